//! The frame: what changed, which parts run for it, all views drawn.
//!
//! ```text
//! volume ─ [occupancy] ─ [parts of the method: opacity, clips, ambient] ─ [distances] ─ [raycast, all views] ─ [present]
//! ```
//!
//! `set_*` say what the scene is; `record_*` write the work that this needs into a command buffer and never touch a queue,
//! so that a host embeds them in its frame; `update` and `draw` do the same on the device's own queue and wait.

use crate::ambient::{Ambient, Categories, Changed};
use crate::draw::bounds::Bounds;
use crate::draw::brick_distance::BrickDistance;
use crate::draw::budget::Controller;
use crate::draw::extent::Extent;
use crate::draw::eyes::FrameBuffer;
use crate::draw::picture::Picture;
use crate::draw::present::Present;
use crate::draw::raycast::Raycast;
use crate::draw::scene_depth::SceneDepth;
use crate::drive::{self, Pace, Part};
use crate::field::Field;
use crate::field::volume_image;
use crate::host::read_values;
use crate::method;
use crate::stages;
use crate::subject::Subject;
use crate::{Error, Result};
use cao_gpu::{Access, Buffer, Format, Gpu, Image, Phase, Recorder, Timings};
use cao_model::clip::Clip;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::volume::Volume;
use glam::Vec3;
use std::sync::Mutex;

mod drawing;
#[cfg(test)]
mod failures;
mod read_back;

pub use crate::draw::band::Bands;
pub use crate::draw::budget::{Drawn, Quality};
pub use crate::draw::eyes::{LateViews, Views};
pub use crate::draw::picture::COLOUR;
pub use crate::draw::target::{Coding, Over, Place, Target, Targets};
pub use read_back::StereoImage;

/// Renders one volume.
pub struct Renderer {
    subject: Subject,
    ambient: Box<dyn Ambient>,
    brick_distance: BrickDistance,
    /// How far rays may leap.
    distances: Buffer,
    bounds_of: Bounds,
    /// Beyond them there is nothing to see.
    bounds: Buffer,
    extent: Extent,
    raycast: Raycast,
    scene_depth: SceneDepth,
    present: Present,
    frame: FrameBuffer,
    /// What is presented; kept from frame to frame.
    presented: Mutex<Option<Picture>>,
    /// What frames with a budget can afford.
    controller: Mutex<Controller>,
    changed: Changed,
    pace: Pace,
    /// Times of preparing clip meshes since the last update.
    prepared: Timings,
}

impl Renderer {
    /// Copies a volume to the device and builds everything that draws it, into colour images of format `colour` by
    /// [`Over::Nothing`]; for other targets a pipeline is built when they first come. Uses the device's queue and waits for it.
    pub fn new(
        gpu: &Gpu,
        volume: &Volume,
        transfer: TransferFunction,
        setup: Setup,
        colour: Format,
    ) -> Result<Self> {
        let subject = Subject::new(gpu, volume, transfer, setup)?;
        Ok(Self {
            ambient: method::of(&subject)?,
            brick_distance: BrickDistance::new(gpu, &subject.field)?,
            distances: BrickDistance::buffer(gpu, &subject.field)?,
            bounds_of: Bounds::new(gpu)?,
            bounds: Bounds::buffer(gpu)?,
            extent: Extent::new(gpu)?,
            raycast: Raycast::new(gpu, &subject.field)?,
            scene_depth: SceneDepth::new(gpu)?,
            present: Present::new(gpu, colour)?,
            frame: FrameBuffer::new(gpu)?,
            presented: Mutex::new(None),
            controller: Mutex::new(Controller::default()),
            subject,
            changed: Changed::ALL,
            pace: Pace::default(),
            prepared: Timings::new(),
        })
    }

    /// Changes the transfer function.
    pub fn set_transfer(&mut self, transfer: TransferFunction) -> Result<()> {
        transfer.check()?;
        // A length of its own changes what every ray sees, even where no opacity changes.
        self.changed.anew |= transfer.reference_mm != self.subject.transfer.reference_mm;
        self.changed.opacities = true;
        self.subject.transfer = transfer;
        Ok(())
    }

    /// Changes how occlusion is computed. Uses the device's queue when clip meshes need new maps for it, and when the method is
    /// another. On error everything stays as it was.
    pub fn set_setup(&mut self, setup: Setup) -> Result<()> {
        setup.check(f64::from(self.subject.field.min_spacing()))?;
        let before = std::mem::replace(&mut self.subject.setup, setup);
        match self.prepare_clips().and_then(|()| self.hold(before)) {
            Ok(changed) => {
                self.changed = changed;
                self.pace.clear();
            }
            Err(error) => {
                // Maps of one radius under rays of another would leave voxels stale.
                self.subject.setup = before;
                self.restore_clips()?;
                return Err(error);
            }
        }
        Ok(())
    }

