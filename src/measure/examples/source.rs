//! What examples are cut from: built-in volumes of random proportions, scenes of random solids, volumes that are given.
//!
//! A scan has values with the smallest and largest of them, its peaks, and spacings in mm. Half of those that are made have noise, of up to
//! 3 % of the range, as scanners have. Cost: some tenths of a second each; given ones are converted once.

use super::peaks::peaks;
use crate::Result;
use crate::random::Random;
use cao_model::builtin::builtin_box;
use cao_model::volume::Volume;
use cao_twin::{Grid, each};
use glam::{DMat3, DQuat, DVec3};
use std::sync::Arc;

/// Where examples come from.
#[derive(Clone, Debug)]
pub enum Source {
    /// A built-in volume, by name.
    Builtin(String),
    /// Random solids: [`SOLIDS`].
    Solids,
    /// A volume that was read.
    Given(Arc<Scan>),
}

/// What a scene of random solids is called.
pub const SOLIDS: &str = "solids";

/// A volume as examples need it.
#[derive(Debug)]
pub struct Scan {
    /// Its name: of the file, or of the built-in volume.
    pub name: String,
    /// Voxels.
    pub grid: Grid,
    /// Values, x fastest.
    pub values: Vec<f32>,
    /// Smallest and largest value.
    pub range: [f32; 2],
    /// Peaks of the histogram, 0 … 1 of the range.
    pub peaks: Vec<f64>,
}

impl Scan {
    /// Of a volume.
    pub fn new(name: &str, volume: &Volume) -> Self {
        let grid = Grid { dims: volume.dims, spacing: volume.spacing };
        Self::of(name, grid, each(volume.len(), |i| volume.value(i) as f32))
    }

    fn of(name: &str, grid: Grid, values: Vec<f32>) -> Self {
        let range = values
            .iter()
            .fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], v| [low.min(*v), high.max(*v)]);
        let peaks = peaks(&values, range);
        Self { name: name.to_owned(), grid, values, range, peaks }
    }
}

/// Voxels along the edges of volumes that are made.
const DIMS: [u64; 2] = [72, 128];
/// Largest standard deviation of noise, of the range.
const NOISE: f32 = 0.03;

impl Source {
    /// Its name.
    pub fn name(&self) -> &str {
        match self {
            Self::Builtin(name) => name,
            Self::Solids => SOLIDS,
            Self::Given(scan) => &scan.name,
        }
    }

    /// Whether it is a volume that was read.
    pub fn given(&self) -> bool {
        matches!(self, Self::Given(_))
    }

    /// A volume of it.
    ///
    /// # Errors
    /// A name that no built-in volume has.
    pub fn scan(&self, random: &mut Random) -> Result<Arc<Scan>> {
        let mut dims = || std::array::from_fn(|_| (DIMS[0] + random.below(DIMS[1] - DIMS[0] + 1)) as usize);
        let (grid, mut values) = match self {
            Self::Given(scan) => return Ok(Arc::clone(scan)),
            Self::Builtin(name) => {
                let volume = builtin_box(name, dims(), [1.0; 3])?;
                let grid = Grid { dims: volume.dims, spacing: volume.spacing };
                (grid, each(volume.len(), |i| volume.value(i) as f32))
            }
            Self::Solids => {
                let grid = Grid { dims: dims(), spacing: [1.0; 3] };
                let solids: Vec<Solid> = (0..6 + random.below(20)).map(|_| Solid::random(random)).collect();
                (grid, solid_values(&grid, &solids))
            }
        };
        if random.below(2) == 0 {
            add_noise(random, &mut values);
        }
        Ok(Arc::new(Scan::of(self.name(), grid, values)))
    }
}

/// Adds noise of a random strength: sums of four uniform numbers, which are near enough to normal.
fn add_noise(random: &mut Random, values: &mut [f32]) {
    let (low, high) =
        values.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    // Four numbers of U(-1, 1) have a variance of 4/3.
    let scale = random.between(0.0, NOISE) * (high - low) * 0.75_f32.sqrt();
    for value in values {
        let bits = random.bits();
        let sum: f32 = (0..4).map(|i| (bits >> (16 * i) & 0xffff) as f32 / 32768.0 - 1.0).sum();
        *value += scale * sum;
    }
}

#[derive(Clone, Copy, Debug)]
enum Form {
    Ellipsoid,
    Block,
    Rod,
    /// Of this thickness.
    Shell(f64),
}

/// A solid in coordinates from -1 to 1.
#[derive(Clone, Copy, Debug)]
struct Solid {
    form: Form,
    centre: DVec3,
    half: DVec3,
    turn: DMat3,
    value: f32,
}

