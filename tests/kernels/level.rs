//! The kernel `level` against its twin: every cell that is stored, of every form.

use cao::field::volume_image;
use cao::field::volume_of;
use cao::pyramid::level::MakeLevel;
use cao::pyramid::plan::Plan;
use cao_gpu::{Access, Format, Image};
use cao_measure::random::Random;
use cao_model::options::Levels;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::pyramid::level::Means;

/// Each level is rounded to 65535ths once more, and means of it keep what was lost before; opacities of another length are rounded too, by a
/// `pow` that is off by far less.
const ROUNDING: f64 = 0.51 / 65535.0;

#[test]
fn every_cell_equals_the_mean_that_it_stands_for() {
    let gpu = open();
    let make = MakeLevel::new(&gpu).unwrap();
    let mut random = Random::new(31);
    let extra = [
        Grid { dims: [33, 17, 21], spacing: [1.0; 3] },
        Grid { dims: [26, 20, 9], spacing: [1.0, 0.5, 1.6] },
    ];
    let mut cells = 0;
    for grid in GRIDS.iter().chain(&extra) {
        let field = blank(&gpu, grid);
        let opacity: Vec<u16> = (0..grid.len()).map(|_| random.below(65536) as u16).collect();
        let image = volume_image(&gpu, "test opacity", &field, Format::R16Unorm).unwrap();
        write_image(&gpu, &image, bytemuck::cast_slice(&opacity));
        let floats: Vec<f32> = opacity.iter().map(|&a| f32::from(a) / 65535.0).collect();
        for form in [Levels::Nbuffer, Levels::Mip, Levels::Mixed(1), Levels::Reversed(2)] {
            let another = random.below(2) == 1;
            let reference_mm = grid.min_spacing() * if another { 2.5 } else { 1.0 };
            let plan = Plan::of(field.dims, field.spacing, 4, form, 1.0);
            let means = Means::new(grid, &floats, reference_mm, 4, form);
            let mut exponent = (grid.min_spacing() / reference_mm) as f32;
            let mut made: Option<Image> = None;
            for l in 1..=4 {
                let now = plan.cells[l];
                let coarser = volume_of(&gpu, "test level", now.dims, Format::R16Unorm).unwrap();
                run(&gpu, |rec| {
                    rec.discard(&coarser);
                    let finer = made.as_ref().unwrap_or(&image);
                    make.record(rec, [&plan.cells[l - 1], &now], exponent, [finer, &coarser]).unwrap();
                    rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
                });
                let found: Vec<u16> = bytemuck::pod_collect_to_vec(&read_image(&gpu, &coarser));
                let stored = Grid { dims: now.dims.map(|n| n as usize), spacing: [1.0; 3] };
                for (i, &found) in found.iter().enumerate() {
                    let cell = stored.voxel(i);
                    let place = std::array::from_fn(|i| {
                        let low = (now.first[i] + cell[i] as i64) * now.stride[i];
                        low as f64 + 0.5 * now.width[i] as f64
                    });
                    let (found, expected) = (f64::from(found) / 65535.0, means.around(l, place));
                    let off = (found - expected).abs();
                    let context = || format!("{form:?} {grid:?} level {l} cell {cell:?}: {found} {expected}");
                    let roundings = l + usize::from(another);
                    assert!(off <= roundings as f64 * ROUNDING, "{}", context());
                }
                cells += found.len();
                (made, exponent) = (Some(coarser), 1.0);
            }
        }
    }
    assert!(cells > 50_000, "{cells}");
    drop(make);
    close(gpu);
}
