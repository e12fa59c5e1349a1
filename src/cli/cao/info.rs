//! `cao info`: what a volume file holds.

use crate::args::{Global, Info};
use anyhow::Result;
use cao_cli::output::Out;
use cao_model::volume::{Space, Volume};
use serde_json::json;
use std::process::ExitCode;

/// Bars of the histogram.
const BINS: usize = 32;

pub fn run(global: &Global, args: &Info) -> Result<ExitCode> {
    let volume = args.raw.open(&args.input)?;
    let mut out = Out::new(global);
    out.volume(&args.input, &volume);
    let [x, y, z] = volume.size_mm();
    let (low, high) = volume.range();
    let space = match volume.space {
        Space::Ras => "patient (right, anterior, superior)",
        Space::Unknown => "not said",
    };
    out.line(format!("size      {x} x {y} x {z} mm"));
    out.line(format!("origin    {:?} mm, space {space}", volume.origin));
    out.line(format!("axes      {:?}", volume.directions));
    if left_handed(&volume) {
        out.line("          left-handed: pictures of this volume are mirror images");
    }
    out.line(format!("rescale   stored * {} + {}", volume.slope, volume.intercept));
    out.line(format!("values    {low} ... {high}"));
    let bins = histogram(&volume, low, high);
    let none = volume.len() as u64 - bins.iter().sum::<u64>();
    if none > 0 {
        out.line(format!("no number {none} voxels"));
    }
    let most = bins.iter().copied().max().unwrap_or(1).max(1) as f64;
    for (i, &count) in bins.iter().enumerate() {
        // Logarithmic, or air would be all there is to see.
        let bar = "#".repeat((40.0 * (1.0 + count as f64).ln() / (1.0 + most).ln()).round() as usize);
        let from = low + (high - low) * i as f64 / BINS as f64;
        let share = 100.0 * count as f64 / volume.len() as f64;
        out.line(format!("  {from:>12.2} {share:>7.3} % {bar}"));
    }
    out.json(json!({
        "size_mm": volume.size_mm(),
        "origin_mm": volume.origin,
        "directions": volume.directions,
        "left_handed": left_handed(&volume),
        "slope": volume.slope,
        "intercept": volume.intercept,
        "smallest": low,
        "largest": high,
        "no_number": none,
        "histogram": bins,
    }));
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}

fn left_handed(volume: &Volume) -> bool {
    let [a, b, c] = volume.directions.map(glam::DVec3::from_array);
    volume.space == Space::Ras && a.cross(b).dot(c) < 0.0
}

fn histogram(volume: &Volume, low: f64, high: f64) -> Vec<u64> {
    let mut bins = vec![0; BINS];
    let scale = if high > low { BINS as f64 / (high - low) } else { 0.0 };
    for i in 0..volume.len() {
        let value = volume.value(i);
        if value.is_finite() {
            bins[(((value - low) * scale) as usize).min(BINS - 1)] += 1;
        }
    }
    bins
}
