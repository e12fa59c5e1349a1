//! The comparison of DVAO with LAO (DVAO §5.2, Table 3, Fig. 8) rebuilt: structural similarity, mean squared error, time and memory of a network and of 16,
//! 32 and 190 rays from every voxel, against the truth that the network was trained to give.
//!
//! There are two such truths, and no number of the one stands beside one of the other: `mean`, the ambient reference (measure.md §1), which the methods of this
//! program stand for; and `end`, DVAO eq. (1) as its authors programmed it, 512 directions, whose rays with fewer directions are the paper's LAO.
//! Phantoms are cubes, R a tenth of their diagonal, opacities per voxel of 64³ (`end`: half of one), so that a scene looks the same at every size; every voxel has
//! a value and counts. Memory: a renderer at a time. Cost on two cores at 64³ and 5 runs: some three minutes a scene.

use super::front::quartiles;
use super::montage::{above, beside};
use super::pictures::{SATURATED, diverging};
use crate::Result;
use crate::error::errors;
use crate::reference::Evaluator;
use crate::ssim::{Constants, ssim_3d};
use cao::renderer::{COLOUR, Renderer};
use cao_formats::Picture;
use cao_gpu::{DeviceKind, Gpu};
use cao_model::builtin::builtin;
use cao_model::methods::Method;
use cao_model::network::{Label, Network, Shape};
use cao_model::occlusion::{Integral, Occlusion, Quadrature, RaySet};
use cao_model::settings::{Scope, Setup};
use cao_model::transfer::TransferFunction;
use cao_model::volume::Volume;
use cao_twin::Grid;

/// How much is measured.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// Voxels along each axis.
    pub edge: usize,
    /// The first so many of [`SCENES`].
    pub scenes: usize,
    /// Directions of both truths; the paper has 512.
    pub directions: u32,
    /// Timed runs of each method.
    pub runs: u32,
}

impl Plan {
    /// What a device can do: the paper's size on a GPU, half of its edge on a software driver, a quarter for a first look.
    pub fn of(gpu: &Gpu, quick: bool, runs: u32) -> Self {
        let software = gpu.info().kind == DeviceKind::Cpu;
        let (edge, scenes) = match (quick, software) {
            (true, _) => (32, 1),
            (_, true) => (64, SCENES.len()),
            _ => (128, SCENES.len()),
        };
        Self { edge, scenes, directions: 512, runs }
    }
}

/// Phantoms; `tools/train` trains on the first two kinds, not on the last.
pub const SCENES: [&str; 3] = ["engine", "skeleton", "bucky"];

/// Rays of LAO in Table 3.
pub const RAYS: [u8; 3] = [16, 32, 190];

/// DVAO Table 3 (RTX 2070, 128³): SSIM, MSE, ms, MiB; the network's, and LAO's with [`RAYS`].
pub const TABLE_3: ([f64; 4], [[f64; 4]; 3]) = (
    [0.81, 7e-3, 411.0, 1322.0],
    [[0.74, 2e-3, 87.0, 42.0], [0.83, 7e-4, 111.0, 42.0], [0.96, 8e-5, 417.0, 42.0]],
);

/// Edge of the grid whose voxels opacities are per.
const EDGE: f64 = Shape::SMALL.edge as f64;

/// What a row is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    /// The network.
    Network,
    /// Method `lao` by the rule `segment`, or `rays`, with so many directions.
    Rays(Method, u8),
    /// Rays to their ends, as the truth `end` but with so many directions. Of these there are no times: no method of this program has them.
    Ends(u8),
}

impl Of {
    /// As tables have it.
    pub fn name(self) -> String {
        match self {
            Self::Network => "DVAO".into(),
            Self::Rays(method, count) => format!("{}, {count}", method.name()),
            Self::Ends(count) => format!("LAO to its rays' ends, {count}"),
        }
    }

    /// What the paper prints in its place.
    pub fn printed(self) -> Option<[f64; 4]> {
        let (network, lao) = TABLE_3;
        match self {
            Self::Network => Some(network),
            Self::Rays(_, count) | Self::Ends(count) => {
                RAYS.iter().position(|rays| *rays == count).map(|row| lao[row])
            }
        }
    }
}

/// What was measured of one.
#[derive(Clone, Debug)]
pub struct Row {
    /// Which.
    pub of: Of,
    /// SSIM-3D with the constants of the authors' program, [`Constants::SQUARED`].
    pub ssim: f64,
    /// Mean squared error.
    pub mse: f64,
    /// Every timed update of everything, in ms.
    pub ms: Vec<f64>,
    /// Bytes of the device that a renderer with this method holds, the volume included.
    pub bytes: Option<u64>,
}

impl Row {
    /// Median.
    pub fn median(&self) -> Option<f64> {
        (!self.ms.is_empty()).then(|| quartiles(self.ms.iter().copied())[1])
    }
}

