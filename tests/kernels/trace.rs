//! The kernel `trace` against its twin, and in pieces.

use cao::mesh::ambient::{ByRays, PixelAmbient, Pixels as On};
use cao_gpu::Access;
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
    let accessibility = pixels.values(&gpu);
    let (surfaces, geometry) = (&pixels.surfaces, &pixels.geometry);
    let on = On { gpu: &gpu, geometry, surfaces, delta_mm: DELTA };
    let traced_by = |rays: u32| {
        let method = ByRays::walks(&gpu, rays).unwrap();
        for part in 0..method.parts(&on) {
            run(&gpu, |rec| {
                rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
                method.record(rec, &on, part, &accessibility).unwrap();
            });
        }
        (floats(&gpu, &accessibility), method.parts(&on))
    };
    let (found, parts) = traced_by(512);
    assert!(parts > 1, "all at once");
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
    let fewer = [16, 128].map(|rays| rms(&traced_by(rays).0, &found));
    assert!(fewer[1] < 0.3 * fewer[0], "{fewer:?}");
    drop((pixels, accessibility));
    close(gpu);
}
