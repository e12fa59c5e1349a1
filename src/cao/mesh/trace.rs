//! Ambient occlusion of pixels by rays, the truth of the other methods (AOV §6).
//!
//! `AO = 1/N Σ_i max(0, 1 − t_i/δ)` over N cosine-weighted rays. In: geometry, a world. Out: 1 − AO a pixel. Cost: N walks through the tree a pixel.

use crate::host::row_of_groups;
use crate::mesh::geometry::Geometry;
use crate::mesh::surfaces::{ByCaps, Surfaces};
use crate::{Error, Result};
use cao_gpu::{Buffer, Gpu, Recorder};
use cao_kernels::trace as kernel;
use std::ops::Range;

/// The kernel `trace`.
pub struct Trace {
    pipelines: ByCaps,
}

/// Rays of each pixel.
#[derive(Clone, Debug)]
pub struct Rays {
    /// Those that are followed now,
    pub some: Range<u32>,
    /// of so many.
    pub all: u32,
}

impl Rays {
    /// What a kernel takes of them. `whole`: neither masks nor clips take any of the triangles.
    pub(super) fn params(
        self,
        geometry: &Geometry,
        delta_mm: f32,
        whole: bool,
    ) -> Result<kernel::TraceParams> {
        let Self { some, all } = self;
        if !(delta_mm.is_finite() && delta_mm > 0.0) {
            return Err(Error::refused("delta_mm", format!("{delta_mm}; expected a length > 0 mm")));
        }
        if some.is_empty() || some.end > all {
            return Err(Error::refused("rays", format!("{some:?} of {all}; expected some, within all")));
        }
        let size = geometry.size();
        Ok(kernel::TraceParams {
            size,
            pixels: size[0] * size[1] * geometry.views() as u32,
            first_ray: some.start,
            rays: some.len() as u32,
            all_rays: all,
            delta: delta_mm,
            whole: u32::from(whole),
        })
    }
}

impl Trace {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipelines: ByCaps::new(gpu, &kernel::SHADER)? })
    }

    /// Rays of all pixels, some at a time, which follow on those of the call before. `accessibility` holds an f32 a pixel, which is 1 − AO after the
    /// last of them. Between two calls its caller orders storage writes before storage reads.
    ///
    /// # Errors
    /// Rays beyond all, or none; a reach that is no length.
    pub fn record(
        &self,
        rec: &mut Recorder,
        surfaces: &Surfaces,
        geometry: &Geometry,
        delta_mm: f32,
        rays: Rays,
        accessibility: &Buffer,
    ) -> Result<()> {
        let params = rays.params(geometry, delta_mm, surfaces.whole())?;
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
        let groups = row_of_groups(params.pixels.div_ceil(kernel::MAIN_WORKGROUP[0]));
        rec.dispatch(self.pipelines.of(surfaces)?, &binds, bytemuck::bytes_of(&params), groups)?;
        Ok(())
    }
}
