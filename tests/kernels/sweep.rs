//! The kernels `sweep` and `sweep_list` against the twin that evaluates every window directly (method.md §4).

use cao::field::Field;
use cao::field::volume_image;
use cao::sweep::near::{ANEW, CHANGED, Chosen, TODO};
use cao::sweep::sweep::{Bindings, Pass, Sweep, SweepPlan};
use cao::sweep::sweep_list;
use cao::sweep::sweep_list::{SweepList, SweepLists};
use cao_gpu::{Access, Buffer, Format, Gpu, Image};
use cao_measure::random::Random;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_testing::*;
use cao_twin as twin;
use cao_twin::Grid;

/// Each ray's contribution is rounded to 1/65535 once: half a unit, times the rays, is the worst.
const ROUNDING: f64 = 0.5 / 65535.0;
/// Rounding of `exp` and `log` along a ray, and of a segment's closed form, relative; see `kernels::lao`.
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

    /// Walks what the words of `todo` ask for.
    fn run(&self, field: &Field, plan: &SweepPlan, passes: &[(Pass, &State)], todo: &[u32], ambient: &Image) {
        let lists = SweepLists::new(self.gpu, plan).unwrap();
        let everywhere = Chosen { bricks: 0, low: [0; 6], high: [1000; 6] };
        let chosen = buffer(self.gpu, "chosen", bytemuck::bytes_of(&everywhere));
        let todo = &buffer(self.gpu, "todo", bytemuck::cast_slice(todo));
        run(self.gpu, |rec| {
            for (pass, state) in passes {
                let b = sweep_list::Bindings { todo, chosen: &chosen, lists: &lists };
                self.lists.record(rec, field, plan, *pass != Pass::Anew, b).unwrap();
                for index in 0..plan.walks.len() {
                    let (opacity, solid) = (&state.image, &state.solid);
                    let b = Bindings { opacity, list: &lists.list, todo, solid, ambient };
                    self.sweep.record(rec, field, plan, index, *pass, REFERENCE_MM, b).unwrap();
                    rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
                }
            }
        });
    }

    /// Everything anew.
    fn full(&self, field: &Field, plan: &SweepPlan, state: &State) -> Image {
        let ambient = filled(self.gpu, field, 7);
        let todo = vec![TODO | ANEW; field.brick_count() as usize];
        self.run(field, plan, &[(Pass::Anew, state)], &todo, &ambient);
        ambient
    }
}

const REFERENCE_MM: f32 = 0.9;

/// Opacities as 16-bit texels, and what these hold.
struct State {
    image: Image,
    solid: Buffer,
    held: Vec<u16>,
}

impl State {
    fn new(gpu: &Gpu, field: &Field, grid: &Grid, opacity: &[f32]) -> Self {
        let held: Vec<u16> = opacity.iter().map(|a| (a * 65535.0).round() as u16).collect();
        let image = volume_image(gpu, "test opacity", field, Format::R16Unorm).unwrap();
        write_image(gpu, &image, bytemuck::cast_slice(&held));
        let solid = buffer(gpu, "solid", bytemuck::cast_slice(&twin::sweep::near::solid(grid, &held)));
        Self { image, solid, held }
    }

