//! What the program prints: text for people, one JSON object for machines, progress on a terminal only.

use super::args::Global;
use anyhow::{Context, Result};
use cao::ambient::Categories;
use cao_gpu::{Gpu, OpenOptions, Timings};
use cao_model::error::shown_path;
use cao_model::feature::Features;
use cao_model::light::AmbientLight;
use cao_model::options::Options;
use cao_model::order::Layout;
use cao_model::pixel_occlusion::PixelOcclusion;
use cao_model::settings::Setup;
use cao_model::surface::World;
use cao_model::volume::Volume;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::{Map, Value, json};
use std::io::Write;
use std::path::Path;
use std::sync::mpsc;
use std::time::Duration;

/// Gathers the answer and prints it once, or piece by piece as it comes.
pub struct Out {
    as_json: bool,
    text: String,
    /// Bytes of it that are printed already.
    shown: usize,
    fields: Map<String, Value>,
}

impl Out {
    /// Nothing yet, in the form that the user chose.
    pub fn new(global: &Global) -> Self {
        Self { as_json: global.json, text: String::new(), shown: 0, fields: Map::new() }
    }

    /// A line for people.
    pub fn line(&mut self, line: impl AsRef<str>) {
        self.text.push_str(&crate::harmless(line.as_ref()));
        self.text.push('\n');
    }

    /// All lines so far.
    pub fn text(&self) -> &str {
        &self.text
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

    /// A volume's header, axes as its file has them.
    pub fn volume(&mut self, name: impl AsRef<Path>, volume: &Volume) {
        let Layout { dims, spacing, .. } = volume.stored_layout();
        let ([x, y, z], [sx, sy, sz]) = (dims, spacing);
        self.line(format!(
            "volume    {}: {x} x {y} x {z} voxels of {sx} x {sy} x {sz} mm, {}",
            shown_path(&name),
            volume.values.kind()
        ));
        self.json(json!({
            "volume": name.as_ref().to_string_lossy(), "dims": dims, "spacing_mm": spacing,
            "type": volume.values.kind()
        }));
    }

    /// Meshes, and how their pixels are occluded.
    pub fn meshes(&mut self, world: &World, occlusion: &PixelOcclusion, delta_mm: f32) {
        let (triangles, materials) = (world.triangles.len(), world.materials.len());
        let left_out = match world.degenerate {
            0 => String::new(),
            n => format!(", {n} without area left out"),
        };
        self.line(format!("meshes    {triangles} triangles{left_out}, {materials} materials"));
        self.json(json!({
            "triangles": triangles, "degenerate_triangles": world.degenerate, "materials": materials
        }));
        self.pixels(occlusion, delta_mm);
    }

    /// How pixels are occluded.
    pub fn pixels(&mut self, occlusion: &PixelOcclusion, delta_mm: f32) {
        let method = occlusion.method.name();
        let entry = occlusion.method.entry();
        let mut how = String::new();
        if entry.rays.is_some() {
            how += &format!(", {} rays", occlusion.rays);
        }
        if entry.samples.is_some() {
            how += &format!(", {} samples", occlusion.samples);
        }
        if occlusion.sparse > 1 {
            how += &format!(", 1 of {} pixels", occlusion.sparse.pow(2));
        }
        if occlusion.clamp {
            how += ", corners clamped";
        }
        self.line(format!("surfaces  {method}{how}, delta {delta_mm} mm"));
        self.json(json!({
            "mesh_method": method, "delta_mm": delta_mm, "sparse": occlusion.sparse,
            "clamp": occlusion.clamp,
        }));
    }

    /// Features and how each is shown; nothing where there are none.
    pub fn features(&mut self, features: &Features) {
        if features.is_empty() {
            return;
        }
        let said = features.list.iter().map(|feature| {
            let scale =
                if feature.scale == 1.0 { String::new() } else { format!(" times {}", feature.scale) };
            let (hidden, spared) =
                (if feature.visible { "" } else { " hidden" }, if feature.spared { " spared" } else { "" });
            format!("{}{scale}{hidden}{spared}", feature.name)
        });
        self.line(format!("features  {}", said.collect::<Vec<_>>().join(", ")));
        let list = features.list.iter().map(|feature| {
            json!({ "name": feature.name, "visible": feature.visible, "opacity": feature.scale, "spared": feature.spared })
        });
        self.json(json!({ "features": list.collect::<Vec<_>>() }));
    }

    /// How occlusion was computed.
    pub fn setup(&mut self, setup: &Setup, volume: &Volume) {
        let method = setup.method.name();
        self.json(json!({ "method": method }));
        self.occlusion(method, setup, volume);
    }

    /// The rays of these methods.
    pub fn occlusion(&mut self, methods: &str, setup: &Setup, volume: &Volume) {
        let o = setup.occlusion;
        let (rays, quadrature, spacing) = (o.rays.name(), o.quadrature.name(), volume.min_spacing());
        let (samples, step, first) = (o.samples(spacing), o.step(spacing), o.first(spacing));
        let given = setup.options.other_than(&Options::DEFAULT);
        let mut options: String = given.iter().map(|(name, value)| format!(", {name} {value}")).collect();
        let light = o.light.to_string();
        if o.light != AmbientLight::Uniform {
            options += &format!(", light {light}");
        }
        self.line(format!(
            "method    {methods}, rays {rays}, quadrature {quadrature}{options}, radius {} mm in {samples} steps of {step} mm, first sample at {first} mm",
            o.radius_mm,
        ));
        self.json(json!({
            "rays": rays, "quadrature": quadrature, "radius_mm": o.radius_mm,
            "light": light, "samples": samples, "step_mm": step, "first_sample_mm": first,
            "options": given.into_iter().collect::<std::collections::BTreeMap<_, _>>()
        }));
    }

    /// Size of the picture.
    pub fn image(&mut self, [width, height]: [u32; 2]) {
        self.line(format!("image     {width} x {height} pixels for each eye"));
        self.json(json!({ "image_size": [width, height] }));
    }

    /// Voxels of each category.
    pub fn categories(&mut self, c: &Categories) {
        let all = c.clipped as f64 + c.affected as f64 + c.untouched as f64;
        let share = |n: u64| 100.0 * n as f64 / all.max(1.0);
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
        self.json(json!({ "memory_peak_bytes": peak, "memory_bytes_per_voxel": per_voxel }));
    }

    /// A file that was written.
    pub fn wrote(&mut self, path: &Path) {
        self.line(format!("wrote     {}", shown_path(path)));
        let files = self.fields.entry("files").or_insert_with(|| json!([]));
        if let Value::Array(files) = files {
            files.push(path.display().to_string().into());
        }
    }

    /// Times of the stages, in both forms.
    pub fn timings(&mut self, timings: &Timings) {
        let mut stages = Map::new();
        for timing in timings {
            self.line(format!("  {:<20} {:>10.3} ms", timing.stage.name, timing.ms));
            stages.insert(timing.stage.name.into(), timing.ms.into());
        }
        self.json(json!({ "stages_ms": stages }));
    }

    /// Prints what was not yet shown. A pipe whose reader has left is no failure.
    ///
    /// # Errors
    /// Standard output cannot be written to.
    pub fn finish(mut self) -> Result<()> {
        if self.as_json {
            return print(&format!("{:#}\n", Value::Object(self.fields)));
        }
        self.show()
    }

    /// Prints the lines since the last call, for people who wait for minutes; machines get one object at the end.
    ///
    /// # Errors
    /// Standard output cannot be written to.
    pub fn show(&mut self) -> Result<()> {
        if !self.as_json {
            print(&self.text[self.shown..])?;
            self.shown = self.text.len();
        }
        Ok(())
    }
}

fn print(text: &str) -> Result<()> {
    let mut stdout = std::io::stdout();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("cannot write to standard output"),
    }
}

