//! What scenes are put together from: blocks, prisms, cylinders, height fields, masked sheets. All solids are closed, their triangles
//! counter-clockwise seen from outside.

use std::f32::consts::TAU;
use std::sync::Arc;

use glam::{Vec2, Vec3};

use crate::clip::Pose;
use crate::surface::{Instance, Material, Surface, Texture};

/// A surface that grows part by part. What is added is of the material that was chosen last.
pub(super) struct Builder {
    surface: Surface,
}

impl Builder {
    pub(super) fn new(name: &str) -> Self {
        Self { surface: Surface { name: name.into(), ..Surface::default() } }
    }

    /// From here on of this material.
    pub(super) fn of(&mut self, material: Material) -> &mut Self {
        self.surface.materials.push(material);
        self
    }

    pub(super) fn done(self) -> Arc<Surface> {
        Arc::new(self.surface)
    }

    /// `n[0]` × `n[1]` cells of a patch; `at` maps (0, 0) … (1, 1) to places, seen from the front with the second coordinate to the left
    /// of the first. Normals are the patch's own, flat where it is flat; it takes its texture `repeats` times.
    pub(super) fn patch(&mut self, n: [u32; 2], repeats: Vec2, at: impl Fn(Vec2) -> Vec3) -> &mut Self {
        let first = self.surface.positions.len() as u32;
        let place = |i: u32, j: u32| Vec2::new(i as f32 / n[0] as f32, j as f32 / n[1] as f32);
        for j in 0..=n[1] {
            for i in 0..=n[0] {
                let uv = place(i, j);
                let (i0, j0) = (i.max(1) - 1, j.max(1) - 1);
                let along = at(place((i + 1).min(n[0]), j)) - at(place(i0, j));
                let across = at(place(i, (j + 1).min(n[1]))) - at(place(i, j0));
                self.surface.positions.push(at(uv));
                self.surface.normals.push(along.cross(across).normalize_or(Vec3::Z));
                self.surface.uvs.push(Vec2::new(uv.x, 1.0 - uv.y) * repeats);
            }
        }
        let row = n[0] + 1;
        for j in 0..n[1] {
            for i in 0..n[0] {
                let a = first + j * row + i;
                self.triangle([a, a + 1, a + 1 + row]);
                self.triangle([a, a + 1 + row, a + row]);
            }
        }
        self
    }

    /// A flat face about `middle`, whose border is convex and counter-clockwise seen along `-normal`.
    pub(super) fn face(&mut self, middle: Vec3, normal: Vec3, border: &[Vec3]) -> &mut Self {
        let first = self.surface.positions.len() as u32;
        for at in [middle].iter().chain(border) {
            self.surface.positions.push(*at);
            self.surface.normals.push(normal);
            self.surface.uvs.push(Vec2::ZERO);
        }
        let count = border.len() as u32;
        (0..count).for_each(|i| self.triangle([first, first + 1 + i, first + 1 + (i + 1) % count]));
        self
    }

    /// A box between two corners, each face of `n` × `n` cells.
    pub(super) fn block(&mut self, low: Vec3, high: Vec3, n: u32) -> &mut Self {
        for axis in 0..3 {
            for upper in [false, true] {
                // Seen from the side that it faces, `u` goes to the right of `v`.
                let (u, v) =
                    if upper { ((axis + 1) % 3, (axis + 2) % 3) } else { ((axis + 2) % 3, (axis + 1) % 3) };
                self.patch([n, n], Vec2::ONE, |uv| {
                    let mut at = if upper { high } else { low };
                    // Exact at both ends, so that faces share their edges.
                    at[u] = low[u] * (1.0 - uv.x) + high[u] * uv.x;
                    at[v] = low[v] * (1.0 - uv.y) + high[v] * uv.y;
                    at
                });
            }
        }
        self
    }

    /// What a convex outline, counter-clockwise seen against `along`, sweeps on its way; each side of `n` × `n` cells.
    pub(super) fn prism(&mut self, outline: &[Vec3], along: Vec3, n: u32) -> &mut Self {
        let count = outline.len();
        let mut border = [Vec::new(), Vec::new()];
        for i in 0..count {
            let (from, to) = (outline[i], outline[(i + 1) % count]);
            let end = |uv: Vec2| from * (1.0 - uv.x) + to * uv.x;
            self.patch([n, n], Vec2::ONE, |uv| end(uv) * (1.0 - uv.y) + (end(uv) + along) * uv.y);
            for step in 0..n {
                let at = end(Vec2::new(step as f32 / n as f32, 0.0));
                border[0].push(at);
                border[1].push(at + along);
            }
        }
        let middle = outline.iter().sum::<Vec3>() / count as f32;
        let normal = along.normalize();
        self.face(middle + along, normal, &border[1]);
        border[0].reverse();
        self.face(middle, -normal, &border[0])
    }

