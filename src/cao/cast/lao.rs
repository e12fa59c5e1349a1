//! Local ambient occlusion over a list of bricks: CAO eq. (2) and (3),
//! `A(x) = Σ_k w_k A_k(x)`, `A_k(x) = 1/M Σ_{m=1..M} Π_{i<m} (1 − a_i)`, or one of the better quadratures of method.md §3.
//! Eq. (3) is printed with a factor 1/K; the w_k here are w_k/K there, with the sum 1.
//!
//! In: `opacity` V_o, `list`, and for a contextual update `mask` V_m and `precomputed` V_PAO. Out: `ambient` (3D r32float).
//! Cost: K·M trilinear samples for each voxel computed.
//!
//! One module serves the full computation and the contextual update: a voxel's value depends on nothing but V_o, and one
//! module has one rounding, so both give the same bits.

use crate::drive::Take;
use crate::field::Field;
use crate::field::bricks::BrickList;
use bytemuck::Zeroable;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Image, Pipeline, Recorder, Sampler, SamplerDesc};
use cao_kernels::lao as kernel;
use cao_model::occlusion::{Occlusion, Quadrature};
use cao_model::settings::Scope;

/// How the listed bricks are worked on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// Every voxel in scope is computed.
    Full,
    /// The mask decides (CAO §3.5 step 5): b computed, c from V_PAO, a computed only where it touches a visible voxel.
    ByMask,
}

/// What the kernel reads and writes.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// V_o, clipped or not.
    pub opacity: &'a Image,
    /// Bricks to work on.
    pub list: &'a BrickList,
    /// V_m; not read by [`Work::Full`].
    pub mask: &'a Image,
    /// V_PAO; not read by [`Work::Full`].
    pub precomputed: &'a Image,
    /// V_AO or V_PAO.
    pub ambient: &'a Image,
}

/// The kernel `lao` with its ray set.
pub struct Lao {
    pipeline: Pipeline,
    field: Sampler,
    rays: Buffer,
}

impl Lao {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            pipeline: gpu.compute(&kernel::SHADER, "main")?,
            field: gpu.sampler("field", SamplerDesc { linear: true, border_zero: true })?,
            rays: gpu.buffer("rays", size_of::<kernel::Rays>() as u64, BufferUse::Device)?,
        })
    }

    /// Writes the ray set; once after each change of the settings.
    pub fn record_rays(&self, rec: &mut Recorder, occlusion: &Occlusion) -> Result<()> {
        let mut data = kernel::Rays::zeroed();
        for (slot, ([x, y, z], weight)) in data.ray.iter_mut().zip(occlusion.weighted_directions()) {
            *slot = [x, y, z, weight].map(|c| c as f32);
        }
        rec.barrier(&[Access::UniformRead], &[Access::TransferWrite]);
        rec.update(&self.rays, 0, bytemuck::bytes_of(&data))?;
        rec.barrier(&[Access::TransferWrite], &[Access::UniformRead]);
        Ok(())
    }

    /// Works on the list, or some of its bricks.
    #[expect(clippy::too_many_arguments, reason = "settings and bindings of the kernel, each named once")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        occlusion: &Occlusion,
        reference_mm: f32,
        scope: Scope,
        work: Work,
        bindings: Bindings,
        take: &Take,
    ) -> Result<()> {
        let params = params(field, occlusion, reference_mm, scope, work, take.first());
        let (binds, push) = (self.binds(bindings), bytemuck::bytes_of(&params));
        take.dispatch(rec, &self.pipeline, &binds, push, &bindings.list.buffer)
    }

    fn binds<'a>(&'a self, b: Bindings<'a>) -> kernel::MainBindings<'a> {
        kernel::MainBindings {
            opacity: b.opacity,
            field: &self.field,
            rays: &self.rays,
            list: &b.list.buffer,
            mask: b.mask,
            precomputed: b.precomputed,
            ambient: b.ambient,
        }
    }
}

fn params(
    field: &Field,
    occlusion: &Occlusion,
    reference_mm: f32,
    scope: Scope,
    work: Work,
    base: u32,
) -> kernel::LaoParams {
    let smallest = f64::from(field.min_spacing());
    let step = occlusion.step(smallest);
    kernel::LaoParams {
        dims: field.dims,
        samples: occlusion.samples(smallest),
        bricks: field.bricks(),
        rays: occlusion.weighted_directions().len() as u32,
        per_mm: field.spacing.map(f32::recip),
        first: occlusion.first(smallest),
        step,
        exponent: step / reference_mm,
        quadrature: match occlusion.quadrature {
            Quadrature::Left => kernel::LEFT,
            Quadrature::Cell => kernel::CELL,
            // Other methods' rules are refused by `Setup::check`.
            _ => kernel::SEGMENT,
        },
        flags: if work == Work::ByMask { kernel::BY_MASK } else { 0 }
            | if scope == Scope::Needed { kernel::ONLY_NEEDED } else { 0 },
        base,
        pad: Default::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::occlusion::RaySet;

    #[test]
    fn every_ray_set_fits_the_kernels() {
        assert_eq!(u32::from(RaySet::MOST), kernel::MOST_RAYS);
        assert!(RaySet::ALL.iter().all(|set| set.count() <= kernel::MOST_RAYS as usize));
    }
}
