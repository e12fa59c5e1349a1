//! Scene files: what they say, what follows when they say nothing, and what they are refused for.

use std::path::Path;

use cao_formats::Error;
use cao_formats::scene::{Scene, TransferSource, Viewpoint, VolumeSource};
use cao_model::clip::{Mode, Shape};
use cao_model::frame::Frame;
use cao_model::look::{LightFrom, Occluded, Shading};
use cao_model::mesh::TriangleMesh;
use cao_model::methods::Method;
use cao_model::occlusion::{Quadrature, RaySet};
use cao_model::settings::Scope;
use glam::Vec3;

const ENGINE: &str = "volume = \"builtin:engine:16\"\n";

fn read(text: &str) -> Result<Scene, Error> {
    Scene::from_toml(text, Path::new("."))
}

/// A scene of the built-in engine with `text` after it.
fn with(text: &str) -> Scene {
    read(&format!("{ENGINE}{text}")).unwrap()
}

fn volume(scene: &Scene) -> &VolumeSource {
    scene.volume.as_ref().unwrap()
}

fn obj(mesh: &TriangleMesh) -> String {
    let vertices = mesh.vertices.iter().map(|v| format!("v {} {} {}\n", v.x, v.y, v.z));
    let faces = mesh.triangles.iter().map(|t| format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1));
    vertices.chain(faces).collect()
}

#[test]
fn a_volume_is_enough() {
    let scene = with("");
    let default = Scene::default_for(VolumeSource::parse("builtin:engine:16"));
    assert_eq!(format!("{scene:?}"), format!("{default:?}"));
    assert_eq!(volume(&scene).open(&scene.reading).unwrap().volume.dims, [16; 3]);
    let occlusion = scene.occlusion.setup(0.5).unwrap().occlusion;
    assert_eq!(
        (occlusion.radius_mm, occlusion.rays, occlusion.quadrature),
        (10.0, RaySet::Spiral(50), Quadrature::Hybrid)
    );
    assert_eq!((scene.occlusion.method, scene.occlusion.scope), (Method::Rays, Scope::Needed));
    // Every face of the volume is seen at its middle, by both eyes.
    for view in scene.stereo.rig([16.0; 3]).views(1.0, 0.1, 1e3).unwrap() {
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            for face in [axis * 8.0, axis * -8.0] {
                let (uv, _) = view.project(face).unwrap();
                assert!(uv.min_element() > 0.0 && uv.max_element() < 1.0, "{face}: {uv}");
            }
        }
    }
}

#[test]
fn a_scene_says_what_its_axes_are() {
    let frames = ["", "frame = \"patient\"", "frame = \"index\""].map(|text| with(text).frame);
    assert_eq!(frames, [Frame::Patient, Frame::Patient, Frame::Index]);
}

/// What a scene leaves open follows from what it says: a rule of the paper asks for rays, and these for the paper's set.
#[test]
fn method_rule_and_rays_follow_from_each_other() {
    for (text, expected) in [
        ("method = \"cao\"", (Method::Cao, RaySet::R26, Quadrature::Left)),
        ("quadrature = \"cell\"", (Method::Cao, RaySet::R26, Quadrature::Cell)),
        ("quadrature = \"segment\"", (Method::Cao, RaySet::R26, Quadrature::Segment)),
        ("quadrature = \"nearest\"", (Method::Rays, RaySet::Spiral(50), Quadrature::Nearest)),
        ("rays = \"spiral:96\"", (Method::Rays, RaySet::Spiral(96), Quadrature::Hybrid)),
        ("rays = 26", (Method::Rays, RaySet::R26, Quadrature::Hybrid)),
        ("method = \"lao\"\nquadrature = \"segment\"", (Method::Lao, RaySet::R26, Quadrature::Segment)),
    ] {
        let found = with(&format!("[occlusion]\n{text}")).occlusion;
        assert_eq!((found.method, found.rays, found.quadrature), expected, "{text}");
    }
}

#[test]
fn the_default_background_is_the_colour_that_the_documentation_shows() {
    assert_eq!(with("[image]\nbackground = \"#17191d\"").image, with("").image);
}

