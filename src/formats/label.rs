//! The features of a volume by a label map, a volume of whole numbers on its very grid, in any format that volumes have; or by values.
//!
//! Labels that no `[[feature]]` of [`FeatureSettings`] names are features of their own, as the map's header or the table calls and colours
//! them. Label 0 is none. Names and colours come from the keys `SegmentN_LabelValue`, `_Name` and `_Color` of NRRD files (3D Slicer's
//! `.seg.nrrd`), and from a table of text: `label name r g b [a]`, 0 to 255, as 3D Slicer's colour tables have it, or
//! `label r g b a visible mesh "name"`, a from 0 to 1, as ITK-SNAP's label descriptions; `#` begins a comment.

use crate::feature::{Entry, FeatureSettings, Of};
use crate::reading::Reading;
use crate::{Error, Result, file, listing, nrrd, volume};
use cao_model::error::{quoted, shown_path};
use cao_model::feature::{Feature, Features};
use cao_model::frame::Frame;
use cao_model::transfer::to_linear;
use cao_model::values::Values;
use cao_model::volume::{Space, Volume};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Spacings of one grid may differ by this share: what headers of five digits leave, a twentieth of a voxel in 512.
const SAME_SPACING: f64 = 1e-4;
/// Their first voxels may lie so many voxels apart, for the same reason.
const SAME_ORIGIN: f64 = 0.05;
/// Components of their axes' unit vectors may differ by this: a voxel in a thousand.
const SAME_DIRECTION: f64 = 1e-3;

/// Labels in a message.
const MOST_LISTED: usize = 12;

/// What a header or a table says of a label.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// What it is called.
    pub name: String,
    /// Linear red, green, blue.
    pub colour: Option<[f32; 3]>,
    /// What opacities are multiplied with.
    pub opacity: f32,
    /// Whether it shows.
    pub visible: bool,
}

impl FeatureSettings {
    /// The features of a volume in the order in which `frame` has it drawn, and warnings of reading.
    ///
    /// # Errors
    /// Those of reading; [`Error::File`] for a label map that is not of this grid or not of whole numbers, and for labels without a feature;
    /// [`cao_model::Error`] by the feature's name, as [`Features::check`], for labels that are not there or two features have.
    pub fn features(&self, volume: &Volume, frame: Frame) -> Result<(Features, Vec<String>)> {
        let Some(map) = &self.label else {
            let list = self.list.iter().map(by_values).collect::<Result<_>>()?;
            return Ok((Features::by_intervals(list)?, Vec::new()));
        };
        let opened = volume::read_as(&map.file, &Reading::default())?;
        let (labels, _) = frame.arrange(opened.volume)?;
        on_grid(&map.file, &labels, volume)?;
        let numbers = whole(&map.file, &labels)?;
        let mut segments = segments(&map.file)?;
        if let Some(table) = &map.table {
            segments.extend(
                table_of(&file::read_text(table)?)
                    .map_err(|(line, problem)| Error::file(table, &format!("line {line}"), problem))?,
            );
        }
        let (list, places) = self.assign(&map.file, &present(&numbers), &segments)?;
        Ok((Features::by_labels(list, volume.dims, numbered(&numbers, &places))?, opened.warnings))
    }

