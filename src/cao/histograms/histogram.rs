//! Local histograms (docs/histograms.md; `cao_twin::histograms::histogram` has the equations), after Ropinski et al. 2008: which share of a
//! voxel's neighbourhood has which value, whatever the transfer function.
//!
//! In: `volume` V. Out: the range of its values, the bin of each voxel (3D r8uint), histograms of samples (128 bytes each), and for all
//! voxels, or one of every 2³, the number of the nearest cluster (3D r16uint). Cost: a read of a bin for each voxel of each neighbourhood,
//! 7,152 at a radius of 12, and 64 differences for each cluster.

use crate::field::{Field, ratios};
use crate::host::{row_of_groups, rows_over};
use cao_gpu::Result;
use cao_gpu::{
    Access, Buffer, BufferUse, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse, Pipeline, Recorder,
};
use cao_kernels::histogram as kernel;

/// Largest neighbourhood in smallest spacings; larger ones cost their cube.
pub const MOST_VOXELS: f64 = 12.0;
/// Above so many voxels one of every 2³ has a histogram.
pub const MOST_FINE: u64 = 1 << 24;
/// Fewest voxels that there have to be for each cluster: fewer are no compression.
pub const VOXELS_A_CLUSTER: u64 = 256;
/// Samples that a cluster is the mean of, where all are as large: 32,768 of the default's.
const ROWS_A_CLUSTER: u32 = 32;
/// Steps of a slab of `assign`, so that no submission takes long.
const SLAB: f64 = 4e9;

/// What histograms of a volume there are.
#[derive(Clone, Debug, PartialEq)]
pub struct HistogramPlan {
    offsets: Vec<kernel::Offset>,
    share: f32,
    /// Clusters, at most as many as asked for.
    pub clusters: u32,
    /// Samples.
    pub rows: u32,
    stride: u32,
    /// Voxels along each axis that share one.
    pub block: u32,
    /// Voxels of the index volume.
    pub coarse: [u32; 3],
}

impl HistogramPlan {
    /// Of neighbourhoods of this radius in mm, [`MOST_VOXELS`] at most; none at a radius of less than a voxel. `block` voxels along each
    /// axis share one.
    pub fn new(dims: [u32; 3], spacing: [f32; 3], radius_mm: f32, clusters: u32, block: u32) -> Self {
        let smallest = f64::from(spacing.into_iter().fold(f32::INFINITY, f32::min));
        let radius = (f64::from(radius_mm) / smallest).min(MOST_VOXELS);
        // Rounding of lengths in mm must not lose a voxel.
        let (edge, ratios) = ((radius * (1.0 + 1e-5)).floor() as i32, ratios(spacing));
        let mut offsets = Vec::new();
        for z in -edge..=edge {
            for y in -edge..=edge {
                for x in -edge..=edge {
                    let of = |c: i32, i: usize| (f64::from(c) * ratios[i]).powi(2);
                    let squared = of(x, 0) + of(y, 1) + of(z, 2);
                    if squared > 0.0 && squared <= radius * radius * (1.0 + 1e-5) {
                        let place = [x, y, z].map(|c| (c + 128) as u32);
                        offsets.push(kernel::Offset {
                            place: place[0] | place[1] << 8 | place[2] << 16,
                            weight: (65536.0 / squared).round() as u32,
                        });
                    }
                }
            }
        }
        let sum: f64 = offsets.iter().map(|offset| f64::from(offset.weight)).sum();
        let voxels: u64 = dims.iter().map(|d| u64::from(*d)).product();
        let clusters = u64::from(clusters).min(voxels / VOXELS_A_CLUSTER).max(1) as u32;
        let rows = (u64::from(clusters) * u64::from(ROWS_A_CLUSTER)).min(voxels);
        // Kernels count in 32 bits; of larger volumes the first 2³² voxels are sampled.
        let counted = voxels.min(u64::from(u32::MAX));
        let rows = rows.min(u64::from(cao_kernels::clusters::MOST_ROWS)) as u32;
        Self {
            offsets,
            share: if sum > 0.0 { (f64::from(kernel::WHOLE_SHARE) / sum) as f32 } else { 0.0 },
            clusters,
            rows,
            stride: (counted / u64::from(rows)) as u32,
            block,
            coarse: dims.map(|d| d.div_ceil(block)),
        }
    }

