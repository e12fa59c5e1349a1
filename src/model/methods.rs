//! The methods of ambient occlusion: the one list that programs, scene files, charts, the planner and the README's table read.
//! `cao::method` has a constructor for each.

use crate::error::quoted;
use crate::light::Lights;
use crate::occlusion::{Quadrature, RaySet};
use crate::options::Options;
use crate::{Error, Result};

/// A method of ambient occlusion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Method {
    /// The mean opacity of a box around each voxel, from a summed-area table.
    Sat,
    /// Shells of such boxes.
    Shells,
    /// Directions in which nothing more opaque lies.
    Vicinity,
    /// Histograms of neighbourhoods, in clusters.
    Histograms,
    /// What a network that was trained takes for it.
    Deep,
    /// Local ambient occlusion of each feature by itself; equal to computing everything bit for bit.
    FeatureDriven,
    /// Local ambient occlusion of the clipped volume, every voxel.
    Lao,
    /// Contextual: only voxels that the clip affects; equal to [`Method::Lao`] bit for bit.
    Cao,
    /// Rays by brick in whole numbers, only where opacities changed; equal to computing everything bit for bit.
    Rays,
    /// Shells of cubes around each voxel, from volumes of means.
    Spao,
    /// Cones through volumes of means.
    Cones,
}

/// What is known of a method, and how it is used unless one says otherwise.
#[derive(Debug)]
pub struct Entry {
    /// Which one.
    pub method: Method,
    /// Name on the command line, in scene files and in tables.
    pub name: &'static str,
    /// Name in full.
    pub title: &'static str,
    /// What it does, in a clause.
    pub what: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// The rays that it follows unless others are asked for; [`RaySet::None`] where it follows none.
    pub rays: RaySet,
    /// The rules that it can integrate rays by; the first unless another is asked for.
    pub quadratures: &'static [Quadrature],
    /// The ray sets that charts and the planner try, in the order of their cost; others are for who asks for them.
    pub sets: &'static [RaySet],
    /// Names of the [options](Options) that it takes.
    pub options: &'static [&'static str],
    /// Options that charts and the planner try, names and values; the first is none, the method as it is.
    pub variants: &'static [&'static [(&'static str, &'static str)]],
    /// The ambient lights that it follows.
    pub lights: Lights,
    /// Whether an update computes only what a change affects; else everything.
    pub contextual: bool,
    /// The method whose values it has, bit for bit; itself where no other has them.
    pub same_values_as: Method,
}

