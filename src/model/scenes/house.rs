//! A house with recessed windows, a porch on posts, stairs and a steep roof. After AOV's "House": methods of the image miss its windows and
//! stairs, whose steps of depth are small.

use glam::Vec3;

use super::parts::{Builder, here, plain};
use crate::surface::Instance;

/// Half the house along x, and its front and back along y.
const HALF: f32 = 260.0;
const FRONT: f32 = -120.0;
const BACK: f32 = 200.0;
/// Height of the floor and of the walls' upper end.
const FLOOR: f32 = 48.0;
const EAVES: f32 = 270.0;
/// Thickness of walls, and how far panes lie behind them.
const WALL: f32 = 20.0;
const RECESS: f32 = 7.0;

/// Openings of a wall of this width: from and to across it, and up.
type Opening = [f32; 4];

pub(super) fn make(detail: u32) -> Vec<Instance> {
    let n = detail;
    let v = Vec3::new;
    let mut house = Builder::new("house");
    house.of(plain("lawn", [0.3, 0.42, 0.2])).block(v(-600.0, -520.0, -20.0), v(600.0, 480.0, 0.0), 4 * n);
    house.of(plain("plinth", [0.5, 0.48, 0.46]));
    house.block(v(-HALF - 8.0, FRONT - 8.0, -1.0), v(HALF + 8.0, BACK + 8.0, FLOOR), 2 * n);
    house.of(plain("render", [0.82, 0.76, 0.66]));
    let front = [[40.0, 130.0, 90.0, 190.0], [225.0, 295.0, 1.0, 160.0], [390.0, 480.0, 90.0, 190.0]];
    let side = [[50.0, 120.0, 90.0, 190.0], [190.0, 260.0, 90.0, 190.0]];
    wall(&mut house, v(-HALF, FRONT, FLOOR - 1.0), Vec3::X, 2.0 * HALF, &front, n);
    wall(&mut house, v(HALF, FRONT, FLOOR - 1.0), Vec3::Y, BACK - FRONT, &side, n);
    wall(&mut house, v(HALF, BACK, FLOOR - 1.0), -Vec3::X, 2.0 * HALF, &front, n);
    wall(&mut house, v(-HALF, BACK, FLOOR - 1.0), -Vec3::Y, BACK - FRONT, &side, n);

    house.of(plain("wood", [0.5, 0.34, 0.22]));
    // Sills, the porch's floor, posts, beam and roof.
    for x in [-HALF + 85.0, HALF - 85.0] {
        house.block(v(x - 52.0, FRONT - 8.0, FLOOR + 81.0), v(x + 52.0, FRONT + 2.0, FLOOR + 89.0), n);
    }
    house.block(v(-130.0, -230.0, 36.0), v(130.0, FRONT - 7.0, FLOOR), 2 * n);
    for x in [-118.0, -50.0, 50.0, 118.0] {
        house.cylinder(v(x, -220.0, FLOOR - 1.0), v(x, -220.0, 216.0), [6.0, 5.0], 6 + 2 * n, n);
    }
    house.block(v(-126.0, -228.0, 215.0), v(126.0, -212.0, 228.0), n);
    // Five steps: their rise is a hundredth of the distance from the eyes.
    for step in 0..5 {
        let (near, high) = (-230.0 - 16.0 * (5 - step) as f32, 7.0 * (step + 1) as f32);
        house.block(v(-46.0, near, -1.0), v(46.0, -229.0, high), n);
    }
    house.of(plain("tiles", [0.5, 0.22, 0.17]));
    let gable =
        |x: f32, y0: f32, y1: f32, z0: f32, z1: f32| [v(x, y0, z0), v(x, y1, z0), v(x, 0.5 * (y0 + y1), z1)];
    house.prism(
        &gable(-HALF - 30.0, FRONT - 30.0, BACK + 30.0, EAVES - 1.0, 450.0),
        Vec3::X * 2.0 * (HALF + 30.0),
        4 * n,
    );
    let lean = [v(-140.0, -244.0, 227.0), v(-140.0, FRONT + 4.0, 227.0), v(-140.0, FRONT + 4.0, 262.0)];
    house.prism(&lean, Vec3::X * 280.0, 2 * n);
    house.of(plain("chimney", [0.45, 0.25, 0.2])).block(v(120.0, 90.0, 300.0), v(165.0, 135.0, 490.0), n);
    vec![here(house.done())]
}

/// A wall that begins at `from` and goes `along` for a `length`, its outside to the right; what is behind openings is a pane.
fn wall(house: &mut Builder, from: Vec3, along: Vec3, length: f32, openings: &[Opening], n: u32) {
    let inwards = Vec3::Z.cross(along);
    let height = EAVES - FLOOR + 1.0;
    let mut part = |[x0, x1, z0, z1]: Opening, near: f32, far: f32, n: u32| {
        let corner = |x: f32, y: f32, z: f32| from + along * x + inwards * y + Vec3::Z * z;
        let (a, b) = (corner(x0, near, z0), corner(x1, far, z1));
        house.block(a.min(b), a.max(b), n);
    };
    // Piers between openings, and above and below each of them.
    let mut x = 0.0;
    for &[x0, x1, z0, z1] in openings {
        part([x, x0, 0.0, height], 0.0, WALL, 2 * n);
        if z0 > 1.0 {
            part([x0, x1, 0.0, z0], 0.0, WALL, n);
        }
        part([x0, x1, z1, height], 0.0, WALL, n);
        part([x0, x1, z0, z1], RECESS, RECESS + 4.0, n);
        // A cross of bars.
        let (middle, z) = (0.5 * (x0 + x1), 0.5 * (z0 + z1));
        part([middle - 2.5, middle + 2.5, z0, z1], RECESS - 3.0, RECESS + 1.0, n);
        part([x0, x1, z - 2.5, z + 2.5], RECESS - 3.0, RECESS + 1.0, n);
        x = x1;
    }
    part([x, length, 0.0, height], 0.0, WALL, 2 * n);
}
