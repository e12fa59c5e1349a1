//! Flags and their meaning, one place for all commands.

use anyhow::{Result, bail};
use cao::clip::{Clip, Mode, Pose, Shape};
use cao::mesh::TriangleMesh;
use cao::occlusion::{Quadrature, RaySet};
use cao::scene::Method;
use cao::volume::{self, Endian, Volume};
use clap::{ArgMatches, Args, Parser, Subcommand};
use glam::Vec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Volumes with ambient occlusion, for both eyes, exact under clipping.
#[derive(Parser)]
#[command(version, arg_required_else_help = true, after_help = EXAMPLES)]
pub struct Cli {
    #[command(flatten)]
    pub global: Global,
    #[command(subcommand)]
    pub command: Command,
}

const EXAMPLES: &str = "Examples:
  cao render builtin:engine:128 -o stereo.png
  cao render head.nrrd --transfer ct-bone --clip plane --clip-rotate 0,90,0 -o stereo.png
  cao render scene.toml --eyes left.png,right.png
  cao occlusion head.nii.gz --transfer ct-bone --rays 26w --radius-mm 20 -o ao.nrrd
  cao verify builtin:fruit:64 --poses 10 --seed 7
  cao info head.nrrd

Built-in volumes are named like files: builtin:NAME:SIZE, NAME one of engine, fruit, skeleton, empty, uniform,
half-space, voxel, sheets. Lengths are millimetres, angles degrees.";

#[derive(Args)]
pub struct Global {
    /// Device to use: its number or part of its name, as `cao devices` lists them [env: CAO_DEVICE]
    #[arg(long, global = true)]
    pub device: Option<String>,
    /// Run under the Vulkan validation layer and fail if it reports anything [env: CAO_VALIDATION=1]
    #[arg(long, global = true)]
    pub validate: bool,
    /// Print one JSON object instead of text
    #[arg(long, global = true)]
    pub json: bool,
}

#[derive(Subcommand)]
pub enum Command {
    /// Draw a scene or a volume for both eyes
    #[command(after_help = RENDER_EXAMPLES)]
    Render(Render),
    /// Write the ambient volume of a volume as f32 NRRD
    #[command(after_help = OCCLUSION_EXAMPLES)]
    Occlusion(Occlusion),
    /// Check that contextual equals full recomputation bit for bit, and left eye right eye
    #[command(after_help = VERIFY_EXAMPLES)]
    Verify(Verify),
    /// Show a volume's header, value range and histogram
    Info(Info),
    /// List the Vulkan devices
    Devices,
}

const RENDER_EXAMPLES: &str = "Examples:
  cao render builtin:engine:128 --clip sphere --clip-scale 40 --clip-translate 38,-38,38 -o stereo.png
  cao render head.nrrd --transfer ct-bone --clip box --clip-mode keep --clip-scale 60,80,90 -o stereo.png
  cao render head.nrrd --clip tool.obj --clip plane --clip-rotate 0,90,0 --eyes left.png,right.png";

const OCCLUSION_EXAMPLES: &str = "Examples:
  cao occlusion head.nrrd --transfer ct-bone -o ao.nrrd
  cao occlusion ct.raw --dims 512,512,110 --type int16 --spacing 0.7,0.7,1.5 --rays 50w --quadrature segment -o ao.nrrd
  cao occlusion builtin:engine:64 --method cao --clip torus --clip-scale 20 -o ao.nrrd --mask-out vm.nrrd";

const VERIFY_EXAMPLES: &str = "Examples:
  cao verify                                all built-in scenes
  cao verify builtin:skeleton:64 --poses 20 --seed 3
  cao verify head.nrrd --transfer ct-bone --poses 5 --shapes sphere,torus,tool.obj";

/// How to read a file that holds nothing but values.
#[derive(Args, Default)]
pub struct Raw {
    /// Raw data: voxels along x, y, z
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<usize>)]
    pub dims: Option<[usize; 3]>,
    /// Raw data: type of the values, such as uint8, int16, float32
    #[arg(long = "type", value_name = "TYPE", requires = "dims")]
    pub kind: Option<String>,
    /// Raw data: distance of voxel centres in mm
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<f64>, requires = "dims")]
    pub spacing: Option<[f64; 3]>,
    /// Raw data: byte order, little or big
    #[arg(long, default_value = "little")]
    pub endian: String,
}

