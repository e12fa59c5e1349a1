//! What draws, recorded: into a picture, or into a host's attachments.

use super::Renderer;
use crate::draw::band::Band;
use crate::draw::budget::{Drawn, Quality};
use crate::draw::eyes::Views;
use crate::draw::picture::Picture;
use crate::draw::raycast::Bindings;
use crate::draw::target::Targets;
use crate::mesh::light::VolumeShade;
use crate::stages;
use crate::{Error, Result};
use cao_gpu::{Access, Recorder};
use cao_model::look::Look;
use cao_model::view::View;
use std::ops::Range;
use std::sync::PoisonError;

/// What is drawn into a picture.
#[derive(Clone, Copy)]
pub(super) struct Shot<'a> {
    pub views: Views<'a>,
    pub look: &'a Look,
    pub picture: &'a Picture,
    /// Where it goes from there, and what ends its rays.
    pub targets: Option<&'a Targets<'a>>,
    /// Whether the picture's depth holds how far rays go.
    pub ended: bool,
}

impl Renderer {
    /// Records one to four views ([`View::MAX`](cao_model::view::View::MAX)), known now or [late](crate::draw::eyes::LateViews), into a picture of as many, whose content before is given up; copies, kernels and shaders
    /// can read it afterwards. Refuses while the ambient volume is out of date.
    ///
    /// Returns what is drawn: with [`Look::budget_ms`] that may be a part of the picture, its upper left, and samples may lie farther apart;
    /// else it is all of it. [`Self::drew`] takes it with the time that it took.
    pub fn record_picture<'a>(
        &self,
        rec: &mut Recorder,
        views: impl Into<Views<'a>>,
        look: &Look,
        picture: &Picture,
    ) -> Result<Drawn> {
        self.current()?;
        look.check()?;
        let drawn = self.affordable(look, picture.size());
        self.record_shot(
            rec,
            &Shot { views: views.into(), look, picture, targets: None, ended: false },
            drawn,
        )?;
        Ok(drawn)
    }

    /// The ambient values, for what else stands in the volume.
    pub(crate) fn shade(&self) -> VolumeShade<'_> {
        let subject = &self.subject;
        let spacing = subject.field.spacing;
        // Half of all directions lie behind the surface of a solid.
        let open = if subject.solids.any { 0.5 } else { 1.0 };
        VolumeShade { ambient: self.ambient.fields().ambient, coloured: subject.coloured(), spacing, open }
    }

    /// As [`Self::record_picture`], all of it, with rays that end where the picture's depth says: view depths in mm.
    pub(crate) fn record_ended(
        &self,
        rec: &mut Recorder,
        views: &[View],
        look: &Look,
        picture: &Picture,
    ) -> Result<()> {
        self.current()?;
        let step_mm = look.step(self.subject.field.min_spacing());
        let drawn = Drawn { size: picture.size(), step_mm, quality: Quality::FULL };
        let shot = Shot { views: views.into(), look, picture, targets: None, ended: true };
        self.record_shot(rec, &shot, drawn)
    }

    fn record_shot(&self, rec: &mut Recorder, shot: &Shot, drawn: Drawn) -> Result<()> {
        let look = Look { step_mm: Some(drawn.step_mm), ..*shot.look };
        let band = Band::whole(drawn.size);
        self.record_tiles(rec, &Shot { look: &look, ..*shot }, band, 0..band.tiles())
    }

    /// What the look's budget allows of a picture of this size.
    fn affordable(&self, look: &Look, size: [u32; 2]) -> Drawn {
        let voxel = self.subject.field.min_spacing();
        let step = look.step(voxel);
        let quality = look.budget_ms.map_or(Quality::FULL, |ms| {
            let mut controller = self.controller.lock().unwrap_or_else(PoisonError::into_inner);
            // Samples at most a voxel apart: beyond, thin things are missed.
            controller.choose(f64::from(ms), voxel / step)
        });
        let part = |pixels: u32| (pixels as f32 * quality.scale).ceil().max(1.0) as u32;
        // A float holds no larger number of pixels exactly; all of them are all of them.
        let size = if quality.scale == 1.0 { size } else { size.map(part) };
        Drawn { size, step_mm: step * quality.coarser, quality }
    }

    /// Says how long a drawing took that [`Self::record_picture`] or [`Self::record_draw`] recorded, in ms: for looks with a budget, whose
    /// later drawings are chosen by it. Times may come late and need not come for every frame. They are
    /// [`Recorded::timings`](cao_gpu::Recorded::timings)`.of(Phase::Draw)`, or what the host measured itself.
    pub fn drew(&self, drawn: &Drawn, ms: f64) {
        self.controller.lock().unwrap_or_else(PoisonError::into_inner).learn(&drawn.quality, ms);
    }

    /// Records these tiles of a band, after the eyes and what else a band begins with where they are its first.
    pub(super) fn record_tiles(
        &self,
        rec: &mut Recorder,
        shot: &Shot,
        band: Band,
        tiles: Range<u32>,
    ) -> Result<()> {
        self.current()?;
        let Shot { views, look, picture, .. } = *shot;
        let count = views.planned().len();
        if picture.views() != count {
            let problem = format!("has room for {} views, given are {count}", picture.views());
            return Err(Error::refused("picture", problem));
        }
        let (subject, fields) = (&self.subject, self.ambient.fields());
        let (field, transfer) = subject.opacities();
        if tiles.start == 0 {
            self.frame.record(rec, field, views, look, subject.reference_mm())?;
        }
        rec.barrier(
            &[Access::TransferRead, Access::SampledRead, Access::GraphicsRead, Access::StorageWrite],
            &[Access::StorageRead, Access::StorageWrite],
        );
        if tiles.start == 0 {
            rec.discard(&picture.colour);
            if !shot.ended {
                rec.discard(&picture.depth);
            }
        }
        let ended = self.record_scenes(rec, shot, band.size)? || shot.ended;
        rec.stage(stages::RAYCAST)?;
        let bindings = Bindings {
            field,
            transfer,
            values: &subject.field.volume,
            features: &subject.features,
            ambient: fields.ambient,
            coloured: subject.coloured(),
            distances: &self.distances,
            bounds: &self.bounds,
            clips: &subject.clip_set,
            frame: &self.frame,
        };
        self.raycast.record(rec, bindings, picture, band, tiles, ended)?;
        rec.end_stage()?;
        rec.barrier(
            &[Access::StorageWrite],
            &[Access::TransferRead, Access::SampledRead, Access::GraphicsRead],
        );
        Ok(())
    }

    /// Where rays end at what the host has drawn; whether they do.
    fn record_scenes(&self, rec: &mut Recorder, shot: &Shot, drawn: [u32; 2]) -> Result<bool> {
        let Some(targets) = shot.targets else { return Ok(false) };
        let scenes = targets.views.iter().filter_map(|target| target.scene);
        if scenes.clone().next().is_none() {
            return Ok(false);
        }
        rec.stage(stages::SCENE_DEPTH)?;
        for (i, (view, scene)) in shot.views.planned().iter().zip(scenes).enumerate() {
            self.scene_depth.record(rec, (i as u32, view), scene, targets.size, shot.picture, drawn)?;
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
        }
        rec.end_stage()?;
        Ok(true)
    }

    /// Records the same into a host's images ([`Targets`]), in front of its scene and ended by it. The images must be held
    /// ([`Recorder::acquire`]) or have a layout, and barriers must order what the host did with them before [`Access::AttachmentWrite`], of a
    /// scene's depth [`Access::SampledRead`]; afterwards likewise.
    ///
    /// The picture between is allocated when a size or a number of views first comes; what draws to formats is built when they first
    /// come. Where a look's budget allows less than all pixels, the rectangles are filled all the same, colours interpolated, depths those of the
    /// nearest pixel.
    ///
    /// # Errors
    /// As many targets as views; images without room, formats that cannot be drawn to, a device's queue that draws nothing.
    pub fn record_draw<'a>(
        &self,
        rec: &mut Recorder,
        views: impl Into<Views<'a>>,
        look: &Look,
        targets: &Targets,
    ) -> Result<Drawn> {
        self.current()?;
        look.check()?;
        let (views, size) = (views.into(), targets.size);
        let planned = views.planned();
        targets.check(planned.len())?;
        let mut presented = self.presented.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = |picture: &Picture| picture.size() == size && picture.views() == planned.len();
        let picture = match presented.take().filter(fits) {
            Some(picture) => picture,
            None => Picture::new(&self.subject.gpu, size, planned.len())?,
        };
        let picture = presented.insert(picture);
        let drawn = self.affordable(look, size);
        self.record_shot(rec, &Shot { views, look, picture, targets: Some(targets), ended: false }, drawn)?;
        // A scene's depth may be where theirs goes.
        rec.barrier(&[Access::SampledRead], &[Access::AttachmentWrite]);
        rec.stage(stages::PRESENT)?;
        self.present.record(rec, picture, drawn.size, planned, targets)?;
        rec.end_stage()?;
        Ok(drawn)
    }
}
