//! Stereo mismatch (CAO §5, measure.md §4): how much the ambient factors differ that the two eyes show at the same point, as
//! the eyes move apart.
//!
//! Points are what the left eye's picture shows and the right eye sees too. Control: occlusion from each eye's depth image
//! ([`cao_twin::measure::ssao`]), with the same radius.

use super::{Chart, Effort, Finding, Ours, Quantity, Series, evenly, mean, quantile};
use crate::Result;
use crate::plot::short;
use cao::renderer::{COLOUR, Renderer, StereoImage};
use cao_gpu::Gpu;
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Pose, Shape};
use cao_model::look::Look;
use cao_model::methods::Method;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::{StereoRig, View};
use cao_model::volume::Volume;
use cao_twin::measure::ssao::{Settings, ssao};
use glam::{Vec2, Vec3};

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Voxels along an edge of the volume.
    pub edge: usize,
    /// Pixels along an edge of an eye's picture.
    pub pixels: u32,
    /// Distances of the eyes in mm.
    pub separations_mm: Vec<f64>,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { edge: 64, pixels: 256, separations_mm: evenly(0.0, 100.0, 21) },
            Effort::Quick => Self { edge: 40, pixels: 128, separations_mm: evenly(0.0, 100.0, 6) },
        }
    }
}

/// Edge of the volume in mm, as large as a head; and the eyes' distance to its centre.
pub(super) const SIZE_MM: f64 = 200.0;
pub(super) const DISTANCE_MM: f32 = 500.0;

/// Radius of both methods in voxels.
pub(super) const RADIUS: f32 = 6.0;

/// An average adult's eyes are this far apart (mm): where the sentence quotes the curves.
pub(super) const ADULT_MM: f64 = 63.0;

/// Runs the trial, telling the share done. Uses the device's queue and waits for it.
pub fn run(gpu: &Gpu, plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let voxel = SIZE_MM / plan.edge as f64;
    let volume = builtin_box("engine", [plan.edge; 3], [voxel; 3])?;
    let mut setup = Setup::of(Method::Cao, voxel);
    setup.occlusion.radius_mm = RADIUS * voxel as f32;
    let transfer = TransferFunction::preset("auto", volume.range())?;
    let mut renderer = Renderer::new(gpu, &volume, transfer, setup, COLOUR)?;
    let pose = Pose {
        translate_mm: Vec3::new(0.23, -0.3, 0.23) * SIZE_MM as f32,
        scale: Vec3::splat(0.3 * SIZE_MM as f32),
        ..Pose::default()
    };
    renderer.set_clips(&[Clip { pose, ..Clip::remove(Shape::Sphere) }])?;
    renderer.update(&mut |_| ())?;

    let [mut image_mean, mut image_high, mut image_share] = [const { Vec::new() }; 3];
    let [mut grid_largest, mut grid_share, mut any_share] = [const { Vec::new() }; 3];
    let (mut points, mut grid_different, mut any_largest) = (0, 0, 0.0_f64);
    for (n, &separation) in plan.separations_mm.iter().enumerate() {
        let seen = compare(&renderer, &volume, plan, separation as f32)?;
        let share = |d: &[f64]| 100.0 * d.iter().filter(|&&d| d > 0.0).count() as f64 / d.len().max(1) as f64;
        image_mean.push([separation, mean(&seen.image)]);
        image_high.push([separation, quantile(&seen.image, 0.99)]);
        image_share.push([separation, share(&seen.image)]);
        grid_largest.push([separation, quantile(&seen.grid, 1.0)]);
        grid_share.push([separation, share(&seen.grid)]);
        any_share.push([separation, share(&seen.any)]);
        points += seen.grid.len();
        grid_different += seen.grid.iter().filter(|&&d| d > 0.0).count();
        any_largest = any_largest.max(quantile(&seen.any, 1.0));
        progress((n + 1) as f64 / plan.separations_mm.len() as f64);
    }
    let image_mean = Series::control("image space, mean", image_mean);
    let image_high = Series::control("image space, 99th percentile", image_high);
    let any_share = Series::ours("data space (ours), any point", any_share);
    let parted = image_mean.points.iter().find(|point| point[1] > 0.0);
    let failing = match parted {
        Some([at, by]) => format!(
            "Image-space occlusion differs between the eyes from {} mm of separation on (by {} in the mean) and at {} mm by {} \
             in the mean, {} at the 99th percentile",
            short(*at),
            short(*by),
            short(nearest(&plan.separations_mm, ADULT_MM)),
            short(image_mean.at(ADULT_MM)),
            short(image_high.at(ADULT_MM))
        ),
        None => "Image-space occlusion did not differ between the eyes".into(),
    };
    let ours = match grid_different {
        0 if points > 0 => format!(
            "ours reads the same bits at all {points} points of the 1/256-voxel grid at every separation up to {} mm; \
             between grid points at most {} % of the points differ, by up to {}",
            short(quantile(&plan.separations_mm, 1.0)),
            short(any_share.largest()),
            short(any_largest)
        ),
        count => format!("OURS DIFFERS at {count} of {points} points"),
    };
    let eyes = || Quantity::linear("distance between the eyes, mm");
    Ok(Finding {
        sentence: format!("{failing}; {ours}."),
        ours: Ours::holding(points > 0 && grid_different == 0),
        control_fails: parted.is_some(),
        setting: format!(
            "engine {}³, {} mm wide, seen from {DISTANCE_MM} mm, opened by a sphere, {}² pixels an eye; 26 rays, radius {RADIUS} \
             voxels for both; image space: 32 samples a pixel",
            plan.edge,
            short(SIZE_MM),
            plan.pixels
        ),
        charts: vec![
            Chart {
                title: "Difference of the ambient factor at points that both eyes see".into(),
                x: eyes(),
                y: Quantity::linear("|left − right| of the ambient factor (0 … 1)"),
                series: vec![
                    image_high,
                    image_mean,
                    Series::ours("data space (ours), largest", grid_largest),
                ],
            },
            Chart {
                title: "Points at which the eyes differ at all".into(),
                x: eyes(),
                y: Quantity::linear("share of the points both see, %"),
                series: vec![
                    Series::control("image space", image_share),
                    any_share,
                    Series::ours("data space (ours), points of the 1/256-voxel grid", grid_share),
                ],
            },
        ],
    })
}

