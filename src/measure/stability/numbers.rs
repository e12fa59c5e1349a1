//! Extreme and impossible numbers (measure.md §4): opacity 0 and 1, radius 0 and beyond the volume, axes of one voxel, NaN and
//! infinities in a file. Each gives a defined result, or an error that says what to do.
//!
//! Control: eq. (2) on values as they come, as a program without checks computes it: what one NaN in a file does to the ambient
//! volume.

use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::plot::short;
use crate::{Error, Result};
use cao::renderer::{COLOUR, Renderer};
use cao_formats::{read, write_nrrd};
use cao_gpu::Gpu;
use cao_model::builtin::builtin_box;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::{Scope, Setup};
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::volume::Volume;
use cao_twin::Grid;
use cao_twin::cast::lao::lao;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Opacities of an even volume.
    pub opacities: Vec<f64>,
    /// Radii in voxels for the control.
    pub radii: Vec<f64>,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self {
                opacities: [0.0, 1e-6, 1e-3]
                    .into_iter()
                    .chain(super::evenly(0.05, 0.95, 19))
                    .chain([0.999, 1.0 - 1e-6, 1.0])
                    .collect(),
                radii: vec![2.0, 3.0, 4.0, 6.0, 8.0, 10.0],
            },
            Effort::Quick => {
                Self { opacities: vec![0.0, 1e-6, 0.1, 0.5, 0.9, 0.999, 1.0], radii: vec![2.0, 4.0, 8.0] }
            }
        }
    }
}

/// Samples of a ray in the even volume, and the voxel in its middle from which none leaves it.
const SAMPLES: u32 = 6;
const MIDDLE: usize = 8;

/// Opacities are f32, products of six of them and their sums too: a device may be off by some of these.
pub const ROUNDING: f64 = 64.0 * ULP;

/// Distance of the f32 numbers above 1, 2⁻²³.
const ULP: f64 = f32::EPSILON as f64;

/// The case whose message is shown.
const NAN_IN_FILE: &str = "NaN in a file";

/// What became of a case.
enum Outcome {
    /// All ambient factors are numbers from 0 to 1, and what they should be.
    Defined,
    /// Refused, with this message.
    Refused(String),
    /// Neither.
    Wrong(String),
}

/// Runs the trial, telling the share done. Uses the device's queue and waits for it.
pub fn run(gpu: &Gpu, plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let total = (3 * plan.opacities.len() + plan.radii.len() + 16) as f64;
    let mut done = 0.0;
    let mut tick = || {
        done += 1.0;
        progress(f64::min(done / total, 1.0));
    };
    let mut series = Vec::new();
    let mut even = Even::new(gpu)?;
    for quadrature in Quadrature::CAST {
        let mut points = Vec::new();
        for &opacity in &plan.opacities {
            let found = even.ambient(opacity as f32, quadrature)?;
            let expected = closed_form(quadrature, 1.0 - f64::from(opacity as f32), f64::from(SAMPLES));
            points.push([opacity, (f64::from(found) - expected).abs() / ULP]);
            tick();
        }
        series.push(Series::ours(format!("rule {} (ours)", quadrature.name()), points));
    }
    // `f64::max` drops a NaN, which is what must not be.
    let off = series.iter().flat_map(|s| s.points.iter().map(|p| p[1]));
    let worst = off.fold(0.0, |most: f64, d| if d.is_nan() || d > most { d } else { most });

    let cases = cases(gpu, &mut tick)?;
    let wrong: Vec<String> = cases
        .iter()
        .filter_map(|(name, outcome)| match outcome {
            Outcome::Wrong(how) => Some(format!("{name}: {how}")),
            _ => None,
        })
        .collect();
    let defined = cases.iter().filter(|(_, outcome)| matches!(outcome, Outcome::Defined)).count();
    let refused = cases.iter().filter(|(_, outcome)| matches!(outcome, Outcome::Refused(_))).count();

    let poisoned: Vec<[f64; 2]> = plan
        .radii
        .iter()
        .map(|&radius| {
            tick();
            [radius, poisoned(radius as u32)]
        })
        .collect();
    let poisoned = Series::control("eq. (2) on values as they come: voxels that one NaN spoils", poisoned);
    let harmless = plan.radii.iter().map(|&radius| [radius, 0.0]).collect();
    let last = plan.radii[plan.radii.len() - 1];
    let holds = wrong.is_empty() && worst * ULP <= ROUNDING;
    let says = match holds {
        true => format!(
            "ours gives a defined result in {defined} of {} extreme cases and refuses the other {} with a reason, and meets the closed \
             form for every opacity from 0 to 1 within {} · 2⁻²³",
            cases.len(),
            refused,
            short(worst)
        ),
        false => format!("OURS: {}; {} · 2⁻²³ off the closed form", wrong.join("; "), short(worst)),
    };
    let message = cases.iter().find_map(|(name, outcome)| match outcome {
        Outcome::Refused(message) if name == NAN_IN_FILE => Some(message.as_str()),
        _ => None,
    });
    Ok(Finding {
        sentence: format!(
            "Computed without a check, one NaN in a file spoils {} voxels at a radius of {} and {} at {}; {says}.",
            short(poisoned.points[0][1]),
            short(plan.radii[0]),
            short(poisoned.at(last)),
            short(last),
        ),
        ours: Ours::holding(holds),
        control_fails: poisoned.points.iter().all(|point| point[1] > 1.0),
        setting: format!(
            "even volume {0}³, 26 rays of {SAMPLES} samples, its middle voxel on the device; cases: {1}; {NAN_IN_FILE}: {2}",
            2 * MIDDLE + 1,
            cases.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", "),
            message.unwrap_or("taken for a number")
        ),
        charts: vec![
            Chart {
                title: "Error against the closed form of an even opacity".into(),
                x: Quantity::linear("opacity of every voxel (0 … 1)"),
                y: Quantity::linear("|A − closed form|, units of 2⁻²³"),
                series,
            },
            Chart {
                title: "What one NaN does".into(),
                x: Quantity::linear("radius, voxels"),
                y: Quantity::linear("voxels whose ambient factor is no number"),
                series: vec![poisoned, Series::ours("ours: the file is refused", harmless)],
            },
        ],
    })
}

