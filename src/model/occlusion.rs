//! What is computed at a voxel: ray sets, quadrature along a ray, radius, start offset (method.md §2–§4).

use crate::error::quoted;
use crate::light::AmbientLight;
use crate::{Error, Result};

/// Directions of the rays cast from every voxel.
///
/// The plain sets are the paper's (CAO §4: 6, 14, 26, 54 rays, equal weights); their directions are the lattice
/// vectors that its authors' program uses, without its jitter. The weighted sets `…w` carry the weights of the
/// Lebedev rules of degree 5, 7 and 11, which integrate the sphere exactly to that degree (method.md §2). Spirals have any even number
/// of directions, see [`spiral`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RaySet {
    /// The 6 faces of a cube, equal weights.
    R6,
    /// Faces and corners, equal weights.
    R14,
    /// Faces, edges and corners, equal weights.
    R26,
    /// The nine cells of each face of a cube, equal weights.
    R54,
    /// Faces and corners with the weights of degree 5.
    W14,
    /// Faces, edges and corners with the weights of degree 7.
    W26,
    /// Faces, edges, corners and (1,1,3) with the weights of degree 11.
    W50,
    /// So many on a [`spiral`], equal weights: even, 2 … [`RaySet::MOST`].
    Spiral(u8),
    /// No rays, of methods that follow none.
    None,
}

impl RaySet {
    /// Most directions of a set.
    pub const MOST: u8 = 254;

    /// Every set that has a name of its own, in the order of its cost.
    pub const ALL: [Self; 7] = [Self::R6, Self::R14, Self::W14, Self::R26, Self::W26, Self::W50, Self::R54];

    /// Name on the command line and in scene files: `6`, `14`, `26`, `54`, `14w`, `26w`, `50w`, `spiral:50`.
    pub fn name(self) -> String {
        let name = match self {
            Self::R6 => "6",
            Self::R14 => "14",
            Self::R26 => "26",
            Self::R54 => "54",
            Self::W14 => "14w",
            Self::W26 => "26w",
            Self::W50 => "50w",
            Self::Spiral(count) => return format!("spiral:{count}"),
            Self::None => "none",
        };
        name.into()
    }

    /// The set called `name`.
    pub fn parse(name: &str) -> Result<Self> {
        let set = match name.strip_prefix("spiral:") {
            Some(count) => count.parse().ok().map(Self::Spiral).filter(|set| set.check().is_ok()),
            None => Self::ALL.into_iter().chain([Self::None]).find(|set| set.name() == name),
        };
        set.ok_or_else(|| {
            let sets = Self::ALL.map(Self::name).join(", ");
            let most = Self::MOST;
            Error::refused(
                "rays",
                format!("{} is no ray set; there are {sets} and spiral:N, N even, 2 … {most}", quoted(name)),
            )
        })
    }

    fn check(self) -> Result<()> {
        match self {
            Self::Spiral(count) if count == 0 || count % 2 == 1 => Err(Error::refused(
                "rays",
                format!("spiral:{count}; expected an even number, 2 … {}", Self::MOST),
            )),
            _ => Ok(()),
        }
    }

    /// Number of directions.
    pub fn count(self) -> usize {
        match self {
            Self::Spiral(count) => usize::from(count / 2 * 2),
            named => named.lattice().len(),
        }
    }

