//! Contextual ambient occlusion (CAO §3): V_PAO once, then at each change of the clips only the voxels whose neighbourhood
//! changed. The list holds the bricks that changed now, and those that changed at the last update, which return to V_PAO;
//! V_AO is updated in place, and no other brick is touched.

use super::parts;
use super::volumes::{Kernels, Settings, Volumes};
use crate::cast::lao::{Bindings, Work};
use crate::field::Field;
use crate::field::bricks::Which;
use cao_gpu::Result;
use cao_gpu::{Access, Gpu, Recorder, Timings};

/// Records the update of V_AO from V_PAO, V_o and V_m into a command buffer, as one dispatch.
pub fn record(
    rec: &mut Recorder,
    field: &Field,
    kernels: &Kernels,
    volumes: &Volumes,
    settings: &Settings,
) -> Result<()> {
    list(rec, field, kernels, volumes)?;

    rec.stage("contextual")?;
    kernels.lao.record(
        rec,
        field,
        &settings.occlusion,
        settings.reference_mm,
        settings.scope,
        Work::ByMask,
        bindings(volumes),
    )?;
    rec.end_stage()?;
    rec.barrier(&[Access::StorageWrite], &[Access::SampledRead, Access::GraphicsRead, Access::TransferRead]);
    Ok(())
}

/// The same on the device's own queue, in parts, telling `progress` the share done (0 … 1). Waits for the end.
pub fn run(
    gpu: &Gpu,
    field: &Field,
    kernels: &Kernels,
    volumes: &Volumes,
    settings: &Settings,
    progress: &mut dyn FnMut(f64),
) -> Result<Timings> {
    let mut rec = gpu.recorder("contextual bricks")?;
    list(&mut rec, field, kernels, volumes)?;
    let mut timings = rec.submit_and_wait()?;
    let b = bindings(volumes);
    timings.push(parts::run(gpu, "contextual", field, kernels, settings, Work::ByMask, b, progress)?);
    Ok(timings)
}

fn list(rec: &mut Recorder, field: &Field, kernels: &Kernels, volumes: &Volumes) -> Result<()> {
    rec.stage("bricks")?;
    kernels.bricks.record(
        rec,
        field,
        Which::Changed,
        &volumes.opacity,
        &volumes.mask,
        &volumes.changed_before,
        &volumes.list,
    )?;
    rec.end_stage()?;
    rec.barrier(&[Access::SampledRead, Access::GraphicsRead, Access::TransferRead], &[Access::StorageWrite]);
    Ok(())
}

fn bindings(volumes: &Volumes) -> Bindings<'_> {
    Bindings {
        opacity: &volumes.opacity,
        list: &volumes.list,
        mask: &volumes.mask,
        precomputed: &volumes.precomputed,
        ambient: &volumes.ambient,
    }
}