#[test]
fn clips_stand_where_the_file_says() {
    let scene = with(
        "[[clip]]\nshape = \"box\"\nmode = \"keep\"\ntranslate_mm = [1, 2.5, -3]\nrotate_deg = [0, 90, 0]\nscale = [4, 5, 6]\n\
         [[clip]]\nshape = \"torus\"\nscale = 7",
    );
    let [first, second] = &scene.clips[..] else { panic!("two clips") };
    assert!(matches!(first.shape, Shape::Box) && first.mode == Mode::Keep);
    assert_eq!(first.pose.translate_mm, Vec3::new(1.0, 2.5, -3.0));
    assert_eq!(first.pose.rotate_deg, Vec3::new(0.0, 90.0, 0.0));
    assert_eq!(first.pose.scale, Vec3::new(4.0, 5.0, 6.0));
    assert!(matches!(second.shape, Shape::Torus) && second.mode == Mode::Remove);
    assert_eq!((second.pose.translate_mm, second.pose.scale), (Vec3::ZERO, Vec3::splat(7.0)));
}

#[test]
fn every_setting_arrives() {
    let scene = with(
        "transfer = \"mr\"\n\
         [occlusion]\nmethod = \"lao\"\nrays = \"50w\"\nquadrature = \"segment\"\nradius_mm = 12\noffset_mm = 0.25\n\
         step_mm = 0.75\nscope = \"all\"\n\
         [stereo]\nposition_mm = [0, -100, 0]\ntarget_mm = [0, 10, 0]\nup = [1, 0, 0]\nipd_mm = 0\nfov_deg = 60\n\
         screen_mm = 50\n\
         [image]\nwidth = 320\nheight = 200\nstep_mm = 0.5\nbackground = [1, 1, 1]\n\
         [shading]\nambient = 1\ndiffuse = 0\nlight = [0, 0, 2]\nmode = \"phong\"\n\
         specular = 0.5\nshininess = 9\ntwo_sided = true\nlight_from = \"world\"\nocclusion = \"all\"\ngain = 3",
    );
    assert_eq!(scene.transfer, TransferSource::Preset("mr".into()));
    let o = scene.occlusion.setup(1.0).unwrap().occlusion;
    assert_eq!((scene.occlusion.method, scene.occlusion.scope), (Method::Lao, Scope::All));
    assert_eq!((o.rays, o.quadrature), (RaySet::W50, Quadrature::Segment));
    assert_eq!((o.radius_mm, o.offset_mm, o.step_mm), (12.0, Some(0.25), Some(0.75)));
    let rig = scene.stereo.rig([1.0; 3]);
    assert_eq!((rig.position, rig.target, rig.up), (Vec3::Y * -100.0, Vec3::Y * 10.0, Vec3::X));
    assert_eq!((rig.ipd_mm, rig.fov_deg, rig.screen_mm), (0.0, 60.0, Some(50.0)));
    assert_eq!((scene.image.width, scene.image.height, scene.look.step_mm), (320, 200, Some(0.5)));
    assert_eq!(scene.image.background, [1.0; 3]);
    let s = scene.look;
    assert_eq!((s.ambient, s.diffuse, s.light, s.shading), (1.0, 0.0, Vec3::Z, Shading::Phong));
    assert_eq!((s.specular, s.shininess, s.two_sided, s.gain), (0.5, 9.0, true, 3.0));
    assert_eq!((s.light_from, s.occluded), (LightFrom::World, Occluded::All));
    // A number names a ray set as its text does.
    assert_eq!(with("[occlusion]\nrays = 54").occlusion.rays, RaySet::R54);
}

#[test]
fn framing_keeps_its_side_at_another_distance_and_a_comfortable_parallax() {
    let scene = with("[stereo]\nazimuth_deg = 90\nelevation_deg = 0\ndistance_mm = 300");
    let rig = scene.stereo.rig([100.0, 50.0, 20.0]);
    assert!((rig.position - Vec3::X * 300.0).length() < 1e-3, "{}", rig.position);
    assert!((rig.ipd_mm - 20.0).abs() < 1e-4);
    let far = with("[stereo]\nposition_mm = [0, 0, 3000]\nup = [0, 1, 0]").stereo;
    assert!(matches!(far.viewpoint, Viewpoint::Placed { .. }));
    assert!((far.rig([1.0; 3]).ipd_mm - 200.0).abs() < 1e-3, "as far away as it may be");
}

/// Eyes frame what is visible unless the scene gives them a place or asks for the box; what else it says of them stays.
#[test]
fn what_is_visible_is_framed_unless_a_scene_says_otherwise() {
    let fitting = with("[stereo]\nazimuth_deg = 10\nipd_mm = 3\nscreen_mm = 70").stereo.fitting(1.5).unwrap();
    assert_eq!((fitting.azimuth_deg, fitting.elevation_deg, fitting.aspect), (10.0, 25.0, 1.5));
    assert_eq!((fitting.ipd_mm, fitting.screen_mm), (Some(3.0), Some(70.0)));
    assert_eq!((fitting.fov_deg, fitting.distance_mm), (None, None));
    assert_eq!(with("[stereo]\nfit = \"visible\"").stereo, with("").stereo);
    for other in ["fit = \"box\"", "position_mm = [9, 0, 0]"] {
        assert_eq!(with(&format!("[stereo]\n{other}")).stereo.fitting(1.0), None, "{other}");
    }
}

