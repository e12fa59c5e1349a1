//! Size of a clip mesh's depth map (CAO §6, measure.md §4): how far the cut lies from the mesh, what that changes in a picture, and what larger maps
//! cost.
//!
//! A pixel has the depths of its centre, so that a point is judged by the mesh at most √½ pixel beside it: the cut is misplaced by no more than
//! that. It is never stale: the conservative dilation map has a size of its own. Control: the published recipe, whose dilation map has the depth map's
//! size and leaves voxels stale where that is small. The exact mesh is asked by winding numbers in float64.

use super::{Chart, Effort, Finding, Ours, Quantity, Series, as_twin, quantile, tiny};
use crate::Result;
use crate::flip::{PIXELS_PER_DEGREE, flip};
use crate::plot::short;
use crate::random::Random;
use cao::clip::peel::Peel;
use cao::renderer::{COLOUR, Renderer};
use cao::stages;
use cao_formats::Picture;
use cao_gpu::Gpu;
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, ClipCamera, Pose, Shape};
use cao_model::look::Look;
use cao_model::mesh::TriangleMesh;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::{MapSettings, Setup};
use cao_model::transfer::TransferFunction;
use cao_model::view::StereoRig;
use cao_twin::clip::clips::MeshLayers;
use cao_twin::each;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Voxels along an edge of the volume.
    pub edge: usize,
    /// Pixels along an edge of the depth maps, ascending.
    pub resolutions: Vec<u32>,
    /// Pixels along an edge of the picture.
    pub pixels: u32,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => {
                Self { edge: 64, resolutions: vec![64, 128, 256, 512, 1024, 2048, 4096], pixels: 192 }
            }
            Effort::Quick => Self { edge: 32, resolutions: vec![64, 256, 512, 1024], pixels: 96 },
        }
    }
}

/// Radius in voxels.
const RADIUS: f32 = 5.0;
/// Layer pairs of the clip, a torus.
const PAIRS: u32 = 2;
/// Sizes of the literal maps that are made: one costs the fourth power of its size.
const LITERAL: [u32; 4] = [16, 32, 64, 128];
/// Times of which the median is taken.
const RUNS: usize = 3;
/// Points of the surface, and places beside each, evenly within [`BESIDE`] pixels on both sides.
const POINTS: usize = 600;
const PLACES: usize = 64;
const BESIDE: f64 = 1.5;
/// Farthest that a point is judged from, in pixels: half of one along two axes; and one place for where the places lie.
const FARTHEST: f64 = std::f64::consts::FRAC_1_SQRT_2 + 2.0 * BESIDE / PLACES as f64;
/// A picture that differs from that of the largest map by no more FLIP is as good: a quarter of what the chart's reference pictures are known to
/// (measure.md §3).
pub const ENOUGH: f64 = 0.001;

/// What one size gives.
struct Size {
    resolution: u32,
    /// Edge of a pixel in voxels.
    pixel: f64,
    misplaced: Misplaced,
    /// Voxels that ours leaves stale.
    stale: u64,
    /// Making the maps, ms.
    ms: f64,
    picture: Picture,
}

/// How far points lie from the surface that are judged to be on its wrong side, in voxels.
struct Misplaced {
    /// At most.
    largest: f64,
    /// Mean thickness of what is misjudged.
    mean: f64,
}

/// Runs the trial, telling the share done. Uses the device's queue and waits for it.
pub fn run(gpu: &Gpu, plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let volume = builtin_box("engine", [plan.edge; 3], [1.0; 3])?;
    let transfer = TransferFunction::preset("auto", volume.range())?;
    let occlusion = Occlusion {
        rays: RaySet::R14,
        quadrature: Quadrature::Left,
        radius_mm: RADIUS,
        offset_mm: None,
        step_mm: None,
        ..Occlusion::paper(1.0)
    };
    let setup = Setup { occlusion, ..Setup::of(Method::Cao, 1.0) };
    let mut renderer = Renderer::new(gpu, &volume, transfer, setup, COLOUR)?;
    let mesh = Arc::new(TriangleMesh::torus(48, 24));
    let edge = plan.edge as f32;
    let pose = Pose {
        translate_mm: Vec3::new(0.11, -0.23, 0.17) * edge,
        rotate_deg: Vec3::new(25.0, 40.0, -15.0),
        scale: Vec3::new(0.25, 0.3, 0.22) * edge,
    };
    let clip = Clip { pose, ..Clip::remove(Shape::Mesh(mesh.clone())) };
    renderer.set_clips(std::slice::from_ref(&clip))?;
    let peel = Peel::new(gpu)?;
    let mut literal = Vec::new();
    for resolution in LITERAL {
        let maps = MapSettings { resolution, cells: resolution, pairs: PAIRS, literal: true };
        literal.push([f64::from(resolution), stale(&mut renderer, maps)? as f64]);
    }
    renderer.set_setup(setup)?;
    let mut sizes = Vec::new();
    let mut left_out = Vec::new();
    for (n, &resolution) in plan.resolutions.iter().enumerate() {
        match size(gpu, &mut renderer, &peel, &mesh, &clip, plan, resolution) {
            Ok(size) => sizes.push(size),
            Err(crate::Error::Cao(cao::Error::Gpu(cao_gpu::Error::Limit { .. }))) if n > 1 => {
                left_out.push(format!("{resolution}²"));
                renderer.set_setup(setup)?;
            }
            Err(error) => return Err(error),
        }
        progress((n + 1) as f64 / plan.resolutions.len() as f64);
    }
    Ok(finding(plan, &sizes, literal, &left_out))
}

