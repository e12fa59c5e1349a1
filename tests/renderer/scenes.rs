//! Scenes that change at random, and what a renderer made for the last state of one shows.

use cao::renderer::{COLOUR, Renderer};
use cao_gpu::Gpu;
use cao_measure::random::Random;
use cao_model::builtin::builtin_box;
use cao_model::clip::Clip;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, RaySet};
use cao_model::options::Options;
use cao_model::settings::{AntiAliasing, MapSettings, Scope, Setup};
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::volume::Volume;
use cao_testing::*;

/// Volumes to make scenes of.
pub const NAMES: [&str; 3] = ["engine", "fruit", "skeleton"];

const MAPS: MapSettings = MapSettings { resolution: 128, cells: 64, pairs: 4, literal: false };

fn setup(method: Method, rays: RaySet, radius_mm: f32) -> Setup {
    let (rays, quadrature) = (method.rays_like(rays), method.quadrature());
    Setup {
        occlusion: Occlusion { rays, quadrature, radius_mm, offset_mm: None, step_mm: None },
        method,
        options: Options::DEFAULT,
        scope: Scope::Needed,
        anti_aliasing: AntiAliasing::N32,
        maps: MAPS,
    }
}

/// A scene as an engine holds it, so that a renderer can be made for it anew.
#[derive(Clone)]
pub struct Scene {
    pub volume: Volume,
    pub transfer: TransferFunction,
    pub setup: Setup,
    pub clips: Vec<Clip>,
}

impl Scene {
    pub fn renderer(&self, gpu: &Gpu) -> Renderer {
        let mut renderer =
            Renderer::new(gpu, &self.volume, self.transfer.clone(), self.setup, COLOUR).unwrap();
        renderer.set_clips(&self.clips).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        renderer
    }

    /// One edit, done to the scene and to the renderer.
    pub fn edit(&mut self, random: &mut Random, renderer: &mut Renderer) -> String {
        let kind = random.below(10);
        self.edit_of(kind, random, renderer)
    }

    /// One that never uses the queue, unless a clip mesh is new.
    pub fn edit_recorded(&mut self, random: &mut Random, renderer: &mut Renderer) -> String {
        let kind = [0, 2, 7][random.below(3) as usize];
        self.edit_of(kind, random, renderer)
    }

    /// One whose kind is a number below 10; some of 6 are another method and back, which makes that method.
    pub fn edit_of(&mut self, kind: u64, random: &mut Random, renderer: &mut Renderer) -> String {
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
                    0 => {
                        let radius = [0.0, random.between(0.0, 18.0), random.between(18.0, 60.0)];
                        next.occlusion.radius_mm = radius[[0, 1, 1, 2][pick(random, 4)]] * smallest;
                    }
                    1 => {
                        let sets = [RaySet::R6, RaySet::W14, RaySet::W26, RaySet::Spiral(20)];
                        next.occlusion.rays = next.method.rays_like(sets[pick(random, 4)]);
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
                let (rays, quadrature) = (method.rays_like(self.setup.occlusion.rays), method.quadrature());
                let other = Setup {
                    method,
                    occlusion: Occlusion { rays, quadrature, ..self.setup.occlusion },
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

/// A scene of its own size and spacing, without clips.
pub fn scene(random: &mut Random, name: &str, method: Method) -> Scene {
    scene_up_to(39, random, name, method)
}

/// The same with fewer voxels than this along each edge.
pub fn scene_up_to(edge: u64, random: &mut Random, name: &str, method: Method) -> Scene {
    let dims = std::array::from_fn(|_| 9 + random.below(edge - 9) as usize);
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

/// All opacities and ambient factors are those of a renderer made for this state, to the bit.
pub fn assert_as_fresh(scene: &Scene, renderer: &Renderer, fresh: &Renderer, context: &dyn Fn() -> String) {
    assert!(renderer.read_opacity().unwrap() == fresh.read_opacity().unwrap(), "opacity {}", context());
    let (found, expected) = (renderer.read_ambient().unwrap(), fresh.read_ambient().unwrap());
    let different = (0..found.len()).find(|&i| found[i].to_bits() != expected[i].to_bits());
    let said = different.map(|i| {
        format!(
            "{:?}: {} instead of {} {}",
            grid_of(&scene.volume).voxel(i),
            found[i],
            expected[i],
            context()
        )
    });
    assert_eq!(said, None);
}
