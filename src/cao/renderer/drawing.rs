//! What draws, recorded: into a picture, or into a host's attachments.

use super::Renderer;
use crate::draw::band::Band;
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
    pub fn record_picture(
        &self,
        rec: &mut Recorder,
        views: &[View],
        look: &Look,
        picture: &Picture,
    ) -> Result<()> {
        let band = Band::whole(picture.size());
        self.record_tiles(rec, views, look, picture, band, 0..band.tiles())
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
            opacity: fields.opacity,
            ambient: fields.ambient,
            distances: &self.distances,
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
    /// is allocated when a size or a number of views first comes; numbers other than two build a pipeline then.
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
        let mut presented = self.presented.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = |picture: &Picture| picture.size() == size && picture.views() == views.len();
        let picture = match presented.take().filter(fits) {
            Some(picture) => picture,
            None => Picture::new(&self.subject.gpu, size, views.len())?,
        };
        let picture = presented.insert(picture);
        self.record_picture(rec, views, look, picture)?;
        rec.stage(stages::PRESENT)?;
        self.present.record(rec, picture, colour, depth)?;
        rec.end_stage()?;
        Ok(())
    }
}
