//! The comparison of ambient occlusion volumes with ray tracing and with methods of image space (AOV §6, Fig. 5, 9, 10, 11) rebuilt: seven scenes, and scans
//! that one has, by the rows of Fig. 9, milliseconds and the error of eq. (31) of accessibility in 8 bits, against rays.
//!
//! All have one G-buffer of the left eye alone, and compute its accessibility and nothing else, as in the paper. Rows of rays are not part of the reference's
//! rays: they are those of a second view of the same pixels, whose shifts are others; only the reference's own first half is a part of it. Times are
//! timestamps of the phase `Ambient`. Cost on two cores at 160 × 90 with 1,000 rays: some minutes.

use super::front::quartiles;
use super::meshes_overdraw::Overdraw;
use super::meshes_printed::{FIGURE_9, Printed};
use super::meshes_scenes::{About, MeshScene};
use crate::Result;
use crate::error::{Accessibility, aov_error, errors};
use crate::kernels::overdraw::Overdraw as Counter;
use crate::shown::shown;
use cao::host::read_buffer;
use cao::image_space::method::ByImage;
use cao::mesh::ambient::{ByRays, ByVolumes, PixelAmbient, Pixels};
use cao::mesh::gather::Scene;
use cao::mesh::geometry::Geometry;
use cao::mesh::surfaces::Surfaces;
use cao::mesh::volumes::Volumes;
use cao_formats::Picture;
use cao_gpu::{Access, Buffer, DeviceKind, Gpu, Phase};
use cao_model::image_space::{Crytek, Hbao, ImageMethod, Volumetric};
use cao_model::scenes::SCENES;
use cao_model::surface::World;
use cao_model::view::View;

/// How much is measured.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// Pixels of the view.
    pub size: [u32; 2],
    /// Rays a pixel of the reference; the paper has 5,000.
    pub rays: u32,
    /// Timed runs of each row.
    pub runs: u32,
    /// The scenes' detail where it is not their own.
    pub detail: Option<u32>,
    /// Whether the best δ is sought, a quarter of it all.
    pub sought: bool,
}

impl Plan {
    /// What a device can do: the paper's size on a GPU, an eighth of its edges and a fifth of its rays on a software driver, little for a first look.
    pub fn of(gpu: &Gpu, quick: bool, size: Option<[u32; 2]>, rays: Option<u32>, runs: u32) -> Self {
        let software = gpu.info().kind == DeviceKind::Cpu;
        let (pixels, most) = match (quick, software) {
            (true, _) => ([48, 27], 64),
            (_, true) => ([160, 90], 1000),
            _ => ([1280, 720], PRINTED_RAYS),
        };
        let (size, rays, detail) = (size.unwrap_or(pixels), rays.unwrap_or(most), quick.then_some(1));
        Self { size, rays, runs, detail, sought: true }
    }

    /// For a panel of the chart beside all others, at a small part of their time.
    pub fn panel(gpu: &Gpu, quick: bool, runs: u32) -> Self {
        let software = gpu.info().kind == DeviceKind::Cpu;
        let (size, rays) = if software { ([96, 54], 256) } else { ([640, 360], 1000) };
        let first = Self::of(gpu, quick, (!quick).then_some(size), (!quick).then_some(rays), runs);
        Self { detail: quick.then_some(1), sought: false, ..first }
    }
}

/// Rays a pixel of the paper's reference.
pub const PRINTED_RAYS: u32 = 5000;

/// Of a row of so many rays one run is a mean of many submissions already.
const MANY_RAYS: u32 = 100;

/// δ of the volumes and of Volumetric AO over that of rays, as printed (AOV §6.1).
pub const FACTORS: [f32; 2] = [0.6, 1.1];

/// Factors that best ones are sought among.
pub const SOUGHT: [f32; 7] = [0.3, 0.45, 0.6, 0.8, 1.0, 1.1, 1.5];

/// What a row is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    /// So many rays of [`PRINTED_RAYS`], 1 of which is one whatever the reference has; all of them are the reference.
    Rays(u32),
    /// Volumes gathered, at every so many-th pixel in each direction.
    Gathered(u32),
    /// Volumes drawn, their corners made beforehand or by each vertex.
    Drawn {
        /// Made beforehand.
        is_static: bool,
    },
    /// Volumes gathered whose corners are clamped to 2 δ, as printed.
    Clamped,
    /// Volumetric AO with so many lines.
    Volumetric(u32),
    /// Crytek SSAO.
    Crytek,
    /// Horizon-based ambient occlusion.
    Hbao,
}

