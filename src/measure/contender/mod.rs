//! Contenders of the chart (measure.md §3): one method of ambient occlusion at one setting each, that brings its ambient
//! values up to date after a change and says what each stage of that cost.
//!
//! A new method joins by one file here, its `mod` line and its line in `METHODS`: a function that lists its settings
//! as [`Entry`]s, each of which opens a [`Contender`]. Where a [`Renderer`](crate::renderer::Renderer) does the work, `rendered` is all it takes.

mod cao;
mod cao_literal;
mod image_space;
mod lao;
mod lao_unit;
mod rendered;
mod solid;
mod sweep;

use crate::Result;
use ::cao::renderer::StereoImage;
use cao_gpu::{Gpu, Timings};
use cao_model::clip::Clip;
use cao_model::look::Look;
use cao_model::occlusion::{Occlusion, Quadrature};
use cao_model::transfer::TransferFunction;
use cao_model::view::View;
use cao_model::volume::Volume;

/// Every method, in the order of the legend.
const METHODS: [fn(&Asked) -> Vec<Entry>; 7] = [
    solid::entries,
    image_space::entries,
    lao_unit::entries,
    lao::entries,
    cao_literal::entries,
    cao::entries,
    sweep::entries,
];

/// Name of the method that times are quoted against: the paper's naive recomputation (method.md §2).
pub const BASELINE: &str = "LAO (unit)";

/// Every contender for such a scene.
pub fn all(asked: &Asked) -> Vec<Entry> {
    METHODS.iter().flat_map(|entries| entries(asked)).collect()
}

/// Place of a method in the legend.
pub fn place(method: &str) -> usize {
    let asked = Asked { min_spacing: 1.0, quick: true };
    let named = |entries: &fn(&Asked) -> Vec<Entry>| entries(&asked).iter().any(|e| e.method == method);
    METHODS.iter().position(named).unwrap_or(METHODS.len())
}

/// What settings depend on.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    /// Smallest spacing of the volume in mm.
    pub min_spacing: f64,
    /// Only enough settings for a first look?
    pub quick: bool,
}

/// What changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Other values in the same box: everything that was computed is out of date. Copying them to the device is not
    /// counted, for it is the same for every method.
    Volume,
    /// The clips moved.
    Clip,
    /// Another transfer function.
    Transfer,
    /// Another radius.
    Radius,
}

impl Change {
    /// Every kind.
    pub const ALL: [Self; 4] = [Self::Volume, Self::Clip, Self::Transfer, Self::Radius];

    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Volume => "new volume",
            Self::Clip => "clip moved",
            Self::Transfer => "transfer function edited",
            Self::Radius => "radius changed",
        }
    }
}

/// All that a change can change.
#[derive(Clone, Debug)]
pub struct State {
    /// The clips.
    pub clips: Vec<Clip>,
    /// Opacity and colour.
    pub transfer: TransferFunction,
    /// R in mm.
    pub radius_mm: f32,
}

/// What contenders compete on.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The device.
    pub gpu: &'a Gpu,
    /// The volume.
    pub volume: &'a Volume,
    /// The eyes.
    pub views: &'a [View; 2],
    /// Pixels of one eye's image.
    pub size: [u32; 2],
}

/// A method's setting, as it is shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    /// Beside its points in the chart, as `26w`.
    pub label: String,
    /// Rule along its rays, if it has rays: its mark in the chart.
    pub quadrature: Option<Quadrature>,
    /// The rest in words.
    pub details: String,
}

impl Setting {
    /// That of rays cast from voxels.
    pub fn rays(occlusion: &Occlusion, min_spacing: f64, details: &str) -> Self {
        let step = occlusion.step(min_spacing);
        let first = occlusion.first(min_spacing);
        Self {
            label: occlusion.rays.name().into(),
            quadrature: Some(occlusion.quadrature),
            details: format!("step {step} mm, first sample at {first} mm, {details}"),
        }
    }

    /// Label and rule, as `26w segment`.
    pub fn name(&self) -> String {
        match self.quadrature {
            Some(rule) => format!("{} {}", self.label, rule.name()),
            None => self.label.clone(),
        }
    }
}

/// A contender before it has anything on the device.
pub struct Entry {
    /// Name of the method.
    pub method: &'static str,
    /// Its setting.
    pub setting: Setting,
    /// Rough cost of an update in rays cast from every voxel: for the order of progress only.
    pub work: f64,
    /// Prepares it, up to date with the state given.
    pub open: Open,
}

/// How a frame is drawn whose depth stands for the surface: without noise, so that it is the same each time.
pub fn surface_look() -> Look {
    Look { jitter: false, occluded: false, ..Look::default() }
}

/// What opens a contender.
pub type Open = Box<dyn for<'a> Fn(Subject<'a>, &State) -> Result<Box<dyn Contender + 'a>>>;

/// Ambient values, 0 fully occluded … 1 unobstructed.
#[derive(Clone, Debug)]
pub enum Ambient {
    /// One a voxel, x fastest.
    Voxels(Vec<f32>),
    /// One a pixel of the left eye's image, rows from the top: that of the surface which [`surface_look`]'s depth shows there.
    Pixels(Vec<f32>),
}

/// One method at one setting.
pub trait Contender {
    /// Brings the ambient values up to date after a change to this state. Returns the device's time of each stage in ms.
    fn update(&mut self, change: Change, state: &State) -> Result<Timings>;

    /// The values, as of the last update.
    fn ambient(&self) -> Result<Ambient>;

    /// Both eyes as the method shows them, and the time that drawing them took, by stage.
    fn draw(&self, look: &Look) -> Result<(StereoImage, Timings)>;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(quick: bool) -> Vec<Entry> {
        all(&Asked { min_spacing: 1.0, quick })
    }

    #[test]
    fn every_method_has_its_settings_and_no_two_are_the_same() {
        for quick in [true, false] {
            let entries = entries(quick);
            for (i, a) in entries.iter().enumerate() {
                for b in &entries[..i] {
                    assert!((a.method, &a.setting) != (b.method, &b.setting), "{} {:?}", a.method, a.setting);
                }
            }
            let mut methods: Vec<_> = entries.iter().map(|e| e.method).collect();
            methods.dedup();
            assert_eq!(methods.len(), METHODS.len(), "{methods:?}: one run of settings a method");
        }
        assert!(entries(true).len() < entries(false).len());
    }

    #[test]
    fn the_baseline_is_there_with_the_papers_26_rays() {
        for quick in [true, false] {
            let found = entries(quick);
            let baseline = found.iter().filter(|e| e.method == BASELINE && e.setting.label == "26");
            assert_eq!(baseline.count(), 1);
        }
    }
}