    /// Makes what is held fit the setup; returns what is out of date then.
    fn hold(&mut self, before: Setup) -> Result<Changed> {
        if before.method == self.subject.setup.method {
            self.ambient.set(&self.subject)?;
            Ok(Changed { anew: true, ..self.changed })
        } else {
            self.ambient = method::of(&self.subject)?;
            Ok(Changed::ALL)
        }
    }

    /// Overwrites a box of voxels, the first of which is `first`, by the values of a volume of the same type. Uses the device's
    /// queue and waits for it.
    ///
    /// # Errors
    /// [`cao_model::Error::Config`] if the box is not inside the volume or the values are of another type.
    pub fn set_values(&mut self, first: [u32; 3], values: &Volume) -> Result<()> {
        let written = self.subject.field.overwrite(&self.subject.gpu, first, values);
        // Values that are refused change nothing; where the device fails some may be there.
        self.changed.opacities |= !matches!(written, Err(Error::Model(_)));
        written
    }

    /// Changes the clips: shapes, sides, poses. Uses the device's queue only where a mesh is new or has a new scale; moving
    /// and turning never do. On error the clips stay as they were.
    pub fn set_clips(&mut self, clips: &[Clip]) -> Result<()> {
        let before = std::mem::replace(&mut self.subject.clips, clips.to_vec());
        if let Err(error) = self.prepare_clips() {
            self.subject.clips = before;
            self.restore_clips()?;
            return Err(error);
        }
        self.changed.clips = true;
        Ok(())
    }

    /// Maps of clip meshes again, after others failed. Where these fail too, nothing counts as done.
    fn restore_clips(&mut self) -> Result<()> {
        let changed = std::mem::replace(&mut self.changed, Changed::ALL);
        self.prepare_clips()?;
        self.changed = changed;
        Ok(())
    }

    fn prepare_clips(&mut self) -> Result<()> {
        let radius = method::map_radius(&self.subject);
        self.prepared.extend(self.subject.prepare_clips(radius)?);
        Ok(())
    }

    /// What changed. From here on nothing counts as done until all of it is: an error or a panic on the way leaves everything to do.
    fn begin(&mut self) -> Changed {
        match self.changed {
            Changed::NOTHING => Changed::NOTHING,
            _ => std::mem::replace(&mut self.changed, Changed::ALL),
        }
    }

