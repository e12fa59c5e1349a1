//! Transfer functions: what opacity and colour a data value has.
//!
//! Both are piecewise linear over *data values* (Hounsfield units where the volume is in Hounsfield units; never the
//! stored integers before slope and intercept), and constant beyond their first and last points. Opacity is per
//! *reference length*: a ray that crosses one reference length of constant opacity `a` keeps the share `1 - a` of its
//! light. Two points of equal value make a step; at the value itself the second one holds.

use crate::error::quoted;
use crate::values::FARTHEST;
use crate::{Error, Result};

/// Most points that opacity or colour may have: kernels keep them in a uniform block of fixed size.
pub const MAX_POINTS: usize = 64;

/// Preset names and what each is for. See [`TransferFunction::preset`].
pub const PRESETS: [(&str, &str); 5] = [
    ("auto", "ct-bone where the data look like Hounsfield units, else paper"),
    ("ct-bone", "CT: bone, all softer tissue transparent"),
    ("ct-soft", "CT: translucent skin and soft tissue over bone"),
    ("mr", "MR: brightness to opacity over the range of the data"),
    ("paper", "one colour and a steep opacity edge for any data, as in the CAO paper's pictures"),
];

/// Below this smallest value data are taken for Hounsfield units: air is -1000, and no 8-bit or MR volume goes there.
const HOUNSFIELD_AIR: f64 = -500.0;

/// Data nearer to 0 than this are all 0 to the device, or the distances of a preset's points are.
const SMALLEST: f64 = 1e-36;

/// The Hounsfield window that data of another range are taken to show from end to end.
const HOUNSFIELD_WINDOW: (f64, f64) = (-1000.0, 1500.0);

/// Piecewise-linear opacity and colour over data values.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferFunction {
    /// `[value, opacity]`, values ascending, opacity in \[0, 1\] per reference length.
    pub opacity: Vec<[f32; 2]>,
    /// `[value, r, g, b]`, values ascending, linear (not sRGB) components in \[0, 1\].
    pub colour: Vec<[f32; 4]>,
    /// Length in mm that the opacities are for; `None` is the volume's smallest spacing.
    pub reference_mm: Option<f32>,
}

impl TransferFunction {
    /// A checked transfer function; arguments as the fields.
    ///
    /// # Errors
    /// [`Error::Config`] naming `opacity`, `colour` or `reference_mm`: no points, more than [`MAX_POINTS`], values
    /// that are not finite, do not ascend, or are equal three times; opacity or colour outside \[0, 1\]; a reference
    /// length that is not positive.
    pub fn new(opacity: Vec<[f32; 2]>, colour: Vec<[f32; 4]>, reference_mm: Option<f32>) -> Result<Self> {
        let made = Self { opacity, colour, reference_mm };
        made.check()?;
        Ok(made)
    }

    /// Is it what [`TransferFunction::new`] would accept? For one whose fields were changed by hand.
    ///
    /// # Errors
    /// As [`TransferFunction::new`].
    pub fn check(&self) -> Result<()> {
        check_points("opacity", &self.opacity)?;
        check_points("colour", &self.colour)?;
        match self.reference_mm {
            Some(mm) if !(mm.is_finite() && mm > 0.0) => {
                Err(Error::refused("reference_mm", format!("{mm}: expected a length > 0 mm")))
            }
            _ => Ok(()),
        }
    }

    /// Opacity per reference length of data value `value`, in \[0, 1\].
    pub fn opacity_at(&self, value: f32) -> f32 {
        let [opacity] = interpolate(&self.opacity, value, |point| [point[1]]);
        opacity
    }

    /// Linear r, g, b of data value `value`, each in \[0, 1\].
    pub fn colour_at(&self, value: f32) -> [f32; 3] {
        interpolate(&self.colour, value, |point| [point[1], point[2], point[3]])
    }

    /// Largest opacity of any value in `low..=high`: never less than [`opacity_at`](Self::opacity_at) anywhere in it,
    /// and reached (or, at the lower side of a step, approached) there. What empty-space skipping asks of a brick.
    pub fn max_opacity_in(&self, low: f32, high: f32) -> f32 {
        let ends = self.opacity_at(low).max(self.opacity_at(high));
        // Between its points the function is linear, so its largest value is at one of them or at an end. A point at
        // `low` itself counts only where it holds there, which the end has seen to.
        let inside = self.opacity.iter().filter(|[value, _]| low < *value && *value <= high);
        inside.fold(ends, |most, [_, opacity]| most.max(*opacity))
    }