/// A volume of the same value everywhere.
struct Even {
    renderer: Renderer,
    middle: usize,
}

impl Even {
    fn new(gpu: &Gpu) -> Result<Self> {
        let grid = Grid { dims: [2 * MIDDLE + 1; 3], spacing: [1.0; 3] };
        let volume = Volume::new(grid.dims, grid.spacing, Values::U8(vec![1; grid.len()]))?;
        let renderer = renderer(gpu, &volume, occlusion(Quadrature::Left, SAMPLES as f32))?;
        Ok(Self { renderer, middle: grid.index([MIDDLE; 3]) })
    }

    /// Ambient factor in its middle where all of it has this opacity.
    fn ambient(&mut self, opacity: f32, quadrature: Quadrature) -> Result<f32> {
        self.renderer.set_transfer(TransferFunction::new(vec![[0.0, opacity]], WHITE.to_vec(), None)?)?;
        let ambient = computed(&mut self.renderer, occlusion(quadrature, SAMPLES as f32))?;
        Ok(ambient[self.middle])
    }
}

const WHITE: [[f32; 4]; 1] = [[0.0, 1.0, 1.0, 1.0]];

fn occlusion(quadrature: Quadrature, radius_mm: f32) -> Occlusion {
    Occlusion { rays: RaySet::R26, quadrature, radius_mm, ..Occlusion::paper(1.0) }
}

/// Renders a volume whose data values are opacities.
fn renderer(gpu: &Gpu, volume: &Volume, occlusion: Occlusion) -> Result<Renderer> {
    let transfer = TransferFunction::new(vec![[0.0, 0.0], [1.0, 1.0]], WHITE.to_vec(), None)?;
    let setup = Setup { occlusion, scope: Scope::All, ..Setup::of(Method::Lao, volume.min_spacing()) };
    Ok(Renderer::new(gpu, volume, transfer, setup, COLOUR)?)
}

/// Every voxel's ambient factor, computed so.
fn computed(renderer: &mut Renderer, occlusion: Occlusion) -> Result<Vec<f32>> {
    renderer.set_setup(Setup { occlusion, ..*renderer.setup() })?;
    renderer.update(&mut |_| ())?;
    Ok(renderer.read_ambient()?)
}

/// For one opacity 1 − q everywhere and M samples of a step of the reference length (method.md §3).
fn closed_form(quadrature: Quadrature, q: f64, m: f64) -> f64 {
    if q == 1.0 {
        return 1.0;
    }
    // (1 − q^M)/(1 − q) is the sum of the M powers, without its cancellation near 1.
    let powers: f64 = (0..m as i32).map(|i| q.powi(i)).sum();
    match quadrature {
        Quadrature::Left => powers / m,
        Quadrature::Cell => powers / m * (1.0 + q) / 2.0,
        // Rays by brick have the same integral.
        _ if q == 0.0 => 0.0,
        _ => {
            let depth = -(m - 0.5) * q.ln();
            -(-depth).exp_m1() / depth
        }
    }
}

