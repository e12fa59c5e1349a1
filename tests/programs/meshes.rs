//! `cao render` of scenes with meshes.

use crate::support::Folder;

#[test]
fn scenes_of_meshes_are_drawn_by_every_method() {
    let folder = Folder::with_device();
    for (method, more) in
        [("aov", "sparse = 5"), ("rays", "rays = 8"), ("crytek", ""), ("volumetric", ""), ("hbao", "")]
    {
        let scene = format!(
            "[[mesh]]\nbuiltin = \"fence\"\ndetail = 1\n[mesh_occlusion]\nmethod = \"{method}\"\n{more}\n\
             [image]\nwidth = 64\nheight = 36\nsamples = 4\n"
        );
        folder.put("scene.toml", scene);
        let answer = folder.json(&format!("render scene.toml -o {method}.png --eyes l.png,r.png"));
        assert_eq!(answer["mesh_method"], method);
        assert_eq!(answer["triangles"], 728);
        assert!(answer["stages_ms"]["gbuffer"].as_f64().is_some_and(|ms| ms > 0.0), "{answer}");
        let pixels = image::open(folder.path(&format!("{method}.png"))).unwrap().into_rgb8();
        assert_eq!(pixels.dimensions(), (128, 36));
        let different: std::collections::HashSet<_> = pixels.pixels().collect();
        assert!(different.len() > 200, "{method}: {} colours", different.len());
    }
}

#[test]
fn what_a_volumes_picture_shows_is_shaded_in_image_space() {
    let folder = Folder::with_device();
    let scene =
        |more: &str| format!("volume = \"builtin:engine:32\"\n{more}\n[image]\nwidth = 64\nheight = 48\n");
    let picture = |name: &str| image::open(folder.path(name)).unwrap().into_rgb8().into_raw();
    folder.put("open.toml", scene("[shading]\nmode = \"phong\""));
    folder.json("render open.toml -o open.png");
    let open = picture("open.png");
    let mut all = Vec::new();
    for method in ["crytek", "volumetric", "hbao"] {
        folder.put("scene.toml", scene(&format!("[mesh_occlusion]\nmethod = \"{method}\"\ndelta_mm = 6")));
        let answer = folder.json(&format!("render scene.toml -o {method}.png"));
        assert_eq!((&answer["mesh_method"], &answer["delta_mm"]), (&method.into(), &6.0.into()));
        assert!(answer["stages_ms"]["image space"].as_f64().is_some_and(|ms| ms > 0.0), "{answer}");
        let shaded = picture(&format!("{method}.png"));
        assert!(shaded.iter().zip(&open).all(|(a, b)| a <= b), "{method}: brighter than open");
        let darker = shaded.iter().zip(&open).filter(|(a, b)| **a + 10 < **b).count();
        assert!(darker > 300, "{method}: {darker}");
        all.push(shaded);
    }
    assert!(all[0] != all[1] && all[1] != all[2]);
    let refused = folder.run("render scene.toml -o x.png --method rays");
    assert!(refused.code == Some(2) && refused.err.contains("[mesh_occlusion]"), "{}", refused.err);
}

