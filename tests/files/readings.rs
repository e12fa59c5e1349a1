//! What files leave open, and what is wrong with them without making them unreadable: series, values that are no numbers, bytes after
//! the data, names in capitals.

use crate::volume_files::{
    COUNT, DIMS, Folder, Nifti, assert_close, assert_refused, bytes_of, gzip, joined, meta_header,
    nrrd_header, nrrd_values, text_of, zlib,
};
use cao_formats::{NoNumbers, Opened, Reading, read_as};
use cao_model::transfer::{PRESETS, TransferFunction};
use cao_model::values::{Endian, FARTHEST, Values};
use cao_model::volume::{Space, Volume};
use std::path::Path;

fn frame(index: u64) -> Reading {
    Reading { frame_index: Some(index), ..Reading::default() }
}

fn opened(path: &Path) -> Opened {
    read_as(path, &Reading::default()).unwrap_or_else(|e| panic!("{e}"))
}

// ---------------------------------------------------------------------------------------------------------- series

const FRAMES: usize = 4;

/// Frame `f` has values 1000 f, 1000 f + 1, …
fn series(interleaved: bool) -> Values {
    let value = |f: usize, voxel: usize| (1000 * f + voxel) as i16;
    Values::I16(match interleaved {
        false => (0..FRAMES).flat_map(|f| (0..COUNT).map(move |voxel| value(f, voxel))).collect(),
        true => (0..COUNT).flat_map(|voxel| (0..FRAMES).map(move |f| value(f, voxel))).collect(),
    })
}

/// Every frame comes as it is, alone in memory; none is not enough, and beyond the last is too much.
#[track_caller]
fn assert_series(path: &Path, field: &str) {
    for f in 0..FRAMES {
        let found = read_as(path, &frame(f as u64)).unwrap_or_else(|e| panic!("frame {f}: {e}"));
        let expected: Vec<i16> = (0..COUNT).map(|voxel| (1000 * f + voxel) as i16).collect();
        assert_eq!(found.warnings, [""; 0], "{}", path.display());
        let volume = found.volume.into_stored().unwrap();
        assert_eq!(volume.values, Values::I16(expected), "{} frame {f}", path.display());
        assert_eq!((volume.dims, volume.spacing), (DIMS, [0.5, 1.0, 2.0]));
    }
    assert_refused(cao_formats::read(path), path, field, &["a series of 4 volumes", "--frame-index 0 … 3"]);
    assert_refused(read_as(path, &frame(4)), path, field, &["4 volumes, 0 … 3", "--frame-index 4"]);
}

const TRAILING: [(&str, Option<&str>); 3] =
    [("dimension", Some("4")), ("sizes", Some("5 3 2 4")), ("spacings", Some("0.5 1 2 nan"))];
const LEADING: [(&str, Option<&str>); 3] =
    [("dimension", Some("4")), ("sizes", Some("4 5 3 2")), ("spacings", Some("nan 0.5 1 2"))];

