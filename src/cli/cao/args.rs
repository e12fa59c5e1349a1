//! Flags and their meaning, one place for all commands. Those that the programs share are in [`cao_cli::args`].

use anyhow::{Context, Result};
pub use cao_cli::args::{
    Global, Parts, Raw, Settings, has_extension, open, setup, shape, transfer, usage, volume_of,
};
use cao_cli::args::{length, methods_help, network, number, positive, size, three, triple};
use cao_measure::stability::Trial;
use cao_model::METHODS;
use cao_model::clip::{Clip, Mode, Pose};
use cao_model::error::shown_path;
use cao_model::fit::Fit;
use cao_model::frame::Frame;
use cao_model::look::{LightFrom, Shading};
use cao_model::methods::Method;
use cao_model::network::{Label, Network};
use cao_model::occlusion::Quadrature;
use cao_model::samples::{Filter, MOST_SAMPLES};
use clap::{ArgAction, ArgMatches, Args, Parser, Subcommand};
use glam::Vec3;
use std::ffi::OsString;
use std::path::PathBuf;

/// Volumes with ambient occlusion, for both eyes, exact under clipping.
#[derive(Parser)]
#[command(version, arg_required_else_help = true, after_help = EXAMPLES)]
pub struct Cli {
    #[command(flatten)]
    pub global: Global,
    #[command(subcommand)]
    pub command: Command,
}

const EXAMPLES: &str = "\
Examples:
  cao render builtin:engine:128 -o stereo.png
  cao render scene.toml --eyes left.png,right.png
  cao occlusion head.nii.gz --transfer ct-bone --rays 26w -o ao.nrrd
  cao verify builtin:fruit:64 --poses 10 --seed 7
  cao info head.nrrd
More in `cao render --help` and so on.

Volumes: NRRD, NIfTI, MetaImage, raw values with --dims and --type, and
built-in ones, named like files: builtin:NAME:SIZE, with NAME one of
engine, fruit, beetle, skeleton, bucky, empty, uniform, half-space, voxel,
sheets.
Lengths are millimetres, angles degrees. The origin is the volume's centre;
x, y, z are the patient's right, anterior, superior where a file states them,
else the volume's index axes.

Exit codes: 0 done, 1 failed (verify: something differs), 2 wrong usage.";

#[derive(Subcommand)]
pub enum Command {
    /// Draw a scene or a volume for both eyes
    #[command(after_help = RENDER_EXAMPLES)]
    Render(Render),
    /// Write a volume's ambient occlusion as a volume: 0 fully occluded, 1 unobstructed
    #[command(after_help = OCCLUSION_EXAMPLES)]
    Occlusion(Occlusion),
    /// Check on this device that occlusion after a change equals full recomputation, and left eye right eye
    #[command(after_help = VERIFY_EXAMPLES)]
    Verify(Verify),
    /// Chart time against error for every method after every kind of change, on this device
    #[command(after_help = CHART_EXAMPLES)]
    Chart(Chart),
    /// Show where methods fail, ours beside them: data, charts and one sentence for each trial
    #[command(after_help = STABILITY_EXAMPLES)]
    Stability(Stability),
    /// Make volumes with exact ambient values to train a network on
    #[command(after_help = EXAMPLES_EXAMPLES)]
    Examples(Examples),
    /// Show a volume's header, value range and histogram
    Info(Info),
    /// List the Vulkan devices
    Devices,
}

const RENDER_EXAMPLES: &str = "\
Examples:
  cao render builtin:engine:128 -o stereo.png \\
      --clip sphere --clip-scale 40 --clip-translate 38,-38,38
  cao render head.nrrd --transfer ct-bone -o stereo.png \\
      --clip box --clip-mode keep --clip-scale 60,80,90
  cao render head.nrrd --transfer ct-bone --budget-ms 20 -o stereo.png
  cao render head.nrrd --eyes left.png,right.png \\
      --clip tool.obj --clip plane --clip-rotate 0,90,0";

