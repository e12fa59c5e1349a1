//! Features: parts of a volume that are shown, weakened, coloured and spared by clips each for itself (after fdAO §4.1).
//!
//! Every voxel belongs to one feature k = 1 … K, K ≤ [`Features::MOST`], or to none, 0: by the interval that its value lies in, or by a label.
//! Opacity is that of the transfer function times the feature's: `V_f(x) = min(s_k TF_o(V(x)), 1)`, 0 where the feature is hidden.

use crate::error::quoted;
use crate::{Error, Result};
use std::sync::Arc;

/// A part of a volume.
#[derive(Clone, Debug, PartialEq)]
pub struct Feature {
    /// What it is called; no two have one name.
    pub name: String,
    /// Whether it shows.
    pub visible: bool,
    /// What opacities are multiplied with, 0 … [`Self::MOST_SCALE`]; they end at 1.
    pub scale: f32,
    /// Linear red, green and blue; the transfer function's where it has none.
    pub colour: Option<[f32; 3]>,
    /// Whether clips leave it whole.
    pub spared: bool,
}

impl Feature {
    /// Largest scale.
    pub const MOST_SCALE: f32 = 16.0;

    /// A feature that changes nothing.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), visible: true, scale: 1.0, colour: None, spared: false }
    }

    /// What the opacity of its voxels is multiplied with.
    pub fn factor(&self) -> f32 {
        if self.visible { self.scale } else { 0.0 }
    }

    fn check(&self) -> Result<()> {
        let refuse =
            |key: &str, problem: String| Err(Error::refused(key, problem).under(&section(&self.name)));
        let most = Self::MOST_SCALE;
        if self.name.trim().is_empty() {
            return Err(Error::refused("feature", "has no name; expected one"));
        }
        if !(0.0..=most).contains(&self.scale) {
            return refuse("opacity", format!("{}; expected a number from 0 to {most}", self.scale));
        }
        match self.colour {
            Some(colour) if !colour.iter().all(|c| (0.0..=1.0).contains(c)) => {
                refuse("colour", format!("{colour:?}; expected components from 0 to 1"))
            }
            _ => Ok(()),
        }
    }
}

/// What a message calls a feature.
fn section(name: &str) -> String {
    format!("feature {}", quoted(name))
}

/// Which voxels belong to which feature.
#[derive(Clone, Debug, PartialEq)]
pub enum Voxels {
    /// Those with a value in the feature's interval, from the first number on and below the second. They follow the values.
    Intervals(Vec<[f32; 2]>),
    /// The number of the feature of every voxel, x fastest, 0 where there is none.
    Labels(Arc<[u8]>),
}

/// The features of a volume: none, or up to [`Self::MOST`].
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// The first has the number 1.
    pub list: Vec<Feature>,
    /// Whose voxels they are.
    pub voxels: Voxels,
}

impl Default for Features {
    fn default() -> Self {
        Self::NONE
    }
}

impl Features {
    /// No features.
    pub const NONE: Self = Self { list: Vec::new(), voxels: Voxels::Intervals(Vec::new()) };

    /// Most features.
    pub const MOST: usize = 8;

