//! Odd eyes (CAO §3.5 step 6, measure.md §4): inside the volume, with the near plane inside, equal, with asymmetric fields of view. No
//! holes, no NaN, and both eyes read the same.
//!
//! An opaque block, so that every ray that meets it has to stop; what both eyes read is compared in an engine of the same size. Control of the holes: rays that begin on the block's front faces, as
//! those do that are started by rasterizing them: where the near plane or the eye is past the face, there is none. Control of the
//! asymmetric eyes: a projection that takes them for symmetric, of the same width.

use super::{Chart, Effort, Finding, Ours, Quantity, Series, tiny};
use crate::exactness::{Stereo, compare_views};
use crate::plot::short;
use crate::random::Random;
use crate::{Error, Result};
use cao::renderer::{COLOUR, Renderer, StereoImage};
use cao_gpu::Gpu;
use cao_model::builtin::builtin_box;
use cao_model::look::Look;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::{StereoRig, Tangents, View};
use cao_model::volume::Volume;
use glam::{Vec2, Vec3};

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Voxels along an edge of the volume.
    pub edge: usize,
    /// Pixels along an edge of a picture, a multiple of 16.
    pub pixels: u32,
    /// Distances of the head from the block's centre, in half-edges of the block.
    pub distances: Vec<f64>,
    /// Shifts of the field of view as a share of its half-width, multiples of 1/8.
    pub shifts: Vec<f64>,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self {
                edge: 40,
                pixels: 128,
                distances: super::evenly(0.0, 2.5, 26),
                shifts: super::evenly(0.0, 1.0, 9),
            },
            Effort::Quick => Self {
                edge: 24,
                pixels: 64,
                distances: super::evenly(0.0, 2.5, 6),
                shifts: vec![0.0, 0.25, 0.5, 1.0],
            },
        }
    }
}

/// The near plane in half-edges: far enough that it enters the block before the eye does.
const NEAR: f32 = 0.2;

/// A ray that runs through less of the block than this many voxels may stay below full opacity: it only touches an edge.
const TOUCH: f32 = 2.0;

/// What two pictures of the same rays may differ by: positions are computed from other numbers and rounded, which moves samples by some
/// 1e-5 of a voxel, and samples at the block's edges come and go.
pub const SAME_RAYS: f64 = 2e-3;

