//! Line sweeps with contextual updates from change (method.md §4, §5.2): V_o is brought up to date in place and compared with
//! what V_AO was computed from. Exact for any edit, clips, transfer function, values, radius: a ray's contribution depends on
//! nothing but the opacities of its window.
//!
//! The context is the ray's, not the neighbourhood's. Where few bricks changed, only rays that meet a change are walked, once
//! through the former opacities, taking back what they contributed, and once through the new ones. A voxel beside a change keeps
//! what the rays that lead away from it contributed, which walking all its rays would compute again, each with a window of
//! segments before it. Bricks that had no value yet are computed anew; so is everything within reach of a change where more bricks changed
//! than are kept ([`PastBricks`]).
//!
//! No V_PAO, no mask, no second opacity: 4 bytes a voxel beside the volume, an eighth for what was, and some 50 bytes a brick of
//! 512 with the lists of lines.

use super::carve::{self, Carve};
use super::near::{self, ANEW, FAR, Near, TODO};
use super::past::{Past, PastBricks};
use super::sweep::{self, Pass, Sweep, SweepPlan};
use super::sweep_list::{self, SweepList, SweepLists};
use crate::Result;
use crate::ambient::{Ambient, Changed, Fields, Recomputation, Recomputed};
use crate::clip::classify::{AFFECTED, Classify, UNTOUCHED};
use crate::clip::clip_bricks::ClipBricks;
use crate::drive::{self, Pace, Part};
use crate::field::bricks::BrickList;
use crate::field::volume_image;
use crate::field::{BRICK, Field};
use crate::host::read_buffer;
use crate::stages;
use crate::subject::Subject;
use cao_gpu::{Access, Buffer, BufferUse, Format, Gpu, Image, Timings};
use cao_model::occlusion::Occlusion;

/// Device memory of one scene, beside the volume itself.
struct Volumes {
    /// V_o: opacity after transfer function and clips, r16unorm.
    opacity: Image,
    /// V_AO, r16unorm.
    ambient: Image,
    /// Bricks that the last update computed, u32 each.
    todo: Buffer,
    /// [`near::Chosen`].
    chosen: Buffer,
    /// What the clips do to each brick, u32 each.
    clip_bricks: Buffer,
    clip_bricks_before: Buffer,
    contact: Buffer,
    change: Buffer,
    other: Buffer,
    solid: Buffer,
    /// As it was when V_AO was computed.
    solid_before: Buffer,
    valued: Buffer,
    past: PastBricks,
    list: BrickList,
    lists: SweepLists,
    plan: SweepPlan,
}

impl Volumes {
    /// Allocates them for a field: V_o holds 0 and V_AO 1. Uses the device's queue and waits for it.
    ///
    /// # Errors
    /// As [`SweepPlan::new`], and those of the device.
    fn new(gpu: &Gpu, field: &Field, occlusion: &Occlusion) -> Result<Self> {
        if !(gpu.stores(Format::R16Unorm) && gpu.filters(Format::R16Unorm)) {
            return Err(cao_gpu::Error::Device {
                problem:
                    "has no filtered storage images of R16_UNORM, which sweeps need; choose method cao or lao"
                        .into(),
            }
            .into());
        }
        let plan = plan(field, occlusion)?;
        let bricks = 4 * u64::from(field.brick_count());
        let brick_buffer = |name| gpu.buffer(name, bricks, BufferUse::Device);
        let volumes = Self {
            opacity: volume_image(gpu, "opacity", field, Format::R16Unorm)?,
            ambient: volume_image(gpu, "ambient", field, Format::R16Unorm)?,
            todo: brick_buffer("bricks to do")?,
            chosen: gpu.buffer(
                "bricks to do, in all",
                size_of::<near::Chosen>() as u64,
                BufferUse::Device,
            )?,
            clip_bricks: ClipBricks::buffer(gpu, field)?,
            clip_bricks_before: ClipBricks::buffer(gpu, field)?,
            contact: brick_buffer("contact")?,
            change: brick_buffer("change")?,
            other: brick_buffer("change, other")?,
            solid: brick_buffer("solid bricks")?,
            solid_before: brick_buffer("solid bricks before")?,
            valued: brick_buffer("bricks with values")?,
            past: PastBricks::new(gpu, field)?,
            list: BrickList::new(gpu, field)?,
            lists: SweepLists::new(gpu, &plan)?,
            plan,
        };
        let mut rec = gpu.recorder("clear volumes")?;
        rec.discard(&volumes.opacity);
        rec.discard(&volumes.ambient);
        rec.barrier(&[], &[Access::TransferWrite]);
        rec.clear_image(&volumes.opacity, [0.0; 4])?;
        rec.clear_image(&volumes.ambient, [1.0; 4])?;
        for buffer in
            [&volumes.contact, &volumes.clip_bricks_before, &volumes.todo, &volumes.solid, &volumes.valued]
        {
            rec.fill(buffer, 0, bricks, 0)?;
        }
        rec.fill(&volumes.change, 0, bricks, FAR)?;
        rec.submit_and_wait()?;
        Ok(volumes)
    }
}

