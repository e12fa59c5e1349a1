//! Contenders of the chart (measure.md §3): one method of ambient occlusion at one setting each, that brings its ambient
//! values up to date after a change and says what each stage of that cost.
//!
//! A new method joins by its lines in `CONTENDERS`, which has one kind of contender for each of [`cao_model::METHODS`]. Another way to
//! have ambient values joins by one file here and its line there: a function that lists its settings as [`Entrant`]s, each of
//! which opens a [`Contender`].

mod deep;
mod first_hits;
mod hemisphere;
mod image_space;
mod listed;
mod paper;
mod rendered;
mod solid;

use crate::Result;
use cao::renderer::StereoImage;
use cao_gpu::{Gpu, Timings};
use cao_model::clip::Clip;
use cao_model::look::{Look, Shading};
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::options::Options;
use cao_model::transfer::TransferFunction;
use cao_model::view::View;
use cao_model::volume::Volume;
use listed::Listed;

/// Everything that competes, in the order of the legend. The share of the voxels that a scene usually needs, and the share recomputed
/// for a change, are a fifth each (method.md §5).
static CONTENDERS: [Kind; 16] = [
    Kind { name: SOLID, enters: Enters::By(solid::entrants) },
    Kind { name: PHONG, enters: Enters::By(solid::phong) },
    Kind { name: "image space", enters: Enters::By(image_space::entrants) },
    Kind { name: BASELINE, enters: Enters::By(paper::unit) },
    Kind {
        name: "fdAO",
        enters: Enters::As(Listed {
            method: Method::FeatureDriven,
            computes: "bricks that show and changed, of each feature",
            ray: |_| 0.08,
            few: &[RaySet::Spiral(50)],
            half_sphere: |_| false,
        }),
    },
    Kind {
        name: "LAO",
        enters: Enters::As(Listed {
            method: Method::Lao,
            computes: "voxels that show recomputed",
            ray: |_| 0.2,
            few: &[RaySet::R6, RaySet::R26, RaySet::W26, RaySet::W50],
            half_sphere: |_| false,
        }),
    },
    Kind { name: "CAO literal", enters: Enters::By(paper::literal) },
    Kind {
        name: "CAO",
        enters: Enters::As(Listed {
            method: Method::Cao,
            computes: "voxels that show and changed",
            ray: |_| 0.2,
            few: &[RaySet::R6, RaySet::R26, RaySet::W26, RaySet::W50],
            half_sphere: |_| false,
        }),
    },
    Kind {
        name: "SPAO",
        enters: Enters::As(Listed {
            method: Method::Spao,
            computes: "levels anew, bricks that show and changed",
            ray: |_| 1.0,
            few: &[RaySet::None],
            half_sphere: |options| options.normal > 0.0,
        }),
    },
    Kind {
        name: "cones",
        enters: Enters::As(Listed {
            method: Method::Cones,
            computes: "levels anew, bricks that show and changed",
            ray: |_| 0.1,
            few: &[RaySet::W14, RaySet::W26],
            half_sphere: |_| false,
        }),
    },
    Kind {
        name: "rays",
        enters: Enters::As(Listed {
            method: Method::Rays,
            computes: "bricks that show and changed",
            ray: |_| 0.05,
            few: &[RaySet::Spiral(14), RaySet::Spiral(50), RaySet::Spiral(96)],
            half_sphere: |_| false,
        }),
    },
    Kind {
        name: "SAT",
        enters: Enters::As(Listed {
            method: Method::Sat,
            computes: "whole table, bricks that show and changed",
            ray: |_| 0.05,
            few: &[RaySet::None],
            half_sphere: |_| false,
        }),
    },
    Kind {
        name: "shells",
        enters: Enters::As(Listed {
            method: Method::Shells,
            computes: "whole table, bricks that show and changed",
            ray: |_| 0.05,
            few: &[RaySet::None],
            half_sphere: |_| false,
        }),
    },
    Kind {
        name: "vicinity",
        enters: Enters::As(Listed {
            method: Method::Vicinity,
            computes: "bricks that show and changed",
            ray: |_| 0.05,
            few: &[RaySet::W50],
            half_sphere: |_| true,
        }),
    },
    Kind {
        name: "histograms",
        enters: Enters::As(Listed {
            method: Method::Histograms,
            computes: "12 voxels at most, as if nothing were clipped; new values cluster anew",
            // A hundred rays of every voxel, where values or radius are new.
            ray: |_| 100.0,
            // Not for a first look, which is to take less than two minutes on a software driver.
            few: &[],
            half_sphere: |_| false,
        }),
    },
    Kind {
        name: "DVAO",
        enters: Enters::As(Listed {
            method: Method::Deep,
            computes: "the whole network",
            ray: deep::ray,
            // Nor is this one.
            few: &[],
            half_sphere: |_| false,
        }),
    },
];

