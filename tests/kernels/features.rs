//! The kernel `features` against its twin: which voxel is whose, and opacities after features.

use cao::field::Field;
use cao::field::features::{Classes, FeatureSet};
use cao::field::transfer::TransferBuffer;
use cao_measure::random::Random;
use cao_model::feature::{Feature, Features};
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::volume::Volume;
use cao_testing::*;
use cao_twin::field::features::{classified, index};

/// Values are whole numbers below 256, whose opacities round as those of `opacity` do; the factor, 4 at most here, rounds once more.
const TOLERANCE: f32 = 4.0 * 5.0 * 6e-8;

fn some(random: &mut Random, name: &str) -> Feature {
    Feature {
        visible: random.below(4) > 0,
        scale: random.between(0.0, 4.0),
        spared: random.below(2) == 0,
        ..Feature::new(name)
    }
}

#[test]
fn which_voxel_is_whose_and_its_opacity_are_the_twins() {
    let gpu = open();
    let classes = Classes::new(&gpu).unwrap();
    let mut random = Random::new(5);
    let transfer = TransferFunction::new(
        vec![[10.0, 0.0], [90.0, 0.7], [120.0, 0.1], [250.0, 1.0]],
        vec![[0.0, 1.0, 1.0, 1.0]],
        None,
    )
    .unwrap();
    let mut seen = [0; 9];
    for (case, grid) in GRIDS.iter().enumerate() {
        let bytes: Vec<u8> = (0..grid.len()).map(|_| random.below(256) as u8).collect();
        let values = match case % 2 {
            0 => Values::U8(bytes),
            _ => Values::F32(bytes.into_iter().map(f32::from).collect()),
        };
        let volume = Volume::new(grid.dims, grid.spacing, values).unwrap();
        let ends = [0.0, 20.0, 50.0, 51.0, 90.0, 130.0, 131.5, 200.0, 255.0];
        let by_intervals =
            (0..8).map(|k| (some(&mut random, &k.to_string()), [ends[k], ends[k + 1]])).collect::<Vec<_>>();
        let labels = (0..grid.len()).map(|_| random.below(9) as u8).collect();
        let list = (0..8).map(|k| some(&mut random, &k.to_string())).collect();
        for features in [
            Features::by_intervals(by_intervals).unwrap(),
            Features::by_labels(list, grid.dims, labels).unwrap(),
        ] {
            let field = Field::upload(&gpu, &volume).unwrap();
            let buffer = TransferBuffer::new(&gpu).unwrap();
            let set = FeatureSet::new(&gpu, &field, features.clone()).unwrap();
            run(&gpu, |rec| {
                buffer.record(rec, &transfer).unwrap();
                set.record(rec, &classes, &field, &transfer, &buffer).unwrap();
            });
            let found = read_image(&gpu, &set.index);
            assert_eq!(found, index(&volume, &features), "{:?}", grid.dims);
            found.iter().for_each(|k| seen[usize::from(*k)] += 1);
            let expected = classified(&volume, &transfer, &features);
            let found = read_floats(&gpu, &set.opacities().unwrap().0.volume);
            for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
                assert!((found - expected).abs() <= TOLERANCE, "voxel {i}: {found} instead of {expected}");
            }
        }
    }
    assert!(seen.iter().all(|count| *count > 20), "{seen:?}");
    drop(classes);
    close(gpu);
}
