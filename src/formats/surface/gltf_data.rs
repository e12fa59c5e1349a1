//! What lies behind the JSON of a glTF file: buffers, the numbers of accessors, images.
//!
//! Read by our own few lines: every offset is added and compared before anything is read or asked for, and whole numbers stand for shares of
//! 1 where they are said to. Buffers of all files together have at most [`MOST_BYTES`].

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use crate::{Error, Result, file};
use cao_model::error::quoted;
use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{Index, Root, buffer};

/// Most bytes of all buffers.
const MOST_BYTES: u64 = 1 << 30;

/// Most bytes of an accessor that has no buffer.
const MOST_ZEROS: usize = 1 << 20;

/// A document and its buffers.
pub(super) struct Data<'a> {
    pub(super) path: &'a Path,
    pub(super) root: &'a Root,
    buffers: Vec<Cow<'a, [u8]>>,
}

/// Where a URI leads.
pub(super) enum Source {
    Bytes(Vec<u8>),
    File(PathBuf),
}

/// Numbers of an accessor as they are stored, tightly.
struct Packed {
    bytes: Vec<u8>,
    component: ComponentType,
    components: usize,
}

impl<'a> Data<'a> {
    /// Reads the buffers; `inside` is that of a binary file.
    pub(super) fn new(path: &'a Path, root: &'a Root, inside: Option<&'a [u8]>) -> Result<Self> {
        let mut data = Self { path, root, buffers: Vec::new() };
        let mut left = MOST_BYTES;
        for (number, buffer) in root.buffers.iter().enumerate() {
            let field = format!("buffer {number}");
            let bytes: Cow<[u8]> = match (&buffer.uri, inside) {
                (None, Some(inside)) if number == 0 => inside.into(),
                (None, _) => return Err(data.wrong(&field, "has no uri, and the file no binary part for it")),
                (Some(uri), _) => match source(path, uri).map_err(|problem| data.wrong(&field, problem))? {
                    Source::Bytes(bytes) => bytes.into(),
                    Source::File(path) => file::read_bytes(&path, left)?.into(),
                },
            };
            let (there, needed) = (bytes.len() as u64, buffer.byte_length.0);
            if there < needed {
                return Err(data.wrong(&field, format!("of {needed} bytes, but there are {there}")));
            }
            left = left.checked_sub(there).ok_or_else(|| {
                data.wrong(&field, format!("more than {MOST_BYTES} bytes in all buffers; split the file"))
            })?;
            data.buffers.push(bytes);
        }
        Ok(data)
    }

    pub(super) fn wrong(&self, field: &str, problem: impl Into<String>) -> Error {
        Error::file(self.path, field, problem)
    }

    /// Numbers of an accessor, so many at a place.
    pub(super) fn numbers<const N: usize>(&self, index: Index<Accessor>) -> Result<Vec<[f32; N]>> {
        let field = format!("accessor {}", index.value());
        let packed = self.packed(index)?;
        if packed.components != N {
            let found = packed.components;
            return Err(self.wrong(&field, format!("has {found} numbers at a place, expected {N}")));
        }
        let normalized = self.root.get(index).is_some_and(|accessor| accessor.normalized);
        let size = packed.component.size();
        let number = |bytes: &[u8]| number(packed.component, normalized, bytes);
        let place = |bytes: &[u8]| std::array::from_fn(|i| number(&bytes[i * size..(i + 1) * size]));
        Ok(packed.bytes.chunks_exact(N * size).map(place).collect())
    }