/// All rows, the reference first.
pub const ROWS: [Of; 18] = [
    Of::Rays(PRINTED_RAYS),
    Of::Rays(PRINTED_RAYS / 2),
    Of::Rays(1941),
    Of::Rays(292),
    Of::Rays(1),
    Of::Gathered(1),
    Of::Drawn { is_static: true },
    Of::Drawn { is_static: false },
    Of::Clamped,
    Of::Gathered(3),
    Of::Gathered(5),
    Of::Gathered(15),
    Of::Volumetric(1024),
    Of::Volumetric(256),
    Of::Volumetric(32),
    Of::Volumetric(1),
    Of::Crytek,
    Of::Hbao,
];

/// Columns of the picture, as Fig. 11 has them.
pub const SHOWN: [Of; 4] = [Of::Rays(PRINTED_RAYS), Of::Gathered(1), Of::Volumetric(1024), Of::Crytek];

impl Of {
    /// Rays a pixel where the reference has `all`.
    fn rays(part: u32, all: u32) -> u32 {
        match part {
            1 => 1,
            _ => (f64::from(part) / f64::from(PRINTED_RAYS) * f64::from(all)).round().max(1.0) as u32,
        }
    }

    /// As tables have it, where the reference has so many rays.
    pub fn name(self, all: u32) -> String {
        match self {
            Self::Rays(part) if part == PRINTED_RAYS / 2 => {
                format!("rays, {}, the reference's first half", Self::rays(part, all))
            }
            Self::Rays(part) => format!("rays, {}", Self::rays(part, all)),
            Self::Gathered(1) => "AOV, 1".into(),
            Self::Gathered(step) => format!("AOV, 1/{} 5x5", step * step),
            Self::Drawn { is_static: true } => "AOV, 1, drawn, static".into(),
            Self::Drawn { is_static: false } => "AOV, 1, drawn, dynamic".into(),
            Self::Clamped => "AOV, 1, clamped at 2 δ".into(),
            Self::Volumetric(samples) => format!("Volumetric, {samples}"),
            Self::Crytek => "Crytek, 16 4x4".into(),
            Self::Hbao => "HBAO, 16 directions 15x15".into(),
        }
    }

    /// ms and error that the paper prints in its place.
    pub fn printed(self, scene: &str) -> Option<[f64; 2]> {
        Printed::of(scene)?.row(self)
    }

    /// δ over that of rays.
    pub fn factor(self) -> f32 {
        match self {
            Self::Gathered(_) | Self::Drawn { .. } | Self::Clamped => FACTORS[0],
            Self::Volumetric(_) => FACTORS[1],
            Self::Rays(_) | Self::Crytek | Self::Hbao => 1.0,
        }
    }

    /// The method, of rays with this number and of images with this radius.
    fn method(self, gpu: &Gpu, all: u32, radius_mm: f32) -> Result<Box<dyn PixelAmbient>> {
        let image = match self {
            Self::Rays(part) => return Ok(Box::new(ByRays::new(gpu, Self::rays(part, all))?)),
            Self::Gathered(step) => return Ok(Box::new(ByVolumes::new(gpu, step, false)?)),
            Self::Drawn { is_static } => return Ok(Box::new(Volumes::new(gpu, is_static, false)?)),
            Self::Clamped => return Ok(Box::new(ByVolumes::new(gpu, 1, true)?)),
            Self::Volumetric(samples) => ImageMethod::Volumetric(Volumetric { radius_mm, samples }),
            Self::Crytek => ImageMethod::Crytek(Crytek { radius_mm }),
            // 16 directions in place of 16/4, a filter of 15 pixels.
            Self::Hbao => {
                ImageMethod::Hbao(Hbao { radius_mm, directions: 16, bias_deg: 30.0, falloff: true, reach: 7 })
            }
        };
        Ok(Box::new(ByImage::new(gpu, image)?))
    }
}

/// What was measured of one.
#[derive(Clone, Debug)]
pub struct Row {
    /// Which.
    pub of: Of,
    /// Eq. (31), of the whole image.
    pub error: f64,
    /// Root mean squared error of 1 − AO, of pixels that show a surface.
    pub rmse: f64,
    /// Every timed run, in ms.
    pub ms: Vec<f64>,
}

impl Row {
    /// Median.
    pub fn median(&self) -> f64 {
        quartiles(self.ms.iter().copied())[1]
    }
}

