//! Ambient occlusion of pixels by the rays of [`trace`](crate::mesh::trace), found by the device's ray queries instead of walks through a tree.
//!
//! In: geometry, a world and its acceleration structure. Out: 1 − AO a pixel, within rounding what `trace` gives. Cost: N queries a pixel; where masks
//! or clips may take triangles, each candidate is asked for.

use crate::Result;
use crate::host::row_of_groups;
use crate::mesh::geometry::Geometry;
use crate::mesh::surfaces::Surfaces;
use crate::mesh::trace::Rays;
use cao_gpu::{AccelerationStructure, Buffer, Gpu, Pipeline, Recorder};
use cao_kernels::trace_queries as kernel;

/// The kernel `trace_queries`.
pub struct TraceQueries {
    pipeline: Pipeline,
}

impl TraceQueries {
    /// Builds the pipeline.
    ///
    /// # Errors
    /// A device without ray queries ([`Gpu::ray_queries`]).
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// As [`Trace::record`](crate::mesh::trace::Trace::record), through the structure of [`Surfaces::structure`].
    ///
    /// # Errors
    /// The same.
    pub fn record(
        &self,
        rec: &mut Recorder,
        (surfaces, world): (&Surfaces, &AccelerationStructure),
        geometry: &Geometry,
        delta_mm: f32,
        rays: Rays,
        accessibility: &Buffer,
    ) -> Result<()> {
        let params = rays.params(geometry, delta_mm, surfaces.whole())?;
        let binds = kernel::MainBindings {
            eyes: &geometry.eyes,
            world,
            triangles: &surfaces.triangles,
            looks: &surfaces.looks,
            materials: &surfaces.materials,
            texels: &surfaces.texels,
            clips: &surfaces.clips.clips,
            layers: &surfaces.clips.layers,
            geometry: &geometry.pixels,
            accessibility,
        };
        let groups = row_of_groups(params.pixels.div_ceil(kernel::MAIN_WORKGROUP[0]));
        rec.dispatch(&self.pipeline, &binds, bytemuck::bytes_of(&params), groups)?;
        Ok(())
    }
}
