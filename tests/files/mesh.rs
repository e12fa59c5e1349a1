//! Meshes: what comes out of an OBJ file, and what is refused as a clip shape.

use cao_formats::Error;
use cao_model::mesh::TriangleMesh;
use cao_testing::meshes::{join, winding_number};
use glam::{DVec3, Vec3};
use proptest::prelude::*;

/// Relative rounding of positions kept in f32 (2⁻²⁴), summed over the thousands of triangles of these meshes.
const ROUNDING: f64 = 1e-5;

/// 345 344 triangles in 21 953 parts are checked in a fraction of a second; looking at every pair of parts took over a minute.
const MANY_PARTS_SECONDS: f64 = 10.0;

/// A tetrahedron in OBJ, outward.
const TETRAHEDRON: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

fn message<T: std::fmt::Debug, E: std::error::Error>(result: Result<T, E>) -> String {
    result.unwrap_err().to_string()
}

#[test]
fn generators_are_closed_and_outward_with_their_known_volume() {
    // Polyhedra inscribed in a curved surface hold a little less than it; the sagitta sets how much.
    let ball = 4.0 / 3.0 * std::f64::consts::PI;
    let ring = 2.0 * std::f64::consts::PI.powi(2) * 0.4 * 0.4;
    for (mesh, volume, deficit) in [
        (TriangleMesh::cuboid(), 8.0, ROUNDING),
        (TriangleMesh::sphere(0), ball, 0.4),
        (TriangleMesh::sphere(4), ball, 0.004),
        (TriangleMesh::torus(96, 48), ring, 0.005),
        (TriangleMesh::torus(0, 0), ring, 0.9),
    ] {
        mesh.closed().unwrap();
        let found = mesh.signed_volume();
        assert!(
            found <= volume * (1.0 + ROUNDING) && found >= volume * (1.0 - deficit),
            "{}: {found}",
            mesh.name
        );
        mesh.check_solid().unwrap();
    }
    assert_eq!(TriangleMesh::cuboid().bounds(), (Vec3::NEG_ONE, Vec3::ONE));
    assert_eq!(TriangleMesh::sphere(3).triangles.len(), 20 * 64);
}

#[test]
fn seams_of_texture_and_normal_indices_are_welded() {
    let text = "mtllib nowhere.mtl\no solid\nv 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv -0 0 -0.0\nvt 0 0\nvn 0 0 1\n\
                usemtl red\ns off\nf 1/1/1 3/1/1 2/1/1\ng part\nf 5//1 2//1 4//1\nf 2 3 4\nf -1 -2 -3 # comment\n";
    let mesh = cao_formats::obj::parse("seams.obj", text).unwrap();
    assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (4, 4));
    // The last face is (5, 4, 3): the tetrahedron closes through the vertex that is vertex 1 again.
    mesh.closed().unwrap();
    assert!((mesh.signed_volume() - 1.0 / 6.0).abs() < ROUNDING);
}

#[test]
fn polygons_become_triangles_and_continued_lines_are_read() {
    let text = "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n\
                f 4 3 2 1\nf 5 6 7 8\nf 1 2 \\\n 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\nl 1 2\np 3\nf 1 2\n";
    let mesh = cao_formats::obj::parse("cube.obj", text).unwrap();
    assert_eq!(mesh.triangles.len(), 12);
    mesh.check_solid().unwrap();
    assert!((mesh.signed_volume() - 8.0).abs() < ROUNDING);
}

#[test]
fn collapsed_triangles_are_dropped_and_counted_and_leave_the_mesh_closed() {
    let mesh = cao_formats::obj::parse(
        "thin.obj",
        &format!("{TETRAHEDRON}v 0 0 0\nv 9 9 9\nf 1 5 2\nf 1 1 3\nf 6 6 6\n"),
    );
    let mesh = mesh.unwrap();
    assert_eq!((mesh.degenerate, mesh.triangles.len()), (3, 4));
    mesh.closed().unwrap();
    assert_eq!(mesh.bounds(), (Vec3::ZERO, Vec3::ONE), "a vertex that no triangle uses widens nothing");
}

#[test]
fn open_meshes_are_refused_with_count_and_place() {
    let mut mesh = TriangleMesh::cuboid();
    mesh.triangles.retain(|t| t.iter().any(|&v| mesh.vertices[v as usize].z < 0.0));
    let found = message(mesh.closed());
    assert!(found.starts_with("mesh cuboid: "), "{found}");
    assert!(found.contains("4 edges are open") && found.contains(", 1) mm"), "{found}");
    assert!(message(mesh.check_solid()).contains("4 edges are open"));
}

