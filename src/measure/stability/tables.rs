//! Tables (measure.md §4): how wrong means of boxes are that are taken from a summed-area table of floats, as boxes become small.
//!
//! Even matter of opacity 0.9, so that every box has the same mean. Control: a table of f32, which is as large as the whole volume's sum and
//! has no digits left for a few voxels. Ours: whole numbers modulo 2³² (docs/tables.md), which err by their rounding alone.

use super::{Chart, Effort, Finding, Ours, Quantity, Series};
use crate::Result;
use crate::plot::short;
use crate::random::Random;
use cao::tables::sums::Counted;
use cao_twin::Grid;

/// Sizes and values of the trial.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Voxels along an edge of the volume.
    pub edge: usize,
    /// Boxes of each radius, in the upper half of the volume.
    pub boxes: usize,
    /// Radii in voxels.
    pub radii: Vec<usize>,
}

impl Plan {
    /// The plan for this effort.
    pub fn of(effort: Effort) -> Self {
        match effort {
            Effort::Full => Self { edge: 256, boxes: 4000, radii: vec![1, 2, 4, 6, 9, 12, 16, 23, 32] },
            Effort::Quick => Self { edge: 96, boxes: 1000, radii: vec![1, 4, 9, 16] },
        }
    }
}

const OPACITY: f64 = 0.9;

/// An ambient factor that is this far off is a level of a picture off.
const LEVEL: f64 = 1.0 / 255.0;

/// A summed-area table of even matter, one more along each axis, each pass in place.
fn table<T: Copy>(grid: &Grid, zero: T, one: T, add: impl Fn(T, T) -> T) -> Vec<T> {
    let mut sums = vec![zero; grid.len()];
    for i in 0..grid.len() {
        let at = grid.voxel(i);
        if !at.contains(&0) {
            sums[i] = add(sums[grid.index([at[0] - 1, at[1], at[2]])], one);
        }
    }
    for axis in [1, 2] {
        for i in 0..grid.len() {
            let mut before = grid.voxel(i);
            if before[axis] > 0 {
                before[axis] -= 1;
                sums[i] = add(sums[grid.index(before)], sums[i]);
            }
        }
    }
    sums
}

/// Sums at the corners of a box with this first voxel, odd numbers of low sides marked.
fn corners<T: Copy>(grid: &Grid, sums: &[T], low: [usize; 3], size: usize) -> [(bool, T); 8] {
    std::array::from_fn(|corner| {
        let far: [usize; 3] = std::array::from_fn(|i| corner >> i & 1);
        let at = std::array::from_fn(|i| low[i] + size * far[i]);
        (far.iter().sum::<usize>() % 2 == 0, sums[grid.index(at)])
    })
}

/// Runs the trial, telling the share done.
pub fn run(plan: &Plan, progress: &mut dyn FnMut(f64)) -> Result<Finding> {
    let grid = Grid { dims: [plan.edge + 1; 3], spacing: [1.0; 3] };
    let floats = table(&grid, 0.0_f32, OPACITY as f32, |a, b| a + b);
    progress(0.3);
    let (mut of_floats, mut of_numbers, mut largest) = (Vec::new(), Vec::new(), 0.0_f64);
    // Those of one number of bits share a table.
    let mut held: Option<(u32, Vec<u32>)> = None;
    for (n, &radius) in plan.radii.iter().enumerate() {
        let (size, mut random) = (2 * radius + 1, Random::new(radius as u64));
        let voxels = (size as u64).pow(3);
        let counted =
            Counted::of(voxels, false).ok_or_else(|| crate::Error::refused("radius", "too large"))?;
        if held.as_ref().is_none_or(|(bits, _)| *bits != counted.bits) {
            let one = (OPACITY * f64::from(counted.levels())).round() as u32;
            held = Some((counted.bits, table(&grid, 0, one, u32::wrapping_add)));
        }
        let Some((_, numbers)) = &held else { continue };
        let mut squares = [0.0; 2];
        for _ in 0..plan.boxes {
            let room = (plan.edge - plan.edge / 2 - size).max(1) as u64;
            let low = [(); 3].map(|()| plan.edge / 2 + random.below(room) as usize);
            let sum = corners(&grid, &floats, low, size)
                .iter()
                .fold(0.0_f32, |sum, &(minus, term)| if minus { sum - term } else { sum + term });
            let exact = corners(&grid, numbers, low, size).iter().fold(0_u32, |sum, &(minus, term)| {
                if minus { sum.wrapping_sub(term) } else { sum.wrapping_add(term) }
            });
            let off = f64::from(sum) / voxels as f64 - OPACITY;
            let whole = voxels as f64 * f64::from(counted.levels());
            squares[0] += off * off;
            squares[1] += (f64::from(exact) / whole - OPACITY).powi(2);
            largest = largest.max(off.abs());
        }
        let root = squares.map(|sum| (sum / plan.boxes as f64).sqrt());
        // An error of none has no place on an axis of factors.
        of_floats.push([radius as f64, root[0].max(1e-9)]);
        of_numbers.push([radius as f64, root[1].max(1e-9)]);
        progress(0.3 + 0.7 * (n + 1) as f64 / plan.radii.len() as f64);
    }
    let floats = Series::control("table of floats", of_floats);
    let numbers = Series::ours("whole numbers modulo 2³² (ours)", of_numbers);
    let smallest = plan.radii[0] as f64;
    Ok(Finding {
        sentence: format!(
            "Means of boxes from a summed-area table of floats of {}³ voxels are off by {} (RMS) at radius {smallest} and {} at {}, {} at most; from \
             whole numbers modulo 2³² by {} at most.",
            plan.edge,
            short(floats.at(smallest)),
            short(floats.points[floats.points.len() - 1][1]),
            plan.radii[plan.radii.len() - 1],
            short(largest),
            super::tiny(numbers.largest()),
        ),
        ours: Ours::holding(numbers.largest() < 0.5 * LEVEL),
        control_fails: largest > LEVEL,
        setting: format!(
            "even opacity {OPACITY}, {}³ voxels, {} boxes of each radius in the upper half of each axis",
            plan.edge, plan.boxes
        ),
        charts: vec![Chart {
            title: "Error of the mean of a box".into(),
            x: Quantity::log("radius of the box, voxels"),
            y: Quantity::log("RMS error of the mean opacity"),
            series: vec![numbers, floats],
        }],
    })
}
