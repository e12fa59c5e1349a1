//! Cut faces (CAO §3.5 step 5, method.md §5): what the ambient factor of clipped voxels does to the face that a clip cuts.
//!
//! The ray cast interpolates V_AO between the last visible voxel and the first clipped one. Control: the published 1 in every
//! clipped voxel, which leaks light along the cut. Ours computes the clipped voxels that touch a visible one. Truth: the
//! ambient integral at the points of the face themselves, and a picture whose every sample has its own.

use super::plane_cut::PlaneCut;
use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::plot::short;
use crate::reference as truth;
use crate::reference::image;
use cao_gpu::Gpu;
use cao_model::look::Look;
use cao_model::occlusion::{Integral, Occlusion, Quadrature, RaySet};
use cao_model::settings::Support;
use cao_twin::clip::clips::{ClipField, Dilation, Maps};
use cao_twin::draw::raycast::{Frame, raycast};
use cao_twin::measure::reference::reference;
use cao_twin::trilinear_clamped;
use glam::Vec3;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Voxels along an edge of the volume.
    pub edge: usize,
    /// Places of the cut within a voxel.
    pub places: Vec<f64>,
    /// Most points of the face at each place.
    pub points: usize,
    /// Directions and steps a voxel of the truth at the points.
    pub directions: u32,
    /// See `directions`.
    pub steps_per_voxel: u32,
    /// Pixels along an edge of the pictures; every other place has one.
    pub pixels: usize,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self {
                edge: 48,
                places: super::evenly(0.0, 1.0, 9),
                points: 400,
                directions: 500,
                steps_per_voxel: 8,
                pixels: 32,
            },
            Effort::Quick => Self {
                edge: 32,
                places: vec![0.0, 0.25, 0.5, 0.75],
                points: 80,
                directions: 200,
                steps_per_voxel: 4,
                pixels: 16,
            },
        }
    }
}

/// Radius in voxels.
const RADIUS: f32 = 8.0;

/// Category a of the mask.
const CLIPPED: u8 = 0;

/// Runs the trial, telling the share done. Uses the device's queue and waits for it.
pub fn run(gpu: &Gpu, plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let occlusion = Occlusion {
        rays: RaySet::W50,
        quadrature: Quadrature::Segment,
        radius_mm: RADIUS,
        offset_mm: None,
        step_mm: None,
        ..Occlusion::paper(1.0)
    };
    let mut cut = PlaneCut::new(gpu, plan.edge, occlusion, 1)?;
    let offset = 0.5;
    let integral = Integral::ambient(f64::from(RADIUS), offset, plan.steps_per_voxel, plan.directions, 1.0);
    let [mut literal, mut ours, mut bias, mut our_bias] = [const { Vec::new() }; 4];
    let (mut literal_picture, mut our_picture) = (Vec::new(), Vec::new());
    for (n, &place) in plan.places.iter().enumerate() {
        let x = cut.place(place)?;
        let (opacity, mask) = (cut.renderer.read_opacity()?, cut.renderer.read_mask()?);
        let computed = cut.renderer.read_ambient()?;
        // What the paper stores.
        let leaking: Vec<f32> =
            computed.iter().zip(&mask).map(|(&a, &m)| if m == CLIPPED { 1.0 } else { a }).collect();
        let every = cut.face.len().div_ceil(plan.points).max(1);
        let points: Vec<[f64; 3]> = cut.face.iter().step_by(every).map(|&[y, z]| [x, y, z]).collect();
        let expected = reference(&cut.grid, &opacity, &integral, 1.0, &points);
        let off = |ambient: &[f32]| -> Vec<f64> {
            let at = |(p, e): (&[f64; 3], &f64)| trilinear_clamped(&cut.grid, ambient, *p) - e;
            points.iter().zip(&expected).map(at).collect()
        };
        for (values, rmse, mean) in
            [(off(&leaking), &mut literal, &mut bias), (off(&computed), &mut ours, &mut our_bias)]
        {
            let squares: Vec<f64> = values.iter().map(|d| d * d).collect();
            rmse.push([place, super::mean(&squares).sqrt()]);
            mean.push([place, super::mean(&values)]);
        }
        if n % 2 == 0 {
            let [theirs, mine] =
                pictures(gpu, &cut, plan, place, x, &opacity, [&leaking, &computed], offset)?;
            literal_picture.push([place, theirs]);
            our_picture.push([place, mine]);
        }
        progress((n + 1) as f64 / plan.places.len() as f64);
    }
    let literal = Series::control("clipped voxels hold 1, RMSE", literal);
    let bias = Series::control("clipped voxels hold 1, mean error", bias);
    let ours = Series::ours("computed (ours), RMSE", ours);
    let our_bias = Series::ours("computed (ours), mean error", our_bias);
    let picture = Series::control("clipped voxels hold 1", literal_picture);
    let our_picture = Series::ours("computed (ours)", our_picture);
    let worst = literal.points.iter().max_by(|a, b| a[1].total_cmp(&b[1])).copied().unwrap_or([0.0; 2]);
    let better = literal.points.iter().zip(&ours.points).all(|(a, b)| b[1] <= a[1]);
    let best = literal.points.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
    Ok(Finding {
        sentence: format!(
            "The published 1 in clipped voxels is wrong on the cut face by {} (RMSE; mean {}, too light) at a cut {} voxel below a voxel's \
             centre and by {} at best, {} of the picture's light; {} {} (mean at most {} off), {} of the light.",
            short(worst[1]),
            short(bias.at(worst[0])),
            short(worst[0]),
            short(best),
            short(picture.largest()),
            if better { "ours by at most" } else { "OURS IS NOT BETTER EVERYWHERE: by up to" },
            short(ours.largest()),
            short(our_bias.points.iter().map(|p| p[1].abs()).fold(0.0, f64::max)),
            short(our_picture.largest()),
        ),
        ours: Ours::holding(better && ours.largest() < 0.5 * literal.largest()),
        control_fails: literal.largest() > 2.0 * ours.largest(),
        setting: format!(
            "engine {}³ cut by a plane along the voxels, 50w rays, segment rule, radius {RADIUS} voxels; truth: ambient integral at up to \
             {} points of the face, {} directions, 1/{} voxel; pictures of {}² pixels against the image reference",
            plan.edge, plan.points, plan.directions, plan.steps_per_voxel, plan.pixels
        ),
        charts: vec![
            Chart {
                title: "Error of the ambient factor on the cut face".into(),
                x: Quantity::linear("place of the cut, voxels below a voxel's centre"),
                y: Quantity::linear("error against the ambient integral (0 … 1)"),
                series: vec![literal, bias, ours, our_bias],
            },
            Chart {
                title: "Error of the picture of the cut face".into(),
                x: Quantity::linear("place of the cut, voxels below a voxel's centre"),
                y: Quantity::linear("RMSE against the image reference, linear light"),
                series: vec![picture, our_picture],
            },
        ],
    })
}

