//! Updates are exact (method.md §5), whatever the method: after any sequence of edits V_AO equals a full computation bit for bit, V_o
//! and V_AO equal those of a renderer that was made for the last state only, and so do frames that a host records.

use cao::renderer::{COLOUR, Renderer};
use cao_gpu::{Access, BufferUse, Format, Gpu, ImageDesc, ImageKind, ImageUse};
use cao_measure::random::Random;
use cao_model::builtin::builtin_box;
use cao_model::clip::Clip;
use cao_model::look::Look;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, RaySet};
use cao_model::settings::AntiAliasing;
use cao_model::settings::MapSettings;
use cao_model::settings::Scope;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::volume::Volume;
use cao_testing::*;

const MAPS: MapSettings = MapSettings { resolution: 128, cells: 64, pairs: 4, literal: false };

fn setup(method: Method, rays: RaySet, radius_mm: f32) -> Setup {
    let quadrature = method.quadrature();
    Setup {
        occlusion: Occlusion { rays, quadrature, radius_mm, offset_mm: None, step_mm: None },
        method,
        scope: Scope::Needed,
        anti_aliasing: AntiAliasing::N32,
        maps: MAPS,
    }
}

/// A scene as an engine holds it, so that a renderer can be made for it anew.
struct Scene {
    volume: Volume,
    transfer: TransferFunction,
    setup: Setup,
    clips: Vec<Clip>,
}

impl Scene {
    fn renderer(&self, gpu: &Gpu) -> Renderer {
        let mut renderer =
            Renderer::new(gpu, &self.volume, self.transfer.clone(), self.setup, COLOUR).unwrap();
        renderer.set_clips(&self.clips).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        renderer
    }

    /// One edit, done to the scene and to the renderer.
    fn edit(&mut self, random: &mut Random, renderer: &mut Renderer) -> String {
        let kind = random.below(10);
        self.edit_of(kind, random, renderer)
    }

    /// One that a host makes between recorded frames.
    fn edit_recorded(&mut self, random: &mut Random, renderer: &mut Renderer) -> String {
        // All but new values and another method, which use the queue and run a frame of their own.
        let kind = [0, 2, 3, 7, 7, 7][random.below(6) as usize];
        self.edit_of(kind, random, renderer)
    }