const OCCLUSION_EXAMPLES: &str = "\
Examples:
  cao occlusion head.nrrd --transfer ct-bone -o ao.nrrd
  cao occlusion ct.raw --dims 512,512,110 --type int16 --spacing 0.7,0.7,1.5 \\
      --rays 50w --quadrature segment -o ao.nrrd
  cao occlusion head.nrrd --transfer ct-bone --budget-error 0.01 -o ao.nrrd
  cao occlusion builtin:engine:64 --method cao --clip torus --clip-scale 20 \\
      -o ao.nrrd --mask-out vm.nrrd";

const VERIFY_EXAMPLES: &str = "\
Examples:
  cao verify                       all built-in scenes
  cao verify --method all          with every method
  cao verify builtin:skeleton:64 --poses 20 --seed 3
  cao verify head.nrrd --transfer ct-bone --shapes sphere,torus,tool.obj

Every clip is followed by an update, and the update compared bit by bit with a
full recomputation of the method: of cao, LAO of every voxel.

Exit code 1 if any voxel or any point that both eyes see differs.";

const CHART_EXAMPLES: &str = "\
Examples:
  cao chart -o chart                      three built-in scenes, some fifteen minutes
                                          without a GPU
  cao chart --quick -o chart              a first look, two minutes
  cao chart head.nrrd --transfer ct-bone --radius-mm 20 -o chart
  cao chart scene.toml builtin:fruit:96 --runs 9 -o chart
  cao chart --fdao -o features            feature-driven occlusion beside the printed
                                          times, with its pictures
  cao chart --dvao -o network             a network beside rays, Table 3 of its paper
  cao chart --meshes -o meshes            ambient occlusion of meshes beside rays,
                                          figures 5 and 9 to 11 of its paper
  cao chart --meshes --data bunny.obj -o meshes

Writes report.html, which stands alone; chart.svg, chart.png and runs.csv, every
run of every method; the same of the picture's own settings, pictures.*. A scene without clips gets a ball.";

const STABILITY_EXAMPLES: &str = "\
Examples:
  cao stability -o stability            all trials; open stability/index.html
  cao stability -o out --quick --only stereo,views
  cao stability --list

Exit code 1 if ours fails where it claims to hold, or the method that a trial
is there to catch does not.";

const EXAMPLES_EXAMPLES: &str = "\
Examples:
  cao examples --builtin fruit --builtin solids --count 100 -o examples
  cao examples --volume head.nrrd --count 20 --seed 7 -o examples

A random transfer function and rotation for each. `tools/train` runs this.";

/// Clips: every --clip begins a new one, and the --clip-* after it belong to it.
#[derive(Args)]
#[command(next_help_heading = "Clips (every --clip-… belongs to the last --clip before it)")]
pub struct Clips {
    /// Clip with plane, box, sphere, cylinder, cone, torus, or a closed mesh file.obj; up to 8 times
    #[arg(long, value_name = "SHAPE|MESH.obj")]
    pub clip: Vec<OsString>,
    /// What disappears. remove: the inside; keep: the outside [default: remove]
    #[arg(long, value_name = "remove|keep", value_parser = |s: &str| Mode::parse(s))]
    pub clip_mode: Vec<Mode>,
    /// Move by mm from the volume's centre
    #[arg(long, value_name = "X,Y,Z", value_parser = translation, allow_hyphen_values = true)]
    pub clip_translate: Vec<[f32; 3]>,
    /// Turn by degrees about x, then y, then z
    #[arg(long, value_name = "RX,RY,RZ", value_parser = rotation, allow_hyphen_values = true)]
    pub clip_rotate: Vec<[f32; 3]>,
    /// Scale the shape, whose radius or half-edge is 1 mm; a mesh has the file's size in mm
    #[arg(long, value_name = "S|SX,SY,SZ", value_parser = scale, allow_hyphen_values = true)]
    pub clip_scale: Vec<[f32; 3]>,
}

/// Settings chosen by what they cost in the scene at hand.
#[derive(Args)]
#[command(next_help_heading = "Occlusion")]
pub struct Budget {
    /// Choose the cheapest settings whose error stays below E (root mean square, 0 to 1, against converged occlusion), measured on samples
    /// of this scene; --method, --rays and --quadrature limit the choice
    #[arg(long, value_name = "E", value_parser = budget, conflicts_with = "budget_ms")]
    pub budget_error: Option<f64>,
    /// Choose the most accurate settings that compute all occlusion in T ms on this device
    #[arg(long, value_name = "T", value_parser = budget)]
    pub budget_ms: Option<f64>,
}

