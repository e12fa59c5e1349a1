//! Slices that are no DICOM, and what is none: TIFF pages and folders, ANALYZE pairs, formats of others.

use std::fs;
use std::path::{Path, PathBuf};

use cao_formats::Error;
use cao_model::values::Values;
use cao_model::volume::{Space, Volume};
use proptest::prelude::*;
use tempfile::TempDir;

const WIDTH: u32 = 6;
const HEIGHT: u32 = 5;

/// 5 × 6 values of a page.
fn page(z: u16) -> Vec<u16> {
    (0..30).map(|i| i * 997 + z).collect()
}

/// The first page as another program's LZW.
const LZW: &str = "8000000e501b280eaf05a501e79099782e430d8a03e0d11bc84cd7152f05ca1192186c6b1d1407c35210688cff24b909ac928ab8aa932c9e0ba5d30908ca2734830daf138404";

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn put(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, bytes).unwrap();
        path
    }
}

#[track_caller]
fn refused(found: cao_formats::Result<Volume>, field: &str, says: &[&str]) {
    let error = found.expect_err(&format!("should be refused for {field}"));
    let text = error.to_string();
    assert!(matches!(&error, Error::File { field: found, .. } if found == field), "{field}: {text}");
    for part in says {
        assert!(text.contains(part), "{text:?} should say {part:?}");
    }
}

// -------------------------------------------------------------------------------------------------------------- TIFF

/// How a file is written.
#[derive(Clone, Copy, PartialEq, Default)]
struct Form {
    big_endian: bool,
    /// Offsets of 64 bits.
    big: bool,
    deflated: bool,
}

/// Tags of a page beyond its size: number, values (as LONG; two for a fraction), or text.
#[derive(Clone)]
enum Field {
    Short(u16, u16),
    Ratio(u16, u32, u32),
    Text(u16, String),
}

/// A TIFF of these pages, one strip each; the first has more fields.
fn tiff(form: Form, pages: &[Vec<u8>], bits: u16, format: u16, more: &[Field]) -> Vec<u8> {
    let n16 = |v: u16| if form.big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
    let n32 = |v: u32| if form.big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
    let n64 = |v: u64| if form.big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
    let offset = |v: usize| if form.big { n64(v as u64).to_vec() } else { n32(v as u32).to_vec() };
    let mut out = if form.big_endian { b"MM".to_vec() } else { b"II".to_vec() };
    out.extend(n16(if form.big { 43 } else { 42 }));
    if form.big {
        out.extend([n16(8), n16(0)].concat());
    }
    let mut link = out.len();
    out.extend(offset(0));
    for (i, data) in pages.iter().enumerate() {
        let data = if form.deflated { zlib(data) } else { data.clone() };
        let start = out.len();
        out.extend(&data);
        let mut entries: Vec<(u16, u16, usize, Vec<u8>)> = vec![
            (256, 4, 1, n32(WIDTH).to_vec()),
            (257, 4, 1, n32(HEIGHT).to_vec()),
            (258, 3, 1, n16(bits).to_vec()),
            (259, 3, 1, n16(if form.deflated { 8 } else { 1 }).to_vec()),
            (262, 3, 1, n16(1).to_vec()),
            (273, 4, 1, n32(start as u32).to_vec()),
            (277, 3, 1, n16(1).to_vec()),
            (278, 4, 1, n32(HEIGHT).to_vec()),
            (279, 4, 1, n32(data.len() as u32).to_vec()),
            (339, 3, 1, n16(format).to_vec()),
        ];
        for field in more.iter().filter(|_| i == 0) {
            let entry = match field {
                Field::Short(tag, v) => (*tag, 3, 1, n16(*v).to_vec()),
                Field::Ratio(tag, a, b) => (*tag, 5, 1, [n32(*a), n32(*b)].concat()),
                Field::Text(tag, text) => (*tag, 2, text.len() + 1, [text.as_bytes(), b"\0"].concat()),
            };
            entries.retain(|e| e.0 != entry.0);
            entries.push(entry);
        }
        entries.sort_by_key(|e| e.0);
        let inline = if form.big { 8 } else { 4 };
        for entry in &mut entries {
            if entry.3.len() > inline {
                let at = out.len();
                out.extend(&entry.3);
                entry.3 = offset(at);
            }
            entry.3.resize(inline, 0);
        }
        let at = out.len();
        let to = offset(at);
        out[link..link + to.len()].copy_from_slice(&to);
        out.extend(if form.big {
            n64(entries.len() as u64).to_vec()
        } else {
            n16(entries.len() as u16).to_vec()
        });
        for (tag, kind, count, value) in entries {
            out.extend([&n16(tag)[..], &n16(kind), &offset(count), &value].concat());
        }
        link = out.len();
        out.extend(offset(0));
    }
    out
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    use std::io::Write;
    let mut out = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    out.write_all(bytes).unwrap();
    out.finish().unwrap()
}

