//! Where methods fail (measure.md §4): one trial for each way, from the range where it holds through the one where it does
//! not, ours in the same run.
//!
//! A trial has a plan (sizes, values of its parameter), and finds a [`Finding`]: the curves, and one sentence that says what
//! failed at which value, made from the numbers alone. A trial in which nothing fails shows nothing, so that each
//! carries its own control: a method that is known to fail there.

pub mod absorption;
pub mod anisotropy;
pub mod concave;
pub mod cut;
pub mod dilation;
pub mod labels;
pub mod layers;
pub mod map;
pub mod mesh_stereo;
pub mod mip_blocks;
pub mod motion;
pub mod network;
pub mod noise;
pub mod numbers;
pub mod off_screen;
pub mod overdraw;
pub mod page;
pub mod pixels;
mod plane_cut;
mod progressive;
mod quads;
pub mod radius;
pub mod shape;
pub mod sheets;
pub mod shells;
pub mod slope;
pub mod stacked;
pub mod stacked_layers;
pub mod stereo;
pub mod tables;
pub mod tessellation;
pub mod thin_sheets;
pub mod views;

use crate::Result;
use crate::plot::short;
use cao::clip::peel::Layers;
use cao_gpu::Gpu;
use cao_twin::clip::clips::{MeshLayers, NO_BACK, NO_FRONT};

/// How long a trial may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// A fraction of a minute each, on two cores: the sizes that the charts are meant for.
    Full,
    /// Seconds each: fewer and coarser steps over the same ranges.
    Quick,
}

/// Whether a curve is ours, a method that the trial is there to catch, or a yardstick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// This program, as it is used.
    Ours,
    /// A method that fails.
    Control,
    /// The truth, or what no method could do better.
    Yardstick,
}

/// One curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// What it shows.
    pub name: String,
    /// Whose it is.
    pub role: Role,
    /// (parameter, measured), ascending.
    pub points: Vec<[f64; 2]>,
}

impl Series {
    /// Ours.
    pub fn ours(name: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self { name: name.into(), role: Role::Ours, points }
    }

    /// What fails.
    pub fn control(name: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self { name: name.into(), role: Role::Control, points }
    }

    /// What the others are measured by.
    pub fn yardstick(name: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self { name: name.into(), role: Role::Yardstick, points }
    }

    /// Largest measured value, NaN if any is; 0 of nothing.
    pub fn largest(&self) -> f64 {
        // `f64::max` would drop a NaN, and with it what is wrong.
        self.points
            .iter()
            .fold(0.0, |most, &[_, value]| if value.is_nan() || value > most { value } else { most })
    }

    /// Measured value where the parameter is nearest to `x`; NaN of nothing.
    pub fn at(&self, x: f64) -> f64 {
        self.nearest_to(x)[1]
    }

    /// The parameter's value nearest to `x`; NaN of nothing.
    pub fn nearest(&self, x: f64) -> f64 {
        self.nearest_to(x)[0]
    }

    fn nearest_to(&self, x: f64) -> [f64; 2] {
        let nearest = self.points.iter().min_by(|a, b| (a[0] - x).abs().total_cmp(&(b[0] - x).abs()));
        nearest.copied().unwrap_or([f64::NAN; 2])
    }
}

/// What an axis of a chart shows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Quantity {
    /// What and in which unit.
    pub label: String,
    /// Equal factors have equal lengths.
    pub log: bool,
}

impl Quantity {
    /// Equal differences have equal lengths.
    pub fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), log: false }
    }

    /// Equal factors have equal lengths.
    pub fn log(label: impl Into<String>) -> Self {
        Self { label: label.into(), log: true }
    }
}

/// Curves over one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// What is asked.
    pub title: String,
    /// The parameter.
    pub x: Quantity,
    /// What is measured.
    pub y: Quantity,
    /// The curves.
    pub series: Vec<Series>,
}

/// What a trial says about ours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ours {
    /// It does over the whole range what it claims.
    Holds,
    /// The method itself ends here, and so does ours; the trial shows where.
    Limited,
    /// It does not do what it claims.
    Fails,
}

impl Ours {
    /// Holds if it does.
    pub fn holding(does: bool) -> Self {
        if does { Self::Holds } else { Self::Fails }
    }

    /// `holds`, `limited`, `fails`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Limited => "limited",
            Self::Fails => "fails",
        }
    }
}

/// What a trial found.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// The curves.
    pub charts: Vec<Chart>,
    /// What failed and at which value.
    pub sentence: String,
    /// Whether ours did.
    pub ours: Ours,
    /// Whether the control failed, as it must: else the trial could not have caught anything.
    pub control_fails: bool,
    /// What was computed: sizes and settings.
    pub setting: String,
}

