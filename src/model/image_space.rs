//! Ambient occlusion from what pixels show: three published methods and their settings, lengths in the world's mm.
//!
//! All three belong to an image and change with it (docs/image-space.md): they are here to be compared with.

use crate::{Error, Result};

/// A method of image space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ImageMethod {
    /// Points in a ball, tested against depth.
    Crytek(Crytek),
    /// Lines through a ball that touches the surface.
    Volumetric(Volumetric),
    /// Horizons.
    Hbao(Hbao),
}

/// After Mittring 2007: 16 points in the ball of radius R, then the mean of 4 × 4 pixels. A flat wall is ½: half of the ball is behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crytek {
    /// R.
    pub radius_mm: f32,
}

/// After Szirmay-Kalos and others 2009: lines through the ball of diameter R that touches the surface from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Volumetric {
    /// R.
    pub radius_mm: f32,
    /// Lines, 1 … [`Self::MOST_SAMPLES`].
    pub samples: u32,
}

/// After Bavoil and Sainz 2008: horizons of 6 steps along directions of the image, then a joint bilateral filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hbao {
    /// R.
    pub radius_mm: f32,
    /// Directions, 1 … [`Self::MOST_DIRECTIONS`].
    pub directions: u32,
    /// Angle above the surface that no horizon counts below, 0 … 90 degrees.
    pub bias_deg: f32,
    /// What a horizon adds falls off with its distance r by 1 − r²/R². Without, R is only how far steps go.
    pub falloff: bool,
    /// Pixels of the filter to each side, 0 … [`Self::MOST_REACH`]; 0 leaves the noise in.
    pub reach: u32,
}

impl Volumetric {
    /// Most lines.
    pub const MOST_SAMPLES: u32 = 4096;
}

impl Hbao {
    /// Most directions.
    pub const MOST_DIRECTIONS: u32 = 64;
    /// Widest filter.
    pub const MOST_REACH: u32 = 32;
}

impl ImageMethod {
    /// The three at the settings of AOV's figures 8 and 9: 16 points, 32 lines, 16 directions with a filter of 15 pixels.
    pub fn all(radius_mm: f32) -> [Self; 3] {
        let hbao = Hbao { radius_mm, directions: 16, bias_deg: 30.0, falloff: true, reach: 7 };
        [
            Self::Crytek(Crytek { radius_mm }),
            Self::Volumetric(Volumetric { radius_mm, samples: 32 }),
            Self::Hbao(hbao),
        ]
    }

    /// Its name in charts.
    pub fn title(&self) -> &'static str {
        match self {
            Self::Crytek(_) => "Crytek SSAO",
            Self::Volumetric(_) => "Volumetric AO",
            Self::Hbao(_) => "HBAO",
        }
    }

    /// R.
    pub fn radius_mm(&self) -> f32 {
        match self {
            Self::Crytek(crytek) => crytek.radius_mm,
            Self::Volumetric(volumetric) => volumetric.radius_mm,
            Self::Hbao(hbao) => hbao.radius_mm,
        }
    }

    /// Refuses settings that mean nothing, by name.
    ///
    /// # Errors
    /// [`Error::Config`] for a radius that is no length above 0 or a bias that is no angle of 0 … 90 degrees, and for more samples,
    /// directions or pixels than there can be.
    pub fn check(&self) -> Result<()> {
        let radius = self.radius_mm();
        if !(radius > 0.0 && radius.is_finite()) {
            return Err(Error::refused("radius_mm", format!("{radius}; expected a length > 0 mm")));
        }
        match *self {
            Self::Crytek(_) => Ok(()),
            Self::Volumetric(Volumetric { samples, .. }) => {
                count("samples", samples, 1, Volumetric::MOST_SAMPLES)
            }
            Self::Hbao(Hbao { directions, bias_deg, reach, .. }) => {
                if !(0.0..=90.0).contains(&bias_deg) {
                    return Err(Error::refused("bias_deg", format!("{bias_deg}; expected 0 … 90 degrees")));
                }
                count("directions", directions, 1, Hbao::MOST_DIRECTIONS)?;
                count("reach", reach, 0, Hbao::MOST_REACH)
            }
        }
    }
}

fn count(what: &str, value: u32, least: u32, most: u32) -> Result<()> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(Error::refused(what, format!("{value}; expected {least} … {most}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_settings_are_refused_by_name() {
        let [_, _, ImageMethod::Hbao(hbao)] = ImageMethod::all(10.0) else { panic!("HBAO is the third") };
        let volumetric = |samples| ImageMethod::Volumetric(Volumetric { radius_mm: 10.0, samples });
        for (bad, name) in [
            (ImageMethod::Crytek(Crytek { radius_mm: 0.0 }), "radius_mm"),
            (ImageMethod::Crytek(Crytek { radius_mm: f32::NAN }), "radius_mm"),
            (ImageMethod::Crytek(Crytek { radius_mm: f32::INFINITY }), "radius_mm"),
            (volumetric(0), "samples"),
            (volumetric(4097), "samples"),
            (ImageMethod::Hbao(Hbao { directions: 0, ..hbao }), "directions"),
            (ImageMethod::Hbao(Hbao { bias_deg: 91.0, ..hbao }), "bias_deg"),
            (ImageMethod::Hbao(Hbao { bias_deg: f32::NAN, ..hbao }), "bias_deg"),
            (ImageMethod::Hbao(Hbao { reach: 33, ..hbao }), "reach"),
        ] {
            let error = bad.check().unwrap_err().to_string();
            assert!(error.starts_with(name) && error.contains("expected"), "{error}");
        }
        for good in ImageMethod::all(0.5) {
            good.check().unwrap();
        }
    }
}
