//! The method `dvao`: V_AO by a network of V_o (DVAO; docs/dvao.md).
//!
//! A network is tied to its voxel: its rays are 0.17 of its cube's edge long (10 % of the diagonal). So a radius of R mm says how large a voxel of
//! the grid is, and the volume lies in a grid of whole multiples of what its halvings need, transparent around it. Every value depends on every
//! opacity, through the normalisations: any edit runs the whole net.

use super::net::{Kernels, Scratch, Weights};
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
use cao_gpu::{Recorder, Stage};
use cao_model::network::{Network, Shape};
use cao_model::settings::Setup;

/// Most voxels of a grid: 256³.
pub const MOST: u64 = 1 << 24;

/// Where a volume lies in the grid of a network of this shape, for rays of this length in mm.
///
/// # Errors
/// More voxels than [`MOST`].
pub fn grid(shape: &Shape, field: &Field, radius_mm: f32) -> Result<Grid> {
    let step = radius_mm / shape.radius();
    // Rounding of lengths in mm must not make a voxel more.
    let covers = |i: usize| ((field.dims[i] as f32 * field.spacing[i] / step) - 1e-3).ceil().max(1.0);
    let edge = |i: usize| (covers(i) as u64).next_multiple_of(1 << shape.levels);
    let edges: [u64; 3] = std::array::from_fn(edge);
    let voxels = edges.iter().fold(1u64, |product, edge| product.saturating_mul(*edge));
    if voxels > MOST {
        let least = radius_mm * (voxels as f32 / MOST as f32).cbrt();
        let problem = format!(
            "is {radius_mm} mm, for which the network of dvao needs a grid of {voxels} voxels; it takes {MOST} at most, some {least:.3} mm"
        );
        return Err(Error::refused("radius", problem));
    }
    Ok(Grid {
        dims: edges.map(|edge| edge as u32),
        before: std::array::from_fn(|i| (edges[i] as u32 - covers(i) as u32) / 2),
        voxel: field.spacing.map(|spacing| spacing / step),
    })
}

/// The net, and what it gives the listed bricks.
pub struct Predicted {
    kernels: Kernels,
    output: Output,
    network: Network,
    weights: Weights,
    grid: Grid,
    scratch: Scratch,
    reach: Reach,
}

impl Gather for Predicted {
    const NAME: &str = "dvao";

    fn new(on: &Subject) -> Result<Self> {
        let network = on.network.clone();
        let grid = grid(network.shape(), &on.field, on.setup.occlusion.radius_mm)?;
        Ok(Self {
            kernels: Kernels::new(&on.gpu)?,
            output: Output::new(&on.gpu)?,
            weights: Weights::new(&on.gpu, &network)?,
            scratch: Scratch::new(&on.gpu, Plan::new(network.shape(), grid.dims))?,
            network,
            grid,
            reach: Reach::Box(on.field.dims),
        })
    }

    fn set(&mut self, on: &Subject) -> Result<()> {
        let grid = grid(self.network.shape(), &on.field, on.setup.occlusion.radius_mm)?;
        if grid.dims != self.scratch.plan.dims {
            self.scratch = Scratch::new(&on.gpu, Plan::new(self.network.shape(), grid.dims))?;
        }
        self.grid = grid;
        Ok(())
    }

    fn accepts(&self, on: &Subject, setup: &Setup) -> Result<()> {
        grid(self.network.shape(), &on.field, setup.occlusion.radius_mm).map(drop)
    }

    fn reach(&self) -> Reach {
        self.reach
    }

    fn prepare<'a>(&'a self, on: &'a Subject, from: Carved<'a>, _: Changed) -> Vec<Part<'a>> {
        // A voxel of the grid in mm, and what the network takes opacities to be per.
        let step = on.field.spacing[0] / self.grid.voxel[0];
        let exponent = self.network.shape().label.reference() * step / on.ambient_mm;
        let net = &self.scratch;
        let steps = net.plan.steps.iter().flat_map(|step| net.step(&self.kernels, &self.weights, step));
        net.shrink(&self.kernels, from.opacity, &self.grid, exponent).chain(steps).collect()
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
        Ok(self.output.record(rec, &to.on.field, &self.grid, to.on.setup.scope, b, take)?)
    }
}
