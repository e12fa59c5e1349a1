//! The frame: what changed, which stages run for it, all views drawn.
//!
//! ```text
//! volume ─ [opacity] ─ [classify: clips] ─ [bricks] ─ [lao: full or contextual] ─ [raycast, both eyes]
//! ```
//!
//! `set_*` say what the scene is; `record_*` write the work that this needs into a command buffer and never touch a queue,
//! so that a host embeds them in its frame; `update` and `draw` do the same on the device's own queue and wait.

use crate::clip::Clip;
use crate::gpu::{
    Access, Buffer, BufferUse, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse, Recorder, Timings,
};
use crate::method::volumes::{Kernels, Settings, Volumes, volume_image};
use crate::method::{cao, lao};
use crate::occlusion::Occlusion;
use crate::scene::Method;
use crate::stage::classify::{AntiAliasing, Classify};
use crate::stage::clips::{ClipSet, MapSettings};
use crate::stage::compare::{Compare, Difference};
use crate::stage::consistency::{Consistency, Seen};
use crate::stage::dilate::Dilate;
use crate::stage::eyes::{FrameBuffer, Look, check_count};
use crate::stage::field::Field;
use crate::stage::lao::Scope;
use crate::stage::occupancy::Occupancy;
use crate::stage::opacity::Opacity;
use crate::stage::peel::Peel;
use crate::stage::raycast::{Bindings, Raycast};
use crate::stage::transfer::TransferBuffer;
use crate::transfer::TransferFunction;
use crate::view::View;
use crate::volume::Volume;
use crate::{Error, Result};
use glam::Vec3;

/// Format of the colour images that [`Renderer::draw`] makes.
pub const COLOUR: Format = Format::Rgba32Float;

/// How occlusion is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    /// Rays, quadrature, radius.
    pub occlusion: Occlusion,
    /// Full or contextual updates.
    pub method: Method,
    /// Which voxels get a value.
    pub scope: Scope,
    /// Samples at cut voxels.
    pub anti_aliasing: AntiAliasing,
    /// Depth maps of clip meshes.
    pub maps: MapSettings,
}

impl Setup {
    /// The paper's settings (CAO §4), contextual updates, only needed voxels.
    pub fn paper(min_spacing: f64) -> Self {
        Self {
            occlusion: Occlusion::paper(min_spacing),
            method: Method::Cao,
            scope: Scope::Needed,
            anti_aliasing: AntiAliasing::N32,
            maps: MapSettings::default(),
        }
    }
}

/// Voxels of each category after the last update (CAO §3.3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Categories {
    /// a: clipped.
    pub clipped: u32,
    /// b: visible, neighbourhood changed.
    pub affected: u32,
    /// c: untouched.
    pub untouched: u32,
}

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

/// What has to be brought up to date.
#[derive(Clone, Copy, Debug)]
struct Stale {
    opacity: bool,
    rays: bool,
    precomputed: bool,
    ambient: bool,
}

impl Stale {
    const ALL: Self = Self { opacity: true, rays: true, precomputed: true, ambient: true };
}

/// Renders one volume.
pub struct Renderer {
    gpu: Gpu,
    field: Field,
    volumes: Volumes,
    kernels: Kernels,
    opacity: Opacity,
    occupancy: Occupancy,
    peel: Peel,
    dilate: Dilate,
    raycast: Raycast,
    transfer_buffer: TransferBuffer,
    clip_set: ClipSet,
    frame: FrameBuffer,
    transfer: TransferFunction,
    setup: Setup,
    clips: Vec<Clip>,
    stale: Stale,
    /// Times of preparing clip meshes since the last update.
    prepared: Timings,
}

impl Renderer {
    /// Copies a volume to the device and builds everything that draws it into colour images of format `colour`. Uses the
    /// device's queue and waits for it.
    pub fn new(
        gpu: &Gpu,
        volume: &Volume,
        transfer: TransferFunction,
        setup: Setup,
        colour: Format,
    ) -> Result<Self> {
        setup.occlusion.check(volume.min_spacing())?;
        transfer.check()?;
        let field = Field::upload(gpu, volume)?;
        Ok(Self {
            gpu: gpu.clone(),
            volumes: Volumes::new(gpu, &field)?,
            kernels: Kernels::new(gpu)?,
            opacity: Opacity::new(gpu)?,
            occupancy: Occupancy::new(gpu)?,
            peel: Peel::new(gpu)?,
            dilate: Dilate::new(gpu)?,
            raycast: Raycast::new(gpu, colour)?,
            transfer_buffer: TransferBuffer::new(gpu)?,
            clip_set: ClipSet::new(gpu)?,
            frame: FrameBuffer::new(gpu)?,
            field,
            transfer,
            setup,
            clips: Vec::new(),
            stale: Stale::ALL,
            prepared: Timings::new(),
        })
    }

