//! `tools/bundle` and the script `run` within: packed, unpacked and run on the real device, with the real `cao` on a small volume. Test
//! executables and `stereo-bench` are small scripts here, which can fail, hang and skip; `.ci/more` runs the whole with the real ones.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;
use std::sync::LazyLock;

const TOOL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tools/bundle");

/// Lists tests as a test executable does; the second waits for two minutes where it is told to.
const KERNELS: &str = r#"#!/bin/bash
case "$*" in
'--list --ignored'*) echo 'e::child: test' ;;
--list*) printf '%s: test\n' a::reads b::waits c::fails d::skips e::child ;;
*a::reads*) [ -e "$CAO_SOURCE/spirv/field/opacity.wgsl" ] && [ -d "$TMPDIR" ] ;;
*b::waits*) [ -z "$WAIT" ] || sleep 120 ;;
*c::fails*) [ -z "$FAIL" ] || { echo 'the reason' && exit 101; } ;;
*d::skips*) echo 'skipped: no volume' ;;
*) exit 3 ;;
esac
"#;

const BARS: &str = "#!/bin/bash\necho 'ok     here  2 x'\necho 'MISSED there  1 x'\nexit 1\n";

/// The bundle, unpacked once for all tests of this process. Each test is a process of its own under nextest.
static BUNDLE: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir_all(at("built/tests")).unwrap();
    // The same program, but no minutes of verification.
    let real = env!("CARGO_BIN_EXE_cao");
    let cao = format!(
        "#!/bin/bash\n[ \"$*\" != verify ] || set -- verify builtin:fruit:12 --poses 1\nexec {real} \"$@\"\n"
    );
    for (name, text) in [("cao", cao.as_str()), ("stereo-bench", BARS), ("tests/kernels", KERNELS)] {
        let file = at("built").join(name);
        fs::write(&file, text).unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o755)).unwrap();
    }
    let arguments = ["--built", "built", "--output", "out/bundle.tar.gz"];
    let (code, out, err) = finished(Command::new(TOOL).args(arguments).current_dir(folder.path()));
    assert_eq!((code, out.as_str(), err.lines().count()), (Some(0), "", 1), "{err}");
    let (code, ..) =
        finished(Command::new("tar").args(["xf", "out/bundle.tar.gz"]).current_dir(folder.path()));
    assert_eq!(code, Some(0));
    folder
});

/// Exit code, standard output, standard error.
fn finished(command: &mut Command) -> (Option<i32>, String, String) {
    let run = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (run.status.code(), text(run.stdout), text(run.stderr))
}

/// `run` with these arguments, in this folder.
fn run(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(BUNDLE.path().join("cao-bundle/run"));
    command.args(arguments.split_whitespace()).current_dir(folder).env_remove("CAO_DATA");
    command
}

fn names(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = names.collect();
    names.sort();
    names
}

/// Whether a line of the summary begins with these two words.
fn row(summary: &str, step: &str, result: &str) -> bool {
    summary.lines().any(|line| line.split_whitespace().take(2).eq([step, result]))
}

#[test]
fn an_unpacked_bundle_checks_this_device() {
    let folder = tempfile::tempdir().unwrap();
    let (code, out, err) =
        finished(&mut run(folder.path(), "--minutes 1 --only verify,devices,bars,kernels"));
    assert_eq!(code, Some(0), "{out}{err}");
    assert!(!err.contains(['\r', '\u{1b}']), "progress in a pipe: {err:?}");
    let kept = names(folder.path());
    assert!(kept.len() == 1 && kept[0].starts_with("cao-run-20"), "{kept:?}");
    let kept = folder.path().join(&kept[0]);
    let files = ["1-devices.txt", "2-verify.txt", "3-bars.txt", "4-kernels.txt", "summary.txt"];
    assert_eq!(names(&kept), files);
    assert_eq!(fs::read_to_string(kept.join("summary.txt")).unwrap(), out, "the summary is what is printed");
    for (step, result) in [("devices", "ok"), ("verify", "ok"), ("bars", "missed"), ("kernels", "ok")] {
        assert!(row(&out, step, result), "{step}: {out}");
    }
    for words in ["exact: ", "MISSED there", "3 passed, 0 failed, 1 skipped", "passed: 4 of 4"] {
        assert!(out.contains(words), "{words} is not in {out}");
    }
    assert!(
        fs::read_to_string(kept.join("2-verify.txt")).unwrap().contains("voxels that differ             0")
    );
}

/// A failure costs its own test only, and the exit status.
#[test]
fn what_fails_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = run(folder.path(), "--minutes 1 --only devices,kernels,gpu -o here");
    let (code, out, err) = finished(command.env("FAIL", "1"));
    assert_eq!(code, Some(1), "{out}{err}");
    for words in
        ["2 passed, 1 failed, 1 skipped", "failed: kernels c::fails", "failed: gpu: not in this bundle"]
    {
        assert!(out.contains(words), "{words} is not in {out}");
    }
    let kernels = fs::read_to_string(folder.path().join("here/2-kernels.txt")).unwrap();
    assert!(kernels.contains("FAILED   c::fails") && kernels.contains("         the reason"), "{kernels}");
    assert!(!kernels.contains("e::child"), "ignored: {kernels}");
}

#[test]
fn what_has_no_time_is_left_out_and_said() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = run(folder.path(), "--minutes 0.2 --only devices,kernels -o here");
    let began = std::time::Instant::now();
    let (code, out, err) = finished(command.env("WAIT", "1"));
    assert!(began.elapsed().as_secs() <= 13, "{out}{err}");
    assert_eq!(code, Some(0), "{out}{err}");
    assert!(row(&out, "kernels", "stopped") && out.contains("something was left out"), "{out}");
    assert!(out.contains("left out: kernels: 3 of 4 tests"), "{out}");
}

#[test]
fn a_machine_without_a_driver_is_told_what_to_install() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = run(folder.path(), "");
    command.envs(["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].map(|name| (name, "/nonexistent")));
    let (code, out, err) = finished(&mut command);
    assert_eq!((code, out.as_str()), (Some(1), ""), "{err}");
    for words in ["no Vulkan device answers", "apt-get install libvulkan1", "nothing was run"] {
        assert!(err.contains(words), "{words} is not in {err}");
    }
    assert!(names(folder.path()).is_empty(), "nothing is left behind");
}

#[test]
fn wrong_arguments_are_refused_in_a_line() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, words) in [
        ("--minutes many", "--minutes many"),
        ("--minutes 0", "ten seconds"),
        ("--only verify,picture", "verify-all"),
        ("--data absent", "absent"),
        ("--colour", "--colour"),
        ("--device", "needs a value"),
    ] {
        let (code, out, err) = finished(&mut run(folder.path(), arguments));
        assert_eq!((code, out.as_str()), (Some(2), ""), "{arguments}: {err}");
        assert!(err.contains(words) && err.lines().count() == 1, "{arguments}: {err}");
    }
    for (arguments, words) in [
        ("-o bundle.zip", ".tar.xz or .tar.gz"),
        ("--data absent", "absent"),
        ("--built absent", "absent"),
        ("--colour", "--colour"),
    ] {
        let mut command = Command::new(TOOL);
        let (code, out, err) = finished(command.args(arguments.split(' ')).current_dir(folder.path()));
        assert_eq!((code, out.as_str()), (Some(2), ""), "{arguments}: {err}");
        assert!(err.contains(words) && err.lines().count() == 1, "{arguments}: {err}");
    }
    assert!(names(folder.path()).is_empty(), "nothing is left behind");
}
