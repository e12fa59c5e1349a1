//! What a method of ambient occlusion is to the renderer, and the constructor of each.

use crate::Result;
use crate::cast::contextual::Contextual;
use crate::cast::full::Full;
use crate::clip::classify::{AFFECTED, CLIPPED, UNTOUCHED};
use crate::drive::Part;
use crate::field::bricks::BrickList;
use crate::rays::traced::Traced;
use crate::subject::Subject;
use crate::verify::compare::Recomputed;
use cao_gpu::{Buffer, Image, Timings};
use cao_model::methods::Method;

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

    /// What there is to do after these changes, in order. Where opacities changed, the subject's occupancy comes before it.
    fn update<'a>(&'a self, on: &'a Subject, changed: Changed) -> Vec<Part<'a>>;

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
            mask.iter().filter(|voxel| u32::from(**voxel) == category).count() as u32
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
}

impl Changed {
    /// Nothing is up to date.
    pub const ALL: Self = Self { opacities: true, anew: true, clips: true };
    /// Everything is up to date.
    pub const NOTHING: Self = Self { opacities: false, anew: false, clips: false };
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
    pub clipped: u32,
    /// b: visible, neighbourhood changed.
    pub affected: u32,
    /// c: untouched.
    pub untouched: u32,
}

impl Categories {
    /// What `of` says of each category, as the mask has it.
    pub(crate) fn each(of: impl Fn(u32) -> u32) -> Self {
        Self { clipped: of(CLIPPED), affected: of(AFFECTED), untouched: of(UNTOUCHED) }
    }
}

/// What the library knows of a method beside its entry in [`cao_model::METHODS`].
struct Maker {
    method: Method,
    new: fn(&Subject) -> Result<Box<dyn Ambient>>,
    /// How far in mm it wants the maps of clip meshes dilated.
    map_radius: fn(&Subject) -> f32,
}

const MAKERS: &[Maker] = &[
    Maker {
        method: Method::Lao,
        new: |on| Ok(Box::new(Full::new(on)?)),
        map_radius: crate::cast::map_radius,
    },
    Maker {
        method: Method::Cao,
        new: |on| Ok(Box::new(Contextual::new(on)?)),
        map_radius: crate::cast::map_radius,
    },
    // Changes are found in the opacities; nothing is dilated.
    Maker { method: Method::Rays, new: |on| Ok(Box::new(Traced::new(on)?)), map_radius: |_| 0.0 },
];

fn maker(on: &Subject) -> &'static Maker {
    MAKERS.iter().find(|maker| maker.method == on.setup.method).expect("every method has a maker")
}

/// The method that the subject's settings name.
pub(crate) fn of(on: &Subject) -> Result<Box<dyn Ambient>> {
    (maker(on).new)(on)
}

/// How far in mm this method wants the maps of clip meshes dilated.
pub(crate) fn map_radius(on: &Subject) -> f32 {
    (maker(on).map_radius)(on)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_listed_method_has_a_maker() {
        for entry in cao_model::METHODS {
            assert_eq!(
                MAKERS.iter().filter(|maker| maker.method == entry.method).count(),
                1,
                "{}",
                entry.name
            );
        }
    }
}
