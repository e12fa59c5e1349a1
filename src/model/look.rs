//! How a picture looks: light, and the samples along its rays.

use crate::samples::{Filter, MOST_SAMPLES, offsets};
use crate::{Error, Result};
use glam::{Vec2, Vec3};

/// How samples are lit and where they lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Part of the light that comes from everywhere; times the ambient factor.
    pub ambient: f32,
    /// Part of the light that depends on the surface's direction; times the ambient factor too.
    pub diffuse: f32,
    /// Direction towards the light in the world; the same for both eyes.
    pub light: Vec3,
    /// Distance between samples along a ray in mm; `None` is a quarter of the smallest spacing: at half of it,
    /// steep transfer functions show wood-grain.
    pub step_mm: Option<f32>,
    /// A ray ends where what remains of it cannot change an 8-bit sRGB pixel, over any background, by more than this many
    /// levels of 255; 0: only where nothing remains.
    pub tolerance: f32,
    /// The ambient factor is shown times this. A flat wall's is 1/2, so that 2 shows it at full light; the paper's authors do
    /// the same.
    pub gain: f32,
    /// Whether the ambient factor is shown; without it the picture is the paper's "solid colour".
    pub occluded: bool,
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
            ambient: 0.6,
            diffuse: 0.6,
            light: Vec3::new(-0.4, -0.7, 0.6).normalize(),
            step_mm: None,
            tolerance: 0.5,
            gain: 2.0,
            occluded: true,
            samples: 1,
            filter: Filter::default(),
            budget_ms: None,
        }
    }
}

impl Look {
    /// What may remain of a ray's light, times the slope of sRGB coding: the tolerance over the brightest light there is, a
    /// white background's or that of a white sample, unoccluded and facing the light.
    pub fn remainder(&self) -> f32 {
        let brightest = (self.ambient + self.diffuse) * if self.occluded { self.gain } else { 1.0 };
        self.tolerance / 255.0 / brightest.max(1.0)
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
            ("shading.gain", self.gain),
            ("shading.tolerance", self.tolerance),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return refuse(what, format!("{value}; expected a number >= 0"));
            }
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
