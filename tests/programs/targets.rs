//! How the programs write their files, where the whole program is too long a way to see it.

use cao_cli::targets::Targets;
use std::fs;

#[test]
fn folders_are_made_with_their_files_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let targets = Targets::in_folder(&at("a/b"), ["c.csv".to_owned()]).unwrap();
    assert!(!at("a").exists(), "not before there is something in it");
    let failed = targets.write(|files| {
        files.write(&at("a/b/c.csv"), |file| file.write_all(b"1,2\n"))?;
        anyhow::bail!("the disk is full")
    });
    assert_eq!((failed.unwrap_err().to_string().as_str(), at("a").exists()), ("the disk is full", false));
    targets.write_all(&["1,2\n"]).unwrap();
    assert_eq!(fs::read(at("a/b/c.csv")).unwrap(), b"1,2\n");

    // Folders that were there stay.
    let targets = Targets::in_folder(&at("a/d"), ["c.csv".to_owned()]).unwrap();
    assert!(targets.write(|_| anyhow::bail!("no")).is_err());
    assert_eq!((at("a/d").exists(), at("a/b").exists()), (false, true));
}

/// The last look is the one that counts.
#[test]
fn a_file_that_was_read_meanwhile_is_spared() {
    let folder = tempfile::tempdir().unwrap();
    let [input, output] = ["input.csv", "output.csv"].map(|name| folder.path().join(name));
    fs::write(&input, "input").unwrap();
    let targets = Targets::files([&output], "csv").unwrap();
    targets.spare_inputs().unwrap();
    let written = targets.write(|files| {
        cao_formats::file::read_text(&input)?;
        fs::hard_link(&input, &output)?;
        Ok(files.write(&output, |file| file.write_all(b"output"))?)
    });
    assert!(written.unwrap_err().to_string().contains("would replace an input"));
    assert_eq!(fs::read(&output).unwrap(), b"input");
}