/// Voxels that such maps leave stale.
fn stale(renderer: &mut Renderer, maps: MapSettings) -> Result<u64> {
    renderer.set_setup(Setup { maps, ..*renderer.setup() })?;
    renderer.update(&mut |_| ())?;
    Ok(cao::verify::verify(renderer, &mut |_| ())?.0.different)
}

fn size(
    gpu: &Gpu,
    renderer: &mut Renderer,
    peel: &Peel,
    mesh: &TriangleMesh,
    clip: &Clip,
    plan: &Plan,
    resolution: u32,
) -> Result<Size> {
    let own = MapSettings { resolution, pairs: PAIRS, ..MapSettings::default() };
    let stale = stale(renderer, own)?;
    let mut times = Vec::new();
    for _ in 0..RUNS {
        renderer.invalidate();
        let timings = renderer.update(&mut |_| ())?;
        let maps = timings.0.iter().filter(|t| [stages::PEEL, stages::DILATE].contains(&t.stage));
        times.push(maps.map(|t| t.ms).sum());
    }
    let rig = StereoRig { ipd_mm: 0.0, ..StereoRig::framing([plan.edge as f64; 3], 30.0, 25.0) };
    let views = rig.views(1.0, 1.0, 20.0 * plan.edge as f32)?;
    let (image, _) = renderer.draw(&views, &Look::default(), [plan.pixels; 2])?;
    let camera = ClipCamera::around(mesh, clip.pose.scale, 0.0, resolution);
    let layers = as_twin(&peel.run(gpu, mesh, clip.pose.scale, camera, PAIRS)?);
    Ok(Size {
        resolution,
        pixel: f64::from(camera.pixel_mm),
        misplaced: misplaced(mesh, clip.pose.scale, &layers),
        stale,
        ms: quantile(&times, 0.5),
        picture: Picture::over(plan.pixels, plan.pixels, &image.colour[0], [0.0; 3]),
    })
}

/// Places beside points of the surface, at random on its triangles: layers against the mesh itself. A voxel is a mm.
fn misplaced(mesh: &TriangleMesh, scale: Vec3, layers: &MeshLayers) -> Misplaced {
    let corners: Vec<DVec3> = mesh.vertices.iter().map(|v| (*v * scale).as_dvec3()).collect();
    let faces: Vec<[DVec3; 3]> = mesh.triangles.iter().map(|t| t.map(|i| corners[i as usize])).collect();
    let mut random = Random::new(7);
    let on: Vec<[DVec3; 2]> = (0..POINTS)
        .map(|_| {
            let [a, b, c] = faces[random.below(faces.len() as u64) as usize];
            let [u, v] = [0; 2].map(|_| f64::from(random.between(0.0, 1.0)));
            let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
            [a + (b - a) * u + (c - a) * v, (b - a).cross(c - a).normalize()]
        })
        .collect();
    let step = 2.0 * BESIDE * f64::from(layers.camera.pixel_mm) / PLACES as f64;
    let wrong: Vec<(f64, usize)> = each(POINTS, |n| {
        let [point, normal] = on[n];
        let ways = (0..PLACES).map(|k| (k as f64 + 0.5 - 0.5 * PLACES as f64) * step);
        let wrong: Vec<f64> = ways
            .filter(|way| {
                let place = point + normal * *way;
                layers.inside(place.as_vec3()) != inside(&faces, place)
            })
            .collect();
        (wrong.iter().fold(0.0, |far, way| way.abs().max(far)), wrong.len())
    });
    Misplaced {
        largest: wrong.iter().fold(0.0, |far, (way, _)| way.max(far)),
        mean: wrong.iter().map(|(_, count)| *count as f64 * step).sum::<f64>() / POINTS as f64,
    }
}

