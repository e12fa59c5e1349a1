//! Where ambient light comes from: the weights of directions (method.md §2.1; CAO eq. (3)'s w_k).
//!
//! ```text
//! w_k' = w_k L(d_k) / Σ_j w_j L(d_j)       L ≥ 0: what is negative is 0, at each direction; red, green and blue by themselves
//! uniform   L = 1
//! sky       L = max(0, d·up)
//! sh        L = Σ_lm s_l c_lm Y_lm(d),  l ≤ 2,  s_l = sin(πl/3)/(πl/3)
//! ```
//!
//! Y are the real spherical harmonics, in the order 1, y, z, x, xy, yz, 3z² − 1, xz, x² − y², of length 1 over the sphere. s is Lanczos'
//! window (Sloan, Stupid Spherical Harmonics Tricks, 2008): it takes the ringing of what was cut off behind l = 2, most of which is
//! negative light.

use crate::error::quoted;
use crate::{Error, Result};
use glam::{DMat3, DVec3};
use std::fmt;

/// Coefficients of harmonics up to l = 2.
pub const HARMONICS: usize = 9;

/// What a light may be, in words.
pub const LIGHTS: &str = "uniform, sky, sky:X,Y,Z with the direction that is up, sh:C/C/... with at most nine coefficients C, each a number or R,G,B";

/// Ambient light by the direction that it comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AmbientLight {
    /// The same from everywhere.
    #[default]
    Uniform,
    /// As a sky's that a ground sees: the cosine to a direction, of any length.
    Sky([f64; 3]),
    /// Spherical harmonics, red, green and blue of each.
    Harmonics([[f64; 3]; HARMONICS]),
}

/// What methods follow of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Lights {
    /// The same from everywhere.
    Uniform,
    /// Any, of one colour.
    Grey,
    /// Any.
    Coloured,
}

impl Lights {
    /// What it is, in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform light",
            Self::Grey => "light of one colour",
            Self::Coloured => "coloured light",
        }
    }
}

/// As [`AmbientLight::parse`] reads it.
impl fmt::Display for AmbientLight {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let three = |v: &[f64; 3]| v.map(|c| c.to_string()).join(",");
        match self {
            Self::Uniform => f.write_str("uniform"),
            Self::Sky(up) => write!(f, "sky:{}", three(up)),
            Self::Harmonics(all) => write!(f, "sh:{}", all.each_ref().map(three).join("/")),
        }
    }
}

impl AmbientLight {
    /// A sky above +z.
    pub const SKY: Self = Self::Sky([0.0, 0.0, 1.0]);

    /// What `text` says: `uniform`, `sky`, `sky:0,1,0`, `sh:1/0.5,0,0/...`.
    ///
    /// # Errors
    /// [`Error::Config`] for what is none.
    pub fn parse(text: &str) -> Result<Self> {
        let numbers = |part: &str| -> Option<Vec<f64>> {
            part.split(',').map(|number| number.trim().parse().ok()).collect()
        };
        let found = match text.split_once(':') {
            None if text == "uniform" => Some(Self::Uniform),
            None if text == "sky" => Some(Self::SKY),
            Some(("sky", up)) => numbers(up).and_then(|up| Some(Self::Sky(up.try_into().ok()?))),
            Some(("sh", list)) => {
                let each = |part: &str| match numbers(part)?.as_slice() {
                    [grey] => Some([*grey; 3]),
                    [r, g, b] => Some([*r, *g, *b]),
                    _ => None,
                };
                let list: Option<Vec<[f64; 3]>> = list.split('/').map(each).collect();
                list.map(|list| Self::harmonics(&list)).transpose()?
            }
            _ => None,
        };
        found.ok_or_else(|| Error::refused("light", format!("{}; expected {LIGHTS}", quoted(text))))
    }

    /// Harmonics by the first so many coefficients; the others are 0.
    ///
    /// # Errors
    /// [`Error::Config`] for none or more than nine.
    pub fn harmonics(first: &[[f64; 3]]) -> Result<Self> {
        if first.is_empty() || first.len() > HARMONICS {
            let problem =
                format!("{} coefficients; expected 1 to {HARMONICS}, those up to l = 2", first.len());
            return Err(Error::refused("light", problem));
        }
        let mut all = [[0.0; 3]; HARMONICS];
        all[..first.len()].copy_from_slice(first);
        Ok(Self::Harmonics(all))
    }