#[test]
fn nrrd_frames_come_one_by_one_from_every_encoding_first_axis_or_last() {
    let folder = Folder::new();
    for (axes, kinds, interleaved) in [
        (TRAILING, "domain domain domain list", false),
        (TRAILING, "space space space time", false),
        (TRAILING, "domain domain domain domain", false),
        (LEADING, "list domain domain domain", true),
        (LEADING, "time domain domain domain", true),
    ] {
        let data = bytes_of(&series(interleaved), Endian::Little);
        for (encoding, content) in [
            ("raw", data.clone()),
            ("gzip", gzip(&data)),
            ("gzip", zlib(&data)),
            ("ascii", text_of(&series(interleaved))),
        ] {
            let changes = [&axes[..], &[("kinds", Some(kinds)), ("encoding", Some(encoding))]].concat();
            let path = folder.put("a.nrrd", &joined(&(nrrd_header(&changes) + "\n"), &content));
            assert_series(&path, "sizes");
            folder.put("a.raw", &content);
            let detached = nrrd_header(&changes) + "data file: a.raw\n";
            assert_series(&folder.put("a.nhdr", detached.as_bytes()), "sizes");
        }
        // A file a piece: of slices, and of pieces that no frame begins with.
        for (pieces, dimension) in [(FRAMES, 3), (2, 4), (8, 2)] {
            if interleaved && dimension != 4 {
                continue;
            }
            for (i, piece) in data.chunks(data.len() / pieces).enumerate() {
                folder.put(&format!("p{i}.raw"), piece);
            }
            let names = format!("data file: p%d.raw 0 {} 1 {dimension}\n", pieces - 1);
            let changes = [&axes[..], &[("kinds", Some(kinds))]].concat();
            assert_series(&folder.put("a.nhdr", (nrrd_header(&changes) + &names).as_bytes()), "sizes");
        }
    }
    // Without kinds the last axis is that of the series; vectors are none.
    let data = bytes_of(&series(false), Endian::Little);
    assert_series(&folder.put("a.nrrd", &joined(&(nrrd_header(&TRAILING) + "\n"), &data)), "sizes");
    let vectors = [&LEADING[..], &[("kinds", Some("vector domain domain domain"))]].concat();
    let path = folder.put("a.nrrd", &joined(&(nrrd_header(&vectors) + "\n"), &data));
    assert_refused(read_as(&path, &frame(0)), &path, "kinds", &["axis 0", "vectors"]);
    let middle =
        [&LEADING[1..], &[("dimension", Some("4")), ("kinds", Some("domain list domain domain"))]].concat();
    let path = folder.put("a.nrrd", &joined(&(nrrd_header(&middle) + "\n"), &data));
    assert_refused(read_as(&path, &frame(0)), &path, "kinds", &["axis 1", "first or the last"]);
}

/// The header that ITK writes for an image of four dimensions.
fn itk_nrrd(sizes: &str, space: &str) -> String {
    format!(
        "NRRD0004\n# Complete NRRD file format specification at:\ntype: short\ndimension: 4\n{space}\nsizes: {sizes}\n\
         space directions: (0,0.5,0,0) (-1,0,0,0) (0,0,2,0) (0,0,0,1)\nkinds: domain domain domain domain\n\
         endian: little\nencoding: raw\nspace origin: (1,2,3,7)\n\n"
    )
}

#[test]
fn four_axes_as_itk_writes_them_are_a_volume_or_a_series() {
    let folder = Folder::new();
    let one = bytes_of(&nrrd_values(), Endian::Little);
    let four = bytes_of(&series(false), Endian::Little);
    for (space, known) in [
        ("space dimension: 4", false),
        ("space: left-posterior-superior-time", true),
        ("space: LPST", true),
        ("space: scanner-xyz-time", false),
    ] {
        let path = folder.put("a.nrrd", &joined(&itk_nrrd("5 3 2 1", space), &one));
        let volume = opened(&path).volume.into_stored().unwrap();
        assert_eq!((volume.dims, &volume.values, volume.spacing), (DIMS, &nrrd_values(), [0.5, 1.0, 2.0]));
        let turned = if known { (Space::Ras, -1.0) } else { (Space::Unknown, 1.0) };
        assert_eq!(volume.space, turned.0);
        assert_close(volume.origin, [turned.1, 2.0 * turned.1, 3.0]);
        assert_close(volume.directions[0], [0.0, turned.1, 0.0]);
        assert_series(&folder.put("a.nrrd", &joined(&itk_nrrd("5 3 2 4", space), &four)), "sizes");
    }
    let sheared = itk_nrrd("5 3 2 4", "space dimension: 4").replace("(0,0,2,0)", "(0,0,2,1)");
    let path = folder.put("a.nrrd", &joined(&sheared, &four));
    assert_refused(read_as(&path, &frame(0)), &path, "space directions", &["axis 2", "series"]);

    let meta = |sizes: &str, matrix: &str| {
        meta_header(&[
            ("NDims", "4"),
            ("DimSize", sizes),
            ("ElementSpacing", "0.5 1 2 1"),
            ("Offset", "1 2 3 7"),
            ("TransformMatrix", matrix),
            ("CenterOfRotation", "0 0 0 0"),
        ])
    };
    let matrix = "0 1 0 0 -1 0 0 0 0 0 1 0 0 0 0 1";
    let volume =
        opened(&folder.put("a.mha", &joined(&meta("5 3 2 1", matrix), &one))).volume.into_stored().unwrap();
    assert_eq!((volume.dims, volume.values, volume.spacing), (DIMS, nrrd_values(), [0.5, 1.0, 2.0]));
    assert_close(volume.origin, [-1.0, -2.0, 3.0]);
    assert_close(volume.directions[0], [0.0, -1.0, 0.0]);
    assert_close(volume.directions[1], [1.0, 0.0, 0.0]);
    assert_series(&folder.put("a.mha", &joined(&meta("5 3 2 4", matrix), &four)), "DimSize");
    let path = folder.put("a.mha", &joined(&meta("5 3 2 4", "1 0 0 0 0 1 0 0 0 0 1 1 0 0 0 1"), &four));
    assert_refused(read_as(&path, &frame(0)), &path, "TransformMatrix", &["series"]);
    let path = folder.put("a.mha", &joined(&meta("5 3 2 1", "1 0 0 0 1 0 0 0 1"), &one));
    assert_refused(cao_formats::read(&path), &path, "TransformMatrix", &["9 numbers, expected 16"]);
}

