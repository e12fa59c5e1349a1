//! Flags that the programs share, and what they mean.

use anyhow::{Context, Result};
use cao::renderer::Renderer;
use cao_formats::feature::{FeatureSettings, LabelMap};
use cao_formats::scene::VolumeSource;
use cao_formats::{NoNumbers, Reading};
use cao_model::METHODS;
use cao_model::clip::Shape;
use cao_model::error::shown_path;
use cao_model::feature::Features;
use cao_model::frame::Frame;
use cao_model::light::{AmbientLight, LIGHTS, Lights};
use cao_model::methods::{Entry, Method};
use cao_model::network::Network;
use cao_model::occlusion::{Quadrature, RaySet};
use cao_model::options::{KEYS, Key, Options};
use cao_model::settings::{Scope, Setup};
use cao_model::transfer::TransferFunction;
use cao_model::values::Endian;
use cao_model::volume::Volume;
use clap::Args;
use std::ffi::{OsStr, OsString};
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

/// Flags that contradict each other, beyond what the parser of the command line can tell: exit code 2.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Usage(String);

/// A [`Usage`] error.
pub fn usage(problem: impl Into<String>) -> anyhow::Error {
    Usage(problem.into()).into()
}

/// Flags of every command.
#[derive(Args)]
pub struct Global {
    /// Device to use: its number or part of its name, as `cao devices` lists them [env: CAO_DEVICE]
    #[arg(long, global = true, help_heading = "Everywhere")]
    pub device: Option<String>,
    /// Run under the Vulkan validation layer and fail if it reports anything [env: CAO_VALIDATION=1]
    #[arg(long, global = true, help_heading = "Everywhere")]
    pub validate: bool,
    /// Print one JSON object instead of text
    #[arg(long, global = true, help_heading = "Everywhere")]
    pub json: bool,
}

/// How to read a file that holds nothing but values.
#[derive(Args)]
#[command(next_help_heading = "Raw data")]
pub struct Raw {
    /// The input is raw values: voxels along x, y, z, x fastest
    #[arg(long, value_name = "X,Y,Z", value_parser = dims, requires = "kind")]
    pub dims: Option<[usize; 3]>,
    /// Type of the values, such as uint8, int16, float32
    #[arg(long = "type", value_name = "TYPE", requires = "dims")]
    pub kind: Option<String>,
    /// Distance of voxel centres in mm [default: 1,1,1]
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<f64>, allow_hyphen_values = true, requires = "dims")]
    pub spacing: Option<[f64; 3]>,
    /// Order of a value's bytes: little or big [default: little]
    #[arg(long, value_name = "ORDER", value_parser = endian, requires = "dims")]
    pub endian: Option<Endian>,
    /// The DICOM series to read where a folder has several: its number in the list that is then printed, or its UID
    #[arg(long, value_name = "N|UID", conflicts_with = "dims", help_heading = "DICOM")]
    pub series: Option<String>,
    /// What the file leaves open.
    #[command(flatten)]
    pub choices: Choices,
}

/// What a volume file leaves open.
#[derive(Args)]
#[command(next_help_heading = "Reading")]
pub struct Choices {
    /// Which volume of a series (4D NIfTI, NRRD, MetaImage), from 0
    #[arg(long, value_name = "N")]
    pub frame_index: Option<u64>,
    /// What stands for voxels that are NaN, infinite or beyond 8.5e37 (the largest numbers stand for no data in many files): a value, or
    /// transparent, a value that the transfer function gives opacity 0
    #[arg(long, value_name = "VALUE|transparent", value_parser = no_numbers, allow_hyphen_values = true)]
    pub nan: Option<NoNumbers>,
}

impl Choices {
    /// These, and where they say nothing the `other` ones.
    pub fn or(&self, other: Reading) -> Reading {
        Reading {
            frame_index: self.frame_index.or(other.frame_index),
            no_numbers: self.nan.unwrap_or(other.no_numbers),
        }
    }
}

fn no_numbers(text: &str) -> Result<NoNumbers, String> {
    NoNumbers::parse(text).ok_or_else(|| "expected a number or transparent".into())
}

/// Parts of the volume that are shown each for itself.
#[derive(Args)]
#[command(next_help_heading = "Features")]
pub struct Parts {
    /// Label map: a volume of whole numbers on the very grid of the input, 0 none, each other label a feature, 8 at most; names and colours
    /// by the header of a .seg.nrrd
    #[arg(long, value_name = "FILE")]
    pub label: Option<PathBuf>,
    /// Names and colours of its labels: lines of text, label name r g b, 0 to 255, or label descriptions of ITK-SNAP
    #[arg(long, value_name = "FILE", requires = "label")]
    pub label_table: Option<PathBuf>,
    /// Parts by a file.
    #[arg(
        long,
        value_name = "FILE.toml",
        help = "Features by a TOML file with the keys label and [[feature]]; a scene file is one [default: those of the scene]"
    )]
    pub features: Option<PathBuf>,
}