    /// Changes the transfer function.
    pub fn set_transfer(&mut self, transfer: TransferFunction) -> Result<()> {
        transfer.check()?;
        self.transfer = transfer;
        self.stale = Stale { opacity: true, precomputed: true, ambient: true, ..self.stale };
        Ok(())
    }

    /// Changes how occlusion is computed. Uses the device's queue when clip meshes need new maps for it. On error
    /// everything stays as it was.
    pub fn set_setup(&mut self, setup: Setup) -> Result<()> {
        setup.occlusion.check(f64::from(self.field.min_spacing()))?;
        let before = std::mem::replace(&mut self.setup, setup);
        if let Err(error) = self.prepare_clips() {
            // Maps of one radius under rays of another would leave voxels stale.
            self.setup = before;
            self.prepare_clips()?;
            return Err(error);
        }
        self.stale = Stale { rays: true, precomputed: true, ambient: true, ..self.stale };
        Ok(())
    }

    /// Changes the clips: shapes, sides, poses. Uses the device's queue only where a mesh is new or has a new scale; moving
    /// and turning never do. On error the clips stay as they were.
    pub fn set_clips(&mut self, clips: &[Clip]) -> Result<()> {
        let before = std::mem::replace(&mut self.clips, clips.to_vec());
        if let Err(error) = self.prepare_clips() {
            self.clips = before;
            self.prepare_clips()?;
            return Err(error);
        }
        self.stale.ambient = true;
        Ok(())
    }

    fn prepare_clips(&mut self) -> Result<()> {
        let radius = self.map_radius();
        let maps = self.setup.maps;
        let timings = self.clip_set.prepare(
            &self.gpu,
            &self.peel,
            &self.dilate,
            &self.clips,
            radius,
            self.half_diagonal(),
            maps,
        )?;
        self.prepared.extend(timings);
        Ok(())
    }

    /// Half the volume's diagonal in mm.
    fn half_diagonal(&self) -> f32 {
        let edge = |i: usize| self.field.dims[i] as f32 * self.field.spacing[i];
        0.5 * Vec3::new(edge(0), edge(1), edge(2)).length()
    }

    /// The literal recipe dilates by the ray's length alone.
    fn map_radius(&self) -> f32 {
        if self.setup.maps.literal {
            self.setup.occlusion.reach(f64::from(self.field.min_spacing()))
        } else {
            Classify::reach(&self.field, &self.setup.occlusion)
        }
    }

    fn settings(&self) -> Settings {
        Settings {
            occlusion: self.setup.occlusion,
            scope: self.setup.scope,
            reference_mm: self.transfer.reference_mm(f64::from(self.field.min_spacing())),
        }
    }

    /// Records what brings the ambient volume up to date: nothing where nothing changed.
    ///
    /// From here on the renderer takes the commands as done. They must be submitted, in the order of recording and before
    /// any later use of this renderer reaches the queue; where they are not, call [`Self::invalidate`]. After an error
    /// nothing counts as done, and what was recorded should not be submitted.
    pub fn record_update(&mut self, rec: &mut Recorder) -> Result<()> {
        let settings = self.settings();
        self.record_opacity(rec)?;
        if self.setup.method == Method::Cao && self.stale.precomputed {
            lao::record(
                rec,
                &self.field,
                &self.kernels,
                &self.volumes,
                &settings,
                &self.volumes.full_opacity,
                &self.volumes.precomputed,
            )?;
            self.record_all_changed(rec)?;
        }
        if self.stale.ambient {
            self.record_clips(rec)?;
            match self.setup.method {
                Method::Cao => cao::record(rec, &self.field, &self.kernels, &self.volumes, &settings)?,
                Method::Lao => lao::record(
                    rec,
                    &self.field,
                    &self.kernels,
                    &self.volumes,
                    &settings,
                    &self.volumes.opacity,
                    &self.volumes.ambient,
                )?,
            }
        }
        self.updated();
        Ok(())
    }

