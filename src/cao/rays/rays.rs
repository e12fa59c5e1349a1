//! Rays by brick (method.md §4; `cao_twin::rays::rays` has the equations): every voxel of the listed bricks that needs a value, along every
//! direction of a plan.
//!
//! In: `opacity` V_o (3D r16unorm, the only form of it), the list of bricks. Out: `ambient` V_AO (3D r16unorm; of coloured light rgba16unorm:
//! red, green, blue, 1) in the listed bricks, one write a voxel. Cost: N·M reads of V_o a voxel at most; a ray ends when it is dark or leaves the volume. Forms that were timed on a
//! GPU: `benches/runs/2026-11-26-h200-rays-prototype/`.

use super::ruled::Ruled;
use crate::drive::Take;
use crate::field::Field;
use crate::field::bricks::BrickList;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Image, Recorder};
use cao_kernels::rays as kernel;
use cao_model::light::Lights;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::Scope;

/// Longest ray, offset included, in smallest spacings: what was tested.
pub const MOST_VOXELS: f32 = 256.0;

/// What rays there are from every voxel: M cells of one step each, the m-th with its middle at m steps where rays begin half a step from
/// their voxel, as they do unless an offset is given; they end in the middle of the last.
#[derive(Clone, Debug)]
pub struct RayPlan {
    /// As the kernel reads them, in any order. Those from which no light comes are left out.
    pub directions: Vec<kernel::Direction>,
    /// Of coloured light, of each of them: its factors in red, green and blue; else none.
    pub tints: Vec<[f32; 4]>,
    /// How far in mm a change of opacity can change values: rays and what they interpolate.
    pub reach_mm: f32,
    pub(crate) rule: Quadrature,
    /// M.
    pub(crate) cells: u32,
    pub(crate) step_mm: f32,
    /// How much farther out than half a step they begin, in steps.
    pub(crate) shift: f32,
    /// Farthest cell from its voxel along each axis.
    pub(crate) reach: [u32; 3],
}

impl RayPlan {
    /// The rays of these settings, which hold, at voxels of this spacing in mm.
    ///
    /// # Errors
    /// [`cao_model::Error::Limit`] for rays longer than [`MOST_VOXELS`].
    pub fn new(spacing: [f32; 3], occlusion: &Occlusion) -> cao_model::Result<Self> {
        let smallest = spacing.into_iter().fold(f32::INFINITY, f32::min);
        let (cells, far) = (occlusion.samples(smallest.into()), occlusion.reach(smallest.into()) / smallest);
        // Rounding of lengths in mm must not refuse it.
        if far > MOST_VOXELS * 1.001 {
            return Err(cao_model::Error::Limit {
                what: format!("voxels along a ray of {} mm at {smallest} mm a voxel", occlusion.radius_mm),
                needed: far.ceil() as u64,
                limit: MOST_VOXELS as u64,
                hint: "make the radius or the offset smaller, or use method cao or lao".into(),
            });
        }
        let step_mm = occlusion.step(smallest.into());
        // A step in voxels along each axis.
        let step = |d: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|i| d[i] * f64::from(step_mm) / f64::from(spacing[i]))
        };
        let unit = f64::from(kernel::UNIT);
        let halves = f64::from((2 * cells).saturating_sub(1).max(1));
        let factor = |weight: f64| (weight * f64::from(kernel::FINE) / halves) as f32;
        let lit = occlusion.lit_directions();
        let directions: Vec<_> = lit
            .iter()
            .map(|&(d, weights)| kernel::Direction {
                step: step(d).map(|c| (unit * c).round() as i32),
                factor: factor(weights[0]),
                half_step: step(d).map(|c| (0.5 * c) as f32),
                pad: Default::default(),
            })
            .collect();
        let coloured = occlusion.light.needs() == Lights::Coloured;
        let tint = |[r, g, b]: [f64; 3]| [factor(r), factor(g), factor(b), 0.0];
        let tints = lit.iter().filter(|_| coloured).map(|(_, weights)| tint(*weights)).collect();
        let shift = occlusion.offset_mm.map_or(0.0, |offset| offset / step_mm - 0.5);
        let farthest = |i: usize| {
            let cell = |d: &kernel::Direction| {
                let first = (shift * d.step[i] as f32).round_ties_even() as i32;
                ((first + d.step[i] * cells as i32 + kernel::UNIT / 2) >> kernel::UNIT_BITS).unsigned_abs()
            };
            directions.iter().map(cell).max().unwrap_or(0)
        };
        let diagonal = glam::Vec3::from_array(spacing).length();
        Ok(Self {
            reach: std::array::from_fn(farthest),
            // A hundredth for rounding, of which the 1/256 voxel of a GPU's texture coordinates is the most.
            reach_mm: occlusion.reach(smallest.into()) + 1.01 * diagonal,
            rule: match occlusion.quadrature {
                // All cells are near.
                Quadrature::Hybrid if cells <= kernel::NEAR => Quadrature::Linear,
                rule => rule,
            },
            directions,
            tints,
            cells,
            step_mm,
            shift,
        })
    }

    /// How many directions a kernel is to follow: none where rays have no cells.
    pub(crate) fn followed(&self) -> u32 {
        if self.cells == 0 { 0 } else { self.directions.len() as u32 }
    }

    /// Reads of V_o for a brick, at most.
    pub fn brick_samples(&self) -> f64 {
        f64::from(kernel::VOXELS) * self.directions.len() as f64 * f64::from(self.cells.max(1))
    }
}