impl Parts {
    /// What the flags say, else what the scene does; a label map by its flag takes the place of the other.
    pub fn settings(&self, scene: FeatureSettings) -> Result<FeatureSettings> {
        let mut settings = match &self.features {
            Some(path) => FeatureSettings::load(path)?,
            None => scene,
        };
        if let Some(file) = &self.label {
            settings.label = Some(LabelMap { file: file.clone(), table: self.label_table.clone() });
        }
        Ok(settings)
    }

    /// The features of a volume, in the order in which `frame` has it; prints warnings.
    pub fn of(&self, scene: FeatureSettings, volume: &Volume, frame: Frame) -> Result<Features> {
        let (features, warnings) = self.settings(scene)?.features(volume, frame)?;
        warnings.iter().for_each(|warning| crate::say(&format!("warning: {warning}")));
        Ok(features)
    }
}

/// How occlusion is computed.
#[derive(Args)]
#[command(next_help_heading = "Occlusion")]
pub struct Settings {
    /// Opacity and colour of values: auto, ct-bone, ct-soft, mr, paper, or a TOML file [default: auto]
    #[arg(long, value_name = "FILE|PRESET")]
    pub transfer: Option<OsString>,
    /// Ray set.
    #[arg(long, value_name = "SET", value_parser = |s: &str| RaySet::parse(s), help = rays_help())]
    pub rays: Option<RaySet>,
    /// Rule along a ray.
    #[arg(long, value_name = "RULE", value_parser = |s: &str| Quadrature::parse(s), help = quadrature_help())]
    pub quadrature: Option<Quadrature>,
    /// Length of the rays in mm [default: 20 times the smallest spacing]
    #[arg(long, value_name = "R", value_parser = length, allow_hyphen_values = true)]
    pub radius_mm: Option<f32>,
    /// Distance from the voxel's centre in mm at which they start [default: half a step]
    #[arg(long, value_name = "O", value_parser = length, allow_hyphen_values = true)]
    pub offset_mm: Option<f32>,
    /// Distance in mm between their samples [default: the smallest spacing]
    #[arg(long, value_name = "S", value_parser = positive, allow_hyphen_values = true)]
    pub step_mm: Option<f32>,
    /// Where ambient light comes from.
    #[arg(long, value_name = "LIGHT", value_parser = |s: &str| AmbientLight::parse(s), allow_hyphen_values = true, help = light_help())]
    pub ambient_light: Option<AmbientLight>,
    /// What single methods take beside.
    #[arg(long = "option", value_name = "NAME=VALUE", value_parser = option, help = options_help())]
    pub options: Vec<(String, String)>,
    /// Weight file of another network for method dvao, as tools/train writes it [default: the one that is built in]
    #[arg(long, value_name = "FILE", value_parser = network)]
    pub network: Option<Network>,
}

/// A weight file.
///
/// # Errors
/// What is wrong with it, for who reads the command line.
pub fn network(path: &str) -> Result<Network, String> {
    Ok(cao_formats::network::load(Path::new(path)).map_err(|error| error.to_string())?.network)
}

fn option(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE")?;
    // Whether it is one, and takes this.
    Options::default().set(name, value).map_err(|error| error.to_string())?;
    Ok((name.to_owned(), value.to_owned()))
}

fn options_help() -> String {
    let of = |key: &Key| {
        let takers = METHODS.iter().filter(|entry| entry.options.contains(&key.name));
        let takers: Vec<&str> = takers.map(|entry| entry.name).collect();
        let default = Options::DEFAULT.value(key.name).unwrap_or_default();
        format!("{} of {}: {} [default: {default}]", key.name, takers.join(", "), key.takes)
    };
    format!("What single methods take beside; again for each. {}", KEYS.each_ref().map(of).join("; "))
}

impl Settings {
    /// Gives a renderer the network that is asked for.
    ///
    /// # Errors
    /// As [`Renderer::set_network`].
    pub fn give_network(&self, renderer: &mut Renderer) -> cao::Result<()> {
        self.network.clone().map_or(Ok(()), |network| renderer.set_network(network))
    }