    /// The same on the device's own queue, in parts, telling `progress` the share done of each long stage. Waits for
    /// the end; returns the time of each stage in ms, clip meshes prepared since the last update included.
    pub fn update(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Timings> {
        let settings = self.settings();
        let mut timings = std::mem::take(&mut self.prepared);
        if self.stale.opacity || self.stale.rays {
            let mut rec = self.gpu.recorder("opacity")?;
            self.record_opacity(&mut rec)?;
            timings.extend(rec.submit_and_wait()?);
        }
        let (field, kernels, volumes) = (&self.field, &self.kernels, &self.volumes);
        if self.setup.method == Method::Cao && self.stale.precomputed {
            let (from, to) = (&volumes.full_opacity, &volumes.precomputed);
            let parts = lao::run(&self.gpu, field, kernels, volumes, &settings, from, to, progress)?;
            timings.extend(parts.into_iter().map(|(name, ms)| (format!("precompute {name}"), ms)));
            let mut rec = self.gpu.recorder("changed")?;
            self.record_all_changed(&mut rec)?;
            rec.submit_and_wait()?;
        }
        if self.stale.ambient {
            let mut rec = self.gpu.recorder("clips")?;
            self.record_clips(&mut rec)?;
            timings.extend(rec.submit_and_wait()?);
            timings.extend(match self.setup.method {
                Method::Cao => cao::run(&self.gpu, field, kernels, volumes, &settings, progress)?,
                Method::Lao => {
                    let (from, to) = (&volumes.opacity, &volumes.ambient);
                    lao::run(&self.gpu, field, kernels, volumes, &settings, from, to, progress)?
                }
            });
        }
        self.updated();
        Ok(timings)
    }

    /// Takes nothing on the device for granted, so that the next update recomputes everything: after commands of
    /// [`Self::record_update`] that were never submitted. Clip meshes stay prepared: that never waits for the host.
    pub fn invalidate(&mut self) {
        self.stale = Stale::ALL;
    }

    /// Refuses to show or read what no longer fits the scene.
    fn current(&self) -> Result<()> {
        let Stale { opacity, precomputed, ambient, .. } = self.stale;
        // V_PAO is no part of a full computation.
        if opacity || ambient || (precomputed && self.setup.method == Method::Cao) {
            return Err(Error::Config {
                what: "ambient volume".into(),
                problem: "out of date; call update or record_update first".into(),
            });
        }
        Ok(())
    }

    fn updated(&mut self) {
        // Hosts that only record never ask for these times; they must not pile up.
        self.prepared.clear();
        // V_PAO belongs to contextual updates only; a full one leaves it as stale as it was.
        let precomputed = self.stale.precomputed && self.setup.method == Method::Lao;
        self.stale = Stale { opacity: false, rays: false, precomputed, ambient: false };
    }

    fn record_opacity(&self, rec: &mut Recorder) -> Result<()> {
        if self.stale.rays {
            self.kernels.lao.record_rays(rec, &self.setup.occlusion)?;
        }
        if self.stale.opacity {
            self.transfer_buffer.record(rec, &self.transfer)?;
            rec.barrier(
                &[Access::SampledRead, Access::GraphicsRead, Access::TransferWrite],
                &[Access::StorageWrite, Access::SampledRead],
            );
            rec.stage("opacity")?;
            self.opacity.record(rec, &self.field, &self.transfer_buffer, &self.volumes.full_opacity)?;
            rec.end_stage()?;
            rec.stage("occupancy")?;
            self.occupancy.record(rec, &self.field, &self.transfer_buffer, &self.volumes.occupancy)?;
            rec.end_stage()?;
            rec.barrier(&[Access::StorageWrite], &[Access::SampledRead, Access::GraphicsRead]);
        }
        Ok(())
    }

    /// After a new V_PAO every brick of V_AO is out of date.
    fn record_all_changed(&self, rec: &mut Recorder) -> Result<()> {
        rec.barrier(&[Access::StorageRead, Access::StorageWrite], &[Access::TransferWrite]);
        rec.fill(&self.volumes.changed_before, 0, self.volumes.changed_before.bytes(), 1)?;
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::StorageWrite]);
        Ok(())
    }

    fn record_clips(&self, rec: &mut Recorder) -> Result<()> {
        self.clip_set.record(rec, &self.clips, self.half_diagonal())?;
        let count = &self.kernels.classify.count;
        rec.barrier(&[Access::TransferRead, Access::StorageWrite], &[Access::TransferWrite]);
        rec.fill(count, 0, count.bytes(), 0)?;
        rec.barrier(
            &[Access::TransferWrite, Access::SampledRead, Access::GraphicsRead, Access::TransferRead],
            &[Access::StorageRead, Access::StorageWrite],
        );
        let reach = Classify::reach(&self.field, &self.setup.occlusion);
        rec.stage("classify")?;
        let clip_bricks = &self.volumes.clip_bricks;
        self.kernels.clip_bricks.record(rec, &self.field, &self.clip_set, reach, clip_bricks)?;
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
        self.kernels.classify.record(
            rec,
            &self.field,
            &self.clip_set,
            self.setup.anti_aliasing,
            reach,
            self.setup.maps.literal,
            clip_bricks,
            &self.volumes.full_opacity,
            &self.volumes.opacity,
            &self.volumes.mask,
        )?;
        rec.end_stage()?;
        rec.barrier(
            &[Access::StorageWrite],
            &[Access::SampledRead, Access::GraphicsRead, Access::TransferRead],
        );
        Ok(())
    }

    /// Records one to four views ([`View::MAX`]) into as many layers of `colour` and `depth` (`D32Float`), in one multiview pass. Refuses
    /// while the ambient volume is out of date. Numbers other than two build a pipeline when they first come.
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
        let reference_mm = self.settings().reference_mm;
        self.frame.record(rec, &self.field, views, look, reference_mm)?;
        rec.stage("raycast")?;
        let bindings = Bindings {
            field: &self.field,
            transfer: &self.transfer_buffer,
            opacity: &self.volumes.opacity,
            ambient: &self.volumes.ambient,
            occupancy: &self.volumes.occupancy,
            clips: &self.clip_set,
            frame: &self.frame,
        };
        self.raycast.record(rec, bindings, views.len(), colour, depth, size)?;
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
        check_count(VIEWS)?;
        if size.contains(&0) {
            return Err(Error::Config {
                what: "image size".into(),
                problem: format!("{} x {}; expected at least 1 x 1 pixels", size[0], size[1]),
            });
        }
        let target = |name, format, extra| {
            self.gpu.image(
                name,
                &ImageDesc {
                    dims: [size[0], size[1], 1],
                    layers: VIEWS as u32,
                    format,
                    kind: ImageKind::D2,
                    usage: ImageUse::ATTACHMENT | extra,
                },
            )
        };
        let colour = target("colour", COLOUR, ImageUse::SAMPLED)?;
        let depth = target("depth", Format::D32Float, ImageUse::SAMPLED)?;
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let read_back = |bytes| self.gpu.buffer("image read-back", bytes, BufferUse::Readback);
        let colours = (0..VIEWS).map(|_| read_back(16 * pixels)).collect::<Result<Vec<_>>>()?;
        let depths = (0..VIEWS).map(|_| read_back(4 * pixels)).collect::<Result<Vec<_>>>()?;

        let mut rec = self.gpu.recorder("draw")?;
        rec.discard(&colour);
        rec.discard(&depth);
        rec.barrier(&[], &[Access::AttachmentWrite]);
        self.record_draw(&mut rec, views, look, &colour, &depth, size)?;
        rec.barrier(&[Access::AttachmentWrite], &[Access::TransferRead]);
        for eye in 0..VIEWS {
            let extent = [size[0], size[1], 1];
            rec.copy_image_to_buffer(&colour, eye as u32, [0; 3], extent, &colours[eye], 0)?;
            rec.copy_image_to_buffer(&depth, eye as u32, [0; 3], extent, &depths[eye], 0)?;
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

    /// Recomputes the ambient volume in full, beside the current one, and compares the two bit by bit on every voxel that has
    /// a value. Also returns the time of the full recomputation. Refuses while the ambient volume is out of date. Uses the device's queue
    /// and waits for it.
    pub fn verify(&self, progress: &mut dyn FnMut(f64)) -> Result<(Difference, Timings)> {
        self.current()?;
        let expected = volume_image(&self.gpu, "expected ambient", &self.field, Format::R32Float)?;
        let mut rec = self.gpu.recorder("expected")?;
        rec.discard(&expected);
        rec.submit_and_wait()?;
        let v = &self.volumes;
        let settings = self.settings();
        let timings =
            lao::run(&self.gpu, &self.field, &self.kernels, v, &settings, &v.opacity, &expected, progress)?;
        let difference = Compare::new(&self.gpu)?.run(
            &self.gpu,
            &self.field,
            self.setup.scope,
            &v.list,
            &v.opacity,
            &v.mask,
            &expected,
            &v.ambient,
        )?;
        Ok((difference, timings))
    }

    /// What the left and the right eye read at world points in mm, in the order given. Refuses while the ambient volume is out of date.
    /// Uses the device's queue and waits for it.
    pub fn seen_by_both(&self, views: &[View; 2], look: &Look, points: &[Vec3]) -> Result<Vec<[Seen; 2]>> {
        self.current()?;
        let mut rec = self.gpu.recorder("frame")?;
        self.frame.record(&mut rec, &self.field, views, look, self.settings().reference_mm)?;
        rec.submit_and_wait()?;
        let v = &self.volumes;
        Consistency::new(&self.gpu)?.run(&self.gpu, &self.frame, &v.opacity, &v.ambient, points)
    }

    /// Voxels of each category after the last update. Uses the device's queue and waits for it.
    pub fn categories(&self) -> Result<Categories> {
        let count = &self.kernels.classify.count;
        let read_back = self.gpu.buffer("count read-back", count.bytes(), BufferUse::Readback)?;
        let mut rec = self.gpu.recorder("read count")?;
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        rec.copy_buffer(count, 0, &read_back, 0, count.bytes())?;
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        rec.submit_and_wait()?;
        let [clipped, affected, untouched] = bytemuck::pod_read_unaligned(&read_back.read(0, 12)?);
        Ok(Categories { clipped, affected, untouched })
    }

    /// V_AO, x fastest. Refuses while out of date. Uses the device's queue and waits for it.
    pub fn read_ambient(&self) -> Result<Vec<f32>> {
        Ok(bytemuck::pod_collect_to_vec(&self.read_volume(&self.volumes.ambient)?))
    }

    /// V_o after clipping, x fastest. Refuses while out of date. Uses the device's queue and waits for it.
    pub fn read_opacity(&self) -> Result<Vec<f32>> {
        Ok(bytemuck::pod_collect_to_vec(&self.read_volume(&self.volumes.opacity)?))
    }

    /// V_m, x fastest: 0 clipped, 1 affected, 2 untouched. Refuses while out of date. Uses the device's queue and waits
    /// for it.
    pub fn read_mask(&self) -> Result<Vec<u8>> {
        self.read_volume(&self.volumes.mask)
    }

    /// Texels of a volume, slices at a time so that no buffer exceeds a device's limits.
    fn read_volume(&self, image: &Image) -> Result<Vec<u8>> {
        self.current()?;
        let [x, y, z] = self.field.dims;
        let slice = u64::from(x) * u64::from(y) * image.desc().format.bytes();
        let slices = ((64 << 20) / slice).clamp(1, u64::from(z)) as u32;
        let read_back =
            self.gpu.buffer("volume read-back", slice * u64::from(slices), BufferUse::Readback)?;
        let mut all = Vec::with_capacity((slice * u64::from(z)) as usize);
        let mut first = 0;
        while first < z {
            let count = slices.min(z - first);
            let mut rec = self.gpu.recorder("read volume")?;
            rec.copy_image_to_buffer(image, 0, [0, 0, first], [x, y, count], &read_back, 0)?;
            rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
            rec.submit_and_wait()?;
            all.extend(read_back.read(0, slice * u64::from(count))?);
            first += count;
        }
        Ok(all)
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// The volume on the device.
    pub fn field(&self) -> &Field {
        &self.field
    }

    /// How occlusion is computed.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }
}
