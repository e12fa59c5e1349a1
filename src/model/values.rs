//! The stored numbers of a volume, in the type the file has.

use std::io::{self, Read};

/// The data value that is farthest from 0 and still means something: the difference of any two must be a number of 32 bits. Files that
/// write the largest number for *no data* are beyond it.
pub const FARTHEST: f64 = (f32::MAX / 4.0) as f64;

/// Stored values, one a voxel, x fastest, in the file's own type: nothing is cut to fewer bits.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Unsigned, 8 bits.
    U8(Vec<u8>),
    /// Signed, 8 bits.
    I8(Vec<i8>),
    /// Unsigned, 16 bits.
    U16(Vec<u16>),
    /// Signed, 16 bits.
    I16(Vec<i16>),
    /// Unsigned, 32 bits.
    U32(Vec<u32>),
    /// Signed, 32 bits.
    I32(Vec<i32>),
    /// Unsigned, 64 bits; beyond 2⁵³ [`Values::get`] rounds.
    U64(Vec<u64>),
    /// Signed, 64 bits; beyond ±2⁵³ [`Values::get`] rounds.
    I64(Vec<i64>),
    /// IEEE 754, 32 bits.
    F32(Vec<f32>),
    /// IEEE 754, 64 bits.
    F64(Vec<f64>),
}

/// Runs one expression with `$v` bound to the typed vector.
macro_rules! each {
    ($values:expr, $v:ident => $body:expr) => {
        match $values {
            Values::U8($v) => $body,
            Values::I8($v) => $body,
            Values::U16($v) => $body,
            Values::I16($v) => $body,
            Values::U32($v) => $body,
            Values::I32($v) => $body,
            Values::U64($v) => $body,
            Values::I64($v) => $body,
            Values::F32($v) => $body,
            Values::F64($v) => $body,
        }
    };
}

impl Values {
    /// Number of values.
    pub fn len(&self) -> usize {
        each!(self, v => v.len())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Name of the type: `uint8`, `int8`, `uint16`, `int16`, `uint32`, `int32`, `uint64`, `int64`, `float32`, `float64`.
    pub fn kind(&self) -> &'static str {
        match self {
            Values::U8(_) => Kind::U8,
            Values::I8(_) => Kind::I8,
            Values::U16(_) => Kind::U16,
            Values::I16(_) => Kind::I16,
            Values::U32(_) => Kind::U32,
            Values::I32(_) => Kind::I32,
            Values::U64(_) => Kind::U64,
            Values::I64(_) => Kind::I64,
            Values::F32(_) => Kind::F32,
            Values::F64(_) => Kind::F64,
        }
        .name()
    }

    /// Stored value `i`. Panics when `i` is not below [`Values::len`], as a slice does.
    pub fn get(&self, i: usize) -> f64 {
        each!(self, v => v[i].to_f64())
    }

    /// Smallest and largest stored value; those that are NaN or infinite do not count, and `None` where there are no others.
    pub fn range(&self) -> Option<(f64, f64)> {
        each!(self, v => range(v))
    }

    /// Index of the first value that is NaN or infinite, and how many there are.
    pub fn non_finite(&self) -> Option<(usize, usize)> {
        each!(self, v => non_finite(v))
    }

    /// Sets every value that is NaN, infinite or farther from 0 than [`FARTHEST`] to `to`; returns how many there were. Integers never
    /// are.
    pub fn replace_no_numbers(&mut self, to: f64) -> usize {
        match self {
            Values::F32(v) => replace(v, |x| no_number(f64::from(x)), to as f32),
            Values::F64(v) => replace(v, no_number, to),
            _ => 0,
        }
    }