    /// What there is to do after these changes, in order.
    fn parts(&self, changed: Changed) -> Vec<Part<'_>> {
        if changed == Changed::NOTHING {
            return Vec::new();
        }
        let mut parts = Vec::new();
        if changed.opacities {
            parts.push(self.subject.occupancy());
        }
        parts.extend(self.ambient.update(&self.subject, changed));
        parts.push(self.distances());
        parts
    }

    /// How far rays may leap, and where they end, after new occupancy or clips.
    fn distances(&self) -> Part<'_> {
        Part::short(stages::DISTANCES, |rec| {
            let (field, occupancy) = (&self.subject.field, &self.subject.occupancy);
            let clip_bricks = self.ambient.fields().clip_bricks;
            self.brick_distance.record(rec, field, occupancy, clip_bricks, &self.distances)?;
            Ok(self.bounds_of.record(rec, field, &self.distances, &self.bounds)?)
        })
    }

    /// Records what brings the ambient volume up to date: nothing where nothing changed.
    ///
    /// From here on the renderer takes the commands as done. They must be submitted, in the order of recording and before
    /// any later use of this renderer reaches the queue; where they are not, call [`Self::invalidate`]. After an error
    /// nothing counts as done, and what was recorded should not be submitted.
    pub fn record_update(&mut self, rec: &mut Recorder) -> Result<()> {
        let changed = self.begin();
        let parts = self.parts(changed);
        if !parts.is_empty() {
            drive::record(rec, &parts)?;
        }
        drop(parts);
        // Hosts that only record never ask for these times; they must not pile up.
        self.prepared.0.clear();
        self.changed = Changed::NOTHING;
        Ok(())
    }

    /// The same on the device's own queue, in parts, telling `progress` the share done. Waits for the end; returns the time of each
    /// stage, clip meshes prepared since the last update included. After an error, or a panic of `progress`, nothing counts as done, and
    /// the next update computes everything.
    pub fn update(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Timings> {
        let changed = self.begin();
        if !self.subject.clips_are_prepared() {
            self.prepare_clips()?;
        }
        let mut timings = std::mem::take(&mut self.prepared);
        let mut pace = std::mem::take(&mut self.pace);
        let ran = drive::run(&self.subject.gpu, &self.parts(changed), &mut pace, progress);
        self.pace = pace;
        timings.extend(ran?);
        self.changed = Changed::NOTHING;
        Ok(timings)
    }

    /// Takes nothing on the device for granted, so that the next update recomputes everything: after commands of
    /// [`Self::record_update`] that were never submitted. Clip meshes stay prepared: that never waits for the host.
    pub fn invalidate(&mut self) {
        self.changed = Changed::ALL;
    }

    /// Refuses to show or read what no longer fits the scene.
    pub(crate) fn current(&self) -> Result<()> {
        match self.changed {
            Changed::NOTHING => Ok(()),
            _ => Err(Error::refused("ambient volume", "out of date; call update or record_update first")),
        }
    }

    /// Brings V_o alone up to date; V_AO goes out of date, so that the next update computes everything. Uses the device's queue and waits
    /// for it.
    pub(crate) fn update_opacity(&mut self) -> Result<()> {
        let changed = std::mem::replace(&mut self.changed, Changed::ALL);
        let mut parts = self.parts(changed);
        parts.retain(|part| matches!(part.stage().phase, Phase::Opacity | Phase::Clip));
        drive::run(&self.subject.gpu, &parts, &mut Pace::default(), &mut |_| ())?;
        Ok(())
    }

    /// An image of the form of V_AO that holds 1. Uses the device's queue and waits for it.
    pub(crate) fn unoccluded(&self) -> Result<Image> {
        let (gpu, format) = (&self.subject.gpu, self.ambient.fields().ambient.desc().format);
        let image = volume_image(gpu, "expected ambient", &self.subject.field, format)?;
        let mut rec = gpu.recorder("expected")?;
        rec.discard(&image);
        rec.barrier(&[], &[Access::TransferWrite]);
        rec.clear_image(&image, [1.0; 4])?;
        rec.submit_and_wait()?;
        Ok(image)
    }

    /// Voxels of each category after the last update; rays by brick tell recomputed bricks from others only, and count nothing
    /// as clipped. Uses the device's queue and waits for it.
    pub fn categories(&self) -> Result<Categories> {
        self.ambient.categories(&self.subject)
    }

    /// V_AO, x fastest. Refuses while out of date. Uses the device's queue and waits for it.
    pub fn read_ambient(&self) -> Result<Vec<f32>> {
        self.current()?;
        Ok(read_values(&self.subject.gpu, self.ambient.fields().ambient)?)
    }

    /// V_o after clipping, x fastest. Refuses while out of date. Uses the device's queue and waits for it.
    pub fn read_opacity(&self) -> Result<Vec<f32>> {
        self.current()?;
        Ok(read_values(&self.subject.gpu, self.ambient.fields().opacity)?)
    }

    /// V_m, x fastest: 0 clipped, 1 affected, 2 untouched; of rays by brick 1 in those that the last update computed and 2
    /// elsewhere. Refuses while out of date. Uses the device's queue and waits for it.
    pub fn read_mask(&self) -> Result<Vec<u8>> {
        self.current()?;
        self.ambient.mask(&self.subject)
    }

    /// How far what is visible, clips and all, reaches along each direction: the largest `d·p` in mm over its points `p`, from the volume's
    /// centre, index axes ([`crate::draw::extent`]); `None` where nothing is visible. It is what [`Fitting`](cao_model::fit::Fitting)
    /// asks for. Refuses while out of date. Uses the device's queue and waits for it.
    pub fn visible_extent(&self, directions: &[Vec3]) -> Result<Option<Vec<f32>>> {
        self.current()?;
        let (subject, fields) = (&self.subject, self.ambient.fields());
        let (occupancy, clip_bricks) = (&subject.occupancy, fields.clip_bricks);
        self.extent.run(&subject.gpu, &subject.field, fields.opacity, occupancy, clip_bricks, directions)
    }

    /// The scene on the device.
    pub fn subject(&self) -> &Subject {
        &self.subject
    }

    /// The method in use.
    pub fn ambient(&self) -> &dyn Ambient {
        &*self.ambient
    }

    pub(crate) fn frame(&self) -> &FrameBuffer {
        &self.frame
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.subject.gpu
    }

    /// The volume on the device.
    pub fn field(&self) -> &Field {
        &self.subject.field
    }

    /// How occlusion is computed.
    pub fn setup(&self) -> &Setup {
        &self.subject.setup
    }
}