    /// Values of opacity 0, the one nearest to `low` first: `low` itself, or where the function begins or ends to be 0. Empty where it
    /// is 0 nowhere.
    pub fn transparent_near(&self, low: f32) -> Vec<f32> {
        let at_points = self.opacity.iter().flat_map(|[value, _]| [*value, value.next_down()]);
        let mut found: Vec<f32> =
            std::iter::once(low).chain(at_points).filter(|v| self.opacity_at(*v) == 0.0).collect();
        found.sort_by(|a, b| (a - low).abs().total_cmp(&(b - low).abs()));
        found
    }

    /// Reference length in mm for a volume whose smallest spacing is `min_spacing` mm.
    pub fn reference_mm(&self, min_spacing: f64) -> f32 {
        self.reference_mm.unwrap_or(min_spacing as f32)
    }

    /// A preset of [`PRESETS`] for data whose values run over `range` (smallest, largest).
    ///
    /// `ct-bone` and `ct-soft` are written in Hounsfield units and are used as they stand where the smallest value is
    /// below -500; other data are taken to show the window -1000…1500 HU from the smallest to the largest value.
    /// `mr` and `paper` are written in shares of the range. A range of one value is widened to include 0 (or 1); so is one whose values
    /// are the same to 32-bit floating point, or nearly.
    ///
    /// # Errors
    /// [`Error::Config`] for a name that is none of [`PRESETS`], a range that is not finite or descends, or data that no preset can tell
    /// apart: beyond [`FARTHEST`], or all but 0.
    pub fn preset(name: &str, range: (f64, f64)) -> Result<Self> {
        if !(range.0.is_finite() && range.1.is_finite() && range.0 <= range.1) {
            let problem = format!("data run from {} to {}: expected two ascending numbers", range.0, range.1);
            return Err(Error::refused("range", problem));
        }
        let (low, high) = range;
        let run = |problem: &str| {
            let problem = format!("the data run from {low:?} to {high:?}, {problem}");
            Err(Error::refused(&format!("preset {}", quoted(name)), problem))
        };
        if low < -FARTHEST || high > FARTHEST {
            return run(&format!(
                "farther than {FARTHEST:.1e} from 0, which no preset can show; values that stand for `no data` can be read as others \
                 (--nan VALUE|transparent), or a transfer function of your own says what the values mean (--transfer FILE)"
            ));
        }
        let largest = low.abs().max(high.abs());
        if largest > 0.0 && largest < SMALLEST {
            return run(
                "too near to 0 to be told apart; expected larger values, or the same in a smaller unit",
            );
        }
        let hounsfield = low < HOUNSFIELD_AIR;
        let (opacity, colour): (Points<f32>, Points<u32>) = match name {
            "auto" => return Self::preset(if hounsfield { "ct-bone" } else { "paper" }, range),
            "ct-bone" => (
                &[(150.0, 0.0), (300.0, 0.3), (600.0, 0.8), (1500.0, 0.95)],
                &[(150.0, 0xb5653b), (350.0, 0xe3cba0), (900.0, 0xfaf2e1), (1500.0, 0xffffff)],
            ),
            "ct-soft" => (
                &[
                    (-400.0, 0.0),
                    (-200.0, 0.03),
                    (-50.0, 0.01),
                    (20.0, 0.015),
                    (100.0, 0.04),
                    (200.0, 0.15),
                    (400.0, 0.85),
                ],
                &[
                    (-400.0, 0xe0a080),
                    (-50.0, 0xe8b890),
                    (60.0, 0xb04a3a),
                    (200.0, 0xd08060),
                    (400.0, 0xf5ead5),
                ],
            ),
            "mr" => (
                &[(0.08, 0.0), (0.25, 0.05), (0.45, 0.3), (0.75, 0.8), (1.0, 0.9)],
                &[(0.08, 0x6b2f2a), (0.35, 0xb87a68), (0.6, 0xdcc4b4), (1.0, 0xffffff)],
            ),
            "paper" => (&[(0.2, 0.0), (0.3, 0.9), (1.0, 0.95)], &[(0.0, 0xe6d9c4)]),
            _ => {
                return Err(Error::refused(
                    "transfer",
                    format!("no preset {}; expected one of {}", quoted(name), preset_names()),
                ));
            }
        };
        let placed = |(low, high): (f64, f64)| {
            let (air, bone) = HOUNSFIELD_WINDOW;
            let place = |at: f64| match (name.starts_with("ct-"), hounsfield) {
                (true, true) => at as f32,
                (true, false) => (low + (at - air) / (bone - air) * (high - low)) as f32,
                (false, _) => (low + at * (high - low)) as f32,
            };
            Self {
                opacity: opacity.iter().map(|&(at, opacity)| [place(at), opacity]).collect(),
                colour: colour.iter().map(|&(at, rgb)| coloured(place(at), from_hex(rgb))).collect(),
                reference_mm: None,
            }
        };
        let made = placed(widened(range));
        // Points that fell together: to 32 bits the data are one value.
        let told_apart = made.opacity.is_sorted_by(|a, b| a[0] < b[0]);
        let made = if told_apart { made } else { placed(widened((high, high))) };
        made.check()?;
        Ok(made)
    }