/// A series of single slices, which must not become a stack of its moments.
#[test]
fn a_series_of_slices_stays_one() {
    let folder = Folder::new();
    let data = bytes_of(&nrrd_values(), Endian::Little);
    let half = |second: bool| nrrd_part(if second { 15..30 } else { 0..15 });
    let itk = itk_nrrd("5 3 1 2", "space dimension: 4");
    let four = |kinds| {
        [
            ("dimension", Some("4")),
            ("sizes", Some("5 3 1 2")),
            ("spacings", Some("1 1 1 1")),
            ("kinds", kinds),
        ]
    };
    let mut nifti = Nifti::new(1, &nrrd_values(), Endian::Little);
    nifti.dim(&[4, 5, 3, 1, 2]);
    let meta = meta_header(&[("NDims", "4"), ("DimSize", "5 3 1 2"), ("ElementSpacing", "1 1 1 1")]);
    for (name, content) in [
        ("itk.nrrd", joined(&itk, &data)),
        ("a.nrrd", joined(&(nrrd_header(&four(Some("domain domain domain domain"))) + "\n"), &data)),
        ("b.nrrd", joined(&(nrrd_header(&four(Some("space space space time"))) + "\n"), &data)),
        ("a.nii", nifti.file()),
        ("a.mha", joined(&meta, &data)),
    ] {
        let path = folder.put(name, &content);
        for second in [false, true] {
            let volume = read_as(&path, &frame(second.into())).unwrap().volume;
            assert_eq!((volume.dims, volume.values), ([5, 3, 1], half(second)), "{name}");
        }
        assert!(
            cao_formats::read(&path).unwrap_err().to_string().contains("a series of 2 volumes"),
            "{name}"
        );
    }
    // Nothing says that the last axis is time: the one of one sample is the odd one.
    let path = folder.put("c.nrrd", &joined(&(nrrd_header(&four(None)) + "\n"), &data));
    assert_eq!(cao_formats::read(&path).unwrap().dims, [5, 3, 2]);
}

fn nrrd_part(range: std::ops::Range<usize>) -> Values {
    match nrrd_values() {
        Values::I16(values) => Values::I16(values[range].to_vec()),
        other => other,
    }
}

