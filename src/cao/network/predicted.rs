//! The method `dvao`: V_AO by a network of V_o (DVAO; docs/dvao.md).
//!
//! A network is tied to its voxel: its rays are 0.17 of its cube's edge long (10 % of the diagonal). So a radius of R mm says how large a voxel of
//! the grid is, and the volume lies in a grid of whole multiples of what its halvings need, transparent around it; or cubes as it was trained on cover
//! that grid, with overlaps as long as the rays. Every value depends on every opacity, through the normalisations: any edit runs the whole net.

use super::net::{Kernels, Scratch, Weights, Window};
use super::output::{Bindings, Output};
use super::plan::Plan;
use super::resize::Grid;
use crate::ambient::Changed;
use crate::by_brick::{Carved, Gather, Target};
use crate::drive::{Part, Take};
use crate::field::Field;
use crate::field::near::Reach;
use crate::subject::Subject;
use crate::{Error, Result, stages};
use cao_gpu::{Access, Recorder, Stage};
use cao_model::network::{Network, Shape};
use cao_model::options::Cover;
use cao_model::settings::Setup;

/// Most voxels of a grid that a network sees at once: 256³.
pub const MOST: u64 = 1 << 24;

/// Where a volume lies in its grid, and the windows by which a network sees that: all of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    grid: Grid,
    dims: [u32; 3],
    windows: Vec<Window>,
}

impl Placement {
    /// For a network of this shape and rays of this length in mm.
    ///
    /// # Errors
    /// [`Error::Model`] for more voxels than [`MOST`] at once.
    pub fn new(shape: &Shape, field: &Field, radius_mm: f32, cover: Cover) -> Result<Self> {
        // Without rays nothing is occluded, and no grid is that fine.
        let step = if radius_mm == 0.0 { f32::INFINITY } else { radius_mm / shape.radius() };
        // Rounding of lengths in mm must not make a voxel more.
        let covers =
            |i: usize| ((field.dims[i] as f32 * field.spacing[i] / step) - 1e-3).ceil().max(1.0) as u64;
        let count: [u64; 3] = std::array::from_fn(covers);
        let voxel = field.spacing.map(|spacing| spacing / step);
        let product = |dims: [u64; 3]| dims.iter().fold(1u64, |product, edge| product.saturating_mul(*edge));
        if cover == Cover::Tiles
            && count.iter().any(|n| *n > u64::from(shape.edge))
            && product(count) <= u64::from(u32::MAX)
        {
            return Ok(Self::tiles(shape, count.map(|n| n as u32), voxel));
        }
        let edges = count.map(|n| n.next_multiple_of(1 << shape.levels));
        if product(edges) > MOST {
            let least = radius_mm * (product(edges) as f32 / MOST as f32).cbrt();
            let problem = format!(
                "is {radius_mm} mm, for which the network of dvao needs a grid of {} voxels; it takes {MOST} at once, some {least:.3} mm; option grid=tiles takes more",
                product(edges)
            );
            return Err(Error::refused("radius", problem));
        }
        let dims = edges.map(|edge| edge as u32);
        let before: [u32; 3] = std::array::from_fn(|i| (dims[i] - count[i] as u32) / 2);
        let window = Window { before: before.map(|b| b as i32), at: [0; 3], low: [0; 3], high: dims };
        Ok(Self { grid: Grid { dims, before, voxel }, dims, windows: vec![window] })
    }

    /// By cubes as it was trained on, of each of which the values are taken whose rays end in it.
    fn tiles(shape: &Shape, count: [u32; 3], voxel: [f32; 3]) -> Self {
        // Of the smallest cubes something has to be left.
        let (edge, overlap) = (shape.edge, (shape.radius().ceil() as u32).min((shape.edge - 1) / 2));
        let step = edge - 2 * overlap;
        // Along an axis: where each begins, and which of its voxels are taken.
        let along = |count: u32| -> Vec<[u32; 3]> {
            let last = count.saturating_sub(edge).div_ceil(step);
            let of = |k: u32| {
                let low = if k == 0 { 0 } else { overlap };
                let high = if k == last { count - k * step } else { edge - overlap };
                [k * step, low, high]
            };
            (0..=last).map(of).collect()
        };
        let mut windows = Vec::new();
        for z in along(count[2]) {
            for y in along(count[1]) {
                for x in along(count[0]) {
                    let of = |i: usize| [x[i], y[i], z[i]];
                    let at = of(0).map(|a| a as i32);
                    windows.push(Window { before: at.map(|a| -a), at, low: of(1), high: of(2) });
                }
            }
        }
        Self { grid: Grid { dims: count, before: [0; 3], voxel }, dims: [edge; 3], windows }
    }
}

