//! Finds missing barriers while commands are recorded, from what reflection says each command reads and writes.
//!
//! The rule: before a command touches memory that an earlier command touched, and one of the two writes, a barrier recorded in
//! between must have named both accesses, `barrier(&[earlier], &[later])`. That is stricter than Vulkan, which orders pipeline
//! stages and lets chains of barriers add up; naming both keeps each line true on its own. Two exceptions, where naming one says the other:
//! where a command reads *and* writes the same memory, its write stands for both; and a write that readers were ordered after need not be
//! named again by the next write, which must name the readers.
//!
//! Plain data, no device: images are ranges of layers, buffers ranges of bytes. Images also carry whether they have been
//! moved from Vulkan's UNDEFINED layout to GENERAL, in which they then stay.

use super::access::Access;
use std::{collections::BTreeMap, ops::Range, sync::Arc};

/// Identity of a buffer or image, never reused (a driver reuses its handles), not by another device either.
pub type ResourceId = u64;

/// One way in which one command touches one resource.
#[derive(Debug, Clone)]
pub struct Touch<'a> {
    /// Which resource.
    pub id: ResourceId,
    /// Its name, for messages.
    pub name: &'a str,
    /// Through what: a binding name, "source", "attachment"…
    pub via: &'a str,
    /// Bytes of a buffer, layers of an image.
    pub range: Range<u64>,
    /// How.
    pub access: Access,
}

/// What a resource has been through.
#[derive(Debug, Clone, Default)]
struct State {
    /// An image that has not been discarded, cleared of its undefined layout, yet; or a host's that is not held.
    undefined: bool,
    /// An image of a host, held between acquiring and releasing.
    lent: bool,
    /// Accesses that a later command may still have to be ordered after.
    pending: Vec<Pending>,
    /// Bytes of a buffer that may be indirect arguments: what the program wrote last there are numbers that every device can dispatch.
    dispatchable: Vec<Range<u64>>,
    /// Whether this recording has written words of it: else what it knows of them is as old as its beginning.
    worded: bool,
}

#[derive(Debug, Clone, PartialEq)]
struct Pending {
    range: Range<u64>,
    access: Access,
    /// Accesses that barriers have ordered after this one, one [`Access::bit`] each.
    ordered: u16,
    command: Arc<str>,
}

/// The state of all resources at one point of the recording.
#[derive(Debug, Clone, Default)]
pub struct Hazards {
    resources: BTreeMap<ResourceId, State>,
}

impl Hazards {
    /// Makes a buffer known.
    pub fn add_buffer(&mut self, id: ResourceId) {
        self.resources.insert(id, State::default());
    }

    /// Makes an image known; it must be discarded before it is used.
    pub fn add_image(&mut self, id: ResourceId) {
        self.resources.insert(id, State { undefined: true, ..State::default() });
    }

    /// Makes a host's image known; it must be acquired before it is used.
    pub fn add_hosts_image(&mut self, id: ResourceId) {
        self.resources.insert(id, State { undefined: true, lent: true, ..State::default() });
    }

    /// Whether a host's image is with the host at this point.
    pub fn is_hosts(&self, id: ResourceId) -> bool {
        self.resources.get(&id).is_some_and(|state| state.lent && state.undefined)
    }

    /// Records that a host's image was taken over: what follows waits for that.
    pub fn take_over(&mut self, id: ResourceId) {
        self.resources.insert(id, State { lent: true, ..State::default() });
    }

    /// Records that a host's image was given back: that waited for all before.
    pub fn give_back(&mut self, id: ResourceId) {
        self.add_hosts_image(id);
    }

    /// Forgets a resource that no longer exists.
    pub fn remove(&mut self, id: ResourceId) {
        self.resources.remove(&id);
    }

    /// Takes over what `gpu` knows of a resource that was made after this recording began.
    pub fn learn(&mut self, gpu: &Hazards, id: ResourceId) {
        if let (false, Some(state)) = (self.resources.contains_key(&id), gpu.resources.get(&id)) {
            self.resources.insert(id, state.clone());
        }
    }