    fn edit_of(&mut self, kind: u64, random: &mut Random, renderer: &mut Renderer) -> String {
        let pick = |random: &mut Random, n: usize| random.below(n as u64) as usize;
        match kind {
            // The transfer function, as a ramp or as labels of which some are shown.
            0 | 1 => {
                let opacity = if random.below(2) == 0 {
                    let first = random.between(0.0, 150.0);
                    vec![[first, 0.0], [first + 60.0, random.between(0.1, 1.0)], [600.0, 1.0]]
                } else {
                    let shown = |random: &mut Random| [0.0, 0.0, 0.4, 1.0][pick(random, 4)];
                    let mut points = vec![[10.0, 0.0]];
                    for label in 0..4 {
                        let (from, a) = (10.0 + 60.0 * label as f32, shown(random));
                        points.extend([[from, a], [from + 60.0, a]]);
                    }
                    points
                };
                let reference = [None, Some(random.between(0.5, 3.0))][pick(random, 2)];
                self.transfer =
                    TransferFunction::new(opacity, vec![[0.0, 1.0, 0.9, 0.8]], reference).unwrap();
                renderer.set_transfer(self.transfer.clone()).unwrap();
                format!("{:?}", self.transfer.opacity)
            }
            2 | 3 => {
                let smallest = self.volume.min_spacing() as f32;
                let next = &mut self.setup;
                match random.below(5) {
                    0 => next.occlusion.radius_mm = random.between(0.0, 18.0) * smallest,
                    1 => {
                        let sets = [RaySet::R6, RaySet::W14, RaySet::W26, RaySet::Spiral(20)];
                        next.occlusion.rays = sets[pick(random, 4)];
                        let rules = next.method.entry().quadratures;
                        next.occlusion.quadrature = rules[pick(random, rules.len())];
                    }
                    2 => {
                        let share = random.between(0.0, 0.9) * smallest;
                        next.occlusion.offset_mm = [None, Some(share)][pick(random, 2)];
                        let step = random.between(0.5, 3.0) * smallest;
                        next.occlusion.step_mm = [None, Some(step)][pick(random, 2)];
                    }
                    3 => next.scope = [Scope::All, Scope::Needed][pick(random, 2)],
                    _ => {
                        next.anti_aliasing =
                            [AntiAliasing::N0, AntiAliasing::N8, AntiAliasing::N32][pick(random, 3)];
                    }
                }
                renderer.set_setup(self.setup).unwrap();
                format!("{:?}", self.setup)
            }
            // New data in a box.
            4 | 5 => {
                let first: [usize; 3] = self.volume.dims.map(|d| pick(random, d));
                let size: [usize; 3] =
                    std::array::from_fn(|i| 1 + pick(random, self.volume.dims[i] - first[i]));
                let value = [0, random.below(256) as u8][pick(random, 2)];
                let Values::U8(values) = &mut self.volume.values else { panic!("bytes") };
                let [x, y, _] = self.volume.dims;
                for k in 0..size[2] {
                    for j in 0..size[1] {
                        let at = ((first[2] + k) * y + first[1] + j) * x + first[0];
                        values[at..at + size[0]].fill(value);
                    }
                }
                let part = Values::U8(vec![value; size.iter().product()]);
                let part = Volume::new(size, self.volume.spacing, part).unwrap();
                renderer.set_values(first.map(|f| f as u32), &part).unwrap();
                format!("{value} in {size:?} at {first:?}")
            }
            // Another method and back: nothing of it may be left.
            6 if random.below(4) == 0 => {
                let others: Vec<_> = methods().filter(|method| *method != self.setup.method).collect();
                let method = others[pick(random, others.len())];
                let quadrature = method.quadrature();
                let other = Setup {
                    method,
                    occlusion: Occlusion { quadrature, ..self.setup.occlusion },
                    ..self.setup
                };
                renderer.set_setup(other).unwrap();
                renderer.update(&mut |_| ()).unwrap();
                renderer.set_setup(self.setup).unwrap();
                format!("{} and back", method.name())
            }
            _ => {
                let (shapes, size) = (shapes(), size_mm(&grid_of(&self.volume)));
                let count = [0, 1, 1, 1, 2, 3, 5][pick(random, 7)];
                // Often the same clips, moved a little.
                if count == self.clips.len() && random.below(2) == 0 {
                    let step = self.volume.min_spacing() as f32;
                    for clip in &mut self.clips {
                        clip.pose.translate_mm += glam::Vec3::splat(random.between(-step, step));
                    }
                } else {
                    self.clips = (0..count)
                        .map(|_| {
                            let shape = &shapes[pick(random, shapes.len())];
                            random_clip(random, shape, size)
                        })
                        .collect();
                }
                renderer.set_clips(&self.clips).unwrap();
                format!("{} clips", self.clips.len())
            }
        }
    }
}

fn scene(random: &mut Random, name: &str, method: Method) -> Scene {
    let dims = std::array::from_fn(|_| 9 + random.below(30) as usize);
    let spacing = match random.below(2) {
        0 => [1.0; 3],
        _ => std::array::from_fn(|_| f64::from(random.between(0.4, 2.0))),
    };
    let volume = builtin_box(name, dims, spacing).unwrap();
    // As bytes, so that boxes can be overwritten and labels told apart.
    let (low, high) = volume.range();
    let bytes = (0..volume.len()).map(|i| ((volume.value(i) - low) / (high - low) * 255.0) as u8).collect();
    let volume = Volume::new(dims, spacing, Values::U8(bytes)).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let radius = 4.0 * volume.min_spacing() as f32;
    Scene { volume, transfer, setup: setup(method, RaySet::W14, radius), clips: Vec::new() }
}

/// Ambient factors of every voxel that a sample with opacity can touch, and all opacities, are those of a renderer made for this state.
fn assert_as_fresh(gpu: &Gpu, scene: &Scene, renderer: &Renderer, context: &dyn Fn() -> String) {
    let fresh = scene.renderer(gpu);
    let (opacity, ambient) = (renderer.read_opacity().unwrap(), renderer.read_ambient().unwrap());
    assert!(opacity == fresh.read_opacity().unwrap(), "opacity {}", context());
    let (grid, expected) = (grid_of(&scene.volume), fresh.read_ambient().unwrap());
    for i in 0..grid.len() {
        let needed = opacity[i] > 0.0 || grid.neighbours(grid.voxel(i)).any(|n| opacity[grid.index(n)] > 0.0);
        assert!(
            !needed || ambient[i].to_bits() == expected[i].to_bits(),
            "{:?}: {} {} {}",
            grid.voxel(i),
            ambient[i],
            expected[i],
            context()
        );
    }
}

