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
use crate::drive::Pace;
use crate::field::Field;
use crate::field::features::FeatureSet;
use crate::field::volume_image;
use crate::host::{read_colours, read_values};
use crate::method;
use crate::subject::Subject;
use crate::{Error, Result};
use cao_gpu::{Access, Buffer, Format, Gpu, Image};
use cao_model::clip::{Clip, Mode};
use cao_model::feature::Features;
use cao_model::light::AmbientLight;
use cao_model::network::Network;
use cao_model::occlusion::{Occlusion, Quadrature};
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::volume::Volume;
use glam::Vec3;
use std::sync::Mutex;

mod building;
mod drawing;
#[cfg(test)]
mod failures;
mod read_back;

use building::Building;

pub use crate::draw::band::Bands;
pub use crate::draw::budget::{Drawn, Quality};
pub use crate::draw::eyes::{LateViews, Views};
pub use crate::draw::picture::COLOUR;
pub use crate::draw::target::{Coding, Over, Place, Target, Targets};
pub use read_back::StereoImage;

/// Whether volumes and pipelines for the one serve the other.
fn kept(one: &Setup, other: &Setup) -> bool {
    one.method == other.method && one.coloured() == other.coloured()
}

/// What methods say that find what changed by clips alone.
const NO_SOLIDS: &str = "lao and cao take no solids, as their updates look at clips alone; choose rays or another, or take the solids away";

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
    /// Edits that no update has taken in.
    changed: Changed,
    /// Edits that no picture can show.
    unshown: Changed,
    building: Building,
    pace: Pace,
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
            unshown: Changed::ALL,
            building: Building::new(gpu)?,
            pace: Pace::default(),
        })
    }

    /// Changes the transfer function.
    pub fn set_transfer(&mut self, transfer: TransferFunction) -> Result<()> {
        transfer.check()?;
        // A length of its own changes what every ray sees, even where no opacity changes.
        let anew = transfer.reference_mm != self.subject.transfer.reference_mm;
        self.edited(Changed { opacities: true, anew, ..Changed::NOTHING });
        self.subject.transfer = transfer;
        Ok(())
    }

    /// Changes the features. How features are shown, visibility, opacity, colour, spared by clips, never uses a queue, and the next update
    /// computes what that affects. Features of other voxels are copied to the device, by its queue, which is waited for; then the next update
    /// computes everything, and nothing is shown before.
    ///
    /// # Errors
    /// Those of [`Features::check`], and of a device without memory; the features stay as they were.
    pub fn set_features(&mut self, features: Features) -> Result<()> {
        features.check(Some(self.subject.field.dims.map(|d| d as usize)))?;
        if features.same_voxels(&self.subject.features.features) {
            self.subject.features.show(features);
            self.edited(Changed { opacities: true, ..Changed::NOTHING });
            return Ok(());
        }
        self.subject.features = FeatureSet::new(&self.subject.gpu, &self.subject.field, features)?;
        self.spoil();
        Ok(())
    }

    fn edited(&mut self, changed: Changed) {
        (self.changed, self.unshown) = (self.changed.and(changed), self.unshown.and(changed));
    }

    /// Changes how occlusion is computed. Uses the device's queue when the method is another, or light becomes coloured or ceases to be:
    /// then nothing is occluded until the next update has ended. While an update spans frames other settings of the same method wait
    /// for its end. On error everything stays as it was.
    pub fn set_setup(&mut self, setup: Setup) -> Result<()> {
        setup.check(f64::from(self.subject.field.min_spacing()))?;
        let before = (self.subject.setup, self.subject.wanted);
        let waits = self.is_building() && kept(&before.0, &setup);
        if waits {
            self.ambient.accepts(&self.subject, &setup)?;
        } else {
            self.subject.setup = setup;
        }
        self.subject.wanted = setup;
        let planned = match self.subject.solids.any && !method::takes_solids(&self.subject) {
            true => Err(Error::refused("method", NO_SOLIDS)),
            false => self.subject.planned_clips(method::map_radius(&self.subject)),
        };
        let held = planned.and_then(|planned| {
            if !waits {
                self.hold(&before.0)?;
            }
            Ok(planned)
        });
        match held {
            Ok(planned) => self.subject.clip_set = planned,
            Err(error) => {
                (self.subject.setup, self.subject.wanted) = before;
                return Err(error);
            }
        }
        self.edited(Changed { anew: true, ..Changed::NOTHING });
        self.pace.clear();
        self.building.rates.clear();
        Ok(())
    }

    /// Changes the ambient light, and nothing else of how occlusion is computed: every value is computed anew, opacities stay. As
    /// [`Self::set_setup`] otherwise.
    pub fn set_ambient_light(&mut self, light: AmbientLight) -> Result<()> {
        let setup = *self.setup();
        self.set_setup(Setup { occlusion: Occlusion { light, ..setup.occlusion }, ..setup })
    }

    /// Changes the network of method `dvao`; of others nothing is seen of it until they are that one. Uses the device's queue with that method: then
    /// nothing is occluded until the next update has ended. On error everything stays as it was.
    ///
    /// # Errors
    /// [`Error::Model`] for a radius that the network has no grid for, and those of a device without memory.
    pub fn set_network(&mut self, network: Network) -> Result<()> {
        let before = std::mem::replace(&mut self.subject.network, network);
        if self.setup().occlusion.quadrature != Quadrature::Network {
            return Ok(());
        }
        match method::of(&self.subject) {
            Ok(ambient) => self.ambient = ambient,
            Err(error) => {
                self.subject.network = before;
                return Err(error);
            }
        }
        self.spoil();
        self.pace.clear();
        self.building.rates.clear();
        Ok(())
    }

    /// Makes what is held fit the setup; of another method, or of light in colours or none, nothing is up to date.
    fn hold(&mut self, before: &Setup) -> Result<()> {
        if kept(before, &self.subject.setup) {
            return self.ambient.set(&self.subject);
        }
        self.ambient = method::of(&self.subject)?;
        self.spoil();
        Ok(())
    }

    /// Overwrites a box of voxels, the first of which is `first`, by the values of a volume of the same type. Uses the device's
    /// queue and waits for it.
    ///
    /// # Errors
    /// [`cao_model::Error::Config`] if the box is not inside the volume or the values are of another type.
    pub fn set_values(&mut self, first: [u32; 3], values: &Volume) -> Result<()> {
        let written = self.subject.field.overwrite(&self.subject.gpu, first, values);
        // Values that are refused change nothing; where the device fails some may be there.
        if !matches!(written, Err(Error::Model(_))) {
            let features = self.subject.features.follow_values();
            self.edited(Changed { opacities: true, features, ..Changed::NOTHING });
            self.subject.values += 1;
        }
        written
    }

    /// Changes the clips: shapes, sides, poses. Never uses a queue: maps of a mesh that is new, has other vertices or a new ratio of its axes
    /// are made by the next update, and with methods `lao` and `cao` those of another scale. On error the clips stay as they were.
    ///
    /// How many layer pairs a mesh needs is known when that update has run. Too few are refused by `update`, and by the first
    /// `record_update…` that is called after the recorded commands have run and their [`Recorded`](cao_gpu::Recorded) is dropped; until then what
    /// lies behind the last pair is not cut.
    pub fn set_clips(&mut self, clips: &[Clip]) -> Result<()> {
        let before = std::mem::replace(&mut self.subject.clips, clips.to_vec());
        match self.subject.planned_clips(method::map_radius(&self.subject)) {
            Ok(planned) => self.subject.clip_set = planned,
            Err(error) => {
                self.subject.clips = before;
                return Err(error);
            }
        }
        self.edited(Changed { clips: true, ..Changed::NOTHING });
        Ok(())
    }

    /// Changes what fills the volume's opacity beside what is in it, up to [`Clip::MAX`] shapes at their poses: an implant, say, whose surface is drawn as
    /// a mesh. Solids occlude and are not drawn; the next update computes what they affect and nothing else. `spared`: clips leave them whole. Uses the
    /// device's queue and waits for it; on error everything stays as it was.
    ///
    /// # Errors
    /// Methods `lao` and `cao`, whose updates look at clips alone; shapes that keep, and what [`Self::set_clips`] refuses.
    pub fn set_solids(&mut self, solids: &[Clip], spared: bool) -> Result<()> {
        if !solids.is_empty() && !method::takes_solids(&self.subject) {
            return Err(Error::refused("solids", NO_SOLIDS));
        }
        if let Some(solid) = solids.iter().find(|solid| solid.mode == Mode::Keep) {
            let problem =
                format!("{}: expected the mode remove, by which its inside counts", solid.shape.name());
            return Err(Error::refused("solid", problem));
        }
        self.subject.solids = self.subject.solids_of(solids, spared)?;
        self.edited(Changed { opacities: true, ..Changed::NOTHING });
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

    /// V_AO, x fastest, as pictures show it: while an update spans frames, that of the last one. Refuses while out of date. Uses the device's queue and waits for it.
    pub fn read_ambient(&self) -> Result<Vec<f32>> {
        self.current()?;
        Ok(read_values(&self.subject.gpu, self.ambient.fields().ambient)?)
    }

    /// V_AO in red, green and blue light, x fastest; of light of one colour its value thrice. As [`Self::read_ambient`] otherwise, which has the
    /// least of the three.
    ///
    /// # Errors
    /// [`cao_model::Error::Config`] with method `fdao`, whose channels are features; and those of the device.
    pub fn read_ambient_colours(&self) -> Result<Vec<[f32; 3]>> {
        self.current()?;
        let ambient = self.ambient.fields().ambient;
        if ambient.desc().format == Format::Rgba16Unorm && !self.subject.coloured() {
            let problem =
                "are of features with method fdao, not of colours; read_ambient has the least of them";
            return Err(Error::refused("ambient channels", problem));
        }
        Ok(read_colours(&self.subject.gpu, ambient)?)
    }

    /// V_o after clipping, x fastest. Refuses while out of date, or while an update spans frames. Uses the device's queue and waits for it.
    pub fn read_opacity(&self) -> Result<Vec<f32>> {
        self.complete()?;
        Ok(read_values(&self.subject.gpu, self.ambient.fields().opacity)?)
    }

    /// V_m, x fastest: 0 clipped, 1 affected, 2 untouched; of rays by brick 1 in those that the last update computed and 2
    /// elsewhere. Refuses while out of date, or while an update spans frames. Uses the device's queue and waits for it.
    pub fn read_mask(&self) -> Result<Vec<u8>> {
        self.complete()?;
        self.ambient.mask(&self.subject)
    }

    /// How far what is visible, clips and all, reaches along each direction: the largest `d·p` in mm over its points `p`, from the volume's
    /// centre, index axes ([`crate::draw::extent`]); `None` where nothing is visible. It is what [`Fitting`](cao_model::fit::Fitting)
    /// asks for. Refuses while out of date, or while an update spans frames. Uses the device's queue and waits for it.
    pub fn visible_extent(&self, directions: &[Vec3]) -> Result<Option<Vec<f32>>> {
        self.complete()?;
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

    /// How occlusion is computed, or will be when an update that spans frames has ended.
    #[expect(
        clippy::misnamed_getters,
        reason = "the one that was set, not the one that a running update has"
    )]
    pub fn setup(&self) -> &Setup {
        &self.subject.wanted
    }
}