impl Budget {
    /// Whether there is one.
    pub fn given(&self) -> bool {
        self.budget_error.is_some() || self.budget_ms.is_some()
    }
}

fn budget(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|b: &f64| b.is_finite() && *b > 0.0)
        .ok_or_else(|| "expected a number > 0".into())
}

#[derive(Args)]
pub struct Render {
    /// Scene file (.toml), volume file, or builtin:NAME:SIZE
    pub input: OsString,
    /// Picture of both eyes side by side (PNG)
    #[arg(short, long, value_name = "FILE", required_unless_present = "eyes")]
    pub output: Option<PathBuf>,
    /// One picture for each eye (PNG); instead of -o or beside it
    #[arg(long, value_name = "LEFT,RIGHT", value_delimiter = ',', action = ArgAction::Set)]
    pub eyes: Vec<PathBuf>,
    /// Pixels of one eye [default: 1024x1024]
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<[u32; 2]>,
    /// Rays of a pixel, whose mean is shown: smooth edges for N times the time [default: the scene's, 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_SAMPLES)))]
    pub samples: Option<u32>,
    /// How they are spread. box: over the pixel; gaussian: as a bell with sigma half a pixel, smoother and softer [default: the scene's,
    /// box]
    #[arg(long, value_name = "box|gaussian", value_parser = |s: &str| Filter::parse(s))]
    pub filter: Option<Filter>,
    /// Axes of clips, eyes and light. patient: right, anterior, superior where the file states them, else the index axes; index:
    /// the index axes as stored [default: the scene's, patient]
    #[arg(long, value_name = "patient|index", value_parser = |s: &str| Frame::parse(s))]
    pub frame: Option<Frame>,
    /// What fills the picture. visible: what is visible, after clips; box: the volume's box, whatever is in it [default: visible]
    #[arg(long, value_name = "visible|box", value_parser = |s: &str| Fit::parse(s))]
    pub fit: Option<Fit>,
    /// Look from this side: degrees about +z, from -y; a patient's face is at 180 [default: 30]
    #[arg(long, value_name = "DEG", value_parser = angle, allow_hyphen_values = true)]
    pub azimuth: Option<f32>,
    /// Look from this height: -90 to 90 degrees above the xy plane [default: 25]
    #[arg(long, value_name = "DEG", value_parser = elevation, allow_hyphen_values = true)]
    pub elevation: Option<f32>,
    /// Distance of the head in mm from the middle of what is visible, or of the box [default: it fills the picture]
    #[arg(long, value_name = "MM", value_parser = positive, allow_hyphen_values = true)]
    pub distance: Option<f32>,
    /// Distance between the eyes in mm [default: 1/15 of that distance, or less, so that disparities stay below 1 degree]
    #[arg(long, value_name = "MM", value_parser = length, allow_hyphen_values = true)]
    pub ipd: Option<f32>,
    /// Light that is shown: none, the colours alone; phong, ambient, diffuse and specular; ao, colours times ambient occlusion; phong+ao,
    /// both [default: the scene's, phong+ao]
    #[arg(long, value_name = "LIGHT", value_parser = |s: &str| Shading::parse(s))]
    pub shading: Option<Shading>,
    /// What the light's direction is fixed to: head, world [default: the scene's, head]
    #[arg(long, value_name = "head|world", value_parser = |s: &str| LightFrom::parse(s))]
    pub light_from: Option<LightFrom>,
    #[command(flatten)]
    pub settings: Settings,
    #[command(flatten)]
    pub budget: Budget,
    #[arg(long, value_name = "METHOD", value_parser = |s: &str| Method::parse(s), help_heading = "Occlusion",
        help = format!("{} [default: {}]", methods_help(), default_method()))]
    pub method: Option<Method>,
    #[command(flatten)]
    pub clips: Clips,
    #[command(flatten)]
    pub parts: Parts,
    #[command(flatten)]
    pub raw: Raw,
}

