//! The kernel `trace` against its twin, and in pieces.

use cao::mesh::trace::Trace;
use cao_testing::worlds::{Pixels, clips, corner, corner_eyes, floats};
use cao_testing::*;
use cao_twin::mesh::gbuffer::gbuffer;
use cao_twin::mesh::trace::traced;

/// No multiple of a workgroup.
const SIZE: [u32; 2] = [37, 27];
const DELTA: f32 = 40.0;
/// Rays of the twin, along an edge of their grid, at each pixel of every so many.
const EDGE: u32 = 24;
const EVERY: usize = 11;

/// Mean of |difference| of two estimates by 576 and 512 rays each whose hits vary by less than one half: of random rays it would be
/// below 0.5/√512 = .022, and both sequences do better.
const MEAN: f64 = 0.01;

#[test]
fn rays_give_what_the_twin_integrates() {
    let gpu = open();
    let (world, views, clips) = (corner(), corner_eyes(SIZE), &clips()[..1]);
    let pixels = Pixels::clipped(&gpu, &world, clips, &views, SIZE);
    let (trace, accessibility) = (Trace::new(&gpu).unwrap(), pixels.values(&gpu));
    let run = |all: u32, to| {
        let mut progress = Vec::new();
        let (surfaces, geometry) = (&pixels.surfaces, &pixels.geometry);
        trace.run(&gpu, surfaces, geometry, DELTA, all, to, &mut |share| progress.push(share)).unwrap();
        assert_eq!(progress.last(), Some(&1.0));
    };
    run(512, &accessibility);
    let found = floats(&gpu, &accessibility);
    let (mut sum, mut bias, mut count) = (0.0, 0.0, 0.0);
    for (view, eye) in views.iter().enumerate() {
        for (i, shown) in gbuffer(&world, clips, eye, SIZE).into_iter().enumerate().step_by(EVERY) {
            let found = f64::from(found[view * (SIZE[0] * SIZE[1]) as usize + i]);
            let Some(shown) = shown else {
                assert_eq!(found, 1.0);
                continue;
            };
            let expected = 1.0 - traced(&world, clips, shown.place, shown.normal, f64::from(DELTA), EDGE);
            (sum, bias, count) = (sum + (found - expected).abs(), bias + found - expected, count + 1.0);
        }
    }
    assert!(count > 80.0 && sum / count < MEAN, "mean difference {} of {count}", sum / count);
    assert!((bias / count).abs() < 0.3 * MEAN, "bias {}", bias / count);
    // More rays are nearer to more rays: it converges.
    let rms = |a: &[f32], b: &[f32]| {
        (a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
    };
    let fewer: Vec<f64> = [16, 128]
        .map(|rays| {
            run(rays, &accessibility);
            rms(&floats(&gpu, &accessibility), &found)
        })
        .to_vec();
    assert!(fewer[1] < 0.3 * fewer[0], "{fewer:?}");
    drop((pixels, accessibility));
    close(gpu);
}
