//! A hall between two rows of columns, with galleries above them, vaulted by beams; sunlit court in the middle. After what Sponza is for.

use glam::Vec3;

use super::parts::{Builder, here, plain, there};
use crate::surface::Instance;

/// Columns of a row.
const COLUMNS: u32 = 8;
/// Their distance along x.
const STEP: f32 = 150.0;

pub(super) fn make(detail: u32) -> Vec<Instance> {
    let n = detail;
    let v = Vec3::new;
    let mut hall = Builder::new("colonnade hall");
    hall.of(plain("floor", [0.55, 0.5, 0.45])).block(v(-600.0, -400.0, -20.0), v(600.0, 400.0, 0.0), 4 * n);
    hall.of(plain("wall", [0.75, 0.66, 0.52]));
    for side in [-1.0, 1.0] {
        // The outer wall, the gallery's floor, the beam on the columns, a parapet.
        let mut slab = |y0: f32, y1: f32, z0: f32, z1: f32, n: u32| {
            let (low, high) = ((side * y0).min(side * y1), (side * y0).max(side * y1));
            hall.block(v(-600.0, low, z0), v(600.0, high, z1), n);
        };
        slab(380.0, 400.0, -1.0, 520.0, 4 * n);
        slab(196.0, 381.0, 290.0, 304.0, 4 * n);
        slab(180.0, 224.0, 258.0, 291.0, 2 * n);
        slab(184.0, 192.0, 303.0, 352.0, 2 * n);
        // Cross beams below the gallery.
        for i in 0..COLUMNS {
            let x = (i as f32 - 0.5 * (COLUMNS - 1) as f32) * STEP;
            let (low, high) = ((side * 223.0).min(side * 381.0), (side * 223.0).max(side * 381.0));
            hall.block(v(x - 9.0, low, 270.0), v(x + 9.0, high, 291.0), n);
        }
    }
    hall.block(v(580.0, -381.0, -1.0), v(600.0, 381.0, 520.0), 4 * n);

    let mut column = Builder::new("colonnade column");
    let sides = 8 + 4 * n;
    column.of(plain("stone", [0.7, 0.64, 0.55]));
    column.block(v(-27.0, -27.0, -1.0), v(27.0, 27.0, 16.0), n);
    column.cylinder(v(0.0, 0.0, 15.0), v(0.0, 0.0, 26.0), [25.0, 19.0], sides, 1);
    column.cylinder(v(0.0, 0.0, 25.0), v(0.0, 0.0, 226.0), [18.0, 15.0], sides, n);
    column.cylinder(v(0.0, 0.0, 225.0), v(0.0, 0.0, 244.0), [15.0, 26.0], sides, 1);
    column.block(v(-28.0, -28.0, 243.0), v(28.0, 28.0, 259.0), n);
    let column = column.done();

    let mut all = vec![here(hall.done())];
    for i in 0..COLUMNS {
        let x = (i as f32 - 0.5 * (COLUMNS - 1) as f32) * STEP;
        all.extend([-202.0, 202.0].map(|y| there(&column, v(x, y, 0.0), 0.0, 1.0)));
        // Slighter ones on the gallery.
        all.extend([-204.0, 204.0].map(|y| there(&column, v(x, y, 304.0), 45.0, 0.6)));
    }
    all
}
