//! Slope (measure.md §4): a plane, nothing on it and nothing above it, seen more and more aslant. Nothing occludes it: 1.
//!
//! Depths of pixels are those of their middles, and a plane that is seen aslant changes by much from one to the next: methods of image space take it for its
//! own occluder, or lose what it hides. Ours: occlusion volumes at the places that pixels show ([`cao_twin::mesh::gather`]), depths in f32 as on the device.
//! Control: Crytek, volumetric and horizon-based ambient occlusion, each by its twin, the mean of the pixels in the middle of the picture.

use super::off_screen::{view, world};
use super::{Chart, Effort, Finding, Ours, Quantity, Series, evenly, mean};
use crate::Result;
use crate::plot::short;
use cao_model::image_space::ImageMethod;
use cao_twin::image_space::accessibility;
use cao_twin::image_space::scenes::{Sheet, nearest};
use cao_twin::image_space::shown::Shown;
use cao_twin::mesh::gather::gathered;
use glam::{DVec3, Vec3};

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Pixels along an edge of the picture.
    pub pixels: usize,
    /// Angles in degrees between the plane's normal and the view axis.
    pub slopes_deg: Vec<f64>,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => {
                Self { pixels: 128, slopes_deg: [evenly(0.0, 84.0, 15), evenly(85.0, 89.0, 5)].concat() }
            }
            Effort::Quick => Self { pixels: 64, slopes_deg: vec![0.0, 30.0, 60.0, 75.0, 85.0, 89.0] },
        }
    }
}

/// Radius of every method in mm.
const RADIUS: f32 = 20.0;

/// A plane whose value changes by more than this is seen to be shaded.
pub const WRONG: f64 = 0.02;

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let plane = [Sheet::around(DVec3::ZERO, [5000.0 * DVec3::X, 5000.0 * DVec3::Y])];
    let world = world(&plane)?;
    let methods = ImageMethod::all(RADIUS);
    let mut found: [Vec<[f64; 2]>; 4] = Default::default();
    for (n, &slope) in plan.slopes_deg.iter().enumerate() {
        let (sin, cos) = slope.to_radians().sin_cos();
        let view = view(Vec3::new(1e-3, -sin as f32, cos as f32))?;
        let exact = Shown::of(&view, [plan.pixels; 2], nearest(&plane));
        let shown = Shown::new(&view, exact.size, &exact.pixels());
        let middle = plan.pixels / 2 - 4..plan.pixels / 2 + 4;
        let pixels: Vec<usize> =
            middle.clone().flat_map(|y| middle.clone().map(move |x| y * plan.pixels + x)).collect();
        for (curve, method) in found.iter_mut().zip(&methods) {
            let all = accessibility(&shown, method);
            curve.push([slope, mean(&pixels.iter().map(|i| all[*i]).collect::<Vec<_>>())]);
        }
        let places = pixels.iter().filter_map(|i| shown.surface(*i));
        let ours: Vec<f64> = places
            .map(|(normal, place)| 1.0 - gathered(&world, place, normal, f64::from(RADIUS)).min(1.0))
            .collect();
        found[3].push([slope, mean(&ours)]);
        progress((n + 1) as f64 / plan.slopes_deg.len() as f64);
    }
    let [crytek, volumetric, hbao, ours] = found;
    let name = |n: usize| methods[n].title();
    let controls =
        [crytek, volumetric, hbao].into_iter().enumerate().map(|(n, c)| Series::control(name(n), c));
    let mut series: Vec<Series> = controls.collect();
    let ours = Series::ours("occlusion volumes (ours)", ours);
    let change = |series: &Series| {
        let values = series.points.iter().map(|point| point[1]);
        values.clone().fold(0.0, f64::max) - values.fold(1.0, f64::min)
    };
    let said = |series: &Series| {
        let [first, last] =
            [series.points.first(), series.points.last()].map(|p| p.copied().unwrap_or([f64::NAN; 2]));
        format!(
            "{} goes from {} at {} degrees to {} at {}",
            series.name,
            short(first[1]),
            short(first[0]),
            short(last[1]),
            short(last[0])
        )
    };
    // Lines along the view axis end where their own pixel shows the plane: of the three the volumetric one hardly changes.
    let control_fails = [0, 2].into_iter().all(|n| change(&series[n]) > WRONG);
    let sentence = format!(
        "Of a plane that nothing occludes, {}; volumes of the world leave it at {}.",
        series.iter().map(said).collect::<Vec<_>>().join(", "),
        short(ours.points.iter().map(|point| point[1]).fold(1.0, f64::min))
    );
    let holds = ours.points.iter().all(|point| (1.0 - point[1]).abs() <= WRONG);
    series.push(ours);
    series.push(Series::yardstick("truth", plan.slopes_deg.iter().map(|slope| [*slope, 1.0]).collect()));
    Ok(Finding {
        sentence,
        ours: Ours::holding(holds),
        control_fails,
        setting: format!(
            "a plane of 10 m seen from 300 mm, 30 degrees wide, {}² pixels, the 8² in the middle; radius {RADIUS} mm; 16 points, 32 lines, 16 directions",
            plan.pixels
        ),
        charts: vec![Chart {
            title: "A plane without anything, seen aslant".into(),
            x: Quantity::linear("angle between normal and view axis, degrees"),
            y: Quantity::linear("accessibility"),
            series,
        }],
    })
}
