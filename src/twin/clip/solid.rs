//! What fills a volume's opacity beside what is in it: the share of each voxel inside a solid, which is what clips that remove the solids would hide of it.

use super::classify::classify;
use super::clips::ClipField;
use crate::Grid;
use cao_model::settings::AntiAliasing;

/// Of every voxel, x fastest.
pub fn solid(grid: &Grid, solids: &[ClipField], how: AntiAliasing) -> Vec<f32> {
    let (left, _) = classify(grid, &vec![1.0; grid.len()], solids, how);
    left.into_iter().map(|share| 1.0 - share).collect()
}
