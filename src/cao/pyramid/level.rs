//! One level of the volumes of means from the one before, all of its cells.
//!
//! In: level l − 1 (r16unorm, V_o as level 0), out: level l (r16unorm). 8 reads and a write a cell.

use super::plan::Cells;
use cao_gpu::Result;
use cao_gpu::{Gpu, Image, Pipeline, Recorder};
use cao_kernels::level as kernel;

/// The kernel `level`.
pub struct MakeLevel(Pipeline);

impl MakeLevel {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self(gpu.compute(&kernel::SHADER, "main")?))
    }

    /// From `finer` of the cells `before` makes `coarser` of the cells `now`. Opacities are raised to `exponent`, 1 but for those of V_o.
    pub fn record(
        &self,
        rec: &mut Recorder,
        [before, now]: [&Cells; 2],
        exponent: f32,
        finer: &Image,
        coarser: &Image,
    ) -> Result<()> {
        let along = |of: &dyn Fn(usize) -> i64| -> [i32; 3] { std::array::from_fn(|i| of(i) as i32) };
        let ratio = |i: usize| now.stride[i] / before.stride[i];
        let params = kernel::LevelParams {
            dims: now.dims,
            exponent,
            before: before.dims.map(|n| n as i32),
            stride: along(&ratio),
            first: along(&|i| now.first[i] * ratio(i) - before.first[i]),
            second: along(&|i| (now.width[i] - before.width[i]) / before.stride[i]),
            pad: Default::default(),
            pad_1: Default::default(),
            pad_2: Default::default(),
            pad_3: Default::default(),
        };
        let binds = kernel::MainBindings { finer, coarser };
        let groups: [u32; 3] = std::array::from_fn(|i| now.dims[i].div_ceil(kernel::MAIN_WORKGROUP[i]));
        rec.dispatch(&self.0, &binds, bytemuck::bytes_of(&params), groups)
    }
}
