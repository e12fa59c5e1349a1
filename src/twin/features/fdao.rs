//! Feature-driven ambient occlusion (fdAO §4, eq. (5), (6)) by rays by brick (method.md §4, [`crate::rays::rays`]).
//!
//! With V_o,k = V_o where the voxel's feature f is k and 0 elsewhere, A_k is the value of rays by brick from V_o,k, which is masked before
//! it is interpolated. Matter without a feature occludes nothing. The own feature of a voxel is
//!
//! ```text
//! g(x) = f(x);   where that is 0, f of the neighbour with a feature that has most opacity, of equal ones the lowest; 0 where none has any
//!
//! own          A_g(x)(x),  1 where g is 0
//! neighbours   Σ_v V_o(v) A_f(v)(v) / Σ_v V_o(v)  over the 3³ around x with a feature, where f is not the same in all of them; else own
//! max          min_k A_k(x): the maximum is of occlusion
//! sample       A_k(x) in channel k − 1 where V_o,k has opacity in the 3³ around x, else 1; with more than four features max
//! ```
//!
//! Literally (fdAO §4.2) the maximum is of the stored values, which the text calls accessibility here and occlusion there; of accessibility it is
//! 1 nearly everywhere.

use crate::rays::rays::Rays;
use crate::{Grid, each};
use cao_model::occlusion::Occlusion;
use cao_model::options::Combine;

/// What occlusion comes from.
#[derive(Clone, Copy)]
pub struct Matter<'a> {
    /// Its shape.
    pub grid: &'a Grid,
    /// V_o in 65535ths.
    pub opacity: &'a [u16],
    /// Feature of each voxel, 0 where it has none.
    pub labels: &'a [u8],
    /// How many features there are.
    pub features: u8,
}

impl Matter<'_> {
    /// V_o,k in 0 … 1.
    fn of_feature(&self, k: u8) -> Vec<f32> {
        let masked = self.opacity.iter().zip(self.labels);
        masked.map(|(&a, &label)| if label == k { f32::from(a) / 65535.0 } else { 0.0 }).collect()
    }

    /// A voxel and its neighbours, by index.
    fn around(&self, voxel: [usize; 3]) -> impl Iterator<Item = usize> {
        std::iter::once(voxel).chain(self.grid.neighbours(voxel)).map(|v| self.grid.index(v))
    }

    /// g.
    pub fn own(&self, voxel: [usize; 3]) -> u8 {
        let own = self.labels[self.grid.index(voxel)];
        if own > 0 {
            return own;
        }
        let others = self.grid.neighbours(voxel).map(|v| self.grid.index(v));
        let others = others.filter(|&i| self.labels[i] > 0 && self.opacity[i] > 0);
        others
            .max_by_key(|&i| (self.opacity[i], std::cmp::Reverse(self.labels[i])))
            .map_or(0, |i| self.labels[i])
    }
}

/// V_AO of every voxel in 65535ths, the four channels of a texel; 65535 where none is needed: where neither the voxel nor a neighbour has
/// opacity, unless `unneeded`. Rules with one value have it in all channels. Opacity is of `reference_mm`.
pub fn fdao(
    matter: Matter,
    occlusion: &Occlusion,
    reference_mm: f32,
    combine: Combine,
    unneeded: bool,
) -> Vec<[u16; 4]> {
    let masked: Vec<Vec<f32>> = (1..=matter.features).map(|k| matter.of_feature(k)).collect();
    let truth = Truth::new(matter, &masked, occlusion, reference_mm, combine, unneeded);
    each(matter.grid.len(), |i| truth.of(i))
}

/// The same in one voxel, needed or not.
pub fn fdao_at(
    matter: Matter,
    occlusion: &Occlusion,
    reference_mm: f32,
    combine: Combine,
    voxel: [usize; 3],
) -> [u16; 4] {
    let masked: Vec<Vec<f32>> = (1..=matter.features).map(|k| matter.of_feature(k)).collect();
    let truth = Truth::new(matter, &masked, occlusion, reference_mm, combine, true);
    truth.of(matter.grid.index(voxel))
}

