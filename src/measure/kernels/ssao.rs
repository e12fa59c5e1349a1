//! Image-space ambient occlusion as renderers without data-space values have it, the baseline of the chart and the control of
//! the stereo claim; from one eye's depth image alone (Shi et al. 2022, CAO §1).
//!
//! `AO = 1 − 1/K Σ_i [surface at the pixel of p_i is nearer than p_i] · smoothstep(R / |z − z_i|)`, the p_i a hemisphere of K
//! points within R around the surface, turned by a hash of the pixel.
//!
//! In: `depth`, Vulkan depth of one eye, a layer of the image that both were drawn into. Out: one f32 a pixel, rows from the top; 1
//! where nothing is drawn. Cost: K + 5 depth reads a pixel.

use crate::{Error, Result};
use cao_gpu::{Buffer, Flat, Gpu, Image, Pipeline, Recorder};
use cao_kernels::ssao as kernel;
use cao_model::view::View;

/// The kernel `ssao`.
pub struct Ssao {
    pipeline: Pipeline,
}

impl Ssao {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Shades one eye's image, layer `eye` of `depth` (`D32Float`), seen by `view`. `radius_mm` is R, `samples` K; a surface hides a point only
    /// if it is nearer by more than `bias_mm`. `occlusion` holds 4 bytes a pixel.
    #[expect(clippy::too_many_arguments, reason = "settings and bindings of the kernel, each named once")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        view: &View,
        depth: &Image,
        eye: u32,
        radius_mm: f32,
        samples: u32,
        bias_mm: f32,
        occlusion: &Buffer,
    ) -> Result<()> {
        view.check()?;
        let [width, height, _] = depth.desc().dims;
        if occlusion.bytes() < 4 * u64::from(width) * u64::from(height) {
            let problem = format!("{} bytes; expected 4 for each pixel", occlusion.bytes());
            return Err(Error::refused("image-space occlusion", problem));
        }
        let params = kernel::SsaoParams {
            tan: [view.tan.left, view.tan.right, view.tan.up, view.tan.down],
            near: view.near_mm,
            far: view.far_mm,
            radius: radius_mm,
            bias: bias_mm,
            size: [width, height],
            samples,
            pad: Default::default(),
        };
        let binds = kernel::MainBindings { depth: Flat::Layer(depth, eye), occlusion };
        Ok(rec.dispatch_over(&self.pipeline, &binds, bytemuck::bytes_of(&params), [width, height, 1])?)
    }
}
