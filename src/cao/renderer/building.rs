//! What brings the ambient volume up to date: whole, or within a budget, over as many frames as that takes.
//!
//! An update that spans frames, a *build*, writes into a volume of its own. Everything that depends on values, transfer function and clips is
//! recorded in the frame that opens it, so that it is of one scene; the slices of its list follow, and the device itself shows the new values in
//! the frame of the last one. Meanwhile pictures show the newest clips, transfer function and values with the ambient volume of before.

use super::Renderer;
use crate::ambient::Changed;
use crate::build::{Budget, Build, Rates, Stale, Updated};
use crate::drive::{self, ANYTHING, Part, Take};
use crate::field::commit::{Commit, Slice};
use crate::field::volume_image;
use crate::stages;
use crate::{Error, Result};
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Image, Phase, Recorder, Timings};
use std::time::Instant;

/// Updates without anything to do after which the second volume is given back: a second or so.
const IDLE: u32 = 90;

/// Updates that span frames.
pub(super) struct Building {
    commit: Commit,
    pub(super) rates: Rates,
    /// What runs, and what it writes into, of the form of V_AO.
    build: Option<(Build, Image)>,
    /// What the last one wrote into.
    spare: Option<Image>,
    /// Updates in a row that had nothing to do.
    idle: u32,
    /// Updates that were recorded or run, and the one whose scene the ambient volume shows.
    updates: u64,
    shown: u64,
}

impl Building {
    /// Nothing is built.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            commit: Commit::new(gpu)?,
            rates: Rates::default(),
            build: None,
            spare: None,
            idle: 0,
            updates: 0,
            shown: 0,
        })
    }
}

/// What an update found, and what it is to leave where it succeeds.
struct Begun {
    changed: Changed,
    unshown: Changed,
    build: Option<(Build, Image)>,
    spare: Option<Image>,
}

impl Renderer {
    /// Records what brings the ambient volume up to date, all of it: nothing where nothing changed.
    ///
    /// From here on the renderer takes the commands as done. They must be submitted, in the order of recording and before
    /// any later use of this renderer reaches the queue; where they are not, call [`Self::invalidate`]. After an error
    /// nothing counts as done, and what was recorded should not be submitted.
    ///
    /// # Errors
    /// Those of the device, and what an update that has run meanwhile found wrong with a clip mesh: see [`Self::set_clips`].
    pub fn record_update(&mut self, rec: &mut Recorder) -> Result<()> {
        self.hear()?;
        let mut begun = self.begin();
        self.subject.record_clip_maps(rec)?;
        if let Some((build, made)) = &mut begun.build {
            while !build.ended(self.bricks()) {
                self.slice(rec, made, build, Budget::Bricks(u32::MAX), None)?;
            }
        }
        self.take_settings(begun.changed)?;
        let parts = self.parts(begun.changed, None);
        if !parts.is_empty() {
            drive::record(rec, &parts)?;
        }
        drop(parts);
        self.all_done(begun);
        Ok(())
    }

    /// Records as much of it as a budget allows: the whole update where that is sure to fit, as [`Self::record_update`] does; else a part of it,
    /// and the next calls go on. The ambient volume that pictures show is that of the last update that ended, complete, until this one has; clips,
    /// transfer function and values are the newest in any case. Voxels that a newer clip lays bare hold what they held: 1, unoccluded, where
    /// nothing needed their value. Before the first update has ended, and after a change of method, nothing is occluded.
    ///
    /// What opens an update is never split: opacities, what the clips do to them, the list of bricks; with method `cao`, all of that twice
    /// where more than clips changed. Edits that come while an update spans frames wait for its end, together. That the last slice was the
    /// last is known to the device in that frame, to the renderer when [`Self::updated`] says that it has run; without it, after as many slices as a
    /// volume full of bricks to compute would take.
    ///
    /// The other rules are those of [`Self::record_update`]. A second volume of the form of V_AO is allocated when a first update spans frames, and
    /// given back after 90 calls without anything to do: 2 bytes a voxel, with methods `lao` and `cao` 4, with `fdao` 8.
    ///
    /// # Errors
    /// A budget of 0 bricks, of no time or of no number; those of [`Self::record_update`].
    pub fn record_update_within(&mut self, rec: &mut Recorder, budget: Budget) -> Result<Updated> {
        budget.check()?;
        self.hear()?;
        let mut begun = self.begin();
        self.subject.record_clip_maps(rec)?;
        let updated = match (&mut begun.build, begun.changed) {
            (Some((build, made)), _) => {
                self.record_shown(rec, begun.unshown)?;
                self.slice(rec, made, build, budget, None)?
            }
            (None, Changed::NOTHING) => {
                self.building.idle += 1;
                begun.spare = begun.spare.filter(|_| self.building.idle < IDLE);
                Updated::default()
            }
            (None, changed) => {
                self.take_settings(changed)?;
                if let Some(updated) = self.whole(rec, budget, changed)? {
                    self.all_done(begun);
                    return Ok(updated);
                }
                let made = begun.spare.take().map_or_else(|| self.made(rec), Ok)?;
                let mut build = Build::new(self.building.updates, changed);
                let updated = self.slice(rec, &made, &mut build, budget, Some(changed))?;
                drive::record(rec, &[self.distances()])?;
                (begun.build, begun.changed, self.building.idle) = (Some((build, made)), Changed::NOTHING, 0);
                updated
            }
        };
        self.subject.clip_set.settle();
        (self.changed, self.unshown) = (begun.changed, Changed::NOTHING);
        (self.building.build, self.building.spare) = (begun.build, begun.spare);
        Ok(updated)
    }

