//! How a picture looks: light, and the samples along its rays.

use crate::error::quoted;
use crate::samples::{Filter, MOST_SAMPLES, offsets};
use crate::{Error, Result};
use glam::{Quat, Vec2, Vec3};

/// Which parts of the light a picture shows, so that they can be compared (CAO §4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shading {
    /// The transfer function's colours alone.
    None,
    /// Ambient, diffuse and specular light.
    Phong,
    /// Colours times the ambient factor.
    Ao,
    /// Ambient, diffuse and specular light, and the ambient factor on what [`Look::occluded`] says.
    PhongAo,
}

impl Shading {
    const NAMES: [(Self, &str); 4] =
        [(Self::None, "none"), (Self::Phong, "phong"), (Self::Ao, "ao"), (Self::PhongAo, "phong+ao")];

    /// `none`, `phong`, `ao` or `phong+ao`.
    pub fn parse(name: &str) -> Result<Self> {
        named(&Self::NAMES, "shading", name)
    }

    /// Whether the ambient factor is shown.
    pub fn occluded(self) -> bool {
        matches!(self, Self::Ao | Self::PhongAo)
    }
}

/// What the light's direction is fixed to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightFrom {
    /// The head, whose axes are those of the first view: x right, y up, z backwards. All views see the same light.
    Head,
    /// The world.
    World,
}

impl LightFrom {
    const NAMES: [(Self, &str); 2] = [(Self::Head, "head"), (Self::World, "world")];

    /// `head` or `world`.
    pub fn parse(name: &str) -> Result<Self> {
        named(&Self::NAMES, "light", name)
    }
}

/// What the ambient factor multiplies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Occluded {
    /// The ambient part: light from everywhere comes in where there is a way, light from one side does not care.
    Ambient,
    /// All of it, as in the paper's pictures.
    All,
}

impl Occluded {
    const NAMES: [(Self, &str); 2] = [(Self::Ambient, "ambient"), (Self::All, "all")];

    /// `ambient` or `all`.
    pub fn parse(name: &str) -> Result<Self> {
        named(&Self::NAMES, "occluded light", name)
    }
}

/// The value of this name.
fn named<T: Copy>(names: &[(T, &str)], what: &str, name: &str) -> Result<T> {
    let found = names.iter().find(|(_, other)| *other == name).map(|(value, _)| *value);
    found.ok_or_else(|| {
        let (last, rest) = names.split_last().expect("there are names");
        let rest: Vec<_> = rest.iter().map(|(_, name)| *name).collect();
        let problem = format!("{}; expected {} or {}", quoted(name), rest.join(", "), last.1);
        Error::Config { what: what.into(), problem }
    })
}

/// How samples are lit and where they lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Which parts of the light are shown.
    pub shading: Shading,
    /// Light that comes from everywhere.
    pub ambient: f32,
    /// Light that depends on the surface's direction, Lambert's.
    pub diffuse: f32,
    /// White light that a surface reflects towards the eye, Blinn's and Phong's.
    pub specular: f32,
    /// Exponent of that reflection; the larger, the smaller the highlight.
    pub shininess: f32,
    /// Whether surfaces are lit from behind as from the front.
    pub two_sided: bool,
    /// Direction towards the light, the same for all views.
    pub light: Vec3,
    /// What that direction is fixed to.
    pub light_from: LightFrom,
    /// What the ambient factor multiplies.
    pub occluded: Occluded,
    /// The ambient factor is shown times this, and at most as 1. A flat wall's is 1/2, so that 2 shows it at full light; the
    /// paper's authors do the same.
    pub gain: f32,
    /// Distance between samples along a ray in mm; `None` is a quarter of the smallest spacing: at half of it,
    /// steep transfer functions show wood-grain.
    pub step_mm: Option<f32>,
    /// A ray ends where what remains of it cannot change an 8-bit sRGB pixel, over any background, by more than this many
    /// levels of 255; 0: only where nothing remains.
    pub tolerance: f32,
    /// Rays of a pixel, 1 … 256: the colour is their mean, premultiplied and linear, the depth that of the one nearest to the pixel's
    /// centre. One goes through the centre.
    pub samples: u32,
    /// How they are spread; the same in every pixel, view and frame.
    pub filter: Filter,
    /// What a recorded drawing is to take, ms: resolution and distance of samples follow from the times of former ones, which the host
    /// tells. `None`: always full quality.
    pub budget_ms: Option<f32>,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            shading: Shading::PhongAo,
            ambient: 0.4,
            diffuse: 0.65,
            specular: 0.15,
            shininess: 24.0,
            two_sided: false,
            light: Vec3::new(-0.7, 0.7, 0.6).normalize(),
            light_from: LightFrom::Head,
            occluded: Occluded::Ambient,
            gain: 2.0,
            step_mm: None,
            tolerance: 0.5,
            samples: 1,
            filter: Filter::default(),
            budget_ms: None,
        }
    }
}

