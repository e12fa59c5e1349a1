//! The evaluation of feature-driven ambient occlusion (fdAO §5) rebuilt: Table 2, what an update of everything takes beside AO; the bricks behind
//! Table 3; Fig. 1 and Table 1 (four shadings), Fig. 3 (rules side by side), Fig. 4 (three radii).
//!
//! Scenes have as many features as the paper's: a bucky ball five, a phantom with skin, flesh and bones three (its head), an engine two (its knee).
//! 16 rays as printed, ours on a spiral. AO is `rays`. Opacities are per 1/32 of the edge, so that a scene looks the same at every size.
//! Memory: five renderers of one scene, some 25 bytes a voxel each. Cost: five updates a run and scene, 22 pictures.

use super::front::quartiles;
use super::montage::{above, beside, crop, most_different};
use crate::Result;
use cao::renderer::{COLOUR, Renderer};
use cao_formats::Picture;
use cao_gpu::{DeviceKind, Gpu};
use cao_kernels::fdao::BRICK;
use cao_model::builtin::builtin;
use cao_model::feature::{Feature, Features};
use cao_model::look::{Look, Shading};
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, RaySet};
use cao_model::options::Options;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::StereoRig;
use cao_model::volume::Volume;

/// How much is measured.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// Voxels along each axis.
    pub edge: usize,
    /// R in voxels of what is timed.
    pub radius: u32,
    /// R in voxels of pictures.
    pub shown: u32,
    /// Timed runs of each setting.
    pub runs: u32,
    /// Pixels of a picture along each axis.
    pub size: u32,
}

impl Plan {
    /// What a device can do: the paper's R in volumes of its head's size on a GPU, of a 64th of that on a software driver; less for a first
    /// look. Rays of pictures are a quarter of the edge long: in large volumes layers are many voxels thick, and shorter ones do not leave them.
    pub fn of(gpu: &Gpu, quick: bool, runs: u32) -> Self {
        let software = gpu.info().kind == DeviceKind::Cpu;
        let (edge, radius, size) = match (quick, software) {
            (true, _) => (32, 8, 192),
            (_, true) => (64, 16, 256),
            _ => (256, 16, 512),
        };
        Self { edge, radius, shown: edge as u32 / 4, runs, size }
    }

    /// R in voxels of Fig. 4: half, the same, twice.
    pub fn radii(&self) -> [u32; 3] {
        [self.shown / 2, self.shown, 2 * self.shown]
    }
}

/// A scene: the built-in volume, what the paper has in its place, what Table 2 prints for AO and fdAO in ms, its features from the outside in.
struct Built {
    name: &'static str,
    printed_as: &'static str,
    printed: [f64; 2],
    features: &'static [Part],
}

