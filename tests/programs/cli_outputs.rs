//! What the programs write: whole or not at all, nothing beside it, nothing lost without a word, under any name.

use crate::support::{Folder, cube_obj, nrrd};
use std::ffi::{OsStr, OsString};
use std::fs;
use std::os::unix::ffi::OsStringExt;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// Three files of 8 MiB.
const LARGE: &str = "occlusion builtin:uniform:128 --rays 6 --radius-mm 1 -o ao.nrrd --opacity-out vo.nrrd --mask-out vm.nrrd";
/// Two small pictures.
const EYES: &str = "render builtin:engine:8 --radius-mm 2 --size 8x8 --eyes l.png,r.png";

/// Whether the process has a file of the folder open, with or without a name, that holds something.
fn is_writing(process: u32, folder: &Path) -> bool {
    let Ok(open) = fs::read_dir(format!("/proc/{process}/fd")) else { return false };
    open.flatten().any(|file| {
        let place = fs::read_link(file.path());
        place.is_ok_and(|place| place.starts_with(folder))
            && file.path().metadata().is_ok_and(|meta| meta.is_file() && meta.len() > 0)
    })
}

/// Runs the program until it writes; `None` if it was done before that was seen, as happens on a busy machine.
fn caught_writing(folder: &Folder, mut command: Command) -> Option<Child> {
    let place = folder.path("").canonicalize().unwrap();
    let mut program = command.stderr(Stdio::piped()).spawn().unwrap();
    while !is_writing(program.id(), &place) {
        if program.try_wait().unwrap().is_some() {
            return None;
        }
    }
    Some(program)
}

/// How often one tries to catch it.
const TRIES: usize = 20;

fn signal(name: &str, process: u32) {
    Command::new("kill").args(["-s", name, &process.to_string()]).status().unwrap();
}

fn remove(folder: &Folder) {
    folder.list().iter().for_each(|name| fs::remove_file(folder.path(name)).unwrap());
}

#[test]
fn a_program_that_is_killed_while_it_writes_leaves_nothing() {
    let folder = Folder::with_device();
    let line: Vec<_> = LARGE.split_whitespace().collect();
    // Who runs this under `nohup` or in a shell's background has the program ignore some.
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap();
    let ignored = u64::from_str_radix(ignored.trim(), 16).unwrap();
    let heard = |(_, number): &(&str, i32)| ignored >> (number - 1) & 1 == 0;
    for (name, number) in [("HUP", 1), ("INT", 2), ("TERM", 15), ("KILL", 9)].into_iter().filter(heard) {
        let killed = (0..TRIES).any(|_| {
            remove(&folder);
            let Some(mut program) = caught_writing(&folder, folder.command(&line)) else { return false };
            signal(name, program.id());
            program.wait().unwrap().signal() == Some(number)
        });
        assert!(killed, "{name} always came too late");
        assert_eq!(folder.list(), [""; 0], "{name}");
    }
}

/// As `nohup` asks.
#[test]
fn a_signal_that_is_to_be_ignored_is() {
    let folder = Folder::with_device();
    let went_on = (0..TRIES).any(|_| {
        remove(&folder);
        let command = folder.shell("trap '' HUP; exec \"$@\"", LARGE);
        let Some(program) = caught_writing(&folder, command) else { return false };
        signal("HUP", program.id());
        program.wait_with_output().unwrap().status.success()
    });
    assert!(went_on);
    assert_eq!(folder.list(), ["ao.nrrd", "vm.nrrd", "vo.nrrd"]);
}

