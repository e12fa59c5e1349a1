//! The kernel `ssao` against its twin, on depth images that the renderer drew.

use cao::renderer::{COLOUR, Renderer, Target, Targets};
use cao_gpu::{Access, BufferUse, Format, Gpu, ImageDesc, ImageKind, ImageUse};
use cao_measure::kernels::ssao::Ssao;
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Pose, Shape};
use cao_model::look::Look;
use cao_model::methods::Method;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::{StereoRig, View};
use cao_testing::*;
use cao_twin::measure::ssao::{Settings, ssao};
use glam::Vec3;

/// Not square, no multiple of a workgroup.
const SIZE: [u32; 2] = [90, 70];

/// Both eyes' depth on the device and read back, and what the kernel makes of it.
fn on_device(gpu: &Gpu, settings: Settings, azimuth: f32) -> ([View; 2], [Vec<f32>; 2], [Vec<f32>; 2]) {
    let volume = builtin_box("engine", [32, 28, 30], [1.0, 1.2, 0.9]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let mut setup = Setup::of(Method::Cao, volume.min_spacing());
    setup.occlusion.radius_mm = 0.0;
    let mut renderer = Renderer::new(gpu, &volume, transfer, setup, COLOUR).unwrap();
    let pose = Pose { translate_mm: Vec3::new(7.0, -9.0, 7.0), scale: Vec3::splat(10.0), ..Pose::default() };
    renderer.set_clips(&[Clip { pose, ..Clip::remove(Shape::Sphere) }]).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let rig = StereoRig::framing(volume.size_mm(), azimuth, 25.0);
    let far = 3.0 * rig.position.length();
    let views = rig.views(SIZE[0] as f32 / SIZE[1] as f32, 0.02 * far, far).unwrap();

    let target = |name, format| {
        let usage = ImageUse::ATTACHMENT | ImageUse::SAMPLED;
        let dims = [SIZE[0], SIZE[1], 1];
        gpu.image(name, &ImageDesc { dims, layers: 2, format, kind: ImageKind::D2, usage }).unwrap()
    };
    let (colour, depth) = (target("colour", COLOUR), target("depth", Format::D32Float));
    let bytes = 4 * u64::from(SIZE[0]) * u64::from(SIZE[1]);
    let back = [(); 2].map(|()| gpu.buffer("depth read-back", bytes, BufferUse::Readback).unwrap());
    let occlusion = [(); 2].map(|()| gpu.buffer("occlusion", bytes, BufferUse::Device).unwrap());
    let kernel = Ssao::new(gpu).unwrap();
    run(gpu, |rec| {
        rec.discard(&colour);
        rec.discard(&depth);
        rec.barrier(&[], &[Access::AttachmentWrite]);
        let look = Look::default();
        renderer
            .record_draw(
                rec,
                &views,
                &look,
                &Targets::new(&Target::layers(&colour, &depth, views.len()), SIZE),
            )
            .unwrap();
        rec.barrier(&[Access::AttachmentWrite], &[Access::SampledRead, Access::TransferRead]);
        let Settings { radius_mm, samples, bias_mm } = settings;
        for (eye, to) in occlusion.iter().enumerate() {
            let view = &views[eye];
            kernel.record(rec, view, &depth, eye as u32, radius_mm, samples, bias_mm, to).unwrap();
        }
        for (eye, back) in back.iter().enumerate() {
            rec.copy_image_to_buffer(&depth, eye as u32, [0; 3], [SIZE[0], SIZE[1], 1], back, 0).unwrap();
        }
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    });
    let floats = |bytes: Vec<u8>| bytemuck::pod_collect_to_vec::<u8, f32>(&bytes);
    let depths = back.map(|buffer| floats(buffer.read(0, bytes).unwrap()));
    (views, depths, occlusion.map(|buffer| floats(read_buffer(gpu, &buffer))))
}

fn twin(depth: &[f32], view: &View, settings: &Settings) -> Vec<f32> {
    ssao(depth, SIZE.map(|s| s as usize), view, settings)
}

/// Share of the pixels whose values differ by more than one sample's worth of rounding.
fn differing(a: &[f32], b: &[f32]) -> f64 {
    /// Sums of up to 48 terms and a few f32 operations on positions of some 100 mm.
    const ROUNDING: f32 = 1e-4;
    a.iter().zip(b).filter(|(a, b)| (*a - *b).abs() > ROUNDING).count() as f64 / a.len() as f64
}

/// Share of the pixels at which a point of the hemisphere may fall on the other side of a pixel's border or of the surface:
/// 48 points, each near one of four borders by the rounding of its position, 2e-5 pixel.
const FLIPPED: f64 = 48.0 * 4.0 * 2e-5;

#[test]
fn the_kernel_shades_as_its_twin_does_for_each_eye() {
    let gpu = open();
    for (azimuth, settings) in [
        (30.0, Settings { radius_mm: 6.0, samples: 48, bias_mm: 0.2 }),
        (200.0, Settings { radius_mm: 12.0, samples: 16, bias_mm: 0.0 }),
    ] {
        let (views, depths, shaded) = on_device(&gpu, settings, azimuth);
        for eye in 0..2 {
            let expected = twin(&depths[eye], &views[eye], &settings);
            let occluded = expected.iter().filter(|&&a| a < 0.9).count();
            assert!(occluded > 100, "{azimuth}: only {occluded} pixels are occluded");
            let off = differing(&shaded[eye], &expected);
            println!("{azimuth} eye {eye}: {occluded} occluded, {:.4} % differ", 100.0 * off);
            assert!(off <= FLIPPED, "{azimuth} eye {eye}: {:.3} % differ", 100.0 * off);
            // The other eye's image, and another radius, are told apart.
            assert!(differing(&shaded[1 - eye], &expected) > 4.0 * FLIPPED);
            let other = Settings { radius_mm: 1.2 * settings.radius_mm, ..settings };
            assert!(differing(&shaded[eye], &twin(&depths[eye], &views[eye], &other)) > 4.0 * FLIPPED);
        }
    }
    close(gpu);
}

#[test]
fn too_little_memory_is_refused() {
    let gpu = open();
    let kernel = Ssao::new(&gpu).unwrap();
    let usage = ImageUse::ATTACHMENT | ImageUse::SAMPLED;
    let desc = ImageDesc { dims: [8, 8, 1], layers: 2, format: Format::D32Float, kind: ImageKind::D2, usage };
    let depth = gpu.image("depth", &desc).unwrap();
    let occlusion = gpu.buffer("occlusion", 4 * 63, BufferUse::Device).unwrap();
    let [view, _] = StereoRig::framing([8.0; 3], 0.0, 0.0).views(1.0, 1.0, 100.0).unwrap();
    run(&gpu, |rec| {
        let error = kernel.record(rec, &view, &depth, 0, 1.0, 8, 0.0, &occlusion).unwrap_err();
        assert!(error.to_string().contains("expected 4 for each pixel"), "{error}");
    });
    drop((depth, occlusion, kernel));
    close(gpu);
}
