//! Depth layers of a clip mesh (CAO §3.4 step 2; any number of layer pairs, the paper's future work).
//!
//! The ray through each pixel's centre, along +z of the clip camera, meets the mesh in front faces (normal against
//! the ray) and back faces. Sorted by depth, a front adds 1 to the winding number and a back takes 1 away; the k-th pair
//! is the k-th stretch in which the number is not 0. Gaps and stretches no longer than [`ONE_DEPTH`] are none.
//!
//! Vertices are snapped to 2⁻¹⁶ pixel, then coverage is exact in integers, ties by the top-left rule: a closed mesh
//! has as many front as back faces at every pixel, whatever its triangles look like.

use crate::clip::clips::{MeshLayers, NO_BACK, NO_FRONT};
use cao_kernels::shared::layers::ONE_DEPTH;
use cao_model::clip::ClipCamera;
use cao_model::mesh::TriangleMesh;
use glam::{DVec3, Vec3};

/// What the peeling found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Pixels with more front than back faces or the reverse: the mesh has a hole there.
    pub open_pixels: usize,
    /// Pixels with more pairs than were asked for: the cut is wrong there.
    pub unresolved_pixels: usize,
    /// The first such pixel (x, y) in row order.
    pub first: Option<[u32; 2]>,
}

/// Peels `layers` pairs from `mesh` scaled by `scale` (each > 0), as `camera` sees it.
pub fn peel(mesh: &TriangleMesh, scale: Vec3, camera: &ClipCamera, layers: usize) -> (MeshLayers, Report) {
    let side = camera.resolution as usize;
    let mut faces: Vec<Vec<(f64, i32)>> = vec![Vec::new(); side * side];
    let place = |index: u32| {
        let offset = (mesh.vertices[index as usize] * scale).as_dvec3() - camera.corner.as_dvec3();
        let (pixel, depth) = (f64::from(camera.pixel_mm), f64::from(camera.depth_mm));
        Corner::snap(offset / DVec3::new(pixel, pixel, depth))
    };
    for triangle in &mesh.triangles {
        let corners = triangle.map(place);
        let area = corners[0].side(&corners[1], [corners[2].x, corners[2].y]);
        // The normal's z has the sign of the area in the xy plane. Edge-on triangles cover no pixel's centre.
        let (corners, step) = match area {
            0 => continue,
            1.. => (corners, -1),
            _ => ([corners[0], corners[2], corners[1]], 1),
        };
        cover(&corners, area.unsigned_abs() as f64, side, |pixel, depth| faces[pixel].push((depth, step)));
    }
    let mut report = Report::default();
    let mut pairs = Vec::new();
    for (pixel, faces) in faces.iter_mut().enumerate() {
        faces.sort_by(|a, b| a.0.total_cmp(&b.0));
        let open = faces.iter().map(|face| face.1).sum::<i32>() != 0;
        pairs.push(stretches(faces));
        let unresolved = pairs[pixel].len() > layers;
        report.open_pixels += usize::from(open);
        report.unresolved_pixels += usize::from(unresolved);
        if open || unresolved {
            report.first.get_or_insert([(pixel % side) as u32, (pixel / side) as u32]);
        }
    }
    let layer = |k: usize, end: usize, none: f32| -> Vec<f32> {
        pairs.iter().map(|pairs| pairs.get(k).map_or(none, |pair| pair[end] as f32)).collect()
    };
    let pairs = MeshLayers {
        camera: *camera,
        front: (0..layers).map(|k| layer(k, 0, NO_FRONT)).collect(),
        back: (0..layers).map(|k| layer(k, 1, NO_BACK)).collect(),
    };
    (pairs, report)
}

