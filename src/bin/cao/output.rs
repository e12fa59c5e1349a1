//! What the program prints: text for people, one JSON object for machines, progress on a terminal only.

use crate::args::Global;
use anyhow::{Context, Result};
use cao::gpu::{Gpu, OpenOptions};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Map, Value};
use std::io::Write;
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

    /// Times of the stages, in both forms.
    pub fn timings(&mut self, timings: &[(String, f64)]) {
        let mut stages = Map::new();
        for (stage, ms) in timings {
            self.line(format!("  {stage:<20} {ms:>10.3} ms"));
            stages.insert(stage.clone(), (*ms).into());
        }
        self.json(serde_json::json!({ "stages_ms": stages }));
    }

    /// Prints. A pipe whose reader has left is no failure.
    pub fn finish(self) -> Result<()> {
        let text =
            if self.as_json { format!("{:#}\n", Value::Object(self.fields)) } else { self.text };
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
