//! Tessellation (measure.md §4): the same wall in more and more parts. What it hides does not change.
//!
//! AOV's falloff (eq. 24) is a face's: it falls beyond the face's own edges, so that of the same wall many small faces hide less than few large ones.
//! Control: quads as one face each, as the paper allows polygons. Ours is AOV of triangles, two of a quad, and ends here as well. Truth: rays.

use super::quads::{Quad, grid, world};
use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::plot::short;
use cao_twin::mesh::gather::gathered;
use cao_twin::mesh::occluder::occlusion;
use cao_twin::mesh::trace::traced;
use glam::{DVec3, Vec3};

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Quads along an edge of the wall.
    pub parts: Vec<u32>,
    /// Rays are this number squared.
    pub edge: u32,
}

impl Plan {
    /// The plan for this effort: one wall is cheap enough for both.
    pub fn of(effort: Effort) -> Self {
        let edge = if effort == Effort::Full { 600 } else { 300 };
        Self { parts: vec![1, 2, 4, 8, 16, 32], edge }
    }
}

/// Reach of rays in mm, and the volumes' share of it (AOV §6).
const REACH: f64 = 100.0;
const SHARE: f64 = 0.6;

/// How far from the point the wall stands, in mm; it is as high as rays reach, and four times as wide.
const DISTANCE: f32 = 30.0;

/// A share of the truth by which what is drawn may depend on how it is divided.
pub const WRONG: f64 = 0.1;

/// What a plane quad hides of the origin as one face: eq. 24's product over four edges times its exact occlusion.
fn as_one_face(quad: &Quad, normal: DVec3, delta: f64) -> f64 {
    let [a, b, c, d] = quad.map(|corner| corner.as_dvec3());
    let face = (b - a).cross(c - a).normalize();
    let edges = [(a, b), (b, c), (c, d), (d, a)];
    let factor = |(from, to): (DVec3, DVec3)| {
        let inward = face.cross((to - from).normalize());
        (1.0 - from.dot(inward) / delta).clamp(0.0, 1.0)
    };
    let height = -a.dot(face);
    let falloff = (1.0 - height / delta).clamp(0.0, 1.0) * edges.into_iter().map(factor).product::<f64>();
    falloff * occlusion(&[a, b, c, d], normal)
}

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let reach = REACH as f32;
    let delta = SHARE * REACH;
    let (corner, up, along) =
        (Vec3::new(DISTANCE, -2.0 * reach, 0.0), reach * Vec3::Z, 4.0 * reach * Vec3::Y);
    // Towards the origin.
    let wall = |parts: u32| grid(corner, up, along, parts);
    let truth = traced(&world(&wall(1))?, &[], DVec3::ZERO, DVec3::Z, REACH, plan.edge);
    let [mut quads, mut triangles, mut rays] = [const { Vec::new() }; 3];
    for (n, &parts) in plan.parts.iter().enumerate() {
        let (wall, count) = (wall(parts), f64::from(parts * parts));
        quads.push([count, wall.iter().map(|quad| as_one_face(quad, DVec3::Z, delta)).sum()]);
        triangles.push([count, gathered(&world(&wall)?, DVec3::ZERO, DVec3::Z, delta)]);
        rays.push([count, truth]);
        progress((n + 1) as f64 / plan.parts.len() as f64);
    }
    let series = vec![
        Series::control("AOV, a quad one face", quads),
        Series::ours("AOV (ours), a quad two triangles", triangles),
        Series::yardstick("rays", rays),
    ];
    let values =
        |series: &Series| series.points.iter().map(|point| short(point[1])).collect::<Vec<_>>().join(", ");
    let spread = |series: &Series| {
        let all = series.points.iter().map(|point| point[1]);
        (series.largest() - all.fold(f64::INFINITY, f64::min)) / truth
    };
    let counts = plan.parts.iter().map(|parts| (parts * parts).to_string()).collect::<Vec<_>>().join(", ");
    Ok(Finding {
        sentence: format!(
            "A wall in {counts} quads hides {} by AOV with a face a quad, and {} with two triangles a quad, ours included; rays find {} however it is divided.",
            values(&series[0]),
            values(&series[1]),
            short(truth),
        ),
        ours: if spread(&series[1]) > WRONG { Ours::Limited } else { Ours::Holds },
        control_fails: spread(&series[0]) > WRONG,
        setting: format!(
            "a wall of {} × {} mm, {DISTANCE} mm beside a point of a floor; {} rays of {REACH} mm, volumes {SHARE} of it",
            short(4.0 * REACH),
            short(REACH),
            plan.edge * plan.edge
        ),
        charts: vec![Chart {
            title: "A point beside the same wall".into(),
            x: Quantity::log("quads of the wall"),
            y: Quantity::linear("occlusion"),
            series,
        }],
    })
}