    /// Records that an image's content was given up. The layout change waits for everything before it and holds back
    /// everything after it, so nothing is pending afterwards.
    pub fn discard(&mut self, id: ResourceId) {
        self.resources.insert(id, State::default());
    }

    /// Records a global memory barrier.
    pub fn barrier(&mut self, before: &[Access], after: &[Access]) {
        let after = after.iter().fold(0, |bits, access| bits | access.bit());
        for pending in self.resources.values_mut().flat_map(|state| &mut state.pending) {
            if before.contains(&pending.access) {
                pending.ordered |= after;
            }
        }
    }

    /// Records a command, or says which barrier is missing before it.
    pub fn command(&mut self, command: &str, touches: &[Touch<'_>]) -> Result<(), String> {
        for (i, touch) in touches.iter().enumerate() {
            if let Some(other) = touches[..i].iter().find(|other| clash(other, touch)) {
                return Err(format!(
                    "{command} binds {} as `{}` ({:?}) and as `{}` ({:?}) at once; no barrier can order them, use two resources",
                    touch.name, other.via, other.access, touch.via, touch.access
                ));
            }
            self.check(command, touch)?;
        }
        let command: Arc<str> = command.into();
        let (writes, reads): (Vec<_>, Vec<_>) = touches.iter().partition(|touch| touch.access.writes());
        // Reads first: a write of the same command then stands for both.
        for touch in reads.into_iter().chain(writes) {
            self.record(&command, touch);
        }
        Ok(())
    }

    fn check(&self, command: &str, touch: &Touch<'_>) -> Result<(), String> {
        let Some(state) = self.resources.get(&touch.id) else {
            return Err(format!(
                "{command} uses {} as `{}`, which belongs to another device",
                touch.name, touch.via
            ));
        };
        if state.undefined && state.lent {
            return Err(format!(
                "{command} uses image {} as `{}` while it is with its host; add `rec.acquire(&image)` before, and `rec.release(&image)` after the last use",
                touch.name, touch.via
            ));
        }
        if state.undefined {
            return Err(format!(
                "{command} uses image {} as `{}` before anything gave it a layout; add `rec.discard(&image)` once before its first use",
                touch.name, touch.via
            ));
        }
        let ordered = |pending: &Pending| pending.ordered & touch.access.bit() != 0;
        // The latest first: its barrier may be all that is missing.
        let missing = state.pending.iter().enumerate().rev().find(|(i, pending)| {
            let writes = (pending.access.writes(), touch.access.writes());
            let through_readers = || {
                writes == (true, true)
                    && state.pending[i + 1..].iter().any(|reader| {
                        !reader.access.writes()
                            && ordered(reader)
                            && covers(&reader.range, &common(&pending.range, &touch.range))
                    })
            };
            overlap(&pending.range, &touch.range)
                && writes != (false, false)
                && !ordered(pending)
                && !through_readers()
        });
        missing.map(|(_, pending)| pending).map_or(Ok(()), |pending| {
            Err(format!(
                "{command} {} {} as `{}` while {} may still be {} it; add `rec.barrier(&[{:?}], &[{:?}])` between the two",
                if touch.access.writes() { "writes" } else { "reads" },
                touch.name,
                touch.via,
                pending.command,
                if pending.access.writes() { "writing" } else { "reading" },
                pending.access,
                touch.access
            ))
        })
    }

    fn record(&mut self, command: &Arc<str>, touch: &Touch<'_>) {
        let Some(state) = self.resources.get_mut(&touch.id) else { return };
        // What lies below a write has been ordered before it: who waits for the write waits for that. A read takes the place of
        // reads of its own kind only.
        let (before, kept): (Vec<_>, Vec<_>) = std::mem::take(&mut state.pending)
            .into_iter()
            .partition(|pending| touch.access.writes() || pending.access == touch.access);
        let parts = before.into_iter().flat_map(|pending| {
            let Range { start, end } = pending.range;
            let left = start..end.min(touch.range.start);
            let right = start.max(touch.range.end)..end;
            [left, right].map(|range| Pending { range, ..pending.clone() })
        });
        state.pending = parts.filter(|part| !part.range.is_empty()).chain(kept).collect();
        state.pending.push(Pending {
            range: touch.range.clone(),
            access: touch.access,
            ordered: 0,
            command: command.clone(),
        });
    }

    /// Notes that a copy, fill or update writes these bytes of a buffer, with numbers that can be dispatched or with others.
    pub fn words(&mut self, id: ResourceId, range: Range<u64>, dispatchable: bool) {
        let Some(state) = self.resources.get_mut(&id) else { return };
        state.worded = true;
        let mut joined = range.clone();
        let mut parts = Vec::new();
        for Range { start, end } in state.dispatchable.drain(..) {
            parts.extend(
                [start..end.min(range.start), start.max(range.end)..end]
                    .into_iter()
                    .filter(|part| !part.is_empty()),
            );
        }
        if dispatchable {
            let touch = |part: &Range<u64>| part.end == range.start || part.start == range.end;
            for part in parts.extract_if(.., |part| touch(part)) {
                joined = joined.start.min(part.start)..joined.end.max(part.end);
            }
            parts.push(joined);
        }
        state.dispatchable = parts;
    }

    /// Whether these bytes may be indirect arguments, as far as the program has written them; what shaders write is theirs to answer for.
    pub fn may_dispatch(&self, id: ResourceId, range: &Range<u64>) -> bool {
        self.resources.get(&id).is_some_and(|state| state.dispatchable.iter().any(|part| covers(part, range)))
    }

    /// Takes over what a recorder knows after its commands have run to the end: nothing is pending any more.
    pub fn commit_waited(&mut self, recorded: &Hazards) {
        for (id, state) in &mut self.resources {
            state.pending.clear();
            if let Some(recorded) = recorded.resources.get(id) {
                state.undefined &= recorded.undefined;
                if state.lent {
                    state.undefined = recorded.undefined;
                }
                // Another thread may have written them since this recording began.
                if recorded.worded {
                    state.dispatchable.clone_from(&recorded.dispatchable);
                }
            }
        }
    }

    /// Takes over what a recorder knows after its commands were handed to a host that will run them in recording order.
    pub fn commit_pending(&mut self, recorded: Hazards) {
        for (id, theirs) in recorded.resources {
            // A resource that is gone by now is no longer in `self`.
            if let Some(ours) = self.resources.get_mut(&id) {
                *ours = State { worded: false, ..theirs };
            }
        }
    }
}

fn overlap(a: &Range<u64>, b: &Range<u64>) -> bool {
    a.start < b.end && b.start < a.end
}

fn covers(outer: &Range<u64>, inner: &Range<u64>) -> bool {
    outer.start <= inner.start && inner.end <= outer.end
}

/// What two overlapping ranges have in common.
fn common(a: &Range<u64>, b: &Range<u64>) -> Range<u64> {
    a.start.max(b.start)..a.end.min(b.end)
}

/// Two bindings of one command that touch the same memory, one of them writing.
fn clash(a: &Touch<'_>, b: &Touch<'_>) -> bool {
    a.id == b.id && a.via != b.via && overlap(&a.range, &b.range) && (a.access.writes() || b.access.writes())
}

#[cfg(test)]
mod tests {
    use super::{Access::*, *};