#[test]
fn files_are_found_beside_the_scene() {
    let dir = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    put("mine.toml", "opacity = [[0, 0.25]]\ncolour = \"#ffffff\"");
    put("values.raw", "\u{1}\u{2}");
    put("ball.obj", &obj(&TriangleMesh::sphere(1)));
    let mut inside_out = TriangleMesh::cuboid();
    inside_out.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    put("cube.obj", &obj(&inside_out));
    put(
        "scene.toml",
        "volume = { raw = \"values.raw\", dims = [2, 1, 1], type = \"uint8\", spacing_mm = [1, 1, 2], endian = \"big\" }\n\
         transfer = \"mine.toml\"\n[[clip]]\nmesh = \"ball.obj\"\n[[clip]]\nmesh = \"cube.obj\"\n",
    );
    let scene = Scene::load(&dir.path().join("scene.toml")).unwrap();
    assert_eq!(
        *volume(&scene),
        VolumeSource::Raw {
            path: dir.path().join("values.raw"),
            dims: [2, 1, 1],
            kind: "uint8".into(),
            spacing_mm: [1.0, 1.0, 2.0],
            big_endian: true
        }
    );
    let opened = volume(&scene).open(&scene.reading).unwrap().volume;
    assert_eq!((opened.at(0, 0, 0), opened.at(1, 0, 0), opened.spacing), (1.0, 2.0, [1.0, 1.0, 2.0]));
    assert_eq!(scene.transfer(opened.range()).unwrap().opacity_at(0.0), 0.25);
    for clip in &scene.clips {
        let Shape::Mesh(mesh) = &clip.shape else { panic!("a mesh") };
        assert!(
            mesh.signed_volume().abs() > 3.0 && mesh.check_solid().is_ok(),
            "a solid, whichever way it faces"
        );
    }
    put("series.toml", "volume = { dicom = \"values.raw\", series = \"2\" }");
    let series = Scene::load(&dir.path().join("series.toml")).unwrap();
    let path = dir.path().join("values.raw");
    assert_eq!(*volume(&series), VolumeSource::Series { path, series: "2".into() });
    let refusal = volume(&series).open(&cao_formats::Reading::default()).unwrap_err().to_string();
    assert!(refusal.contains("only DICOM files have series"), "{refusal}");
    put("plain.toml", "volume = \"values.raw\"");
    let plain = Scene::load(&dir.path().join("plain.toml")).unwrap();
    assert_eq!(*volume(&plain), VolumeSource::File(dir.path().join("values.raw")));
}

#[test]
fn transfer_functions_can_stand_in_the_scene() {
    let scene = with("[transfer]\nopacity = [[0, 0], [10, 1]]\ncolour = \"#ff0000\"\nreference_mm = 2");
    let transfer = scene.transfer((0.0, 1.0)).unwrap();
    assert_eq!((transfer.opacity_at(5.0), transfer.reference_mm(1.0)), (0.5, 2.0));
}

#[test]
fn wrong_files_are_refused_with_the_scene_and_its_key() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scene.toml");
    let found = Scene::load(&path).unwrap_err();
    assert!(matches!(found, Error::Io { .. }) && found.to_string().contains("scene.toml"), "{found}");
    std::fs::write(dir.path().join("open.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    std::fs::write(dir.path().join("bad.toml"), "opacity = [[0, 7]]\ncolour = \"#ffffff\"\n").unwrap();
    for (text, expected) in [
        ("volume = \"gone.nrrd\"", vec!["scene.toml: volume: there is no file", "gone.nrrd"]),
        (
            "volume = { raw = \"gone.raw\", dims = [1, 1, 1], type = \"u8\" }",
            vec!["scene.toml: volume.raw:", "gone.raw"],
        ),
        (
            "volume = \"builtin:engine:8\"\ntransfer = \"gone.toml\"",
            vec!["scene.toml: transfer:", "gone.toml"],
        ),
        ("volume = \"builtin:engine:8\"\ntransfer = \"bad.toml\"", vec!["bad.toml: opacity[0]: 7"]),
        (
            "volume = \"builtin:engine:8\"\n[[clip]]\nmesh = \"gone.obj\"",
            vec!["scene.toml: clip[0].mesh:", "gone.obj"],
        ),
        (
            "volume = \"builtin:engine:8\"\n[[clip]]\nmesh = \"open.obj\"",
            vec!["open.obj: the surface does not", "3 edges are open"],
        ),
    ] {
        std::fs::write(&path, text).unwrap();
        let found = Scene::load(&path).unwrap_err().to_string();
        assert!(expected.iter().all(|part| found.contains(part)), "{text}: {found}");
    }
}

