//! `CAO`: contextual updates, equal to `LAO` bit for bit at every setting; only what a clip changed is recomputed.

use super::{Asked, Entry, lao, rendered};
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::Setup;

/// Share of the voxels recomputed, precomputation included, in the mean over the kinds of change.
const RECOMPUTED: f64 = 0.2;

/// The settings of `LAO`.
pub fn entries(asked: &Asked) -> Vec<Entry> {
    let paper = Setup::of(cao_model::methods::Method::Cao, asked.min_spacing);
    let entry = |(rays, quadrature): (RaySet, Quadrature)| {
        let setup = Setup { occlusion: Occlusion { rays, quadrature, ..paper.occlusion }, ..paper };
        let work = RECOMPUTED * rays.directions().len() as f64;
        rendered::entry("CAO", setup, asked.min_spacing, "voxels that show and changed", work)
    };
    lao::settings(asked).into_iter().map(entry).collect()
}
