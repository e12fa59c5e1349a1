//! Results: a code from every function, a message for each thread, a callback for all; and where panics end.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::ffi::{CString, c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};

/// What a function answers. Where it is not CAO_RESULT_OK nothing was done, what it would have given is 0, and cao_last_error says why.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaoResult {
    /// Done.
    Ok = 0,
    /// A pointer is NULL that must not be.
    NullPointer = 1,
    /// A handle that this library never gave out, or of something else.
    BadHandle = 2,
    /// A handle of what was freed.
    Freed = 3,
    /// Another thread is in a call with the same renderer or recording. Try again.
    Busy = 4,
    /// It is needed still: a device by what is on it, an image by recordings, anything by a call of another thread. Free those first.
    InUse = 5,
    /// Not now: a recording that has ended, or not, or failed; an ambient volume that is out of date; an image that is not acquired.
    WrongOrder = 6,
    /// A struct's size is none that this library knows, or a number of bytes is not what the format asks for.
    WrongSize = 7,
    /// A value that cannot be: a number beyond an enum, dimensions of 0, a scale below 0, a mesh with a hole.
    BadValue = 8,
    /// Beyond a limit of the device or of the library.
    Limit = 9,
    /// The device lacks something, or was made without it.
    Device = 10,
    /// A call of Vulkan failed, perhaps because the device is lost.
    Vulkan = 11,
    /// Memory of the processor or of the device could not be had.
    OutOfMemory = 12,
    /// The device has not finished yet.
    NotReady = 13,
    /// A fault of this library, caught at its edge. What the call worked on is to be freed.
    Internal = 14,
}

/// Why a call was refused.
#[derive(Debug)]
pub(crate) struct Failure {
    pub code: CaoResult,
    pub message: String,
}

pub(crate) type Result<T = (), E = Failure> = std::result::Result<T, E>;

pub(crate) fn refuse<T>(code: CaoResult, message: impl Into<String>) -> Result<T> {
    Err(Failure { code, message: message.into() })
}

impl From<cao_model::Error> for Failure {
    fn from(error: cao_model::Error) -> Self {
        let code = match error {
            cao_model::Error::Limit { .. } => CaoResult::Limit,
            // How the renderer refuses to show what it has not updated.
            cao_model::Error::Config { ref what, .. } if what == "ambient volume" => CaoResult::WrongOrder,
            _ => CaoResult::BadValue,
        };
        Self { code, message: error.to_string() }
    }
}

impl From<cao_gpu::Error> for Failure {
    fn from(error: cao_gpu::Error) -> Self {
        let code = match error {
            cao_gpu::Error::Limit { .. } => CaoResult::Limit,
            cao_gpu::Error::Device { .. } => CaoResult::Device,
            cao_gpu::Error::Memory { .. } => CaoResult::OutOfMemory,
            cao_gpu::Error::Vulkan { .. } => CaoResult::Vulkan,
            // Ours are in place; what a host can leave out is to acquire an image.
            cao_gpu::Error::Hazard { .. } => CaoResult::WrongOrder,
            _ => CaoResult::BadValue,
        };
        Self { code, message: error.to_string() }
    }
}

impl From<cao::Error> for Failure {
    fn from(error: cao::Error) -> Self {
        match error {
            cao::Error::Model(error) => error.into(),
            cao::Error::Gpu(error) => error.into(),
            error => Self { code: CaoResult::BadValue, message: error.to_string() },
        }
    }
}

/// Hears of every failure, on the thread of the call that fails, before it returns. It may call this library; failures in there are not
/// told again. Nothing may be thrown out of it.
pub type CaoErrorCallback =
    Option<unsafe extern "C" fn(result: CaoResult, message: *const c_char, user: *mut c_void)>;

/// The callback and what it is given.
struct Listener(CaoErrorCallback, *mut c_void);

// SAFETY: the pointer is only handed back to the host, who says in `cao_set_error_callback` that any thread may have it.
unsafe impl Send for Listener {}

static LISTENER: Mutex<Listener> = Mutex::new(Listener(None, std::ptr::null_mut()));

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
    static TELLING: Cell<bool> = const { Cell::new(false) };
}

/// Runs what a function does. Neither panics nor errors pass.
pub(crate) fn guard(body: impl FnOnce() -> Result) -> CaoResult {
    // What a panic leaves half done is marked by its owner: the renderer, the recording.
    let failure = match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => return CaoResult::Ok,
        Ok(Err(failure)) => failure,
        Err(panic) => Failure { code: CaoResult::Internal, message: said(&*panic) },
    };
    let told = catch_unwind(AssertUnwindSafe(|| tell(&failure)));
    told.map_or(CaoResult::Internal, |()| failure.code)
}

fn said(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without words");
    format!("a fault of this library: {text}")
}

fn tell(failure: &Failure) {
    let message = CString::new(failure.message.replace('\0', " ")).unwrap_or_default();
    let remember = || LAST.try_with(|last| *last.borrow_mut() = message.clone()).unwrap_or_default();
    remember();
    let Listener(callback, user) = *LISTENER.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(callback) = callback else { return };
    // A thread that is ending has no such word any more, and tells nothing.
    if TELLING.try_with(|telling| telling.replace(true)).unwrap_or(true) {
        return;
    }
    // SAFETY: the host's function, as `cao_set_error_callback` asks; the message lives until it returns. No lock is held.
    unsafe { callback(failure.code, message.as_ptr(), user) };
    let _ = TELLING.try_with(|telling| telling.set(false));
    remember();
}

/// Why this thread's last call that failed did so, in UTF-8; empty before any. Alive until this thread's next call that fails; copy it.
// SAFETY: the name is ours alone.
#[unsafe(no_mangle)]
pub extern "C" fn cao_last_error() -> *const c_char {
    LAST.try_with(|last| last.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}

/// Has every failure of any thread told, or with NULL none. A thread that is failing may still call the former one for a moment.
/// `user` is handed to it as it is; any thread may have it.
// SAFETY: the name is ours alone; what the callback must be is said with its type.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_set_error_callback(callback: CaoErrorCallback, user: *mut c_void) -> CaoResult {
    guard(|| {
        *LISTENER.lock().unwrap_or_else(PoisonError::into_inner) = Listener(callback, user);
        Ok(())
    })
}