fn words(z: u16, big_endian: bool) -> Vec<u8> {
    page(z).iter().flat_map(|v| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() }).collect()
}

fn pages(count: u16, big_endian: bool) -> Vec<Vec<u8>> {
    (0..count).map(|z| words(z, big_endian)).collect()
}

#[test]
fn pages_of_a_tiff_are_slices_in_every_form_of_the_format() {
    let folder = Folder::new();
    for big_endian in [false, true] {
        for big in [false, true] {
            for deflated in [false, true] {
                let form = Form { big_endian, big, deflated };
                let path = folder.put("a.tif", &tiff(form, &pages(3, big_endian), 16, 1, &[]));
                let volume = cao_formats::read(&path).unwrap();
                assert_eq!(volume.dims, [6, 5, 3]);
                assert_eq!(volume.values, Values::U16([page(0), page(1), page(2)].concat()));
                assert_eq!((volume.spacing, volume.space), ([1.0; 3], Space::Unknown));
            }
        }
    }
    let form = Form::default();
    let read = |bits, format, bytes: Vec<u8>| {
        cao_formats::read(&folder.put("a", &tiff(form, &[bytes], bits, format, &[]))).unwrap().values
    };
    let n = 0..30u8;
    assert_eq!(read(8, 1, n.clone().collect()), Values::U8(n.clone().collect()));
    assert_eq!(
        read(8, 2, n.clone().map(|v| 255 - v).collect()),
        Values::I8(n.clone().map(|v| -1 - v as i8).collect())
    );
    let bytes = |f: &dyn Fn(u8) -> Vec<u8>| n.clone().flat_map(f).collect::<Vec<u8>>();
    let i16s = bytes(&|v| (-300 * i16::from(v)).to_le_bytes().to_vec());
    assert_eq!(read(16, 2, i16s), Values::I16(n.clone().map(|v| -300 * i16::from(v)).collect()));
    let f32s = bytes(&|v| (f32::from(v) / 3.0).to_le_bytes().to_vec());
    assert_eq!(read(32, 3, f32s), Values::F32(n.clone().map(|v| f32::from(v) / 3.0).collect()));
    let f64s = bytes(&|v| (f64::from(v) / 3.0).to_le_bytes().to_vec());
    assert_eq!(read(64, 3, f64s), Values::F64(n.clone().map(|v| f64::from(v) / 3.0).collect()));
    let u32s = bytes(&|v| (u32::from(v) << 24).to_le_bytes().to_vec());
    assert_eq!(read(32, 1, u32s), Values::U32(n.clone().map(|v| u32::from(v) << 24).collect()));
    let lzw: Vec<u8> =
        (0..LZW.len()).step_by(2).map(|i| u8::from_str_radix(&LZW[i..i + 2], 16).unwrap()).collect();
    let bytes = tiff(form, &[lzw], 16, 1, &[Field::Short(259, 5)]);
    assert_eq!(cao_formats::read(&folder.put("a", &bytes)).unwrap().values, Values::U16(page(0)));
    // 1.5 in half precision.
    assert_eq!(read(16, 3, [0x00, 0x3e].repeat(30)), Values::F32(vec![1.5; 30]));
}

