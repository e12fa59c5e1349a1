//! After a failure nothing counts as done: the next update makes what a fresh renderer has.

use crate::scenes::{NAMES, assert_as_fresh, scene};
use cao::renderer::Renderer;
use cao_measure::random::Random;
use cao_model::clip::{Clip, Shape};
use cao_model::mesh::TriangleMesh;
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::volume::Volume;
use cao_testing::*;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

/// A progress callback may panic at any of its calls.
#[test]
fn an_update_whose_progress_panicked_is_done_anew() {
    /// What the callback says, so that other panics are not taken for it.
    struct Stop;
    let gpu = open();
    // What is expected is not printed.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        if !info.payload().is::<Stop>() {
            hook(info);
        }
    }));
    let mut stopped = 0;
    for (case, method) in methods().enumerate() {
        let mut random = Random::new(91 + case as u64);
        let mut scene = scene(&mut random, NAMES[case % NAMES.len()], method);
        let mut renderer = scene.renderer(&gpu);
        for turn in 0..if kinds().contains(&method) { 16 } else { 5 } {
            let mut edits = vec![scene.edit(&mut random, &mut renderer)];
            // At the first call, at the second, and so on, of updates that always have another edit to make.
            for at in 0.. {
                let mut calls = 0;
                let update = catch_unwind(AssertUnwindSafe(|| {
                    renderer.update(&mut |_| {
                        calls += 1;
                        if calls > at {
                            std::panic::panic_any(Stop);
                        }
                    })
                }));
                match update {
                    Ok(updated) => {
                        updated.unwrap();
                        break;
                    }
                    Err(panic) => assert!(panic.is::<Stop>(), "another panic: {edits:?}"),
                }
                stopped += 1;
                assert!(renderer.read_ambient().is_err(), "half an update is out of date");
                if random.below(2) == 0 {
                    edits.push(scene.edit(&mut random, &mut renderer));
                }
            }
            if turn % 4 == 0 {
                let context = || format!("{} turn {turn}: {}", method.name(), edits.join("; "));
                assert_as_fresh(&scene, &renderer, &scene.renderer(&gpu), &context);
            }
        }
    }
    assert!(stopped > 100, "{stopped}");
    close(gpu);
}

/// What is refused changes nothing: what there is stays up to date, and the next update is that of the scene as it was.
#[test]
fn what_is_refused_changes_nothing() {
    let gpu = open();
    for (case, method) in methods().enumerate() {
        let mut random = Random::new(95 + case as u64);
        let mut scene = scene(&mut random, NAMES[case % NAMES.len()], method);
        let size = size_mm(&grid_of(&scene.volume));
        let mesh = || random_clip(&mut Random::new(1), &Shape::Mesh(concave()), size);
        scene.clips = vec![mesh()];
        let mut renderer = scene.renderer(&gpu);
        let mut open_mesh = TriangleMesh::cuboid();
        open_mesh.triangles.pop();
        let mut larger = mesh();
        larger.pose.scale *= 1.5;
        let open_mesh = Clip { shape: Shape::Mesh(Arc::new(open_mesh)), ..mesh() };
        let other_type = Volume::new([1; 3], scene.volume.spacing, Values::F32(vec![1.0])).unwrap();
        let inside = Volume::new([2; 3], scene.volume.spacing, Values::U8(vec![0; 8])).unwrap();
        let mut far = scene.setup;
        (far.occlusion.radius_mm, far.maps.resolution) = (1e6 * size.max_element(), 64);
        // Maps of another radius come before what is refused.
        let mut none = scene.setup;
        (none.occlusion.radius_mm, none.maps.pairs) = (0.5 * scene.setup.occlusion.radius_mm, 0);
        let nothing = TransferFunction { opacity: Vec::new(), ..scene.transfer.clone() };
        type Edit<'a> = (&'a str, Box<dyn Fn(&mut Renderer) -> cao::Result<()> + 'a>);
        let refused: [Edit; 6] = [
            (
                "an open mesh behind a new scale",
                Box::new(|r| r.set_clips(&[larger.clone(), open_mesh.clone()])),
            ),
            ("a radius that no ray has", Box::new(|r| r.set_setup(far))),
            ("no layers", Box::new(|r| r.set_setup(none))),
            ("values of another type", Box::new(|r| r.set_values([0; 3], &other_type))),
            ("values outside", Box::new(|r| r.set_values([u32::MAX, 0, 0], &inside))),
            ("an empty transfer function", Box::new(|r| r.set_transfer(nothing.clone()))),
        ];
        for (what, edit) in refused {
            let context = || format!("{}: {what}", method.name());
            scene.clips = vec![mesh()];
            renderer.set_clips(&scene.clips).unwrap();
            renderer.update(&mut |_| ()).unwrap();
            assert!(edit(&mut renderer).is_err(), "{} is refused", context());
            assert_as_fresh(&scene, &renderer, &scene.renderer(&gpu), &context);
            scene.edit_recorded(&mut random, &mut renderer);
            renderer.update(&mut |_| ()).unwrap();
            assert_as_fresh(&scene, &renderer, &scene.renderer(&gpu), &context);
        }
    }
    close(gpu);
}