/// Every method, the one to use first last.
pub static METHODS: &[Entry] = &[
    Entry {
        method: Method::Sat,
        name: "sat",
        title: "Summed-area table",
        what: "the mean opacity of a box around each voxel",
        source: "after Díaz",
        rays: RaySet::None,
        quadratures: &[Quadrature::Box],
        sets: &[RaySet::None],
        options: &[],
        variants: &[&[]],
        lights: Lights::Uniform,
        contextual: true,
        same_values_as: Method::Sat,
    },
    Entry {
        method: Method::Shells,
        name: "shells",
        title: "Shells of a summed-area table",
        what: "mean opacities of shells of boxes, behind one another",
        source: "after Schlegel",
        rays: RaySet::None,
        quadratures: &Quadrature::SHELLS,
        sets: &[RaySet::None],
        options: &["shells"],
        variants: &[&[], &[("shells", "4")], &[("shells", "8")], &[("shells", "32")]],
        lights: Lights::Uniform,
        contextual: true,
        same_values_as: Method::Shells,
    },
    Entry {
        method: Method::Vicinity,
        name: "vicinity",
        title: "Vicinity shading",
        what: "directions of a hemisphere in which nothing more opaque lies",
        source: "after Stewart",
        rays: RaySet::W50,
        quadratures: &[Quadrature::Visible],
        sets: &[RaySet::W26, RaySet::W50, RaySet::Spiral(96)],
        options: &[],
        variants: &[&[]],
        lights: Lights::Uniform,
        contextual: true,
        same_values_as: Method::Vicinity,
    },
    Entry {
        method: Method::Histograms,
        name: "histograms",
        title: "Clustered local histograms",
        what: "histograms of the unclipped neighbourhoods, in clusters",
        source: "after Ropinski",
        rays: RaySet::None,
        quadratures: &[Quadrature::Histogram],
        sets: &[RaySet::None],
        options: &["clusters", "bleeding"],
        variants: &[&[]],
        lights: Lights::Uniform,
        contextual: true,
        same_values_as: Method::Histograms,
    },
    Entry {
        method: Method::Deep,
        name: "dvao",
        title: "Deep volumetric ambient occlusion",
        what: "what a trained network makes of the whole volume, at every change",
        source: "DVAO §3",
        rays: RaySet::None,
        quadratures: &[Quadrature::Network],
        sets: &[RaySet::None],
        options: &["grid"],
        variants: &[&[], &[("grid", "tiles")]],
        lights: Lights::Uniform,
        contextual: false,
        same_values_as: Method::Deep,
    },
    Entry {
        method: Method::FeatureDriven,
        name: "fdao",
        title: "Feature-driven ambient occlusion",
        what: "rays of each feature by itself, of the bricks within reach of what changed",
        source: "fdAO §4, eq. (5), (6)",
        rays: RaySet::Spiral(50),
        quadratures: &Quadrature::BRICK,
        // Where there are no features its values are those of `rays`, whatever the option.
        sets: &[RaySet::Spiral(50)],
        options: &["combine"],
        variants: &[&[]],
        lights: Lights::Uniform,
        contextual: true,
        same_values_as: Method::FeatureDriven,
    },
    Entry {
        method: Method::Spao,
        name: "spao",
        title: "Smooth probabilistic ambient occlusion",
        what: "shells of cubes around each voxel, from volumes of means that are made at every change",
        source: "SPAO §1.2, §1.3",
        rays: RaySet::None,
        quadratures: &[Quadrature::Product],
        sets: &[RaySet::None],
        options: &["levels", "normal"],
        variants: &[
            &[],
            &[("levels", "mixed:1")],
            &[("levels", "mip")],
            &[("levels", "reversed:3")],
            &[("normal", "1")],
            &[("levels", "mip"), ("normal", "1")],
        ],
        lights: Lights::Uniform,
        contextual: true,
        same_values_as: Method::Spao,
    },
    Entry {
        method: Method::Cones,
        name: "cones",
        title: "Cone tracing",
        what: "cones through volumes of means that are made at every change",
        source: "ours, after voxel cone tracing (docs/cones.md)",
        rays: RaySet::W26,
        quadratures: &[Quadrature::Cone],
        sets: &[RaySet::W14, RaySet::W26],
        options: &[],
        variants: &[&[]],
        lights: Lights::Uniform,
        contextual: true,
        same_values_as: Method::Cones,
    },
    Entry {
        method: Method::Lao,
        name: "lao",
        title: "Local ambient occlusion",
        what: "all rays of every voxel, at every change",
        source: "CAO §3.4, eq. (2), (3)",
        rays: RaySet::R26,
        quadratures: &Quadrature::CAST,
        sets: &RaySet::ALL,
        options: &[],
        variants: &[&[]],
        lights: Lights::Grey,
        contextual: false,
        same_values_as: Method::Lao,
    },
    Entry {
        method: Method::Cao,
        name: "cao",
        title: "Contextual ambient occlusion",
        what: "all rays of the voxels that a clip affects",
        source: "CAO §3.5",
        rays: RaySet::R26,
        quadratures: &Quadrature::CAST,
        sets: &RaySet::ALL,
        options: &[],
        variants: &[&[]],
        lights: Lights::Grey,
        contextual: true,
        same_values_as: Method::Lao,
    },
    Entry {
        method: Method::Rays,
        name: "rays",
        title: "Rays by brick",
        what: "rays of the bricks within reach of what changed",
        source: "ours (method.md §4)",
        rays: RaySet::Spiral(50),
        quadratures: &Quadrature::BRICK,
        sets: &[
            RaySet::Spiral(14),
            RaySet::Spiral(26),
            RaySet::Spiral(50),
            RaySet::Spiral(96),
            RaySet::Spiral(192),
        ],
        options: &[],
        variants: &[&[]],
        lights: Lights::Coloured,
        contextual: true,
        same_values_as: Method::Rays,
    },
];

impl Default for Method {
    fn default() -> Self {
        Self::for_rule(None)
    }
}

