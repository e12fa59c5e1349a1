//! `CAO literal`: contextual updates by the paper's own recipe (CAO §3.4 and §3.5): dilation maps by eq. (4) as printed, every voxel of category
//! b, transparent or not, equal weights, the sum as printed. It leaves voxels stale, which its error shows.

use super::{Asked, Entry, rendered};
use cao_model::occlusion::{Occlusion, RaySet};
use cao_model::settings::MapSettings;
use cao_model::settings::Scope;
use cao_model::settings::Setup;

/// Share of the voxels recomputed, precomputation included, in the mean over the kinds of change.
const RECOMPUTED: f64 = 1.0;

/// Pixels along the edge of the maps, some to a voxel at the sizes that a software driver can do. Eq. (4) as printed costs its fourth power
/// whenever the radius changes.
const MAPS: u32 = 128;

/// The paper's four ray sets; for a first look, two.
pub fn entries(asked: &Asked) -> Vec<Entry> {
    let paper = Setup::of(cao_model::methods::Method::Cao, asked.min_spacing);
    let maps = MapSettings { literal: true, resolution: MAPS, cells: MAPS, ..paper.maps };
    let entry = |&rays: &RaySet| {
        let setup =
            Setup { occlusion: Occlusion { rays, ..paper.occlusion }, scope: Scope::All, maps, ..paper };
        let work = RECOMPUTED * rays.directions().len() as f64;
        let details = format!("the paper's dilation maps, {MAPS} x {MAPS}");
        rendered::entry("CAO literal", setup, asked.min_spacing, &details, work)
    };
    let sets = [RaySet::R6, RaySet::R26, RaySet::R14, RaySet::R54];
    sets[..if asked.quick { 2 } else { 4 }].iter().map(entry).collect()
}
