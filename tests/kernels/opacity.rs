//! The kernel `opacity` against its twin.

use cao::cast::volumes::Volumes;
use cao::field::Field;
use cao::field::opacity::Opacity;
use cao::field::transfer::TransferBuffer;
use cao_gpu::{Access, Gpu};
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::volume::Volume;
use cao_testing::*;
use cao_twin as twin;

/// Rounding of a data value on the device, as a share of the texel type's range: a UNORM texel, the scale and the bias
/// round once each.
const VALUE_ROUNDING: f64 = 3.0 * 6e-8;

/// Rounding of an interpolated opacity, which is at most 1: slope, difference and product round once each.
const OPACITY_ROUNDING: f64 = 4.0 * 6e-8;

fn on_device(gpu: &Gpu, kernel: &Opacity, volume: &Volume, transfer: &TransferFunction) -> Vec<f32> {
    let field = Field::upload(gpu, volume).unwrap();
    let volumes = Volumes::new(gpu, &field).unwrap();
    let buffer = TransferBuffer::new(gpu).unwrap();
    run(gpu, |rec| {
        buffer.record(rec, transfer).unwrap();
        rec.barrier(&[], &[Access::StorageWrite]);
        kernel.record(rec, &field, &buffer, &volumes.full_opacity).unwrap();
    });
    read_floats(gpu, &volumes.full_opacity)
}

/// Largest slope of the opacity, per unit of data value.
fn steepest(transfer: &TransferFunction) -> f64 {
    let slope = |pair: &[[f32; 2]]| {
        let run = f64::from(pair[1][0] - pair[0][0]);
        if run > 0.0 { f64::from((pair[1][1] - pair[0][1]).abs()) / run } else { 0.0 }
    };
    transfer.opacity.windows(2).map(slope).fold(0.0, f64::max)
}

fn white(opacity: &[[f32; 2]]) -> TransferFunction {
    TransferFunction::new(opacity.to_vec(), vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap()
}

/// Integers of 8 and 16 bits fill their whole range; others lie around it.
fn every_type(random: &mut cao_measure::random::Random, n: usize) -> Vec<(Values, f64)> {
    let mut bits = || (0..n).map(|_| random.bits()).collect::<Vec<_>>();
    let (a, b) = (bits(), bits());
    vec![
        (Values::U8(a.iter().map(|&v| v as u8).collect()), 255.0),
        (Values::I8(a.iter().map(|&v| v as i8).collect()), 255.0),
        (Values::U16(a.iter().map(|&v| v as u16).collect()), 65535.0),
        (Values::I16(a.iter().map(|&v| v as i16).collect()), 65535.0),
        (Values::U32(b.iter().map(|&v| (v % 70_000) as u32).collect()), 70_000.0),
        (Values::I32(b.iter().map(|&v| (v % 70_000) as i32 - 35_000).collect()), 70_000.0),
        (Values::U64(b.iter().map(|&v| v % 70_000).collect()), 70_000.0),
        (Values::I64(b.iter().map(|&v| (v % 70_000) as i64 - 35_000).collect()), 70_000.0),
        (Values::F32(a.iter().map(|&v| (v % 10_007) as f32 * 0.37 - 900.0).collect()), 4000.0),
        (Values::F64(a.iter().map(|&v| (v % 10_007) as f64 * 0.37 - 900.0).collect()), 4000.0),
    ]
}

#[test]
fn opacity_is_the_transfer_function_of_every_type_and_size() {
    let gpu = open();
    let kernel = Opacity::new(&gpu).unwrap();
    let mut random = cao_measure::random::Random::new(1);
    for (g, grid) in GRIDS.iter().enumerate() {
        for (values, range) in every_type(&mut random, grid.len()) {
            let mut volume = Volume::new(grid.dims, grid.spacing, values).unwrap();
            // Slope and intercept of the file, as CT has them, in every other size.
            if g % 2 == 1 {
                (volume.slope, volume.intercept) = (0.25, -1024.0);
            }
            let (low, high) = volume.range();
            // A volume of one voxel has a range of one value.
            let at = |share: f64| (low + share * (high - low).max(1.0)) as f32;
            for transfer in [
                white(&[[at(0.1), 0.0], [at(0.4), 0.7], [at(0.5), 0.2], [at(0.9) + 1.0, 1.0]]),
                white(&[[at(0.5), 0.6]]),
            ] {
                let tolerance = steepest(&transfer)
                    * VALUE_ROUNDING
                    * (range * volume.slope.abs() + volume.intercept.abs())
                    + OPACITY_ROUNDING;
                let expected = twin::field::opacity::opacity(&volume, &transfer);
                let found = on_device(&gpu, &kernel, &volume, &transfer);
                for i in 0..volume.len() {
                    let error = f64::from((found[i] - expected[i]).abs());
                    assert!(
                        error <= tolerance,
                        "{:?} {} voxel {i}, value {}: {} instead of {}, tolerance {tolerance:e}",
                        grid.dims,
                        volume.values.kind(),
                        volume.value(i),
                        found[i],
                        expected[i]
                    );
                }
            }
        }
    }
    drop(kernel);
    close(gpu);
}

/// Where two points have one value, the second holds at the value itself: an integer that the file holds must not fall
/// to the wrong side of a step because its texel is a rounded quotient.
#[test]
fn steps_fall_on_the_right_side_of_every_integer() {
    let gpu = open();
    let kernel = Opacity::new(&gpu).unwrap();
    for kind in 0..4 {
        let values = match kind {
            0 => Values::U8((0..=255).collect()),
            1 => Values::I8((i8::MIN..=i8::MAX).collect()),
            2 => Values::U16((0..256).map(|v| v * 255 + v % 7).collect()),
            _ => Values::I16((0..256).map(|v| (v * 253 - 32_000) as i16).collect()),
        };
        let volume = Volume::new([256, 1, 1], [1.0; 3], values).unwrap();
        // 31 steps at a time, each at a value of the volume, until every value has had one.
        for first in 0..9 {
            let steps = (first..256).step_by(9);
            let points: Vec<_> = steps
                .flat_map(|i| {
                    let value = volume.value(i) as f32;
                    let level = |k: usize| ((k / 9) % 7) as f32 / 8.0;
                    [[value, level(i + 9)], [value, level(i + 18)]]
                })
                .collect();
            let transfer = white(&points);
            let expected = twin::field::opacity::opacity(&volume, &transfer);
            let found = on_device(&gpu, &kernel, &volume, &transfer);
            for i in 0..volume.len() {
                assert!(
                    f64::from((found[i] - expected[i]).abs()) <= 1e-3,
                    "{} {}: {} instead of {}",
                    volume.values.kind(),
                    volume.value(i),
                    found[i],
                    expected[i]
                );
            }
        }
    }
    drop(kernel);
    close(gpu);
}