#[test]
fn metaimage_and_nifti_frames_come_one_by_one_whatever_the_encoding() {
    let folder = Folder::new();
    let data = bytes_of(&series(false), Endian::Little);
    let sizes = [("NDims", "4"), ("DimSize", "5 3 2 4"), ("ElementSpacing", "0.5 1 2 9")];
    for (encoding, content) in
        [("raw", data.clone()), ("zlib", zlib(&data)), ("ascii", text_of(&series(false)))]
    {
        let mut changes = sizes.to_vec();
        match encoding {
            "zlib" => changes.push(("CompressedData", "True")),
            "ascii" => changes.push(("BinaryData", "False")),
            _ => {}
        }
        assert_series(&folder.put("a.mha", &joined(&meta_header(&changes), &content)), "DimSize");
    }
    for (i, piece) in data.chunks(data.len() / FRAMES).enumerate() {
        folder.put(&format!("p{i}.raw"), piece);
    }
    let listed = [&sizes[..], &[("ElementDataFile", "LIST\np0.raw\np1.raw\np2.raw\np3.raw")]].concat();
    assert_series(&folder.put("a.mhd", meta_header(&listed).as_bytes()), "DimSize");
    let colours = [&sizes[..], &[("ElementNumberOfChannels", "3")]].concat();
    let path = folder.put("a.mha", &joined(&meta_header(&colours), &data));
    assert_refused(read_as(&path, &frame(0)), &path, "ElementNumberOfChannels", &["3, expected 1"]);

    for version in [1, 2] {
        for endian in [Endian::Little, Endian::Big] {
            let mut nifti = Nifti::new(version, &series(false), endian);
            nifti.dim(&[4, 5, 3, 2, 4]);
            assert_series(&folder.put("a.nii", &nifti.file()), "dim[4]");
            assert_series(&folder.put("a.nii.gz", &gzip(&nifti.file())), "dim[4]");
            nifti.dim(&[5, 5, 3, 2, 1, 4]);
            let path = folder.put("a.nii", &nifti.file());
            assert_refused(read_as(&path, &frame(0)), &path, "dim[5]", &["4, expected 1", "no vectors"]);
        }
    }
}

#[test]
fn what_is_one_volume_has_frame_0_and_no_other() {
    let folder = Folder::new();
    let data = bytes_of(&nrrd_values(), Endian::Little);
    for (name, content, field) in [
        ("a.nrrd", joined(&(nrrd_header(&[]) + "\n"), &data), "sizes"),
        ("a.mha", joined(&meta_header(&[]), &data), "DimSize"),
        ("a.nii", Nifti::new(1, &nrrd_values(), Endian::Little).file(), "dim[4]"),
    ] {
        let path = folder.put(name, &content);
        assert_eq!(read_as(&path, &frame(0)).unwrap().volume.values, nrrd_values());
        assert_refused(read_as(&path, &frame(1)), &path, field, &["one volume", "--frame-index 1"]);
    }
}

#[test]
fn a_frame_of_a_series_that_no_memory_holds_is_read() {
    let folder = Folder::new();
    // 2³⁸ bytes of holes, then the last frame.
    let frames = 1i64 << 32;
    let mut nifti = Nifti::new(2, &nrrd_values(), Endian::Little);
    nifti.dim(&[4, 5, 3, 2, frames]);
    let path = folder.put("a.nii", &nifti.header);
    let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
    let start = 544 + 60 * (frames as u64 - 1);
    std::os::unix::fs::FileExt::write_all_at(&file, &nifti.data, start).unwrap();
    let found = read_as(&path, &frame(frames as u64 - 1)).unwrap();
    assert_eq!((found.volume.values, found.warnings.len()), (nrrd_values(), 0));
    assert_eq!(read_as(&path, &frame(7)).unwrap().volume.values, Values::I16(vec![0; COUNT]));
}

// ------------------------------------------------------------------------------------------------ what follows the data

/// What is made of the data.
type Padding<'a> = &'a dyn Fn(&[u8]) -> Vec<u8>;

/// Files of every format with `padded` of the data in their place; each with the file that ends too late.
fn with_data(folder: &Folder, compressed: bool, padded: Padding) -> Vec<(String, Vec<u8>)> {
    let data = bytes_of(&nrrd_values(), Endian::Little);
    let nifti = Nifti::new(1, &nrrd_values(), Endian::Little);
    let encoding = if compressed { "gzip" } else { "raw" };
    let flag = if compressed { "True" } else { "False" };
    let mut pair = nifti.clone();
    pair.header[345] = b'i';
    pair.offset(0.0);
    let (header, image) = if compressed { ("p.hdr", "p.img.gz") } else { ("p.hdr", "p.img") };
    folder.put(image, &padded(&data));
    folder.put("d.raw", &padded(&data));
    let nrrd = nrrd_header(&[("encoding", Some(encoding))]);
    let meta = [("CompressedData", flag)];
    vec![
        ("a.nrrd".into(), joined(&(nrrd.clone() + "\n"), &padded(&data))),
        ("a.nhdr".into(), (nrrd + "data file: d.raw\n").into_bytes()),
        ("a.mha".into(), joined(&meta_header(&meta), &padded(&data))),
        ("a.nii".into(), padded(&nifti.file())),
        (header.into(), pair.header.clone()),
    ]
}

