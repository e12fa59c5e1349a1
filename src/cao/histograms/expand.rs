//! From clusters to values (docs/histograms.md): `A_c = 1 − Σ_j α_j LH_cj` for every cluster c, α_j the transfer function's opacity of bin j
//! in a smallest spacing; then every voxel of the listed bricks that needs a value takes its cluster's. Where matter lends its colour, A_c is
//! red, green and blue: `1 − Σ_j α_j (1 − b rgb_j) LH_cj`.
//!
//! In: the clusters, the range of values, the transfer function; `opacity` V_o, for which voxels need a value; the index volume, the list.
//! Out: `ambient` V_AO (3D r16unorm; of colours rgba16unorm) in the listed bricks, one write a voxel. Cost: two reads a voxel.

use super::histogram::HistogramPlan;
use crate::drive::Take;
use crate::field::Field;
use crate::field::bricks::BrickList;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Image, Pipeline, Recorder};
use cao_kernels::expand as kernel;
use cao_model::options::Options;
use cao_model::settings::Scope;

/// What both entry points know.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// Clusters and what they stand for.
    pub plan: &'a HistogramPlan,
    /// Reference length of the transfer function's opacities in mm.
    pub reference_mm: f32,
    /// Which voxels get a value.
    pub scope: Scope,
    /// b.
    pub bleeding: f32,
}

/// What the kernel reads and writes.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// V_o.
    pub opacity: &'a Image,
    /// Number of each voxel's cluster.
    pub index: &'a Image,
    /// Bricks to work on.
    pub list: &'a BrickList,
    /// V_AO.
    pub ambient: &'a Image,
}

/// The kernel `expand`.
pub struct Expand {
    shade: Pipeline,
    main: Pipeline,
    /// Of each cluster one number, or four.
    factors: Buffer,
    coloured: bool,
}

impl Expand {
    /// Builds the pipelines, for values of one number or of three.
    pub fn new(gpu: &Gpu, coloured: bool) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        let ([shade, main], bytes) = match coloured {
            false => (["shade", "main"], size_of::<f32>()),
            true => (["shade_coloured", "main_coloured"], size_of::<[f32; 4]>()),
        };
        let room = bytes as u64 * u64::from(Options::MOST_CLUSTERS);
        Ok(Self {
            shade: pipeline(shade)?,
            main: pipeline(main)?,
            factors: gpu.buffer("factors of clusters", room, BufferUse::Device)?,
            coloured,
        })
    }

    /// The ambient factors of all clusters.
    pub fn record_shade(
        &self,
        rec: &mut Recorder,
        field: &Field,
        scene: Scene,
        [range_of, centres, transfer]: [&Buffer; 3],
    ) -> Result<()> {
        let params = params(field, scene, 0);
        let factors = &self.factors;
        rec.barrier(
            &[Access::StorageRead, Access::StorageWrite],
            &[Access::StorageRead, Access::StorageWrite],
        );
        let groups = [scene.plan.clusters.div_ceil(kernel::EACH), 1, 1];
        let push = bytemuck::bytes_of(&params);
        if self.coloured {
            let binds = kernel::ShadeColouredBindings { transfer, centres, range_of, tints: factors };
            rec.dispatch(&self.shade, &binds, push, groups)?;
        } else {
            let binds = kernel::ShadeBindings { transfer, centres, range_of, factors };
            rec.dispatch(&self.shade, &binds, push, groups)?;
        }
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
        Ok(())
    }

    /// Works on the list, or some of its bricks, with the factors recorded last.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        scene: Scene,
        b: Bindings,
        take: &Take,
    ) -> Result<()> {
        let params = params(field, scene, take.first());
        let (factors, list, push) = (&self.factors, &b.list.buffer, bytemuck::bytes_of(&params));
        let Bindings { opacity, index, ambient, .. } = b;
        if self.coloured {
            let binds =
                kernel::MainColouredBindings { opacity, tints: factors, list, index, coloured: ambient };
            return take.dispatch(rec, &self.main, &binds, push, list);
        }
        let binds = kernel::MainBindings { opacity, factors, list, index, ambient };
        take.dispatch(rec, &self.main, &binds, push, list)
    }
}

fn params(field: &Field, scene: Scene, base: u32) -> kernel::ExpandParams {
    kernel::ExpandParams {
        dims: field.dims,
        block: scene.plan.block,
        bricks: field.bricks(),
        base,
        clusters: scene.plan.clusters,
        unneeded: u32::from(scene.scope == Scope::All),
        exponent: field.min_spacing() / scene.reference_mm,
        bleeding: scene.bleeding,
    }
}
