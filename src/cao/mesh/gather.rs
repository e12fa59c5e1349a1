//! Ambient occlusion volumes, gathered (AOV §5): for each pixel, or for some, the sum of what the triangles contribute in whose volume it lies.
//!
//! `AO(x) = min(1, Σ_P g_P(x)·AO_P(x))`. In: geometry, a world, the tree of its volumes. Out: 1 − AO a pixel. Cost: the triangles within δ of each pixel.

use crate::Result;
use crate::mesh::geometry::Geometry;
use crate::mesh::surfaces::{Surfaces, VolumeTree};
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Pipeline, Recorder};
use cao_kernels::gather as kernel;
use std::ops::Range;

/// The kernel `gather`.
pub struct Gather {
    full: Pipeline,
    sparse: Pipeline,
    failed: Pipeline,
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

/// Sums of one pixel of each block.
pub struct Blocks {
    /// Bound as `sparse_sums`.
    pub sums: Buffer,
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
        Ok(Self { sums: gpu.buffer("sparse occlusion", bytes, BufferUse::Device)?, count, step })
    }
}

impl Gather {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        Ok(Self { full: pipeline("full")?, sparse: pipeline("sparse")?, failed: pipeline("failed")? })
    }

    fn params(scene: Scene, blocks: [u32; 2], step: u32) -> kernel::GatherParams {
        kernel::GatherParams {
            size: scene.geometry.size(),
            blocks,
            step,
            first_row: 0,
            rows: 0,
            delta: scene.delta_mm,
            clamped: u32::from(scene.volumes.clamped),
            pad: Default::default(),
        }
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
            ..Self::params(scene, [0; 2], 1)
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
        let params = Self::params(scene, blocks.count, blocks.step);
        let over = [blocks.count[0], blocks.count[1], geometry.views() as u32];
        Ok(rec.dispatch_over(&self.sparse, &binds, bytemuck::bytes_of(&params), over)?)
    }

    /// The pixels that [`Upsample`](crate::mesh::upsample::Upsample) has marked.
    pub fn record_failed(&self, rec: &mut Recorder, scene: Scene, accessibility: &Buffer) -> Result<()> {
        let Scene { geometry, surfaces, volumes, .. } = scene;
        let binds = kernel::FailedBindings {
            eyes: &geometry.eyes,
            tree: &volumes.tree,
            triangles: &surfaces.triangles,
            shares: &surfaces.shares,
            geometry: &geometry.pixels,
            accessibility,
        };
        let params = Self::params(scene, [0; 2], 1);
        let [columns, rows] = geometry.size().map(|pixels| pixels.div_ceil(kernel::TILE));
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
        rec.dispatch(
            &self.failed,
            &binds,
            bytemuck::bytes_of(&params),
            [columns, rows, geometry.views() as u32],
        )?;
        Ok(())
    }
}
