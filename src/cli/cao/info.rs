//! `cao info`: what a volume file holds.

use crate::args::{Global, Info};
use anyhow::Result;
use cao_cli::output::Out;
use cao_formats::label::segments;
use cao_formats::scene::VolumeSource;
use cao_model::frame::Turn;
use cao_model::order::Layout;
use cao_model::volume::{Space, Volume};
use serde_json::json;
use std::process::ExitCode;

/// Bars of the histogram.
const BINS: usize = 32;

pub fn run(global: &Global, args: &Info) -> Result<ExitCode> {
    let volume = args.raw.open(&args.input)?;
    let mut out = Out::new(global);
    out.volume(&args.input, &volume);
    let Layout { dims, spacing, origin, directions } = volume.stored_layout();
    let [x, y, z] = [0, 1, 2].map(|a| dims[a] as f64 * spacing[a]);
    let (low, high) = volume.range();
    let space = match volume.space {
        Space::Ras => "patient (right, anterior, superior)",
        Space::Unknown => "not said",
    };
    out.line(format!("size      {x} x {y} x {z} mm"));
    out.line(format!("origin    {origin:?} mm, space {space}"));
    out.line(format!("axes      {directions:?}"));
    let oblique = Turn::into_axes_of(&volume).degrees();
    let stored_order = volume.stored_axes();
    match &stored_order {
        None => out.line("order     of the index axes; no patient frame is stated, and none is drawn"),
        Some(order) => {
            let hand = if left_handed(directions) { "left" } else { "right" };
            out.line(format!(
                "order     {order} as stored, {hand}-handed; drawn as RAS, oblique by {oblique:.2} degrees"
            ));
            out.line(format!("centre    {:?} mm, the origin of clips and eyes", centre(&volume)));
        }
    }
    out.line(format!("rescale   stored * {} + {}", volume.slope, volume.intercept));
    out.line(format!("values    {low} ... {high}"));
    let segments = match args.raw.source(&args.input)? {
        VolumeSource::File(path) => segments(&path)?,
        _ => Default::default(),
    };
    for (label, segment) in &segments {
        out.line(format!("segment   {label} {}", segment.name));
    }
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
        "size_mm": [x, y, z],
        "origin_mm": origin,
        "directions": directions,
        "left_handed": stored_order.is_some() && left_handed(directions),
        "stored_order": stored_order,
        "drawn_order": stored_order.as_ref().map(|_| "RAS"),
        "oblique_deg": oblique,
        "centre_mm": centre(&volume),
        "slope": volume.slope,
        "intercept": volume.intercept,
        "smallest": low,
        "largest": high,
        "no_number": none,
        "histogram": bins,
        "segments": segments.iter().map(|(label, s)| json!({ "label": label, "name": s.name })).collect::<Vec<_>>(),
    }));
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}

fn left_handed(directions: [[f64; 3]; 3]) -> bool {
    glam::DMat3::from_cols_array_2d(&directions).determinant() < 0.0
}

/// Position of the volume's centre in mm.
fn centre(volume: &Volume) -> [f64; 3] {
    let half = |a: usize| 0.5 * (volume.dims[a] as f64 - 1.0) * volume.spacing[a];
    [0, 1, 2].map(|i| (0..3).fold(volume.origin[i], |sum, a| sum + half(a) * volume.directions[a][i]))
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