/// Whether the winding number of a point is not 0: faces above it, the ones that look up less those that look down.
fn inside(faces: &[[DVec3; 3]], p: DVec3) -> bool {
    let side = |a: DVec3, b: DVec3| (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
    let mut winding = 0;
    for &[a, b, c] in faces {
        let sides = [side(b, c), side(c, a), side(a, b)];
        let turn = if sides.iter().all(|&s| s > 0.0) {
            1
        } else if sides.iter().all(|&s| s < 0.0) {
            -1
        } else {
            continue;
        };
        let z = (sides[0] * a.z + sides[1] * b.z + sides[2] * c.z) / (sides[0] + sides[1] + sides[2]);
        winding += if z > p.z { turn } else { 0 };
    }
    winding != 0
}

fn finding(plan: &Plan, sizes: &[Size], literal: Vec<[f64; 2]>, left_out: &[String]) -> Finding {
    let largest = &sizes[sizes.len() - 1];
    let flips: Vec<f64> =
        sizes.iter().map(|size| flip(&size.picture, &largest.picture, PIXELS_PER_DEGREE).mean).collect();
    let curve = |of: &dyn Fn(usize, &Size) -> f64| {
        sizes
            .iter()
            .enumerate()
            .map(|(n, size)| [f64::from(size.resolution), of(n, size)])
            .collect::<Vec<_>>()
    };
    let stale = Series::ours("conservative (ours)", curve(&|_, size| size.stale as f64));
    let literal = Series::control("eq. (4) as printed", literal);
    let within = sizes.iter().all(|size| size.misplaced.largest <= FARTHEST * size.pixel);
    let holds = stale.largest() == 0.0 && within;
    let default = MapSettings::default().resolution;
    let pictures = Series::ours("ours", curve(&|n, _| flips[n]));
    let at_default = f64::from(default);
    let says = match holds {
        true => "by at most √½ pixel at every size, and no voxel is stale".to_owned(),
        false => format!("OURS by more than √½ pixel, or stale in up to {} voxels", short(stale.largest())),
    };
    let first = &sizes[0];
    let enough = if pictures.at(at_default) <= ENOUGH { "is enough" } else { "is NOT enough" };
    let verdict = format!(
        "at {}² the picture is {} FLIP from that with {}², so that the default of {default}² {enough}",
        pictures.nearest(at_default),
        tiny(pictures.at(at_default)),
        largest.resolution
    );
    Finding {
        sentence: format!(
            "A clip's depth map misplaces the cut {says}: {} voxels at {}², {} at {}²; eq. (4) as printed leaves {} voxels stale at {}²; \
             {verdict}.",
            short(first.misplaced.largest),
            first.resolution,
            short(largest.misplaced.largest),
            largest.resolution,
            short(literal.at(f64::from(LITERAL[0]))),
            LITERAL[0],
        ),
        ours: Ours::holding(holds),
        control_fails: literal.largest() > 0.0,
        setting: format!(
            "engine {}³ cut by a torus of {} triangles, 14 rays, radius {RADIUS} voxels, {}² pixels; {POINTS} points of the surface{}",
            plan.edge,
            2 * 48 * 24,
            plan.pixels,
            match left_out {
                [] => String::new(),
                some => format!("; left out, for the device binds no buffer so large: {}", some.join(", ")),
            }
        ),
        charts: vec![
            Chart {
                title: "How far the cut lies from the mesh".into(),
                x: Quantity::log("pixels along an edge of the depth map"),
                y: Quantity::log("misplaced cut, voxels"),
                series: vec![
                    Series::ours("largest (ours)", curve(&|_, size| size.misplaced.largest)),
                    Series::ours("mean (ours)", curve(&|_, size| size.misplaced.mean)),
                    Series::yardstick("√½ pixel", curve(&|_, size| 0.5_f64.sqrt() * size.pixel)),
                ],
            },
            Chart {
                title: "Voxels that a contextual update leaves stale".into(),
                x: Quantity::log("pixels along an edge of the depth map"),
                y: Quantity::linear("stale voxels"),
                series: vec![literal, stale],
            },
            Chart {
                title: format!("What it changes in the picture, against {}²", largest.resolution),
                x: Quantity::log("pixels along an edge of the depth map"),
                y: Quantity::linear("FLIP"),
                series: vec![pictures],
            },
            Chart {
                title: "What it costs".into(),
                x: Quantity::log("pixels along an edge of the depth map"),
                y: Quantity::log("peeling and dilating, ms"),
                series: vec![Series::ours("ours", curve(&|_, size| size.ms))],
            },
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_of_triangles_holds_what_is_inside_it() {
        let mesh = TriangleMesh::sphere(3);
        let faces: Vec<[DVec3; 3]> =
            mesh.triangles.iter().map(|t| t.map(|i| mesh.vertices[i as usize].as_dvec3())).collect();
        let mut random = Random::new(3);
        for _ in 0..500 {
            let place = DVec3::from_array([0; 3].map(|_| f64::from(random.between(-1.2, 1.2))));
            let length = place.length();
            if !(0.98..=1.0).contains(&length) {
                assert_eq!(inside(&faces, place), length < 1.0, "{place}");
            }
        }
    }
}
