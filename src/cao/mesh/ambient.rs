//! The seam of methods whose values belong to pixels, and those that read the triangles of the world.

use crate::mesh::gather::{Blocks, Gather, Scene};
use crate::mesh::geometry::Geometry;
use crate::mesh::surfaces::{Surfaces, VolumeTree};
use crate::mesh::trace::{Rays, Trace};
use crate::mesh::trace_queries::TraceQueries;
use crate::mesh::upsample::Upsample;
use crate::stages;
use crate::{Error, Result};
use cao_gpu::{AccelerationStructure, Access, Buffer, DeviceKind, Gpu, Recorder};

/// Gives each pixel the light that reaches it.
pub trait PixelAmbient {
    /// Makes ready what it needs of a world and of pictures of this size. Uses the device's queue and waits for it.
    ///
    /// # Errors
    /// A reach that is no length; a device without memory.
    fn prepare(&mut self, on: &Pixels) -> Result<()>;

    /// How many recordings the values of a picture take, none of which keeps a slow device for much longer than a tenth of a second.
    fn parts(&self, on: &Pixels) -> u32;

    /// Records one of them, in order; after the last `accessibility` holds 1 − AO of each pixel, an f32 in the order of the geometry. Barriers
    /// between parts, and after the last, are its caller's.
    ///
    /// # Errors
    /// Pictures of another size than prepared for.
    fn record(&self, rec: &mut Recorder, on: &Pixels, part: u32, accessibility: &Buffer) -> Result<()>;
}

/// What such a method has before it.
#[derive(Clone, Copy)]
pub struct Pixels<'a> {
    /// The device.
    pub gpu: &'a Gpu,
    /// Normals and depths.
    pub geometry: &'a Geometry,
    /// The triangles they are of.
    pub surfaces: &'a Surfaces,
    /// How far occlusion reaches, in mm.
    pub delta_mm: f32,
}

/// Rays: [`Trace`], or [`TraceQueries`] where the device has ray queries in hardware.
pub struct ByRays {
    /// For worlds with caps too, of which queries know nothing.
    walks: Trace,
    /// With the structure of the triangles that were prepared for.
    queries: Option<(TraceQueries, Option<(Buffer, AccelerationStructure)>)>,
    rays: u32,
}

/// Rays times pixels of a part: some hundredth of a second of a software driver at each of ten thousand triangles' depth of tree.
const RAYS_OF_A_PART: u32 = 1 << 17;

/// How many times as much a part has on hardware: a small GPU is so much faster, and a large one stands idle with less.
const ON_HARDWARE: u32 = 64;

/// What a part has, of what it has on a software driver.
fn scaled(gpu: &Gpu, of_a_part: u32) -> u32 {
    if gpu.info().kind == DeviceKind::Cpu { of_a_part } else { ON_HARDWARE * of_a_part }
}

impl ByRays {
    /// So many a pixel, the faster way: by queries where a device has them, but for software drivers, whose queries are the slower
    /// (`docs/meshes.md`).
    pub fn new(gpu: &Gpu, rays: u32) -> Result<Self> {
        if gpu.ray_queries() && gpu.info().kind != DeviceKind::Cpu {
            Self::queries(gpu, rays)
        } else {
            Self::walks(gpu, rays)
        }
    }

    /// So many a pixel, by walks through the tree, which every device can.
    pub fn walks(gpu: &Gpu, rays: u32) -> Result<Self> {
        Ok(Self { walks: Trace::new(gpu)?, queries: None, rays })
    }

    /// So many a pixel, by ray queries.
    ///
    /// # Errors
    /// A device without ([`Gpu::ray_queries`]).
    pub fn queries(gpu: &Gpu, rays: u32) -> Result<Self> {
        let queries = Some((TraceQueries::new(gpu)?, None));
        Ok(Self { queries, ..Self::walks(gpu, rays)? })
    }

    fn of_a_part(on: &Pixels) -> u32 {
        let [width, height] = on.geometry.size();
        (scaled(on.gpu, RAYS_OF_A_PART) / (width * height * on.geometry.views() as u32).max(1)).max(1)
    }
}

impl PixelAmbient for ByRays {
    fn prepare(&mut self, on: &Pixels) -> Result<()> {
        let Some((_, made)) = &mut self.queries else { return Ok(()) };
        let triangles = &on.surfaces.triangles;
        if !made.as_ref().is_some_and(|(of, _)| of.is(triangles)) {
            *made = Some((triangles.clone(), on.surfaces.structure(on.gpu)?));
        }
        Ok(())
    }

    fn parts(&self, on: &Pixels) -> u32 {
        self.rays.div_ceil(Self::of_a_part(on))
    }