    /// Voxels of a neighbourhood.
    pub fn neighbours(&self) -> usize {
        self.offsets.len()
    }

    /// Voxels of the index volume, in slabs of about as many steps.
    fn slabs(&self) -> Vec<(u32, u32)> {
        let all = self.coarse.iter().product::<u32>();
        let steps = self.neighbours() as f64 + f64::from(kernel::BINS * self.clusters);
        // Whole workgroups.
        let size = ((SLAB / steps) as u32).max(1).next_multiple_of(kernel::EACH);
        (0..all.max(1)).step_by(size as usize).map(|first| (first, size.min(all - first))).collect()
    }

    /// How many slabs there are.
    pub fn slab_count(&self) -> usize {
        self.slabs().len()
    }
}

/// The kernel `histogram`, and what it makes.
pub struct Histogram {
    extent: Pipeline,
    sort: Pipeline,
    sample: Pipeline,
    assign: Pipeline,
    /// Range of the values, two ordered u32.
    pub extent_of: Buffer,
    binned: Image,
    offsets: Buffer,
    /// Histograms of samples.
    pub sampled: Buffer,
    /// Number of each voxel's cluster, r16uint.
    pub index: Image,
}

impl Histogram {
    /// Builds the pipelines and allocates room for a volume of so many voxels, `block` of which along each axis share a cluster. Uses the
    /// device's queue and waits for it.
    pub fn new(gpu: &Gpu, field: &Field, block: u32) -> Result<Self> {
        let shader = &kernel::SHADER;
        let image = |name: &str, dims, format| {
            let usage = ImageUse::SAMPLED | ImageUse::STORAGE;
            gpu.image(name, &ImageDesc { dims, layers: 1, format, kind: ImageKind::D3, usage })
        };
        let device = |name: &str, bytes: u64| gpu.buffer(name, bytes, BufferUse::Device);
        let words = u64::from(kernel::WORDS * cao_kernels::clusters::MOST_ROWS);
        let made = Self {
            extent: gpu.compute(shader, "extent")?,
            sort: gpu.compute(shader, "sort")?,
            sample: gpu.compute(shader, "sample")?,
            assign: gpu.compute(shader, "assign")?,
            extent_of: device("extent of values", 8)?,
            binned: image("bins", field.dims, Format::R8Uint)?,
            offsets: device("offsets", size_of::<kernel::Offset>() as u64 * u64::from(kernel::MOST_OFFSETS))?,
            sampled: device("sampled histograms", 4 * words)?,
            index: image("clusters", field.dims.map(|d| d.div_ceil(block)), Format::R16Uint)?,
        };
        let mut rec = gpu.recorder("histograms")?;
        rec.discard(&made.binned);
        rec.discard(&made.index);
        rec.submit_and_wait()?;
        Ok(made)
    }

    fn params(field: &Field, plan: &HistogramPlan, first: u32) -> kernel::HistogramParams {
        kernel::HistogramParams {
            dims: field.dims,
            block: plan.block,
            coarse: plan.coarse,
            offsets: plan.offsets.len() as u32,
            levels: field.levels,
            slope: field.scale / field.levels,
            bias: field.bias,
            share: plan.share,
            rows: plan.rows,
            stride: plan.stride,
            first,
            clusters: plan.clusters,
        }
    }

