//! `sweep`: line sweeps along lattice directions, only where opacities changed (method.md §4, §5.2).

use super::{Asked, Entry, Setting, rendered};
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::Setup;

/// Cost of a direction in rays cast from every voxel: what a sweep saves.
const RAY: f64 = 0.01;

/// Every ray set with exact weights; two of them also with finer samples.
pub fn entries(asked: &Asked) -> Vec<Entry> {
    let paper = Setup::of(cao_model::methods::Method::Cao, asked.min_spacing);
    let voxel = asked.min_spacing as f32;
    let mut settings: Vec<(RaySet, Option<f32>)> =
        [RaySet::R6, RaySet::W14, RaySet::W26, RaySet::W50].map(|rays| (rays, None)).to_vec();
    if !asked.quick {
        settings.extend([(RaySet::W26, Some(1.25 * voxel)), (RaySet::W50, Some(1.15 * voxel))]);
    }
    let entry = |(rays, step_mm): (RaySet, Option<f32>)| {
        let occlusion = Occlusion { rays, quadrature: Quadrature::Segment, step_mm, ..paper.occlusion };
        let setup = Setup { occlusion, method: Method::Sweep, ..paper };
        let work = RAY * rays.directions().len() as f64;
        let mut entry = rendered::entry("sweep", setup, asked.min_spacing, "", work);
        let (step, offset) =
            (occlusion.lattice_step(asked.min_spacing), occlusion.lattice_offset(asked.min_spacing));
        entry.setting = Setting {
            label: if step_mm.is_some() { format!("{}, finer", rays.name()) } else { rays.name().into() },
            details: format!(
                "samples at most {step} mm apart, from {offset} mm on, bricks that show and changed"
            ),
            ..entry.setting
        };
        entry
    };
    settings.into_iter().map(entry).collect()
}