#[derive(Args)]
pub struct Occlusion {
    /// Volume file or builtin:NAME:SIZE
    pub input: OsString,
    /// Ambient volume (NRRD of f32 on the input's grid, in its order)
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Axes of clips. patient: right, anterior, superior where the file states them, else the index axes; index:
    /// the index axes as stored [default: patient]
    #[arg(long, value_name = "patient|index", value_parser = |s: &str| Frame::parse(s))]
    pub frame: Option<Frame>,
    /// Also write the clipped opacity (NRRD of f32)
    #[arg(long, value_name = "FILE")]
    pub opacity_out: Option<PathBuf>,
    /// Also write the mask (NRRD of f32): 0 clipped away, 0.5 near a clip, recomputed, 1 untouched
    #[arg(long, value_name = "FILE")]
    pub mask_out: Option<PathBuf>,
    #[command(flatten)]
    pub settings: Settings,
    #[command(flatten)]
    pub budget: Budget,
    #[arg(long, value_name = "METHOD", value_parser = |s: &str| Method::parse(s), help_heading = "Occlusion",
        help = format!("{} [default: {}]", methods_help(), OCCLUSION.name()))]
    pub method: Option<Method>,
    /// Compute only voxels that a sample with opacity can touch; the others hold 1
    #[arg(long, help_heading = "Occlusion")]
    pub needed_only: bool,
    #[command(flatten)]
    pub clips: Clips,
    #[command(flatten)]
    pub parts: Parts,
    #[command(flatten)]
    pub raw: Raw,
}

#[derive(Args)]
pub struct Verify {
    /// Volume file, builtin:NAME:SIZE, or built-in for all built-in scenes
    #[arg(default_value = "built-in")]
    pub input: OsString,
    /// Random poses of every shape
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub poses: u32,
    /// Seed of the poses
    #[arg(long, value_name = "S", default_value_t = 1, allow_hyphen_values = true)]
    pub seed: u64,
    /// Shapes to clip with, meshes too [default: plane,box,sphere,cylinder,cone,torus]
    #[arg(long, value_name = "SHAPE,...", value_delimiter = ',')]
    pub shapes: Vec<OsString>,
    /// Compare every voxel, not only those that a sample with opacity can touch
    #[arg(long)]
    pub all_voxels: bool,
    #[arg(long, value_name = "METHOD|all", value_parser = verified, help_heading = "Occlusion",
        help = format!(
            "Only this method, or all that have the rule of --quadrature. {} [default: {}; and {}, the proof that contextual \
             occlusion equals full recomputation]",
            methods_help(), default_method(), PROOF.name()
        ))]
    pub method: Option<Verified>,
    #[command(flatten)]
    pub settings: Settings,
    #[command(flatten)]
    pub parts: Parts,
    #[command(flatten)]
    pub raw: Raw,
}

/// What `verify --method` names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verified {
    /// This method.
    One(Method),
    /// Every method.
    All,
}

fn verified(text: &str) -> Result<Verified, String> {
    match text {
        "all" => Ok(Verified::All),
        name => Method::parse(name).map(Verified::One).map_err(|error| format!("{error}, all")),
    }
}

/// What `occlusion` computes unless told otherwise: the paper's own definition.
pub const OCCLUSION: Method = Method::Lao;

/// What `verify` verifies beside the default method: the claim of the paper (CAO §4).
pub const PROOF: Method = Method::Cao;

/// The method for whom names none, and those for whom names a rule that it lacks.
fn default_method() -> String {
    let of_rules = |method: Method| {
        let own = Quadrature::ALL.into_iter().filter(|rule| Method::for_rule(Some(*rule)) == method);
        own.map(Quadrature::name).collect::<Vec<_>>()
    };
    let mut text = Method::default().name().to_owned();
    for entry in METHODS.iter().filter(|entry| entry.method != Method::default()) {
        let rules = of_rules(entry.method);
        if !rules.is_empty() {
            text += &format!("; {} where --quadrature is {}", entry.name, rules.join(" or "));
        }
    }
    text
}

