//! Dilation maps of a mesh clip (CAO §3.4 step 3, eq. (4)): the Minkowski sum of its depth layers and a sphere, or for a kept
//! shape the contraction by it.
//!
//! In: `layers` (`pairs` × front, back × Z² f32). Out: `dilation` (the same × D² f32), on a wider map. Conservative: maps stand
//! for cells, distances are between cells, so every point within the radius of any point of the layers is inside; the
//! literal recipe (D = Z, distances between centres) is kept to show that it is not. Cost: (2·radius/cell)² reads a cell.

use crate::clip::clips::MeshClip;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Pipeline, Recorder};
use cao_kernels::dilate as kernel;

/// The kernel `dilate`.
pub struct Dilate {
    reduce: Pipeline,
    main: Pipeline,
}

impl Dilate {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            reduce: gpu.compute(&kernel::SHADER, "reduce")?,
            main: gpu.compute(&kernel::SHADER, "main")?,
        })
    }

    /// Working memory for one mesh: the hulls of the blocks.
    pub fn blocks(gpu: &Gpu, cells: u32, pairs: u32) -> Result<Buffer> {
        gpu.buffer("dilation blocks", 8 * u64::from(cells * cells) * u64::from(pairs), BufferUse::Device)
    }

    /// Fills the dilation maps of one mesh clip for this radius in mm, of as many pairs as `groups` says, which begins with the group counts
    /// over cells and pairs ([`Peeled`](cao_kernels::shared::peeled::Peeled)).
    #[expect(clippy::too_many_arguments, reason = "a mesh and four buffers, each named once")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        clip: &MeshClip,
        radius: f32,
        layers: &Buffer,
        blocks: &Buffer,
        dilation: &Buffer,
        groups: &Buffer,
    ) -> Result<()> {
        let camera = clip.camera;
        let params = kernel::DilateParams {
            resolution: camera.resolution,
            cells: clip.cells.resolution,
            layers_at: clip.layers_at,
            dilation_at: clip.dilation_at,
            radius,
            cell_mm: clip.cells.pixel_mm,
            depth_mm: camera.depth_mm,
            flags: if clip.keep { kernel::KEEP } else { 0 } | if clip.literal { kernel::LITERAL } else { 0 },
            per_cell: clip.cells.pixel_mm / camera.pixel_mm,
        };
        let push = bytemuck::bytes_of(&params);
        let binds = kernel::ReduceBindings { layers, blocks };
        rec.dispatch_indirect(&self.reduce, &binds, push, groups, 0)?;
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
        let binds = kernel::MainBindings { blocks, dilation };
        rec.dispatch_indirect(&self.main, &binds, push, groups, 0)
    }
}