#[test]
fn inconsistent_winding_is_refused_with_count() {
    let mut mesh = TriangleMesh::sphere(1);
    mesh.triangles[7].swap(0, 1);
    let found = message(mesh.closed());
    assert!(found.contains("3 edges are between triangles that are wound in opposite senses"), "{found}");
    assert!(!found.contains("open"), "{found}");
}

#[test]
fn edges_of_more_than_two_triangles_without_balance_are_refused() {
    let fin = format!("{TETRAHEDRON}v 0 -1 -1\nf 1 2 5\n");
    let found = message(cao_formats::obj::parse("fin.obj", &fin).unwrap().closed());
    assert!(
        found.contains("2 edges are open")
            && found.contains("1 edge is shared by more than two triangles of which more run one way"),
        "{found}"
    );
}

#[test]
fn parts_that_touch_are_solids() {
    let cube = TriangleMesh::cuboid();
    for (place, what) in [
        (Vec3::new(2.0, 2.0, 0.0), "an edge"),
        (Vec3::new(2.0, 2.0, 2.0), "a corner"),
        (Vec3::new(2.0, 0.0, 0.0), "a face"),
        (Vec3::new(0.5, 0.0, 0.0), "nothing but each other"),
    ] {
        for turned in [[false; 2], [true; 2], [false, true]] {
            let mesh = join(&[(&cube, 1.0, Vec3::ZERO, turned[0]), (&cube, 1.0, place, turned[1])]);
            mesh.check_solid().unwrap_or_else(|e| panic!("{what}, inside out {turned:?}: {e}"));
        }
    }
    // Two tiny cubes far apart hold next to nothing of their box.
    let far = join(&[(&cube, 1e-3, Vec3::splat(-1e3), false), (&cube, 1e-3, Vec3::splat(1e3), true)]);
    far.check_solid().unwrap();
    // Together nothing is left of a part and the same part inside out, whatever its triangles are.
    let mut other = cube.clone();
    for pair in other.triangles.chunks_exact_mut(2) {
        let [[a, b, c], [_, d, e]] = [pair[0], pair[1]];
        assert_eq!((c, a), (d, pair[1][0]));
        pair.copy_from_slice(&[[b, c, e], [b, e, a]]);
    }
    other.check_solid().unwrap();
    for again in [&cube, &other] {
        let nothing = join(&[(&cube, 1.0, Vec3::ZERO, false), (again, 1.0, Vec3::ZERO, true)]);
        assert!(message(nothing.check_solid()).contains("encloses no volume"));
    }
}

#[test]
fn a_face_that_crosses_itself_is_refused_with_its_line() {
    let text = "v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 2 0\nv 1 1 1\n# comment\nf 1 2 5\nf 1 2\nf 1 2 \\\n 3 4\n";
    let found = message(cao_formats::obj::parse("bow.obj", text));
    assert!(found.starts_with("mesh bow.obj: line 9: the face crosses itself"), "{found}");
}

/// A prism over a polygon, each cap one face that begins at any corner, or in convex pieces.
fn prism(corners: &[(i32, i32)], caps: &[Vec<usize>], start: usize, turned: bool) -> String {
    let n = corners.len();
    let mut text = String::new();
    for z in [-7, 7] {
        corners.iter().for_each(|(x, y)| text += &format!("v {x} {y} {z}\n"));
    }
    let mut face = |mut list: Vec<usize>| {
        let len = list.len();
        list.rotate_left(start % len);
        if turned {
            list.reverse();
        }
        let words: Vec<_> = list.iter().map(|i| (i + 1).to_string()).collect();
        text += &format!("f {}\n", words.join(" "));
    };
    for cap in caps {
        face(cap.iter().rev().copied().collect());
        face(cap.iter().map(|i| i + n).collect());
    }
    (0..n).for_each(|i| face(vec![i, (i + 1) % n, (i + 1) % n + n, i + n]));
    text
}

