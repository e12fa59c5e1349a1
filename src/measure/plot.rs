//! Charts, drawn once for SVG and PNG: lines, markers, text, and axes that map data to them. Knows nothing of what is measured.
//!
//! Lengths are pixels from the top left corner. SVGs hold no style sheet, script or reference, so that they may stand inside
//! a page.

use crate::{Error, Result};
use kuva::backend::png::PngBackend;
use kuva::backend::svg::SvgBackend;
use kuva::render::color::Color;
use kuva::render::render::{PathData, Primitive, Scene, TextAnchor};

/// Where a text stands relative to its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// Begins there.
    Start,
    /// Is centred there.
    Middle,
    /// Ends there.
    End,
}

/// Shape of a data point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marker {
    /// ●
    Circle,
    /// ■
    Square,
    /// ▲
    Triangle,
    /// ▼
    Down,
    /// ▶
    Right,
    /// ◀
    Left,
    /// ◆
    Diamond,
    /// ⬢
    Hexagon,
}

/// Colour of axes and of text that is not about one series.
pub const INK: &str = "#222222";

/// Colour of grid lines.
const GRID: &str = "#e4e4e4";

/// Pixels of a PNG for each of the drawing: sharp on dense screens and in print.
const PNG_SCALE: f32 = 2.0;

/// Width of a character in em: that of DejaVu Sans in the mean, a little more than that of other sans-serif fonts.
const EM: f64 = 0.58;

/// Width in pixels that a text of this size takes.
pub fn text_width(text: &str, size: u32) -> f64 {
    EM * f64::from(size) * text.chars().count() as f64
}

/// A list of shapes.
pub struct Drawing {
    scene: Scene,
}

impl Drawing {
    /// A white sheet of this size.
    pub fn new(width: f64, height: f64) -> Self {
        let mut scene = Scene::new(width, height);
        scene.font_family = Some("DejaVu Sans, Verdana, sans-serif".into());
        Self { scene }
    }

    /// A straight line; dashed if `dashed`.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], colour: &str, width: f64, dashed: bool) {
        self.polyline(&[from, to], colour, width, dashed);
    }

    /// Connected lines.
    pub fn polyline(&mut self, points: &[[f64; 2]], colour: &str, width: f64, dashed: bool) {
        if points.len() > 1 {
            self.scene.add(Primitive::PolyLine {
                points: points.iter().map(|p| (p[0], p[1])).collect(),
                stroke: Color::from(colour),
                stroke_width: width,
                stroke_dasharray: dashed.then(|| "5 4".into()),
            });
        }
    }

    /// A filled rectangle: its top left corner, its size.
    pub fn rectangle(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], fill: &str) {
        self.scene.add(Primitive::Rect {
            x,
            y,
            width,
            height,
            fill: Color::from(fill),
            stroke: None,
            stroke_width: None,
            opacity: None,
        });
    }

    /// A data point, its radius in pixels; hollow ones have a white inside.
    pub fn marker(&mut self, marker: Marker, at: [f64; 2], radius: f64, colour: &str, hollow: bool) {
        let fill = if hollow { "#ffffff" } else { colour };
        let [x, y] = at;
        if marker == Marker::Circle {
            self.scene.add(Primitive::Circle {
                cx: x,
                cy: y,
                r: radius,
                fill: Color::from(fill),
                fill_opacity: None,
                stroke: Some(Color::from(colour)),
                stroke_width: Some(1.5),
            });
            return;
        }
        let corners: &[[f64; 2]] = match marker {
            Marker::Square => &[[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]],
            Marker::Triangle => &[[0.0, -1.2], [1.1, 0.8], [-1.1, 0.8]],
            Marker::Down => &[[0.0, 1.2], [1.1, -0.8], [-1.1, -0.8]],
            Marker::Right => &[[1.2, 0.0], [-0.8, 1.1], [-0.8, -1.1]],
            Marker::Left => &[[-1.2, 0.0], [0.8, 1.1], [0.8, -1.1]],
            Marker::Hexagon => {
                &[[0.0, -1.2], [1.05, -0.6], [1.05, 0.6], [0.0, 1.2], [-1.05, 0.6], [-1.05, -0.6]]
            }
            Marker::Circle | Marker::Diamond => &[[0.0, -1.25], [1.25, 0.0], [0.0, 1.25], [-1.25, 0.0]],
        };
        let mut d = String::new();
        for (i, c) in corners.iter().enumerate() {
            let (command, px, py) = (if i == 0 { 'M' } else { 'L' }, x + radius * c[0], y + radius * c[1]);
            d += &format!("{command} {px:.2} {py:.2} ");
        }
        d.push('Z');
        self.scene.add(Primitive::Path(Box::new(PathData {
            d,
            fill: Some(Color::from(fill)),
            stroke: Color::from(colour),
            stroke_width: 1.5,
            opacity: None,
            stroke_dasharray: None,
        })));
    }

    /// A line of text, its base line at `at`.
    pub fn text(&mut self, at: [f64; 2], text: &str, size: u32, anchor: Anchor, colour: &str, bold: bool) {
        self.write(at, text, size, anchor, colour, bold, None);
    }

    /// Text that runs upwards, centred at `at`.
    pub fn upward_text(&mut self, at: [f64; 2], text: &str, size: u32) {
        self.write(at, text, size, Anchor::Middle, INK, false, Some(-90.0));
    }

    #[expect(clippy::too_many_arguments, reason = "what a text is, each named once, for the two above")]
    fn write(
        &mut self,
        [x, y]: [f64; 2],
        text: &str,
        size: u32,
        anchor: Anchor,
        colour: &str,
        bold: bool,
        rotate: Option<f64>,
    ) {
        self.scene.add(Primitive::Text {
            x,
            y,
            content: text.into(),
            size,
            anchor: match anchor {
                Anchor::Start => TextAnchor::Start,
                Anchor::Middle => TextAnchor::Middle,
                Anchor::End => TextAnchor::End,
            },
            rotate,
            bold,
            color: Some(Color::from(colour)),
        });
    }

    /// The drawing as an SVG file.
    pub fn svg(&self) -> String {
        SvgBackend::new().render_scene(&self.scene)
    }

    /// The drawing as a PNG file, two pixels for one.
    pub fn png(&self) -> Result<Vec<u8>> {
        let refused = |problem| Error::refused("chart", problem);
        PngBackend::new().with_scale(PNG_SCALE).render_scene(&self.scene).map_err(refused)
    }
}