/// How occlusion is computed.
#[derive(Args)]
pub struct Settings {
    /// Transfer function: a TOML file, or auto, ct-bone, ct-soft, mr, paper
    #[arg(long, value_name = "FILE|PRESET")]
    pub transfer: Option<String>,
    /// Ray set: 6, 14, 26, 54 with equal weights as in the paper; 14w, 26w, 50w weighted
    #[arg(long, value_name = "SET", value_parser = |s: &str| RaySet::parse(s))]
    pub rays: Option<RaySet>,
    /// Rule along a ray: left (the paper's sum), cell, segment
    #[arg(long, value_name = "RULE", value_parser = |s: &str| Quadrature::parse(s))]
    pub quadrature: Option<Quadrature>,
    /// Radius of the neighbourhood in mm [default: 20 of the smallest spacing]
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    pub radius_mm: Option<f32>,
    /// Distance in mm at which rays start [default: half a step]
    #[arg(long, value_name = "O", allow_negative_numbers = true)]
    pub offset_mm: Option<f32>,
    /// Distance in mm between samples [default: the smallest spacing]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub step_mm: Option<f32>,
    /// lao computes everything again, cao only what a clip changed
    #[arg(long, value_name = "METHOD", value_parser = |s: &str| Method::parse(s))]
    pub method: Option<Method>,
}

/// Clips: every --clip begins a new one, and the --clip-* after it belong to it.
#[derive(Args)]
pub struct Clips {
    /// Clip with plane, box, sphere, cylinder, cone, torus or a mesh file.obj; may be given several times
    #[arg(long, value_name = "SHAPE|MESH.obj")]
    pub clip: Vec<String>,
    /// remove: the inside disappears; keep: the outside
    #[arg(long, value_name = "remove|keep", value_parser = |s: &str| Mode::parse(s))]
    pub clip_mode: Vec<Mode>,
    /// Move by mm from the volume's centre
    #[arg(long, value_name = "X,Y,Z", value_parser = triple::<f32>, allow_hyphen_values = true)]
    pub clip_translate: Vec<[f32; 3]>,
    /// Turn by degrees about x, then y, then z
    #[arg(long, value_name = "RX,RY,RZ", value_parser = triple::<f32>, allow_hyphen_values = true)]
    pub clip_rotate: Vec<[f32; 3]>,
    /// Scale the shape, whose radius or half-edge is 1 mm
    #[arg(long, value_name = "S|SX,SY,SZ", value_parser = one_or_three)]
    pub clip_scale: Vec<[f32; 3]>,
}

#[derive(Args)]
pub struct Render {
    /// Scene file (.toml), volume file, or builtin:NAME:SIZE
    pub input: String,
    /// Picture of both eyes side by side (PNG)
    #[arg(short, long, value_name = "FILE", required_unless_present = "eyes")]
    pub output: Option<PathBuf>,
    /// One picture for each eye (PNG)
    #[arg(long, value_name = "LEFT,RIGHT", value_delimiter = ',', num_args = 2)]
    pub eyes: Vec<PathBuf>,
    /// Pixels of one eye [default: 1024x1024]
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<[u32; 2]>,
    /// Look from this side: degrees about +z, from -y
    #[arg(long, value_name = "DEG", allow_hyphen_values = true)]
    pub azimuth: Option<f32>,
    /// Look from this height: degrees above the xy plane
    #[arg(long, value_name = "DEG", allow_hyphen_values = true)]
    pub elevation: Option<f32>,
    /// Distance of the head from the volume's centre in mm [default: the volume fills the picture]
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub distance: Option<f32>,
    /// Distance between the eyes in mm
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub ipd: Option<f32>,
    /// Draw without ambient occlusion
    #[arg(long)]
    pub solid: bool,
    #[command(flatten)]
    pub settings: Settings,
    #[command(flatten)]
    pub clips: Clips,
    #[command(flatten)]
    pub raw: Raw,
}

#[derive(Args)]
pub struct Occlusion {
    /// Volume file or builtin:NAME:SIZE
    pub input: String,
    /// Ambient volume (f32 NRRD, x fastest, the input's spacing)
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Also write the clipped opacity (f32 NRRD)
    #[arg(long, value_name = "FILE")]
    pub opacity_out: Option<PathBuf>,
    /// Also write the mask: 0 clipped, 0.5 recomputed, 1 untouched (f32 NRRD)
    #[arg(long, value_name = "FILE")]
    pub mask_out: Option<PathBuf>,
    /// Compute only voxels that a sample with opacity can touch; the others hold 1
    #[arg(long)]
    pub needed_only: bool,
    #[command(flatten)]
    pub settings: Settings,
    #[command(flatten)]
    pub clips: Clips,
    #[command(flatten)]
    pub raw: Raw,
}

