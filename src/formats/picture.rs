//! Pictures: linear, premultiplied pixels over a background, to 8-bit sRGB, to PNG.

use crate::outputs::{Output, write_atomic};
use crate::{Error, Result};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// 8-bit sRGB pixels, rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Pixels along x.
    pub width: u32,
    /// Pixels along y.
    pub height: u32,
    /// `width · height` red, green, blue.
    pub pixels: Vec<[u8; 3]>,
}

impl Picture {
    /// Composites premultiplied linear pixels over a linear background and encodes them as sRGB.
    pub fn over(width: u32, height: u32, colour: &[[f32; 4]], background: [f32; 3]) -> Self {
        let over = |p: &[f32; 4]| std::array::from_fn(|i| encode(p[i] + (1.0 - p[3]) * background[i]));
        Self { width, height, pixels: colour.iter().map(over).collect() }
    }

    /// Two pictures of the same height, left and right.
    pub fn beside(left: &Self, right: &Self) -> Self {
        let row = |y: u32| {
            let of = |p: &Self| {
                let start = (y * p.width) as usize;
                p.pixels[start..start + p.width as usize].to_vec()
            };
            [of(left), of(right)].concat()
        };
        Self {
            width: left.width + right.width,
            height: left.height.min(right.height),
            pixels: (0..left.height.min(right.height)).flat_map(row).collect(),
        }
    }

    /// The picture as a PNG file.
    pub fn png(&self) -> Result<Vec<u8>> {
        let mut png = Vec::new();
        let write = |file| {
            let mut file = begin(file, self.width, self.height)?;
            file.write_image_data(self.pixels.as_flattened())?;
            file.finish()
        };
        write(&mut png).map_err(|error| Error::refused("picture", error.to_string()))?;
        Ok(png)
    }

    /// Writes a PNG; nothing is left behind on failure.
    pub fn write_png(&self, path: &Path) -> Result<()> {
        let png = self.png()?;
        write_atomic(path, |file| file.write_all(&png))
    }
}

/// A PNG file that grows downwards, some rows at a time, and takes little memory, whatever its size.
pub struct GrowingPng {
    /// The encoder does not give its file back.
    file: Arc<Mutex<Output>>,
    path: PathBuf,
    rows: png::StreamWriter<'static, Shared>,
}

impl GrowingPng {
    /// Begins a picture of this size.
    ///
    /// # Errors
    /// [`Error::Io`] naming the file; also for a size that PNG does not have.
    pub fn new(file: Output, width: u32, height: u32) -> Result<Self> {
        let path = file.path().to_owned();
        let file = Arc::new(Mutex::new(file));
        let rows = begin(Shared(file.clone()), width, height).and_then(|file| file.into_stream_writer());
        match rows {
            Ok(rows) => Ok(Self { file, path, rows }),
            Err(error) => Err(Error::io(&path)(error.into())),
        }
    }

    /// Adds pixels, along its rows.
    ///
    /// # Errors
    /// [`Error::Io`] naming the file; also for more than the picture has.
    pub fn add(&mut self, pixels: &[[u8; 3]]) -> Result<()> {
        self.rows.write_all(pixels.as_flattened()).map_err(Error::io(&self.path))
    }

    /// Completes the file, for [`Outputs::keep`](crate::Outputs::keep).
    ///
    /// # Errors
    /// [`Error::Io`] naming the file; also for less than the picture has.
    pub fn finish(self) -> Result<Output> {
        let Self { file, path, rows } = self;
        rows.finish().map_err(|error| Error::io(&path)(error.into()))?;
        let file = Arc::into_inner(file).ok_or_else(|| io::Error::other("is still being written"));
        let file = file.map_err(Error::io(&path))?;
        Ok(file.into_inner().unwrap_or_else(PoisonError::into_inner))
    }
}

/// A file that two hold.
struct Shared(Arc<Mutex<Output>>);

impl Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).flush()
    }
}

/// The head of a PNG file.
fn begin<W: Write>(file: W, width: u32, height: u32) -> Result<png::Writer<W>, png::EncodingError> {
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Adaptive);
    encoder.write_header()
}

/// sRGB transfer curve (IEC 61966-2-1), to 8 bits.
fn encode(linear: f32) -> u8 {
    let c = linear.clamp(0.0, 1.0);
    let s = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
    (s * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transparent_shows_the_background_and_opaque_does_not() {
        let p = Picture::over(3, 1, &[[0.0; 4], [1.0, 0.0, 0.0, 1.0], [0.5, 0.5, 0.5, 0.5]], [1.0; 3]);
        assert_eq!(p.pixels, [[255; 3], [255, 0, 0], [255; 3]]);
    }

    #[test]
    fn linear_half_is_srgb_188() {
        assert_eq!(encode(0.5), 188);
        assert_eq!((encode(-1.0), encode(2.0), encode(f32::NAN)), (0, 255, 0));
    }

    #[test]
    fn pictures_stand_side_by_side() {
        let l = Picture { width: 1, height: 2, pixels: vec![[1; 3], [2; 3]] };
        let r = Picture { width: 2, height: 2, pixels: vec![[3; 3], [4; 3], [5; 3], [6; 3]] };
        assert_eq!(Picture::beside(&l, &r).pixels, [[1; 3], [3; 3], [4; 3], [2; 3], [5; 3], [6; 3]]);
    }
}
