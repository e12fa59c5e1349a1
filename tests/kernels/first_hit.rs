//! The kernel `first_hit` against its twin, on depths that the renderer drew and on those of sheets, and methods of image space on what it makes.

use cao::draw::picture::Picture;
use cao::image_space::first_hit::FirstHit;
use cao::image_space::shade::ImageSpace;
use cao::mesh::geometry::Geometry;
use cao::renderer::COLOUR;
use cao_gpu::{Access, BufferUse, Gpu, Recorder};
use cao_model::builtin::builtin_box;
use cao_model::image_space::ImageMethod;
use cao_model::look::Look;
use cao_model::view::View;
use cao_testing::image_space::{differing, values};
use cao_testing::*;
use cao_twin::image_space::accessibility;
use cao_twin::image_space::first_hit::first_hit;
use cao_twin::image_space::shown::Shown;
use glam::Vec4;

/// Not square, no multiple of a workgroup.
const SIZE: [u32; 2] = [45, 35];

/// Of normals: positions of some 100 mm in f32 against differences of a mm. Of depths, relative.
const NORMAL: f32 = 1e-3;
const DEPTH: f32 = 1e-5;

/// Share of the pixels whose neighbours are as far to one side as to the other, to rounding, and not in one plane.
const TIES: f64 = 0.002;

/// Depths of each view, as drawn.
fn depths(gpu: &Gpu, picture: &Picture) -> Vec<Vec<f32>> {
    let bytes = 4 * u64::from(SIZE[0] * SIZE[1]);
    let read = |layer: usize| {
        let back = gpu.buffer("back", bytes, BufferUse::Readback).unwrap();
        run(gpu, |rec| {
            let size = [SIZE[0], SIZE[1], 1];
            rec.copy_image_to_buffer(&picture.depth, layer as u32, [0; 3], size, &back, 0).unwrap();
            rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        });
        bytemuck::pod_collect_to_vec(&back.read(0, bytes).unwrap())
    };
    (0..picture.views()).map(read).collect()
}

/// Share of the pixels that differ by more than rounding.
fn off(found: &[[f32; 4]], expected: &[[f32; 4]]) -> f64 {
    // So that a NaN is not near.
    let near = |(f, e): &(&[f32; 4], &[f32; 4])| {
        let (f, e) = (Vec4::from(**f), Vec4::from(**e));
        f.truncate().distance(e.truncate()) <= NORMAL && (f.w - e.w).abs() <= DEPTH * e.w
    };
    1.0 - found.iter().zip(expected).filter(near).count() as f64 / expected.len() as f64
}

#[test]
fn a_volume_is_shaded_by_what_its_picture_shows() {
    let gpu = open();
    let volume = builtin_box("fruit", [16, 18, 14], [1.0; 3]).unwrap();
    let (renderer, kernel, shade) =
        (fruit(&gpu, COLOUR), FirstHit::new(&gpu).unwrap(), ImageSpace::new(&gpu).unwrap());
    let picture = Picture::new(&gpu, SIZE, 2).unwrap();
    let geometry = Geometry::new(&gpu, SIZE, 2).unwrap();
    for reversed in [false, true] {
        let views = eyes(&volume, 30.0).map(|view| View { reversed, ..view });
        run(&gpu, |rec| {
            renderer.record_picture(rec, &views, &Look::default(), &picture).unwrap();
            geometry.record_eyes(rec, &views).unwrap();
            rec.barrier(&[Access::StorageWrite], &[Access::SampledRead]);
            kernel.record(rec, &picture, &geometry).unwrap();
        });
        let drawn = depths(&gpu, &picture);
        let pixels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &geometry.pixels));
        let size = SIZE.map(|s| s as usize);
        let shown: Vec<Shown> = (0..2).map(|eye| first_hit(&views[eye], size, &drawn[eye])).collect();
        let found: Vec<&[[f32; 4]]> = pixels.chunks(pixels.len() / 2).collect();
        for eye in 0..2 {
            let expected = shown[eye].pixels();
            assert!(expected.iter().filter(|p| p[3] > 0.0).count() > 200, "the fruit is in the picture");
            let share = off(found[eye], &expected);
            println!("eye {eye}: {:.4} % differ", 100.0 * share);
            assert!(share <= TIES, "eye {eye}: {share}");
            assert!(off(found[1 - eye], &expected) > 0.1, "the eyes are told apart");
        }
        // From there on as of a mesh. The twin takes what the kernel made, whose few ties are its own.
        for method in ImageMethod::all(4.0) {
            let shaded = values(&gpu, &geometry, |rec: &mut Recorder, scratch, to| {
                shade.record(rec, &geometry, &method, scratch, to).unwrap();
            });
            for eye in 0..2 {
                let expected = accessibility(&Shown::new(&views[eye], size, found[eye]), &method);
                let share = differing(&shaded[eye], &expected, 2e-4);
                println!("{} eye {eye}: {:.4} % differ", method.title(), 100.0 * share);
                assert!(share <= FLIPPED, "{} eye {eye}: {share}", method.title());
                assert!(expected.iter().any(|a| *a < 1.0), "{}", method.title());
            }
        }
    }
    let wrong = Geometry::new(&gpu, [SIZE[0], SIZE[1] + 1], 2).unwrap();
    run(&gpu, |rec| {
        let error = kernel.record(rec, &picture, &wrong).unwrap_err().to_string();
        assert!(error.starts_with("picture") && error.contains("expected 2 of [45, 36]"), "{error}");
    });
    drop((renderer, kernel, shade, picture, geometry, wrong));
    close(gpu);
}

/// Share of the pixels that a flipped sample reaches through a filter; tests of the kernels bound the flips.
const FLIPPED: f64 = 0.02;
