//! What methods take beside rays, lengths and rule; each has some of these.

use crate::error::quoted;
use crate::{Error, Result};

/// The settings of single methods, as plain data; [`crate::methods::Entry::options`] says which a method has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// What volumes of means `spao` looks up.
    pub levels: Levels,
    /// How far in half-widths of a cube `spao` moves it out along the normal, 0 … 4; 0 takes the whole sphere.
    pub normal: f32,
    /// Shells of `shells`, 1 … [`Self::MOST_SHELLS`].
    pub shells: u32,
    /// Clusters of `histograms`, 1 … [`Self::MOST_CLUSTERS`].
    pub clusters: u32,
    /// How much of the light that matter hides it gives back in its own colour, of `histograms`, 0 … 1.
    pub bleeding: f32,
    /// Which of the features around it shades a place, of `fdao`.
    pub combine: Combine,
    /// How much of a volume's grid the network of `dvao` sees at once.
    pub grid: Cover,
}

/// Volumes of means over cubes of 2^l voxels (SPAO §1.2.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Levels {
    /// Every level at full resolution: N-buffers.
    Nbuffer,
    /// Every level at half the resolution of the one before.
    Mip,
    /// So many halvings, then N-buffers on the coarse grid: the paper's order.
    Mixed(u32),
    /// So many N-buffers at full resolution, then halvings: ours.
    Reversed(u32),
}

/// How a network covers a grid that is larger than the cubes that it was trained on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cover {
    /// At once.
    Whole,
    /// By such cubes, which overlap by the length of the rays.
    Tiles,
}

/// How the occlusion of each feature becomes a place's (fdAO §4.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Combine {
    /// That of the voxel's own feature.
    Own,
    /// The mean over the neighbours' own, weighted by opacity, where features meet.
    Neighbours,
    /// The most occlusion of all features.
    Max,
    /// That of the feature of the very place which is shaded.
    Sample,
}

/// An option by its name.
#[derive(Debug)]
pub struct Key {
    /// On the command line and in scene files.
    pub name: &'static str,
    /// What it takes, in words.
    pub takes: &'static str,
    get: fn(&Options) -> String,
    set: fn(&mut Options, &str) -> Option<()>,
}

/// Every option.
pub static KEYS: [Key; 7] = [
    Key {
        name: "levels",
        takes: "nbuffer, mip, mixed:N or reversed:N, N 1 to 9",
        get: |o| match o.levels {
            Levels::Nbuffer => "nbuffer".into(),
            Levels::Mip => "mip".into(),
            Levels::Mixed(n) => format!("mixed:{n}"),
            Levels::Reversed(n) => format!("reversed:{n}"),
        },
        set: |o, text| {
            let number = |n: &str| whole(n, 1, 9);
            o.levels = match text.split_once(':') {
                None if text == "nbuffer" => Levels::Nbuffer,
                None if text == "mip" => Levels::Mip,
                Some(("mixed", n)) => Levels::Mixed(number(n)?),
                Some(("reversed", n)) => Levels::Reversed(number(n)?),
                _ => return None,
            };
            Some(())
        },
    },
    Key {
        name: "normal",
        takes: "a number, 0 to 4",
        get: |o| o.normal.to_string(),
        set: |o, text| {
            o.normal = text.parse().ok().filter(|factor| (0.0..=4.0).contains(factor))?;
            Some(())
        },
    },
    Key {
        name: "shells",
        takes: "a whole number, 1 to 64",
        get: |o| o.shells.to_string(),
        set: |o, text| {
            o.shells = whole(text, 1, Options::MOST_SHELLS)?;
            Some(())
        },
    },
    Key {
        name: "clusters",
        takes: "a whole number, 1 to 4096",
        get: |o| o.clusters.to_string(),
        set: |o, text| {
            o.clusters = whole(text, 1, Options::MOST_CLUSTERS)?;
            Some(())
        },
    },
    Key {
        name: "bleeding",
        takes: "a number, 0 to 1",
        get: |o| o.bleeding.to_string(),
        set: |o, text| {
            o.bleeding = text.parse().ok().filter(|share| (0.0..=1.0).contains(share))?;
            Some(())
        },
    },
    Key {
        name: "combine",
        takes: "own, neighbours, max or sample",
        get: |o| {
            let name = match o.combine {
                Combine::Own => "own",
                Combine::Neighbours => "neighbours",
                Combine::Max => "max",
                Combine::Sample => "sample",
            };
            name.into()
        },
        set: |o, text| {
            o.combine = match text {
                "own" => Combine::Own,
                "neighbours" => Combine::Neighbours,
                "max" => Combine::Max,
                "sample" => Combine::Sample,
                _ => return None,
            };
            Some(())
        },
    },
    Key {
        name: "grid",
        takes: "whole or tiles",
        get: |o| {
            let name = match o.grid {
                Cover::Whole => "whole",
                Cover::Tiles => "tiles",
            };
            name.into()
        },
        set: |o, text| {
            o.grid = match text {
                "whole" => Cover::Whole,
                "tiles" => Cover::Tiles,
                _ => return None,
            };
            Some(())
        },
    },
];

