//! The tables of a scene file about meshes: what they say, and what they are refused for.

use std::path::Path;

use cao_formats::mesh_keys::MeshFrom;
use cao_formats::scene::Scene;
use cao_model::pixel_occlusion::{PixelMethod, PixelOcclusion};
use cao_model::surface::World;
use glam::Vec3;

fn read(text: &str) -> Result<Scene, String> {
    Scene::from_toml(text, Path::new(".")).map_err(|error| error.to_string())
}

#[test]
fn a_mesh_is_enough() {
    let scene = read("[[mesh]]\nbuiltin = \"fence\"").unwrap();
    assert!(scene.volume.is_none());
    assert_eq!(scene.mesh_occlusion, None);
    let [mesh] = &scene.meshes[..] else { panic!("{:?}", scene.meshes) };
    let MeshFrom::Builtin(fence, detail) = mesh.from else { panic!("{mesh:?}") };
    assert_eq!((fence.name, detail), ("fence", fence.detail));
    let (as_made, from_scene) = (fence.instances(), mesh.instances().unwrap());
    let worlds = [as_made, from_scene].map(|instances| World::new(&instances).unwrap().triangles);
    assert_eq!(worlds[0], worlds[1]);
    // Volumes need none, and may stand beside them.
    let both =
        read("volume = \"builtin:engine:16\"\n[[mesh]]\nbuiltin = \"fence\"\n[occlusion]\nmethod = \"cao\"")
            .unwrap();
    assert_eq!((both.volume.is_some(), both.meshes.len()), (true, 1));
}

#[test]
fn every_key_of_a_mesh_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    put("a.obj", b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\nusemtl n\nf 1/1 2/1 3/1\n");
    put("a.mtl", b"newmtl m\nKd 1 0 0\nmap_Kd t.png\nmap_d t.png\nnewmtl n\nmap_Kd t.png\n");
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, 1, 1);
    encoder.set_color(png::ColorType::Rgba);
    encoder.write_header().unwrap().write_image_data(&[9, 9, 9, 200]).unwrap();
    put("t.png", &png);
    let text = "[[mesh]]\nfile = \"a.obj\"\ntranslate_mm = [1, 2, 3]\nrotate_deg = [0, 0, 90]\nscale = [2, 1, 1]\ncolour = \"#00ff00\"\n\
                two_sided = false\nspared = true\n[[mesh]]\nbuiltin = \"level\"\ndetail = 1\n[mesh_occlusion]\nmethod = \"aov\"\ndelta_mm = 7\nsparse = 15\nclamp = true\n";
    let scene = Scene::from_toml(text, folder.path()).unwrap();
    let instances = scene.meshes[0].instances().unwrap();
    let world = World::new(&instances).unwrap();
    // (1, 0, 0) twice as far, turned to y.
    assert!(
        (world.triangles[0].corners[1] - Vec3::new(1.0, 4.0, 3.0)).length() < 1e-5,
        "{:?}",
        world.triangles[0]
    );
    let [m, n] = &world.materials[..] else { panic!("{:?}", world.materials) };
    assert_eq!((m.colour, m.two_sided, m.cutoff), ([0.0, 1.0, 0.0], false, Some(0.5)));
    assert!(m.spared && n.spared);
    assert_eq!(m.texture.as_ref().unwrap().texels, [[255, 255, 255, 200]], "its mask is left");
    assert_eq!((n.colour, n.two_sided, n.texture.is_none()), ([0.0, 1.0, 0.0], false, true));
    assert_eq!(scene.meshes[1].instances().unwrap()[0].surface.name, "level");
    let expected = PixelOcclusion {
        delta_mm: Some(7.0),
        sparse: 15,
        clamp: true,
        ..PixelOcclusion::of(PixelMethod::Aov)
    };
    assert_eq!(scene.mesh_occlusion, Some(expected));
    let of = |keys: &str| {
        let scene = read(&format!("[[mesh]]\nbuiltin = \"house\"\n[mesh_occlusion]\n{keys}")).unwrap();
        scene.mesh_occlusion.unwrap()
    };
    assert_eq!(of("method = \"rays\"\nrays = 5000").rays, 5000);
    assert_eq!(of("method = \"hbao\"\nsamples = 96").samples, 96);
    assert_eq!(of("method = \"crytek\""), PixelOcclusion::of(PixelMethod::Crytek));
    // Of what a volume's picture shows.
    let alone = read("volume = \"builtin:engine:8\"\n[mesh_occlusion]\nmethod = \"hbao\"").unwrap();
    assert_eq!(alone.mesh_occlusion, Some(PixelOcclusion::of(PixelMethod::Hbao)));
}

