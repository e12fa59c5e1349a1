//! How many occlusion volumes each pixel lies in (AOV Fig. 5): those of the triangles whose g is above 0 there.
//!
//! In: geometry, a world, the tree of its volumes. Out: a u32 a pixel, `NO_SURFACE` of one that shows none. Cost: the triangles within δ of each pixel.

use crate::Result;
use cao::host::read_buffer;
use cao::mesh::gather::Scene;
use cao_gpu::{Access, Buffer, Gpu, Pipeline, Recorder};
use cao_kernels::overdraw as kernel;

/// The kernel `overdraw`.
pub struct Overdraw {
    pipeline: Pipeline,
}

impl Overdraw {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Of all pixels of all views; `counts` holds a u32 each.
    pub fn record(&self, rec: &mut Recorder, scene: Scene, counts: &Buffer) -> cao_gpu::Result<()> {
        let Scene { geometry, surfaces, volumes, delta_mm } = scene;
        let params = kernel::OverdrawParams {
            size: geometry.size(),
            delta: delta_mm,
            clamped: u32::from(volumes.clamped),
        };
        let binds = kernel::MainBindings {
            eyes: &geometry.eyes,
            tree: &volumes.tree,
            triangles: &surfaces.triangles,
            geometry: &geometry.pixels,
            shares: &surfaces.shares,
            counts,
        };
        let [width, height] = geometry.size();
        let over = [width, height, geometry.views() as u32];
        rec.dispatch_over(&self.pipeline, &binds, bytemuck::bytes_of(&params), over)
    }

    /// The counts of all pixels of all views, `None` of one that shows no surface. Uses the device's queue and waits for it.
    pub fn read(&self, gpu: &Gpu, scene: Scene) -> Result<Vec<Option<u32>>> {
        let counts = scene.geometry.values(gpu, "overdraw")?;
        let mut rec = gpu.recorder("overdraw")?;
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
        self.record(&mut rec, scene, &counts)?;
        rec.submit_and_wait()?;
        let counts: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(gpu, &counts)?);
        Ok(counts.into_iter().map(|count| (count != kernel::NO_SURFACE).then_some(count)).collect())
    }
}