/// Where along a pixel's ray the winding number is not 0, from its faces in the order of depth.
fn stretches(faces: &[(f64, i32)]) -> Vec<[f64; 2]> {
    let mut found: Vec<[f64; 2]> = Vec::new();
    let mut winding = 0;
    for (face, next) in faces.iter().zip(faces.iter().skip(1)) {
        winding += face.1;
        if winding == 0 {
            continue;
        }
        match found.last_mut() {
            Some(last) if face.0 - last[1] <= f64::from(ONE_DEPTH) => last[1] = next.0,
            _ => found.push([face.0, next.0]),
        }
    }
    found.retain(|pair| pair[1] - pair[0] > f64::from(ONE_DEPTH));
    found
}

/// A projected vertex: x and y in 2⁻¹⁶ pixel, depth 0 … 1.
#[derive(Clone, Copy)]
struct Corner {
    x: i128,
    y: i128,
    depth: f64,
}

const PIXEL: i128 = 1 << 16;

impl Corner {
    fn snap(mapped: DVec3) -> Self {
        let fixed = |c: f64| (c * PIXEL as f64).round() as i64 as i128;
        Self { x: fixed(mapped.x), y: fixed(mapped.y), depth: mapped.z }
    }

    /// Twice the area of (self, to, point): positive when the point is to the left of the edge (y up).
    fn side(&self, to: &Self, [x, y]: [i128; 2]) -> i128 {
        (to.x - self.x) * (y - self.y) - (to.y - self.y) * (x - self.x)
    }

    /// Whether a pixel's centre exactly on this edge belongs to the triangle at its left; never to both neighbours.
    fn owns(&self, to: &Self) -> bool {
        to.y > self.y || (to.y == self.y && to.x < self.x)
    }
}