#[test]
fn bytes_after_the_data_are_a_warning_that_names_the_file() {
    let long = |bytes: &[u8]| [bytes, &[1, 2, 3]].concat();
    type Case<'a> = (bool, Padding<'a>, &'a str);
    let cases: [Case; 5] = [
        (false, &long, "3 bytes after the"),
        (true, &|bytes| long(&gzip(bytes)), "3 bytes after the end of the compressed data"),
        (true, &|bytes| [gzip(bytes), vec![0; 70_000], vec![1]].concat(), "70001 bytes after the end"),
        (true, &|bytes| long(&zlib(bytes)), "3 bytes after the end of the compressed data"),
        (true, &|bytes| gzip(&long(bytes)), "more than"),
    ];
    for (compressed, padded, says) in cases {
        let folder = Folder::new();
        for (name, content) in with_data(&folder, compressed, padded) {
            let path = folder.put(&name, &content);
            if name == "a.nii" && padded(&[0; 400])[0] != 0x1f && compressed {
                // NIfTI in one file is compressed by gzip only.
                continue;
            }
            let found = opened(&path);
            assert_eq!(found.volume.values, nrrd_values(), "{name}");
            assert_eq!(found.warnings.len(), 1, "{name}: {:?}", found.warnings);
            let warning = &found.warnings[0];
            let holder = match name.as_str() {
                "a.nhdr" => "d.raw",
                "p.hdr" => "p.img",
                own => own,
            };
            assert!(warning.contains(holder) && warning.contains(says), "{name}: {warning}");
            assert!(warning.ends_with("ignored"), "{warning}");
        }
    }
    let folder = Folder::new();
    let ascii = nrrd_header(&[("encoding", Some("ascii"))]) + "\n";
    let found = opened(&folder.put("a.nrrd", &joined(&ascii, &b"1 ".repeat(31))));
    assert!(found.warnings[0].contains("more than 30 numbers"), "{:?}", found.warnings);
    // Many files, one warning.
    for i in 0..5 {
        folder.put(&format!("row{i}.raw"), &[0; 13]);
    }
    let rows = nrrd_header(&[("sizes", Some("5 1 5")), ("type", Some("int16"))]);
    let found = opened(&folder.put("a.nhdr", (rows + "data file: row%d.raw 0 4 1\n").as_bytes()));
    assert_eq!(found.warnings.len(), 1);
    assert!(found.warnings[0].contains("row0.raw") && found.warnings[0].contains("4 more files"));
}

#[test]
fn zeros_after_gzip_and_several_members_are_nothing_to_speak_of() {
    let (zeros, halves): (Padding, Padding) = (&|bytes| [gzip(bytes), vec![0; 100_000]].concat(), &|bytes| {
        let (a, b) = bytes.split_at(bytes.len() / 2);
        [gzip(a), gzip(b), vec![0; 512]].concat()
    });
    for padded in [zeros, halves] {
        let folder = Folder::new();
        for (name, content) in with_data(&folder, true, padded) {
            let found = opened(&folder.put(&name, &content));
            assert_eq!((found.volume.values, found.warnings), (nrrd_values(), vec![]), "{name}");
        }
    }
    // Wherever a buffer of the reader ends: a member of every length around it.
    let folder = Folder::new();
    let header = nrrd_header(&[("encoding", Some("gzip"))]) + "data file: d.raw\n";
    let path = folder.put("a.nhdr", header.as_bytes());
    let data = bytes_of(&nrrd_values(), Endian::Little);
    let (a, b) = (gzip(&data[..20]), gzip(&data[20..]));
    for named in (1 << 16) - 50..(1 << 16) + 5 {
        // A member with a long name in its header.
        let mut first = a[..10].to_vec();
        first[3] |= 8;
        first.extend(vec![b'n'; named - a.len()]);
        first.push(0);
        first.extend(&a[10..]);
        folder.put("d.raw", &[first, b.clone(), vec![0; 99]].concat());
        let found = opened(&path);
        assert_eq!((found.volume.values, found.warnings), (nrrd_values(), vec![]), "{named}");
    }
}

