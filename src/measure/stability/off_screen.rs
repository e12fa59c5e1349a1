//! Off screen (measure.md §4): an occluder beside a point leaves the picture as the head turns; nothing else changes.
//!
//! Methods of image space know what the picture shows, and open the point as the occluder goes. A value of the world belongs to the point. Truth: the
//! exact projected solid angle of its face (AOV eq. 19). Ours: occlusion volumes ([`cao_twin::mesh::gather`]). Control: Crytek, volumetric and horizon-based
//! ambient occlusion, each by its twin, at the pixel that shows the point.

use super::{Chart, Effort, Finding, Ours, Quantity, Series, evenly};
use crate::Result;
use crate::plot::short;
use cao_model::clip::Pose;
use cao_model::image_space::ImageMethod;
use cao_model::surface::{Instance, Material, Surface, World};
use cao_model::view::{StereoRig, View};
use cao_twin::image_space::accessibility;
use cao_twin::image_space::scenes::{Sheet, nearest};
use cao_twin::image_space::shown::Shown;
use cao_twin::mesh::gather::gathered;
use cao_twin::mesh::occluder::occlusion;
use glam::{DVec3, Quat, Vec3};
use std::sync::Arc;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Pixels along an edge of the picture.
    pub pixels: usize,
    /// Angles in degrees by which the head turns away.
    pub turns_deg: Vec<f64>,
}

impl Plan {
    /// The plan for this effort. Beyond 16.5 degrees the point itself leaves the picture.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { pixels: 128, turns_deg: evenly(0.0, 16.4, 24) },
            Effort::Quick => Self { pixels: 64, turns_deg: evenly(0.0, 16.0, 6) },
        }
    }
}

/// Radius of every method in mm.
pub(super) const RADIUS: f32 = 40.0;

/// The wall's distance from the point in mm.
const BESIDE: f64 = 12.0;

/// A value that changes by more than this while nothing happens is the picture's and not the point's.
pub const JUMP: f64 = 0.05;

/// Values of the world do not know the picture: what they may change by.
const NOTHING: f64 = 1e-12;

/// A floor; and what stands on it to the right of the origin, a block: the face towards the origin, the one towards the eye, the top.
fn scene() -> [Sheet; 4] {
    let [x, y, z] = DVec3::AXES;
    let corner = BESIDE * x - 40.0 * y;
    [
        Sheet::around(DVec3::ZERO, [2000.0 * x, 2000.0 * y]),
        Sheet { corner, sides: [40.0 * z, 55.0 * y] },
        Sheet { corner, sides: [50.0 * x, 40.0 * z] },
        Sheet { corner: corner + 40.0 * z, sides: [50.0 * x, 55.0 * y] },
    ]
}

/// The sheets as a mesh, seen from both sides.
pub(super) fn world(sheets: &[Sheet]) -> Result<World> {
    let surface = |sheet: &Sheet| {
        let [u, v] = sheet.sides;
        let corners = [sheet.corner, sheet.corner + u, sheet.corner + u + v, sheet.corner + v];
        Arc::new(Surface {
            name: "sheet".into(),
            positions: corners.map(|corner| corner.as_vec3()).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            material_of: vec![0; 2],
            materials: vec![Material { two_sided: true, ..Material::default() }],
            ..Surface::default()
        })
    };
    let instances: Vec<Instance> =
        sheets.iter().map(|sheet| Instance { surface: surface(sheet), pose: Pose::default() }).collect();
    Ok(World::new(&instances)?)
}

/// From 300 mm along a direction towards the origin, 30 degrees wide.
pub(super) fn view(from: Vec3) -> Result<View> {
    let position = 300.0 * from.normalize();
    let rig =
        StereoRig { position, target: Vec3::ZERO, up: Vec3::Z, ipd_mm: 0.0, fov_deg: 30.0, screen_mm: None };
    Ok(rig.views(1.0, 1.0, 1e4)?[0])
}

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let scene = scene();
    let ahead = view(Vec3::new(-0.3, -1.0, 0.5))?;
    let methods = ImageMethod::all(RADIUS);
    // Of the block only one face is turned to the point.
    let [floor, wall, ..] = scene;
    let world = world(&[floor, wall])?;
    let [u, v] = wall.sides;
    let polygon = [wall.corner, wall.corner + u, wall.corner + u + v, wall.corner + v];
    // Of the two ways around it is the one that faces the point.
    let turned: Vec<DVec3> = polygon.into_iter().rev().collect();
    let truth = 1.0 - occlusion(&polygon, DVec3::Z).max(occlusion(&turned, DVec3::Z));
    let mut found: [Vec<[f64; 2]>; 4] = Default::default();
    for (n, &turn) in plan.turns_deg.iter().enumerate() {
        let orientation = Quat::from_rotation_z(turn.to_radians() as f32) * ahead.orientation;
        let view = View { orientation, ..ahead };
        let shown = Shown::of(&view, [plan.pixels; 2], nearest(&scene));
        let Some((_, pixel)) = shown.place(DVec3::ZERO) else {
            return Err(crate::Error::refused(
                "turns_deg",
                format!("{turn}: the point is outside of the picture"),
            ));
        };
        for (curve, method) in found.iter_mut().zip(&methods) {
            curve.push([turn, accessibility(&shown, method)[pixel]]);
        }
        found[3].push([turn, 1.0 - gathered(&world, DVec3::ZERO, DVec3::Z, f64::from(RADIUS)).min(1.0)]);
        progress((n + 1) as f64 / plan.turns_deg.len() as f64);
    }
    let [crytek, volumetric, hbao, ours] = found;
    let name = |n: usize| methods[n].title();
    let controls =
        [crytek, volumetric, hbao].into_iter().enumerate().map(|(n, c)| Series::control(name(n), c));
    let mut series: Vec<Series> = controls.collect();
    let change = |series: &Series| {
        let values = series.points.iter().map(|point| point[1]);
        values.clone().fold(0.0, f64::max) - values.fold(1.0, f64::min)
    };
    let ends = |series: &Series| {
        let value = |point: Option<&[f64; 2]>| point.map_or(f64::NAN, |point| point[1]);
        format!(
            "{} goes from {} to {}",
            series.name,
            short(value(series.points.first())),
            short(value(series.points.last()))
        )
    };
    let ours = Series::ours("occlusion volumes (ours)", ours);
    let control_fails = series.iter().all(|series| change(series) > JUMP);
    let holds = change(&ours) <= NOTHING;
    let sentence = format!(
        "As the head turns until a block beside a point is out of the picture, the point's accessibility by {}; by volumes of the world it is {} at every \
         angle (exact, without falloff: {}).",
        series.iter().map(ends).collect::<Vec<_>>().join(", "),
        short(ours.at(0.0)),
        short(truth)
    );
    series.push(ours);
    series.push(Series::yardstick(
        "exact solid angle",
        plan.turns_deg.iter().map(|turn| [*turn, truth]).collect(),
    ));
    Ok(Finding {
        sentence,
        ours: Ours::holding(holds),
        control_fails,
        setting: format!(
            "a block of 50 × 55 × 40 mm, {} mm beside a point of a floor, seen from 300 mm, 30 degrees wide, {}² pixels; radius {RADIUS} mm; 16 points, 32 lines, 16 \
             directions",
            short(BESIDE),
            plan.pixels
        ),
        charts: vec![Chart {
            title: "A point beside a block that leaves the picture".into(),
            x: Quantity::linear("turn of the head, degrees"),
            y: Quantity::linear("accessibility"),
            series,
        }],
    })
}