    /// Empty values of `kind` with room for `count`; `None` when the system has not the memory.
    pub fn with_capacity(kind: Kind, count: usize) -> Option<Values> {
        Some(match kind {
            Kind::U8 => Values::U8(room(count)?),
            Kind::I8 => Values::I8(room(count)?),
            Kind::U16 => Values::U16(room(count)?),
            Kind::I16 => Values::I16(room(count)?),
            Kind::U32 => Values::U32(room(count)?),
            Kind::I32 => Values::I32(room(count)?),
            Kind::U64 => Values::U64(room(count)?),
            Kind::I64 => Values::I64(room(count)?),
            Kind::F32 => Values::F32(room(count)?),
            Kind::F64 => Values::F64(room(count)?),
        })
    }

    /// Appends `count` values of binary data; returns the bytes that came, fewer than needed only at the end of `from`.
    pub fn append(&mut self, from: &mut dyn Read, count: usize, endian: Endian) -> io::Result<u64> {
        each!(self, v => append(v, from, count, endian))
    }

    /// Replaces the values by those at `places`; `false`, and nothing done, when the system has not the memory.
    pub(crate) fn gather(&mut self, places: impl Iterator<Item = usize>) -> bool {
        each!(self, v => gather(v, places))
    }

    /// Appends one value written as text; `false` when it is not a number of this type.
    pub fn append_text(&mut self, text: &str) -> bool {
        each!(self, v => text.parse().map(|x| v.push(x)).is_ok())
    }
}

/// Byte order of values of more than one byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Endian {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

impl Endian {
    /// From `little` or `big`, in any case.
    pub fn parse(name: &str) -> Option<Endian> {
        match name.to_ascii_lowercase().as_str() {
            "little" => Some(Endian::Little),
            "big" => Some(Endian::Big),
            _ => None,
        }
    }

    fn is_native(self) -> bool {
        (self == Endian::Little) == cfg!(target_endian = "little")
    }
}

/// Type of the stored values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Unsigned, 8 bits.
    U8,
    /// Signed, 8 bits.
    I8,
    /// Unsigned, 16 bits.
    U16,
    /// Signed, 16 bits.
    I16,
    /// Unsigned, 32 bits.
    U32,
    /// Signed, 32 bits.
    I32,
    /// Unsigned, 64 bits.
    U64,
    /// Signed, 64 bits.
    I64,
    /// IEEE 754, 32 bits.
    F32,
    /// IEEE 754, 64 bits.
    F64,
}

impl Kind {
    /// What an error may offer instead of an unknown type name.
    pub const EXPECTED: &str =
        "uint8, int8, uint16, int16, uint32, int32, uint64, int64, float (float32) or double (float64)";

    /// From any name that NRRD knows, and `u8` … `f64`, in any case.
    pub fn parse(name: &str) -> Option<Kind> {
        let words: Vec<&str> = name.split_whitespace().collect();
        Some(match words.join(" ").to_ascii_lowercase().as_str() {
            "signed char" | "int8" | "int8_t" | "i8" => Kind::I8,
            "uchar" | "unsigned char" | "uint8" | "uint8_t" | "u8" => Kind::U8,
            "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" | "i16" => {
                Kind::I16
            }
            "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" | "u16" => Kind::U16,
            "int" | "signed int" | "int32" | "int32_t" | "i32" => Kind::I32,
            "uint" | "unsigned int" | "uint32" | "uint32_t" | "u32" => Kind::U32,
            "longlong"
            | "long long"
            | "long long int"
            | "signed long long"
            | "signed long long int"
            | "int64"
            | "int64_t"
            | "i64" => Kind::I64,
            "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" | "u64" => {
                Kind::U64
            }
            "float" | "float32" | "f32" => Kind::F32,
            "double" | "float64" | "f64" => Kind::F64,
            _ => return None,
        })
    }

    /// Bytes of one value.
    pub fn bytes(self) -> usize {
        match self {
            Kind::U8 | Kind::I8 => 1,
            Kind::U16 | Kind::I16 => 2,
            Kind::U32 | Kind::I32 | Kind::F32 => 4,
            Kind::U64 | Kind::I64 | Kind::F64 => 8,
        }
    }