impl Solid {
    fn random(random: &mut Random) -> Self {
        let form = match random.below(4) {
            0 => Form::Ellipsoid,
            1 => Form::Block,
            2 => Form::Rod,
            _ => Form::Shell(random.between(0.015, 0.08).into()),
        };
        let vector = |random: &mut Random, low: f32, high: f32| -> DVec3 {
            std::array::from_fn(|_| f64::from(random.between(low, high))).into()
        };
        let centre = vector(random, -0.7, 0.7);
        let half = vector(random, -3.0, -0.7).map(f64::exp);
        Self { form, centre, half, turn: turn(random), value: random.between(40.0, 250.0) }
    }

    /// Signed distance, to first order.
    fn distance(&self, at: DVec3) -> f64 {
        let p = self.turn * (at - self.centre);
        let round = |p: DVec3| {
            let (level, slope) = ((p / self.half).length(), (p / (self.half * self.half)).length());
            if slope < 1e-9 { -self.half.min_element() } else { (level - 1.0) * level / slope }
        };
        match self.form {
            Form::Ellipsoid => round(p),
            Form::Shell(thick) => {
                let d = round(p);
                d.max(-thick - d)
            }
            Form::Block => (p.abs() - self.half).max_element(),
            Form::Rod => {
                let [half, radius] = [self.half.max_element(), 0.5 * self.half.min_element()];
                (p - DVec3::X * p.x.clamp(-half, half)).length() - radius
            }
        }
    }
}

/// Solids over one another in emptiness of value 0, the later ones on top, with partial volumes at their faces.
fn solid_values(grid: &Grid, solids: &[Solid]) -> Vec<f32> {
    let edge = 2.0 / grid.dims.into_iter().max().unwrap_or(1) as f64;
    each(grid.len(), |i| {
        let voxel = DVec3::from(grid.voxel(i).map(|c| c as f64));
        let half = DVec3::from(grid.dims.map(|d| d as f64)) / 2.0;
        let at = (voxel + 0.5 - half) * edge;
        solids.iter().fold(0.0, |below, solid| {
            let cover = (0.5 - solid.distance(at) / edge).clamp(0.0, 1.0) as f32;
            below + (solid.value - below) * cover
        })
    })
}

/// A rotation, each as likely as any other (Shoemake, Uniform random rotations, 1992).
pub fn turn(random: &mut Random) -> DMat3 {
    let [u, v, w] = [0; 3].map(|_| f64::from(random.between(0.0, 1.0)));
    let (a, b) = ((1.0 - u).sqrt(), u.sqrt());
    let (s, t) = (std::f64::consts::TAU * v, std::f64::consts::TAU * w);
    DMat3::from_quat(DQuat::from_xyzw(a * s.sin(), a * s.cos(), b * t.sin(), b * t.cos()).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solids_are_where_they_are_and_the_last_is_on_top() {
        let grid = Grid { dims: [32; 3], spacing: [1.0; 3] };
        let solid = |form, half: f64, value| Solid {
            form,
            centre: DVec3::ZERO,
            half: DVec3::splat(half),
            turn: DMat3::IDENTITY,
            value,
        };
        let values =
            solid_values(&grid, &[solid(Form::Block, 0.5, 100.0), solid(Form::Ellipsoid, 0.25, 200.0)]);
        let at = |x, y, z| values[grid.index([x, y, z])];
        assert_eq!([at(16, 16, 16), at(10, 10, 10), at(2, 16, 16)], [200.0, 100.0, 0.0]);
        let volume = |least: f32| values.iter().filter(|v| **v > least).count() as f64;
        assert!((volume(50.0) - 16.0_f64.powi(3)).abs() < 1.0);
        let ball = 4.0 / 3.0 * std::f64::consts::PI * 4.0_f64.powi(3);
        assert!((volume(150.0) / ball - 1.0).abs() < 0.05);
    }

    #[test]
    fn rotations_are_rotations_and_leave_no_direction_out() {
        let mut random = Random::new(3);
        let mut octants = [0; 8];
        for _ in 0..400 {
            let turn = turn(&mut random);
            assert!((turn.determinant() - 1.0).abs() < 1e-9);
            assert!((turn * turn.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-9));
            let d = turn.x_axis;
            octants[usize::from(d.x > 0.0) + 2 * usize::from(d.y > 0.0) + 4 * usize::from(d.z > 0.0)] += 1;
        }
        assert!(octants.iter().all(|n| *n > 25), "{octants:?}");
    }

    #[test]
    fn a_seed_is_a_volume() {
        let [one, same, other] = [1, 1, 2].map(|seed| Source::Solids.scan(&mut Random::new(seed)).unwrap());
        assert_eq!((&one.values, one.range, &one.peaks), (&same.values, same.range, &same.peaks));
        assert!(one.values != other.values);
        let fruit = Source::Builtin("fruit".into()).scan(&mut Random::new(1)).unwrap();
        assert!(fruit.peaks.len() > 2, "{:?}", fruit.peaks);
        assert!(Source::Builtin("none".into()).scan(&mut Random::new(1)).is_err());
    }
}
