//! The two ways to walk the parts of an update: into a host's command buffer, or on the device's own queue with progress.

use crate::Result;
use crate::host::row_of_groups;
use cao_gpu::{Access, Bindings, Buffer, BufferUse, Gpu, Pipeline, Recorder, Stage, Timing, Timings};
use std::ops::Range;
use std::time::{Duration, Instant};

/// What earlier frames may still be doing when an update begins, and what the update may do.
pub(crate) const ANYTHING: [Access; 8] = [
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

impl Take<'_> {
    /// The first item.
    pub fn first(&self) -> u32 {
        match self {
            Self::All => 0,
            Self::These(items) => items.start,
            Self::Slice { first, .. } => *first,
        }
    }

    /// Runs a kernel of which each group takes an item from the first on, and none beyond the end of `list`, which begins with the group
    /// counts of all.
    pub fn dispatch(
        &self,
        rec: &mut Recorder,
        pipeline: &Pipeline,
        binds: &impl Bindings,
        push: &[u8],
        list: &Buffer,
    ) -> cao_gpu::Result<()> {
        match self {
            Self::All => rec.dispatch_indirect(pipeline, binds, push, list, 0),
            Self::These(items) => rec.dispatch(pipeline, binds, push, row_of_groups(items.len() as u32)),
            Self::Slice { groups, .. } => rec.dispatch_indirect(pipeline, binds, push, groups, 0),
        }
    }
}

/// Records a part, or some of its items.
type Record<'a> = dyn Fn(&mut Recorder, &Take) -> Result<()> + 'a;

/// How much of a part.
#[derive(Clone)]
pub enum Take<'a> {
    /// All of it.
    All,
    /// These items.
    These(Range<u32>),
    /// As many as the device says when it gets there.
    Slice {
        /// From this item on.
        first: u32,
        /// Group counts of a dispatch in which each group takes an item: at byte 0.
        groups: &'a Buffer,
    },
}

enum Extent<'a> {
    Short,
    Long,
    Items { items: Items<'a>, first: u32 },
}

/// A list of items on the device.
#[derive(Clone, Copy)]
pub struct Items<'a> {
    /// Where their number is, a u32,
    pub count: &'a Buffer,
    /// at this byte.
    pub at: u64,
    /// How many there are at most.
    pub most: u32,
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

    /// One over a list of items, whose number is known to the device when everything before it has run: recorded whole, or some items at a
    /// time, `first` at first, where it is not known how long one takes.
    pub fn items(
        stage: Stage,
        items: Items<'a>,
        first: u32,
        record: impl Fn(&mut Recorder, &Take) -> Result<()> + 'a,
    ) -> Self {
        Self { stage, extent: Extent::Items { items, first }, record: Box::new(record) }
    }

    /// What it is.
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// Its list, and how many items to take at first; `None` of a part that is always recorded whole.
    pub fn listed(&self) -> Option<(Items<'a>, u32)> {
        match self.extent {
            Extent::Items { items, first } => Some((items, first)),
            Extent::Short | Extent::Long => None,
        }
    }

    /// Records it, or some of its items, as a stage.
    pub fn record(&self, rec: &mut Recorder, take: &Take) -> Result<()> {
        rec.stage(self.stage)?;
        (self.record)(rec, take)?;
        Ok(rec.end_stage()?)
    }

    /// What it takes at most, in ms; unknown where nobody has seen it run.
    fn at_most(&self, pace: &Pace) -> Option<f64> {
        match self.extent {
            Extent::Short => Some(0.0),
            Extent::Long => pace.ms(self.stage),
            Extent::Items { items, .. } => {
                pace.ms(self.stage).map(|ms| ms * f64::from(pace.most(self.stage, items)))
            }
        }
    }
}

/// How long an item of a stage took, ms, and how many there were at most, as far as that was seen since the settings changed. More may
/// come, under a clip that lets more be seen: then one submission is longer than foreseen, and the next is careful again.
#[derive(Default)]
pub struct Pace(Vec<(Stage, f64, u32)>);

