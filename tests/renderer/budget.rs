//! Updates that span frames: what is shown is complete at every time, it ends, and it ends where an update without a budget does.

use crate::scenes::{NAMES, Scene, assert_as_fresh, scene_up_to};
use cao::renderer::Renderer;
use cao::{Budget, Stale, Updated};
use cao_gpu::{Counts, Gpu, Timings};
use cao_measure::random::Random;
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Shape};
use cao_model::look::Look;
use cao_model::methods::Method;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_testing::*;
use std::collections::VecDeque;

const SIZE: [u32; 2] = [20, 16];

/// A frame that a host records and runs.
fn frame(gpu: &Gpu, renderer: &mut Renderer, budget: Budget) -> (Updated, Timings) {
    let mut rec = gpu.recorder("frame").unwrap();
    let updated = renderer.record_update_within(&mut rec, budget).unwrap();
    (updated, rec.submit_and_wait().unwrap())
}

fn bits(renderer: &Renderer) -> Vec<u32> {
    renderer.read_ambient().unwrap().into_iter().map(f32::to_bits).collect()
}

/// What pictures have of the scene itself, whatever the ambient volume holds: where half of the light is stopped. A ray's end, and so its
/// opacity, depends on its colour.
fn depths(renderer: &Renderer, scene: &Scene) -> Vec<u32> {
    let image = renderer.draw(&eyes(&scene.volume, 30.0), &Look::default(), SIZE).unwrap().0;
    image.depth.iter().flatten().map(|depth| depth.to_bits()).collect()
}

/// What happened in the frames of a scene.
#[derive(Debug, Default)]
struct Seen {
    /// Updates that took one frame, and more.
    whole: u32,
    spanned: u32,
    /// Frames that showed a volume that was not the newest scene's.
    behind: u32,
    /// Times that nothing was stale.
    settled: u32,
}

/// Any edits under any budgets, told late or never. After each frame V_AO is that of a state of the scene that an update took in, and never
/// an older one than before; what pictures show of anything else is the newest; what is settled is what a fresh renderer has.
fn frames(gpu: &Gpu, name: &str, method: Method, seed: u64, frames: usize) -> Seen {
    let mut random = Random::new(seed);
    let mut scene = scene_up_to(21, &mut random, name, method);
    // One renderer under budgets, and one that does everything at once.
    let make = || renderer_of(gpu, &scene.volume, scene.transfer.clone(), scene.setup, cao::renderer::COLOUR);
    let (mut renderer, mut at_once) = (make().unwrap(), make().unwrap());
    let mut told = VecDeque::new();
    let mut history = Vec::new();
    let mut found = Seen::default();
    // Before the first update has ended nothing is occluded. Then the volumes of the scenes that updates took in, the latest last.
    let mut volumes = vec![vec![1.0_f32.to_bits(); scene.volume.len()]];
    for number in 0..frames {
        let mut edited = number == 0;
        for _ in 0..[0, 0, 1, 1, 2][random.below(5) as usize] {
            // Another method takes a while to make: rarely.
            let kind = [0, 2, 4, 7, 8, 9][random.below(6) as usize];
            let kind = if random.below(40) == 0 { 6 } else { kind };
            let (mut again, mut same) = (scene.clone(), random.clone());
            again.edit_of(kind, &mut same, &mut at_once);
            let coloured = scene.setup.coloured();
            let edit = scene.edit_of(kind, &mut random, &mut renderer);
            edited = true;
            // Another method had its own volume, and so has light in colours.
            if edit.ends_with("and back") || scene.setup.coloured() != coloured {
                volumes = vec![vec![1.0_f32.to_bits(); scene.volume.len()]];
                told.clear();
            }
            history.push(edit);
        }
        if random.below(60) == 0 {
            renderer.invalidate();
            // What ran never ends.
            volumes.truncate(1);
            history.push("invalidate".into());
        }
        if edited {
            at_once.update(&mut |_| ()).unwrap();
        }
        let budget = match random.below(8) {
            0 => Budget::Bricks(u32::MAX),
            1 | 2 => Budget::Ms(random.between(0.1, 20.0)),
            3 | 4 => Budget::Bricks(1),
            _ => Budget::Bricks(1 + random.below(5) as u32),
        };
        let (updated, timings) = frame(gpu, &mut renderer, budget);
        if let Budget::Bricks(most) = budget {
            assert!(updated.bricks() <= most);
        }
        history.push(format!("{budget:?}"));
        let context = || {
            let last = &history[history.len().saturating_sub(6)..];
            format!("{} seed {seed} frame {number}: after {}", method.name(), last.join("; "))
        };
        if updated.opens() {
            volumes.push(bits(&at_once));
        }
        let now = bits(&renderer);
        let shown = volumes.iter().rposition(|volume| *volume == now);
        let Some(shown) = shown else {
            let newest = volumes.last().unwrap();
            let different = (0..now.len()).filter(|&i| now[i] != newest[i]).count();
            panic!("torn: {different} of {} voxels {}", now.len(), context());
        };
        // No way back.
        volumes.drain(..shown);
        assert!(volumes.len() <= 2, "{} volumes were skipped {}", volumes.len(), context());
        found.behind += u32::from(volumes.len() > 1);
        if updated.opens() {
            *if volumes.len() == 1 { &mut found.whole } else { &mut found.spanned } += 1;
        }
        if random.below(20) == 0 {
            assert!(depths(&renderer, &scene) == depths(&at_once, &scene), "picture {}", context());
        }
        // Times come up to three frames late, or not at all.
        if random.below(10) > 0 {
            told.push_back((number + random.below(4) as usize, updated, timings.total()));
        }
        while told.front().is_some_and(|(when, ..)| *when <= number) {
            let (_, updated, ms) = told.pop_front().unwrap();
            renderer.updated(&updated, ms).unwrap();
        }
        if renderer.stale().is_settled() {
            assert_eq!(renderer.stale(), Stale::default());
            assert!(bits(&renderer) == bits(&at_once), "settled {}", context());
            found.settled += 1;
            if random.below(96) == 0 {
                assert_as_fresh(&scene, &renderer, &scene.renderer(gpu), &context);
            }
        } else {
            assert!(renderer.stale().frames > 0);
            assert!(renderer.read_opacity().is_err() && cao::verify::verify(&renderer, &mut |_| ()).is_err());
        }
        // Without a budget what is left is done at once, on either way.
        if random.below(40) == 0 {
            match random.below(2) {
                0 => drop(renderer.update(&mut |_| ()).unwrap()),
                _ => run(gpu, |rec| renderer.record_update(rec).unwrap()),
            }
            volumes = vec![bits(&at_once)];
            told.clear();
            assert!(renderer.stale().is_settled() && bits(&renderer) == volumes[0], "all {}", context());
            history.push("all".into());
        }
    }
    // It settles.
    for _ in 0..60 {
        let (updated, timings) = frame(gpu, &mut renderer, Budget::Bricks(5));
        renderer.updated(&updated, timings.total()).unwrap();
    }
    assert_eq!(renderer.stale(), Stale::default());
    let context = || format!("{} seed {seed}, at the end", method.name());
    assert_as_fresh(&scene, &renderer, &scene.renderer(gpu), &context);
    found
}

