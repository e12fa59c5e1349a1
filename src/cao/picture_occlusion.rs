//! Methods of image space for what a picture of a volume shows first.
//!
//! 28 bytes a pixel and view beside the picture.

use crate::Result;
use crate::draw::picture::Picture;
use crate::host::read_buffer;
use crate::image_space::first_hit::FirstHit;
use crate::image_space::shade::ImageSpace;
use crate::mesh::geometry::Geometry;
use crate::renderer::{Renderer, StereoImage};
use crate::stages;
use cao_gpu::{Access, Buffer, Gpu, Recorder, Timings};
use cao_model::image_space::ImageMethod;
use cao_model::look::{Look, Shading};
use cao_model::view::View;

/// Kernels, and memory for pictures of one size.
pub struct PictureOcclusion {
    geometry: Geometry,
    first_hit: FirstHit,
    shade: ImageSpace,
    scratch: Buffer,
    accessibility: Buffer,
}

impl PictureOcclusion {
    /// For so many views of `size` pixels.
    ///
    /// # Errors
    /// No views or more than [`View::MAX`]; a device without memory.
    pub fn new(gpu: &Gpu, size: [u32; 2], views: usize) -> Result<Self> {
        let geometry = Geometry::new(gpu, size, views)?;
        Ok(Self {
            first_hit: FirstHit::new(gpu)?,
            shade: ImageSpace::new(gpu)?,
            scratch: geometry.values(gpu, "image-space occlusion before its filter")?,
            accessibility: geometry.values(gpu, "image-space occlusion")?,
            geometry,
        })
    }

    /// Writes the eyes that the picture is of; a recording of its own, or before a stage that is timed.
    ///
    /// # Errors
    /// Another number of views than there is room for, or impossible ones.
    pub fn record_eyes(&self, rec: &mut Recorder, views: &[View]) -> Result<()> {
        self.geometry.record_eyes(rec, views)
    }

    /// Shades a picture of those eyes, whose depths [`Renderer::record_picture`](crate::renderer::Renderer::record_picture) has written.
    ///
    /// # Errors
    /// Impossible settings, a picture of another size.
    pub fn record(&self, rec: &mut Recorder, picture: &Picture, method: &ImageMethod) -> Result<()> {
        rec.barrier(
            &[Access::StorageWrite, Access::StorageRead],
            &[Access::StorageWrite, Access::SampledRead],
        );
        self.first_hit.record(rec, picture, &self.geometry)?;
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
        self.shade.record(rec, &self.geometry, method, &self.scratch, &self.accessibility)
    }

    /// Accessibility as last shaded, rows from the top, view after view; 1 is open, and where nothing is. Uses the device's queue and waits for it.
    ///
    /// # Errors
    /// Those of the device.
    pub fn accessibility(&self, gpu: &Gpu) -> Result<Vec<f32>> {
        Ok(bytemuck::pod_collect_to_vec(&read_buffer(gpu, &self.accessibility)?))
    }

    /// Draws a volume with this occlusion in place of its ambient factor, on the device's own queue, and reads the picture back. It darkens all light
    /// by half the gain times accessibility, at most 1, since half of all directions are open at a flat wall; where the look shows occlusion.
    ///
    /// # Errors
    /// As [`Renderer::record_picture`], [`Self::record`].
    pub fn draw<const VIEWS: usize>(
        gpu: &Gpu,
        renderer: &Renderer,
        views: &[View; VIEWS],
        look: &Look,
        size: [u32; 2],
        method: &ImageMethod,
    ) -> Result<(StereoImage<VIEWS>, Timings)> {
        let shading = match look.shading {
            Shading::Ao => Shading::None,
            Shading::PhongAo => Shading::Phong,
            without => without,
        };
        let picture = Picture::new(gpu, size, VIEWS)?;
        let passes = Self::new(gpu, size, VIEWS)?;
        let mut rec = gpu.recorder("picture and its occlusion")?;
        renderer.record_picture(&mut rec, views, &Look { shading, ..*look }, &picture)?;
        passes.record_eyes(&mut rec, views)?;
        rec.stage(stages::IMAGE_SPACE)?;
        passes.record(&mut rec, &picture, method)?;
        rec.end_stage()?;
        let timings = rec.submit_and_wait()?;
        let mut image = StereoImage::read(gpu, &picture)?;
        if look.shading.occluded() {
            let all = passes.accessibility(gpu)?;
            for (pixel, open) in image.colour.iter_mut().flatten().zip(all) {
                let light = (0.5 * look.gain * open).min(1.0);
                pixel[..3].iter_mut().for_each(|part| *part *= light);
            }
        }
        Ok((image, timings))
    }
}
