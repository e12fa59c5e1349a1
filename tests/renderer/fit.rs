//! The default camera: what is visible fills the picture of both eyes from any side, whatever is hidden around it.

use cao::renderer::{Renderer, StereoImage};
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::fit::Fitting;
use cao_model::look::Look;
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::view::{StereoRig, View};
use cao_model::volume::Volume;
use cao_testing::*;
use glam::{Vec2, Vec3};

/// Pixels along the shorter side: one is 1 % of it.
const PIXELS: f32 = 100.0;

/// What of the shorter side is to be filled.
const FILLED: std::ops::RangeInclusive<f32> = 0.80..=0.90;

/// From here on a pixel is something that one sees, and not the edge of a voxel that fades out.
const SEEN: f32 = 0.2;

fn fitting(azimuth_deg: f32, elevation_deg: f32, aspect: f32) -> Fitting {
    let (fov_deg, distance_mm, ipd_mm, screen_mm) = (None, None, None, None);
    Fitting { azimuth_deg, elevation_deg, fov_deg, aspect, distance_mm, ipd_mm, screen_mm }
}

/// Eyes and pictures of a scene from a side, in pictures of this aspect whose shorter side is [`PIXELS`].
fn picture(renderer: &Renderer, side: [f32; 2], aspect: f32) -> (StereoRig, [View; 2], StereoImage) {
    let rig = fitting(side[0], side[1], aspect).rig(|ways| renderer.visible_extent(ways)).unwrap().unwrap();
    let distance = (rig.position - rig.target).length();
    let size = Vec2::new(aspect.max(1.0), (1.0 / aspect).max(1.0)) * PIXELS;
    let views = rig.views(aspect, 0.05 * distance, 20.0 * distance).unwrap();
    let size = [size.x.round() as u32, size.y.round() as u32];
    let (image, _) = renderer.draw(&views, &Look::default(), size).unwrap();
    (rig, views, image)
}

/// First and last column and row, as shares of width and height, of pixels that show more than `alpha`.
fn rectangle(image: &StereoImage, eye: usize, alpha: f32) -> [Vec2; 2] {
    let [width, height] = image.size.map(|n| n as f32);
    let (mut low, mut high) = (Vec2::MAX, Vec2::MIN);
    for (i, pixel) in image.colour[eye].iter().enumerate() {
        if pixel[3] > alpha {
            let at = Vec2::new((i as u32 % image.size[0]) as f32, (i as u32 / image.size[0]) as f32);
            low = low.min(at / Vec2::new(width, height));
            high = high.max((at + 1.0) / Vec2::new(width, height));
        }
    }
    [low, high]
}

/// The largest angle in degrees between what both eyes make of a point that the left one sees, and of the screen plane.
fn worst_disparity(rig: &StereoRig, views: &[View; 2], image: &StereoImage) -> f32 {
    let angle = |p: Vec3| {
        let [a, b] = views.map(|eye| (p - eye.position).normalize());
        a.cross(b).length().atan2(a.dot(b)).to_degrees()
    };
    let View { near_mm: near, far_mm: far, .. } = views[0];
    let mut worst = 0.0_f32;
    for (i, depth) in image.depth[0].iter().enumerate().filter(|(_, depth)| **depth < 1.0) {
        let [x, y] = [i as u32 % image.size[0], i as u32 / image.size[0]];
        let uv = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / Vec2::from_array(image.size.map(|n| n as f32));
        let (origin, direction) = views[0].ray(uv);
        // Depth is far/(far − near) − far·near/(far − near)/t.
        let t = far * near / (far - depth * (far - near));
        worst = worst.max((angle(origin + t * direction) - angle(rig.target)).abs());
    }
    worst
}

/// A picture is filled, in the tighter direction and in both eyes, and comfortable.
fn assert_filled(renderer: &Renderer, side: [f32; 2], aspect: f32, context: &str) {
    let (rig, views, image) = picture(renderer, side, aspect);
    for eye in 0..2 {
        let [low, high] = rectangle(&image, eye, SEEN);
        let context = format!("{context} {side:?} {aspect} eye {eye}: {low} to {high}");
        let filled = (high - low).max_element();
        assert!(FILLED.contains(&filled), "{context}");
        assert!(low.min_element() > 0.03 && high.max_element() < 0.97, "near an edge: {context}");
    }
    let worst = worst_disparity(&rig, &views, &image);
    assert!(worst > 0.1 && worst <= Fitting::DISPARITY_DEG, "{context} {side:?} {aspect}: {worst} degrees");
}

