//! The kernel `hbao` against its twin.

use cao::image_space::hbao::HbaoShading;
use cao_model::image_space::Hbao;
use cao_testing::image_space::{Rooms, differing, values};
use cao_testing::{close, open};
use cao_twin::image_space::hbao::hbao;

/// Not square, no multiple of a workgroup.
const SIZE: [u32; 2] = [45, 35];

/// Sines of differences of positions of 300 mm in f32, some of a few mm; sums of 7 × 6.
const ROUNDING: f64 = 2e-4;

/// Share of the pixels at which one of 42 steps may fall into the next pixel: positions and sines are off by 1e-4 mm of the 5 mm of a pixel, at each of
/// four borders.
const FLIPPED: f64 = 42.0 * 4.0 * 1e-4 / 5.0;

#[test]
fn horizons_rise_as_the_twin_has_it_in_both_eyes() {
    let gpu = open();
    let kernel = HbaoShading::new(&gpu).unwrap();
    let rooms = Rooms::new(&gpu, SIZE);
    let usual = Hbao { radius_mm: 30.0, directions: 7, bias_deg: 30.0, falloff: true, reach: 0 };
    for settings in [usual, Hbao { falloff: false, bias_deg: 0.0, ..usual }] {
        for (shown, geometry) in rooms.shown.iter().zip(&rooms.geometry) {
            let found =
                values(&gpu, geometry, |rec, _, to| kernel.record(rec, geometry, &settings, to).unwrap());
            for (eye, shown) in shown.iter().enumerate() {
                let expected = hbao(shown, &settings);
                let off = differing(&found[eye], &expected, ROUNDING);
                println!("eye {eye}: {:.4} % differ", 100.0 * off);
                assert!(off <= FLIPPED, "eye {eye}: {off}");
                let occluded = expected.iter().filter(|a| **a < 0.9).count();
                assert!(occluded > 50, "only {occluded} pixels are occluded");
                // The other eye's image and another radius are told apart.
                assert!(differing(&found[1 - eye], &expected, ROUNDING) > 4.0 * FLIPPED);
                let other = hbao(shown, &Hbao { radius_mm: 33.0, ..settings });
                assert!(differing(&found[eye], &other, ROUNDING) > 4.0 * FLIPPED);
            }
        }
    }
    drop((kernel, rooms));
    close(gpu);
}
