//! What directions weigh in ambient light (method.md §2.1): those of rays, and those of a reference's integral.
//!
//! ```text
//! w_k' = w_k L(d_k) / Σ_j w_j L(d_j)
//! ```

use crate::light::{AmbientLight, Lights};
use crate::occlusion::{Integral, Occlusion, fibonacci};
use crate::{Error, Result};

impl Occlusion {
    /// Unit vectors in mm and the weights w' of each in red, green and blue light, Σ = 1 each; those from which none comes are left out.
    pub fn lit_directions(&self) -> Vec<([f64; 3], [f64; 3])> {
        let all = self.rays.directions();
        if self.light == AmbientLight::Uniform {
            return all.into_iter().map(|(d, weight)| (d, [weight; 3])).collect();
        }
        let lit: Vec<_> = all.into_iter().map(|(d, w)| (d, self.light.from(d).map(|l| w * l))).collect();
        let sum: [f64; 3] = std::array::from_fn(|c| lit.iter().map(|(_, w)| w[c]).sum());
        let share = |(d, w): ([f64; 3], [f64; 3])| (d, std::array::from_fn(|c| w[c] / sum[c]));
        lit.into_iter().filter(|(_, w)| *w != [0.0; 3]).map(share).collect()
    }

    /// The same of light of one colour.
    pub fn weighted_directions(&self) -> Vec<([f64; 3], f64)> {
        self.lit_directions().into_iter().map(|(d, [weight, ..])| (d, weight)).collect()
    }
}