    /// These options with what is asked for.
    pub fn options(&self, mut options: Options) -> cao_model::Result<Options> {
        self.options.iter().try_for_each(|(name, value)| options.set(name, value))?;
        Ok(options)
    }
}

fn rays_help() -> String {
    let defaults = by_method(|entry| entry.rays.name());
    format!(
        "Ray set: 6, 14, 26, 54 with equal weights as in the paper; 14w, 26w, 50w weighted; spiral:N for any even N up to {} [default: {defaults}]",
        RaySet::MOST
    )
}

fn light_help() -> String {
    let takers = METHODS.iter().filter(|entry| entry.lights > Lights::Uniform);
    let takers = takers.map(|entry| match entry.lights {
        Lights::Coloured => format!("{}, in colours", entry.name),
        _ => entry.name.to_owned(),
    });
    format!(
        "Where ambient light comes from: {LIGHTS} [default: uniform; others with methods {}]",
        takers.collect::<Vec<_>>().join(", ")
    )
}

fn quadrature_help() -> String {
    let rules =
        by_method(|entry| entry.quadratures.iter().map(|rule| rule.name()).collect::<Vec<_>>().join(", "));
    format!("Rule along a ray, left being the paper's sum [default: the method's first; {rules}]")
}

/// Every method and what it does, for a flag's help.
pub fn methods_help() -> String {
    by_method(|entry| entry.what.into())
}

/// What there is to say of every method, once for those of which it is the same.
fn by_method(say: impl Fn(&Entry) -> String) -> String {
    let mut said: Vec<(Vec<&str>, String)> = Vec::new();
    for entry in METHODS {
        let text = say(entry);
        match said.iter_mut().find(|(_, same)| *same == text) {
            Some((names, _)) => names.push(entry.name),
            None => said.push((vec![entry.name], text)),
        }
    }
    let clauses = said.iter().map(|(names, text)| format!("{}: {text}", names.join(", ")));
    clauses.collect::<Vec<_>>().join("; ")
}

impl Raw {
    /// A flag that says what the volume is; a scene says that itself.
    pub fn given(&self) -> Option<&'static str> {
        self.dims.map(|_| "--dims").or(self.series.as_ref().map(|_| "--series"))
    }

    /// What the user means by the name of a volume.
    pub fn source(&self, input: &OsStr) -> Result<VolumeSource> {
        let source = VolumeSource::parse(input);
        match (self.dims, &self.kind, source) {
            (Some(dims), Some(kind), VolumeSource::File(path)) => Ok(VolumeSource::Raw {
                path,
                dims,
                kind: kind.clone(),
                spacing_mm: self.spacing.unwrap_or([1.0; 3]),
                big_endian: self.endian == Some(Endian::Big),
            }),
            (Some(_), ..) => Err(usage(format!("--dims: {} has dimensions of its own", shown_path(input)))),
            (None, _, VolumeSource::File(path)) => Ok(match &self.series {
                Some(series) => VolumeSource::Series { path, series: series.clone() },
                None => VolumeSource::File(path),
            }),
            (None, ..) if self.series.is_some() => {
                Err(usage(format!("--series: {} has no DICOM series", shown_path(input))))
            }
            (None, _, source) => Ok(source),
        }
    }

    /// Opens a volume by the name that the user gave.
    pub fn open(&self, input: &OsStr) -> Result<Volume> {
        open(&self.source(input)?, self.choices.or(Reading::default()), input)
    }
}

/// The volume of a scene that is to have one.
pub fn volume_of<'a>(scene: &'a cao_formats::Scene, input: &OsStr) -> Result<&'a VolumeSource> {
    scene.volume.as_ref().ok_or_else(|| {
        usage(format!(
            "{}: a scene of meshes without a volume; expected one with the key volume",
            shown_path(input)
        ))
    })
}

/// Opens a volume and prints its warnings; errors name `input`, also where the library knows of no file.
pub fn open(source: &VolumeSource, reading: Reading, input: &OsStr) -> Result<Volume> {
    let opened = match source.open(&reading) {
        Err(error @ cao_formats::Error::Model(_)) => Err(error).with_context(|| shown_path(input))?,
        other => other?,
    };
    opened.warnings.iter().for_each(|warning| crate::say(&format!("warning: {warning}")));
    Ok(opened.volume)
}

/// The transfer function of a volume, of which voxels that hold no number get a value without opacity where the user asked for that;
/// errors name `input`, also where the library knows of no file.
pub fn transfer(
    loaded: cao_formats::Result<TransferFunction>,
    volume: &mut Volume,
    input: &OsStr,
) -> Result<TransferFunction> {
    let transfer = match loaded {
        Err(error @ cao_formats::Error::Model(_)) => Err(error).with_context(|| shown_path(input))?,
        other => other?,
    };
    if volume.values.non_finite().is_some() {
        volume
            .hide_no_numbers(&transfer)
            .with_context(|| format!("{}: --nan transparent", shown_path(input)))?;
    }
    Ok(transfer)
}