#[test]
fn a_tiff_says_its_spacing_in_four_ways() {
    let folder = Folder::new();
    let (x, y) = (Field::Ratio(282, 4, 1), Field::Ratio(283, 2, 1));
    let described = |text: &str| Field::Text(270, text.into());
    let unit = |n| Field::Short(296, n);
    let ome = "<OME><Pixels PhysicalSizeX=\"0.5\" PhysicalSizeY=\"0.25\" PhysicalSizeYUnit=\"mm\" PhysicalSizeZ=\"2\" SizeC=\"1\"/></OME>";
    for (more, expected) in [
        (vec![x.clone(), y.clone(), unit(3)], [2.5, 5.0, 2.5]),
        // An inch where no unit is said.
        (vec![x.clone(), y.clone()], [6.35, 12.7, 6.35]),
        (vec![x.clone(), y.clone(), unit(1)], [1.0; 3]),
        (
            vec![x.clone(), y.clone(), unit(1), described("ImageJ=1\nslices=2\nunit=\\u00B5m\nspacing=3\n")],
            [0.00025, 0.0005, 0.003],
        ),
        (
            vec![x.clone(), y.clone(), unit(1), described("ImageJ=1\nslices=2\nunit=mm\nspacing=3\n")],
            [0.25, 0.5, 3.0],
        ),
        (vec![described(ome)], [0.0005, 0.25, 0.002]),
        (vec![Field::Ratio(282, 0, 1), Field::Ratio(283, 1, 0), unit(3)], [1.0; 3]),
    ] {
        let path = folder.put("a.tif", &tiff(Form::default(), &pages(2, false), 16, 1, &more));
        let found = cao_formats::read(&path).unwrap().spacing;
        assert!((0..3).all(|a| (found[a] - expected[a]).abs() < 1e-9), "{found:?}, expected {expected:?}");
    }
}

#[test]
fn a_large_imagej_file_has_one_header_and_all_pages_behind_it() {
    let folder = Folder::new();
    for big_endian in [false, true] {
        let form = Form { big_endian, ..Form::default() };
        let more = [Field::Text(270, "ImageJ=1\nimages=3\nslices=3\n".into())];
        // The strip is the last that is written before the directory; here it is moved behind it.
        let mut bytes = tiff(form, &pages(1, big_endian), 16, 1, &more);
        let end = bytes.len() as u32;
        let (offsets, to) = match big_endian {
            true => ([0x01, 0x11], end.to_be_bytes()),
            false => ([0x11, 0x01], end.to_le_bytes()),
        };
        let entry = bytes.windows(2).rposition(|w| w == offsets).unwrap();
        bytes[entry + 8..entry + 12].copy_from_slice(&to);
        bytes.extend(pages(3, big_endian).concat());
        let volume = cao_formats::read(&folder.put("a.tif", &bytes)).unwrap();
        assert_eq!(volume.values, Values::U16([page(0), page(1), page(2)].concat()));
        bytes.pop();
        refused(cao_formats::read(&folder.put("a.tif", &bytes)), "data", &["179 bytes, expected 180"]);
    }
}

#[test]
fn a_folder_or_a_pattern_of_tiffs_is_sorted_as_people_number() {
    let folder = Folder::new();
    let one = |z: u16| tiff(Form::default(), &[words(z, false)], 16, 1, &[]);
    for z in 8..11 {
        folder.put(&format!("s/cut{z}.tif"), &one(z));
    }
    folder.put("s/notes.txt", b"how it was made");
    folder.put("s/deeper/other.tif", &one(3));
    let expected = Values::U16([page(8), page(9), page(10)].concat());
    let path = folder.0.path().join("s");
    assert_eq!(cao_formats::read(&path).unwrap().values, expected);
    assert_eq!(cao_formats::read(&path.join("cut?*.tif")).unwrap().values, expected);
    assert_eq!(cao_formats::read(&path.join("cut?.tif")).unwrap().dims[2], 2);
    refused(cao_formats::read(&path.join("*.png")), "format", &["0 files", "DICOM", "TIFF"]);
    folder.put("s/mask.tif", &tiff(Form::default(), &[vec![1; 30]], 8, 1, &[]));
    refused(cao_formats::read(&path), "page 1", &["6 × 5 uint8, expected 6 × 5 uint16", "cut8.tif"]);
}