    /// Says that the commands of a recorded update have run, and how long they took, in ms:
    /// [`Recorded::timings`](cao_gpu::Recorded::timings), all but those of the drawing, or what the host measured itself; anything but a number
    /// above 0 where it is not known. Times may come late and need not come for every frame. Until one comes a budget in ms allows a
    /// few bricks, and an update takes as many frames as if every brick of the volume had to be computed.
    ///
    /// # Errors
    /// Those of the device.
    pub fn updated(&mut self, updated: &Updated, ms: f64) -> Result<()> {
        let Some(counted) = &updated.counted else { return Ok(()) };
        let count: u32 = bytemuck::pod_read_unaligned(&counted.read(0, 4)?);
        if let Some((build, _)) = &mut self.building.build {
            build.told(updated, count);
        }
        self.building.rates.learn(updated, count.saturating_sub(updated.first).min(updated.most), ms);
        self.note_end();
        Ok(())
    }

    /// How much of the scene the ambient volume that is shown does not know yet, as far as the renderer was told.
    pub fn stale(&self) -> Stale {
        let Building { build, updates, shown, .. } = &self.building;
        let (most, mut shown) = (self.bricks(), *shown);
        let mut bricks = 0;
        match build {
            Some((build, _)) if build.ended(most) => shown = build.number,
            // All of a list may be recorded, and another to come.
            Some((build, _)) => bricks = build.left(most).max(1),
            None => (),
        }
        let waiting = self.changed != Changed::NOTHING;
        let frames = if waiting || bricks > 0 { updates - shown } else { 0 };
        Stale { waiting, bricks, frames }
    }