    fn touch(access: Access) -> Touch<'static> {
        Touch { id: 1, name: "thing", via: "x", range: 0..16, access }
    }

    fn state() -> Hazards {
        let mut hazards = Hazards::default();
        hazards.add_buffer(1);
        hazards
    }

    /// Every pair of accesses of which one writes is refused without a barrier and accepted with it.
    #[test]
    fn a_barrier_must_name_both_accesses() {
        let all = [
            TransferRead,
            TransferWrite,
            StorageRead,
            StorageWrite,
            SampledRead,
            UniformRead,
            IndirectRead,
            GraphicsRead,
            AttachmentWrite,
            BuildRead,
            BuildWrite,
            QueryRead,
        ];
        for first in all {
            for second in all {
                let mut without = state();
                without.command("first", &[touch(first)]).unwrap();
                let mut with = without.clone();
                let mut wrong_way = without.clone();
                let result = without.command("second", &[touch(second)]);
                assert_eq!(
                    result.is_err(),
                    first.writes() || second.writes(),
                    "{first:?} {second:?}: {result:?}"
                );
                with.barrier(&[first], &[second]);
                with.command("second", &[touch(second)]).unwrap();
                if result.is_err() && first != second {
                    wrong_way.barrier(&[second], &[first]);
                    wrong_way.command("second", &[touch(second)]).unwrap_err();
                }
            }
        }
    }

