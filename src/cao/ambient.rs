//! What a method of ambient occlusion is to the renderer.

use crate::Result;
use crate::drive::Part;
use crate::field::bricks::BrickList;
use crate::subject::Subject;
use cao_gpu::{Buffer, Image, Timings};
use cao_kernels::shared::categories::{AFFECTED, CLIPPED, UNTOUCHED};
use cao_model::settings::Setup;

/// Keeps V_AO equal to what the subject's settings define. Owns its volumes and pipelines.
pub trait Ambient: Send + Sync {
    /// Takes the subject's settings, which are new; every value will have to be computed. Never uses the device's queue.
    ///
    /// # Errors
    /// Settings that this method does not have; then nothing has changed.
    fn set(&mut self, on: &Subject) -> Result<()> {
        let _ = on;
        Ok(())
    }

    /// Whether it has such settings, which may come later.
    ///
    /// # Errors
    /// As [`Self::set`].
    fn accepts(&self, on: &Subject, setup: &Setup) -> Result<()> {
        let _ = (on, setup);
        Ok(())
    }

    /// What there is to do after these changes, in order. Where opacities changed, the subject's occupancy comes before it.
    ///
    /// The last part computes V_AO over a list, of V_AO itself, or of what is [written](Self::written) of it the values `into` an image like
    /// it. Everything that reads values, transfer function or clips comes before the first part over a list: from there on an update may
    /// span frames, in which these change.
    fn update<'a>(&'a self, on: &'a Subject, changed: Changed, into: Option<&'a Image>) -> Vec<Part<'a>>;

    /// The clips as they are, for pictures: they are recorded, and what they do to each brick. Touches nothing that an update needs.
    fn clips<'a>(&'a self, on: &'a Subject) -> Part<'a>;

    /// What the last part of such an update writes.
    fn written(&self, changed: Changed) -> Written<'_>;

    /// Its volumes.
    fn fields(&self) -> Fields<'_>;

    /// Computes every value into `into`, which is all 1 before, from V_o as it is; leaves the rest as it was. Uses the device's queue and
    /// waits for it.
    fn recompute(
        &self,
        on: &Subject,
        into: &Image,
        progress: &mut dyn FnMut(f64),
    ) -> Result<(Recomputation<'_>, Timings)>;

    /// V_m, x fastest: [`CLIPPED`], [`AFFECTED`] or [`UNTOUCHED`] by the last update. Uses the device's queue and waits for it.
    fn mask(&self, on: &Subject) -> Result<Vec<u8>>;

    /// Voxels of each category after the last update. Uses the device's queue and waits for it.
    fn categories(&self, on: &Subject) -> Result<Categories> {
        let mask = self.mask(on)?;
        Ok(Categories::each(|category| {
            mask.iter().filter(|voxel| u32::from(**voxel) == category).count() as u64
        }))
    }
}

/// What changed since the last update.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Changed {
    /// Values or transfer function: every opacity has to be looked at.
    pub opacities: bool,
    /// Rays, radius or reference length: every ambient value has to be computed anew.
    pub anew: bool,
    /// Shapes, sides or poses.
    pub clips: bool,
    /// Values by which voxels belong to features: to methods that read these, every ambient value is out of date.
    pub features: bool,
}

impl Changed {
    /// Nothing is up to date.
    pub const ALL: Self = Self { opacities: true, anew: true, clips: true, features: true };
    /// Everything is up to date.
    pub const NOTHING: Self = Self { opacities: false, anew: false, clips: false, features: false };

    /// These changes and others.
    pub fn and(self, other: Self) -> Self {
        Self {
            opacities: self.opacities || other.opacities,
            anew: self.anew || other.anew,
            clips: self.clips || other.clips,
            features: self.features || other.features,
        }
    }
}

/// Bricks of V_AO that an update writes.
#[derive(Clone, Copy)]
pub struct Written<'a> {
    /// The bricks that it computes.
    pub list: &'a BrickList,
    /// Whether all others hold 1 afterwards, and not what they held.
    pub all: bool,
}

/// What a picture is drawn from.
#[derive(Clone, Copy)]
pub struct Fields<'a> {
    /// V_o after clipping.
    pub opacity: &'a Image,
    /// V_AO.
    pub ambient: &'a Image,
    /// What the clips do to each brick, u32 each.
    pub clip_bricks: &'a Buffer,
}

/// What a recomputation covered.
pub struct Recomputation<'a> {
    /// The bricks that need values.
    pub list: BrickList,
    /// What the last update had computed.
    pub recomputed: Recomputed<'a>,
}

/// Voxels of each category (CAO §3.3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Categories {
    /// a: clipped.
    pub clipped: u64,
    /// b: visible, neighbourhood changed.
    pub affected: u64,
    /// c: untouched.
    pub untouched: u64,
}

impl Categories {
    /// What `of` says of each category, as the mask has it.
    pub(crate) fn each(of: impl Fn(u32) -> u64) -> Self {
        Self { clipped: of(CLIPPED), affected: of(AFFECTED), untouched: of(UNTOUCHED) }
    }
}

/// How it is known which voxels were recomputed.
#[derive(Clone, Copy)]
pub enum Recomputed<'a> {
    /// V_m; clipped voxels that touch no visible one have no value.
    Mask(&'a Image),
    /// A u32 a brick, [`TODO`](cao_kernels::compare::TODO) where they were.
    Bricks(&'a Buffer),
}