    /// Unit vectors *in millimetres*, whatever the spacing, and weights, Σ weights = 1, in the fixed order in which every implementation
    /// sums them.
    pub fn directions(self) -> Vec<([f64; 3], f64)> {
        if let Self::Spiral(count) = self {
            let all = spiral(count);
            let weight = 1.0 / all.len() as f64;
            return all.into_iter().map(|d| (d, weight)).collect();
        }
        let unit = |v: [i32; 3]| {
            let length = f64::from(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
            v.map(|c| f64::from(c) / length)
        };
        self.lattice().into_iter().map(|(v, weight)| (unit(v), weight)).collect()
    }

    /// The vectors that the directions of a named set have, and weights; none of a spiral.
    pub fn lattice(self) -> Vec<([i32; 3], f64)> {
        let orbits: &[([i32; 3], f64)] = match self {
            Self::R6 => &[([1, 0, 0], 1.0 / 6.0)],
            Self::R14 => &[([1, 0, 0], 1.0 / 14.0), ([1, 1, 1], 1.0 / 14.0)],
            Self::R26 => &[([1, 0, 0], 1.0 / 26.0), ([1, 1, 0], 1.0 / 26.0), ([1, 1, 1], 1.0 / 26.0)],
            Self::R54 => &[([1, 0, 0], 1.0 / 54.0), ([3, 2, 0], 1.0 / 54.0), ([3, 2, 2], 1.0 / 54.0)],
            Self::W14 => &[([1, 0, 0], 1.0 / 15.0), ([1, 1, 1], 3.0 / 40.0)],
            Self::W26 => &[([1, 0, 0], 1.0 / 21.0), ([1, 1, 0], 4.0 / 105.0), ([1, 1, 1], 9.0 / 280.0)],
            Self::W50 => &[
                ([1, 0, 0], 4.0 / 315.0),
                ([1, 1, 0], 64.0 / 2835.0),
                ([1, 1, 1], 27.0 / 1280.0),
                ([3, 1, 1], 14641.0 / 725_760.0),
            ],
            Self::Spiral(_) | Self::None => &[],
        };
        orbits.iter().flat_map(|&(v, weight)| orbit(v).into_iter().map(move |d| (d, weight))).collect()
    }
}

/// All images of `v` under the symmetries of the cube, in lexicographic order.
fn orbit(v: [i32; 3]) -> Vec<[i32; 3]> {
    let mut images = Vec::new();
    for p in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        for signs in 0..8_u32 {
            let image: [i32; 3] =
                std::array::from_fn(|i| if signs >> i & 1 == 1 { -v[p[i]] } else { v[p[i]] });
            images.push(image);
        }
    }
    images.sort_unstable();
    images.dedup();
    images
}

/// How a ray's samples become its ambient value (method.md §3, §4), or how a method without rays makes one of what it looks up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quadrature {
    /// CAO eq. (2) as printed: each cell counts with its entry transmittance.
    Left,
    /// Cells centred on the samples count with the mean of their entry and exit transmittance.
    Cell,
    /// Opacity linear between consecutive samples, integrated with the segment's mean extinction.
    Segment,
    /// Cells in whole numbers, the first few with trilinear opacity, the others with that of the nearest voxel.
    Hybrid,
    /// Cells in whole numbers with the opacity of the nearest voxel.
    Nearest,
    /// Cells in whole numbers with trilinear opacity.
    Linear,
    /// No rays: the product of what shells of cubes let through (SPAO §1.2.1).
    Product,
    /// Cones in steps of their own width, with mean opacities.
    Cone,
    /// What the mean opacity of a box lets through.
    Box,
    /// The mean transmittance through shells of boxes, each of one extinction.
    Mean,
    /// The transmittance behind the last shell.
    End,
    /// The extinction of shells over the squares of their distances, as it was published.
    Published,
    /// The share of directions in which nothing more opaque lies.
    Visible,
    /// The opacity of a neighbourhood's histogram.
    Histogram,
    /// What a network learned.
    Network,
}

impl Quadrature {
    /// Every rule.
    pub const ALL: [Self; 15] = [
        Self::Left,
        Self::Cell,
        Self::Segment,
        Self::Hybrid,
        Self::Nearest,
        Self::Linear,
        Self::Product,
        Self::Cone,
        Self::Box,
        Self::Mean,
        Self::End,
        Self::Published,
        Self::Visible,
        Self::Histogram,
        Self::Network,
    ];
    /// Those of rays by the sampler, the paper's first.
    pub const CAST: [Self; 3] = [Self::Left, Self::Cell, Self::Segment];
    /// Those of rays by brick, the default first.
    pub const BRICK: [Self; 3] = [Self::Hybrid, Self::Nearest, Self::Linear];
    /// Those of shells, the default first.
    pub const SHELLS: [Self; 3] = [Self::Mean, Self::End, Self::Published];

