//! Thin sheets (measure.md §4): how much occlusion ray sets, rules and steps miss of a sheet that is thinner than their samples are
//! apart, in all orientations.
//!
//! An opaque sheet in front of a voxel, its opacity the share of each voxel that it covers. Truth: the ambient integral of that same field, so
//! that what is measured is directions and sampling, not the voxels. Control: the published sets with eq. (2) at unit steps.

use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::plot::short;
use crate::random::Random;
use cao_model::occlusion::{Integral, Occlusion, Quadrature, RaySet, fibonacci};
use cao_twin::Grid;
use cao_twin::cast::lao::lao_at;
use cao_twin::measure::reference::reference;
use cao_twin::rays::rays::rays_at;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Thicknesses in voxels.
    pub thicknesses: Vec<f64>,
    /// Normals of the sheet, spread over the sphere, each at a place of its own between the voxels.
    pub orientations: u32,
    /// Directions of the truth.
    pub directions: u32,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self {
                thicknesses: vec![0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0],
                orientations: 96,
                directions: 600,
            },
            Effort::Quick => {
                Self { thicknesses: vec![0.5, 1.0, 2.0, 3.0], orientations: 24, directions: 300 }
            }
        }
    }
}

/// Radius in voxels, and least distance of the sheet's middle.
const RADIUS: f32 = 10.0;
const NEAREST: f32 = 2.5;

/// How the ambient factor is computed.
#[derive(Clone, Copy)]
struct Way {
    rays: RaySet,
    quadrature: Quadrature,
    step: f32,
}

impl Way {
    const fn unit(rays: RaySet, quadrature: Quadrature) -> Self {
        Self { rays, quadrature, step: 1.0 }
    }

    fn name(self) -> String {
        let Self { rays, quadrature, step } = self;
        format!("{} rays, {}, step {}", rays.name(), quadrature.name(), short(f64::from(step)))
    }
}

/// Against the directions: all sets, by the most accurate rule; against the sampling: rules and steps on one set.
const SETS: [Way; 7] = [
    Way::unit(RaySet::R6, Quadrature::Segment),
    Way::unit(RaySet::R14, Quadrature::Segment),
    Way::unit(RaySet::R26, Quadrature::Segment),
    Way::unit(RaySet::R54, Quadrature::Segment),
    Way::unit(RaySet::W14, Quadrature::Segment),
    Way::unit(RaySet::W26, Quadrature::Segment),
    Way::unit(RaySet::W50, Quadrature::Segment),
];
const RULES: [Way; 7] = [
    Way::unit(RaySet::W50, Quadrature::Left),
    Way { rays: RaySet::W50, quadrature: Quadrature::Left, step: 0.5 },
    Way { rays: RaySet::W50, quadrature: Quadrature::Left, step: 0.25 },
    Way::unit(RaySet::W50, Quadrature::Cell),
    Way { rays: RaySet::W50, quadrature: Quadrature::Cell, step: 0.5 },
    Way::unit(RaySet::W50, Quadrature::Segment),
    Way { rays: RaySet::W50, quadrature: Quadrature::Segment, step: 0.5 },
];
/// The published sets and sum.
const PUBLISHED: [Way; 4] = [
    Way::unit(RaySet::R6, Quadrature::Left),
    Way::unit(RaySet::R14, Quadrature::Left),
    Way::unit(RaySet::R26, Quadrature::Left),
    Way::unit(RaySet::R54, Quadrature::Left),
];

