//! What a caller decides where a file leaves a choice, and what reading gives back.

use cao_model::volume::Volume;

/// How to read a volume file where the file alone does not say it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Which volume of a series, from 0. A series is refused without it.
    pub frame_index: Option<u64>,
    /// What stands for values that are no numbers.
    pub no_numbers: NoNumbers,
}

/// What stands for values that are NaN, infinite or beyond [`FARTHEST`](cao_model::values::FARTHEST), the largest numbers that
/// stand for *no data* in many files.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum NoNumbers {
    /// Nothing: NaN and infinities are refused, large numbers are taken as they are.
    #[default]
    Refuse,
    /// This value, in the file's own unit (after slope and intercept).
    Value(f64),
    /// NaN, until [`Volume::hide_no_numbers`] gives them a value without opacity: which one is known with the transfer function. The
    /// volume cannot be drawn before.
    Transparent,
}

impl NoNumbers {
    /// From `transparent` or a number.
    pub fn parse(text: &str) -> Option<Self> {
        match text {
            "transparent" => Some(Self::Transparent),
            number => number.parse().ok().filter(|v: &f64| v.is_finite()).map(Self::Value),
        }
    }
}

/// A volume that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Opened {
    /// The volume.
    pub volume: Volume,
    /// What was wrong with the file and did not keep it from being read: file, field and finding, a line each.
    pub warnings: Vec<String>,
}

/// One of a series of volumes in one stream of values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Frame {
    /// Which, from 0.
    pub(crate) index: u64,
    /// How many there are.
    pub(crate) count: u64,
    /// All frames' values of a voxel stand together; otherwise frame follows frame.
    pub(crate) interleaved: bool,
}

impl Frame {
    /// The frame that the caller chose among `count`; says how to choose where he did not.
    pub(crate) fn choose(reading: &Reading, count: u64, interleaved: bool) -> Result<Frame, String> {
        let last = count.saturating_sub(1);
        match reading.frame_index {
            _ if count == 0 => Err("a series of 0 volumes, expected at least 1".into()),
            None if count > 1 => Err(format!(
                "a series of {count} volumes, expected one: choose it with --frame-index 0 … {last}"
            )),
            Some(index) if index > last => Err(match count {
                1 => format!("one volume, number 0; --frame-index {index} is not there"),
                _ => format!("{count} volumes, 0 … {last}; --frame-index {index} is not there"),
            }),
            index => Ok(Frame { index: index.unwrap_or(0), count, interleaved }),
        }
    }
}
