//! Output files: all of them whole or none, under the names they were given; and which files were read.

use cao_formats::{GrowingPng, Outputs, Picture, input};
use cao_model::error::shown_path;
use cao_model::values::Values;
use cao_model::volume::Volume;
use std::fs;
use std::os::unix::fs::symlink;
use std::sync::atomic::{AtomicBool, Ordering};

#[test]
fn nothing_has_its_name_before_all_can_have_theirs() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    let mut outputs = Outputs::default();
    for path in [&first, &second] {
        outputs.write(path, |file| file.write_all(b"new")).unwrap();
    }
    assert!(!first.exists() && !second.exists());
    // Another program was quicker.
    fs::create_dir(&second).unwrap();
    let refused = outputs.commit().unwrap_err();
    assert!(refused.to_string().contains("second"), "{refused}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "the folder and nothing else");

    fs::remove_dir(&second).unwrap();
    let mut outputs = Outputs::default();
    for path in [&first, &second] {
        outputs.write(path, |file| file.write_all(b"new")).unwrap();
    }
    outputs.commit().unwrap();
    for path in [&first, &second] {
        assert_eq!(fs::read(path).unwrap(), b"new");
    }
}

/// On file systems without unnamed files too: what is dropped is gone.
#[test]
fn writing_stops_when_it_is_told_to() {
    static STOP: AtomicBool = AtomicBool::new(false);
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    let mut outputs = Outputs::until(|| STOP.load(Ordering::SeqCst));
    outputs.write(&first, |file| file.write_all(&[1; 100_000])).unwrap();
    let stopped = outputs.write(&second, |file| {
        file.write_all(&[1; 100_000])?;
        STOP.store(true, Ordering::SeqCst);
        (0..1000).try_for_each(|_| file.write_all(&[1; 100_000]))
    });
    let stopped = stopped.unwrap_err();
    assert_eq!(std::error::Error::source(&stopped).unwrap().to_string(), "interrupted");
    drop(outputs);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn what_is_said_to_be_writable_is_and_the_check_leaves_no_trace() {
    let folder = tempfile::tempdir().unwrap();
    let longest = folder.path().join("x".repeat(247));
    let old = folder.path().join("old");
    fs::write(&old, "old").unwrap();
    symlink("old", folder.path().join("link")).unwrap();
    for (path, place) in [(longest.clone(), &longest), (folder.path().join("link"), &old)] {
        assert_eq!(Outputs::check(&path).unwrap(), place.canonicalize().unwrap_or(place.clone()));
        assert_eq!((longest.exists(), fs::read(&old).unwrap()), (false, b"old".to_vec()));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }
    cao_formats::write_atomic(&longest, |file| file.write_all(b"new")).unwrap();
    assert_eq!(fs::read(&longest).unwrap(), b"new");
    let longer = folder.path().join("x".repeat(248));
    let refused = Outputs::check(&longer).unwrap_err();
    assert!(std::error::Error::source(&refused).unwrap().to_string().contains("too long"), "{refused}");
}

#[test]
fn a_file_that_was_read_is_known_by_every_name() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for name in ["read", "alike"] {
        fs::write(at(name), "the same").unwrap();
    }
    fs::hard_link(at("read"), at("hard")).unwrap();
    symlink("hard", at("soft")).unwrap();
    assert!(!input::was_read(&at("read")));
    assert_eq!(cao_formats::file::read_text(&at("soft")).unwrap(), "the same");
    let known = ["read", "alike", "hard", "soft", "./soft", "absent"].map(|name| input::was_read(&at(name)));
    assert_eq!(known, [true, false, true, true, true, false]);
}

#[test]
fn names_are_shown_without_what_a_terminal_would_obey() {
    for (name, shown) in [
        ("head.nrrd", "head.nrrd"),
        ("Kopf, groß.nrrd", "Kopf, groß.nrrd"),
        ("a\u{1b}[2Jb", "a\\u{1b}[2Jb"),
        ("two\nlines\r\t\u{7f}\u{9b}", "two\\nlines\\r\\t\\u{7f}\\u{9b}"),
    ] {
        assert_eq!(shown_path(name), shown);
    }
}

/// A picture written some rows at a time; with too few or too many of them it is refused by name.
#[test]
fn a_picture_that_grows_is_the_whole_one() {
    let pixels: Vec<[u8; 3]> = (0..35).map(|i| [i, 7 * i, 90 - i]).collect();
    let whole = Picture { width: 5, height: 7, pixels };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grown.png");
    let grow = |pieces: &[&[[u8; 3]]]| -> cao_formats::Result<()> {
        let mut outputs = Outputs::default();
        let mut png = GrowingPng::new(outputs.open(&path)?, 5, 7)?;
        pieces.iter().try_for_each(|piece| png.add(piece))?;
        outputs.keep(png.finish()?)?;
        outputs.commit()
    };
    let (top, rest) = whole.pixels.split_at(5);
    grow(&[top, rest]).unwrap();
    let read = |png: Vec<u8>| {
        let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        assert_eq!((info.width, info.height), (5, 7));
        bytes
    };
    assert_eq!(read(std::fs::read(&path).unwrap()), whole.pixels.as_flattened());
    assert_eq!(read(whole.png().unwrap()), whole.pixels.as_flattened());
    std::fs::remove_file(&path).unwrap();
    for wrong in [&[top, top][..], &[top, rest, top]] {
        let error = grow(wrong).unwrap_err().to_string();
        assert!(error.contains("grown.png") && !path.exists(), "{error}");
    }
}

#[test]
fn colours_are_an_axis_of_a_nrrd_file_without_a_place_in_space() {
    let volume = Volume::new([2, 3, 1], [1.0, 0.5, 2.0], Values::U8(vec![0; 6])).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("colours.nrrd");
    let colours: Vec<[f32; 3]> = (0..6_u8).map(|i| [0.25, 1.0, 0.1].map(|c| c * f32::from(i))).collect();
    let mut outputs = Outputs::default();
    let few = outputs.nrrd_colours(&path, &volume, &colours[1..], "c").unwrap_err().to_string();
    assert!(few.contains("5 values, expected 6"), "{few}");
    outputs.nrrd_colours(&path, &volume, &colours, "c").unwrap();
    outputs.commit().unwrap();
    let found = fs::read(&path).unwrap();
    let header = "NRRD0004\ncontent: c\ntype: float\ndimension: 4\nsizes: 3 2 3 1\nspacings: NaN 1 0.5 2\n\
        kinds: RGB-color domain domain domain\nendian: little\nencoding: raw\n\n";
    let (text, values) = found.split_at(header.len());
    assert_eq!(String::from_utf8_lossy(text), header);
    let bytes: Vec<u8> = colours.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
    assert_eq!(values, bytes);
}
