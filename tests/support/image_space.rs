//! Scenes on the device as what pixels show, and what methods of image space make of them.

use crate::{buffer, read_buffer, run};
use cao::mesh::geometry::Geometry;
use cao_gpu::{Buffer, Gpu, Recorder};
use cao_model::view::{StereoRig, View};
use cao_twin::image_space::scenes::{Sheet, nearest};
use cao_twin::image_space::shown::Shown;
use glam::{DVec3, Vec3};

/// Both eyes of a head at a place that looks at the origin, for pictures of this size.
pub fn eyes_at(position: Vec3, size: [u32; 2]) -> [View; 2] {
    let up = if position.truncate().length() < 1.0 { Vec3::Y } else { Vec3::Z };
    let distance = position.length();
    let rig = StereoRig {
        position,
        target: Vec3::ZERO,
        up,
        ipd_mm: 0.1 * distance,
        fov_deg: 30.0,
        screen_mm: None,
    };
    rig.views(size[0] as f32 / size[1] as f32, 0.01 * distance, 4.0 * distance).unwrap()
}

/// A floor, a wall that leans back, a table, and twelve small ones at different heights; beside them nothing.
pub fn room() -> Vec<Sheet> {
    let [x, y, z] = DVec3::AXES;
    let mut sheets = vec![
        Sheet::around(DVec3::ZERO, [70.0 * x, 50.0 * y]),
        Sheet::around(DVec3::new(-50.0, 0.0, 20.0), [4.0 * x + 40.0 * y, 20.0 * z - 14.0 * x]),
        Sheet::around(DVec3::new(45.0, 10.0, 9.0), [14.0 * x - 6.0 * y, 15.0 * y + 2.0 * z]),
    ];
    for i in 0..12 {
        let middle =
            DVec3::new(f64::from(i % 4) * 17.0 - 30.0, f64::from(i / 4) * 22.0 - 24.0, f64::from(4 + i));
        sheets.push(Sheet::around(middle, [5.5 * x + y, 6.0 * y - 2.0 * z]));
    }
    sheets
}

/// What each view shows of sheets.
pub fn shown(views: &[View], size: [u32; 2], sheets: &[Sheet]) -> Vec<Shown> {
    // As the device has it: in f32.
    let view = |view: &View| {
        let size = size.map(|s| s as usize);
        let exact = Shown::of(view, size, nearest(sheets));
        Shown::new(view, size, &exact.pixels())
    };
    views.iter().map(view).collect()
}

/// The same on the device.
pub fn geometry(gpu: &Gpu, views: &[View], size: [u32; 2], shown: &[Shown]) -> Geometry {
    let pixels: Vec<[f32; 4]> = shown.iter().flat_map(Shown::pixels).collect();
    let staging = buffer(gpu, "pixels", bytemuck::cast_slice(&pixels));
    let geometry = Geometry::new(gpu, size, views.len()).unwrap();
    run(gpu, |rec| {
        geometry.record_eyes(rec, views).unwrap();
        rec.copy_buffer(&staging, 0, &geometry.pixels, 0, staging.bytes()).unwrap();
    });
    geometry
}

/// Two views of the room, from above and aslant, on the device and for twins.
pub struct Rooms {
    /// Two eyes each.
    pub views: [[View; 2]; 2],
    /// What they show.
    pub shown: [Vec<Shown>; 2],
    /// The same on the device.
    pub geometry: [Geometry; 2],
}

impl Rooms {
    /// In pictures of this size.
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        let from = [Vec3::new(0.0, 0.0, 260.0), Vec3::new(190.0, -90.0, 120.0)];
        let views = from.map(|position| eyes_at(position, size));
        let shown = views.map(|views| shown(&views, size, &room()));
        let geometry = [0, 1].map(|n| geometry(gpu, &views[n], size, &shown[n]));
        Self { views, shown, geometry }
    }
}

/// Share of the pixels whose values differ by more than rounding.
pub fn differing(found: &[f32], expected: &[f64], rounding: f64) -> f64 {
    assert_eq!(found.len(), expected.len());
    // So that a NaN is not near.
    let near = |(a, b): &(&f32, &f64)| (f64::from(**a) - **b).abs() <= rounding;
    1.0 - found.iter().zip(expected).filter(near).count() as f64 / expected.len() as f64
}

/// Values that commands write, view by view.
pub fn values(
    gpu: &Gpu,
    geometry: &Geometry,
    commands: impl FnOnce(&mut Recorder, &Buffer, &Buffer),
) -> Vec<Vec<f32>> {
    let [scratch, found] = ["scratch", "accessibility"].map(|name| geometry.values(gpu, name).unwrap());
    run(gpu, |rec| commands(rec, &scratch, &found));
    let all: Vec<f32> = bytemuck::pod_collect_to_vec(&read_buffer(gpu, &found));
    all.chunks(all.len() / geometry.views()).map(<[f32]>::to_vec).collect()
}
