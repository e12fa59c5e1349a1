//! The kernel `histogram` against its twin: bins, samples and the cluster of every voxel.

use cao::field::Field;
use cao::histograms::clusters::{Clusters, ROUNDS};
use cao::histograms::histogram::{Histogram, HistogramPlan};
use cao_gpu::{Access, Gpu};
use cao_kernels::histogram::WORDS;
use cao_measure::random::Random;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::histograms::clusters::{clusters, mixed, nearest};
use cao_twin::histograms::histogram::{bins, histogram};

/// A share is rounded from a quotient of floats.
const ROUNDED: u32 = 1;

/// What the device makes of these values: samples, clusters, and the cluster of each voxel of the index volume.
struct Made {
    samples: Vec<Vec<u32>>,
    centres: Vec<Vec<u32>>,
    index: Vec<u16>,
}

fn unpacked(words: &[u32], at: impl Fn(u32) -> usize) -> Vec<u32> {
    (0..WORDS).flat_map(|w| [words[at(w)] & 0xffff, words[at(w)] >> 16]).collect()
}

fn made(gpu: &Gpu, field: &Field, plan: &HistogramPlan) -> Made {
    let (kernel, groups) = (Histogram::new(gpu, field, plan.block).unwrap(), Clusters::new(gpu).unwrap());
    // Twice: what earlier clusters left is not in it.
    for _ in 0..2 {
        run(gpu, |rec| {
            kernel.record_samples(rec, field, plan).unwrap();
            groups.record_seed(rec, plan, &kernel.sampled).unwrap();
            (0..ROUNDS).for_each(|round| groups.record_round(rec, plan, &kernel.sampled, round).unwrap());
            for slab in 0..plan.slab_count() {
                kernel.record_slab(rec, field, plan, &groups.centres, slab).unwrap();
            }
            rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        });
    }
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(gpu, &kernel.sampled));
    let row = |r: u32| unpacked(&words, |w| (plan.rows * w + r) as usize);
    let samples = (0..plan.rows).map(row).collect();
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(gpu, &groups.centres));
    let centre = |c: u32| unpacked(&words, |w| (WORDS * c + w) as usize);
    let centres = (0..plan.clusters).map(centre).collect();
    Made { samples, centres, index: bytemuck::pod_collect_to_vec(&read_image(gpu, &kernel.index)) }
}

#[test]
fn samples_clusters_and_their_numbers_equal_the_twins() {
    let mut random = Random::new(5);
    let sizes = [
        Grid { dims: [1, 1, 1], spacing: [1.0; 3] },
        Grid { dims: [13, 9, 11], spacing: [1.25, 0.8, 1.0] },
        Grid { dims: [20, 17, 15], spacing: [1.0; 3] },
    ];
    for (n, grid) in sizes.iter().enumerate() {
        let gpu = open();
        // A few steps between values, and noise.
        let values: Vec<f32> = (0..grid.len())
            .map(|i| {
                let [x, y, z] = grid.voxel(i);
                ((x / 5 + 2 * (y / 6) + z / 7) % 4) as f32 * 40.0 - 70.0 + random.between(0.0, 9.0)
            })
            .collect();
        let field = Field::upload(&gpu, &volume_of(grid, values.clone())).unwrap();
        let radius_mm = [3.0, 3.6, 30.0][n];
        for block in [1, 2] {
            let plan = HistogramPlan::new(field.dims, field.spacing, radius_mm, 9, block);
            let found = made(&gpu, &field, &plan);
            let bins = bins(&values);
            let stride = grid.len() as u32 / plan.rows;
            for (r, sample) in found.samples.iter().enumerate() {
                let i = r as u32 * stride + mixed(r as u32) % stride;
                let expected = histogram(grid, &bins, radius_mm, grid.voxel(i as usize));
                let worst = sample.iter().zip(&expected).map(|(f, e)| f.abs_diff(*e)).max();
                assert!(worst <= Some(ROUNDED), "{grid:?} sample {r}: {sample:?} {expected:?}");
            }
            // Whole numbers from here on.
            assert!(found.centres == clusters(&found.samples, plan.clusters, ROUNDS), "{grid:?}");
            assert!(plan.clusters == 1 || found.centres[0] != found.centres[1]);
            let coarse = Grid { dims: plan.coarse.map(|d| d as usize), ..*grid };
            let mut other = 0;
            for (i, &number) in found.index.iter().enumerate() {
                let own = histogram(grid, &bins, radius_mm, coarse.voxel(i).map(|c| c * block as usize));
                other += usize::from(nearest(&own, &found.centres) != usize::from(number));
            }
            // Two may be equally near but for rounding.
            assert!(other * 200 <= found.index.len(), "{grid:?}: {other} of {}", found.index.len());
        }
        drop(field);
        close(gpu);
    }
}
