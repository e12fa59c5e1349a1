//! The frames of some configurations: every method of each in turn, along the path, timed.

use super::path;
use super::way::Way;
use anyhow::{Context, Result};
use cao::Budget;
use cao::ambient::Categories;
use cao::draw::picture::Picture;
use cao::renderer::{COLOUR, Drawn, Renderer};
use cao_gpu::{Counts, Gpu, Phase, Timings};
use cao_measure::split::Split;
use cao_model::clip::Shape;
use cao_model::look::Look;
use cao_model::network::Network;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::volume::Volume;
use std::rc::Rc;
use std::time::Instant;

/// A volume and how it is drawn.
pub struct Input {
    /// What the user calls it.
    pub name: String,
    pub volume: Volume,
    pub transfer: TransferFunction,
    /// Of method dvao, another than the one that is built in.
    pub network: Option<Network>,
}

/// Everything that may be varied.
#[derive(Clone)]
pub struct Configuration {
    pub input: Rc<Input>,
    /// What all methods share.
    pub setup: Setup,
    /// Pixels of one view.
    pub size: [u32; 2],
    pub views: usize,
}

/// What is done in every configuration.
pub struct Plan {
    pub methods: Vec<Way>,
    /// What moves through the volume.
    pub clip: Option<Shape>,
    /// Whether it is another mesh in every frame.
    pub deform: bool,
    pub frames: u32,
    pub runs: u32,
    pub warm_up: u32,
    /// What the drawing of a frame is to take, ms.
    pub draw_budget_ms: Option<f32>,
    /// What its update is to take, ms.
    pub budget_ms: Option<f32>,
}

impl Plan {
    /// Frames that all methods draw together in one configuration, counted or not.
    pub fn total(&self) -> u64 {
        u64::from(self.runs) * u64::from(self.warm_up + self.frames) * self.methods.len() as u64
    }
}

/// One frame. Times in ms.
pub struct Frame {
    /// From moving the clip to the end of the device's work.
    pub wall: f64,
    /// GPU timestamps; empty where the device has none.
    pub stages: Timings,
    /// What the clip did to the voxels.
    pub categories: Categories,
    /// Time in which the clips were set: where a mesh has another form, with all that is made of it.
    pub clips: f64,
    /// Time in which the processor recorded the update.
    pub recording: f64,
    /// What the update asks of Vulkan.
    pub asked: Counts,
    /// Time of the update on the device; of the whole frame where that has no timestamps.
    pub update: f64,
    /// Frames since the scene that the ambient volume shows was the newest.
    pub behind: u64,
    /// What was drawn; less than all of the picture where there is a budget.
    pub drawn: Drawn,
}

/// The parts of a frame as the paper names them (CAO Fig. 9), and what no stage accounts for.
pub const PARTS: [&str; 4] = {
    let [clipping, rays, rendering] = Split::PARTS;
    [clipping, rays, rendering, "overhead"]
};

impl Frame {
    /// Times of the [`PARTS`] in ms; overhead is recording, submission, waiting.
    pub fn parts(&self) -> [f64; 4] {
        let [clipping, rays, rendering] = Split::of(&self.stages).parts();
        [clipping, rays, rendering, (self.wall - self.stages.total()).max(0.0)]
    }
}

/// A method's frames.
pub struct Measured {
    pub method: Way,
    /// In each run the frames that count, in order.
    pub runs: Vec<Vec<Frame>>,
}

impl Measured {
    /// The counted frames of all runs.
    pub fn frames(&self) -> impl Iterator<Item = &Frame> {
        self.runs.iter().flatten()
    }
}

/// A method's renderer in one configuration.
struct Runner<'a> {
    configuration: &'a Configuration,
    target: Rc<Picture>,
    renderer: Renderer,
    measured: Measured,
}

/// Draws the path with all methods of all configurations in turn, frame by frame, so that all can be compared with one another.
/// `progress` hears of every frame drawn. The results are in the order of the configurations, and within each in that of the methods.
pub fn measure(
    gpu: &Gpu,
    configurations: &[Configuration],
    plan: &Plan,
    progress: &mut dyn FnMut(),
) -> Result<Vec<Vec<Measured>>> {
    let mut runners = Vec::new();
    for configuration in configurations {
        let Configuration { size: [width, height], views, .. } = configuration;
        let target = Picture::new(gpu, [*width, *height], *views)
            .with_context(|| format!("pictures of {views} views of {width} x {height} pixels"))?;
        let target = Rc::new(target);
        for &method in &plan.methods {
            let runner = Runner::new(gpu, configuration, &target, plan, method);
            runners.push(runner.with_context(|| method.name())?);
        }
    }
    for _ in 0..plan.runs {
        runners.iter_mut().for_each(|runner| runner.measured.runs.push(Vec::new()));
        for frame in -i64::from(plan.warm_up)..i64::from(plan.frames) {
            for runner in &mut runners {
                let drawn = runner.draw(gpu, plan, frame)?;
                if let (0.., Some(run)) = (frame, runner.measured.runs.last_mut()) {
                    run.push(drawn);
                }
                progress();
            }
        }
    }
    let mut measured = runners.into_iter().map(|runner| runner.measured);
    Ok(configurations.iter().map(|_| measured.by_ref().take(plan.methods.len()).collect()).collect())
}