/// Runs a trial, telling the share done (0 … 1). Uses the device's queue and waits for it.
pub type Run = fn(&Gpu, Effort, &mut dyn FnMut(f64)) -> Result<Finding>;

/// A trial by its name.
#[derive(Clone, Copy)]
pub struct Trial {
    /// On the command line.
    pub name: &'static str,
    /// What it asks.
    pub title: &'static str,
    /// Runs it.
    pub run: Run,
}

/// Every trial, in the order of measure.md §4.
pub const TRIALS: [Trial; 29] = [
    Trial {
        name: "stereo",
        title: "Do both eyes see the same shading?",
        run: |gpu, effort, progress| stereo::run(gpu, &stereo::Plan::of(effort), progress),
    },
    Trial {
        name: "pixels",
        title: "Do both eyes' pictures show a surface in the same colours?",
        run: |gpu, effort, progress| pixels::run(gpu, &pixels::Plan::of(effort), progress),
    },
    Trial {
        name: "motion",
        title: "Does a clip that moves slowly pop, and when has a frame settled?",
        run: |gpu, effort, progress| motion::run(gpu, &motion::Plan::of(effort), progress),
    },
    Trial {
        name: "dilation",
        title: "Which dilation map leaves voxels stale?",
        run: |gpu, effort, progress| dilation::run(gpu, &dilation::Plan::of(effort), progress),
    },
    Trial {
        name: "map",
        title: "How large does a clip's depth map have to be?",
        run: |gpu, effort, progress| map::run(gpu, &map::Plan::of(effort), progress),
    },
    Trial {
        name: "concave",
        title: "What is cut wrongly when a concave clip has too few depth layers?",
        run: |gpu, effort, progress| concave::run(gpu, &concave::Plan::of(effort), progress),
    },
    Trial {
        name: "cut",
        title: "How wrong is the shading of a cut face?",
        run: |gpu, effort, progress| cut::run(gpu, &cut::Plan::of(effort), progress),
    },
    Trial {
        name: "radius",
        title: "How dark do inner layers become as the radius grows?",
        run: |_, effort, progress| radius::run(&radius::Plan::of(effort), progress),
    },
    Trial {
        name: "layers",
        title: "Does each layer's shading depend on the layers around it?",
        run: |_, effort, progress| layers::run(&layers::Plan::of(effort), progress),
    },
    Trial {
        name: "labels",
        title: "What does a segmentation that is off do to feature-driven occlusion?",
        run: |gpu, effort, progress| labels::run(gpu, &labels::Plan::of(effort), progress),
    },
    Trial {
        name: "sheets",
        title: "How much occlusion of thin sheets do directions and steps miss?",
        run: |_, effort, progress| sheets::run(&sheets::Plan::of(effort), progress),
    },
    Trial {
        name: "anisotropy",
        title: "Does the shading depend on which way a scene lies on anisotropic voxels?",
        run: |_, effort, progress| anisotropy::run(&anisotropy::Plan::of(effort), progress),
    },
    Trial {
        name: "numbers",
        title: "Do extreme and impossible numbers give a defined result or a clear error?",
        run: |gpu, effort, progress| numbers::run(gpu, &numbers::Plan::of(effort), progress),
    },
    Trial {
        name: "views",
        title: "Do odd eyes see holes, or each another picture?",
        run: |gpu, effort, progress| views::run(gpu, &views::Plan::of(effort), progress),
    },
    Trial {
        name: "tables",
        title: "How wrong are means from a summed-area table of floats?",
        run: |_, effort, progress| tables::run(&tables::Plan::of(effort), progress),
    },
    Trial {
        name: "shells",
        title: "Do more shells make a wall darker?",
        run: |_, effort, progress| shells::run(&shells::Plan::of(effort), progress),
    },
    Trial {
        name: "noise",
        title: "How much does noise in the values change the shading?",
        run: |_, effort, progress| noise::run(&noise::Plan::of(effort), progress),
    },
    Trial {
        name: "absorption",
        title: "Does an opaque sheet hide what lies behind it?",
        run: |_, effort, progress| absorption::run(&absorption::Plan::of(effort), progress),
    },
    Trial {
        name: "shape",
        title: "What of each method's error does no tone mend?",
        run: |_, effort, progress| shape::run(&shape::Plan::of(effort), progress),
    },
    Trial {
        name: "stacked-layers",
        title: "Do sheets that no light reaches darken what lies in front of the first?",
        run: |_, effort, progress| stacked_layers::run(&stacked_layers::Plan::of(effort), progress),
    },
    Trial {
        name: "mip-blocks",
        title: "Does a wall change its shading as it moves by whole voxels?",
        run: |_, effort, progress| mip_blocks::run(&mip_blocks::Plan::of(effort), progress),
    },
    Trial {
        name: "thin-sheets",
        title: "How wrong are cones about sheets that are thinner than they are wide?",
        run: |_, effort, progress| thin_sheets::run(&thin_sheets::Plan::of(effort), progress),
    },
    Trial {
        name: "network",
        title: "How wrong is a network about what it was not trained on?",
        run: |_, effort, progress| network::run(&network::Plan::of(effort), progress),
    },
    Trial {
        name: "off-screen",
        title: "Does a point change when what occludes it leaves the picture?",
        run: |_, effort, progress| off_screen::run(&off_screen::Plan::of(effort), progress),
    },
    Trial {
        name: "slope",
        title: "Does a plane occlude itself when it is seen aslant?",
        run: |_, effort, progress| slope::run(&slope::Plan::of(effort), progress),
    },
    Trial {
        name: "mesh-stereo",
        title: "Do both eyes see the same occlusion of a mesh?",
        run: |gpu, effort, progress| mesh_stereo::run(gpu, &mesh_stereo::Plan::of(effort), progress),
    },
    Trial {
        name: "stacked",
        title: "Do surfaces that no light reaches darken a point in front of the first?",
        run: |_, effort, progress| stacked::run(&stacked::Plan::of(effort), progress),
    },
    Trial {
        name: "tessellation",
        title: "Does a wall hide less the more finely it is divided?",
        run: |_, effort, progress| tessellation::run(&tessellation::Plan::of(effort), progress),
    },
    Trial {
        name: "overdraw",
        title: "How does the work of occlusion volumes grow with their reach?",
        run: |gpu, effort, progress| overdraw::run(gpu, &overdraw::Plan::of(effort), progress),
    },
];

