//! Volumes as other programs read them: pydicom, GDCM (SimpleITK), tifffile, nibabel, on public files and on files of other
//! encoders. `tools/references` makes them and runs this; without `CAO_REFERENCES` a test says that it was skipped.

use std::fs;
use std::path::Path;

use super::places::along;
use cao_formats::Result;
use cao_model::volume::{Space, Volume};

/// Relative to the largest number of its kind: a header has some 16 digits, and others compute spacing from rounded positions.
const PLACE: f64 = 1e-5;

/// What one case says is wrong, if anything.
fn wrong(case: &Path) -> Option<String> {
    let text = fs::read_to_string(case.join("expected.toml")).unwrap();
    let expected: toml::Table = text.parse().unwrap();
    let input = case.join(expected["file"].as_str().unwrap());
    let found = match expected.get("series").and_then(|s| s.as_str()) {
        Some(series) => cao_formats::read_series(&input, series),
        None => cao_formats::read(&input),
    };
    let problem = match expected.get("refused") {
        Some(says) => refused(found, says.as_str().unwrap()),
        None => found.map_err(|e| e.to_string()).and_then(|volume| compare(&volume, &expected, case)),
    };
    problem.err().map(|problem| format!("{}: {problem}", case.file_name().unwrap().display()))
}

fn refused(found: Result<Volume>, says: &str) -> Result<(), String> {
    match found.map_err(|e| e.to_string()) {
        Ok(_) => Err(format!("was read, expected a refusal that says {says:?}")),
        Err(text) if text.contains(says) => Ok(()),
        Err(text) => Err(format!("{text:?} should say {says:?}")),
    }
}

fn compare(volume: &Volume, expected: &toml::Table, case: &Path) -> Result<(), String> {
    let numbers = |value: &toml::Value| -> Vec<f64> {
        let number = |v: &toml::Value| v.as_float().or(v.as_integer().map(|n| n as f64)).unwrap();
        value.as_array().unwrap().iter().map(number).collect()
    };
    let axes: Vec<f64> = expected["directions"].as_array().unwrap().iter().flat_map(numbers).collect();
    let found = along(volume, std::array::from_fn(|a| std::array::from_fn(|i| axes[3 * a + i])))?;
    let dims: Vec<f64> = found.dims.iter().map(|d| *d as f64).collect();
    let found_spacing = found.spacing.iter().fold(0.0f64, |m, x| m.max(*x));
    for (what, found, expected) in [
        ("dimensions", &dims[..], numbers(&expected["dims"])),
        ("spacing", &found.spacing, numbers(&expected["spacing"])),
        ("origin", &found.origin, numbers(&expected["origin"])),
    ] {
        // An origin at 0 is known as well as the distance to its neighbours.
        let least = if what == "origin" { found_spacing } else { 0.0 };
        let largest = expected.iter().fold(least, |m, x| m.max(x.abs()));
        if found.iter().zip(&expected).any(|(a, b)| (a - b).abs() > PLACE * largest) {
            return Err(format!("{what} {found:?}, expected {expected:?}"));
        }
    }
    let ras = volume.space == Space::Ras;
    if ras != expected["ras"].as_bool().unwrap() {
        return Err(format!("{:?}", volume.space));
    }
    let tolerance = expected["tolerance"].as_float().unwrap();
    let bytes = fs::read(case.join("values.f64")).unwrap();
    let values: Vec<f64> = bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    assert_eq!(values.len(), volume.len());
    let value = |i: usize| volume.value(found.order[i]);
    let off = |i: &usize| (value(*i) - values[*i]).abs() > tolerance;
    let count = (0..values.len()).filter(off).count();
    match (0..values.len()).find(off) {
        None => Ok(()),
        Some(i) => Err(format!(
            "{count} of {} values differ, first {} at {i}, expected {}",
            values.len(),
            value(i),
            values[i]
        )),
    }
}

#[test]
fn every_value_is_what_other_programs_read() {
    let Some(folder) = std::env::var_os("CAO_REFERENCES").filter(|folder| !folder.is_empty()) else {
        eprintln!("skipped: tools/references makes the volumes and runs this test");
        return;
    };
    let mut cases: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    cases.retain(|case| case.join("expected.toml").is_file());
    cases.sort();
    assert!(cases.len() > 100, "only {} cases", cases.len());
    let wrong: Vec<String> = cases.iter().filter_map(|case| wrong(case)).collect();
    assert!(wrong.is_empty(), "{} of {} cases:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
    eprintln!("{} cases, all equal", cases.len());
}
