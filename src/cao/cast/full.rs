//! Local ambient occlusion of the clipped volume (CAO §3.4 step 1), every voxel at every change.

use super::volumes::{Kernels, Volumes};
use super::{classified, clips, local, unclipped};
use crate::Result;
use crate::ambient::{Ambient, Categories, Changed, Fields, Recomputation, Recomputed, Written};
use crate::drive::{self, Pace, Part};
use crate::field::bricks::BrickList;
use crate::stages;
use crate::subject::Subject;
use cao_gpu::{Image, Timings};

/// The method `lao`.
pub struct Full {
    kernels: Kernels,
    volumes: Volumes,
}

impl Full {
    /// Volumes and pipelines for a subject. Uses the device's queue and waits for it.
    pub fn new(on: &Subject) -> Result<Self> {
        Ok(Self { kernels: Kernels::new(&on.gpu)?, volumes: Volumes::new(&on.gpu, &on.field)? })
    }
}

impl Ambient for Full {
    fn update<'a>(&'a self, on: &'a Subject, changed: Changed, into: Option<&'a Image>) -> Vec<Part<'a>> {
        let (k, v) = (&self.kernels, &self.volumes);
        let mut parts = unclipped(k, v, on, changed);
        parts.push(classified(k, v, on));
        let to = into.unwrap_or(&v.ambient);
        parts.extend(local(k, v, on, (&v.opacity, to), [stages::BRICKS, stages::LAO]));
        parts
    }

    fn clips<'a>(&'a self, on: &'a Subject) -> Part<'a> {
        clips(&self.kernels, &self.volumes, on)
    }

    fn written(&self, _: Changed) -> Written<'_> {
        // What is not listed holds 1 again.
        Written { list: &self.volumes.list, all: true }
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

/// Every value from V_o as it is.
pub(super) fn recompute<'a>(
    k: &Kernels,
    v: &'a Volumes,
    on: &Subject,
    into: &Image,
    progress: &mut dyn FnMut(f64),
) -> Result<(Recomputation<'a>, Timings)> {
    let parts = local(k, v, on, (&v.opacity, into), [stages::BRICKS, stages::LAO]);
    let timings = drive::run(&on.gpu, &parts, &mut Pace::default(), progress)?;
    let list = BrickList { buffer: v.list.buffer.clone() };
    Ok((Recomputation { list, recomputed: Recomputed::Mask(&v.mask) }, timings))
}
