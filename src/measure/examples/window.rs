//! The cube that an example shows of a scan: turned by any angle, as large as what is seen in it or a part of that, with equal edges along
//! all axes whatever the scan's spacings (the paper's program stretches each axis, which makes R differ by direction).
//!
//! In: a scan, a transfer function, a rotation. Out: opacity, and values, of edge³ voxels, each the mean over n³ samples of the trilinear
//! value and of the opacity made of it. Outside the scan opacity is 0. Cost: 8 reads a sample.

use super::source::Scan;
use super::trapezoids::{Trapezoid, opacity};
use crate::random::Random;
use cao_twin::each;
use glam::{DMat3, DVec3};

/// A cube of a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// From its axes to the scan's.
    pub turn: DMat3,
    /// Its middle in mm from the scan's, along its own axes.
    pub centre: DVec3,
    /// Its edge in mm.
    pub side: f64,
}

/// Samples along each axis in which what can be seen is looked for.
const COARSE: usize = 56;
/// Edge of a window in lengths of what can be seen: from a part of it to all of it with room around.
const SIDES: [f32; 2] = [0.55, 1.1];

impl Window {
    /// All of a scan, turned.
    pub fn around(scan: &Scan, turn: DMat3) -> Self {
        let half =
            DVec3::from(std::array::from_fn(|a| 0.5 * scan.grid.dims[a] as f64 * scan.grid.spacing[a]));
        let reach =
            DMat3::from_cols(turn.x_axis.abs(), turn.y_axis.abs(), turn.z_axis.abs()).transpose() * half;
        Self { turn, centre: DVec3::ZERO, side: 2.0 * reach.max_element() }
    }

    /// A random one on what this transfer function shows within this one; `None` where it shows nothing.
    pub fn random(self, random: &mut Random, scan: &Scan, transfer: &[Trapezoid]) -> Option<Self> {
        let step = self.side / COARSE as f64;
        let seen = each(COARSE.pow(3), |i| {
            let index = [i % COARSE, i / COARSE % COARSE, i / COARSE / COARSE];
            let value = self.value(scan, self.place(index, COARSE, 0.5));
            value.is_some_and(|value| opacity(transfer, value) > 0.0)
        });
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for (i, _) in seen.iter().enumerate().filter(|(_, seen)| **seen) {
            let at = self.place([i % COARSE, i / COARSE % COARSE, i / COARSE / COARSE], COARSE, 0.5);
            (low, high) = (low.min(at), high.max(at));
        }
        if low.x > high.x {
            return None;
        }
        let size = high - low + 2.0 * step;
        let side = size.max_element() * f64::from(random.between(SIDES[0], SIDES[1]));
        let shift = DVec3::from([0; 3].map(|_| f64::from(random.between(-0.5, 0.5)))) * (size - side).abs();
        Some(Self { turn: self.turn, centre: 0.5 * (low + high) + shift, side })
    }

    /// Place of a voxel of `edge`³, along the window's axes; `offset` in it.
    fn place(&self, index: [usize; 3], edge: usize, offset: f64) -> DVec3 {
        let at = DVec3::from(index.map(|c| c as f64)) + offset;
        self.centre + (at / edge as f64 - 0.5) * self.side
    }

    /// Value there, 0 … 1 of the range; `None` outside the scan.
    fn value(&self, scan: &Scan, place: DVec3) -> Option<f64> {
        let grid = &scan.grid;
        let mm = self.turn * place;
        let last = grid.dims.map(|d| d as f64 - 1.0);
        let at: [f64; 3] = std::array::from_fn(|a| mm[a] / grid.spacing[a] + 0.5 * last[a]);
        // Up to the outer faces of the outermost voxels.
        if (0..3).any(|a| at[a] < -0.5 || at[a] > last[a] + 0.5) {
            return None;
        }
        let low: [usize; 3] = std::array::from_fn(|a| at[a].clamp(0.0, (last[a] - 1.0).max(0.0)) as usize);
        let t: [f32; 3] = std::array::from_fn(|a| (at[a] - low[a] as f64).clamp(0.0, 1.0) as f32);
        let step: [usize; 3] = std::array::from_fn(|a| usize::from(grid.dims[a] > 1));
        let read = |x: usize, y: usize, z: usize| {
            scan.values[grid.index([low[0] + x * step[0], low[1] + y * step[1], low[2] + z * step[2]])]
        };
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let row = |y, z| mix(read(0, y, z), read(1, y, z), t[0]);
        let slice = |z| mix(row(0, z), row(1, z), t[1]);
        let [least, most] = scan.range;
        Some(f64::from((mix(slice(0), slice(1), t[2]) - least) / (most - least).max(f32::MIN_POSITIVE)))
    }

