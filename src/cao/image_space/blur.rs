//! Filters of accessibility (`cao_twin::image_space::blur` has the equations).
//!
//! In: geometry, eyes, an f32 a pixel. Out: the same, filtered. Cost: 16 values a pixel; 2 (2 reach + 1) values and texels of the geometry.

use crate::Result;
use crate::mesh::geometry::Geometry;
use cao_gpu::{Access, Buffer, Gpu, Pipeline, Recorder};
use cao_kernels::blur as kernel;
use cao_model::image_space::Hbao;

/// The kernel `blur`.
pub struct Blur {
    square: Pipeline,
    bilateral: Pipeline,
}

impl Blur {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        Ok(Self { square: pipeline("square")?, bilateral: pipeline("bilateral")? })
    }

    /// The mean of 4 × 4 pixels of `unfiltered`.
    pub fn record_square(
        &self,
        rec: &mut Recorder,
        geometry: &Geometry,
        unfiltered: &Buffer,
        accessibility: &Buffer,
    ) -> Result<()> {
        let size = geometry.size();
        let params = kernel::BlurParams { size, step: [0; 2], reach: 0, thickness: 0.0 };
        let binds = kernel::SquareBindings { geometry: &geometry.pixels, unfiltered, accessibility };
        let over = [size[0], size[1], geometry.views() as u32];
        Ok(rec.dispatch_over(&self.square, &binds, bytemuck::bytes_of(&params), over)?)
    }

    /// The joint bilateral filter, in place; `scratch` holds as much.
    pub fn record_bilateral(
        &self,
        rec: &mut Recorder,
        geometry: &Geometry,
        settings: &Hbao,
        scratch: &Buffer,
        accessibility: &Buffer,
    ) -> Result<()> {
        let size = geometry.size();
        let over = [size[0], size[1], geometry.views() as u32];
        for (step, from, to) in [([1, 0], accessibility, scratch), ([0, 1], scratch, accessibility)] {
            let reach = settings.reach as i32;
            let params = kernel::BlurParams { size, step, reach, thickness: settings.radius_mm / 10.0 };
            let binds = kernel::BilateralBindings {
                geometry: &geometry.pixels,
                eyes: &geometry.eyes,
                unfiltered: from,
                accessibility: to,
            };
            rec.dispatch_over(&self.bilateral, &binds, bytemuck::bytes_of(&params), over)?;
            if step == [1, 0] {
                rec.barrier(
                    &[Access::StorageRead, Access::StorageWrite],
                    &[Access::StorageRead, Access::StorageWrite],
                );
            }
        }
        Ok(())
    }
}