/// A ball of radius 9 mm, away from the middle of a box that is five times as wide, in a fog of this opacity a voxel.
fn ball(fog: f32) -> Volume {
    let dims = [90, 70, 80];
    let centre = Vec3::new(-18.0, 12.0, 20.0);
    let mut values = Vec::new();
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                let at = Vec3::new(x as f32 - 44.5, y as f32 - 34.5, z as f32 - 39.5);
                // As wide as a voxel, its edge.
                values.push((9.5 - at.distance(centre)).clamp(fog, 1.0));
            }
        }
    }
    Volume::new(dims, [1.0; 3], Values::F32(values)).unwrap()
}

const SIDES: [[f32; 2]; 4] = [[0.0, 0.0], [30.0, 25.0], [-140.0, -50.0], [75.0, 90.0]];
const ASPECTS: [f32; 3] = [1.0, 16.0 / 9.0, 9.0 / 16.0];

#[test]
fn what_is_visible_fills_both_pictures() {
    let gpu = open();
    let auto = |volume: &Volume| TransferFunction::preset("auto", volume.range()).unwrap();
    let clip = |shape, mode, at: Vec3, scale: f32| {
        let pose =
            Pose { translate_mm: at, rotate_deg: Vec3::new(10.0, 40.0, 0.0), scale: Vec3::splat(scale) };
        Clip { shape, mode, pose }
    };
    let [engine, skeleton] =
        ["engine", "skeleton"].map(|name| builtin_box(name, [96, 84, 108], [0.7, 0.8, 0.5]).unwrap());
    let corner = clip(Shape::Box, Mode::Keep, Vec3::new(20.0, -15.0, 12.0), 24.0);
    let half = clip(Shape::Plane, Mode::Remove, Vec3::new(0.0, 0.0, -4.0), 1.0);
    for (name, volume, transfer, clips) in [
        ("ball", &ball(0.0), identity(), vec![]),
        ("engine", &engine, auto(&engine), vec![]),
        ("skeleton", &skeleton, auto(&skeleton), vec![]),
        ("corner of engine", &engine, auto(&engine), vec![corner]),
        ("half of skeleton", &skeleton, auto(&skeleton), vec![half]),
    ] {
        let renderer = unoccluded(&gpu, volume, transfer, &clips);
        for (i, side) in SIDES.into_iter().enumerate() {
            assert_filled(&renderer, side, ASPECTS[i % 3], name);
            assert_filled(&renderer, side, ASPECTS[(i + 1) % 3], name);
        }
    }
    close(gpu);
}

/// A fog of less than a 64th of the most opaque fills no picture, although it hides a fifth of what is behind it here; alone it does.
#[test]
fn a_fog_does_not_count_beside_what_stands_in_it() {
    let gpu = open();
    let renderer_of = |fog| unoccluded(&gpu, &ball(fog), identity(), &[]);
    let (rig, _, image) = picture(&renderer_of(0.002), SIDES[1], 1.0);
    let [low, high] = rectangle(&image, 0, 0.5);
    assert!(FILLED.contains(&(high - low).max_element()), "{low} {high}");
    let (without, ..) = picture(&renderer_of(0.0), SIDES[1], 1.0);
    assert_eq!(rig, without);
    // A denser one is all of the box, more than four times as wide as the ball.
    let (denser, ..) = picture(&renderer_of(0.02), SIDES[1], 1.0);
    let distance = |rig: &StereoRig| (rig.position - rig.target).length();
    assert!(distance(&denser) > 4.0 * distance(&rig), "{denser:?}");
    close(gpu);
}

#[test]
fn of_nothing_there_is_no_extent_and_of_what_is_out_of_date_neither() {
    let gpu = open();
    let volume = ball(0.0);
    let everything =
        Clip { pose: Pose { scale: Vec3::splat(100.0), ..Pose::default() }, ..Clip::remove(Shape::Sphere) };
    let mut renderer = unoccluded(&gpu, &volume, identity(), &[everything]);
    assert_eq!(renderer.visible_extent(&[Vec3::X]).unwrap(), None);
    renderer.set_clips(&[]).unwrap();
    let error = renderer.visible_extent(&[Vec3::X]).unwrap_err().to_string();
    assert!(error.contains("update"), "{error}");
    renderer.update(&mut |_| ()).unwrap();
    let found = renderer.visible_extent(&[Vec3::X, Vec3::NEG_X]).unwrap().unwrap();
    // The ball lies from −27 to −9 mm, and a voxel's edge further.
    assert!((found[0] + 9.0).abs() <= 1.0 && (found[1] - 27.0).abs() <= 1.0, "{found:?}");
    drop(renderer);
    close(gpu);
}