/// Everything of one scene.
#[derive(Clone, Debug)]
pub struct SceneFound {
    /// Which.
    pub scene: About,
    /// Its triangles, each of which has a volume.
    pub triangles: usize,
    /// Share of the pixels that show a surface.
    pub covered: f64,
    /// The rows that the device has.
    pub rows: Vec<Row>,
    /// Eq. (31) with δ times each of [`SOUGHT`], of volumes and of Volumetric AO with 1024 lines; where it was sought.
    pub fits: Option<[[f64; SOUGHT.len()]; 2]>,
    /// How many volumes each pixel lies in; and with clamped corners.
    pub overdraw: [Overdraw; 2],
    /// Accessibility by [`SHOWN`].
    pub pictures: Vec<Picture>,
    /// What has no row, and why.
    pub left_out: Vec<String>,
}

impl SceneFound {
    /// A row.
    pub fn row(&self, of: Of) -> Option<&Row> {
        self.rows.iter().find(|row| row.of == of)
    }

    /// Eq. (31); NaN where there is none.
    pub fn error(&self, of: Of) -> f64 {
        self.row(of).map_or(f64::NAN, |row| row.error)
    }

    /// Time over that of volumes at every pixel, gathered.
    pub fn ratio(&self, of: Of) -> f64 {
        let ms = |of| self.row(of).map_or(f64::NAN, Row::median);
        ms(of) / ms(Of::Gathered(1))
    }

    /// Time of volumes that are dynamic over that of static ones, both drawn.
    pub fn dynamic(&self) -> f64 {
        self.ratio(Of::Drawn { is_static: false }) / self.ratio(Of::Drawn { is_static: true })
    }

    /// The best of [`SOUGHT`] for volumes and for Volumetric AO, and the error with it.
    pub fn best(&self) -> Option<[(f32, f64); 2]> {
        let best = |errors: [f64; SOUGHT.len()]| {
            let all = SOUGHT.into_iter().zip(errors);
            all.min_by(|a, b| a.1.total_cmp(&b.1)).expect("some are sought")
        };
        self.fits.map(|fits| fits.map(best))
    }
}

/// Everything that was found.
#[derive(Clone, Debug)]
pub struct Found {
    /// Device and driver.
    pub device: [String; 2],
    /// Whether the device is a program on the processor.
    pub software: bool,
    /// Scene by scene.
    pub scenes: Vec<SceneFound>,
    /// What was asked for.
    pub plan: Plan,
}

/// Measures the seven scenes, and more. `progress` hears what is being done and the share of the whole that is done.
///
/// # Errors
/// Those of the device.
pub fn measure(
    gpu: &Gpu,
    plan: &Plan,
    more: Vec<MeshScene>,
    progress: &mut dyn FnMut(&str, f64),
) -> Result<Found> {
    // Pipelines last while somebody has them: compiled once for all scenes.
    let mut held: Vec<Box<dyn PixelAmbient>> = Vec::new();
    for of in [Of::Rays(1), Of::Gathered(3), Of::Clamped, Of::Crytek] {
        held.push(of.method(gpu, plan.rays, 1.0)?);
    }
    let drawn = Volumes::new(gpu, true, false);
    let mut scenes = Vec::new();
    let count = (SCENES.len() + more.len()) as f64;
    let built = SCENES.iter().map(|scene| MeshScene::built(scene, plan.detail.unwrap_or(scene.detail)));
    for (n, scene) in built.chain(more).enumerate() {
        let name = scene.about.name.clone();
        let stand = Stand::new(gpu, scene, plan)?;
        scenes.push(stand.measure(&mut |what, share| {
            progress(&format!("{name}: {what}"), (n as f64 + share) / count);
        })?);
    }
    drop((held, drawn));
    let info = gpu.info();
    Ok(Found {
        device: [info.name.clone(), info.driver.clone()],
        software: info.kind == DeviceKind::Cpu,
        scenes,
        plan: *plan,
    })
}

/// A scene on the device, seen once, and twice.
struct Stand<'a> {
    gpu: &'a Gpu,
    scene: About,
    plan: &'a Plan,
    triangles: usize,
    surfaces: Surfaces,
    once: Seen,
    twice: Seen,
    /// Pixels that show a surface.
    shown: Vec<bool>,
}

/// What so many views of the same pixels show, and values of them.
struct Seen {
    geometry: Geometry,
    accessibility: Buffer,
}

impl Seen {
    fn new(gpu: &Gpu, surfaces: &Surfaces, size: [u32; 2], views: &[View]) -> Result<Self> {
        let geometry = shown(gpu, surfaces, size, views)?;
        Ok(Self { accessibility: geometry.values(gpu, "accessibility")?, geometry })
    }
}