#[test]
fn a_tiff_that_is_no_volume_is_refused_by_name() {
    let folder = Folder::new();
    let read = |more: &[Field]| {
        cao_formats::read(&folder.put("a.tif", &tiff(Form::default(), &pages(2, false), 16, 1, more)))
    };
    let described = |text: &str| vec![Field::Text(270, text.into())];
    refused(read(&[Field::Short(262, 2), Field::Short(277, 3)]), "page 1", &[]);
    refused(read(&[Field::Short(262, 0)]), "page 1", &["0 is white"]);
    refused(read(&[Field::Short(258, 12)]), "page 1", &[]);
    refused(read(&[Field::Short(259, 7)]), "page 1", &["compression"]);
    refused(read(&described("ImageJ=1\nchannels=2\n")), "ImageDescription", &["channels 2, expected 1"]);
    refused(read(&described("ImageJ=1\nframes=2\n")), "ImageDescription", &["frames 2"]);
    refused(
        read(&described("ImageJ=1\nslices=3\n")),
        "ImageDescription",
        &["3 slices, but there are 2 pages"],
    );
    refused(read(&described("<OME SizeT=\"5\"/>")), "ImageDescription", &["SizeT 5"]);
    refused(
        read(&described("<OME PhysicalSizeX=\"5\" PhysicalSizeXUnit=\"pixel\"/>")),
        "ImageDescription",
        &["unit"],
    );
    let whole = tiff(Form::default(), &pages(2, false), 16, 1, &[]);
    refused(cao_formats::read(&folder.put("a.tif", &whole[..30])), "page 1", &[]);
    // A description longer than any file.
    let mut bytes = tiff(Form::default(), &pages(1, false), 16, 1, &described("ImageJ=1\n"));
    let at = bytes.windows(4).rposition(|w| w == [14, 1, 2, 0]).unwrap();
    bytes[at + 4..at + 8].copy_from_slice(&[0xff; 4]);
    assert_eq!(cao_formats::read(&folder.put("a.tif", &bytes)).unwrap().dims[2], 1);
    // A million pages that are not there, and sizes that no file holds.
    let millions = [Field::Text(270, "ImageJ=1\nimages=100000000\n".into())];
    let one = tiff(Form::default(), &pages(1, false), 16, 1, &millions);
    refused(
        cao_formats::read(&folder.put("a.tif", &one)),
        "pages",
        &["6000000000 bytes of values", "cannot hold"],
    );
    for deflated in [false, true] {
        let mut bytes = tiff(Form { deflated, ..Form::default() }, &pages(1, false), 16, 1, &[]);
        let at = bytes.windows(4).rposition(|w| w == [0, 1, 4, 0]).unwrap();
        bytes[at + 8..at + 12].copy_from_slice(&[0, 0, 0, 0x7f]);
        let text = cao_formats::read(&folder.put("a.tif", &bytes)).unwrap_err().to_string();
        assert!(text.contains("page"), "{text}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_mutation_of_a_tiff_makes_it_panic(
        which in 0..8usize,
        changes in proptest::collection::vec((0.0..1.0f64, any::<u8>(), 1..4usize), 1..6),
        cut in proptest::option::of(0.0..1.0f64),
    ) {
        let form = Form { big_endian: which & 1 > 0, big: which & 2 > 0, deflated: which & 4 > 0 };
        let more = [Field::Ratio(282, 4, 1), Field::Text(270, "ImageJ=1\nslices=2\nspacing=3\n".into())];
        let mut bytes = tiff(form, &pages(2, form.big_endian), 16, 1, &more);
        for (at, value, count) in changes {
            let at = (bytes.len() as f64 * at) as usize;
            let end = (at + count).min(bytes.len());
            bytes[at..end].fill(value);
        }
        if let Some(share) = cut {
            bytes.truncate((bytes.len() as f64 * share) as usize);
        }
        let folder = Folder::new();
        let _ = cao_formats::read(&folder.put("a.tif", &bytes));
    }
}

// ----------------------------------------------------------------------------------------------------------- ANALYZE

/// A header of 6 × 5 × 1 values of int16.
fn analyze(
    big_endian: bool,
    change: impl Fn(&mut Vec<u8>, &dyn Fn(i16) -> [u8; 2], &dyn Fn(f32) -> [u8; 4]),
) -> Vec<u8> {
    let n16 = |v: i16| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
    let real = |v: f32| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
    let mut bytes = vec![0; 348];
    bytes[..4].copy_from_slice(&if big_endian { 348i32.to_be_bytes() } else { 348i32.to_le_bytes() });
    for (i, dim) in [4, 6, 5, 2, 1].into_iter().enumerate() {
        bytes[40 + 2 * i..][..2].copy_from_slice(&n16(dim));
    }
    bytes[70..72].copy_from_slice(&n16(4));
    for (i, mm) in [0.0, 0.5, 0.75, -3.0].into_iter().enumerate() {
        bytes[76 + 4 * i..][..4].copy_from_slice(&real(mm));
    }
    change(&mut bytes, &n16, &real);
    bytes
}

#[test]
fn an_analyze_pair_has_values_and_spacing_but_no_place() {
    let folder = Folder::new();
    let stored: Vec<i16> = (0..60).map(|i| i * 500 - 10_000).collect();
    for big_endian in [false, true] {
        let bytes: Vec<u8> =
            stored.iter().flat_map(|v| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() }).collect();
        let header = folder.put("a.hdr", &analyze(big_endian, |_, _, _| {}));
        let image = folder.put("a.img", &bytes);
        for path in [&header, &image] {
            let volume = cao_formats::read(path).unwrap();
            assert_eq!(volume.values, Values::I16(stored.clone()));
            assert_eq!((volume.dims, volume.spacing), ([6, 5, 2], [0.5, 0.75, 3.0]));
            assert_eq!(
                (volume.space, volume.origin, volume.slope, volume.intercept),
                (Space::Unknown, [0.0; 3], 1.0, 0.0)
            );
        }
        // SPM's slope, and where the values begin.
        folder.put("a.img", &[&[9; 16][..], &bytes].concat());
        folder.put(
            "a.hdr",
            &analyze(big_endian, |h, _, real| {
                for (at, value) in [(108, 16.0), (112, 0.5), (116, -3.0)] {
                    h[at..at + 4].copy_from_slice(&real(value));
                }
            }),
        );
        let volume = cao_formats::read(&header).unwrap();
        assert_eq!((volume.values, volume.slope, volume.intercept), (Values::I16(stored.clone()), 0.5, -3.0));
    }
    let refuse = |at: usize, value: i16, field: &str, says: &str| {
        let path =
            folder.put("a.hdr", &analyze(true, |h, n16, _| h[at..at + 2].copy_from_slice(&n16(value))));
        refused(cao_formats::read(&path), field, &[says]);
    };
    refuse(70, 128, "datatype", "128, expected 2, 4, 8");
    refuse(48, 3, "dim[4]", "no series");
    refuse(40, 2, "dim[0]", "2 dimensions");
    refuse(42, -6, "dim", "expected at least 1 voxel");
    refuse(80, 0, "pixdim", "positive");
}

