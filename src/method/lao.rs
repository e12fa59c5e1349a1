//! Local ambient occlusion of a whole volume (CAO §3.4 step 1): list the bricks, cast the rays.

use super::volumes::{Kernels, Settings, Volumes};
use crate::Result;
use crate::gpu::{Access, BufferUse, Gpu, Image, Recorder, Timings};
use crate::stage::bricks::{BrickList, Which};
use crate::stage::field::{BRICK, Field};
use crate::stage::lao::{Bindings, Scope, Work};
use std::time::Instant;

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

/// The same on the device's own queue, in parts of about a tenth of a second, telling `progress` the share done (0 … 1).
/// Waits for the end.
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
    let read_back = gpu.buffer("brick count", 4, BufferUse::Readback)?;
    let mut rec = gpu.recorder("lao bricks")?;
    list(&mut rec, field, kernels, volumes, settings, opacity, ambient)?;
    rec.copy_buffer(&volumes.list.buffer, BrickList::COUNT_AT, &read_back, 0, 4)?;
    rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    let mut timings = rec.submit_and_wait()?;
    let count: u32 = bytemuck::pod_read_unaligned(&read_back.read(0, 4)?);

    // The first part is small enough for any device; the rest follow its pace.
    let brick_samples = f64::from(BRICK.pow(3))
        * settings.occlusion.rays.directions().len() as f64
        * f64::from(settings.occlusion.samples(f64::from(field.min_spacing())).max(1));
    let mut part = (4e6 / brick_samples).clamp(1.0, 1e6) as u32;
    let (mut done, mut lao_ms) = (0, 0.0);
    while done < count {
        let now = part.min(count - done);
        let mut rec = gpu.recorder("lao")?;
        rec.stage("lao")?;
        let b = bindings(volumes, opacity, ambient);
        let occlusion = &settings.occlusion;
        kernels.lao.record_part(
            &mut rec,
            field,
            occlusion,
            settings.reference_mm,
            settings.scope,
            b,
            done,
            now,
        )?;
        rec.end_stage()?;
        let start = Instant::now();
        lao_ms += rec.submit_and_wait()?.iter().map(|(_, ms)| ms).sum::<f64>();
        done += now;
        progress(f64::from(done) / f64::from(count));
        let pace = 0.1 / start.elapsed().as_secs_f64().max(1e-4);
        part = (f64::from(now) * pace.clamp(0.25, 4.0)).clamp(1.0, 1e7) as u32;
    }
    timings.push(("lao".into(), lao_ms));
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
