//! The product over shells of cubes (SPAO §1.2; `cao_twin::spao::product` has the equations): every voxel of the listed bricks that needs a value.
//!
//! In: `opacity` V_o, the volumes of means, the list. Out: `ambient` V_AO (3D r16unorm) in the listed bricks, one write a voxel. Cost: L + 1
//! look-ups a voxel, 6 reads more where cubes are moved out.

use crate::drive::Take;
use crate::field::Field;
use crate::field::bricks::BrickList;
use crate::pyramid::levels::{LevelImages, MakeLevels};
use cao_gpu::Result;
use cao_gpu::{Gpu, Image, Pipeline, Recorder};
use cao_kernels::product as kernel;
use cao_model::settings::Scope;

/// What the kernel reads and writes.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// V_o.
    pub opacity: &'a Image,
    /// How levels are looked up.
    pub make: &'a MakeLevels,
    /// The volumes of means.
    pub levels: &'a LevelImages,
    /// Bricks to work on.
    pub list: &'a BrickList,
    /// V_AO.
    pub ambient: &'a Image,
}

/// The kernel `product`.
pub struct Product(Pipeline);

impl Product {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self(gpu.compute(&kernel::SHADER, "main")?))
    }

    /// Works on the list, or some of its bricks. `opacity` is per `reference_mm`; cubes are moved out where `lifted`.
    #[expect(clippy::too_many_arguments, reason = "settings and bindings of the kernel, each named once")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        reference_mm: f32,
        lifted: bool,
        scope: Scope,
        b: Bindings,
        take: &Take,
    ) -> Result<()> {
        let smallest = field.min_spacing();
        let params = kernel::ProductParams {
            dims: field.dims,
            levels: b.levels.plan.levels(),
            bricks: field.bricks(),
            base: take.first(),
            slope: field.spacing.map(|s| smallest / s),
            exponent: smallest / reference_mm,
            unneeded: u32::from(scope == Scope::All),
            lifted: u32::from(lifted),
            pad: Default::default(),
        };
        let [level_1, level_2, level_3, level_4, level_5, level_6, level_7, level_8, level_9] =
            b.levels.bound(b.opacity);
        let binds = kernel::MainBindings {
            opacity: b.opacity,
            field: &b.make.field,
            table: &b.make.table,
            list: &b.list.buffer,
            ambient: b.ambient,
            level_1,
            level_2,
            level_3,
            level_4,
            level_5,
            level_6,
            level_7,
            level_8,
            level_9,
        };
        take.dispatch(rec, &self.0, &binds, bytemuck::bytes_of(&params), &b.list.buffer)
    }
}
