//! The kernel `volumetric` against its twin.

use cao::image_space::volumetric::VolumetricShading;
use cao_model::image_space::Volumetric;
use cao_testing::image_space::{Rooms, differing, values};
use cao_testing::{close, open};
use cao_twin::image_space::volumetric::volumetric;

/// Not square, no multiple of a workgroup.
const SIZE: [u32; 2] = [45, 35];

/// Depths of 300 mm in f32 against chords of some 10 mm, sums of 24.
const ROUNDING: f64 = 1e-4;

/// Share of the pixels at which one of 24 lines may fall into the next pixel: positions and sines are off by 1e-4 mm of the 5 mm of a pixel, at each of
/// four borders.
const FLIPPED: f64 = 24.0 * 4.0 * 1e-4 / 5.0;

#[test]
fn balls_are_filled_as_the_twin_has_it_in_both_eyes() {
    let gpu = open();
    let kernel = VolumetricShading::new(&gpu).unwrap();
    let rooms = Rooms::new(&gpu, SIZE);
    let settings = Volumetric { radius_mm: 30.0, samples: 24 };
    for (shown, geometry) in rooms.shown.iter().zip(&rooms.geometry) {
        let found = values(&gpu, geometry, |rec, _, to| kernel.record(rec, geometry, &settings, to).unwrap());
        for (eye, shown) in shown.iter().enumerate() {
            let expected = volumetric(shown, &settings);
            let off = differing(&found[eye], &expected, ROUNDING);
            println!("eye {eye}: {:.4} % differ", 100.0 * off);
            assert!(off <= FLIPPED, "eye {eye}: {off}");
            let occluded = expected.iter().filter(|a| **a < 0.98).count();
            assert!(occluded > 50, "only {occluded} pixels are occluded");
            // The other eye's image and another radius are told apart.
            assert!(differing(&found[1 - eye], &expected, ROUNDING) > 4.0 * FLIPPED);
            let other = volumetric(shown, &Volumetric { radius_mm: 33.0, ..settings });
            assert!(differing(&found[eye], &other, ROUNDING) > 4.0 * FLIPPED);
        }
    }
    drop((kernel, rooms));
    close(gpu);
}
