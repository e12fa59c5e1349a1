//! The frame: what changed, which stages run for it, all views drawn.
//!
//! ```text
//! volume ─ [opacity] ─ [classify: clips] ─ [bricks] ─ [lao: full or contextual] ─ [raycast, both eyes]
//! ```
//!
//! `set_*` say what the scene is; `record_*` write the work that this needs into a command buffer and never touch a queue,
//! so that a host embeds them in its frame; `update` and `draw` do the same on the device's own queue and wait.

use crate::cast::volumes::{Kernels, Settings, Volumes, read_texels, read_values, volume_image};
use crate::cast::{contextual as cao, full as lao};
use crate::clip::classify::Classify;
use crate::clip::clips::ClipSet;
use crate::clip::dilate::Dilate;
use crate::clip::peel::Peel;
use crate::draw::brick_distance::BrickDistance;
use crate::draw::eyes::{FrameBuffer, check_count};
use crate::draw::raycast::{Bindings, Raycast};
use crate::field::occupancy::Occupancy;
use crate::field::opacity::Opacity;
use crate::field::transfer::TransferBuffer;
use crate::field::{BRICK, Field};
use crate::sweep::method::{self as sweep, Edit, SweepKernels, SweptVolumes};
use crate::sweep::near::TODO;
use crate::verify::compare::{Compare, Difference, Recomputed};
use crate::verify::consistency::{Consistency, Seen};
use crate::verify::probe::Probe;
use crate::{Error, Result};
use cao_gpu::{
    Access, Buffer, BufferUse, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse, Recorder, Timings,
};
use cao_model::clip::Clip;
use cao_model::look::Look;
use cao_model::methods::Method;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::View;
use cao_model::volume::Volume;
use glam::Vec3;

/// Format of the colour images that [`Renderer::draw`] makes.
pub const COLOUR: Format = Format::Rgba32Float;

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

    /// Whether a sweep has something to do.
    fn any(self) -> bool {
        self.opacity || self.rays || self.ambient
    }
}

/// Kernels and volumes of the method in use.
enum Held {
    /// [`Method::Lao`] and [`Method::Cao`], rays by the sampler.
    Cast(Box<(Kernels, Volumes)>),
    /// [`Method::Sweep`].
    Swept(Box<(SweepKernels, SweptVolumes)>),
}

impl Held {
    fn new(gpu: &Gpu, field: &Field, setup: &Setup) -> Result<Self> {
        Ok(match setup.method {
            Method::Lao | Method::Cao => {
                Self::Cast(Box::new((Kernels::new(gpu)?, Volumes::new(gpu, field)?)))
            }
            Method::Sweep => {
                let volumes = SweptVolumes::new(gpu, field, &setup.occlusion, setup.scope)?;
                Self::Swept(Box::new((SweepKernels::new(gpu)?, volumes)))
            }
        })
    }

    /// V_o after clipping.
    fn opacity(&self) -> &Image {
        match self {
            Self::Cast(cast) => &cast.1.opacity,
            Self::Swept(swept) => &swept.1.opacity,
        }
    }

    /// V_AO.
    fn ambient(&self) -> &Image {
        match self {
            Self::Cast(cast) => &cast.1.ambient,
            Self::Swept(swept) => &swept.1.ambient,
        }
    }

    /// Bricks that can have opacity.
    fn occupancy(&self) -> &Buffer {
        match self {
            Self::Cast(cast) => &cast.1.occupancy,
            Self::Swept(swept) => &swept.1.occupancy,
        }
    }

    /// What the clips do to each brick.
    fn clip_bricks(&self) -> &Buffer {
        match self {
            Self::Cast(cast) => &cast.1.clip_bricks,
            Self::Swept(swept) => &swept.1.clip_bricks,
        }
    }
}