#[test]
fn concave_faces_make_the_same_solid_as_convex_ones() {
    let cross = [
        (-3, -9),
        (3, -9),
        (3, -3),
        (9, -3),
        (9, 3),
        (3, 3),
        (3, 9),
        (-3, 9),
        (-3, 3),
        (-9, 3),
        (-9, -3),
        (-3, -3),
    ];
    let whole = vec![(0..12).collect()];
    // The middle and four arms.
    let pieces =
        vec![vec![11, 2, 5, 8], vec![0, 1, 2, 11], vec![3, 4, 5, 2], vec![6, 7, 8, 5], vec![9, 10, 11, 8]];
    let convex = cao_formats::obj::parse("convex.obj", &prism(&cross, &pieces, 0, false)).unwrap();
    convex.check_solid().unwrap();
    let points: Vec<DVec3> = (0..400_u32)
        .map(|i| DVec3::from_array([7919, 6007, 4001].map(|p| f64::from(i * p % 997) / 997.0 * 22.0 - 11.0)))
        .collect();
    for start in 0..12 {
        for turned in [false, true] {
            let concave =
                cao_formats::obj::parse("concave.obj", &prism(&cross, &whole, start, turned)).unwrap();
            concave.check_solid().unwrap();
            for &p in &points {
                let (found, expected) = (winding_number(&concave, p), winding_number(&convex, p));
                let expected = if turned { -expected } else { expected };
                assert!((found - expected).abs() < 1e-6, "{start} {turned} {p}: {found}, not {expected}");
            }
            // Its surface is no larger, so no triangle covers what is no part of the face.
            let area = |mesh: &TriangleMesh| -> f32 {
                let at = |v: u32| mesh.vertices[v as usize];
                mesh.triangles.iter().map(|&[a, b, c]| (at(b) - at(a)).cross(at(c) - at(a)).length()).sum()
            };
            assert!((area(&concave) - area(&convex)).abs() < 1e-2, "{start} {turned}");
        }
    }
}

/// A ball that is inside out around many parts: looking at where each of them lies takes minutes, looking at its moments does not.
#[test]
fn a_mesh_of_many_parts_is_checked_in_near_linear_time() {
    let (ball, cube) = (TriangleMesh::sphere(6), TriangleMesh::cuboid());
    let part = |i: u32| {
        let place = Vec3::from_array([i % 28, i / 28 % 28, i / 784].map(|n| n as f32 - 13.5));
        (&cube, 0.4, place, true)
    };
    let mut parts: Vec<_> = (0..28 * 28 * 28).map(part).collect();
    parts.push((&ball, 30.0, Vec3::ZERO, true));
    let mesh = join(&parts);
    assert_eq!(mesh.triangles.len(), 345_344);
    let begun = std::time::Instant::now();
    mesh.check_solid().unwrap();
    assert!(begun.elapsed().as_secs_f64() < MANY_PARTS_SECONDS, "{:?}", begun.elapsed());
}

#[test]
fn flat_meshes_are_refused() {
    // Two triangles back to back: closed, and nothing in between.
    let flat = cao_formats::obj::parse("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 3 2 1\n").unwrap();
    flat.closed().unwrap();
    assert!(message(flat.check_solid()).contains("encloses no volume"));
}

#[test]
fn wrong_files_are_refused_with_file_and_line() {
    let dir = tempfile::tempdir().unwrap();
    let missing = dir.path().join("missing.obj");
    let found = cao_formats::obj::load(&missing).unwrap_err();
    assert!(matches!(found, Error::Io { .. }) && found.to_string().contains("missing.obj"), "{found}");
    for (text, expected) in [
        ("", "has no faces"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "has no faces"),
        ("\u{0}\u{1}binary\n\u{7f}", "has no faces"),
        ("v 0 0 0\nv 1 0 0\nf 1 2\n", "has no faces"),
        ("v 0 0 0\nv 1 0 0\nv 0 NaN 0\nf 1 2 3\n", "vertex at (0, NaN, 0); coordinates must be finite"),
        ("v 0 0 0\nv 1 0 0\nv 0 1e39 0\nf 1 2 3\n", "coordinates must be finite"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "a face names a vertex that is not there; the file has 3"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", "a face names a vertex that is not there"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -9\n", "a face names a vertex that is not there"),
        ("# hi\n\nv 0 0\nv 1 0 0\n", "line 3: position parse error: \"v 0 0\""),
        ("v 0 0 0\nv 1 0 0\nf a b c\n", "line 3: face parse error: \"f a b c\""),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\nf\nf 1 2 3\n", "line 5: a face without corners"),
        ("v 0 0 0\nv 0 0 0\nv 0 1 0\nf 1 2 3\n", "all of its 1 triangles are degenerate"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9223372036854775807\n", "a face names a vertex that is not there"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n", "line 4: face parse error"),
    ] {
        let path = dir.path().join("wrong.obj");
        std::fs::write(&path, text).unwrap();
        let found = message(cao_formats::obj::load(&path));
        assert!(found.contains("wrong.obj") && found.contains(expected), "{text:?}: {found}");
    }
}

