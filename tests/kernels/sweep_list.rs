//! The kernel `sweep_list` against the twin that asks every voxel: what is listed suffices, and is not much more.

use cao::sweep::near::{ANEW, CHANGED, Chosen, TODO};
use cao::sweep::sweep::{SweepPlan, Walk};
use cao::sweep::sweep_list::{Bindings, HEAD_BYTES, SweepList, SweepLists};
use cao_gpu::{Access, BufferUse, Gpu};
use cao_measure::random::Random;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_testing::*;
use cao_twin as twin;
use cao_twin::Grid;
use std::collections::BTreeSet;

/// Heads in a list.
const HEADS: usize = 54;
/// Chunks listed for one that has to be: the kernel bounds a skewed tile by boxes a cell high, and where voxels beside a line count,
/// by boxes that reach a step further. At most 1.18 and 1.98 were seen.
const TOO_MANY: [f64; 2] = [1.25, 2.25];

/// Voxels between two lattice points: those of the box that has them as corners.
fn box_between(grid: &Grid, a: [usize; 3], b: [i32; 3]) -> Vec<[usize; 3]> {
    let range = |axis: usize| {
        let (a, b) = (a[axis] as i32, b[axis]);
        (a.min(b).max(0) as usize, a.max(b).min(grid.dims[axis] as i32 - 1) as usize)
    };
    let ([x, y, z], mut found) = ([0, 1, 2].map(range), Vec::new());
    for k in z.0..=z.1 {
        for j in y.0..=y.1 {
            found.extend((x.0..=x.1).map(|i| [i, j, k]));
        }
    }
    found
}

