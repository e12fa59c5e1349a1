//! The kernel `sweep_list` against the twin that asks every voxel: what is listed suffices, and is not much more.

mod common;

use cao::cpu::{self, Grid};
use cao::gpu::{Access, BufferUse, Gpu};
use cao::measure::random::Random;
use cao::occlusion::{Occlusion, Quadrature, RaySet};
use cao::stage::field::Field;
use cao::stage::sweep::{SweepPlan, Walk};
use cao::stage::sweep_list::{HEAD_BYTES, SweepList, SweepLists};
use common::*;
use std::collections::BTreeSet;

/// Heads in a list.
const HEADS: usize = 54;
/// Chunks listed for one that has to be: the kernel bounds a skewed tile by boxes a brick high. At most 1.08 was seen.
const TOO_MANY: f64 = 1.25;

/// Runs of each walk: tile, chunks from … to.
fn runs(gpu: &Gpu, field: &Field, plan: &SweepPlan, todo: &[u32]) -> Vec<Vec<[usize; 3]>> {
    let todo = buffer(gpu, "todo", bytemuck::cast_slice(todo));
    let lists = SweepLists::new(gpu, plan).unwrap();
    let kernel = SweepList::new(gpu).unwrap();
    let bytes = lists.list.bytes();
    let back = gpu.buffer("read-back", bytes, BufferUse::Readback).unwrap();
    run(gpu, |rec| {
        kernel.record(rec, field, plan, &todo, &lists).unwrap();
        rec.copy_buffer(&lists.list, 0, &back, 0, bytes).unwrap();
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    });
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(&back.read(0, bytes).unwrap());
    let head_words = HEAD_BYTES as usize / 4;
    let list = &words[HEADS * head_words..];
    let walk = |(k, walk): (usize, &Walk)| {
        let head = &words[k * head_words..][..head_words];
        let (count, at) = (head[3], head[4]);
        assert!(count <= walk.runs, "{count} runs, room for {}", walk.runs);
        assert_eq!([head[0], head[1], head[2]], [count, u32::from(count > 0), 1], "indirect arguments");
        let run = |r: u32| {
            let run = &list[3 * (at + r) as usize..];
            [run[0], run[1], run[1] + run[2]].map(|x| x as usize)
        };
        (0..count).map(run).collect()
    };
    plan.walks.iter().enumerate().map(walk).collect()
}

#[test]
fn what_is_listed_suffices_and_is_not_much_more() {
    let gpu = open();
    let mut random = Random::new(47);
    let extra = [Grid { dims: [37, 29, 50], spacing: [1.0; 3] }, Grid { dims: [64; 3], spacing: [1.0; 3] }];
    for grid in GRIDS.iter().chain(&extra) {
        let field = blank(&gpu, grid);
        for (rays, voxels) in [(RaySet::W26, 3.0), (RaySet::W26, 14.0), (RaySet::W50, 9.0)] {
            let occlusion = Occlusion {
                rays,
                quadrature: Quadrature::Segment,
                radius_mm: voxels * grid.min_spacing() as f32,
                offset_mm: None,
                step_mm: None,
            };
            let plan = SweepPlan::new(field.dims, grid.spacing, &occlusion).unwrap();
            for share in [0, 2, 20, 100] {
                let todo: Vec<u32> =
                    (0..field.brick_count()).map(|_| u32::from(random.below(100) < share)).collect();
                let bricks = cpu::bricks::bricks(grid);
                let (mut listed, mut needed) = (0, 0);
                for (walk, runs) in plan.walks.iter().zip(runs(&gpu, &field, &plan, &todo)) {
                    let size = walk.window.min(8) as usize;
                    let lag = walk.window as usize / size + 1;
                    let wanted =
                        cpu::sweep_list::sweep_list(grid.dims, walk.ray.step, walk.axis, size, |voxel| {
                            todo[bricks.index(voxel.map(|c| c / 8))] == 1
                        });
                    for &(tile, chunk) in &wanted {
                        // One run holds the chunk and those in which its voxels' rays backwards are found.
                        let holds =
                            |run: &&[usize; 3]| run[0] == tile && run[1] <= chunk && chunk + lag < run[2];
                        assert_eq!(runs.iter().filter(holds).count(), 1, "{tile} {chunk} of {walk:?}");
                    }
                    let mut seen = BTreeSet::new();
                    for [tile, first, end] in runs {
                        assert!((first..end).all(|chunk| seen.insert((tile, chunk))), "twice: {walk:?}");
                    }
                    listed += seen.len();
                    needed += wanted
                        .iter()
                        .flat_map(|&(tile, chunk)| (chunk..=chunk + lag).map(move |c| (tile, c)))
                        .collect::<BTreeSet<_>>()
                        .len();
                }
                assert_eq!(listed == 0, needed == 0, "nothing is listed where nothing is to do");
                let ratio = listed as f64 / needed.max(1) as f64;
                println!("{:?} {} {voxels} {share} %: {ratio:.2}", grid.dims, rays.name());
                assert!(ratio <= TOO_MANY, "{grid:?} {occlusion:?} {share} %: {listed} for {needed}");
            }
        }
        drop(field);
    }
    close(gpu);
}
