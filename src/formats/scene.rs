//! The scene file: everything that one picture needs, in TOML.
//!
//! Paths are relative to the scene file. Every key but `volume` may be left out, and that in a scene of meshes. Unknown keys and impossible values are
//! refused by name. Lengths are millimetres, angles degrees, colours sRGB. Clips with their meshes, eyes and light share one
//! frame, whose origin is the volume's centre and whose axes `frame` chooses ([`Frame`]).
//!
//! ```
//! let scene = cao_formats::Scene::from_toml(
//!     r##"
//!     volume = "builtin:engine:128"    # or a file: "head.nrrd"; or a file without header:
//!     ## volume = { file = "fmri.nii.gz", frame_index = 7, nan = "transparent" }  # one of a series, from 0; or a value for NaN
//!     ## volume = { dicom = "scan", series = "2" }       # one series of a folder: its number in the list, or its UID
//!     ## volume = { raw = "engine.raw", dims = [256, 256, 128], type = "uint8", spacing_mm = [1, 1, 1], endian = "little" }
//!
//!     frame = "patient"                # right, anterior, superior where the file states them, else index axes; "index": as stored
//!     transfer = "paper"               # a preset, a file, or the table [transfer] with the keys of such a file
//!
//!     [[clip]]                         # none, one, or up to eight
//!     shape = "sphere"                 # plane box sphere cylinder cone torus; or instead: mesh = "bunny.obj"
//!     mode = "remove"                  # inside invisible; "keep": outside invisible
//!     translate_mm = [20, 0, 30]
//!     rotate_deg = [0, 45, 0]          # about the fixed axes x, then y, then z
//!     scale = 40                       # or one number an axis: [40, 40, 20]
//!
//!     ## [[mesh]]                       # meshes that are drawn, and [mesh_occlusion]: module `mesh_keys`
//!
//!     ## label = "seg.nrrd"             # parts of the volume, by a label map or by values, and how each is shown: module `feature`
//!     ## [[feature]]                    # none, or up to eight
//!
//!     [occlusion]
//!     method = "rays"                  # rays by brick, where opacities change; "cao": rays, where clips change; "lao": all rays
//!     rays = "spiral:50"               # any even number up to 254; "6" "14w" "26w" "50w", weighted; 14 26 54, equal weights, as the paper's
//!     quadrature = "hybrid"            # nearest hybrid linear; of cao and lao, whose rays are 26: left, the paper's sum, cell, segment
//!     radius_mm = 20                   # default: 20 of the smallest spacing
//!     offset_mm = 0.5                  # where rays start; default: half a step
//!     step_mm = 1                      # default: the smallest spacing
//!     ## options = { levels = "mip" }   # what single methods take beside: cao render --help lists them
//!     light = "sky"                    # where ambient light comes from: "uniform", "sky", { up = [0, 1, 0] }, { sh = [...] }: module `light`
//!     scope = "needed"                 # voxels that a sample with opacity can touch; "all": every voxel
//!
//!     [stereo]
//!     fit = "visible"                  # frames what is visible after clips; "box": the volume's box, whatever is in it
//!     azimuth_deg = 30                 # from this side, about +z from -y; 180: a patient's face
//!     elevation_deg = 25
//!     distance_mm = 400                # of the eyes from the middle of that; default: it fills the picture
//!     ## position_mm = [0, -400, 100]   # or a place of one's own, with
//!     ## target_mm = [0, 0, 0]
//!     ## up = [0, 0, 1]
//!     ipd_mm = 20                      # between the eyes; default: 1/15 of the distance, or less, so that disparities stay below 1 degree
//!     fov_deg = 35                     # vertical; default: 35 across the shorter side; for box, and eyes at a place of their own, vertically
//!     screen_mm = 400                  # distance of the plane without parallax; default: the target
//!
//!     [image]
//!     width = 1024                     # of one eye
//!     height = 1024
//!     step_mm = 0.5                    # between samples of a ray; default: a quarter of the smallest spacing
//!     samples = 16                     # rays of a pixel, 1 to 256; their mean is shown
//!     filter = "box"                   # how they are spread: over the pixel; "gaussian": as a bell, of sigma half a pixel
//!     background = "#17191d"
//!
//!     [shading]
//!     mode = "phong+ao"                # none: colours alone; phong: without ambient occlusion; ao: colours times the ambient factor
//!     ambient = 0.4                    # light from everywhere
//!     diffuse = 0.65                   # light that depends on the surface's direction
//!     specular = 0.15                  # white light that surfaces reflect towards the eye
//!     shininess = 24                   # its exponent: the larger, the smaller the highlight
//!     two_sided = false                # true: surfaces are lit from behind as from the front
//!     light = [-0.7, 0.7, 0.6]         # direction towards it: of the head right, up, backwards; of the world x, y, z
//!     light_from = "head"              # or "world"
//!     occlusion = "ambient"            # the light that the ambient factor multiplies; "all", as the paper's pictures
//!     gain = 2                         # the ambient factor is shown times this, and at most as 1; a flat wall's is 1/2
//!     "##,
//!     std::path::Path::new("."),
//! )?;
//! assert_eq!(scene.clips.len(), 1);
//! # Ok::<(), cao_formats::Error>(())
//! ```

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Vec3;
use serde::Deserialize;
use toml::Value;

