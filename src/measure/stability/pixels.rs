//! The colours of both eyes (CAO §5, measure.md §4): the left picture's surface, looked up in the right picture, as the eyes move apart.
//!
//! A pixel of the left picture shows a point at its depth, where opacity passes ½. It counts where the right picture's four pixels around that
//! point show the same surface, and where the left picture's neighbours do, so that no silhouette is near. Compared is its colour with that
//! of the four, bilinear. Noise of sampling is what the same comparison finds between each eye and itself with its pixels moved by half of
//! their width: the same place and light, another grid, and the most that interpolating between two pixels can do.
//!
//! The matter is opaque, so that there is a surface: through translucent matter two eyes see other light from behind, whatever the method.
//! No highlights: those differ between eyes on real surfaces, too. Control: the same light times occlusion from each eye's depth image
//! ([`cao_twin::measure::ssao`]), with the same radius.

use super::stereo::{ADULT_MM, DISTANCE_MM, RADIUS, SIZE_MM};
use super::{Chart, Effort, Finding, Ours, Quantity, Series, evenly, mean, quantile, tiny};
use crate::Result;
use crate::plot::short;
use cao::renderer::{COLOUR, Renderer};
use cao_gpu::Gpu;
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Pose, Shape};
use cao_model::look::{LightFrom, Look, Shading};
use cao_model::methods::Method;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::{StereoRig, Tangents, View};
use cao_twin::measure::ssao::{Settings, ssao};
use glam::{Vec2, Vec3, Vec4};

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
            Effort::Full => Self { edge: 64, pixels: 192, separations_mm: evenly(0.0, WIDEST_MM, 6) },
            Effort::Quick => Self { edge: 40, pixels: 96, separations_mm: evenly(0.0, WIDEST_MM, 4) },
        }
    }
}

/// Few adults' eyes are farther apart (mm).
const WIDEST_MM: f64 = 75.0;

/// Depths of one surface differ by less than this many voxels from pixel to pixel, and between the eyes; at the edge of something
/// by many more. A wall that is seen at less than some 30° counts as an edge.
const AGREE: f32 = 1.0;

/// Opacities times this, at most 1: whatever shows is a wall.
const OPAQUE: f32 = 20.0;

/// How the eyes are lit.
const LIGHTS: [(LightFrom, &str); 2] = [(LightFrom::Head, "the head"), (LightFrom::World, "the world")];

