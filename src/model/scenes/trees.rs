//! Trees over a meadow: branches with masked leaves, two sheets across one another a twig. After AOV's "Trees".

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use super::parts::{Builder, chance, here, masked, plain, there};
use crate::surface::{Instance, Surface};
use std::sync::Arc;

/// Branches of a tree.
const BRANCHES: u32 = 14;

pub(super) fn make(detail: u32) -> Vec<Instance> {
    let mut meadow = Builder::new("trees meadow");
    meadow.of(plain("meadow", [0.32, 0.44, 0.2]));
    meadow.patch([12 * detail, 12 * detail], Vec2::ONE, |uv| {
        let at = Vec2::new(1200.0 * uv.x - 600.0, 1000.0 * uv.y - 500.0);
        at.extend(hill(at))
    });
    let kinds = [tree(1, detail), tree(2, detail)];
    let mut all = vec![here(meadow.done())];
    for (i, (x, y, size)) in [
        (-210.0, -90.0, 1.0),
        (40.0, 30.0, 1.2),
        (260.0, -140.0, 0.85),
        (-390.0, 190.0, 1.15),
        (180.0, 240.0, 1.05),
        (410.0, 120.0, 1.2),
        (-90.0, 310.0, 0.95),
    ]
    .into_iter()
    .enumerate()
    {
        // Its foot a little below the ground.
        let foot = Vec3::new(x, y, hill(Vec2::new(x, y)) - 4.0);
        all.push(there(&kinds[i % 2], foot, 51.0 * i as f32, size));
    }
    all
}

/// Height of the ground, −25 … 25.
fn hill(at: Vec2) -> f32 {
    15.0 * (at.x / 140.0).sin() * (at.y / 170.0).cos() + 10.0 * ((at.x + 1.7 * at.y) / 90.0).sin()
}

fn tree(seed: u32, detail: u32) -> Arc<Surface> {
    let v = Vec3::new;
    let luck = |number: u32| chance(seed, number);
    let mut tree = Builder::new(&format!("tree {seed}"));
    let sides = 5 + detail;
    tree.of(plain("bark", [0.34, 0.25, 0.18]));
    tree.cylinder(v(0.0, 0.0, 0.0), v(6.0, 2.0, 150.0), [15.0, 10.0], sides, detail);
    tree.cylinder(v(6.0, 2.0, 148.0), v(2.0, 5.0, 280.0), [10.0, 4.0], sides, detail);
    let branch = |i: u32| {
        let (turn, up) = (TAU * (i as f32 * 0.381_966 + 0.1 * luck(i)), i as f32 / BRANCHES as f32);
        let from = v(4.0, 3.0, 110.0 + 160.0 * up);
        let reach = (95.0 - 45.0 * up) * (0.8 + 0.4 * luck(100 + i));
        (from, from + v(turn.cos() * reach, turn.sin() * reach, 20.0 + 30.0 * luck(200 + i)))
    };
    for (from, to) in (0..BRANCHES).map(branch) {
        tree.cylinder(from, to, [4.0, 1.2], 6, 1);
    }
    // Four leaves on a twig along the sheet's middle.
    let leaves = masked("leaves", [0.24, 0.42, 0.14], 64, |uv| {
        let leaf = |x: f32, y: f32, turn: f32| {
            let d = Vec2::from_angle(-turn).rotate(uv - Vec2::new(x, y));
            let thickness = 0.11 * (1.0 - (d.x / 0.22).powi(2));
            d.x.abs() < 0.22 && d.y.abs() < thickness
        };
        leaf(0.28, 0.27, 0.7)
            || leaf(0.72, 0.3, 2.5)
            || leaf(0.27, 0.72, -0.5)
            || leaf(0.74, 0.74, 3.6)
            || (uv.x - 0.5).abs() < 0.012
    });
    tree.of(leaves);
    let twigs = 10 * detail;
    for (b, (from, to)) in (0..BRANCHES).map(branch).enumerate() {
        for i in 0..twigs {
            let number = 1000 + b as u32 * 4096 + i * 8;
            let along = from.lerp(to, 0.25 + 0.8 * (i as f32 + luck(number)) / twigs as f32);
            let off = |k: u32| 2.0 * luck(number + k) - 1.0;
            let middle = along + v(off(1), off(2), 0.7 * off(3)) * 26.0;
            let axis = v(off(4), off(5), 0.6 + 0.4 * off(6)).normalize_or(Vec3::Z);
            let (right, ahead) = axis.any_orthonormal_pair();
            for across in [right, ahead] {
                tree.patch([1, 1], Vec2::ONE, |uv| {
                    middle + (across * (uv.x - 0.5) + axis * (uv.y - 0.5)) * 34.0
                });
            }
        }
    }
    tree.done()
}
