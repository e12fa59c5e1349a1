//! The kernel `upsample` against its twin, and what it marks.

use cao::mesh::gather::{Blocks, Gather, Scene};
use cao::mesh::upsample::Upsample;
use cao_gpu::Access;
use cao_testing::worlds::{Pixels, corner, corner_eyes, floats};
use cao_testing::*;
use cao_twin::mesh::gbuffer::gbuffer;
use cao_twin::mesh::upsample::upsampled;

const SIZE: [u32; 2] = [61, 45];
const DELTA: f32 = 40.0;

/// Largest difference: exponentials of f32, and places whose depth has its rounding.
const ERROR: f64 = 1e-3;
/// Share of pixels beyond it, or marked by one alone: other triangles at edges.
const OTHER: f64 = 0.01;

#[test]
fn means_are_the_twins_and_what_is_left_is_computed() {
    let gpu = open();
    let (world, views) = (corner(), corner_eyes(SIZE));
    let pixels = Pixels::new(&gpu, &world, &views, SIZE);
    let volumes = pixels.surfaces.volumes(&gpu, DELTA, false).unwrap();
    let (gather, upsample) = (Gather::new(&gpu, false).unwrap(), Upsample::new(&gpu).unwrap());
    let scene =
        Scene { geometry: &pixels.geometry, surfaces: &pixels.surfaces, volumes: &volumes, delta_mm: DELTA };
    let every = pixels.values(&gpu);
    run(&gpu, |rec| gather.record_full(rec, scene, 0..SIZE[1], &every).unwrap());
    let full = floats(&gpu, &every);
    let shown = views.map(|view| gbuffer(&world, &[], &view, SIZE));
    let mut counts = Vec::new();
    for step in [3, 5, 15] {
        let blocks = Blocks::new(&gpu, &pixels.geometry, step).unwrap();
        let accessibility = pixels.values(&gpu);
        run(&gpu, |rec| {
            gather.record_sparse(rec, scene, &blocks).unwrap();
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
            upsample.record(rec, scene, &blocks, &accessibility).unwrap();
        });
        let (sums, marked) = (floats(&gpu, &blocks.sums), floats(&gpu, &accessibility));
        let failures: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &blocks.failures));
        let failed = failures[0];
        let mut listed = failures[1..=failed as usize].to_vec();
        listed.sort_unstable();
        let negative = |i: &u32| marked[*i as usize] < 0.0;
        assert_eq!(listed, (0..marked.len() as u32).filter(negative).collect::<Vec<_>>());
        run(&gpu, |rec| gather.record_failed(rec, scene, &blocks, &accessibility).unwrap());
        let mended = floats(&gpu, &accessibility);
        let (mut other, per_view) = (0, (SIZE[0] * SIZE[1]) as usize);
        for (i, &found) in marked.iter().enumerate() {
            let (view, at) = (i / per_view, i % per_view);
            let sums: Vec<f64> = sums[view * sums.len() / 2..].iter().map(|sum| f64::from(*sum)).collect();
            let pixel = [at as u32 % SIZE[0], at as u32 / SIZE[0]];
            if shown[view][at].is_none() {
                assert_eq!(found, 1.0);
                continue;
            }
            let expected = upsampled(&shown[view], SIZE, &sums, step, f64::from(DELTA), pixel);
            match expected {
                None => other += u32::from(found >= 0.0),
                Some(expected) => other += u32::from((f64::from(found) - expected).abs() > ERROR),
            }
            assert_eq!(mended[i], if found < 0.0 { full[i] } else { found });
        }
        assert!(f64::from(other) < OTHER * marked.len() as f64, "step {step}: {other}");
        counts.push(failed);
    }
    // The coarser, the more pixels that nothing is like; here they are the box's and the needle's.
    assert!(counts[0] <= counts[1] && counts[1] < counts[2], "{counts:?}");
    drop((pixels, volumes, every));
    close(gpu);
}
