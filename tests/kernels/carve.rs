//! The kernel `carve` against `classify`, which is held to its twin, and against its own: opacity in place, where it lies, what
//! changed.

use cao::clip::carve::{Bindings, Carve};
use cao::clip::classify::Classify;
use cao::clip::clip_bricks::ClipBricks;
use cao::clip::clips::ClipSet;
use cao::clip::dilate::Dilate;
use cao::clip::peel::Peel;
use cao::clip::solid::Solids;
use cao::field::Field;
use cao::field::bricks::BrickList;
use cao::field::features::{Classes, FeatureSet};
use cao::field::near::FAR;
use cao::field::occupancy::Occupancy;
use cao::field::opacity::Opacity;
use cao::field::transfer::TransferBuffer;
use cao::field::volume_image;
use cao_gpu::{Access, Buffer, Format, Gpu, Image};
use cao_measure::random::Random;
use cao_model::clip::Clip;
use cao_model::feature::{Feature, Features};
use cao_model::settings::{AntiAliasing, Estimator, MapSettings, Support};
use cao_model::transfer::TransferFunction;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::clip::carve::{changed, contact, stored};

const MAPS: MapSettings = MapSettings { resolution: 128, cells: 32, pairs: 4, literal: false };

/// Of a clip's change for `classify`: farther than any clip sample of a voxel, 1.025 of its diagonal.
const REACH: f32 = 2.0;

struct Bench<'a> {
    gpu: &'a Gpu,
    field: Field,
    set: ClipSet,
    solids: Solids,
    half_mm: f32,
    function: TransferFunction,
    transfer: TransferBuffer,
    features: FeatureSet,
    words: [Buffer; 3],
    occupancy: Buffer,
    contact: Buffer,
    change: Buffer,
    list: BrickList,
    opacity: Image,
    full: Image,
    clipped: Image,
    mask: Image,
}

impl<'a> Bench<'a> {
    fn new(gpu: &'a Gpu, grid: &Grid, values: Vec<f32>) -> Self {
        let field = Field::upload(gpu, &volume_of(grid, values)).unwrap();
        let zeros = |name| buffer(gpu, name, &vec![0; 4 * field.brick_count() as usize]);
        let image = |name, format| {
            let image = volume_image(gpu, name, &field, format).unwrap();
            let bytes = grid.len() * format.bytes() as usize;
            write_image(gpu, &image, &vec![0; bytes]);
            image
        };
        Self {
            set: ClipSet::new(gpu).unwrap(),
            solids: Solids::none(gpu).unwrap(),
            half_mm: 0.5 * size_mm(grid).length(),
            function: identity(),
            transfer: TransferBuffer::new(gpu).unwrap(),
            features: FeatureSet::new(gpu, &field, Features::NONE).unwrap(),
            words: [zeros("now"), zeros("before"), zeros("for classify")],
            occupancy: zeros("occupancy"),
            contact: zeros("contact"),
            change: zeros("change"),
            list: BrickList::new(gpu, &field).unwrap(),
            opacity: image("opacity", Format::R16Unorm),
            full: image("full", Format::R32Float),
            clipped: image("clipped", Format::R32Float),
            mask: image("mask", Format::R8Uint),
            gpu,
            field,
        }
    }

    /// Runs both kernels; `transfer` only where it changed.
    fn run(
        &mut self,
        kernels: &Kernels,
        transfer: Option<&TransferFunction>,
        clips: &[Clip],
        samples: AntiAliasing,
    ) {
        let Kernels { classify, clip_bricks, carve, opacity, occupancy, peel, dilate, classes } = kernels;
        if let Some(transfer) = transfer {
            self.function = transfer.clone();
        }
        let (field, by) = self.features.opacities().unwrap_or((&self.field, &self.transfer));
        self.set = self.set.planned(self.gpu, clips, Some(REACH), self.half_mm, MAPS).unwrap();
        self.set.make(self.gpu, peel, dilate).unwrap();
        let between = [Access::StorageRead, Access::StorageWrite, Access::SampledRead];
        let support = samples.support;
        run(self.gpu, |rec| {
            let count = &classify.count;
            rec.fill(count, 0, count.bytes(), 0).unwrap();
            rec.fill(&self.change, 0, self.change.bytes(), FAR).unwrap();
            if let Some(transfer) = transfer {
                self.transfer.record(rec, transfer).unwrap();
                self.features.record(rec, classes, &self.field, transfer, &self.transfer).unwrap();
                occupancy.record(rec, field, by, &self.features, &self.occupancy).unwrap();
            }
            opacity.record(rec, field, by, &self.full).unwrap();
            self.set.record(rec, clips, self.half_mm).unwrap();
            clip_bricks.record(rec, &self.field, &self.set, 0.0, support, &self.words[0]).unwrap();
            clip_bricks.record(rec, &self.field, &self.set, REACH, support, &self.words[2]).unwrap();
            rec.barrier(&[Access::StorageWrite, Access::TransferWrite], &between);
            let b = Bindings {
                transfer: by,
                features: &self.features,
                clips: &self.set,
                solids: &self.solids,
                clip_bricks: &self.words[0],
                clip_bricks_before: &self.words[1],
                occupancy: &self.occupancy,
                contact: &self.contact,
                change: &self.change,
                list: &self.list,
                opacity: &self.opacity,
            };
            carve.record(rec, field, samples, transfer.is_some(), b).unwrap();
            let (set, words, features) = (&self.set, &self.words[2], &self.features);
            let (full, clipped, mask) = (&self.full, &self.clipped, &self.mask);
            classify
                .record(rec, field, features, set, samples, REACH, false, words, full, clipped, mask)
                .unwrap();
        });
    }

