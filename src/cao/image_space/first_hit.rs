//! What pixels show of a volume: geometry from a picture's depths (`cao_twin::image_space::first_hit` has the equations).
//!
//! In: a [`Picture`]'s depth, by its views' planes. Out: [`Geometry`]. Cost: five depths a pixel.

use crate::draw::picture::Picture;
use crate::mesh::geometry::Geometry;
use crate::{Error, Result};
use cao_gpu::{Gpu, Pipeline, Recorder};
use cao_kernels::first_hit as kernel;

/// The kernel `first_hit`.
pub struct FirstHit {
    pipeline: Pipeline,
}

impl FirstHit {
    /// Builds the pipeline.
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Writes the geometry of a picture of the views that [`Geometry::record_eyes`] has written.
    ///
    /// # Errors
    /// A picture of another size, or of fewer views.
    pub fn record(&self, rec: &mut Recorder, picture: &Picture, geometry: &Geometry) -> Result<()> {
        let (size, views) = (geometry.size(), geometry.views());
        if picture.size() != size || picture.views() < views {
            let problem = format!(
                "{} views of {:?} pixels; expected {views} of {size:?}, as the geometry has",
                picture.views(),
                picture.size()
            );
            return Err(Error::refused("picture", problem));
        }
        let params = kernel::FirstHitParams { size };
        let binds =
            kernel::MainBindings { depth: &picture.depth, eyes: &geometry.eyes, geometry: &geometry.pixels };
        let over = [size[0], size[1], views as u32];
        Ok(rec.dispatch_over(&self.pipeline, &binds, bytemuck::bytes_of(&params), over)?)
    }
}
