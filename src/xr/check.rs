//! Whether two eyes' pictures are what they should be: not empty, not the same, and the same point equally lit in both.
//!
//! In: for each eye its view, colours as displayed (sRGB, 8 bits) and Vulkan depths. Out: shares. Cost: one projection a pixel.
//!
//! A pixel of the left eye shows a point of the volume: pixel's ray and depth say where it is. Projected into the right eye that point
//! lies between four pixels. Where their depths say that they show the same surface, nothing hides the point there, and its colour must be
//! one that these four span, to two levels of 255: the right eye shows it nowhere else, only points around it.

#![forbid(unsafe_code)]

use cao::View;
use cao::glam::{Vec2, Vec3};

/// What one eye was shown.
#[derive(Clone, Debug)]
pub struct Eye {
    /// Where from.
    pub view: View,
    /// Width and height.
    pub size: [u32; 2],
    /// Premultiplied sRGB and opacity, rows from the top.
    pub colours: Vec<[u8; 4]>,
    /// By the view's planes, as many.
    pub depths: Vec<f32>,
}

/// Most by which a colour may lie outside of what four neighbours span, in levels of 255: each of two pixels is rounded to 8 bits, half
/// a level each, and each of their rays ends where what remains is worth half a level (`Look::tolerance`).
const LEVELS: i16 = 2;

/// Neighbours whose distances from the eye differ by more than this share of the distance show different surfaces: the steps between pixels of
/// a surface that leans away by 70° at 100 pixels a radian are 3 %.
const SURFACE: f32 = 0.03;

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// Pixels of the left and of the right eye that show something, of all.
    pub covered: [f64; 2],
    /// Pixels that differ between the eyes, of all.
    pub different: f64,
    /// Points that both eyes see.
    pub points: usize,
    /// Of them those equally lit.
    pub equal: f64,
    /// The control: those that are so where the right eye is read [`ASIDE`] pixels from where the point is.
    pub control: f64,
}

/// How far the control reads beside the point.
pub const ASIDE: f32 = 6.0;

impl Verdict {
    /// Least share of pixels that show something: the volume stands before the eyes.
    const COVERED: f64 = 0.01;
    /// Least share of pixels that differ: the eyes are at different places.
    const DIFFERENT: f64 = 0.005;
    /// Fewest points that say anything.
    const POINTS: usize = 500;
    /// Least share of equally lit points. Not all are: where the picture has detail finer than a pixel, four pixels do not span what lies
    /// between them.
    const EQUAL: f64 = 0.95;
    /// The control must fall short by so much: else the picture could not show a difference.
    const BELOW: f64 = 0.2;

    /// Most that the rehearsed clip leaves of what is covered: its hand reaches through the volume. The head moves a little between two
    /// frames, and with it what is covered.
    const LEFT_OVER: f64 = 0.85;

    /// What is wrong with this first frame and a last one after it.
    pub fn problems_until(&self, last: &Self) -> Vec<String> {
        let mut wrong = Vec::new();
        for (when, verdict) in [("first", self), ("last", last)] {
            wrong.extend(verdict.problems().into_iter().map(|problem| format!("{when} frame: {problem}")));
        }
        let [before, after] = [self, last].map(|verdict| verdict.covered[0]);
        if after > before * Self::LEFT_OVER {
            wrong.push(format!(
                "the clip takes nothing away: {:.2} % of the pixels are covered at first, {:.2} % at last",
                before * 100.0,
                after * 100.0
            ));
        }
        wrong
    }

    /// Looks at both pictures.
    pub fn of(left: &Eye, right: &Eye) -> Self {
        let all = left.colours.len().max(1) as f64;
        let differing = left.colours.iter().zip(&right.colours).filter(|(a, b)| a != b).count();
        let (points, equal) = lit(left, right, 0.0);
        let (others, control) = lit(left, right, ASIDE);
        let share = |some: usize, of: usize| some as f64 / of.max(1) as f64;
        Self {
            covered: [left, right]
                .map(|eye| (0..eye.colours.len()).filter(|&i| eye.shows(i)).count() as f64 / all),
            different: differing as f64 / all,
            points,
            equal: share(equal, points),
            control: share(control, others),
        }
    }

