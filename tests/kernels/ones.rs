//! The kernel `ones`: every voxel holds 1, whatever it held.

use cao::field::ones::Ones;
use cao::field::volume_image;
use cao_gpu::{Access, Format};
use cao_testing::*;

#[test]
fn every_voxel_holds_one() {
    let gpu = open();
    let kernel = Ones::new(&gpu).unwrap();
    for grid in &GRIDS {
        let field = blank(&gpu, grid);
        for format in [Format::R16Unorm, Format::R32Float, Format::Rgba16Unorm] {
            if !gpu.stores(format) {
                continue;
            }
            let volume = volume_image(&gpu, "volume", &field, format).unwrap();
            let found = |ones: bool| {
                run(&gpu, |rec| {
                    rec.discard(&volume);
                    rec.barrier(&[], &[Access::TransferWrite]);
                    rec.clear_image(&volume, [0.25; 4]).unwrap();
                    rec.barrier(&[Access::TransferWrite], &[Access::StorageWrite, Access::TransferRead]);
                    if ones {
                        kernel.record(rec, &volume).unwrap();
                        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
                    }
                });
                let content = read_image(&gpu, &volume);
                match format {
                    Format::R32Float => {
                        let floats: Vec<f32> = bytemuck::pod_collect_to_vec(&content);
                        floats.into_iter().filter(|v| *v == 1.0).count()
                    }
                    _ => {
                        let halves: Vec<u16> = bytemuck::pod_collect_to_vec(&content);
                        halves.into_iter().filter(|v| *v == 65535).count()
                    }
                }
            };
            let components = if format == Format::Rgba16Unorm { 4 } else { 1 } * grid.len();
            assert_eq!((found(false), found(true)), (0, components), "{format:?}, {grid:?}");
        }
    }
    drop(kernel);
    close(gpu);
}