fn placement(on: &Subject, network: &Network, setup: &Setup) -> Result<Placement> {
    Placement::new(network.shape(), &on.field, setup.occlusion.radius_mm, setup.options.grid)
}

/// The net, and what it gives the listed bricks.
pub struct Predicted {
    kernels: Kernels,
    output: Output,
    network: Network,
    weights: Weights,
    placement: Placement,
    scratch: Scratch,
    reach: Reach,
}

fn scratch(on: &Subject, network: &Network, placement: &Placement) -> Result<Scratch> {
    Ok(Scratch::new(&on.gpu, Plan::new(network.shape(), placement.dims), placement.grid.dims)?)
}

impl Gather for Predicted {
    const NAME: &str = "dvao";

    fn new(on: &Subject) -> Result<Self> {
        let network = on.network.clone();
        let placement = placement(on, &network, &on.setup)?;
        Ok(Self {
            kernels: Kernels::new(&on.gpu)?,
            output: Output::new(&on.gpu)?,
            weights: Weights::new(&on.gpu, &network)?,
            scratch: scratch(on, &network, &placement)?,
            network,
            placement,
            reach: Reach::Box(on.field.dims),
        })
    }

    fn set(&mut self, on: &Subject) -> Result<()> {
        let placement = placement(on, &self.network, &on.setup)?;
        if (placement.dims, placement.grid.dims) != (self.scratch.plan.dims, self.scratch.given) {
            self.scratch = scratch(on, &self.network, &placement)?;
        }
        self.placement = placement;
        Ok(())
    }

    fn accepts(&self, on: &Subject, setup: &Setup) -> Result<()> {
        placement(on, &self.network, setup).map(drop)
    }

    fn reach(&self) -> Reach {
        self.reach
    }

    fn prepare<'a>(&'a self, on: &'a Subject, from: Carved<'a>, _: Changed) -> Vec<Part<'a>> {
        if on.setup.occlusion.radius_mm == 0.0 {
            return vec![Part::short(stages::NETWORK, |rec| {
                rec.barrier(&[Access::StorageRead], &[Access::TransferWrite]);
                rec.fill(&self.scratch.values, 0, self.scratch.values.bytes(), 1.0_f32.to_bits())?;
                rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::StorageWrite]);
                Ok(())
            })];
        }
        // A voxel of the grid in mm, and what the network takes opacities to be per.
        let voxel = self.placement.grid.voxel;
        let exponent =
            self.network.shape().label.reference() * (on.field.spacing[0] / voxel[0]) / on.ambient_mm;
        let net = &self.scratch;
        let of = |window| {
            let steps = net.plan.steps.iter();
            let steps = steps.flat_map(move |step| net.step(&self.kernels, &self.weights, step, window));
            net.shrink(&self.kernels, from.opacity, window, voxel, exponent).chain(steps)
        };
        self.placement.windows.iter().flat_map(of).collect()
    }

    fn stage(&self) -> (Stage, u32) {
        // Eight reads a voxel.
        (stages::OUTPUT, 4000)
    }

    fn record(&self, rec: &mut Recorder, to: &Target, take: &Take) -> Result<()> {
        let b = Bindings {
            opacity: to.opacity,
            values: &self.scratch.values,
            list: to.list,
            ambient: to.ambient,
        };
        Ok(self.output.record(rec, &to.on.field, &self.placement.grid, to.on.setup.scope, b, take)?)
    }
}