    #[test]
    fn a_barrier_orders_only_what_was_recorded_before_it() {
        let mut h = state();
        h.barrier(&[StorageWrite], &[SampledRead]);
        h.command("first", &[touch(StorageWrite)]).unwrap();
        let message = h.command("second", &[touch(SampledRead)]).unwrap_err();
        assert!(message.contains("rec.barrier(&[StorageWrite], &[SampledRead])"), "{message}");
        assert!(
            message.contains("first") && message.contains("second") && message.contains("thing"),
            "{message}"
        );
    }

    #[test]
    fn a_write_stays_visible_to_later_barriers() {
        let mut h = state();
        h.command("produce", &[touch(StorageWrite)]).unwrap();
        h.barrier(&[StorageWrite], &[SampledRead]);
        h.command("sample", &[touch(SampledRead)]).unwrap();
        h.command("draw", &[touch(GraphicsRead)]).unwrap_err();
        h.barrier(&[StorageWrite], &[GraphicsRead]);
        h.command("draw", &[touch(GraphicsRead)]).unwrap();
    }

    #[test]
    fn a_second_read_must_be_ordered_before_a_write_again() {
        let mut h = state();
        h.command("a", &[touch(SampledRead)]).unwrap();
        h.barrier(&[SampledRead], &[StorageWrite]);
        h.command("b", &[touch(SampledRead)]).unwrap();
        h.command("c", &[touch(StorageWrite)]).unwrap_err();
    }

    #[test]
    fn in_place_work_needs_only_its_write_named() {
        let mut h = state();
        let in_place = [touch(StorageRead), touch(StorageWrite)];
        h.command("a", &in_place).unwrap();
        h.command("b", &in_place).unwrap_err();
        h.barrier(&[StorageWrite], &[StorageRead]);
        h.command("b", &in_place).unwrap_err();
        h.barrier(&[StorageWrite], &[StorageRead, StorageWrite]);
        h.command("b", &in_place).unwrap();
    }

    #[test]
    fn a_write_after_readers_names_the_readers_only_if_they_read_all_of_it() {
        let mut h = state();
        h.command("write", &[touch(TransferWrite)]).unwrap();
        h.barrier(&[TransferWrite], &[StorageRead]);
        let mut part = h.clone();
        h.command("read", &[touch(StorageRead)]).unwrap();
        h.barrier(&[StorageRead], &[StorageWrite]);
        h.command("write again", &[touch(StorageWrite)]).unwrap();
        part.command("read", &[Touch { range: 0..8, ..touch(StorageRead) }]).unwrap();
        part.barrier(&[StorageRead], &[StorageWrite]);
        part.command("write again", &[touch(StorageWrite)]).unwrap_err();
        part.command("write what was read", &[Touch { range: 2..6, ..touch(StorageWrite) }]).unwrap();
    }

    #[test]
    fn readers_from_before_a_write_do_not_order_it() {
        let mut h = state();
        h.command("read", &[touch(StorageRead)]).unwrap();
        h.barrier(&[StorageRead], &[StorageWrite, TransferWrite]);
        h.command("write part", &[Touch { range: 0..8, ..touch(TransferWrite) }]).unwrap();
        h.command("write part", &[Touch { range: 0..8, ..touch(StorageWrite) }]).unwrap_err();
    }

