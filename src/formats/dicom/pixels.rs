//! Stored values of the frames of one file, whatever the transfer syntax (PS3.5 §8, annexes A and G).

use std::io::{Cursor, SeekFrom};

use super::data_set::{self, Source};
use super::fragments::{self, Piece};
use super::image::{Image, Sample};
use crate::volume::bad;
use crate::{Error, Result};
use cao_model::values::{Endian, Kind, Values};

/// How the frames are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Codec {
    /// Not at all.
    Native,
    RunLengths,
    Jpeg,
    JpegLs,
    Jpeg2000,
}

/// By the UID of the transfer syntax, with the name that the standard gives it.
fn codec(uid: &str) -> Result<Codec, String> {
    let name = match uid.strip_prefix("1.2.840.10008.1.2") {
        // Files without file meta information.
        None if uid.is_empty() => return Ok(Codec::Native),
        Some("" | ".1" | ".2" | ".1.98" | ".1.99") => return Ok(Codec::Native),
        Some(".5") => return Ok(Codec::RunLengths),
        Some(".4.50" | ".4.51" | ".4.57" | ".4.70") => return Ok(Codec::Jpeg),
        Some(".4.80" | ".4.81") => return Ok(Codec::JpegLs),
        Some(".4.90" | ".4.91") => return Ok(Codec::Jpeg2000),
        Some(".4.92" | ".4.93") => "JPEG 2000 part 2",
        Some(".4.94" | ".4.95" | ".4.204" | ".4.205") => "JPIP, pixels elsewhere",
        Some(".4.100" | ".4.101" | ".4.102" | ".4.103" | ".4.104" | ".4.105" | ".4.106") => "MPEG video",
        Some(".4.107" | ".4.108") => "HEVC video",
        Some(".4.110" | ".4.111" | ".4.112") => "JPEG XL",
        Some(".4.201" | ".4.202" | ".4.203") => "High-Throughput JPEG 2000",
        _ => "unknown",
    };
    Err(format!("{uid} ({name}), {EXPECTED}"))
}

/// Transfer syntaxes whose values may differ from those that were compressed.
const LOSSY: [&str; 4] =
    ["1.2.840.10008.1.2.4.50", "1.2.840.10008.1.2.4.51", "1.2.840.10008.1.2.4.81", "1.2.840.10008.1.2.4.91"];

const EXPECTED: &str = "expected uncompressed, deflated, RLE, JPEG (baseline, lossless), JPEG-LS or JPEG 2000; gdcmconv --raw converts";

/// A frame of up to this many bytes may be as blank as it likes; a larger one does not expand more than
/// [`MAX_RATIO`] times.
const SMALL_FRAME: u64 = 64 << 20;
pub(super) const MAX_RATIO: u64 = 1000;

impl Image {
    /// Voxels of a frame.
    pub(super) fn frame_len(&self) -> usize {
        self.columns * self.rows
    }

    /// Bytes of a frame as they come out of a decoder.
    fn frame_bytes(&self) -> u64 {
        let bytes = match self.sample {
            Sample::Integer { allocated, .. } => u64::from(allocated / 8),
            Sample::Float => 4,
            Sample::Double => 8,
        };
        self.frame_len() as u64 * bytes
    }

    /// The type of stored values.
    pub(super) fn kind(&self) -> Kind {
        match self.sample {
            Sample::Float => Kind::F32,
            Sample::Double => Kind::F64,
            Sample::Integer { allocated: 8, signed: false, .. } => Kind::U8,
            Sample::Integer { allocated: 8, .. } => Kind::I8,
            Sample::Integer { allocated: 16, signed: false, .. } => Kind::U16,
            Sample::Integer { allocated: 16, .. } => Kind::I16,
            Sample::Integer { signed: false, .. } => Kind::U32,
            Sample::Integer { .. } => Kind::I32,
        }
    }
}