impl Pace {
    fn seen(&self, stage: Stage) -> Option<&(Stage, f64, u32)> {
        self.0.iter().find(|(of, ..)| *of == stage)
    }

    fn ms(&self, stage: Stage) -> Option<f64> {
        self.seen(stage).map(|(_, ms, _)| *ms)
    }

    /// How many items to foresee: those that were seen.
    fn most(&self, stage: Stage, items: Items) -> u32 {
        self.seen(stage).map_or(items.most, |(.., most)| (*most).min(items.most))
    }

    fn learn(&mut self, stage: Stage, ms: f64, items: u32) {
        let most = self.seen(stage).map_or(0, |(.., most)| *most).max(items);
        self.forget(stage);
        self.0.push((stage, ms, most));
    }

    fn forget(&mut self, stage: Stage) {
        self.0.retain(|(of, ..)| *of != stage);
    }

    /// Nothing is known: other settings take another time.
    pub fn clear(&mut self) {
        self.0.clear();
    }
}

/// No submission takes longer than this, in ms, so that no driver takes one for a hang.
const TENTH_MS: f64 = 100.0;

/// How much longer than foreseen a part may take.
const MARGIN: f64 = 2.0;

/// Records all parts, whole, ordered after everything before and before everything after.
pub fn record(rec: &mut Recorder, parts: &[Part]) -> Result<()> {
    rec.barrier(&ANYTHING, &ANYTHING);
    for same in parts.chunk_by(|a, b| a.stage == b.stage) {
        rec.stage(same[0].stage)?;
        for part in same {
            (part.record)(rec, &Take::All)?;
        }
        rec.end_stage()?;
    }
    rec.barrier(&ANYTHING, &ANYTHING);
    Ok(())
}

/// Runs all parts on the device's own queue: in one submission where `pace` says that it takes less than a tenth of a second; else those that
/// may take longer one by one, lists in slices. Tells `progress` the share done (0 … 1), waits for the end.
pub fn run(gpu: &Gpu, parts: &[Part], pace: &mut Pace, progress: &mut dyn FnMut(f64)) -> Result<Timings> {
    let (mut timings, mut first) = (Timings::new(), 0);
    let mut expected = 0.0;
    for (i, part) in parts.iter().enumerate() {
        if let Some(ms) = part.at_most(pace).filter(|ms| MARGIN * (expected + ms) <= TENTH_MS) {
            expected += ms;
            continue;
        }
        together(gpu, &parts[first..i], pace, &mut timings)?;
        let share = |of: f64| (i as f64 + of) / parts.len() as f64;
        let start = Instant::now();
        match part.extent {
            Extent::Short | Extent::Long => {
                together(gpu, std::slice::from_ref(part), pace, &mut timings)?;
                pace.learn(part.stage, start.elapsed().as_secs_f64() * 1e3, 1);
            }
            Extent::Items { items, first } => {
                let count = read_count(gpu, items)?;
                let mut record =
                    |rec: &mut Recorder, items: Range<u32>| (part.record)(rec, &Take::These(items));
                let told = &mut |of: f64| progress(share(of));
                let ms = in_parts(gpu, part.stage, count, first, &mut record, told)?;
                add(&mut timings, part.stage, ms);
                // What there are few of says little of many.
                if count > 0 {
                    pace.learn(part.stage, start.elapsed().as_secs_f64() * 1e3 / f64::from(count), count);
                }
            }
        }
        progress(share(1.0));
        (first, expected) = (i + 1, 0.0);
    }
    together(gpu, &parts[first..], pace, &mut timings)?;
    progress(1.0);
    Ok(timings)
}