    /// What a method has to follow for it.
    pub fn needs(&self) -> Lights {
        match self {
            Self::Uniform => Lights::Uniform,
            Self::Harmonics(all) if all.iter().any(|[r, g, b]| r != g || g != b) => Lights::Coloured,
            Self::Sky(_) | Self::Harmonics(_) => Lights::Grey,
        }
    }

    /// The light of one of red, green and blue, 0 … 2, as grey.
    #[must_use]
    pub fn channel(&self, channel: usize) -> Self {
        match self {
            Self::Harmonics(all) => Self::Harmonics(all.map(|coefficient| [coefficient[channel]; 3])),
            grey => *grey,
        }
    }

    /// The same light of a world that is turned, or mirrored, by this matrix.
    #[must_use]
    pub fn turned(&self, turn: DMat3) -> Self {
        match self {
            Self::Uniform => Self::Uniform,
            Self::Sky(up) => Self::Sky((turn * DVec3::from_array(*up)).to_array()),
            Self::Harmonics(all) => {
                let by_channel: [[f64; HARMONICS]; 3] =
                    std::array::from_fn(|c| turned(std::array::from_fn(|i| all[i][c]), turn));
                Self::Harmonics(std::array::from_fn(|i| by_channel.map(|channel| channel[i])))
            }
        }
    }

    /// L, red, green and blue, from a direction of length 1.
    pub fn from(&self, direction: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Uniform => [1.0; 3],
            Self::Sky(up) => {
                let up = DVec3::from_array(*up).normalize_or_zero();
                [DVec3::from_array(direction).dot(up).max(0.0); 3]
            }
            Self::Harmonics(all) => {
                let basis = basis(direction);
                let sum = |c: usize| {
                    let term = |i: usize| WINDOW[i] * all[i][c] * basis[i];
                    (0..HARMONICS).map(term).sum::<f64>().max(0.0)
                };
                std::array::from_fn(sum)
            }
        }
    }

    /// Refuses what is no light, and light of which none comes along the rays of this name with these directions, where there are any.
    ///
    /// # Errors
    /// [`Error::Config`] naming it, and what is allowed.
    pub fn check(&self, rays: &str, directions: &[([f64; 3], f64)]) -> Result<()> {
        let refuse = |problem: String| Err(Error::refused("light", problem));
        match self {
            Self::Uniform => return Ok(()),
            Self::Sky(up) => {
                let length = DVec3::from_array(*up).length();
                if !(length.is_finite() && length > 0.0) {
                    return refuse(format!("sky with up = {up:?}; expected a direction, not all of it 0"));
                }
            }
            Self::Harmonics(all) => {
                if let Some(bad) = all.iter().flatten().find(|c| !c.is_finite()) {
                    return refuse(format!("sh with a coefficient {bad}; expected finite numbers"));
                }
            }
        }
        for (c, name) in ["red", "green", "blue"].into_iter().enumerate() {
            let sum: f64 = directions.iter().map(|&(d, weight)| weight * self.from(d)[c]).sum();
            if !(directions.is_empty() || sum.is_finite() && sum > 0.0) {
                return refuse(format!(
                    "no {name} light comes along any of the rays {rays}; expected some, negative light counts as none"
                ));
            }
        }
        Ok(())
    }
}

/// Lengths of the harmonics: √(1/4π), √(3/4π), √(15/4π), √(5/16π), √(15/16π).
const Y0: f64 = 0.282_094_791_773_878_14;
const Y1: f64 = 0.488_602_511_902_919_9;
const Y2: f64 = 1.092_548_430_592_079_2;
const Y20: f64 = 0.315_391_565_252_520_05;
const Y22: f64 = 0.546_274_215_296_039_6;

/// Lanczos' window: sinc(π/3) = 3√3/2π and sinc(2π/3), half as much.
const WINDOW: [f64; HARMONICS] = {
    const S1: f64 = 0.826_993_343_132_688_1;
    const S2: f64 = 0.413_496_671_566_344_05;
    [1.0, S1, S1, S1, S2, S2, S2, S2, S2]
};

fn basis([x, y, z]: [f64; 3]) -> [f64; HARMONICS] {
    [
        Y0,
        Y1 * y,
        Y1 * z,
        Y1 * x,
        Y2 * x * y,
        Y2 * y * z,
        Y20 * (3.0 * z * z - 1.0),
        Y2 * x * z,
        Y22 * (x * x - y * y),
    ]
}

