//! Mesh stereo (CAO §5's question of meshes, measure.md §4): how much ambient occlusion differs that the two eyes show at the same point of a surface.
//!
//! The points are those of a board that lies in the plane without parallax: a pixel there shows the same point to both eyes, to rounding of its depth, and nothing
//! has to be interpolated. Blocks on the board have parallax: the eyes see other parts of them. Ours: AOV of every pixel. Control: AOV of one pixel in 25,
//! and the three methods of image space. Rays are of the world as well, and noisy: each eye has its own.

use super::quads::{block, quad, world};
use super::stereo::ADULT_MM;
use super::{Chart, Effort, Finding, Ours, Quantity, Series, evenly, mean, quantile, tiny};
use crate::Result;
use crate::plot::short;
use cao::mesh_renderer::MeshRenderer;
use cao_gpu::Gpu;
use cao_model::look::Look;
use cao_model::pixel_occlusion::{PixelMethod, PixelOcclusion};
use cao_model::surface::World;
use cao_model::view::StereoRig;
use glam::Vec3;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Pixels along an edge of an eye's picture.
    pub pixels: u32,
    /// Distances of the eyes in mm.
    pub separations_mm: Vec<f64>,
    /// Rays a pixel.
    pub rays: u32,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { pixels: 256, separations_mm: evenly(0.0, 100.0, 11), rays: 64 },
            Effort::Quick => Self { pixels: 96, separations_mm: vec![0.0, 63.0, 100.0], rays: 16 },
        }
    }
}

/// Edge of the board, the eyes' distance, and how far occlusion reaches, in mm.
const SIZE: f32 = 200.0;
const DISTANCE: f32 = 500.0;
const DELTA: f32 = 25.0;

/// The blocks: smallest and largest x, smallest and largest y, height, in mm.
const BLOCKS: [[f32; 5]; 9] = [
    [-83.3, -51.7, -78.1, -40.3, 42.7],
    [-37.9, -12.2, -88.7, -57.1, 18.3],
    [9.1, 20.6, -81.2, -12.4, 57.9],
    [47.3, 86.9, -69.8, -47.6, 9.7],
    [-71.4, -60.9, -13.3, 74.2, 31.1],
    [-33.6, -3.8, 12.9, 38.7, 60.3],
    [-28.3, 14.4, 61.6, 84.9, 24.6],
    [38.1, 66.7, 8.2, 33.3, 13.8],
    [51.9, 79.6, 52.7, 86.3, 48.2],
];

/// How far a point's depth in mm may be from the board's: some roundings of a depth in f32.
const ON_THE_BOARD: f32 = 0.01;

/// Values of the world differ between the eyes by the rounding of depths alone: 1e-4 mm of a reach of 25.
pub const ROUNDING: f64 = 1e-4;

/// A difference that the control has to show in the mean, to be told from rounding.
const SHOWN: f64 = 1e-3;

fn board() -> Result<World> {
    let half = 0.5 * SIZE;
    let mut quads = vec![quad(Vec3::new(-half, -half, 0.0), SIZE * Vec3::X, SIZE * Vec3::Y)];
    for [x0, x1, y0, y1, height] in BLOCKS {
        quads.extend(block(Vec3::new(x0, y0, 0.0), Vec3::new(x1, y1, height)));
    }
    world(&quads)
}

