//! Output files: all of them whole or none, under the names they were given; and which files were read.

use cao_formats::{Outputs, input};
use cao_model::error::shown_path;
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