/// A feature: name, first value, opacity per 1/32 of the edge, linear colour. It ends where the next begins.
type Part = (&'static str, f32, f32, [f32; 3]);

const SCENES: [Built; 3] = [
    Built {
        name: "bucky",
        printed_as: "Bucky Ball",
        printed: [237.0, 912.0],
        features: &[
            ("haze", 20.0, 0.08, [0.20, 0.35, 0.80]),
            ("cage", 60.0, 0.12, [0.15, 0.65, 0.60]),
            ("bonds", 100.0, 0.25, [0.55, 0.75, 0.20]),
            ("balls", 145.0, 0.40, [0.90, 0.60, 0.15]),
            ("cores", 200.0, 0.95, [0.85, 0.20, 0.15]),
        ],
    },
    Built {
        name: "skeleton",
        printed_as: "Human Head",
        printed: [1339.0, 3282.0],
        features: &[
            ("skin", -500.0, 0.12, [0.80, 0.55, 0.40]),
            ("flesh", -60.0, 0.14, [0.75, 0.25, 0.20]),
            ("bones", 250.0, 0.95, [0.88, 0.85, 0.75]),
        ],
    },
    Built {
        name: "engine",
        printed_as: "CT Knee",
        printed: [2437.0, 4049.0],
        features: &[
            ("block", 40.0, 0.12, [0.55, 0.60, 0.70]),
            ("liners and valves", 130.0, 0.95, [0.85, 0.55, 0.15]),
        ],
    },
];

/// The scene of Figs. 3 and 4, as in the paper.
const HEAD: usize = 1;

/// The settings of Table 2: AO, and fdAO by its rules.
const SETTINGS: [&str; 5] = ["rays", "own", "neighbours", "max", "sample"];
/// What `fdao` does where nobody asks for a rule.
const DEFAULT: &str = SETTINGS[4];
/// Those of Fig. 3, the paper's last rule beside ours.
const RULES: [&str; 4] = ["own", "neighbours", "max", "sample"];

/// Vertical field of view of the pictures in degrees.
const FOV_DEG: f32 = 26.0;

/// Voxels around a brick that its matter can touch.
const OVERLAP: usize = 1;
/// Voxels beyond a ray's end that the kernel takes into account: what it interpolates, and one for rounding.
const BESIDE: usize = 2;

/// What was measured of a scene.
#[derive(Clone, Debug)]
pub struct SceneFound {
    /// The volume's name.
    pub name: &'static str,
    /// What the paper has in its place.
    pub printed_as: &'static str,
    /// What Table 2 prints for AO and fdAO, ms.
    pub printed: [f64; 2],
    /// Its features.
    pub features: Vec<&'static str>,
    /// Of each setting every run: ms, and ms over those of `rays` in the same run.
    pub settings: Vec<(&'static str, Vec<[f64; 2]>)>,
    /// What bricks are empty.
    pub bricks: Bricks,
}

impl SceneFound {
    /// Medians of ms and ratio.
    pub fn medians(&self, setting: &str) -> [f64; 2] {
        let runs = self.settings.iter().find(|(name, _)| *name == setting).map_or(&[][..], |(_, runs)| runs);
        [0, 1].map(|column| quartiles(runs.iter().map(|run| run[column]))[1])
    }
}

/// Numbers of bricks, of voxels and opacities alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Bricks {
    /// All.
    pub all: usize,
    /// With matter in them or touching them.
    pub matter: usize,
    /// Of these, of each feature: without any of it in them or touching them, as the paper looks.
    pub empty: Vec<usize>,
    /// Of these, of each feature: without any of it within reach of a ray, which its pass skips.
    pub skipped: Vec<usize>,
}

/// Everything that was found.
#[derive(Clone, Debug)]
pub struct Found {
    /// Device and driver.
    pub device: [String; 2],
    /// Whether the device is a program on the processor.
    pub software: bool,
    /// The scenes.
    pub scenes: Vec<SceneFound>,
    /// Pictures: number in the paper, what it shows.
    pub figures: Vec<(u32, String, Picture)>,
    /// Mean change of the lit pixels from the smallest radius of Fig. 4 to the largest, in levels of 255: LAO, fdAO.
    pub changes: [f64; 2],
    /// What was asked for.
    pub plan: Plan,
}

/// Measures. `progress` hears what is being done and the share of the whole that is done.
///
/// # Errors
/// Those of the device.
pub fn measure(gpu: &Gpu, plan: &Plan, progress: &mut dyn FnMut(&str, f64)) -> Result<Found> {
    let (mut scenes, mut shadings, mut figures) = (Vec::new(), Vec::new(), Vec::new());
    let mut changes = [0.0; 2];
    for (n, built) in SCENES.iter().enumerate() {
        let mut done =
            |what: &str, step: f64| progress(&format!("{}: {what}", built.name), (n as f64 + step) / 3.0);
        done("updates", 0.0);
        let prepared = Prepared::new(gpu, built, plan)?;
        let (settings, mut open) = prepared.race(plan)?;
        scenes.push(SceneFound {
            name: built.name,
            printed_as: built.printed_as,
            printed: built.printed,
            features: built.features.iter().map(|(name, ..)| *name).collect(),
            settings,
            bricks: bricks(&prepared.volume, &prepared.transfer, &prepared.features, plan.radius as usize),
        });
        done("pictures", 0.6);
        for (setting, renderer) in SETTINGS.into_iter().zip(&mut open) {
            renderer.set_setup(Prepared::setup(setting, plan.shown)?)?;
            renderer.update(&mut |_| ())?;
        }
        let picture = |which: usize, shading| prepared.picture(&open[which], shading, plan);
        let last = SETTINGS.len() - 1;
        shadings.push(beside(&[
            picture(0, Shading::None)?,
            picture(0, Shading::Phong)?,
            picture(0, Shading::Ao)?,
            picture(last, Shading::Ao)?,
        ]));
        if n == HEAD {
            let rules = (1..=last).map(|which| picture(which, Shading::Ao)).collect::<Result<Vec<_>>>()?;
            let at = most_different(&[rules[0].clone(), rules[2].clone()]);
            let crops: Vec<Picture> = rules.iter().map(|rule| crop(rule, at)).collect();
            let shows = format!("{}: {}, and a part of each, enlarged", built.name, RULES.join(", "));
            figures.push((3, shows, above(&[beside(&rules), beside(&crops)])));
            done("radii", 0.8);
            let (shows, radii, found) = prepared.radii(open, plan)?;
            figures.push((4, shows, radii));
            changes = found;
        }
    }
    let shows = format!(
        "{}, from the top: no light, Phong's, LAO, fdAO by {DEFAULT}",
        SCENES.map(|built| built.name).join(", ")
    );
    figures.insert(0, (1, shows, above(&shadings)));
    let info = gpu.info();
    Ok(Found {
        device: [info.name.clone(), info.driver.clone()],
        software: info.kind == DeviceKind::Cpu,
        scenes,
        figures,
        changes,
        plan: *plan,
    })
}

/// A scene as renderers take it.
struct Prepared<'a> {
    gpu: &'a Gpu,
    name: &'static str,
    volume: Volume,
    transfer: TransferFunction,
    features: Features,
}