/// The frames of one file, where they lie in it.
pub(super) struct Frames<'a> {
    image: &'a Image,
    source: Box<dyn Source>,
    codec: Codec,
    pieces: Vec<Vec<Piece>>,
}

impl<'a> Frames<'a> {
    /// Finds them. Before anything is decoded, the bytes that are there must make the promised size possible.
    pub(super) fn open(image: &'a Image) -> Result<Self> {
        let codec = codec(&image.syntax).map_err(|problem| bad(&image.path, "TransferSyntaxUID", problem))?;
        let (mut source, end) = data_set::source(&image.path)?;
        let wrong = |problem: String| bad(&image.path, "PixelData", problem);
        let (count, each) = (image.frames.len() as u64, image.frame_bytes());
        let pieces = match (image.pixels.length, codec) {
            (Some(length), Codec::Native) => {
                let have = length.min(end.saturating_sub(image.pixels.start));
                // What follows the last frame is padding.
                let need = count.checked_mul(each).filter(|need| *need <= have);
                if need.is_none() {
                    let problem = format!(
                        "{have} bytes, expected {} or more ({count} frames of {} × {} values of type {})",
                        count.saturating_mul(each),
                        image.columns,
                        image.rows,
                        image.kind().name()
                    );
                    return Err(wrong(problem));
                }
                (0..count).map(|i| vec![(image.pixels.start + i * each, each)]).collect()
            }
            (Some(_), _) => {
                return Err(wrong("not encapsulated, but compressed by its transfer syntax".into()));
            }
            (None, _) => {
                let frames = (image.frames.len(), image.offsets.as_slice());
                let pieces = fragments::pieces(source.as_mut(), image.pixels, end, frames).map_err(wrong)?;
                for (i, frame) in pieces.iter().enumerate() {
                    let have: u64 = frame.iter().map(|(_, length)| length).sum();
                    if each > SMALL_FRAME && have.saturating_mul(MAX_RATIO) < each {
                        let problem = format!("frame {} has {have} bytes, which cannot hold {each}", i + 1);
                        return Err(wrong(problem));
                    }
                }
                pieces
            }
        };
        Ok(Self { image, source, codec, pieces })
    }

    /// Appends the stored values of frame `index`.
    pub(super) fn append(&mut self, index: usize, values: &mut Values) -> Result<()> {
        let image = self.image;
        let mut bytes = Vec::new();
        for &(start, length) in &self.pieces[index] {
            self.source.seek(SeekFrom::Start(start)).map_err(Error::io(&image.path))?;
            let piece = std::io::Read::take(self.source.as_mut(), length);
            std::io::Read::read_to_end(&mut { piece }, &mut bytes).map_err(Error::io(&image.path))?;
        }
        let wrong = |problem: String| {
            bad(
                &image.path,
                "PixelData",
                format!("frame {}, transfer syntax {}: {problem}", index + 1, image.syntax),
            )
        };
        let (words, endian) = self.decoded(bytes).map_err(wrong)?;
        let expected = image.frame_bytes();
        if words.len() as u64 != expected {
            return Err(wrong(format!("{} bytes after decoding, expected {expected}", words.len())));
        }
        let Sample::Integer { allocated, stored, high, signed } = image.sample else {
            let mut from = Cursor::new(words);
            values.append(&mut from, image.frame_len(), endian).map_err(Error::io(&image.path))?;
            return Ok(());
        };
        // Bits above and below the stored ones mean nothing (they once held overlays).
        let shift = high + 1 - stored;
        let unused = 32 - u32::from(stored);
        // What a lossy codec adds beyond the largest value must not come out as the smallest.
        let most =
            if LOSSY.contains(&image.syntax.as_str()) && !signed { u32::MAX >> unused } else { u32::MAX };
        let word = |word: u32| (word >> shift).min(most) << unused;
        let number = |bytes: &[u8]| {
            let mut native = [0; 4];
            let n = bytes.len();
            native[..n].copy_from_slice(bytes);
            if endian == Endian::Big {
                native[..n].reverse();
            }
            word(u32::from_le_bytes(native))
        };
        let words = words.chunks_exact(usize::from(allocated / 8)).map(number);
        match values {
            Values::U8(v) => v.extend(words.map(|w| (w >> unused) as u8)),
            Values::I8(v) => v.extend(words.map(|w| ((w as i32) >> unused) as i8)),
            Values::U16(v) => v.extend(words.map(|w| (w >> unused) as u16)),
            Values::I16(v) => v.extend(words.map(|w| ((w as i32) >> unused) as i16)),
            Values::U32(v) => v.extend(words.map(|w| w >> unused)),
            Values::I32(v) => v.extend(words.map(|w| (w as i32) >> unused)),
            _ => {
                return Err(wrong(format!(
                    "integers of {allocated} bits, signed: {signed}, among other values"
                )));
            }
        }
        Ok(())
    }

