//! Flags and their meaning.

use super::scale::Series;
use super::way::Way;
use cao_cli::args::{Global, Raw, Settings, methods_help, size};
use clap::{Parser, ValueEnum};
use std::ffi::OsString;
use std::path::PathBuf;

/// Times frames for one, two or four views while head and clip move, method by method.
#[derive(Parser)]
#[command(name = "stereo-bench", version, after_help = EXAMPLES)]
pub struct Cli {
    /// Volume file or builtin:NAME:SIZE
    #[arg(default_value = "builtin:engine:128")]
    pub input: OsString,
    #[arg(long, value_name = "METHOD,...", value_delimiter = ',', value_parser = Way::parse, default_values_t = Way::all(),
        help = format!(
            "Methods, which take turns frame by frame. solid: no occlusion; {}; cao-literal: cao by the paper's recipe to the letter. One that \
             lacks the rule of --quadrature takes its own",
            methods_help()
        ))]
    pub methods: Vec<Way>,
    /// Pixels of one view
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "512x512")]
    pub size: [u32; 2],
    /// Views drawn at once: 1, 2 (left and right), 4 (and an inset for each)
    #[arg(long, value_name = "N", value_parser = views, default_value = "2")]
    pub views: usize,
    /// What the drawing of a frame is to take: resolution and distance of samples follow from the times of former frames, down to half of
    /// the pixels along each axis and samples a voxel apart
    #[arg(long, value_name = "T", value_parser = milliseconds)]
    pub draw_budget_ms: Option<f32>,
    /// What the update of the ambient volume is to take of a frame: where it does not fit it spans frames, which show the newest clip with the
    /// ambient volume of before. Says percentiles of frames and how many the volume is behind
    #[arg(long, value_name = "T", value_parser = milliseconds)]
    pub budget_ms: Option<f32>,
    /// Frames of one run that count; the path closes after 90 [default: 90, on a software driver 10]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub frames: Option<u32>,
    /// Runs, along the same path; the spread of their medians says how far to trust the numbers
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000), default_value_t = 3)]
    pub runs: u32,
    /// Frames before each run that do not count
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=1000), default_value_t = 3)]
    pub warm_up: u32,
    /// Shape that moves through the volume: plane, box, sphere, cylinder, cone, torus, or a closed mesh file.obj; none for no clip
    #[arg(long, value_name = "SHAPE|MESH.obj", default_value = "sphere")]
    pub clip: OsString,
    /// Give the clip mesh another form in every frame, so that its depth layers are drawn again
    #[arg(long)]
    pub deform: bool,
    /// Compute every voxel, not only those that a sample with opacity can touch
    #[arg(long)]
    pub all_voxels: bool,
    /// Also vary one setting at a time: size (of a built-in volume), rays, radius, resolution, views
    #[arg(long, value_name = "SETTING,...", value_delimiter = ',', value_parser = Series::parse)]
    pub scale: Vec<Series>,
    /// Write every frame as a line of comma-separated values
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Keep the run in FOLDER/DATE-DEVICE: raw.csv, summary, README.md with command, versions and hardware
    /// [default of FOLDER: benches/runs]
    #[arg(long, value_name = "FOLDER", num_args = 0..=1, default_missing_value = "benches/runs")]
    pub save: Option<PathBuf>,
    /// Measure what the project holds itself to and exit with 1 where a bar is missed; every other setting is the bar's own. Of some parts
    /// alone: volumes, networks, meshes
    #[arg(long, value_enum, value_name = "PART,...", value_delimiter = ',', num_args = 0.., require_equals = true,
        default_missing_values = ["volumes", "networks", "meshes"])]
    pub bars: Vec<Part>,
    /// Folder with volumes/engine_256x256x128_uint8.nrrd and volumes/torso_s0024_287x287x486_uint8.nrrd, for the bars on real
    /// volumes
    #[arg(long, value_name = "DIR", requires = "bars")]
    pub data: Option<PathBuf>,
    /// Measure 1024³ voxels too: some 6 GiB of device memory
    #[arg(long, requires = "bars")]
    pub large: bool,
    #[command(flatten)]
    pub settings: Settings,
    #[command(flatten)]
    pub raw: Raw,
    #[command(flatten)]
    pub global: Global,
}

/// Parts of the bars.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// Updates and pictures of volumes.
    Volumes,
    /// Method `dvao`.
    Networks,
    /// Occlusion of pixels that show meshes.
    Meshes,
}

const EXAMPLES: &str = "\
Examples:
  stereo-bench                                 the built-in engine block, all methods
  stereo-bench builtin:engine:64 --size 128x128 --frames 30 --runs 1     in seconds
  stereo-bench head.nrrd --transfer ct-bone --clip plane --views 4
  stereo-bench builtin:skeleton:512 --radius-mm 50 --rays 54 --size 2064x2208
  stereo-bench --methods lao,cao --scale rays,radius,views --csv frames.csv
  stereo-bench --scale size,rays,radius,resolution,views --save
  stereo-bench --methods rays --budget-ms 4 --frames 90     a clip that moves, updates of at most 4 ms a frame
  stereo-bench --bars --data DIR               minutes on a software driver
  stereo-bench --bars=meshes                   only those

The path: in 90 frames the head goes once round an ellipse of 20 degrees of
azimuth and 8 of elevation about a place from which the volume fills the
picture, a tenth nearer and farther on the way. The clip, whose half-size is
a fifth of the volume's shortest edge, goes once round a loop of nearly half
the volume and turns once about z. Both depend on the frame's number alone.

What is printed: percentiles are frames that were measured (nearest rank). The
stages are those of the paper's Fig. 9: clipping (its step 4), spherical ray
cast (step 5), rendering (step 6), overhead (the rest of the frame's time).

Exit codes: 0 done, 1 failed, 2 wrong usage.";

fn milliseconds(text: &str) -> Result<f32, String> {
    let ms = text.parse().ok().filter(|ms: &f32| ms.is_finite() && *ms > 0.0);
    ms.ok_or_else(|| "expected a number > 0".into())
}

fn views(text: &str) -> Result<usize, String> {
    match text {
        "1" => Ok(1),
        "2" => Ok(2),
        "4" => Ok(4),
        _ => Err("expected 1, 2 or 4".into()),
    }
}
