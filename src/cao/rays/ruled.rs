//! What kernels of rays in whole numbers (method.md §4) have in common: a pipeline for each rule, and the tables that they read.
//!
//! Some 40 bytes a direction, 1 KiB of means of cells.

use super::rays::RayPlan;
use crate::host::device_buffer;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Pipeline, Recorder, Sampler, SamplerDesc, Shader};
use cao_kernels::shared::whole_rays as kernel;
use cao_model::occlusion::{Quadrature, RaySet};

/// Pipelines and tables.
pub(crate) struct Ruled {
    nearest: Pipeline,
    hybrid: Pipeline,
    linear: Pipeline,
    /// Linear, transparent outside the volume.
    pub(crate) field: Sampler,
    /// Of the plan that was written last.
    pub(crate) directions: Buffer,
    /// Means of cells.
    pub(crate) cells: Buffer,
}

impl Ruled {
    /// Builds the pipelines of the entry points `nearest`, `hybrid` and `linear`. Uses the device's queue and waits for it.
    pub(crate) fn new(gpu: &Gpu, shader: &'static Shader) -> Result<Self> {
        Self::of(gpu, shader, ["nearest", "hybrid", "linear"])
    }

    /// Builds the pipelines of these entry points, one for each of the three rules. Uses the device's queue and waits for it.
    pub(crate) fn of(
        gpu: &Gpu,
        shader: &'static Shader,
        [nearest, hybrid, linear]: [&str; 3],
    ) -> Result<Self> {
        let pipeline = |entry| gpu.compute(shader, entry);
        let room = size_of::<kernel::Direction>() as u64 * u64::from(RaySet::MOST);
        Ok(Self {
            nearest: pipeline(nearest)?,
            hybrid: pipeline(hybrid)?,
            linear: pipeline(linear)?,
            field: gpu.sampler("field", SamplerDesc { linear: true, border_zero: true })?,
            directions: gpu.buffer("directions", room, BufferUse::Device)?,
            cells: device_buffer(gpu, "cell means", bytemuck::bytes_of(&cell_means()))?,
        })
    }

    /// Writes the directions of a plan; once after each change of the settings.
    pub(crate) fn record_directions(&self, rec: &mut Recorder, plan: &RayPlan) -> Result<()> {
        rec.barrier(&[Access::StorageRead], &[Access::TransferWrite]);
        rec.update(&self.directions, 0, bytemuck::cast_slice(&plan.directions))?;
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead]);
        Ok(())
    }

    /// That of the plan's rule.
    pub(crate) fn pipeline(&self, plan: &RayPlan) -> &Pipeline {
        match plan.rule {
            Quadrature::Nearest => &self.nearest,
            Quadrature::Linear => &self.linear,
            _ => &self.hybrid,
        }
    }
}

/// `a / −ln(1 − a)` in 65536ths at a = 256 i / 65535, the mean transmittance of a cell of this opacity. The last is 0: nothing comes
/// through.
fn cell_means() -> kernel::Cells {
    const LAST: usize = kernel::MEANS as usize - 1;
    let whole = f64::from(kernel::WHOLE) + 1.0;
    kernel::Cells {
        mean: std::array::from_fn(|i| match i {
            0 => whole as u32,
            LAST => 0,
            _ => {
                let a = (256 * i) as f64 / f64::from(kernel::WHOLE);
                (whole * a / -(1.0 - a).ln()).round() as u32
            }
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cell_means_fall_from_all_to_nothing() {
        let means = cell_means().mean;
        assert_eq!((means[0], means[256]), (65536, 0));
        assert!(means.windows(2).all(|w| w[0] > w[1]));
        // a = 0.5: 0.5 / ln 2.
        assert!((f64::from(means[128]) / 65536.0 - 0.7213).abs() < 1e-3);
    }
}