/// Runs the trial, telling the share done. Uses the device's queue and waits for it.
pub fn run(gpu: &Gpu, plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let stage = Stage::new(gpu, plan)?;
    let total = (plan.distances.len() + plan.shifts.len()) as f64;
    let mut random = Random::new(1);
    let (mut holes, mut front_holes) = (Vec::new(), Vec::new());
    let (mut nan, mut unequal, mut eyes) = (0, 0, Stereo::default());
    for (n, &distance) in plan.distances.iter().enumerate() {
        let rig = stage.rig(distance as f32);
        let views = stage.views(rig)?;
        let picture = stage.draw(&views)?;
        let [ours, front] = stage.holes(&views, &picture);
        holes.push([distance, ours]);
        front_holes.push([distance, front]);
        nan += numberless(&picture);
        // The same eye twice sees the same picture, bit for bit.
        let same = stage.draw(&stage.views(StereoRig { ipd_mm: 0.0, ..rig })?)?;
        unequal += usize::from(same.colour[0] != same.colour[1] || same.depth[0] != same.depth[1]);
        add(&mut eyes, compare_views(&stage.engine, &views, &mut random)?);
        progress((n + 1) as f64 / total);
    }
    let (mut shifted, mut mistaken) = (Vec::new(), Vec::new());
    for (n, &shift) in plan.shifts.iter().enumerate() {
        let [ours, symmetric, values] = stage.asymmetric(shift as f32, &mut eyes, &mut random)?;
        shifted.push([shift, ours]);
        mistaken.push([shift, symmetric]);
        nan += values as usize;
        progress((plan.distances.len() + n + 1) as f64 / total);
    }
    let front = Series::control("rays that begin on front faces behind the near plane", front_holes);
    let holes = Series::ours("ours", holes);
    let mistaken = Series::control("taken for symmetric", mistaken);
    let shifted = Series::ours("ours", shifted);
    let first = front.points.iter().rev().find(|point| point[1] > 0.0).map_or(0.0, |point| point[0]);
    let holds = holes.largest() == 0.0
        && nan == 0
        && unequal == 0
        && eyes.points > 0
        && eyes.different == 0
        && shifted.largest() <= SAME_RAYS;
    Ok(Finding {
        sentence: format!(
            "Rays that begin on front faces leave holes at distances of {} half-edges and less ({} % of the block's pixels at the centre), and \
             asymmetric eyes that are taken for symmetric are off by {}; {} {} holes, {nan} NaN, {unequal} of {} equal eyes with other \
             pictures, {} of {} points that the eyes read differently, and asymmetric eyes off by {}.",
            short(first),
            short(front.at(0.0)),
            short(mistaken.largest()),
            if holds { "ours has" } else { "OURS HAS" },
            short(holes.largest()),
            plan.distances.len(),
            eyes.different,
            eyes.points,
            tiny(shifted.largest()),
        ),
        ours: Ours::holding(holds),
        control_fails: front.largest() > 0.0 && mistaken.largest() > 10.0 * SAME_RAYS,
        setting: format!(
            "opaque block {0}³, {1}² pixels an eye, near plane {NEAR} half-edges before the eye, eyes a tenth of a half-edge apart; what both eyes read at points of the \
             1/256-voxel grid near surfaces of an engine of the same size",
            plan.edge, plan.pixels
        ),
        charts: vec![
            Chart {
                title: "Holes as the head moves into the block".into(),
                x: Quantity::linear("distance of the head from the centre, half-edges of the block"),
                y: Quantity::linear("pixels that should be opaque and are not, %"),
                series: vec![front, holes],
            },
            Chart {
                title: "Asymmetric field of view against the same part of a wider symmetric picture".into(),
                x: Quantity::linear("shift of the field of view, half-widths"),
                y: Quantity::linear("mean |difference|, linear light (0 … 1)"),
                series: vec![mistaken, shifted],
            },
        ],
    })
}

fn add(sum: &mut Stereo, more: Stereo) {
    sum.points += more.points;
    sum.different += more.different;
    sum.largest = sum.largest.max(more.largest);
}

/// Values of a picture that are no numbers.
fn numberless(picture: &StereoImage) -> usize {
    let colours = picture.colour.iter().flatten().flatten();
    colours.chain(picture.depth.iter().flatten()).filter(|v| !v.is_finite()).count()
}

struct Stage {
    /// The opaque block.
    renderer: Renderer,
    /// An engine of the same size, whose surfaces eyes see from anywhere in it.
    engine: Renderer,
    half: f32,
    pixels: u32,
}

impl Stage {
    fn new(gpu: &Gpu, plan: &Plan) -> Result<Self> {
        let volume = builtin_box("uniform", [plan.edge; 3], [1.0; 3])?;
        let occlusion = Occlusion {
            rays: RaySet::R14,
            quadrature: Quadrature::Left,
            radius_mm: 5.0,
            offset_mm: None,
            step_mm: None,
            ..Occlusion::paper(1.0)
        };
        let setup = Setup { occlusion, ..Setup::of(Method::Cao, 1.0) };
        let ready = |volume: &Volume, transfer| {
            let mut renderer = Renderer::new(gpu, volume, transfer, setup, COLOUR)?;
            renderer.update(&mut |_| ())?;
            Ok::<_, Error>(renderer)
        };
        let opaque = TransferFunction::new(vec![[0.0, 1.0]], vec![[0.0, 0.8, 0.7, 0.6]], None)?;
        let engine = builtin_box("engine", [plan.edge; 3], [1.0; 3])?;
        Ok(Self {
            renderer: ready(&volume, opaque)?,
            engine: ready(&engine, TransferFunction::preset("auto", engine.range())?)?,
            half: 0.5 * plan.edge as f32,
            pixels: plan.pixels,
        })
    }