/// One axis of a chart.
#[derive(Clone, Debug)]
pub struct Axis {
    /// What it shows, with its unit.
    pub label: String,
    /// Least and largest value shown.
    pub range: [f64; 2],
    /// Logarithmic? Then the range is positive.
    pub log: bool,
}

impl Axis {
    /// A linear axis over these values and 0.
    pub fn linear(label: impl Into<String>, values: impl Iterator<Item = f64>) -> Self {
        let [low, high] = spread(values, [0.0, 0.0]);
        let high = if high > low { high + 0.05 * (high - low) } else { low + 1.0 };
        Self { label: label.into(), range: [low, high], log: false }
    }

    /// A logarithmic axis with a little room around the positive ones of these values.
    pub fn log(label: impl Into<String>, values: impl Iterator<Item = f64>) -> Self {
        let positive = values.filter(|v| *v > 0.0);
        let [low, high] = spread(positive, [f64::INFINITY, 0.0]);
        let (low, high) = if high > 0.0 { (low, high) } else { (0.1, 1.0) };
        Self { label: label.into(), range: [low / 1.6, high * 1.6], log: true }
    }

    /// Where a value lies, 0 … 1; values that an axis cannot show lie at its ends.
    fn share(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        let share = match self.log {
            true => (value.max(low) / low).ln() / (high / low).ln(),
            false => (value - low) / (high - low),
        };
        share.clamp(0.0, 1.0)
    }

    /// Values with a number beside them, and those with a grid line only.
    fn ticks(&self) -> (Vec<f64>, Vec<f64>) {
        let [low, high] = self.range;
        let inside = |v: &f64| (low..=high).contains(v);
        if self.log {
            let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
            let times = |factors: &'static [f64]| {
                decades.clone().flat_map(move |d| factors.iter().map(move |f| f * 10f64.powi(d)))
            };
            let major: Vec<f64> = times(&[1.0]).filter(inside).collect();
            // Where a decade or two is all there is, its parts are numbered too.
            let major = match major.len() {
                0..=2 => times(&[1.0, 2.0, 5.0]).filter(inside).collect(),
                _ => major,
            };
            return (major, times(&[2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]).filter(inside).collect());
        }
        let rough = (high - low) / 5.0;
        let unit = 10f64.powf(rough.log10().floor());
        let step = unit * [1.0, 2.0, 5.0, 10.0].into_iter().find(|s| s * unit >= rough).unwrap_or(10.0);
        let first = (low / step).ceil() as i64;
        let last = (high / step).floor() as i64;
        ((first..=last).map(|i| i as f64 * step).collect(), Vec::new())
    }
}

fn spread(values: impl Iterator<Item = f64>, [low, high]: [f64; 2]) -> [f64; 2] {
    let finite = values.filter(|v| v.is_finite());
    finite.fold([low, high], |[low, high], v| [low.min(v), high.max(v)])
}

/// A number as an axis or a table shows it: three digits, without zeros that say nothing.
pub fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let digits = (2 - value.abs().log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{value:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').into(),
        false => text,
    }
}

