//! Pictures of a world for all eyes: what pixels show, their ambient occlusion by a method of [`PIXEL_METHODS`](cao_model::pixel_occlusion::PIXEL_METHODS), their light; alone, or
//! together with a volume, each in front of and behind the other.
//!
//! ```text
//! eyes ── gbuffer ── occlusion ──────────────── light
//!            └────── ends ── volume's rays ──────┘
//! ```
//!
//! 28 bytes a pixel and view, beside the picture.

use crate::draw::picture::Picture;
use crate::drive::add;
use crate::image_space::method::{ByImage, image_method};
use crate::mesh::ambient::{ByRays, ByVolumes, PixelAmbient, Pixels};
use crate::mesh::gbuffer::Gbuffer;
use crate::mesh::geometry::Geometry;
use crate::mesh::light::{Light, Lit};
use crate::mesh::surfaces::Surfaces;
use crate::renderer::{Renderer, StereoImage};
use crate::{Error, Result, stages};
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Recorder, Timing, Timings};
use cao_model::clip::Clip;
use cao_model::look::Look;
use cao_model::pixel_occlusion::{PixelMethod, PixelOcclusion};
use cao_model::settings::MapSettings;
use cao_model::surface::World;
use cao_model::view::View;

/// Draws a world.
pub struct MeshRenderer {
    gpu: Gpu,
    surfaces: Surfaces,
    delta_mm: f32,
    method: Box<dyn PixelAmbient>,
    gbuffer: Gbuffer,
    light: Light,
    frame: Option<Frame>,
}

/// What belongs to pictures of one size.
struct Frame {
    geometry: Geometry,
    hits: Buffer,
    accessibility: Buffer,
}

impl MeshRenderer {
    /// Brings a world to the device. Uses its queue and waits for it.
    ///
    /// # Errors
    /// Settings that the method does not have; a world without triangles; a device without memory.
    pub fn new(gpu: &Gpu, world: &World, occlusion: PixelOcclusion) -> Result<Self> {
        occlusion.check()?;
        let delta_mm = occlusion.delta_mm(world.bounds());
        let method: Box<dyn PixelAmbient> = match occlusion.method {
            PixelMethod::Aov => Box::new(ByVolumes::new(gpu, occlusion.sparse, occlusion.clamp)?),
            PixelMethod::Rays => Box::new(ByRays::new(gpu, occlusion.rays)?),
            PixelMethod::Crytek | PixelMethod::Volumetric | PixelMethod::Hbao => {
                let method = image_method(&occlusion, delta_mm);
                Box::new(ByImage::new(gpu, method.expect("the three are of images"))?)
            }
        };
        Self::with(gpu, world, method, delta_mm)
    }