#[test]
fn meshes_stand_in_volumes_and_are_cut_with_them() {
    let folder = Folder::with_device();
    let scene = |clip: &str| {
        format!(
            "volume = \"builtin:engine:24\"\n[[mesh]]\nbuiltin = \"house\"\ndetail = 1\nscale = 0.02\n{clip}\
             [image]\nwidth = 48\nheight = 48\n"
        )
    };
    folder.put("whole.toml", scene(""));
    folder.put("cut.toml", scene("[[clip]]\nshape = \"sphere\"\nscale = 9\ntranslate_mm = [6, -6, 6]\n"));
    let answer = folder.json("render whole.toml -o whole.png");
    assert_eq!((&answer["dims"][0], &answer["method"]), (&24.into(), &"rays".into()));
    folder.json("render cut.toml -o cut.png");
    let picture = |name: &str| image::open(folder.path(name)).unwrap().into_rgb8().into_raw();
    let (whole, cut) = (picture("whole.png"), picture("cut.png"));
    let changed = whole.iter().zip(&cut).filter(|(a, b)| a.abs_diff(**b) > 20).count();
    assert!(changed > 100, "{changed}");
    // A solid one darkens the volume around it.
    let torus = |more: &str| {
        format!(
            "volume = \"builtin:engine:24\"\n[[mesh]]\nfile = \"cube.obj\"\nscale = 5\ntranslate_mm = [6, -6, 6]\n{more}[image]\nwidth = 48\nheight = 48\n"
        )
    };
    folder.put("cube.obj", crate::support::cube_obj(6));
    folder.put("plain.toml", torus("")).put("solid.toml", torus("solid = true\n"));
    folder.json("render plain.toml -o plain.png");
    folder.json("render solid.toml -o solid.png");
    assert_ne!(picture("plain.png"), picture("solid.png"));
    folder.put("lone.toml", "[[mesh]]\nbuiltin = \"house\"\ndetail = 1\nsolid = true\n");
    let refused = folder.run("render lone.toml -o x.png");
    assert!(refused.code == Some(2) && refused.err.contains("no volume"), "{}", refused.err);
    let refused = folder.run("render whole.toml -o x.png --budget-ms 10");
    assert!(refused.code == Some(2) && refused.err.contains("this scene has meshes"), "{}", refused.err);
}

#[test]
fn cut_meshes_show_caps_where_they_are_asked_for() {
    let folder = Folder::with_device();
    folder.put("cube.obj", crate::support::cube_obj(6)).put("open.obj", crate::support::cube_obj(5));
    let scene = |mesh: &str, cap: &str| {
        format!(
            "[[mesh]]\nfile = \"{mesh}.obj\"\nscale = 20\ncolour = \"#3060c0\"\n{cap}\n[[clip]]\nshape = \"sphere\"\nscale = 18\n\
             translate_mm = [8, -20, 10]\n[mesh_occlusion]\nmethod = \"rays\"\nrays = 8\n[image]\nwidth = 64\nheight = 64\n"
        )
    };
    // Pixels of a scene that are red, and blue.
    let drawn = |name: &str, cap: &str| {
        folder.put(&format!("{name}.toml"), scene("cube", cap));
        folder.json(&format!("render {name}.toml -o {name}.png"));
        let picture = image::open(folder.path(&format!("{name}.png"))).unwrap().into_rgb8();
        let count = |colour: usize, other: usize| {
            picture.pixels().filter(|pixel| pixel[colour] > pixel[other].saturating_add(20)).count()
        };
        (count(0, 2), count(2, 0), picture.into_raw())
    };
    let (backs, red, own) =
        (drawn("backs", ""), drawn("red", "cap = \"#c03020\""), drawn("own", "cap = true"));
    assert!(backs.0 == 0 && own.0 == 0, "{} and {} red pixels", backs.0, own.0);
    assert!(red.0 > 300 && red.1 > 300, "{} red and {} blue pixels", red.0, red.1);
    assert!(own.2 != backs.2, "caps in the mesh's own colour are its backs");
    assert!(drawn("none", "cap = false").2 == backs.2);
    for (mesh, cap, parts) in [
        (
            "open",
            "cap = true",
            &[
                "open.obj",
                "cannot have caps: the surface does not enclose a solid",
                "close the holes",
                "do without caps",
            ][..],
        ),
        ("cube", "cap = true\nspared = true", &["mesh[0].cap: has no effect with spared"]),
        ("cube", "cap = 3", &["mesh[0].cap: 3: expected true, false, \"#rrggbb\""]),
    ] {
        folder.put("refused.toml", scene(mesh, cap));
        let refused = folder.run("render refused.toml -o x.png");
        assert_eq!(refused.code, Some(1), "{}", refused.err);
        parts.iter().for_each(|part| assert!(refused.err.contains(part), "{part}: {}", refused.err));
    }
}
