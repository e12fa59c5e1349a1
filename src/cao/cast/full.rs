//! Local ambient occlusion of a whole volume (CAO §3.4 step 1): list the bricks, cast the rays.

use super::parts;
use super::volumes::{Kernels, Settings, Volumes};
use crate::cast::lao::{Bindings, Work};
use crate::field::Field;
use crate::field::bricks::Which;
use cao_gpu::Result;
use cao_gpu::{Access, Gpu, Image, Recorder, Timings};
use cao_model::settings::Scope;

/// Records the computation of `ambient` from `opacity` into a command buffer, as one dispatch.
pub fn record(
    rec: &mut Recorder,
    field: &Field,
    kernels: &Kernels,
    volumes: &Volumes,
    settings: &Settings,
    opacity: &Image,
    ambient: &Image,
) -> Result<()> {
    list(rec, field, kernels, volumes, settings, opacity, ambient)?;

    rec.stage("lao")?;
    let b = bindings(volumes, opacity, ambient);
    kernels.lao.record(
        rec,
        field,
        &settings.occlusion,
        settings.reference_mm,
        settings.scope,
        Work::Full,
        b,
    )?;
    rec.end_stage()?;
    rec.barrier(&[Access::StorageWrite], &[Access::SampledRead, Access::GraphicsRead, Access::TransferRead]);
    Ok(())
}

/// The same on the device's own queue, in parts, telling `progress` the share done (0 … 1). Waits for the end.
#[expect(clippy::too_many_arguments, reason = "inputs, outputs and settings, each named once")]
pub fn run(
    gpu: &Gpu,
    field: &Field,
    kernels: &Kernels,
    volumes: &Volumes,
    settings: &Settings,
    opacity: &Image,
    ambient: &Image,
    progress: &mut dyn FnMut(f64),
) -> Result<Timings> {
    let mut rec = gpu.recorder("lao bricks")?;
    list(&mut rec, field, kernels, volumes, settings, opacity, ambient)?;
    let mut timings = rec.submit_and_wait()?;
    let b = bindings(volumes, opacity, ambient);
    timings.push(parts::run(gpu, "lao", field, kernels, settings, Work::Full, b, progress)?);
    Ok(timings)
}

fn list(
    rec: &mut Recorder,
    field: &Field,
    kernels: &Kernels,
    volumes: &Volumes,
    settings: &Settings,
    opacity: &Image,
    ambient: &Image,
) -> Result<()> {
    rec.barrier(
        &[Access::SampledRead, Access::GraphicsRead, Access::StorageWrite, Access::TransferRead],
        &[Access::TransferWrite],
    );
    rec.clear_image(ambient, [1.0; 4])?;
    rec.barrier(
        &[Access::TransferWrite, Access::StorageWrite],
        &[Access::SampledRead, Access::StorageRead, Access::StorageWrite],
    );
    rec.stage("bricks")?;
    let which = match settings.scope {
        Scope::All => Which::All,
        Scope::Needed => Which::Needed,
    };
    kernels.bricks.record(
        rec,
        field,
        which,
        opacity,
        &volumes.mask,
        &volumes.changed_before,
        &volumes.list,
    )?;
    rec.end_stage()?;
    Ok(())
}

fn bindings<'a>(volumes: &'a Volumes, opacity: &'a Image, ambient: &'a Image) -> Bindings<'a> {
    // The mask and a precomputed volume are bound but not read by a full computation; V_PAO may be its output.
    Bindings {
        opacity,
        list: &volumes.list,
        mask: &volumes.mask,
        precomputed: &volumes.full_opacity,
        ambient,
    }
}
