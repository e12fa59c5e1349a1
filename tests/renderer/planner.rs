//! The planner's promises, on a device: what it chooses keeps its budget on bricks that it has not seen, and takes the time that
//! it foresaw.

use cao::gpu::{Phase, Stage};
use cao::renderer::{COLOUR, Renderer};
use cao::stages;
use cao::{Clip, Gpu, Pose, Shape};
use cao_measure::planner::{
    Budget, Calibration, Candidate, Measured, SAMPLES, TIME_FACTOR, calibrate, candidates, measure,
};
use cao_measure::random::Random;
use cao_model::methods::Method;
use cao_model::settings::Scope;
use cao_model::settings::Setup;
use cao_testing::{close, open};
use glam::Vec3;

fn renderer(gpu: &Gpu, volume: &str, method: Method, scope: Scope) -> Renderer {
    let volume = cao_formats::open(volume).unwrap();
    let transfer = cao_formats::transfer::load("auto", volume.range()).unwrap();
    let mut setup = Setup { method, scope, ..Setup::of(Method::Cao, volume.min_spacing()) };
    setup.occlusion.radius_mm = 8.0;
    let mut renderer = Renderer::new(gpu, &volume, transfer, setup, COLOUR).unwrap();
    let pose = Pose { translate_mm: Vec3::new(9.0, -9.0, 9.0), scale: Vec3::splat(11.0), ..Pose::default() };
    renderer.set_clips(&[Clip { pose, ..Clip::remove(Shape::Sphere) }]).unwrap();
    renderer
}

/// As many bricks as a calibration takes, none of them its own.
fn held_back(calibration: &Calibration) -> Vec<u32> {
    let mut rest: Vec<u32> =
        calibration.needed.iter().copied().filter(|b| !calibration.bricks.contains(b)).collect();
    let mut random = Random::new(9);
    for i in (1..rest.len()).rev() {
        rest.swap(i, random.below(i as u64 + 1) as usize);
    }
    rest.truncate(2 * SAMPLES);
    assert!(rest.len() > SAMPLES, "too few bricks are left to be held back");
    rest
}

#[test]
fn what_an_error_budget_chooses_keeps_it_on_bricks_held_back() {
    let gpu = open();
    for volume in ["builtin:engine:48", "builtin:fruit:40"] {
        let mut renderer = renderer(&gpu, volume, Method::Cao, Scope::Needed);
        let list = candidates(renderer.setup(), None, None, None);
        let calibration = calibrate(&mut renderer, &list, None, &mut |_| ()).unwrap();
        assert_eq!(calibration.measured.len(), list.len());
        let rest = held_back(&calibration);
        let on_rest = measure(&mut renderer, &list, &rest).unwrap();
        let rest_of = |candidate: Candidate| -> Measured {
            *on_rest.iter().find(|m| m.candidate == candidate).unwrap()
        };
        // Budgets across all that is there.
        let mut bounds: Vec<f64> = calibration.measured.iter().map(|m| m.bound).collect();
        bounds.sort_by(f64::total_cmp);
        let mut last_ms = 0.0;
        for &budget in bounds.iter().rev() {
            let chosen = calibration.choose(Budget::Error(budget)).unwrap();
            let error = rest_of(chosen.candidate).rmse;
            assert!(error <= budget, "{volume}: {} errs by {error}, budget {budget}", chosen.candidate);
            assert!(chosen.ms >= last_ms, "{volume}: a tighter budget chose a cheaper setting");
            last_ms = chosen.ms;
        }
        // With the budget known beforehand, not everything is tried, and the choice keeps it too.
        let budget = Budget::Error(bounds[bounds.len() / 2]);
        let short = calibrate(&mut renderer, &list, Some(budget), &mut |_| ()).unwrap();
        let few = short.choose(budget).unwrap();
        assert!(short.measured.len() < list.len(), "{volume}: all were tried");
        assert!(rest_of(few.candidate).rmse <= bounds[bounds.len() / 2], "{volume}");
        // The comparison can fail: the setting with the largest error misses the tightest budget.
        let worst = calibration.measured.iter().max_by(|a, b| a.bound.total_cmp(&b.bound)).unwrap();
        assert!(rest_of(worst.candidate).rmse > bounds[0], "{volume}");
        let refusal = calibration.choose(Budget::Error(0.5 * bounds[0])).unwrap_err().to_string();
        assert!(refusal.contains("most accurate") && refusal.contains("ask for"), "{refusal}");
    }
    close(gpu);
}

/// Time of one full update of the ambient volume with a setting.
fn taken(renderer: &mut Renderer, candidate: Candidate) -> f64 {
    let Candidate { method, occlusion, options } = candidate;
    let method = if method == Method::Cao { Method::Lao } else { method };
    renderer.set_setup(Setup { method, occlusion, options, ..*renderer.setup() }).unwrap();
    let mut times: Vec<f64> = (0..3)
        .map(|_| {
            renderer.invalidate();
            let timings = renderer.update(&mut |_| ()).unwrap();
            // Rays by the sampler are foreseen by themselves, other methods as a whole.
            let own = |stage: Stage| match method {
                Method::Lao => stage == stages::LAO,
                _ => stage.phase == Phase::Ambient,
            };
            timings.iter().filter(|t| own(t.stage)).map(|t| t.ms).sum()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[1]
}

#[test]
fn foreseen_times_are_taken() {
    let gpu = open();
    for (method, scope) in [(Method::Cao, Scope::Needed), (Method::Lao, Scope::All)] {
        // Other work on the machine may disturb one attempt, not three.
        let attempt = || {
            let mut renderer = renderer(&gpu, "builtin:engine:48", method, scope);
            let list = candidates(renderer.setup(), None, None, None);
            let list: Vec<_> = list.into_iter().step_by(5).collect();
            let calibration = calibrate(&mut renderer, &list, None, &mut |_| ()).unwrap();
            let slowest = calibration.measured.iter().map(|m| m.ms).fold(0.0, f64::max);
            [0.3, 0.6, 2.0].map(|share| {
                let chosen = calibration.choose(Budget::Milliseconds(share * slowest)).unwrap();
                let ms = taken(&mut renderer, chosen.candidate);
                println!("{scope:?} {}: foreseen {:.1} ms, taken {ms:.1} ms", chosen.candidate, chosen.ms);
                let factor = ms / chosen.ms;
                factor < TIME_FACTOR && factor > 1.0 / TIME_FACTOR
            })
        };
        assert!((0..3).any(|_| attempt() == [true; 3]), "{method:?} {scope:?}");
    }
    close(gpu);
}

#[test]
fn nothing_to_see_needs_no_accuracy() {
    let gpu = open();
    let mut renderer = renderer(&gpu, "builtin:empty:16", Method::Cao, Scope::Needed);
    let list = candidates(renderer.setup(), None, None, None);
    let calibration = calibrate(&mut renderer, &list, None, &mut |_| ()).unwrap();
    assert!(calibration.needed.is_empty());
    assert_eq!(calibration.choose(Budget::Error(1e-9)).unwrap().rmse, 0.0);
    drop(renderer);
    close(gpu);
}
