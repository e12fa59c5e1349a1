//! A level of a game, of boxes: a grid of cells with crates, machines, pillars, catwalks and pipes. After AOV's "Secret War", by whose number of
//! triangles methods over triangles are judged; `detail` divides each face of the same boxes.

use glam::Vec3;

use super::parts::{Builder, chance, here, plain};
use crate::surface::Instance;

/// Cells along each axis, and the size of one.
const CELLS: u32 = 10;
const CELL: f32 = 100.0;

pub(super) fn make(detail: u32) -> Vec<Instance> {
    let n = detail;
    let v = Vec3::new;
    let half = 0.5 * CELLS as f32 * CELL;
    let mut level = Builder::new("level");
    level.of(plain("floor", [0.4, 0.4, 0.42])).block(v(-half, -half, -20.0), v(half, half, 0.0), 10 * n);
    level.of(plain("walls", [0.5, 0.48, 0.44]));
    level.block(v(-half, half - 10.0, -1.0), v(half, half + 10.0, 240.0), 6 * n);
    level.block(v(half - 10.0, -half, -1.0), v(half + 10.0, half - 10.0, 240.0), 6 * n);

    level.of(plain("crates", [0.58, 0.46, 0.3]));
    cells(|middle, luck| {
        let count = (5.0 * luck(0)) as u32;
        for i in 0..count {
            let size = v(10.0 + 16.0 * luck(10 + i), 10.0 + 16.0 * luck(20 + i), 12.0 + 40.0 * luck(30 + i));
            let at = middle + v(60.0 * luck(40 + i) - 30.0, 60.0 * luck(50 + i) - 30.0, 0.0);
            level.block(at - v(size.x, size.y, 1.0), at + size, n);
            // Another on top of it, smaller.
            let above = at + v(0.0, 0.0, size.z - 0.5);
            level.block(above - v(0.6 * size.x, 0.5 * size.y, 0.0), above + 0.6 * size, n);
        }
    });
    level.of(plain("pillars", [0.55, 0.56, 0.58]));
    cells(|middle, luck| {
        if luck(1) < 0.35 {
            level.cylinder(middle - Vec3::Z, middle + v(0.0, 0.0, 170.0), [9.0, 9.0], 4 + 4 * n, 3 * n);
            level.block(middle - v(14.0, 14.0, 1.0), middle + v(14.0, 14.0, 12.0), n);
        } else if luck(1) < 0.6 {
            // A machine: a body with ribs.
            level.block(middle - v(30.0, 22.0, 1.0), middle + v(30.0, 22.0, 46.0), 2 * n);
            for rib in 0..6 {
                let x = -27.0 + 10.0 * rib as f32;
                level.block(middle + v(x, -26.0, -1.0), middle + v(x + 4.0, 26.0, 50.0), n);
            }
        }
    });
    // Catwalks of slats along every third row of cells, and pipes below them.
    level.of(plain("catwalks", [0.44, 0.45, 0.48]));
    for row in (1..CELLS).step_by(3) {
        let y = (row as f32 + 0.5) * CELL - half;
        for slat in 0..(CELLS * 5) {
            let x = slat as f32 * 20.0 - half;
            level.block(v(x + 2.0, y - 24.0, 120.0), v(x + 18.0, y + 24.0, 124.0), n);
        }
        for side in [-24.0, 21.0] {
            level.block(v(-half, y + side, 112.0), v(half, y + side + 3.0, 121.0), 2 * n);
        }
        level.cylinder(v(-half, y - 6.0, 104.0), v(half, y - 6.0, 104.0), [6.0, 6.0], 4 + 4 * n, 8 * n);
        level.cylinder(v(-half, y + 10.0, 102.0), v(half, y + 10.0, 102.0), [4.0, 4.0], 4 + 4 * n, 8 * n);
    }
    vec![here(level.done())]
}

/// Every cell with the middle of its floor and numbers of its own from 0 to 1.
fn cells(mut furnish: impl FnMut(Vec3, &dyn Fn(u32) -> f32)) {
    for cell in 0..CELLS * CELLS {
        let place = |i: u32| (i as f32 + 0.5 - 0.5 * CELLS as f32) * CELL;
        let middle = Vec3::new(place(cell % CELLS), place(cell / CELLS), 0.0);
        furnish(middle, &|number| chance(7 + cell, number));
    }
}