use crate::feature::FeatureSettings;
use crate::keys::{existing, length, pose, vector};
use crate::mesh_keys::{MOST_MESHES, MeshFile, MeshOcclusionFile, MeshSource};
use crate::reading::{NoNumbers, Reading};
use crate::toml_value::{in_line, number, parse_colour, shown};
use crate::{Error, Result, file, light, obj, transfer};
use cao_model::clip::{Clip, Mode, Shape};
use cao_model::error::quoted;
use cao_model::fit::{Fit, Fitting};
use cao_model::frame::Frame;
use cao_model::light::AmbientLight;
use cao_model::look::{LightFrom, Look, Occluded, Shading};
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::options::Options;
use cao_model::pixel_occlusion::{PixelMethod, PixelOcclusion};
use cao_model::samples::{Filter, MOST_SAMPLES};
use cao_model::settings::{Scope, Setup};
use cao_model::transfer::TransferFunction;
use cao_model::view::StereoRig;

/// Largest edge of one eye's image in pixels: what every Vulkan device with a desktop driver holds.
pub const MAX_IMAGE: u32 = 16384;

/// Everything that one picture needs. Clip meshes and transfer functions are loaded, the volume and the meshes to draw are only named.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Where the volume comes from; `None` in a scene of meshes alone.
    pub volume: Option<VolumeSource>,
    /// How to read it where the file leaves a choice.
    pub reading: Reading,
    /// What the axes of clips, eyes and light are.
    pub frame: Frame,
    /// Where opacity and colour come from; see [`Scene::transfer`].
    pub transfer: TransferSource,
    /// Meshes that are drawn; at most [`MOST_MESHES`].
    pub meshes: Vec<MeshSource>,
    /// How they are occluded; without meshes, how what the volume's picture shows is, in place of the volume's own occlusion.
    pub mesh_occlusion: Option<PixelOcclusion>,
    /// Clips, all applied together; at most [`Clip::MAX`]. Meshes are solids.
    pub clips: Vec<Clip>,
    /// Parts of the volume; see [`FeatureSettings::features`].
    pub features: FeatureSettings,
    /// Ambient occlusion; see [`OcclusionSettings::setup`].
    pub occlusion: OcclusionSettings,
    /// The eyes; see [`Stereo::rig`].
    pub stereo: Stereo,
    /// The picture.
    pub image: ImageSettings,
    /// How samples are lit and where they lie.
    pub look: Look,
}

/// Where a volume comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum VolumeSource {
    /// A built-in volume, as `builtin:NAME:SIZE`.
    Builtin(String),
    /// A file that describes itself, or a folder of slices.
    File(PathBuf),
    /// One DICOM series of several.
    Series {
        /// The folder, or a file in it.
        path: PathBuf,
        /// Its UID, or its number in the list of series.
        series: String,
    },
    /// A file of values only.
    Raw {
        /// The file.
        path: PathBuf,
        /// Voxels along x, y, z; x fastest.
        dims: [usize; 3],
        /// Name of the values' type, such as `uint8`.
        kind: String,
        /// Distance of voxel centres in mm.
        spacing_mm: [f64; 3],
        /// Most significant byte first?
        big_endian: bool,
    },
}

impl VolumeSource {
    /// What the user calls a volume on the command line: `builtin:NAME:SIZE` or a path.
    pub fn parse(spec: impl AsRef<Path>) -> Self {
        let path = spec.as_ref();
        match path.to_str().filter(|name| name.starts_with("builtin:")) {
            Some(name) => Self::Builtin(name.into()),
            None => Self::File(path.into()),
        }
    }
}

/// Where opacity and colour come from.
#[derive(Clone, Debug, PartialEq)]
pub enum TransferSource {
    /// A preset, which depends on the data's range.
    Preset(String),
    /// From a file or from the scene itself.
    Given(TransferFunction),
}

