//! A relief of stone: courses of masonry, a frame, three rosettes and braids between them, on one height field. After AOV's "Belgium", whose
//! triangles are as small as pixels.

use glam::{Vec2, Vec3};

use super::parts::{Builder, here, plain};
use crate::surface::Instance;

/// Half its width, its height, its depth behind the ground of the ornament.
const HALF: f32 = 440.0;
const HEIGHT: f32 = 660.0;
const DEPTH: f32 = 40.0;

pub(super) fn make(detail: u32) -> Vec<Instance> {
    let n = detail;
    let cells = [36 * n, 27 * n];
    let v = Vec3::new;
    let mut stone = Builder::new("relief");
    stone.of(plain("ground", [0.5, 0.47, 0.43])).block(v(-600.0, -300.0, -20.0), v(600.0, 80.0, 0.0), 4 * n);
    stone.of(plain("stone", [0.72, 0.68, 0.6]));
    // Columns that frame it, and a cornice.
    for x in [-490.0, 490.0] {
        stone.cylinder(v(x, 5.0, -1.0), v(x, 5.0, 661.0), [38.0, 34.0], 12 + 6 * n, 2 * n);
    }
    stone.block(v(-560.0, -50.0, 660.0), v(560.0, 60.0, 690.0), 2 * n);
    stone.block(v(-580.0, -62.0, 689.0), v(580.0, 70.0, 706.0), 2 * n);
    // The front faces −y; its border is flat, so that flat sides close it.
    let place = |uv: Vec2, out: f32| v(HALF * (2.0 * uv.x - 1.0), -out, HEIGHT * uv.y - 1.0);
    let back = |uv: Vec2| place(uv, -DEPTH);
    stone.patch(cells, Vec2::ONE, |uv| {
        let border = uv.x == 0.0 || uv.x == 1.0 || uv.y == 0.0 || uv.y == 1.0;
        place(uv, if border { 0.0 } else { height(v(HALF, 0.0, HEIGHT) * v(2.0 * uv.x - 1.0, 0.0, uv.y)) })
    });
    // Coordinates change places rather than run backwards, so that faces share their edges to the last digit.
    stone.patch([cells[1], cells[0]], Vec2::ONE, |uv| back(Vec2::new(uv.y, uv.x)));
    let side = |at: Vec2, out: f32| if out == 0.0 { place(at, 0.0) } else { back(at) };
    stone.patch([cells[0], 1], Vec2::ONE, |uv| side(Vec2::new(uv.x, 1.0), uv.y));
    stone.patch([1, cells[0]], Vec2::ONE, |uv| side(Vec2::new(uv.y, 0.0), uv.x));
    stone.patch([1, cells[1]], Vec2::ONE, |uv| side(Vec2::new(1.0, uv.y), uv.x));
    stone.patch([cells[1], 1], Vec2::ONE, |uv| side(Vec2::new(0.0, uv.x), uv.y));
    vec![here(stone.done())]
}

/// How far the stone stands out at x, z in mm.
fn height(at: Vec3) -> f32 {
    let (x, z) = (at.x, at.z);
    // Masonry: courses of 60 mm, every second one moved by half a stone, joints 5 mm wide and 7 deep.
    let course = (z / 60.0).floor();
    let joint = |t: f32, size: f32| ((t / size - (t / size).round()).abs() * size / 2.5).min(1.0);
    let stones = 7.0 * joint(z, 60.0).min(joint(x + 45.0 * (course % 2.0), 90.0));
    let frame = {
        let edge = (HALF - x.abs()).min(z).min(HEIGHT - z);
        // A moulding of two steps and a round.
        if edge < 18.0 {
            34.0
        } else if edge < 26.0 {
            22.0
        } else {
            round(edge - 36.0, 9.0) + 8.0 * f32::from(edge < 46.0)
        }
    };
    // Two braids of three strands.
    let braid = |z0: f32| {
        (0..3).fold(0.0_f32, |highest, strand| {
            let phase = x / 34.0 + strand as f32 * 2.094_395;
            // A strand goes over and under: it rises by its own double frequency.
            let rise = 5.0 * (2.0 * phase).cos();
            highest.max(round(z - z0 - 22.0 * phase.sin(), 11.0) * (11.0 + rise) / 11.0)
        })
    };
    let braids = if x.abs() < HALF - 60.0 { 1.6 * braid(110.0).max(braid(550.0)) } else { 0.0 };
    // Rosettes: petals round a button.
    let rosettes = [-260.0, 0.0, 260.0].into_iter().fold(0.0_f32, |highest, x0| {
        let (d, size) = (Vec2::new(x - x0, z - 330.0), if x0 == 0.0 { 130.0 } else { 95.0 });
        let (r, angle) = (d.length() / size, d.y.atan2(d.x));
        let petals = (6.0 * angle).cos().abs().sqrt();
        let petal = 26.0 * petals * (1.0 - (2.0 * r - 1.15).powi(2)).max(0.0).sqrt() * f32::from(r < 1.05);
        let rim = round((r - 1.14) * size, 8.0);
        highest.max(petal).max(round(r * size, 0.28 * size) * 0.8).max(1.3 * rim)
    });
    stones.max(frame).max(braids).max(rosettes)
}

/// Height of a half-round of this radius at a distance from its axis.
fn round(d: f32, radius: f32) -> f32 {
    (radius * radius - d * d).max(0.0).sqrt()
}
