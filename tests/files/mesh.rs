//! Meshes: what comes out of an OBJ file, and what is refused as a clip shape.

use cao_formats::Error;
use cao_model::mesh::TriangleMesh;
use glam::Vec3;
use proptest::prelude::*;

/// Relative rounding of positions kept in f32 (2⁻²⁴), summed over the thousands of triangles of these meshes.
const ROUNDING: f64 = 1e-5;

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
        assert_eq!(mesh.outward().unwrap(), mesh, "{} changed though it was right", mesh.name);
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
    assert!((mesh.outward().unwrap().signed_volume() - 8.0).abs() < ROUNDING);
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
    assert!(message(mesh.outward()).contains("4 edges are open"));
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
fn edges_of_more_than_two_triangles_are_refused() {
    let fin = format!("{TETRAHEDRON}v 0 -1 -1\nf 1 2 5\n");
    let found = message(cao_formats::obj::parse("fin.obj", &fin).unwrap().closed());
    assert!(
        found.contains("2 edges are open") && found.contains("1 edge is shared by more than two"),
        "{found}"
    );
}

#[test]
fn inside_out_meshes_are_turned_and_cavities_stay_cavities() {
    let turned = |mesh: &TriangleMesh| {
        let mut mesh = mesh.clone();
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        mesh
    };
    let (ball, cube) = (TriangleMesh::sphere(2), TriangleMesh::cuboid());
    assert!(turned(&ball).signed_volume() < 0.0);
    assert_eq!(turned(&ball).outward().unwrap().signed_volume(), ball.signed_volume());

    // Surfaces at different places and sizes in one mesh: (surface, scale, shift along x).
    let join = |parts: &[(&TriangleMesh, f32, f32)]| {
        let (mut positions, mut faces) = (Vec::new(), Vec::new());
        for (mesh, scale, shift) in parts {
            let first = positions.len() as u32;
            positions.extend(mesh.vertices.iter().map(|v| *v * *scale + Vec3::X * *shift));
            faces.extend(mesh.triangles.iter().map(|t| t.map(|v| v + first)));
        }
        TriangleMesh::new("parts", &positions, &faces).unwrap()
    };
    let hollow = 8.0 * 8.0 - ball.signed_volume();
    for parts in [
        // A cube with a round cavity, beside a cube that is inside out.
        [(&cube, 2.0, 0.0), (&turned(&ball), 1.0, 0.0), (&turned(&cube), 1.0, 9.0)],
        // The same with the hollow cube as a whole inside out.
        [(&turned(&cube), 2.0, 0.0), (&ball, 1.0, 0.0), (&cube, 1.0, 9.0)],
    ] {
        let volume = join(&parts).outward().unwrap().signed_volume();
        assert!((volume - (hollow + 8.0)).abs() < 64.0 * ROUNDING, "{volume}");
    }
}

#[test]
fn flat_meshes_are_refused() {
    // Two triangles back to back: closed, and nothing in between.
    let flat = cao_formats::obj::parse("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 3 2 1\n").unwrap();
    flat.closed().unwrap();
    assert!(message(flat.outward()).contains("encloses no volume"));
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
        ("v 0 0 0\nv 1 0 0\nf\n", "polygon"),
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
            let _ = mesh.outward();
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
}
