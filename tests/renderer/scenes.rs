//! Scenes that change at random, and what a renderer made for the last state of one shows.

use cao::renderer::{COLOUR, Renderer};
use cao_gpu::Gpu;
use cao_measure::random::Random;
use cao_model::builtin::builtin_box;
use cao_model::clip::Clip;
use cao_model::feature::{Feature, Features};
use cao_model::light::AmbientLight;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, RaySet};
use cao_model::options::Options;
use cao_model::settings::{AntiAliasing, Estimator, MapSettings, Scope, Setup, Support};
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
        occlusion: Occlusion { rays, quadrature, radius_mm, ..Occlusion::paper(1.0) },
        method,
        options: Options::DEFAULT,
        scope: Scope::Needed,
        anti_aliasing: AntiAliasing::N32,
        maps: MAPS,
    }
}

/// Kinds of edits.
const KINDS: u64 = 12;

/// A scene as an engine holds it, so that a renderer can be made for it anew.
#[derive(Clone)]
pub struct Scene {
    pub volume: Volume,
    pub transfer: TransferFunction,
    pub setup: Setup,
    pub clips: Vec<Clip>,
    pub features: Features,
}

impl Scene {
    pub fn renderer(&self, gpu: &Gpu) -> Renderer {
        let mut renderer = renderer_of(gpu, &self.volume, self.transfer.clone(), self.setup, COLOUR).unwrap();
        renderer.set_clips(&self.clips).unwrap();
        renderer.set_features(self.features.clone()).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        renderer
    }

    /// One edit, done to the scene and to the renderer.
    pub fn edit(&mut self, random: &mut Random, renderer: &mut Renderer) -> String {
        let kind = random.below(KINDS);
        self.edit_of(kind, random, renderer)
    }

    /// One that never uses the queue, unless a clip mesh is new.
    pub fn edit_recorded(&mut self, random: &mut Random, renderer: &mut Renderer) -> String {
        let kind = [0, 2, 7, 10][random.below(4) as usize];
        self.edit_of(kind, random, renderer)
    }

    /// One whose kind is a number below [`KINDS`]; some of 6 are another method and back, which makes that method.
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
                if next.method.entry().options.contains(&"combine") && random.below(2) == 0 {
                    let rule = ["own", "neighbours", "max", "sample"][pick(random, 4)];
                    next.options.set("combine", rule).unwrap();
                }
                if next.method.entry().options.contains(&"bleeding") && random.below(2) == 0 {
                    next.options.set("bleeding", ["0", "0.7"][pick(random, 2)]).unwrap();
                }
                if next.method.entry().options.contains(&"grid") && random.below(2) == 0 {
                    next.options.set("grid", ["whole", "tiles"][pick(random, 2)]).unwrap();
                }
                if next.method.entry().options.contains(&"levels") && random.below(2) == 0 {
                    let form = ["nbuffer", "mip", "mixed:1", "reversed:2"][pick(random, 4)];
                    next.options.set("levels", form).unwrap();
                    next.options.set("normal", ["0", "1.3"][pick(random, 2)]).unwrap();
                }
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
                        next.occlusion.light = next.occlusion.light.turned(third_turn());
                    }
                    2 => {
                        let share = random.between(0.0, 0.9) * smallest;
                        next.occlusion.offset_mm = [None, Some(share)][pick(random, 2)];
                        let step = random.between(0.5, 3.0) * smallest;
                        next.occlusion.step_mm = [None, Some(step)][pick(random, 2)];
                    }
                    3 => next.scope = [Scope::All, Scope::Needed][pick(random, 2)],
                    _ => {
                        next.anti_aliasing = AntiAliasing {
                            support: [Support::Voxel, Support::Neighbours][pick(random, 2)],
                            estimator: [Estimator::Paper, Estimator::Interior][pick(random, 2)],
                            ..[AntiAliasing::N0, AntiAliasing::N8, AntiAliasing::N32][pick(random, 3)]
                        };
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
                    occlusion: Occlusion {
                        rays,
                        quadrature,
                        light: AmbientLight::Uniform,
                        ..self.setup.occlusion
                    },
                    options: Options::DEFAULT,
                    ..self.setup
                };
                renderer.set_setup(other).unwrap();
                renderer.update(&mut |_| ()).unwrap();
                renderer.set_setup(self.setup).unwrap();
                format!("{} and back", method.name())
            }
            // How a feature is shown; where there is none, nothing changes.
            10 => {
                let count = self.features.list.len();
                if count > 0 {
                    let feature = &mut self.features.list[pick(random, count)];
                    match random.below(3) {
                        0 => feature.visible = !feature.visible,
                        1 => feature.scale = random.between(0.0, 2.0),
                        _ => feature.spared = !feature.spared,
                    }
                }
                renderer.set_features(self.features.clone()).unwrap();
                format!("{:?}", self.features.list)
            }
            // Other features: none, by intervals, or of boxes of voxels.
            11 => {
                let count = 1 + pick(random, Features::MOST);
                let list = (0..count).map(|k| Feature { spared: k % 3 == 0, ..Feature::new(k.to_string()) });
                let step = 256.0 / count as f32;
                let interval = |k: usize| [k as f32 * step, (k as f32 + 0.9) * step];
                self.features = match random.below(4) {
                    0 => Features::NONE,
                    1 | 2 => Features::by_intervals(list.zip((0..).map(interval)).collect()).unwrap(),
                    _ => {
                        let dims = self.volume.dims;
                        let grid = grid_of(&self.volume);
                        let label = |i| grid.voxel(i).iter().map(|c| c / 5).sum::<usize>() % (count + 1);
                        let labels = (0..self.volume.len()).map(|i| label(i) as u8).collect();
                        Features::by_labels(list.collect(), dims, labels).unwrap()
                    }
                };
                renderer.set_features(self.features.clone()).unwrap();
                format!("{} features", self.features.list.len())
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
    Scene {
        volume,
        transfer,
        setup: setup(method, RaySet::W14, radius),
        clips: Vec::new(),
        features: Features::NONE,
    }
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