impl Look {
    /// Largest exponent of the highlight: a mirror's edge in 8 bits; beyond, powers of cosines that are 1 to rounding are not.
    pub const MOST_SHININESS: f32 = 1e4;

    /// Ambient, diffuse and specular light as shown.
    pub fn parts(&self) -> [f32; 3] {
        match self.shading {
            Shading::None | Shading::Ao => [1.0, 0.0, 0.0],
            Shading::Phong | Shading::PhongAo => [self.ambient, self.diffuse, self.specular],
        }
    }

    /// Unit vector towards the light in the world, for a head of this orientation.
    pub fn towards_light(&self, head: Quat) -> Vec3 {
        let light = self.light.normalize();
        match self.light_from {
            LightFrom::Head => head * light,
            LightFrom::World => light,
        }
    }

    /// What may remain of a ray's light, times the slope of sRGB coding: the tolerance over the brightest light there is, a
    /// white background's or that of a white sample, unoccluded, that faces the light and mirrors it into the eye.
    pub fn remainder(&self) -> f32 {
        self.tolerance / 255.0 / self.parts().iter().sum::<f32>().max(1.0)
    }

    /// The distance between samples in mm, for a volume whose smallest spacing is `min_spacing` mm.
    pub fn step(&self, min_spacing: f32) -> f32 {
        self.step_mm.unwrap_or(0.25 * min_spacing)
    }

    /// Places of a pixel's samples, in pixels from its centre, the nearest first.
    pub fn offsets(&self) -> Vec<Vec2> {
        offsets(self.samples, self.filter)
    }

    /// Refuses impossible values.
    pub fn check(&self) -> Result<()> {
        let refuse = |what: &str, problem: String| Err(Error::Config { what: what.into(), problem });
        for (what, value) in [
            ("shading.ambient", self.ambient),
            ("shading.diffuse", self.diffuse),
            ("shading.specular", self.specular),
            ("shading.gain", self.gain),
            ("shading.tolerance", self.tolerance),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return refuse(what, format!("{value}; expected a number >= 0"));
            }
        }
        if !(1.0..=Self::MOST_SHININESS).contains(&self.shininess) {
            let problem = format!("{}; expected a number from 1 to {}", self.shininess, Self::MOST_SHININESS);
            return refuse("shading.shininess", problem);
        }
        if self.light.try_normalize().is_none() {
            return refuse("shading.light", format!("{}; expected a direction", self.light));
        }
        if !(1..=MOST_SAMPLES).contains(&self.samples) {
            return refuse("image.samples", format!("{}; expected 1 to {MOST_SAMPLES}", self.samples));
        }
        if let Some(ms) = self.budget_ms.filter(|ms| !(ms.is_finite() && *ms > 0.0)) {
            return refuse("budget_ms", format!("{ms}; expected a time > 0 ms"));
        }
        match self.step_mm {
            Some(step) if !(step.is_finite() && step > 0.0) => {
                refuse("image.step_mm", format!("{step}; expected a length > 0 mm"))
            }
            _ => Ok(()),
        }
    }
}
