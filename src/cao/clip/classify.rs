//! Clip classification (CAO §3.5 step 4): opacity after clipping, anti-aliased by eq. (5),
//! `O_AA = C_visible / (N + 9) · O_voxel`, and the category of every voxel.
//!
//! In: `full_opacity`, the clips with layers and dilation maps, the words of `clip_bricks`. Out: `opacity` V_o (3D r32float), `mask` V_m (3D r8uint: 0 = a
//! clipped, 1 = b affected, 2 = c untouched), `count` of each. Cost: one distance a voxel and clip
//! where the brick's word leaves it open; 9 or 9 + N samples only for voxels that a clip's surface may pass.

use crate::clip::clips::ClipSet;
use crate::field::Field;
use crate::host::device_buffer;
use bytemuck::{Pod, Zeroable};
use cao_gpu::Result;
use cao_gpu::layout_check;
use cao_gpu::{Bind, Buffer, BufferUse, Gpu, Image, Pipeline, Recorder};
use cao_kernels as shaders;
use cao_model::occlusion::Occlusion;
use cao_model::settings::AntiAliasing;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Params {
    dims: [u32; 3],
    extra_samples: u32,
    spacing: [f32; 3],
    reach: f32,
    flags: u32,
    pad: [u32; 3],
}
layout_check!(Params => shaders::classify::CLASSIFY_PARAMS { dims, extra_samples, spacing, reach, flags });

/// The kernel `classify`.
pub struct Classify {
    pipeline: Pipeline,
    /// The N extra positions of eq. (5), a uniform buffer.
    pub positions: Buffer,
    /// Voxels of category a, b, c after the last classification: three u32.
    pub count: Buffer,
}

impl Classify {
    /// Builds the pipeline and the table of sample positions. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            pipeline: gpu.compute(&shaders::classify::SHADER, "main")?,
            positions: device_buffer(gpu, "sample positions", bytemuck::cast_slice(&sample_positions()))?,
            count: gpu.buffer("category counts", 12, BufferUse::Device)?,
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
        let params = Params {
            dims: field.dims,
            extra_samples: samples as u32,
            spacing: field.spacing,
            reach,
            flags: u32::from(literal),
            pad: [0; 3],
        };
        let binds = [
            ("full_opacity", Bind::Image(full_opacity)),
            ("clips", Bind::Buffer(&clips.clips)),
            ("layers", Bind::Buffer(&clips.layers)),
            ("dilation", Bind::Buffer(&clips.dilation)),
            ("positions", Bind::Buffer(&self.positions)),
            ("opacity", Bind::Image(opacity)),
            ("mask", Bind::Image(mask)),
            ("count", Bind::Buffer(&self.count)),
            ("clip_bricks", Bind::Buffer(clip_bricks)),
        ];
        rec.dispatch_over(&self.pipeline, &binds, bytemuck::bytes_of(&params), field.dims)
    }
}

/// The N extra positions in the voxel's [−1, 1]³: points of the R3 sequence (Roberts 2018), whose every prefix is evenly
/// spread, each followed by its mirror image, so that the mean of every even number of them is the centre.
fn sample_positions() -> [[f32; 4]; 32] {
    const G: f64 = 1.220_744_084_605_759_5;
    std::array::from_fn(|k| {
        let side = if k % 2 == 0 { 1.0 } else { -1.0 };
        let u = |power: i32| (0.5 + (k / 2 + 1) as f64 / G.powi(power)).fract();
        [1, 2, 3, 0].map(|axis| if axis == 0 { 0.0 } else { (side * (2.0 * u(axis) - 1.0)) as f32 })
    })
}
