//! The kernel `dilate` against its twin, one layer pair at a time, and against the definition: no point within the radius
//! of a point of the layers is missed.

use cao::clip::clips::MeshClip;
use cao::clip::dilate::Dilate;
use cao_gpu::{Access, BufferUse, Gpu};
use cao_measure::random::Random;
use cao_model::clip::{ClipCamera, Mode};
use cao_testing::*;
use cao_twin as twin;
use cao_twin::clip::clips::{MeshLayers, NO_BACK, NO_FRONT};
use glam::Vec3;

/// Rounding of a depth that is sum of two up to about 2, f32.
const DEPTH_ROUNDING: f32 = 4e-7;

/// The height of the ball at a distance d is √(r² − d²); r² and d² round to f32 (1.2e-7 together), whose root is what the
/// height may be off by, as a share of the radius, where d is almost r.
const HEIGHT_ROUNDING: f32 = 5e-4;

/// Layers in the kernel's form: `pairs` × (front, back), empty pixels 1. Those of a kept shape have no gaps and are so
/// thick that contraction leaves something.
fn random_layers(random: &mut Random, camera: ClipCamera, pairs: u32, keep: bool) -> Vec<f32> {
    let filled = if keep { 1.0 } else { 0.6 };
    let size = (camera.resolution * camera.resolution) as usize;
    let mut layers = vec![1.0; 2 * pairs as usize * size];
    for pixel in 0..size {
        let mut z = random.between(0.05, 0.3);
        for pair in 0..pairs as usize {
            if random.between(0.0, 1.0) > filled {
                break;
            }
            let back = z + random.between(0.0, 0.6 / pairs as f32);
            layers[2 * pair * size + pixel] = z;
            layers[(2 * pair + 1) * size + pixel] = back;
            z = back + random.between(0.01, 0.1);
        }
    }
    if keep {
        layers[..size].iter_mut().for_each(|z| *z *= 0.3);
        layers[size..2 * size].iter_mut().for_each(|z| *z = z.max(0.97));
    }
    layers
}

/// One pair of them in the twin's form.
fn pair_of(layers: &[f32], camera: ClipCamera, pair: u32) -> MeshLayers {
    let size = (camera.resolution * camera.resolution) as usize;
    let [front, back] = [0, 1].map(|side| &layers[(2 * pair as usize + side) * size..][..size]);
    let empty: Vec<bool> = front.iter().map(|&f| f >= 1.0).collect();
    let or = |depths: &[f32], none: f32| -> Vec<f32> {
        depths.iter().zip(&empty).map(|(&z, &empty)| if empty { none } else { z }).collect()
    };
    MeshLayers { camera, front: vec![or(front, NO_FRONT)], back: vec![or(back, NO_BACK)] }
}

/// Dilation maps of all pairs, as the kernel leaves them.
fn on_device(gpu: &Gpu, kernel: &Dilate, clip: &MeshClip, radius: f32, layers: &[f32]) -> Vec<f32> {
    // Not at the buffers' beginning, as when other meshes come before.
    let layers = [vec![0.5; clip.layers_at as usize], layers.to_vec()].concat();
    let layers = buffer(gpu, "layers", bytemuck::cast_slice(&layers));
    let cells = clip.cells.resolution;
    let blocks = Dilate::blocks(gpu, cells, clip.pairs).unwrap();
    let count = clip.dilation_at + 2 * clip.pairs * cells * cells;
    let maps = gpu.buffer("maps", 4 * u64::from(count), BufferUse::Device).unwrap();
    let groups = gpu.buffer("groups", 12, BufferUse::Device).unwrap();
    run(gpu, |rec| {
        let over = cells.div_ceil(8);
        rec.update(&groups, 0, bytemuck::cast_slice(&[over, over, clip.pairs])).unwrap();
        rec.barrier(&[Access::TransferWrite], &[Access::IndirectRead]);
        kernel.record(rec, clip, radius, &layers, &blocks, &maps, &groups).unwrap();
    });
    let all: Vec<f32> = bytemuck::pod_collect_to_vec(&read_buffer(gpu, &maps));
    all[clip.dilation_at as usize..].to_vec()
}

fn camera(resolution: u32) -> ClipCamera {
    ClipCamera { corner: Vec3::new(-3.0, 1.0, 0.5), pixel_mm: 0.37, depth_mm: 7.3, resolution }
}

/// (Z, cells): cells smaller and larger than pixels; one workgroup of 8x8, more, no multiple of it.
const SIZES: [(u32, u32); 7] = [(8, 9), (8, 8), (9, 30), (24, 8), (20, 20), (51, 17), (96, 24)];