    /// Words of a frame and their byte order.
    fn decoded(&self, mut bytes: Vec<u8>) -> Result<(Vec<u8>, Endian), String> {
        let image = self.image;
        let bytes = match self.codec {
            Codec::Native => {
                // An encapsulated frame is padded to an even length.
                bytes.truncate(image.frame_bytes() as usize);
                return Ok((bytes, image.pixels.endian));
            }
            Codec::RunLengths => run_lengths(&bytes, image.frame_len(), image.frame_bytes())?,
            Codec::Jpeg => jpeg(&bytes, image)?,
            Codec::JpegLs => jpeg_ls(&bytes, image)?,
            Codec::Jpeg2000 => jpeg_2000(&bytes, image)?,
        };
        Ok((bytes, Endian::Little))
    }
}

/// RLE of PS3.5 annex G: a segment of packed bits for every byte of the values, most significant first.
fn run_lengths(bytes: &[u8], count: usize, expected: u64) -> Result<Vec<u8>, String> {
    let (words, _) = bytes.as_chunks::<4>();
    let words: Vec<usize> = words.iter().take(16).map(|w| u32::from_le_bytes(*w) as usize).collect();
    let planes = expected as usize / count;
    let segments = words.first().copied().unwrap_or(0);
    if segments != planes {
        return Err(format!("{segments} segments of run lengths, expected {planes}"));
    }
    // A run of 128 takes 2 bytes.
    if (bytes.len() as u64).saturating_mul(64) < expected {
        return Err(format!("{} bytes of run lengths cannot hold {expected}", bytes.len()));
    }
    let mut out = vec![0; expected as usize];
    for plane in 0..planes {
        let start = words.get(1 + plane).copied().unwrap_or(0);
        let end = if plane + 1 < planes { words.get(2 + plane).copied().unwrap_or(0) } else { bytes.len() };
        let mut from = bytes.get(start..end).ok_or("a segment lies outside the frame")?;
        let mut to = out.iter_mut().skip(planes - 1 - plane).step_by(planes);
        let mut written = 0;
        while written < count {
            let Some((&code, rest)) = from.split_first() else {
                return Err(format!("a segment of run lengths ends after {written} of {count} bytes"));
            };
            let length = match code {
                0..=127 => usize::from(code) + 1,
                128 => 0,
                _ => 257 - usize::from(code),
            };
            let (run, used) = match code {
                0..=127 => (rest.get(..length), length),
                128 => (Some(&rest[..0]), 0),
                _ => (rest.get(..1), 1),
            };
            let run = run.ok_or("a segment of run lengths ends within a run")?;
            for byte in run.iter().cycle().take(length) {
                // A last run may be longer than the image.
                if let Some(place) = to.next() {
                    *place = *byte;
                }
            }
            written += length;
            from = &rest[used..];
        }
    }
    Ok(out)
}

/// What a codestream says of itself must be what the data set says, before it is decoded.
fn same_size(found: (usize, usize), image: &Image) -> Result<(), String> {
    let expected = (image.columns, image.rows);
    if found == expected {
        return Ok(());
    }
    Err(format!("{} × {} pixels, expected {} × {}", found.0, found.1, expected.0, expected.1))
}