/// A full disk, played by a limit on the length of files that begins as the program writes: the first output has room, the others, with
/// their longer headers, have not.
#[test]
fn of_several_outputs_all_are_written_or_none() {
    let folder = Folder::with_device();
    folder.ok(LARGE);
    let names = ["ao.nrrd", "vm.nrrd", "vo.nrrd"];
    let [limit, others @ ..] = names.map(|name| fs::metadata(folder.path(name)).unwrap().len());
    assert!(others.iter().all(|length| *length > limit));
    let limit = format!("--fsize={limit}");
    for there_before in [&names[..], &[]] {
        let full = (0..TRIES).any(|_| {
            remove(&folder);
            for name in there_before {
                folder.put(name, "old");
            }
            let command = folder.shell("trap '' XFSZ; exec \"$@\"", LARGE);
            let Some(program) = caught_writing(&folder, command) else { return false };
            signal("STOP", program.id());
            Command::new("prlimit").args(["--pid", &program.id().to_string(), &limit]).status().unwrap();
            signal("CONT", program.id());
            let ended = program.wait_with_output().unwrap();
            let said = String::from_utf8(ended.stderr).unwrap();
            assert!(ended.status.success() || said.contains("File too large"), "{said}");
            ended.status.code() == Some(1)
        });
        assert!(full, "the disk was always full too late");
        assert_eq!(folder.list(), there_before);
        for name in there_before {
            assert_eq!(fs::read(folder.path(name)).unwrap(), b"old", "{name}");
        }
    }
}

/// Programs in containers of their own may have the same number and the same folder.
#[test]
fn files_of_another_program_are_neither_used_nor_deleted() {
    let folder = Folder::with_device();
    let script =
        "for n in .cao-$$.part .l.png.$$-0.part .r.png.$$-1.part; do echo theirs > $n; done; exec \"$@\"";
    let run = folder.under(script, EYES);
    assert_eq!(run.code, Some(0), "{}", run.err);
    let (parts, written): (Vec<_>, Vec<_>) =
        folder.list().into_iter().partition(|name| name.ends_with(".part"));
    assert_eq!((parts.len(), written), (3, vec!["l.png".to_owned(), "r.png".to_owned()]));
    for name in parts {
        assert_eq!(fs::read_to_string(folder.path(&name)).unwrap(), "theirs\n", "{name}");
    }
}

#[test]
fn the_mode_of_a_file_survives_and_so_does_a_link_to_it() {
    let folder = Folder::with_device();
    let mode = |name: &str| fs::metadata(folder.path(name)).unwrap().permissions().mode() & 0o7777;
    folder.put("real.png", "old").put("l.png", "old");
    fs::set_permissions(folder.path("l.png"), fs::Permissions::from_mode(0o640)).unwrap();
    fs::set_permissions(folder.path("real.png"), fs::Permissions::from_mode(0o604)).unwrap();
    symlink("real.png", folder.path("r.png")).unwrap();
    let run = folder.under("umask 027; exec \"$@\"", EYES);
    assert_eq!(run.code, Some(0), "{}", run.err);
    assert_eq!((mode("l.png"), mode("real.png")), (0o640, 0o604));
    assert!(fs::symlink_metadata(folder.path("r.png")).unwrap().is_symlink());
    assert!(fs::read(folder.path("real.png")).unwrap().starts_with(b"\x89PNG"));

    let run = folder.under("umask 027; exec \"$@\"", "render builtin:engine:8 --size 8x8 -o new.png");
    assert_eq!((run.code, mode("new.png")), (Some(0), 0o640), "a new file has the user's: {}", run.err);
}

#[test]
fn what_is_printed_into_a_full_disk_is_lost_with_a_word_and_without_a_panic() {
    let folder = Folder::with_device();
    let bench = Folder::with_device().running(env!("CARGO_BIN_EXE_stereo-bench"));
    let measured = "builtin:engine:8 --radius-mm 2 --size 8x8 --frames 1 --runs 1 --methods cao";
    for (program, arguments) in [
        (&folder, "--help"),
        (&folder, "render --help"),
        (&folder, "--version"),
        (&folder, "info builtin:engine:8"),
        (&folder, "devices --json"),
        (&folder, "stability --list"),
        (&folder, EYES),
        (&bench, "--help"),
        (&bench, measured),
    ] {
        let run = program.under("exec \"$@\" >/dev/full", arguments);
        assert_eq!(run.code, Some(1), "{}: {}", run.line, run.err);
        assert!(run.err.contains("cannot write to standard output: No space left"), "{}", run.err);
    }
    for (program, arguments, code) in [
        (&folder, "info absent.nrrd", 1),
        (&folder, "info --absent", 2),
        (&folder, "", 2),
        (&folder, "render builtin:engine:8 -o s.jpg", 2),
        (&bench, "absent.nrrd", 1),
        (&bench, "--absent", 2),
    ] {
        let run = program.under("exec \"$@\" 2>/dev/full", arguments);
        assert_eq!((run.code, run.out.as_str()), (Some(code), ""), "{}", run.line);
    }
}

