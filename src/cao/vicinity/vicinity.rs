//! Vicinity shading (docs/vicinity.md; `cao_twin::vicinity::vicinity` has the equations), after Stewart 2003: the share of a hemisphere in
//! which nothing within the radius is more opaque.
//!
//! In: `opacity` V_o (3D r16unorm), the list of bricks. Out: `ambient` V_AO (3D r16unorm) in the listed bricks, one write a voxel. Cost: at
//! most half the directions times the radius in voxels, reads of V_o a voxel; a line ends at the first voxel that is more opaque.

use crate::drive::Take;
use crate::field::Field;
use crate::field::bricks::BrickList;
use crate::field::ratios;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Image, Pipeline, Recorder};
use cao_kernels::vicinity as kernel;
use cao_model::occlusion::{Occlusion, RaySet};
use cao_model::settings::Scope;

/// Longest line in smallest spacings: what was tested.
pub const MOST_VOXELS: f32 = 256.0;

/// The lines of every voxel.
#[derive(Clone, Debug)]
pub struct LinePlan {
    /// As the kernel reads them, in the order in which it adds them up.
    pub directions: Vec<kernel::Direction>,
    /// How far in mm a change of opacity can change values.
    pub reach_mm: f32,
    slope: [f32; 3],
    smallest_mm: f32,
}

impl LinePlan {
    /// The lines of these settings, which hold, at voxels of this spacing in mm; none where the radius is less than half a voxel.
    ///
    /// # Errors
    /// [`cao_model::Error::Limit`] for lines longer than [`MOST_VOXELS`].
    pub fn new(spacing: [f32; 3], occlusion: &Occlusion) -> cao_model::Result<Self> {
        let (smallest_mm, radius_mm) =
            (spacing.into_iter().fold(f32::INFINITY, f32::min), occlusion.radius_mm);
        let voxels = radius_mm / smallest_mm;
        // Rounding of lengths in mm must not refuse it.
        if voxels > MOST_VOXELS * 1.001 {
            return Err(cao_model::Error::Limit {
                what: format!("voxels along a line of {radius_mm} mm at {smallest_mm} mm a voxel"),
                needed: voxels.ceil() as u64,
                limit: MOST_VOXELS as u64,
                hint: "make the radius smaller, or use another method".into(),
            });
        }
        let ratios = ratios(spacing);
        let line = |(d, weight): ([f64; 3], f64)| {
            // In voxels a smallest spacing, and how long one along the longest axis is.
            let along: [f64; 3] = std::array::from_fn(|i| d[i] / ratios[i]);
            let longest = along.into_iter().map(f64::abs).fold(0.0, f64::max);
            kernel::Direction {
                step: along.map(|c| (f64::from(kernel::UNIT) * c / longest).round() as i32),
                // A length in mm that rounded down must not lose a step.
                steps: (f64::from(radius_mm) / f64::from(smallest_mm) * longest * (1.0 + 1e-6)).floor()
                    as u32,
                weighted: d.map(|c| (c * weight) as f32),
                pad: Default::default(),
            }
        };
        let near = voxels < 0.5;
        let all = occlusion.rays.directions().into_iter().map(line);
        let diagonal = glam::Vec3::from_array(spacing).length();
        Ok(Self {
            directions: if near { Vec::new() } else { all.collect() },
            // A voxel of a line lies within half a voxel of it.
            reach_mm: radius_mm + 1.01 * diagonal,
            slope: ratios.map(|ratio| (0.5 / ratio) as f32),
            smallest_mm,
        })
    }

    /// Reads of V_o for a brick, at most.
    pub fn brick_reads(&self) -> f64 {
        let steps: f64 = self.directions.iter().map(|line| f64::from(line.steps)).sum();
        f64::from(kernel::VOXELS) * steps.max(1.0)
    }
}

/// What the kernel reads and writes.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// V_o.
    pub opacity: &'a Image,
    /// Bricks to work on.
    pub list: &'a BrickList,
    /// V_AO.
    pub ambient: &'a Image,
}

/// The kernel `vicinity`.
pub struct Vicinity {
    pipeline: Pipeline,
    directions: Buffer,
}

impl Vicinity {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let room = size_of::<kernel::Direction>() as u64 * u64::from(RaySet::MOST);
        Ok(Self {
            pipeline: gpu.compute(&kernel::SHADER, "main")?,
            directions: gpu.buffer("directions", room, BufferUse::Device)?,
        })
    }

    /// Writes the lines of a plan; once after each change of the settings.
    pub fn record_directions(&self, rec: &mut Recorder, plan: &LinePlan) -> Result<()> {
        rec.barrier(&[Access::StorageRead], &[Access::TransferWrite]);
        if !plan.directions.is_empty() {
            rec.update(&self.directions, 0, bytemuck::cast_slice(&plan.directions))?;
        }
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead]);
        Ok(())
    }

    /// Works on the list, or some of its bricks, along the lines written last. `opacity` is per `reference_mm`.
    #[expect(clippy::too_many_arguments, reason = "settings and bindings of the kernel, each named once")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        plan: &LinePlan,
        reference_mm: f32,
        scope: Scope,
        b: Bindings,
        take: &Take,
    ) -> Result<()> {
        let params = kernel::VicinityParams {
            dims: field.dims,
            directions: plan.directions.len() as u32,
            bricks: field.bricks(),
            base: take.first(),
            slope: plan.slope,
            unneeded: u32::from(scope == Scope::All),
            exponent: plan.smallest_mm / reference_mm,
            pad: Default::default(),
        };
        let binds = kernel::MainBindings {
            opacity: b.opacity,
            directions: &self.directions,
            list: &b.list.buffer,
            ambient: b.ambient,
        };
        take.dispatch(rec, &self.pipeline, &binds, bytemuck::bytes_of(&params), &b.list.buffer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_within_the_radius_and_are_no_longer_than_256_voxels() {
        let of = |rays, radius_mm| Occlusion { rays, radius_mm, ..Occlusion::paper(0.5) };
        let plan = LinePlan::new([0.5, 1.0, 0.5], &of(RaySet::R6, 4.0)).unwrap();
        let mut steps: Vec<_> = plan.directions.iter().map(|line| line.steps).collect();
        steps.sort_unstable();
        assert_eq!(steps, [4, 4, 8, 8, 8, 8]);
        // Along a diagonal a step is √3 long.
        let plan = LinePlan::new([1.0; 3], &of(RaySet::W14, 6.0)).unwrap();
        assert!(plan.directions.iter().any(|line| line.step == [65536; 3] && line.steps == 3));
        assert!(LinePlan::new([1.0; 3], &of(RaySet::W14, 0.4)).unwrap().directions.is_empty());
        let error = LinePlan::new([0.5; 3], &of(RaySet::R6, 129.0)).unwrap_err().to_string();
        assert!(error.contains("258") && error.contains("256"), "{error}");
    }
}
