//! The kernel `resize` against its twin: volumes in grids that are finer, coarser and as fine; tensors halved.

use cao::network::resize::{Resize, items};
use cao_gpu::{Access, BufferUse, Format};
use cao_measure::random::Random;
use cao_testing::*;
use cao_twin::network::Tensor;
use cao_twin::network::resize::{Placed, halve, shrink};

#[test]
fn volumes_in_grids_equal_the_twins() {
    let gpu = open();
    let mut random = Random::new(8);
    let kernel = Resize::new(&gpu).unwrap();
    for grid in &GRIDS {
        let opacity: Vec<u16> = (0..grid.len()).map(|_| random.bits() as u16).collect();
        let floats: Vec<f32> = opacity.iter().map(|texel| f32::from(*texel) / 65535.0).collect();
        let field = blank(&gpu, grid);
        let image = cao::field::volume_image(&gpu, "test opacity", &field, Format::R16Unorm).unwrap();
        write_image(&gpu, &image, bytemuck::cast_slice(&opacity));
        for (step, exponent) in [(0.37, 0.6), (1.0, 1.0), (2.6, 2.3)] {
            let placed = Placed::new(grid, step, 4);
            let dims = placed.dims.map(|d| d as u32);
            let (before, voxel) = (placed.before.map(|d| d as i32), placed.voxel.map(|v| v as f32));
            let voxels: usize = placed.dims.iter().product();
            let out = gpu.buffer("test grid", 4 * voxels as u64, BufferUse::Device).unwrap();
            run(&gpu, |rec| {
                let items = 0..items(voxels as u32);
                kernel.record_shrink(rec, &image, &out, dims, before, voxel, exponent, items).unwrap();
                rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
            });
            let found: Vec<f32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &out));
            let expected = shrink(grid, &floats, &placed, f64::from(exponent));
            // Positions are f32 in shares of an edge. Powers of what is left below 1 are steep near full opacity: |a^p - b^p| <= |a - b|^p.
            let tolerance = 4e-5 + (filter_error(&gpu) as f32).powf(exponent.min(1.0)) * exponent.max(1.0);
            for (i, (f, e)) in found.iter().zip(&expected).enumerate() {
                assert!((f - e).abs() <= tolerance, "{grid:?} step {step}, {i}: {f} {e}");
            }
        }
    }
    drop(kernel);
    close(gpu);
}

#[test]
fn every_second_voxel_is_the_twins() {
    let gpu = open();
    let kernel = Resize::new(&gpu).unwrap();
    let (fine, dims) = ([10, 6, 4], [5, 3, 2]);
    // A voxel's 8 channels of 16 bits, as numbers that say where it is.
    let number = |b: usize, v: usize, c: usize| (b * 4096 + v * 8 + c) as u16;
    let words: Vec<u16> =
        (0..3).flat_map(|b| (0..240).flat_map(move |v| (0..8).map(move |c| number(b, v, c)))).collect();
    let source = buffer(&gpu, "test tensor", bytemuck::cast_slice(&words));
    let out = gpu.buffer("test half", 16 * 30 * 3, BufferUse::Device).unwrap();
    run(&gpu, |rec| {
        kernel.record_halve(rec, [&source, &out], dims, 3, 0..items(90)).unwrap();
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
    });
    let found: Vec<u16> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &out));
    let channel = |b: usize, c: usize| (0..240).map(move |v| f32::from(number(b, v, c)));
    let values = (0..24).flat_map(|n| channel(n / 8, n % 8)).collect();
    let expected = halve(&Tensor { dims: fine, values }).values;
    for (i, value) in expected.iter().enumerate() {
        let (channel, voxel) = (i / 30, i % 30);
        let at = (channel / 8 * 30 + voxel) * 8 + channel % 8;
        assert_eq!(f32::from(found[at]), *value, "channel {channel}, voxel {voxel}");
    }
    drop((kernel, source, out));
    close(gpu);
}
