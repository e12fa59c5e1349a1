//! The kernels `sweep` and `sweep_list` against the twin that evaluates every window directly (method.md §4).

mod common;

use cao::cpu::{self, Grid};
use cao::gpu::{Access, Buffer, Format, Gpu, Image};
use cao::measure::random::Random;
use cao::method::volumes::volume_image;
use cao::occlusion::{Occlusion, Quadrature, RaySet};
use cao::stage::field::Field;
use cao::stage::sweep::{Sweep, SweepPlan};
use cao::stage::sweep_list::{SweepList, SweepLists};
use common::*;

/// Each direction's contribution is rounded to 1/65535 once: half a unit, times the directions, is the worst.
const ROUNDING: f64 = 0.5 / 65535.0;
/// Rounding of `exp` and `log` along a ray, and of a segment's closed form, relative; see tests/lao.rs.
const FUNCTIONS: f64 = 1e-5;

struct Bench<'a> {
    gpu: &'a Gpu,
    sweep: Sweep,
    lists: SweepList,
}

impl<'a> Bench<'a> {
    fn new(gpu: &'a Gpu) -> Self {
        Self { gpu, sweep: Sweep::new(gpu).unwrap(), lists: SweepList::new(gpu).unwrap() }
    }

    fn run(
        &self,
        field: &Field,
        plan: &SweepPlan,
        reference_mm: f32,
        opacity: &Image,
        todo: &Buffer,
        ambient: &Image,
    ) {
        let lists = SweepLists::new(self.gpu, plan).unwrap();
        run(self.gpu, |rec| {
            self.lists.record(rec, field, plan, todo, &lists).unwrap();
            for index in 0..plan.walks.len() {
                self.sweep
                    .record(rec, field, plan, index, reference_mm, opacity, &lists.list, todo, ambient)
                    .unwrap();
                rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
            }
        });
    }
}

/// Opacities as 16-bit texels, and what these hold.
fn texels(gpu: &Gpu, field: &Field, opacity: &[f32]) -> (Image, Vec<f32>) {
    let stored: Vec<u16> = opacity.iter().map(|a| (a * 65535.0).round() as u16).collect();
    let image = volume_image(gpu, "test opacity", field, Format::R16Unorm).unwrap();
    write_image(gpu, &image, bytemuck::cast_slice(&stored));
    (image, stored.iter().map(|&s| f32::from(s) / 65535.0).collect())
}

fn filled(gpu: &Gpu, field: &Field, value: u16) -> Image {
    let image = volume_image(gpu, "test ambient", field, Format::R16Unorm).unwrap();
    let voxels = field.dims.iter().product::<u32>() as usize;
    write_image(gpu, &image, bytemuck::cast_slice(&vec![value; voxels]));
    image
}

fn stored(gpu: &Gpu, image: &Image) -> Vec<u16> {
    bytemuck::pod_collect_to_vec(&read_image(gpu, image))
}

fn settings(rays: RaySet, radius_mm: f32, offset_mm: Option<f32>, step_mm: Option<f32>) -> Occlusion {
    Occlusion { rays, quadrature: Quadrature::Segment, radius_mm, offset_mm, step_mm }
}

fn all_todo(gpu: &Gpu, field: &Field) -> Buffer {
    buffer(gpu, "todo", bytemuck::cast_slice(&vec![1_u32; field.brick_count() as usize]))
}

#[test]
fn every_window_equals_its_direct_evaluation() {
    let gpu = open();
    let bench = Bench::new(&gpu);
    let mut random = Random::new(41);
    let extra =
        [Grid { dims: [33, 7, 21], spacing: [1.0; 3] }, Grid { dims: [5, 26, 40], spacing: [1.0; 3] }];
    for grid in GRIDS.iter().chain(&extra) {
        let field = blank(&gpu, grid);
        let todo = all_todo(&gpu, &field);
        let smallest = grid.min_spacing() as f32;
        for (rays, radius, offset, step) in [
            (RaySet::R6, 5.0, None, None),
            (RaySet::W26, 4.3, None, None),
            (RaySet::W26, 1.0, Some(0.0), None),
            (RaySet::R26, 9.0, Some(0.2), Some(0.6)),
            (RaySet::W50, 12.0, None, None),
            (RaySet::R54, 8.0, None, Some(1.45)),
        ] {
            let occlusion =
                settings(rays, radius * smallest, offset.map(|o| o * smallest), step.map(|s| s * smallest));
            for largest in [0.3, 1.0] {
                let (image, held) = texels(&gpu, &field, &opacities(&mut random, grid, largest));
                let expected = cpu::sweep::sweep(grid, &held, &occlusion, 0.9);
                let plan = SweepPlan::new(field.dims, grid.spacing, &occlusion).unwrap();
                let ambient = filled(&gpu, &field, 7);
                bench.run(&field, &plan, 0.9, &image, &todo, &ambient);
                let tolerance = ROUNDING * plan.walks.len() as f64 + FUNCTIONS;
                for (i, (found, expected)) in stored(&gpu, &ambient).into_iter().zip(expected).enumerate() {
                    let found = f64::from(found) / 65535.0;
                    assert!(
                        (found - expected).abs() <= tolerance,
                        "{:?} of {grid:?}, {occlusion:?}: {found}, expected {expected}",
                        grid.voxel(i)
                    );
                }
            }
        }
    }
    drop(bench);
    close(gpu);
}

/// Random sets of bricks: the same bits where a brick is to do, nothing touched elsewhere.
#[test]
fn a_sparse_sweep_gives_the_bits_of_a_full_one_and_touches_nothing_else() {
    let gpu = open();
    let bench = Bench::new(&gpu);
    let mut random = Random::new(43);
    let grid = Grid { dims: [37, 29, 50], spacing: [1.0; 3] };
    let field = blank(&gpu, &grid);
    let (image, _) = texels(&gpu, &field, &opacities(&mut random, &grid, 0.4));
    for (rays, radius) in [(RaySet::W26, 6.0), (RaySet::W50, 9.0), (RaySet::W26, 40.0), (RaySet::R6, 1.0)] {
        let plan = SweepPlan::new(field.dims, grid.spacing, &settings(rays, radius, None, None)).unwrap();
        let full = filled(&gpu, &field, 0);
        bench.run(&field, &plan, 1.0, &image, &all_todo(&gpu, &field), &full);
        let full = stored(&gpu, &full);
        for share in [0, 3, 30, 80] {
            let flags: Vec<u32> =
                (0..field.brick_count()).map(|_| u32::from(random.below(100) < share)).collect();
            let ambient = filled(&gpu, &field, 12345);
            bench.run(
                &field,
                &plan,
                1.0,
                &image,
                &buffer(&gpu, "todo", bytemuck::cast_slice(&flags)),
                &ambient,
            );
            for (i, found) in stored(&gpu, &ambient).into_iter().enumerate() {
                let brick = cpu::bricks::bricks(&grid).index(grid.voxel(i).map(|c| c / 8));
                let expected = if flags[brick] == 1 { full[i] } else { 12345 };
                assert_eq!(found, expected, "{:?}, {share} %, {rays:?}", grid.voxel(i));
            }
        }
    }
    drop((bench, image, field));
    close(gpu);
}
