//! The program `cao-xr` where there is no headset. What it does with one is checked by `tools/openxr`.

use std::process::Command;

/// Runs it so that no runtime is found, whatever the system has.
fn xr(arguments: &[&str]) -> (Option<i32>, String) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_cao-xr"));
    let run = program.args(arguments).env("XR_RUNTIME_JSON", "/nonexistent").output().unwrap();
    (run.status.code(), String::from_utf8(run.stderr).unwrap())
}

#[test]
fn without_a_runtime_xr_says_what_to_install_or_start() {
    let (code, said) = xr(&["builtin:fruit:16"]);
    let last = said.lines().last().unwrap();
    assert_eq!(code, Some(1), "{said}");
    // Some systems have the loader, which says more before.
    let remedy = match last.starts_with("cao-xr: there is no OpenXR loader") {
        true => "apt install libopenxr-loader1",
        false => "no OpenXR runtime answers; start",
    };
    assert!(last.starts_with("cao-xr: ") && last.contains(remedy), "{said}");
}

#[test]
fn wrong_flags_of_xr_are_refused_before_a_runtime_is_asked() {
    for (flags, named) in [
        (&["builtin:fruit:16", "--check"][..], "--frames"),
        (&["builtin:fruit:16", "--frames", "0"], "--frames"),
        (&["builtin:fruit:16", "--method", "blur"], "--method"),
        (&[], "Usage"),
    ] {
        let (code, said) = xr(flags);
        assert!(code == Some(2) && said.contains(named), "{flags:?}: {said}");
    }
}