/// Rays by brick: what its rules cost, and its directions gain.
const BRICK: [Way; 3] = [
    Way::unit(RaySet::Spiral(50), Quadrature::Nearest),
    Way::unit(RaySet::Spiral(50), Quadrature::Hybrid),
    Way::unit(RaySet::Spiral(50), Quadrature::Linear),
];

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let ways: Vec<Way> = SETS.into_iter().chain(RULES).chain(PUBLISHED).chain(BRICK).collect();
    // missed[way][thickness][orientation]: found − truth; above 0 light comes through that does not.
    let mut missed = vec![Vec::new(); ways.len()];
    let normals = fibonacci(plan.orientations);
    for (n, &thickness) in plan.thicknesses.iter().enumerate() {
        // The same places for every thickness.
        let mut random = Random::new(1);
        let mut of = vec![Vec::new(); ways.len()];
        for normal in &normals {
            let distance = f64::from(random.between(NEAREST, NEAREST + 1.0));
            for (of, value) in of.iter_mut().zip(errors(*normal, distance, thickness, plan, &ways)) {
                of.push(value);
            }
        }
        for (missed, of) in missed.iter_mut().zip(of) {
            missed.push(of);
        }
        progress((n + 1) as f64 / plan.thicknesses.len() as f64);
    }
    let worst = |values: &Vec<f64>| values.iter().copied().fold(0.0, f64::max);
    let curve = |way: usize| {
        let points = plan.thicknesses.iter().zip(&missed[way]);
        points.map(|(&t, values)| [t, worst(values)]).collect::<Vec<_>>()
    };
    let published = |way: Way| !matches!(way.rays, RaySet::W14 | RaySet::W26 | RaySet::W50);
    let sets: Vec<Series> = (0..SETS.len())
        .map(|i| {
            let name = format!("{} rays", ways[i].rays.name());
            if published(ways[i]) { Series::control(name, curve(i)) } else { Series::ours(name, curve(i)) }
        })
        .collect();
    let rules: Vec<Series> = (SETS.len()..SETS.len() + RULES.len())
        .map(|i| match ways[i].quadrature {
            Quadrature::Left => Series::control(ways[i].name(), curve(i)),
            _ => Series::ours(ways[i].name(), curve(i)),
        })
        .collect();
    let first = SETS.len() + RULES.len();
    let by_brick: Vec<Series> =
        (first + PUBLISHED.len()..ways.len()).map(|i| Series::ours(ways[i].name(), curve(i))).collect();
    let paper: Vec<Series> =
        (first..first + PUBLISHED.len()).map(|i| Series::control(ways[i].name(), curve(i))).collect();
    let best = sets[SETS.len() - 1].clone();
    let by_angle = by_angle(&normals, &missed, first, SETS.len() - 1);

    let least = plan.thicknesses[0];
    let better =
        best.points.iter().zip(0..).all(|(point, t)| paper.iter().all(|s| point[1] <= s.points[t][1]));
    let most = &paper[PUBLISHED.len() - 1];
    let worst_at = most.points.iter().max_by(|a, b| a[1].total_cmp(&b[1])).copied().unwrap_or([0.0; 2]);
    Ok(Finding {
        sentence: format!(
            "Of the light that an opaque sheet stops, eq. (2) at unit steps misses up to {} with 54 rays, at a thickness of {} voxels ({} with \
             6 rays; {} at {} voxels), and 6 rays miss up to {} with the best rule; {} {} with the segment rule and 50 weighted rays, {} with 26; \
             rays by brick in 50 spiral directions {} with the nearest voxel, {} with the rule hybrid and {} with the filter.",
            short(worst_at[1]),
            short(worst_at[0]),
            short(paper[0].largest()),
            short(most.at(least)),
            short(least),
            short(sets[0].largest()),
            if better { "ours at most" } else { "OURS IS NOT BETTER THROUGHOUT: up to" },
            short(best.largest()),
            short(sets[5].largest()),
            short(by_brick[0].largest()),
            short(by_brick[1].largest()),
            short(by_brick[2].largest()),
        ),
        ours: Ours::holding(better),
        control_fails: worst_at[1] > 2.0 * best.largest(),
        setting: format!(
            "opaque sheet {NEAREST} … {} voxels in front of a voxel, {} orientations, radius {RADIUS} voxels; truth: ambient integral of the \
             same field, {} directions, 1/8 voxel; segment rule at unit steps where no rule is named",
            NEAREST + 1.0,
            plan.orientations,
            plan.directions
        ),
        charts: vec![
            Chart {
                title: "Occlusion missed by the directions (segment rule, step 1)".into(),
                x: Quantity::linear("thickness of the sheet, voxels"),
                y: Quantity::linear("largest missed occlusion of all orientations (0 … 1)"),
                series: sets,
            },
            Chart {
                title: "Occlusion missed along the rays (50 weighted rays)".into(),
                x: Quantity::linear("thickness of the sheet, voxels"),
                y: Quantity::linear("largest missed occlusion of all orientations (0 … 1)"),
                series: rules,
            },
            Chart {
                title: "The published sets with eq. (2), step 1".into(),
                x: Quantity::linear("thickness of the sheet, voxels"),
                y: Quantity::linear("largest missed occlusion of all orientations (0 … 1)"),
                series: paper
                    .into_iter()
                    .chain([Series { name: "50w rays, segment, step 1 (ours)".into(), ..best }])
                    .collect(),
            },
            Chart {
                title: "Rays by brick, 50 spiral directions, step 1".into(),
                x: Quantity::linear("thickness of the sheet, voxels"),
                y: Quantity::linear("largest missed occlusion of all orientations (0 … 1)"),
                series: by_brick,
            },
            Chart {
                title: "Missed occlusion by orientation, all thicknesses".into(),
                x: Quantity::linear("angle of the sheet's normal to the nearest axis, degrees (0 … 55)"),
                y: Quantity::linear("largest missed occlusion within 5 degrees (0 … 1)"),
                series: by_angle,
            },
        ],
    })
}