/// Runs of each walk: tile, chunks from … to.
fn runs(gpu: &Gpu, grid: &Grid, plan: &SweepPlan, amend: bool, todo: &[u32]) -> Vec<Vec<[usize; 3]>> {
    let field = &blank(gpu, grid);
    let chosen = buffer(gpu, "chosen", bytemuck::bytes_of(&bounds(grid, todo)));
    let todo = buffer(gpu, "todo", bytemuck::cast_slice(todo));
    let lists = SweepLists::new(gpu, plan).unwrap();
    let kernel = SweepList::new(gpu).unwrap();
    let bytes = lists.list.bytes();
    let back = gpu.buffer("read-back", bytes, BufferUse::Readback).unwrap();
    run(gpu, |rec| {
        kernel
            .record(rec, field, plan, amend, Bindings { todo: &todo, chosen: &chosen, lists: &lists })
            .unwrap();
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

/// Of the bricks to compute anew and of those that changed.
fn bounds(grid: &Grid, todo: &[u32]) -> Chosen {
    let mut chosen = Chosen { bricks: 0, low: [u32::MAX; 6], high: [0; 6] };
    let bricks = twin::field::bricks::bricks(grid);
    for (i, word) in todo.iter().enumerate() {
        for (axis, place) in bricks.voxel(i).into_iter().enumerate() {
            let kinds = [(word & ANEW != 0, axis), (word / CHANGED != 0, 3 + axis)];
            for (_, at) in kinds.into_iter().filter(|kind| kind.0) {
                chosen.low[at] = chosen.low[at].min(place as u32);
                chosen.high[at] = chosen.high[at].max(place as u32);
            }
        }
    }
    chosen
}

#[test]
fn what_is_listed_suffices_and_is_not_much_more() {
    let gpu = open();
    let mut random = Random::new(47);
    let extra = [Grid { dims: [37, 29, 50], spacing: [1.0; 3] }, Grid { dims: [64; 3], spacing: [1.0; 3] }];
    for grid in GRIDS.iter().chain(&extra) {
        let dims = grid.dims.map(|d| d as u32);
        for (rays, voxels) in [(RaySet::W26, 3.0), (RaySet::W26, 14.0), (RaySet::W50, 9.0)] {
            let occlusion = Occlusion {
                rays,
                quadrature: Quadrature::Segment,
                radius_mm: voxels * grid.min_spacing() as f32,
                offset_mm: None,
                step_mm: None,
            };
            let plan = SweepPlan::new(dims, grid.spacing, &occlusion).unwrap();
            let bricks = twin::field::bricks::bricks(grid);
            for (share, amend) in [0, 2, 20, 100].into_iter().flat_map(|s| [(s, false), (s, true)]) {
                // Bricks of the other kind, beside them, are not listed.
                let mut hit = |share: u64| random.below(100) < share;
                let todo: Vec<u32> = (0..bricks.len())
                    .map(|_| match amend {
                        false => {
                            let anew = if hit(share) { TODO | ANEW } else { 0 };
                            anew | if hit(20) { 255 * CHANGED } else { 0 }
                        }
                        true => {
                            let octants: u32 = (0..8).map(|o| u32::from(hit(share)) << o).sum();
                            (octants * CHANGED) | if hit(20) { TODO | ANEW } else { 0 }
                        }
                    })
                    .collect();
                let (mut listed, mut needed) = ([0; 2], [0; 2]);
                for (walk, runs) in plan.walks.iter().zip(runs(&gpu, grid, &plan, amend, &todo)) {
                    let size = walk.window.min(8) as usize;
                    let lag = walk.window as usize / size + 1;
                    let word = |voxel: [usize; 3]| todo[bricks.index(voxel.map(|c| c / 8))];
                    let changed = |voxel: [usize; 3]| {
                        let [x, y, z] = voxel.map(|c| c / 4 % 2);
                        word(voxel) & CHANGED << (x + 2 * y + 4 * z) != 0
                    };
                    // Samples between two lattice points interpolate voxels of the box between them.
                    let meets = |voxel: [usize; 3]| {
                        if walk.pieces == 1 {
                            return changed(voxel);
                        }
                        let end = |way: i32| -> [i32; 3] {
                            std::array::from_fn(|axis| voxel[axis] as i32 + way * walk.ray.step[axis])
                        };
                        let outside = |p: [i32; 3]| (0..3).any(|a| p[a] < 0 || p[a] >= grid.dims[a] as i32);
                        // A ray backwards that leaves the volume has a segment of its own.
                        let ends = [Some(end(1)), Some(end(-1)).filter(|p| outside(*p))];
                        ends.into_iter()
                            .flatten()
                            .any(|p| box_between(grid, voxel, p).into_iter().any(changed))
                    };
                    let wanted =
                        twin::sweep::sweep_list::sweep_list(grid.dims, walk.ray.step, walk.axis, |voxel| {
                            if amend { meets(voxel) } else { word(voxel) & ANEW != 0 }
                        });
                    // The rays that begin or meet there, forwards and backwards, begin up to a window and a step before.
                    let chunks = |step: usize| {
                        (step + lag * size - walk.window as usize - 1) / size..=step / size + lag
                    };
                    for &(tile, step) in &wanted {
                        let (begin, end) = chunks(step).into_inner();
                        let holds = |run: &&[usize; 3]| run[0] == tile && run[1] <= begin && end < run[2];
                        assert_eq!(runs.iter().filter(holds).count(), 1, "{tile} {step} of {walk:?}");
                    }
                    if amend {
                        // Rays backwards that a run amends begin up to `lag` chunks behind it.
                        for (a, b) in runs.iter().flat_map(|a| runs.iter().map(move |b| (a, b))) {
                            let behind = a[0] == b[0] && b[1] >= a[2];
                            assert!(!behind || b[1] >= a[2] + lag, "{a:?} {b:?} {walk:?}");
                        }
                    }
                    let mut seen = BTreeSet::new();
                    for [tile, first, end] in runs {
                        assert!((first..end).all(|chunk| seen.insert((tile, chunk))), "twice: {walk:?}");
                    }
                    let mut least: BTreeSet<(usize, usize)> = (wanted.iter())
                        .flat_map(|&(tile, step)| chunks(step).map(move |c| (tile, c)))
                        .collect();
                    if amend {
                        // Runs that would lie too near to each other are one.
                        let before: Vec<_> = least.iter().copied().collect();
                        for pair in before.windows(2).filter(|p| p[0].0 == p[1].0 && p[1].1 <= p[0].1 + lag) {
                            least.extend((pair[0].1..pair[1].1).map(|c| (pair[0].0, c)));
                        }
                    }
                    assert_eq!(seen.is_empty(), least.is_empty(), "nothing is listed where nothing is to do");
                    let kind = usize::from(amend && walk.pieces > 1);
                    listed[kind] += seen.len();
                    needed[kind] += least.len();
                }
                for kind in 0..2 {
                    let ratio = listed[kind] as f64 / needed[kind].max(1) as f64;
                    println!("{:?} {} {voxels} {share} % {amend} {kind}: {ratio:.2}", grid.dims, rays.name());
                    assert!(ratio <= TOO_MANY[kind], "{grid:?} {occlusion:?} {share} %: {ratio}");
                }
            }
        }
    }
    close(gpu);
}