/// A kind of contender.
struct Kind {
    /// In tables, files and the legend.
    name: &'static str,
    enters: Enters,
}

/// How its settings are found.
enum Enters {
    /// From a method's entry.
    As(Listed),
    /// By what it lists itself.
    By(fn(&'static str, &Asked) -> Vec<Entrant>),
}

impl Kind {
    fn entrants(&self, asked: &Asked) -> Vec<Entrant> {
        match &self.enters {
            Enters::As(listed) => listed.entrants(self.name, asked),
            Enters::By(list) => list(self.name, asked),
        }
    }
}

/// What methods that shade half a sphere count in data space, where all of it is shaded: a flat wall has 1 in the ones, 1/2 in the others.
const HALF_SPHERE: f32 = 0.5;

/// Name of no ambient occlusion, the paper's "solid colour" (CAO §4).
pub const SOLID: &str = "solid colour";

/// Name of light from one side without ambient occlusion, which CAO leaves for later (§6).
pub const PHONG: &str = "Phong";

/// Name of the contender that times are quoted against: the paper's naive recomputation (method.md §2).
pub const BASELINE: &str = "LAO (unit)";

/// Name of a method's contender.
pub fn name(method: Method) -> &'static str {
    let own = |kind: &&Kind| matches!(&kind.enters, Enters::As(listed) if listed.method == method);
    CONTENDERS.iter().find(own).map_or(method.name(), |kind| kind.name)
}

/// Label of a method without rays with these options.
pub fn label_of(method: Method, options: &Options) -> String {
    listed::with_options(method.quadrature().name().into(), options)
}

/// Every contender for such a scene.
pub fn all(asked: &Asked) -> Vec<Entrant> {
    CONTENDERS.iter().flat_map(|kind| kind.entrants(asked)).collect()
}

/// The paper's two methods with so many of its rays: the naive recomputation, and the contextual update of every voxel.
pub fn printed(rays: RaySet, min_spacing: f64) -> [Entrant; 2] {
    paper::printed([BASELINE, name(Method::Cao)], rays, min_spacing)
}

/// The one without occlusion.
pub fn solid() -> Entrant {
    solid::entrant(SOLID)
}

/// Place of a name in the legend.
pub fn place(name: &str) -> usize {
    CONTENDERS.iter().position(|kind| kind.name == name).unwrap_or(CONTENDERS.len())
}

/// What settings depend on.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    /// Smallest spacing of the volume in mm.
    pub min_spacing: f64,
    /// R in such spacings.
    pub radius: f64,
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

/// Where contenders compete.
#[derive(Clone, Copy)]
pub struct Arena<'a> {
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
    /// That of rays.
    fn rays(occlusion: &Occlusion, min_spacing: f64, computes: &str) -> Self {
        let (step, first) = (occlusion.step(min_spacing), occlusion.first(min_spacing));
        let details = format!("step {step} mm, first sample at {first} mm, {computes}");
        Self { label: occlusion.rays.name(), quadrature: Some(occlusion.quadrature), details }
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
pub struct Entrant {
    /// Its kind's name.
    pub method: &'static str,
    /// Its setting.
    pub setting: Setting,
    /// Rough cost of an update in rays cast from every voxel: for the order of progress only.
    pub work: f64,
    /// Whether it has ambient values; else only its pictures are of interest, and what drawing them takes.
    pub has_values: bool,
    /// Prepares it, up to date with the state given.
    pub open: Open,
}

/// How a frame is drawn whose depth stands for the surface: without noise, so that it is the same each time.
pub fn surface_look() -> Look {
    Look { shading: Shading::None, ..Look::default() }
}

/// What opens a contender.
pub type Open = Box<dyn for<'a> Fn(Arena<'a>, &State) -> Result<Box<dyn Contender + 'a>>>;

/// Ambient values, 0 fully occluded … 1 unobstructed.
#[derive(Clone, Debug)]
pub enum Values {
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
    fn ambient(&self) -> Result<Values>;