/// Ambient occlusion as the scene file has it: what is `None` follows from the volume's spacing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OcclusionSettings {
    /// All voxels, or those that a clip affects.
    pub method: Method,
    /// Which voxels get a value.
    pub scope: Scope,
    /// Directions and weights.
    pub rays: RaySet,
    /// Rule along a ray.
    pub quadrature: Quadrature,
    /// Radius in mm; `None` is 20 of the smallest spacing.
    pub radius_mm: Option<f32>,
    /// Start of a ray in mm; `None` is half a step.
    pub offset_mm: Option<f32>,
    /// Distance of samples in mm; `None` is the smallest spacing.
    pub step_mm: Option<f32>,
    /// What the method takes beside.
    pub options: Options,
    /// Ambient light, in the frame's axes.
    pub light: AmbientLight,
}

impl Default for OcclusionSettings {
    fn default() -> Self {
        let method = Method::default();
        Self {
            method,
            scope: Scope::Needed,
            rays: method.rays(),
            quadrature: method.quadrature(),
            radius_mm: None,
            offset_mm: None,
            step_mm: None,
            options: Options::DEFAULT,
            light: AmbientLight::Uniform,
        }
    }
}

impl OcclusionSettings {
    /// The settings for a volume whose smallest spacing is `min_spacing` mm, checked.
    ///
    /// # Errors
    /// As [`Setup::check`], keys with `occlusion.` before them.
    pub fn setup(&self, min_spacing: f64) -> Result<Setup> {
        let usual = Setup::of(self.method, min_spacing);
        let occlusion = Occlusion {
            rays: self.rays,
            quadrature: self.quadrature,
            radius_mm: self.radius_mm.unwrap_or(usual.occlusion.radius_mm),
            offset_mm: self.offset_mm,
            step_mm: self.step_mm,
            light: self.light,
        };
        let setup = Setup { occlusion, options: self.options, scope: self.scope, ..usual };
        setup.check(min_spacing).map_err(|error| error.under("occlusion"))?;
        Ok(setup)
    }
}

/// The eyes as the scene file has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stereo {
    /// Where they are and where they look.
    pub viewpoint: Viewpoint,
    /// Distance between the eyes in mm; `None` is 1/15 of the distance to the target, or what [`Fitting`] finds comfortable.
    pub ipd_mm: Option<f32>,
    /// Vertical field of view in degrees; `None` is that of [`StereoRig::framing`] or [`Fitting::rig`].
    pub fov_deg: Option<f32>,
    /// Distance in mm of the plane without parallax; `None` is the distance to the target.
    pub screen_mm: Option<f32>,
}

/// Where the eyes are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Viewpoint {
    /// From this side.
    Framing {
        /// What is looked at and fills the picture.
        fit: Fit,
        /// About +z, from -y: of a patient 0 is from behind, 180 at the face.
        azimuth_deg: f32,
        /// Above the xy plane.
        elevation_deg: f32,
        /// From its middle in mm; `None` lets it fill the picture.
        distance_mm: Option<f32>,
    },
    /// At a place of the user's own.
    Placed {
        /// Midpoint of the eyes in mm.
        position_mm: Vec3,
        /// Point looked at in mm.
        target_mm: Vec3,
        /// Direction that is up in the picture.
        up: Vec3,
    },
}

impl Default for Stereo {
    fn default() -> Self {
        let viewpoint = Viewpoint::Framing {
            fit: Fit::Visible,
            azimuth_deg: Self::AZIMUTH_DEG,
            elevation_deg: Self::ELEVATION_DEG,
            distance_mm: None,
        };
        Self { viewpoint, ipd_mm: None, fov_deg: None, screen_mm: None }
    }
}

impl Stereo {
    /// The side looked from where nobody names one.
    pub const AZIMUTH_DEG: f32 = 30.0;
    /// And the height.
    pub const ELEVATION_DEG: f32 = 25.0;

    /// What to fit into pictures of this aspect (width / height): `None` where the eyes have a place of their own or frame the box, as
    /// [`Self::rig`] says.
    pub fn fitting(&self, aspect: f32) -> Option<Fitting> {
        match self.viewpoint {
            Viewpoint::Framing { fit: Fit::Visible, azimuth_deg, elevation_deg, distance_mm } => {
                Some(Fitting {
                    azimuth_deg,
                    elevation_deg,
                    fov_deg: self.fov_deg,
                    aspect,
                    distance_mm,
                    ipd_mm: self.ipd_mm,
                    screen_mm: self.screen_mm,
                })
            }
            _ => None,
        }
    }