    /// The same as [`Self::record_update`] on the device's own queue, in parts, telling `progress` the share done. Waits for the end; returns
    /// the time of each stage. After an error, or a panic of `progress`, nothing counts
    /// as done, and the next update computes everything.
    pub fn update(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Timings> {
        self.hear()?;
        let mut begun = self.begin();
        let gpu = self.subject.gpu.clone();
        let mut timings = self.subject.make_clip_maps()?;
        if let Some((build, made)) = &mut begun.build {
            let mut bricks = drive::Slice::of(1);
            while !build.ended(self.bricks()) {
                let budget = Budget::Bricks(bricks.of_these(u32::MAX));
                let mut rec = gpu.recorder("build")?;
                let updated = self.slice(&mut rec, made, build, budget, None)?;
                let start = Instant::now();
                timings.extend(rec.submit_and_wait()?);
                bricks.took(updated.most, start.elapsed());
                if let Some(counted) = &updated.counted {
                    build.told(&updated, bytemuck::pod_read_unaligned(&counted.read(0, 4)?));
                }
            }
        }
        self.take_settings(begun.changed)?;
        let mut pace = std::mem::take(&mut self.pace);
        let ran = drive::run(&gpu, &self.parts(begun.changed, None), &mut pace, progress);
        self.pace = pace;
        timings.extend(ran?);
        self.all_done(begun);
        Ok(timings)
    }

    /// Takes nothing on the device for granted, so that the next update recomputes everything: after commands of
    /// [`Self::record_update`] that were never submitted.
    pub fn invalidate(&mut self) {
        self.subject.clip_set.forget();
        self.spoil();
    }

    /// Maps of clip meshes apart, nothing counts as done.
    pub(super) fn spoil(&mut self) {
        (self.changed, self.unshown) = (Changed::ALL, Changed::ALL);
        (self.building.build, self.building.spare) = (None, None);
    }

    /// What there is to do. From here on nothing counts as done until all of it is: an error or a panic on the way leaves everything to do.
    fn begin(&mut self) -> Begun {
        self.note_end();
        self.building.updates += 1;
        let Building { build, spare, .. } = &mut self.building;
        let begun =
            Begun { changed: self.changed, unshown: self.unshown, build: build.take(), spare: spare.take() };
        if begun.changed != Changed::NOTHING || begun.build.is_some() {
            self.spoil();
        }
        begun
    }

    /// What recordings that have run meanwhile found of clip meshes: where the maps of one are to be made again, the clips changed.
    fn hear(&mut self) -> Result<()> {
        let heard = self.subject.clip_set.heard();
        if !matches!(heard, Ok(false)) {
            self.edited(Changed { clips: true, ..Changed::NOTHING });
        }
        heard.map(drop)
    }

    /// A build that is known to have ended is none any more.
    fn note_end(&mut self) {
        let most = self.bricks();
        if let Some((build, made)) = self.building.build.take_if(|(build, _)| build.ended(most)) {
            (self.building.shown, self.building.spare) = (build.number, Some(made));
        }
    }

    /// The newest scene is there, whole.
    fn all_done(&mut self, begun: Begun) {
        self.subject.clip_set.settle();
        (self.changed, self.unshown) = (Changed::NOTHING, Changed::NOTHING);
        self.building.spare = begun.build.map(|(_, made)| made).or(begun.spare);
        (self.building.shown, self.building.idle) = (self.building.updates, 0);
    }

    /// Settings that waited for the end of a build, and the length that opacities are meant for.
    fn take_settings(&mut self, changed: Changed) -> Result<()> {
        if changed.anew {
            self.subject.setup = self.subject.wanted;
            self.ambient.set(&self.subject)?;
            self.subject.ambient_mm = self.subject.reference_mm();
        }
        Ok(())
    }

    pub(super) fn is_building(&self) -> bool {
        self.building.build.as_ref().is_some_and(|(build, _)| !build.ended(self.bricks()))
    }

    fn bricks(&self) -> u32 {
        self.subject.field.brick_count()
    }

    /// Another volume of the form of V_AO.
    fn made(&self, rec: &mut Recorder) -> Result<Image> {
        let format = self.ambient.fields().ambient.desc().format;
        let made = volume_image(&self.subject.gpu, "ambient being built", &self.subject.field, format)?;
        rec.discard(&made);
        Ok(made)
    }

    /// What there is to do after these changes, in order.
    fn parts<'a>(&'a self, changed: Changed, into: Option<&'a Image>) -> Vec<Part<'a>> {
        if changed == Changed::NOTHING {
            return Vec::new();
        }
        let mut parts = Vec::new();
        if changed.opacities {
            parts.extend(self.subject.classified());
        }
        parts.extend(self.ambient.update(&self.subject, changed, into));
        // Of a build they come with what opens it.
        if into.is_none() {
            parts.push(self.distances());
        }
        parts
    }

    /// How far rays may leap, and where they end, after new occupancy or clips.
    fn distances(&self) -> Part<'_> {
        Part::short(stages::DISTANCES, |rec| {
            let (field, occupancy) = (&self.subject.field, &self.subject.occupancy);
            let clip_bricks = self.ambient.fields().clip_bricks;
            self.brick_distance.record(rec, field, occupancy, clip_bricks, &self.distances)?;
            Ok(self.bounds_of.record(rec, field, &self.distances, &self.bounds)?)
        })
    }

    /// Records what pictures show of edits that wait for a build: all but ambient values.
    fn record_shown(&self, rec: &mut Recorder, unshown: Changed) -> Result<()> {
        let mut parts = Vec::new();
        if unshown.opacities {
            parts.extend(self.subject.classified());
        }
        if unshown.clips {
            parts.push(self.ambient.clips(&self.subject));
        }
        if !parts.is_empty() {
            parts.push(self.distances());
            drive::record(rec, &parts)?;
        }
        Ok(())
    }