    /// Name as [`Values::kind`] gives it.
    pub fn name(self) -> &'static str {
        match self {
            Kind::U8 => "uint8",
            Kind::I8 => "int8",
            Kind::U16 => "uint16",
            Kind::I16 => "int16",
            Kind::U32 => "uint32",
            Kind::I32 => "int32",
            Kind::U64 => "uint64",
            Kind::I64 => "int64",
            Kind::F32 => "float32",
            Kind::F64 => "float64",
        }
    }
}

/// What the code above needs of a number type.
trait Sample: bytemuck::Pod + PartialOrd {
    fn to_f64(self) -> f64;
    fn finite(self) -> bool;
    fn swapped(self) -> Self;
}

macro_rules! sample {
    (integers: $($int:ty)*; floats: $($float:ty)*) => {
        $(impl Sample for $int {
            fn to_f64(self) -> f64 { self as f64 }
            fn finite(self) -> bool { true }
            fn swapped(self) -> Self { self.swap_bytes() }
        })*
        $(impl Sample for $float {
            fn to_f64(self) -> f64 { self as f64 }
            fn finite(self) -> bool { self.is_finite() }
            fn swapped(self) -> Self { <$float>::from_bits(self.to_bits().swap_bytes()) }
        })*
    };
}
sample!(integers: u8 i8 u16 i16 u32 i32 u64 i64; floats: f32 f64);

fn no_number(x: f64) -> bool {
    x.is_nan() || x.abs() > FARTHEST
}

fn replace<T: Copy>(values: &mut [T], is: impl Fn(T) -> bool, to: T) -> usize {
    values.iter_mut().filter(|v| is(**v)).map(|v| *v = to).count()
}

fn range<T: Sample>(values: &[T]) -> Option<(f64, f64)> {
    let first = *values.iter().find(|v| v.finite())?;
    let (low, high) = values.iter().filter(|v| v.finite()).fold((first, first), |(low, high), &v| {
        (if v < low { v } else { low }, if v > high { v } else { high })
    });
    Some((low.to_f64(), high.to_f64()))
}

fn non_finite<T: Sample>(values: &[T]) -> Option<(usize, usize)> {
    let count = values.iter().filter(|v| !v.finite()).count();
    let first = if count > 0 { values.iter().position(|v| !v.finite()) } else { None };
    first.map(|first| (first, count))
}

fn room<T>(count: usize) -> Option<Vec<T>> {
    let mut values = Vec::new();
    values.try_reserve_exact(count).ok()?;
    Some(values)
}

fn gather<T: Sample>(values: &mut Vec<T>, places: impl Iterator<Item = usize>) -> bool {
    let Some(mut gathered) = room(values.len()) else { return false };
    // From within, the three loops of the places are three loops.
    places.for_each(|place| gathered.push(values[place]));
    *values = gathered;
    true
}

/// Grows by a piece at a time, so that a header which promises too much costs no more memory than the data that came.
fn append<T: Sample>(
    values: &mut Vec<T>,
    from: &mut dyn Read,
    count: usize,
    endian: Endian,
) -> io::Result<u64> {
    const PIECE_BYTES: usize = 1 << 20;
    let piece = PIECE_BYTES / size_of::<T>();
    let mut total = 0;
    let mut left = count;
    while left > 0 {
        let now = left.min(piece);
        let start = values.len();
        values.resize(start + now, T::zeroed());
        let fresh = &mut values[start..];
        let got = read_up_to(from, bytemuck::cast_slice_mut(fresh))?;
        total += got as u64;
        if got < size_of_val(fresh) {
            return Ok(total);
        }
        if !endian.is_native() {
            fresh.iter_mut().for_each(|v| *v = v.swapped());
        }
        left -= now;
    }
    Ok(total)
}

/// Fills `buffer` as far as `from` goes.
fn read_up_to(from: &mut dyn Read, buffer: &mut [u8]) -> io::Result<usize> {
    let mut got = 0;
    while got < buffer.len() {
        match from.read(&mut buffer[got..]) {
            Ok(0) => break,
            Ok(n) => got += n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(got)
}
