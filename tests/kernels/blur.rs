//! The kernel `blur` against its twin, and whole methods of image space with their filters.

use cao::Error;
use cao::image_space::blur::Blur;
use cao::image_space::shade::ImageSpace;
use cao_gpu::{Access, Gpu, Recorder};
use cao_measure::random::Random;
use cao_model::image_space::{Crytek, Hbao, ImageMethod};
use cao_testing::image_space::{Rooms, differing, values};
use cao_testing::{buffer, close, open};
use cao_twin::image_space::{accessibility, blur};

/// Not square, no multiple of a workgroup.
const SIZE: [u32; 2] = [45, 35];

/// Distances of 1e-4 mm to planes against a thickness of 3 mm, exponentials of a device, sums of two times 11.
const ROUNDING: f64 = 1e-4;

const SETTINGS: Hbao = Hbao { radius_mm: 30.0, directions: 6, bias_deg: 30.0, falloff: true, reach: 5 };

#[test]
fn filters_are_the_twins() {
    let gpu = open();
    let kernel = Blur::new(&gpu).unwrap();
    let rooms = Rooms::new(&gpu, SIZE);
    let mut random = Random::new(7);
    for (shown, geometry) in rooms.shown.iter().zip(&rooms.geometry) {
        let noise: Vec<f32> = (0..2 * SIZE[0] * SIZE[1]).map(|_| random.between(0.0, 1.0)).collect();
        let from = buffer(&gpu, "noise", bytemuck::cast_slice(&noise));
        let square =
            values(&gpu, geometry, |rec, _, to| kernel.record_square(rec, geometry, &from, to).unwrap());
        let bilateral = values(&gpu, geometry, |rec, scratch, to| {
            rec.copy_buffer(&from, 0, to, 0, from.bytes()).unwrap();
            rec.barrier(&[Access::TransferWrite], &[Access::StorageRead]);
            kernel.record_bilateral(rec, geometry, &SETTINGS, scratch, to).unwrap();
        });
        for (eye, shown) in shown.iter().enumerate() {
            let noise: Vec<f64> =
                noise.iter().skip(eye * shown.len()).take(shown.len()).map(|v| f64::from(*v)).collect();
            assert_eq!(differing(&square[eye], &blur::square(shown, &noise), ROUNDING), 0.0);
            let expected = blur::bilateral(shown, &SETTINGS, &noise);
            assert_eq!(differing(&bilateral[eye], &expected, ROUNDING), 0.0);
            // Told apart from each other and from another reach.
            assert!(differing(&square[eye], &expected, ROUNDING) > 0.2);
            let other = blur::bilateral(shown, &Hbao { reach: 6, ..SETTINGS }, &noise);
            assert!(differing(&bilateral[eye], &other, ROUNDING) > 0.2);
        }
    }
    drop((kernel, rooms));
    close(gpu);
}

/// Values that a flipped sample changes by a sixteenth, or by a line or step, spread by the filter over up to 11 × 11 pixels.
const SPREAD: f64 = 0.01;

#[test]
fn whole_methods_are_the_twins_and_refuse_what_they_cannot_do() {
    let gpu = open();
    let kernels = ImageSpace::new(&gpu).unwrap();
    let rooms = Rooms::new(&gpu, SIZE);
    let [crytek, volumetric, _] = ImageMethod::all(30.0);
    for method in [crytek, volumetric, ImageMethod::Hbao(SETTINGS)] {
        for (shown, geometry) in rooms.shown.iter().zip(&rooms.geometry) {
            let found = values(&gpu, geometry, |rec, scratch, to| {
                kernels.record(rec, geometry, &method, scratch, to).unwrap()
            });
            for (eye, shown) in shown.iter().enumerate() {
                let expected = accessibility(shown, &method);
                let off = differing(&found[eye], &expected, 2.0 * ROUNDING);
                println!("{} eye {eye}: {:.4} % differ", method.title(), 100.0 * off);
                assert!(off <= SPREAD, "{} eye {eye}: {off}", method.title());
                assert!(differing(&found[1 - eye], &expected, 2.0 * ROUNDING) > 4.0 * SPREAD);
            }
        }
    }
    refused(&gpu, &kernels, &rooms);
    drop((kernels, rooms));
    close(gpu);
}

fn refused(gpu: &Gpu, kernels: &ImageSpace, rooms: &Rooms) {
    let geometry = &rooms.geometry[0];
    let small = buffer(gpu, "small", &[0; 16]);
    values(gpu, geometry, |rec: &mut Recorder, scratch, to| {
        let mut record = |method: ImageMethod, to| kernels.record(rec, geometry, &method, scratch, to);
        let refusal = |found: Result<(), Error>| found.unwrap_err().to_string();
        let error = refusal(record(ImageMethod::Crytek(Crytek { radius_mm: f32::NAN }), to));
        assert!(error.starts_with("radius_mm"), "{error}");
        let error = refusal(record(ImageMethod::all(1.0)[0], &small));
        assert!(error.contains("16 bytes; expected 12600"), "{error}");
    });
}