/// 1,000 frames.
#[test]
fn no_frame_shows_a_torn_volume_and_what_settles_is_exact() {
    let gpu = open();
    for (case, method) in methods().enumerate() {
        let (count, [enough, often]) =
            if method == Method::default() { (500, [10, 40]) } else { (160, [3, 3]) };
        let name = NAMES[case % NAMES.len()];
        // In a volume of few bricks hardly an update of a quick method spans frames.
        let large = |seed: &u64| {
            let volume = scene_up_to(21, &mut Random::new(*seed), name, method).volume;
            volume.dims.iter().map(|d| d.div_ceil(8)).product::<usize>() >= 12
        };
        let seed = (91 + case as u64..).step_by(50).find(large).unwrap();
        let found = frames(&gpu, name, method, seed, count);
        // All of it happened.
        let Seen { whole, spanned, behind, settled } = found;
        let all = whole > enough && spanned > enough && behind > often && settled > 2 * enough;
        assert!(all, "{}: {found:?}", method.name());
    }
    close(gpu);
}

/// A renderer of a volume of bytes in which there is much to compute, up to date, and a clip that moves through it.
fn moving(gpu: &Gpu, method: Method) -> Renderer {
    let volume = builtin_box("engine", [40, 32, 36], [1.0; 3]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let mut setup = Setup::of(method, 1.0);
    setup.occlusion.radius_mm = 4.0;
    let mut renderer = renderer_of(gpu, &volume, transfer, setup, cao::renderer::COLOUR).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    renderer
}

fn clip(number: usize) -> Clip {
    let mut clip = Clip::remove(Shape::Sphere);
    clip.pose.scale = glam::Vec3::splat(9.0);
    clip.pose.translate_mm.x = number as f32 * 0.7 - 8.0;
    clip
}

fn second_volume(gpu: &Gpu) -> u64 {
    gpu.memory_report().iter().filter(|(name, _)| name == "ambient being built").map(|(_, bytes)| bytes).sum()
}

/// What a recording asks of Vulkan.
fn asked(gpu: &Gpu, record: impl FnOnce(&mut cao_gpu::Recorder)) -> Counts {
    let mut rec = gpu.recorder("frame").unwrap();
    record(&mut rec);
    let counts = rec.counts();
    rec.submit_and_wait().unwrap();
    counts
}

/// It is the update without a budget, command by command, with no other volume.
#[test]
fn a_budget_that_allows_all_changes_nothing() {
    let gpu = open();
    for method in methods() {
        let (mut within, mut whole) = (moving(&gpu, method), moving(&gpu, method));
        for number in 0..4 {
            for renderer in [&mut within, &mut whole] {
                renderer.set_clips(&[clip(number)]).unwrap();
            }
            let mut opens = false;
            let one = asked(&gpu, |rec| {
                opens = within.record_update_within(rec, Budget::Bricks(u32::MAX)).unwrap().opens();
            });
            let other = asked(&gpu, |rec| whole.record_update(rec).unwrap());
            assert_eq!((one, opens), (other, true), "{}", method.name());
            assert!(bits(&within) == bits(&whole) && within.stale().is_settled());
        }
        // Nothing changed, nothing runs.
        let nothing = asked(&gpu, |rec| drop(within.record_update_within(rec, Budget::Bricks(1)).unwrap()));
        assert_eq!(nothing.commands, 0);
        assert_eq!(second_volume(&gpu), 0);
    }
    close(gpu);
}

/// A clip that never stands still: updates end all the same, one after the other, and what they take of memory is given back.
#[test]
fn edits_in_every_frame_do_not_keep_an_update_from_its_end() {
    let gpu = open();
    for method in methods() {
        let mut renderer = moving(&gpu, method);
        let (mut opened, mut shown, mut lag) = (0, Vec::new(), 0);
        for number in 0..40 {
            renderer.set_clips(&[clip(number)]).unwrap();
            let (updated, timings) = frame(&gpu, &mut renderer, Budget::Bricks(30));
            opened += u32::from(updated.opens());
            renderer.updated(&updated, timings.total()).unwrap();
            lag = lag.max(renderer.stale().frames);
            shown.push(bits(&renderer));
        }
        shown.dedup();
        // The list is never longer than 5 · 4 · 5 bricks: four frames.
        let ended = shown.len() as u32;
        assert!(opened >= 10 && ended + 1 >= opened && ended <= opened + 1, "{ended} of {opened}");
        assert!(lag <= 8, "{}: {lag} frames behind", method.name());
        // A frame that opens an update and ends it is not behind.
        let mut calm = 0;
        while !renderer.stale().is_settled() {
            let (updated, timings) = frame(&gpu, &mut renderer, Budget::Bricks(30));
            renderer.updated(&updated, timings.total()).unwrap();
            calm += 1;
        }
        assert!(calm <= 8, "{}: {calm}", method.name());
        let voxel = match method {
            Method::FeatureDriven => 8,
            Method::Lao | Method::Cao => 4,
            _ => 2,
        };
        let (volume, bytes) = (40 * 32 * 36 * voxel, second_volume(&gpu));
        assert!((volume..2 * volume).contains(&bytes), "{}: {bytes} of {volume}", method.name());
        for _ in 0..90 {
            frame(&gpu, &mut renderer, Budget::Bricks(30));
        }
        assert_eq!(second_volume(&gpu), 0, "{}", method.name());
    }
    close(gpu);
}

/// A host that never tells has its update in the end, too: after as many slices as the volume has bricks for.
#[test]
fn an_update_ends_if_nobody_tells() {
    let gpu = open();
    for method in methods() {
        let mut renderer = moving(&gpu, method);
        renderer.set_clips(&[clip(3)]).unwrap();
        // 100 bricks.
        let mut frames = 0;
        while !renderer.stale().is_settled() {
            frame(&gpu, &mut renderer, Budget::Bricks(12));
            frames += 1;
            assert!(frames <= 9, "{}", method.name());
        }
        let mut whole = moving(&gpu, method);
        whole.set_clips(&[clip(3)]).unwrap();
        whole.update(&mut |_| ()).unwrap();
        assert!(frames == 9 && bits(&renderer) == bits(&whole), "{}: {frames}", method.name());
    }
    close(gpu);
}

#[test]
fn budgets_that_allow_nothing_and_settings_that_cannot_be_are_refused() {
    let gpu = open();
    for method in methods() {
        let mut renderer = moving(&gpu, method);
        renderer.set_clips(&[clip(1)]).unwrap();
        for budget in [Budget::Bricks(0), Budget::Ms(0.0), Budget::Ms(f32::NAN)] {
            run(&gpu, |rec| {
                let error = renderer.record_update_within(rec, budget).map(drop).unwrap_err().to_string();
                assert!(error.contains("budget"), "{error}");
            });
        }
        // Nothing was lost by that. While the update spans frames, settings wait, and those that are refused change nothing.
        let (updated, _) = frame(&gpu, &mut renderer, Budget::Bricks(1));
        assert!(updated.opens());
        let good = *renderer.setup();
        if method == Method::Rays {
            let mut long = good;
            long.occlusion.radius_mm = 1000.0;
            let error = renderer.set_setup(long).unwrap_err().to_string();
            assert!(error.contains("256"), "{error}");
            assert_eq!((*renderer.setup(), renderer.stale().waiting), (good, false));
        }
        let mut other = good;
        other.occlusion.radius_mm = 2.0;
        renderer.set_setup(other).unwrap();
        assert_eq!((*renderer.setup(), renderer.stale().waiting), (other, true));
        while !renderer.stale().is_settled() {
            let (updated, timings) = frame(&gpu, &mut renderer, Budget::Bricks(40));
            renderer.updated(&updated, timings.total()).unwrap();
        }
        let mut whole = moving(&gpu, method);
        whole.set_clips(&[clip(1)]).unwrap();
        whole.set_setup(other).unwrap();
        whole.update(&mut |_| ()).unwrap();
        assert!(bits(&renderer) == bits(&whole), "{}", method.name());
    }
    close(gpu);
}