fn plan(field: &Field, occlusion: &Occlusion) -> cao_model::Result<SweepPlan> {
    SweepPlan::new(field.dims, field.spacing.map(f64::from), occlusion)
}

/// The kernels.
struct Kernels {
    clip_bricks: ClipBricks,
    classify: Classify,
    carve: Carve,
    near: Near,
    past: Past,
    list: SweepList,
    sweep: Sweep,
}

impl Kernels {
    /// Builds the pipelines. Uses the device's queue and waits for it.
    fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            clip_bricks: ClipBricks::new(gpu)?,
            classify: Classify::new(gpu)?,
            carve: Carve::new(gpu)?,
            near: Near::new(gpu)?,
            past: Past::new(gpu)?,
            list: SweepList::new(gpu)?,
            sweep: Sweep::new(gpu)?,
        })
    }
}

/// The method `sweep`.
pub struct Swept {
    kernels: Kernels,
    volumes: Volumes,
}

/// What is walked, and into what.
#[derive(Clone, Copy)]
struct Target<'a> {
    on: &'a Subject,
    todo: &'a Buffer,
    ambient: &'a Image,
}

impl Swept {
    /// Volumes and pipelines for a subject. Uses the device's queue and waits for it.
    ///
    /// # Errors
    /// As [`SweepPlan::new`], and those of the device.
    pub fn new(on: &Subject) -> Result<Self> {
        let volumes = Volumes::new(&on.gpu, &on.field, &on.setup.occlusion)?;
        Ok(Self { kernels: Kernels::new(&on.gpu)?, volumes })
    }

    /// V_o in place, and which bricks changed.
    fn carve<'a>(&'a self, on: &'a Subject, changed: Changed) -> Part<'a> {
        let (k, v) = (&self.kernels, &self.volumes);
        let all = [Access::StorageRead, Access::StorageWrite];
        Part::short(stages::CARVE, move |rec| {
            on.record_clips(rec)?;
            if changed.anew {
                rec.fill(&v.change, 0, v.change.bytes(), 0)?;
                rec.barrier(&[Access::TransferWrite], &all);
            }
            k.clip_bricks.record(rec, &on.field, &on.clip_set, 0.0, &v.clip_bricks)?;
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
            k.carve.record(
                rec,
                &on.field,
                on.setup.anti_aliasing,
                changed.opacities,
                &k.classify,
                carve::Bindings {
                    transfer: &on.transfer_buffer,
                    clips: &on.clip_set,
                    clip_bricks: &v.clip_bricks,
                    clip_bricks_before: &v.clip_bricks_before,
                    occupancy: &on.occupancy,
                    contact: &v.contact,
                    change: &v.change,
                    list: &v.list,
                    todo: &v.todo,
                    past: &v.past,
                    opacity: &v.opacity,
                },
            )?;
            rec.barrier(&all, &[Access::StorageRead, Access::StorageWrite, Access::SampledRead]);
            rec.copy_buffer(&v.solid, 0, &v.solid_before, 0, v.solid.bytes())?;
            rec.barrier(&[Access::TransferRead, Access::TransferWrite], &all);
            Ok(())
        })
    }

