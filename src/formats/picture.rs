//! Pictures: linear, premultiplied pixels over a background, to 8-bit sRGB, to PNG.

use crate::write_atomic;
use crate::{Error, Result};
use std::path::Path;

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
        let mut png = std::io::Cursor::new(Vec::new());
        let bytes = self.pixels.as_flattened();
        image::write_buffer_with_format(
            &mut png,
            bytes,
            self.width,
            self.height,
            image::ExtendedColorType::Rgb8,
            image::ImageFormat::Png,
        )
        .map_err(|e| Error::refused("picture", e.to_string()))?;
        Ok(png.into_inner())
    }

    /// Writes a PNG; nothing is left behind on failure.
    pub fn write_png(&self, path: &Path) -> Result<()> {
        let png = self.png()?;
        write_atomic(path, |file| file.write_all(&png))
    }
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