#[test]
fn each_pair_is_dilated_as_the_twin_does_it() {
    let gpu = open();
    let kernel = Dilate::new(&gpu).unwrap();
    let mut random = Random::new(10);
    let mut left = 0;
    for (resolution, cells) in SIZES {
        let camera = camera(resolution);
        let map_mm = camera.pixel_mm * resolution as f32;
        for pairs in [1, 3] {
            for keep in [false, true] {
                for literal in [false, true] {
                    if literal && cells != resolution {
                        continue;
                    }
                    // Smaller than a pixel, a few cells, more than the whole map; never a whole number of cells, where
                    // rounding decides what is within it.
                    for radius in [0.41 * camera.pixel_mm, 0.1371 * map_mm + 0.3, 1.713 * map_mm] {
                        let layers = random_layers(&mut random, camera, pairs, keep);
                        // The twin takes what lies beyond the map for empty; the kernel trusts the margin around
                        // a mesh, which is empty itself.
                        let wide = if literal { camera } else { camera.widened(radius, cells) };
                        let border = if keep { (radius / wide.pixel_mm) as u32 + 1 } else { 0 };
                        let clip = MeshClip {
                            camera,
                            pairs,
                            cells: wide,
                            layers_at: 5,
                            dilation_at: 3,
                            blocks_at: 0,
                            keep,
                            literal,
                        };
                        let found = on_device(&gpu, &kernel, &clip, radius, &layers);
                        let context = format!(
                            "{resolution}/{cells} pairs {pairs} keep {keep} literal {literal} radius {radius}"
                        );
                        let tolerance = DEPTH_ROUNDING + HEIGHT_ROUNDING * radius / camera.depth_mm;
                        for pair in 0..pairs {
                            let layers = pair_of(&layers, camera, pair);
                            let mode = if keep { Mode::Keep } else { Mode::Remove };
                            let expected = if literal {
                                twin::clip::dilate::literal(&layers, mode, radius, false)
                            } else {
                                twin::clip::dilate::conservative(&layers, mode, radius, cells).unwrap()
                            };
                            let size = (cells * cells) as usize;
                            let map = |side: usize| &found[(2 * pair as usize + side) * size..][..size];
                            let (front, back) = (map(0), map(1));
                            for cell in 0..size {
                                let (x, y) = (cell as u32 % cells, cell as u32 / cells);
                                let inner = border..cells.saturating_sub(border);
                                if !inner.contains(&x) || !inner.contains(&y) {
                                    continue;
                                }
                                let (f, b) = (expected.front[cell], expected.back[cell]);
                                left += usize::from(f < b);
                                let at = format!("{context} pair {pair} cell {cell}");
                                if f >= b {
                                    let empty = front[cell] + tolerance >= back[cell];
                                    assert!(empty, "{at}: {} {}, not empty", front[cell], back[cell]);
                                } else {
                                    let error = (front[cell] - f).abs().max((back[cell] - b).abs());
                                    assert!(
                                        error <= tolerance,
                                        "{at}: {} {} instead of {f} {b}",
                                        front[cell],
                                        back[cell]
                                    );
                                }
                            }
                        }
                    }
                }
            }
        }
    }
    assert!(left > 10_000, "{left}");
    drop(kernel);
    close(gpu);
}

/// From the definition, without the twin: points of a removed shape's layers, moved by less than the radius in any
/// direction, lie in the dilated maps; points of a kept shape's contracted maps, moved so, still lie in its layers.
#[test]
fn no_point_within_the_radius_is_missed() {
    const SEED: u64 = 11;
    let gpu = open();
    let kernel = Dilate::new(&gpu).unwrap();
    let mut random = Random::new(SEED);
    let (mut tested, mut kept) = (0, 0);
    for turn in 0..40 {
        let (resolution, cells) = SIZES[turn % SIZES.len()];
        let camera = camera(resolution);
        let keep = turn % 2 == 1;
        let pairs = 1 + random.below(3) as u32;
        let radius = random.between(0.05, 0.3) * camera.pixel_mm * resolution as f32;
        let layers = random_layers(&mut random, camera, pairs, keep);
        let wide = camera.widened(radius, cells);
        let clip = MeshClip {
            camera,
            pairs,
            cells: wide,
            layers_at: 0,
            dilation_at: 0,
            blocks_at: 0,
            keep,
            literal: false,
        };
        let maps = on_device(&gpu, &kernel, &clip, radius, &layers);
        // p in pixels and depths of the layers.
        let inside = |maps: &[f32], of: ClipCamera, p: Vec3| {
            let scale = Vec3::new(camera.pixel_mm, camera.pixel_mm, camera.depth_mm);
            let on = of.map(camera.corner + p * scale);
            let (x, y, edge) = (on.x.floor(), on.y.floor(), of.resolution);
            let on_map = (0.0..edge as f32).contains(&x) && (0.0..edge as f32).contains(&y);
            on_map
                && (0..pairs as usize).any(|pair| {
                    let size = (edge * edge) as usize;
                    let at = 2 * pair * size + y as usize * edge as usize + x as usize;
                    maps[at] < p.z && p.z < maps[at + size]
                })
        };
        for _ in 0..20_000 {
            let mut share = || random.between(0.0, 1.0);
            let p = Vec3::new(share() * resolution as f32, share() * resolution as f32, share());
            let direction = Vec3::new(share() - 0.5, share() - 0.5, share() - 0.5).normalize_or_zero();
            let moved = direction * radius * share() * 0.9999;
            let scale = Vec3::new(camera.pixel_mm, camera.pixel_mm, camera.depth_mm);
            let q = p + moved / scale;
            let context = || format!("seed {SEED} turn {turn}: {p} to {q}");
            if keep && inside(&maps, wide, p) {
                assert!(inside(&layers, camera, q), "{}", context());
                kept += 1;
            } else if !keep && inside(&layers, camera, p) {
                assert!(inside(&maps, wide, q), "{}", context());
                tested += 1;
            }
        }
    }
    assert!(tested > 10_000 && kept > 1000, "{tested} {kept}");
    drop(kernel);
    close(gpu);
}
