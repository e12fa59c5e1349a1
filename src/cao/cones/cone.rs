//! Cones over mip levels (`cao_twin::cones::cone` has the equations): every voxel of the listed bricks that needs a value, along every
//! direction of a set.
//!
//! In: `opacity` V_o, its mip levels, the list. Out: `ambient` V_AO (3D r16unorm) in the listed bricks, one write a voxel. Cost: two look-ups a
//! step of each cone, some eight steps for 20 voxels.

use crate::drive::Take;
use crate::field::Field;
use crate::field::bricks::BrickList;
use crate::pyramid::levels::{LevelImages, MakeLevels};
use crate::pyramid::plan::{MOST, Plan, too_far};
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Image, Pipeline, Recorder};
use cao_kernels::cone as kernel;
use cao_model::occlusion::{Occlusion, RaySet};
use cao_model::options::Levels;
use cao_model::settings::Scope;

/// A cone's share of the sphere is at most this: its half angle then is 60°.
const WIDEST: f64 = 0.25;

/// Cones from every voxel.
#[derive(Clone, Debug, PartialEq)]
pub struct ConePlan {
    /// As the kernel reads them.
    pub cones: Vec<kernel::Cone>,
    /// How far in voxels a change of opacity can change values: to the end along each axis, and the cells that are looked up there.
    pub reach: [u32; 3],
    /// Where cones begin and end, in smallest spacings.
    start: f32,
    end: f32,
}

impl ConePlan {
    /// The cones of these settings, which hold, at voxels of this spacing in mm; and the levels that they look up.
    ///
    /// # Errors
    /// [`cao_model::Error::Limit`] for a radius above [`crate::pyramid::plan::MOST_VOXELS`], [`cao_model::Error::Config`] for
    /// directions so few that their cones are wider than 60° to each side.
    pub fn new(dims: [u32; 3], spacing: [f32; 3], occlusion: &Occlusion) -> cao_model::Result<(Self, Plan)> {
        let smallest = spacing.into_iter().fold(f32::INFINITY, f32::min);
        too_far(occlusion.radius_mm, smallest)?;
        let directions = occlusion.rays.directions();
        if directions.iter().any(|(_, weight)| *weight > WIDEST) {
            let problem = format!("{}: expected four directions at least", occlusion.rays.name());
            return Err(cao_model::Error::refused("rays", problem));
        }
        let cones: Vec<kernel::Cone> = directions
            .into_iter()
            .map(|(d, weight)| {
                let cosine = 1.0 - 2.0 * weight;
                kernel::Cone {
                    step: std::array::from_fn(|i| (d[i] * f64::from(smallest / spacing[i])) as f32),
                    share: (weight * f64::from(kernel::FINE)) as f32,
                    tangent: ((1.0 - cosine * cosine).sqrt() / cosine) as f32,
                    pad: Default::default(),
                }
            })
            .collect();
        let widest = cones.iter().map(|cone| cone.tangent).fold(0.0, f32::max);
        let end = occlusion.radius_mm / smallest;
        // Of a radius of 0 it is −∞, which is none.
        let levels = ((2.0 * end * widest).log2().ceil().max(0.0) as u32).min(MOST);
        let plan = Plan::of(dims, spacing, levels, Levels::Mip, 0.0);
        let farthest = |i: usize| cones.iter().map(|cone| end * cone.step[i].abs()).fold(0.0, f32::max);
        let reach = plan.reach(std::array::from_fn(farthest));
        let start = occlusion.offset_mm.map_or(0.5, |offset| offset / smallest);
        Ok((Self { cones, reach, start, end }, plan))
    }
}

/// What the kernel reads and writes.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// V_o.
    pub opacity: &'a Image,
    /// How levels are looked up.
    pub make: &'a MakeLevels,
    /// The mip levels.
    pub levels: &'a LevelImages,
    /// Bricks to work on.
    pub list: &'a BrickList,
    /// V_AO.
    pub ambient: &'a Image,
}

/// The kernel `cone`.
pub struct ConeTracing {
    pipeline: Pipeline,
    cones: Buffer,
}

impl ConeTracing {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let room = size_of::<kernel::Cone>() as u64 * u64::from(RaySet::MOST);
        Ok(Self {
            pipeline: gpu.compute(&kernel::SHADER, "main")?,
            cones: gpu.buffer("cones", room, BufferUse::Device)?,
        })
    }

    /// Writes the cones of a plan; once after each change of the settings.
    pub fn record_cones(&self, rec: &mut Recorder, plan: &ConePlan) -> Result<()> {
        rec.barrier(&[Access::StorageRead], &[Access::TransferWrite]);
        rec.update(&self.cones, 0, bytemuck::cast_slice(&plan.cones))?;
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead]);
        Ok(())
    }

    /// Works on the list, or some of its bricks, along the cones written last. `opacity` is per `reference_mm`.
    #[expect(clippy::too_many_arguments, reason = "settings and bindings of the kernel, each named once")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        plan: &ConePlan,
        reference_mm: f32,
        scope: Scope,
        b: Bindings,
        take: &Take,
    ) -> Result<()> {
        let params = kernel::ConeParams {
            dims: field.dims,
            // Cones that end where they begin have no light to lose.
            directions: if plan.end > plan.start { plan.cones.len() as u32 } else { 0 },
            bricks: field.bricks(),
            base: take.first(),
            unneeded: u32::from(scope == Scope::All),
            exponent: field.min_spacing() / reference_mm,
            start: plan.start,
            end: plan.end,
            levels: b.levels.plan.levels() as f32,
            pad: Default::default(),
        };
        let [level_1, level_2, level_3, level_4, level_5, level_6, level_7, level_8, level_9] =
            b.levels.bound(b.opacity);
        let binds = kernel::MainBindings {
            opacity: b.opacity,
            field: &b.make.field,
            table: &b.make.table,
            list: &b.list.buffer,
            ambient: b.ambient,
            cones: &self.cones,
            level_1,
            level_2,
            level_3,
            level_4,
            level_5,
            level_6,
            level_7,
            level_8,
            level_9,
        };
        take.dispatch(rec, &self.pipeline, &binds, bytemuck::bytes_of(&params), &b.list.buffer)
    }
}