/// Runs the trial, telling the share done. Uses the device's queue and waits for it.
pub fn run(gpu: &Gpu, plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let stage = Stage::new(gpu, plan)?;
    let total = (LIGHTS.len() * plan.separations_mm.len()) as f64;
    let (mut charts, mut compared) = (Vec::new(), usize::MAX);
    let (mut above, mut fails) = (Vec::new(), true);
    let (mut quoted, mut percentiles) = (Vec::new(), Vec::new());
    for (light_from, from) in LIGHTS {
        let names = ["image space", "ours", "noise of sampling"];
        let mut curves = names.map(|_| [const { Vec::new() }; 2]);
        for &separation in &plan.separations_mm {
            let found = stage.compare(separation as f32, light_from)?;
            for (curve, differences) in curves.iter_mut().zip(&found) {
                curve[0].push([separation, mean(differences)]);
                curve[1].push([separation, quantile(differences, 0.99)]);
                compared = compared.min(differences.len());
            }
            progress((charts.len() * plan.separations_mm.len() + curves[0][0].len()) as f64 / total);
        }
        let [image, ours, noise] = curves;
        for part in 0..2 {
            let over = ours[part].iter().zip(&noise[part]).find(|(o, n)| o[1].is_nan() || o[1] > n[1]);
            above.extend(
                over.map(|(o, n)| format!("{} against {} at {} mm", tiny(o[1]), tiny(n[1]), short(o[0]))),
            );
        }
        // In the mean: the largest differences are at edges that this comparison sees in any method. Equal eyes see the same in any.
        let apart = || image[0].iter().zip(&noise[0]).filter(|(image, _)| image[0] > 0.0);
        fails &= apart().count() > 0 && apart().all(|(image, noise)| image[1] > noise[1]);
        let series =
            |make: fn(String, Vec<[f64; 2]>) -> Series, name: &str, [mean, high]: [Vec<[f64; 2]>; 2]| {
                [make(format!("{name}, mean"), mean), make(format!("{name}, 99th percentile"), high)]
            };
        let series: Vec<Series> = [
            series(Series::control, names[0], image),
            series(Series::ours, names[1], ours),
            series(Series::yardstick, names[2], noise),
        ]
        .concat();
        let at = |n: usize| tiny(series[n].at(ADULT_MM));
        quoted.push(format!(
            "light from {from}: image space {} ({}), ours {} ({}), noise {} ({})",
            at(0),
            at(1),
            at(2),
            at(3),
            at(4),
            at(5)
        ));
        let eyes = || Quantity::linear("distance between the eyes, mm");
        let difference = || Quantity::linear("|left − right|, linear light (0 … 1)");
        let title = format!("Colours of a surface that both eyes see, light from {from}");
        // Means apart from percentiles, which are ten times as large.
        let [means, high] = [0, 1].map(|part| series.iter().skip(part).step_by(2).cloned().collect());
        charts.push(Chart { title: title.clone(), x: eyes(), y: difference(), series: means });
        percentiles.push(Chart { title, x: eyes(), y: difference(), series: high });
    }
    charts.append(&mut percentiles);
    let holds = above.is_empty() && compared > 0;
    let nearest = plan
        .separations_mm
        .iter()
        .copied()
        .min_by(|a, b| (a - ADULT_MM).abs().total_cmp(&(b - ADULT_MM).abs()));
    Ok(Finding {
        sentence: format!(
            "At {} mm of separation the colours of the same surface differ between the eyes, in the mean (and at the 99th percentile), with {}; {}.",
            short(nearest.unwrap_or(ADULT_MM)),
            quoted.join("; with "),
            match above.first() {
                None =>
                    format!("ours stays below the noise at every separation, at {compared} pixels or more"),
                Some(first) => format!("OURS IS ABOVE THE NOISE: {first}"),
            }
        ),
        ours: Ours::holding(holds),
        control_fails: fails,
        setting: format!(
            "opaque engine {}³, {} mm wide, seen from {DISTANCE_MM} mm, opened by a sphere, {}² pixels an eye, one sample a pixel, no highlights; radius {RADIUS} voxels for both; \
             image space: 32 samples a pixel; noise: pixels moved by half of their width",
            plan.edge,
            short(SIZE_MM),
            plan.pixels
        ),
        charts,
    })
}

struct Stage {
    renderer: Renderer,
    /// Where the head is.
    rig: StereoRig,
    voxel: f32,
    pixels: u32,
}

/// What an eye sees.
struct Eye {
    view: View,
    colour: Vec<[f32; 4]>,
    depth: Vec<f32>,
}

impl Stage {
    fn new(gpu: &Gpu, plan: &Plan) -> Result<Self> {
        let voxel = SIZE_MM / plan.edge as f64;
        let volume = builtin_box("engine", [plan.edge; 3], [voxel; 3])?;
        let mut setup = Setup::of(Method::default(), voxel);
        setup.occlusion.radius_mm = RADIUS * voxel as f32;
        let mut transfer = TransferFunction::preset("auto", volume.range())?;
        transfer.opacity.iter_mut().for_each(|point| point[1] = (OPAQUE * point[1]).min(1.0));
        let mut renderer = Renderer::new(gpu, &volume, transfer, setup, COLOUR)?;
        let pose = Pose {
            translate_mm: Vec3::new(0.23, -0.3, 0.23) * SIZE_MM as f32,
            scale: Vec3::splat(0.3 * SIZE_MM as f32),
            ..Pose::default()
        };
        renderer.set_clips(&[Clip { pose, ..Clip::remove(Shape::Sphere) }])?;
        renderer.update(&mut |_| ())?;
        let framing = StereoRig::framing(volume.size_mm(), 30.0, 25.0);
        let rig = StereoRig { position: framing.position.normalize() * DISTANCE_MM, ..framing };
        Ok(Self { renderer, rig, voxel: voxel as f32, pixels: plan.pixels })
    }

