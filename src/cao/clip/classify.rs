//! Clip classification (CAO §3.5 step 4): opacity after clipping, anti-aliased by eq. (5),
//! `O_AA = C_visible / (N + 9) · O_voxel`, and the category of every voxel.
//!
//! In: `full_opacity`, the clips with layers and dilation maps, the words of `clip_bricks`. Out: `opacity` V_o (3D r32float), `mask` V_m (3D r8uint: a
//! [`CLIPPED`], b [`AFFECTED`], c [`UNTOUCHED`]), `count` of each. Cost: one distance a voxel and clip
//! where the brick's word leaves it open; 9 or 9 + N samples only for voxels that a clip's surface may pass.

use crate::clip::clips::ClipSet;
use crate::field::Field;
use crate::host::device_buffer;
use cao_gpu::Result;
use cao_gpu::{Buffer, BufferUse, Gpu, Image, Pipeline, Recorder};
use cao_kernels::classify as kernel;
pub use cao_kernels::shared::categories::{AFFECTED, CLIPPED, UNTOUCHED};
use cao_model::occlusion::Occlusion;
use cao_model::settings::AntiAliasing;

const _: () = assert!(kernel::MOST_SAMPLES == AntiAliasing::N32 as u32);

/// The kernel `classify`.
pub struct Classify {
    pipeline: Pipeline,
    /// The N extra positions of eq. (5), a uniform buffer.
    pub positions: Buffer,
    /// Voxels of category a, b, c after the last classification, see [`Self::count_of`].
    pub count: Buffer,
}

impl Classify {
    /// Builds the pipeline and the table of sample positions. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            pipeline: gpu.compute(&kernel::SHADER, "main")?,
            positions: device_buffer(gpu, "sample positions", bytemuck::bytes_of(&sample_positions()))?,
            count: gpu.buffer("category counts", size_of::<kernel::Count>() as u64, BufferUse::Device)?,
        })
    }

    /// How far in mm a clip's change reaches: the longest ray, the eight voxels that its last sample interpolates, the
    /// cell that one clip sample stands for, and a hundredth of a voxel for rounding, of which the 1/512 voxel of texture
    /// coordinates on GPUs is the most (method.md §5).
    pub fn reach(field: &Field, occlusion: &Occlusion) -> f32 {
        occlusion.reach(f64::from(field.min_spacing())) + (1.5 + 1e-2) * field.diagonal()
    }

    /// Classifies every voxel. `count` must have been cleared; `clip_bricks` is of the same clips and reach.
    #[expect(clippy::too_many_arguments, reason = "each is one binding or parameter of the kernel")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
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
            extra_samples: samples as u32,
            spacing: field.spacing,
            reach,
            flags: if literal { kernel::LITERAL } else { 0 },
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
        };
        rec.dispatch_over(&self.pipeline, &binds, bytemuck::bytes_of(&params), field.dims)
    }

    /// How many voxels the content of [`Self::count`] says are of a category.
    pub fn count_of(content: &[u8], category: u32) -> u32 {
        let count: kernel::Count = bytemuck::pod_read_unaligned(content);
        count.category[category as usize]
    }
}

/// The N extra positions in the voxel's [−1, 1]³: points of the R3 sequence (Roberts 2018), whose every prefix is evenly
/// spread, each followed by its mirror image, so that the mean of every even number of them is the centre.
fn sample_positions() -> kernel::Positions {
    const G: f64 = 1.220_744_084_605_759_5;
    let sample = std::array::from_fn(|k| {
        let side = if k % 2 == 0 { 1.0 } else { -1.0 };
        let u = |power: i32| (0.5 + (k / 2 + 1) as f64 / G.powi(power)).fract();
        [1, 2, 3, 0].map(|axis| if axis == 0 { 0.0 } else { (side * (2.0 * u(axis) - 1.0)) as f32 })
    });
    kernel::Positions { sample }
}
