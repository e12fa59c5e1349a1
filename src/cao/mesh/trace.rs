//! Ambient occlusion of pixels by rays, the truth of the other methods (AOV §6).
//!
//! `AO = 1/N Σ_i max(0, 1 − t_i/δ)` over N cosine-weighted rays. In: geometry, a world. Out: 1 − AO a pixel. Cost: N walks through the tree a pixel.

use crate::host::row_of_groups;
use crate::mesh::geometry::Geometry;
use crate::mesh::surfaces::Surfaces;
use crate::{Error, Result};
use cao_gpu::{Access, Buffer, Gpu, Pipeline, Recorder};
use cao_kernels::trace as kernel;
use std::ops::Range;

/// The kernel `trace`.
pub struct Trace {
    pipeline: Pipeline,
}

impl Trace {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Rays of all pixels, some at a time: `rays` of `all`, which follow on those of the call before. `accessibility` holds an f32 a pixel, which
    /// is 1 − AO after the last of them. Between two calls its caller orders storage writes before storage reads.
    ///
    /// # Errors
    /// Rays beyond all, or none; a reach that is no length.
    pub fn record(
        &self,
        rec: &mut Recorder,
        surfaces: &Surfaces,
        geometry: &Geometry,
        delta_mm: f32,
        rays: Range<u32>,
        all: u32,
        accessibility: &Buffer,
    ) -> Result<()> {
        if !(delta_mm.is_finite() && delta_mm > 0.0) {
            return Err(Error::refused("delta_mm", format!("{delta_mm}; expected a length > 0 mm")));
        }
        if rays.is_empty() || rays.end > all {
            return Err(Error::refused("rays", format!("{rays:?} of {all}; expected some, within all")));
        }
        let size = geometry.size();
        let pixels = size[0] * size[1] * geometry.views() as u32;
        let params = kernel::TraceParams {
            size,
            first_pixel: 0,
            pixels,
            views: geometry.views() as u32,
            first_ray: rays.start,
            rays: rays.len() as u32,
            all_rays: all,
            delta: delta_mm,
            pad: Default::default(),
        };
        let binds = kernel::MainBindings {
            eyes: &geometry.eyes,
            tree: &surfaces.tree,
            triangles: &surfaces.triangles,
            looks: &surfaces.looks,
            materials: &surfaces.materials,
            texels: &surfaces.texels,
            clips: &surfaces.clips.clips,
            layers: &surfaces.clips.layers,
            geometry: &geometry.pixels,
            accessibility,
        };
        let groups = row_of_groups(pixels.div_ceil(kernel::MAIN_WORKGROUP[0]));
        rec.dispatch(&self.pipeline, &binds, bytemuck::bytes_of(&params), groups)?;
        Ok(())
    }

    /// All rays of all pixels, on the device's own queue, in submissions of about a tenth of a second on a slow device; tells the share that
    /// is done.
    ///
    /// # Errors
    /// As [`Self::record`].
    pub fn run(
        &self,
        gpu: &Gpu,
        surfaces: &Surfaces,
        geometry: &Geometry,
        delta_mm: f32,
        all: u32,
        accessibility: &Buffer,
        progress: &mut dyn FnMut(f64),
    ) -> Result<cao_gpu::Timings> {
        let mut timings = cao_gpu::Timings::new();
        let mut slice = crate::drive::Slice::of(1);
        let mut done = 0;
        while done < all {
            let rays = slice.of_these(all - done);
            let mut rec = gpu.recorder("trace")?;
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
            rec.stage(crate::stages::TRACE)?;
            self.record(&mut rec, surfaces, geometry, delta_mm, done..done + rays, all, accessibility)?;
            rec.end_stage()?;
            let start = std::time::Instant::now();
            for cao_gpu::Timing { stage, ms } in rec.submit_and_wait()? {
                crate::drive::add(&mut timings, stage, ms);
            }
            slice.took(rays, start.elapsed());
            done += rays;
            progress(f64::from(done) / f64::from(all));
        }
        Ok(timings)
    }
}