/// Everything against one truth in one scene.
#[derive(Clone, Debug)]
pub struct Against {
    /// Name of the volume.
    pub scene: &'static str,
    /// The truth.
    pub label: Label,
    /// The rows.
    pub rows: Vec<Row>,
}

/// Everything that was found.
#[derive(Clone, Debug)]
pub struct Found {
    /// Device and driver.
    pub device: [String; 2],
    /// Whether the device is a program on the processor.
    pub software: bool,
    /// What was trained.
    pub shape: Shape,
    /// Scene by scene, of each both truths.
    pub against: Vec<Against>,
    /// Fig. 8: what it shows, and the picture.
    pub figure: (String, Picture),
    /// What was asked for.
    pub plan: Plan,
}

/// Measures a network. `progress` hears what is being done and the share of the whole that is done.
///
/// # Errors
/// Those of the device.
pub fn measure(
    gpu: &Gpu,
    network: &Network,
    plan: &Plan,
    progress: &mut dyn FnMut(&str, f64),
) -> Result<Found> {
    let scenes = &SCENES[..plan.scenes.min(SCENES.len())];
    let own = network.shape().label;
    let (mut against, mut figure) = (Vec::new(), None);
    for (n, &scene) in scenes.iter().enumerate() {
        for (k, label) in Label::ALL.into_iter().enumerate() {
            let part = (n as f64 + 0.5 * k as f64) / scenes.len() as f64;
            let mut say = |what: &str| progress(&format!("{scene}, {}: {what}", label.name()), part);
            let stand = Stand::new(gpu, scene, label, network, plan)?;
            say("truth");
            let truth = stand.truth(plan.directions)?;
            say("methods");
            let rows = stand.rows(&truth, plan)?;
            if n == 0 && label == own {
                figure = Some(stand.figure(&truth, &rows));
            }
            against.push(Against { scene, label, rows: rows.into_iter().map(|(row, _)| row).collect() });
        }
    }
    let info = gpu.info();
    Ok(Found {
        device: [info.name.clone(), info.driver.clone()],
        software: info.kind == DeviceKind::Cpu,
        shape: *network.shape(),
        against,
        figure: figure.unwrap_or((String::new(), Picture { width: 0, height: 0, pixels: Vec::new() })),
        plan: *plan,
    })
}

/// A scene, and what there is to know of it.
struct Stand<'a> {
    gpu: &'a Gpu,
    name: &'static str,
    label: Label,
    network: &'a Network,
    volume: Volume,
    transfer: TransferFunction,
    grid: Grid,
    radius: f64,
    /// Of opacities, in mm.
    reference_mm: f64,
    opacity: Vec<f32>,
}

impl<'a> Stand<'a> {
    fn new(
        gpu: &'a Gpu,
        name: &'static str,
        label: Label,
        network: &'a Network,
        plan: &Plan,
    ) -> Result<Self> {
        let volume = builtin(name, plan.edge)?;
        let reference_mm = f64::from(label.reference()) * plan.edge as f64 / EDGE;
        let mut transfer = TransferFunction::preset("auto", volume.range())?;
        transfer.reference_mm = Some(reference_mm as f32);
        let grid = Grid { dims: volume.dims, spacing: volume.spacing };
        let radius = f64::from(Shape { edge: plan.edge as u32, ..Shape::PUBLISHED }.radius());
        let mut stand = Self {
            gpu,
            name,
            label,
            network,
            volume,
            transfer,
            grid,
            radius,
            reference_mm,
            opacity: Vec::new(),
        };
        let mut renderer = stand.renderer(Of::Rays(Method::Rays, 2))?;
        renderer.update(&mut |_| ())?;
        stand.opacity = renderer.read_opacity()?;
        Ok(stand)
    }

    fn renderer(&self, of: Of) -> Result<Renderer> {
        let (method, rays, rule) = match of {
            Of::Rays(Method::Lao, count) => (Method::Lao, RaySet::Spiral(count), Quadrature::Segment),
            Of::Rays(method, count) => (method, RaySet::Spiral(count), method.quadrature()),
            _ => (Method::Deep, RaySet::None, Quadrature::Network),
        };
        let base = Setup::of(method, 1.0);
        let occlusion = Occlusion { rays, quadrature: rule, radius_mm: self.radius as f32, ..base.occlusion };
        let setup = Setup { occlusion, scope: Scope::All, ..base };
        let mut renderer = Renderer::new(self.gpu, &self.volume, self.transfer.clone(), setup, COLOUR)?;
        if of == Of::Network {
            renderer.set_network(self.network.clone())?;
        }
        Ok(renderer)
    }

    /// What the label stands for, at every voxel, by so many directions.
    fn truth(&self, directions: u32) -> Result<Vec<f32>> {
        let integral = match self.label {
            Label::Mean => Integral::ambient(self.radius, 0.5, STEPS, directions, 1.0),
            Label::End => Integral::end(self.radius, directions, 1.0),
        };
        let voxels = 0..self.grid.len();
        Evaluator::new(self.gpu)?.evaluate(&self.grid, &self.opacity, voxels, &integral, self.reference_mm)
    }

