//! The kernel `output` against its twin: values of a grid in the listed bricks of a volume.

use cao::drive::Take;
use cao::field::bricks::BrickList;
use cao::field::volume_image;
use cao::network::output::{Bindings, Output};
use cao::network::resize::Grid as Placement;
use cao_gpu::{Access, Format};
use cao_measure::random::Random;
use cao_model::settings::Scope;
use cao_testing::*;
use cao_twin::network::output::output;
use cao_twin::network::resize::Placed;

/// V_AO is rounded to 65535ths, and places in the grid to f32.
const ROUNDED: f32 = 1e-5;

#[test]
fn values_between_those_of_the_grid_equal_the_twins() {
    let gpu = open();
    let kernel = Output::new(&gpu).unwrap();
    let mut random = Random::new(21);
    for grid in &GRIDS {
        let field = blank(&gpu, grid);
        // Some voxels need no value.
        let opacity: Vec<u16> = (0..grid.len()).map(|_| u16::from(random.below(40) == 0) * 999).collect();
        let floats: Vec<f32> = opacity.iter().map(|texel| f32::from(*texel) / 65535.0).collect();
        let image = |name| volume_image(&gpu, name, &field, Format::R16Unorm).unwrap();
        let (source, ambient) = (image("test opacity"), image("test ambient"));
        write_image(&gpu, &source, bytemuck::cast_slice(&opacity));
        write_image(&gpu, &ambient, bytemuck::cast_slice(&opacity));
        let list = BrickList::of(&gpu, &(0..field.brick_count()).collect::<Vec<_>>()).unwrap();
        for (step, scope) in [(0.4, Scope::Needed), (1.0, Scope::All), (2.3, Scope::Needed)] {
            let placed = Placed::new(grid, step, 2);
            let to = Placement {
                dims: placed.dims.map(|d| d as u32),
                before: placed.before.map(|d| d as u32),
                voxel: placed.voxel.map(|v| v as f32),
            };
            let values: Vec<f32> =
                (0..placed.dims.iter().product()).map(|_| random.between(0.0, 1.0)).collect();
            let of_grid = buffer(&gpu, "test values", bytemuck::cast_slice(&values));
            run(&gpu, |rec| {
                let b = Bindings { opacity: &source, values: &of_grid, list: &list, ambient: &ambient };
                rec.barrier(&[Access::TransferWrite], &[Access::SampledRead, Access::StorageRead]);
                kernel.record(rec, &field, &to, scope, b, &Take::All).unwrap();
                rec.barrier(&[Access::StorageWrite, Access::SampledRead], &[Access::TransferRead]);
            });
            let found: Vec<u16> = bytemuck::pod_collect_to_vec(&read_image(&gpu, &ambient));
            let expected = output(grid, &floats, &placed, &values, scope == Scope::All);
            for (i, (f, e)) in found.iter().zip(&expected).enumerate() {
                let f = f32::from(*f) / 65535.0;
                assert!((f - e).abs() <= ROUNDED, "{grid:?} step {step}, {:?}: {f} {e}", grid.voxel(i));
            }
        }
    }
    drop(kernel);
    close(gpu);
}
