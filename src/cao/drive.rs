//! The two ways to walk the parts of an update: into a host's command buffer, or on the device's own queue with progress.

use crate::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Recorder, Stage, Timings};
use std::ops::Range;
use std::time::Instant;

/// What earlier frames may still be doing when an update begins, and what the update may do.
const ANYTHING: [Access; 8] = [
    Access::TransferRead,
    Access::TransferWrite,
    Access::StorageRead,
    Access::StorageWrite,
    Access::SampledRead,
    Access::UniformRead,
    Access::IndirectRead,
    Access::GraphicsRead,
];

/// A part of an update.
pub struct Part<'a> {
    stage: Stage,
    extent: Extent<'a>,
    record: Box<Record<'a>>,
}

/// Records a part: some of its items, or all of it.
type Record<'a> = dyn Fn(&mut Recorder, Option<Range<u32>>) -> Result<()> + 'a;

enum Extent<'a> {
    Short,
    Long,
    Items { count: &'a Buffer, count_at: u64, first: u32 },
}

impl<'a> Part<'a> {
    /// A part that takes less than a tenth of a second on any device.
    pub fn short(stage: Stage, record: impl Fn(&mut Recorder) -> Result<()> + 'a) -> Self {
        Self { stage, extent: Extent::Short, record: Box::new(move |rec, _| record(rec)) }
    }

    /// One that may take longer.
    pub fn long(stage: Stage, record: impl Fn(&mut Recorder) -> Result<()> + 'a) -> Self {
        Self { extent: Extent::Long, ..Self::short(stage, record) }
    }

    /// One over a list of items, whose number is a u32 at `count_at` of `count` when everything before it has run: recorded whole, or
    /// some items at a time, `first` at first.
    pub fn items(
        stage: Stage,
        (count, count_at): (&'a Buffer, u64),
        first: u32,
        record: impl Fn(&mut Recorder, Option<Range<u32>>) -> Result<()> + 'a,
    ) -> Self {
        Self { stage, extent: Extent::Items { count, count_at, first }, record: Box::new(record) }
    }

    /// What it is.
    pub fn stage(&self) -> Stage {
        self.stage
    }

    fn is_short(&self) -> bool {
        matches!(self.extent, Extent::Short)
    }
}

/// Records all parts, whole, ordered after everything before and before everything after.
pub fn record(rec: &mut Recorder, parts: &[Part]) -> Result<()> {
    rec.barrier(&ANYTHING, &ANYTHING);
    for same in parts.chunk_by(|a, b| a.stage == b.stage) {
        rec.stage(same[0].stage)?;
        for part in same {
            (part.record)(rec, None)?;
        }
        rec.end_stage()?;
    }
    rec.barrier(&ANYTHING, &ANYTHING);
    Ok(())
}

/// Runs all parts on the device's own queue: short ones together, long ones one by one, lists in slices of about a tenth of a second, so that
/// no driver takes one for a hang. Tells `progress` the share done (0 … 1), waits for the end.
pub fn run(gpu: &Gpu, parts: &[Part], progress: &mut dyn FnMut(f64)) -> Result<Timings> {
    let all = parts.iter().filter(|part| !part.is_short()).count().max(1) as f64;
    let (mut timings, mut done) = (Timings::new(), 0.0);
    for together in parts.chunk_by(|a, b| a.is_short() && b.is_short()) {
        let part = &together[0];
        match part.extent {
            Extent::Short | Extent::Long => {
                let mut rec = gpu.recorder(part.stage.name)?;
                record(&mut rec, together)?;
                rec.submit_and_wait()?.into_iter().for_each(|t| add(&mut timings, t.stage, t.ms));
            }
            Extent::Items { count, count_at, first } => {
                let count = read_count(gpu, count, count_at)?;
                let ms = in_parts(
                    gpu,
                    part.stage,
                    count,
                    first,
                    &mut |rec, items| (part.record)(rec, Some(items)),
                    &mut |share| progress((done + share) / all),
                )?;
                add(&mut timings, part.stage, ms);
            }
        }
        if !part.is_short() {
            done += 1.0;
            progress(done / all);
        }
    }
    Ok(timings)
}

/// Parts of one stage in a row have one time.
fn add(timings: &mut Timings, stage: Stage, ms: f64) {
    match timings.0.last_mut() {
        Some(last) if last.stage == stage => last.ms += ms,
        _ => timings.push(stage, ms),
    }
}

fn read_count(gpu: &Gpu, buffer: &Buffer, at: u64) -> Result<u32> {
    let read_back = gpu.buffer("count", 4, BufferUse::Readback)?;
    let mut rec = gpu.recorder("count")?;
    rec.barrier(&ANYTHING, &ANYTHING);
    rec.copy_buffer(buffer, at, &read_back, 0, 4)?;
    rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    rec.submit_and_wait()?;
    Ok(bytemuck::pod_read_unaligned(&read_back.read(0, 4)?))
}

/// Has `record` record some of `count` items at a time on the device's own queue, `first` of them at first, then as many as take a tenth of
/// a second; tells `progress` the share done (0 … 1). Waits for the end; returns the device's time in ms.
pub fn in_parts(
    gpu: &Gpu,
    stage: Stage,
    count: u32,
    first: u32,
    record: &mut dyn FnMut(&mut Recorder, Range<u32>) -> Result<()>,
    progress: &mut dyn FnMut(f64),
) -> Result<f64> {
    let (mut part, mut done, mut total_ms) = (first.max(1), 0, 0.0);
    while done < count {
        let now = part.min(count - done);
        let mut rec = gpu.recorder(stage.name)?;
        rec.barrier(&ANYTHING, &ANYTHING);
        rec.stage(stage)?;
        record(&mut rec, done..done + now)?;
        rec.end_stage()?;
        let start = Instant::now();
        total_ms += rec.submit_and_wait()?.total();
        done += now;
        progress(f64::from(done) / f64::from(count));
        let pace = 0.1 / start.elapsed().as_secs_f64().max(1e-4);
        part = (f64::from(now) * pace.clamp(0.25, 4.0)).clamp(1.0, 1e7) as u32;
    }
    Ok(total_ms)
}