    fn rig(&self, distance: f32) -> StereoRig {
        let from = Vec3::new(0.5, -0.8, 0.4).normalize();
        let position = from * (distance * self.half);
        StereoRig {
            position,
            // Ahead of the head, also where that stands in the centre.
            target: position - from * self.half,
            up: Vec3::Z,
            ipd_mm: 0.1 * self.half,
            fov_deg: 50.0,
            screen_mm: None,
        }
    }

    fn views(&self, rig: StereoRig) -> Result<[View; 2]> {
        Ok(rig.views(1.0, NEAR * self.half, 20.0 * self.half)?)
    }

    fn draw(&self, views: &[View; 2]) -> Result<StereoImage> {
        Ok(self.renderer.draw(views, &Look::default(), [self.pixels; 2])?.0)
    }

    /// Share in % of the pixels whose ray has to stop in the block, and does not; and whose ray would not begin on a front face.
    fn holes(&self, views: &[View; 2], picture: &StereoImage) -> [f64; 2] {
        let (mut all, mut ours, mut front) = (0_u32, 0_u32, 0_u32);
        for (view, colour) in views.iter().zip(&picture.colour) {
            for (i, pixel) in colour.iter().enumerate() {
                let at = [i as u32 % self.pixels, i as u32 / self.pixels].map(|c| c as f32 + 0.5);
                let (origin, direction) = view.ray(Vec2::from_array(at) / self.pixels as f32);
                let (a, b) = (
                    (Vec3::splat(-self.half) - origin) / direction,
                    (Vec3::splat(self.half) - origin) / direction,
                );
                let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
                if (leave - enter.max(view.near_mm)) * direction.length() < TOUCH {
                    continue;
                }
                all += 1;
                ours += u32::from(pixel[3] < 0.99);
                front += u32::from(enter < view.near_mm);
            }
        }
        [ours, front].map(|count| 100.0 * f64::from(count) / f64::from(all.max(1)))
    }

    /// Eyes whose field of view is shifted by `shift` half-widths, the left to the left and the right to the right: difference to the same
    /// part of one wide picture, the same where they are taken for symmetric, and values that are no numbers.
    fn asymmetric(&self, shift: f32, eyes: &mut Stereo, random: &mut Random) -> Result<[f64; 3]> {
        let half_width = 0.35;
        let rig = StereoRig { ipd_mm: 0.0, ..self.rig(2.2) };
        let [straight, _] = self.views(rig)?;
        let look = Look::default();
        // Twice as wide as an eye's, with the same pixels.
        let tan = |left: f32, right: f32| Tangents { left, right, up: half_width, down: -half_width };
        let wide = View { tan: tan(-2.0 * half_width, 2.0 * half_width), ..straight };
        let (wide, _) = self.renderer.draw(&[wide; 2], &look, [2 * self.pixels, self.pixels])?;
        let aside = |side: f32| View {
            tan: tan(half_width * (-1.0 + side * shift), half_width * (1.0 + side * shift)),
            ..straight
        };
        let views = [aside(-1.0), aside(1.0)];
        let (picture, _) = self.renderer.draw(&views, &look, [self.pixels; 2])?;
        let symmetric = View { tan: tan(-half_width, half_width), ..straight };
        let (plain, _) = self.renderer.draw(&[symmetric; 2], &look, [self.pixels; 2])?;
        add(eyes, compare_views(&self.engine, &views, random)?);

        let offset = |eye: usize| {
            let side = if eye == 0 { -1.0 } else { 1.0 };
            (0.5 * self.pixels as f32 * (1.0 + side * shift)).round() as u32
        };
        let differences = |picture: &StereoImage| {
            let mut all = Vec::new();
            for eye in 0..2 {
                for (i, pixel) in picture.colour[eye].iter().enumerate() {
                    let (x, y) = (i as u32 % self.pixels, i as u32 / self.pixels);
                    let other = wide.colour[eye][(y * 2 * self.pixels + x + offset(eye)) as usize];
                    all.push(f64::from((pixel[1] - other[1]).abs()));
                }
            }
            super::mean(&all)
        };
        Ok([differences(&picture), differences(&plain), numberless(&picture) as f64])
    }
}
