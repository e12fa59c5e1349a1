//! The files that hold the data, named when they are needed: a header of a few bytes can name a million.

use std::path::{Path, PathBuf};

/// Files in order, at least one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Parts {
    names: Names,
    /// Byte of each file as stored where the data, or what is to be skipped before them, begin.
    pub(crate) start: u64,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Names {
    One(PathBuf),
    Listed { folder: PathBuf, names: Vec<String> },
    Numbered { folder: PathBuf, numbers: Numbers },
}

/// Names that differ by a number: `before`, then `first`, `first + step`, …, then `after`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Numbers {
    pub(crate) before: String,
    pub(crate) after: String,
    /// Filled up with zeros, else with spaces, to this many characters.
    pub(crate) zeros: bool,
    pub(crate) width: usize,
    pub(crate) first: i64,
    pub(crate) step: i64,
    /// How many, at least one.
    pub(crate) count: u64,
}

impl Parts {
    /// All data in one file, from `start` on.
    pub(crate) fn one(path: PathBuf, start: u64) -> Self {
        Self { names: Names::One(path), start }
    }

    /// These files of a folder.
    pub(crate) fn listed(folder: &Path, names: Vec<String>) -> Self {
        Self { names: Names::Listed { folder: folder.into(), names }, start: 0 }
    }

    /// Numbered files of a folder.
    pub(crate) fn numbered(folder: &Path, numbers: Numbers) -> Self {
        Self { names: Names::Numbered { folder: folder.into(), numbers }, start: 0 }
    }

    /// How many.
    pub(crate) fn len(&self) -> u64 {
        match &self.names {
            Names::One(_) => 1,
            Names::Listed { names, .. } => names.len() as u64,
            Names::Numbered { numbers, .. } => numbers.count,
        }
    }

    /// Path of file `number`, which is below [`Parts::len`].
    pub(crate) fn path(&self, number: u64) -> PathBuf {
        match &self.names {
            Names::One(path) => path.clone(),
            Names::Listed { folder, names } => {
                folder.join(names.get(number as usize).map_or("", String::as_str))
            }
            Names::Numbered { folder, numbers } => folder.join(numbers.name(number)),
        }
    }
}

impl Numbers {
    fn name(&self, i: u64) -> String {
        let Self { before, after, width, .. } = self;
        // i128, because the ends of i64 may be further apart than i64 reaches.
        let number = i128::from(self.first) + i128::from(i) * i128::from(self.step);
        match self.zeros {
            true => format!("{before}{number:0width$}{after}"),
            false => format!("{before}{number:width$}{after}"),
        }
    }
}
