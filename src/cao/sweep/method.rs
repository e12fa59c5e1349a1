//! Line sweeps with contextual updates from change (method.md §4, §5.2): V_o is brought up to date in place and compared with
//! what V_AO was computed from. Exact for any edit, clips, transfer function, values, radius: a ray's contribution depends on
//! nothing but the opacities of its window.
//!
//! The context is the ray's, not the neighbourhood's. Where few bricks changed, only rays that meet a change are walked, once
//! through the former opacities, taking back what they contributed, and once through the new ones. A voxel beside a change keeps
//! what the rays that lead away from it contributed, which walking all its rays would compute again, each with a window of
//! segments before it. Bricks that had no value yet are computed anew; so is everything within reach of a change where more bricks changed
//! than are kept ([`PastBricks`]). Engine of the test data, 26 rays, R = 20 voxels, llvmpipe, before and after, full update and clip update
//! in ms: sphere moved one voxel 590 and 191, 511 and 86; to a new place 600 and 300, 511 and 173.
//!
//! No V_PAO, no mask, no second opacity: 4 bytes a voxel beside the volume, an eighth for what was, and some 50 bytes a brick of
//! 512 with the lists of lines.

use crate::Result;
use crate::cast::volumes::volume_image;
use crate::clip::classify::Classify;
use crate::clip::clip_bricks::ClipBricks;
use crate::clip::clips::ClipSet;
use crate::field::Field;
use crate::field::bricks::BrickList;
use crate::field::transfer::TransferBuffer;
use crate::sweep::carve::{self, Carve};
use crate::sweep::near::{self, ANEW, FAR, Near};
use crate::sweep::past::{Past, PastBricks};
use crate::sweep::sweep::{self, Pass, Sweep, SweepPlan};
use crate::sweep::sweep_list::{self, SweepList, SweepLists};
use cao_gpu::{Access, Buffer, BufferUse, Format, Gpu, Image, Recorder, Timings};
use cao_model::occlusion::Occlusion;
use cao_model::settings::{AntiAliasing, Scope};

/// Device memory of one scene, beside the volume itself.
pub struct SweptVolumes {
    /// V_o: opacity after transfer function and clips, r16unorm.
    pub opacity: Image,
    /// V_AO, r16unorm.
    pub ambient: Image,
    /// Bricks that can have opacity, u32 each.
    pub occupancy: Buffer,
    /// Bricks that the last update computed, u32 each.
    pub todo: Buffer,
    /// [`near::Chosen`].
    pub chosen: Buffer,
    /// What the clips do to each brick, u32 each.
    pub clip_bricks: Buffer,
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
    scope: Scope,
}

