//! The kernel `volumes`, which draws, against `gather`, which looks its volumes up.

use cao::mesh::ambient::{ByVolumes, PixelAmbient, Pixels as On};
use cao::mesh::volumes::Volumes;
use cao_gpu::{Access, Gpu};
use cao_model::surface::World;
use cao_testing::worlds::{Pixels, corner, corner_eyes, floats};
use cao_testing::*;

const SIZE: [u32; 2] = [61, 45];

/// Sums of the same numbers in another order.
const ROUNDING: f32 = 1e-5;

/// Share of pixels where a volume is missed or taken whose side passes within rounding.
const OTHER: f64 = 2e-3;

fn occlusion(gpu: &Gpu, pixels: &Pixels, delta_mm: f32, method: &mut dyn PixelAmbient) -> Vec<f32> {
    let on = On { gpu, geometry: &pixels.geometry, surfaces: &pixels.surfaces, delta_mm };
    let accessibility = pixels.values(gpu);
    method.prepare(&on).unwrap();
    for part in 0..method.parts(&on) {
        run(gpu, |rec| {
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
            method.record(rec, &on, part, &accessibility).unwrap();
        });
    }
    floats(gpu, &accessibility)
}

fn others(world: &World, delta: f32, clamped: bool) -> f64 {
    let gpu = open();
    let pixels = Pixels::new(&gpu, world, &corner_eyes(SIZE), SIZE);
    let expected = occlusion(&gpu, &pixels, delta, &mut ByVolumes::new(&gpu, 1, clamped).unwrap());
    let mut worst = 0.0f64;
    for is_static in [false, true] {
        let found = occlusion(&gpu, &pixels, delta, &mut Volumes::new(&gpu, is_static, clamped).unwrap());
        let other = found.iter().zip(&expected).filter(|(a, b)| (**a - **b).abs() > ROUNDING).count();
        worst = worst.max(other as f64 / found.len() as f64);
    }
    assert!(expected.iter().any(|value| *value < 0.5), "nothing is dark");
    drop(pixels);
    close(gpu);
    worst
}

#[test]
fn what_is_drawn_is_what_is_gathered() {
    for (delta, clamped) in [(6.0, false), (40.0, false), (40.0, true)] {
        let other = others(&corner(), delta, clamped);
        assert!(other < OTHER, "delta {delta}, clamped {clamped}: {other}");
    }
}

#[test]
fn eyes_inside_volumes_see_them() {
    // Volumes of 150 mm hold both eyes, and all of the room.
    let other = others(&corner(), 150.0, false);
    assert!(other < OTHER, "{other}");
}