#[expect(clippy::too_many_arguments, reason = "the face and what is shown of it, each named once")]
/// RMSE of pictures with these ambient volumes against the image reference, over the pixels that look at the face.
fn pictures(
    gpu: &Gpu,
    cut: &PlaneCut,
    plan: &Plan,
    place: f64,
    x: f64,
    opacity: &[f32],
    ambient: [&[f32]; 2],
    offset: f64,
) -> Result<[f64; 2]> {
    let maps =
        Maps { layers: 1, resolution: 8, dilation: Dilation::Conservative(8), support: Support::Voxel };
    let clips = [ClipField::new(&cut.clip(place), &cut.grid, RADIUS, &maps)?];
    let values: Vec<f32> = (0..cut.volume.len()).map(|i| cut.volume.value(i) as f32).collect();
    let frame = |ambient| Frame {
        grid: cut.grid,
        values: &values,
        parts: None,
        transfer: &cut.transfer,
        reference_mm: 1.0,
        ambient,
        clips: &clips,
        step_mm: 1.0 / f64::from(truth::Plan::QUICK.steps_per_voxel),
        look: Look::default(),
    };
    let ([view, _], size) = (cut.views()?, [plan.pixels; 2]);
    let radius = f64::from(RADIUS);
    let expected = image(
        gpu,
        &frame(ambient[1]),
        opacity,
        &view,
        size,
        radius,
        offset,
        &truth::Plan::QUICK,
        &mut |_| (),
    )?;
    // The face's pixels: those that stop their light within a voxel of it.
    let world = cut.grid.to_world([x, 0.0, 0.0])[0] as f32;
    let face = Vec3::new(world, 0.0, 0.0);
    let [near, far] = [-1.0, 1.0].map(|d| view.project(face - Vec3::X * d).map_or(0.0, |(_, depth)| depth));
    Ok(ambient.map(|ambient| {
        let found = raycast(&frame(ambient), &view, size);
        let pixels = found.colour.iter().zip(&expected.image.colour).zip(&found.depth);
        let on_face = pixels.filter(|(_, depth)| (near..far).contains(*depth));
        let squares: Vec<f64> = on_face.map(|((f, e), _)| f64::from(f[1] - e[1]).powi(2)).collect();
        super::mean(&squares).sqrt()
    }))
}
