//! What the program prints: text for people, one JSON object for machines, progress on a terminal only.

use crate::args::Global;
use anyhow::{Context, Result};
use cao::gpu::{Gpu, OpenOptions};
use cao::renderer::{Categories, Setup};
use cao::scene::Method;
use cao::volume::Volume;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Map, Value, json};
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

/// Gathers the answer and prints it once.
pub struct Out {
    as_json: bool,
    text: String,
    fields: Map<String, Value>,
}

impl Out {
    pub fn new(global: &Global) -> Self {
        Self { as_json: global.json, text: String::new(), fields: Map::new() }
    }

    /// A line for people.
    pub fn line(&mut self, line: impl AsRef<str>) {
        self.text.push_str(line.as_ref());
        self.text.push('\n');
    }

    /// Fields for machines.
    pub fn json(&mut self, fields: Value) {
        if let Value::Object(fields) = fields {
            self.fields.extend(fields);
        }
    }

    /// The device that did the work.
    pub fn device(&mut self, gpu: &Gpu) {
        let info = gpu.info();
        self.line(format!("device    {} ({})", info.name, info.driver));
        self.json(json!({ "device": info.name, "driver": info.driver }));
    }

    /// A volume's header.
    pub fn volume(&mut self, name: &str, volume: &Volume) {
        let ([x, y, z], [sx, sy, sz]) = (volume.dims, volume.spacing);
        self.line(format!(
            "volume    {name}: {x} x {y} x {z} voxels of {sx} x {sy} x {sz} mm, {}",
            volume.values.kind()
        ));
        self.json(json!({
            "volume": name, "dims": volume.dims, "spacing_mm": volume.spacing, "type": volume.values.kind()
        }));
    }

    /// How occlusion was computed.
    pub fn setup(&mut self, setup: &Setup, volume: &Volume) {
        let o = setup.occlusion;
        let spacing = volume.min_spacing();
        let method = if setup.method == Method::Cao { "cao" } else { "lao" };
        self.line(format!(
            "method    {method}, rays {}, quadrature {}, radius {} mm in {} steps of {} mm, first sample at {} mm",
            o.rays.name(),
            o.quadrature.name(),
            o.radius_mm,
            o.samples(spacing),
            o.step(spacing),
            o.first(spacing)
        ));
        self.json(json!({
            "method": method, "rays": o.rays.name(), "quadrature": o.quadrature.name(), "radius_mm": o.radius_mm,
            "samples": o.samples(spacing), "step_mm": o.step(spacing), "first_sample_mm": o.first(spacing)
        }));
    }

    /// Voxels of each category.
    pub fn categories(&mut self, c: &Categories) {
        let all = f64::from(c.clipped) + f64::from(c.affected) + f64::from(c.untouched);
        let share = |n: u32| 100.0 * f64::from(n) / all.max(1.0);
        self.line(format!(
            "voxels    {:.2} % clipped, {:.2} % affected, {:.2} % untouched",
            share(c.clipped),
            share(c.affected),
            share(c.untouched)
        ));
        self.json(json!({ "clipped": c.clipped, "affected": c.affected, "untouched": c.untouched }));
    }

    /// Device memory at its peak.
    pub fn memory(&mut self, gpu: &Gpu, volume: &Volume) {
        let peak = gpu.memory_peak();
        let per_voxel = peak as f64 / volume.len() as f64;
        self.line(format!(
            "memory    {:.1} MiB at peak, {per_voxel:.1} bytes a voxel",
            peak as f64 / 1048576.0
        ));
        self.json(json!({ "memory_peak_bytes": peak }));
    }

    /// A file that was written.
    pub fn wrote(&mut self, path: &Path) {
        self.line(format!("wrote     {}", path.display()));
        let files = self.fields.entry("wrote").or_insert_with(|| json!([]));
        if let Value::Array(files) = files {
            files.push(path.display().to_string().into());
        }
    }

    /// Times of the stages, in both forms.
    pub fn timings(&mut self, timings: &[(String, f64)]) {
        let mut stages = Map::new();
        for (stage, ms) in timings {
            self.line(format!("  {stage:<20} {ms:>10.3} ms"));
            stages.insert(stage.clone(), (*ms).into());
        }
        self.json(json!({ "stages_ms": stages }));
    }

    /// Prints. A pipe whose reader has left is no failure.
    pub fn finish(self) -> Result<()> {
        let text = if self.as_json { format!("{:#}\n", Value::Object(self.fields)) } else { self.text };
        match std::io::stdout().write_all(text.as_bytes()) {
            Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
            other => other.context("cannot write to standard output"),
        }
    }
}

/// Opens the device that the user chose.
pub fn open_gpu(global: &Global) -> Result<Gpu> {
    Ok(Gpu::open(&OpenOptions { device: global.device.clone(), validation: global.validate })?)
}

/// Fails when the validation layer said anything.
pub fn check_validation(gpu: &Gpu) -> Result<()> {
    Ok(gpu.assert_clean()?)
}

/// A progress bar on a terminal for whatever takes longer than a second; nothing in a pipe.
pub struct Progress {
    what: &'static str,
    start: Instant,
    bar: Option<ProgressBar>,
}

impl Progress {
    pub fn new(what: &'static str) -> Self {
        Self { what, start: Instant::now(), bar: None }
    }

    /// Share done, 0 … 1.
    pub fn set(&mut self, done: f64) {
        if self.bar.is_none() && self.start.elapsed() > Duration::from_secs(1) {
            let style = ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} %  {eta} left")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            self.bar = Some(ProgressBar::new(1000).with_style(style).with_message(self.what));
        }
        if let Some(bar) = &self.bar {
            bar.set_position((done.clamp(0.0, 1.0) * 1000.0) as u64);
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