    #[test]
    fn disjoint_ranges_are_independent_and_partial_writes_keep_what_they_leave() {
        let at = |range: Range<u64>, access| Touch { range, ..touch(access) };
        let mut h = state();
        h.command("low", &[at(0..8, StorageWrite)]).unwrap();
        h.command("high", &[at(8..16, StorageWrite)]).unwrap();
        h.barrier(&[StorageWrite], &[TransferWrite]);
        h.command("patch", &[at(0..4, TransferWrite)]).unwrap();
        h.barrier(&[TransferWrite], &[SampledRead]);
        h.command("patched", &[at(0..4, SampledRead)]).unwrap();
        h.command("rest", &[at(4..8, SampledRead)]).unwrap_err();
    }

    #[test]
    fn one_command_cannot_read_and_write_the_same_memory_through_two_bindings() {
        let other = Touch { via: "y", ..touch(StorageWrite) };
        let message = state().command("a", &[touch(SampledRead), other.clone()]).unwrap_err();
        assert!(message.contains("`x`") && message.contains("`y`"), "{message}");
        state().command("a", &[touch(SampledRead), Touch { range: 16..32, ..other }]).unwrap();
    }

    #[test]
    fn a_resource_of_another_device_is_refused() {
        assert!(
            Hazards::default().command("a", &[touch(SampledRead)]).unwrap_err().contains("another device")
        );
    }

    #[test]
    fn an_image_is_unusable_until_discarded() {
        let mut h = Hazards::default();
        h.add_image(1);
        assert!(h.command("a", &[touch(StorageWrite)]).unwrap_err().contains("rec.discard"));
        h.discard(1);
        h.command("a", &[touch(StorageWrite)]).unwrap();
    }

    #[test]
    fn waiting_clears_and_handing_over_does_not() {
        let mut gpu = Hazards::default();
        gpu.add_image(1);
        let mut recorder = gpu.clone();
        recorder.discard(1);
        recorder.command("a", &[touch(StorageWrite)]).unwrap();
        let mut waited = gpu.clone();
        waited.commit_waited(&recorder);
        waited.command("b", &[touch(SampledRead)]).unwrap();
        gpu.commit_pending(recorder);
        gpu.command("b", &[touch(SampledRead)]).unwrap_err();
    }

    #[test]
    fn a_refused_command_leaves_no_trace() {
        let mut h = state();
        h.command("a", &[touch(StorageWrite)]).unwrap();
        h.command("b", &[touch(SampledRead)]).unwrap_err();
        h.barrier(&[StorageWrite], &[StorageWrite]);
        h.command("c", &[touch(StorageWrite)]).unwrap();
    }

    /// Two threads: one recording begins, another writes arguments and ends, the first ends.
    #[test]
    fn a_recording_that_began_earlier_forgets_nothing_of_another() {
        let mut gpu = state();
        gpu.add_buffer(2);
        let mut earlier = gpu.clone();
        let mut later = gpu.clone();
        later.words(1, 0..12, true);
        gpu.commit_waited(&later);
        assert!(gpu.may_dispatch(1, &(0..12)));
        earlier.words(2, 0..12, true);
        gpu.commit_waited(&earlier);
        assert!(gpu.may_dispatch(1, &(0..12)) && gpu.may_dispatch(2, &(0..12)));
        // What it wrote itself counts.
        let mut last = gpu.clone();
        last.words(1, 0..4, false);
        gpu.commit_waited(&last);
        assert!(!gpu.may_dispatch(1, &(0..12)));
        let mut pending = gpu.clone();
        pending.words(1, 0..12, true);
        gpu.commit_pending(pending);
        assert!(!gpu.clone().resources[&1].worded && gpu.may_dispatch(1, &(0..12)));
    }
}