    /// Opacity and value of edge³ voxels, x fastest, each the mean of samples³; the value of what lies outside is the smallest, 0.
    pub fn sampled(&self, scan: &Scan, transfer: &[Trapezoid], edge: usize, samples: usize) -> Vec<[f32; 2]> {
        let fine = edge * samples;
        each(edge.pow(3), |i| {
            let voxel = [i % edge, i / edge % edge, i / edge / edge];
            let mut sum = [0.0; 2];
            for k in 0..samples.pow(3) {
                let sub = [k % samples, k / samples % samples, k / samples / samples];
                let index = std::array::from_fn(|a| voxel[a] * samples + sub[a]);
                if let Some(value) = self.value(scan, self.place(index, fine, 0.5)) {
                    sum[0] += opacity(transfer, value);
                    sum[1] += value;
                }
            }
            sum.map(|sum| (sum / samples.pow(3) as f64) as f32)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::examples::source::turn;
    use cao_model::values::Values;
    use cao_model::volume::Volume;

    /// A ball of radius 10 mm, whatever the spacing, of value 1 in 0 … 2.
    fn ball(dims: [usize; 3], spacing: [f64; 3]) -> Scan {
        let grid = cao_twin::Grid { dims, spacing };
        let mut values: Vec<f32> = (0..grid.len())
            .map(|i| {
                let voxel = grid.voxel(i);
                let mm = DVec3::from(std::array::from_fn(|a| {
                    (voxel[a] as f64 - 0.5 * (dims[a] as f64 - 1.0)) * spacing[a]
                }));
                f32::from(u8::from(mm.length() < 10.0))
            })
            .collect();
        // Only the range needs it; nobody sees it there.
        values[grid.index(dims.map(|d| d / 2))] = 2.0;
        Scan::new("ball", &Volume::new(dims, spacing, Values::F32(values)).unwrap())
    }

    /// From half the ball's value on, so that its surface is where it is, whatever lies between voxels.
    const SHOWN: [Trapezoid; 1] = [Trapezoid { centre: 0.5, outer: 0.5, inner: 0.5, bottom: 0.8, top: 0.8 }];

    /// Extent of what can be seen, in voxels.
    fn extent(opacity: &[[f32; 2]], edge: usize) -> [usize; 3] {
        std::array::from_fn(|axis| {
            let at = |i: usize| i / edge.pow(axis as u32) % edge;
            let seen: Vec<usize> = (0..opacity.len()).filter(|i| opacity[*i][0] > 0.4).map(at).collect();
            seen.iter().max().unwrap() + 1 - seen.iter().min().unwrap()
        })
    }

    #[test]
    fn a_ball_stays_round_whatever_the_spacings_and_the_angle() {
        let mut random = Random::new(2);
        for (dims, spacing) in [([40, 40, 40], [1.0; 3]), ([64, 40, 14], [0.5, 1.0, 3.0])] {
            let scan = ball(dims, spacing);
            for turn in [DMat3::IDENTITY, turn(&mut random)] {
                let window = Window { turn, centre: DVec3::ZERO, side: 32.0 };
                let found = extent(&window.sampled(&scan, &SHOWN, 32, 2), 32);
                // The coarsest voxel is 3 mm.
                assert!(found.iter().all(|n| n.abs_diff(20) <= 3), "{spacing:?} {found:?}");
            }
        }
    }

    #[test]
    fn windows_lie_on_what_is_seen_and_around_holds_the_corners() {
        let scan = ball([40; 3], [1.0; 3]);
        let mut random = Random::new(4);
        let whole = Window::around(&scan, DMat3::IDENTITY);
        assert!((whole.side - 40.0).abs() < 1e-9);
        let diagonal = DMat3::from_rotation_z(std::f64::consts::FRAC_PI_4);
        assert!((Window::around(&scan, diagonal).side - 40.0 * 2.0_f64.sqrt()).abs() < 1e-9);
        for _ in 0..50 {
            let window = whole.random(&mut random, &scan, &SHOWN).unwrap();
            assert!(window.side > 0.5 * 20.0 && window.side < 1.2 * 23.0, "{window:?}");
            let seen = window.sampled(&scan, &SHOWN, 8, 1).iter().filter(|v| v[0] > 0.0).count();
            assert!(seen > 50, "{window:?} shows {seen}");
        }
        assert_eq!(whole.random(&mut random, &scan, &[]), None);
    }

    #[test]
    fn voxels_are_means_and_outside_is_nothing() {
        let scan = ball([40; 3], [1.0; 3]);
        let window = Window { turn: DMat3::IDENTITY, centre: DVec3::ZERO, side: 80.0 };
        let found = window.sampled(&scan, &SHOWN, 2, 40);
        // An octant of the ball of opacity 0.8 in a cube of 40 mm; the walls of the transfer function are thin.
        let share = std::f64::consts::PI / 6.0 / 64.0;
        for [opacity, value] in found {
            assert!((f64::from(opacity) / (0.8 * share) - 1.0).abs() < 0.1, "{opacity}");
            assert!((f64::from(value) / (0.5 * share) - 1.0).abs() < 0.1, "{value}");
        }
    }
}
