//! How many occlusion volumes each pixel of a scene lies in, as numbers and as colours (AOV Fig. 5).

use super::meshes::{Found, Of, SHOWN};
use super::montage::{above, beside};
use super::tables::table;
use crate::plot::{Anchor, Drawing, INK, short};
use cao_formats::Picture;

/// Counts of a view.
#[derive(Clone, Debug)]
pub struct Overdraw {
    /// Pixels across
    pub width: u32,
    /// and down.
    pub height: u32,
    /// Volumes of each pixel, rows from the top; `None` of one that shows no surface.
    pub counts: Vec<Option<u32>>,
}

/// Colours from one volume to the most, dark to light (van der Walt and Smith 2015, viridis).
const COLOURS: [[f64; 3]; 6] = [
    [68.0, 1.0, 84.0],
    [65.0, 68.0, 135.0],
    [42.0, 120.0, 142.0],
    [34.0, 168.0, 132.0],
    [122.0, 209.0, 81.0],
    [253.0, 231.0, 37.0],
];
/// Of pixels in no volume, and of those that show no surface.
const NONE: [u8; 3] = [0; 3];
const NO_SURFACE: [u8; 3] = [0xd8; 3];

/// Size of the scale, and what is left of it and above.
const SCALE: [f64; 2] = [520.0, 16.0];
const AT: [f64; 2] = [150.0, 12.0];

impl Overdraw {
    /// Mean over the pixels that show a surface; NaN where none does.
    pub fn mean(&self) -> f64 {
        let there = self.counts.iter().flatten();
        there.clone().map(|count| f64::from(*count)).sum::<f64>() / there.count() as f64
    }

    /// The most of a pixel.
    pub fn most(&self) -> u32 {
        self.counts.iter().flatten().copied().max().unwrap_or(0)
    }

    /// As colours of a scale that ends at `most`.
    pub fn picture(&self, most: u32) -> Picture {
        let colour = |count: &Option<u32>| match count {
            None => NO_SURFACE,
            Some(0) => NONE,
            Some(count) => colour(share(f64::from(*count), most)),
        };
        Picture { width: self.width, height: self.height, pixels: self.counts.iter().map(colour).collect() }
    }
}

/// Where a count from 1 on is on the scale, 0 … 1: by its logarithm.
fn share(count: f64, most: u32) -> f64 {
    // One volume of at most one is the end.
    if most > 1 { (count.ln() / f64::from(most).ln()).clamp(0.0, 1.0) } else { 1.0 }
}

fn colour(share: f64) -> [u8; 3] {
    let place = share * (COLOURS.len() - 1) as f64;
    let (below, part) = ((place as usize).min(COLOURS.len() - 2), place.fract());
    let part = if place as usize > below { 1.0 } else { part };
    [0, 1, 2].map(|i| (COLOURS[below][i] + part * (COLOURS[below + 1][i] - COLOURS[below][i])).round() as u8)
}

impl Found {
    /// The most of all scenes, where the scale ends.
    pub fn most_overdraw(&self) -> u32 {
        self.scenes.iter().map(|found| found.overdraw[0].most()).max().unwrap_or(0)
    }

    /// Fig. 5, a scene a row: how many volumes a pixel lies in, and accessibility by AOV, Volumetric, Crytek.
    pub fn figure_5(&self) -> Picture {
        let most = self.most_overdraw();
        let rows: Vec<Picture> = self
            .scenes
            .iter()
            .map(|found| {
                let mut row = vec![found.overdraw[0].picture(most)];
                let others = SHOWN.iter().zip(&found.pictures).filter(|(of, _)| !matches!(of, Of::Rays(_)));
                row.extend(others.map(|(_, picture)| picture.clone()));
                beside(&row)
            })
            .collect();
        above(&rows)
    }

    /// What its colours mean.
    pub fn overdraw_scale(&self) -> Drawing {
        let most = self.most_overdraw();
        let mut drawing = Drawing::new(AT[0] + SCALE[0] + 180.0, AT[1] + SCALE[1] + 26.0);
        let hex = |[r, g, b]: [u8; 3]| format!("#{r:02x}{g:02x}{b:02x}");
        let below = AT[1] + SCALE[1] + 14.0;
        let steps = SCALE[0] as u32 / 4;
        for step in 0..steps {
            let share = (f64::from(step) + 0.5) / f64::from(steps);
            let at = [AT[0] + 4.0 * f64::from(step), AT[1]];
            drawing.rectangle(at, [4.0, SCALE[1]], &hex(colour(share)));
        }
        let decades = (0..10).flat_map(|decade| [1, 2, 5].map(|part| part * 10_u32.pow(decade)));
        let ticks = decades.take_while(|tick| *tick <= most);
        // The end is said, and what would stand in its way is not.
        let end = |tick: &u32| *tick == most || share(f64::from(*tick), most) < 0.93;
        for tick in ticks.filter(end).chain([most]) {
            let x = AT[0] + SCALE[0] * share(f64::from(tick), most);
            drawing.line([x, AT[1] + SCALE[1]], [x, AT[1] + SCALE[1] + 3.0], INK, 1.0, false);
            drawing.text([x, below], &tick.to_string(), 11, Anchor::Middle, INK, false);
        }
        for (x, fill, text) in
            [(0.0, NONE, "in no volume"), (AT[0] + SCALE[0] + 30.0, NO_SURFACE, "no surface")]
        {
            drawing.rectangle([x, AT[1]], [24.0, SCALE[1]], &hex(fill));
            drawing.text([x + 30.0, AT[1] + 13.0], text, 11, Anchor::Start, INK, false);
        }
        drawing
    }

    /// Fig. 5 in numbers.
    pub fn overdraws(&self) -> String {
        let rows: Vec<Vec<String>> = self
            .scenes
            .iter()
            .map(|found| {
                let [own, clamped] = &found.overdraw;
                let mut row = vec![found.scene.name.clone(), found.triangles.to_string()];
                row.extend([short(own.mean()), own.most().to_string()]);
                row.extend([short(clamped.mean()), clamped.most().to_string()]);
                row
            })
            .collect();
        let head = ["", "volumes in all", "of a pixel, mean", "most", "clamped at 2 δ, mean", "most"];
        table(&head, 1, &rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_have_a_mean_a_most_and_colours_from_dark_to_light() {
        let counts = vec![Some(0), Some(1), None, Some(8), Some(64), Some(2)];
        let overdraw = Overdraw { width: 3, height: 2, counts };
        assert_eq!((overdraw.mean(), overdraw.most()), (15.0, 64));
        let Picture { pixels, .. } = overdraw.picture(64);
        let ends = [COLOURS[0], COLOURS[5]].map(|end| end.map(|part| part as u8));
        assert_eq!((pixels[0], pixels[1], pixels[2], pixels[4]), (NONE, ends[0], NO_SURFACE, ends[1]));
        // Half of the logarithm is half of the colours.
        assert_eq!(pixels[3], colour(0.5));
        let light = |[r, g, b]: [u8; 3]| u32::from(r) + 2 * u32::from(g) + u32::from(b);
        assert!(
            (1..=20).all(|i| light(colour(f64::from(i) / 20.0)) > light(colour(f64::from(i - 1) / 20.0)))
        );
        // What is in one volume, where nothing is in more, is seen.
        assert_ne!(Overdraw { width: 1, height: 1, counts: vec![Some(1)] }.picture(1).pixels[0], NONE);
    }
}
