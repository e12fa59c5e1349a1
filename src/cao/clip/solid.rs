//! What fills a volume's opacity beside what is in it, an implant say: `V_o(x) = max(V_o(x), share of the voxel x inside a solid)`. It occludes and is not
//! drawn; its surface is a mesh's.
//!
//! In: solids as clips are, with the depth layers of meshes. Out: `solid` (3D r16unorm), whether each brick has any. Cost: 9 to 41 samples a voxel, once
//! for each edit of the solids.

use crate::Result;
use crate::clip::clips::ClipSet;
use crate::clip::positions;
use crate::field::{Field, volume_image, volume_of};
use crate::host::row_of_groups;
use cao_gpu::{Access, Buffer, BufferUse, Format, Gpu, Image, Pipeline, Recorder};
use cao_kernels::solid as kernel;
use cao_model::settings::AntiAliasing;

/// The solids of a volume, as `carve` reads them.
pub struct Solids {
    /// Bound as `solid`: of one voxel where there are none.
    pub solid: Image,
    /// Bound as `solid_bricks`.
    pub bricks: Buffer,
    /// Whether there are any,
    pub any: bool,
    /// and whether clips leave them whole.
    pub spared: bool,
}

impl Solids {
    /// None. Uses the device's queue and waits for it.
    pub fn none(gpu: &Gpu) -> Result<Self> {
        let none = Self {
            solid: volume_of(gpu, "no solids", [1; 3], Format::R16Unorm)?,
            bricks: gpu.buffer("no solid bricks", 4, BufferUse::Device)?,
            any: false,
            spared: false,
        };
        let mut rec = gpu.recorder("no solids")?;
        rec.discard(&none.solid);
        rec.barrier(&[], &[Access::TransferWrite]);
        rec.fill(&none.bricks, 0, 4, 0)?;
        rec.submit_and_wait()?;
        Ok(none)
    }

    /// Memory for those of a volume.
    pub fn of(gpu: &Gpu, field: &Field, spared: bool) -> Result<Self> {
        Ok(Self {
            solid: volume_image(gpu, "solids", field, Format::R16Unorm)?,
            bricks: gpu.buffer("solid bricks", 4 * u64::from(field.brick_count()), BufferUse::Device)?,
            any: true,
            spared,
        })
    }
}

/// The kernel `solid`.
pub struct Solid {
    pipeline: Pipeline,
    positions: Buffer,
}

impl Solid {
    /// Builds the pipeline and the table of sample positions. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")?, positions: positions::buffer(gpu)? })
    }

    /// Fills the solids, which are of this set.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        samples: AntiAliasing,
        set: &ClipSet,
        to: &Solids,
    ) -> Result<()> {
        let params = kernel::SolidParams {
            dims: field.dims,
            spacing: field.spacing,
            sampling: positions::sampling(samples),
            pad: Default::default(),
        };
        let binds = kernel::MainBindings {
            clips: &set.clips,
            layers: &set.layers,
            positions: &self.positions,
            solid_bricks: &to.bricks,
            solid: &to.solid,
        };
        rec.dispatch(
            &self.pipeline,
            &binds,
            bytemuck::bytes_of(&params),
            row_of_groups(field.brick_count()),
        )?;
        Ok(())
    }
}