    fn record(&self, rec: &mut Recorder, on: &Pixels, part: u32, accessibility: &Buffer) -> Result<()> {
        let Pixels { geometry, surfaces, delta_mm, .. } = *on;
        let some = part * Self::of_a_part(on)..((part + 1) * Self::of_a_part(on)).min(self.rays);
        let rays = Rays { some, all: self.rays };
        let Some((queries, made)) = self.queries.as_ref().filter(|_| !surfaces.caps()) else {
            rec.stage(stages::TRACE)?;
            self.walks.record(rec, surfaces, geometry, delta_mm, rays, accessibility)?;
            return Ok(rec.end_stage()?);
        };
        let made = made.as_ref().filter(|(of, _)| of.is(&surfaces.triangles));
        let (_, world) = made.ok_or_else(unprepared)?;
        rec.stage(stages::TRACE)?;
        queries.record(rec, (surfaces, world), geometry, delta_mm, rays, accessibility)?;
        Ok(rec.end_stage()?)
    }
}

fn unprepared() -> Error {
    Error::refused("ambient occlusion of pixels", "is not prepared for these surfaces; call prepare first")
}

/// Ambient occlusion volumes, gathered: of all pixels, or of some with a joint bilateral mean between.
pub struct ByVolumes {
    gather: Gather,
    upsample: Upsample,
    step: u32,
    /// Of the triangles and the reach that were prepared for: whatever the size is.
    volumes: Option<(Buffer, f32, VolumeTree)>,
    blocks: Option<Blocks>,
}

/// Pixels of a part of all: a tenth of a second of a software driver where each lies in some hundred volumes.
const PIXELS_OF_A_PART: u32 = 1 << 14;

impl ByVolumes {
    /// Every `step`-th pixel in each direction, by volumes whose corners are `clamped` as printed (AOV §5.2) or not.
    pub fn new(gpu: &Gpu, step: u32, clamped: bool) -> Result<Self> {
        Ok(Self {
            gather: Gather::new(gpu, clamped)?,
            upsample: Upsample::new(gpu)?,
            step,
            volumes: None,
            blocks: None,
        })
    }

    /// The tree of what is to be shaded, if it was prepared for.
    fn volumes(&self, on: &Pixels) -> Option<&VolumeTree> {
        let (of, delta_mm, volumes) = self.volumes.as_ref()?;
        (of.is(&on.surfaces.triangles) && *delta_mm == on.delta_mm).then_some(volumes)
    }

    /// Some thousands of pixels, whole workgroups.
    fn rows_of_a_part(on: &Pixels) -> u32 {
        let row = on.geometry.size()[0] * on.geometry.views() as u32;
        (scaled(on.gpu, PIXELS_OF_A_PART) / row.max(1)).max(1).next_multiple_of(8)
    }
}

impl PixelAmbient for ByVolumes {
    fn prepare(&mut self, on: &Pixels) -> Result<()> {
        if self.volumes(on).is_none() {
            let volumes = on.surfaces.volumes(on.gpu, on.delta_mm, self.gather.clamped)?;
            self.volumes = Some((on.surfaces.triangles.clone(), on.delta_mm, volumes));
        }
        self.blocks = (self.step > 1).then(|| Blocks::new(on.gpu, on.geometry, self.step)).transpose()?;
        Ok(())
    }

    fn parts(&self, on: &Pixels) -> u32 {
        if self.step == 1 { on.geometry.size()[1].div_ceil(Self::rows_of_a_part(on)) } else { 1 }
    }

    fn record(&self, rec: &mut Recorder, on: &Pixels, part: u32, accessibility: &Buffer) -> Result<()> {
        let volumes = self.volumes(on).ok_or_else(unprepared)?;
        let Pixels { geometry, surfaces, delta_mm, .. } = *on;
        let scene = Scene { geometry, surfaces, volumes, delta_mm };
        rec.stage(stages::GATHER)?;
        let Some(blocks) = &self.blocks else {
            let (rows, height) = (Self::rows_of_a_part(on), geometry.size()[1]);
            let rows = part * rows..((part + 1) * rows).min(height);
            self.gather.record_full(rec, scene, rows, accessibility)?;
            return Ok(rec.end_stage()?);
        };
        self.gather.record_sparse(rec, scene, blocks)?;
        rec.end_stage()?;
        rec.stage(stages::UPSAMPLE)?;
        self.upsample.record(rec, scene, blocks, accessibility)?;
        rec.end_stage()?;
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
        rec.stage(stages::FAILED)?;
        self.gather.record_failed(rec, scene, blocks, accessibility)?;
        Ok(rec.end_stage()?)
    }
}
