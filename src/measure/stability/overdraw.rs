//! Overdraw (AOV §6, measure.md §4): the farther occlusion reaches, the more volumes each pixel lies in, and the longer AOV takes.
//!
//! Counted is what is the same on every device: volumes that hold what a pixel shows, the mean over those of the left eye that show something. Times are those of the device, as multiples of each
//! method's own at the smallest reach: they say how a method grows, not which is the faster. Ours gathers volumes. Control: volumes drawn, as published. Yardstick:
//! rays, whose number does not grow.

use super::{Chart, Effort, Finding, Ours, Quantity, Series, mean};
use crate::Result;
use crate::kernels::overdraw::Overdraw;
use crate::plot::short;
use crate::shown::shown;
use cao::mesh::ambient::{ByRays, ByVolumes, PixelAmbient};
use cao::mesh::gather::Scene;
use cao::mesh::surfaces::Surfaces;
use cao::mesh::volumes::Volumes;
use cao::mesh_renderer::MeshRenderer;
use cao_gpu::{Gpu, Phase};
use cao_model::look::Look;
use cao_model::scenes::BuiltScene;
use cao_model::surface::World;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The built-in scene and how finely it is divided.
    pub scene: &'static str,
    /// See there.
    pub detail: u32,
    /// Reaches as multiples of the scene's own.
    pub reaches: Vec<f32>,
    /// Pixels of a picture.
    pub size: [u32; 2],
    /// Pictures of which the fastest counts.
    pub runs: usize,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        let scene = "relief";
        match effort {
            Effort::Full => {
                Self { scene, detail: 1, reaches: vec![0.25, 0.5, 1.0, 2.0, 4.0], size: [128, 72], runs: 3 }
            }
            Effort::Quick => Self { scene, detail: 1, reaches: vec![0.5, 2.0], size: [64, 36], runs: 1 },
        }
    }
}

/// Rays a pixel.
const RAYS: u32 = 16;

/// Runs the trial, telling the share done. Uses the device's queue and waits for it.
pub fn run(gpu: &Gpu, plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let scene = BuiltScene::parse(plan.scene)?;
    let world = World::new(&(scene.make)(plan.detail))?;
    let views = scene.eye.views(plan.size[0] as f32 / plan.size[1] as f32, 1.0, 1e5)?;
    let surfaces = Surfaces::new(gpu, &world)?;
    let geometry = shown(gpu, &surfaces, plan.size, &views[..1])?;
    let overdraw = Overdraw::new(gpu)?;
    let mut counts = Vec::new();
    let mut times: [Vec<[f64; 2]>; 3] = Default::default();
    for (n, &reach) in plan.reaches.iter().enumerate() {
        let delta = reach * scene.delta_mm;
        let volumes = surfaces.volumes(gpu, delta, false)?;
        let on = Scene { geometry: &geometry, surfaces: &surfaces, volumes: &volumes, delta_mm: delta };
        let held: Vec<f64> = overdraw.read(gpu, on)?.into_iter().flatten().map(f64::from).collect();
        counts.push([f64::from(reach), mean(&held)]);
        // A device that does not blend floats of 32 bits draws none.
        let drawn = Volumes::new(gpu, true, false).ok();
        let methods: [Option<Box<dyn PixelAmbient>>; 3] = [
            Some(Box::new(ByVolumes::new(gpu, 1, false)?)),
            drawn.map(|drawn| Box::new(drawn) as Box<dyn PixelAmbient>),
            Some(Box::new(ByRays::new(gpu, RAYS)?)),
        ];
        for (times, method) in times.iter_mut().zip(methods) {
            let Some(method) = method else { continue };
            let mut meshes = MeshRenderer::with(gpu, &world, method, delta)?;
            let mut fastest = f64::INFINITY;
            for _ in 0..plan.runs {
                let (_, timings) = meshes.draw(&views, &Look::default(), plan.size, None, &mut |_| ())?;
                fastest = fastest.min(timings.of(Phase::Ambient));
            }
            times.push([f64::from(reach), fastest]);
        }
        progress((n + 1) as f64 / plan.reaches.len() as f64);
    }
    let growth = |points: &[[f64; 2]]| points[points.len() - 1][1] / points[0][1];
    let (first, last) = (counts[0], counts[counts.len() - 1]);
    let times_reach = last[0] / first[0];
    // Of methods that this device ran, and took the time of.
    let timed: Vec<Series> = [
        Series::ours("AOV gathered (ours)", times[0].clone()),
        Series::control("AOV drawn", times[1].clone()),
        Series::yardstick(format!("ray tracing with {RAYS} rays"), times[2].clone()),
    ]
    .into_iter()
    .filter(|series| !series.points.is_empty() && series.points.iter().all(|point| point[1] > 0.0))
    .map(|series| {
        let smallest = series.points[0][1];
        Series { points: series.points.iter().map(|[reach, ms]| [*reach, ms / smallest]).collect(), ..series }
    })
    .collect();
    let took =
        |series: &Series| format!("{} takes {} times as long", series.name, short(growth(&series.points)));
    let sentence = format!(
        "With {} times the reach a pixel lies in {} volumes instead of {}, {} times as many: {}.",
        short(times_reach),
        short(last[1]),
        short(first[1]),
        short(growth(&counts)),
        timed.iter().map(took).collect::<Vec<_>>().join(", "),
    );
    // Faster than the reach itself.
    let bound = growth(&counts) > times_reach;
    let reaches = || Quantity::log(format!("reach, of {} mm", scene.delta_mm));
    let mut charts = vec![Chart {
        title: "Volumes that a pixel lies in".into(),
        x: reaches(),
        y: Quantity::log("volumes"),
        series: vec![Series::ours("AOV (ours gathers them, published draws them)", counts)],
    }];
    if !timed.is_empty() {
        charts.push(Chart {
            title: "Time of the occlusion of a picture".into(),
            x: reaches(),
            y: Quantity::log("multiple of the time with the smallest reach"),
            series: timed,
        });
    }
    Ok(Finding {
        sentence,
        ours: if bound { Ours::Limited } else { Ours::Holds },
        control_fails: bound,
        setting: format!(
            "{} of {} triangles, {}×{} pixels an eye; the fastest of {} pictures",
            scene.name,
            world.triangles.len(),
            plan.size[0],
            plan.size[1],
            plan.runs
        ),
        charts,
    })
}