impl<'a> Prepared<'a> {
    fn new(gpu: &'a Gpu, built: &Built, plan: &Plan) -> Result<Self> {
        let volume = builtin(built.name, plan.edge)?;
        let below = volume.range().0 as f32;
        let mut opacity = vec![[below.min(built.features[0].1 - 1.0), 0.0]];
        let mut before = 0.0;
        for &(_, first, share, _) in built.features {
            // Two points of one value make a step.
            opacity.extend([[first, before], [first, share]]);
            before = share;
        }
        let white = vec![[below, 1.0, 1.0, 1.0]];
        let transfer = TransferFunction::new(opacity, white, Some(plan.edge as f32 / 32.0))?;
        let ends = built.features.iter().skip(1).map(|part| part.1).chain([f32::INFINITY]);
        let list = built.features.iter().zip(ends).map(|(&(name, first, _, colour), end)| {
            (Feature { colour: Some(colour), ..Feature::new(name) }, [first, end])
        });
        Ok(Self {
            gpu,
            name: built.name,
            transfer,
            features: Features::by_intervals(list.collect())?,
            volume,
        })
    }

    fn setup(setting: &str, voxels: u32) -> Result<Setup> {
        let (method, options) = match setting {
            "rays" => (Method::Rays, Options::DEFAULT),
            rule => (Method::FeatureDriven, Options::DEFAULT.with(&[("combine", rule)])?),
        };
        let base = Setup::of(method, 1.0);
        let occlusion = Occlusion { rays: RaySet::Spiral(16), radius_mm: voxels as f32, ..base.occlusion };
        Ok(Setup { occlusion, options, ..base })
    }

    fn open(&self, setting: &str, voxels: u32) -> Result<Renderer> {
        let setup = Self::setup(setting, voxels)?;
        let mut renderer = Renderer::new(self.gpu, &self.volume, self.transfer.clone(), setup, COLOUR)?;
        renderer.set_features(self.features.clone())?;
        renderer.update(&mut |_| ())?;
        Ok(renderer)
    }