#[test]
fn caps_are_of_one_colour_however_many_materials() {
    let cap = |keys: &str| {
        let scene = read(&format!("[[mesh]]\nbuiltin = \"house\"\ndetail = 1\n{keys}")).unwrap();
        let [house] = &scene.meshes[0].instances().unwrap()[..] else { panic!("one instance") };
        let colours: Vec<_> = house.surface.materials.iter().map(|material| material.colour).collect();
        let caps: Vec<_> = house.surface.materials.iter().map(|material| material.cap).collect();
        assert!(caps.iter().all(|cap| *cap == caps[0]), "{caps:?}");
        (caps[0], colours)
    };
    assert_eq!(cap("").0, None);
    assert_eq!(cap("cap = false").0, None);
    let (own, colours) = cap("cap = true");
    assert!(own == Some(colours[0]) && colours[1] != colours[0], "{own:?} of {colours:?}");
    assert_eq!(cap("cap = true\ncolour = \"#00ff00\"").0, Some([0.0, 1.0, 0.0]));
    assert_eq!(cap("cap = [1, 0, 1]").0, Some([1.0, 0.0, 1.0]));
}

#[test]
fn instances_that_share_a_surface_still_do() {
    let scene =
        read("[[mesh]]\nbuiltin = \"colonnade\"\ndetail = 1\ncolour = \"#ffffff\"\nscale = 2").unwrap();
    let instances = scene.meshes[0].instances().unwrap();
    let mut surfaces: Vec<_> =
        instances.iter().map(|instance| std::sync::Arc::as_ptr(&instance.surface)).collect();
    surfaces.sort_unstable();
    surfaces.dedup();
    assert_eq!((instances.len(), surfaces.len()), (33, 2));
}