/// Extreme cases by name.
fn cases(gpu: &Gpu, tick: &mut dyn FnMut()) -> Result<Vec<(String, Outcome)>> {
    let mut found = Vec::new();
    let mut case = |name: &str, outcome: Result<Outcome>| {
        tick();
        let outcome = match outcome {
            Ok(outcome) => outcome,
            Err(error @ Error::Formats(cao_formats::Error::File { .. })) => {
                Outcome::Refused(error.to_string())
            }
            Err(error) if error.of_data().is_some() => Outcome::Refused(error.to_string()),
            Err(other) => return Err(other),
        };
        found.push((name.to_owned(), outcome));
        Ok(())
    };
    let engine = builtin_box("engine", [20, 16, 12], [1.0; 3])?;
    let opacity = |i: usize| (engine.value(i) / 255.0) as f32;
    let solid = Volume::new(engine.dims, [1.0; 3], Values::F32((0..engine.len()).map(opacity).collect()))?;
    let of = |value: f32, dims: [usize; 3]| {
        Volume::new(dims, [1.0; 3], Values::F32(vec![value; dims.iter().product()]))
    };
    let numbers = |volume: &Volume, radius: f32, right: &dyn Fn(f32) -> bool| {
        let mut renderer = renderer(gpu, volume, occlusion(Quadrature::Left, radius))?;
        for quadrature in Quadrature::CAST {
            let values = computed(&mut renderer, occlusion(quadrature, radius))?;
            if let Some(bad) =
                values.iter().find(|v| !(0.0..=1.0 + ROUNDING as f32).contains(*v) || !right(**v))
            {
                return Ok(Outcome::Wrong(format!("{bad} by rule {}", quadrature.name())));
            }
        }
        Ok(Outcome::Defined)
    };
    case("opacity 0", numbers(&of(0.0, [9, 8, 7])?, 5.0, &|v| v == 1.0))?;
    case("opacity 1", numbers(&of(1.0, [9, 8, 7])?, 5.0, &|_| true))?;
    case("radius 0", numbers(&solid, 0.0, &|v| v == 1.0))?;
    case("radius beyond the volume", numbers(&solid, 200.0, &|_| true))?;
    case("radius of 5000 samples", numbers(&solid, 5000.0, &|_| true))?;
    for (name, radius) in [("radius −1", -1.0), ("radius NaN", f32::NAN), ("radius ∞", f32::INFINITY)] {
        case(name, numbers(&solid, radius, &|_| true))?;
    }
    // A sheet, a row and a voxel, against the twin.
    for dims in [[16, 16, 1], [1, 24, 1], [1, 1, 1]] {
        let volume = of(0.5, dims)?;
        let grid = Grid { dims, spacing: [1.0; 3] };
        let settings = occlusion(Quadrature::Left, 5.0);
        let expected = lao(&grid, &vec![0.5; grid.len()], &settings, 1.0);
        let values = renderer(gpu, &volume, settings).and_then(|mut r| computed(&mut r, settings));
        let outcome = values.map(|values| {
            let off =
                values.iter().zip(&expected).map(|(v, e)| (f64::from(*v) - e).abs()).fold(0.0, f64::max);
            let close = off <= ROUNDING && values.iter().all(|v| v.is_finite());
            if close { Outcome::Defined } else { Outcome::Wrong(format!("{off} off the twin")) }
        });
        case(&format!("{}×{}×{} voxels", dims[0], dims[1], dims[2]), outcome)?;
    }
    for (name, value) in [("NaN", f32::NAN), ("∞", f32::INFINITY), ("−∞", f32::NEG_INFINITY)] {
        let mut values: Vec<f32> = (0..solid.len()).map(|i| solid.value(i) as f32).collect();
        values[1234] = value;
        let taken = || Outcome::Wrong("taken for a number".into());
        let in_file = format!("{name} in a file");
        case(&in_file, through_file(&solid, &values).map(|_| taken()))?;
        case(
            &format!("{name} in memory"),
            Volume::new(solid.dims, [1.0; 3], Values::F32(values)).map(|_| taken()).map_err(Into::into),
        )?;
    }
    Ok(found)
}

/// Writes and reads a file, which is gone afterwards.
fn through_file(like: &Volume, values: &[f32]) -> Result<Volume> {
    let path = std::env::temp_dir().join(format!("cao-stability-{}.nrrd", std::process::id()));
    write_nrrd(&path, like, values, "test")?;
    let volume = read(&path);
    // What matters is what was read; a file that stays is the system's to clean.
    let _ = std::fs::remove_file(&path);
    volume.map_err(|error| match error {
        // The path is of no interest, and another every time.
        cao_formats::Error::File { field, problem, .. } => Error::refused(&format!("file: {field}"), problem),
        other => other.into(),
    })
}

/// How many voxels of a volume with one NaN eq. (2) gives no number for.
fn poisoned(radius: u32) -> f64 {
    let edge = 2 * radius as i32 + 3;
    let middle = edge / 2;
    let opacity = |at: [i32; 3]| if at == [middle; 3] { f64::NAN } else { 0.1 };
    let inside = |at: [i32; 3]| at.iter().all(|c| (0..edge).contains(c));
    let directions = RaySet::R26.lattice();
    let spoiled = |voxel: [i32; 3]| {
        let sum: f64 = directions
            .iter()
            .map(|&(v, weight)| {
                let (mut sum, mut transmittance) = (0.0, 1.0);
                for m in 1..=radius as i32 {
                    sum += transmittance;
                    let at = std::array::from_fn(|i| voxel[i] + m * v[i]);
                    transmittance *= 1.0 - if inside(at) { opacity(at) } else { 0.0 };
                }
                weight * sum / f64::from(radius)
            })
            .sum();
        sum.is_nan()
    };
    let all = (0..edge).flat_map(|z| (0..edge).flat_map(move |y| (0..edge).map(move |x| [x, y, z])));
    all.filter(|&voxel| spoiled(voxel)).count() as f64
}