    /// The features, and the place in their list of each label.
    fn assign(
        &self,
        map: &Path,
        present: &BTreeSet<i64>,
        segments: &BTreeMap<i64, Segment>,
    ) -> Result<(Vec<Feature>, BTreeMap<i64, usize>)> {
        let (mut list, mut places) = (Vec::new(), BTreeMap::<i64, usize>::new());
        for (place, entry) in self.list.iter().enumerate() {
            let refuse = |problem: String| Err(Error::refused(&section(&entry.name), problem));
            let labels = match &entry.of {
                Of::Values(_) => {
                    return refuse("has values beside a label map; expected labels, or no label map".into());
                }
                Of::Rest => Vec::new(),
                Of::Labels(labels) => labels.clone(),
                Of::Named => {
                    let own = segments.iter().find(|(_, segment)| segment.name == entry.name);
                    match own {
                        Some((label, _)) => vec![*label],
                        None => {
                            let names = segments.values().map(|s| quoted(&s.name).to_string());
                            let names = listed(names, segments.len());
                            return refuse(format!(
                                "is no segment of {}, whose names are {names}; expected one of these, or labels = [...]",
                                shown_path(map)
                            ));
                        }
                    }
                }
            };
            for label in &labels {
                if *label == 0 {
                    return refuse("label 0 is that of no feature; expected others".into());
                }
                if !present.contains(label) {
                    let there = listed(present.iter().map(i64::to_string), present.len());
                    return refuse(format!(
                        "no voxel of {} has label {label}; there are {there}",
                        shown_path(map)
                    ));
                }
                if let Some(other) = places.insert(*label, place).filter(|other| *other != place) {
                    let other = section(&self.list[other].name);
                    return refuse(format!("label {label} belongs to {other} already; expected each once"));
                }
            }
            let of_one = labels.first().filter(|_| labels.len() == 1).and_then(|label| segments.get(label));
            list.push(entry.feature(of_one));
        }
        let left: Vec<i64> = present.iter().copied().filter(|label| !places.contains_key(label)).collect();
        if let Some(rest) = self.list.iter().position(|entry| entry.of == Of::Rest) {
            if left.is_empty() {
                let problem =
                    "has the rest of the labels, but others have all of them; expected one to be left";
                return Err(Error::refused(&section(&self.list[rest].name), problem));
            }
            places.extend(left.iter().map(|label| (*label, rest)));
            return Ok((list, places));
        }
        if list.len() + left.len() > Features::MOST {
            let problem = format!(
                "{} labels ({}) that no feature names, beside {} features; expected at most {} features in all: name several labels in \
                 one [[feature]] with labels = [...], the others with labels = \"rest\"",
                left.len(),
                listed(left.iter().map(i64::to_string), left.len()),
                list.len(),
                Features::MOST
            );
            return Err(Error::file(map, "labels", problem));
        }
        for label in left {
            places.insert(label, list.len());
            let segment = segments.get(&label);
            let name = segment.map_or_else(|| format!("label {label}"), |segment| segment.name.clone());
            list.push(Entry::named(name).feature(segment));
        }
        Ok((list, places))
    }
}

impl Entry {
    fn named(name: String) -> Self {
        Self { name, of: Of::Named, visible: None, opacity: None, colour: None, spared: false }
    }

    /// As it says itself, else as the header or the table does.
    fn feature(&self, segment: Option<&Segment>) -> Feature {
        Feature {
            visible: self.visible.unwrap_or(segment.is_none_or(|segment| segment.visible)),
            scale: self.opacity.unwrap_or(segment.map_or(1.0, |segment| segment.opacity)),
            colour: self.colour.or(segment.and_then(|segment| segment.colour)),
            spared: self.spared,
            ..Feature::new(&self.name)
        }
    }
}

fn by_values(entry: &Entry) -> Result<(Feature, [f32; 2])> {
    match entry.of {
        Of::Values(interval) => Ok((entry.feature(None), interval)),
        _ => Err(Error::refused(
            &section(&entry.name),
            "has no values; expected values = [from, up to], or a label map: label = \"FILE\", --label FILE",
        )),
    }
}

fn section(name: &str) -> String {
    format!("feature {}", quoted(name))
}

/// Some of a list.
fn listed(all: impl Iterator<Item = String>, count: usize) -> String {
    let mut some: Vec<String> = all.take(MOST_LISTED).collect();
    if some.is_empty() {
        return "none".into();
    }
    if count > some.len() {
        some.push("…".into());
    }
    some.join(", ")
}

