//! What comes from C as pointers, sizes and numbers, checked before it is used.

use crate::error::{CaoResult, Result, refuse};
use std::ffi::{CStr, c_char};

/// A struct of the header that begins with its size, `u32`.
///
/// # Safety
/// The first field is a `u32`, and every pattern of bits is a value.
pub(crate) unsafe trait Versioned: Copy {
    /// Its name in the header.
    const NAME: &'static str;
}

/// Makes a struct one.
macro_rules! versioned {
    ($name:ident) => {
        // SAFETY: `#[repr(C)]`, the size first, numbers and pointers alone.
        unsafe impl crate::edge::Versioned for $name {
            const NAME: &'static str = stringify!($name);
        }
    };
}
pub(crate) use versioned;

pub(crate) fn placed<T>(what: &str, pointer: *const T) -> Result {
    if pointer.is_null() {
        return refuse(CaoResult::NullPointer, format!("{what}: is NULL"));
    }
    if !pointer.is_aligned() {
        let problem = format!("{what}: is at {pointer:p}, expected a multiple of {}", align_of::<T>());
        return refuse(CaoResult::BadValue, problem);
    }
    Ok(())
}

/// Checks a struct by the size that it says, and looks at nothing else.
///
/// # Safety
/// The pointer is NULL or points to as many bytes as the struct says that it has, and to four at least.
pub(crate) unsafe fn sized<T: Versioned>(pointer: *const T) -> Result {
    placed(T::NAME, pointer)?;
    // SAFETY: by the caller's promise there are four bytes, which the trait says are a number.
    let size = unsafe { pointer.cast::<u32>().read() };
    if size as usize != size_of::<T>() {
        let (name, known) = (T::NAME, size_of::<T>());
        let what = format!("{name}.size is {size}, this library knows {known}; set it to sizeof({name})");
        return refuse(CaoResult::WrongSize, what);
    }
    Ok(())
}

/// A struct, by the size that it says.
///
/// # Safety
/// As [`sized`].
pub(crate) unsafe fn read<T: Versioned>(pointer: *const T) -> Result<T> {
    // SAFETY: the caller's promise.
    unsafe { sized(pointer) }?;
    // SAFETY: as many bytes as it says, aligned, and every pattern is a value.
    Ok(unsafe { pointer.read() })
}

/// An array of such structs, of at most `most`.
///
/// # Safety
/// The pointer points to as many structs, each as [`read`] asks.
pub(crate) unsafe fn read_all<T: Versioned>(pointer: *const T, count: u32, most: usize) -> Result<Vec<T>> {
    if count as usize > most {
        let what = format!("{}: {count} of them; expected at most {most}", T::NAME);
        return refuse(CaoResult::Limit, what);
    }
    // SAFETY: the caller's promise, for one after the other; the first that has another size ends it.
    (0..count as usize).map(|i| unsafe { read(pointer.wrapping_add(i)) }).collect()
}

/// An array of numbers; of none it may be NULL.
///
/// # Safety
/// The pointer points to as many numbers, which stay as they are until the function of the header returns.
pub(crate) unsafe fn numbers<'a, T: Copy>(what: &str, pointer: *const T, count: u64) -> Result<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    placed(what, pointer)?;
    let bytes = count.checked_mul(size_of::<T>() as u64).filter(|bytes| *bytes <= isize::MAX as u64);
    if bytes.is_none() {
        return refuse(CaoResult::Limit, format!("{what}: {count} of them are more than any memory holds"));
    }
    // SAFETY: not null, aligned, no larger than an object can be; the rest is the caller's promise.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count as usize) })
}

/// Text.
///
/// # Safety
/// The pointer is NULL or points to text that a zero ends and that stays as it is until the function of the header returns.
pub(crate) unsafe fn text<'a>(what: &str, pointer: *const c_char) -> Result<&'a str> {
    placed(what, pointer)?;
    // SAFETY: the caller's promise.
    match unsafe { CStr::from_ptr(pointer) }.to_str() {
        Ok(text) => Ok(text),
        Err(_) => refuse(CaoResult::BadValue, format!("{what}: is not UTF-8")),
    }
}

/// As many texts, of at most `most`.
///
/// # Safety
/// The pointer points to as many pointers, each as [`text`] asks.
pub(crate) unsafe fn texts<'a>(
    what: &str,
    pointer: *const *const c_char,
    count: u32,
    most: usize,
) -> Result<Vec<&'a str>> {
    if count as usize > most {
        return refuse(CaoResult::Limit, format!("{what}: {count} of them; expected at most {most}"));
    }
    // SAFETY: the caller's promise.
    let all = unsafe { numbers(what, pointer, count.into()) }?;
    // SAFETY: as above, of each.
    all.iter().map(|one| unsafe { text(what, *one) }).collect()
}

/// Where an answer goes: refuses NULL before anything is done, and writes the answer, on failure `none`.
///
/// # Safety
/// The pointer is NULL or may be written.
pub(crate) unsafe fn answer<T: Copy>(to: *mut T, none: T, make: impl FnOnce() -> Result<T>) -> Result {
    placed("answer", to)?;
    // SAFETY: not null and aligned; the rest is the caller's promise.
    unsafe { to.write(none) };
    let made = make()?;
    // SAFETY: as above.
    unsafe { to.write(made) };
    Ok(())
}

/// The value of an enum.
pub(crate) fn one_of<T: Copy>(what: &str, number: u32, all: &[T]) -> Result<T> {
    match all.get(number as usize) {
        Some(value) => Ok(*value),
        None => refuse(CaoResult::BadValue, format!("{what}: {number}; expected 0 … {}", all.len() - 1)),
    }
}
