//! The kernel `gbuffer` against its twin.

use cao_gpu::Gpu;
use cao_model::clip::Clip;
use cao_model::surface::World;
use cao_model::view::View;
use cao_testing::worlds::{self, Pixels, corner, corner_eyes, floats};
use cao_testing::*;
use cao_twin::mesh::gbuffer::gbuffer;
use std::collections::HashSet;

/// No multiple of a workgroup.
const SIZE: [u32; 2] = [61, 45];

/// Share of pixels that may show something else: rays that pass an edge or the border of a mask within rounding.
const OTHER: f64 = 5e-3;

/// Relative error of a depth in f32: some roundings of numbers that are ten times larger than their differences.
const DEPTH: f64 = 2e-5;

#[test]
fn both_eyes_show_what_the_twin_does() {
    let gpu = open();
    let (world, views) = (corner(), corner_eyes(SIZE));
    let mut worlds = Vec::new();
    for clips in [vec![], worlds::clips()] {
        let pixels = Pixels::clipped(&gpu, &world, &clips, &views, SIZE);
        let seen = compared(&gpu, &world, &clips, &views, &pixels);
        worlds.push((seen, floats(&gpu, &pixels.geometry.pixels)));
    }
    assert_eq!(worlds[0].0, 6, "every surface is to be seen, the needle too");
    assert_ne!(worlds[0].1, worlds[1].1, "clips change nothing");
    close(gpu);
}

/// Compares what pixels show with the twin; how many surfaces are seen.
fn compared(gpu: &Gpu, world: &World, clips: &[Clip], views: &[View], pixels: &Pixels) -> usize {
    let geometry = floats(gpu, &pixels.geometry.pixels);
    let hits: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&read_buffer(gpu, &pixels.hits));
    let (mut other, mut all, mut seen) = (0, 0, HashSet::new());
    for (view, eye) in views.iter().enumerate() {
        for (i, expected) in gbuffer(world, clips, eye, SIZE).into_iter().enumerate() {
            let at = view * (SIZE[0] * SIZE[1]) as usize + i;
            let pixel = &geometry[4 * at..4 * at + 4];
            all += 1;
            let Some(expected) = expected else {
                other += u32::from(pixel[3] != 0.0);
                continue;
            };
            let found = pixels.surfaces.ordered.get(hits[at][0] as usize);
            if found != Some(&world.triangles[expected.hit.triangle]) {
                other += 1;
                continue;
            }
            seen.insert(world.triangles[expected.hit.triangle].material);
            let depth = expected.hit.t;
            assert!((f64::from(pixel[3]) - depth).abs() < DEPTH * depth, "{pixel:?}, expected {depth}");
            for axis in 0..3 {
                assert!((f64::from(pixel[axis]) - expected.normal[axis]).abs() < 1e-5, "{pixel:?}");
            }
            let weights = [hits[at][1] & 0xffff, hits[at][1] >> 16].map(|bits| f64::from(bits) / 65535.0);
            for (found, expected) in weights.iter().zip(expected.hit.at) {
                assert!((found - expected).abs() < 1e-3, "{weights:?}");
            }
        }
    }
    assert!(f64::from(other) < OTHER * f64::from(all), "{other} of {all}");
    seen.len()
}
