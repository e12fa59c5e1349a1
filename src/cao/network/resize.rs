//! Between grids (DVAO §3.2; `cao_twin::network::resize`): V_o to the grid of a network, and every second voxel of a tensor.
//!
//! In: V_o (3D r16unorm), or a tensor. Out: the grid, an f32 a voxel, or a tensor. Cost: the samples of V_o, one a voxel of V_o at least; a read and a
//! write.

use cao_gpu::Result;
use cao_gpu::{Buffer, Gpu, Image, Pipeline, Recorder, Sampler, SamplerDesc};
use cao_kernels::resize as kernel;
use std::ops::Range;

/// Where a volume lies in the grid of its ambient values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Voxels of the grid.
    pub dims: [u32; 3],
    /// Of these, before the volume begins.
    pub before: [u32; 3],
    /// A voxel of the volume, in voxels of the grid.
    pub voxel: [f32; 3],
}

/// The kernel `resize`.
pub struct Resize {
    shrink: Pipeline,
    halve: Pipeline,
    field: Sampler,
}

impl Resize {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            shrink: gpu.compute(&kernel::SHADER, "shrink")?,
            halve: gpu.compute(&kernel::SHADER, "halve")?,
            field: gpu.sampler("field", SamplerDesc { linear: true, border_zero: true })?,
        })
    }

    /// Some workgroups' voxels of a grid of `dims`, in which the volume, voxels of this size in voxels of the grid, begins at `before`, from V_o;
    /// opacities are raised to `exponent`.
    #[expect(clippy::too_many_arguments, reason = "settings and bindings of the kernel, each named once")]
    pub fn record_shrink(
        &self,
        rec: &mut Recorder,
        opacity: &Image,
        grid: &Buffer,
        dims: [u32; 3],
        before: [i32; 3],
        voxel: [f32; 3],
        exponent: f32,
        items: Range<u32>,
    ) -> Result<()> {
        let edges = opacity.desc().dims;
        let params = kernel::ResizeParams {
            dims,
            count: dims.iter().product(),
            voxel: std::array::from_fn(|i| 1.0 / (voxel[i] * edges[i] as f32)),
            exponent,
            samples: samples(voxel),
            base: items.start * kernel::TEAM,
            before,
            pad: Default::default(),
        };
        let binds = kernel::ShrinkBindings { opacity, field: &self.field, grid };
        rec.dispatch(&self.shrink, &binds, bytemuck::bytes_of(&params), [items.len() as u32, 1, 1])
    }

    /// Some workgroups' voxels of a tensor of `blocks` blocks of `dims` voxels, from one of eight times as many.
    pub fn record_halve(
        &self,
        rec: &mut Recorder,
        [source, out]: [&Buffer; 2],
        dims: [u32; 3],
        blocks: u32,
        items: Range<u32>,
    ) -> Result<()> {
        let count = dims.iter().product::<u32>() * blocks;
        let params = kernel::ResizeParams {
            dims,
            count,
            base: items.start * kernel::TEAM,
            ..bytemuck::Zeroable::zeroed()
        };
        let binds = kernel::HalveBindings { source, out };
        rec.dispatch(&self.halve, &binds, bytemuck::bytes_of(&params), [items.len() as u32, 1, 1])
    }
}

/// Samples of V_o for a voxel of the grid along each axis.
pub fn samples(voxel: [f32; 3]) -> [u32; 3] {
    // Rounding must not make one more.
    voxel.map(|voxel| (0.999 / voxel).ceil().max(1.0) as u32)
}

/// Workgroups for so many voxels.
pub fn items(voxels: u32) -> u32 {
    voxels.div_ceil(kernel::TEAM)
}