#[test]
fn a_pair_in_capitals_opens_by_either_name() {
    let mut nifti = Nifti::new(1, &nrrd_values(), Endian::Little);
    nifti.header[345] = b'i';
    nifti.offset(0.0);
    for [header, image] in [
        ["PAIR.HDR", "PAIR.IMG"],
        ["Pair.Hdr", "Pair.Img"],
        ["PAIR.HDR", "PAIR.img"],
        ["PAIR.HDR", "PAIR.IMG.GZ"],
        ["PAIR.HDR.gz", "PAIR.IMG.gz"],
    ] {
        let folder = Folder::new();
        let zipped = |name: &str, bytes: &[u8]| match name.to_lowercase().ends_with("gz") {
            true => gzip(bytes),
            false => bytes.to_vec(),
        };
        for name in [
            folder.put(header, &zipped(header, &nifti.header)),
            folder.put(image, &zipped(image, &nifti.data)),
        ] {
            assert_eq!(opened(&name).volume.values, nrrd_values(), "{}", name.display());
        }
        std::fs::remove_file(folder.0.path().join(image)).unwrap();
        let lonely = folder.0.path().join(header);
        let missing = if header.starts_with("PAIR") { "PAIR.IMG" } else { "Pair.img" };
        assert_refused(cao_formats::read(&lonely), &lonely, "data", &[missing, "No such file"]);
    }
}

// ------------------------------------------------------------------------------------------------- what is no number

/// 30 values 10 … 39, six of them no numbers.
fn with_holes(huge: bool) -> Values {
    let mut values: Vec<f32> = (0..COUNT).map(|i| i as f32 + 10.0).collect();
    let large = if huge { f32::MAX } else { f32::NAN };
    for (i, v) in
        [(0, f32::NAN), (7, f32::INFINITY), (8, f32::NEG_INFINITY), (20, large), (21, -large), (29, f32::NAN)]
    {
        values[i] = v;
    }
    Values::F32(values)
}

fn holes(volume: &Volume) -> Vec<f64> {
    [0, 7, 8, 20, 21, 29].map(|i| volume.value(i)).to_vec()
}

fn put_holes(folder: &Folder, huge: bool) -> Vec<std::path::PathBuf> {
    let values = with_holes(huge);
    let Values::F32(floats) = &values else { unreachable!() };
    let doubles = Values::F64(floats.iter().map(|v| f64::from(*v)).collect());
    let little = |values| bytes_of(values, Endian::Little);
    let nrrd = |kind| nrrd_header(&[("type", Some(kind))]) + "\n";
    let mut scaled = Nifti::new(1, &values, Endian::Big);
    // Slope 0.3 and intercept 2.
    scaled.header[112..116].copy_from_slice(&0.3f32.to_be_bytes());
    scaled.header[116..120].copy_from_slice(&2f32.to_be_bytes());
    vec![
        folder.put("f.nrrd", &joined(&nrrd("float"), &little(&values))),
        folder.put("d.nrrd", &joined(&nrrd("double"), &little(&doubles))),
        folder.put("a.mha", &joined(&meta_header(&[("ElementType", "MET_FLOAT")]), &little(&values))),
        folder.put("a.nii", &scaled.file()),
    ]
}

#[test]
fn a_value_stands_for_what_is_no_number_if_the_user_says_so() {
    let folder = Folder::new();
    let reading = |value| Reading { no_numbers: NoNumbers::Value(value), ..Reading::default() };
    for huge in [false, true] {
        for path in put_holes(&folder, huge) {
            let volume = read_as(&path, &reading(-7.5)).unwrap().volume;
            assert!(holes(&volume).iter().all(|v| (v + 7.5).abs() < 1e-5), "{:?}", holes(&volume));
            let [slope, intercept] = [volume.slope, volume.intercept];
            assert_eq!(volume.value(1), slope * 11.0 + intercept, "others stay");
            volume.check().unwrap();
        }
    }
    let path = &put_holes(&folder, false)[0];
    assert_refused(read_as(path, &reading(1e300)), path, "data", &["--nan", "float32"]);
    for text in ["nan", "inf", "", "opaque"] {
        assert_eq!(NoNumbers::parse(text), None, "{text}");
    }
    assert_eq!(NoNumbers::parse("-1e3"), Some(NoNumbers::Value(-1000.0)));
}

