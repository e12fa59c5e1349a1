//! Layer pairs of a clip mesh from its surfaces in the order of depth, and the bounds of blocks of them, to the bit.
//!
//! Along the ray of a pixel each face adds 1 to the winding number or takes 1 away, as it faces the clip camera or not. A pair begins where
//! the number leaves 0 and ends where it is 0 again, so that the pairs are the solid itself. (`peel` has the same from sorted faces.)

use crate::clip::clips::{NO_BACK, NO_FRONT};
use cao_kernels::shared::layers::{BLOCK, BLOCK_BOUNDS, EMPTY, ONE_DEPTH};

/// Depths of a surface, rows of y, [`EMPTY`] where it has none, and whether it faces the clip camera there.
pub type Surface = (Vec<f32>, Vec<bool>);

/// What the surfaces of a mesh make.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Front and back map of each pair that is kept; at least one pair.
    pub maps: Vec<Vec<f32>>,
    /// Surfaces before the first that no pixel has.
    pub surfaces: usize,
    /// Most pairs of a pixel that have ended, and pixels with more than are kept.
    pub most: usize,
    /// See `most`.
    pub beyond: usize,
    /// Pixels at which fronts and backs differ in number.
    pub open: Vec<usize>,
}

/// The pairs of each pixel, of which `max` are kept.
pub fn pairs(surfaces: &[Surface], max: usize) -> Found {
    let pixels = surfaces.first().map_or(0, |surface| surface.0.len());
    let empty = |surface: &Surface| surface.0.iter().all(|&z| z >= EMPTY);
    let surfaces = &surfaces[..surfaces.iter().position(empty).unwrap_or(surfaces.len())];
    // A solid so small or thin that it falls between all pixels hides nothing: one pair of empty layers.
    let mut maps = vec![vec![EMPTY; pixels]; 2];
    let (mut most, mut beyond, mut open) = (0, 0, Vec::new());
    for pixel in 0..pixels {
        let (mut winding, mut count) = (0, 0);
        // Where the last pair began and ended.
        let mut last = [EMPTY; 2];
        for (depths, front) in surfaces {
            let z = depths[pixel];
            if z >= EMPTY {
                continue;
            }
            let before = winding;
            winding += if front[pixel] { 1 } else { -1 };
            if before == 0 {
                // A gap of nothing is none: the last pair goes on.
                if count == 0 || z - last[1] > ONE_DEPTH {
                    count += 1;
                    last = [z, z];
                }
            } else if winding == 0 {
                last[1] = z;
                if z - last[0] <= ONE_DEPTH {
                    // Nor is a pair of nothing one, nor does anything go on from it.
                    count -= 1;
                    last[1] = f32::NEG_INFINITY;
                } else if count <= max {
                    while maps.len() < 2 * count {
                        maps.push(vec![EMPTY; pixels]);
                    }
                    maps[2 * count - 2][pixel] = last[0];
                    maps[2 * count - 1][pixel] = z;
                }
            }
        }
        if winding != 0 {
            open.push(pixel);
            // It has not ended.
            count -= 1;
        }
        most = most.max(count);
        beyond += usize::from(count > max);
    }
    Found { maps, surfaces: surfaces.len(), most, beyond, open }
}

/// Of layers as the device has them, for each pair: nearest front, farthest back, farthest front and nearest back of each block of pixels,
/// rows of y. A pixel with nothing inside counts as [`NO_FRONT`] and [`NO_BACK`], behind and before everything.
pub fn block_bounds(depth: &[f32], resolution: usize) -> Vec<f32> {
    let size = BLOCK as usize;
    let edge = resolution.div_ceil(size);
    let mut bounds = Vec::new();
    for pair in depth.chunks_exact(2 * resolution * resolution) {
        let (front, back) = pair.split_at(resolution * resolution);
        let mut pair = [(); BLOCK_BOUNDS as usize].map(|()| Vec::with_capacity(edge * edge));
        for block in 0..edge * edge {
            let range = |at: usize| at * size..((at + 1) * size).min(resolution);
            let mut b = [NO_FRONT, NO_BACK, NO_BACK, NO_FRONT];
            for pixel in
                range(block / edge).flat_map(|y| range(block % edge).map(move |x| y * resolution + x))
            {
                let (f, k) = match (front[pixel], back[pixel]) {
                    (f, k) if f < k => (f, k),
                    _ => (NO_FRONT, NO_BACK),
                };
                b = [b[0].min(f), b[1].max(k), b[2].max(f), b[3].min(k)];
            }
            pair.iter_mut().zip(b).for_each(|(list, bound)| list.push(bound));
        }
        bounds.extend(pair.into_iter().flatten());
    }
    bounds
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One pixel and the faces behind it: depth, and whether it is a front.
    fn of(faces: &[(f32, bool)]) -> Found {
        let surfaces: Vec<Surface> = faces.iter().map(|&(z, front)| (vec![z], vec![front])).collect();
        pairs(&surfaces, 2)
    }

    #[test]
    fn pairs_are_where_the_winding_number_is_not_0() {
        let (front, back) = (true, false);
        let maps = |faces: &[(f32, bool)]| of(faces).maps.concat();
        assert_eq!(maps(&[]), Vec::<f32>::new());
        assert_eq!(maps(&[(0.2, front), (0.4, back)]), [0.2, 0.4]);
        // Inside out, nested, touching.
        assert_eq!(maps(&[(0.2, back), (0.4, front)]), [0.2, 0.4]);
        assert_eq!(maps(&[(0.1, front), (0.2, front), (0.4, back), (0.5, back)]), [0.1, 0.5]);
        assert_eq!(maps(&[(0.1, front), (0.2, back), (0.2, front), (0.3, back)]), [0.1, 0.3]);
        // Apart, and a pair of nothing between.
        let apart = [(0.1, front), (0.2, back), (0.25, front), (0.25, back), (0.3, front), (0.4, back)];
        assert_eq!(maps(&apart), [0.1, 0.2, 0.3, 0.4]);
        let three = of(&[apart.as_slice(), &[(0.5, front), (0.6, back)]].concat());
        assert_eq!((three.most, three.beyond, three.open.len(), three.maps.len()), (3, 1, 0, 4));
        assert_eq!(of(&[(0.1, front)]).open, [0]);
    }

    #[test]
    fn bounds_of_a_block_hold_all_its_pixels() {
        let mut layers = [vec![EMPTY; 17 * 17], vec![EMPTY; 17 * 17]].concat();
        for (pixel, front, back) in [(0, 0.2, 0.7), (1, 0.3, 0.9), (16, 0.4, 0.5)] {
            (layers[pixel], layers[17 * 17 + pixel]) = (front, back);
        }
        let bounds = block_bounds(&layers, 17);
        assert_eq!(bounds.len(), 16);
        // Of the first block a pixel is empty; the second is one pixel wide and has none.
        assert_eq!([0, 4, 8, 12].map(|map| bounds[map]), [0.2, 0.9, NO_FRONT, NO_BACK]);
        assert_eq!([1, 5, 9, 13].map(|map| bounds[map]), [0.4, 0.5, NO_FRONT, NO_BACK]);
    }
}