/// Parts in one submission.
fn together(gpu: &Gpu, parts: &[Part], pace: &mut Pace, timings: &mut Timings) -> Result<()> {
    let Some(part) = parts.first() else { return Ok(()) };
    let mut rec = gpu.recorder(part.stage.name)?;
    record(&mut rec, parts)?;
    for Timing { stage, ms } in rec.submit_and_wait()? {
        if ms > TENTH_MS {
            pace.forget(stage);
        }
        add(timings, stage, ms);
    }
    Ok(())
}

/// Parts of one stage in a row have one time.
pub fn add(timings: &mut Timings, stage: Stage, ms: f64) {
    match timings.0.last_mut() {
        Some(last) if last.stage == stage => last.ms += ms,
        _ => timings.push(stage, ms),
    }
}

fn read_count(gpu: &Gpu, Items { count, at, .. }: Items) -> Result<u32> {
    let read_back = gpu.buffer("count", 4, BufferUse::Readback)?;
    let mut rec = gpu.recorder("count")?;
    rec.barrier(&ANYTHING, &ANYTHING);
    rec.copy_buffer(count, at, &read_back, 0, 4)?;
    rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    rec.submit_and_wait()?;
    Ok(bytemuck::pod_read_unaligned(&read_back.read(0, 4)?))
}

/// How many items to take at a time, so that a submission takes a tenth of a second.
pub struct Slice(u32);

impl Slice {
    /// So many at first.
    pub fn of(first: u32) -> Self {
        Self(first.max(1))
    }

    /// How many to take of those that are left.
    pub fn of_these(&self, left: u32) -> u32 {
        self.0.min(left)
    }

    /// How long it took with so many.
    pub fn took(&mut self, items: u32, time: Duration) {
        let pace = TENTH_MS / (1e3 * time.as_secs_f64()).max(0.1);
        // A few that are left over at an end say little of many.
        if items == self.0 || pace < 1.0 {
            self.0 = (f64::from(items) * pace.clamp(0.25, 4.0)).clamp(1.0, 1e7) as u32;
        }
    }
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
    let (mut slice, mut done, mut total_ms) = (Slice::of(first), 0, 0.0);
    while done < count {
        let now = slice.of_these(count - done);
        let mut rec = gpu.recorder(stage.name)?;
        rec.barrier(&ANYTHING, &ANYTHING);
        rec.stage(stage)?;
        record(&mut rec, done..done + now)?;
        rec.end_stage()?;
        let start = Instant::now();
        total_ms += rec.submit_and_wait()?.total();
        done += now;
        progress(f64::from(done) / f64::from(count));
        slice.took(now, start.elapsed());
    }
    Ok(total_ms)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::{BRICKS, LAO};

    #[test]
    fn slices_grow_to_a_tenth_of_a_second() {
        // Items of a millisecond each, then of five.
        let (mut slice, mut longest) = (Slice::of(3), 0);
        for ms in [1, 1, 1, 1, 1, 5, 5, 5] {
            let items = slice.of_these(1000);
            longest = longest.max(ms * u64::from(items));
            slice.took(items, Duration::from_millis(ms * u64::from(items)));
        }
        assert_eq!((slice.of_these(1000), slice.of_these(7), longest), (20, 7, 500));
        // What is left at a band's end says nothing; what takes long does.
        slice.took(1, Duration::from_millis(1));
        assert_eq!(slice.of_these(1000), 20);
        slice.took(2, Duration::from_secs(9));
        assert_eq!(slice.of_these(1000), 1);
    }

    #[test]
    fn what_was_never_seen_takes_no_known_time() {
        let mut pace = Pace::default();
        let part = Part::long(LAO, |_| Ok(()));
        assert_eq!((part.at_most(&pace), Part::short(BRICKS, |_| Ok(())).at_most(&pace)), (None, Some(0.0)));
        pace.learn(LAO, 3.0, 1);
        pace.learn(LAO, 2.0, 1);
        assert_eq!(part.at_most(&pace), Some(2.0));
        pace.forget(LAO);
        assert_eq!(part.at_most(&pace), None);
    }
}
