//! The kernel `moments` against its twin: of one part and of several, of channels far from 0.

use cao::network::moments::{Moments, NORM, PARTIAL, parts};
use cao_gpu::{Access, BufferUse};
use cao_kernels::moments::Norm;
use cao_measure::random::Random;
use cao_model::network::half_bits;
use cao_testing::*;
use cao_twin::network::Tensor;
use cao_twin::network::moments::{EPSILON, moments};

/// Sums of some thousand f32.
const ROUNDED: f64 = 2e-5;

#[test]
fn means_and_deviations_equal_the_twins() {
    let gpu = open();
    let kernel = Moments::new(&gpu).unwrap();
    let mut random = Random::new(3);
    for dims in [[1, 1, 1], [7, 5, 3], [16, 16, 16], [17, 19, 40]] {
        let voxels: usize = dims.iter().product();
        // Channels of all sizes: sums of squares of those around 2000 would cancel. One is the same everywhere.
        let of = |c: usize, random: &mut Random| match c {
            3 => 0.25,
            _ => [0.0, 2000.0, -3.0, 0.0][c % 4] + [1.0, 8.0, 0.01, 300.0][c % 4] * random.between(-1.0, 1.0),
        };
        let values: Vec<Vec<u16>> =
            (0..16).map(|c| (0..voxels).map(|_| half_bits(of(c, &mut random))).collect()).collect();
        let words: Vec<u16> = (0..2)
            .flat_map(|b| {
                (0..voxels).flat_map({
                    let values = &values;
                    move |v| (0..8).map(move |c| values[8 * b + c][v])
                })
            })
            .collect();
        let source = buffer(&gpu, "test tensor", bytemuck::cast_slice(&words));
        let count = parts(voxels as u32);
        let partials = gpu.buffer("test parts", PARTIAL * 2 * u64::from(count), BufferUse::Device).unwrap();
        let norms = gpu.buffer("test norms", 3 * NORM, BufferUse::Device).unwrap();
        // In two goes.
        for items in [0..count, count..2 * count] {
            run(&gpu, |rec| {
                let both = [&partials, &norms];
                kernel.record(rec, &source, voxels as u32, 2, 1, both, items).unwrap();
                rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::TransferRead]);
            });
        }
        let found: Vec<Norm> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &norms));
        let tensor =
            Tensor { dims, values: values.concat().into_iter().map(cao_model::network::half).collect() };
        for (c, expected) in moments(&tensor).iter().enumerate() {
            let norm = &found[1 + c / 8];
            let pick = |low: [f32; 4], high: [f32; 4]| f64::from([low, high].concat()[c % 8]);
            let (mean, by) = (pick(norm.mean_low, norm.mean_high), pick(norm.by_low, norm.by_high));
            let deviation = (expected.variance + EPSILON).sqrt();
            assert!(
                (mean - expected.mean).abs() <= ROUNDED * (deviation + expected.mean.abs()),
                "{dims:?} {c}: {mean}"
            );
            assert!((by * deviation - 1.0).abs() <= ROUNDED, "{dims:?} {c}: {by}, {deviation}");
        }
    }
    drop(kernel);
    close(gpu);
}
