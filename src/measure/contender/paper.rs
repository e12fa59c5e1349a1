//! The paper's own recipe (CAO §3.4, §4): its four ray sets with equal weights, its sum as printed, a value for every voxel, transparent or not.

use super::{Asked, Entrant, Setting, rendered};
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::{MapSettings, Scope, Setup};

/// The paper's ray sets.
const SETS: [RaySet; 4] = [RaySet::R6, RaySet::R14, RaySet::R26, RaySet::R54];

/// Two of them, for a first look.
const FEW: [RaySet; 2] = [RaySet::R6, RaySet::R26];

/// Pixels along the edge of the literal maps, some to a voxel at the sizes that a software driver can do. Eq. (4) as printed costs its
/// fourth power whenever the radius changes.
const MAPS: u32 = 128;

/// `LAO (unit)`, the baseline that every comparison names (method.md §2): the naive recomputation (CAO §4).
pub fn unit(name: &'static str, asked: &Asked) -> Vec<Entrant> {
    let setup = Setup::of(Method::Lao, asked.min_spacing);
    entrants(name, &SETS, setup, "every voxel recomputed", asked)
}

/// `CAO literal`: contextual updates by dilation maps of eq. (4) as printed (CAO §3.5). It leaves voxels stale, which its error shows.
pub fn literal(name: &'static str, asked: &Asked) -> Vec<Entrant> {
    let own = Setup::of(Method::Cao, asked.min_spacing);
    let maps = MapSettings { literal: true, resolution: MAPS, cells: MAPS, ..own.maps };
    let computes = format!("the paper's dilation maps, {MAPS} x {MAPS}");
    entrants(name, if asked.quick { &FEW } else { &SETS }, Setup { maps, ..own }, &computes, asked)
}

/// Both of its methods with one of its sets: the naive recomputation, and contextual updates with a value for every voxel (CAO Table 3).
pub fn printed(names: [&'static str; 2], rays: RaySet, min_spacing: f64) -> [Entrant; 2] {
    let of = |name, method, computes| {
        let own = Setup::of(method, min_spacing);
        let occlusion = Occlusion { rays, quadrature: Quadrature::Left, ..own.occlusion };
        let setting = Setting::rays(&occlusion, min_spacing, computes);
        let setup = Setup { occlusion, scope: Scope::All, ..own };
        rendered::entrant(name, setup, setting, rays.count() as f64, 1.0)
    };
    let [lao, cao] = names;
    [of(lao, Method::Lao, "every voxel recomputed"), of(cao, Method::Cao, "every voxel that changed")]
}

fn entrants(
    name: &'static str,
    sets: &[RaySet],
    setup: Setup,
    computes: &str,
    asked: &Asked,
) -> Vec<Entrant> {
    let entrant = |&rays: &RaySet| {
        let occlusion = Occlusion { rays, ..setup.occlusion };
        let setting = Setting::rays(&occlusion, asked.min_spacing, computes);
        let setup = Setup { occlusion, scope: Scope::All, ..setup };
        // The literal maps, too, have all of it recomputed, or nearly.
        rendered::entrant(name, setup, setting, rays.count() as f64, 1.0)
    };
    sets.iter().map(entrant).collect()
}