    /// Differences in image space, of ours, and of the noise.
    fn compare(&self, separation_mm: f32, light_from: LightFrom) -> Result<[Vec<f64>; 3]> {
        let views = StereoRig { ipd_mm: separation_mm, ..self.rig }.views(1.0, 50.0, 1500.0)?;
        let look = Look { specular: 0.0, light_from, ..Look::default() };
        let [left, right] = self.draw(&views, &look)?;
        let noise = views.map(|view| -> Result<Vec<f64>> {
            let [one, moved] =
                self.draw(&[view, View { tan: moved(view.tan, self.pixels), ..view }], &look)?;
            Ok(self.differences(&one, &moved))
        });
        let [left_noise, right_noise] = noise;
        let noise: Vec<f64> = [left_noise?, right_noise?].concat();
        let unlit = Look { shading: Shading::Phong, ..look };
        let [mut image_left, mut image_right] = self.draw(&views, &unlit)?;
        for eye in [&mut image_left, &mut image_right] {
            self.occlude(eye, look.gain);
        }
        Ok([self.differences(&image_left, &image_right), self.differences(&left, &right), noise])
    }

    fn draw(&self, views: &[View; 2], look: &Look) -> Result<[Eye; 2]> {
        let (image, _) = self.renderer.draw(views, look, [self.pixels; 2])?;
        let ([left, right], [left_depth, right_depth]) = (image.colour, image.depth);
        let eye = |eye: usize, colour, depth| Eye { view: views[eye], colour, depth };
        Ok([eye(0, left, left_depth), eye(1, right, right_depth)])
    }

    /// Image-space occlusion instead of data-space values; a flat wall has 1 there and 1/2 here.
    fn occlude(&self, eye: &mut Eye, gain: f32) {
        let settings = Settings { radius_mm: RADIUS * self.voxel, samples: 32, bias_mm: 0.2 * self.voxel };
        let factors = ssao(&eye.depth, [self.pixels as usize; 2], &eye.view, &settings);
        for (pixel, factor) in eye.colour.iter_mut().zip(factors) {
            let light = 0.5 * gain * factor;
            (pixel[0], pixel[1], pixel[2]) = (pixel[0] * light, pixel[1] * light, pixel[2] * light);
        }
    }

    /// Mean |difference| of the three colours at each pixel of one eye whose surface the other one sees, too.
    fn differences(&self, one: &Eye, other: &Eye) -> Vec<f64> {
        let size = self.pixels as usize;
        let inside = 1..size - 1;
        let pixels = inside.clone().flat_map(|y| inside.clone().map(move |x| (x, y)));
        pixels.filter_map(|(x, y)| self.difference(one, other, x, y)).collect()
    }

    fn difference(&self, one: &Eye, other: &Eye, x: usize, y: usize) -> Option<f64> {
        let (size, agree) = (self.pixels as usize, AGREE * self.voxel);
        let at = |x: usize, y: usize| y * size + x;
        let distance = one.distance(one.depth[at(x, y)])?;
        let around = [at(x - 1, y), at(x + 1, y), at(x, y - 1), at(x, y + 1)];
        let flat =
            around.iter().all(|&i| one.distance(one.depth[i]).is_some_and(|d| (d - distance).abs() < agree));
        if !flat {
            return None;
        }
        let uv = (Vec2::new(x as f32, y as f32) + 0.5) / size as f32;
        let (origin, direction) = one.view.ray(uv);
        let (uv, depth) = other.view.project(origin + direction * distance)?;
        let expected = other.distance(depth)?;
        let place = uv * size as f32 - 0.5;
        let low = place.floor();
        if low.cmplt(Vec2::ZERO).any() || low.cmpge(Vec2::splat(size as f32 - 1.0)).any() {
            return None;
        }
        let (low, w) = (low.as_usizevec2(), place - low);
        let mut seen = Vec4::ZERO;
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let i = at(low.x + dx, low.y + dy);
            if (other.distance(other.depth[i])? - expected).abs() >= agree {
                return None;
            }
            let along = |d: usize, w: f32| if d == 1 { w } else { 1.0 - w };
            seen += along(dx, w.x) * along(dy, w.y) * Vec4::from_array(other.colour[i]);
        }
        let apart = (Vec4::from_array(one.colour[at(x, y)]) - seen).truncate().abs();
        Some(f64::from(apart.element_sum() / 3.0))
    }
}

impl Eye {
    /// Along the view axis in mm; `None` where nothing is shown.
    fn distance(&self, depth: f32) -> Option<f32> {
        let (near, far) = (self.view.near_mm, self.view.far_mm);
        (depth < 1.0).then(|| near * far / (far - depth * (far - near)))
    }
}

/// The same field of view, half a pixel to the right.
fn moved(tan: Tangents, pixels: u32) -> Tangents {
    let half = 0.5 * (tan.right - tan.left) / pixels as f32;
    Tangents { left: tan.left + half, right: tan.right + half, ..tan }
}
