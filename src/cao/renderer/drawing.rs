//! What draws, recorded: into a picture, or into a host's attachments.

use super::Renderer;
use crate::draw::band::Band;
use crate::draw::budget::{Drawn, Quality};
use crate::draw::picture::Picture;
use crate::draw::raycast::Bindings;
use crate::stages;
use crate::{Error, Result};
use cao_gpu::{Access, Image, Recorder};
use cao_model::look::Look;
use cao_model::view::View;
use std::ops::Range;
use std::sync::PoisonError;

impl Renderer {
    /// Records one to four views ([`View::MAX`]) into a picture of as many, whose content before is given up; copies, kernels and shaders
    /// can read it afterwards. Refuses while the ambient volume is out of date.
    ///
    /// Returns what is drawn: with [`Look::budget_ms`] that may be a part of the picture, its upper left, and samples may lie farther apart;
    /// else it is all of it. [`Self::drew`] takes it with the time that it took.
    pub fn record_picture(
        &self,
        rec: &mut Recorder,
        views: &[View],
        look: &Look,
        picture: &Picture,
    ) -> Result<Drawn> {
        self.current()?;
        look.check()?;
        let drawn = self.affordable(look, picture.size());
        let look = Look { step_mm: Some(drawn.step_mm), ..*look };
        let band = Band::whole(drawn.size);
        self.record_tiles(rec, views, &look, picture, band, 0..band.tiles())?;
        Ok(drawn)
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
        views: &[View],
        look: &Look,
        picture: &Picture,
        band: Band,
        tiles: Range<u32>,
    ) -> Result<()> {
        self.current()?;
        if picture.views() != views.len() {
            let problem = format!("has room for {} views, given are {}", picture.views(), views.len());
            return Err(Error::refused("picture", problem));
        }
        let (subject, fields) = (&self.subject, self.ambient.fields());
        if tiles.start == 0 {
            self.frame.record(rec, &subject.field, views, look, subject.reference_mm())?;
        }
        rec.barrier(
            &[Access::TransferRead, Access::SampledRead, Access::GraphicsRead, Access::StorageWrite],
            &[Access::StorageWrite],
        );
        if tiles.start == 0 {
            rec.discard(&picture.colour);
            rec.discard(&picture.depth);
            rec.barrier(&[], &[Access::StorageWrite]);
        }
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
        self.raycast.record(rec, bindings, picture, band, tiles)?;
        rec.end_stage()?;
        rec.barrier(
            &[Access::StorageWrite],
            &[Access::TransferRead, Access::SampledRead, Access::GraphicsRead],
        );
        Ok(())
    }

    /// Records the same into as many layers of attachments: `colour` of the renderer's format, `depth` of `D32Float`. The picture between
    /// is allocated when a size or a number of views first comes; numbers other than two build a pipeline then. Where a look's budget allows
    /// less than all pixels, the attachments are filled all the same, colours interpolated, depths those of the nearest pixel.
    pub fn record_draw(
        &self,
        rec: &mut Recorder,
        views: &[View],
        look: &Look,
        colour: &Image,
        depth: &Image,
        size: [u32; 2],
    ) -> Result<Drawn> {
        self.current()?;
        let mut presented = self.presented.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = |picture: &Picture| picture.size() == size && picture.views() == views.len();
        let picture = match presented.take().filter(fits) {
            Some(picture) => picture,
            None => Picture::new(&self.subject.gpu, size, views.len())?,
        };
        let picture = presented.insert(picture);
        let drawn = self.record_picture(rec, views, look, picture)?;
        rec.stage(stages::PRESENT)?;
        self.present.record(rec, picture, drawn.size, colour, depth)?;
        rec.end_stage()?;
        Ok(drawn)
    }
}
