//! Crytek SSAO, Volumetric AO and HBAO (docs/image-space.md) of what each eye's picture of the volume shows first.

use super::image_space::{IMAGE_SPACE, Passes};
use super::{Arena, surface_look};
use crate::Result;
use cao::draw::picture::Picture;
use cao::host::read_buffer;
use cao::image_space::first_hit::FirstHit;
use cao::image_space::shade::ImageSpace;
use cao::mesh::geometry::Geometry;
use cao::renderer::Renderer;
use cao_gpu::{Access, Buffer, Timings};
use cao_model::image_space::ImageMethod;

/// Its kernels and what they write.
pub struct FirstHits {
    place: usize,
    picture: Picture,
    geometry: Geometry,
    first_hit: FirstHit,
    shade: ImageSpace,
    scratch: Buffer,
    accessibility: Buffer,
}

impl FirstHits {
    /// The method of this place in [`ImageMethod::all`].
    pub fn new(Arena { gpu, size, views, .. }: Arena, place: usize) -> Result<Self> {
        let geometry = Geometry::new(gpu, size, views.len())?;
        Ok(Self {
            place,
            picture: Picture::new(gpu, size, views.len())?,
            first_hit: FirstHit::new(gpu)?,
            shade: ImageSpace::new(gpu)?,
            scratch: geometry.values(gpu, "image-space occlusion before its filter")?,
            accessibility: geometry.values(gpu, "image-space occlusion")?,
            geometry,
        })
    }
}

impl Passes for FirstHits {
    fn shade(&mut self, arena: Arena, renderer: &Renderer, radius_mm: f32) -> Result<Timings> {
        let Arena { gpu, views, .. } = arena;
        let mut rec = gpu.recorder("image-space frame")?;
        renderer.record_picture(&mut rec, views, &surface_look(), &self.picture)?;
        self.geometry.record_eyes(&mut rec, views)?;
        rec.submit_and_wait()?;

        let mut rec = gpu.recorder("image-space occlusion")?;
        rec.barrier(
            &[Access::StorageWrite, Access::StorageRead],
            &[Access::StorageWrite, Access::SampledRead],
        );
        rec.stage(IMAGE_SPACE)?;
        self.first_hit.record(&mut rec, &self.picture, &self.geometry)?;
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
        let method = ImageMethod::all(radius_mm)[self.place];
        self.shade.record(&mut rec, &self.geometry, &method, &self.scratch, &self.accessibility)?;
        rec.end_stage()?;
        Ok(rec.submit_and_wait()?)
    }

    fn factors(&self, arena: Arena, eye: usize) -> Result<Vec<f32>> {
        let all: Vec<f32> = bytemuck::pod_collect_to_vec(&read_buffer(arena.gpu, &self.accessibility)?);
        let [width, height] = self.geometry.size().map(|pixels| pixels as usize);
        Ok(all[eye * width * height..(eye + 1) * width * height].to_vec())
    }
}
