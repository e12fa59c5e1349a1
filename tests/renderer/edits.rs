//! Updates are exact (method.md §5), whatever the method: after any sequence of edits V_AO equals a full computation bit for bit, V_o
//! and V_AO equal those of a renderer that was made for the last state only.

use crate::scenes::{NAMES, assert_as_fresh, scene};
use cao_gpu::Gpu;
use cao_measure::random::Random;
use cao_model::light::AmbientLight;
use cao_model::methods::Method;
use cao_testing::*;

/// The history of one scene in this light, which edits turn; voxels compared and recomputed.
fn history(
    gpu: &Gpu,
    name: &str,
    (method, light): (Method, AmbientLight),
    seed: u64,
    steps: usize,
) -> (u64, u64) {
    let mut random = Random::new(seed);
    let mut scene = scene(&mut random, name, method);
    scene.setup.occlusion.light = light;
    let mut renderer = scene.renderer(gpu);
    let (mut compared, mut recomputed) = (0, 0);
    let mut history = Vec::new();
    for step in 0..steps {
        history.push(scene.edit(&mut random, &mut renderer));
        // Several edits in one update, too.
        if random.below(4) == 0 {
            continue;
        }
        if random.below(2) == 0 {
            run(gpu, |rec| renderer.record_update(rec).unwrap());
        }
        renderer.update(&mut |_| ()).unwrap();
        let (found, _) = cao::verify::verify(&renderer, &mut |_| ()).unwrap();
        let context = || {
            format!(
                "{name} {:?} {:?} {} seed {seed} step {step}: after {}",
                scene.volume.dims,
                scene.volume.spacing,
                method.name(),
                history[history.len().saturating_sub(4)..].join("; ")
            )
        };
        assert_eq!(found.different, 0, "{found:?} {}", context());
        compared += found.compared;
        recomputed += found.recomputed;
        if step % 8 == 0 {
            assert_as_fresh(&scene, &renderer, &scene.renderer(gpu), &context);
        }
    }
    (compared, recomputed)
}

#[test]
fn updates_equal_a_full_computation_after_any_sequence_of_edits() {
    const SEED: u64 = 61;
    const STEPS: usize = 200;
    let gpu = open();
    for (case, name) in NAMES.into_iter().enumerate() {
        let light = [AmbientLight::Uniform, coloured_light(), AmbientLight::Uniform][case];
        let (compared, recomputed) =
            history(&gpu, name, (Method::default(), light), SEED + case as u64, STEPS);
        // Neither everything nor nothing was recomputed.
        assert!(
            compared > 100_000 && recomputed * 20 > compared && recomputed < compared,
            "{recomputed} of {compared}"
        );
    }
    close(gpu);
}

/// Methods that are not the default have shorter ones.
#[test]
fn so_do_those_of_every_other_method() {
    const STEPS: usize = 40;
    let gpu = open();
    for (case, method) in methods().filter(|method| *method != Method::default()).enumerate() {
        let light = if method == Method::Lao { AmbientLight::SKY } else { AmbientLight::Uniform };
        let (compared, _) =
            history(&gpu, NAMES[case % NAMES.len()], (method, light), 71 + case as u64, STEPS);
        assert!(compared > 20_000, "{}: {compared}", method.name());
    }
    close(gpu);
}

/// The length that opacities are meant for: none of them changes with it, every value does.
#[test]
fn another_reference_length_is_an_edit() {
    let gpu = open();
    for method in methods() {
        let mut scene = scene(&mut Random::new(64), "engine", method);
        let mut renderer = scene.renderer(&gpu);
        let before = renderer.read_ambient().unwrap();
        scene.transfer.reference_mm = Some(3.0 * scene.volume.min_spacing() as f32);
        renderer.set_transfer(scene.transfer.clone()).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        let after = renderer.read_ambient().unwrap();
        assert!(
            after != before && after == scene.renderer(&gpu).read_ambient().unwrap(),
            "{}",
            method.name()
        );
    }
    close(gpu);
}

/// Nothing is recorded where nothing changed, and setting the same clips again computes nothing.
#[test]
fn a_frame_in_which_nothing_changed_costs_nothing() {
    let gpu = open();
    for method in methods() {
        let mut random = Random::new(66);
        let mut scene = scene(&mut random, "engine", method);
        scene.clips =
            vec![random_clip(&mut random, &cao_model::clip::Shape::Sphere, size_mm(&grid_of(&scene.volume)))];
        let mut renderer = scene.renderer(&gpu);
        assert_eq!(*renderer.update(&mut |_| ()).unwrap(), []);
        renderer.set_clips(&scene.clips).unwrap();
        assert!(!renderer.update(&mut |_| ()).unwrap().is_empty());
        if method == Method::default() {
            assert_eq!(renderer.categories().unwrap().affected, 0);
        }
    }
    close(gpu);
}
