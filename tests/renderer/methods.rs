//! What every method of the list promises on a device: its values after any clip are those of its full recomputation, and its time is
//! that of its ambient phase.

use cao::renderer::{COLOUR, Renderer};
use cao_gpu::{Gpu, Phase};
use cao_measure::exactness::{Plan, verify};
use cao_model::clip::Shape;
use cao_model::methods::Method;
use cao_model::settings::Setup;
use cao_testing::{close, kinds, methods, open, renderer_of};

fn renderer(gpu: &Gpu, volume: &str, method: Method) -> Renderer {
    let volume = cao_formats::open(volume).unwrap();
    let transfer = cao_formats::transfer::load("auto", volume.range()).unwrap();
    let setup = Setup::of(method, volume.min_spacing());
    renderer_of(gpu, &volume, transfer, setup, COLOUR).unwrap()
}

/// As `cao verify --method all` has it. In the second volume a plane often changes bricks at both ends of long axes, and nothing
/// between them.
#[test]
fn every_method_is_exact_after_any_clip() {
    let gpu = open();
    for method in methods() {
        // Fewer where updates are those of another.
        let poses = if kinds().contains(&method) { 10 } else { 4 };
        for (volume, shapes, seed) in [
            ("builtin:fruit:24", &Shape::ANALYTIC[..], 1),
            ("builtin:engine:40x36x20:1,1,2", &[Shape::Plane][..], 3),
        ] {
            let mut renderer = renderer(&gpu, volume, method);
            let plan = Plan { shapes: shapes.to_vec(), poses, seed };
            let report = verify(&mut renderer, &plan, &mut |_| ()).unwrap();
            assert_eq!(report.cuts.len(), poses as usize * shapes.len());
            assert!(!report.vacuous(), "{} {volume}: nothing was compared", method.name());
            assert!(report.exact(), "{} {volume}: {:?} {:?}", method.name(), report.total(), report.stereo);
        }
    }
    close(gpu);
}

/// What the planner and the charts count.
#[test]
fn every_method_spends_time_in_its_ambient_phase() {
    let gpu = open();
    for method in methods() {
        let mut renderer = renderer(&gpu, "builtin:engine:24", method);
        let timings = renderer.update(&mut |_| ()).unwrap();
        // Queues without timestamps tell no times.
        assert!(timings.is_empty() || timings.of(Phase::Ambient) > 0.0, "{}: {timings:?}", method.name());
    }
    close(gpu);
}
