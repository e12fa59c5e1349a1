//! The 48 orders in which the voxels of one patient can be stored: read, all are the same volume; written, each is itself
//! again.

use cao_formats::{read, write_nrrd};
use cao_model::frame::{Frame, Turn};
use cao_model::values::Values;
use cao_model::volume::{IDENTITY, Space, Volume};
use cao_testing::scan::{Scan, orders};
use glam::{DMat3, DQuat, DVec3};
use std::path::Path;

/// Positions are of f32 in NIfTI, and go there and back.
const POSITION_MM: f64 = 1e-5;

/// A scan whose values all differ, with its axes turned by `rotation`.
fn scan(rotation: DQuat) -> Scan {
    let directions = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| (rotation * axis).to_array());
    let values = (0..5 * 4 * 3).map(|i| i * 7 - 100).collect();
    Scan { dims: [5, 4, 3], spacing: [0.5, 1.0, 2.0], directions, origin: [-30.5, 12.25, 7.0], values }
}

/// Straight, oblique, and halfway between two axes, where nothing but a rule says which of them is which.
fn rotations() -> [(&'static str, DQuat); 5] {
    let axis = DVec3::new(1.0, 1.0, 1.0).normalize();
    [
        ("straight", DQuat::IDENTITY),
        ("oblique", DQuat::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), 0.4)),
        ("45 degrees about z", DQuat::from_rotation_z(45_f64.to_radians())),
        ("45 degrees about x, then y", {
            DQuat::from_rotation_y(45_f64.to_radians()) * DQuat::from_rotation_x(45_f64.to_radians())
        }),
        ("60 degrees about the diagonal", DQuat::from_axis_angle(axis, 60_f64.to_radians())),
    ]
}