/// The history of one scene; voxels compared and recomputed.
fn history(gpu: &Gpu, name: &str, method: Method, seed: u64, steps: usize) -> (u64, u64) {
    let mut random = Random::new(seed);
    let mut scene = scene(&mut random, name, method);
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
            assert_as_fresh(gpu, &scene, &renderer, &context);
        }
    }
    (compared, recomputed)
}

const NAMES: [&str; 3] = ["engine", "fruit", "skeleton"];

#[test]
fn updates_equal_a_full_computation_after_any_sequence_of_edits() {
    const SEED: u64 = 61;
    const STEPS: usize = 200;
    let gpu = open();
    for (case, name) in NAMES.into_iter().enumerate() {
        let (compared, recomputed) = history(&gpu, name, Method::default(), SEED + case as u64, STEPS);
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
        let (compared, _) = history(&gpu, NAMES[case % NAMES.len()], method, 71 + case as u64, STEPS);
        assert!(compared > 20_000, "{}: {compared}", method.name());
    }
    close(gpu);
}

/// Frames as a host records them, one command buffer each, never through the own queue: any kind may follow any other, and what they
/// leave is what a fresh renderer makes, to the bit.
#[test]
fn any_sequence_of_recorded_frames_is_that_of_a_fresh_renderer() {
    const FRAMES: usize = 48;
    let gpu = open();
    for (case, method) in methods().enumerate() {
        let seed = 81 + case as u64;
        let mut random = Random::new(seed);
        let mut scene = scene(&mut random, NAMES[case % NAMES.len()], method);
        let mut renderer =
            Renderer::new(&gpu, &scene.volume, scene.transfer.clone(), scene.setup, COLOUR).unwrap();
        let size = [24, 20];
        let views = eyes(&scene.volume, 30.0);
        let look = Look { jitter: false, ..Look::default() };
        let target = |format| {
            let (dims, usage) = ([size[0], size[1], 1], ImageUse::ATTACHMENT | ImageUse::SAMPLED);
            gpu.image("target", &ImageDesc { dims, layers: 2, format, kind: ImageKind::D2, usage }).unwrap()
        };
        let (colour, depth) = (target(COLOUR), target(Format::D32Float));
        let bytes = u64::from(size[0] * size[1]) * 16;
        let back = gpu.buffer("back", bytes, BufferUse::Readback).unwrap();
        let mut history = Vec::new();
        for frame in 0..FRAMES {
            history.push(match random.below(6) {
                0 => "nothing".into(),
                1 => {
                    renderer.invalidate();
                    "invalidate".into()
                }
                _ => scene.edit_recorded(&mut random, &mut renderer),
            });
            let context = || {
                let last = &history[history.len().saturating_sub(3)..];
                format!("{} seed {seed} frame {frame}: after {}", method.name(), last.join("; "))
            };
            run(&gpu, |rec| {
                renderer.record_update(rec).unwrap_or_else(|error| panic!("{error}; {}", context()));
                rec.discard(&colour);
                rec.discard(&depth);
                rec.barrier(&[], &[Access::AttachmentWrite]);
                renderer.record_draw(rec, &views, &look, &colour, &depth, size).unwrap();
                rec.barrier(&[Access::AttachmentWrite], &[Access::TransferRead]);
                rec.copy_image_to_buffer(&colour, 1, [0; 3], [size[0], size[1], 1], &back, 0).unwrap();
                rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
            });
            if frame % 6 == 0 {
                assert_as_fresh(&gpu, &scene, &renderer, &context);
                let (drawn, _) = scene.renderer(&gpu).draw(&views, &look, size).unwrap();
                let pixels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&back.read(0, bytes).unwrap());
                assert!(pixels == drawn.colour[1], "picture {}", context());
            }
        }
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