impl Integral {
    /// The directions from which light comes, and what comes from each in shares of the mean of all of these.
    ///
    /// # Errors
    /// [`Error::Config`] for coloured light, and for light that comes from nowhere.
    pub fn lit_directions(&self) -> Result<Vec<([f64; 3], f64)>> {
        let all = fibonacci(self.directions);
        if self.light == AmbientLight::Uniform {
            return Ok(all.into_iter().map(|d| (d, 1.0)).collect());
        }
        if self.light.needs() == Lights::Coloured {
            let problem =
                "coloured; a reference, and with it a budget, is of one colour: expected a channel of it";
            return Err(Error::refused("light", problem));
        }
        let lit = all.into_iter().map(|d| (d, self.light.from(d)[0])).filter(|(_, light)| *light > 0.0);
        let mut lit: Vec<_> = lit.collect();
        if lit.is_empty() {
            return Err(Error::refused("light", "none comes from anywhere; expected some"));
        }
        let mean = lit.iter().map(|(_, light)| light).sum::<f64>() / lit.len() as f64;
        lit.iter_mut().for_each(|(_, light)| *light /= mean);
        Ok(lit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occlusion::RaySet;
    use glam::{DMat3, DQuat, DVec3};

    /// Of each channel another light, none of it even anywhere.
    fn mixed() -> AmbientLight {
        AmbientLight::Harmonics(std::array::from_fn(|i| {
            [1.0 - 0.2 * i as f64, 0.4 + 0.1 * (i * i % 7) as f64, if i == 0 { 2.0 } else { -0.3 }]
        }))
    }

    /// Share of light that a half-space with this normal leaves: directions in its plane count half.
    fn open(occlusion: &Occlusion, normal: [f64; 3]) -> f64 {
        let seen = |d: [f64; 3]| {
            let rise: f64 = (0..3).map(|i| d[i] * normal[i]).sum();
            if rise.abs() < 1e-9 { 0.5 } else { f64::from(u8::from(rise > 0.0)) }
        };
        occlusion.weighted_directions().into_iter().map(|(d, w)| w * seen(d)).sum()
    }

    #[test]
    fn sky_over_half_spaces_has_its_known_shares() {
        let normals =
            [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 1.0], [1.0; 3], [2.0, 1.0, 3.0]];
        let known = [
            (RaySet::W26, [1.0, 0.5, 0.0, 0.861, 0.802, 0.960]),
            (RaySet::W50, [1.0, 0.5, 0.0, 0.844, 0.787, 0.901]),
        ];
        let exact = [1.0, 0.5, 0.0, 0.854, 0.789, 0.901];
        for (rays, shares) in known {
            let occlusion = Occlusion { rays, light: AmbientLight::SKY, ..Occlusion::paper(1.0) };
            for (normal, share) in normals.into_iter().zip(shares) {
                let found = open(&occlusion, normal);
                assert!((found - share).abs() < 6e-4, "{} {normal:?}: {found} {share}", rays.name());
            }
        }
        // (1 + cos) / 2 of the angle between up and the normal.
        for (normal, share) in normals.into_iter().zip(exact) {
            let normal = DVec3::from_array(normal).normalize();
            assert!((0.5 * (1.0 + normal.z) - share).abs() < 6e-4, "{normal} {share}");
            let all = fibonacci(20_000);
            let sum = |of: &dyn Fn(DVec3) -> bool| -> f64 {
                let light = |d: &[f64; 3]| AmbientLight::SKY.from(*d)[0];
                all.iter().filter(|d| of(DVec3::from_array(**d))).map(light).sum()
            };
            let found = sum(&|d| d.dot(normal) > 0.0) / sum(&|_| true);
            assert!((found - share).abs() < 2e-3, "{normal}: {found} {share}");
        }
    }

    /// No bit of a uniform light's weights is another than without any; what is the same from everywhere by harmonics is nearly that.
    #[test]
    fn weights_sum_to_one_and_uniform_ones_are_the_sets() {
        let sets = RaySet::ALL.into_iter().chain([RaySet::Spiral(50)]);
        for rays in sets {
            let of = |light| Occlusion { rays, light, ..Occlusion::paper(1.0) };
            assert_eq!(of(AmbientLight::Uniform).weighted_directions(), rays.directions());
            let even = of(AmbientLight::harmonics(&[[1.0, 2.0, 3.0]]).unwrap()).lit_directions();
            for ((_, even), (_, w)) in even.iter().zip(rays.directions()) {
                assert!(even.iter().all(|e| (e - w).abs() < 1e-15), "{}", rays.name());
            }
            for light in [AmbientLight::SKY, mixed()] {
                let lit = of(light).lit_directions();
                for c in 0..3 {
                    let sum: f64 = lit.iter().map(|(_, w)| w[c]).sum();
                    assert!((sum - 1.0).abs() < 1e-12, "{}: {sum}", rays.name());
                }
                assert!(lit.iter().all(|(_, w)| *w != [0.0; 3] && w.iter().all(|w| *w >= 0.0)));
            }
        }
        // Half of an even set's directions see no sky; those in its rim neither.
        let sky = Occlusion { light: AmbientLight::SKY, ..Occlusion::paper(1.0) };
        assert_eq!(sky.weighted_directions().len(), 9);
    }

    #[test]
    fn a_turned_light_comes_from_turned_directions() {
        let turn = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(0.4, -1.1, 0.7)));
        let mirrored = turn * DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
        for light in [AmbientLight::Uniform, AmbientLight::Sky([1.0, 2.0, -0.5]), mixed()] {
            for turn in [turn, mirrored] {
                let turned = light.turned(turn);
                for d in fibonacci(200) {
                    let there = (turn * DVec3::from_array(d)).to_array();
                    for (a, b) in light.from(d).into_iter().zip(turned.from(there)) {
                        assert!((a - b).abs() < 1e-12, "{light:?}: {a} {b}");
                    }
                }
            }
        }
        assert_ne!(mixed().turned(turn), mixed());
    }

    #[test]
    fn channels_are_the_grey_lights_of_a_coloured_one() {
        let of = |light| Occlusion { rays: RaySet::Spiral(50), light, ..Occlusion::paper(1.0) };
        let coloured = of(mixed()).lit_directions();
        assert_eq!(mixed().needs(), Lights::Coloured);
        for c in 0..3 {
            let grey = mixed().channel(c);
            assert_eq!(grey.needs(), Lights::Grey);
            let own: Vec<_> = coloured.iter().filter(|(_, w)| w[c] > 0.0).map(|(d, w)| (*d, w[c])).collect();
            assert_eq!(of(grey).weighted_directions(), own);
        }
    }
}
