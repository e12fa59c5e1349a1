//! The kernel `occupancy` against its twin.

use cao::field::Field;
use cao::field::features::{Classes, FeatureSet};
use cao::field::occupancy::Occupancy;
use cao::field::transfer::TransferBuffer;
use cao_gpu::{Access, BufferUse, Gpu};
use cao_measure::random::Random;
use cao_model::feature::{Feature, Features};
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::volume::Volume;
use cao_testing::*;
use cao_twin as twin;
use cao_twin::Grid;

fn on_device(gpu: &Gpu, kernel: &Occupancy, volume: &Volume, transfer: &TransferFunction) -> Vec<bool> {
    words(gpu, kernel, volume, transfer, Features::NONE).into_iter().map(|word| word != 0).collect()
}

fn words(
    gpu: &Gpu,
    kernel: &Occupancy,
    volume: &Volume,
    transfer: &TransferFunction,
    features: Features,
) -> Vec<u32> {
    let field = Field::upload(gpu, volume).unwrap();
    let points = TransferBuffer::new(gpu).unwrap();
    let occupancy = gpu.buffer("occupancy", 4 * u64::from(field.brick_count()), BufferUse::Device).unwrap();
    let features = FeatureSet::new(gpu, &field, features).unwrap();
    let classes = Classes::new(gpu).unwrap();
    run(gpu, |rec| {
        points.record(rec, transfer).unwrap();
        features.record(rec, &classes, &field, transfer, &points).unwrap();
        rec.barrier(&[], &[Access::StorageWrite]);
        let (field, points) = features.opacities().unwrap_or((&field, &points));
        kernel.record(rec, field, points, &features, &occupancy).unwrap();
    });
    bytemuck::pod_collect_to_vec(&read_buffer(gpu, &occupancy))
}

fn twin(volume: &Volume, transfer: &TransferFunction) -> Vec<bool> {
    let values: Vec<f32> = (0..volume.len()).map(|i| volume.value(i) as f32).collect();
    twin::field::occupancy::occupancy(&grid_of(volume), &values, transfer)
}

fn opaque_between(low: f32, high: f32) -> TransferFunction {
    let opacity = vec![[low, 0.0], [0.5 * (low + high), 0.8], [high, 0.0]];
    TransferFunction::new(opacity, vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap()
}

/// Sizes of the shared list, and two whose bricks do not fit one workgroup of 64.
fn grids() -> Vec<Grid> {
    let large = Grid { dims: [70, 33, 17], spacing: [1.0; 3] };
    GRIDS.into_iter().chain([large]).collect()
}

/// Thresholds half-way between stored values, so that the device's slack of a fraction of one decides nothing.
#[test]
fn bricks_that_can_show_something_are_those_of_the_twin() {
    let gpu = open();
    let kernel = Occupancy::new(&gpu).unwrap();
    let mut random = Random::new(3);
    for grid in grids() {
        for turn in 0..6_u64 {
            // Mostly smooth along x, so that bricks differ; a few voxels stand out.
            let mut values: Vec<u8> = (0..grid.len()).map(|i| (grid.voxel(i)[0] * 3) as u8).collect();
            for _ in 0..turn {
                values[random.below(grid.len() as u64) as usize] = random.below(256) as u8;
            }
            let mut volume = Volume::new(grid.dims, grid.spacing, Values::U8(values)).unwrap();
            if turn % 2 == 1 {
                (volume.slope, volume.intercept) = (2.0, -100.0);
            }
            let value = |stored: f64| (stored * volume.slope + volume.intercept) as f32;
            let low = random.below(250) as f64 + 0.5;
            let transfer = opaque_between(value(low), value(low + 1.0 + random.below(9) as f64));
            let (found, expected) = (on_device(&gpu, &kernel, &volume, &transfer), twin(&volume, &transfer));
            assert_eq!(found, expected, "{:?} turn {turn} low {low}", grid.dims);
        }
    }
    drop(kernel);
    close(gpu);
}

/// A brick that the twin calls visible is never skipped: thresholds on the stored values themselves, where rounding could
/// decide, also for floats far from 0.
#[test]
fn no_visible_brick_is_skipped() {
    let gpu = open();
    let kernel = Occupancy::new(&gpu).unwrap();
    let mut random = Random::new(4);
    let grid = Grid { dims: [40, 9, 17], spacing: [1.0; 3] };
    for turn in 0..24 {
        let steps: Vec<u32> = (0..grid.len()).map(|_| random.below(5) as u32).collect();
        let volume = match turn % 3 {
            0 => Values::U8(steps.iter().map(|&s| (s * 3 + 100) as u8).collect()),
            1 => Values::I16(steps.iter().map(|&s| (s * 7) as i16 - 1007).collect()),
            _ => Values::F32(steps.iter().map(|&s| s as f32 * 0.1 + 12_345.0).collect()),
        };
        let volume = Volume::new(grid.dims, grid.spacing, volume).unwrap();
        let (low, high) = volume.range();
        let step = (high - low) / 4.0;
        let from = low + step * random.below(6) as f64;
        let transfer = opaque_between((from - step) as f32, from as f32);
        let (found, expected) = (on_device(&gpu, &kernel, &volume, &transfer), twin(&volume, &transfer));
        for (brick, (&found, &expected)) in found.iter().zip(&expected).enumerate() {
            assert!(found || !expected, "{} brick {brick} turn {turn}", volume.values.kind());
        }
    }
    drop(kernel);
    close(gpu);
}

/// With features: of opacities after them, and a bit more where clips leave some.
#[test]
fn hidden_features_show_nothing_and_what_clips_leave_is_marked() {
    let gpu = open();
    let kernel = Occupancy::new(&gpu).unwrap();
    let mut random = Random::new(7);
    let mut seen = [0; 4];
    for grid in grids() {
        for turn in 0..4 {
            let volume = volume_of(&grid, opacities(&mut random, &grid, 1.0));
            // Few voxels belong to a feature that shows.
            let label = |random: &mut Random| {
                if random.below(1 << (3 * turn)) == 0 { 1 + random.below(2) } else { 3 }
            };
            let labels = (0..grid.len()).map(|_| label(&mut random) as u8).collect();
            let list = vec![
                Feature::new("plain"),
                Feature { spared: true, ..Feature::new("spared") },
                Feature { visible: false, spared: true, ..Feature::new("hidden") },
            ];
            let features = Features::by_labels(list, grid.dims, labels).unwrap();
            let shown = twin::field::features::classified(&volume, &identity(), &features);
            let spared = twin::field::features::spared(&volume, &features);
            let left: Vec<f32> = shown.iter().zip(spared).map(|(a, s)| if s { *a } else { 0.0 }).collect();
            let of = |values: &[f32]| twin::field::occupancy::occupancy(&grid, values, &identity());
            let expected: Vec<u32> = of(&shown)
                .into_iter()
                .zip(of(&left))
                .map(|(a, b)| u32::from(a) | u32::from(b) << 1)
                .collect();
            let found = words(&gpu, &kernel, &volume, &identity(), features);
            assert_eq!(found, expected, "{:?} turn {turn}", grid.dims);
            found.iter().for_each(|word| seen[*word as usize] += 1);
        }
    }
    assert!(seen[0] > 5 && seen[1] > 5 && seen[3] > 20, "{seen:?}");
    drop(kernel);
    close(gpu);
}