impl<'a> Stand<'a> {
    fn new(gpu: &'a Gpu, scene: MeshScene, plan: &'a Plan) -> Result<Self> {
        let MeshScene { about: scene, instances } = scene;
        let world = World::new(&instances)?;
        let surfaces = Surfaces::new(gpu, &world)?;
        let size = plan.size;
        let [left, _] = scene.eye.views(size[0] as f32 / size[1] as f32, 1.0, 1e5)?;
        let once = Seen::new(gpu, &surfaces, size, &[left])?;
        let twice = Seen::new(gpu, &surfaces, size, &[left, left])?;
        let pixels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&read_buffer(gpu, &once.geometry.pixels)?);
        let shown = pixels.iter().map(|[.., depth]| *depth != 0.0).collect();
        Ok(Self { gpu, scene, plan, triangles: world.triangles.len(), surfaces, once, twice, shown })
    }

    /// Values of the first view or, where there are two, of the second; ms of each timed run.
    fn run(&self, of: Of, factor: f32, runs: u32) -> Result<(Vec<f32>, Vec<f64>)> {
        let delta_mm = factor * self.scene.delta_mm;
        // Rays with other shifts than the reference's.
        let apart = matches!(of, Of::Rays(part) if part < PRINTED_RAYS / 2);
        let seen = if apart { &self.twice } else { &self.once };
        let on = Pixels { gpu: self.gpu, geometry: &seen.geometry, surfaces: &self.surfaces, delta_mm };
        let mut method = of.method(self.gpu, self.plan.rays, delta_mm)?;
        method.prepare(&on)?;
        let once = || -> Result<f64> {
            let mut ms = 0.0;
            for part in 0..method.parts(&on) {
                let mut rec = self.gpu.recorder("occlusion of meshes")?;
                rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
                method.record(&mut rec, &on, part, &seen.accessibility)?;
                ms += rec.submit_and_wait()?.of(Phase::Ambient);
            }
            Ok(if apart { 0.5 * ms } else { ms })
        };
        let ms = (0..runs).map(|_| once()).collect::<Result<Vec<_>>>()?;
        let values: Vec<f32> = bytemuck::pod_collect_to_vec(&read_buffer(self.gpu, &seen.accessibility)?);
        Ok((values[values.len() - self.shown.len()..].to_vec(), ms))
    }

    /// Its values and its row.
    fn row(&self, of: Of, truth: Option<&[f32]>) -> Result<(Vec<f32>, Row)> {
        let many = matches!(of, Of::Rays(part) if Of::rays(part, self.plan.rays) > MANY_RAYS);
        // The first of several compiles and warms up.
        let (values, mut ms) = self.run(of, of.factor(), if many { 1 } else { 1 + self.plan.runs })?;
        if !many {
            ms.remove(0);
        }
        let truth = truth.unwrap_or(&values);
        let rmse = errors(&values, truth, &self.shown).rmse;
        Ok((values.clone(), Row { of, error: self.error(&values, truth), rmse, ms }))
    }

    fn error(&self, values: &[f32], truth: &[f32]) -> f64 {
        let width = self.plan.size[0] as usize;
        let [found, reference] = [eight_bits(values), eight_bits(truth)];
        aov_error(Accessibility { width, pixels: &found }, Accessibility { width, pixels: &reference })
    }

    fn measure(&self, progress: &mut dyn FnMut(&str, f64)) -> Result<SceneFound> {
        let mut found = SceneFound {
            scene: self.scene.clone(),
            triangles: self.triangles,
            covered: self.shown.iter().filter(|shown| **shown).count() as f64 / self.shown.len() as f64,
            rows: Vec::new(),
            fits: None,
            overdraw: [self.overdraw(false)?, self.overdraw(true)?],
            pictures: Vec::new(),
            left_out: Vec::new(),
        };
        let name = |of: Of| of.name(self.plan.rays);
        progress(&name(ROWS[0]), 0.0);
        let (truth, row) = self.row(ROWS[0], None)?;
        found.rows.push(row);
        found.pictures.push(self.picture(&truth));
        for (n, of) in ROWS.into_iter().enumerate().skip(1) {
            // The reference is a third of it all, the search for δ a quarter.
            progress(&name(of), 0.35 + 0.4 * n as f64 / ROWS.len() as f64);
            match self.row(of, Some(&truth)) {
                Ok((values, row)) => {
                    if SHOWN.contains(&of) {
                        found.pictures.push(self.picture(&values));
                    }
                    found.rows.push(row);
                }
                // A device need not blend floats.
                Err(refusal) if matches!(of, Of::Drawn { .. }) => {
                    found.left_out.push(format!("{}: {refusal}", name(of)));
                }
                Err(other) => return Err(other),
            }
        }
        if self.plan.sought {
            let fits = found.fits.insert([[0.0; SOUGHT.len()]; 2]);
            for (fits, of) in fits.iter_mut().zip([Of::Gathered(1), Of::Volumetric(1024)]) {
                for (error, factor) in fits.iter_mut().zip(SOUGHT) {
                    progress(&format!("{}, δ × {factor}", name(of)), 0.75);
                    *error = self.error(&self.run(of, factor, 1)?.0, &truth);
                }
            }
        }
        Ok(found)
    }

    /// How many volumes each pixel of the view lies in.
    fn overdraw(&self, clamped: bool) -> Result<Overdraw> {
        let delta_mm = FACTORS[0] * self.scene.delta_mm;
        let volumes = self.surfaces.volumes(self.gpu, delta_mm, clamped)?;
        let (geometry, surfaces) = (&self.once.geometry, &self.surfaces);
        let on = Scene { geometry, surfaces, volumes: &volumes, delta_mm };
        let [width, height] = self.plan.size;
        Ok(Overdraw { width, height, counts: Counter::new(self.gpu)?.read(self.gpu, on)? })
    }

    fn picture(&self, values: &[f32]) -> Picture {
        let [width, height] = self.plan.size;
        Picture { width, height, pixels: eight_bits(values).into_iter().map(|grey| [grey; 3]).collect() }
    }
}