/// Opens the device that the user chose.
///
/// # Errors
/// There is none, or it lacks something.
pub fn open_gpu(global: &Global) -> Result<Gpu> {
    Ok(Gpu::open(&OpenOptions { device: global.device.clone(), validation: global.validate, plain: false })?)
}

/// Fails when the validation layer said anything.
///
/// # Errors
/// What it said.
pub fn check_validation(gpu: &Gpu) -> Result<()> {
    Ok(gpu.assert_clean()?)
}

/// What goes on, on a terminal, where a stage takes longer than a second; nothing in a pipe.
pub struct Progress {
    bar: ProgressBar,
    /// Tells the thread that waits for the second to pass that the stage is over.
    stage: Option<mpsc::Sender<()>>,
}

impl Default for Progress {
    fn default() -> Self {
        Self { bar: ProgressBar::hidden(), stage: None }
    }
}

impl Progress {
    /// Begins a stage.
    pub fn stage(&mut self, what: &'static str) {
        self.end_stage();
        let style = ProgressStyle::with_template("{spinner} {msg} {elapsed}");
        self.bar = ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::hidden());
        self.bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
        self.bar.set_message(what);
        let (sender, ended) = mpsc::channel();
        self.stage = Some(sender);
        let bar = self.bar.clone();
        std::thread::spawn(move || {
            if ended.recv_timeout(Duration::from_secs(1)) == Err(mpsc::RecvTimeoutError::Timeout) {
                // Stays hidden where standard error is no terminal.
                bar.set_draw_target(ProgressDrawTarget::stderr());
                bar.enable_steady_tick(Duration::from_millis(100));
            }
        });
    }

    /// What goes on in the stage just now.
    pub fn say(&self, what: &str) {
        self.bar.set_message(what.to_owned());
    }

    /// Share of the stage that is done, 0 … 1.
    pub fn set(&mut self, done: f64) {
        if self.bar.position() == 0 {
            let style = ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} %  {eta} left");
            self.bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        }
        self.bar.set_position((done.clamp(0.0, 1.0) * 1000.0) as u64);
    }

    /// Does something that prints, without the bar in its way.
    pub fn aside<T>(&self, print: impl FnOnce() -> T) -> T {
        self.bar.suspend(print)
    }

    fn end_stage(&mut self) {
        self.stage = None;
        self.bar.finish_and_clear();
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.end_stage();
    }
}
