//! Handles: numbers for what lives here. The upper eight bits are the kind, the others count and never repeat, so that any number, from a host
//! that is wrong in any way, is either alive, or was, or never was. One look-up in a map a handle and call.

#![forbid(unsafe_code)]

use crate::error::{CaoResult, Result, refuse};
use std::any::Any;
use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};

/// What C holds of an object.
pub(crate) trait Handle: Copy {
    /// The object.
    type Object: Any + Send + Sync;
    /// Its name in messages.
    const NAME: &'static str;
    /// Upper bits.
    const KIND: u8;
    fn of(id: u64) -> Self;
    fn id(self) -> u64;
}

/// The kinds, to name them.
const NAMES: [&str; 7] = ["nothing", "device", "volume", "mesh", "renderer", "image", "recording"];
const SHIFT: u32 = 56;

/// Makes a struct a handle.
macro_rules! handle {
    ($handle:ident, $kind:literal, $name:literal, $object:ty) => {
        impl crate::handle::Handle for $handle {
            type Object = $object;
            const NAME: &'static str = $name;
            const KIND: u8 = $kind;
            fn of(id: u64) -> Self {
                Self { id }
            }
            fn id(self) -> u64 {
                self.id
            }
        }
    };
}
pub(crate) use handle;

struct Live {
    object: Arc<dyn Any + Send + Sync>,
    /// Id of the device that it is on, or 0.
    device: u64,
}

#[derive(Default)]
struct Table {
    live: HashMap<u64, Live>,
    /// How many ids were given out.
    given: u64,
}

static TABLE: LazyLock<Mutex<Table>> = LazyLock::new(Mutex::default);

fn table() -> MutexGuard<'static, Table> {
    TABLE.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Table {
    /// An object that is alive, or why there is none.
    fn find<H: Handle>(&self, handle: H) -> Result<Arc<H::Object>> {
        let (id, name) = (handle.id(), H::NAME);
        let (kind, number) = ((id >> SHIFT) as usize, id & ((1 << SHIFT) - 1));
        if id == 0 {
            return refuse(CaoResult::BadHandle, format!("{name}: the handle is 0, which is none"));
        }
        if number == 0 || number > self.given || kind == 0 || kind >= NAMES.len() {
            let what = format!("{name}: {id:#x} is no handle that this library gave out");
            return refuse(CaoResult::BadHandle, what);
        }
        if kind != usize::from(H::KIND) {
            let what = format!("{name}: the handle is of a {}, expected one of a {name}", NAMES[kind]);
            return refuse(CaoResult::BadHandle, what);
        }
        match self.live.get(&id).map(|live| live.object.clone().downcast()) {
            Some(Ok(object)) => Ok(object),
            _ => refuse(CaoResult::Freed, format!("{name}: the handle is of one that was freed")),
        }
    }
}

/// Takes an object in, on a device or on none.
pub(crate) fn insert<H: Handle>(object: H::Object, device: u64) -> H {
    let mut table = table();
    table.given += 1;
    let id = u64::from(H::KIND) << SHIFT | table.given;
    table.live.insert(id, Live { object: Arc::new(object), device });
    H::of(id)
}

/// The object, which stays alive as long as the caller holds it.
pub(crate) fn get<H: Handle>(handle: H) -> Result<Arc<H::Object>> {
    table().find(handle)
}

/// Takes an object out, if nobody else holds it and nothing is on it. It is dropped after the table is unlocked.
pub(crate) fn free<H: Handle>(handle: H) -> Result {
    let mut table = table();
    let object = table.find(handle)?;
    let children = table.live.iter().filter(|(_, live)| live.device == handle.id());
    let mut kinds = [0usize; NAMES.len()];
    children.for_each(|(id, _)| kinds[(id >> SHIFT) as usize] += 1);
    let held: Vec<_> = kinds.iter().zip(NAMES).filter(|(count, _)| **count > 0).collect();
    if !held.is_empty() {
        let list: Vec<_> = held.iter().map(|(count, name)| format!("{count} × {name}")).collect();
        let what = format!("{}: in use by {}; free them first", H::NAME, list.join(", "));
        return refuse(CaoResult::InUse, what);
    }
    // The table's and ours. Others are taken under the lock only.
    if Arc::strong_count(&object) > 2 {
        let what = format!("{}: in use by a recording, or by a call of another thread", H::NAME);
        return refuse(CaoResult::InUse, what);
    }
    let taken = table.live.remove(&handle.id());
    if table.live.is_empty() {
        // A host that has freed everything leaves nothing, not even room for more.
        table.live = HashMap::new();
    }
    drop(table);
    drop((object, taken));
    Ok(())
}