impl Method {
    /// What is known of it.
    pub fn entry(self) -> &'static Entry {
        METHODS.iter().find(|entry| entry.method == self).expect("every method is listed")
    }

    /// Name on the command line and in scene files.
    pub fn name(self) -> &'static str {
        self.entry().name
    }

    /// The method called `name`.
    ///
    /// # Errors
    /// [`Error::Config`] for any other name.
    pub fn parse(name: &str) -> Result<Self> {
        METHODS.iter().find(|entry| entry.name == name).map(|entry| entry.method).ok_or_else(|| {
            Error::refused("method", format!("{}: expected {}", quoted(name), Self::names().join(", ")))
        })
    }

    /// The names of all methods.
    pub fn names() -> Vec<&'static str> {
        METHODS.iter().map(|entry| entry.name).collect()
    }

    /// The rays that it follows unless others are asked for.
    pub fn rays(self) -> RaySet {
        self.entry().rays
    }

    /// The rule that it integrates rays by unless another is asked for.
    pub fn quadrature(self) -> Quadrature {
        self.entry().quadratures[0]
    }

    /// Whether it can integrate rays by this rule.
    pub fn has(self, rule: Quadrature) -> bool {
        self.entry().quadratures.contains(&rule)
    }

    /// Whether it follows such rays: some, or none.
    pub fn follows(self, rays: RaySet) -> bool {
        (self.rays() == RaySet::None) == (rays == RaySet::None)
    }

    /// These rays where it follows such, else its own.
    pub fn rays_like(self, rays: RaySet) -> RaySet {
        if self.follows(rays) { rays } else { self.rays() }
    }

    /// The options that charts and the planner try.
    pub fn variants(self) -> impl Iterator<Item = Options> {
        let listed = self.entry().variants.iter();
        listed.map(|given| Options::DEFAULT.with(given).expect("variants are options"))
    }

    /// The method whose values it has, bit for bit; itself where no other has them.
    pub fn values(self) -> Self {
        self.entry().same_values_as
    }

    /// The method for whom names none: the last of the list that has the rule that is asked for.
    pub fn for_rule(quadrature: Option<Quadrature>) -> Self {
        let has = |entry: &&Entry| quadrature.is_none_or(|rule| entry.method.has(rule));
        METHODS.iter().rev().find(has).expect("every rule has a method").method
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_has_one_entry_and_is_found_by_its_name() {
        let all = [
            Method::Sat,
            Method::Shells,
            Method::Vicinity,
            Method::Histograms,
            Method::Deep,
            Method::FeatureDriven,
            Method::Spao,
            Method::Cones,
            Method::Lao,
            Method::Cao,
            Method::Rays,
        ];
        assert_eq!(all.len(), METHODS.len());
        for method in all {
            assert_eq!(METHODS.iter().filter(|entry| entry.method == method).count(), 1);
            assert_eq!(Method::parse(method.name()), Ok(method));
        }
        assert!(Method::parse("Rays").is_err());
    }

    #[test]
    fn entries_agree_with_themselves_and_with_those_whose_values_they_have() {
        for entry in METHODS {
            assert!(entry.sets.contains(&entry.rays) && !entry.quadratures.is_empty(), "{}", entry.name);
            assert!(entry.sets.iter().all(|set| entry.method.follows(*set)), "{}", entry.name);
            let options = entry.method.variants();
            assert_eq!(entry.method.variants().next(), Some(Options::DEFAULT), "{}", entry.name);
            for (name, _) in options.flat_map(|options| options.other_than(&Options::DEFAULT)) {
                assert!(entry.options.contains(&name), "{}: {name}", entry.name);
            }
            let like = entry.method.values().entry();
            assert_eq!(like.same_values_as, like.method, "{}: whose values are a third's", entry.name);
            assert_eq!((like.quadratures, like.lights), (entry.quadratures, entry.lights), "{}", entry.name);
        }
    }

    #[test]
    fn who_names_no_method_gets_the_one_that_has_his_rule() {
        assert_eq!(Method::default(), Method::Rays);
        for rule in Quadrature::ALL {
            // Rules of rays have several methods, others one.
            let method = match rule {
                Quadrature::Left | Quadrature::Cell | Quadrature::Segment => Method::Cao,
                Quadrature::Hybrid | Quadrature::Nearest | Quadrature::Linear => Method::Rays,
                Quadrature::Box => Method::Sat,
                Quadrature::Mean | Quadrature::End | Quadrature::Published => Method::Shells,
                Quadrature::Visible => Method::Vicinity,
                Quadrature::Histogram => Method::Histograms,
                Quadrature::Network => Method::Deep,
                Quadrature::Product => Method::Spao,
                Quadrature::Cone => Method::Cones,
            };
            assert_eq!(Method::for_rule(Some(rule)), method);
        }
    }
}
