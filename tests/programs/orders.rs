//! Pictures of patients: the same whatever the order of the voxels in the file, no mirror image, clips and eyes on the axes
//! of the patient also where the grid is oblique.

use crate::support::{Folder, nrrd};
use cao_testing::scan::{Order, Scan, orders};
use glam::{DQuat, DVec3};
use serde_json::json;

/// Where the centre of every scan lies in the patient.
const CENTRE: DVec3 = DVec3::new(10.0, -20.0, 30.0);

/// A ball of 3 mm at `places`, in mm from the centre to the right, to anterior and upwards, in a grid with turned axes.
fn balls(rotation: DQuat, places: &[DVec3]) -> Scan {
    let (dims, spacing) = ([26, 22, 18], [1.0, 1.0, 1.25]);
    let directions = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| (rotation * axis).to_array());
    let half = DVec3::from_array([0, 1, 2].map(|a| 0.5 * (dims[a] - 1) as f64 * spacing[a]));
    let origin = (CENTRE - rotation * half).to_array();
    let mut scan = Scan { dims, spacing, directions, origin, values: Vec::new() };
    for voxel in scan.voxels() {
        let at = DVec3::from(scan.position(voxel)) - CENTRE;
        let distance = places.iter().map(|place| at.distance(*place)).fold(f64::INFINITY, f64::min);
        scan.values.push(((3.5 - distance) * 100.0).clamp(0.0, 100.0) as i16);
    }
    scan
}

fn oblique() -> DQuat {
    DQuat::from_axis_angle(DVec3::new(0.4, -0.3, 0.85).normalize(), 0.5)
}

fn folder() -> Folder {
    let folder = Folder::with_device();
    folder.put("t.toml", "opacity = [[0, 0.0], [100, 0.9]]\ncolour = [[0, \"#ffffff\"]]\n");
    folder
}

/// Draws without parallax; returns the left eye's picture.
fn draw(folder: &Folder, file: &str, flags: &str) -> image::RgbImage {
    let look = "--transfer t.toml --size 64x64 --ipd 0 --radius-mm 4 --eyes l.png,r.png";
    folder.ok(&format!("render {file} {look} {flags}"));
    image::open(folder.path("l.png")).unwrap().into_rgb8()
}

/// Mean place of what is not background, from the middle to the right and upwards in pixels; `None` where nothing is.
fn middle(picture: &image::RgbImage) -> Option<[f64; 2]> {
    let background = *picture.get_pixel(0, 0);
    let drawn = picture.enumerate_pixels().filter(|(.., pixel)| **pixel != background);
    let (n, x, y) =
        drawn.fold((0.0, 0.0, 0.0), |(n, x, y), (px, py, _)| (n + 1.0, x + f64::from(px), y + f64::from(py)));
    (n > 0.0).then(|| [x / n - 31.5, 31.5 - y / n])
}

#[test]
fn pictures_do_not_depend_on_the_stored_order_bit_for_bit() {
    let folder = folder();
    let places = [DVec3::new(6.0, 2.0, 4.0), DVec3::new(-5.0, -3.0, 1.0), DVec3::new(-5.0, 4.0, -4.0)];
    let clip = "--clip box --clip-scale 3,4,5 --clip-translate 6,0,3 --clip-rotate 10,20,30";
    let order = |i: usize| orders()[i];
    for rotation in [DQuat::IDENTITY, oblique()] {
        let scan = balls(rotation, &places);
        let mut first = None;
        let mut check = |name: &str, file: Vec<u8>| {
            folder.put(name, file);
            let picture = draw(&folder, name, clip);
            assert!(middle(&picture).is_some(), "there is something to see");
            assert!(*first.get_or_insert_with(|| picture.clone()) == picture, "{name}: another picture");
        };
        // RAS, LAS, and orders with every axis first.
        check("a.nrrd", scan.nrrd("RAS"));
        for i in [1, 18, 31, 44] {
            check("b.nrrd", scan.in_order(order(i)).nrrd("LPS"));
        }
    }
    // Straight axes are the same numbers in every format.
    let scan = balls(DQuat::IDENTITY, &places);
    folder.put("a.nrrd", scan.nrrd("RAS"));
    folder.put("a.mha", scan.in_order(order(13)).metaimage());
    folder.put("a.nii", scan.in_order(order(22)).nifti());
    folder.put("q.nii", scan.in_order(order(43)).nifti_by_qform());
    let pictures = ["a.nrrd", "a.mha", "a.nii", "q.nii"].map(|name| draw(&folder, name, clip));
    assert!(pictures.iter().all(|picture| *picture == pictures[0]));
}