#[test]
fn what_is_wrong_with_meshes_is_refused_by_name() {
    let house = "[[mesh]]\nbuiltin = \"house\"\n";
    let many = house.repeat(65);
    for (text, expected) in [
        ("", "scene: missing field `volume`; expected it, or [[mesh]]"),
        ("[image]\nwidth = 3", "scene: missing field `volume`"),
        (
            "volume = \"builtin:engine:8\"\n[mesh_occlusion]\nsparse = 3",
            "mesh_occlusion.method: aov: it reads triangles, and there is no [[mesh]]; of a volume's picture expected crytek, volumetric, hbao",
        ),
        (
            "volume = \"builtin:engine:8\"\n[mesh_occlusion]\nmethod = \"hbao\"\n[occlusion]\nrays = 26",
            "occlusion: has no effect beside [mesh_occlusion]",
        ),
        ("[[mesh]]\nscale = 2", "mesh[0]: expected either file or builtin"),
        ("[[mesh]]\nfile = \"a.obj\"\nbuiltin = \"house\"", "mesh[0]: expected either file or builtin"),
        ("[[mesh]]\nfile = \"gone.obj\"", "mesh[0].file: there is no file ./gone.obj"),
        ("[[mesh]]\nfile = \"Cargo.toml\"\ndetail = 2", "mesh[0].detail: has no effect without builtin"),
        (
            &format!("{house}[[mesh]]\nbuiltin = \"sponza\""),
            "mesh[1].builtin: \"sponza\": expected colonnade, fence",
        ),
        ("[[mesh]]\nbuiltin = \"house\"\ndetail = 0", "mesh[0].detail: 0: expected 1 to 16"),
        ("[[mesh]]\nbuiltin = \"house\"\ndetail = 17", "mesh[0].detail: 17: expected 1 to 16"),
        ("[[mesh]]\nbuiltin = \"house\"\nscale = 0", "mesh[0].scale: "),
        (
            "[[mesh]]\nbuiltin = \"house\"\nscale = \"big\"",
            "mesh[0].scale: \"big\": expected a number > 0 or three",
        ),
        ("[[mesh]]\nbuiltin = \"house\"\ntranslate_mm = [nan, 0, 0]", "mesh[0].translate_mm: "),
        ("[[mesh]]\nbuiltin = \"house\"\nrotate_deg = [0, inf, 0]", "mesh[0].rotate_deg: "),
        ("[[mesh]]\nbuiltin = \"house\"\ncolour = \"red\"", "mesh[0].colour: \"red\": expected \"#rrggbb\""),
        (
            "[[mesh]]\nbuiltin = \"house\"\ncap = \"red\"",
            "mesh[0].cap: \"red\": expected true, false, \"#rrggbb\"",
        ),
        (
            "[[mesh]]\nbuiltin = \"house\"\ncap = true\nspared = true",
            "mesh[0].cap: has no effect with spared, which clips do not cut; take one of both away",
        ),
        (&many, "mesh: 65 meshes: expected at most 64"),
        (&format!("frame = \"index\"\n{house}"), "frame: has no effect without volume"),
        (&format!("transfer = \"mr\"\n{house}"), "transfer: has no effect without volume"),
        (&format!("label = \"a.nrrd\"\n{house}"), "label: has no effect without volume"),
        (&format!("{house}[occlusion]\nmethod = \"rays\""), "occlusion: has no effect without volume"),
        (
            &format!("{house}[mesh_occlusion]\nmethod = \"ssao\""),
            "mesh_occlusion.method: \"ssao\": expected aov, rays, crytek",
        ),
        (
            &format!("{house}[mesh_occlusion]\ndelta_mm = 0"),
            "mesh_occlusion.delta_mm: 0: expected a length > 0 mm",
        ),
        (
            &format!("{house}[mesh_occlusion]\nsparse = 2"),
            "mesh_occlusion.sparse: 2: expected 1, 3, 5, 15 of the method aov",
        ),
        (&format!("{house}[mesh_occlusion]\nrays = 9"), "mesh_occlusion.rays: 9: the method aov has no rays"),
        (
            &format!("{house}[mesh_occlusion]\nmethod = \"crytek\"\nclamp = true"),
            "mesh_occlusion.clamp: true: the method crytek has no volumes",
        ),
        (
            &format!("{house}[mesh_occlusion]\nmethod = \"rays\"\nrays = -1"),
            "mesh_occlusion.rays: -1: expected",
        ),
        (
            &format!("{house}[mesh_occlusion]\nmethod = \"volumetric\"\nsamples = 1025"),
            "mesh_occlusion.samples: 1025: expected 1 to 1024",
        ),
    ] {
        let found = read(text).unwrap_err();
        assert!(found.starts_with(expected), "{text}\n gave: {found}\n not: {expected}");
    }
    for (text, key) in
        [("[[mesh]]\nshape = \"box\"", "shape"), ("[mesh_occlusion]\nradius_mm = 3", "radius_mm")]
    {
        let found = read(text).unwrap_err();
        assert!(found.contains(&format!("unknown field `{key}`, expected")), "{found}");
    }
}

/// A file is read when its instances are asked for, and refused by its own name.
#[test]
fn files_are_found_beside_the_scene_and_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.obj"), "v 0 0 0\n").unwrap();
    let scene = Scene::from_toml("[[mesh]]\nfile = \"a.obj\"", folder.path()).unwrap();
    let found = scene.meshes[0].instances().unwrap_err().to_string();
    assert!(found.contains("a.obj: has no triangles"), "{found}");
}