    /// The rig of eyes at a place of their own, or that frame the box of a volume of this size in mm along the frame's axes
    /// ([`Turn::extent`](cao_model::frame::Turn::extent)).
    pub fn rig(&self, size_mm: [f64; 3]) -> StereoRig {
        let mut rig = match self.viewpoint {
            Viewpoint::Framing { azimuth_deg, elevation_deg, .. } => {
                StereoRig::framing(size_mm, azimuth_deg, elevation_deg)
            }
            Viewpoint::Placed { position_mm, target_mm, up } => StereoRig {
                position: position_mm,
                target: target_mm,
                up,
                ..StereoRig::framing(size_mm, 0.0, 0.0)
            },
        };
        if let Viewpoint::Framing { distance_mm: Some(distance), .. } = self.viewpoint {
            rig.position = rig.position.normalize() * distance;
        }
        // Framing's own rule, for the distance that it has become.
        let comfortable = (rig.target - rig.position).length() * StereoRig::PARALLAX;
        rig.ipd_mm = self.ipd_mm.unwrap_or(comfortable);
        rig.fov_deg = self.fov_deg.unwrap_or(rig.fov_deg);
        rig.screen_mm = self.screen_mm;
        rig
    }
}

/// The picture of one eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageSettings {
    /// Pixels across, 1 to [`MAX_IMAGE`].
    pub width: u32,
    /// Pixels down, 1 to [`MAX_IMAGE`].
    pub height: u32,
    /// Linear r, g, b behind the volume.
    pub background: [f32; 3],
}

impl Default for ImageSettings {
    fn default() -> Self {
        // sRGB #17191d: dark enough for bone, light enough to see occlusion against.
        Self { width: 1024, height: 1024, background: [0.008_568_126, 0.009_721_218, 0.012_286_488] }
    }
}

impl Scene {
    /// The scene of a volume and nothing else, as `cao render VOLUME` draws it.
    pub fn default_for(volume: VolumeSource) -> Self {
        Self {
            volume: Some(volume),
            reading: Reading::default(),
            frame: Frame::default(),
            transfer: TransferSource::Preset("auto".into()),
            meshes: Vec::new(),
            mesh_occlusion: None,
            clips: Vec::new(),
            features: FeatureSettings::default(),
            occlusion: OcclusionSettings::default(),
            stereo: Stereo::default(),
            image: ImageSettings::default(),
            look: Look::default(),
        }
    }

    /// Reads a scene file.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be read; [`Error::File`] naming file, key, what was found and what would do; the
    /// errors of [`obj::load_solid`] and [`transfer::load`] for files it names.
    pub fn load(path: &Path) -> Result<Self> {
        let text = file::read_text(path)?;
        Self::from_toml(&text, path.parent().unwrap_or(Path::new("."))).map_err(|error| error.in_file(path))
    }

    /// Reads the text described at the [module](self); paths in it are relative to `base`.
    ///
    /// # Errors
    /// As [`Scene::load`], with [`cao_model::Error::Config`] in place of [`Error::File`].
    pub fn from_toml(text: &str, base: &Path) -> Result<Self> {
        let file: SceneFile =
            toml::from_str(text).map_err(|error| Error::refused("scene", in_line(text, &error)))?;
        if file.clip.len() > Clip::MAX {
            return Err(Error::refused(
                "clip",
                format!("{} clips: expected at most {}", file.clip.len(), Clip::MAX),
            ));
        }
        file.check_meshes()?;
        let mesh_occlusion = file.mesh_occlusion.map(MeshOcclusionFile::read).transpose()?;
        if let Some(PixelOcclusion { method, .. }) = mesh_occlusion.filter(|_| file.mesh.is_empty())
            && method.entry().world
        {
            let problem = format!(
                "{}: it reads triangles, and there is no [[mesh]]; of a volume's picture expected {}",
                method.name(),
                PixelMethod::of_images().join(", ")
            );
            return Err(Error::refused("mesh_occlusion.method", problem));
        }
        let clips = file.clip.into_iter().enumerate();
        let step_mm = file.image.step_mm.map(|mm| mm as f32);
        let (samples, filter) = file.image.samples()?;
        let (volume, reading) = match file.volume {
            Some(value) => volume(value, base).map(|(volume, reading)| (Some(volume), reading))?,
            None => (None, Reading::default()),
        };
        let meshes = file.mesh.into_iter().enumerate();
        Ok(Self {
            volume,
            reading,
            frame: file.frame.as_deref().map_or(Ok(Frame::default()), Frame::parse)?,
            transfer: file
                .transfer
                .map_or(Ok(TransferSource::Preset("auto".into())), |t| transfer_source(t, base))?,
            meshes: meshes.map(|(i, mesh)| mesh.read(&format!("mesh[{i}]"), base)).collect::<Result<_>>()?,
            mesh_occlusion,
            clips: clips.map(|(i, clip)| clip.read(&format!("clip[{i}]"), base)).collect::<Result<_>>()?,
            features: FeatureSettings::from_keys(file.label, file.feature, base)?,
            occlusion: file.occlusion.unwrap_or_default().read()?,
            stereo: file.stereo.read()?,
            image: file.image.read()?,
            look: Look { step_mm, samples, filter, ..file.shading.read()? },
        })
    }

