//! Drawing: into a picture, into a host's attachments, and read back.

use super::Renderer;
use crate::draw::picture::Picture;
use crate::draw::raycast::Bindings;
use crate::stages;
use crate::{Error, Result};
use cao_gpu::{Access, Buffer, BufferUse, Image, Recorder, Timings};
use cao_model::look::Look;
use cao_model::view::View;
use std::sync::PoisonError;

/// The images of all views, left and right first, read back from the device.
#[derive(Clone, Debug)]
pub struct StereoImage<const VIEWS: usize = 2> {
    /// Width and height of one view in pixels.
    pub size: [u32; 2],
    /// Of each view: premultiplied linear RGBA, rows from the top.
    pub colour: [Vec<[f32; 4]>; VIEWS],
    /// Of each view: Vulkan depth, 1 where nothing is drawn.
    pub depth: [Vec<f32>; VIEWS],
}

impl Renderer {
    /// Records one to four views ([`View::MAX`]) into a picture of as many, whose content before is given up; copies, kernels and shaders
    /// can read it afterwards. Refuses while the ambient volume is out of date.
    pub fn record_picture(
        &self,
        rec: &mut Recorder,
        views: &[View],
        look: &Look,
        picture: &Picture,
    ) -> Result<()> {
        self.current()?;
        if picture.views() != views.len() {
            let problem = format!("has room for {} views, given are {}", picture.views(), views.len());
            return Err(Error::refused("picture", problem));
        }
        let (subject, fields) = (&self.subject, self.ambient.fields());
        self.frame.record(rec, &subject.field, views, look, subject.reference_mm())?;
        rec.barrier(
            &[Access::TransferRead, Access::SampledRead, Access::GraphicsRead, Access::StorageWrite],
            &[Access::StorageWrite],
        );
        rec.discard(&picture.colour);
        rec.discard(&picture.depth);
        rec.barrier(&[], &[Access::StorageWrite]);
        rec.stage(stages::RAYCAST)?;
        let bindings = Bindings {
            field: &subject.field,
            transfer: &subject.transfer_buffer,
            ambient: fields.ambient,
            distances: &self.distances,
            bounds: &self.bounds,
            clips: &subject.clip_set,
            frame: &self.frame,
        };
        self.raycast.record(rec, bindings, picture)?;
        rec.end_stage()?;
        rec.barrier(
            &[Access::StorageWrite],
            &[Access::TransferRead, Access::SampledRead, Access::GraphicsRead],
        );
        Ok(())
    }

    /// Records the same into as many layers of attachments: `colour` of the renderer's format, `depth` of `D32Float`. The picture between
    /// is allocated when a size or a number of views first comes; numbers other than two build a pipeline then.
    pub fn record_draw(
        &self,
        rec: &mut Recorder,
        views: &[View],
        look: &Look,
        colour: &Image,
        depth: &Image,
        size: [u32; 2],
    ) -> Result<()> {
        self.current()?;
        let mut presented = self.presented.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = |picture: &Picture| picture.size() == size && picture.views() == views.len();
        let picture = match presented.take().filter(fits) {
            Some(picture) => picture,
            None => Picture::new(&self.subject.gpu, size, views.len())?,
        };
        let picture = presented.insert(picture);
        self.record_picture(rec, views, look, picture)?;
        rec.stage(stages::PRESENT)?;
        self.present.record(rec, picture, colour, depth)?;
        rec.end_stage()?;
        Ok(())
    }

    /// Draws both eyes, or any one to four views ([`View::MAX`]), on the device's own queue and reads them back. Refuses while the ambient
    /// volume is out of date.
    pub fn draw<const VIEWS: usize>(
        &self,
        views: &[View; VIEWS],
        look: &Look,
        size: [u32; 2],
    ) -> Result<(StereoImage<VIEWS>, Timings)> {
        self.current()?;
        if size.contains(&0) {
            let problem = format!("{} x {}; expected at least 1 x 1 pixels", size[0], size[1]);
            return Err(Error::refused("image size", problem));
        }
        let gpu = &self.subject.gpu;
        let picture = Picture::new(gpu, size, VIEWS)?;
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let read_back = |bytes| gpu.buffer("image read-back", bytes, BufferUse::Readback);
        let colours = (0..VIEWS).map(|_| read_back(16 * pixels)).collect::<cao_gpu::Result<Vec<_>>>()?;
        let depths = (0..VIEWS).map(|_| read_back(4 * pixels)).collect::<cao_gpu::Result<Vec<_>>>()?;

        let mut rec = gpu.recorder("draw")?;
        self.record_picture(&mut rec, views, look, &picture)?;
        for eye in 0..VIEWS {
            let extent = [size[0], size[1], 1];
            rec.copy_image_to_buffer(&picture.colour, eye as u32, [0; 3], extent, &colours[eye], 0)?;
            rec.copy_image_to_buffer(&picture.depth, eye as u32, [0; 3], extent, &depths[eye], 0)?;
        }
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        let timings = rec.submit_and_wait()?;

        let mut image = StereoImage {
            size,
            colour: std::array::from_fn(|_| Vec::new()),
            depth: std::array::from_fn(|_| Vec::new()),
        };
        for view in 0..VIEWS {
            let read = |buffer: &Buffer| buffer.read(0, buffer.bytes());
            image.colour[view] = bytemuck::pod_collect_to_vec(&read(&colours[view])?);
            image.depth[view] = bytemuck::pod_collect_to_vec(&read(&depths[view])?);
        }
        Ok((image, timings))
    }
}
