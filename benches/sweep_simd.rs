//! Time of the line sweep in plain SIMD code on all cores: `cargo bench -p cao-benches --bench sweep_simd`. What the kernels of the sweep
//! are compared with (method.md §4). Prints the median of the runs and their range, for each set of vector instructions
//! that the processor has; `Target` is what the crate is built for.

#![forbid(unsafe_code)]

use cao_model::occlusion::RaySet;
use cao_simd::{Rule, Vectors, lines, sweep};
use std::time::Instant;

const EDGE: usize = 128;
const RUNS: usize = 15;

fn main() -> cao_formats::Result<()> {
    let volume = cao_formats::open(&format!("builtin:engine:{EDGE}"))?;
    let transfer = cao_formats::transfer::load("auto", volume.range())?;
    let q: Vec<f32> = (0..volume.len()).map(|i| 1.0 - transfer.opacity_at(volume.value(i) as f32)).collect();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let rays = RaySet::W26.directions();
    println!("{:?} voxels, {} directions, {threads} threads", volume.dims, rays.len());
    println!("rule     W   vectors  ns a voxel and direction     ms");
    for rule in [Rule::Left, Rule::Segment] {
        // The left sum as it was first tried, t = q and s = 1; the segment rule corrects for the length.
        let length = |v: [i32; 3]| match rule {
            Rule::Left => 1.0,
            Rule::Segment => (v.map(|c| c * c).iter().sum::<i32>() as f32).sqrt(),
        };
        for window in [20, 50] {
            let lines = lines(&rays, length, |_| window);
            for vectors in Vectors::available() {
                let mut times: Vec<f64> = (0..RUNS)
                    .map(|_| {
                        let start = Instant::now();
                        std::hint::black_box(sweep(volume.dims, &q, &lines, rule, vectors, threads));
                        start.elapsed().as_secs_f64() * 1e3
                    })
                    .collect();
                times.sort_by(f64::total_cmp);
                let ns = |ms: f64| ms * 1e6 / (volume.len() * rays.len()) as f64;
                let [least, median, most] = [0, RUNS / 2, RUNS - 1].map(|i| times[i]);
                println!(
                    "{:<8} {window:<3} {:<8} {:.3} ({:.3} to {:.3})   {median:>10.1}",
                    format!("{rule:?}").to_lowercase(),
                    format!("{vectors:?}"),
                    ns(median),
                    ns(least),
                    ns(most)
                );
            }
        }
    }
    Ok(())
}