impl Trial {
    /// The trial called `name`.
    pub fn parse(name: &str) -> Result<Self> {
        TRIALS.into_iter().find(|trial| trial.name == name).ok_or_else(|| {
            let names = TRIALS.map(|trial| trial.name).join(", ");
            crate::Error::refused("trial", format!("\"{name}\" is none; there are {names}"))
        })
    }
}

/// The device's depth layers in the form of the twins', whose empty pixels hide nothing.
fn as_twin(layers: &Layers) -> MeshLayers {
    let pixels = (layers.camera.resolution * layers.camera.resolution) as usize;
    let map = |side: usize, none: f32| -> Vec<Vec<f32>> {
        let of = |map: &[f32]| map.iter().map(|&z| if z < 1.0 { z } else { none }).collect();
        layers.depth.chunks(pixels).skip(side).step_by(2).map(of).collect()
    };
    MeshLayers { camera: layers.camera, front: map(0, NO_FRONT), back: map(1, NO_BACK) }
}

/// `count` numbers from `low` to `high`, both included.
fn evenly(low: f64, high: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| low + (high - low) * i as f64 / (count - 1).max(1) as f64).collect()
}

/// Mean; 0 of nothing.
fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The value below which `share` of the values lie; 0 of nothing.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = (share * (sorted.len().max(1) - 1) as f64).round() as usize;
    sorted.get(place).copied().unwrap_or(0.0)
}

/// A number that may be far below a display's steps: then its power of ten tells more than its zeros.
fn tiny(value: f64) -> String {
    if value > 0.0 && value < 1e-4 { format!("{value:.0e}") } else { short(value) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_with_a_nan_has_no_largest_value() {
        let largest = |points: &[f64]| Series::ours("", points.iter().map(|y| [0.0, *y]).collect()).largest();
        assert_eq!((largest(&[]), largest(&[1.0, 3.0, 2.0])), (0.0, 3.0));
        assert!(largest(&[f64::NAN, 1.0]).is_nan() && largest(&[1.0, f64::NAN]).is_nan());
    }

    #[test]
    fn tiny_numbers_are_powers_of_ten() {
        assert_eq!([0.0, 3.1e-8, 0.25].map(tiny), ["0", "3e-8", "0.25"]);
    }

    #[test]
    fn quantiles_and_means_are_of_the_values() {
        let values: Vec<f64> = (0..101).rev().map(f64::from).collect();
        assert_eq!((mean(&values), quantile(&values, 0.99), quantile(&values, 0.0)), (50.0, 99.0, 0.0));
        assert_eq!((mean(&[]), quantile(&[], 0.5)), (0.0, 0.0));
        assert_eq!(evenly(0.0, 1.0, 3), [0.0, 0.5, 1.0]);
    }

    #[test]
    fn trials_have_names_of_their_own() {
        for trial in TRIALS {
            assert_eq!(Trial::parse(trial.name).unwrap().title, trial.title);
        }
        assert!(Trial::parse("colour").is_err_and(|e| e.to_string().contains("stereo, pixels")));
    }
}
