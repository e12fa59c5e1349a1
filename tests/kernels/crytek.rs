//! The kernel `crytek` against its twin.

use cao::image_space::crytek::CrytekShading;
use cao_model::image_space::Crytek;
use cao_testing::image_space::{Rooms, differing, values};
use cao_testing::{close, open};
use cao_twin::image_space::crytek::crytek;

/// Not square, no multiple of a workgroup.
const SIZE: [u32; 2] = [45, 35];

/// Values are whole sixteenths.
const ROUNDING: f64 = 1e-6;

/// Share of the pixels at which one of 16 points may fall on the other side of a pixel's border or of the surface: positions of some 300 mm in f32 and sines
/// of a device are off by 1e-4 mm of the 5 mm of a pixel, for two borders and the depth.
const FLIPPED: f64 = 16.0 * 3.0 * 1e-4 / 5.0 * 4.0;

#[test]
fn points_are_hidden_as_the_twin_has_it_in_both_eyes() {
    let gpu = open();
    let kernel = CrytekShading::new(&gpu).unwrap();
    let rooms = Rooms::new(&gpu, SIZE);
    let settings = Crytek { radius_mm: 24.0 };
    for (shown, geometry) in rooms.shown.iter().zip(&rooms.geometry) {
        let found = values(&gpu, geometry, |rec, _, to| kernel.record(rec, geometry, &settings, to).unwrap());
        for (eye, shown) in shown.iter().enumerate() {
            let expected = crytek(shown, &settings);
            let off = differing(&found[eye], &expected, ROUNDING);
            println!("eye {eye}: {:.4} % differ", 100.0 * off);
            assert!(off <= FLIPPED, "eye {eye}: {off}");
            let occluded = expected.iter().filter(|a| **a < 0.5).count();
            assert!(occluded > 30, "only {occluded} pixels are occluded");
            // The other eye's image and another radius are told apart.
            assert!(differing(&found[1 - eye], &expected, ROUNDING) > 4.0 * FLIPPED);
            let other = crytek(shown, &Crytek { radius_mm: 26.0 });
            assert!(differing(&found[eye], &other, ROUNDING) > 4.0 * FLIPPED);
        }
    }
    drop((kernel, rooms));
    close(gpu);
}