/// Accessibility as the paper's images have it.
fn eight_bits(values: &[f32]) -> Vec<u8> {
    values.iter().map(|value| (255.0 * value.clamp(0.0, 1.0)).round() as u8).collect()
}

/// A claim about all scenes, and where it holds.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// What is claimed.
    pub claim: &'static str,
    /// Scenes of ours, of the seven, in which it holds.
    pub holds: Vec<String>,
    /// In how many of the seven the printed numbers have it.
    pub printed: usize,
}

/// Scenes in which a claim has to hold.
pub const ENOUGH: usize = 5;

impl Verdict {
    /// In enough of them.
    pub fn reached(&self) -> bool {
        self.holds.len() >= ENOUGH
    }
}

impl Found {
    /// Scenes that stand for the paper's: all but scans.
    pub fn built(&self) -> impl Iterator<Item = &SceneFound> {
        self.scenes.iter().filter(|found| found.scene.is_built)
    }

    /// The printed order of the seven scenes, claim by claim.
    pub fn verdicts(&self) -> Vec<Verdict> {
        type Claim = fn(&dyn Fn(Of) -> f64) -> bool;
        /// Whether one ray errs by more than these rows.
        fn worse_than(rows: impl Fn(Of) -> bool, error: &dyn Fn(Of) -> f64) -> bool {
            let one = error(Of::Rays(1));
            let mut others = ROWS.into_iter().filter(|of| *of != Of::Rays(1) && rows(*of)).map(error);
            // What has no row is no other.
            others.all(|other| other.is_nan() || one > other)
        }
        let claims: [(&'static str, Claim); 5] = [
            ("AOV full < Volumetric 1024 and < Crytek", |error| {
                let aov = error(Of::Gathered(1));
                aov < error(Of::Volumetric(1024)) && aov < error(Of::Crytek)
            }),
            ("ray 1 is the worst of all", |error| worse_than(|_| true, error)),
            ("ray 1 is the worst but for Volumetric", |error| {
                worse_than(|of| !matches!(of, Of::Volumetric(_)), error)
            }),
            ("ray 1 is the worst of rays and AOV", |error| {
                let rows = |of| matches!(of, Of::Rays(_) | Of::Gathered(_) | Of::Drawn { .. } | Of::Clamped);
                worse_than(rows, error)
            }),
            ("Volumetric levels off: 1024 no better than .8 of 256", |error| {
                error(Of::Volumetric(1024)) >= 0.8 * error(Of::Volumetric(256))
            }),
        ];
        let verdict = |(claim, holds): (&'static str, Claim)| Verdict {
            claim,
            holds: self
                .built()
                .filter(|found| holds(&|of| found.error(of)))
                .map(|found| found.scene.name.clone())
                .collect(),
            printed: FIGURE_9
                .iter()
                .filter(|printed| holds(&|of: Of| printed.row(of).map_or(f64::NAN, |[_, error]| error)))
                .count(),
        };
        claims.into_iter().map(verdict).collect()
    }
}
