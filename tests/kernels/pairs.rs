//! The kernel `pairs` against its twin, to the bit: surfaces that no mesh has, in every order of faces.

use cao::clip::pairs::{Pairs, Place};
use cao::clip::peel::Surface;
use cao_gpu::{Access, BufferUse};
use cao_kernels::shared::layers::ONE_DEPTH;
use cao_kernels::shared::peeled::Peeled;
use cao_measure::random::Random;
use cao_testing::*;
use cao_twin as twin;

/// Faces of a pixel, in the order of depth: often at one depth, or as little apart as counts for nothing.
fn faces(random: &mut Random, most: u64) -> Vec<(f32, bool)> {
    let mut z = random.between(0.0, 0.2);
    let mut winding = 0;
    let mut faces = Vec::new();
    for _ in 0..random.below(most + 1) {
        let front = random.below(2) == 1;
        winding += if front { 1 } else { -1 };
        faces.push((z, front));
        z += [0.0, 0.9 * ONE_DEPTH, 1.1 * ONE_DEPTH, random.between(0.0, 0.06)][random.below(4) as usize];
    }
    // Mostly of a mesh without border.
    while winding != 0 && random.below(50) > 0 {
        faces.push((z, winding < 0));
        winding -= i32::signum(winding);
        z += random.between(0.0, 0.01);
    }
    faces
}

#[test]
fn pairs_and_bounds_of_blocks_are_those_of_the_twin() {
    const SEED: u64 = 83;
    let gpu = open();
    let kernel = Pairs::new(&gpu).unwrap();
    let mut random = Random::new(SEED);
    let (mut open_ones, mut beyond) = (0, 0);
    for (turn, (resolution, max, most)) in
        [(8, 1, 2), (9, 2, 6), (33, 8, 20), (64, 3, 9), (50, 8, 0), (17, 1, 14)].into_iter().enumerate()
    {
        let pixels = (resolution * resolution) as usize;
        let of_pixels: Vec<_> = (0..pixels)
            .map(|_| if random.below(3) == 0 { Vec::new() } else { faces(&mut random, most) })
            .collect();
        let behind = of_pixels.iter().map(Vec::len).max().unwrap_or(0);
        // With one that is empty, and one behind it that is not looked at.
        let surfaces: Vec<twin::clip::pairs::Surface> = (0..behind + 2)
            .map(|n| {
                let of = |faces: &Vec<(f32, bool)>| match faces.get(n) {
                    Some(face) => *face,
                    None => (if n > behind { 0.5 } else { 1.0 }, true),
                };
                of_pixels.iter().map(of).unzip()
            })
            .collect();
        let expected = twin::clip::pairs::pairs(&surfaces, max);

        let (layers_at, blocks_at) = (5, 11 + Pairs::layers_len(resolution, max as u32));
        let bounds_len = Pairs::bounds_len(resolution, max as u32);
        let layers = buffer(&gpu, "layers", &vec![0x55; 4 * (blocks_at + bounds_len) as usize]);
        let to = Place { resolution, pairs: max as u32, layers: &layers, layers_at, blocks_at };
        let (working, peeled) = (Pairs::pixels(&gpu, resolution).unwrap(), Pairs::peeled(&gpu).unwrap());
        let surface = Surface::new(&gpu, resolution).unwrap();
        let bytes = 4 * pixels as u64;
        run(&gpu, |rec| Pairs::record_begin(rec, &peeled, 20).unwrap());
        for (number, (depths, front)) in surfaces.iter().enumerate() {
            let words: Vec<u32> = front.iter().map(|&front| 6 + u32::from(front)).collect();
            let staging = gpu.buffer("staging", 2 * bytes, BufferUse::Upload).unwrap();
            staging.write(0, bytemuck::cast_slice(depths)).unwrap();
            staging.write(bytes, bytemuck::cast_slice(&words)).unwrap();
            run(&gpu, |rec| {
                let size = [resolution, resolution, 1];
                for (image, at) in [(&surface.depth, 0), (&surface.face, bytes)] {
                    rec.discard(image);
                    rec.copy_buffer_to_image(&staging, at, image, [0; 3], size).unwrap();
                }
                rec.barrier(&[Access::TransferWrite], &[Access::SampledRead]);
                let number = (number as u32, number == behind + 1);
                kernel.record_add(rec, &to, &surface, number, &working, &peeled).unwrap();
            });
        }
        run(&gpu, |rec| kernel.record_finish(rec, &to, &working, &peeled).unwrap());

        let context = format!("seed {SEED} turn {turn}");
        let found: Peeled = bytemuck::pod_read_unaligned(&read_buffer(&gpu, &peeled));
        let first = expected.open.first().map_or(0, |first| (pixels - first) as u32);
        let pairs = expected.maps.len() / 2;
        let words = Peeled {
            across: 3,
            down: 3,
            pairs: pairs as u32,
            surfaces: expected.surfaces as u32,
            seen: 0,
            most: expected.most as u32,
            beyond: expected.beyond as u32,
            open: expected.open.len() as u32,
            from_first: first,
        };
        assert_eq!(found, words, "{context}");
        let all: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &layers));
        let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let maps = expected.maps.concat();
        assert!(all[layers_at as usize..][..maps.len()] == bits(&maps), "{context}");
        let bounds = bits(&twin::clip::pairs::block_bounds(&maps, resolution as usize));
        assert!(all[blocks_at as usize..][..bounds.len()] == bounds, "{context}");
        // Nothing else was written.
        let between = layers_at as usize + 2 * max * pixels..blocks_at as usize;
        assert!(all[..layers_at as usize].iter().chain(&all[between]).all(|&word| word == 0x5555_5555));
        (open_ones, beyond) = (open_ones + expected.open.len(), beyond + expected.beyond);
    }
    assert!(open_ones > 10 && beyond > 20, "{open_ones} {beyond}");
    drop(kernel);
    close(gpu);
}