impl SweptVolumes {
    /// Allocates them for a field: V_o holds 0 and V_AO 1. Uses the device's queue and waits for it.
    ///
    /// # Errors
    /// As [`SweepPlan::new`], and those of the device.
    pub fn new(gpu: &Gpu, field: &Field, occlusion: &Occlusion, scope: Scope) -> Result<Self> {
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
            occupancy: brick_buffer("occupancy")?,
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
            scope,
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

    /// Takes other settings: all values will have to be computed. Uses the device's queue and waits for it.
    ///
    /// # Errors
    /// As [`SweepPlan::new`]; then nothing has changed.
    pub fn set(&mut self, gpu: &Gpu, field: &Field, occlusion: &Occlusion, scope: Scope) -> Result<()> {
        let plan = plan(field, occlusion)?;
        self.lists = SweepLists::new(gpu, &plan)?;
        self.plan = plan;
        self.scope = scope;
        Ok(())
    }

    /// The directions and how they are walked.
    pub fn plan(&self) -> &SweepPlan {
        &self.plan
    }
}

fn plan(field: &Field, occlusion: &Occlusion) -> cao_model::Result<SweepPlan> {
    SweepPlan::new(field.dims, field.spacing.map(f64::from), occlusion)
}

/// The kernels.
pub struct SweepKernels {
    clip_bricks: ClipBricks,
    classify: Classify,
    carve: Carve,
    near: Near,
    past: Past,
    list: SweepList,
    sweep: Sweep,
}

impl SweepKernels {
    /// Builds the pipelines. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu) -> Result<Self> {
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

/// What an edit touched, beside the clips.
#[derive(Clone, Copy, Debug)]
pub struct Edit {
    /// Values or transfer function: every brick's opacity has to be looked at.
    pub opacities: bool,
    /// Rays, radius or reference length: every ambient value has to be computed.
    pub ambient: bool,
    /// Samples at cut voxels.
    pub anti_aliasing: AntiAliasing,
    /// Reference length of the opacity in mm.
    pub reference_mm: f32,
}

/// Records what finds the bricks to compute: opacities, changes, their reach, the runs of lines.
pub fn record_choice(
    rec: &mut Recorder,
    field: &Field,
    kernels: &SweepKernels,
    volumes: &SweptVolumes,
    transfer: &TransferBuffer,
    clips: &ClipSet,
    edit: &Edit,
) -> Result<()> {
    let all_shaders = [Access::StorageRead, Access::StorageWrite];
    rec.barrier(
        &[
            Access::SampledRead,
            Access::GraphicsRead,
            Access::TransferRead,
            Access::StorageRead,
            Access::StorageWrite,
        ],
        &[Access::StorageRead, Access::StorageWrite, Access::TransferWrite],
    );
    if edit.ambient {
        rec.fill(&volumes.change, 0, volumes.change.bytes(), 0)?;
        rec.barrier(&[Access::TransferWrite], &all_shaders);
    }

    rec.stage("carve")?;
    kernels.clip_bricks.record(rec, field, clips, 0.0, &volumes.clip_bricks)?;
    rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
    kernels.carve.record(
        rec,
        field,
        edit.anti_aliasing,
        edit.opacities,
        &kernels.classify,
        carve::Bindings {
            transfer,
            clips,
            clip_bricks: &volumes.clip_bricks,
            clip_bricks_before: &volumes.clip_bricks_before,
            occupancy: &volumes.occupancy,
            contact: &volumes.contact,
            change: &volumes.change,
            list: &volumes.list,
            todo: &volumes.todo,
            past: &volumes.past,
            opacity: &volumes.opacity,
        },
    )?;
    rec.end_stage()?;
    rec.barrier(&all_shaders, &[Access::StorageRead, Access::StorageWrite, Access::SampledRead]);

    rec.copy_buffer(&volumes.solid, 0, &volumes.solid_before, 0, volumes.solid.bytes())?;
    rec.barrier(&[Access::TransferRead, Access::TransferWrite], &all_shaders);
    Ok(choose(rec, field, kernels, volumes, edit.ambient, &volumes.todo)?)
}

/// From changed bricks to those to amend and those to compute anew.
fn choose(
    rec: &mut Recorder,
    field: &Field,
    kernels: &SweepKernels,
    volumes: &SweptVolumes,
    anew: bool,
    todo: &Buffer,
) -> cao_gpu::Result<()> {
    rec.stage("choose")?;
    let bindings = near::Bindings {
        change: &volumes.change,
        other: &volumes.other,
        contact: &volumes.contact,
        todo,
        count: &volumes.chosen,
        solid: &volumes.solid,
        valued: &volumes.valued,
        past: &volumes.past,
    };
    // At least to the bricks that a change can give their first voxel that needs a value.
    let reach = volumes.plan.reach_mm.max(f64::from(field.diagonal()));
    kernels.near.record(rec, field, volumes.scope, reach as f32, anew, bindings)?;
    rec.end_stage()
}

/// A part of what follows the choice.
#[derive(Clone, Copy)]
enum Step {
    /// The runs of lines to walk.
    List { amend: bool },
    /// Former for present opacities and back.
    Exchange,
    /// One direction and its reverse.
    Direction { index: usize, pass: Pass },
}

/// The stages and their steps: the rays that meet a change are walked through the former and the new opacities, then bricks
/// without values are swept.
fn stages(plan: &SweepPlan, anew_only: bool) -> Vec<(&'static str, Vec<Step>)> {
    let directions = |pass| (0..plan.walks.len()).map(move |index| Step::Direction { index, pass });
    let mut amend = vec![Step::List { amend: true }, Step::Exchange];
    amend.extend(directions(Pass::TakeBack));
    amend.push(Step::Exchange);
    amend.extend(directions(Pass::Amend));
    let mut sweep = vec![Step::List { amend: false }];
    sweep.extend(directions(Pass::Anew));
    let stages = [("amend", amend), ("sweep", sweep)];
    stages.into_iter().skip(usize::from(anew_only)).collect()
}

/// What the steps work on, beside the volumes.
struct Target<'a> {
    field: &'a Field,
    kernels: &'a SweepKernels,
    volumes: &'a SweptVolumes,
    reference_mm: f32,
    todo: &'a Buffer,
    ambient: &'a Image,
}

impl Target<'_> {
    fn record(&self, rec: &mut Recorder, step: Step) -> cao_gpu::Result<()> {
        let Target { field, kernels, volumes, reference_mm, todo, ambient } = *self;
        let (plan, lists) = (&volumes.plan, &volumes.lists);
        match step {
            Step::List { amend } => {
                let bindings = sweep_list::Bindings { todo, chosen: &volumes.chosen, lists };
                kernels.list.record(rec, field, plan, amend, bindings)
            }
            Step::Exchange => kernels.past.record(rec, field, &volumes.past, &volumes.opacity),
            Step::Direction { index, pass } => {
                let bindings = sweep::Bindings {
                    opacity: &volumes.opacity,
                    list: &lists.list,
                    todo,
                    solid: if pass == Pass::TakeBack { &volumes.solid_before } else { &volumes.solid },
                    ambient,
                };
                kernels.sweep.record(rec, field, plan, index, pass, reference_mm, bindings)?;
                rec.barrier(
                    &[Access::StorageRead, Access::StorageWrite],
                    &[
                        Access::StorageRead,
                        Access::StorageWrite,
                        Access::SampledRead,
                        Access::GraphicsRead,
                        Access::TransferRead,
                    ],
                );
                Ok(())
            }
        }
    }

