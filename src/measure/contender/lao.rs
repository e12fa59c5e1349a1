//! `LAO`: a full recomputation of the voxels that a sample with opacity can touch, with every ray set and rule.

use super::{Asked, Entry, rendered};
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::Setup;

/// Share of the voxels that a scene usually needs (method.md §5).
const NEEDED: f64 = 0.2;

/// Every ray set with every rule.
pub fn entries(asked: &Asked) -> Vec<Entry> {
    let paper = Setup::of(cao_model::methods::Method::Cao, asked.min_spacing);
    let entry = |(rays, quadrature): (RaySet, Quadrature)| {
        let occlusion = Occlusion { rays, quadrature, ..paper.occlusion };
        let setup = Setup { occlusion, method: Method::Lao, ..paper };
        let work = NEEDED * rays.directions().len() as f64;
        rendered::entry("LAO", setup, asked.min_spacing, "voxels that show recomputed", work)
    };
    settings(asked).into_iter().map(entry).collect()
}

/// Ray sets and rules of methods that have both; for a first look, the cheapest and the dearest set and those of the default size.
pub fn settings(asked: &Asked) -> Vec<(RaySet, Quadrature)> {
    let quick = [RaySet::R6, RaySet::R26, RaySet::W26, RaySet::W50];
    let sets = if asked.quick { &quick[..] } else { &RaySet::ALL };
    let rules = if asked.quick { &[Quadrature::Left, Quadrature::Segment][..] } else { &Quadrature::ALL };
    rules.iter().flat_map(|&rule| sets.iter().map(move |&set| (set, rule))).collect()
}