/// A name that is not UTF-8, as file systems of long ago left them.
fn foreign(ending: &str) -> OsString {
    OsString::from_vec([b"caf\xe9", ending.as_bytes()].concat())
}

#[test]
fn names_that_are_not_utf_8_are_names() {
    let folder = Folder::with_device();
    let put = |ending: &str, content: &[u8]| {
        fs::write(folder.path("").join(foreign(ending)), content).unwrap();
        foreign(ending)
    };
    let volume = put(".nrrd", &nrrd("uchar", "8 8 8", "1 1 1", &[200; 512]));
    let raw = put(".raw", &[200; 8]);
    let mesh = put(".obj", cube_obj(6).as_bytes());
    let transfer = put("-tf.toml", b"opacity = [[0, 0.0], [255, 0.5]]\ncolour = \"#ffffff\"\n");
    let scene = put(".toml", b"volume = \"builtin:engine:8\"\n[image]\nwidth = 8\nheight = 8\n");
    let eyes = OsString::from_vec(b"l\xe9.png,r\xe9.png".to_vec());
    let [picture, table, kept] = [".png", ".csv", "-runs"].map(foreign);
    let small = |words: &'static str| words.split_whitespace().map(OsStr::new).collect::<Vec<_>>();
    let o = OsStr::new("-o");
    let [clip, of] = ["--clip", "--transfer"].map(OsStr::new);
    let shading = ["--radius-mm", "2", "--size", "8x8"].map(OsStr::new);
    let with = |words: &[&[&OsStr]]| folder.command(&words.concat());

    let commands = [
        with(&[&small("info"), &[&volume]]),
        with(&[&small("info --dims 2,2,2 --type uint8"), &[&raw]]),
        with(&[&small("render"), &[&volume, clip, &mesh, of, &transfer, o, &picture], &shading]),
        with(&[&small("render --eyes"), &[&eyes, &scene], &shading]),
        with(&[
            &small("occlusion --radius-mm 2"),
            &[&volume, clip, &mesh, of, &transfer, o, &foreign("-ao.nrrd")],
        ]),
        with(&[&small("verify --poses 1 --radius-mm 2 --shapes"), &[&mesh, &volume]]),
    ];
    let bench = Folder::with_device().running(env!("CARGO_BIN_EXE_stereo-bench"));
    let words = small("--radius-mm 2 --size 8x8 --frames 1 --runs 1 --methods cao --csv");
    let mut measured =
        bench.command(&[&words[..], &[&table, OsStr::new("--save"), &kept, clip, &mesh, &volume]].concat());
    measured.current_dir(folder.path(""));
    for mut command in commands.into_iter().chain([measured]) {
        let output = command.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{command:?}: {said}");
    }
    for name in [picture, "-ao.nrrd".into(), table, kept] {
        let name =
            if name.to_string_lossy().starts_with('-') { foreign(&name.to_string_lossy()) } else { name };
        assert!(folder.path("").join(&name).exists(), "{name:?}");
    }
    for eye in eyes.into_vec().split(|byte| *byte == b',') {
        assert!(folder.path("").join(OsString::from_vec(eye.to_vec())).exists());
    }

    // What is wrong with them is said in text.
    let absent = OsString::from_vec(b"caf\xe9\x1b[2J\n.nrrd".to_vec());
    let output = with(&[&small("info"), &[&absent]]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(
        said,
        "cao: cannot access caf\u{fffd}\\u{1b}[2J\\n.nrrd: No such file or directory (os error 2)\n"
    );
    let output = with(&[&small("info"), &[&OsString::from("--ab\u{1b}[2J\u{7}sent")]]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("sent") && !said.contains(['\u{1b}', '\u{7}']), "{said:?}");
}