    /// Name on the command line: `left`, say, or `hybrid`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Cell => "cell",
            Self::Segment => "segment",
            Self::Hybrid => "hybrid",
            Self::Nearest => "nearest",
            Self::Linear => "linear",
            Self::Product => "product",
            Self::Cone => "cone",
            Self::Box => "box",
            Self::Mean => "mean",
            Self::End => "end",
            Self::Published => "published",
            Self::Visible => "visible",
            Self::Histogram => "histogram",
            Self::Network => "network",
        }
    }

    /// The rule called `name`.
    pub fn parse(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|rule| rule.name() == name).ok_or_else(|| Error::Config {
            what: "quadrature".into(),
            problem: format!(
                "{} is no rule; there are {}",
                quoted(name),
                Self::ALL.map(Self::name).join(", ")
            ),
        })
    }
}

/// Settings of local ambient occlusion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Occlusion {
    /// Directions and weights.
    pub rays: RaySet,
    /// Rule along a ray, or of a method without rays.
    pub quadrature: Quadrature,
    /// Radius of the neighbourhood in mm, ≥ 0; 0 leaves every voxel unoccluded.
    pub radius_mm: f32,
    /// Distance in mm at which a ray starts; `None` is half a step, which puts samples at whole steps.
    pub offset_mm: Option<f32>,
    /// Distance in mm between samples; `None` is the smallest spacing.
    pub step_mm: Option<f32>,
    /// Where light comes from: what directions weigh.
    pub light: AmbientLight,
}

impl Occlusion {
    /// The paper's setting (CAO §4) for a volume of this smallest spacing in mm: 26 rays, 20 voxels.
    pub fn paper(min_spacing: f64) -> Self {
        Self {
            rays: RaySet::R26,
            quadrature: Quadrature::Left,
            radius_mm: (20.0 * min_spacing) as f32,
            offset_mm: None,
            step_mm: None,
            light: AmbientLight::Uniform,
        }
    }

    /// Refuses lengths that are negative, not finite, or ask for more than [`Self::MAX_SAMPLES`] a ray, spirals that there are none of,
    /// and light that does not come along the rays.
    pub fn check(&self, min_spacing: f64) -> Result<()> {
        self.rays.check()?;
        self.light.check(&self.rays.name(), &self.rays.directions())?;
        let length = |what: &str, value: Option<f32>, positive: bool| match value {
            Some(v) if !v.is_finite() || v < 0.0 || (positive && v == 0.0) => Err(Error::Config {
                what: what.into(),
                problem: format!("{v} mm; expected a length {} 0 mm", if positive { ">" } else { ">=" }),
            }),
            _ => Ok(()),
        };
        length("radius_mm", Some(self.radius_mm), false)?;
        length("offset_mm", self.offset_mm, false)?;
        length("step_mm", self.step_mm, true)?;
        let samples = (f64::from(self.radius_mm) / f64::from(self.step(min_spacing))).round();
        if samples > f64::from(Self::MAX_SAMPLES) {
            return Err(Error::Limit {
                what: format!("radius {} mm in steps of {} mm", self.radius_mm, self.step(min_spacing)),
                needed: samples as u64,
                limit: Self::MAX_SAMPLES.into(),
                hint: "make the radius smaller or the step longer".into(),
            });
        }
        Ok(())
    }

    /// Most samples of one ray; more has no use at any volume's size that a device holds.
    pub const MAX_SAMPLES: u32 = 4096;

    /// Δ, distance between samples in mm.
    pub fn step(&self, min_spacing: f64) -> f32 {
        self.step_mm.unwrap_or(min_spacing as f32)
    }

    /// M = round(R/Δ), samples of a ray (method.md §2).
    pub fn samples(&self, min_spacing: f64) -> u32 {
        (self.radius_mm / self.step(min_spacing)).round() as u32
    }