/// An analytic shape or a mesh file.
pub fn shape(name: &OsStr) -> Result<Shape> {
    if has_extension(name, "obj") {
        let mesh = cao_formats::obj::load_solid(Path::new(name))?;
        return Ok(Shape::Mesh(Arc::new(mesh)));
    }
    Shape::parse(&name.to_string_lossy()).map_err(|error| usage(error.to_string()))
}

/// Whether a file's name ends so, in capitals or not.
pub fn has_extension(name: &OsStr, extension: &str) -> bool {
    Path::new(name).extension().is_some_and(|found| found.eq_ignore_ascii_case(extension))
}

/// The settings that the flags ask for; the paper's where they say nothing.
pub fn setup(settings: &Settings, volume: &Volume, method: Method, all: bool) -> Result<Setup> {
    let mut setup = Setup::of(method, volume.min_spacing());
    setup.scope = if all { Scope::All } else { Scope::Needed };
    let occlusion = &mut setup.occlusion;
    occlusion.rays = settings.rays.unwrap_or(occlusion.rays);
    occlusion.quadrature = settings.quadrature.unwrap_or(occlusion.quadrature);
    occlusion.radius_mm = settings.radius_mm.unwrap_or(occlusion.radius_mm);
    occlusion.offset_mm = settings.offset_mm;
    occlusion.step_mm = settings.step_mm;
    occlusion.light = settings.ambient_light.unwrap_or_default();
    setup.options = settings.options(setup.options)?;
    setup.check(volume.min_spacing())?;
    Ok(setup)
}

/// Three values with one of these characters between them.
pub fn three<T: FromStr>(text: &str, separators: &[char]) -> Option<[T; 3]> {
    let parts: Option<Vec<T>> = text.split(separators).map(|part| part.trim().parse().ok()).collect();
    parts?.try_into().ok()
}

/// Three numbers with commas between them.
///
/// # Errors
/// What is expected instead.
pub fn triple<T: FromStr>(text: &str) -> Result<[T; 3], String> {
    three(text, &[',']).ok_or_else(|| "expected three numbers, X,Y,Z".into())
}

fn dims(text: &str) -> Result<[usize; 3], String> {
    three(text, &[',', 'x']).ok_or_else(|| "expected three whole numbers, X,Y,Z".into())
}

fn endian(text: &str) -> Result<Endian, String> {
    Endian::parse(text).ok_or_else(|| "expected little or big".into())
}

/// A number that fits.
///
/// # Errors
/// What is expected instead.
pub fn number(text: &str, expected: impl Display, fits: impl Fn(f32) -> bool) -> Result<f32, String> {
    let number = text.parse().ok().filter(|n: &f32| n.is_finite() && fits(*n));
    number.ok_or_else(|| format!("expected {expected}"))
}

/// A length in mm that may be 0.
///
/// # Errors
/// What is expected instead.
pub fn length(text: &str) -> Result<f32, String> {
    number(text, "a length >= 0 mm", |mm| mm >= 0.0)
}

/// A length in mm above 0.
///
/// # Errors
/// What is expected instead.
pub fn positive(text: &str) -> Result<f32, String> {
    number(text, "a length > 0 mm", |mm| mm > 0.0)
}

/// Width and height of an image, as `640x480`.
///
/// # Errors
/// What is expected instead.
pub fn size(text: &str) -> Result<[u32; 2], String> {
    let limit = 1..=cao_formats::scene::MAX_IMAGE;
    match text.split_once('x').map(|(w, h)| (w.parse(), h.parse())) {
        Some((Ok(w), Ok(h))) if limit.contains(&w) && limit.contains(&h) => Ok([w, h]),
        _ => Err(format!("expected WIDTHxHEIGHT, each 1 … {}", cao_formats::scene::MAX_IMAGE)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn help_reads_the_list_of_methods() {
        let text = methods_help();
        assert!(METHODS.iter().all(|e| text.contains(&format!("{}: {}", e.name, e.what))), "{text}");
        let rays = "cones: 26w; lao, cao: 26]";
        assert!(rays_help().ends_with(rays), "{}", rays_help());
        let rules = "spao: product; cones: cone; lao, cao: left, cell, segment]";
        assert!(quadrature_help().ends_with(rules), "{}", quadrature_help());
    }
}