/// Samples as words of the data set, which may be wider or narrower than the codestream's.
fn as_words(samples: impl Iterator<Item = u32>, image: &Image) -> Vec<u8> {
    let width = (image.frame_bytes() / image.frame_len() as u64) as usize;
    samples.flat_map(|sample| sample.to_le_bytes().into_iter().take(width)).collect()
}

fn jpeg(bytes: &[u8], image: &Image) -> Result<Vec<u8>, String> {
    use jpeg_decoder::PixelFormat;
    let mut decoder = jpeg_decoder::Decoder::new(bytes);
    decoder.read_info().map_err(|e| e.to_string())?;
    let info = decoder.info().ok_or("no header of a JPEG frame")?;
    same_size((info.width.into(), info.height.into()), image)?;
    let pixels = decoder.decode().map_err(|e| e.to_string())?;
    match info.pixel_format {
        PixelFormat::L8 => Ok(as_words(pixels.iter().map(|p| u32::from(*p)), image)),
        PixelFormat::L16 => {
            let (words, _) = pixels.as_chunks::<2>();
            Ok(as_words(words.iter().map(|w| u16::from_ne_bytes(*w).into()), image))
        }
        other => Err(format!("pixels of format {other:?}, expected one value each")),
    }
}

fn jpeg_ls(bytes: &[u8], image: &Image) -> Result<Vec<u8>, String> {
    // The crate compares the sizes before it decodes.
    let size = |n: usize| u32::try_from(n).map_err(|e| e.to_string());
    let decoded = jpegls::decode(bytes, size(image.columns)?, size(image.rows)?);
    let (pixels, ..) = decoded.map_err(|e| e.to_string())?;
    Ok(as_words(pixels.iter().map(|p| u32::from(*p)), image))
}

fn jpeg_2000(bytes: &[u8], image: &Image) -> Result<Vec<u8>, String> {
    use hayro_jpeg2000::{DecodeSettings, DecoderContext, Image as Codestream};
    // Values, not colours.
    let settings = DecodeSettings { resolve_palette_indices: false, strict: true, target_resolution: None };
    let codestream = Codestream::new(bytes, &settings).map_err(|e| e.to_string())?;
    same_size((codestream.width() as usize, codestream.height() as usize), image)?;
    let mut context = DecoderContext::default();
    let decoded = codestream.decode(&mut context).map_err(|e| e.to_string())?;
    let [component] = decoded.components() else {
        return Err(format!("{} components, expected one value a pixel", decoded.components().len()));
    };
    let bits = u32::from(component.bit_depth());
    // Beyond these the decoder's 32-bit floating point is not exact.
    if bits > 16 {
        return Err(format!("{bits} bits a pixel, expected at most 16"));
    }
    // The decoder counts signed samples from the smallest up; their sign bit is then the wrong way round.
    let turned = if signed(bytes) { 1 << (bits - 1) } else { 0 };
    let most = ((1_u32 << bits) - 1) as f32;
    let sample = |sample: &f32| {
        let word = sample.round_ties_even().clamp(0.0, most) as u32 ^ turned;
        // The sign goes on into the higher bits of the data set's word.
        if turned != 0 { (((word << (32 - bits)) as i32) >> (32 - bits)) as u32 } else { word }
    };
    Ok(as_words(component.samples().iter().map(sample), image))
}

/// Whether the first component of a JPEG 2000 codestream is signed (ISO/IEC 15444-1 A.5.1): the top bit of Ssiz.
fn signed(bytes: &[u8]) -> bool {
    let start = bytes.windows(4).position(|w| w == [0xff, 0x4f, 0xff, 0x51]);
    start.and_then(|start| bytes.get(start + 42)).is_some_and(|ssiz| ssiz & 0x80 != 0)
}
