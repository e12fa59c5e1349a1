//! A long computation on the device's own queue, in parts of about a tenth of a second: progress can be shown, and no driver
//! takes one dispatch for a hang.

use super::volumes::{Kernels, Settings};
use crate::Result;
use crate::gpu::{Access, BufferUse, Gpu};
use crate::stage::bricks::BrickList;
use crate::stage::field::{BRICK, Field};
use crate::stage::lao::{Bindings, Work};
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

    // The first part is small enough for any device; the rest follow its pace.
    let brick_samples = f64::from(BRICK.pow(3))
        * settings.occlusion.rays.directions().len() as f64
        * f64::from(settings.occlusion.samples(f64::from(field.min_spacing())).max(1));
    let mut part = (4e6 / brick_samples).clamp(1.0, 1e6) as u32;
    let (mut done, mut total_ms) = (0, 0.0);
    while done < count {
        let now = part.min(count - done);
        let mut rec = gpu.recorder(stage)?;
        rec.stage(stage)?;
        let (occlusion, reference_mm) = (&settings.occlusion, settings.reference_mm);
        kernels.lao.record_part(
            &mut rec,
            field,
            occlusion,
            reference_mm,
            settings.scope,
            work,
            bindings,
            done,
            now,
        )?;
        rec.end_stage()?;
        let start = Instant::now();
        total_ms += rec.submit_and_wait()?.iter().map(|(_, ms)| ms).sum::<f64>();
        done += now;
        progress(f64::from(done) / f64::from(count));
        let pace = 0.1 / start.elapsed().as_secs_f64().max(1e-4);
        part = (f64::from(now) * pace.clamp(0.25, 4.0)).clamp(1.0, 1e7) as u32;
    }
    Ok((stage.into(), total_ms))
}
