//! The kernel `clip_bricks`: what it says of a brick holds for every sample of its voxels, by its twin, and the
//! classification that trusts it is the same, bit for bit, as one that looks at every sample.

use crate::clipping::{Clipped, Kernels};
use cao::clip::clip_bricks::{ClipBricks, UNKNOWN};
use cao::field::features::FeatureSet;
use cao::field::volume_image;
use cao::renderer::{COLOUR, Renderer};
use cao_gpu::{Access, Buffer, Format, Gpu, Image};
use cao_measure::exactness;
use cao_measure::random::Random;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::feature::{Feature, Features};
use cao_model::methods::Method;
use cao_model::occlusion::Occlusion;
use cao_model::settings::{AntiAliasing, Estimator, MapSettings, Setup, Support};
use cao_testing::*;
use cao_twin as twin;
use cao_twin::Grid;
use cao_twin::clip::clip_bricks::{Brick, Share};
use cao_twin::clip::clips::{ClipField, Dilation, Maps};
use glam::Vec3;

const MAPS: MapSettings = MapSettings { resolution: 96, cells: 48, pairs: 4, literal: false };

const SUPPORTS: [Support; 2] = [Support::Voxel, Support::Neighbours];

/// Several bricks along each axis, the last of them cut short; equal and unequal spacing.
const LARGE: [Grid; 2] =
    [Grid { dims: [44, 33, 26], spacing: [1.0; 3] }, Grid { dims: [25, 40, 31], spacing: [1.25, 0.8, 1.0] }];

struct Bench<'a>(Kernels<'a>);

/// Clips on the device in front of a volume.
struct Scene {
    clipped: Clipped,
    full: Image,
    literal: bool,
}

#[derive(Debug, PartialEq)]
struct Found {
    opacity: Vec<u32>,
    mask: Vec<u8>,
    count: [u32; 3],
}

impl<'a> Bench<'a> {
    fn new(gpu: &'a Gpu) -> Self {
        Self(Kernels::new(gpu))
    }

    fn scene(
        &self,
        grid: &Grid,
        clips: &[Clip],
        radius_mm: f32,
        maps: MapSettings,
        support: Support,
    ) -> Scene {
        let occlusion = Occlusion { radius_mm, ..Occlusion::paper(grid.min_spacing()) };
        let mut clipped = self.0.clipped(grid, clips, &occlusion, maps, support);
        // Without zeros: what is hidden must be seen to be.
        let mut random = Random::new(1);
        let full: Vec<f32> = (0..grid.len()).map(|_| random.between(0.1, 1.0)).collect();
        let full = float_image(self.0.gpu, &clipped.field, &full);
        // An odd number of clips leaves every second voxel whole.
        if clips.len() % 2 == 1 {
            let list = vec![Feature { spared: true, ..Feature::new("spared") }];
            let labels = (0..grid.len()).map(|i| (i % 2) as u8).collect();
            let features = Features::by_labels(list, grid.dims, labels).unwrap();
            clipped.features = FeatureSet::new(self.0.gpu, &clipped.field, features).unwrap();
            run(self.0.gpu, |rec| clipped.features.record_table(rec, &clipped.field).unwrap());
        }
        Scene { clipped, full, literal: maps.literal }
    }

    fn bricks(&self, scene: &Scene) -> Buffer {
        let Clipped { field, set, reach, support, .. } = &scene.clipped;
        let words = ClipBricks::buffer(self.0.gpu, field).unwrap();
        run(self.0.gpu, |rec| self.0.clip_bricks.record(rec, field, set, *reach, *support, &words).unwrap());
        words
    }

    fn unknown(&self, scene: &Scene) -> Buffer {
        let words = ClipBricks::buffer(self.0.gpu, &scene.clipped.field).unwrap();
        run(self.0.gpu, |rec| rec.fill(&words, 0, words.bytes(), UNKNOWN).unwrap());
        words
    }