    fn opacity(&self) -> Vec<f32> {
        self.held.iter().map(|&s| f32::from(s) / 65535.0).collect()
    }
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

#[test]
fn every_window_equals_its_direct_evaluation() {
    let gpu = open();
    let bench = Bench::new(&gpu);
    let mut random = Random::new(41);
    let extra =
        [Grid { dims: [33, 7, 21], spacing: [1.0; 3] }, Grid { dims: [5, 26, 40], spacing: [1.0; 3] }];
    for grid in GRIDS.iter().chain(&extra) {
        let field = blank(&gpu, grid);
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
                let state = State::new(&gpu, &field, grid, &opacities(&mut random, grid, largest));
                let expected =
                    twin::sweep::sweep::sweep(grid, &state.opacity(), &occlusion, f64::from(REFERENCE_MM));
                let plan = SweepPlan::new(field.dims, grid.spacing, &occlusion).unwrap();
                let ambient = bench.full(&field, &plan, &state);
                let tolerance = ROUNDING * 2.0 * plan.walks.len() as f64 + FUNCTIONS;
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
    let state = State::new(&gpu, &field, &grid, &opacities(&mut random, &grid, 0.4));
    for (rays, radius) in [(RaySet::W26, 6.0), (RaySet::W50, 9.0), (RaySet::W26, 40.0), (RaySet::R6, 1.0)] {
        let plan = SweepPlan::new(field.dims, grid.spacing, &settings(rays, radius, None, None)).unwrap();
        let full = stored(&gpu, &bench.full(&field, &plan, &state));
        for share in [0, 3, 30, 80] {
            // Bricks that changed or have a value are none of its business.
            let words: Vec<u32> = (0..field.brick_count())
                .map(|_| {
                    if random.below(100) < share {
                        TODO | ANEW
                    } else {
                        [0, TODO, CHANGED][share as usize % 3]
                    }
                })
                .collect();
            let ambient = filled(&gpu, &field, 12345);
            bench.run(&field, &plan, &[(Pass::Anew, &state)], &words, &ambient);
            for (i, found) in stored(&gpu, &ambient).into_iter().enumerate() {
                let brick = twin::field::bricks::bricks(&grid).index(grid.voxel(i).map(|c| c / 8));
                let expected = if words[brick] & ANEW != 0 { full[i] } else { 12345 };
                assert_eq!(found, expected, "{:?}, {share} %, {rays:?}", grid.voxel(i));
            }
        }
    }
    drop((bench, state, field));
    close(gpu);
}

/// Opacities in a few bricks only: segments that meet none are not looked at, and give what looking gives.
#[test]
fn empty_bricks_are_passed_over_without_a_difference() {
    let gpu = open();
    let bench = Bench::new(&gpu);
    let mut random = Random::new(44);
    let grid = Grid { dims: [44, 37, 50], spacing: [1.0; 3] };
    let field = blank(&gpu, &grid);
    for (rays, radius, step) in [
        (RaySet::W26, 6.0, None),
        (RaySet::W50, 19.0, None),
        (RaySet::R54, 9.0, Some(9.0)),
        (RaySet::R6, 30.0, None),
    ] {
        let filled: Vec<bool> = (0..field.brick_count()).map(|_| random.below(100) < 8).collect();
        let bricks = twin::field::bricks::bricks(&grid);
        let mut opacity = opacities(&mut random, &grid, 0.7);
        for (i, a) in opacity.iter_mut().enumerate() {
            if !filled[bricks.index(grid.voxel(i).map(|c| c / 8))] {
                *a = 0.0;
            }
        }
        let mut state = State::new(&gpu, &field, &grid, &opacity);
        let plan = SweepPlan::new(field.dims, grid.spacing, &settings(rays, radius, None, step)).unwrap();
        let passed_over = stored(&gpu, &bench.full(&field, &plan, &state));
        state.solid = buffer(&gpu, "solid", &vec![255; 4 * bricks.len()]);
        assert!(passed_over == stored(&gpu, &bench.full(&field, &plan, &state)), "{rays:?}");
        // The other way round it would be seen.
        state.solid = buffer(&gpu, "empty", &vec![0; 4 * bricks.len()]);
        assert!(passed_over != stored(&gpu, &bench.full(&field, &plan, &state)), "{rays:?}");
    }
    drop((bench, field));
    close(gpu);
}

/// Edits of a few voxels: what their rays contributed before is taken back, what they contribute now added, and the bits are
/// those of a full sweep.
#[test]
fn amending_gives_the_bits_of_a_full_sweep() {
    let gpu = open();
    let bench = Bench::new(&gpu);
    let mut random = Random::new(45);
    for grid in
        [Grid { dims: [44, 37, 50], spacing: [1.0; 3] }, Grid { dims: [21, 9, 70], spacing: [1.0, 0.8, 1.7] }]
    {
        let field = blank(&gpu, &grid);
        let bricks = twin::field::bricks::bricks(&grid);
        for (rays, radius) in
            [(RaySet::W26, 6.0), (RaySet::W50, 14.0), (RaySet::W26, 40.0), (RaySet::R6, 1.0)]
        {
            let plan = SweepPlan::new(field.dims, grid.spacing, &settings(rays, radius, None, None)).unwrap();
            let mut opacity = opacities(&mut random, &grid, 0.6);
            opacity.iter_mut().for_each(|a| {
                if random.below(3) > 0 {
                    *a = 0.0
                }
            });
            let mut before = State::new(&gpu, &field, &grid, &opacity);
            let mut expected = stored(&gpu, &bench.full(&field, &plan, &before));
            let mut differ = 0;
            for edit in 0..6 {
                for _ in 0..1 + edit * edit {
                    let at = random.below(grid.len() as u64) as usize;
                    opacity[at] = if random.below(2) == 0 { 0.0 } else { random.between(0.0, 1.0) };
                }
                let now = State::new(&gpu, &field, &grid, &opacity);
                let full = stored(&gpu, &bench.full(&field, &plan, &now));
                let octants = twin::sweep::carve::changed(&grid, &before.held, &now.held);
                // A few bricks have no value: they keep what they hold.
                let words: Vec<u32> = octants
                    .iter()
                    .map(|o| (o * CHANGED) | [TODO, TODO, TODO, TODO | ANEW][random.below(4) as usize])
                    .collect();
                let ambient = filled(&gpu, &field, 0);
                write_image(&gpu, &ambient, bytemuck::cast_slice(&expected));
                let passes = [(Pass::TakeBack, &before), (Pass::Amend, &now)];
                bench.run(&field, &plan, &passes, &words, &ambient);
                let found = stored(&gpu, &ambient);
                for i in 0..grid.len() {
                    let amended = words[bricks.index(grid.voxel(i).map(|c| c / 8))] & ANEW == 0;
                    assert_eq!(
                        found[i],
                        if amended { full[i] } else { expected[i] },
                        "{:?} {rays:?}",
                        grid.voxel(i)
                    );
                    differ += u32::from(full[i] != expected[i]);
                }
                (before, expected) = (now, full);
            }
            assert!(differ > 20, "the edits hardly changed a value: {differ}");
        }
        drop(field);
    }
    drop(bench);
    close(gpu);
}