fn whole(text: &str, least: u32, most: u32) -> Option<u32> {
    text.parse().ok().filter(|n| (least..=most).contains(n))
}

impl Default for Options {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl Options {
    /// What every method starts from.
    pub const DEFAULT: Self = Self {
        levels: Levels::Nbuffer,
        normal: 0.0,
        shells: 16,
        clusters: 1024,
        bleeding: 0.0,
        combine: Combine::Sample,
        grid: Cover::Whole,
    };
    /// Most shells.
    pub const MOST_SHELLS: u32 = 64;
    /// Most clusters.
    pub const MOST_CLUSTERS: u32 = 4096;

    /// Sets the option of this name.
    ///
    /// # Errors
    /// [`Error::Config`] for another name or what it does not take.
    pub fn set(&mut self, name: &str, value: &str) -> Result<()> {
        let Some(key) = KEYS.iter().find(|key| key.name == name) else {
            let names = KEYS.each_ref().map(|key| key.name).join(", ");
            return Err(Error::refused("option", format!("{} is none; there are {names}", quoted(name))));
        };
        let problem = || Error::refused(name, format!("{}; expected {}", quoted(value), key.takes));
        (key.set)(self, value).ok_or_else(problem)
    }

    /// With these, of which every one is an option that takes it.
    ///
    /// # Errors
    /// As [`Self::set`].
    pub fn with(mut self, given: &[(&str, &str)]) -> Result<Self> {
        given.iter().try_for_each(|(name, value)| self.set(name, value))?;
        Ok(self)
    }

    /// Names and values of those that are not as `other` has them.
    pub fn other_than(&self, other: &Self) -> Vec<(&'static str, String)> {
        let values = KEYS.iter().map(|key| (key, (key.get)(self)));
        values
            .filter(|(key, value)| *value != (key.get)(other))
            .map(|(key, value)| (key.name, value))
            .collect()
    }

    /// The value of the option of this name, as text.
    pub fn value(&self, name: &str) -> Option<String> {
        KEYS.iter().find(|key| key.name == name).map(|key| (key.get)(self))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_set_is_what_is_read() {
        let given = [
            ("levels", "mixed:2"),
            ("normal", "0.5"),
            ("shells", "4"),
            ("clusters", "256"),
            ("bleeding", "0.25"),
            ("combine", "max"),
            ("grid", "tiles"),
        ];
        let options = Options::default().with(&given).unwrap();
        let found = options.other_than(&Options::DEFAULT);
        assert_eq!(found, given.map(|(name, value)| (name, value.to_owned())));
        assert_eq!(options.value("levels").as_deref(), Some("mixed:2"));
        for levels in ["nbuffer", "mip", "reversed:3"] {
            let options = options.with(&[("levels", levels)]).unwrap();
            assert_eq!(options.value("levels").as_deref(), Some(levels));
        }
    }

    #[test]
    fn what_is_no_option_or_no_value_is_refused_by_name() {
        for (name, value, told) in [
            ("level", "mip", "levels, normal"),
            ("levels", "mixed:0", "mixed:N"),
            ("levels", "tower", "reversed:N"),
            ("normal", "NaN", "0 to 4"),
            ("normal", "-1", "0 to 4"),
            ("shells", "65", "1 to 64"),
            ("clusters", "0", "1 to 4096"),
            ("bleeding", "1.5", "0 to 1"),
            ("combine", "mean", "neighbours"),
            ("grid", "1", "tiles"),
        ] {
            let error = Options::default().with(&[(name, value)]).unwrap_err().to_string();
            assert!(error.contains(told), "{error}");
        }
        assert!(KEYS[2].takes.contains(&Options::MOST_SHELLS.to_string()));
        assert!(KEYS[3].takes.contains(&Options::MOST_CLUSTERS.to_string()));
    }
}
