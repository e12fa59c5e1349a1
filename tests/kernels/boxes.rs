//! The kernel `boxes` against its twin: closely, for whole numbers and quotients are all that it has, and logarithms where there are shells.

use cao::drive::Take;
use cao::field::Field;
use cao::field::bricks::BrickList;
use cao::field::volume_image;
use cao::tables::boxes::{Bindings, BoxPlan, Boxes};
use cao::tables::sums::Sums;
use cao_gpu::{Access, Format, Gpu};
use cao_kernels::boxes::Shell;
use cao_measure::random::Random;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::Scope;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::tables::boxes::boxes;

/// Half a 65535th that V_AO is rounded to, twice: what quotients and logarithms round.
const ROUNDED: f64 = 1.0 / 65535.0;
/// What fewer bits than V_o's leave of an opacity, seen in the darkest of values: the steepest of them falls by so many
/// reference lengths.
const OF_BITS: f64 = 0.5;

struct State {
    gpu: Gpu,
    field: Field,
    sums: Sums,
    boxes: Boxes,
}

impl State {
    fn new(grid: &Grid) -> Self {
        let gpu = open();
        let field = blank(&gpu, grid);
        Self { sums: Sums::new(&gpu, &field).unwrap(), boxes: Boxes::new(&gpu).unwrap(), field, gpu }
    }

    /// V_AO with 7 in what is not written.
    fn computed(
        &self,
        opacity: &[u16],
        plan: &BoxPlan,
        reference_mm: f32,
        scope: Scope,
        bricks: &[u32],
    ) -> Vec<u16> {
        let Self { gpu, field, sums, boxes } = self;
        let image = |name| volume_image(gpu, name, field, Format::R16Unorm).unwrap();
        let (source, ambient) = (image("test opacity"), image("test ambient"));
        write_image(gpu, &source, bytemuck::cast_slice(opacity));
        write_image(gpu, &ambient, bytemuck::cast_slice(&vec![7_u16; opacity.len()]));
        let list = BrickList::of(gpu, bricks).unwrap();
        let b = Bindings { opacity: &source, table: &sums.table, list: &list, ambient: &ambient };
        run(gpu, |rec| {
            sums.record(rec, field, &source, plan.counted).unwrap();
            boxes.record_shells(rec, plan).unwrap();
            boxes.record(rec, field, plan, reference_mm, scope, b, &Take::All).unwrap();
            rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        });
        bytemuck::pod_collect_to_vec(&read_image(gpu, &ambient))
    }

    fn all(&self) -> Vec<u32> {
        (0..self.field.brick_count()).collect()
    }

    fn close(self) {
        let Self { gpu, field, sums, boxes } = self;
        drop((sums, boxes, field));
        close(gpu);
    }
}

fn settings(quadrature: Quadrature, radius_mm: f32) -> Occlusion {
    Occlusion { rays: RaySet::None, quadrature, radius_mm, ..Occlusion::paper(1.0) }
}

const RULES: [Quadrature; 4] = [Quadrature::Box, Quadrature::Mean, Quadrature::End, Quadrature::Published];

#[test]
fn every_rule_equals_its_twin() {
    let mut random = Random::new(8);
    let mut worst = [0.0_f64; 4];
    for grid in &GRIDS {
        let state = State::new(grid);
        // Radii in smallest spacings, of which some reach far out of every grid and leave few bits.
        for (radius, shells, reference) in
            [(0.4, 16, 1.0), (1.0, 16, 1.0), (5.0, 3, 1.0), (9.3, 64, 2.5), (32.0, 16, 1.0), (60.0, 64, 0.7)]
        {
            let share = random.between(0.1, 1.0);
            let opacity: Vec<u16> = (0..grid.len())
                .map(|_| {
                    let soft = random.below(65536) as u16;
                    if random.between(0.0, 1.0) < share {
                        [0, 65535, soft][random.below(3) as usize]
                    } else {
                        0
                    }
                })
                .collect();
            let floats: Vec<f32> = opacity.iter().map(|&a| f32::from(a) / 65535.0).collect();
            let scope = if random.below(2) == 0 { Scope::Needed } else { Scope::All };
            let radius_mm = (radius * grid.min_spacing()) as f32;
            let reference_mm = reference * grid.min_spacing() as f32;
            for (r, rule) in RULES.into_iter().enumerate() {
                let occlusion = settings(rule, radius_mm);
                let plan = BoxPlan::new(state.field.spacing, &occlusion, shells).unwrap();
                let mut bricks = state.all();
                let found = state.computed(&opacity, &plan, reference_mm, scope, &bricks);
                let expected = boxes(grid, &floats, &occlusion, shells, reference_mm, scope == Scope::All);
                let steep = radius.max(1.0) / f64::from(reference);
                let allowed = ROUNDED
                    + match rule {
                        // Each voxel's extinction is half a level off at most.
                        Quadrature::Published => {
                            let off = |shell: &Shell| f64::from(0.5 * shell.added * shell.share);
                            plan.shells.iter().map(off).sum::<f64>() / f64::from(reference)
                        }
                        _ => OF_BITS * steep / f64::from(plan.counted.levels()),
                    };
                for (i, (f, e)) in found.iter().zip(&expected).enumerate() {
                    let error = (f64::from(*f) / 65535.0 - e).abs();
                    worst[r] = worst[r].max(error / allowed);
                    assert!(error <= allowed, "{occlusion:?} {:?} of {grid:?}: {f} {e}", grid.voxel(i));
                }
                bricks.reverse();
                assert_eq!(found, state.computed(&opacity, &plan, reference_mm, scope, &bricks), "{rule:?}");
            }
        }
        state.close();
    }
    println!("worst, as shares of what is allowed: {worst:?}");
}

#[test]
fn known_answers() {
    let grid = Grid { dims: [33, 33, 40], spacing: [1.0; 3] };
    let state = State::new(&grid);
    let half: Vec<u16> = (0..grid.len()).map(|i| if grid.voxel(i)[2] <= 16 { 65535 } else { 0 }).collect();
    let even = vec![6554_u16; grid.len()];
    let value = |opacity: &[u16], rule, radius, at| {
        let plan = BoxPlan::new(state.field.spacing, &settings(rule, radius), 16).unwrap();
        let found = state.computed(opacity, &plan, 1.0, Scope::Needed, &state.all());
        f64::from(found[grid.index(at)]) / 65535.0
    };
    for (opacity, rule, radius, expected) in [
        (&even, Quadrature::Box, 16.0, 0.9),
        (&even, Quadrature::Mean, 16.0, 0.4833),
        (&even, Quadrature::End, 16.0, 0.9_f64.powi(16)),
        (&half, Quadrature::Box, 16.0, 0.4848),
        (&half, Quadrature::Mean, 16.0, 0.0644),
        (&half, Quadrature::Mean, 0.0, 1.0),
        (&half, Quadrature::Box, 0.0, 1.0),
    ] {
        let found = value(opacity, rule, radius, [16; 3]);
        assert!((found - expected).abs() < 1e-4, "{rule:?} {radius}: {found} {expected}");
    }
    // Not needed, and not listed.
    assert_eq!(value(&half, Quadrature::Box, 16.0, [16, 16, 30]), 1.0);
    let plan = BoxPlan::new(state.field.spacing, &settings(Quadrature::Box, 4.0), 1).unwrap();
    let one = state.computed(&half, &plan, 1.0, Scope::Needed, &[0]);
    assert_eq!((one[grid.index([16; 3])], one[0] == 7), (7, false));
    state.close();
}