    /// Is `name` one of [`PRESETS`]?
    pub fn is_preset(name: &str) -> bool {
        PRESETS.iter().any(|(preset, _)| *preset == name)
    }
}

/// A preset's points: where (Hounsfield units or share of the range), and opacity or 0xrrggbb there.
type Points<T> = &'static [(f64, T)];

/// The names of [`PRESETS`].
pub fn preset_names() -> String {
    PRESETS.map(|(name, _)| name).join(", ")
}

/// A range that is one value says nothing about scale; zero does.
fn widened((low, high): (f64, f64)) -> (f64, f64) {
    match low == high {
        true if low == 0.0 => (0.0, 1.0),
        true => (low.min(0.0), low.max(0.0)),
        false => (low, high),
    }
}

fn check_points<const N: usize>(key: &str, points: &[[f32; N]]) -> Result<()> {
    if points.is_empty() {
        return Err(Error::refused(key, "has no points: expected at least one"));
    }
    if points.len() > MAX_POINTS {
        return Err(Error::refused(
            key,
            format!("has {} points: expected at most {MAX_POINTS}", points.len()),
        ));
    }
    for (i, point) in points.iter().enumerate() {
        let at = format!("{key}[{i}]");
        let value = point[0];
        // The difference of two values must be a number too.
        if !value.is_finite() || f64::from(value.abs()) > FARTHEST {
            return Err(Error::refused(&at, format!("value {value}: expected a finite number below 8.5e37")));
        }
        if let Some(wrong) = point[1..].iter().find(|c| !(0.0..=1.0).contains(*c)) {
            return Err(Error::refused(&at, format!("{wrong}: expected a number from 0 to 1")));
        }
        if i >= 1 && value < points[i - 1][0] {
            let before = points[i - 1][0];
            return Err(Error::refused(
                &at,
                format!("value {value} after {before}: expected ascending values"),
            ));
        }
        if i >= 2 && value == points[i - 2][0] {
            let problem =
                format!("value {value} for the third time: two equal values make a step, more mean nothing");
            return Err(Error::refused(&at, problem));
        }
    }
    Ok(())
}

/// Linear between points, constant beyond; at a step the second point holds. Values that are NaN get the first point.
fn interpolate<const N: usize, const M: usize>(
    points: &[[f32; N]],
    value: f32,
    pick: impl Fn(&[f32; N]) -> [f32; M],
) -> [f32; M] {
    let above = points.partition_point(|point| point[0] <= value);
    if above == 0 || above == points.len() {
        return points.get(above.saturating_sub(1)).map_or([0.0; M], pick);
    }
    let (left, right) = (&points[above - 1], &points[above]);
    let t = (value - left[0]) / (right[0] - left[0]);
    let (a, b) = (pick(left), pick(right));
    // Clamped to its ends: rounding must not exceed what `max_opacity_in` promises.
    std::array::from_fn(|c| (a[c] + t * (b[c] - a[c])).clamp(a[c].min(b[c]), a[c].max(b[c])))
}

/// The point of a colour function at `value`.
pub fn coloured(value: f32, [r, g, b]: [f32; 3]) -> [f32; 4] {
    [value, r, g, b]
}

/// 0xrrggbb to linear components.
pub fn from_hex(rgb: u32) -> [f32; 3] {
    [16, 8, 0].map(|shift| to_linear(f64::from(rgb >> shift & 0xff) / 255.0))
}

/// sRGB component to linear, IEC 61966-2-1.
pub fn to_linear(srgb: f64) -> f32 {
    (if srgb <= 0.04045 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }) as f32
}

/// Inverse of [`to_linear`], in f64 so that writing and reading a colour gives it back bit for bit.
pub fn to_srgb(linear: f32) -> f64 {
    let linear = f64::from(linear);
    let srgb =
        if linear <= 0.040_45 / 12.92 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    srgb.clamp(0.0, 1.0)
}
