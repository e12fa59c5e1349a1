//! A picture for both eyes: `cargo run --release --example picture [OUT.png]`.

use cao::glam::Vec3;
use cao::{Clip, Gpu, Look, OpenOptions, Pose, Renderer, Setup, Shape, StereoRig, TransferFunction};
use cao_formats::Picture;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let volume = cao_formats::open("builtin:engine:64")?; // or the path of a file
    let transfer = TransferFunction::preset("auto", volume.range())?;
    let gpu = Gpu::open(&OpenOptions::default())?;
    let setup = Setup::new(volume.min_spacing());
    let mut renderer = Renderer::new(&gpu, &volume, transfer, setup, cao::renderer::COLOUR)?;

    // A ball of 20 mm is cut out of one corner. In a loop over frames: move it, update, draw.
    let pose =
        Pose { translate_mm: Vec3::new(19.0, -19.0, 19.0), scale: Vec3::splat(20.0), ..Pose::default() };
    renderer.set_clips(&[Clip { pose, ..Clip::remove(Shape::Sphere) }])?;
    renderer.update(&mut |_share_done| ())?;

    let views = StereoRig::framing(volume.size_mm(), 30.0, 25.0).views(1.0, 1.0, 1000.0)?;
    let (image, times) = renderer.draw(&views, &Look::default(), [512, 512])?;
    let [left, right] = image.colour.each_ref().map(|eye| Picture::over(512, 512, eye, [0.0; 3]));
    let path = std::env::args().nth(1).unwrap_or("picture.png".into());
    Picture::beside(&left, &right).write_png(path.as_ref())?;
    println!("{path}: drawn in {:.1} ms on {}", times.total(), gpu.info().name);
    Ok(())
}