    /// Distance in mm of the first sample from the voxel's centre, `s_1`; the m-th is `s_1 + (m-1)Δ`.
    pub fn first(&self, min_spacing: f64) -> f32 {
        let step = self.step(min_spacing);
        self.offset_mm.map_or(step, |offset| offset + 0.5 * step)
    }

    /// Distance in mm of the farthest sample, `s_M`; 0 when there is none.
    pub fn reach(&self, min_spacing: f64) -> f32 {
        match self.samples(min_spacing) {
            0 => 0.0,
            m => self.first(min_spacing) + (m - 1) as f32 * self.step(min_spacing),
        }
    }
}

/// What a reference integrates (measure.md §1): many directions, and along each of them samples at
/// `first_mm + m·step_mm`, m = 0 … `samples` − 1, all lengths in mm from the point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Integral {
    /// What the samples of a ray become.
    pub rule: Rule,
    /// Number of directions, spread by [`fibonacci`], equal weights.
    pub directions: u32,
    /// Distance of the first sample.
    pub first_mm: f64,
    /// Distance between samples.
    pub step_mm: f64,
    /// Samples of a ray; 0 leaves every point unoccluded.
    pub samples: u32,
    /// Where light comes from; of one colour.
    pub light: AmbientLight,
}

/// What the samples of a reference's ray become.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// The mean transmittance along the ray, extinction constant between the middles of samples.
    Ambient = 0,
    /// CAO eq. (2): the mean over the samples of the transmittance in front of each.
    Literal = 1,
    /// DVAO eq. (1) as its authors programmed it: the transmittance behind the last sample, or where a ray stops with less than
    /// [`Integral::STOP`] left.
    End = 2,
}

impl Integral {
    /// The mean transmittance from `offset_mm` to `radius_mm`, with at least `steps_per_voxel` samples on the smallest
    /// spacing.
    pub fn ambient(
        radius_mm: f64,
        offset_mm: f64,
        steps_per_voxel: u32,
        directions: u32,
        min_spacing: f64,
    ) -> Self {
        let length = (radius_mm - offset_mm).max(0.0);
        // Rounding of lengths in mm must not add a sample.
        let samples = (length / min_spacing * f64::from(steps_per_voxel) - 1e-6).ceil().max(0.0);
        let step_mm = if samples > 0.0 { length / samples } else { min_spacing };
        let first_mm = offset_mm + 0.5 * step_mm;
        let light = AmbientLight::Uniform;
        Self { rule: Rule::Ambient, directions, first_mm, step_mm, samples: samples as u32, light }
    }

    /// What CAO eq. (2) and (3) converge to with ever more rays: its sum at steps of the smallest spacing.
    pub fn literal(radius_mm: f64, directions: u32, min_spacing: f64) -> Self {
        let samples = (radius_mm / min_spacing).round() as u32;
        let (first_mm, step_mm, light) = (min_spacing, min_spacing, AmbientLight::Uniform);
        Self { rule: Rule::Literal, directions, first_mm, step_mm, samples, light }
    }

    /// What is left of a ray of [`Rule::End`] when it stops.
    pub const STOP: f32 = 0.01;

    /// The transmittance at the ends of rays of `radius_mm` (DVAO eq. (1) as programmed): samples every half of the smallest spacing, the
    /// first at one and a half of it. Of opacity per half a spacing.
    pub fn end(radius_mm: f64, directions: u32, min_spacing: f64) -> Self {
        let samples = (2.0 * radius_mm / min_spacing - 1e-6).ceil().max(0.0) as u32;
        let (first_mm, step_mm, light) = (1.5 * min_spacing, 0.5 * min_spacing, AmbientLight::Uniform);
        Self { rule: Rule::End, directions, first_mm, step_mm, samples, light }
    }

    /// The same at twice the resolution: twice the directions, and for [`Rule::Ambient`] half the step.
    #[must_use]
    pub fn doubled(&self) -> Self {
        let directions = 2 * self.directions;
        match self.rule {
            Rule::Literal | Rule::End => Self { directions, ..*self },
            Rule::Ambient => {
                let step_mm = 0.5 * self.step_mm;
                let first_mm = self.first_mm - 0.5 * step_mm;
                Self { directions, first_mm, step_mm, samples: 2 * self.samples, ..*self }
            }
        }
    }
}