#[test]
fn indices_without_position_are_refused() {
    let found = message(TriangleMesh::new("made", &[Vec3::ZERO, Vec3::X], &[[0, 1, 2]]));
    assert_eq!(found, "mesh made: triangle 0 names vertex 2, but there are only 2");
}

proptest! {
    /// Nothing in an OBJ file can make the reader panic, and what it accepts is sound.
    #[test]
    fn any_text_is_read_or_refused(lines in prop::collection::vec("(v|f|vt|vn|o|usemtl|mtllib|#)?( -?[0-9]{1,20}(/[0-9]{0,20}){0,3}| nan| x|\\\\){0,5}", 0..12)) {
        if let Ok(mesh) = cao_formats::obj::parse("any.obj", &lines.join("\n")) {
            prop_assert!(!mesh.triangles.is_empty());
            prop_assert!(mesh.triangles.iter().flatten().all(|&v| (v as usize) < mesh.vertices.len()));
            prop_assert!(mesh.vertices.iter().all(|v| v.is_finite()));
            let _ = mesh.check_solid();
        }
    }

    /// The volume is the solid's own: it does not depend on where the mesh stands.
    #[test]
    fn volume_does_not_depend_on_place(x in -1e3f32..1e3, y in -1e3f32..1e3, z in -1e3f32..1e3) {
        let mut mesh = TriangleMesh::sphere(2);
        let volume = mesh.signed_volume();
        mesh.vertices.iter_mut().for_each(|v| *v += Vec3::new(x, y, z));
        // Positions near 1000 are rounded to 6e-5.
        prop_assert!((mesh.signed_volume() - volume).abs() < 1e-3);
    }

    /// Every refusal against an independent count: parts that touch, nest and overlap, some inside out, some with holes. A mesh is
    /// closed if and only if its winding number is whole everywhere, and a solid if and only if it is then not 0 somewhere.
    #[test]
    fn what_is_refused_has_no_winding_number_or_none_but_0(
        parts in prop::collection::vec((0..3_usize, 0..3_u32, (-2..=2_i8, -2..=2_i8, -2..=2_i8), any::<bool>()), 1..5),
        holes in prop::collection::vec(any::<prop::sample::Index>(), 0..3),
        flips in prop::collection::vec(any::<prop::sample::Index>(), 0..2),
        damaged in any::<bool>(),
    ) {
        // Coarse, so that parts often share vertices.
        let shapes = [TriangleMesh::cuboid(), TriangleMesh::torus(4, 4), TriangleMesh::sphere(0)];
        let parts: Vec<_> = parts
            .into_iter()
            .map(|(shape, scale, (x, y, z), turned)| {
                (&shapes[shape], 0.5 * 2_f32.powi(scale as i32), Vec3::new(x.into(), y.into(), z.into()), turned)
            })
            .collect();
        let mut mesh = join(&parts);
        if damaged {
            for flip in flips {
                let at = flip.index(mesh.triangles.len());
                mesh.triangles[at].swap(0, 1);
            }
            for hole in holes {
                mesh.triangles.swap_remove(hole.index(mesh.triangles.len()));
            }
        }
        // Points on both sides of every face, off all of them: the grid of the vertices is coarser.
        let off = DVec3::new(0.013_1, 0.017_3, 0.019_7);
        let (mut whole, mut something) = (true, false);
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|v| mesh.vertices[v as usize].as_dvec3());
            for sign in [-1.0, 1.0] {
                let count = winding_number(&mesh, (a + b + c) / 3.0 + off * sign);
                whole &= (count - count.round()).abs() < 1e-6;
                something |= count.round() != 0.0;
            }
        }
        prop_assert_eq!(mesh.closed().is_ok(), whole, "{:?}", mesh.closed());
        prop_assert_eq!(mesh.check_solid().is_ok(), whole && something, "{:?}", mesh.check_solid());
    }
}
