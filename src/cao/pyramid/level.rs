//! One level of the volumes of means from the one before: all of its cells, or those of listed tiles.
//!
//! In: level l − 1 (r16unorm, V_o as level 0), out: level l (r16unorm). 8 reads and a write a cell.

use super::plan::Cells;
use cao_gpu::Result;
use cao_gpu::{Buffer, Gpu, Image, Pipeline, Recorder};
use cao_kernels::level as kernel;

/// The kernel `level`.
pub struct MakeLevel {
    main: Pipeline,
    listed: Pipeline,
}

impl MakeLevel {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        Ok(Self { main: pipeline("main")?, listed: pipeline("listed")? })
    }

    /// From `finer` of the cells `before` makes `coarser` of the cells `now`. Opacities are raised to `exponent`, 1 but for those of V_o.
    pub fn record(
        &self,
        rec: &mut Recorder,
        cells: [&Cells; 2],
        exponent: f32,
        [finer, coarser]: [&Image; 2],
    ) -> Result<()> {
        let params = params(cells, exponent);
        let binds = kernel::MainBindings { finer, coarser };
        let groups: [u32; 3] = std::array::from_fn(|i| params.dims[i].div_ceil(kernel::MAIN_WORKGROUP[i]));
        rec.dispatch(&self.main, &binds, bytemuck::bytes_of(&params), groups)
    }

    /// The same of the listed tiles alone, whose marks are 0 again afterwards.
    pub fn record_listed(
        &self,
        rec: &mut Recorder,
        cells: [&Cells; 2],
        exponent: f32,
        [finer, coarser]: [&Image; 2],
        [list, marks]: [&Buffer; 2],
    ) -> Result<()> {
        let binds = kernel::ListedBindings { finer, coarser, list, marks };
        rec.dispatch_indirect(&self.listed, &binds, bytemuck::bytes_of(&params(cells, exponent)), list, 0)
    }
}

fn params(cells: [&Cells; 2], exponent: f32) -> kernel::LevelParams {
    let [before, now] = cells;
    let Means { stride, first, second } = Means::of(cells);
    kernel::LevelParams {
        dims: now.dims,
        exponent,
        before: before.dims.map(|n| n as i32),
        stride,
        first,
        second,
        tiles: now.tiles(),
        pad: Default::default(),
        pad_1: Default::default(),
        pad_2: Default::default(),
        pad_3: Default::default(),
        pad_4: Default::default(),
    }
}

/// Which cells of the level before a cell is the mean of, along each axis, counted from the first that is stored: c stride + first, and that
/// many farther `second`.
#[derive(Clone, Copy, Debug)]
pub struct Means {
    /// 1 or 2.
    pub stride: [i32; 3],
    /// May lie before the first.
    pub first: [i32; 3],
    /// 0 along an axis that is not doubled.
    pub second: [i32; 3],
}

impl Means {
    /// Of the cells of a level, from those of the level before.
    pub fn of([before, now]: [&Cells; 2]) -> Self {
        let along = |of: &dyn Fn(usize) -> i64| -> [i32; 3] { std::array::from_fn(|i| of(i) as i32) };
        let ratio = |i: usize| now.stride[i] / before.stride[i];
        Self {
            stride: along(&ratio),
            first: along(&|i| now.first[i] * ratio(i) - before.first[i]),
            second: along(&|i| (now.width[i] - before.width[i]) / before.stride[i]),
        }
    }
}