struct Truth<'a> {
    matter: Matter<'a>,
    /// Of each feature.
    rays: Vec<Rays<'a>>,
    combine: Combine,
    unneeded: bool,
}

impl<'a> Truth<'a> {
    fn new(
        matter: Matter<'a>,
        masked: &'a [Vec<f32>],
        occlusion: &Occlusion,
        reference_mm: f32,
        combine: Combine,
        unneeded: bool,
    ) -> Self {
        let rays = masked.iter().map(|opacity| Rays::new(matter.grid, opacity, occlusion, reference_mm));
        let many = combine == Combine::Sample && matter.features > 4;
        let combine = if many { Combine::Max } else { combine };
        Self { matter, rays: rays.collect(), combine, unneeded }
    }

    /// A_k, or 1 of no feature.
    fn value(&self, k: u8, i: usize) -> u16 {
        match k {
            0 => 65535,
            k => self.rays[usize::from(k) - 1].value(self.matter.grid.voxel(i)),
        }
    }

    fn of(&self, i: usize) -> [u16; 4] {
        let Matter { grid, opacity, labels, features } = self.matter;
        let voxel = grid.voxel(i);
        let around = || self.matter.around(voxel);
        if !(self.unneeded || around().any(|n| opacity[n] > 0)) {
            return [65535; 4];
        }
        match self.combine {
            Combine::Own => [self.value(self.matter.own(voxel), i); 4],
            Combine::Neighbours if around().all(|n| labels[n] == labels[i]) => [self.value(labels[i], i); 4],
            Combine::Neighbours => {
                let (mut total, mut weighted) = (0.0, 0.0);
                for n in around().filter(|&n| labels[n] > 0 && opacity[n] > 0) {
                    total += f64::from(opacity[n]);
                    weighted += f64::from(opacity[n]) * f64::from(self.value(labels[n], n));
                }
                [if total > 0.0 { (weighted / total).round() as u16 } else { 65535 }; 4]
            }
            Combine::Max => [(1..=features).map(|k| self.value(k, i)).min().unwrap_or(65535); 4],
            Combine::Sample => std::array::from_fn(|channel| {
                let k = channel as u8 + 1;
                let has = |n: usize| labels[n] == k && opacity[n] > 0;
                match k <= features && (self.unneeded || around().any(has)) {
                    true => self.value(k, i),
                    false => 65535,
                }
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::rays::rays::{rays, rays_at};
    use cao_model::occlusion::{Quadrature, RaySet};

    const RULES: [Combine; 4] = [Combine::Own, Combine::Neighbours, Combine::Max, Combine::Sample];

    fn settings(count: u8, quadrature: Quadrature, radius_mm: f32) -> Occlusion {
        Occlusion { rays: RaySet::Spiral(count), quadrature, radius_mm, ..Occlusion::paper(1.0) }
    }

    /// Distance from the middle of a grid of odd edges.
    fn from_middle(grid: &Grid, i: usize) -> f64 {
        let voxel = grid.voxel(i);
        (0..3).map(|a| (voxel[a] as f64 - (grid.dims[a] / 2) as f64).powi(2)).sum::<f64>().sqrt()
    }

    /// Two features farther apart than R: none is in the other's way, and all rules are LAO.
    #[test]
    fn features_out_of_each_others_reach_have_the_values_of_all_matter() {
        let grid = Grid { dims: [32, 9, 9], spacing: [1.0; 3] };
        let mut random = Random(3);
        let (mut opacity, mut labels) = (vec![0; grid.len()], vec![0; grid.len()]);
        for i in 0..grid.len() {
            let x = grid.voxel(i)[0];
            labels[i] = u8::from(x < 16) + 2 * u8::from(x >= 16);
            if !(8..24).contains(&x) {
                opacity[i] = (65535.0 * random.within(-1.0, 1.0).max(0.0)) as u16;
            }
        }
        let matter = Matter { grid: &grid, opacity: &opacity, labels: &labels, features: 2 };
        for rule in Quadrature::BRICK {
            let occlusion = settings(20, rule, 9.0);
            let all = rays(&grid, &opacity, &occlusion, 1.0, false);
            for combine in RULES {
                let found = fdao(matter, &occlusion, 1.0, combine, false);
                let least: Vec<u16> = found.iter().map(|v| *v.iter().min().unwrap()).collect();
                assert_eq!(least, all, "{combine:?} {rule:?}");
            }
            // Nearer than R they are in the way: the same test fails.
            let near = settings(20, rule, 30.0);
            let found = fdao(matter, &near, 1.0, Combine::Own, false);
            assert_ne!(
                found.iter().map(|v| v[0]).collect::<Vec<_>>(),
                rays(&grid, &opacity, &near, 1.0, false)
            );
        }
    }

    /// Shells of optical depth t and width w at r around a point, which has the feature of the inner one. A ray has 1 before a shell, in it
    /// the mean (1 − e^−t)/t, and e^−t behind it; through all of them the product counts.
    #[test]
    fn concentric_shells_have_the_closed_form() {
        const RADIUS: f64 = 20.0;
        const WIDTH: f64 = 2.0;
        /// Voxels make a shell as wide as it should be on average, but not along every ray; the last half cell.
        const ROUGH: f64 = 0.02;
        let grid = Grid { dims: [45; 3], spacing: [1.0; 3] };
        let shells = [(5.0, 1.4), (11.0, 0.6)];
        let (mut opacity, mut labels) = (vec![0; grid.len()], vec![0; grid.len()]);
        for i in 0..grid.len() {
            for (k, (r, t)) in shells.into_iter().enumerate() {
                if (from_middle(&grid, i) - r).abs() < 0.5 * WIDTH {
                    opacity[i] = (65535.0 * (1.0 - (-t / WIDTH).exp())).round() as u16;
                    labels[i] = k as u8 + 1;
                }
            }
        }
        let middle = grid.index([22; 3]);
        labels[middle] = 1;
        let matter = Matter { grid: &grid, opacity: &opacity, labels: &labels, features: 2 };
        // The integral along a ray: up to each shell, through it, and behind it.
        let integral = |shells: &[(f64, f64)]| {
            let (mut sum, mut through, mut at) = (0.0, 1.0, 0.0);
            for &(r, t) in shells {
                sum += through * (r - 0.5 * WIDTH - at) + through * WIDTH * (1.0 - (-t).exp()) / t;
                (through, at) = (through * (-t).exp(), r + 0.5 * WIDTH);
            }
            (sum + through * (RADIUS - at)) / RADIUS
        };
        let occlusion = settings(254, Quadrature::Nearest, RADIUS as f32);
        let of = |combine| f64::from(fdao_at(matter, &occlusion, 1.0, combine, [22; 3])[0]) / 65535.0;
        let [inner, outer] = shells.map(|shell| integral(&[shell]));
        let all = integral(&shells);
        let floats: Vec<f32> = opacity.iter().map(|&a| f32::from(a) / 65535.0).collect();
        let found = rays_at(&grid, &floats, &occlusion, 1.0, [22; 3]);
        assert!((found - all).abs() < ROUGH, "LAO {found} {all}");
        for (combine, expected) in [(Combine::Own, inner), (Combine::Max, inner.min(outer))] {
            let found = of(combine);
            assert!((found - expected).abs() < ROUGH, "{combine:?} {found} {expected}");
        }
        // What they are told apart by is more than what is allowed.
        assert!(
            (inner - all).abs() > 2.0 * ROUGH && (inner - outer).abs() > 3.0 * ROUGH,
            "{inner} {outer} {all}"
        );
    }

    /// The maximum of accessibility, which the paper's formula is taken literally, hides everything that there is to see.
    #[test]
    fn the_maximum_is_of_occlusion() {
        let grid = Grid { dims: [24; 3], spacing: [1.0; 3] };
        let (mut opacity, mut labels) = (vec![0; grid.len()], vec![0; grid.len()]);
        for i in 0..grid.len() {
            let r = from_middle(&grid, i);
            labels[i] = if r < 4.0 { 1 } else { 2 };
            opacity[i] = if r < 3.5 || (8.0..10.0).contains(&r) { 40000 } else { 0 };
        }
        let matter = Matter { grid: &grid, opacity: &opacity, labels: &labels, features: 2 };
        let occlusion = settings(50, Quadrature::Hybrid, 6.0);
        let shown: Vec<usize> = (0..grid.len()).filter(|&i| opacity[i] > 0).collect();
        let mean = |of: &dyn Fn(usize) -> u16| {
            shown.iter().map(|&i| f64::from(of(i)) / 65535.0).sum::<f64>() / shown.len() as f64
        };
        let found = fdao(matter, &occlusion, 1.0, Combine::Max, false);
        let channels = fdao(matter, &occlusion, 1.0, Combine::Sample, true);
        let (most, literal) = (mean(&|i| found[i][0]), mean(&|i| channels[i][0].max(channels[i][1])));
        assert!(most < 0.6 && literal > 0.95, "{most} {literal}");
    }

    #[test]
    fn what_has_no_feature_takes_the_most_opaque_neighbours() {
        let grid = Grid { dims: [5, 1, 1], spacing: [1.0; 3] };
        let own = |opacity: &[u16], labels: &[u8]| {
            let matter = Matter { grid: &grid, opacity, labels, features: 3 };
            (0..5).map(|x| matter.own([x, 0, 0])).collect::<Vec<_>>()
        };
        assert_eq!(own(&[5, 0, 9, 0, 0], &[1, 0, 2, 0, 0]), [1, 2, 2, 2, 0]);
        // Equal ones: the lowest number. Transparent matter has no say, nor has such without a feature.
        assert_eq!(own(&[9, 0, 9, 0, 0], &[3, 0, 2, 0, 1]), [3, 2, 2, 2, 1]);
        assert_eq!(own(&[7, 0, 9, 0, 3], &[1, 0, 0, 0, 3]), [1, 1, 0, 3, 3]);
    }

    #[test]
    fn neighbours_blend_where_features_meet_and_samples_keep_them_apart() {
        let grid = Grid { dims: [9, 5, 5], spacing: [1.0; 3] };
        let labels: Vec<u8> = (0..grid.len()).map(|i| if grid.voxel(i)[0] < 4 { 1 } else { 2 }).collect();
        let opacity: Vec<u16> =
            (0..grid.len()).map(|i| if grid.voxel(i)[0] < 4 { 60000 } else { 6000 }).collect();
        let matter = Matter { grid: &grid, opacity: &opacity, labels: &labels, features: 2 };
        let occlusion = settings(50, Quadrature::Hybrid, 4.0);
        let all = RULES.map(|combine| fdao(matter, &occlusion, 1.0, combine, false));
        let at = |combine, x| {
            let rule = RULES.iter().position(|rule| *rule == combine).unwrap();
            all[rule][grid.index([x, 2, 2])]
        };
        let [left, right] = [3, 4].map(|x| at(Combine::Own, x)[0]);
        let [blended, beside] = [at(Combine::Neighbours, 4)[0], at(Combine::Neighbours, 6)[0]];
        // The soft side takes nearly all of its weight from the hard one, a voxel farther it is alone.
        assert!(left + 10000 < right && blended < right - 5000, "{left} {right} {blended}");
        assert_eq!(beside, at(Combine::Own, 6)[0]);
        let sample = at(Combine::Sample, 4);
        assert!(sample[1] == right && sample[0] < 65535 && sample[2..] == [65535; 2], "{sample:?}");
        assert_eq!(at(Combine::Sample, 6)[0], 65535);
    }
}