#[test]
fn right_is_right_from_behind_and_the_head_is_up_however_oblique_the_grid() {
    let folder = folder();
    // The place of one ball, and where it is seen from behind, from the face, and from the right.
    for (place, seen) in [
        (DVec3::new(6.0, 0.0, 0.0), [[1.0, 0.0], [-1.0, 0.0], [0.0, 0.0]]),
        (DVec3::new(0.0, 6.0, 0.0), [[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]]),
        (DVec3::new(0.0, 0.0, 6.0), [[0.0, 1.0], [0.0, 1.0], [0.0, 1.0]]),
    ] {
        for rotation in [DQuat::IDENTITY, oblique()] {
            // LAS, a mirror image in its index axes.
            folder.put("a.nrrd", balls(rotation, &[place]).in_order(LAS).nrrd("RAS"));
            for (azimuth, seen) in [0, 180, 90].into_iter().zip(seen) {
                let flags = format!("--fit box --azimuth {azimuth} --elevation 0 --distance 60");
                let found = middle(&draw(&folder, "a.nrrd", &flags)).unwrap();
                // 60 mm away from the box's centre, 64 pixels are 38 mm at the centre.
                for axis in 0..2 {
                    let expected = seen[axis] * 6.0 * 64.0 / 38.0;
                    let off = (found[axis] - expected).abs();
                    assert!(off < 1.5, "{place} at azimuth {azimuth}: {found:?}, expected {seen:?}");
                }
            }
        }
    }
}

/// Eyes that frame what is visible find it on the patient's axes too: one ball, wherever it is, is in the middle and fills the picture.
#[test]
fn what_is_visible_is_framed_however_oblique_the_grid() {
    let folder = folder();
    for place in [DVec3::new(6.0, 3.0, -4.0), DVec3::new(-5.0, -2.0, 6.0)] {
        for rotation in [DQuat::IDENTITY, oblique()] {
            folder.put("a.nrrd", balls(rotation, &[place]).in_order(LAS).nrrd("RAS"));
            let picture = draw(&folder, "a.nrrd", "--azimuth 120 --elevation 35");
            let [x, y] = middle(&picture).unwrap();
            // Of 64 pixels; the ball is 7 voxels across, of which a row on each side fades out.
            assert!(x.abs() < 3.0 && y.abs() < 3.0, "{place}: {x}, {y}");
            let seen = |x, y| picture.get_pixel(x, y).0[1] > picture.get_pixel(0, 0).0[1] + 50;
            let columns = (0..64).filter(|x| (0..64).any(|y| seen(*x, y))).count();
            assert!((45..=60).contains(&columns), "{place}: {columns} columns");
        }
    }
}

/// The first axis backwards.
const LAS: Order = ([0, 1, 2], [true, false, false]);

#[test]
fn clips_light_and_eyes_of_flags_and_scenes_are_on_the_axes_of_the_patient() {
    let folder = folder();
    let mut lit: Option<image::RgbImage> = None;
    let (right, left) = (DVec3::new(7.0, 0.0, 0.0), DVec3::new(-7.0, 0.0, 0.0));
    for rotation in [DQuat::IDENTITY, oblique()] {
        folder.put("a.nii", balls(rotation, &[right, left]).in_order(LAS).nifti());
        let from_behind = "--fit box --azimuth 0 --elevation 0 --distance 60";
        // A plane removes the side that it faces: turned by 90 degrees about y, the right.
        let clip = "--clip plane --clip-rotate 0,90,0";
        let [x, _] = middle(&draw(&folder, "a.nii", &format!("{from_behind} {clip}"))).unwrap();
        assert!(x < -8.0, "the left ball is left, at {x}");

        let scene = "volume = \"a.nii\"\n[[clip]]\nshape = \"sphere\"\nscale = 5\ntranslate_mm = [-7, 0, 0]\n\
                     [stereo]\nposition_mm = [0, -60, 0]\n";
        folder.put("scene.toml", scene);
        let [x, _] = middle(&draw(&folder, "scene.toml", "")).unwrap();
        assert!(x > 8.0, "the right ball is left over, at {x}");

        // The picture of a ball is that of its light, which comes from a side that no axis of the oblique grid has.
        folder.put("one.nii", balls(rotation, &[DVec3::ZERO]).in_order(LAS).nifti());
        let eyes = "[stereo]\nposition_mm = [0, -25, 0]\n";
        let light = "[shading]\nlight = [1, 0, 0]\nlight_from = \"world\"\nambient = 0.1\n";
        folder.put("lit.toml", format!("volume = \"one.nii\"\n{eyes}{light}"));
        let picture = draw(&folder, "lit.toml", "");
        let straight = lit.get_or_insert_with(|| picture.clone());
        // Within the rim, where voxels show.
        let inner = (24..40).flat_map(|y| (24..40).map(move |x| (x, y)));
        let red = |of: &image::RgbImage, (x, y)| f64::from(of.get_pixel(x, y).0[0]);
        let off = inner.map(|p| (red(&picture, p) - red(straight, p)).abs()).sum::<f64>() / 256.0;
        // 9 levels are of other voxels; light that stays on the grid's axes makes 32.
        assert!(off < 16.0, "{off} levels");
    }
}

