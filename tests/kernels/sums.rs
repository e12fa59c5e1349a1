//! The kernel `sums` against its twin, bit for bit, and that its boxes are exact though the table wraps around.

use cao::field::volume_image;
use cao::tables::sums::{Counted, MOST_EXTINCTION, Sums};
use cao_gpu::Format;
use cao_measure::random::Random;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::tables::sums::{extinction_of, levels_of, sums};

/// The device's logarithm may round to the other neighbour, in each voxel that is summed.
const EXTINCTION: f64 = 1.0;

/// The table of these opacities, as the device has it and as the twin does.
fn tables(grid: &Grid, opacity: &[u16], counted: Counted) -> (Vec<u32>, Vec<u32>) {
    let gpu = open();
    let field = blank(&gpu, grid);
    let image = volume_image(&gpu, "test opacity", &field, Format::R16Unorm).unwrap();
    write_image(&gpu, &image, bytemuck::cast_slice(opacity));
    let kernel = Sums::new(&gpu, &field).unwrap();
    // Twice: what an earlier table left is not in it.
    for _ in 0..2 {
        run(&gpu, |rec| kernel.record(rec, &field, &image, counted).unwrap());
    }
    let found = bytemuck::pod_collect_to_vec(&read_image(&gpu, &kernel.table));
    let numbers: Vec<u32> = opacity
        .iter()
        .map(|&a| match counted.extinction {
            true => extinction_of(a, counted.levels(), f64::from(MOST_EXTINCTION)),
            false => levels_of(a, counted.levels()),
        })
        .collect();
    drop((kernel, image, field));
    close(gpu);
    (found, sums(grid, &numbers))
}

#[test]
fn tables_equal_their_twin_bit_for_bit() {
    let mut random = Random::new(3);
    for (grid, bits) in GRIDS.iter().zip([16, 8, 13, 16, 10, 9]) {
        let opacity: Vec<u16> = (0..grid.len()).map(|_| random.below(65536) as u16).collect();
        let counted = Counted { bits, extinction: false };
        let (found, expected) = tables(grid, &opacity, counted);
        assert!(found == expected, "{grid:?}");
        let (found, expected) = tables(grid, &opacity, Counted { extinction: true, ..counted });
        let worst = found.iter().zip(&expected).map(|(f, e)| f.abs_diff(*e)).max().unwrap();
        assert!(f64::from(worst) <= EXTINCTION * grid.len() as f64, "{grid:?}: {worst}");
    }
}

/// 2¹⁷ voxels of 16 bits: twice what 32 bits hold. Each box of eight voxels has the sum that it has.
#[test]
fn boxes_of_a_table_that_wrapped_around_are_exact() {
    let grid = Grid { dims: [64, 64, 32], spacing: [1.0; 3] };
    let mut random = Random::new(4);
    let opacity: Vec<u16> = (0..grid.len()).map(|_| 65535 - random.below(9) as u16).collect();
    let (table, _) = tables(&grid, &opacity, Counted { bits: 16, extinction: false });
    let at = |[x, y, z]: [usize; 3]| table[(z * 65 + y) * 65 + x];
    assert!(table.iter().zip(&table[1..]).any(|(a, b)| a > b && *b > 0), "nothing wrapped around");
    for _ in 0..200 {
        let low: [usize; 3] = grid.dims.map(|d| random.below(d as u64 - 1) as usize);
        let (mut sum, mut expected) = (0_u32, 0);
        for corner in 0..8_usize {
            let far: [usize; 3] = std::array::from_fn(|i| corner >> i & 1);
            expected += u32::from(opacity[grid.index(std::array::from_fn(|i| low[i] + far[i]))]);
            let term = at(std::array::from_fn(|i| low[i] + 2 * far[i]));
            let odd = far.iter().sum::<usize>() % 2 == 1;
            sum = if odd { sum.wrapping_add(term) } else { sum.wrapping_sub(term) };
        }
        assert_eq!(sum, expected, "{low:?}");
    }
}
