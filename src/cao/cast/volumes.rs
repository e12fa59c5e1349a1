//! The full-size volumes that methods read and write, and the kernels that fill them.

use crate::ambient::{Categories, Fields};
use crate::cast::lao::Lao;
use crate::clip::classify::Classify;
use crate::clip::clip_bricks::ClipBricks;
use crate::field::Field;
use crate::field::bricks::{BrickList, Bricks};
use crate::field::ones::Ones;
use crate::field::opacity::Opacity;
use crate::field::volume_image;
use crate::host::{read_buffer, read_texels};
use crate::subject::Subject;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Format, Gpu, Image};

/// Device memory of one scene, beside the volume itself (CAO Fig. 3). 13 bytes a voxel and a little over 12 a brick of 512.
pub struct Volumes {
    /// Opacity before clipping, r32float.
    pub full_opacity: Image,
    /// V_o: opacity after clipping, r32float.
    pub opacity: Image,
    /// V_m: category of each voxel, r8uint.
    pub mask: Image,
    /// V_AO, r32float.
    pub ambient: Image,
    /// What the clips do to each brick, u32 each.
    pub clip_bricks: Buffer,
    /// Bricks that the last contextual update changed, u32 each.
    pub changed_before: Buffer,
    /// Bricks to work on.
    pub list: BrickList,
}

impl Volumes {
    /// Allocates them for a field; V_AO holds 1, nothing is clipped. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu, field: &Field) -> Result<Self> {
        // Classification counts its categories.
        field.countable()?;
        let bricks = 4 * u64::from(field.brick_count());
        let volumes = Self {
            full_opacity: volume_image(gpu, "full opacity", field, Format::R32Float)?,
            opacity: volume_image(gpu, "opacity", field, Format::R32Float)?,
            mask: volume_image(gpu, "mask", field, Format::R8Uint)?,
            ambient: volume_image(gpu, "ambient", field, Format::R32Float)?,
            clip_bricks: ClipBricks::buffer(gpu, field)?,
            changed_before: gpu.buffer("changed before", bricks, BufferUse::Device)?,
            list: BrickList::new(gpu, field)?,
        };
        let mut rec = gpu.recorder("clear volumes")?;
        for image in [&volumes.full_opacity, &volumes.opacity, &volumes.mask, &volumes.ambient] {
            rec.discard(image);
        }
        rec.barrier(&[], &[Access::TransferWrite]);
        rec.clear_image(&volumes.ambient, [1.0; 4])?;
        rec.submit_and_wait()?;
        Ok(volumes)
    }

    pub(super) fn fields(&self) -> Fields<'_> {
        Fields { opacity: &self.opacity, ambient: &self.ambient, clip_bricks: &self.clip_bricks }
    }

    pub(super) fn mask(&self, on: &Subject) -> crate::Result<Vec<u8>> {
        Ok(read_texels(&on.gpu, &self.mask)?)
    }
}

/// The kernels.
pub struct Kernels {
    /// V_o before clipping.
    pub opacity: Opacity,
    /// What bounds say of whole bricks, for stage 4.
    pub clip_bricks: ClipBricks,
    /// Stage 4, and the reach of its clips.
    pub classify: Classify,
    /// Compaction.
    pub bricks: Bricks,
    /// What nothing is computed for.
    pub ones: Ones,
    /// Stages 1 and 5.
    pub lao: Lao,
}

impl Kernels {
    /// Builds the pipelines. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            opacity: Opacity::new(gpu)?,
            clip_bricks: ClipBricks::new(gpu)?,
            classify: Classify::new(gpu)?,
            bricks: Bricks::new(gpu)?,
            ones: Ones::new(gpu)?,
            lao: Lao::new(gpu)?,
        })
    }

    /// What the last classification counted.
    pub(super) fn categories(&self, on: &Subject) -> crate::Result<Categories> {
        let counted = read_buffer(&on.gpu, &self.classify.count)?;
        Ok(Categories::each(|category| Classify::count_of(&counted, category).into()))
    }
}
