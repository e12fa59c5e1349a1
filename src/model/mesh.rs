//! Triangle meshes that clip a volume: weld, check.
//!
//! A clip mesh has to bound a solid, otherwise "inside" has no meaning and depth peeling cuts somewhere the user
//! did not ask for. So a mesh is welded on entry (OBJ files split vertices at texture and normal seams), and
//! [`TriangleMesh::check_solid`] says what is wrong before a wrong cut can happen.
//!
//! Coordinates are the mesh's own, read as millimetres at scale 1. The solid is where the winding number is not 0, so
//! that it does not matter which way the whole faces.

use std::collections::HashMap;
use std::f64::consts::TAU;

use glam::{DVec3, Vec3};

use crate::{Error, Result};

/// Triangles over shared vertices: no two vertices have the same position, no triangle names one twice.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleMesh {
    /// Where it came from (the file, or a generator's name); errors name it.
    pub name: String,
    /// Positions in mm at scale 1; every one is used and finite.
    pub vertices: Vec<Vec3>,
    /// Three vertex indices each; counter-clockwise seen from outside, or clockwise all of them.
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

    /// Does the surface have no border: at every edge, do as many triangles run one way as the other?
    ///
    /// Parts may touch along edges and at corners, so that an edge may have 4, 6 or more triangles. A surface without
    /// border has a winding number at every point off it, which is all that clipping asks of a mesh.
    ///
    /// # Errors
    /// [`Error::Mesh`] with the number of edges that are open (one triangle), that lie between triangles wound in opposite
    /// senses, or that have more than two triangles and no balance, and the middle of the first such edge in mm.
    pub fn closed(&self) -> Result<()> {
        // One entry for each side of each triangle: the edge, and whether it runs from the lower to the higher index.
        let mut sides: Vec<(u32, u32, bool)> = Vec::with_capacity(3 * self.triangles.len());
        for &[a, b, c] in &self.triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                sides.push((from.min(to), from.max(to), from < to));
            }
        }
        sides.sort_unstable();
        let (mut open, mut wound, mut unbalanced) = (0, 0, 0);
        let mut first = None;
        for edge in sides.chunk_by(|l, r| (l.0, l.1) == (r.0, r.1)) {
            if 2 * edge.iter().filter(|side| side.2).count() == edge.len() {
                continue;
            }
            match edge.len() {
                1 => open += 1,
                2 => wound += 1,
                _ => unbalanced += 1,
            }
            first.get_or_insert((edge[0].0, edge[0].1));
        }
        let Some((a, b)) = first else { return Ok(()) };
        let place = (self.vertices[a as usize] + self.vertices[b as usize]) * 0.5;
        let (mut found, mut remedies) = (Vec::new(), Vec::new());
        for (count, what, remedy) in [
            (open, "open (only one triangle)", "close the holes and merge vertices that should be one"),
            (wound, "between triangles that are wound in opposite senses", "make the winding consistent"),
            (
                unbalanced,
                "shared by more than two triangles of which more run one way than the other",
                "remove what is there twice or ends in a wall",
            ),
        ] {
            if count > 0 {
                found.push(format!("{count} {} {what}", if count == 1 { "edge is" } else { "edges are" }));
                remedies.push(remedy);
            }
        }
        Err(self.wrong(format!(
            "the surface does not enclose a solid: {}; the first is at ({}, {}, {}) mm; in a mesh editor, {}",
            found.join(", "),
            place.x,
            place.y,
            place.z,
            remedies.join(", ")
        )))
    }

    /// Can the mesh clip: is it [closed](Self::closed), and is there anything in it?
    ///
    /// The solid is where the winding number is not 0. So a mesh that is inside out is the same solid, a part that is
    /// inside out in another is a cavity, and parts that touch or overlap are one. Linear in the triangles, but for a sort.
    ///
    /// # Errors
    /// As [`TriangleMesh::closed`]; [`Error::Mesh`] when the winding number is 0 everywhere: a flat or folded sheet, or a
    /// part and the same part inside out.
    pub fn check_solid(&self) -> Result<()> {
        self.closed()?;
        if self.surfaces().iter().any(|surface| self.encloses(surface)) {
            return Ok(());
        }
        Err(self.wrong("encloses no volume; a clip mesh must be a solid".into()))
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

    /// Triangles of the connected components over shared vertices, in order of their first triangle.
    fn surfaces(&self) -> Vec<Vec<[u32; 3]>> {
        let mut parent: Vec<u32> = (0..self.vertices.len() as u32).collect();
        for &[a, b, c] in &self.triangles {
            let root = find(&mut parent, a);
            for other in [b, c] {
                let other = find(&mut parent, other);
                parent[other as usize] = root;
            }
        }
        let mut slots = HashMap::new();
        let mut members: Vec<Vec<[u32; 3]>> = Vec::new();
        for triangle in &self.triangles {
            let slot = *slots.entry(find(&mut parent, triangle[0])).or_insert_with(|| {
                members.push(Vec::new());
                members.len() - 1
            });
            members[slot].push(*triangle);
        }
        members
    }

    /// Is the winding number of these triangles, which have no border, anything but 0 somewhere?
    ///
    /// ```text
    /// m_k = ∫ w(x) (d·x)^k dx = Σ_triangles V_t · 6 k! / (k + 3)! · h_k(d·a, d·b, d·c)
    /// ```
    ///
    /// about the middle of their box, V_t the cone over the triangle, h_k the complete homogeneous symmetric polynomial.
    /// m_0 is the volume. Parts of opposite sense that touch can cancel in it, but not in all moments along a direction
    /// that is aligned with nothing.
    fn encloses(&self, triangles: &[[u32; 3]]) -> bool {
        let corners = triangles.iter().flatten();
        let (low, high) = bounds_of(corners.map(|&v| self.vertices[v as usize]));
        let middle = (low.as_dvec3() + high.as_dvec3()) * 0.5;
        let radius = (high.as_dvec3() - middle).length();
        let direction = DVec3::new(0.631_475, 0.553_098, 0.543_412);
        let mut moments = [0.0; MOMENTS];
        let mut size = 0.0;
        for &triangle in triangles {
            let [a, b, c] = self.corners(triangle).map(|p| (p - middle) / radius);
            let volume = a.dot(b.cross(c));
            size += a.length() * b.length() * c.length();
            let mut h = [0.0; MOMENTS];
            h[0] = 1.0;
            for s in [a, b, c].map(|p| p.dot(direction)) {
                for k in 1..MOMENTS {
                    h[k] += s * h[k - 1];
                }
            }
            let mut share = 1.0;
            for k in 0..MOMENTS {
                moments[k] += volume * share * h[k];
                share *= (k + 1) as f64 / (k + 4) as f64;
            }
        }
        // What rounding leaves of so many terms that cancel.
        let rounding = (triangles.len() + 8) as f64 * f64::EPSILON * size;
        moments.iter().any(|moment| moment.abs() > rounding)
    }
}

/// Moments of the winding number that are looked at.
const MOMENTS: usize = 8;

/// Smallest and largest coordinates.
pub fn bounds_of(points: impl IntoIterator<Item = Vec3>) -> (Vec3, Vec3) {
    points.into_iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
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