/// What the kernel reads and writes.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// V_o.
    pub opacity: &'a Image,
    /// Bricks to work on.
    pub list: &'a BrickList,
    /// V_AO, of coloured light rgba16unorm.
    pub ambient: &'a Image,
}

/// The kernel `rays`, one pipeline a rule.
pub struct Rays {
    ruled: Ruled,
    /// Of coloured light: those of the plan that was written last.
    tints: Option<Buffer>,
}

impl Rays {
    /// Builds the pipelines for light of one colour. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { ruled: Ruled::new(gpu, &kernel::SHADER)?, tints: None })
    }

    /// Those for coloured light. Uses the device's queue and waits for it.
    pub fn coloured(gpu: &Gpu) -> Result<Self> {
        let entries = ["nearest_coloured", "hybrid_coloured", "linear_coloured"];
        let room = size_of::<[f32; 4]>() as u64 * u64::from(RaySet::MOST);
        let tints = gpu.buffer("tints", room, BufferUse::Device)?;
        Ok(Self { ruled: Ruled::of(gpu, &kernel::SHADER, entries)?, tints: Some(tints) })
    }

    /// Writes the directions of a plan; once after each change of the settings.
    pub fn record_directions(&self, rec: &mut Recorder, plan: &RayPlan) -> Result<()> {
        self.ruled.record_directions(rec, plan)?;
        if let Some(tints) = &self.tints {
            rec.barrier(&[Access::StorageRead], &[Access::TransferWrite]);
            rec.update(tints, 0, bytemuck::cast_slice(&plan.tints))?;
            rec.barrier(&[Access::TransferWrite], &[Access::StorageRead]);
        }
        Ok(())
    }

    /// Works on the list, or some of its bricks, along the directions written last. `opacity` is per `reference_mm`.
    #[expect(clippy::too_many_arguments, reason = "settings and bindings of the kernel, each named once")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        plan: &RayPlan,
        reference_mm: f32,
        scope: Scope,
        b: Bindings,
        take: &Take,
    ) -> Result<()> {
        let params = params(field, plan, reference_mm, scope, take.first());
        let (pipeline, push) = (self.ruled.pipeline(plan), bytemuck::bytes_of(&params));
        match &self.tints {
            None => take.dispatch(rec, pipeline, &self.binds(b), push, &b.list.buffer),
            Some(tints) => take.dispatch(rec, pipeline, &self.coloured_binds(b, tints), push, &b.list.buffer),
        }
    }

    fn binds<'a>(&'a self, b: Bindings<'a>) -> kernel::HybridBindings<'a> {
        kernel::HybridBindings {
            opacity: b.opacity,
            field: &self.ruled.field,
            directions: &self.ruled.directions,
            cells: &self.ruled.cells,
            list: &b.list.buffer,
            ambient: b.ambient,
        }
    }

    fn coloured_binds<'a>(
        &'a self,
        b: Bindings<'a>,
        tints: &'a Buffer,
    ) -> kernel::HybridColouredBindings<'a> {
        kernel::HybridColouredBindings {
            opacity: b.opacity,
            field: &self.ruled.field,
            directions: &self.ruled.directions,
            cells: &self.ruled.cells,
            list: &b.list.buffer,
            tints,
            coloured: b.ambient,
        }
    }
}

fn params(field: &Field, plan: &RayPlan, reference_mm: f32, scope: Scope, base: u32) -> kernel::RaysParams {
    kernel::RaysParams {
        dims: field.dims,
        directions: plan.followed(),
        bricks: field.bricks(),
        cells: plan.cells,
        reach: plan.reach,
        base,
        unneeded: u32::from(scope == Scope::All),
        exponent: plan.step_mm / reference_mm,
        shift: plan.shift,
        pad: Default::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_are_as_long_as_they_are_asked_for_and_no_longer_than_256_voxels() {
        let of = |radius_mm| Occlusion { rays: RaySet::R6, radius_mm, ..Occlusion::paper(0.5) };
        let plan = RayPlan::new([0.5, 1.0, 2.0], &of(128.0)).unwrap();
        assert_eq!((plan.cells, plan.reach), (256, [256, 128, 64]));
        let error = RayPlan::new([0.5, 1.0, 2.0], &of(129.0)).unwrap_err().to_string();
        assert!(error.contains("258") && error.contains("256"), "{error}");
        assert_eq!(RayPlan::new([1.0; 3], &of(0.0)).unwrap().cells, 0);
    }
}
