//! The two central claims, as a measurement: after a clip has moved, the ambient values equal a full recomputation bit for bit
//! (CAO §4; of [`Method::Cao`](cao_model::methods::Method::Cao): contextual LAO = LAO), and both eyes read the same ambient factor at the
//! same point (CAO §5).

use super::random::Random;
use crate::Result;
use cao::ambient::Categories;
use cao::renderer::Renderer;
use cao::verify::compare::Difference;
use cao_gpu::{Phase, Timings};
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::look::Look;
use cao_model::view::{StereoRig, View};
use glam::Vec3;

/// What is tried.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Shapes to clip with.
    pub shapes: Vec<Shape>,
    /// Random poses of each shape.
    pub poses: u32,
    /// Seed of the poses and views.
    pub seed: u64,
}

/// One clip and what it showed.
#[derive(Clone, Debug)]
pub struct Cut {
    /// The clip.
    pub clip: Clip,
    /// The full recomputation against the update.
    pub difference: Difference,
    /// Voxels of each category.
    pub categories: Categories,
    /// Stages of the update after the clip moved, classification included, ms.
    pub contextual: Timings,
    /// Stages of the full recomputation of the same volume, ms.
    pub full: Timings,
}

/// Left eye against right.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stereo {
    /// Points of the volume that both eyes see.
    pub points: u64,
    /// Of these, points at which the ambient factors' bits differ.
    pub different: u64,
    /// Largest difference among them.
    pub largest: f32,
}

/// Everything that was tried.
#[derive(Clone, Debug)]
pub struct Report {
    /// Each clip.
    pub cuts: Vec<Cut>,
    /// All views together.
    pub stereo: Stereo,
}

impl Report {
    /// All cuts together.
    pub fn total(&self) -> Difference {
        self.cuts.iter().fold(Difference::default(), |sum, cut| Difference {
            compared: sum.compared + cut.difference.compared,
            different: sum.different + cut.difference.different,
            largest: sum.largest.max(cut.difference.largest),
            recomputed: sum.recomputed + cut.difference.recomputed,
        })
    }

    /// Median over the cuts of full time / contextual time.
    pub fn speedup(&self) -> f64 {
        let mut ratios: Vec<f64> =
            self.cuts.iter().map(|cut| cut.full.total() / cut.contextual.total().max(1e-6)).collect();
        ratios.sort_by(f64::total_cmp);
        ratios.get(ratios.len() / 2).copied().unwrap_or(1.0)
    }

    /// Whether either claim was tried on nothing: no voxel was compared, or no point seen by both eyes.
    pub fn vacuous(&self) -> bool {
        self.total().compared == 0 || self.stereo.points == 0
    }

    /// Whether nothing differs, in any voxel or between the eyes, and there was something that could.
    pub fn exact(&self) -> bool {
        !self.vacuous() && self.total().different == 0 && self.stereo.different == 0
    }

    /// Share of all voxels that the clips affected (category b), the paper's measure of the contextual work (CAO §4); of methods that do not
    /// tell voxels apart, in whole bricks.
    pub fn affected(&self) -> f64 {
        let sum = |of: fn(&Categories) -> u64| self.cuts.iter().map(|cut| of(&cut.categories) as f64).sum();
        let (affected, other): (f64, f64) = (sum(|c| c.affected), sum(|c| c.clipped) + sum(|c| c.untouched));
        affected / (affected + other).max(1.0)
    }
}

/// Points at which the eyes are compared, before asking which of them both eyes see.
const CANDIDATES: usize = 20_000;

/// Opacity from which a voxel belongs to a surface.
const SOLID: f32 = 0.05;

/// A point counts as seen when at least this much of its light reaches the eye.
const SEEN: f32 = 0.3;

