//! What tables of the scene file have in common: poses, lengths, names of files.

use crate::toml_value::{number, shown};
use crate::{Error, Result};
use cao_model::clip::Pose;
use cao_model::error::shown_path;
use glam::Vec3;
use std::path::{Path, PathBuf};
use toml::Value;

/// The pose that the keys `translate_mm`, `rotate_deg` and `scale` of the table `key` give.
pub(crate) fn pose(
    key: &str,
    translate_mm: Option<[f64; 3]>,
    rotate_deg: Option<[f64; 3]>,
    scale: Option<&Value>,
) -> Result<Pose> {
    let mut pose = Pose::default();
    // One at a time, so that a refusal is under the key that caused it.
    let mut checked = |name: &str, set: &dyn Fn(&mut Pose)| {
        set(&mut pose);
        pose.check().map_err(|error| Error::from(error).renamed(&format!("{key}.{name}")))
    };
    if let Some(mm) = translate_mm {
        checked("translate_mm", &|pose| pose.translate_mm = vector(mm))?;
    }
    if let Some(degrees) = rotate_deg {
        checked("rotate_deg", &|pose| pose.rotate_deg = vector(degrees))?;
    }
    if let Some(value) = scale {
        let factors = match value {
            Value::Array(axes) => axes.iter().map(number).collect::<Option<Vec<f64>>>(),
            single => number(single).map(|factor| vec![factor; 3]),
        };
        let factors: Option<[f64; 3]> = factors.and_then(|axes| axes.try_into().ok());
        let expected = || {
            Error::refused(
                &format!("{key}.scale"),
                format!("{}: expected a number > 0 or three", shown(value)),
            )
        };
        let factors = factors.ok_or_else(expected)?;
        checked("scale", &|pose| pose.scale = vector(factors))?;
    }
    Ok(pose)
}

/// A length in mm that an f32 can hold: > 0, or >= 0 where `zero` may be.
pub(crate) fn length(key: &str, mm: Option<f64>, zero: bool) -> Result<()> {
    match mm {
        Some(mm) if !((mm as f32).is_finite() && mm >= 0.0 && (zero || mm as f32 > 0.0)) => Err(
            Error::refused(key, format!("{mm}: expected a length {} 0 mm", if zero { ">=" } else { ">" })),
        ),
        _ => Ok(()),
    }
}

/// A file that is there, relative to the scene's folder.
pub(crate) fn existing(key: &str, base: &Path, path: &Path) -> Result<PathBuf> {
    let path = base.join(path);
    match path.exists() {
        true => Ok(path),
        false => Err(Error::refused(key, format!("there is no file {}", shown_path(&path)))),
    }
}

/// A vector as the program computes with it.
pub(crate) fn vector(of: [f64; 3]) -> Vec3 {
    Vec3::from_array(of.map(|c| c as f32))
}