    fn opacity(&self) -> Vec<u16> {
        bytemuck::pod_collect_to_vec(&read_image(self.gpu, &self.opacity))
    }
}

struct Kernels {
    classify: Classify,
    clip_bricks: ClipBricks,
    carve: Carve,
    opacity: Opacity,
    occupancy: Occupancy,
    peel: Peel,
    dilate: Dilate,
    classes: Classes,
}

impl Kernels {
    fn new(gpu: &Gpu) -> Self {
        Self {
            classify: Classify::new(gpu).unwrap(),
            clip_bricks: ClipBricks::new(gpu).unwrap(),
            carve: Carve::new(gpu).unwrap(),
            opacity: Opacity::new(gpu).unwrap(),
            occupancy: Occupancy::new(gpu).unwrap(),
            peel: Peel::new(gpu).unwrap(),
            dilate: Dilate::new(gpu).unwrap(),
            classes: Classes::new(gpu).unwrap(),
        }
    }
}

#[test]
fn opacity_in_place_equals_classification_after_every_edit_and_changes_are_found() {
    let gpu = open();
    let kernels = Kernels::new(&gpu);
    let mut random = Random::new(71);
    let shapes = shapes();
    let (mut bricks_changed, mut bricks_kept) = (0, 0);
    for grid in
        [Grid { dims: [41, 30, 19], spacing: [1.0, 0.8, 1.3] }, Grid { dims: [9, 1, 33], spacing: [1.0; 3] }]
    {
        let values = opacities(&mut random, &grid, 1.0);
        let mut bench = Bench::new(&gpu, &grid, values);
        let mut before = bench.opacity();
        for step in 0..40 {
            // From the middle on some voxels are of features, some of which are hidden, weaker or spared by clips.
            if step >= 20 && step % 10 == 0 {
                let mut feature = |k: usize| Feature {
                    visible: random.below(4) > 0,
                    scale: random.between(0.2, 2.0),
                    spared: (step / 10 + k).is_multiple_of(2),
                    ..Feature::new(k.to_string())
                };
                let list = (0..3).map(&mut feature).collect();
                let labels = (0..grid.len()).map(|_| random.below(4) as u8).collect();
                let features = Features::by_labels(list, grid.dims, labels).unwrap();
                bench.features = FeatureSet::new(&gpu, &bench.field, features).unwrap();
            }
            let transfer = (step % 5 == 0).then(|| {
                let (low, top) = (random.between(0.0, 0.7), random.between(0.2, 1.0));
                TransferFunction::new(vec![[low, 0.0], [low + 0.2, top]], vec![[0.0, 1.0, 1.0, 1.0]], None)
                    .unwrap()
            });
            let clips: Vec<Clip> = (0..random.below(4))
                .map(|_| {
                    let shape = &shapes[random.below(shapes.len() as u64) as usize];
                    random_clip(&mut random, shape, size_mm(&grid))
                })
                .collect();
            let samples = AntiAliasing {
                support: [Support::Voxel, Support::Neighbours][step / 2 % 2],
                estimator: [Estimator::Paper, Estimator::Interior][step / 4 % 2],
                ..[AntiAliasing::N0, AntiAliasing::N8, AntiAliasing::N32][step % 3]
            };
            bench.run(&kernels, transfer.as_ref(), &clips, samples);
            let after = bench.opacity();
            for (i, expected) in read_floats(&gpu, &bench.clipped).into_iter().enumerate() {
                // Both kernels run the same functions; only a half of 1/65535 may round to either side.
                let difference = (f64::from(expected) * 65535.0 - f64::from(after[i])).abs();
                assert!(difference <= 0.5 + 1e-2, "step {step} {:?}: {difference}, {clips:?}", grid.voxel(i));
            }
            let bits: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &bench.contact));
            assert_eq!(bits, contact(&grid, &after), "step {step}");
            let found: Vec<f32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &bench.change));
            let expected = changed(&grid, &before, &after);
            assert!(found.iter().zip(&expected).all(|(d, changed)| (*d == 0.0) == *changed), "step {step}");
            bricks_changed += expected.iter().filter(|changed| **changed).count();
            bricks_kept += expected.iter().filter(|changed| !**changed).count();
            before = after;
        }
    }
    assert!(bricks_changed > 200 && bricks_kept > 200, "{bricks_changed} {bricks_kept}");
    assert_eq!(stored(1.0), 65535);
    drop(kernels);
    close(gpu);
}
