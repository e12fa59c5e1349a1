//! What `tools/peers` measured of other systems beside this one (`peers.json`), for a table in the report.

use crate::{Error, Result};
use serde::Deserialize;

/// The file, as far as the report shows it. Keys that are not named here are allowed.
#[derive(Clone, Debug, Deserialize)]
pub struct Peers {
    pub(super) machine: String,
    pub(super) volume: String,
    pub(super) dims: [usize; 3],
    pub(super) image_size: [u32; 2],
    pub(super) radius_mm: f64,
    pub(super) rounds: u32,
    pub(super) rows: Vec<Row>,
    pub(super) stereo: Stereo,
    pub(super) clip_shadow: ClipShadow,
    #[serde(default)]
    pub(super) notes: Vec<String>,
}

/// Time of a frame after a move of the clip.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Row {
    pub system: String,
    pub what: String,
    pub median_ms: f64,
    pub low: f64,
    pub high: f64,
    pub ratio_to_cao: f64,
}

/// Occlusion at points that both eyes see.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Stereo {
    pub rows: Vec<StereoRow>,
}

#[derive(Clone, Debug, Deserialize)]
pub(super) struct StereoRow {
    pub what: String,
    pub points: u64,
    pub mean: f64,
    pub p99: f64,
}

/// A floor below a block that is taken away.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct ClipShadow {
    pub rows: Vec<ShadowRow>,
}

#[derive(Clone, Debug, Deserialize)]
pub(super) struct ShadowRow {
    pub what: String,
    pub mean_brightness: f64,
    pub too_dark: u64,
    pub floor_pixels: u64,
}

impl Peers {
    /// Reads the file's text.
    ///
    /// # Errors
    /// [`cao_model::Error::Config`] naming line and key.
    pub fn parse(text: &str) -> Result<Self> {
        serde_json::from_str(text).map_err(|error| {
            Error::refused(
                "peers",
                format!("{error}; expected the peers.json that tools/peers -o DIR writes"),
            )
        })
    }
}