#[test]
fn unknown_keys_are_refused_by_name_and_line() {
    for (text, key, line) in [
        ("colour = 1", "colour", 2),
        ("[occlusion]\nradius = 3", "radius", 3),
        ("[[clip]]\nshape = \"box\"\nsize = 3", "size", 4),
        ("[stereo]\neyes = 2", "eyes", 3),
        ("[image]\nsize = 3", "size", 3),
        ("[shading]\nglossy = 1", "glossy", 3),
    ] {
        let found = read(&format!("{ENGINE}{text}")).unwrap_err().to_string();
        assert!(found.contains(&format!("unknown field `{key}`, expected")), "{found}");
        assert!(found.contains(&format!("line {line}")), "{found}");
    }
    for (text, key) in [
        (
            "volume = { raw = \"Cargo.toml\", dims = [1, 1, 1], type = \"u8\", size = 3 }",
            "volume: unknown field `size`",
        ),
        ("volume = \"builtin:engine:8\"\ntransfer = { opaque = 1 }", "transfer.keys: unknown field `opaque`"),
        ("transfer = \"mr\"", "missing field `volume`"),
    ] {
        let found = read(text).unwrap_err().to_string();
        assert!(found.contains(key), "{found}");
    }
}

#[test]
fn impossible_values_are_refused_by_name() {
    let nine = "[[clip]]\nshape = \"box\"\n".repeat(9);
    for (text, expected) in [
        ("frame = \"world\"", "frame: \"world\"; expected patient or index"),
        ("transfer = 3", "transfer: 3: expected a preset, a file, or a table"),
        ("transfer = \"ct-bones\"", "transfer: there is no file"),
        (
            "[transfer]\nopacity = [[0, 2]]\ncolour = \"#ffffff\"",
            "transfer.opacity[0]: 2: expected a number from 0 to 1",
        ),
        ("[[clip]]\nmode = \"keep\"", "clip[0]: expected either shape or mesh"),
        ("[[clip]]\nshape = \"box\"\nmesh = \"a.obj\"", "clip[0]: expected either shape or mesh"),
        ("[[clip]]\nshape = \"box\"\n[[clip]]\nshape = \"cube\"", "clip[1].shape: \"cube\" is no shape"),
        ("[[clip]]\nshape = \"box\"\nmode = \"cut\"", "clip[0].mode: \"cut\"; expected remove or keep"),
        ("[[clip]]\nshape = \"box\"\nscale = 0", "clip[0].scale: "),
        ("[[clip]]\nshape = \"box\"\nscale = -2", "clip[0].scale: "),
        (
            "[[clip]]\nshape = \"box\"\nscale = [1, 2]",
            "clip[0].scale: [1, 2]: expected a number > 0 or three",
        ),
        ("[[clip]]\nshape = \"box\"\nscale = \"big\"", "clip[0].scale: \"big\": expected"),
        ("[[clip]]\nshape = \"box\"\ntranslate_mm = [nan, 0, 0]", "clip[0].translate_mm: "),
        ("[[clip]]\nshape = \"box\"\nrotate_deg = [0, inf, 0]", "clip[0].rotate_deg: "),
        (&nine, "clip: 9 clips: expected at most 8"),
        ("[occlusion]\nradius_mm = -3", "occlusion.radius_mm: -3: expected a length >= 0 mm"),
        ("[occlusion]\nradius_mm = nan", "occlusion.radius_mm: NaN: expected a length >= 0 mm"),
        ("[occlusion]\noffset_mm = -0.5", "occlusion.offset_mm: -0.5: expected a length >= 0 mm"),
        ("[occlusion]\nstep_mm = 0", "occlusion.step_mm: 0: expected a length > 0 mm"),
        ("[occlusion]\nstep_mm = 1e-60", "occlusion.step_mm: "),
        ("[occlusion]\nrays = 7", "occlusion.rays: \"7\" is no ray set"),
        ("[occlusion]\nrays = [26]", "occlusion.rays: "),
        ("[occlusion]\nquadrature = \"simpson\"", "occlusion.quadrature: \"simpson\" is no rule"),
        (
            "[occlusion]\nmethod = \"ssao\"",
            "occlusion.method: \"ssao\": expected sat, shells, vicinity, histograms, dvao, fdao, spao, cones, lao, cao, rays",
        ),
        ("[occlusion]\nscope = \"some\"", "occlusion.scope: \"some\": expected needed or all"),
        ("[stereo]\nipd_mm = -1", "stereo.ipd_mm: -1: expected a length >= 0 mm"),
        ("[stereo]\nscreen_mm = 0", "stereo.screen_mm: 0: expected a length > 0 mm"),
        ("[stereo]\nfov_deg = 180", "stereo.fov_deg: 180: expected"),
        ("[stereo]\ndistance_mm = 0", "stereo.distance_mm: 0: expected a length > 0 mm"),
        ("[stereo]\nelevation_deg = 91", "stereo.elevation_deg: 91: expected -90 to 90 degrees"),
        ("[stereo]\nazimuth_deg = inf", "stereo.azimuth_deg: inf: expected"),
        ("[stereo]\ntarget_mm = [0, 0, 0]", "stereo.target_mm: has no effect without stereo.position_mm"),
        ("[stereo]\nposition_mm = [9, 0, 0]\nazimuth_deg = 3", "stereo.azimuth_deg: has no effect"),
        ("[stereo]\nposition_mm = [9, 0, 0]\nfit = \"visible\"", "stereo.fit: has no effect"),
        ("[stereo]\nfit = \"all\"", "stereo.fit: \"all\"; expected visible or box"),
        ("[stereo]\nposition_mm = [0, 0, 0]", "stereo.target_mm: "),
        ("[stereo]\nposition_mm = [0, 0, 9]", "stereo.up: "),
        ("[image]\nwidth = 0", "image.width: 0: expected 1 to 16384 pixels"),
        ("[image]\nheight = 99999", "image.height: 99999: expected 1 to 16384 pixels"),
        ("[image]\nstep_mm = -1", "image.step_mm: -1: expected a length > 0 mm"),
        ("[image]\nsamples = 257", "image.samples: 257: expected 1 to 256"),
        ("[image]\nfilter = \"tent\"", "image.filter: \"tent\": expected box or gaussian"),
        ("[image]\nbackground = \"black\"", "image.background: \"black\": expected \"#rrggbb\""),
        ("[shading]\nambient = -1", "shading.ambient: -1: expected a number from 0 to 10"),
        ("[shading]\ndiffuse = nan", "shading.diffuse: NaN: expected a number from 0 to 10"),
        ("[shading]\nshininess = 0", "shading.shininess: 0; expected a number from 1 to 10000"),
        ("[shading]\nmode = \"solid\"", "shading.mode: \"solid\"; expected none, phong, ao or phong+ao"),
        ("[shading]\nlight_from = \"hand\"", "shading.light_from: \"hand\"; expected head or world"),
        ("[shading]\nocclusion = \"none\"", "shading.occlusion: \"none\"; expected ambient or all"),
        (
            "[shading]\nocclusion = false",
            "shading.occlusion: false: expected \"ambient\" or \"all\"; a picture without",
        ),
        ("[shading]\nlight = [0, 0, 0]", "shading.light: [0.0, 0.0, 0.0]: expected a direction"),
    ] {
        let found = read(&format!("{ENGINE}{text}")).unwrap_err().to_string();
        assert!(found.starts_with(expected), "{text}\n gave: {found}\n not: {expected}");
    }
    for (text, expected) in [
        ("volume = 3", "volume: 3: expected a file, builtin:NAME:SIZE, or a table"),
        (
            "volume = { raw = \"Cargo.toml\", dims = [0, 1, 1], type = \"u8\" }",
            "volume.dims: [0, 1, 1]: expected",
        ),
        (
            "volume = { raw = \"Cargo.toml\", dims = [1, 1, 1], type = \"u8\", spacing_mm = [1, 0, 1] }",
            "volume.spacing_mm: 0",
        ),
        ("volume = { raw = \"Cargo.toml\", dims = [1, 1], type = \"u8\" }", "volume: "),
        (
            "volume = { raw = \"Cargo.toml\", dims = [1, 1, 1], type = \"u8\", endian = \"middle\" }",
            "volume: unknown variant",
        ),
    ] {
        let found = read(text).unwrap_err().to_string();
        assert!(found.starts_with(expected), "{text}\n gave: {found}\n not: {expected}");
    }
}

#[test]
fn a_radius_beyond_reason_is_refused_when_the_spacing_is_known() {
    let scene = with("[occlusion]\nradius_mm = 5000");
    assert!(scene.occlusion.setup(10.0).is_ok());
    assert!(matches!(scene.occlusion.setup(0.1), Err(Error::Model(cao_model::Error::Limit { .. }))));
}
