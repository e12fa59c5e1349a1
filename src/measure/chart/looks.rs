//! Errors of the picture itself: the same ambient values, drawn with other steps, samples and resolutions, against a picture that has
//! converged (measure.md §3).
//!
//! Times are those of the ray cast, both eyes, medians of runs in which the settings take turns. Errors are of both eyes' 8-bit sRGB
//! pictures: FLIP, its mean over all pixels, and RMSE over all pixels and channels. The reference takes `SAMPLES` rays a pixel with
//! 1/`STEPS` voxel between samples, and lets no ray end early; what it is worth is its change when both are halved.

use super::front::{beaten, front, quartiles};
use super::pictures::BACKGROUND;
use crate::Result;
use crate::flip::{PIXELS_PER_DEGREE, flip};
use cao::draw::budget::{LAST, Quality};
use cao::renderer::{Renderer, StereoImage};
use cao::stages::RAYCAST;
use cao_formats::Picture;
use cao_model::look::Look;
use cao_model::samples::Filter;
use cao_model::view::View;

/// Rays a pixel, and samples a voxel along each, of the reference.
const SAMPLES: u32 = 64;
const STEPS: u32 = 16;

/// Distances of samples in voxels, and rays a pixel, that are drawn each with each.
pub const STEP_VOXELS: [f32; 4] = [0.125, 0.25, 0.5, 1.0];
/// Rays a pixel.
pub const RAYS: [u32; 3] = [1, 4, 16];
/// Levels of a budget that are drawn, of [`LAST`]: quarters of the way.
const LEVELS: [u32; 4] = [LAST / 4, LAST / 2, 3 * LAST / 4, LAST];

/// In what way a setting differs from the default.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// In steps and samples.
    Rays,
    /// In resolution alone.
    Scale,
    /// As this level of a budget draws.
    Budget(u32),
}

/// One way to draw.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Light, filter, samples and the distance between them.
    pub look: Look,
    /// That distance in voxels.
    pub step_voxels: f32,
    /// Share of the pixels along each axis that is drawn; the rest is interpolated.
    pub scale: f32,
    /// What it stands for.
    pub kind: Kind,
}

impl Setting {
    fn new(look: Look, step_voxels: f32, voxel: f32, scale: f32, kind: Kind) -> Self {
        Self { look: Look { step_mm: Some(step_voxels * voxel), ..look }, step_voxels, scale, kind }
    }

    /// Whether nobody has to ask for it.
    pub fn is_default(&self) -> bool {
        let own = Look { step_mm: None, ..self.look };
        own == Look::default() && self.step_voxels == Look::default().step(1.0) && self.scale == 1.0
    }

    /// In words: its steps, its samples, its resolution.
    pub fn name(&self) -> String {
        let step = match STEP_VOXELS.iter().position(|step| *step == self.step_voxels) {
            Some(n) => ["1/8", "1/4", "1/2", "1"][n].to_owned(),
            None => format!("{:.2}", self.step_voxels),
        };
        let filter = if self.look.filter == Filter::Box { "" } else { " Gaussian" };
        let part = match (self.kind, self.scale == 1.0) {
            (Kind::Budget(level), _) => {
                format!(", {:.2} of the resolution, budget level {level}", self.scale)
            }
            (_, false) => format!(", {} of the resolution", self.scale),
            (_, true) => String::new(),
        };
        format!("step {step}, {}{filter}{part}", plural(self.look.samples))
    }
}

fn plural(samples: u32) -> String {
    if samples == 1 { "1 sample".into() } else { format!("{samples} samples") }
}

/// What is drawn of every scene, the default first; `voxel` is the smallest spacing in mm. A first look leaves the most rays out, which take
/// most of the time.
pub fn settings(voxel: f32, quick: bool) -> Vec<Setting> {
    let rays = &RAYS[..if quick { 2 } else { 3 }];
    let look = Look::default();
    let default = look.step(1.0);
    let mut all = vec![Setting::new(look, default, voxel, 1.0, Kind::Rays)];
    for &samples in rays {
        for step in STEP_VOXELS {
            all.push(Setting::new(Look { samples, ..look }, step, voxel, 1.0, Kind::Rays));
        }
    }
    let gaussian = Look { samples: rays[rays.len() - 1], filter: Filter::Gaussian, ..look };
    all.push(Setting::new(gaussian, default, voxel, 1.0, Kind::Rays));
    all.push(Setting::new(look, default, voxel, 0.5, Kind::Scale));
    for level in LEVELS {
        // Samples at most a voxel apart, as the renderer has it.
        let Quality { scale, coarser, .. } = Quality::at(level, 1.0 / default);
        all.push(Setting::new(look, default * coarser, voxel, scale, Kind::Budget(level)));
    }
    let mut seen: Vec<Setting> = Vec::new();
    all.retain(|setting| {
        let new = !seen.contains(setting);
        seen.push(setting.clone());
        new
    });
    all
}