/// Refuses a label map of another grid.
fn on_grid(path: &Path, labels: &Volume, volume: &Volume) -> Result<()> {
    let refuse = |field: &str, found: String, expected: String| {
        let problem = format!(
            "{found}; expected the volume's {expected}: a label map is of the very grid of its volume"
        );
        Err(Error::file(path, field, problem))
    };
    let dims = |[x, y, z]: [usize; 3]| format!("{x} × {y} × {z} voxels");
    if labels.dims != volume.dims {
        return refuse("dims", dims(labels.dims), dims(volume.dims));
    }
    let three = |[x, y, z]: [f64; 3]| format!("{x}, {y}, {z} mm");
    let near = |a: usize| (labels.spacing[a] - volume.spacing[a]).abs() <= SAME_SPACING * volume.spacing[a];
    if !(0..3).all(near) {
        return refuse("spacing", three(labels.spacing), three(volume.spacing));
    }
    if labels.space != volume.space {
        let says = |space| if space == Space::Ras { "a patient frame" } else { "no patient frame" };
        return refuse("space", format!("it states {}", says(labels.space)), says(volume.space).into());
    }
    let apart = (0..3).map(|a| (labels.origin[a] - volume.origin[a]).abs()).fold(0.0, f64::max);
    if apart > SAME_ORIGIN * volume.min_spacing() {
        return refuse("origin", three(labels.origin), three(volume.origin));
    }
    let turned = labels.directions.iter().flatten().zip(volume.directions.iter().flatten());
    if turned.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) > SAME_DIRECTION {
        return refuse("directions", format!("{:?}", labels.directions), format!("{:?}", volume.directions));
    }
    Ok(())
}

/// The labels of a volume of whole numbers.
fn whole(path: &Path, labels: &Volume) -> Result<Vec<i64>> {
    let refuse = |problem: String| {
        let expected = "expected whole numbers, of type uint8 to int64, as they are";
        Err(Error::file(path, "type", format!("{problem}; {expected}")))
    };
    if (labels.slope, labels.intercept) != (1.0, 0.0) {
        return refuse(format!("values are rescaled by {} and {}", labels.slope, labels.intercept));
    }
    Ok(match &labels.values {
        Values::U8(v) => v.iter().map(|v| i64::from(*v)).collect(),
        Values::I8(v) => v.iter().map(|v| i64::from(*v)).collect(),
        Values::U16(v) => v.iter().map(|v| i64::from(*v)).collect(),
        Values::I16(v) => v.iter().map(|v| i64::from(*v)).collect(),
        Values::U32(v) => v.iter().map(|v| i64::from(*v)).collect(),
        Values::I32(v) => v.iter().map(|v| i64::from(*v)).collect(),
        // Beyond, no two labels are one.
        Values::U64(v) => v.iter().map(|v| *v as i64).collect(),
        Values::I64(v) => v.clone(),
        Values::F32(_) | Values::F64(_) => return refuse(labels.values.kind().into()),
    })
}

/// The labels that there are, without 0.
fn present(labels: &[i64]) -> BTreeSet<i64> {
    let (mut found, mut last) = (BTreeSet::new(), 0);
    for label in labels {
        // Most voxels are as the one before.
        if *label != last {
            last = *label;
            if last != 0 {
                found.insert(last);
            }
        }
    }
    found
}

/// The number of each voxel's feature, by its label's place in the list.
fn numbered(labels: &[i64], places: &BTreeMap<i64, usize>) -> Vec<u8> {
    let (mut last, mut number) = (0, 0);
    let of = |label: &i64| {
        if *label != last {
            last = *label;
            number = places.get(label).map_or(0, |place| *place as u8 + 1);
        }
        number
    };
    labels.iter().map(of).collect()
}

/// What a file says of its labels; nothing, where it is no NRRD.
///
/// # Errors
/// Those of reading.
pub fn segments(path: &Path) -> Result<BTreeMap<i64, Segment>> {
    if !path.is_file() || !nrrd::is_nrrd(&listing::head(path)?) {
        return Ok(BTreeMap::new());
    }
    let keys: BTreeMap<String, String> = nrrd::keys(path)?.into_iter().collect();
    let mut segments = BTreeMap::new();
    for (key, value) in &keys {
        let Some(prefix) = key.strip_prefix("Segment").and_then(|rest| rest.strip_suffix("_LabelValue"))
        else {
            continue;
        };
        let of = |what: &str| keys.get(&format!("Segment{prefix}_{what}")).map(|text| text.trim());
        let label: i64 = value
            .trim()
            .parse()
            .map_err(|_| Error::file(path, key, format!("{}, expected a whole number", quoted(value))))?;
        let colour = of("Color").map(|text| {
            let three = text.split_whitespace().map(|c| c.parse().ok()).collect::<Option<Vec<f64>>>();
            let three: Option<[f64; 3]> = three.and_then(|three| three.try_into().ok());
            three.filter(|c| c.iter().all(|c| (0.0..=1.0).contains(c))).ok_or_else(|| {
                let problem = format!("{}, expected three numbers from 0 to 1", quoted(text));
                Error::file(path, &format!("Segment{prefix}_Color"), problem)
            })
        });
        let colour = colour.transpose()?.map(|srgb| srgb.map(to_linear));
        let name = of("Name").filter(|name| !name.is_empty()).map(str::to_owned);
        let name = name.unwrap_or_else(|| format!("label {label}"));
        segments.insert(label, Segment { name, colour, opacity: 1.0, visible: true });
    }
    Ok(segments)
}