    /// Each step on the device's own queue, telling `progress` the share done (0 … 1). Waits for the end.
    fn run(&self, gpu: &Gpu, anew_only: bool, progress: &mut dyn FnMut(f64)) -> Result<Timings> {
        let stages = stages(&self.volumes.plan, anew_only);
        let all: usize = stages.iter().map(|(_, steps)| steps.len()).sum();
        let mut done = 0;
        let mut timings = Timings::new();
        for (stage, steps) in stages {
            let mut total_ms = 0.0;
            for step in steps {
                let mut rec = gpu.recorder(stage)?;
                rec.stage(stage)?;
                self.record(&mut rec, step)?;
                rec.end_stage()?;
                total_ms += rec.submit_and_wait()?.iter().map(|(_, ms)| ms).sum::<f64>();
                done += 1;
                progress(done as f64 / all as f64);
            }
            timings.push((stage.into(), total_ms));
        }
        Ok(timings)
    }
}

impl SweptVolumes {
    fn target<'a>(&'a self, field: &'a Field, kernels: &'a SweepKernels, reference_mm: f32) -> Target<'a> {
        Target { field, kernels, volumes: self, reference_mm, todo: &self.todo, ambient: &self.ambient }
    }
}

/// Records the whole update of V_o and V_AO into a command buffer.
pub fn record(
    rec: &mut Recorder,
    field: &Field,
    kernels: &SweepKernels,
    volumes: &SweptVolumes,
    transfer: &TransferBuffer,
    clips: &ClipSet,
    edit: &Edit,
) -> Result<()> {
    record_choice(rec, field, kernels, volumes, transfer, clips, edit)?;
    let target = volumes.target(field, kernels, edit.reference_mm);
    for (stage, steps) in stages(&volumes.plan, edit.ambient) {
        rec.stage(stage)?;
        for step in steps {
            target.record(rec, step)?;
        }
        rec.end_stage()?;
    }
    Ok(())
}

/// The same on the device's own queue, a step at a time, telling `progress` the share done (0 … 1). Waits for the end.
#[expect(clippy::too_many_arguments, reason = "inputs, outputs and settings, each named once")]
pub fn run(
    gpu: &Gpu,
    field: &Field,
    kernels: &SweepKernels,
    volumes: &SweptVolumes,
    transfer: &TransferBuffer,
    clips: &ClipSet,
    edit: &Edit,
    progress: &mut dyn FnMut(f64),
) -> Result<Timings> {
    let mut rec = gpu.recorder("choice")?;
    record_choice(&mut rec, field, kernels, volumes, transfer, clips, edit)?;
    let mut timings = rec.submit_and_wait()?;
    timings.extend(volumes.target(field, kernels, edit.reference_mm).run(gpu, edit.ambient, progress)?);
    Ok(timings)
}

/// Computes every value anew into `ambient`, which is all 1 before, from V_o as it is; leaves everything else as it was. Returns
/// the bricks that need values, and the times. Uses the device's queue and waits for it.
pub fn recompute(
    gpu: &Gpu,
    field: &Field,
    kernels: &SweepKernels,
    volumes: &SweptVolumes,
    reference_mm: f32,
    ambient: &Image,
    progress: &mut dyn FnMut(f64),
) -> Result<(BrickList, Timings)> {
    let all = gpu.buffer("all bricks to do", volumes.todo.bytes(), BufferUse::Device)?;
    let read_back = gpu.buffer("bricks read-back", all.bytes(), BufferUse::Readback)?;
    let mut rec = gpu.recorder("recompute")?;
    rec.fill(&volumes.change, 0, volumes.change.bytes(), 0)?;
    rec.fill(&all, 0, all.bytes(), 0)?;
    rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::StorageWrite]);
    choose(&mut rec, field, kernels, volumes, true, &all)?;
    rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
    rec.copy_buffer(&all, 0, &read_back, 0, all.bytes())?;
    rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    let mut timings = rec.submit_and_wait()?;
    let target = Target { todo: &all, ambient, ..volumes.target(field, kernels, reference_mm) };
    timings.extend(target.run(gpu, true, progress)?);
    let todo: Vec<u32> = bytemuck::pod_collect_to_vec(&read_back.read(0, all.bytes())?);
    let bricks: Vec<u32> = (0..todo.len() as u32).filter(|&brick| todo[brick as usize] & ANEW != 0).collect();
    Ok((BrickList::of(gpu, &bricks)?, timings))
}
