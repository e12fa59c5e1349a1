//! A folder with several DICOM series: the program lists them, and reads the one that is chosen.

use crate::support::Folder;

/// A slice of 2 × 2 values at z mm, explicit little endian.
fn slice(series: &str, z: u8) -> Vec<u8> {
    let mut out = [&[0; 128][..], b"DICM"].concat();
    let mut put = |tag: [u8; 4], kind: &[u8; 2], value: &[u8]| {
        let padded = [value, &[b' '][..value.len() % 2]].concat();
        out.extend([&tag[..], kind].concat());
        match kind {
            b"OW" => out.extend([&[0, 0][..], &(padded.len() as u32).to_le_bytes()].concat()),
            _ => out.extend((padded.len() as u16).to_le_bytes()),
        }
        out.extend(padded);
    };
    put([2, 0, 0x10, 0], b"UI", b"1.2.840.10008.1.2.1");
    put([8, 0, 0x60, 0], b"CS", b"CT");
    put([0x20, 0, 0x0e, 0], b"UI", series.as_bytes());
    put([0x20, 0, 0x32, 0], b"DS", format!("0\\0\\{z}").as_bytes());
    put([0x20, 0, 0x37, 0], b"DS", b"1\\0\\0\\0\\1\\0");
    put([0x28, 0, 0x10, 0], b"US", &[2, 0]);
    put([0x28, 0, 0x11, 0], b"US", &[2, 0]);
    put([0x28, 0, 0x30, 0], b"DS", b"0.5\\0.5");
    put([0x28, 0, 0, 1], b"US", &[16, 0]);
    put([0xe0, 0x7f, 0x10, 0], b"OW", &[z, 0, z, 1, z, 2, z, 3]);
    out
}

#[test]
fn several_series_are_listed_and_one_is_chosen() {
    let folder = Folder::without_device();
    std::fs::create_dir(folder.path("scan")).unwrap();
    for z in [0, 2, 4] {
        folder.put(&format!("scan/a{z}"), slice("1.2.1", z));
        folder.put(&format!("scan/b{z}"), slice("1.2.2", z + 100));
    }
    let run = folder.run("info scan");
    assert_eq!((run.code, run.out.as_str()), (Some(1), ""), "{}", run.err);
    let listed = ["2 in this folder", "--series", "1: CT", "3 images of 2 × 2, 1.2.1", "2: CT", "1.2.2"];
    assert!(listed.iter().all(|part| run.err.contains(part)), "{}", run.err);
    for (which, smallest) in [("1", 0), ("2", 100), ("1.2.2", 100)] {
        let found = folder.json(&format!("info scan --series {which}"));
        assert_eq!(found["dims"], serde_json::json!([2, 2, 3]));
        assert_eq!(found["spacing_mm"], serde_json::json!([0.5, 0.5, 2.0]));
        assert_eq!(found["smallest"], serde_json::json!(f64::from(smallest)));
    }
    // Any file of a series.
    assert_eq!(folder.json("info scan/b2")["smallest"], 100.0);
}
