//! `--budget-error` and `--budget-ms`: settings that the scene at hand affords.

use crate::args;
use anyhow::Result;
use cao::renderer::Renderer;
use cao_cli::output::{Out, Progress};
use cao_measure::planner;
use cao_measure::planner::{Budget, Measured};
use cao_model::methods::Method;
use cao_model::settings::Setup;
use serde_json::json;
use std::time::Instant;

/// What was chosen, and why.
pub struct Planned {
    budget: Budget,
    chosen: Measured,
    missed: Option<Measured>,
    tried: usize,
    samples: usize,
    needed: usize,
    seconds: f64,
}

/// Chooses settings within the budget, if one was given, among those that the flags leave open, and hands them to the renderer.
pub fn plan(
    renderer: &mut Renderer,
    budget: &args::Budget,
    settings: &args::Settings,
    method: Option<Method>,
    progress: &mut Progress,
) -> Result<Option<Planned>> {
    let budget = match (budget.budget_error, budget.budget_ms) {
        (Some(error), _) => Budget::Error(error),
        (_, Some(ms)) => Budget::Milliseconds(ms),
        _ => return Ok(None),
    };
    progress.stage("calibrating");
    let start = Instant::now();
    let setup = *renderer.setup();
    let candidates = planner::candidates(&setup, method, settings.rays, settings.quadrature);
    let calibration =
        planner::calibrate(renderer, &candidates, Some(budget), &mut |done| progress.set(done))?;
    let chosen = calibration.choose(budget)?;
    let seconds = start.elapsed().as_secs_f64();
    let planner::Candidate { method, occlusion, options } = chosen.candidate;
    renderer.set_setup(Setup { method, occlusion, options, ..setup })?;
    Ok(Some(Planned {
        budget,
        chosen,
        missed: calibration.runner_up(budget),
        tried: calibration.measured.len(),
        samples: calibration.bricks.len(),
        needed: calibration.needed.len(),
        seconds,
    }))
}

impl Planned {
    /// Says what was chosen, and what was measured.
    pub fn print(&self, out: &mut Out) {
        let found = |m: &Measured| {
            format!("{}: error {:.4}, at most {:.4}, about {:.1} ms", m.candidate, m.rmse, m.bound, m.ms)
        };
        out.line(format!("planned   {}", found(&self.chosen)));
        let (asked, missed) = match self.budget {
            Budget::Error(error) => (format!("error budget {error}"), "the most accurate beyond it"),
            Budget::Milliseconds(ms) => (format!("time budget {ms} ms"), "the quickest beyond it"),
        };
        let beyond = self
            .missed
            .as_ref()
            .map_or("no setting is beyond it".to_owned(), |m| format!("{missed}: {}", found(m)));
        out.line(format!("          {asked}; {beyond}"));
        out.line(format!(
            "          {} settings tried on {} of {} bricks in {:.1} s",
            self.tried, self.samples, self.needed, self.seconds
        ));
        let budget = match self.budget {
            Budget::Error(error) => json!({ "error": error }),
            Budget::Milliseconds(ms) => json!({ "ms": ms }),
        };
        out.json(json!({ "planned": {
            "budget": budget, "error": self.chosen.rmse, "error_bound": self.chosen.bound,
            "foreseen_ms": self.chosen.ms, "settings_tried": self.tried, "sample_bricks": self.samples,
            "needed_bricks": self.needed, "calibration_s": self.seconds,
        } }));
    }
}