    /// Features by the intervals of values `low ≤ value < high`, in the order of the list.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn by_intervals(list: Vec<(Feature, [f32; 2])>) -> Result<Self> {
        let (list, intervals) = list.into_iter().unzip();
        let features = Self { list, voxels: Voxels::Intervals(intervals) };
        features.check(None)?;
        Ok(features)
    }

    /// Features by the number of each voxel of a volume of so many along x, y, z, x fastest: 0 none, k the k-th of the list.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub fn by_labels(list: Vec<Feature>, dims: [usize; 3], labels: Vec<u8>) -> Result<Self> {
        let features = Self { list, voxels: Voxels::Labels(labels.into()) };
        features.check(Some(dims))?;
        Ok(features)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Whether clips leave one whole that shows.
    pub fn any_spared(&self) -> bool {
        self.list.iter().any(|feature| feature.spared && feature.factor() > 0.0)
    }

    /// The number of the feature of this name.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.list.iter().position(|feature| feature.name == name).map(|place| place + 1)
    }

    /// The number of the feature of a voxel, by its place, x fastest, and its value.
    pub fn of(&self, voxel: usize, value: f32) -> u8 {
        match &self.voxels {
            Voxels::Labels(labels) => labels[voxel],
            Voxels::Intervals(all) => {
                let found = all.iter().position(|[low, high]| *low <= value && value < *high);
                found.map_or(0, |place| place as u8 + 1)
            }
        }
    }

    /// Whether the other ones have the same voxels, so that they differ at most in how these are shown.
    pub fn same_voxels(&self, other: &Self) -> bool {
        self.list.len() == other.list.len()
            && match (&self.voxels, &other.voxels) {
                // Those of a long map are compared only where they are not the very same.
                (Voxels::Labels(a), Voxels::Labels(b)) => Arc::ptr_eq(a, b) || a == b,
                (a, b) => a == b,
            }
    }

    /// Are they of a volume of so many voxels along x, y, z, where it is known?
    ///
    /// # Errors
    /// [`Error::Limit`] for more than [`Self::MOST`]; [`Error::Config`] by the feature's name for two of one name, a scale or a colour that is
    /// none, intervals that are empty or overlap, and by `labels` for those of another volume or without a feature.
    pub fn check(&self, dims: Option<[usize; 3]>) -> Result<()> {
        if self.list.len() > Self::MOST {
            return Err(Error::Limit {
                what: "features".into(),
                needed: self.list.len() as u64,
                limit: Self::MOST as u64,
                hint: "join some: one feature may have several labels".into(),
            });
        }
        for (place, feature) in self.list.iter().enumerate() {
            feature.check()?;
            if self.list[..place].iter().any(|other| other.name == feature.name) {
                return Err(Error::refused(
                    &section(&feature.name),
                    "is there twice; expected a name for each",
                ));
            }
        }
        match &self.voxels {
            Voxels::Intervals(all) => self.check_intervals(all),
            Voxels::Labels(labels) => self.check_labels(labels, dims),
        }
    }

    fn check_intervals(&self, all: &[[f32; 2]]) -> Result<()> {
        let name = |place: usize| section(&self.list[place].name);
        if all.len() != self.list.len() {
            let problem = format!("{} for {} features; expected one for each", all.len(), self.list.len());
            return Err(Error::refused("intervals", problem));
        }
        for (place, &[low, high]) in all.iter().enumerate() {
            // NaN is in no order.
            if low.partial_cmp(&high) != Some(std::cmp::Ordering::Less) {
                let problem = format!(
                    "its interval from {low} to {high} is empty; expected a first value that belongs to it and a larger one that ends it"
                );
                return Err(Error::refused(&name(place), problem));
            }
            let overlaps = |other: &[f32; 2]| low < other[1] && other[0] < high;
            if let Some(other) = all[..place].iter().position(overlaps) {
                let [from, to] = all[other];
                let problem = format!(
                    "its values from {low} up to {high} overlap those of {}, from {from} up to {to}; expected intervals apart, of which one may begin where another ends",
                    name(other)
                );
                return Err(Error::refused(&name(place), problem));
            }
        }
        Ok(())
    }

    fn check_labels(&self, labels: &[u8], dims: Option<[usize; 3]>) -> Result<()> {
        if let Some([x, y, z]) = dims.filter(|dims| dims.iter().product::<usize>() != labels.len()) {
            let problem = format!("{} voxels; expected the volume's {x} × {y} × {z}", labels.len());
            return Err(Error::refused("labels", problem));
        }
        match labels.iter().find(|label| usize::from(**label) > self.list.len()) {
            Some(label) => {
                let problem = format!("{label} is no feature's number; there are {}", self.list.len());
                Err(Error::refused("labels", problem))
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str) -> Feature {
        Feature::new(name)
    }

    fn refusal(list: Vec<(Feature, [f32; 2])>) -> String {
        Features::by_intervals(list).unwrap_err().to_string()
    }

    #[test]
    fn a_value_belongs_to_the_interval_that_it_begins_and_not_to_the_one_that_it_ends() {
        let features = Features::by_intervals(vec![
            (named("soft"), [10.0, 20.0]),
            (named("hard"), [20.0, f32::INFINITY]),
        ])
        .unwrap();
        let found = [9.9, 10.0, 19.9, 20.0, 1e30].map(|value| features.of(0, value));
        assert_eq!(found, [0, 1, 1, 2, 2]);
        assert_eq!((features.find("hard"), features.find("bone")), (Some(2), None));
    }

    #[test]
    fn what_is_no_feature_is_refused_by_its_name_with_what_is_allowed() {
        let two = |a: [f32; 2], b: [f32; 2]| vec![(named("flesh"), a), (named("seed"), b)];
        for (found, told) in [
            (refusal(two([0.0, 5.0], [3.0, 3.0])), ["\"seed\"", "3 to 3 is empty"]),
            (refusal(two([0.0, 5.0], [f32::NAN, 9.0])), ["\"seed\"", "is empty"]),
            (refusal(two([0.0, 5.0], [4.0, 9.0])), ["\"seed\"", "overlap those of feature \"flesh\""]),
            (refusal(vec![(named("a"), [0.0, 1.0]), (named("a"), [1.0, 2.0])]), ["\"a\"", "twice"]),
            (refusal(vec![(named(" "), [0.0, 1.0])]), ["feature", "no name"]),
            (
                refusal(vec![(Feature { scale: -1.0, ..named("x") }, [0.0, 1.0])]),
                ["\"x\".opacity", "0 to 16"],
            ),
            (
                refusal(vec![(Feature { colour: Some([0.0, 2.0, 0.0]), ..named("x") }, [0.0, 1.0])]),
                ["\"x\".colour", "0 to 1"],
            ),
            (
                refusal((0..9u8).map(|i| (named(&i.to_string()), [i.into(), f32::from(i) + 1.0])).collect()),
                ["needs 9", "limit is 8"],
            ),
        ] {
            assert!(told.iter().all(|told| found.contains(told)), "{found}");
        }
        let labels = |labels: Vec<u8>| Features::by_labels(vec![named("a")], [3, 1, 1], labels);
        assert_eq!(labels(vec![0, 1, 0]).unwrap().of(1, 0.0), 1);
        assert!(
            labels(vec![0, 1]).unwrap_err().to_string().contains("2 voxels; expected the volume's 3 × 1 × 1")
        );
        assert!(labels(vec![0, 1, 2]).unwrap_err().to_string().contains("2 is no feature's number"));
    }

    #[test]
    fn how_features_are_shown_does_not_change_whose_voxels_are_whose() {
        let one =
            |scale| Features::by_intervals(vec![(Feature { scale, ..named("a") }, [0.0, 1.0])]).unwrap();
        assert!(one(1.0).same_voxels(&one(0.5)) && one(1.0) != one(0.5));
        assert!(!one(1.0).same_voxels(&Features::NONE));
        let labels = |n| Features::by_labels(vec![named("a")], [1; 3], vec![n]).unwrap();
        assert!(labels(1).same_voxels(&labels(1)) && !labels(1).same_voxels(&labels(0)));
        let spared = Feature { spared: true, visible: false, ..named("a") };
        assert_eq!(spared.factor(), 0.0);
        assert!(!Features::by_intervals(vec![(spared, [0.0, 1.0])]).unwrap().any_spared());
    }
}