// ------------------------------------------------------------------------------------------------- formats of others

#[test]
fn what_is_not_read_is_named_with_what_converts_it() {
    let folder = Folder::new();
    let at = |offset: usize, magic: &[u8]| [&vec![0; offset][..], magic].concat();
    for (name, bytes, says) in [
        (
            "a.vti",
            b"<?xml version=\"1.0\"?>\n<VTKFile>".to_vec(),
            "VTK XML image data, which is not read: ParaView",
        ),
        ("a.vtk", b"# vtk DataFile Version 3.0".to_vec(), "legacy VTK"),
        ("a", b"\x89HDF\r\n\x1a\n".to_vec(), "HDF5, which is not read: h5py"),
        ("a.mnc", b"\x89HDF\r\n\x1a\n".to_vec(), "MINC, which is not read: mnc2nii"),
        ("a.mgz", vec![0x1f, 0x8b, 8], "mri_convert"),
        ("a.nc", b"CDF\x02".to_vec(), "xarray"),
        ("a.nd2", b"\xda\xce\xbe\x0a".to_vec(), "Nikon ND2, which is not read: Fiji"),
        ("a.czi", b"ZISRAWFILE".to_vec(), "Zeiss CZI"),
        ("a.LIF", vec![1], "Leica LIF"),
        ("a.npy", b"\x93NUMPY".to_vec(), "tifffile.imwrite"),
        ("a", at(208, b"MAP "), "mrc2tif"),
        ("a.png", b"\x89PNG\r\n\x1a\n".to_vec(), "PNG"),
        ("scan.zip", b"PK\x03\x04".to_vec(), "unpack it first"),
        ("a", at(257, b"ustar"), "an archive"),
        ("a.dcm", vec![1, 2, 3], "not that of a DICOM file"),
        ("a.xyz", vec![1, 2, 3], "not recognised, expected NRRD"),
    ] {
        let path = folder.put(name, &bytes);
        refused(cao_formats::read(&path), "format", &[says]);
        fs::remove_file(path).unwrap();
    }
    let inside = |name: &str| folder.0.path().join(name);
    folder.put("z/.zarray", b"{}");
    refused(cao_formats::read(&inside("z")), "format", &["Zarr, which is not read"]);
    folder.put("pictures/1.png", b"\x89PNG\r\n\x1a\n");
    refused(
        cao_formats::read(&inside("pictures")),
        "format",
        &["1 files, none of them a slice", "found PNG"],
    );
    fs::create_dir(inside("empty")).unwrap();
    refused(
        cao_formats::read(&inside("empty")),
        "format",
        &["0 files", "DICOM images (8 folders deep) and TIFF files"],
    );
    assert!(
        cao_formats::read(Path::new("no/such*file")).unwrap_err().to_string().contains("cannot access no")
    );
}
