//! What a net is to give for an opacity volume of edge³ voxels (DVAO §3.1), by the fastest exact ways:
//!
//! ```text
//! mean   the mean transmittance along rays of ρ voxels, opacity per voxel: V_AO by method `rays` with 50 directions
//! end    the transmittance at their ends, opacity per half voxel: DVAO eq. (1) as programmed, 64 directions
//! ```
//!
//! ρ is a tenth of the cube's diagonal. Cost on two cores at 64³: a second each.

use crate::Result;
use crate::error::{Errors, errors};
use crate::reference::{self, Evaluator};
use cao::renderer::{COLOUR, Renderer};
use cao_gpu::Gpu;
use cao_model::methods::Method;
use cao_model::network::{Label, Shape};
use cao_model::occlusion::{Integral, Occlusion, RaySet};
use cao_model::settings::{Scope, Setup};
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::volume::Volume;
use cao_twin::Grid;

/// Directions of each label.
const MEAN_RAYS: RaySet = RaySet::Spiral(50);
const END_RAYS: u32 = 64;
/// Of the reference that labels are compared with: as many as make its own error small beside theirs.
const CHECK: reference::Plan =
    reference::Plan { max_voxels: 1000, directions: 512, steps_per_voxel: 4, ..reference::Plan::FULL };

/// Length of the rays in voxels, of a cube of this edge.
pub fn radius(edge: usize) -> f64 {
    let shape = Shape { edge: edge as u32, ..Shape::PUBLISHED };
    f64::from(shape.radius())
}

/// A device that computes labels of cubes of one size.
pub struct Labels<'a> {
    gpu: &'a Gpu,
    renderer: Renderer,
    evaluator: Evaluator<'a>,
    grid: Grid,
}

impl<'a> Labels<'a> {
    /// Builds the pipelines. Uses the device's queue and waits for it.
    pub fn new(gpu: &'a Gpu, edge: usize) -> Result<Self> {
        let grid = Grid { dims: [edge; 3], spacing: [1.0; 3] };
        let opacity = vec![[0.0, 0.0], [65535.0, 1.0]];
        let transfer = TransferFunction::new(opacity, vec![[0.0, 1.0, 1.0, 1.0]], Some(1.0))?;
        let setup = Setup::of(Method::Rays, 1.0);
        // Whole steps up to the radius itself.
        let radius_mm = radius(edge) as f32;
        let step_mm = Some(radius_mm / radius_mm.round());
        let occlusion = Occlusion { rays: MEAN_RAYS, radius_mm, step_mm, ..setup.occlusion };
        let setup = Setup { occlusion, scope: Scope::All, ..setup };
        let empty = volume(&grid, vec![0; grid.len()])?;
        let renderer = Renderer::new(gpu, &empty, transfer, setup, COLOUR)?;
        Ok(Self { gpu, renderer, evaluator: Evaluator::new(gpu)?, grid })
    }

    /// Of opacities in 65535ths, x fastest. Uses the device's queue and waits for it.
    pub fn of(&mut self, label: Label, opacity: &[u16]) -> Result<Vec<f32>> {
        match label {
            Label::Mean => {
                self.renderer.set_values([0; 3], &volume(&self.grid, opacity.to_vec())?)?;
                self.renderer.update(&mut |_| ())?;
                Ok(self.renderer.read_ambient()?)
            }
            Label::End => self.end(&shares(opacity), 1, END_RAYS),
        }
    }

    /// Of every `nth` voxel.
    fn end(&self, opacity: &[f32], nth: usize, directions: u32) -> Result<Vec<f32>> {
        let integral = Integral::end(radius(self.grid.dims[0]), directions, 1.0);
        let voxels = (0..self.grid.len()).step_by(nth);
        self.evaluator.evaluate(&self.grid, opacity, voxels, &integral, Label::End.reference().into())
    }

    /// The error of a label to the converged reference: of `mean` at a sample of the voxels near matter, of `end` at one of all. Uses the
    /// device's queue and waits for it.
    pub fn check(&self, label: Label, opacity: &[u16], found: &[f32]) -> Result<Errors> {
        let opacity = shares(opacity);
        let (grid, radius, length) = (&self.grid, radius(self.grid.dims[0]), f64::from(label.reference()));
        match label {
            Label::Mean => {
                let truth =
                    reference::ambient(self.gpu, grid, &opacity, radius, 0.5, length, &CHECK, &mut |_| ())?;
                Ok(errors(found, &truth.ambient, &truth.counts))
            }
            Label::End => {
                let nth = grid.len().div_ceil(CHECK.max_voxels) | 1;
                let truth = self.end(&opacity, nth, CHECK.directions)?;
                let found: Vec<f32> = found.iter().copied().step_by(nth).collect();
                Ok(errors(&found, &truth, &vec![true; truth.len()]))
            }
        }
    }
}

fn volume(grid: &Grid, opacity: Vec<u16>) -> Result<Volume> {
    Ok(Volume::new(grid.dims, grid.spacing, Values::U16(opacity))?)
}

/// 65535ths as numbers from 0 to 1.
fn shares(opacity: &[u16]) -> Vec<f32> {
    opacity.iter().map(|a| f32::from(*a) / 65535.0).collect()
}