    /// What is wrong, in words; nothing where all is well.
    fn problems(&self) -> Vec<String> {
        let mut wrong = Vec::new();
        for (eye, covered) in ["left", "right"].iter().zip(self.covered) {
            if covered < Self::COVERED {
                wrong.push(format!(
                    "the {eye} view is empty: {:.2} % of its pixels show something",
                    covered * 100.0
                ));
            }
        }
        if self.different < Self::DIFFERENT {
            wrong.push(format!(
                "both views are the same: {:.2} % of the pixels differ",
                self.different * 100.0
            ));
        }
        if self.points < Self::POINTS {
            wrong.push(format!(
                "only {} points are seen by both eyes, expected {}",
                self.points,
                Self::POINTS
            ));
        }
        if self.equal < Self::EQUAL {
            wrong.push(format!(
                "{:.2} % of the points that both eyes see are equally lit, expected {:.0} %",
                self.equal * 100.0,
                Self::EQUAL * 100.0
            ));
        }
        if self.control > self.equal - Self::BELOW {
            wrong.push(format!(
                "the control is equally lit in {:.2} % of the points, which leaves nothing to be told from",
                self.control * 100.0
            ));
        }
        wrong
    }
}

/// Points seen by both eyes, and those of them equally lit where the right eye is read so many pixels beside.
fn lit(left: &Eye, right: &Eye, aside: f32) -> (usize, usize) {
    let (mut points, mut equal) = (0, 0);
    for (i, colour) in left.colours.iter().enumerate() {
        // Behind what is not opaque each eye sees something else.
        if !left.opaque(i) {
            continue;
        }
        let Some(quad) = right.around(left.point(i), aside) else { continue };
        points += 1;
        let within = |channel: usize| {
            let spanned = quad.map(|j| i16::from(right.colours[j][channel]));
            let (low, high) = (spanned.into_iter().min(), spanned.into_iter().max());
            let value = i16::from(colour[channel]);
            low.is_some_and(|low| value >= low - LEVELS) && high.is_some_and(|high| value <= high + LEVELS)
        };
        equal += usize::from((0..3).all(within));
    }
    (points, equal)
}

impl Eye {
    fn shows(&self, i: usize) -> bool {
        self.colours[i][3] > 0
    }

    fn opaque(&self, i: usize) -> bool {
        self.colours[i][3] == u8::MAX && self.depths[i] != self.view.depth_of_nothing()
    }

    /// Distance along the view axis in mm at a depth.
    fn distance(&self, depth: f32) -> f32 {
        let [a, b] = self.view.depth_terms();
        b / (depth - a)
    }

    /// The point in mm that a pixel shows.
    fn point(&self, i: usize) -> Vec3 {
        let [width, height] = self.size.map(|s| s as f32);
        let (x, y) = (i as u32 % self.size[0], i as u32 / self.size[0]);
        let uv = Vec2::new((x as f32 + 0.5) / width, (y as f32 + 0.5) / height);
        let (eye, along) = self.view.ray(uv);
        eye + along * self.distance(self.depths[i])
    }

    /// The four pixels between which a point lies, or those so many pixels to the right of them; `None` outside the picture, and where one
    /// of the four that the point lies between shows another surface.
    fn around(&self, point: Vec3, aside: f32) -> Option<[usize; 4]> {
        let (uv, depth) = self.view.project(point)?;
        let at = uv * Vec2::new(self.size[0] as f32, self.size[1] as f32) - 0.5;
        let own = self.quad(at)?;
        let distance = self.distance(depth);
        let same = |i: usize| {
            self.opaque(i) && (self.distance(self.depths[i]) - distance).abs() < SURFACE * distance
        };
        if !own.into_iter().all(same) {
            return None;
        }
        if aside == 0.0 { Some(own) } else { self.quad(at + Vec2::new(aside, 0.0)) }
    }

