//! Line sweeps with contextual updates from change (method.md §4, §5.2): V_o is brought up to date in place and compared with
//! what V_AO was computed from; bricks within reach of a change are swept along every direction, the others keep their values.
//! Exact for any edit, clips, transfer function, values, radius: a value depends on nothing but the opacities of its windows.
//!
//! No V_PAO, no mask, no second opacity: 4 bytes a voxel beside the volume, and some 36 bytes a brick of 512.

use crate::Result;
use crate::gpu::{Access, Buffer, BufferUse, Format, Gpu, Image, Recorder, Timings};
use crate::method::volumes::volume_image;
use crate::occlusion::Occlusion;
use crate::stage::bricks::BrickList;
use crate::stage::carve::{self, Carve};
use crate::stage::classify::{AntiAliasing, Classify};
use crate::stage::clip_bricks::ClipBricks;
use crate::stage::clips::ClipSet;
use crate::stage::field::Field;
use crate::stage::lao::Scope;
use crate::stage::near::{self, FAR, Near};
use crate::stage::sweep::{Sweep, SweepPlan};
use crate::stage::sweep_list::{SweepList, SweepLists};
use crate::stage::transfer::TransferBuffer;

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
    /// Their number, one u32.
    pub count: Buffer,
    /// What the clips do to each brick, u32 each.
    pub clip_bricks: Buffer,
    clip_bricks_before: Buffer,
    contact: Buffer,
    change: Buffer,
    other: Buffer,
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
        let plan = plan(field, occlusion)?;
        let bricks = 4 * u64::from(field.brick_count());
        let brick_buffer = |name| gpu.buffer(name, bricks, BufferUse::Device);
        let volumes = Self {
            opacity: volume_image(gpu, "opacity", field, Format::R16Unorm)?,
            ambient: volume_image(gpu, "ambient", field, Format::R16Unorm)?,
            occupancy: brick_buffer("occupancy")?,
            todo: brick_buffer("bricks to do")?,
            count: gpu.buffer("number of bricks to do", 4, BufferUse::Device)?,
            clip_bricks: ClipBricks::buffer(gpu, field)?,
            clip_bricks_before: ClipBricks::buffer(gpu, field)?,
            contact: brick_buffer("contact")?,
            change: brick_buffer("change")?,
            other: brick_buffer("change, other")?,
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
        for buffer in [&volumes.contact, &volumes.clip_bricks_before, &volumes.todo] {
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

fn plan(field: &Field, occlusion: &Occlusion) -> Result<SweepPlan> {
    SweepPlan::new(field.dims, field.spacing.map(f64::from), occlusion)
}

/// The kernels.
pub struct SweepKernels {
    clip_bricks: ClipBricks,
    classify: Classify,
    carve: Carve,
    near: Near,
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
            opacity: &volumes.opacity,
        },
    )?;
    rec.end_stage()?;
    rec.barrier(&all_shaders, &[Access::StorageRead, Access::StorageWrite, Access::SampledRead]);

    choose(rec, field, kernels, volumes, &volumes.todo)
}

/// From changed bricks to bricks to do and the runs of lines through them.
fn choose(
    rec: &mut Recorder,
    field: &Field,
    kernels: &SweepKernels,
    volumes: &SweptVolumes,
    todo: &Buffer,
) -> Result<()> {
    rec.stage("choose")?;
    let bindings = near::Bindings {
        change: &volumes.change,
        other: &volumes.other,
        contact: &volumes.contact,
        todo,
        count: &volumes.count,
    };
    // At least to the bricks that a change can give their first voxel that needs a value.
    let reach = volumes.plan.reach_mm.max(f64::from(field.diagonal()));
    kernels.near.record(rec, field, volumes.scope, reach as f32, bindings)?;
    kernels.list.record(rec, field, &volumes.plan, todo, &volumes.lists)?;
    rec.end_stage()
}

/// Records one direction of the sweep into `ambient`.
#[expect(clippy::too_many_arguments, reason = "inputs, outputs and settings, each named once")]
fn record_direction(
    rec: &mut Recorder,
    field: &Field,
    kernels: &SweepKernels,
    volumes: &SweptVolumes,
    direction: usize,
    reference_mm: f32,
    todo: &Buffer,
    ambient: &Image,
) -> Result<()> {
    kernels.sweep.record(
        rec,
        field,
        &volumes.plan,
        direction,
        reference_mm,
        &volumes.opacity,
        &volumes.lists.list,
        todo,
        ambient,
    )?;
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
    rec.stage("sweep")?;
    for direction in 0..volumes.plan.walks.len() {
        record_direction(
            rec,
            field,
            kernels,
            volumes,
            direction,
            edit.reference_mm,
            &volumes.todo,
            &volumes.ambient,
        )?;
    }
    rec.end_stage()
}

/// The same on the device's own queue, a direction at a time, telling `progress` the share done (0 … 1). Waits for the end.
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
    let (reference_mm, v) = (edit.reference_mm, volumes);
    timings.push(run_directions(gpu, field, kernels, v, reference_mm, &v.todo, &v.ambient, progress)?);
    Ok(timings)
}

#[expect(clippy::too_many_arguments, reason = "inputs, outputs and settings, each named once")]
fn run_directions(
    gpu: &Gpu,
    field: &Field,
    kernels: &SweepKernels,
    volumes: &SweptVolumes,
    reference_mm: f32,
    todo: &Buffer,
    ambient: &Image,
    progress: &mut dyn FnMut(f64),
) -> Result<(String, f64)> {
    let directions = volumes.plan.walks.len();
    let mut total_ms = 0.0;
    for direction in 0..directions {
        let mut rec = gpu.recorder("sweep")?;
        rec.stage("sweep")?;
        record_direction(&mut rec, field, kernels, volumes, direction, reference_mm, todo, ambient)?;
        rec.end_stage()?;
        total_ms += rec.submit_and_wait()?.iter().map(|(_, ms)| ms).sum::<f64>();
        progress((direction + 1) as f64 / directions as f64);
    }
    Ok(("sweep".into(), total_ms))
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
    rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::StorageWrite]);
    choose(&mut rec, field, kernels, volumes, &all)?;
    rec.copy_buffer(&all, 0, &read_back, 0, all.bytes())?;
    rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    let mut timings = rec.submit_and_wait()?;
    timings.push(run_directions(gpu, field, kernels, volumes, reference_mm, &all, ambient, progress)?);
    let todo: Vec<u32> = bytemuck::pod_collect_to_vec(&read_back.read(0, all.bytes())?);
    let bricks: Vec<u32> = (0..todo.len() as u32).filter(|&brick| todo[brick as usize] == 1).collect();
    Ok((BrickList::of(gpu, &bricks)?, timings))
}
