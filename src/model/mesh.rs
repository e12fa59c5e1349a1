//! Triangle meshes that clip a volume: read, weld, check, orient.
//!
//! A clip mesh has to bound a solid, otherwise "inside" has no meaning and depth peeling cuts somewhere the user
//! did not ask for. So a mesh is welded on entry (OBJ files split vertices at texture and normal seams), and
//! [`TriangleMesh::closed`] and [`TriangleMesh::outward`] say what is wrong before a wrong cut can happen.
//!
//! Coordinates are the mesh's own, read as millimetres at scale 1; counter-clockwise triangles face outward.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};

use crate::{Error, Result};

/// Triangles over shared vertices: no two vertices have the same position, no triangle names one twice.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleMesh {
    /// Where it came from (the file, or a generator's name); errors name it.
    pub name: String,
    /// Positions in mm at scale 1; every one is used and finite.
    pub vertices: Vec<Vec3>,
    /// Three vertex indices each, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Triangles that were dropped because two of their corners have the same position.
    pub degenerate: usize,
}

impl TriangleMesh {
    /// Welds `positions` (mm) that are exactly equal, drops triangles that collapse by it, forgets unused positions.
    ///
    /// # Errors
    /// [`Error::Mesh`] when an index has no position, a used position is NaN or infinite, or no triangle is left.
    pub fn new(name: impl Into<String>, positions: &[Vec3], faces: &[[u32; 3]]) -> Result<Self> {
        let mut mesh = Self { name: name.into(), vertices: Vec::new(), triangles: Vec::new(), degenerate: 0 };
        let mut known = HashMap::new();
        for (number, face) in faces.iter().enumerate() {
            let mut corners = [0; 3];
            for (corner, &index) in corners.iter_mut().zip(face) {
                let Some(&position) = positions.get(index as usize) else {
                    return Err(mesh.wrong(format!(
                        "triangle {number} names vertex {index}, but there are only {}",
                        positions.len()
                    )));
                };
                if !position.is_finite() {
                    return Err(mesh.wrong(format!(
                        "triangle {number} has a vertex at ({}, {}, {}); coordinates must be finite",
                        position.x, position.y, position.z
                    )));
                }
                // Adding zero turns -0 into +0, which are one position with two bit patterns.
                let key = (position + Vec3::ZERO).to_array().map(f32::to_bits);
                *corner = *known.entry(key).or_insert_with(|| {
                    mesh.vertices.push(position);
                    (mesh.vertices.len() - 1) as u32
                });
            }
            let [a, b, c] = corners;
            if a == b || b == c || c == a {
                mesh.degenerate += 1;
            } else {
                mesh.triangles.push(corners);
            }
        }
        if mesh.triangles.is_empty() {
            return Err(mesh.wrong(match mesh.degenerate {
                0 => "has no faces; a clip mesh needs a closed surface".into(),
                n => format!("all of its {n} triangles are degenerate (two corners at the same place)"),
            }));
        }
        mesh.drop_unused();
        Ok(mesh)
    }