/// `count` / 2 unit vectors on the upper half of the sphere, heights at the middles of equal steps, each turned by the golden angle from
/// the last, and behind each its reverse: equal weights integrate every odd function exactly.
pub fn spiral(count: u8) -> Vec<[f64; 3]> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let half = count / 2;
    (0..half)
        .flat_map(|i| {
            let z = (f64::from(i) + 0.5) / f64::from(half);
            let (sin, cos) = (f64::from(i) * golden).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let d = [r * cos, r * sin, z];
            [d, d.map(|c| -c)]
        })
        .collect()
}

/// `count` unit vectors spread evenly over the sphere: heights in equal steps, each turned by the golden angle from the
/// last (González, Measurement of areas on a sphere using Fibonacci and latitude–longitude lattices, 2010).
pub fn fibonacci(count: u32) -> Vec<[f64; 3]> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..count)
        .map(|k| {
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
            let (sin, cos) = (f64::from(k) * golden).sin_cos();
            let r = (1.0 - z * z).sqrt();
            [r * cos, r * sin, z]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one_and_sets_have_their_size() {
        for set in RaySet::ALL {
            let directions = set.directions();
            let count: usize = set.name().trim_end_matches('w').parse().unwrap();
            assert_eq!((directions.len(), set.count()), (count, count), "{}", set.name());
            let sum: f64 = directions.iter().map(|d| d.1).sum();
            assert!((sum - 1.0).abs() < 1e-14, "{} sums to {sum}", set.name());
        }
    }

    /// Monomials x^a y^b z^c up to the rule's degree, against their exact mean over the sphere.
    #[test]
    fn weighted_sets_integrate_the_sphere_to_their_degree() {
        fn double_factorial(n: i32) -> f64 {
            if n <= 0 { 1.0 } else { f64::from(n) * double_factorial(n - 2) }
        }
        for (set, degree) in [(RaySet::R6, 3), (RaySet::W14, 5), (RaySet::W26, 7), (RaySet::W50, 11)] {
            let mean = |a: i32, b: i32, c: i32| -> f64 {
                set.directions()
                    .iter()
                    .map(|&(v, w)| {
                        let [x, y, z] = v;
                        w * x.powi(a) * y.powi(b) * z.powi(c)
                    })
                    .sum()
            };
            let exact = |a: i32, b: i32, c: i32| {
                if (a | b | c) & 1 == 1 {
                    return 0.0;
                }
                double_factorial(a - 1) * double_factorial(b - 1) * double_factorial(c - 1)
                    / double_factorial(a + b + c + 1)
            };
            let worst = |degree: i32| {
                (0..=degree)
                    .flat_map(|a| (0..=degree - a).map(move |b| (a, b)))
                    .map(|(a, b)| (degree - a - b, a, b))
                    .map(|(a, b, c)| (mean(a, b, c) - exact(a, b, c)).abs())
                    .fold(0.0, f64::max)
            };
            for d in 0..=degree {
                assert!(worst(d) < 1e-14, "{} at degree {d}: {}", set.name(), worst(d));
            }
            assert!(worst(degree + 1) > 1e-4, "{} would be exact beyond {degree}", set.name());
        }
    }

    /// Of any even number; odd functions integrate to 0, and squares to a third.
    #[test]
    fn spirals_are_pairs_of_unit_vectors_that_integrate_squares() {
        for count in [2, 14, 50, 96, 254] {
            let set = RaySet::parse(&format!("spiral:{count}")).unwrap();
            assert_eq!(set, RaySet::Spiral(count));
            let all = set.directions();
            assert_eq!((all.len(), set.count()), (count.into(), count.into()));
            assert!((all.iter().map(|d| d.1).sum::<f64>() - 1.0).abs() < 1e-12);
            for pair in all.chunks(2) {
                assert!((pair[0].0.iter().map(|c| c * c).sum::<f64>() - 1.0).abs() < 1e-12);
                assert_eq!(pair[0].0.map(|c| -c), pair[1].0);
            }
            for i in (0..3).filter(|_| count >= 50) {
                let mean: f64 = all.iter().map(|(d, w)| w * d[i] * d[i]).sum();
                assert!((mean - 1.0 / 3.0).abs() < 0.02, "{count} {i}: {mean}");
            }
        }
        for bad in ["spiral:0", "spiral:7", "spiral:255", "spiral:256", "spiral:", "spiral", "spiral:-2"] {
            let said = RaySet::parse(bad).unwrap_err().to_string();
            assert!(said.contains(bad) && said.contains("spiral:N, N even, 2 … 254"), "{said}");
        }
        for count in [0, 51] {
            let odd = Occlusion { rays: RaySet::Spiral(count), ..Occlusion::paper(1.0) };
            assert!(odd.check(1.0).unwrap_err().to_string().starts_with("rays: spiral:"));
            assert_eq!(odd.rays.directions().len(), odd.rays.count());
        }
    }

    #[test]
    fn impossible_lengths_are_refused_by_name() {
        let good = Occlusion::paper(1.0);
        assert!(good.check(1.0).is_ok());
        for (bad, name) in [
            (Occlusion { radius_mm: -3.0, ..good }, "radius_mm"),
            (Occlusion { radius_mm: f32::NAN, ..good }, "radius_mm"),
            (Occlusion { offset_mm: Some(-1.0), ..good }, "offset_mm"),
            (Occlusion { step_mm: Some(0.0), ..good }, "step_mm"),
            (Occlusion { radius_mm: 1e6, ..good }, "radius"),
        ] {
            assert!(bad.check(1.0).unwrap_err().to_string().starts_with(name));
        }
    }

    #[test]
    fn integrals_cover_their_ray_and_doubling_keeps_it() {
        let covered = |i: &Integral| {
            (i.first_mm - 0.5 * i.step_mm, i.first_mm + (f64::from(i.samples) - 0.5) * i.step_mm)
        };
        let close = |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).abs() < 1e-12 && (a.1 - b.1).abs() < 1e-12;
        let ambient = Integral::ambient(6.0, 0.25, 8, 100, 0.5);
        assert_eq!(ambient.samples, 92);
        assert!(close(covered(&ambient), (0.25, 6.0)) && close(covered(&ambient.doubled()), (0.25, 6.0)));
        assert_eq!(ambient.doubled(), Integral::ambient(6.0, 0.25, 16, 200, 0.5));
        let literal = Integral::literal(6.0, 100, 0.5);
        assert_eq!((literal.samples, literal.first_mm), (12, 0.5));
        assert_eq!(literal.doubled(), Integral { directions: 200, ..literal });
        assert_eq!(Integral::ambient(1.0, 2.0, 8, 100, 1.0).samples, 0);
    }

    /// The mean of x², of xy and of x⁴ over the sphere are 1/3, 0 and 1/5.
    #[test]
    fn fibonacci_directions_are_unit_and_even() {
        let all = fibonacci(1000);
        let mean = |f: fn(&[f64; 3]) -> f64| all.iter().map(f).sum::<f64>() / 1000.0;
        assert!(all.iter().all(|d| (d.iter().map(|c| c * c).sum::<f64>() - 1.0).abs() < 1e-12));
        for (found, exact) in [
            (mean(|d| d[0] * d[0]), 1.0 / 3.0),
            (mean(|d| d[2] * d[2]), 1.0 / 3.0),
            (mean(|d| d[0] * d[1]), 0.0),
            (mean(|d| d[1]), 0.0),
            (mean(|d| d[1].powi(4)), 0.2),
        ] {
            assert!((found - exact).abs() < 2e-4, "{found} {exact}");
        }
        assert_eq!(fibonacci(0), [[0.0; 3]; 0]);
    }
}
