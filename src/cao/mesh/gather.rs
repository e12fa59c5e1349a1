//! Ambient occlusion volumes, gathered (AOV §5): for each pixel, or for some, the sum of what the triangles contribute in whose volume it lies.
//!
//! `AO(x) = min(1, Σ_P g_P(x)·AO_P(x))`. In: geometry, a world, the tree of its volumes. Out: 1 − AO a pixel. Cost: the triangles within δ of each pixel.

use crate::mesh::geometry::Geometry;
use crate::mesh::surfaces::{Surfaces, VolumeTree};
use crate::{Error, Result};
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Pipeline, Recorder};
use cao_kernels::gather as kernel;
use std::ops::Range;

const _: () = assert!(kernel::DEEPEST as usize == cao_model::bvh::DEEPEST, "nodes that wait would not fit");

/// Workgroups for failed pixels: as many as the largest GPUs hold at once.
const MOST_GROUPS: u32 = 4096;
/// Pixels of a picture for each: where few fail, fewer are enough.
const PIXELS_A_GROUP: u32 = 64;

/// The kernel `gather`.
pub struct Gather {
    full: Pipeline,
    sparse: Pipeline,
    failed: Pipeline,
    /// For volumes whose corners are clamped, and for no others?
    pub clamped: bool,
}

/// What is occluded, and by what.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    /// What pixels show.
    pub geometry: &'a Geometry,
    /// The triangles,
    pub surfaces: &'a Surfaces,
    /// their volumes,
    pub volumes: &'a VolumeTree,
    /// and how far those reach, in mm.
    pub delta_mm: f32,
}

/// Sums of one pixel of each block, cut off at 1.
pub struct Blocks {
    /// Bound as `sparse_sums`.
    pub sums: Buffer,
    /// Bound as `failures`: how many pixels no block is like, and which, u32 each.
    pub failures: Buffer,
    /// Blocks across and down a view.
    pub count: [u32; 2],
    /// Pixels along the edge of one.
    pub step: u32,
}

impl Blocks {
    /// Memory for the blocks of a geometry.
    pub fn new(gpu: &Gpu, geometry: &Geometry, step: u32) -> Result<Self> {
        let count = geometry.size().map(|pixels| pixels.div_ceil(step));
        let bytes = 4 * u64::from(count[0]) * u64::from(count[1]) * geometry.views() as u64;
        let pixels = geometry.pixels.bytes() / Geometry::BYTES;
        Ok(Self {
            sums: gpu.buffer("sparse occlusion", bytes, BufferUse::Device)?,
            failures: gpu.buffer("failed pixels", 4 + 4 * pixels, BufferUse::Device)?,
            count,
            step,
        })
    }
}

impl Gather {
    /// Builds the pipelines, for volumes whose corners are `clamped` as printed or not.
    pub fn new(gpu: &Gpu, clamped: bool) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        let [full, sparse, failed] = match clamped {
            true => ["full_clamped", "sparse_clamped", "failed_clamped"],
            false => ["full", "sparse", "failed"],
        };
        Ok(Self { full: pipeline(full)?, sparse: pipeline(sparse)?, failed: pipeline(failed)?, clamped })
    }

    fn params(&self, scene: Scene, blocks: [u32; 2], step: u32) -> Result<kernel::GatherParams> {
        if scene.volumes.clamped != self.clamped {
            return Err(Error::refused(
                "volumes",
                "are not those of the pipelines: make both with clamped corners, or neither",
            ));
        }
        Ok(kernel::GatherParams {
            size: scene.geometry.size(),
            blocks,
            step,
            first_row: 0,
            rows: 0,
            groups: 0,
            delta: scene.delta_mm,
            pad: Default::default(),
        })
    }

    /// Every pixel of some rows of all views; `accessibility` holds an f32 for each of the picture.
    pub fn record_full(
        &self,
        rec: &mut Recorder,
        scene: Scene,
        rows: Range<u32>,
        accessibility: &Buffer,
    ) -> Result<()> {
        let Scene { geometry, surfaces, volumes, .. } = scene;
        let binds = kernel::FullBindings {
            eyes: &geometry.eyes,
            tree: &volumes.tree,
            triangles: &surfaces.triangles,
            shares: &surfaces.shares,
            geometry: &geometry.pixels,
            accessibility,
        };
        let params = kernel::GatherParams {
            first_row: rows.start,
            rows: rows.len() as u32,
            ..self.params(scene, [0; 2], 1)?
        };
        let over = [geometry.size()[0], rows.len() as u32, geometry.views() as u32];
        Ok(rec.dispatch_over(&self.full, &binds, bytemuck::bytes_of(&params), over)?)
    }

    /// The middle pixel of each block.
    pub fn record_sparse(&self, rec: &mut Recorder, scene: Scene, blocks: &Blocks) -> Result<()> {
        let Scene { geometry, surfaces, volumes, .. } = scene;
        let binds = kernel::SparseBindings {
            eyes: &geometry.eyes,
            tree: &volumes.tree,
            triangles: &surfaces.triangles,
            shares: &surfaces.shares,
            geometry: &geometry.pixels,
            sparse_sums: &blocks.sums,
        };
        let params = self.params(scene, blocks.count, blocks.step)?;
        let groups = [blocks.count[0], blocks.count[1], geometry.views() as u32];
        Ok(rec.dispatch(&self.sparse, &binds, bytemuck::bytes_of(&params), groups)?)
    }

    /// The pixels that [`Upsample`](crate::mesh::upsample::Upsample) has listed.
    pub fn record_failed(
        &self,
        rec: &mut Recorder,
        scene: Scene,
        blocks: &Blocks,
        accessibility: &Buffer,
    ) -> Result<()> {
        let Scene { geometry, surfaces, volumes, .. } = scene;
        let binds = kernel::FailedBindings {
            eyes: &geometry.eyes,
            tree: &volumes.tree,
            triangles: &surfaces.triangles,
            shares: &surfaces.shares,
            geometry: &geometry.pixels,
            accessibility,
            failures: &blocks.failures,
        };
        let pixels = (geometry.pixels.bytes() / Geometry::BYTES) as u32;
        let groups = pixels.div_ceil(PIXELS_A_GROUP).min(MOST_GROUPS);
        let params = kernel::GatherParams { groups, ..self.params(scene, [0; 2], 1)? };
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
        rec.dispatch(&self.failed, &binds, bytemuck::bytes_of(&params), [groups, 1, 1])?;
        Ok(())
    }
}