/// Coefficients of the turned function: l = 1 is a vector, l = 2 a symmetric matrix M of d·Md without trace.
fn turned(c: [f64; HARMONICS], turn: DMat3) -> [f64; HARMONICS] {
    let v = turn * DVec3::new(c[3], c[1], c[2]);
    let (xy, yz, xz) = (0.5 * Y2 * c[4], 0.5 * Y2 * c[5], 0.5 * Y2 * c[7]);
    let (axial, across) = (Y20 * c[6], Y22 * c[8]);
    let form = DMat3::from_cols_array_2d(&[
        [across - axial, xy, xz],
        [xy, -across - axial, yz],
        [xz, yz, 2.0 * axial],
    ]);
    let m = (turn * form * turn.transpose()).to_cols_array_2d();
    [
        c[0],
        v.y,
        v.z,
        v.x,
        2.0 * m[0][1] / Y2,
        2.0 * m[1][2] / Y2,
        m[2][2] / (2.0 * Y20),
        2.0 * m[0][2] / Y2,
        (m[0][0] - m[1][1]) / (2.0 * Y22),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn along(text: &str, directions: &[[f64; 3]]) -> Result<()> {
        let weight = 1.0 / directions.len() as f64;
        let directions: Vec<_> = directions.iter().map(|d| (*d, weight)).collect();
        AmbientLight::parse(text)?.check("6", &directions)
    }

    const SIX: [[f64; 3]; 6] = [
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
    ];

    /// Products of two harmonics integrate to 1 where they are the same and else to 0.
    #[test]
    fn harmonics_are_orthonormal_and_windowed() {
        // Heights at the middles of equal steps; twelve places around each are exact to the fourth power.
        let bases = (0..400 * 12).map(|i| {
            let z = (f64::from(i / 12) + 0.5) / 200.0 - 1.0;
            let (sin, cos) = (f64::from(i % 12) * std::f64::consts::PI / 6.0).sin_cos();
            let r = (1.0 - z * z).sqrt();
            basis([r * cos, r * sin, z])
        });
        let bases: Vec<_> = bases.collect();
        for i in 0..HARMONICS {
            for j in 0..=i {
                let mean = bases.iter().map(|b| b[i] * b[j]).sum::<f64>() / bases.len() as f64;
                let expected = f64::from(u8::from(i == j));
                assert!((4.0 * std::f64::consts::PI * mean - expected).abs() < 1e-3, "{i} {j}");
            }
        }
        let third = std::f64::consts::PI / 3.0;
        let sinc = |x: f64| x.sin() / x;
        assert!((WINDOW[1] - sinc(third)).abs() < 1e-15 && (WINDOW[8] - sinc(2.0 * third)).abs() < 1e-15);
    }

    #[test]
    fn lights_are_read_and_what_is_none_is_refused_by_name() {
        for (text, light) in [
            ("uniform", AmbientLight::Uniform),
            ("sky", AmbientLight::SKY),
            ("sky:0, 2,-1", AmbientLight::Sky([0.0, 2.0, -1.0])),
            ("sh:1/0.5,0,-1", AmbientLight::harmonics(&[[1.0; 3], [0.5, 0.0, -1.0]]).unwrap()),
        ] {
            assert_eq!(AmbientLight::parse(text).unwrap(), light);
            assert_eq!(AmbientLight::parse(&light.to_string()).unwrap(), light);
            assert!(along(text, &SIX).is_ok(), "{text}");
        }
        for (text, told) in [
            ("sun", "\"sun\"; expected uniform, sky, sky:X,Y,Z"),
            ("sky:1,2", "sky:X,Y,Z"),
            ("sh:1,2", "a number or R,G,B"),
            ("sh:", "a number or R,G,B"),
            ("sh:1/1/1/1/1/1/1/1/1/1", "10 coefficients; expected 1 to 9"),
        ] {
            let error = AmbientLight::parse(text).unwrap_err().to_string();
            assert!(error.starts_with("light: ") && error.contains(told), "{error}");
        }
        for (text, told) in [
            ("sky:0,0,0", "up = [0.0, 0.0, 0.0]; expected a direction"),
            ("sky:0,nan,0", "expected a direction"),
            ("sh:nan", "a coefficient NaN; expected finite numbers"),
            ("sh:-1", "no red light comes along any of the rays 6; expected some"),
            ("sh:1,1,0", "no blue light comes"),
        ] {
            let error = along(text, &SIX).unwrap_err().to_string();
            assert!(error.starts_with("light: ") && error.contains(told), "{error}");
        }
        // Light that is negative in places is some all the same.
        assert!(along("sh:0/0/1", &SIX).is_ok() && along("sh:0/0/1", &SIX[5..]).is_err());
        // Methods that follow no rays refuse lights themselves.
        assert!(along("sky", &[]).is_ok());
    }
}