/// How far two pairs of pictures are apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Apart {
    /// FLIP, mean over the pixels of both eyes.
    pub flip: f64,
    /// RMSE in levels of 255.
    pub levels: f64,
}

impl Apart {
    /// Of both eyes' pictures.
    pub fn of(found: &[Picture; 2], reference: &[Picture; 2]) -> Self {
        let (mut flips, mut squares, mut count) = (0.0, 0.0, 0);
        for (found, reference) in found.iter().zip(reference) {
            flips += 0.5 * flip(found, reference, PIXELS_PER_DEGREE).mean;
            for (f, r) in found.pixels.as_flattened().iter().zip(reference.pixels.as_flattened()) {
                squares += (f64::from(*f) - f64::from(*r)).powi(2);
                count += 1;
            }
        }
        Self { flip: flips, levels: (squares / f64::from(count.max(1))).sqrt() }
    }
}

/// A setting, drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// Which.
    pub setting: Setting,
    /// To the reference.
    pub error: Apart,
    /// Ray cast of both eyes in ms, and over that of the default in the same run.
    pub runs: Vec<[f64; 2]>,
}

/// The pictures of one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Looks {
    /// Each setting, the default first.
    pub drawn: Vec<Drawn>,
    /// How far the reference moves when its rays and samples are halved.
    pub convergence: Apart,
}

/// The reference's look, its rays and samples over `less`.
pub fn reference(voxel: f32, less: u32) -> Look {
    let step_mm = Some(voxel * less as f32 / STEPS as f32);
    Look { step_mm, samples: SAMPLES / less, tolerance: 0.0, ..Look::default() }
}

/// Draws the settings, the first of which times are quoted against, in turns. `progress` hears of each drawing, as multiples of the default's
/// rays and samples.
pub fn measure(
    renderer: &Renderer,
    views: &[View; 2],
    size: [u32; 2],
    voxel: f32,
    settings: &[Setting],
    runs: u32,
    progress: &mut dyn FnMut(f64),
) -> Result<Looks> {
    let mut draw = |look: &Look, scale: f32| -> Result<([Picture; 2], f64)> {
        let part = size.map(|pixels| (pixels as f32 * scale).ceil().max(1.0) as u32);
        let (image, times) = renderer.draw(views, look, part)?;
        let ms = times.iter().filter(|timing| timing.stage == RAYCAST).map(|timing| timing.ms).sum();
        progress(cost(look, scale, voxel));
        Ok((shown(&image, size), ms))
    };
    let (truth, _) = draw(&reference(voxel, 1), 1.0)?;
    let (rough, _) = draw(&reference(voxel, 2), 1.0)?;
    let mut drawn = Vec::new();
    // These warm up, too.
    for setting in settings {
        let (found, _) = draw(&setting.look, setting.scale)?;
        drawn.push(Drawn { setting: setting.clone(), error: Apart::of(&found, &truth), runs: Vec::new() });
    }
    for _ in 0..runs {
        let mut first = f64::NAN;
        for (n, drawn) in drawn.iter_mut().enumerate() {
            let (_, ms) = draw(&drawn.setting.look, drawn.setting.scale)?;
            if n == 0 {
                first = ms;
            }
            drawn.runs.push([ms, ms / first]);
        }
    }
    Ok(Looks { drawn, convergence: Apart::of(&rough, &truth) })
}

/// Samples along all rays, as multiples of the default's.
fn cost(look: &Look, scale: f32, voxel: f32) -> f64 {
    let finer = Look::default().step(voxel) / look.step(voxel);
    f64::from(look.samples) * f64::from(finer) * f64::from(scale).powi(2)
}

/// What [`measure`] will tell its progress, in all.
pub fn work(voxel: f32, settings: &[Setting], runs: u32) -> f64 {
    let references = cost(&reference(voxel, 1), 1.0, voxel) + cost(&reference(voxel, 2), 1.0, voxel);
    let once: f64 = settings.iter().map(|setting| cost(&setting.look, setting.scale, voxel)).sum();
    references + once * f64::from(1 + runs)
}

/// Both eyes as they are shown: enlarged where fewer pixels were drawn, as the kernel `present` does it.
fn shown(image: &StereoImage, size: [u32; 2]) -> [Picture; 2] {
    [0, 1].map(|eye| {
        let colour = enlarged(&image.colour[eye], image.size, size);
        Picture::over(size[0], size[1], &colour, BACKGROUND)
    })
}

