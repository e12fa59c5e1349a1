//! `tools/train` refuses what it cannot do before it installs anything, each in one line. PyTorch is too large a download for tests: what
//! comes after is in docs/training.md.

use super::peers::{has_python, run};
use std::fs;
use std::process::Command;

const TOOL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tools/train");
const ARGUMENTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tools/train.d/arguments.py");

#[test]
fn a_training_that_there_is_none_of_is_refused_before_anything_is_installed() {
    if !has_python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (arguments, words) in [
        ("--label max", "mean"),
        ("--loss ssim4", "ssim3+mse"),
        ("--injection adaptive", "latent"),
        ("--filters 0", "--filters"),
        ("--cap 4", "--cap 4: expected at least as many"),
        ("--edge 72", "a multiple of 32"),
        ("--minutes -1", "minutes > 0"),
        ("--suite", "--minutes"),
        ("--pack a --from b", "one of them"),
        ("--colour red", "--colour"),
    ] {
        let mut command = Command::new(TOOL);
        command.current_dir(folder.path()).args(arguments.split(' '));
        let (code, out, err) = run(&mut command);
        assert_eq!((code, out.as_str()), (Some(2), ""), "{arguments}: {err}");
        assert!(err.contains(words) && err.lines().count() == 1, "{arguments}: {err}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left behind");
    // What was packed has examples of one size and label.
    let mut command = Command::new(TOOL);
    command.current_dir(folder.path()).args(["--from", "pack", "--folder", "out", "--label", "end"]);
    let (code, _, err) = run(&mut command);
    assert_eq!(code, Some(1), "{err}");
    assert!(err.contains("edge 64 and label end"), "{err}");
}

#[test]
fn trains_help_names_every_option() {
    if !has_python() {
        return;
    }
    let (code, help, _) = run(Command::new(TOOL).arg("--help"));
    assert_eq!(code, Some(0));
    let source = fs::read_to_string(ARGUMENTS).unwrap();
    let options: Vec<&str> =
        source.split("add(\"--").skip(1).map(|rest| rest.split('"').next().unwrap()).collect();
    assert!(options.len() > 10);
    // What the script says to the program.
    for option in
        options.into_iter().chain(["filters", "cap", "levels", "edge"]).filter(|option| *option != "data")
    {
        assert!(help.contains(&format!("--{option} ")), "--{option} is not in\n{help}");
    }
}
