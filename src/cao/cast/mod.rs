//! Rays cast by the sampler: local ambient occlusion ([`full`]) and its contextual update ([`contextual`]).

pub mod contextual;
pub mod full;
pub mod lao;
pub mod volumes;

use crate::ambient::Changed;
use crate::cast::lao::{Bindings, Work};
use crate::cast::volumes::{Kernels, Volumes};
use crate::clip::classify::Classify;
use crate::drive::Part;
use crate::field::BRICK;
use crate::field::bricks::Which;
use crate::stages;
use crate::subject::Subject;
use cao_gpu::{Access, Image, Stage};
use cao_model::settings::{Scope, Setup};

/// How far in mm dilation maps reach; the literal recipe dilates by the ray's length alone.
pub(crate) fn map_radius(on: &Subject) -> f32 {
    let Setup { occlusion, maps, anti_aliasing, .. } = &on.wanted;
    match maps.literal {
        true => occlusion.reach(f64::from(on.field.min_spacing())),
        false => Classify::reach(&on.field, occlusion, anti_aliasing.support),
    }
}

/// How far in mm a clip's change reaches, with the settings of the last update.
fn clip_reach(on: &Subject) -> f32 {
    Classify::reach(&on.field, &on.setup.occlusion, on.setup.anti_aliasing.support)
}

/// Rays and V_o before clipping, as far as they changed.
fn unclipped<'a>(k: &'a Kernels, v: &'a Volumes, on: &'a Subject, changed: Changed) -> Vec<Part<'a>> {
    let mut parts = Vec::new();
    if changed.anew {
        parts.push(Part::short(stages::DIRECTIONS, |rec| Ok(k.lao.record_rays(rec, &on.setup.occlusion)?)));
    }
    if changed.opacities {
        parts.push(Part::short(stages::OPACITY, |rec| {
            let (field, transfer) = on.opacities();
            k.opacity.record(rec, field, transfer, &v.full_opacity)?;
            rec.barrier(&[Access::StorageWrite], &[Access::SampledRead]);
            Ok(())
        }));
    }
    parts
}

/// V_o after clipping, and the category of every voxel (CAO §3.5 step 4).
fn classified<'a>(k: &'a Kernels, v: &'a Volumes, on: &'a Subject) -> Part<'a> {
    Part::short(stages::CLASSIFY, |rec| {
        let reach = clip_reach(on);
        on.record_clip_bricks(rec, &k.clip_bricks, reach, &v.clip_bricks)?;
        let count = &k.classify.count;
        rec.fill(count, 0, count.bytes(), 0)?;
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::StorageWrite]);
        k.classify.record(
            rec,
            &on.field,
            &on.features,
            &on.clip_set,
            on.setup.anti_aliasing,
            reach,
            on.setup.maps.literal,
            &v.clip_bricks,
            &v.full_opacity,
            &v.opacity,
            &v.mask,
        )?;
        rec.barrier(&[Access::StorageWrite], &[Access::SampledRead]);
        Ok(())
    })
}

/// The clips as pictures need them, and what they do to each brick.
fn clips<'a>(k: &'a Kernels, v: &'a Volumes, on: &'a Subject) -> Part<'a> {
    let reach = clip_reach(on);
    Part::short(stages::CLIPS, move |rec| on.record_clip_bricks(rec, &k.clip_bricks, reach, &v.clip_bricks))
}

/// `to` from `from`: the bricks, then their rays, in two stages.
fn local<'a>(
    k: &'a Kernels,
    v: &'a Volumes,
    on: &'a Subject,
    (from, to): (&'a Image, &'a Image),
    [bricks, rays]: [Stage; 2],
) -> [Part<'a>; 2] {
    let listed = Part::short(bricks, move |rec| {
        k.ones.record(rec, to)?;
        rec.barrier(&[Access::StorageWrite], &[Access::StorageWrite]);
        let which = match on.setup.scope {
            Scope::All => Which::All,
            Scope::Needed => Which::Needed,
        };
        Ok(k.bricks.record(rec, &on.field, which, from, &v.mask, &v.changed_before, &v.list)?)
    });
    // The mask and a precomputed volume are bound but not read by a full computation; V_PAO may be its output.
    let bindings =
        Bindings { opacity: from, list: &v.list, mask: &v.mask, precomputed: &v.full_opacity, ambient: to };
    [listed, over_bricks(k, on, rays, Work::Full, bindings)]
}

/// Rays of the listed bricks.
fn over_bricks<'a>(k: &'a Kernels, on: &'a Subject, stage: Stage, work: Work, b: Bindings<'a>) -> Part<'a> {
    let (field, setup) = (&on.field, &on.setup);
    // The first slice is small enough for any device.
    let brick_samples = f64::from(BRICK.pow(3))
        * setup.occlusion.rays.count() as f64
        * f64::from(setup.occlusion.samples(f64::from(field.min_spacing())).max(1));
    let first = (4e6 / brick_samples).clamp(1.0, 1e6) as u32;
    Part::items(stage, b.list.items(field), first, move |rec, take| {
        let (occlusion, reference_mm, scope) = (&setup.occlusion, on.ambient_mm, setup.scope);
        k.lao.record(rec, field, occlusion, reference_mm, scope, work, b, take)?;
        // What follows V_PAO writes the mask that these rays may have read, and another list.
        rec.barrier(
            &[Access::SampledRead, Access::StorageRead, Access::StorageWrite],
            &[Access::SampledRead, Access::StorageWrite, Access::TransferWrite],
        );
        Ok(())
    })
}