    fn classify(&self, scene: &Scene, words: &Buffer, samples: AntiAliasing) -> Found {
        let Kernels { gpu, classify, .. } = &self.0;
        let Scene { clipped: Clipped { field, features, set, reach, .. }, full, literal } = scene;
        let count = &classify.count;
        let opacity = volume_image(gpu, "opacity", field, Format::R32Float).unwrap();
        let mask = volume_image(gpu, "mask", field, Format::R8Uint).unwrap();
        run(gpu, |rec| {
            rec.discard(&opacity);
            rec.discard(&mask);
            rec.fill(count, 0, count.bytes(), 0).unwrap();
            rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::StorageWrite]);
            classify
                .record(rec, field, features, set, samples, *reach, *literal, words, full, &opacity, &mask)
                .unwrap();
        });
        Found {
            opacity: read_floats(gpu, &opacity).into_iter().map(f32::to_bits).collect(),
            mask: read_image(gpu, &mask),
            count: bytemuck::pod_read_unaligned(&read_buffer(gpu, count)),
        }
    }
}

/// What a word says; `Some` stands for "not known".
fn said(word: u32) -> Brick {
    Brick {
        visible: [Share::None, Share::Some, Share::All, Share::Some][word as usize & 3],
        affected: [Share::None, Share::Some, Share::All][word as usize >> 2 & 3],
    }
}

fn words(gpu: &Gpu, buffer: &Buffer) -> Vec<u32> {
    bytemuck::pod_collect_to_vec(&read_buffer(gpu, buffer))
}

/// Share of the bricks of which something holds that the bounds, those of a ball around the brick, do not see.
const LOOSE: f32 = 0.15;

#[test]
fn what_is_said_of_a_brick_holds_for_each_of_its_samples() {
    const SEED: u64 = 40;
    let gpu = open();
    let bench = Bench::new(&gpu);
    let mut random = Random::new(SEED);
    let (mut loose, mut bricks, mut decided) = (0, 0, [0; 6]);
    for grid in LARGE {
        for shape in Shape::ANALYTIC {
            for turn in 0..4 {
                let clips = [random_clip(&mut random, &shape, size_mm(&grid))];
                let radius = [0.0, 3.0][turn % 2];
                let how = AntiAliasing { support: SUPPORTS[turn / 2 % 2], ..AntiAliasing::N32 };
                let scene = bench.scene(&grid, &clips, radius, MAPS, how.support);
                let maps = Maps {
                    layers: 1,
                    resolution: 8,
                    dilation: Dilation::Conservative(8),
                    support: how.support,
                };
                let reach = Occlusion { radius_mm: radius, ..Occlusion::paper(grid.min_spacing()) };
                let twins = clips
                    .each_ref()
                    .map(|clip| ClipField::new(clip, &grid, reach.reach(grid.min_spacing()), &maps).unwrap());
                let truth = twin::clip::clip_bricks::clip_bricks(&grid, &twins, how);
                let found = words(&gpu, &bench.bricks(&scene));
                assert_eq!(found.len(), truth.len());
                for (brick, (&word, truth)) in found.iter().zip(&truth).enumerate() {
                    let said = said(word);
                    let context = format!("seed {SEED} {clips:?} brick {brick}: {said:?}, truth {truth:?}");
                    for (n, (said, truth)) in [(said.visible, truth.visible), (said.affected, truth.affected)]
                        .into_iter()
                        .enumerate()
                    {
                        assert!(said == Share::Some || said == truth, "{context}");
                        loose += usize::from(said != truth);
                        decided[3 * n + said as usize] += 1;
                        bricks += 1;
                    }
                }
            }
        }
    }
    assert!((loose as f32) < LOOSE * bricks as f32, "{loose} of {bricks} answers are not known");
    assert!(decided.iter().all(|&n| n > 20), "{decided:?}");
    drop(bench);
    close(gpu);
}

fn several(random: &mut Random, grid: &Grid, count: usize) -> Vec<Clip> {
    let all = shapes();
    (0..count)
        .map(|_| {
            let shape = &all[random.below(all.len() as u64) as usize];
            let mut clip = random_clip(random, shape, size_mm(grid));
            // Several kept shapes share hardly anything.
            if random.below(3) > 0 {
                clip.mode = Mode::Remove;
                clip.pose.scale *= 0.3;
            }
            clip
        })
        .collect()
}