    /// From changed bricks to those to amend and those to compute anew.
    fn choose<'a>(&'a self, on: &'a Subject, anew: bool, todo: &'a Buffer) -> Part<'a> {
        let (k, v) = (&self.kernels, &self.volumes);
        Part::short(stages::CHOOSE, move |rec| {
            let bindings = near::Bindings {
                change: &v.change,
                other: &v.other,
                contact: &v.contact,
                todo,
                chosen: &v.chosen,
                solid: &v.solid,
                valued: &v.valued,
                past: &v.past,
            };
            // At least to the bricks that a change can give their first voxel that needs a value.
            let reach = v.plan.reach_mm.max(f64::from(on.field.diagonal()));
            Ok(k.near.record(rec, &on.field, on.setup.scope, reach as f32, anew, bindings)?)
        })
    }

    /// The rays that meet a change, walked through the former and through the new opacities.
    fn amend<'a>(&'a self, to: Target<'a>) -> Vec<Part<'a>> {
        let exchange = || {
            Part::short(stages::AMEND, move |rec| {
                let v = &self.volumes;
                Ok(self.kernels.past.record(rec, &to.on.field, &v.past, &v.opacity)?)
            })
        };
        let mut parts = vec![self.list(to, true), exchange()];
        parts.extend(self.directions(to, Pass::TakeBack));
        parts.push(exchange());
        parts.extend(self.directions(to, Pass::Amend));
        parts
    }

    /// Lines of the bricks that are computed anew.
    fn sweep<'a>(&'a self, to: Target<'a>) -> Vec<Part<'a>> {
        let mut parts = vec![self.list(to, false)];
        parts.extend(self.directions(to, Pass::Anew));
        parts
    }

    /// The runs of lines to walk.
    fn list<'a>(&'a self, to: Target<'a>, amend: bool) -> Part<'a> {
        let (k, v) = (&self.kernels, &self.volumes);
        Part::short(if amend { stages::AMEND } else { stages::SWEEP }, move |rec| {
            let bindings = sweep_list::Bindings { todo: to.todo, chosen: &v.chosen, lists: &v.lists };
            Ok(k.list.record(rec, &to.on.field, &v.plan, amend, bindings)?)
        })
    }

    /// Each direction with its reverse.
    fn directions<'a>(&'a self, to: Target<'a>, pass: Pass) -> impl Iterator<Item = Part<'a>> {
        let (k, v) = (&self.kernels, &self.volumes);
        let stage = if pass == Pass::Anew { stages::SWEEP } else { stages::AMEND };
        (0..v.plan.walks.len()).map(move |index| {
            Part::long(stage, move |rec| {
                let bindings = sweep::Bindings {
                    opacity: &v.opacity,
                    list: &v.lists.list,
                    todo: to.todo,
                    solid: if pass == Pass::TakeBack { &v.solid_before } else { &v.solid },
                    ambient: to.ambient,
                };
                k.sweep.record(rec, &to.on.field, &v.plan, index, pass, to.on.reference_mm(), bindings)?;
                rec.barrier(
                    &[Access::StorageRead, Access::StorageWrite],
                    &[Access::StorageRead, Access::StorageWrite],
                );
                Ok(())
            })
        })
    }
}

impl Ambient for Swept {
    fn set(&mut self, on: &Subject) -> Result<()> {
        let plan = plan(&on.field, &on.setup.occlusion)?;
        self.volumes.lists = SweepLists::new(&on.gpu, &plan)?;
        self.volumes.plan = plan;
        Ok(())
    }

    fn update<'a>(&'a self, on: &'a Subject, changed: Changed) -> Vec<Part<'a>> {
        let to = Target { on, todo: &self.volumes.todo, ambient: &self.volumes.ambient };
        let mut parts = vec![self.carve(on, changed), self.choose(on, changed.anew, to.todo)];
        if !changed.anew {
            parts.extend(self.amend(to));
        }
        parts.extend(self.sweep(to));
        parts
    }

    fn fields(&self) -> Fields<'_> {
        let v = &self.volumes;
        Fields { opacity: &v.opacity, ambient: &v.ambient, clip_bricks: &v.clip_bricks }
    }

    fn recompute(
        &self,
        on: &Subject,
        into: &Image,
        progress: &mut dyn FnMut(f64),
    ) -> Result<(Recomputation<'_>, Timings)> {
        let v = &self.volumes;
        let all = on.gpu.buffer("all bricks to do", v.todo.bytes(), BufferUse::Device)?;
        let everything = Part::short(stages::CHOOSE, |rec| {
            rec.fill(&v.change, 0, v.change.bytes(), 0)?;
            rec.fill(&all, 0, all.bytes(), 0)?;
            rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::StorageWrite]);
            Ok(())
        });
        let mut parts = vec![everything, self.choose(on, true, &all)];
        parts.extend(self.sweep(Target { on, todo: &all, ambient: into }));
        let timings = drive::run(&on.gpu, &parts, &mut Pace::default(), progress)?;
        drop(parts);
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&on.gpu, &all)?);
        let bricks: Vec<u32> =
            (0..words.len() as u32).filter(|&brick| words[brick as usize] & ANEW != 0).collect();
        let list = BrickList::of(&on.gpu, &bricks)?;
        Ok((Recomputation { list, recomputed: Recomputed::Bricks(&v.todo) }, timings))
    }

    /// Tells recomputed bricks from others only, and nothing as clipped.
    fn mask(&self, on: &Subject) -> Result<Vec<u8>> {
        let todo: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&on.gpu, &self.volumes.todo)?);
        let ([x, y, z], [bx, by, _]) = (on.field.dims, on.field.bricks());
        let mut mask = Vec::with_capacity((x * y * z) as usize);
        for k in 0..z {
            for j in 0..y {
                let row = (k / BRICK * by + j / BRICK) * bx;
                let done = |i: u32| todo[(row + i / BRICK) as usize] & TODO != 0;
                mask.extend((0..x).map(|i| if done(i) { AFFECTED as u8 } else { UNTOUCHED as u8 }));
            }
        }
        Ok(mask)
    }
}