impl<'a> Runner<'a> {
    /// A renderer with all that does not change from frame to frame.
    fn new(
        gpu: &Gpu,
        configuration: &'a Configuration,
        target: &Rc<Picture>,
        plan: &Plan,
        method: Way,
    ) -> Result<Self> {
        let input = &configuration.input;
        let setup = method.setup(configuration.setup);
        let mut renderer = Renderer::new(gpu, &input.volume, input.transfer.clone(), setup, COLOUR)?;
        if let Some(network) = &input.network {
            renderer.set_network(network.clone())?;
        }
        let measured = Measured { method, runs: Vec::new() };
        let mut runner = Self { configuration, target: target.clone(), renderer, measured };
        runner.move_clip(plan, -1 - i64::from(plan.warm_up))?;
        runner.renderer.update(&mut |_| ())?;
        Ok(runner)
    }

    fn move_clip(&mut self, plan: &Plan, frame: i64) -> Result<()> {
        let size_mm = self.configuration.input.volume.size_mm();
        let mut clips: Vec<_> = plan.clip.iter().map(|shape| path::clip(shape, size_mm, frame)).collect();
        if plan.deform {
            for clip in &mut clips {
                clip.shape = path::deformed(&clip.shape, frame)?;
            }
        }
        Ok(self.renderer.set_clips(&clips)?)
    }

    /// One frame, as a host draws it.
    fn draw(&mut self, gpu: &Gpu, plan: &Plan, frame: i64) -> Result<Frame> {
        let Configuration { input, size, views, .. } = self.configuration;
        let aspect = size[0] as f32 / size[1] as f32;
        let views = path::views(input.volume.size_mm(), aspect, *views, frame)?;
        let look = Look { budget_ms: plan.draw_budget_ms, ..self.measured.method.look() };

        let start = Instant::now();
        self.move_clip(plan, frame)?;
        let clips = start.elapsed().as_secs_f64() * 1e3;
        let mut rec = gpu.recorder("frame")?;
        let before = Instant::now();
        let updated = match plan.budget_ms {
            Some(ms) => Some(self.renderer.record_update_within(&mut rec, Budget::Ms(ms))?),
            None => self.renderer.record_update(&mut rec).map(|()| None)?,
        };
        let (recording, asked) = (before.elapsed().as_secs_f64() * 1e3, rec.counts());
        let drawn = self.renderer.record_picture(&mut rec, &views, &look, &self.target)?;
        let stages = rec.submit_and_wait()?;
        let wall = start.elapsed().as_secs_f64() * 1e3;
        // Of a device without timestamps the whole frame is known.
        self.renderer.drew(&drawn, if stages.is_empty() { wall } else { stages.of(Phase::Draw) });

        let update = if stages.is_empty() { wall } else { update_ms(&stages) };
        if let Some(updated) = updated {
            self.renderer.updated(&updated, update)?;
        }
        let (categories, behind) = (self.renderer.categories()?, self.renderer.stale().frames);
        Ok(Frame { wall, stages, categories, clips, recording, asked, update, behind, drawn })
    }
}

/// All but the picture.
fn update_ms(stages: &Timings) -> f64 {
    stages.iter().filter(|timing| timing.stage != cao::stages::RAYCAST).map(|timing| timing.ms).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao::renderer::Quality;

    #[test]
    fn what_no_stage_accounts_for_is_overhead() {
        let mut stages = Timings::new();
        let frame =
            [(cao::stages::CLASSIFY, 1.0), (cao::stages::CONTEXTUAL, 4.5), (cao::stages::RAYCAST, 2.0)];
        frame.into_iter().for_each(|(stage, ms)| stages.push(stage, ms));
        let mut frame = Frame {
            wall: 8.0,
            stages,
            categories: Categories::default(),
            clips: 0.0,
            recording: 0.0,
            asked: Counts::default(),
            update: 5.5,
            behind: 0,
            drawn: Drawn { size: [1, 1], step_mm: 1.0, quality: Quality::FULL },
        };
        assert_eq!((frame.parts(), update_ms(&frame.stages)), ([1.0, 4.5, 2.0, 0.5], 5.5));
        // Clocks of device and host may disagree by a little; no time is negative.
        frame.wall = 7.0;
        assert_eq!(frame.parts()[3], 0.0);
    }
}
