//! The methods of ambient occlusion: the one list that programs, scene files, charts, the planner and the README's table read.
//! `cao::method` has a constructor for each.

use crate::occlusion::{Quadrature, RaySet};
use crate::{Error, Result};

/// A method of ambient occlusion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Method {
    /// Local ambient occlusion of the clipped volume, every voxel.
    Lao,
    /// Contextual: only voxels that the clip affects; equal to [`Method::Lao`] bit for bit.
    Cao,
    /// Line sweeps along lattice directions, only where opacities changed; equal to sweeping everything bit for bit.
    Sweep,
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
    /// The rays that it follows unless others are asked for.
    pub rays: RaySet,
    /// The rules that it can integrate rays by; the first unless another is asked for.
    pub quadratures: &'static [Quadrature],
}

/// Every method, the one to use first last.
pub static METHODS: &[Entry] = &[
    Entry {
        method: Method::Lao,
        name: "lao",
        title: "Local ambient occlusion",
        what: "all rays of every voxel, at every change",
        source: "CAO §3.4, eq. (2), (3)",
        rays: RaySet::R26,
        quadratures: &[Quadrature::Left, Quadrature::Cell, Quadrature::Segment],
    },
    Entry {
        method: Method::Cao,
        name: "cao",
        title: "Contextual ambient occlusion",
        what: "all rays of the voxels that a clip affects",
        source: "CAO §3.5",
        rays: RaySet::R26,
        quadratures: &[Quadrature::Left, Quadrature::Cell, Quadrature::Segment],
    },
    Entry {
        method: Method::Sweep,
        name: "sweep",
        title: "Line sweeps",
        what: "whole lines of voxels, where opacities changed",
        source: "ours (method.md §4, §5)",
        // Those that cost it least for their accuracy.
        rays: RaySet::W26,
        quadratures: &[Quadrature::Segment],
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
            Error::refused("method", format!("{name:?}: expected {}", Self::names().join(", ")))
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

    /// The method for whom names none: the last of the list that has the rule that is asked for.
    pub fn for_rule(quadrature: Option<Quadrature>) -> Self {
        let has = |entry: &&Entry| quadrature.is_none_or(|rule| entry.quadratures.contains(&rule));
        METHODS.iter().rev().find(has).expect("every rule has a method").method
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_method_has_one_entry_and_is_found_by_its_name() {
        for method in [Method::Lao, Method::Cao, Method::Sweep] {
            assert_eq!(METHODS.iter().filter(|entry| entry.method == method).count(), 1);
            assert_eq!(Method::parse(method.name()), Ok(method));
        }
        assert!(Method::parse("Sweep").is_err());
    }

    #[test]
    fn who_names_no_method_gets_the_one_that_has_his_rule() {
        assert_eq!(Method::default(), Method::Sweep);
        assert_eq!(Method::for_rule(Some(Quadrature::Segment)), Method::Sweep);
        assert_eq!(Method::for_rule(Some(Quadrature::Left)), Method::Cao);
        assert_eq!(Method::for_rule(Some(Quadrature::Cell)), Method::Cao);
    }
}
