//! Contextual ambient occlusion (CAO §3): V_PAO once, then at each change of the clips only the voxels whose neighbourhood
//! changed. The list holds the bricks that changed now, and those that changed at the last update, which return to V_PAO;
//! V_AO is updated in place, and no other brick is touched.

use super::full::recompute;
use super::lao::{Bindings, Work};
use super::volumes::{Kernels, Volumes};
use super::{classified, clips, local, over_bricks, unclipped};
use crate::Result;
use crate::ambient::{Ambient, Categories, Changed, Fields, Recomputation, Written};
use crate::drive::Part;
use crate::field::bricks::Which;
use crate::field::volume_image;
use crate::stages;
use crate::subject::Subject;
use cao_gpu::{Access, Format, Image, Timings};

/// The method `cao`.
pub struct Contextual {
    kernels: Kernels,
    volumes: Volumes,
    /// V_PAO: ambient factor without clips, r32float.
    precomputed: Image,
}

impl Contextual {
    /// Volumes and pipelines for a subject. Uses the device's queue and waits for it.
    pub fn new(on: &Subject) -> Result<Self> {
        let precomputed = volume_image(&on.gpu, "precomputed ambient", &on.field, Format::R32Float)?;
        let mut rec = on.gpu.recorder("clear volumes")?;
        rec.discard(&precomputed);
        rec.submit_and_wait()?;
        Ok(Self { kernels: Kernels::new(&on.gpu)?, volumes: Volumes::new(&on.gpu, &on.field)?, precomputed })
    }

    /// V_PAO, after which every brick of V_AO is out of date.
    fn precompute<'a>(&'a self, on: &'a Subject) -> [Part<'a>; 3] {
        let (k, v) = (&self.kernels, &self.volumes);
        let two = [stages::PRECOMPUTE_BRICKS, stages::PRECOMPUTE];
        let [bricks, rays] = local(k, v, on, (&v.full_opacity, &self.precomputed), two);
        let outdated = Part::short(stages::PRECOMPUTE, |rec| {
            rec.barrier(&[Access::StorageRead], &[Access::TransferWrite]);
            rec.fill(&v.changed_before, 0, v.changed_before.bytes(), 1)?;
            rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::StorageWrite]);
            Ok(())
        });
        [bricks, rays, outdated]
    }
}

impl Ambient for Contextual {
    fn update<'a>(&'a self, on: &'a Subject, changed: Changed, into: Option<&'a Image>) -> Vec<Part<'a>> {
        let (k, v) = (&self.kernels, &self.volumes);
        let mut parts = unclipped(k, v, on, changed);
        // Whatever spans frames comes later, and sees the clips as they are now.
        parts.push(classified(k, v, on));
        if changed.opacities || changed.anew {
            parts.extend(self.precompute(on));
        }
        parts.push(Part::short(stages::BRICKS, |rec| {
            let (which, mask, before) = (Which::Changed, &v.mask, &v.changed_before);
            Ok(k.bricks.record(rec, &on.field, which, &v.opacity, mask, before, &v.list)?)
        }));
        let bindings = Bindings {
            opacity: &v.opacity,
            list: &v.list,
            mask: &v.mask,
            precomputed: &self.precomputed,
            ambient: into.unwrap_or(&v.ambient),
        };
        parts.push(over_bricks(k, on, stages::CONTEXTUAL, Work::ByMask, bindings));
        parts
    }

    fn clips<'a>(&'a self, on: &'a Subject) -> Part<'a> {
        clips(&self.kernels, &self.volumes, on)
    }

    fn written(&self, _: Changed) -> Written<'_> {
        Written { list: &self.volumes.list, all: false }
    }

    fn fields(&self) -> Fields<'_> {
        self.volumes.fields()
    }

    fn recompute(
        &self,
        on: &Subject,
        into: &Image,
        progress: &mut dyn FnMut(f64),
    ) -> Result<(Recomputation<'_>, Timings)> {
        recompute(&self.kernels, &self.volumes, on, into, progress)
    }

    fn mask(&self, on: &Subject) -> Result<Vec<u8>> {
        self.volumes.mask(on)
    }

    fn categories(&self, on: &Subject) -> Result<Categories> {
        self.kernels.categories(on)
    }
}