/// Runs the trial, telling the share done. Uses the device's queue and waits for it.
pub fn run(gpu: &Gpu, plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let world = board()?;
    let of = |method| PixelOcclusion { delta_mm: Some(DELTA), ..PixelOcclusion::of(method) };
    let methods = [
        ("AOV, every pixel (ours)", of(PixelMethod::Aov)),
        ("AOV, one pixel in 25", PixelOcclusion { sparse: 5, ..of(PixelMethod::Aov) }),
        ("Crytek SSAO", of(PixelMethod::Crytek)),
        ("Volumetric AO", of(PixelMethod::Volumetric)),
        ("HBAO", of(PixelMethod::Hbao)),
        ("rays", PixelOcclusion { rays: plan.rays, ..of(PixelMethod::Rays) }),
    ];
    let [mut means, mut highs, mut largests] = [const { [const { Vec::new() }; 6] }; 3];
    let (mut points, mut dark) = (usize::MAX, 0.0_f64);
    for (n, (_, occlusion)) in methods.iter().enumerate() {
        let mut meshes = MeshRenderer::new(gpu, &world, *occlusion)?;
        for &separation in &plan.separations_mm {
            let both = seen_by_both(&mut meshes, plan.pixels, separation as f32)?;
            let off: Vec<f64> = both.iter().map(|[left, right]| f64::from((left - right).abs())).collect();
            means[n].push([separation, mean(&off)]);
            highs[n].push([separation, quantile(&off, 0.99)]);
            largests[n].push([separation, quantile(&off, 1.0)]);
            points = points.min(off.len());
            if n == 0 {
                dark = both.iter().fold(dark, |dark, [left, _]| dark.max(f64::from(1.0 - left)));
            }
        }
        progress((n + 1) as f64 / methods.len() as f64);
    }
    let series = |n: usize, points: &[Vec<[f64; 2]>; 6]| {
        let (name, points) = (methods[n].0, points[n].clone());
        match n {
            0 => Series::ours(name, points),
            5 => Series::yardstick(format!("{name}, {} a pixel", plan.rays), points),
            _ => Series::control(name, points),
        }
    };
    let chart = |title: &str, points| Chart {
        title: title.into(),
        x: Quantity::linear("distance between the eyes, mm"),
        y: Quantity::linear("|left − right| of the accessibility"),
        series: (0..6).map(|n| series(n, points)).collect(),
    };
    let charts = vec![
        chart("Meshes: difference at points that both eyes see, mean", &means),
        chart("Meshes: difference at points that both eyes see, 99th percentile", &highs),
        chart("Meshes: difference at points that both eyes see, largest", &largests),
    ];
    let at = |chart: usize, n: usize| charts[chart].series[n].at(ADULT_MM);
    let said = |n: usize| {
        let name = &charts[0].series[n].name;
        format!("{name} by {} in the mean and {} at the 99th percentile", tiny(at(0, n)), tiny(at(1, n)))
    };
    let largest = charts[2].series[0].largest();
    let holds = points > 0 && dark > 0.5 && largest <= ROUNDING;
    let sentence = format!(
        "With eyes {} mm apart points of a board that both see differ by {}; {}; {}; {}. AOV of every pixel differs at no distance by more than {}, the rounding of depths; {} \
         by their noise.",
        short(charts[0].series[0].nearest(ADULT_MM)),
        said(1),
        said(2),
        said(3),
        said(4),
        tiny(largest),
        said(5),
    );
    Ok(Finding {
        sentence,
        ours: Ours::holding(holds),
        control_fails: (1..5).all(|n| at(0, n) > SHOWN),
        setting: format!(
            "a board of {SIZE} mm with {} blocks of up to 60 mm, seen from {DISTANCE} mm, {}² pixels an eye, at least {points} points; reach {DELTA} mm",
            BLOCKS.len(),
            plan.pixels
        ),
        charts,
    })
}

/// Accessibility in the left and in the right picture of each point of the board that both show.
fn seen_by_both(meshes: &mut MeshRenderer, pixels: u32, separation_mm: f32) -> Result<Vec<[f32; 2]>> {
    let rig = StereoRig {
        position: Vec3::Z * DISTANCE,
        target: Vec3::ZERO,
        up: Vec3::Y,
        ipd_mm: separation_mm,
        fov_deg: 24.0,
        screen_mm: None,
    };
    let (near, far) = (50.0, 1500.0);
    let views = rig.views(1.0, near, far)?;
    let (picture, _) = meshes.draw(&views, &Look::default(), [pixels; 2], None, &mut |_| ())?;
    let open = meshes.accessibility()?;
    let count = (pixels * pixels) as usize;
    let on_the_board = |depth: f32| {
        let distance = near * far / (far - depth * (far - near));
        (distance - DISTANCE).abs() < ON_THE_BOARD
    };
    let both = (0..count).filter(|&i| (0..2).all(|eye| on_the_board(picture.depth[eye][i])));
    Ok(both.map(|i| [open[i], open[count + i]]).collect())
}