    /// The transfer function for data that run over `range` (smallest, largest value).
    ///
    /// # Errors
    /// As [`TransferFunction::preset`].
    pub fn transfer(&self, range: (f64, f64)) -> Result<TransferFunction> {
        match &self.transfer {
            TransferSource::Preset(name) => Ok(TransferFunction::preset(name, range)?),
            TransferSource::Given(transfer) => Ok(transfer.clone()),
        }
    }
}

/// The file's keys; values that may have two forms stay TOML until they are looked at.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneFile {
    volume: Option<Value>,
    frame: Option<String>,
    transfer: Option<Value>,
    #[serde(default)]
    mesh: Vec<MeshFile>,
    mesh_occlusion: Option<MeshOcclusionFile>,
    #[serde(default)]
    clip: Vec<ClipFile>,
    label: Option<Value>,
    #[serde(default)]
    feature: Vec<toml::Table>,
    occlusion: Option<OcclusionFile>,
    #[serde(default)]
    stereo: StereoFile,
    #[serde(default)]
    image: ImageFile,
    #[serde(default)]
    shading: ShadingFile,
}

impl SceneFile {
    /// Refuses too many meshes, a scene of nothing, and what has no effect in a scene without a volume or without meshes.
    fn check_meshes(&self) -> Result<()> {
        if self.mesh.len() > MOST_MESHES {
            let problem = format!("{} meshes: expected at most {MOST_MESHES}", self.mesh.len());
            return Err(Error::refused("mesh", problem));
        }
        if self.mesh.is_empty() {
            let problem = "has no effect beside [mesh_occlusion], which without [[mesh]] takes its place";
            return match (&self.volume, &self.mesh_occlusion, &self.occlusion) {
                (None, ..) => {
                    Err(Error::refused("scene", "missing field `volume`; expected it, or [[mesh]]"))
                }
                (_, Some(_), Some(_)) => Err(Error::refused("occlusion", problem)),
                _ => Ok(()),
            };
        }
        let of_volumes = [
            ("frame", self.frame.is_some()),
            ("transfer", self.transfer.is_some()),
            ("label", self.label.is_some()),
            ("feature", !self.feature.is_empty()),
            ("occlusion", self.occlusion.is_some()),
        ];
        match of_volumes.iter().find(|(_, given)| *given && self.volume.is_none()) {
            Some((key, _)) => Err(Error::refused(key, "has no effect without volume")),
            None => Ok(()),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NamedFile {
    file: PathBuf,
    frame_index: Option<u64>,
    nan: Option<Value>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFile {
    raw: PathBuf,
    dims: [usize; 3],
    #[serde(rename = "type")]
    kind: String,
    #[serde(default = "unit_spacing")]
    spacing_mm: [f64; 3],
    #[serde(default)]
    endian: EndianFile,
    nan: Option<Value>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SeriesFile {
    dicom: PathBuf,
    series: String,
    nan: Option<Value>,
}

fn unit_spacing() -> [f64; 3] {
    [1.0; 3]
}

#[derive(Deserialize, Default, PartialEq)]
#[serde(rename_all = "lowercase")]
enum EndianFile {
    #[default]
    Little,
    Big,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ClipFile {
    shape: Option<String>,
    mesh: Option<PathBuf>,
    mode: Option<String>,
    translate_mm: Option<[f64; 3]>,
    rotate_deg: Option<[f64; 3]>,
    scale: Option<Value>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct OcclusionFile {
    method: Option<String>,
    rays: Option<Value>,
    quadrature: Option<String>,
    radius_mm: Option<f64>,
    offset_mm: Option<f64>,
    step_mm: Option<f64>,
    options: Option<toml::Table>,
    scope: Option<String>,
    light: Option<Value>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct StereoFile {
    fit: Option<String>,
    azimuth_deg: Option<f64>,
    elevation_deg: Option<f64>,
    distance_mm: Option<f64>,
    position_mm: Option<[f64; 3]>,
    target_mm: Option<[f64; 3]>,
    up: Option<[f64; 3]>,
    ipd_mm: Option<f64>,
    fov_deg: Option<f64>,
    screen_mm: Option<f64>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct ImageFile {
    width: Option<i64>,
    height: Option<i64>,
    step_mm: Option<f64>,
    samples: Option<i64>,
    filter: Option<String>,
    background: Option<Value>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct ShadingFile {
    mode: Option<String>,
    ambient: Option<f64>,
    diffuse: Option<f64>,
    specular: Option<f64>,
    shininess: Option<f64>,
    two_sided: Option<bool>,
    light: Option<[f64; 3]>,
    light_from: Option<String>,
    occlusion: Option<Value>,
    gain: Option<f64>,
}

fn volume(value: Value, base: &Path) -> Result<(VolumeSource, Reading)> {
    match value {
        Value::String(spec) => match VolumeSource::parse(&spec) {
            VolumeSource::File(path) => {
                Ok((VolumeSource::File(existing("volume", base, &path)?), Reading::default()))
            }
            other => Ok((other, Reading::default())),
        },
        Value::Table(table) if table.contains_key("file") => {
            let named: NamedFile = table
                .try_into()
                .map_err(|error: toml::de::Error| Error::refused("volume", error.message()))?;
            let reading =
                Reading { frame_index: named.frame_index, no_numbers: no_numbers(named.nan.as_ref())? };
            Ok((VolumeSource::File(existing("volume.file", base, &named.file)?), reading))
        }
        Value::Table(table) if table.contains_key("dicom") => {
            let file: SeriesFile = table
                .try_into()
                .map_err(|error: toml::de::Error| Error::refused("volume", error.message()))?;
            let reading = Reading { no_numbers: no_numbers(file.nan.as_ref())?, ..Reading::default() };
            let path = existing("volume.dicom", base, &file.dicom)?;
            Ok((VolumeSource::Series { path, series: file.series }, reading))
        }
        Value::Table(table) => {
            let raw: RawFile = table
                .try_into()
                .map_err(|error: toml::de::Error| Error::refused("volume", error.message()))?;
            if let Some(mm) = raw.spacing_mm.iter().find(|mm| !(mm.is_finite() && **mm > 0.0)) {
                return Err(Error::refused("volume.spacing_mm", format!("{mm}: expected lengths > 0 mm")));
            }
            if raw.dims.contains(&0) {
                return Err(Error::refused(
                    "volume.dims",
                    format!("{:?}: expected at least 1 voxel along each axis", raw.dims),
                ));
            }
            let reading = Reading { no_numbers: no_numbers(raw.nan.as_ref())?, ..Reading::default() };
            let source = VolumeSource::Raw {
                path: existing("volume.raw", base, &raw.raw)?,
                dims: raw.dims,
                kind: raw.kind,
                spacing_mm: raw.spacing_mm,
                big_endian: raw.endian == EndianFile::Big,
            };
            Ok((source, reading))
        }
        other => {
            let problem = format!(
                "{}: expected a file, builtin:NAME:SIZE, or a table with file, with dicom, series, or with raw, dims, type",
                shown(&other)
            );
            Err(Error::refused("volume", problem))
        }
    }
}

/// A number, or "transparent".
fn no_numbers(value: Option<&Value>) -> Result<NoNumbers> {
    let Some(value) = value else { return Ok(NoNumbers::Refuse) };
    let given = match value {
        Value::String(text) if text == "transparent" => Some(NoNumbers::Transparent),
        other => number(other).filter(|v| v.is_finite()).map(NoNumbers::Value),
    };
    given.ok_or_else(|| {
        Error::refused("volume.nan", format!("{}: expected a number or \"transparent\"", shown(value)))
    })
}

fn transfer_source(value: Value, base: &Path) -> Result<TransferSource> {
    match value {
        Value::String(name) if TransferFunction::is_preset(&name) => Ok(TransferSource::Preset(name)),
        Value::String(file) => {
            let path = existing("transfer", base, Path::new(&file))?;
            transfer::read(&path).map(TransferSource::Given)
        }
        Value::Table(table) => {
            transfer::from_table(table).map(TransferSource::Given).map_err(|error| error.under("transfer"))
        }
        other => Err(Error::refused(
            "transfer",
            format!("{}: expected a preset, a file, or a table", shown(&other)),
        )),
    }
}

impl ClipFile {
    fn read(self, key: &str, base: &Path) -> Result<Clip> {
        let shape = match (&self.shape, &self.mesh) {
            (Some(name), None) => {
                Shape::parse(name).map_err(|error| Error::from(error).renamed(&format!("{key}.shape")))?
            }
            (None, Some(path)) => {
                let path = existing(&format!("{key}.mesh"), base, path)?;
                Shape::Mesh(Arc::new(obj::load_solid(&path)?))
            }
            _ => return Err(Error::refused(key, "expected either shape or mesh")),
        };
        let mode = self.mode.as_deref().map_or(Ok(Mode::Remove), Mode::parse);
        let mode = mode.map_err(|error| Error::from(error).renamed(&format!("{key}.mode")))?;
        let pose = pose(key, self.translate_mm, self.rotate_deg, self.scale.as_ref())?;
        Ok(Clip { shape, mode, pose })
    }
}

impl OcclusionFile {
    fn read(self) -> Result<OcclusionSettings> {
        let default = OcclusionSettings::default();
        let in_occlusion = |error: cao_model::Error| error.under("occlusion");
        let quadrature =
            self.quadrature.as_deref().map(Quadrature::parse).transpose().map_err(in_occlusion)?;
        let method = self.method.as_deref().map(Method::parse).transpose().map_err(in_occlusion)?;
        let method = method.unwrap_or(Method::for_rule(quadrature));
        let rays = match &self.rays {
            None => method.rays(),
            // 26 and "26" are the same set.
            Some(Value::String(name)) => RaySet::parse(name).map_err(in_occlusion)?,
            Some(other) => RaySet::parse(&shown(other)).map_err(in_occlusion)?,
        };
        let scope = match self.scope.as_deref() {
            None => default.scope,
            Some("needed") => Scope::Needed,
            Some("all") => Scope::All,
            Some(other) => {
                return Err(Error::refused(
                    "occlusion.scope",
                    format!("{}: expected needed or all", quoted(other)),
                ));
            }
        };
        for (key, value, zero) in [
            ("occlusion.radius_mm", self.radius_mm, true),
            ("occlusion.offset_mm", self.offset_mm, true),
            ("occlusion.step_mm", self.step_mm, false),
        ] {
            length(key, value, zero)?;
        }
        let mut options = Options::default();
        for (name, value) in self.options.unwrap_or_default() {
            let text = value.as_str().map_or_else(|| shown(&value), str::to_owned);
            options.set(&name, &text).map_err(|error| error.under("occlusion.options"))?;
        }
        Ok(OcclusionSettings {
            method,
            scope,
            rays,
            quadrature: quadrature.unwrap_or(method.quadrature()),
            radius_mm: self.radius_mm.map(|mm| mm as f32),
            offset_mm: self.offset_mm.map(|mm| mm as f32),
            step_mm: self.step_mm.map(|mm| mm as f32),
            options,
            light: self.light.as_ref().map_or(Ok(AmbientLight::Uniform), light::read)?,
        })
    }
}

impl StereoFile {
    fn read(self) -> Result<Stereo> {
        let viewpoint = match self.position_mm {
            Some(position) => self.placed(vector(position))?,
            None => self.framing()?,
        };
        length("stereo.ipd_mm", self.ipd_mm, true)?;
        length("stereo.screen_mm", self.screen_mm, false)?;
        if let Some(degrees) = self.fov_deg.filter(|degrees| !(*degrees > 0.0 && *degrees < 179.0)) {
            return Err(Error::refused(
                "stereo.fov_deg",
                format!("{degrees}: expected more than 0 and less than 179 degrees"),
            ));
        }
        Ok(Stereo {
            viewpoint,
            ipd_mm: self.ipd_mm.map(|mm| mm as f32),
            fov_deg: self.fov_deg.map(|degrees| degrees as f32),
            screen_mm: self.screen_mm.map(|mm| mm as f32),
        })
    }

    fn framing(&self) -> Result<Viewpoint> {
        for (key, unused) in [("stereo.target_mm", self.target_mm), ("stereo.up", self.up)] {
            if unused.is_some() {
                return Err(Error::refused(key, "has no effect without stereo.position_mm"));
            }
        }
        let fit = self.fit.as_deref().map_or(Ok(Fit::default()), Fit::parse);
        let fit = fit.map_err(|error| error.under("stereo"))?;
        let azimuth = self.azimuth_deg.unwrap_or(Stereo::AZIMUTH_DEG.into());
        let elevation = self.elevation_deg.unwrap_or(Stereo::ELEVATION_DEG.into());
        if !azimuth.is_finite() {
            return Err(Error::refused(
                "stereo.azimuth_deg",
                format!("{azimuth}: expected an angle in degrees"),
            ));
        }
        if !(-90.0..=90.0).contains(&elevation) {
            return Err(Error::refused(
                "stereo.elevation_deg",
                format!("{elevation}: expected -90 to 90 degrees"),
            ));
        }
        length("stereo.distance_mm", self.distance_mm, false)?;
        Ok(Viewpoint::Framing {
            fit,
            azimuth_deg: azimuth as f32,
            elevation_deg: elevation as f32,
            distance_mm: self.distance_mm.map(|mm| mm as f32),
        })
    }

    fn placed(&self, position_mm: Vec3) -> Result<Viewpoint> {
        for (key, unused) in [
            ("stereo.fit", self.fit.is_some()),
            ("stereo.azimuth_deg", self.azimuth_deg.is_some()),
            ("stereo.elevation_deg", self.elevation_deg.is_some()),
            ("stereo.distance_mm", self.distance_mm.is_some()),
        ] {
            if unused {
                return Err(Error::refused(key, "has no effect together with stereo.position_mm"));
            }
        }
        let (target_mm, up) =
            (vector(self.target_mm.unwrap_or_default()), vector(self.up.unwrap_or([0.0, 0.0, 1.0])));
        // The rig knows what it can look at, and names its keys.
        let rig = StereoRig {
            position: position_mm,
            target: target_mm,
            up,
            ..StereoRig::framing([1.0; 3], 0.0, 0.0)
        };
        rig.views(1.0, 1.0, 2.0).map_err(|error| match error {
            cao_model::Error::Config { what, problem } if what == "stereo.target" => {
                Error::refused("stereo.target_mm", problem)
            }
            other => other.into(),
        })?;
        Ok(Viewpoint::Placed { position_mm, target_mm, up })
    }
}

impl ImageFile {
    fn samples(&self) -> Result<(u32, Filter)> {
        let samples = match self.samples {
            None => Look::default().samples,
            Some(n) if (1..=i64::from(MOST_SAMPLES)).contains(&n) => n as u32,
            Some(n) => {
                return Err(Error::refused("image.samples", format!("{n}: expected 1 to {MOST_SAMPLES}")));
            }
        };
        let filter = self.filter.as_deref().map_or(Ok(Filter::default()), Filter::parse);
        Ok((samples, filter.map_err(|error| error.under("image"))?))
    }

    fn read(self) -> Result<ImageSettings> {
        let default = ImageSettings::default();
        let pixels = |key: &str, value: Option<i64>, default: u32| match value {
            None => Ok(default),
            Some(n) if (1..=i64::from(MAX_IMAGE)).contains(&n) => Ok(n as u32),
            Some(n) => Err(Error::refused(key, format!("{n}: expected 1 to {MAX_IMAGE} pixels"))),
        };
        length("image.step_mm", self.step_mm, false)?;
        Ok(ImageSettings {
            width: pixels("image.width", self.width, default.width)?,
            height: pixels("image.height", self.height, default.height)?,
            background: self
                .background
                .map_or(Ok(default.background), |colour| parse_colour("image.background", &colour))?,
        })
    }
}

impl ShadingFile {
    fn read(self) -> Result<Look> {
        let default = Look::default();
        for (key, value) in [
            ("shading.ambient", self.ambient),
            ("shading.diffuse", self.diffuse),
            ("shading.specular", self.specular),
            ("shading.gain", self.gain),
        ] {
            if let Some(share) = value.filter(|share| !(0.0..=10.0).contains(share)) {
                return Err(Error::refused(key, format!("{share}: expected a number from 0 to 10")));
            }
        }
        let light = match self.light {
            None => default.light,
            Some(towards) => vector(towards).try_normalize().ok_or_else(|| {
                Error::refused(
                    "shading.light",
                    format!("{towards:?}: expected a direction other than [0, 0, 0]"),
                )
            })?,
        };
        let refused = |key: &'static str| move |error| Error::from(error).renamed(key);
        let occluded = match &self.occlusion {
            None => default.occluded,
            Some(Value::String(name)) => Occluded::parse(name).map_err(refused("shading.occlusion"))?,
            Some(other) => {
                let problem = format!(
                    "{}: expected \"ambient\" or \"all\"; a picture without it has mode = \"phong\"",
                    shown(other)
                );
                return Err(Error::refused("shading.occlusion", problem));
            }
        };
        let shading =
            self.mode.as_deref().map(Shading::parse).transpose().map_err(refused("shading.mode"))?;
        let light_from = self.light_from.as_deref().map(LightFrom::parse).transpose();
        let part = |given: Option<f64>, default| given.map_or(default, |share| share as f32);
        let look = Look {
            shading: shading.unwrap_or(default.shading),
            ambient: part(self.ambient, default.ambient),
            diffuse: part(self.diffuse, default.diffuse),
            specular: part(self.specular, default.specular),
            shininess: part(self.shininess, default.shininess),
            two_sided: self.two_sided.unwrap_or(default.two_sided),
            light,
            light_from: light_from.map_err(refused("shading.light_from"))?.unwrap_or(default.light_from),
            occluded,
            gain: part(self.gain, default.gain),
            ..default
        };
        look.check()?;
        Ok(look)
    }
}
