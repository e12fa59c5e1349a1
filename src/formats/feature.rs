//! Features as scene files and flags have them: by intervals of values, or by a label map, a volume of whole numbers on the very grid of
//! the volume, in any format that volumes have.
//!
//! ```
//! let scene = cao_formats::Scene::from_toml(
//!     r##"
//!     volume = "builtin:fruit:96"
//!     ## label = "seg.nrrd"             # a label map; or with a table of names and colours: { file = "seg.nii.gz", table = "names.txt" }
//!
//!     [[feature]]                      # none, or up to eight
//!     name = "core"
//!     values = [160, 190]              # from the first up to the second, which does not belong to it; with a label map instead:
//!     ## labels = [3, 4]                # these; or "rest", all that no other feature has; without it the segment of this name
//!     visible = true
//!     opacity = 0.5                    # opacities times this, 0 to 16, at most 1
//!     colour = "#c0522b"               # default: the segment's, else the transfer function's
//!     spared = true                    # clips leave it whole
//!     "##,
//!     std::path::Path::new("."),
//! )?;
//! assert_eq!(scene.features.list.len(), 1);
//! # Ok::<(), cao_formats::Error>(())
//! ```
//!
//! What follows from that for a volume, and what label maps are: [`label`](crate::label).

use crate::toml_value::{in_line, number, parse_colour, shown};
use crate::{Error, Result, file};
use cao_model::error::shown_path;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use toml::Value;

/// The features of a scene, before its volume is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FeatureSettings {
    /// Which voxels are whose.
    pub label: Option<LabelMap>,
    /// How they are shown.
    pub list: Vec<Entry>,
}

/// A volume of labels.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelMap {
    /// The volume.
    pub file: PathBuf,
    /// Names and colours of labels, beside what the volume's own header says.
    pub table: Option<PathBuf>,
}

/// What is said of a feature.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// What it is called.
    pub name: String,
    /// Whose voxels it has.
    pub of: Of,
    /// Whether it shows; `None`: as the table says.
    pub visible: Option<bool>,
    /// What opacities are multiplied with; `None`: as the table says.
    pub opacity: Option<f32>,
    /// Linear red, green, blue; `None`: as the header or the table says.
    pub colour: Option<[f32; 3]>,
    /// Whether clips leave it whole.
    pub spared: bool,
}

/// Whose voxels a feature has.
#[derive(Clone, Debug, PartialEq)]
pub enum Of {
    /// Those of values from the first up to the second.
    Values([f32; 2]),
    /// Those of these labels.
    Labels(Vec<i64>),
    /// Those of all labels that no other feature has.
    Rest,
    /// Those of the segment of its name.
    Named,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FeatureFile {
    name: Option<String>,
    values: Option<Value>,
    labels: Option<Value>,
    visible: Option<bool>,
    opacity: Option<f64>,
    #[serde(alias = "color")]
    colour: Option<Value>,
    spared: Option<bool>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LabelFile {
    file: PathBuf,
    table: Option<PathBuf>,
}

/// The keys of features in a file that may be a scene.
#[derive(Deserialize)]
struct Keys {
    label: Option<Value>,
    #[serde(default)]
    feature: Vec<toml::Table>,
}

impl FeatureSettings {
    /// The keys `label` and `[[feature]]` of a TOML file, which may be a scene; others are not looked at.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::File`] naming file, key, what was found and what would do.
    pub fn load(path: &Path) -> Result<Self> {
        let text = file::read_text(path)?;
        let keys: Keys =
            toml::from_str(&text).map_err(|error| Error::file(path, "features", in_line(&text, &error)))?;
        let base = path.parent().unwrap_or(Path::new("."));
        Self::from_keys(keys.label, keys.feature, base).map_err(|error| error.in_file(path))
    }

    /// From what a scene has under these keys; paths are relative to `base`.
    pub(crate) fn from_keys(label: Option<Value>, list: Vec<toml::Table>, base: &Path) -> Result<Self> {
        let label = match label {
            None => None,
            Some(Value::String(file)) => {
                Some(LabelMap { file: existing("label", base, Path::new(&file))?, table: None })
            }
            Some(Value::Table(table)) => {
                let label: LabelFile = table
                    .try_into()
                    .map_err(|error: toml::de::Error| Error::refused("label", error.message()))?;
                let table = label.table.map(|table| existing("label.table", base, &table)).transpose()?;
                Some(LabelMap { file: existing("label.file", base, &label.file)?, table })
            }
            Some(other) => {
                let problem = format!("{}: expected a file, or a table with file and table", shown(&other));
                return Err(Error::refused("label", problem));
            }
        };
        let list = list.into_iter().enumerate();
        let list = list.map(|(i, table)| entry(&format!("feature[{i}]"), table)).collect::<Result<_>>()?;
        Ok(Self { label, list })
    }
}

fn existing(key: &str, base: &Path, path: &Path) -> Result<PathBuf> {
    let path = base.join(path);
    match path.exists() {
        true => Ok(path),
        false => Err(Error::refused(key, format!("there is no file {}", shown_path(&path)))),
    }
}

fn entry(key: &str, table: toml::Table) -> Result<Entry> {
    let file: FeatureFile =
        table.try_into().map_err(|error: toml::de::Error| Error::refused(key, error.message()))?;
    let name = file.name.ok_or_else(|| Error::refused(key, "has no name; expected name = \"...\""))?;
    let key = |name: &str| format!("{key}.{name}");
    let of = match (&file.values, &file.labels) {
        (Some(values), None) => {
            let two = values.as_array().and_then(|a| a.iter().map(number).collect::<Option<Vec<f64>>>());
            let two: Option<[f64; 2]> = two.and_then(|two| two.try_into().ok());
            let expected = || {
                let problem = format!("{}: expected two numbers, [from, up to]", shown(values));
                Error::refused(&key("values"), problem)
            };
            Of::Values(two.ok_or_else(expected)?.map(|value| value as f32))
        }
        (None, Some(Value::String(rest))) if rest == "rest" => Of::Rest,
        (None, Some(labels)) => {
            let list = match labels {
                Value::Array(list) => list.iter().map(Value::as_integer).collect(),
                one => one.as_integer().map(|label| vec![label]),
            };
            let list = list.filter(|list: &Vec<i64>| !list.is_empty()).ok_or_else(|| {
                let problem = format!("{}: expected whole numbers, at least one, or \"rest\"", shown(labels));
                Error::refused(&key("labels"), problem)
            })?;
            Of::Labels(list)
        }
        (None, None) => Of::Named,
        (Some(_), Some(_)) => {
            return Err(Error::refused(&key("labels"), "has no effect beside values; expected one of both"));
        }
    };
    let colour = file.colour.map(|colour| parse_colour(&key("colour"), &colour)).transpose()?;
    Ok(Entry {
        name,
        of,
        visible: file.visible,
        opacity: file.opacity.map(|share| share as f32),
        colour,
        spared: file.spared.unwrap_or(false),
    })
}