fn enlarged(pixels: &[[f32; 4]], drawn: [u32; 2], size: [u32; 2]) -> Vec<[f32; 4]> {
    if drawn == size {
        return pixels.to_vec();
    }
    // The pixel below a place, the next, and the weight of that.
    let along = |axis: usize, n: u32| {
        let at = (n as f32 + 0.5) * drawn[axis] as f32 / size[axis] as f32 - 0.5;
        let inside = |place: f32| place.clamp(0.0, (drawn[axis] - 1) as f32) as usize;
        (inside(at.floor()), inside(at.floor() + 1.0), at - at.floor())
    };
    let mix = |a: [f32; 4], b: [f32; 4], w: f32| std::array::from_fn(|i| a[i] + w * (b[i] - a[i]));
    let pixel = |n: u32| {
        let ((x, right, u), (y, below, v)) = (along(0, n % size[0]), along(1, n / size[0]));
        let of = |x: usize, y: usize| pixels[y * drawn[0] as usize + x];
        mix(mix(of(x, y), of(right, y), u), mix(of(x, below), of(right, below), u), v)
    };
    (0..size[0] * size[1]).map(pixel).collect()
}

/// A setting over several scenes.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Which.
    pub setting: Setting,
    /// Lower quartile, median and upper quartile of the time: geometric means over the scenes.
    pub time: [f64; 3],
    /// FLIP: mean over the scenes; levels: root of the mean square.
    pub error: Apart,
}

/// The marks of these scenes' pictures; times in ms, or ratios to the default.
pub fn marks(scenes: &[&Looks], ratios: bool) -> Vec<Mark> {
    let Some(first) = scenes.first() else { return Vec::new() };
    let of = |(at, drawn): (usize, &Drawn)| {
        let n = scenes.len() as f64;
        let (mut logs, mut flip, mut squares) = ([0.0; 3], 0.0, 0.0);
        for drawn in scenes.iter().map(|scene| &scene.drawn[at]) {
            let times = quartiles(drawn.runs.iter().map(|run| run[usize::from(ratios)]));
            logs = [0, 1, 2].map(|i| logs[i] + times[i].ln() / n);
            flip += drawn.error.flip / n;
            squares += drawn.error.levels.powi(2) / n;
        }
        let error = Apart { flip, levels: squares.sqrt() };
        Mark { setting: drawn.setting.clone(), time: logs.map(f64::exp), error }
    };
    first.drawn.iter().enumerate().map(of).collect()
}

/// One of the two errors.
pub type Error = fn(&Apart) -> f64;

/// Both, with what an axis says of them.
pub const ERRORS: [(&str, Error); 2] = [
    ("error: FLIP, mean over the picture", |apart| apart.flip),
    ("error: RMSE in levels of 255, sRGB", |apart| apart.levels),
];

/// Marks on the Pareto front, from the fastest on.
pub fn front_of(marks: &[Mark], error: Error) -> Vec<usize> {
    front(&marks.iter().map(|mark| [mark.time[1], error(&mark.error)]).collect::<Vec<_>>())
}

/// Marks that are better than the one at `of` beyond the noise of its time.
pub fn better(marks: &[Mark], of: usize, error: Error) -> Vec<usize> {
    beaten(&marks.iter().map(|mark| (mark.time, error(&mark.error))).collect::<Vec<_>>(), of)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_first_and_no_setting_comes_twice() {
        let all = settings(2.0, false);
        assert!(all[0].is_default() && all[0].name() == "step 1/4, 1 sample", "{}", all[0].name());
        assert_eq!(all.iter().filter(|setting| setting.is_default()).count(), 1);
        // Steps by samples, a Gaussian, half the resolution, levels.
        assert_eq!(all.len(), STEP_VOXELS.len() * RAYS.len() + 2 + LEVELS.len());
        let mut names: Vec<String> = all.iter().map(Setting::name).collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), all.len());
        assert!(all.iter().all(|setting| setting.look.check().is_ok()));
        let last = all.last().unwrap();
        assert_eq!((last.scale, last.step_voxels, last.look.step_mm), (0.5, 1.0, Some(2.0)));
    }

    #[test]
    fn errors_by_hand() {
        let even =
            |level: u8| [0; 2].map(|_: u8| Picture { width: 9, height: 7, pixels: vec![[level; 3]; 63] });
        assert_eq!(Apart::of(&even(50), &even(50)), Apart { flip: 0.0, levels: 0.0 });
        let apart = Apart::of(&even(53), &even(50));
        assert!((apart.levels - 3.0).abs() < 1e-12 && apart.flip > 0.0, "{apart:?}");
        // One eye's error counts for half.
        let [left, _] = even(54);
        let [_, right] = even(50);
        let apart = Apart::of(&[left, right], &even(50));
        assert!((apart.levels - 8.0_f64.sqrt()).abs() < 1e-12, "{apart:?}");
    }

    /// Centres of pixels lie at quarters of the smaller picture's.
    #[test]
    fn enlarging_interpolates_and_keeps_what_is_even() {
        let of = |v: f32| [v; 4];
        let row = enlarged(&[of(0.0), of(1.0)], [2, 1], [4, 1]);
        assert_eq!(row, [0.0, 0.25, 0.75, 1.0].map(of));
        let column = enlarged(&[of(0.0), of(1.0)], [1, 2], [1, 4]);
        assert_eq!(column, row);
        assert!(enlarged(&[of(0.5); 6], [3, 2], [5, 3]).iter().all(|pixel| *pixel == of(0.5)));
    }
}