#[derive(Args)]
pub struct Chart {
    /// Scene files (.toml), volume files, or builtin:NAME:SIZE [default: engine, fruit, skeleton]
    pub scenes: Vec<OsString>,
    /// Folder for report, chart and numbers; made where there is none
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Fewer settings, smaller built-in scenes, a coarser reference
    #[arg(long)]
    pub quick: bool,
    /// The paper's own three scenes, tables and pictures instead
    #[arg(long, conflicts_with_all = ["scenes", "peers", "transfer", "radius_mm"])]
    pub paper: bool,
    /// The scenes, tables and pictures of the paper of method fdao instead: what features cost, and what they show
    #[arg(long, conflicts_with_all = ["scenes", "peers", "transfer", "radius_mm", "paper"])]
    pub fdao: bool,
    /// Table 3 of the paper of method dvao instead: its network beside rays, with likeness, time and memory
    #[arg(long, conflicts_with_all = ["scenes", "peers", "transfer", "radius_mm", "paper", "fdao"])]
    pub dvao: bool,
    /// With --dvao: weight file of another network, for either truth [default: the one that is built in]
    #[arg(long, value_name = "FILE", value_parser = network, requires = "dvao")]
    pub network: Option<Network>,
    /// Figures 5 and 9 to 11 of the paper of ambient occlusion volumes instead: seven scenes of meshes, its methods and rays, time against error
    #[arg(long, conflicts_with_all = ["scenes", "peers", "transfer", "radius_mm", "paper", "fdao", "dvao"])]
    pub meshes: bool,
    /// With --meshes: pixels of the view [default: 1280x720, on a software driver 160x90, with --quick 48x27]
    #[arg(long, value_name = "WxH", value_parser = size, requires = "meshes")]
    pub size: Option<[u32; 2]>,
    /// With --meshes: rays a pixel of the reference [default: 5000, on a software driver 1000, with --quick 64]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=65536), requires = "meshes")]
    pub rays: Option<u32>,
    /// With --paper: a volume for its engine, its beetle, its skeleton, in this order, instead of phantoms; with --meshes: scans (.obj, .gltf, .glb) as
    /// scenes beside the seven, each on a ground
    #[arg(long, value_name = "FILE")]
    pub data: Vec<OsString>,
    /// A peers.json of tools/peers, for a table of other systems in the report
    #[arg(long, value_name = "FILE")]
    pub peers: Option<PathBuf>,
    /// Timed runs of every method and change
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub runs: u32,
    /// Opacity and colour of values, as in `cao render` [default: the scene's, auto for volumes]
    #[arg(long, value_name = "FILE|PRESET")]
    pub transfer: Option<OsString>,
    /// Length of the rays in mm [default: the scene's; 8 voxels for the default scenes, else 20]
    #[arg(long, value_name = "R", value_parser = positive, allow_hyphen_values = true)]
    pub radius_mm: Option<f32>,
    #[command(flatten)]
    pub raw: Raw,
}

#[derive(Args)]
pub struct Stability {
    /// Folder for index.html, and for each trial its data (CSV) and charts (SVG, PNG); made where missing
    #[arg(short, long, value_name = "DIR", required_unless_present = "list")]
    pub output: Option<PathBuf>,
    /// Only these trials, as --list names them
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', value_parser = |s: &str| Trial::parse(s))]
    pub only: Vec<Trial>,
    /// Fewer and coarser steps: under a minute instead of some minutes
    #[arg(long)]
    pub quick: bool,
    /// Name the trials, and do nothing else
    #[arg(long)]
    pub list: bool,
}

#[derive(Args)]
pub struct Examples {
    /// Folder for the examples and examples.json; made where there is none
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// How many to make
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub count: u32,
    /// Voxels along each axis
    #[arg(long, value_name = "VOXELS", default_value_t = 64, value_parser = clap::value_parser!(u32).range(8..=512))]
    pub edge: u32,
    /// Samples along each axis of a voxel, of which it is the mean
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=8))]
    pub samples: u32,
    /// Seed of everything that is random
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    pub seed: u64,
    /// Mean transmittance of the rays, or that at their ends; twice for both [default: both]
    #[arg(long, value_name = "mean|end", value_parser = label)]
    pub label: Vec<Label>,
    /// A built-in volume of random proportions, or `solids`, random solids; more often for more of them
    #[arg(long, value_name = "NAME")]
    pub builtin: Vec<String>,
    /// A volume; more often for more of them
    #[arg(long, value_name = "FILE")]
    pub volume: Vec<OsString>,
    #[command(flatten)]
    pub raw: Raw,
}

