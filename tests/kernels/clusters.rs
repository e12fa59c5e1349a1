//! The kernel `clusters` against its twin, bit for bit, where histograms are few and clusters stay empty; where they are those of a volume
//! the test of `histogram` has it.

use cao::histograms::clusters::Clusters;
use cao::histograms::histogram::HistogramPlan;
use cao_kernels::clusters::{BINS, WORDS};
use cao_measure::random::Random;
use cao_testing::*;
use cao_twin::histograms::clusters::clusters;

#[test]
fn clusters_that_stay_empty_begin_anew_as_in_the_twin() {
    let gpu = open();
    let mut random = Random::new(6);
    // 24 clusters of three different histograms.
    let plan = HistogramPlan::new([32, 16, 12], [1.0; 3], 4.0, 24, 1);
    assert_eq!(plan.clusters, 24);
    let kinds: Vec<Vec<u32>> =
        (0..3).map(|_| (0..BINS).map(|_| random.below(32767 / u64::from(BINS)) as u32).collect()).collect();
    let samples: Vec<Vec<u32>> = (0..plan.rows).map(|_| kinds[random.below(3) as usize].clone()).collect();
    let word = |w: u32, r: u32| {
        let sample = &samples[r as usize];
        sample[2 * w as usize] | sample[2 * w as usize + 1] << 16
    };
    let words: Vec<u32> = (0..WORDS).flat_map(|w| (0..plan.rows).map(move |r| word(w, r))).collect();
    let sampled = buffer(&gpu, "test samples", bytemuck::cast_slice(&words));
    let kernel = Clusters::new(&gpu).unwrap();
    for rounds in [0, 1, 5] {
        run(&gpu, |rec| {
            kernel.record_seed(rec, &plan, &sampled).unwrap();
            (0..rounds).for_each(|round| kernel.record_round(rec, &plan, &sampled, round).unwrap());
            rec.barrier(&[cao_gpu::Access::StorageWrite], &[cao_gpu::Access::TransferRead]);
        });
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &kernel.centres));
        let expected = clusters(&samples, plan.clusters, rounds);
        for (c, centre) in expected.iter().enumerate() {
            let found = &words[c * WORDS as usize..][..WORDS as usize];
            assert!(centre.chunks(2).map(|p| p[0] | p[1] << 16).eq(found.iter().copied()), "{rounds} {c}");
        }
    }
    drop((kernel, sampled));
    close(gpu);
}
