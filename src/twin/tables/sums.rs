//! A summed-area table in whole numbers modulo 2³² (docs/tables.md), written from its definition: at (x, y, z) the sum over all voxels below.

use crate::{Grid, each};

/// Opacities (65535ths) in `levels` parts of 1: the nearest, half away from 0 up to rounding down of odd halves.
pub fn levels_of(opacity: u16, levels: u32) -> u32 {
    ((u64::from(opacity) * u64::from(levels) + 32767) / 65535) as u32
}

/// The same of −ln(1 − a), in `levels` parts of `most`.
pub fn extinction_of(opacity: u16, levels: u32, most: f64) -> u32 {
    let a = f64::from(opacity) / 65535.0;
    let extinction = -(1.0 - a).max(1e-6).ln();
    (extinction.min(most) * f64::from(levels) / most).round() as u32
}

/// The table of these numbers, one more along each axis, x fastest.
pub fn sums(grid: &Grid, numbers: &[u32]) -> Vec<u32> {
    let dims = grid.dims.map(|d| d + 1);
    let table = Grid { dims, ..*grid };
    each(table.len(), |i| {
        let [x, y, z] = table.voxel(i);
        let row = |j: usize, k: usize| numbers[grid.index([0, j, k])..].iter().take(x);
        let below = (0..z).flat_map(|k| (0..y).map(move |j| (j, k)));
        below.flat_map(|(j, k)| row(j, k)).fold(0_u32, |sum, q| sum.wrapping_add(*q))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ones_count_and_wrap_around() {
        let grid = Grid { dims: [3, 2, 4], spacing: [1.0; 3] };
        let table = sums(&grid, &[1; 24]);
        let at = |[x, y, z]: [usize; 3]| table[(z * 3 + y) * 4 + x];
        assert_eq!((at([3, 2, 4]), at([2, 1, 3]), at([0, 2, 4])), (24, 6, 0));
        let large = sums(&grid, &[1 << 31; 24]);
        assert_eq!((large[4 + 1], large[(3 + 1) * 4 + 1], *large.last().unwrap()), (0, 1 << 31, 0));
    }

    #[test]
    fn numbers_are_the_nearest() {
        assert_eq!([0, 1, 32767, 32768, 65535].map(|a| levels_of(a, 255)), [0, 0, 127, 128, 255]);
        assert_eq!([0, 7, 65535].map(|a| levels_of(a, 65535)), [0, 7, 65535]);
        assert_eq!(extinction_of(65535, 255, 11.09), 255);
        assert_eq!(extinction_of(0, 255, 11.09), 0);
    }

    /// Half a part at most, and somewhere that: 7.6e-6 at 16 bits, of opacities that V_o rounds first; of 65535ths no 16 bits take anything.
    #[test]
    fn an_opacity_is_off_by_half_a_part_at_most() {
        let most = |bits: u32, places: u32| {
            let levels = (1_u32 << bits) - 1;
            let off = |step: u32| {
                let a = f64::from(step) / f64::from(places);
                let texel = (65535.0 * a).round() as u16;
                (f64::from(levels_of(texel, levels)) / f64::from(levels) - a).abs()
            };
            (0..=places).map(off).fold(0.0, f64::max)
        };
        let (rounded, none) = (most(16, 8 * 65535), most(16, 65535));
        assert!((rounded - 7.63e-6).abs() < 1e-8 && none < 1e-12, "{rounded} {none}");
        for (bits, expected) in [(15, 1.53e-5), (13, 6.1e-5), (10, 4.89e-4), (8, 1.96e-3)] {
            let found = most(bits, 65535);
            assert!((found / expected - 1.0).abs() < 0.01, "{bits}: {found}");
        }
    }
}
