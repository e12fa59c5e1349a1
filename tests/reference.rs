//! The converged references: closed forms, the kernel against its twin, convergence that is as small as it says.

mod common;

use cao::cpu;
use cao::measure::random::Random;
use cao::measure::reference::{self, Plan};
use cao::occlusion::Integral;
use common::*;

/// As coarse as it gets: what is compared has the same directions and steps.
const COARSE: Plan = Plan { directions: 100, steps_per_voxel: 4, max_voxels: 300 };

/// How far f32 may be from f64. Positions round to 6e-8 of coordinates up to 32 on three axes, over which opacity changes by
/// up to 1 a voxel: 6e-6 a sample, independently of each other, so that the transmittance behind n samples is off by √n of
/// them times a step in reference lengths (at most 1/4 at up to 40 samples a voxel of opacity); `log` and `exp` are good to 1e-6.
const ROUNDING: f64 = 2e-5;

#[test]
fn kernel_and_twin_agree() {
    let gpu = open();
    let mut random = Random::new(11);
    for (g, grid) in GRIDS.iter().enumerate() {
        let opacity = opacities(&mut random, grid, if g % 2 == 0 { 0.9 } else { 1.0 });
        let smallest = grid.min_spacing();
        let (radius, offset, reference_mm) = (6.0 * smallest, 0.5 * smallest, 1.3 * smallest);
        for rule in 0..2 {
            let found = match rule {
                0 => reference::ambient(
                    &gpu,
                    grid,
                    &opacity,
                    radius,
                    offset,
                    reference_mm,
                    &COARSE,
                    &mut |_| (),
                ),
                _ => reference::literal(&gpu, grid, &opacity, radius, reference_mm, &COARSE, &mut |_| ()),
            }
            .unwrap();
            let integral = match rule {
                0 => Integral::ambient(radius, offset, 4, 100, smallest),
                _ => Integral::literal(radius, 100, smallest),
            };
            let computed: Vec<usize> = (0..grid.len()).filter(|i| found.counts[*i]).collect();
            let centres: Vec<[f64; 3]> = computed.iter().map(|i| grid.voxel(*i).map(|c| c as f64)).collect();
            let expected = cpu::reference::reference(grid, &opacity, &integral, reference_mm, &centres);
            let worst = computed.iter().zip(&expected).map(|(i, e)| (f64::from(found.ambient[*i]) - e).abs());
            let worst = worst.fold(0.0, |a, b| if b.is_nan() { b } else { a.max(b) });
            assert!(worst < ROUNDING, "{:?} rule {rule}: {worst:e}", grid.dims);
        }
    }
    close(gpu);
}
