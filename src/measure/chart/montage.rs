//! Pictures side by side and above one another, and parts of them enlarged: how figures of papers are laid out.

use cao_formats::Picture;

/// Crops are enlarged by this.
pub(super) const CROP: u32 = 4;

/// The first pixel of the part, a [`CROP`]th of both edges, in which two pictures of one size differ most: what a close-up is to show. Where
/// they are the same, of the lightest.
pub(super) fn most_different(pictures: &[Picture]) -> [u32; 2] {
    let [a, b] = pictures else { return [0; 2] };
    let part = [a.width, a.height].map(|edge| edge / CROP);
    let differences = |[x, y]: [u32; 2]| -> u64 {
        let pixels =
            (y..y + part[1]).flat_map(|row| (x..x + part[0]).map(move |column| row * a.width + column));
        let apart = |i: u32| (0..3).map(move |c| a.pixels[i as usize][c].abs_diff(b.pixels[i as usize][c]));
        pixels.flat_map(apart).map(u64::from).sum()
    };
    // Half a part apart, all within.
    let steps = 2 * CROP - 1;
    let places = (0..steps * steps).map(|n| [n % steps * part[0] / 2, n / steps * part[1] / 2]);
    let light = |[x, y]: [u32; 2]| -> u64 {
        let pixels =
            (y..y + part[1]).flat_map(|row| (x..x + part[0]).map(move |column| row * a.width + column));
        pixels.map(|i| u64::from(a.pixels[i as usize][1])).sum()
    };
    places.max_by_key(|&place| (differences(place), light(place))).unwrap_or([0; 2])
}

/// A [`CROP`]th of both edges from this pixel on, enlarged to the picture's own size; pixels stay pixels.
pub(super) fn crop(of: &Picture, first: [u32; 2]) -> Picture {
    let size = [of.width, of.height];
    let pixel = |i: u32| {
        let (x, y) = (first[0] + i % size[0] / CROP, first[1] + i / size[0] / CROP);
        of.pixels[(y * size[0] + x) as usize]
    };
    Picture { width: size[0], height: size[1], pixels: (0..size[0] * size[1]).map(pixel).collect() }
}

/// Pictures of one height, from the left to the right.
pub(super) fn beside(pictures: &[Picture]) -> Picture {
    let height = pictures.iter().map(|picture| picture.height).min().unwrap_or(0);
    let row = |y: u32| {
        pictures.iter().flat_map(move |p| {
            let first = (y * p.width) as usize;
            p.pixels[first..first + p.width as usize].iter().copied()
        })
    };
    let width = pictures.iter().map(|picture| picture.width).sum();
    Picture { width, height, pixels: (0..height).flat_map(row).collect() }
}

/// Pictures of one width, from the top down.
pub(super) fn above(pictures: &[Picture]) -> Picture {
    let width = pictures.iter().map(|picture| picture.width).min().unwrap_or(0);
    let height = pictures.iter().map(|picture| picture.height).sum();
    Picture {
        width,
        height,
        pixels: pictures.iter().flat_map(|picture| picture.pixels.iter().copied()).collect(),
    }
}