/// A table of labels; or the line that is wrong, and what is.
fn table_of(text: &str) -> Result<BTreeMap<i64, Segment>, (usize, String)> {
    let mut segments = BTreeMap::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let (label, segment) = row(line).ok_or_else(|| {
            let expected = "expected label name r g b [a] with numbers from 0 to 255, or label r g b a visible mesh \"name\"";
            (i + 1, format!("{}, {expected}", quoted(line)))
        })?;
        if segments.insert(label, segment).is_some() {
            return Err((i + 1, format!("label {label} is there twice, expected each once")));
        }
    }
    Ok(segments)
}

fn row(line: &str) -> Option<(i64, Segment)> {
    let byte = |text: &str| text.parse().ok().filter(|c: &f64| (0.0..=255.0).contains(c)).map(|c| c / 255.0);
    let colour = |words: &[&str]| -> Option<[f32; 3]> {
        let three: Vec<f64> = words.iter().map(|word| byte(word)).collect::<Option<_>>()?;
        Some(<[f64; 3]>::try_from(three).ok()?.map(to_linear))
    };
    // A name in quotes may have white space in it.
    let (before, name, after) = match line.split_once('"') {
        Some((before, rest)) => {
            let (name, after) = rest.split_once('"')?;
            (before, Some(name), after)
        }
        None => (line, None, ""),
    };
    let mut words: Vec<&str> = before.split_whitespace().collect();
    let label = words.first()?.parse().ok()?;
    if let (Some(name), 7) = (name, words.len()) {
        // As ITK-SNAP writes it.
        let opacity = words[4].parse().ok().filter(|a: &f32| (0.0..=1.0).contains(a))?;
        let visible = words[5] != "0";
        let segment = Segment { name: name.into(), colour: Some(colour(&words[1..4])?), opacity, visible };
        return after.trim().is_empty().then_some((label, segment));
    }
    words.extend(name);
    words.extend(after.split_whitespace());
    let opacity = match words.len() {
        5 => 1.0,
        6 => byte(words[5])? as f32,
        _ => return None,
    };
    let segment =
        Segment { name: words[1].into(), colour: Some(colour(&words[2..5])?), opacity, visible: true };
    Some((label, segment))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_both_tables() {
        let slicer = row("2 liver 221 130 101 255").unwrap();
        assert_eq!((slicer.0, slicer.1.name.as_str(), slicer.1.opacity), (2, "liver", 1.0));
        assert_eq!(row("2 liver 221 130 101").unwrap().1.colour, slicer.1.colour);
        assert_eq!(row("7 \"left lung\" 0 0 255 51").unwrap().1.name, "left lung");
        let snap = row("3    0  0  255  0.5  0  1    \"right lung\"").unwrap();
        assert_eq!((snap.0, snap.1.name.as_str()), (3, "right lung"));
        assert_eq!((snap.1.opacity, snap.1.visible, snap.1.colour), (0.5, false, Some([0.0, 0.0, 1.0])));
        for wrong in [
            "liver",
            "1 liver",
            "1 liver 1 2 256",
            "1 liver 1 2 3 4 5",
            "x liver 1 2 3",
            "1 0 0 0 2 1 1 \"a\"",
        ] {
            assert!(row(wrong).is_none(), "{wrong}");
        }
        assert_eq!(table_of("# none\n\n1 a 0 0 0\n1 b 0 0 0\n").unwrap_err().0, 4);
        assert!(table_of("1 a 0 0\n").unwrap_err().1.contains("label name r g b"));
    }
}