    /// Range, bins and samples of V as it is; afterwards samples are visible to kernels.
    pub fn record_samples(&self, rec: &mut Recorder, field: &Field, plan: &HistogramPlan) -> Result<()> {
        let params = Self::params(field, plan, 0);
        let push = bytemuck::bytes_of(&params);
        let both = [Access::StorageRead, Access::StorageWrite];
        let before = [Access::StorageRead, Access::StorageWrite, Access::SampledRead];
        rec.barrier(&before, &[Access::TransferWrite, Access::StorageWrite]);
        rec.update(&self.extent_of, 0, bytemuck::cast_slice(&[kernel::NOTHING_LOW, 0]))?;
        if !plan.offsets.is_empty() {
            rec.update(&self.offsets, 0, bytemuck::cast_slice(&plan.offsets))?;
        }
        rec.barrier(&[Access::TransferWrite], &both);
        let [x, y, z] = field.dims;
        let binds = kernel::ExtentBindings { volume: &field.volume, extent_of: &self.extent_of };
        rec.dispatch(&self.extent, &binds, push, [y.div_ceil(8), z.div_ceil(8), 1])?;
        rec.barrier(&[Access::StorageWrite], &both);
        let binds =
            kernel::SortBindings { volume: &field.volume, extent_of: &self.extent_of, binned: &self.binned };
        rec.dispatch(&self.sort, &binds, push, [x.div_ceil(8), y.div_ceil(8), z.div_ceil(4)])?;
        rec.barrier(&[Access::StorageWrite], &[Access::SampledRead, Access::StorageRead]);
        let binds =
            kernel::SampleBindings { bin_at: &self.binned, offsets: &self.offsets, sampled: &self.sampled };
        rec.dispatch(&self.sample, &binds, push, rows_over(plan.rows, kernel::SAMPLE_WORKGROUP))?;
        rec.barrier(&[Access::StorageWrite], &both);
        Ok(())
    }

    /// The nearest of these clusters of one slab of the index volume, which is visible to kernels after the last.
    pub fn record_slab(
        &self,
        rec: &mut Recorder,
        field: &Field,
        plan: &HistogramPlan,
        centres: &Buffer,
        slab: usize,
    ) -> Result<()> {
        let Some(&(first, count)) = plan.slabs().get(slab) else { return Ok(()) };
        let params = Self::params(field, plan, first);
        let binds = kernel::AssignBindings {
            centres,
            bin_at: &self.binned,
            offsets: &self.offsets,
            index: &self.index,
        };
        let groups = row_of_groups(count.div_ceil(kernel::EACH));
        rec.dispatch(&self.assign, &binds, bytemuck::bytes_of(&params), groups)?;
        rec.barrier(
            &[Access::StorageRead, Access::StorageWrite],
            &[Access::SampledRead, Access::StorageRead, Access::StorageWrite],
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_neighbourhood_has_the_voxels_and_weights_of_a_ball() {
        let plan = HistogramPlan::new([128; 3], [0.5; 3], 20.0, 1024, 1);
        assert_eq!((plan.neighbours(), plan.clusters, plan.rows), (7152, 1024, 32_768));
        let sum: f64 = plan.offsets.iter().map(|offset| f64::from(offset.weight) / 65536.0).sum();
        assert!((sum - 141.29).abs() < 0.01, "{sum}");
        assert!(plan.neighbours() < kernel::MOST_OFFSETS as usize);
        assert!(plan.offsets.iter().all(|offset| offset.place < 1 << 24 && offset.weight > 0));
        // None within less than a voxel; six within one, of which long voxels lose two.
        assert_eq!(HistogramPlan::new([9; 3], [0.5; 3], 0.4, 1024, 1).neighbours(), 0);
        assert_eq!(HistogramPlan::new([9; 3], [0.5, 0.5, 0.9], 0.5, 1024, 1).neighbours(), 4);
    }

    #[test]
    fn small_volumes_have_few_clusters_and_slabs_cover_all() {
        let plan = HistogramPlan::new([20; 3], [1.0; 3], 4.0, 1024, 1);
        assert_eq!((plan.clusters, plan.rows, plan.stride), (31, 992, 8));
        assert_eq!(HistogramPlan::new([3, 2, 1], [1.0; 3], 4.0, 1024, 1).clusters, 1);
        let large = HistogramPlan::new([257; 3], [1.0; 3], 12.0, 1024, 2);
        assert_eq!(large.coarse, [129; 3]);
        let slabs = large.slabs();
        assert!(slabs.len() > 10 && slabs.iter().map(|(_, count)| count).sum::<u32>() == 129 * 129 * 129);
        assert!(slabs.windows(2).all(|pair| pair[0].0 + pair[0].1 == pair[1].0));
    }
}