    fn quad(&self, at: Vec2) -> Option<[usize; 4]> {
        let [width, height] = self.size;
        let (x, y) = (at.x.floor(), at.y.floor());
        if x < 0.0 || y < 0.0 || x + 1.0 >= width as f32 || y + 1.0 >= height as f32 {
            return None;
        }
        let first = y as usize * width as usize + x as usize;
        Some([first, first + 1, first + width as usize, first + width as usize + 1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao::glam::Quat;
    use cao::model::view::Tangents;

    const SIZE: [u32; 2] = [96, 80];

    /// An eye before a ball of 60 mm with a pattern, lit by `light`.
    fn eye(x: f32, light: impl Fn(Vec3) -> f32) -> Eye {
        let view = View {
            position: Vec3::new(x, 0.0, 300.0),
            orientation: Quat::IDENTITY,
            tan: Tangents { left: -0.4, right: 0.4, up: 0.35, down: -0.35 },
            near_mm: 10.0,
            far_mm: 1000.0,
            reversed: false,
        };
        let mut eye = Eye { view, size: SIZE, colours: Vec::new(), depths: Vec::new() };
        for i in 0..SIZE[0] * SIZE[1] {
            let (column, row) = (i % SIZE[0], i / SIZE[0]);
            let uv = Vec2::new((column as f32 + 0.5) / SIZE[0] as f32, (row as f32 + 0.5) / SIZE[1] as f32);
            let (origin, along) = view.ray(uv);
            let (a, b, c) = (along.length_squared(), origin.dot(along), origin.length_squared() - 3600.0);
            let root = b * b - a * c;
            if root < 0.0 {
                eye.colours.push([0; 4]);
                eye.depths.push(1.0);
                continue;
            }
            let point = origin + along * ((-b - root.sqrt()) / a);
            let wave = 0.5 + 0.4 * (point.x * 0.15).sin() * (point.y * 0.11).cos();
            let level = (wave * light(point) * 255.0).round() as u8;
            eye.colours.push([level, level / 2, 40, 255]);
            eye.depths.push(view.project(point).unwrap().1);
        }
        eye
    }

    #[test]
    fn the_same_ball_from_two_places_has_no_problem() {
        let verdict = Verdict::of(&eye(-15.0, |_| 1.0), &eye(15.0, |_| 1.0));
        assert_eq!(verdict.problems(), [""; 0], "{verdict:?}");
        assert!(verdict.points > 800 && verdict.equal > 0.99, "{verdict:?}");
    }

    #[test]
    fn a_clip_that_takes_nothing_away_is_found() {
        let whole = Verdict::of(&eye(-15.0, |_| 1.0), &eye(15.0, |_| 1.0));
        let cut = Verdict { covered: whole.covered.map(|share| share * 0.6), ..whole };
        assert_eq!(whole.problems_until(&cut), [""; 0]);
        assert!(whole.problems_until(&whole).join("").contains("takes nothing away"));
        let empty = Verdict { covered: [0.0; 2], ..whole };
        assert!(whole.problems_until(&empty).join("").contains("last frame: the left view is empty"));
    }

    #[test]
    fn what_is_wrong_is_found() {
        let good = || eye(-15.0, |_| 1.0);
        let found = |left: &Eye, right: &Eye| Verdict::of(left, right).problems().join("; ");
        let mut empty = eye(15.0, |_| 1.0);
        empty.colours.fill([0; 4]);
        assert!(found(&good(), &empty).contains("the right view is empty"));
        assert!(found(&good(), &good()).contains("both views are the same"));
        // One eye darker by a twentieth; light that belongs to the picture and not to the point.
        assert!(found(&good(), &eye(15.0, |_| 0.95)).contains("equally lit, expected"));
        let shifted = eye(15.0, |p| 1.0 - 0.002 * (p.x + 15.0).abs());
        assert!(found(&eye(-15.0, |p| 1.0 - 0.002 * (p.x - 15.0).abs()), &shifted).contains("equally lit"));
        // Swapped eyes have their parallax the wrong way round.
        let (mut a, mut b) = (good(), eye(15.0, |_| 1.0));
        std::mem::swap(&mut a.view, &mut b.view);
        assert!(found(&a, &b).contains("lit"), "{}", found(&a, &b));
        // A picture without detail says nothing.
        let flat = |x| {
            let mut eye = eye(x, |_| 1.0);
            eye.colours.iter_mut().filter(|c| c[3] > 0).for_each(|c| *c = [90, 80, 70, 255]);
            eye
        };
        assert!(found(&flat(-15.0), &flat(15.0)).contains("nothing to be told from"));
    }
}