/// A file format: its name for a file, and the scan as such a file.
type Format = (&'static str, fn(&Scan) -> Vec<u8>);

const FORMATS: [Format; 5] = [
    ("ras.nrrd", |scan| scan.nrrd("RAS")),
    ("las.nrrd", |scan| scan.nrrd("LAS")),
    ("lps.nrrd", |scan| scan.nrrd("LPS")),
    ("a.mha", Scan::metaimage),
    ("a.nii", Scan::nifti),
];

fn read_as(folder: &Path, name: &str, bytes: &[u8]) -> Volume {
    std::fs::write(folder.join(name), bytes).unwrap();
    read(&folder.join(name)).unwrap()
}

fn place(volume: &Volume) -> Scan {
    let Volume { dims, spacing, directions, origin, .. } = *volume;
    let Values::I16(values) = &volume.values else { panic!("{}", volume.values.kind()) };
    Scan { dims, spacing, directions, origin, values: values.clone() }
}

#[test]
fn all_48_orders_are_read_as_the_same_volume_at_the_same_places_of_the_patient() {
    let folder = tempfile::tempdir().unwrap();
    for (turned, rotation) in rotations() {
        let truth = scan(rotation);
        for (name, file) in FORMATS {
            let mut first: Option<Volume> = None;
            for order in orders() {
                let volume = read_as(folder.path(), name, &file(&truth.in_order(order)));
                let what = format!("{turned}, {name}, {order:?}");
                assert_eq!(volume.space, Space::Ras, "{what}");
                assert!(DMat3::from_cols_array_2d(&volume.directions).determinant() > 0.99, "{what}");

                // All that a picture depends on is the same bit for bit.
                let first = first.get_or_insert_with(|| volume.clone());
                assert_eq!(
                    (&volume.values, volume.dims, volume.spacing, volume.directions),
                    (&first.values, first.dims, first.spacing, first.directions),
                    "{what}"
                );
                let distance = DVec3::from(volume.origin).distance(first.origin.into());
                assert!(distance < POSITION_MM, "{what}: {distance} mm");

                // Each value where the truth has it; there all values differ.
                let found = place(&volume);
                for (voxel, value) in found.voxels().zip(&found.values) {
                    let i = truth.values.iter().position(|v| v == value).unwrap();
                    let expected = DVec3::from(truth.position(truth.voxels().nth(i).unwrap()));
                    let distance = expected.distance(found.position(voxel).into());
                    assert!(distance < POSITION_MM, "{what}: {value} is off by {distance} mm");
                }
            }
        }
    }
}

#[test]
fn axes_run_along_those_of_the_patient_that_they_are_nearest_to() {
    let folder = tempfile::tempdir().unwrap();
    for (turned, rotation) in rotations() {
        let volume = read_as(folder.path(), "a.nrrd", &scan(rotation).nrrd("RAS"));
        let sum = |axes: [usize; 3]| (0..3).map(|a| volume.directions[axes[a]][a].abs()).sum::<f64>();
        let found = (0..3).map(|a| volume.directions[a][a]).sum::<f64>();
        for (axes, _) in orders() {
            assert!(found > sum(axes) - 1e-9, "{turned}: {axes:?} is nearer");
        }
    }
    // Of axes at 45° the one comes first whose right end is the more anterior: a turn of 45° about +z, not of -45°.
    let z = DQuat::from_rotation_z(45_f64.to_radians());
    let volume = read_as(folder.path(), "a.nrrd", &scan(z).nrrd("RAS"));
    assert!(volume.directions[0][1] > 0.7 && volume.directions[1][0] < -0.7, "{:?}", volume.directions);
}

#[test]
fn a_qform_is_read_in_every_order_and_leaves_no_rotation_where_axes_are_straight() {
    let folder = tempfile::tempdir().unwrap();
    for (turned, rotation) in rotations() {
        let truth = scan(rotation);
        // Quaternions of f32 are rounded differently in every order, which must not choose between axes at 45°.
        let first = read_as(folder.path(), "a.nrrd", &truth.nrrd("RAS"));
        for order in orders() {
            let volume = read_as(folder.path(), "a.nii", &truth.in_order(order).nifti_by_qform());
            let what = format!("{turned}, {order:?}");
            assert_eq!((&volume.values, volume.dims), (&first.values, first.dims), "{what}");
            assert_eq!(volume.spacing, truth_spacing(&first), "{what}");
            assert!(DVec3::from(volume.origin).distance(first.origin.into()) < POSITION_MM, "{what}");
            let straight = Turn::into_axes_of(&volume) == Turn::NONE;
            assert_eq!(straight, turned == "straight", "{what}: {:?}", volume.directions);
        }
    }
}

/// Spacings without what the lengths of oblique vectors add to them.
fn truth_spacing(volume: &Volume) -> [f64; 3] {
    volume.spacing.map(|s| f64::from(s as f32))
}

#[test]
fn volumes_and_written_files_get_the_stored_order_back() {
    let folder = tempfile::tempdir().unwrap();
    let ambient = folder.path().join("ao.nrrd");
    for (turned, rotation) in rotations() {
        for order in orders() {
            let stored = scan(rotation).in_order(order);
            let volume = read_as(folder.path(), "a.nrrd", &stored.nrrd("RAS"));
            let what = format!("{turned}, {order:?}");
            let same = |found: &Scan| {
                assert_eq!((found.dims, &found.values), (stored.dims, &stored.values), "{what}");
                assert_eq!(found.origin, stored.origin, "{what}");
                let near = |a: [f64; 3], b: [f64; 3]| DVec3::from(a).distance(b.into()) < 1e-12;
                assert!(near(found.spacing, stored.spacing), "{what}: {:?}", found.spacing);
                assert!((0..3).all(|a| near(found.directions[a], stored.directions[a])), "{what}");
            };
            same(&place(&volume.clone().into_stored().unwrap()));

            // What was computed of each voxel, here its own value, lies on the file that it was computed of.
            let values: Vec<f32> = (0..volume.len()).map(|i| volume.value(i) as f32).collect();
            write_nrrd(&ambient, &volume, &values, "").unwrap();
            let written = std::fs::read(&ambient).unwrap();
            let data = written[written.len() - 4 * stored.values.len()..].as_chunks::<4>().0;
            let back = read(&ambient).unwrap().into_stored().unwrap();
            let values = data.iter().map(|b| f32::from_le_bytes(*b) as i16).collect();
            same(&place(&Volume { values: Values::I16(values), ..back }));
        }
    }
}

#[test]
fn the_stored_axes_have_names_and_the_index_frame_keeps_them() {
    let folder = tempfile::tempdir().unwrap();
    let truth = scan(DQuat::from_rotation_z(0.2));
    for (order, name) in [
        (([0, 1, 2], [false, false, false]), "RAS"),
        (([0, 1, 2], [true, false, false]), "LAS"),
        (([0, 2, 1], [false, true, false]), "RIA"),
        (([2, 0, 1], [false, true, true]), "SLP"),
    ] {
        let stored = truth.in_order(order);
        let volume = read_as(folder.path(), "a.nrrd", &stored.nrrd("LPS"));
        assert_eq!(volume.stored_axes().as_deref(), Some(name));

        let (patient, turn) = Frame::Patient.arrange(volume.clone()).unwrap();
        assert_eq!(patient, volume);
        assert!((turn.degrees() - 0.2_f64.to_degrees()).abs() < 1e-9, "{name}: {}", turn.degrees());
        let (index, turn) = Frame::Index.arrange(volume).unwrap();
        assert_eq!((&place(&index).values, index.dims, turn), (&stored.values, stored.dims, Turn::NONE));
        assert_eq!(index.stored_axes().as_deref(), Some(name));
        assert_eq!(Frame::Patient.arrange(index).unwrap().0, patient, "{name}: there again");
    }
}

#[test]
fn where_no_frame_is_stated_voxels_stay_as_they_are_stored() {
    let values: Vec<u8> = (0..24).collect();
    let volume = Volume::new([2, 3, 4], [1.0; 3], Values::U8(values)).unwrap();
    let mirrored = [[-1.0, 0.0, 0.0], IDENTITY[1], IDENTITY[2]];
    let volume = Volume { directions: mirrored, origin: [1.0; 3], ..volume };
    for frame in [Frame::Patient, Frame::Index] {
        assert_eq!(frame.arrange(volume.clone()).unwrap(), (volume.clone(), Turn::NONE));
    }
    assert_eq!(volume.stored_axes(), None);
}
