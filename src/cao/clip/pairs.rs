//! Layer pairs of a clip mesh: a pair begins where the winding number along a pixel's ray leaves 0 and ends where it is 0 again, so that
//! pairs are the solid itself: parts that touch or overlap are one, and it does not matter which way the whole mesh faces.
//!
//! In: depths and faces of each surface in turn, Z² pixels. Out: `layers` (`pairs` × front, back × Z² f32, rows of y), bounds of their
//! blocks, and what was found (`spirv/shared/peeled.wgsl`). Cost: 40 bytes a pixel and surface, 8 a pixel and pair.

use super::peel::Surface;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Flat, Gpu, Pipeline, Recorder};
use cao_kernels::pairs as kernel;
use cao_kernels::shared::layers::{BLOCK, BLOCK_BOUNDS};
use cao_kernels::shared::peeled::Peeled;

crate::host::same_layout!(Peeled, kernel::GrowingPeeled { across, pairs, surfaces, most, open, from_first });

/// The kernel `pairs`.
pub struct Pairs {
    add: Pipeline,
    finish: Pipeline,
    blocks: Pipeline,
}

/// The layers of one mesh, and where in a buffer they go.
#[derive(Clone, Copy)]
pub struct Place<'a> {
    /// Pixels along an edge.
    pub resolution: u32,
    /// Most pairs that are kept.
    pub pairs: u32,
    /// Bound as `layers`.
    pub layers: &'a Buffer,
    /// First f32 of the layers, [`Pairs::layers_len`] of them.
    pub layers_at: u32,
    /// First f32 of the bounds of blocks, [`Pairs::bounds_len`] of them.
    pub blocks_at: u32,
}

impl Place<'_> {
    fn params(&self, surface: u32, last: bool) -> kernel::PairsParams {
        let &Self { resolution, pairs, layers_at, blocks_at, .. } = self;
        kernel::PairsParams { resolution, pairs, layers_at, blocks_at, surface, last: u32::from(last) }
    }
}

impl Pairs {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let entry = |name| gpu.compute(&kernel::SHADER, name);
        Ok(Self { add: entry("add")?, finish: entry("finish")?, blocks: entry("blocks")? })
    }

    /// f32 of so many pairs.
    pub fn layers_len(resolution: u32, pairs: u32) -> u32 {
        2 * pairs * resolution * resolution
    }

    /// f32 of the bounds of their blocks.
    pub fn bounds_len(resolution: u32, pairs: u32) -> u32 {
        let edge = resolution.div_ceil(BLOCK);
        pairs * BLOCK_BOUNDS * edge * edge
    }

    /// Working memory: the pairs of each pixel so far.
    pub fn pixels(gpu: &Gpu, resolution: u32) -> Result<Buffer> {
        let bytes = size_of::<kernel::Pixel>() as u64 * u64::from(resolution) * u64::from(resolution);
        gpu.buffer("clip pixels", bytes, BufferUse::Device)
    }

    /// Memory for what is found of a mesh.
    pub fn peeled(gpu: &Gpu) -> Result<Buffer> {
        gpu.buffer("clip surfaces", size_of::<Peeled>() as u64, BufferUse::Device)
    }

    /// Begins a mesh whose dilation maps have so many cells along an edge: nothing is found.
    pub fn record_begin(rec: &mut Recorder, peeled: &Buffer, cells: u32) -> Result<()> {
        let across = cells.div_ceil(cao_kernels::dilate::MAIN_WORKGROUP[0]);
        let content = Peeled { across, down: across, pairs: 1, ..bytemuck::Zeroable::zeroed() };
        rec.update(peeled, 0, bytemuck::bytes_of(&content))?;
        rec.barrier(
            &[Access::TransferWrite],
            &[Access::GraphicsRead, Access::StorageRead, Access::StorageWrite],
        );
        Ok(())
    }

    /// Adds a surface, the one of that number; the last one is told.
    pub fn record_add(
        &self,
        rec: &mut Recorder,
        to: &Place,
        surface: &Surface,
        (number, last): (u32, bool),
        pixels: &Buffer,
        peeled: &Buffer,
    ) -> Result<()> {
        let binds = kernel::AddBindings {
            depths: Flat::Only(&surface.depth),
            faces: Flat::Only(&surface.face),
            pixels,
            peeled,
            layers: to.layers,
        };
        let push = to.params(number, last);
        rec.dispatch_over(&self.add, &binds, bytemuck::bytes_of(&push), [to.resolution, to.resolution, 1])
    }

    /// Says what was found, and bounds the blocks. Surfaces may have been added right before: the barriers are its own.
    pub fn record_finish(
        &self,
        rec: &mut Recorder,
        to: &Place,
        pixels: &Buffer,
        peeled: &Buffer,
    ) -> Result<()> {
        const STORAGE: [Access; 2] = [Access::StorageRead, Access::StorageWrite];
        let push = to.params(0, false);
        let push = bytemuck::bytes_of(&push);
        rec.barrier(&STORAGE, &STORAGE);
        let binds = kernel::FinishBindings { pixels, peeled };
        rec.dispatch_over(&self.finish, &binds, push, [to.resolution, to.resolution, 1])?;
        rec.barrier(&STORAGE, &STORAGE);
        let edge = to.resolution.div_ceil(BLOCK);
        let binds = kernel::BlocksBindings { peeled, layers: to.layers };
        rec.dispatch_over(&self.blocks, &binds, push, [edge, edge, to.pairs])
    }
}