#[derive(Args)]
pub struct Verify {
    /// Volume file, builtin:NAME:SIZE, or built-in for all built-in scenes
    #[arg(default_value = "built-in")]
    pub input: String,
    /// Random poses of every shape
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub poses: u32,
    /// Seed of the poses
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Shapes to try, meshes too [default: the six analytic ones]
    #[arg(long, value_name = "SHAPE,...", value_delimiter = ',')]
    pub shapes: Vec<String>,
    /// Compare every voxel, not only those that a sample with opacity can touch
    #[arg(long)]
    pub all_voxels: bool,
    #[command(flatten)]
    pub settings: Settings,
    #[command(flatten)]
    pub raw: Raw,
}

#[derive(Args)]
pub struct Info {
    /// Volume file or builtin:NAME:SIZE
    pub input: String,
    #[command(flatten)]
    pub raw: Raw,
}

impl Raw {
    /// Opens a volume by the name that the user gave.
    pub fn open(&self, input: &str) -> Result<Volume> {
        match (self.dims, &self.kind) {
            (None, _) => Ok(volume::open(input)?),
            (Some(_), None) => bail!("--dims needs --type, the type of the values, such as --type uint8"),
            (Some(dims), Some(kind)) => {
                let Some(endian) = Endian::parse(&self.endian) else {
                    bail!("--endian {}: expected little or big", self.endian);
                };
                let spacing = self.spacing.unwrap_or([1.0; 3]);
                Ok(volume::read_raw(Path::new(input), dims, kind, endian, spacing)?)
            }
        }
    }
}

/// An analytic shape or a mesh file.
pub fn shape(name: &str) -> Result<Shape> {
    if name.to_lowercase().ends_with(".obj") {
        let mesh = TriangleMesh::load_obj(Path::new(name))?.outward()?;
        return Ok(Shape::Mesh(Arc::new(mesh)));
    }
    Ok(Shape::parse(name)?)
}

/// The clips in the order given: each --clip-* belongs to the last --clip before it.
pub fn clips(matches: &ArgMatches) -> Result<Vec<Clip>> {
    let places = |id: &str| matches.indices_of(id).into_iter().flatten().collect::<Vec<_>>();
    let starts = places("clip");
    let mut clips = Vec::new();
    for name in matches.get_many::<String>("clip").into_iter().flatten() {
        clips.push(Clip { shape: shape(name)?, mode: Mode::Remove, pose: Pose::default() });
    }
    // Number of the clip that the i-th value of a flag belongs to.
    let owner = |flag: &str, place: usize| match starts.iter().rposition(|&start| start < place) {
        Some(clip) => Ok(clip),
        None => bail!("--{} stands before any --clip; give the shape first", flag.replace('_', "-")),
    };
    for (place, mode) in places("clip_mode").into_iter().zip(values::<Mode>(matches, "clip_mode")) {
        clips[owner("clip_mode", place)?].mode = mode;
    }
    type Set = fn(&mut Pose, Vec3);
    let flags: [(&str, Set); 3] = [
        ("clip_translate", |pose, v| pose.translate_mm = v),
        ("clip_rotate", |pose, v| pose.rotate_deg = v),
        ("clip_scale", |pose, v| pose.scale = v),
    ];
    for (flag, set) in flags {
        for (place, value) in places(flag).into_iter().zip(values::<[f32; 3]>(matches, flag)) {
            set(&mut clips[owner(flag, place)?].pose, Vec3::from_array(value));
        }
    }
    Ok(clips)
}

fn values<T: Clone + Send + Sync + 'static>(matches: &ArgMatches, flag: &str) -> Vec<T> {
    matches.get_many::<T>(flag).into_iter().flatten().cloned().collect()
}

fn triple<T: std::str::FromStr>(text: &str) -> Result<[T; 3], String> {
    let parts: Vec<T> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    match <[T; 3]>::try_from(parts) {
        Ok(triple) if text.split(',').count() == 3 => Ok(triple),
        _ => Err("expected three numbers, X,Y,Z".into()),
    }
}

fn one_or_three(text: &str) -> Result<[f32; 3], String> {
    match text.parse::<f32>() {
        Ok(scale) => Ok([scale; 3]),
        Err(_) => triple(text).map_err(|_| "expected one number or three, SX,SY,SZ".into()),
    }
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let limit = 1..=cao::scene::MAX_IMAGE;
    match text.split_once('x').map(|(w, h)| (w.parse(), h.parse())) {
        Some((Ok(w), Ok(h))) if limit.contains(&w) && limit.contains(&h) => Ok([w, h]),
        _ => Err(format!("expected WIDTHxHEIGHT, each 1 … {}", cao::scene::MAX_IMAGE)),
    }
}
