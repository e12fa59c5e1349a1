//! Transfer functions as TOML.
//!
//! # File format
//! TOML. Values ascend; colours are sRGB, as `"#rrggbb"` or three numbers from 0 to 1; `colour` alone may be a single
//! colour. Unknown keys and impossible numbers are refused by name.
//!
//! ```
//! let transfer = cao_formats::transfer::from_toml(
//!     r##"
//!     reference_mm = 1.0        # length that the opacities are meant for; without it the smallest spacing
//!     opacity = [[150, 0.0], [300, 0.4], [1500, 0.95]]
//!     colour = [[150, "#b5653b"], [300, [0.91, 0.84, 0.69]], [1500, "#fff8ec"]]
//!     "##,
//! )?;
//! assert_eq!(transfer.opacity_at(225.0), 0.2);
//! # Ok::<(), cao_formats::Error>(())
//! ```

use crate::toml_value::{in_line, number, parse_colour, shown};
use crate::{Error, Result, file};
use cao_model::error::quoted;
use cao_model::transfer::{TransferFunction, coloured, preset_names, to_srgb};
use serde::Deserialize;
use std::fmt::Write as _;
use std::path::Path;
use toml::Value;

/// Reads the TOML text described at the [module](self).
///
/// # Errors
/// [`Error::Model`] naming the key, what it holds and what would do.
pub fn from_toml(text: &str) -> Result<TransferFunction> {
    let table: toml::Table =
        toml::from_str(text).map_err(|error| Error::refused("transfer function", in_line(text, &error)))?;
    from_table(table)
}

/// As [`from_toml`], from a table that is part of another file (a scene).
///
/// # Errors
/// As [`from_toml`].
pub fn from_table(table: toml::Table) -> Result<TransferFunction> {
    let file: Keys =
        table.try_into().map_err(|error: toml::de::Error| Error::refused("keys", error.message()))?;
    let opacity = list("opacity", &file.opacity)?
        .iter()
        .enumerate()
        .map(|(i, entry)| {
            let key = format!("opacity[{i}]");
            let expected = || Error::refused(&key, format!("{}: expected [value, opacity]", shown(entry)));
            let (value, opacity) = pair(entry).ok_or_else(expected)?;
            Ok([value as f32, number(opacity).ok_or_else(expected)? as f32])
        })
        .collect::<Result<_>>()?;
    let colour = match &file.colour {
        single @ Value::String(_) => vec![coloured(0.0, parse_colour("colour", single)?)],
        Value::Array(three) if three.len() == 3 && three.iter().all(|c| number(c).is_some()) => {
            vec![coloured(0.0, parse_colour("colour", &file.colour)?)]
        }
        points => list("colour", points)?
            .iter()
            .enumerate()
            .map(|(i, entry)| {
                let key = format!("colour[{i}]");
                let expected = || Error::refused(&key, format!("{}: expected [value, colour]", shown(entry)));
                let (value, colour) = pair(entry).ok_or_else(expected)?;
                Ok(coloured(value as f32, parse_colour(&key, colour)?))
            })
            .collect::<Result<_>>()?,
    };
    let reference_mm = match &file.reference_mm {
        None => None,
        Some(value) => {
            let expected =
                || Error::refused("reference_mm", format!("{}: expected a length > 0 mm", shown(value)));
            Some(number(value).ok_or_else(expected)? as f32)
        }
    };
    Ok(TransferFunction::new(opacity, colour, reference_mm)?)
}

/// `spec` is the name of a [preset](TransferFunction::preset) (for data over `range`) or the path of a TOML file.
///
/// # Errors
/// [`Error::Model`] when it is neither; [`Error::File`] naming file and key when the file is wrong;
/// [`Error::Io`] when it cannot be read.
pub fn load(spec: impl AsRef<Path>, range: (f64, f64)) -> Result<TransferFunction> {
    let path = spec.as_ref();
    if let Some(name) = path.to_str().filter(|name| TransferFunction::is_preset(name)) {
        return Ok(TransferFunction::preset(name, range)?);
    }
    if !path.exists() {
        let problem = format!(
            "{} is neither a file nor a preset ({})",
            quoted(&path.to_string_lossy()),
            preset_names()
        );
        return Err(Error::refused("transfer", problem));
    }
    read(path)
}

/// Reads a TOML file.
///
/// # Errors
/// [`Error::Io`] when it cannot be read; [`Error::File`] naming file and key when it is wrong or too long.
pub fn read(path: &Path) -> Result<TransferFunction> {
    let text = file::read_text(path)?;
    from_toml(&text).map_err(|error| error.in_file(path))
}

/// The TOML text that [`from_toml`] reads back to an equal transfer function.
pub fn to_toml(transfer: &TransferFunction) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    if let Some(mm) = transfer.reference_mm {
        let _ = writeln!(text, "reference_mm = {mm:?}");
    }
    text += "opacity = [\n";
    for [value, opacity] in &transfer.opacity {
        let _ = writeln!(text, "    [{value:?}, {opacity:?}],");
    }
    text += "]\ncolour = [\n";
    for &[value, r, g, b] in &transfer.colour {
        let [r, g, b] = [r, g, b].map(to_srgb);
        let _ = writeln!(text, "    [{value:?}, [{r:?}, {g:?}, {b:?}]],");
    }
    text + "]\n"
}

/// The file's keys. What they hold stays TOML, so that errors can say which key and which point is wrong.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    reference_mm: Option<Value>,
    opacity: Value,
    #[serde(alias = "color")]
    colour: Value,
}

fn list<'a>(key: &str, value: &'a Value) -> Result<&'a [Value]> {
    value
        .as_array()
        .map(Vec::as_slice)
        .ok_or_else(|| Error::refused(key, format!("{}: expected a list of [value, {key}]", shown(value))))
}

/// `[number, anything]`.
fn pair(entry: &Value) -> Option<(f64, &Value)> {
    match entry.as_array()?.as_slice() {
        [value, other] => Some((number(value)?, other)),
        _ => None,
    }
}
