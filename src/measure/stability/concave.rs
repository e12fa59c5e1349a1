//! Concave clips (CAO §3.4 step 2, measure.md §4): what is cut wrongly when a mesh needs more depth-layer pairs than it gets.
//!
//! Control: P pairs are peeled and the rest is left out without a word, as a fixed number of layers does; the paper's is one,
//! for convex meshes. Ours counts what is missing and refuses.

use super::{Chart, Effort, Finding, Ours, Quantity, Series, as_twin, evenly};
use crate::Result;
use crate::plot::short;
use cao::clip::peel::{MAX_PAIRS, Peel};
use cao_gpu::Gpu;
use cao_model::clip::ClipCamera;
use cao_model::mesh::TriangleMesh;
use cao_twin::clip::clips::MeshLayers;
use cao_twin::clip::peel::peel;
use glam::Vec3;

/// Sizes of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Pixels along an edge of the depth layers.
    pub resolution: u32,
    /// Points along an edge of the mesh's bounds at which the cut is tested.
    pub points: usize,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { resolution: 256, points: 96 },
            Effort::Quick => Self { resolution: 64, points: 40 },
        }
    }
}

/// Runs the trial, telling the share done. Uses the device's queue and waits for it.
pub fn run(gpu: &Gpu, plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let peeler = Peel::new(gpu)?;
    let mut torus = TriangleMesh::torus(48, 24);
    torus.vertices.iter_mut().for_each(|v| *v = Vec3::new(v.z, v.x, v.y));
    let shapes = [("sphere", TriangleMesh::sphere(3), 1), ("torus from the side", torus, 2)];
    let combs = [(4, "comb of 4"), (8, "comb of 8")].map(|(n, name)| comb(n).map(|mesh| (name, mesh, n)));
    let shapes: Vec<_> = shapes.into_iter().map(Ok).chain(combs).collect::<Result<_>>()?;

    let mut series = Vec::new();
    let (mut asked, mut lacking, mut refused, mut most_wrong) = (0, 0, 0, 0.0_f64);
    let mut ours = vec![0.0_f64; MAX_PAIRS as usize];
    for (n, (name, mesh, needed)) in shapes.iter().enumerate() {
        let camera = ClipCamera::around(mesh, Vec3::ONE, 0.0, plan.resolution);
        let (all, report) = peel(mesh, Vec3::ONE, &camera, MAX_PAIRS as usize);
        debug_assert_eq!(report.unresolved_pixels, 0);
        let mut points = Vec::new();
        for pairs in 1..=MAX_PAIRS {
            let (some, _) = peel(mesh, Vec3::ONE, &camera, pairs as usize);
            points.push([f64::from(pairs), wrong(mesh, &all, &some, plan.points)]);
            asked += 1;
            lacking += u32::from(pairs < *needed);
            let mine = &mut ours[pairs as usize - 1];
            match peeler.run(gpu, mesh, Vec3::ONE, camera, pairs) {
                Ok(layers) => *mine = mine.max(wrong(mesh, &all, &as_twin(&layers), plan.points)),
                Err(cao::Error::Model(cao_model::Error::Mesh { .. })) => refused += 1,
                Err(other) => return Err(other.into()),
            }
        }
        most_wrong = most_wrong.max(points[0][1]);
        series.push(Series::control(format!("{name}, layers left out silently"), points));
        progress((n + 1) as f64 / shapes.len() as f64);
    }
    let one: Vec<String> = series
        .iter()
        .zip(&shapes)
        .filter(|(series, _)| series.points[0][1] > 0.0)
        .map(|(series, (name, _, needed))| {
            let right = series.points.iter().find(|point| point[1] == 0.0).map_or(0.0, |point| point[0]);
            format!(
                "{} % of the {name} (right from P = {}, needs {needed})",
                short(series.points[0][1]),
                short(right)
            )
        })
        .collect();
    let ours: Vec<[f64; 2]> =
        evenly(1.0, f64::from(MAX_PAIRS), ours.len()).into_iter().zip(ours).map(|(p, w)| [p, w]).collect();
    let ours = Series::ours("ours, all four shapes: refused or right", ours);
    // A silhouette that the two rasterizers see one pixel apart is no missing layer.
    let holds = refused == lacking && ours.largest() <= SILHOUETTE;
    let says = match holds {
        true => format!(
            "ours refuses in all {refused} of {asked} cases that lack layers, naming the pixels, and cuts the others right (at \
             most {} % apart)",
            short(ours.largest())
        ),
        false => format!(
            "OURS refused {refused} of {lacking} cases that lack layers and cut up to {} % wrongly",
            short(ours.largest())
        ),
    };
    series.push(ours);
    Ok(Finding {
        sentence: format!("One layer pair, the paper's, leaves uncut {}; {says}.", one.join(", ")),
        ours: Ours::holding(holds),
        control_fails: most_wrong > SILHOUETTE,
        setting: format!(
            "depth layers of {0}² pixels, cut tested at {1}³ points of the mesh's bounds",
            plan.resolution, plan.points
        ),
        charts: vec![Chart {
            title: "Volume cut wrongly when layers are missing".into(),
            x: Quantity::linear("P, layer pairs allowed"),
            y: Quantity::linear("wrong, % of the shape's volume"),
            series,
        }],
    })
}

/// Share in % of the shape that rasterizers may see differently along its silhouette: pixels whose centre an edge meets.
pub const SILHOUETTE: f64 = 0.5;

/// `count` plates in a row along the clip camera's axis: as many layer pairs.
fn comb(count: u32) -> Result<TriangleMesh> {
    let plate = TriangleMesh::cuboid();
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    for n in 0..count {
        let first = positions.len() as u32;
        positions.extend(plate.vertices.iter().map(|v| Vec3::new(v.x, v.y, 0.3 * v.z + n as f32)));
        faces.extend(plate.triangles.iter().map(|t| t.map(|i| i + first)));
    }
    Ok(TriangleMesh::new(format!("comb of {count}"), &positions, &faces)?)
}

/// Points on which the two disagree, in % of the points inside the first.
fn wrong(mesh: &TriangleMesh, right: &MeshLayers, other: &MeshLayers, points: usize) -> f64 {
    let (low, high) = mesh.bounds();
    let (mut inside, mut wrong) = (0_u32, 0_u32);
    for i in 0..points.pow(3) {
        let at = [i % points, i / points % points, i / points / points];
        let share = Vec3::from_array(at.map(|c| (c as f32 + 0.5) / points as f32));
        let place = low + (high - low) * share;
        let is = right.inside(place);
        inside += u32::from(is);
        wrong += u32::from(is != other.inside(place));
    }
    100.0 * f64::from(wrong) / f64::from(inside.max(1))
}