    /// Smallest and largest coordinates in mm.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        bounds_of(self.vertices.iter().copied())
    }

    /// Volume enclosed, in mm³: positive where triangles face outward, negative for a mesh that is inside out.
    /// Meaningful for [closed](Self::closed) meshes only.
    pub fn signed_volume(&self) -> f64 {
        // About the middle of the box, so that a mesh far from the origin does not lose digits.
        let (low, high) = self.bounds();
        let middle = (low.as_dvec3() + high.as_dvec3()) * 0.5;
        self.triangles.iter().map(|&t| self.cone_volume(t, middle)).sum()
    }

    /// Is every edge used by exactly two triangles, in opposite directions?
    ///
    /// # Errors
    /// [`Error::Mesh`] with the number of open edges (one triangle), of crowded edges (more than two) and of edges
    /// whose two triangles are wound inconsistently, and the middle of the first such edge in mm.
    pub fn closed(&self) -> Result<()> {
        // One entry for each side of each triangle: the edge, and whether it runs from the lower to the higher index.
        let mut sides: Vec<(u32, u32, bool)> = Vec::with_capacity(3 * self.triangles.len());
        for &[a, b, c] in &self.triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                sides.push((from.min(to), from.max(to), from < to));
            }
        }
        sides.sort_unstable();
        let (mut open, mut crowded, mut wound) = (0, 0, 0);
        let mut first = None;
        for edge in sides.chunk_by(|l, r| (l.0, l.1) == (r.0, r.1)) {
            match edge {
                [one, two] if one.2 != two.2 => continue,
                [_, _] => wound += 1,
                [_] => open += 1,
                _ => crowded += 1,
            }
            first.get_or_insert((edge[0].0, edge[0].1));
        }
        let Some((a, b)) = first else { return Ok(()) };
        let place = (self.vertices[a as usize] + self.vertices[b as usize]) * 0.5;
        let mut found = Vec::new();
        for (count, what) in [
            (open, "open (only one triangle)"),
            (crowded, "shared by more than two triangles"),
            (wound, "between triangles that are wound in opposite senses"),
        ] {
            if count > 0 {
                found.push(format!("{count} {} {what}", if count == 1 { "edge is" } else { "edges are" }));
            }
        }
        Err(self.wrong(format!(
            "the surface does not enclose a solid: {}; the first is at ({}, {}, {}) mm; close the holes, merge \
             vertices and make the winding consistent in a mesh editor",
            found.join(", "),
            place.x,
            place.y,
            place.z
        )))
    }

    /// The same solid with every outer surface facing outward, as the depth peeling needs it.
    ///
    /// Surfaces are the connected components. One that lies in no other is an outer surface: if its volume is
    /// negative it is turned round, together with everything that lies in it. A surface inside another one keeps its
    /// orientation relative to it, so cavities stay cavities. A mesh that is already right comes back unchanged.
    ///
    /// # Errors
    /// As [`TriangleMesh::closed`]; [`Error::Mesh`] when the mesh encloses no volume at all.
    pub fn outward(&self) -> Result<Self> {
        self.closed()?;
        let surfaces = self.surfaces();
        let mut turned = self.clone();
        for (index, surface) in surfaces.iter().enumerate() {
            let outer =
                !surfaces.iter().enumerate().any(|(o, other)| o != index && self.lies_in(surface, other));
            if !outer || surface.volume >= 0.0 {
                continue;
            }
            for (o, other) in surfaces.iter().enumerate() {
                if o == index || self.lies_in(other, surface) {
                    other.triangles.iter().for_each(|&t| turned.triangles[t as usize].swap(1, 2));
                }
            }
        }
        let (low, high) = self.bounds();
        let size = (high - low).as_dvec3();
        // A flat or folded mesh leaves only rounding behind: far below one part in a million of its box.
        if turned.signed_volume() <= 1e-9 * size.x.max(size.y).max(size.z).powi(3) {
            return Err(self.wrong("encloses no volume; a clip mesh must be a solid".into()));
        }
        Ok(turned)
    }

    /// Unit sphere: an icosahedron whose triangles are split into four `subdivisions` times (≤ 8), vertices on the
    /// sphere. 20·4ⁿ triangles.
    pub fn sphere(subdivisions: u32) -> Self {
        let g = (1.0 + 5f64.sqrt()) / 2.0;
        let mut vertices: Vec<DVec3> = [
            (-1.0, g, 0.0),
            (1.0, g, 0.0),
            (-1.0, -g, 0.0),
            (1.0, -g, 0.0),
            (0.0, -1.0, g),
            (0.0, 1.0, g),
            (0.0, -1.0, -g),
            (0.0, 1.0, -g),
            (g, 0.0, -1.0),
            (g, 0.0, 1.0),
            (-g, 0.0, -1.0),
            (-g, 0.0, 1.0),
        ]
        .map(|(x, y, z)| DVec3::new(x, y, z).normalize())
        .to_vec();
        #[rustfmt::skip]
        let mut triangles: Vec<[u32; 3]> = vec![
            [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11],
            [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8],
            [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9],
            [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
        ];
        for _ in 0..subdivisions.min(8) {
            let mut middles = HashMap::new();
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    vertices.push((vertices[a as usize] + vertices[b as usize]).normalize());
                    (vertices.len() - 1) as u32
                })
            };
            triangles = triangles
                .iter()
                .flat_map(|&[a, b, c]| {
                    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                    [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
                })
                .collect();
        }
        let vertices = vertices.iter().map(|v| v.as_vec3()).collect();
        Self { name: "sphere".into(), vertices, triangles, degenerate: 0 }
    }

    /// Torus round the z axis, ring radius 1, tube radius 0.4, with `ring` × `tube` quads (each at least 3),
    /// vertices on the surface. Concave: along z it needs one layer pair, along x two.
    pub fn torus(ring: u32, tube: u32) -> Self {
        let (n, m) = (ring.max(3), tube.max(3));
        let at = |i: u32, j: u32| (i % n) * m + j % m;
        let mut vertices = Vec::new();
        let mut triangles = Vec::new();
        for i in 0..n {
            for j in 0..m {
                let (u, v) = (TAU * f64::from(i) / f64::from(n), TAU * f64::from(j) / f64::from(m));
                let radius = 1.0 + 0.4 * v.cos();
                vertices.push(DVec3::new(radius * u.cos(), radius * u.sin(), 0.4 * v.sin()).as_vec3());
                let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        Self { name: "torus".into(), vertices, triangles, degenerate: 0 }
    }

    /// Cube with half-edge 1: |x|, |y|, |z| ≤ 1; 12 triangles.
    pub fn cuboid() -> Self {
        let vertices = (0..8u8)
            .map(|i| Vec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 1.0 } else { -1.0 })))
            .collect();
        #[rustfmt::skip]
        let triangles = vec![
            [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5], [0, 1, 5], [0, 5, 4],
            [2, 6, 7], [2, 7, 3], [0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6],
        ];
        Self { name: "cuboid".into(), vertices, triangles, degenerate: 0 }
    }

    fn wrong(&self, problem: String) -> Error {
        Error::Mesh { name: self.name.clone(), problem }
    }

    fn corners(&self, triangle: [u32; 3]) -> [DVec3; 3] {
        triangle.map(|v| self.vertices[v as usize].as_dvec3())
    }

    /// Signed volume of the tetrahedron from `apex` to a triangle, mm³.
    fn cone_volume(&self, triangle: [u32; 3], apex: DVec3) -> f64 {
        let [a, b, c] = self.corners(triangle).map(|p| p - apex);
        a.dot(b.cross(c)) / 6.0
    }

    /// Vertices that only collapsed triangles used would widen the bounds for nothing.
    fn drop_unused(&mut self) {
        let mut place = vec![u32::MAX; self.vertices.len()];
        let mut kept = Vec::with_capacity(self.vertices.len());
        for vertex in self.triangles.iter_mut().flatten() {
            let slot = &mut place[*vertex as usize];
            if *slot == u32::MAX {
                *slot = kept.len() as u32;
                kept.push(self.vertices[*vertex as usize]);
            }
            *vertex = *slot;
        }
        self.vertices = kept;
    }

    /// Connected components over shared vertices, in order of their first triangle.
    fn surfaces(&self) -> Vec<Surface> {
        let mut parent: Vec<u32> = (0..self.vertices.len() as u32).collect();
        for &[a, b, c] in &self.triangles {
            let root = find(&mut parent, a);
            for other in [b, c] {
                let other = find(&mut parent, other);
                parent[other as usize] = root;
            }
        }
        let mut slots = HashMap::new();
        let mut members: Vec<Vec<u32>> = Vec::new();
        for (index, triangle) in self.triangles.iter().enumerate() {
            let slot = *slots.entry(find(&mut parent, triangle[0])).or_insert_with(|| {
                members.push(Vec::new());
                members.len() - 1
            });
            members[slot].push(index as u32);
        }
        members.into_iter().map(|triangles| self.surface(triangles)).collect()
    }

    fn surface(&self, triangles: Vec<u32>) -> Surface {
        let corners = triangles.iter().flat_map(|&t| self.triangles[t as usize]);
        let (low, high) = bounds_of(corners.map(|v| self.vertices[v as usize]));
        let middle = (low.as_dvec3() + high.as_dvec3()) * 0.5;
        let volume = triangles.iter().map(|&t| self.cone_volume(self.triangles[t as usize], middle)).sum();
        Surface { triangles, low, high, volume }
    }

    /// Does `inner` lie in the solid that `outer` bounds? By the boxes first, then by the solid angle that `outer`
    /// covers seen from one vertex of `inner` (Van Oosterom and Strackee 1983): 4π inside, 0 outside.
    fn lies_in(&self, inner: &Surface, outer: &Surface) -> bool {
        if !(inner.low.cmpge(outer.low).all() && inner.high.cmple(outer.high).all()) {
            return false;
        }
        let eye = self.corners(self.triangles[inner.triangles[0] as usize])[0];
        let angle: f64 = outer
            .triangles
            .iter()
            .map(|&t| {
                let [a, b, c] = self.corners(self.triangles[t as usize]).map(|p| p - eye);
                let (la, lb, lc) = (a.length(), b.length(), c.length());
                let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
                2.0 * a.dot(b.cross(c)).atan2(below)
            })
            .sum();
        angle.abs() > 2.0 * PI
    }
}

/// One connected piece of a mesh.
struct Surface {
    triangles: Vec<u32>,
    low: Vec3,
    high: Vec3,
    /// mm³, negative when inside out.
    volume: f64,
}

fn bounds_of(points: impl Iterator<Item = Vec3>) -> (Vec3, Vec3) {
    points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}

/// Root of a vertex in the union-find forest, halving the path on the way.
fn find(parent: &mut [u32], mut vertex: u32) -> u32 {
    while parent[vertex as usize] != vertex {
        let above = parent[parent[vertex as usize] as usize];
        parent[vertex as usize] = above;
        vertex = above;
    }
    vertex
}