    /// Rows and their values: the net where this is its label.
    fn rows(&self, truth: &[f32], plan: &Plan) -> Result<Vec<(Row, Vec<f32>)>> {
        let mut all = Vec::new();
        if self.network.shape().label == self.label {
            all.push(Of::Network);
        }
        match self.label {
            Label::Mean => {
                let counts = |method| RAYS.map(|count| Of::Rays(method, count));
                all.extend([Method::Lao, Method::Rays].into_iter().flat_map(counts));
            }
            Label::End => all.extend(RAYS.map(Of::Ends)),
        }
        all.into_iter().map(|of| self.row(of, truth, plan)).collect()
    }

    fn row(&self, of: Of, truth: &[f32], plan: &Plan) -> Result<(Row, Vec<f32>)> {
        let (mut ms, mut bytes) = (Vec::new(), None);
        let values = match of {
            Of::Ends(count) => self.truth(count.into())?,
            _ => {
                let held = || self.gpu.memory_report().iter().map(|(_, bytes)| bytes).sum::<u64>();
                let before = held();
                let mut renderer = self.renderer(of)?;
                // Warms up.
                renderer.update(&mut |_| ())?;
                bytes = Some(held() - before);
                for _ in 0..plan.runs {
                    renderer.invalidate();
                    ms.push(renderer.update(&mut |_| ())?.total());
                }
                renderer.read_ambient()?
            }
        };
        let every = vec![true; truth.len()];
        let ssim = ssim_3d(&self.grid, &values, truth, &every, Constants::SQUARED);
        let mse = errors(&values, truth, &every).mse;
        Ok((Row { of, ssim, mse, ms, bytes }, values))
    }

    /// A slice of the truth and of each row that the paper has, and their errors below.
    fn figure(&self, truth: &[f32], rows: &[(Row, Vec<f32>)]) -> (String, Picture) {
        let shown: Vec<_> =
            rows.iter().filter(|(row, _)| !matches!(row.of, Of::Rays(Method::Rays, _))).collect();
        let grey = |values: &[f32], i: usize| [(255.0 * values[i].clamp(0.0, 1.0)).round() as u8; 3];
        let values = std::iter::once(truth).chain(shown.iter().map(|(_, values)| values.as_slice()));
        let slices: Vec<Picture> = values.clone().map(|values| self.slice(|i| grey(values, i))).collect();
        let apart: Vec<Picture> =
            values.map(|values| self.slice(|i| diverging((values[i] - truth[i]) / SATURATED))).collect();
        let names: Vec<String> = shown.iter().map(|(row, _)| row.of.name()).collect();
        let shows = format!(
            "{}, the slice in the middle along z: truth, {}; below, what they are off by: white none, red too bright, blue too dark, full colour at {SATURATED}",
            self.name,
            names.join("; ")
        );
        (shows, above(&[beside(&slices), beside(&apart)]))
    }

    /// The middle one along z, pixels enlarged.
    fn slice(&self, pixel: impl Fn(usize) -> [u8; 3]) -> Picture {
        let [x, y, z] = self.grid.dims;
        let (width, height) = (x * ENLARGED, y * ENLARGED);
        let at = |i: usize| pixel(self.grid.index([i % width / ENLARGED, i / width / ENLARGED, z / 2]));
        Picture { width: width as u32, height: height as u32, pixels: (0..width * height).map(at).collect() }
    }
}

/// Steps a voxel of the ambient integral: its own error is a thousandth of what is compared with 32 rays.
const STEPS: u32 = 2;
/// Pixels a voxel.
const ENLARGED: usize = 3;

impl Found {
    /// Means over the scenes of SSIM, MSE, ms and bytes of each row against one truth.
    pub fn means(&self, label: Label) -> Vec<(Of, [f64; 2], [Option<f64>; 2])> {
        let of_label: Vec<&Against> = self.against.iter().filter(|against| against.label == label).collect();
        let Some(first) = of_label.first() else { return Vec::new() };
        let mean = |of: Of, value: &dyn Fn(&Row) -> Option<f64>| -> Option<f64> {
            let rows = of_label.iter().flat_map(|against| &against.rows).filter(|row| row.of == of);
            let values: Option<Vec<f64>> = rows.map(value).collect();
            values.map(|values| values.iter().sum::<f64>() / values.len().max(1) as f64)
        };
        let row = |of: Of| {
            let always = |value: &dyn Fn(&Row) -> f64| mean(of, &|row| Some(value(row))).unwrap_or(f64::NAN);
            let costs = [mean(of, &Row::median), mean(of, &|row| row.bytes.map(|bytes| bytes as f64))];
            (of, [always(&|row| row.ssim), always(&|row| row.mse)], costs)
        };
        first.rows.iter().map(|first| row(first.of)).collect()
    }
}