/// The rectangle of a chart in which data lie, with its two axes.
pub struct Panel {
    /// Top left corner.
    pub at: [f64; 2],
    /// Width and height.
    pub size: [f64; 2],
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
}

impl Panel {
    /// Place of a data point.
    pub fn place(&self, x: f64, y: f64) -> [f64; 2] {
        [self.at[0] + self.x.share(x) * self.size[0], self.at[1] + (1.0 - self.y.share(y)) * self.size[1]]
    }

    /// Draws title, grid, frame, numbers and labels.
    pub fn draw(&self, drawing: &mut Drawing, title: &str) {
        let ([left, top], [width, height]) = (self.at, self.size);
        let (right, bottom) = (left + width, top + height);
        let (numbered, minor) = self.x.ticks();
        for value in minor.iter().chain(&numbered) {
            let [x, _] = self.place(*value, self.y.range[0]);
            drawing.line([x, top], [x, bottom], GRID, 1.0, false);
        }
        for value in numbered {
            let [x, _] = self.place(value, self.y.range[0]);
            drawing.text([x, bottom + 16.0], &short(value), 11, Anchor::Middle, INK, false);
        }
        let (numbered, minor) = self.y.ticks();
        for value in minor.iter().chain(&numbered) {
            let [_, y] = self.place(self.x.range[0], *value);
            drawing.line([left, y], [right, y], GRID, 1.0, false);
        }
        let mut widest = 0.0_f64;
        for value in numbered {
            let [_, y] = self.place(self.x.range[0], value);
            drawing.text([left - 6.0, y + 4.0], &short(value), 11, Anchor::End, INK, false);
            widest = widest.max(text_width(&short(value), 11));
        }
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]];
        drawing.polyline(&corners, INK, 1.0, false);
        drawing.text([left, top - 8.0], title, 14, Anchor::Start, INK, true);
        let middle = left + 0.5 * width;
        drawing.text([middle, bottom + 34.0], &self.x.label, 12, Anchor::Middle, INK, false);
        drawing.upward_text([left - 14.0 - widest, top + 0.5 * height], &self.y.label, 12);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel() -> Panel {
        let x = Axis { label: "time".into(), range: [0.1, 10.0], log: true };
        let y = Axis { label: "error".into(), range: [0.0, 4.0], log: false };
        Panel { at: [50.0, 20.0], size: [200.0, 100.0], x, y }
    }

    #[test]
    fn axes_map_their_ends_to_the_corners_and_their_middle_to_the_middle() {
        let p = panel();
        assert_eq!(p.place(0.1, 0.0), [50.0, 120.0]);
        assert_eq!(p.place(10.0, 4.0), [250.0, 20.0]);
        let [x, y] = p.place(1.0, 2.0);
        assert!((x - 150.0).abs() < 1e-9 && (y - 70.0).abs() < 1e-9);
        // Zero has no logarithm, and nothing leaves the panel.
        assert_eq!(p.place(0.0, 9.0), [50.0, 20.0]);
    }

    #[test]
    fn ticks_are_inside_the_range_and_at_least_two() {
        for range in [[0.1, 10.0], [0.02, 0.09], [3.0, 2.5e4]] {
            let (numbered, _) = Axis { label: String::new(), range, log: true }.ticks();
            assert!(numbered.len() >= 2, "{range:?}: {numbered:?}");
            assert!(numbered.iter().all(|t| (range[0]..=range[1]).contains(t)));
        }
        let (numbered, _) = Axis::linear("", [3.0, 17.0].into_iter()).ticks();
        assert_eq!(numbered, [0.0, 5.0, 10.0, 15.0]);
    }

    #[test]
    fn numbers_are_short() {
        for (value, text) in
            [(0.0, "0"), (1.0, "1"), (0.012345, "0.0123"), (1234.6, "1235"), (2.50, "2.5"), (1e-5, "0.00001")]
        {
            assert_eq!(short(value), text);
        }
    }

    #[test]
    fn what_is_drawn_is_in_both_files() {
        let mut drawing = Drawing::new(300.0, 160.0);
        panel().draw(&mut drawing, "a <title> & more");
        drawing.marker(Marker::Triangle, panel().place(1.0, 1.0), 4.0, "#cc0000", false);
        let svg = drawing.svg();
        assert!(svg.contains("a &lt;title&gt; &amp; more") && svg.contains("#cc0000"), "{svg}");
        assert!(!svg.contains("<style") && !svg.contains("<script"), "{svg}");
        let png = image::load_from_memory(&drawing.png().unwrap()).unwrap().to_rgb8();
        assert_eq!(png.dimensions(), (600, 320));
        let [x, y] = panel().place(1.0, 1.0).map(|c| (2.0 * c) as u32);
        assert_eq!(png.get_pixel(x, y).0, [0xcc, 0, 0]);
        assert_eq!(png.get_pixel(1, 1).0, [255; 3]);
    }
}