    /// With a method of one's own: AOV by volumes that are drawn, say.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with(gpu: &Gpu, world: &World, method: Box<dyn PixelAmbient>, delta_mm: f32) -> Result<Self> {
        Ok(Self {
            gpu: gpu.clone(),
            surfaces: Surfaces::new(gpu, world)?,
            delta_mm,
            method,
            gbuffer: Gbuffer::new(gpu)?,
            light: Light::new(gpu)?,
            frame: None,
        })
    }

    /// Cuts the world by other clips: what they hide is neither seen nor occludes. Surfaces that are cut open show their backs, or caps where
    /// their [materials](cao_model::surface::Material::cap) say so. Uses the device's queue and
    /// waits for it; pictures that are recorded already must have run.
    ///
    /// # Errors
    /// More than [`Clip::MAX`], impossible poses, clip meshes that bound no solid: then the clips before stay.
    pub fn set_clips(&mut self, clips: &[Clip]) -> Result<()> {
        self.surfaces.set_clips(&self.gpu, clips, MapSettings::default())
    }

    /// How far occlusion reaches, in mm.
    pub fn delta_mm(&self) -> f32 {
        self.delta_mm
    }

    /// Makes memory for pictures of this size. Uses the device's queue and waits for it.
    ///
    /// # Errors
    /// No views or more than [`View::MAX`]; a device without memory.
    pub fn prepare(&mut self, size: [u32; 2], views: usize) -> Result<()> {
        let fits = |frame: &Frame| frame.geometry.size() == size && frame.geometry.views() == views;
        if self.frame.as_ref().is_some_and(fits) {
            return Ok(());
        }
        self.frame = None;
        let geometry = Geometry::new(&self.gpu, size, views)?;
        let pixels = geometry.pixels.bytes() / Geometry::BYTES;
        let frame = Frame {
            hits: self.gpu.buffer("hits", Gbuffer::HIT * pixels, BufferUse::Device)?,
            accessibility: geometry.values(&self.gpu, "accessibility")?,
            geometry,
        };
        let on = Pixels {
            gpu: &self.gpu,
            geometry: &frame.geometry,
            surfaces: &self.surfaces,
            delta_mm: self.delta_mm,
        };
        self.method.prepare(&on)?;
        self.frame = Some(frame);
        Ok(())
    }

    fn frame(&self) -> Result<&Frame> {
        self.frame
            .as_ref()
            .ok_or_else(|| Error::refused("picture of meshes", "is not prepared; call prepare first"))
    }

    fn pixels<'a>(&'a self, frame: &'a Frame) -> Pixels<'a> {
        Pixels {
            gpu: &self.gpu,
            geometry: &frame.geometry,
            surfaces: &self.surfaces,
            delta_mm: self.delta_mm,
        }
    }

    /// Records what pixels show, of as many views as prepared for.
    ///
    /// # Errors
    /// Another number of views, or impossible ones.
    pub fn record_geometry(&self, rec: &mut Recorder, views: &[View]) -> Result<()> {
        let frame = self.frame()?;
        frame.geometry.record_eyes(rec, views)?;
        rec.barrier(&[Access::StorageRead], &[Access::StorageWrite]);
        rec.stage(stages::GBUFFER)?;
        self.gbuffer.record(rec, &self.surfaces, &frame.geometry, &frame.hits)?;
        rec.end_stage()?;
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
        Ok(())
    }

    /// How many recordings of [`Self::record_occlusion`] a picture takes.
    ///
    /// # Errors
    /// Not prepared.
    pub fn occlusion_parts(&self) -> Result<u32> {
        Ok(self.method.parts(&self.pixels(self.frame()?)))
    }

    /// Records a part of the occlusion of what pixels show.
    ///
    /// # Errors
    /// Not prepared.
    pub fn record_occlusion(&self, rec: &mut Recorder, part: u32) -> Result<()> {
        let frame = self.frame()?;
        self.method.record(rec, &self.pixels(frame), part, &frame.accessibility)?;
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
        Ok(())
    }

    /// Records the picture of what pixels show: alone, or with a volume whose ambient values are up to date, in front of it and behind it.
    /// Copies, kernels and shaders can read it afterwards.
    ///
    /// # Errors
    /// A picture of another size; as [`Renderer::record_picture`] with a volume.
    pub fn record_picture(
        &self,
        rec: &mut Recorder,
        views: &[View],
        look: &Look,
        volume: Option<&Renderer>,
        picture: &Picture,
    ) -> Result<()> {
        look.check()?;
        let frame = self.frame()?;
        if picture.size() != frame.geometry.size() || picture.views() != frame.geometry.views() {
            return Err(Error::refused("picture", "is of another size than prepared for"));
        }
        rec.barrier(
            &[Access::TransferRead, Access::SampledRead, Access::GraphicsRead],
            &[Access::StorageWrite],
        );
        rec.discard(&picture.colour);
        rec.discard(&picture.depth);
        let lit = Lit {
            surfaces: &self.surfaces,
            geometry: &frame.geometry,
            hits: &frame.hits,
            accessibility: &frame.accessibility,
        };
        if let Some(volume) = volume {
            rec.stage(stages::SCENE_DEPTH)?;
            self.light.record_ends(rec, &frame.geometry, picture)?;
            rec.end_stage()?;
            volume.record_ended(rec, views, look, picture)?;
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
        }
        rec.stage(stages::LIGHT)?;
        self.light.record(rec, lit, views, look, picture, volume.map(Renderer::shade))?;
        rec.end_stage()?;
        rec.barrier(
            &[Access::StorageWrite],
            &[Access::TransferRead, Access::SampledRead, Access::GraphicsRead],
        );
        Ok(())
    }

    /// Draws both eyes, or any one to four views, on the device's own queue and reads them back, telling the share that is done.
    ///
    /// # Errors
    /// As [`Self::record_picture`].
    pub fn draw<const VIEWS: usize>(
        &mut self,
        views: &[View; VIEWS],
        look: &Look,
        size: [u32; 2],
        volume: Option<&Renderer>,
        progress: &mut dyn FnMut(f64),
    ) -> Result<(StereoImage<VIEWS>, Timings)> {
        self.prepare(size, VIEWS)?;
        let picture = Picture::new(&self.gpu, size, VIEWS)?;
        let mut timings = Timings::new();
        let mut submit = |rec: Recorder| -> Result<()> {
            for Timing { stage, ms } in rec.submit_and_wait()? {
                add(&mut timings, stage, ms);
            }
            Ok(())
        };
        let mut rec = self.gpu.recorder("geometry of meshes")?;
        self.record_geometry(&mut rec, views)?;
        submit(rec)?;
        let parts = if look.shading.occluded() { self.occlusion_parts()? } else { 0 };
        for part in 0..parts {
            let mut rec = self.gpu.recorder("occlusion of meshes")?;
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
            self.record_occlusion(&mut rec, part)?;
            submit(rec)?;
            progress(f64::from(part + 1) / f64::from(parts + 1));
        }
        let mut rec = self.gpu.recorder("picture of meshes")?;
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
        self.record_picture(&mut rec, views, look, volume, &picture)?;
        submit(rec)?;
        progress(1.0);
        Ok((StereoImage::read(&self.gpu, &picture)?, timings))
    }

    /// 1 − AO of each pixel as last drawn, rows from the top, view after view. Uses the device's queue and waits for it.
    ///
    /// # Errors
    /// Not prepared.
    pub fn accessibility(&self) -> Result<Vec<f32>> {
        let bytes = crate::host::read_buffer(&self.gpu, &self.frame()?.accessibility)?;
        Ok(bytemuck::pod_collect_to_vec(&bytes))
    }
}