    /// Both eyes as the method shows them, and the time that drawing them took, by stage.
    fn draw(&self, look: &Look) -> Result<(StereoImage, Timings)>;
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::METHODS;

    fn entrants(quick: bool) -> Vec<Entrant> {
        all(&Asked { min_spacing: 1.0, radius: 8.0, quick })
    }

    #[test]
    fn every_method_has_one_contender() {
        let listed: Vec<&Listed> = CONTENDERS
            .iter()
            .filter_map(|kind| match &kind.enters {
                Enters::As(listed) => Some(listed),
                Enters::By(_) => None,
            })
            .collect();
        for entry in METHODS {
            let own: Vec<_> = listed.iter().filter(|listed| listed.method == entry.method).collect();
            assert_eq!(own.len(), 1, "{}", entry.name);
            assert!(own[0].few.iter().all(|set| entry.sets.contains(set)), "{}", entry.name);
        }
        assert_eq!(listed.len(), METHODS.len());
    }

    /// Files of earlier runs have them.
    #[test]
    fn names_stay() {
        let names = CONTENDERS.each_ref().map(|kind| kind.name);
        assert_eq!(
            names,
            [
                "solid colour",
                "Phong",
                "image space",
                "LAO (unit)",
                "fdAO",
                "LAO",
                "CAO literal",
                "CAO",
                "SPAO",
                "cones",
                "rays",
                "SAT",
                "shells",
                "vicinity",
                "histograms",
                "DVAO"
            ]
        );
        let listed: Vec<_> = METHODS.iter().map(|e| name(e.method)).collect();
        assert_eq!(
            listed,
            [
                "SAT",
                "shells",
                "vicinity",
                "histograms",
                "DVAO",
                "fdAO",
                "SPAO",
                "cones",
                "LAO",
                "CAO",
                "rays"
            ]
        );
        assert_eq!(names.map(place), std::array::from_fn(|place| place));
    }

    #[test]
    fn every_kind_has_its_settings_and_no_two_are_the_same() {
        let quick = [1, 1, 1, 4, 2, 8, 2, 8, 3, 2, 6, 1, 4, 1, 0, 0];
        let full = [1, 1, 6, 4, 3, 21, 4, 21, 6, 2, 15, 1, 12, 3, 1, 2];
        for (quick, counts) in [(true, quick), (false, full)] {
            let entrants = entrants(quick);
            for (i, a) in entrants.iter().enumerate() {
                for b in &entrants[..i] {
                    assert!((a.method, &a.setting) != (b.method, &b.setting), "{} {:?}", a.method, a.setting);
                }
            }
            let of = |kind: &Kind| entrants.iter().filter(|e| e.method == kind.name).count();
            assert_eq!(CONTENDERS.each_ref().map(of), counts, "quick: {quick}");
        }
    }

    #[test]
    fn the_baseline_is_there_with_the_papers_26_rays() {
        for quick in [true, false] {
            let found = entrants(quick);
            let baseline = found.iter().filter(|e| e.method == BASELINE && e.setting.label == "26");
            assert_eq!(baseline.count(), 1);
        }
    }
}