/// Clips the renderer's volume with every shape at random poses, updates by its method, recomputes in full and compares.
/// `progress` hears the share done.
pub fn verify(renderer: &mut Renderer, plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Report> {
    let mut random = Random::new(plan.seed);
    let total = (plan.shapes.len() as u32 * plan.poses).max(1);
    let mut report = Report { cuts: Vec::new(), stereo: Stereo::default() };
    for shape in &plan.shapes {
        for pose in 0..plan.poses {
            let clip = random_clip(&mut random, renderer, shape, pose);
            renderer.set_clips(std::slice::from_ref(&clip))?;
            let done = f64::from(report.cuts.len() as u32);
            let contextual = renderer.update(&mut |_| ())?;
            let (difference, full) =
                cao::verify::verify(renderer, &mut |part| progress((done + part) / f64::from(total)))?;
            // The first update also computes V_PAO, which belongs to neither.
            let contextual = contextual.into_iter().filter(|timing| timing.stage.phase != Phase::Prepare);
            report.cuts.push(Cut {
                clip,
                difference,
                categories: renderer.categories()?,
                contextual: contextual.collect(),
                full,
            });
            // The first pose is an ordinary one; others may leave nothing to see.
            if pose == 0 {
                let seen = compare_eyes(renderer, &mut random)?;
                report.stereo.points += seen.points;
                report.stereo.different += seen.different;
                report.stereo.largest = report.stereo.largest.max(seen.largest);
            }
        }
    }
    Ok(report)
}

/// A random pose of a shape: in turn ordinary, across the border, tiny, covering everything, outside; either side hidden.
pub fn random_clip(random: &mut Random, renderer: &Renderer, shape: &Shape, turn: u32) -> Clip {
    let field = renderer.field();
    let size = Vec3::from_array(std::array::from_fn(|i| field.dims[i] as f32 * field.spacing[i]));
    let half = 0.5 * size.max_element();
    let voxel = field.min_spacing();
    let mut in_box = |edge: f32| Vec3::from_array([(); 3].map(|()| random.between(-0.5, 0.5))) * size * edge;
    let (place, low, high) = match turn % 5 {
        0 => (in_box(0.7), 0.15 * half, 0.6 * half),
        1 => (in_box(1.3), 0.2 * half, 0.8 * half),
        2 => (in_box(0.9), 0.3 * voxel, 1.5 * voxel),
        3 => (in_box(0.1), 4.0 * half, 5.0 * half),
        _ => (Vec3::splat(4.0 * half) + in_box(1.0), 0.2 * half, 0.5 * half),
    };
    // A mesh in a file has a size of its own; its pose scales that to the unit that shapes have.
    let unit = match shape {
        Shape::Mesh(mesh) => {
            let (low, high) = mesh.bounds();
            0.5 * (high - low).max_element()
        }
        _ => 1.0,
    };
    let scale = Vec3::from_array([(); 3].map(|()| random.between(low, high))) / unit;
    let rotate_deg = Vec3::from_array([(); 3].map(|()| random.between(-180.0, 180.0)));
    let pose = Pose { translate_mm: place, rotate_deg, scale };
    let mode = if random.below(3) == 0 { Mode::Keep } else { Mode::Remove };
    Clip { shape: shape.clone(), mode, pose }
}

/// Compares what two eyes in a random place read at random points near surfaces that both see. The points lie up to 3/8
/// voxel from a voxel's centre along each axis, so that values are interpolated, and on multiples of 1/256 voxel, where the
/// rounding of positions (`spirv/shared/eyes.wgsl`) cannot part the eyes.
pub fn compare_eyes(renderer: &Renderer, random: &mut Random) -> Result<Stereo> {
    let field = renderer.field();
    let size: [f64; 3] = std::array::from_fn(|i| f64::from(field.dims[i] as f32 * field.spacing[i]));
    let rig = StereoRig::framing(size, random.between(0.0, 360.0), random.between(-80.0, 80.0));
    let far = 4.0 * (rig.position - rig.target).length();
    compare_views(renderer, &rig.views(1.0, far * 1e-3, far)?, random)
}

/// The same for given eyes.
pub fn compare_views(renderer: &Renderer, views: &[View; 2], random: &mut Random) -> Result<Stereo> {
    let field = renderer.field();
    let opacity = renderer.read_opacity()?;
    let mut points = Vec::new();
    let [x, y, _] = field.dims.map(|d| d as usize);
    // On surfaces, where eyes look: opaque beside transparent.
    let surface = |voxel: usize| {
        let beside = [voxel.wrapping_sub(1), voxel + 1, voxel.wrapping_sub(x), voxel + x];
        let beyond = [voxel.wrapping_sub(x * y), voxel + x * y];
        let clear = |n: &usize| opacity.get(*n).is_none_or(|a| *a <= SOLID);
        opacity[voxel] > SOLID && beside.iter().chain(&beyond).any(clear)
    };
    for _ in 0..100 * CANDIDATES {
        let voxel = random.below(opacity.len() as u64) as usize;
        if points.len() < CANDIDATES && surface(voxel) {
            let index = Vec3::new((voxel % x) as f32, (voxel / x % y) as f32, (voxel / (x * y)) as f32);
            let dims = Vec3::from_array(field.dims.map(|d| d as f32));
            let aside = Vec3::from_array([(); 3].map(|()| random.below(193) as f32 - 96.0)) / 256.0;
            points.push((index + aside - 0.5 * (dims - 1.0)) * Vec3::from_array(field.spacing));
        }
    }
    let mut stereo = Stereo::default();
    for [left, right] in cao::verify::seen_by_both(renderer, views, &Look::default(), &points)? {
        if left.transmittance >= SEEN && right.transmittance >= SEEN {
            stereo.points += 1;
            if left.ambient.to_bits() != right.ambient.to_bits() {
                stereo.different += 1;
                stereo.largest = stereo.largest.max((left.ambient - right.ambient).abs());
            }
        }
    }
    Ok(stereo)
}