/// Opacity, mask and counts; every shape and side, several clips at once, the poses that `cao verify` tries, the literal recipe.
#[test]
fn classification_by_bricks_is_the_same_bit_for_bit() {
    const SEED: u64 = 41;
    let gpu = open();
    let bench = Bench::new(&gpu);
    let mut random = Random::new(SEED);
    let mut cases: Vec<(Grid, Vec<Clip>, MapSettings)> = Vec::new();
    for grid in GRIDS.into_iter().chain(LARGE) {
        let volume = volume_of(&grid, vec![0.0; grid.len()]);
        let setup = Setup::of(Method::Cao, grid.min_spacing());
        let renderer = Renderer::new(&gpu, &volume, identity(), setup, COLOUR).unwrap();
        for shape in shapes() {
            cases.push((grid, vec![random_clip(&mut random, &shape, size_mm(&grid))], MAPS));
            let turn = random.below(5) as u32;
            let posed = exactness::random_clip(&mut random, &renderer, &shape, turn);
            cases.push((grid, vec![posed], MAPS));
        }
    }
    for count in [0, 2, 3, 5, Clip::MAX] {
        for grid in LARGE {
            cases.push((grid, several(&mut random, &grid, count), MAPS));
        }
    }
    for shape in [Shape::Mesh(convex()), Shape::Mesh(concave()), Shape::Sphere] {
        let clip = random_clip(&mut random, &shape, size_mm(&LARGE[0]));
        cases.push((LARGE[0], vec![clip], MapSettings { cells: 96, literal: true, ..MAPS }));
    }
    let (mut without_samples, mut bricks, mut categories) = (0, 0, [0; 3]);
    for (n, (grid, clips, maps)) in cases.iter().enumerate() {
        let samples = AntiAliasing {
            support: SUPPORTS[n % 2],
            estimator: [Estimator::Paper, Estimator::Interior][n / 2 % 2],
            ..[AntiAliasing::N32, AntiAliasing::N8, AntiAliasing::N0][n % 3]
        };
        let scene = bench.scene(grid, clips, [2.0, 5.0, 0.0][n / 3 % 3], *maps, samples.support);
        let by_bricks = bench.bricks(&scene);
        let (found, expected) = (
            bench.classify(&scene, &by_bricks, samples),
            bench.classify(&scene, &bench.unknown(&scene), samples),
        );
        assert!(found == expected, "seed {SEED} case {n} {:?} {clips:?} {samples:?}", grid.dims);
        let words = words(&gpu, &by_bricks);
        without_samples += words.iter().filter(|&&word| said(word).visible != Share::Some).count();
        bricks += words.len();
        (0..3).for_each(|c| categories[c] += found.count[c]);
    }
    assert!(2 * without_samples > bricks, "{without_samples} of {bricks} bricks take no samples");
    assert!(categories.iter().all(|&n| n > 1000), "{categories:?}");
    drop(bench);
    close(gpu);
}

/// Words of clips that are a voxel larger or smaller stand for bounds that are wrong by as much. Bounds have to be wrong where
/// they are tight, so not in every place.
#[test]
fn a_wrong_bound_is_caught() {
    const SEED: u64 = 42;
    let gpu = open();
    let bench = Bench::new(&gpu);
    let mut random = Random::new(SEED);
    let grid = LARGE[0];
    for shape in [Shape::Sphere, Shape::Box, Shape::Mesh(convex())] {
        let mut caught = [0; 2];
        for _ in 0..6 {
            let translate_mm = Vec3::from_array([(); 3].map(|()| random.between(-8.0, 8.0)));
            let clip = |scale: f32| {
                let pose = Pose { scale: Vec3::splat(scale), translate_mm, ..Pose::default() };
                [Clip { shape: shape.clone(), mode: Mode::Remove, pose }]
            };
            let scene = bench.scene(&grid, &clip(10.0), 2.0, MAPS, Support::Voxel);
            // A corner counts, so that bounds are wrong sooner.
            let how = AntiAliasing { estimator: Estimator::Paper, ..AntiAliasing::N8 };
            let right = bench.classify(&scene, &bench.unknown(&scene), how);
            assert!(bench.classify(&scene, &bench.bricks(&scene), how) == right);
            for (n, scale) in [9.0, 11.0].into_iter().enumerate() {
                let other = bench.scene(&grid, &clip(scale), 2.0, MAPS, Support::Voxel);
                let wrong = bench.classify(&scene, &bench.bricks(&other), how);
                caught[n] += usize::from(wrong != right);
            }
        }
        assert!(caught.iter().all(|&n| n > 0), "{} {caught:?}", shape.name());
    }
    drop(bench);
    close(gpu);
}
