//! Numbers at places of a binary header, whose bytes stand in either order.

use cao_model::values::Endian;

/// Bytes in little-endian order.
pub(crate) fn ordered<const N: usize>(mut bytes: [u8; N], endian: Endian) -> [u8; N] {
    if endian == Endian::Big {
        bytes.reverse();
    }
    bytes
}

/// A header of bytes in this order. Offsets are those of its format, within the length that was checked when it was made.
pub(crate) struct Binary<B> {
    pub(crate) bytes: B,
    pub(crate) endian: Endian,
}

impl<B: AsRef<[u8]>> Binary<B> {
    /// Bytes at an offset in little-endian order.
    pub(crate) fn at<const N: usize>(&self, offset: usize) -> [u8; N] {
        let bytes = self.bytes.as_ref();
        ordered(std::array::from_fn(|i| bytes[offset + i]), self.endian)
    }

    pub(crate) fn i16(&self, offset: usize) -> i64 {
        i16::from_le_bytes(self.at(offset)).into()
    }

    pub(crate) fn i32(&self, offset: usize) -> i64 {
        i32::from_le_bytes(self.at(offset)).into()
    }

    pub(crate) fn f32(&self, offset: usize) -> f64 {
        f32::from_le_bytes(self.at(offset)).into()
    }
}