/// Calls `hit(pixel, depth)` for every pixel whose centre lies in a triangle of positive area.
fn cover(corners: &[Corner; 3], area: f64, side: usize, mut hit: impl FnMut(usize, f64)) {
    let range = |values: [i128; 3]| {
        let last = side as i128 - 1;
        let low = values.into_iter().min().unwrap_or(0).div_euclid(PIXEL).clamp(0, last);
        let high = values.into_iter().max().unwrap_or(0).div_euclid(PIXEL).clamp(0, last);
        low..=high
    };
    for y in range(corners.map(|c| c.y)) {
        for x in range(corners.map(|c| c.x)) {
            let centre = [x * PIXEL + PIXEL / 2, y * PIXEL + PIXEL / 2];
            let mut depth = 0.0;
            let inside = (0..3).all(|i| {
                let (from, to, opposite) = (&corners[i], &corners[(i + 1) % 3], &corners[(i + 2) % 3]);
                let share = from.side(to, centre);
                depth += share as f64 / area * opposite.depth;
                share > 0 || (share == 0 && from.owns(to))
            });
            if inside {
                hit(y as usize * side + x as usize, depth);
            }
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use glam::Vec2;

    /// Several meshes as one, each moved, scaled and perhaps turned inside out.
    pub fn join(parts: &[(&TriangleMesh, Vec3, f32, bool)]) -> TriangleMesh {
        let (mut positions, mut faces) = (Vec::new(), Vec::new());
        for &(mesh, shift, scale, inward) in parts {
            let first = positions.len() as u32;
            positions.extend(mesh.vertices.iter().map(|&v| v * scale + shift));
            faces.extend(mesh.triangles.iter().map(|t| {
                let [a, b, c] = t.map(|i| i + first);
                if inward { [a, c, b] } else { [a, b, c] }
            }));
        }
        TriangleMesh::new("joined", &positions, &faces).unwrap()
    }

    /// The mesh with its x axis turned to z, so that the camera sees it from the side.
    pub fn from_the_side(mesh: &TriangleMesh) -> TriangleMesh {
        let vertices = mesh.vertices.iter().map(|v| Vec3::new(v.y, v.z, v.x)).collect();
        TriangleMesh { vertices, ..mesh.clone() }
    }

    fn peeled(mesh: &TriangleMesh, resolution: u32, layers: usize) -> (MeshLayers, Report) {
        let camera = ClipCamera::around(mesh, Vec3::ONE, 0.1, resolution);
        peel(mesh, Vec3::ONE, &camera, layers)
    }

    /// Pixel → (centre in mm, depths in mm of its pairs).
    fn pixels(layers: &MeshLayers) -> impl Iterator<Item = (Vec2, Vec<[f32; 2]>)> {
        let camera = layers.camera;
        let side = camera.resolution as usize;
        (0..side * side).map(move |i| {
            let pixel = Vec2::new((i % side) as f32 + 0.5, (i / side) as f32 + 0.5);
            let mm = |z: f32| camera.corner.z + z * camera.depth_mm;
            let pairs = layers.front.iter().zip(&layers.back);
            let pairs = pairs.filter(|(f, b)| f[i] != NO_FRONT || b[i] != NO_BACK);
            (
                camera.corner.truncate() + pixel * camera.pixel_mm,
                pairs.map(|(f, b)| [mm(f[i]), mm(b[i])]).collect(),
            )
        })
    }

    #[test]
    fn sphere_layers_lie_on_the_sphere() {
        let (layers, report) = peeled(&TriangleMesh::sphere(5), 128, 2);
        assert_eq!(report, Report::default());
        for (p, pairs) in pixels(&layers) {
            // Facets of 5 subdivisions lie at most 4e-4 inside the sphere.
            if p.length() > 1.0 {
                assert!(pairs.is_empty());
            } else if p.length() < 0.9 {
                let z = (1.0 - p.length_squared()).sqrt();
                let [[front, back]] = pairs[..] else { panic!("{p}: {pairs:?}") };
                assert!((front + z).abs() < 2e-3 && (back - z).abs() < 2e-3, "{p}: {front} {back} {z}");
            }
        }
    }

    /// The diagonals of a box's faces and its corners fall on pixel centres: each is covered exactly once.
    #[test]
    fn box_layers_are_its_faces_even_where_edges_meet_pixel_centres() {
        let mesh = TriangleMesh::cuboid();
        let camera =
            ClipCamera { corner: Vec3::new(-1.25, -1.25, -2.0), pixel_mm: 0.5, depth_mm: 4.0, resolution: 5 };
        let (layers, report) = peel(&mesh, Vec3::ONE, &camera, 1);
        assert_eq!(report, Report::default());
        let covered: Vec<_> = pixels(&layers).filter(|(_, pairs)| !pairs.is_empty()).collect();
        // Centres at −1, −½, 0, ½, 1; the square owns two of its four sides.
        assert_eq!(covered.len(), 16);
        for (_, pairs) in covered {
            assert_eq!(pairs, [[-1.0, 1.0]]);
        }
    }

    #[test]
    fn scale_stretches_the_layers() {
        let mesh = TriangleMesh::cuboid();
        let scale = Vec3::new(3.0, 2.0, 5.0);
        // Pixels of 1/6 mm: no centre lies on an edge of the box.
        let camera = ClipCamera::around(&mesh, scale, 1.0, 50);
        let (layers, report) = peel(&mesh, scale, &camera, 1);
        assert_eq!(report, Report::default());
        for (p, pairs) in pixels(&layers) {
            assert_eq!(!pairs.is_empty(), p.x.abs() < 3.0 && p.y.abs() < 2.0);
            assert!(pairs.iter().all(|[f, b]| (f + 5.0).abs() < 1e-5 && (b - 5.0).abs() < 1e-5));
        }
    }

    #[test]
    fn torus_has_one_pair_from_above_and_two_from_the_side() {
        let torus = TriangleMesh::torus(96, 48);
        let (layers, report) = peeled(&torus, 128, 4);
        assert_eq!(report, Report::default());
        assert!(pixels(&layers).all(|(_, pairs)| pairs.len() <= 1));
        let (layers, report) = peeled(&from_the_side(&torus), 128, 4);
        assert_eq!(report, Report::default());
        let most = pixels(&layers).map(|(_, pairs)| pairs.len()).max();
        assert_eq!(most, Some(2));
        // Through the middle: the tube before and behind the hole.
        let (_, pairs) = pixels(&layers).min_by(|a, b| a.0.length().total_cmp(&b.0.length())).unwrap();
        for (found, expected) in pairs.as_flattened().iter().zip([-1.4, -0.6, 0.6, 1.4]) {
            assert!((found - expected).abs() < 1e-2, "{pairs:?}");
        }
    }

    #[test]
    fn too_few_layers_are_reported_with_a_place() {
        let (layers, report) = peeled(&from_the_side(&TriangleMesh::torus(96, 48)), 128, 1);
        assert_eq!(report.open_pixels, 0);
        assert!(report.unresolved_pixels > 1000, "{report:?}");
        let [x, y] = report.first.unwrap();
        let front = layers.front[0][(y * 128 + x) as usize];
        assert_ne!(front, NO_FRONT);
    }

    /// A shell inside a shell: turned inward it makes a cavity, turned outward it changes nothing.
    #[test]
    fn nested_shells_are_where_the_winding_number_is_not_0() {
        let ball = TriangleMesh::sphere(3);
        for cavity in [true, false] {
            let mesh = join(&[(&ball, Vec3::ZERO, 1.0, false), (&ball, Vec3::ZERO, 0.5, cavity)]);
            let (layers, report) = peeled(&mesh, 64, 2);
            assert_eq!(report, Report::default());
            assert_eq!(layers.inside(Vec3::new(0.01, 0.02, 0.1)), !cavity);
            for z in [-0.75, 0.75] {
                assert!(layers.inside(Vec3::new(0.01, 0.02, z)));
                assert!(!layers.inside(Vec3::new(0.01, 0.02, 1.5 * z)));
            }
        }
    }

    #[test]
    fn a_hole_is_reported_where_it_is() {
        let mut mesh = TriangleMesh::cuboid();
        let hole = mesh.triangles.iter().position(|t| t.iter().all(|&v| mesh.vertices[v as usize].z > 0.0));
        mesh.triangles.remove(hole.unwrap());
        let (_, report) = peeled(&mesh, 64, 2);
        // Half of one face of the box.
        let face = (64.0 - 2.0) / 2.2 * 2.0;
        assert!((report.open_pixels as f64 - face * face / 2.0).abs() < face, "{report:?}");
        assert_eq!(report.unresolved_pixels, 0);
        assert!(report.first.is_some());
    }

    /// Closed meshes with triangles of every size: fronts and backs balance at every pixel and resolution.
    #[test]
    fn closed_meshes_are_never_open() {
        let ball = TriangleMesh::sphere(4);
        let torus = from_the_side(&TriangleMesh::torus(200, 7));
        let pile = join(&[
            (&ball, Vec3::new(0.3, 0.1, 0.2), 0.01, false),
            (&torus, Vec3::new(-0.2, 0.4, 0.0), 0.7, false),
            (&ball, Vec3::new(1.0, 0.0, 3.0), 1.3, false),
            (&TriangleMesh::cuboid(), Vec3::ZERO, 1.0, false),
        ]);
        for mesh in [&ball, &torus, &pile] {
            for resolution in [3, 16, 37, 64, 256] {
                assert_eq!(peeled(mesh, resolution, 8).1, Report::default(), "{resolution}");
            }
        }
    }

    #[test]
    fn triangles_outside_the_map_are_not_drawn() {
        let camera = ClipCamera { corner: Vec3::splat(50.0), pixel_mm: 0.1, depth_mm: 1.0, resolution: 8 };
        let (layers, report) = peel(&TriangleMesh::cuboid(), Vec3::ONE, &camera, 1);
        assert_eq!(report, Report::default());
        assert!(pixels(&layers).all(|(_, pairs)| pairs.is_empty()));
    }
}