    /// A cylinder or the frustum of a cone around the way from `base` to `top`, with the radius of each end.
    pub(super) fn cylinder(
        &mut self,
        base: Vec3,
        top: Vec3,
        radii: [f32; 2],
        sides: u32,
        rings: u32,
    ) -> &mut Self {
        let axis = (top - base).normalize();
        let (right, up) = axis.any_orthonormal_pair();
        let turn: Vec<Vec3> = (0..sides)
            .map(|i| {
                let angle = TAU * i as f32 / sides as f32;
                right * angle.cos() + up * angle.sin()
            })
            .collect();
        let at = |i: u32, t: f32| {
            base * (1.0 - t) + top * t + turn[(i % sides) as usize] * (radii[0] * (1.0 - t) + radii[1] * t)
        };
        let first = self.surface.positions.len() as u32;
        let lean = axis * (radii[0] - radii[1]) / (top - base).length();
        for ring in 0..=rings {
            let t = ring as f32 / rings as f32;
            for i in 0..=sides {
                self.surface.positions.push(at(i, t));
                self.surface.normals.push((turn[(i % sides) as usize] + lean).normalize());
                self.surface.uvs.push(Vec2::new(i as f32 / sides as f32, 1.0 - t));
            }
        }
        let row = sides + 1;
        for ring in 0..rings {
            for i in 0..sides {
                let a = first + ring * row + i;
                self.triangle([a, a + 1, a + 1 + row]);
                self.triangle([a, a + 1 + row, a + row]);
            }
        }
        let border = |t: f32| (0..sides).map(|i| at(i, t)).collect::<Vec<_>>();
        self.face(top, axis, &border(1.0));
        let mut below = border(0.0);
        below.reverse();
        self.face(base, -axis, &below)
    }

    fn triangle(&mut self, corners: [u32; 3]) {
        self.surface.triangles.push(corners);
        self.surface.material_of.push(self.surface.materials.len() as u32 - 1);
    }
}

/// An opaque material.
pub(super) fn plain(name: &str, colour: [f32; 3]) -> Material {
    Material { name: name.into(), colour, ..Material::default() }
}

/// A sheet with two sides, there where the mask says so of a place of its `size`² texels.
pub(super) fn masked(name: &str, colour: [f32; 3], size: u32, mask: impl Fn(Vec2) -> bool) -> Material {
    let centre = |i: u32| (i as f32 + 0.5) / size as f32;
    let texel = |y: u32, x: u32| [255, 255, 255, if mask(Vec2::new(centre(x), centre(y))) { 255 } else { 0 }];
    let texels = (0..size).flat_map(|y| (0..size).map(move |x| (y, x))).map(|(y, x)| texel(y, x)).collect();
    Material {
        name: name.into(),
        colour,
        texture: Some(Arc::new(Texture { name: format!("{name} mask"), size: [size; 2], texels })),
        cutoff: Some(0.5),
        two_sided: true,
        ..Material::default()
    }
}

/// A surface where it was made.
pub(super) fn here(surface: Arc<Surface>) -> Instance {
    Instance { surface, pose: Pose::default() }
}

/// A surface moved, turned about z in degrees, and scaled.
pub(super) fn there(surface: &Arc<Surface>, translate_mm: Vec3, turn_deg: f32, scale: f32) -> Instance {
    let pose = Pose { translate_mm, rotate_deg: Vec3::new(0.0, 0.0, turn_deg), scale: Vec3::splat(scale) };
    Instance { surface: surface.clone(), pose }
}

/// A number from 0 to 1 that looks like chance and is always the same (a hash by Wellons).
pub(super) fn chance(seed: u32, number: u32) -> f32 {
    let mut x = seed.wrapping_mul(0x9e37_79b9) ^ number.wrapping_mul(0x85eb_ca6b);
    for factor in [0x7feb_352d_u32, 0x846c_a68b] {
        x = (x ^ (x >> 16)).wrapping_mul(factor);
    }
    ((x ^ (x >> 16)) >> 8) as f32 / (1 << 24) as f32
}
