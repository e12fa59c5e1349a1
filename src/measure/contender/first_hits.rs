//! Crytek SSAO, Volumetric AO and HBAO (docs/image-space.md) of what each eye's picture of the volume shows first.

use super::image_space::{IMAGE_SPACE, Passes};
use super::{Arena, surface_look};
use crate::Result;
use cao::draw::picture::Picture;
use cao::picture_occlusion::PictureOcclusion;
use cao::renderer::Renderer;
use cao_gpu::Timings;
use cao_model::image_space::ImageMethod;

/// Its kernels and what they write.
pub struct FirstHits {
    place: usize,
    picture: Picture,
    shade: PictureOcclusion,
}

impl FirstHits {
    /// The method of this place in [`ImageMethod::all`].
    pub fn new(Arena { gpu, size, views, .. }: Arena, place: usize) -> Result<Self> {
        let views = views.len();
        Ok(Self {
            place,
            picture: Picture::new(gpu, size, views)?,
            shade: PictureOcclusion::new(gpu, size, views)?,
        })
    }
}

impl Passes for FirstHits {
    fn shade(&mut self, arena: Arena, renderer: &Renderer, radius_mm: f32) -> Result<Timings> {
        let Arena { gpu, views, .. } = arena;
        let mut rec = gpu.recorder("image-space frame")?;
        renderer.record_picture(&mut rec, views, &surface_look(), &self.picture)?;
        self.shade.record_eyes(&mut rec, views)?;
        rec.submit_and_wait()?;

        let mut rec = gpu.recorder("image-space occlusion")?;
        rec.stage(IMAGE_SPACE)?;
        self.shade.record(&mut rec, &self.picture, &ImageMethod::all(radius_mm)[self.place])?;
        rec.end_stage()?;
        Ok(rec.submit_and_wait()?)
    }

    fn factors(&self, arena: Arena, eye: usize) -> Result<Vec<f32>> {
        let all = self.shade.accessibility(arena.gpu)?;
        let per_eye = all.len() / arena.views.len();
        Ok(all[eye * per_eye..(eye + 1) * per_eye].to_vec())
    }
}