    /// Every setting's runs in turns, and its renderer.
    #[expect(clippy::type_complexity, reason = "two things of one race, each used once")]
    fn race(&self, plan: &Plan) -> Result<(Vec<(&'static str, Vec<[f64; 2]>)>, Vec<Renderer>)> {
        let mut open = Vec::new();
        for setting in SETTINGS {
            open.push(self.open(setting, plan.radius)?);
        }
        let mut settings = SETTINGS.map(|setting| (setting, Vec::new()));
        for _ in 0..plan.runs {
            let mut of_rays = f64::NAN;
            for (n, renderer) in open.iter_mut().enumerate() {
                renderer.invalidate();
                let ms = renderer.update(&mut |_| ())?.total();
                if n == 0 {
                    of_rays = ms;
                }
                settings[n].1.push([ms, ms / of_rays]);
            }
        }
        Ok((settings.into(), open))
    }

    fn picture(&self, renderer: &Renderer, shading: Shading, plan: &Plan) -> Result<Picture> {
        // None of the scenes has anything in the corners of its volume.
        let rig = StereoRig { fov_deg: FOV_DEG, ..StereoRig::framing(self.volume.size_mm(), 30.0, 20.0) };
        let far = 3.0 * (rig.position - rig.target).length();
        let [left, _] = rig.views(1.0, 0.02 * far, far)?;
        let (image, _) =
            renderer.draw(&[left], &Look { shading, gain: 1.0, ..Look::default() }, [plan.size; 2])?;
        Ok(Picture::over(plan.size, plan.size, &image.colour[0], [0.0; 3]))
    }

    /// Fig. 4: what it shows, the picture, and how much both rows change.
    fn radii(&self, open: Vec<Renderer>, plan: &Plan) -> Result<(String, Picture, [f64; 2])> {
        let mut rows = Vec::new();
        let mut changes = [0.0; 2];
        let wanted = [(0, SETTINGS[0]), (SETTINGS.len() - 1, DEFAULT)];
        for (n, mut renderer) in open.into_iter().enumerate() {
            let Some(row) = wanted.iter().position(|(which, _)| *which == n) else { continue };
            let mut pictures = Vec::new();
            for voxels in plan.radii() {
                renderer.set_setup(Self::setup(wanted[row].1, voxels)?)?;
                renderer.update(&mut |_| ())?;
                pictures.push(self.picture(&renderer, Shading::Ao, plan)?);
            }
            changes[row] = change(&pictures[0], &pictures[2]);
            rows.push(beside(&pictures));
        }
        let radii = plan.radii().map(|radius| radius.to_string()).join(", ");
        let shows = format!("{}: R = {radii} voxels; LAO above, fdAO by {DEFAULT} below", self.name);
        Ok((shows, above(&rows), changes))
    }
}

/// Mean change of pixels that are not black in both, in levels.
fn change(a: &Picture, b: &Picture) -> f64 {
    let lit = a.pixels.iter().zip(&b.pixels).filter(|(a, b)| **a != [0; 3] || **b != [0; 3]);
    let changes: Vec<f64> = lit.flat_map(|(a, b)| (0..3).map(|c| f64::from(a[c].abs_diff(b[c])))).collect();
    changes.iter().sum::<f64>() / changes.len().max(1) as f64
}

/// Counts bricks of a volume's features; rays are so many voxels long.
pub fn bricks(volume: &Volume, transfer: &TransferFunction, features: &Features, radius: usize) -> Bricks {
    let edge = BRICK as usize;
    let dims = volume.dims;
    let across = dims.map(|n| n.div_ceil(edge));
    let index = |[x, y, z]: [usize; 3]| x + across[0] * (y + across[1] * z);
    let all = across.iter().product();
    // A bit a feature: in the brick, and in it or touching it.
    let (mut held, mut touched) = (vec![0_u8; all], vec![0_u8; all]);
    for i in 0..volume.len() {
        let value = volume.value(i) as f32;
        let feature = features.of(i, value);
        if feature == 0 || transfer.opacity_at(value) <= 0.0 {
            continue;
        }
        let (bit, at) = (1 << (feature - 1), [i % dims[0], i / dims[0] % dims[1], i / (dims[0] * dims[1])]);
        held[index(at.map(|v| v / edge))] |= bit;
        let low = at.map(|v| v.saturating_sub(OVERLAP) / edge);
        let high: [usize; 3] = std::array::from_fn(|axis| (at[axis] + OVERLAP).min(dims[axis] - 1) / edge);
        for_box(low, high, |brick| touched[index(brick)] |= bit);
    }
    let count = features.list.len();
    let mut found = Bricks { all, matter: 0, empty: vec![0; count], skipped: vec![0; count] };
    let far = radius + BESIDE;
    for_box([0; 3], across.map(|n| n - 1), |brick| {
        let here = touched[index(brick)];
        if here == 0 {
            return;
        }
        found.matter += 1;
        let low = brick.map(|b| (b * edge).saturating_sub(far) / edge);
        let high: [usize; 3] =
            std::array::from_fn(|axis| ((brick[axis] * edge + edge + far) / edge).min(across[axis] - 1));
        let mut reached = 0;
        for_box(low, high, |other| reached |= held[index(other)]);
        for k in 0..count {
            found.empty[k] += usize::from(here >> k & 1 == 0);
            found.skipped[k] += usize::from(reached >> k & 1 == 0);
        }
    });
    found
}

/// Every place from `low` to `high`, both included.
fn for_box(low: [usize; 3], high: [usize; 3], mut each: impl FnMut([usize; 3])) {
    for z in low[2]..=high[2] {
        for y in low[1]..=high[1] {
            for x in low[0]..=high[0] {
                each([x, y, z]);
            }
        }
    }
}
