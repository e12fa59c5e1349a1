//! Textures of surfaces: PNG of any depth and kind, as r, g, b and opacity of 8 bits.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::file;
use cao_model::surface::Texture;

/// Longest file of a texture.
const MAX_BYTES: u64 = 256 << 20;
/// Most pixels along an edge: what every device with a desktop driver holds.
const MAX_EDGE: u32 = 16384;
/// Most pixels of all textures of a file: 1 GiB.
const MAX_PIXELS: u64 = 1 << 28;

/// How PNG files begin, and others that are taken for textures.
const BEGINNINGS: [(&[u8], &str); 7] = [
    (b"\x89PNG\r\n\x1a\n", "PNG"),
    (b"\xff\xd8\xff", "JPEG"),
    (b"DDS ", "DDS"),
    (b"\xabKTX", "KTX"),
    (b"BM", "BMP"),
    (b"GIF8", "GIF"),
    (b"RIFF", "WebP"),
];

/// The textures of one file of a surface, each read once.
#[derive(Default)]
pub(super) struct Textures {
    read: HashMap<PathBuf, Arc<Texture>>,
    pixels: u64,
}

impl Textures {
    /// The texture in a file. The error says what is wrong with it, the file in it.
    pub(super) fn load(&mut self, path: &Path) -> Result<Arc<Texture>, String> {
        let shown = cao_model::error::shown_path(path);
        if let Some(texture) = self.read.get(path) {
            return Ok(texture.clone());
        }
        if !path.exists() {
            return Err(format!("there is no file {shown}; put it there, or take the line off"));
        }
        let bytes = file::read_bytes(path, MAX_BYTES).map_err(|error| chain(&error))?;
        let texture = self.decode(&shown, &bytes)?;
        self.read.insert(path.into(), texture.clone());
        Ok(texture)
    }

    /// The texture in these bytes, which are called `name`.
    pub(super) fn decode(&mut self, name: &str, bytes: &[u8]) -> Result<Arc<Texture>, String> {
        let kind =
            BEGINNINGS.iter().find(|(beginning, _)| bytes.starts_with(beginning)).map(|(_, kind)| *kind);
        if kind != Some("PNG") {
            let kind = kind.map_or("no PNG".into(), |kind| format!("{kind}, not PNG"));
            return Err(format!("{name} is {kind}; convert it to PNG"));
        }
        let wrong = |error: png::DecodingError| format!("{name}: {error}");
        let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::normalize_to_color8());
        // Only what is in the image counts, and its size is looked at before it is read.
        decoder.set_ignore_text_chunk(true);
        let mut reader = decoder.read_info().map_err(wrong)?;
        let (width, height) = (reader.info().width, reader.info().height);
        if width > MAX_EDGE || height > MAX_EDGE {
            return Err(format!(
                "{name} has {width}×{height} pixels; expected at most {MAX_EDGE} along each edge"
            ));
        }
        self.pixels += u64::from(width) * u64::from(height);
        if self.pixels > MAX_PIXELS {
            return Err(format!(
                "{name}: more than {MAX_PIXELS} pixels of all textures together; make them smaller"
            ));
        }
        let size = reader.output_buffer_size().ok_or_else(|| format!("{name} is too large"))?;
        let mut values = vec![0; size];
        let frame = reader.next_frame(&mut values).map_err(wrong)?;
        let values = &values[..frame.buffer_size()];
        let texels: Vec<[u8; 4]> = match frame.color_type {
            png::ColorType::Grayscale => values.iter().map(|&v| [v, v, v, 255]).collect(),
            png::ColorType::GrayscaleAlpha => {
                values.as_chunks().0.iter().map(|&[v, a]| [v, v, v, a]).collect()
            }
            png::ColorType::Rgb => values.as_chunks().0.iter().map(|&[r, g, b]| [r, g, b, 255]).collect(),
            png::ColorType::Rgba => values.as_chunks().0.to_vec(),
            // The decoder expands palettes.
            png::ColorType::Indexed => return Err(format!("{name}: its palette was not read")),
        };
        Ok(Arc::new(Texture { name: name.into(), size: [width, height], texels }))
    }
}

/// An error with its causes, in one line.
pub(super) fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        text += &format!(": {cause}");
        next = cause.source();
    }
    text
}