    /// Indices of an accessor.
    pub(super) fn indices(&self, index: Index<Accessor>) -> Result<Vec<u32>> {
        let Packed { bytes, component, components } = self.packed(index)?;
        match (component, components) {
            (ComponentType::U8, 1) => Ok(bytes.iter().map(|&b| b.into()).collect()),
            (ComponentType::U16, 1) => {
                Ok(bytes.as_chunks().0.iter().map(|b| u16::from_le_bytes(*b).into()).collect())
            }
            (ComponentType::U32, 1) => {
                Ok(bytes.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b)).collect())
            }
            _ => Err(self
                .wrong(&format!("accessor {}", index.value()), "expected indices: single numbers, unsigned")),
        }
    }

    /// The image in a view of a buffer.
    pub(super) fn view(&self, index: Index<buffer::View>) -> Result<&[u8]> {
        let field = format!("bufferView {}", index.value());
        let there = || self.wrong(&field, "reaches beyond its buffer");
        let view = self.root.get(index).ok_or_else(|| self.wrong(&field, "is not there"))?;
        let buffer = self.buffers.get(view.buffer.value()).ok_or_else(there)?;
        let begin = usize::try_from(view.byte_offset.map_or(0, |offset| offset.0)).map_err(|_| there())?;
        let length = usize::try_from(view.byte_length.0).map_err(|_| there())?;
        let end = begin.checked_add(length).ok_or_else(there)?;
        buffer.get(begin..end).ok_or_else(there)
    }

    /// `count` elements of `size` bytes of a view, which are `stride` apart.
    fn elements(
        &self,
        field: &str,
        bytes: &[u8],
        offset: u64,
        count: usize,
        size: usize,
        stride: usize,
    ) -> Result<Vec<u8>> {
        let beyond = || self.wrong(field, "reaches beyond its bufferView");
        let bytes = usize::try_from(offset).ok().and_then(|offset| bytes.get(offset..)).ok_or_else(beyond)?;
        if count == 0 {
            return Ok(Vec::new());
        }
        let needed = (count - 1).checked_mul(stride).and_then(|last| last.checked_add(size));
        if needed.is_none_or(|needed| needed > bytes.len()) {
            return Err(beyond());
        }
        Ok((0..count).flat_map(|i| &bytes[i * stride..i * stride + size]).copied().collect())
    }

    fn packed(&self, index: Index<Accessor>) -> Result<Packed> {
        let field = format!("accessor {}", index.value());
        let wrong = |problem: &str| self.wrong(&field, problem);
        let accessor = self.root.get(index).ok_or_else(|| wrong("is not there"))?;
        let (Checked::Valid(component), Checked::Valid(kind)) = (&accessor.component_type, &accessor.type_)
        else {
            return Err(wrong("is of no type that there is"));
        };
        let (component, components) = (component.0, kind.multiplicity());
        if matches!(kind, Type::Mat2 | Type::Mat3 | Type::Mat4) {
            return Err(wrong("has matrices, expected numbers or vectors"));
        }
        let size = component.size() * components;
        let count = usize::try_from(accessor.count.0).map_err(|_| wrong("has too many places"))?;
        let mut bytes = match accessor.buffer_view {
            Some(view) => {
                let stride =
                    self.root.get(view).and_then(|view| view.byte_stride).map_or(size, |stride| stride.0);
                let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
                self.elements(&field, self.view(view)?, offset, count, size, stride)?
            }
            // Zeros, for which nothing stands: memory follows the file nevertheless.
            None => match count.checked_mul(size).filter(|bytes| *bytes <= MOST_ZEROS) {
                Some(bytes) => vec![0; bytes],
                None => {
                    return Err(wrong(
                        "has no bufferView and too many places; expected one, or at most 1 MiB",
                    ));
                }
            },
        };
        if let Some(sparse) = &accessor.sparse {
            let count = usize::try_from(sparse.count.0).map_err(|_| wrong("has too many sparse places"))?;
            let Checked::Valid(kind) = &sparse.indices.component_type else {
                return Err(wrong("has sparse indices of no type that there is"));
            };
            let (at, width) = (&sparse.indices, kind.0.size());
            let places =
                self.elements(&field, self.view(at.buffer_view)?, at.byte_offset.0, count, width, width)?;
            let from = &sparse.values;
            let values =
                self.elements(&field, self.view(from.buffer_view)?, from.byte_offset.0, count, size, size)?;
            for (place, value) in places.chunks_exact(width).zip(values.chunks_exact(size)) {
                let place = place.iter().rev().fold(0, |sum, byte| sum << 8 | usize::from(*byte));
                let slot = place.checked_mul(size).and_then(|at| bytes.get_mut(at..at + size));
                slot.ok_or_else(|| wrong("puts a sparse value where there is no place"))?
                    .copy_from_slice(value);
            }
        }
        Ok(Packed { bytes, component, components })
    }
}

/// A stored number; a share of 1 where it is normalized (glTF 2.0 §3.6.2.2).
fn number(component: ComponentType, normalized: bool, bytes: &[u8]) -> f32 {
    let word = bytes.iter().rev().fold(0, |sum: u32, byte| sum << 8 | u32::from(*byte));
    let (value, most) = match component {
        ComponentType::F32 => return f32::from_bits(word),
        ComponentType::I8 => (f32::from(word as u8 as i8), f32::from(i8::MAX)),
        ComponentType::U8 => (f32::from(word as u8), f32::from(u8::MAX)),
        ComponentType::I16 => (f32::from(word as u16 as i16), f32::from(i16::MAX)),
        ComponentType::U16 => (f32::from(word as u16), f32::from(u16::MAX)),
        ComponentType::U32 => (word as f32, u32::MAX as f32),
    };
    if normalized { (value / most).max(-1.0) } else { value }
}

/// What a URI of this file stands for. The error says why it stands for nothing that is read.
pub(super) fn source(path: &Path, uri: &str) -> Result<Source, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let coded =
            data.split_once(";base64,").ok_or_else(|| format!("{}: data that is not base64", quoted(uri)))?.1;
        let bytes = base64(coded).ok_or_else(|| format!("{}: damaged base64", quoted(uri)))?;
        return Ok(Source::Bytes(bytes));
    }
    if uri.split_once(':').is_some_and(|(scheme, _)| scheme.len() > 1) {
        return Err(format!("{}: nothing is fetched; expected a file beside this one", quoted(uri)));
    }
    let name =
        unescaped(uri).ok_or_else(|| format!("{}: expected %XX, XX two hexadecimal digits", quoted(uri)))?;
    Ok(Source::File(path.parent().unwrap_or(Path::new("")).join(name)))
}

/// A URI's path with the characters that `%XX` stand for.
fn unescaped(uri: &str) -> Option<String> {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        rest = after;
        bytes.push(match byte {
            b'%' => {
                let (digits, after) = rest.split_at_checked(2)?;
                rest = after;
                digits
                    .iter()
                    .try_fold(0, |sum, digit| Some(sum << 4 | (*digit as char).to_digit(16)? as u8))?
            }
            other => other,
        });
    }
    String::from_utf8(bytes).ok()
}

/// What RFC 4648 base64 stands for.
fn base64(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0, 0_u32);
    for letter in text.trim_end_matches('=').bytes() {
        let value = match letter {
            b'A'..=b'Z' => letter - b'A',
            b'a'..=b'z' => letter - b'a' + 26,
            b'0'..=b'9' => letter - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        held = held << 6 | u32::from(value);
        bits += 6;
        if bits >= 8 {
            bits -= 8;
            bytes.push((held >> bits) as u8);
            held &= (1 << bits) - 1;
        }
    }
    Some(bytes)
}