fn label(text: &str) -> Result<Label, String> {
    Label::ALL.into_iter().find(|label| label.name() == text).ok_or_else(|| "expected mean or end".into())
}

#[derive(Args)]
pub struct Info {
    /// Volume file or builtin:NAME:SIZE
    pub input: OsString,
    #[command(flatten)]
    pub raw: Raw,
}

/// The clips in the order given: each --clip-* belongs to the last --clip before it.
pub fn clips(matches: &ArgMatches) -> Result<Vec<Clip>> {
    let places = |id: &str| matches.indices_of(id).into_iter().flatten().collect::<Vec<_>>();
    let starts = places("clip");
    if starts.len() > Clip::MAX {
        return Err(usage(format!("--clip is given {} times; expected at most {}", starts.len(), Clip::MAX)));
    }
    // For each value of a flag the number of the clip that it belongs to.
    let owners = |id: &str| -> Result<Vec<usize>> {
        let flag = id.replace('_', "-");
        let mut owners = Vec::new();
        for place in places(id) {
            let Some(clip) = starts.iter().rposition(|&start| start < place) else {
                return Err(usage(format!("--{flag} stands before any --clip; give the shape first")));
            };
            if owners.last() == Some(&clip) {
                return Err(usage(format!("--{flag} is given twice for the same --clip; expected once")));
            }
            owners.push(clip);
        }
        Ok(owners)
    };
    // Mistakes in the order of flags are found before a mesh is read.
    let modes = owners("clip_mode")?;
    let translations = owners("clip_translate")?;
    let rotations = owners("clip_rotate")?;
    let scales = owners("clip_scale")?;

    let mut clips = Vec::new();
    for name in values::<OsString>(matches, "clip") {
        clips.push(Clip::remove(shape(&name).with_context(|| format!("--clip {}", shown_path(&name)))?));
    }
    for (clip, mode) in modes.into_iter().zip(values(matches, "clip_mode")) {
        clips[clip].mode = mode;
    }
    let vectors = |id| values::<[f32; 3]>(matches, id).into_iter().map(Vec3::from_array);
    for (clip, mm) in translations.into_iter().zip(vectors("clip_translate")) {
        clips[clip].pose.translate_mm = mm;
    }
    for (clip, degrees) in rotations.into_iter().zip(vectors("clip_rotate")) {
        clips[clip].pose.rotate_deg = degrees;
    }
    for (clip, factors) in scales.into_iter().zip(vectors("clip_scale")) {
        clips[clip].pose.scale = factors;
    }
    Ok(clips)
}

fn values<T: Clone + Send + Sync + 'static>(matches: &ArgMatches, flag: &str) -> Vec<T> {
    matches.get_many::<T>(flag).into_iter().flatten().cloned().collect()
}

/// Refuses what no pose can have.
fn posed(value: [f32; 3], set: impl Fn(&mut Pose, Vec3)) -> Result<[f32; 3], String> {
    let mut pose = Pose::default();
    set(&mut pose, Vec3::from_array(value));
    pose.check().map(|()| value).map_err(|error| error.to_string())
}

fn translation(text: &str) -> Result<[f32; 3], String> {
    posed(triple(text)?, |pose, mm| pose.translate_mm = mm)
}

fn rotation(text: &str) -> Result<[f32; 3], String> {
    posed(triple(text)?, |pose, degrees| pose.rotate_deg = degrees)
}

fn scale(text: &str) -> Result<[f32; 3], String> {
    let factors = match text.parse::<f32>() {
        Ok(factor) => [factor; 3],
        Err(_) => three(text, &[',']).ok_or("expected one number or three, SX,SY,SZ")?,
    };
    posed(factors, |pose, factors| pose.scale = factors)
}

fn angle(text: &str) -> Result<f32, String> {
    number(text, "an angle in degrees", |_| true)
}

fn elevation(text: &str) -> Result<f32, String> {
    number(text, "an angle from -90 to 90 degrees", |degrees| degrees.abs() <= 90.0)
}
