//! What each method shows, and where it errs: the left eye's picture, and beside it the error of the ambient factor on the surface
//! that it shows.

use super::{Entrant, Known, Setting, Values};
use crate::error::{Errors, errors, shape_errors};
use cao::renderer::StereoImage;
use cao_formats::Picture;
use cao_model::methods::Method;
use cao_model::occlusion::Quadrature;
use cao_twin::{Grid, trilinear_clamped};

/// One method's pictures.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Name of the method.
    pub method: &'static str,
    /// Its setting.
    pub setting: Setting,
    /// The left eye's picture.
    pub picture: Picture,
    /// Errors on the surface, where it has ambient values: a pixel for every few of the picture: red too bright, blue too dark, white right, grey where nothing is shown.
    pub error: Option<Picture>,
    /// The same as numbers.
    pub errors: Option<Errors>,
    /// What remains of them after the best affine fit of its tone.
    pub shape: Option<Errors>,
}

/// Error at which the colours saturate.
pub const SATURATED: f32 = 0.2;

/// Linear grey behind pictures, and where there is no error to show.
pub(super) const BACKGROUND: [f32; 3] = [0.008_568_126, 0.009_721_218, 0.012_286_488];
const NOTHING: [u8; 3] = [0xd8, 0xd8, 0xd8];

/// One setting of each method: the default's own, 26 weighted rays with the segment rule where there are such, else the paper's 26, else the first of a rule, else any.
pub(super) fn featured<'a>(
    entries: impl Iterator<Item = &'a Entrant> + Clone,
) -> Vec<(&'static str, Setting)> {
    let default = Method::default();
    let ours = format!("{} {}", default.rays().name(), default.quadrature().name());
    let mut chosen: Vec<(&'static str, Setting)> = Vec::new();
    for entry in entries.clone() {
        if chosen.iter().any(|(method, _)| *method == entry.method) {
            continue;
        }
        let own: Vec<&Setting> =
            entries.clone().filter(|e| e.method == entry.method).map(|e| &e.setting).collect();
        let best = own
            .iter()
            .find(|s| s.name() == ours)
            .or_else(|| own.iter().find(|s| s.label == "26w" && s.quadrature == Some(Quadrature::Segment)))
            .or_else(|| own.iter().find(|s| s.label == "26"))
            .or_else(|| own.iter().find(|s| s.quadrature.is_some() || Quadrature::parse(&s.label).is_ok()))
            .unwrap_or(&own[own.len() / 2]);
        chosen.push((entry.method, (*best).clone()));
    }
    chosen
}

impl Known {
    /// A contender's pictures.
    pub(super) fn shown(
        &self,
        grid: &Grid,
        entry: &Entrant,
        image: &StereoImage,
        found: Option<&Values>,
    ) -> Shown {
        let [width, height] = image.size;
        let (error, errors) = found.map(|found| self.surface_errors(grid, image.size, found)).unzip();
        Shown {
            method: entry.method,
            setting: entry.setting.clone(),
            picture: Picture::over(width, height, &image.colour[0], BACKGROUND),
            error,
            errors: errors.map(|[raw, _]| raw),
            shape: errors.map(|[_, shape]| shape),
        }
    }

    /// The picture of them, and as numbers, raw and with the tone fitted.
    fn surface_errors(
        &self,
        grid: &Grid,
        [width, height]: [u32; 2],
        found: &Values,
    ) -> (Picture, [Errors; 2]) {
        let value = |point: [f64; 3], pixel: usize| match found {
            Values::Voxels(values) => trilinear_clamped(grid, values, point) as f32,
            Values::Pixels(values) => values[pixel],
        };
        let small = [width, height].map(|edge| edge.div_ceil(self.stride as u32));
        let mut pixels = vec![NOTHING; (small[0] * small[1]) as usize];
        let mut values = Vec::new();
        for &(point, pixel, _) in &self.surface {
            values.push(value(point, pixel));
        }
        for (&(_, pixel, expected), value) in self.surface.iter().zip(&values) {
            let (x, y) = (pixel % width as usize / self.stride, pixel / width as usize / self.stride);
            pixels[y * small[0] as usize + x] = diverging((value - expected) / SATURATED);
        }
        let expected: Vec<f32> = self.surface.iter().map(|(.., value)| *value).collect();
        let counts = vec![true; expected.len()];
        let found = [errors(&values, &expected, &counts), shape_errors(&values, &expected, &counts).0];
        (Picture { width: small[0], height: small[1], pixels }, found)
    }
}

/// −1 blue, 0 white, 1 red.
pub fn diverging(value: f32) -> [u8; 3] {
    let share = value.clamp(-1.0, 1.0);
    let end = if share < 0.0 { [33.0, 102.0, 172.0] } else { [178.0, 24.0, 43.0] };
    end.map(|c: f32| (255.0 + share.abs() * (c - 255.0)).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_of_errors_have_a_direction_and_an_end() {
        assert_eq!(diverging(0.0), [255; 3]);
        assert_eq!(diverging(-2.0), diverging(-1.0));
        let [red, _, blue] = diverging(0.5);
        assert!(red > blue);
        let [red, _, blue] = diverging(-0.5);
        assert!(red < blue);
    }
}
