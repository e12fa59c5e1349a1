//! A long computation on the device's own queue, in parts of about a tenth of a second: progress can be shown, and no driver
//! takes one dispatch for a hang.

use super::volumes::{Kernels, Settings};
use crate::cast::lao::{Bindings, Work};
use crate::field::bricks::BrickList;
use crate::field::{BRICK, Field};
use cao_gpu::Result;
use cao_gpu::{Access, BufferUse, Gpu, Recorder};
use std::time::Instant;

/// Works through the list, telling `progress` the share done (0 … 1). Waits for the end; returns the stage's name and time in
/// ms.
#[expect(clippy::too_many_arguments, reason = "inputs, outputs and settings, each named once")]
pub fn run(
    gpu: &Gpu,
    stage: &str,
    field: &Field,
    kernels: &Kernels,
    settings: &Settings,
    work: Work,
    bindings: Bindings,
    progress: &mut dyn FnMut(f64),
) -> Result<(String, f64)> {
    let read_back = gpu.buffer("brick count", 4, BufferUse::Readback)?;
    let mut rec = gpu.recorder("brick count")?;
    rec.copy_buffer(&bindings.list.buffer, BrickList::COUNT_AT, &read_back, 0, 4)?;
    rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    rec.submit_and_wait()?;
    let count: u32 = bytemuck::pod_read_unaligned(&read_back.read(0, 4)?);

    // The first part is small enough for any device.
    let brick_samples = f64::from(BRICK.pow(3))
        * settings.occlusion.rays.directions().len() as f64
        * f64::from(settings.occlusion.samples(f64::from(field.min_spacing())).max(1));
    let first = (4e6 / brick_samples).clamp(1.0, 1e6) as u32;
    let (occlusion, reference_mm, scope) = (&settings.occlusion, settings.reference_mm, settings.scope);
    let mut record = |rec: &mut Recorder, base: u32, now: u32| {
        kernels.lao.record_part(rec, field, occlusion, reference_mm, scope, work, bindings, base, now)
    };
    Ok((stage.into(), in_parts(gpu, stage, count, first, &mut record, progress)?))
}

/// Has `record` record items `base` … `base + now` of `count`, `first` of them at first, then as many as take a tenth of a
/// second; tells `progress` the share done (0 … 1). Waits for the end; returns the device's time in ms.
pub fn in_parts(
    gpu: &Gpu,
    stage: &str,
    count: u32,
    first: u32,
    record: &mut dyn FnMut(&mut Recorder, u32, u32) -> Result<()>,
    progress: &mut dyn FnMut(f64),
) -> Result<f64> {
    let (mut part, mut done, mut total_ms) = (first.max(1), 0, 0.0);
    while done < count {
        let now = part.min(count - done);
        let mut rec = gpu.recorder(stage)?;
        rec.stage(stage)?;
        record(&mut rec, done, now)?;
        rec.end_stage()?;
        let start = Instant::now();
        total_ms += rec.submit_and_wait()?.iter().map(|(_, ms)| ms).sum::<f64>();
        done += now;
        progress(f64::from(done) / f64::from(count));
        let pace = 0.1 / start.elapsed().as_secs_f64().max(1e-4);
        part = (f64::from(now) * pace.clamp(0.25, 4.0)).clamp(1.0, 1e7) as u32;
    }
    Ok(total_ms)
}