/// Largest error in bins of 5° of the angle between the sheet's normal and the nearest axis: the published sets from `first` on,
/// and ours.
fn by_angle(normals: &[[f64; 3]], missed: &[Vec<Vec<f64>>], first: usize, ours: usize) -> Vec<Series> {
    const BIN: f64 = 5.0;
    let angle =
        |n: &[f64; 3]| n.iter().fold(0.0_f64, |most, c| most.max(c.abs())).min(1.0).acos().to_degrees();
    let curve = |way: usize| {
        let mut bins: std::collections::BTreeMap<u32, f64> = std::collections::BTreeMap::new();
        for values in &missed[way] {
            for (normal, &value) in normals.iter().zip(values) {
                let most = bins.entry((angle(normal) / BIN) as u32).or_insert(0.0);
                *most = most.max(value);
            }
        }
        bins.into_iter().map(|(bin, most)| [(f64::from(bin) + 0.5) * BIN, most]).collect::<Vec<_>>()
    };
    let published = PUBLISHED.into_iter().zip(first..).map(|(way, i)| Series::control(way.name(), curve(i)));
    published.chain([Series::ours("50w rays, segment, step 1 (ours)", curve(ours))]).collect()
}

/// Found − truth at the voxel in the middle, by each way.
fn errors(normal: [f64; 3], distance: f64, thickness: f64, plan: &Plan, ways: &[Way]) -> Vec<f64> {
    // A ray's last sample interpolates a voxel further.
    let reach = RADIUS as usize + 2;
    let grid = Grid { dims: [2 * reach + 1; 3], spacing: [1.0; 3] };
    let opacity: Vec<f32> = (0..grid.len())
        .map(|i| {
            let at = grid.voxel(i).map(|c| c as f64 - reach as f64);
            let off = (0..3).map(|a| at[a] * normal[a]).sum::<f64>() - distance;
            // Overlap of the sheet with a voxel's width along the normal.
            ((off + 0.5).min(0.5 * thickness) - (off - 0.5).max(-0.5 * thickness)).clamp(0.0, 1.0) as f32
        })
        .collect();
    let middle = [reach; 3];
    let value = |way: &Way| {
        let occlusion = Occlusion {
            rays: way.rays,
            quadrature: way.quadrature,
            radius_mm: RADIUS,
            offset_mm: Some(OFFSET),
            step_mm: Some(way.step),
            ..Occlusion::paper(1.0)
        };
        match Quadrature::BRICK.contains(&way.quadrature) {
            true => rays_at(&grid, &opacity, &occlusion, 1.0, middle),
            false => lao_at(&grid, &opacity, &occlusion, 1.0, middle),
        }
    };
    let integral =
        Integral::ambient(f64::from(RADIUS), f64::from(OFFSET), 8, plan.directions, grid.min_spacing());
    let truth = reference(&grid, &opacity, &integral, 1.0, &[middle.map(|c| c as f64)])[0];
    ways.iter().map(|way| value(way) - truth).collect()
}

/// Distance in voxels at which all rays begin, that of unit steps, so that steps of other lengths compute the same integral.
const OFFSET: f32 = 0.5;
