//! From the grid of a network to V_AO (`cao_twin::network::output`): the value at every voxel of the listed bricks that needs one, interpolated.
//!
//! In: V_o (3D r16unorm), the grid, the list. Out: V_AO (3D r16unorm) in the listed bricks, one write a voxel. Cost: eight reads a voxel.

use super::resize::Grid;
use crate::drive::Take;
use crate::field::Field;
use crate::field::bricks::BrickList;
use cao_gpu::Result;
use cao_gpu::{Buffer, Gpu, Image, Pipeline, Recorder};
use cao_kernels::output as kernel;
use cao_model::settings::Scope;

/// The kernel `output`.
pub struct Output(Pipeline);

/// What the kernel reads and writes.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// V_o.
    pub opacity: &'a Image,
    /// Values of the grid.
    pub values: &'a Buffer,
    /// Bricks to work on.
    pub list: &'a BrickList,
    /// V_AO.
    pub ambient: &'a Image,
}

impl Output {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self(gpu.compute(&kernel::SHADER, "main")?))
    }

    /// Works on the list, or some of its bricks.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        grid: &Grid,
        scope: Scope,
        b: Bindings,
        take: &Take,
    ) -> Result<()> {
        let params = kernel::OutputParams {
            dims: field.dims,
            base: take.first(),
            bricks: field.bricks(),
            unneeded: u32::from(scope == Scope::All),
            grid: grid.dims,
            pad: 0,
            before: grid.before,
            pad_too: 0,
            voxel: grid.voxel,
            pad_1: Default::default(),
        };
        let binds = kernel::MainBindings {
            opacity: b.opacity,
            values: b.values,
            list: &b.list.buffer,
            ambient: b.ambient,
        };
        take.dispatch(rec, &self.0, &binds, bytemuck::bytes_of(&params), &b.list.buffer)
    }
}