fn nearest(values: &[f64], to: f64) -> f64 {
    values.iter().copied().min_by(|a, b| (a - to).abs().total_cmp(&(b - to).abs())).unwrap_or(to)
}

/// |left − right| of the ambient factor at each point that both eyes see.
struct Differences {
    /// Image space.
    image: Vec<f64>,
    /// V_AO at the points themselves.
    any: Vec<f64>,
    /// V_AO at the points moved to multiples of 1/256 voxel.
    grid: Vec<f64>,
}

fn compare(renderer: &Renderer, volume: &Volume, plan: &Plan, separation_mm: f32) -> Result<Differences> {
    let voxel = volume.min_spacing() as f32;
    let framing = StereoRig::framing(volume.size_mm(), 30.0, 25.0);
    let rig =
        StereoRig { position: framing.position.normalize() * DISTANCE_MM, ipd_mm: separation_mm, ..framing };
    let views = rig.views(1.0, 50.0, 1500.0)?;
    let look = Look::default();
    let (picture, _) = renderer.draw(&views, &look, [plan.pixels; 2])?;

    let size = plan.pixels as usize;
    let settings = Settings { radius_mm: RADIUS * voxel, samples: 32, bias_mm: 0.2 * voxel };
    let shaded = [0, 1].map(|eye| ssao(&picture.depth[eye], [size; 2], &views[eye], &settings));
    let (mut any, mut grid, mut image) = (Vec::new(), Vec::new(), Vec::new());
    let dims = Vec3::from_array(volume.dims.map(|d| d as f32));
    for pixel in 0..size * size {
        let Some((point, other)) = seen_by_both(&picture, &views, pixel, size, voxel) else { continue };
        let index = point / voxel + 0.5 * (dims - 1.0);
        let snapped = (index * 256.0).round() / 256.0;
        any.push(point);
        grid.push((snapped - 0.5 * (dims - 1.0)) * voxel);
        image.push(f64::from((shaded[0][pixel] - shaded[1][other]).abs()));
    }
    let differences = |points: &[Vec3]| -> Result<Vec<f64>> {
        let seen = cao::verify::seen_by_both(renderer, &views, &look, points)?;
        // A difference of bits without one of value would count as none; ambient factors have one zero and no NaN.
        Ok(seen.iter().map(|[l, r]| f64::from((l.ambient - r.ambient).abs())).collect())
    };
    Ok(Differences { any: differences(&any)?, grid: differences(&grid)?, image })
}

/// The point in mm that a pixel of the left picture shows, and the right picture's pixel that shows it too, to a voxel.
fn seen_by_both(
    picture: &StereoImage,
    views: &[View; 2],
    pixel: usize,
    size: usize,
    voxel: f32,
) -> Option<(Vec3, usize)> {
    let distance = |eye: usize, depth: f32| {
        let (n, f) = (views[eye].near_mm, views[eye].far_mm);
        n * f / (f - depth * (f - n))
    };
    let depth = picture.depth[0][pixel];
    if depth >= 1.0 {
        return None;
    }
    let uv = Vec2::new((pixel % size) as f32 + 0.5, (pixel / size) as f32 + 0.5) / size as f32;
    let (origin, direction) = views[0].ray(uv);
    let point = origin + direction * distance(0, depth);
    let (uv, at) = views[1].project(point)?;
    if uv.cmplt(Vec2::ZERO).any() || uv.cmpge(Vec2::ONE).any() {
        return None;
    }
    let place = (uv * size as f32).as_usizevec2();
    let other = place.y * size + place.x;
    let off = distance(1, at) - distance(1, picture.depth[1][other]);
    (off.abs() < voxel).then_some((point, other))
}
