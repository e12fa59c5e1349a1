//! Every method at its own settings, on one volume, and whether it is exact: `cargo run --release --example methods`.

use cao::verify::verify;
use cao::{Clip, Gpu, METHODS, OpenOptions, Pose, Renderer, Setup, Shape, TransferFunction};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let volume = cao_formats::open("builtin:skeleton:48")?;
    let transfer = TransferFunction::preset("auto", volume.range())?;
    let gpu = Gpu::open(&OpenOptions::default())?;
    for method in METHODS {
        // Rays and rule are the method's own, the radius 20 voxels; everything may be set.
        let mut setup = Setup::of(method.method, volume.min_spacing());
        setup.occlusion.radius_mm = 12.0 * volume.min_spacing() as f32;
        let mut renderer = Renderer::new(&gpu, &volume, transfer.clone(), setup, cao::renderer::COLOUR)?;
        renderer.update(&mut |_| ())?;

        // A clip moves: only what it changed is computed.
        let pose = Pose { scale: cao::glam::Vec3::splat(15.0), ..Pose::default() };
        renderer.set_clips(&[Clip { pose, ..Clip::remove(Shape::Sphere) }])?;
        let times = renderer.update(&mut |_| ())?;
        let (difference, full) = verify(&renderer, &mut |_| ())?;
        println!(
            "{:<10} {} ({}), rays {}, rule {}: {:.1} ms, in full {:.1} ms, {} of {} voxels differ",
            method.name,
            method.title,
            method.source,
            setup.occlusion.rays.name(),
            setup.occlusion.quadrature.name(),
            times.total(),
            full.total(),
            difference.different,
            difference.compared
        );
        assert_eq!(difference.different, 0);
    }
    Ok(())
}
