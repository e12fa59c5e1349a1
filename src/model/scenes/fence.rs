//! A chain-link fence: two triangles a field, whose mask has the wires, between posts; crates before and a wall behind it. After AOV's "City".

use glam::{Vec2, Vec3};

use super::parts::{Builder, here, masked, plain, there};
use crate::surface::Instance;

/// Meshes across and up a field. Odd, so that the even grid of places that a triangle's opacity is the mean of does not fall into step.
const MESHES: Vec2 = Vec2::new(25.0, 11.0);
/// Half the width of a wire, as a share of a mesh.
const WIRE: f32 = 0.055;

pub(super) fn make(detail: u32) -> Vec<Instance> {
    let n = detail;
    let v = Vec3::new;
    let mut ground = Builder::new("fence ground");
    ground.of(plain("asphalt", [0.42, 0.42, 0.44])).block(
        v(-600.0, -420.0, -20.0),
        v(600.0, 420.0, 0.0),
        4 * n,
    );
    ground.of(plain("brick", [0.6, 0.34, 0.26])).block(v(-600.0, 300.0, -1.0), v(600.0, 340.0, 330.0), 4 * n);
    ground.of(plain("concrete", [0.62, 0.62, 0.6])).block(
        v(-600.0, 252.0, -1.0),
        v(600.0, 301.0, 12.0),
        2 * n,
    );

    // Wires run along both diagonals of a mesh.
    let wires = masked("wires", [0.6, 0.62, 0.64], 64, |uv| {
        let from_line = |t: f32| (t - t.round()).abs();
        from_line(uv.x + uv.y) < 2.0 * WIRE || from_line(uv.x - uv.y) < 2.0 * WIRE
    });
    let mut field = Builder::new("fence field");
    field.of(wires).patch([1, 1], MESHES, |uv| v(440.0 * uv.x, 0.0, 6.0 + 194.0 * uv.y));
    let field = field.done();

    let mut post = Builder::new("fence post");
    let sides = 6 + 2 * n;
    post.of(plain("steel", [0.5, 0.52, 0.54]));
    post.cylinder(v(0.0, 0.0, -1.0), v(0.0, 0.0, 204.0), [6.0, 6.0], sides, n);
    post.cylinder(v(0.0, 0.0, 203.0), v(0.0, 0.0, 210.0), [8.0, 3.0], sides, 1);
    let post = post.done();
    let mut rail = Builder::new("fence rail");
    rail.of(plain("steel", [0.5, 0.52, 0.54]));
    rail.cylinder(v(0.0, 0.0, 200.0), v(440.0, 0.0, 200.0), [3.5, 3.5], sides, n);
    let rail = rail.done();
    let mut crates = Builder::new("fence crate");
    crates.of(plain("wood", [0.56, 0.42, 0.26])).block(v(-40.0, -40.0, -1.0), v(40.0, 40.0, 78.0), n);
    let crates = crates.done();

    let mut all = vec![here(ground.done())];
    for x in [-440.0, 0.0] {
        all.extend([&field, &rail].map(|part| there(part, v(x, 0.0, 0.0), 0.0, 1.0)));
    }
    all.extend([-440.0, 0.0, 440.0].map(|x| there(&post, v(x, 0.0, 0.0), 0.0, 1.0)));
    for (x, y, turn, size) in
        [(-170.0, 90.0, 20.0, 1.0), (120.0, 150.0, -12.0, 1.3), (210.0, -70.0, 35.0, 0.8)]
    {
        all.push(there(&crates, v(x, y, 0.0), turn, size));
    }
    all
}
