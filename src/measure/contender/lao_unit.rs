//! `LAO (unit)`, the baseline that every comparison names (method.md §2): the paper's naive recomputation (CAO §4), every
//! voxel, equal weights, the sum as printed.

use super::{Asked, BASELINE, Entry, rendered};
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, RaySet};
use cao_model::settings::Scope;
use cao_model::settings::Setup;

/// The paper's four ray sets.
pub fn entries(asked: &Asked) -> Vec<Entry> {
    let paper = Setup::of(cao_model::methods::Method::Cao, asked.min_spacing);
    let entry = |rays: RaySet| {
        let occlusion = Occlusion { rays, ..paper.occlusion };
        let setup = Setup { occlusion, method: Method::Lao, scope: Scope::All, ..paper };
        let work = rays.directions().len() as f64;
        rendered::entry(BASELINE, setup, asked.min_spacing, "every voxel recomputed", work)
    };
    [RaySet::R6, RaySet::R14, RaySet::R26, RaySet::R54].map(entry).into()
}