    /// Records the update whole, if the budget allows every brick there could be on its lists; what it counts is for times to come.
    fn whole(&self, rec: &mut Recorder, budget: Budget, changed: Changed) -> Result<Option<Updated>> {
        let parts = self.parts(changed, None);
        let allows = |part: &Part| {
            let listed = part.listed();
            listed.is_none_or(|(_, first)| {
                self.building.rates.bricks(budget, part.stage(), first, Some(changed)) >= self.bricks()
            })
        };
        if !parts.iter().all(allows) {
            return Ok(None);
        }
        drive::record(rec, &parts)?;
        let most = self.bricks();
        let mut updated = Updated { most, opens: Some(changed), ..Updated::default() };
        if let (Budget::Ms(_), Some(part)) = (budget, parts.iter().rfind(|part| part.listed().is_some())) {
            updated.stage = Some(part.stage());
            updated.counted = Some(self.record_count(rec, part)?);
        }
        Ok(Some(updated))
    }

    /// Copies the number of bricks on a part's list to where the host can read it.
    fn record_count(&self, rec: &mut Recorder, part: &Part) -> Result<Buffer> {
        let counted = self.subject.gpu.buffer("bricks on the list", 4, BufferUse::Readback)?;
        if let Some((items, _)) = part.listed() {
            rec.copy_buffer(items.count, items.at, &counted, 0, 4)?;
            rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        }
        Ok(counted)
    }

    /// Records what comes before the next slice of a build, and that slice; where it is the last of all, what shows the new values.
    fn slice(
        &self,
        rec: &mut Recorder,
        made: &Image,
        build: &mut Build,
        budget: Budget,
        opens: Option<Changed>,
    ) -> Result<Updated> {
        let field = &self.subject.field;
        let parts = self.parts(build.changed, Some(made));
        if build.listed(self.bricks()) {
            build.advance();
        }
        rec.barrier(&ANYTHING, &ANYTHING);
        let mut updated = Updated { build: build.number, opens, ..Updated::default() };
        while let Some(part) = parts.get(build.part) {
            let Some((items, first)) = part.listed() else {
                part.record(rec, &Take::All)?;
                build.part += 1;
                continue;
            };
            build.last = parts[build.part + 1..].iter().all(|part| part.listed().is_none());
            if build.counted.is_none() {
                build.counted = Some(self.record_count(rec, part)?);
            }
            let most = self.building.rates.bricks(budget, part.stage(), first, opens);
            let all = build.last && self.ambient.written(build.changed).all;
            let slice = Slice { first: build.first, most, all };
            let Commit { turn, .. } = &self.building.commit;
            self.building.commit.record_choice(rec, field, items.count, slice)?;
            part.record(rec, &Take::Slice { first: slice.first, groups: turn })?;
            if build.last {
                rec.stage(stages::COMMIT)?;
                let shown = self.ambient.fields().ambient;
                self.building.commit.record(rec, field, items.count, slice, made, shown)?;
                rec.end_stage()?;
            }
            (updated.part, updated.stage) = (build.part, Some(part.stage()));
            (updated.first, updated.most) = (slice.first, most.min(items.most));
            updated.counted = build.counted.clone();
            build.first = build.first.saturating_add(most);
            break;
        }
        rec.barrier(&ANYTHING, &ANYTHING);
        Ok(updated)
    }

    /// Refuses to show what no longer fits the scene.
    pub(crate) fn current(&self) -> Result<()> {
        match self.unshown {
            Changed::NOTHING => Ok(()),
            _ => Err(Error::refused("ambient volume", "out of date; call update or record_update first")),
        }
    }

    /// Refuses to read what is of two scenes, too.
    pub(crate) fn complete(&self) -> Result<()> {
        self.current()?;
        match self.stale().is_settled() {
            true => Ok(()),
            false => Err(Error::refused(
                "ambient volume",
                "is being built; call update or record_update, or record_update_within until nothing is stale",
            )),
        }
    }

    /// Brings V_o alone up to date; V_AO goes out of date, so that the next update computes everything. Uses the device's queue and waits
    /// for it.
    pub(crate) fn update_opacity(&mut self) -> Result<()> {
        let changed = self.changed.and(self.unshown);
        let whole = if self.is_building() { Changed::ALL } else { changed };
        self.spoil();
        self.subject.make_clip_maps()?;
        self.take_settings(whole)?;
        let mut parts = self.parts(whole, None);
        parts.retain(|part| matches!(part.stage().phase, Phase::Opacity | Phase::Clip));
        drive::run(&self.subject.gpu, &parts, &mut drive::Pace::default(), &mut |_| ())?;
        Ok(())
    }
}