#[test]
fn transparent_is_a_value_of_opacity_0_exactly_or_a_reason() {
    let folder = Folder::new();
    let reading = Reading { no_numbers: NoNumbers::Transparent, ..Reading::default() };
    let points = |points: &[[f32; 2]]| {
        TransferFunction::new(points.to_vec(), vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap()
    };
    for huge in [false, true] {
        for path in put_holes(&folder, huge) {
            let volume = read_as(&path, &reading).unwrap().volume;
            let (low, high) = volume.range();
            let expected = [11, 38].map(|v| volume.slope * f64::from(v) + volume.intercept);
            assert_eq!([low, high], expected, "what is no number does not count");
            let error = volume.check().unwrap_err().to_string();
            assert!(error.contains("6 of 30"), "cannot be drawn yet: {error}");
            let mut functions: Vec<TransferFunction> = PRESETS
                .iter()
                .map(|(name, _)| TransferFunction::preset(name, (low, high)).unwrap())
                .collect();
            functions.extend([
                // Nothing at the lower end: 0 above, between, at one value, below a step.
                points(&[[0.0, 0.9], [20.0, 0.0]]),
                points(&[[0.0, 0.9], [20.0, 0.0], [30.0, 0.0], [31.0, 1.0]]),
                points(&[[0.0, 0.9], [20.7, 0.0], [31.0, 1.0]]),
                points(&[[-5.3, 0.0], [-5.3, 1.0]]),
            ]);
            for transfer in functions {
                let mut hidden = volume.clone();
                assert_eq!(hidden.hide_no_numbers(&transfer).unwrap(), 6);
                for value in holes(&hidden) {
                    assert_eq!(transfer.opacity_at(value as f32), 0.0, "{value} {transfer:?}");
                }
                hidden.check().unwrap();
                assert_eq!(hidden.value(1), volume.value(1), "others stay");
                assert_eq!(hidden.hide_no_numbers(&transfer).unwrap(), 0, "none is left");
            }
            // Opacity 0 at one value only, which may not be among those that the file's type, slope and intercept reach.
            let mut exact = 0;
            for i in 0..200 {
                let at = 6.0 + 0.37 * i as f32;
                let transfer = points(&[[at - 1.0, 0.9], [at, 0.0], [at + 1.0, 0.9]]);
                let mut hidden = volume.clone();
                match hidden.hide_no_numbers(&transfer) {
                    Ok(_) => exact += 1,
                    Err(error) => {
                        assert!(error.to_string().contains("no value of opacity 0"), "{error}");
                        continue;
                    }
                }
                assert!(holes(&hidden).iter().all(|v| transfer.opacity_at(*v as f32) == 0.0), "{at}");
            }
            assert!(exact > 20, "{exact}");
            for opaque in [points(&[[0.0, 0.1]]), points(&[[0.0, 0.5], [9.0, 0.0], [9.0, 0.5]])] {
                let error = volume.clone().hide_no_numbers(&opaque).unwrap_err().to_string();
                assert!(error.contains("no value of opacity 0 for the 6 voxels"), "{error}");
            }
        }
    }
    // Large numbers are numbers, where nobody says that they are not.
    let lone = Values::F32(vec![f32::MAX; COUNT]);
    let path = folder.put("a.nii", &Nifti::new(1, &lone, Endian::Little).file());
    assert_eq!(opened(&path).volume.values, lone);
    let volume = read_as(&path, &reading).unwrap().volume;
    assert_eq!(volume.range(), (0.0, 0.0), "no number is left");
    let integers = folder.put("i.nii", &Nifti::new(1, &nrrd_values(), Endian::Little).file());
    assert_eq!(read_as(&integers, &reading).unwrap().volume.values, nrrd_values());
    assert!(FARTHEST < f64::from(f32::MAX));
}
