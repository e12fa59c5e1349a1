//! `tools/peers` refuses what it cannot do before it installs anything, each in one line. VTK is too large a download for tests: what
//! comes after is checked by `tools/peers --check`.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

const TOOL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tools/peers");
const ARGUMENTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tools/peers.d/arguments.py");

/// Exit code, standard output, standard error.
pub fn run(command: &mut Command) -> (Option<i32>, String, String) {
    let run = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (run.status.code(), text(run.stdout), text(run.stderr))
}

/// Whether what the tool asks of Python is there; without it the tool would install it.
pub fn has_python() -> bool {
    let found = Command::new("python3").args(["-c", "import ensurepip, venv"]).output();
    let found = found.is_ok_and(|run| run.status.success());
    if !found {
        println!("not checked: python3 with venv is not installed (Debian: python3-venv)");
    }
    found
}

#[test]
fn wrong_arguments_are_refused_before_anything_is_installed() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("file"), "").unwrap();
    for (arguments, words) in [
        ("--size 64", "WIDTHxHEIGHT"),
        ("--size 64x0", "WIDTHxHEIGHT"),
        ("--rounds 0", "--rounds"),
        ("--moves many", "--moves"),
        ("--radius-mm -3", "a length > 0 mm"),
        ("--radius-mm nan", "a length > 0 mm"),
        ("--json missing/peers.json", "a folder that exists"),
        ("-o file", "expected a folder"),
        ("absent.nrrd", "absent.nrrd"),
        ("builtin:engine:32 builtin:engine:64", "builtin:engine:64"),
        ("--colour=red", "--colour"),
    ] {
        let mut command = Command::new(TOOL);
        command.current_dir(folder.path()).args(arguments.split(' '));
        let (code, out, err) = run(&mut command);
        assert_eq!((code, out.as_str()), (Some(2), ""), "{arguments}: {err}");
        assert!(err.contains(words) && err.lines().count() == 1, "{arguments}: {err}");
    }
    let mut kept: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    kept.sort();
    assert_eq!(kept, ["file"], "nothing is left behind");
}

#[test]
fn help_names_every_option() {
    if !has_python() {
        return;
    }
    let (code, help, _) = run(Command::new(TOOL).arg("--help"));
    assert_eq!(code, Some(0));
    let source = fs::read_to_string(ARGUMENTS).unwrap();
    let options: Vec<&str> = source
        .split("add_argument(\"")
        .skip(1)
        .map(|rest| rest.split('"').next().unwrap())
        .filter(|name| name.starts_with('-'))
        .collect();
    assert!(options.len() > 5, "{options:?}");
    for option in options {
        assert!(help.contains(&format!("  {option} ")), "{option} is not in\n{help}");
    }
}

/// A system without Python and without a package manager that the tool knows: one line says what to do.
#[test]
fn without_python_one_line_says_how_to_get_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = std::env::var("PATH").unwrap();
    for tool in ["bash", "dirname", "awk", "sed", "paste", "cat"] {
        let found = path.split(':').map(|at| Path::new(at).join(tool)).find(|file| file.exists());
        symlink(found.unwrap_or_else(|| panic!("no {tool}")), folder.path().join(tool)).unwrap();
    }
    let (code, out, err) = run(Command::new(TOOL).env("PATH", folder.path()));
    assert_eq!((code, out.as_str(), err.lines().count()), (Some(1), "", 1), "{err}");
    for words in ["missing: Python 3 with venv", "dnf install python3", "pacman -S python"] {
        assert!(err.contains(words), "{words} is not in {err}");
    }
}