#[test]
fn the_index_frame_draws_the_file_as_it_is_stored() {
    let folder = folder();
    let scan = balls(oblique(), &[DVec3::new(6.0, 2.0, 4.0)]).in_order(([2, 0, 1], [false, true, true]));
    let bytes: Vec<u8> = scan.values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let three = |v: [String; 3]| v.join(" ");
    let (sizes, spacings) =
        (three(scan.dims.map(|d| d.to_string())), three(scan.spacing.map(|s| s.to_string())));
    folder.put("bare.nrrd", nrrd("int16", &sizes, &spacings, &bytes)).put("a.nrrd", scan.nrrd("RAS"));
    let clip = "--clip sphere --clip-scale 3 --clip-translate 4,5,6";
    let bare = draw(&folder, "bare.nrrd", clip);
    assert!(draw(&folder, "a.nrrd", &format!("--frame index {clip}")) == bare);
    assert!(draw(&folder, "a.nrrd", clip) != bare, "the patient's axes are others");
    // Of a file that states no frame, and of scenes.
    assert!(draw(&folder, "bare.nrrd", &format!("--frame index {clip}")) == bare);
    folder.put("scene.toml", "volume = \"a.nrrd\"\nframe = \"index\"\n");
    assert!(draw(&folder, "scene.toml", clip) == bare);
    assert!(draw(&folder, "scene.toml", &format!("--frame patient {clip}")) == draw(&folder, "a.nrrd", clip));
    let refused = folder.run("render a.nrrd --frame world -o p.png");
    assert!(refused.code == Some(2) && refused.err.contains("patient or index"), "{}", refused.err);
}

#[test]
fn an_occlusion_file_lies_on_its_input_in_stored_order() {
    let folder = folder();
    let place = DVec3::new(6.0, 2.0, 4.0);
    let scan = balls(oblique(), &[place, -place]).in_order(([1, 2, 0], [true, false, true]));
    folder.put("a.nrrd", scan.nrrd("RAS"));
    // The clip takes one of the two balls away, on the patient's axes.
    let clip = "--clip sphere --clip-scale 5 --clip-translate 6,2,4";
    let answer = folder.json(&format!(
        "occlusion a.nrrd --transfer t.toml --radius-mm 3 -o ao.nrrd --opacity-out vo.nrrd {clip}"
    ));
    assert_eq!(answer["dims"], json!(scan.dims), "as the file says");
    let written = std::fs::read(folder.path("vo.nrrd")).unwrap();
    let end = written.windows(2).position(|w| w == b"\n\n").unwrap() + 2;
    let [header, input] =
        [&written[..end], &scan.nrrd("RAS")].map(|b| String::from_utf8_lossy(b).into_owned());
    for field in ["sizes", "space origin"] {
        let line = |text: &str| text.lines().find(|l| l.starts_with(field)).map(String::from);
        let wide = |text: &str| line(text).map(|l| l.replace("right-anterior-superior", "RAS"));
        assert_eq!(wide(&header), wide(&input), "{field}");
    }
    let opacities: Vec<f32> =
        written[end..].as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    let mut opaque = 0;
    for ((voxel, value), opacity) in scan.voxels().zip(&scan.values).zip(&opacities) {
        let left_over = (DVec3::from(scan.position(voxel)) - CENTRE).distance(place) > 5.0;
        let expected = if left_over { f32::from(*value) / 100.0 * 0.9 } else { 0.0 };
        assert!((opacity - expected).abs() < 0.01, "{voxel:?}: {opacity}, expected {expected}");
        opaque += u32::from(*opacity > 0.8);
    }
    assert!(opaque > 50, "one ball is left over");
}

#[test]
fn info_says_how_a_file_is_stored_and_how_it_is_drawn() {
    let folder = folder();
    let scan = balls(DQuat::from_rotation_z(0.2), &[]).in_order(([0, 2, 1], [true, false, false]));
    folder.put("a.mha", scan.metaimage()).put("bare.nrrd", nrrd("uchar", "1 1 1", "1 1 1", &[0]));
    let text = folder.ok("info a.mha");
    for part in
        ["26 x 18 x 22 voxels", "LSA as stored, right-handed; drawn as RAS", "oblique by 11.46 degrees"]
    {
        assert!(text.contains(part), "{part} is not in\n{text}");
    }
    let answer = folder.json("info a.mha");
    assert_eq!((&answer["stored_order"], &answer["drawn_order"]), (&json!("LSA"), &json!("RAS")));
    assert_eq!((&answer["dims"], &answer["left_handed"]), (&json!([26, 18, 22]), &json!(false)));
    let centre = [0, 1, 2].map(|i| answer["centre_mm"][i].as_f64().unwrap());
    assert!(DVec3::from(centre).distance(CENTRE) < 1e-9, "{centre:?}");

    folder.put("las.mha", balls(DQuat::IDENTITY, &[]).in_order(LAS).metaimage());
    assert_eq!(folder.json("info las.mha")["left_handed"], json!(true));
    let bare = folder.json("info bare.nrrd");
    assert_eq!((&bare["stored_order"], &bare["drawn_order"]), (&json!(null), &json!(null)));
    assert!(folder.ok("info bare.nrrd").contains("no patient frame is stated"));
}
