//! Clip classification (CAO §3.5 step 4): opacity after clipping, anti-aliased by eq. (5),
//! `O_AA = C_visible / (N + 9) · O_voxel`, and the category of every voxel.
//!
//! In: `full_opacity`, features, of which clips leave some voxels whole, the clips with layers and dilation maps, the words of `clip_bricks`. Out: `opacity` V_o (3D r32float), `mask` V_m (3D r8uint: a
//! [`CLIPPED`], b [`AFFECTED`], c [`UNTOUCHED`]), `count` of each. Cost: one distance a voxel and clip
//! where the brick's word leaves it open; 9 or 9 + N samples only for voxels that a clip's surface may pass.

use crate::clip::clips::ClipSet;
use crate::clip::positions;
use crate::field::Field;
use crate::field::features::FeatureSet;
use cao_gpu::Result;
use cao_gpu::{Buffer, BufferUse, Gpu, Image, Pipeline, Recorder};
use cao_kernels::classify as kernel;
pub use cao_kernels::shared::categories::{AFFECTED, CLIPPED, UNTOUCHED};
use cao_model::occlusion::Occlusion;
use cao_model::settings::{AntiAliasing, Support};

/// The kernel `classify`.
pub struct Classify {
    pipeline: Pipeline,
    positions: Buffer,
    /// Voxels of category a, b, c after the last classification, see [`Self::count_of`].
    pub count: Buffer,
}

impl Classify {
    /// Builds the pipeline and the table of sample positions. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            pipeline: gpu.compute(&kernel::SHADER, "main")?,
            positions: positions::buffer(gpu)?,
            count: gpu.buffer("category counts", size_of::<kernel::Count>() as u64, BufferUse::Device)?,
        })
    }

    /// How far in mm a clip's change reaches: the longest ray, the eight voxels that its last sample interpolates, the way
    /// from a voxel to its farthest clip sample, and a hundredth of a voxel for rounding, of which the 1/512 voxel of texture
    /// coordinates on GPUs is the most (method.md §5).
    pub fn reach(field: &Field, occlusion: &Occlusion, support: Support) -> f32 {
        let samples = 1.0 + support.corner() + 1e-2;
        occlusion.reach(f64::from(field.min_spacing())) + samples * field.diagonal()
    }

    /// Classifies every voxel. `count` must have been cleared; `clip_bricks` is of the same clips and reach.
    #[expect(clippy::too_many_arguments, reason = "each is one binding or parameter of the kernel")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        features: &FeatureSet,
        clips: &ClipSet,
        samples: AntiAliasing,
        reach: f32,
        literal: bool,
        clip_bricks: &Buffer,
        full_opacity: &Image,
        opacity: &Image,
        mask: &Image,
    ) -> Result<()> {
        let params = kernel::ClassifyParams {
            dims: field.dims,
            spacing: field.spacing,
            reach,
            flags: if literal { kernel::LITERAL } else { 0 },
            sampling: positions::sampling(samples),
            pad: Default::default(),
        };
        let binds = kernel::MainBindings {
            full_opacity,
            clips: &clips.clips,
            layers: &clips.layers,
            dilation: &clips.dilation,
            positions: &self.positions,
            opacity,
            mask,
            count: &self.count,
            clip_bricks,
            features: &features.table,
            feature_index: &features.index,
        };
        rec.dispatch_over(&self.pipeline, &binds, bytemuck::bytes_of(&params), field.dims)
    }

    /// How many voxels the content of [`Self::count`] says are of a category.
    pub fn count_of(content: &[u8], category: u32) -> u32 {
        let count: kernel::Count = bytemuck::pod_read_unaligned(content);
        count.category[category as usize]
    }
}