/// Renders one volume.
pub struct Renderer {
    gpu: Gpu,
    field: Field,
    held: Held,
    opacity: Opacity,
    occupancy: Occupancy,
    brick_distance: BrickDistance,
    /// How far rays may leap.
    distances: Buffer,
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
            held: Held::new(gpu, &field, &setup)?,
            opacity: Opacity::new(gpu)?,
            occupancy: Occupancy::new(gpu)?,
            brick_distance: BrickDistance::new(gpu, &field)?,
            distances: BrickDistance::buffer(gpu, &field)?,
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
        // A length of its own changes what every ray sees, even where no opacity changes.
        let rays = self.stale.rays || transfer.reference_mm != self.transfer.reference_mm;
        self.transfer = transfer;
        self.stale = Stale { opacity: true, precomputed: true, ambient: true, rays };
        Ok(())
    }

    /// Changes how occlusion is computed. Uses the device's queue when clip meshes need new maps for it, and when rays are swept or
    /// cast after the other. On error everything stays as it was.
    pub fn set_setup(&mut self, setup: Setup) -> Result<()> {
        setup.occlusion.check(f64::from(self.field.min_spacing()))?;
        let before = std::mem::replace(&mut self.setup, setup);
        if let Err(error) = self.prepare_clips().and_then(|()| self.hold()) {
            // Maps of one radius under rays of another would leave voxels stale.
            self.setup = before;
            self.prepare_clips()?;
            return Err(error);
        }
        self.stale = Stale { rays: true, precomputed: true, ambient: true, ..self.stale };
        Ok(())
    }

    /// Makes what is held fit the setup.
    fn hold(&mut self) -> Result<()> {
        let Setup { occlusion, scope, method, .. } = self.setup;
        match (&mut self.held, method) {
            (Held::Cast(_), Method::Lao | Method::Cao) => {}
            (Held::Swept(swept), Method::Sweep) => {
                swept.1.set(&self.gpu, &self.field, &occlusion, scope)?;
            }
            _ => {
                self.held = Held::new(&self.gpu, &self.field, &self.setup)?;
                self.stale = Stale::ALL;
            }
        }
        Ok(())
    }

    /// Overwrites a box of voxels, the first of which is `first`, by the values of a volume of the same type. Uses the device's
    /// queue and waits for it.
    ///
    /// # Errors
    /// [`cao_model::Error::Config`] if the box is not inside the volume or the values are of another type.
    pub fn set_values(&mut self, first: [u32; 3], values: &Volume) -> Result<()> {
        self.field.overwrite(&self.gpu, first, values)?;
        self.stale = Stale { opacity: true, precomputed: true, ambient: true, ..self.stale };
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
        if self.setup.method == Method::Sweep {
            // Changes are found in the opacities; nothing is dilated.
            0.0
        } else if self.setup.maps.literal {
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
        match &self.held {
            Held::Cast(cast) => self.record_cast(rec, &cast.0, &cast.1)?,
            Held::Swept(swept) => {
                let (kernels, volumes) = &**swept;
                if self.stale.opacity {
                    self.record_transfer(rec)?;
                    self.record_occupancy(rec)?;
                }
                if self.stale.any() {
                    self.clip_set.record(rec, &self.clips, self.half_diagonal())?;
                    let (transfer, clips) = (&self.transfer_buffer, &self.clip_set);
                    sweep::record(rec, &self.field, kernels, volumes, transfer, clips, &self.edit())?;
                    self.record_distances(rec)?;
                }
            }
        }
        self.updated();
        Ok(())
    }

    /// The same on the device's own queue, in parts, telling `progress` the share done of each long stage. Waits for
    /// the end; returns the time of each stage in ms, clip meshes prepared since the last update included.
    pub fn update(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Timings> {
        let mut timings = std::mem::take(&mut self.prepared);
        match &self.held {
            Held::Cast(cast) => timings.extend(self.update_cast(&cast.0, &cast.1, progress)?),
            Held::Swept(swept) => {
                let (kernels, volumes) = &**swept;
                if self.stale.any() {
                    let mut rec = self.gpu.recorder("opacity")?;
                    if self.stale.opacity {
                        self.record_transfer(&mut rec)?;
                        self.record_occupancy(&mut rec)?;
                    }
                    self.clip_set.record(&mut rec, &self.clips, self.half_diagonal())?;
                    timings.extend(rec.submit_and_wait()?);
                    let (transfer, clips) = (&self.transfer_buffer, &self.clip_set);
                    let (gpu, field, edit) = (&self.gpu, &self.field, self.edit());
                    timings
                        .extend(sweep::run(gpu, field, kernels, volumes, transfer, clips, &edit, progress)?);
                    let mut rec = gpu.recorder("distances")?;
                    self.record_distances(&mut rec)?;
                    timings.extend(rec.submit_and_wait()?);
                }
            }
        }
        self.updated();
        Ok(timings)
    }

    fn record_cast(&self, rec: &mut Recorder, kernels: &Kernels, volumes: &Volumes) -> Result<()> {
        let settings = self.settings();
        self.record_opacity(rec, kernels, volumes)?;
        if self.setup.method == Method::Cao && self.stale.precomputed {
            let (from, to) = (&volumes.full_opacity, &volumes.precomputed);
            lao::record(rec, &self.field, kernels, volumes, &settings, from, to)?;
            Self::record_all_changed(rec, volumes)?;
        }
        if self.stale.ambient {
            self.record_clips(rec, kernels, volumes)?;
            self.record_distances(rec)?;
            if self.setup.method == Method::Cao {
                cao::record(rec, &self.field, kernels, volumes, &settings)?;
            } else {
                let (from, to) = (&volumes.opacity, &volumes.ambient);
                lao::record(rec, &self.field, kernels, volumes, &settings, from, to)?;
            }
        }
        Ok(())
    }

    fn update_cast(
        &self,
        kernels: &Kernels,
        volumes: &Volumes,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Timings> {
        let settings = self.settings();
        let (gpu, field) = (&self.gpu, &self.field);
        let mut timings = Timings::new();
        if self.stale.opacity || self.stale.rays {
            let mut rec = gpu.recorder("opacity")?;
            self.record_opacity(&mut rec, kernels, volumes)?;
            timings.extend(rec.submit_and_wait()?);
        }
        if self.setup.method == Method::Cao && self.stale.precomputed {
            let (from, to) = (&volumes.full_opacity, &volumes.precomputed);
            let parts = lao::run(gpu, field, kernels, volumes, &settings, from, to, progress)?;
            timings.extend(parts.into_iter().map(|(name, ms)| (format!("precompute {name}"), ms)));
            let mut rec = gpu.recorder("changed")?;
            Self::record_all_changed(&mut rec, volumes)?;
            rec.submit_and_wait()?;
        }
        if self.stale.ambient {
            let mut rec = gpu.recorder("clips")?;
            self.record_clips(&mut rec, kernels, volumes)?;
            self.record_distances(&mut rec)?;
            timings.extend(rec.submit_and_wait()?);
            timings.extend(if self.setup.method == Method::Cao {
                cao::run(gpu, field, kernels, volumes, &settings, progress)?
            } else {
                let (from, to) = (&volumes.opacity, &volumes.ambient);
                lao::run(gpu, field, kernels, volumes, &settings, from, to, progress)?
            });
        }
        Ok(timings)
    }

    /// What changed, as a sweep wants it told.
    fn edit(&self) -> Edit {
        Edit {
            opacities: self.stale.opacity,
            ambient: self.stale.rays,
            anti_aliasing: self.setup.anti_aliasing,
            reference_mm: self.settings().reference_mm,
        }
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
            return Err(Error::refused("ambient volume", "out of date; call update or record_update first"));
        }
        Ok(())
    }

    fn updated(&mut self) {
        // Hosts that only record never ask for these times; they must not pile up.
        self.prepared.clear();
        // V_PAO belongs to contextual updates only; a full one leaves it as stale as it was.
        let precomputed = self.stale.precomputed && self.setup.method != Method::Cao;
        self.stale = Stale { opacity: false, rays: false, precomputed, ambient: false };
    }

    fn record_transfer(&self, rec: &mut Recorder) -> Result<()> {
        self.transfer_buffer.record(rec, &self.transfer)?;
        rec.barrier(
            &[Access::SampledRead, Access::StorageRead, Access::GraphicsRead, Access::TransferWrite],
            &[Access::StorageWrite, Access::SampledRead],
        );
        Ok(())
    }

    fn record_occupancy(&self, rec: &mut Recorder) -> Result<()> {
        rec.stage("occupancy")?;
        self.occupancy.record(rec, &self.field, &self.transfer_buffer, self.held.occupancy())?;
        rec.end_stage()?;
        rec.barrier(
            &[Access::StorageWrite],
            &[Access::StorageRead, Access::SampledRead, Access::GraphicsRead],
        );
        Ok(())
    }

    fn record_opacity(&self, rec: &mut Recorder, kernels: &Kernels, volumes: &Volumes) -> Result<()> {
        if self.stale.rays {
            kernels.lao.record_rays(rec, &self.setup.occlusion)?;
        }
        if self.stale.opacity {
            self.record_transfer(rec)?;
            rec.stage("opacity")?;
            self.opacity.record(rec, &self.field, &self.transfer_buffer, &volumes.full_opacity)?;
            rec.end_stage()?;
            self.record_occupancy(rec)?;
        }
        Ok(())
    }

    /// How far rays may leap, after new occupancy or clips.
    fn record_distances(&self, rec: &mut Recorder) -> Result<()> {
        let (occupancy, clip_bricks) = (self.held.occupancy(), self.held.clip_bricks());
        rec.barrier(
            &[Access::StorageRead, Access::StorageWrite, Access::GraphicsRead],
            &[Access::StorageRead, Access::StorageWrite],
        );
        rec.stage("distances")?;
        self.brick_distance.record(rec, &self.field, occupancy, clip_bricks, &self.distances)?;
        rec.end_stage()?;
        rec.barrier(&[Access::StorageWrite], &[Access::GraphicsRead]);
        Ok(())
    }

    /// After a new V_PAO every brick of V_AO is out of date.
    fn record_all_changed(rec: &mut Recorder, volumes: &Volumes) -> Result<()> {
        rec.barrier(&[Access::StorageRead, Access::StorageWrite], &[Access::TransferWrite]);
        rec.fill(&volumes.changed_before, 0, volumes.changed_before.bytes(), 1)?;
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::StorageWrite]);
        Ok(())
    }

    fn record_clips(&self, rec: &mut Recorder, kernels: &Kernels, volumes: &Volumes) -> Result<()> {
        self.clip_set.record(rec, &self.clips, self.half_diagonal())?;
        let count = &kernels.classify.count;
        rec.barrier(&[Access::TransferRead, Access::StorageWrite], &[Access::TransferWrite]);
        rec.fill(count, 0, count.bytes(), 0)?;
        rec.barrier(
            &[Access::TransferWrite, Access::SampledRead, Access::GraphicsRead, Access::TransferRead],
            &[Access::StorageRead, Access::StorageWrite],
        );
        let reach = Classify::reach(&self.field, &self.setup.occlusion);
        rec.stage("classify")?;
        let clip_bricks = &volumes.clip_bricks;
        kernels.clip_bricks.record(rec, &self.field, &self.clip_set, reach, clip_bricks)?;
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
        kernels.classify.record(
            rec,
            &self.field,
            &self.clip_set,
            self.setup.anti_aliasing,
            reach,
            self.setup.maps.literal,
            clip_bricks,
            &volumes.full_opacity,
            &volumes.opacity,
            &volumes.mask,
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
            opacity: self.held.opacity(),
            ambient: self.held.ambient(),
            distances: &self.distances,
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
            let problem = format!("{} x {}; expected at least 1 x 1 pixels", size[0], size[1]);
            return Err(Error::refused("image size", problem));
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
        let colours = (0..VIEWS).map(|_| read_back(16 * pixels)).collect::<cao_gpu::Result<Vec<_>>>()?;
        let depths = (0..VIEWS).map(|_| read_back(4 * pixels)).collect::<cao_gpu::Result<Vec<_>>>()?;

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
        let format = self.held.ambient().desc().format;
        let expected = volume_image(&self.gpu, "expected ambient", &self.field, format)?;
        let mut rec = self.gpu.recorder("expected")?;
        rec.discard(&expected);
        rec.barrier(&[], &[Access::TransferWrite]);
        rec.clear_image(&expected, [1.0; 4])?;
        rec.submit_and_wait()?;
        let (gpu, field, scope, settings) = (&self.gpu, &self.field, self.setup.scope, self.settings());
        let compare = Compare::new(gpu)?;
        let (difference, timings) = match &self.held {
            Held::Cast(cast) => {
                let (kernels, v) = &**cast;
                let timings = lao::run(gpu, field, kernels, v, &settings, &v.opacity, &expected, progress)?;
                let by_mask = Recomputed::Mask(&v.mask);
                let difference =
                    compare.run(gpu, field, scope, &v.list, &v.opacity, by_mask, &expected, &v.ambient)?;
                (difference, timings)
            }
            Held::Swept(swept) => {
                let (kernels, v) = &**swept;
                let (all, timings) =
                    sweep::recompute(gpu, field, kernels, v, settings.reference_mm, &expected, progress)?;
                let by_brick = Recomputed::Bricks(&v.todo);
                let difference =
                    compare.run(gpu, field, scope, &all, &v.opacity, by_brick, &expected, &v.ambient)?;
                (difference, timings)
            }
        };
        Ok((difference, timings))
    }

    /// Brings V_o up to date and lends it to trials of other rays; also returns it, x fastest. V_AO goes out of date: the next
    /// update computes everything. Uses the device's queue and waits for it.
    pub fn probe(&mut self) -> Result<(Probe<'_>, Vec<f32>)> {
        let mut rec = self.gpu.recorder("opacity")?;
        match &self.held {
            Held::Cast(cast) => {
                self.record_opacity(&mut rec, &cast.0, &cast.1)?;
                self.record_clips(&mut rec, &cast.0, &cast.1)?;
            }
            Held::Swept(swept) => {
                let (kernels, volumes) = &**swept;
                if self.stale.opacity {
                    self.record_transfer(&mut rec)?;
                    self.record_occupancy(&mut rec)?;
                }
                self.clip_set.record(&mut rec, &self.clips, self.half_diagonal())?;
                let (transfer, clips) = (&self.transfer_buffer, &self.clip_set);
                let edit = self.edit();
                sweep::record_choice(&mut rec, &self.field, kernels, volumes, transfer, clips, &edit)?;
                rec.barrier(&[Access::StorageWrite], &[Access::TransferRead, Access::SampledRead]);
            }
        }
        rec.submit_and_wait()?;
        self.stale = Stale::ALL;
        let opacity = self.held.opacity();
        let values = read_values(&self.gpu, opacity)?;
        let settings = self.settings();
        let probe = Probe::new(&self.gpu, &self.field, opacity, settings.scope, settings.reference_mm)?;
        Ok((probe, values))
    }

    /// What the left and the right eye read at world points in mm, in the order given. Refuses while the ambient volume is out of date.
    /// Uses the device's queue and waits for it.
    pub fn seen_by_both(&self, views: &[View; 2], look: &Look, points: &[Vec3]) -> Result<Vec<[Seen; 2]>> {
        self.current()?;
        let mut rec = self.gpu.recorder("frame")?;
        self.frame.record(&mut rec, &self.field, views, look, self.settings().reference_mm)?;
        rec.submit_and_wait()?;
        let (opacity, ambient) = (self.held.opacity(), self.held.ambient());
        Ok(Consistency::new(&self.gpu)?.run(&self.gpu, &self.frame, opacity, ambient, points)?)
    }

    /// Voxels of each category after the last update; a sweep tells recomputed bricks from others only, and counts nothing as
    /// clipped. Uses the device's queue and waits for it.
    pub fn categories(&self) -> Result<Categories> {
        match &self.held {
            Held::Cast(cast) => {
                let [clipped, affected, untouched] =
                    bytemuck::pod_read_unaligned(&self.read_buffer(&cast.0.classify.count)?);
                Ok(Categories { clipped, affected, untouched })
            }
            Held::Swept(_) => {
                let mask = self.read_mask()?;
                let affected = mask.iter().filter(|category| **category == 1).count() as u32;
                Ok(Categories { clipped: 0, affected, untouched: mask.len() as u32 - affected })
            }
        }
    }

    /// V_AO, x fastest. Refuses while out of date. Uses the device's queue and waits for it.
    pub fn read_ambient(&self) -> Result<Vec<f32>> {
        self.current()?;
        Ok(read_values(&self.gpu, self.held.ambient())?)
    }

    /// V_o after clipping, x fastest. Refuses while out of date. Uses the device's queue and waits for it.
    pub fn read_opacity(&self) -> Result<Vec<f32>> {
        self.current()?;
        Ok(read_values(&self.gpu, self.held.opacity())?)
    }

    /// V_m, x fastest: 0 clipped, 1 affected, 2 untouched; of a sweep 1 in the bricks that the last update computed and 2
    /// elsewhere. Refuses while out of date. Uses the device's queue and waits for it.
    pub fn read_mask(&self) -> Result<Vec<u8>> {
        self.current()?;
        match &self.held {
            Held::Cast(cast) => Ok(read_texels(&self.gpu, &cast.1.mask)?),
            Held::Swept(swept) => {
                let todo: Vec<u32> = bytemuck::pod_collect_to_vec(&self.read_buffer(&swept.1.todo)?);
                let ([x, y, z], [bx, by, _]) = (self.field.dims, self.field.bricks());
                let mut mask = Vec::with_capacity((x * y * z) as usize);
                for k in 0..z {
                    for j in 0..y {
                        let row = (k / BRICK * by + j / BRICK) * bx;
                        mask.extend((0..x).map(|i| 2 - (todo[(row + i / BRICK) as usize] & TODO) as u8));
                    }
                }
                Ok(mask)
            }
        }
    }

    fn read_buffer(&self, buffer: &Buffer) -> cao_gpu::Result<Vec<u8>> {
        let read_back = self.gpu.buffer("read-back", buffer.bytes(), BufferUse::Readback)?;
        let mut rec = self.gpu.recorder("read buffer")?;
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        rec.copy_buffer(buffer, 0, &read_back, 0, buffer.bytes())?;
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        rec.submit_and_wait()?;
        read_back.read(0, buffer.bytes())
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
