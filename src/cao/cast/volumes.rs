//! The full-size volumes that methods read and write, and the kernels that fill them.

use crate::cast::lao::Lao;
use crate::clip::classify::Classify;
use crate::clip::clip_bricks::ClipBricks;
use crate::field::Field;
use crate::field::bricks::{BrickList, Bricks};
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse};
use cao_model::occlusion::Occlusion;
use cao_model::settings::Scope;

/// Device memory of one scene, beside the volume itself (CAO Fig. 3). 17 bytes a voxel and a little over 16 a brick of 512.
pub struct Volumes {
    /// Opacity before clipping, r32float.
    pub full_opacity: Image,
    /// V_o: opacity after clipping, r32float.
    pub opacity: Image,
    /// V_m: category of each voxel, r8uint.
    pub mask: Image,
    /// V_PAO: ambient factor without clips, r32float.
    pub precomputed: Image,
    /// V_AO, r32float.
    pub ambient: Image,
    /// What the clips do to each brick, u32 each.
    pub clip_bricks: Buffer,
    /// Bricks with opacity before clipping, u32 each.
    pub occupancy: Buffer,
    /// Bricks that the last contextual update changed, u32 each.
    pub changed_before: Buffer,
    /// Bricks to work on.
    pub list: BrickList,
}

impl Volumes {
    /// Allocates them for a field; V_AO and V_PAO hold 1, nothing is clipped. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu, field: &Field) -> Result<Self> {
        let bricks = 4 * u64::from(field.brick_count());
        let volumes = Self {
            full_opacity: volume_image(gpu, "full opacity", field, Format::R32Float)?,
            opacity: volume_image(gpu, "opacity", field, Format::R32Float)?,
            mask: volume_image(gpu, "mask", field, Format::R8Uint)?,
            precomputed: volume_image(gpu, "precomputed ambient", field, Format::R32Float)?,
            ambient: volume_image(gpu, "ambient", field, Format::R32Float)?,
            clip_bricks: ClipBricks::buffer(gpu, field)?,
            occupancy: gpu.buffer("occupancy", bricks, BufferUse::Device)?,
            changed_before: gpu.buffer("changed before", bricks, BufferUse::Device)?,
            list: BrickList::new(gpu, field)?,
        };
        let mut rec = gpu.recorder("clear volumes")?;
        for image in
            [&volumes.full_opacity, &volumes.opacity, &volumes.mask, &volumes.precomputed, &volumes.ambient]
        {
            rec.discard(image);
        }
        rec.barrier(&[], &[Access::TransferWrite]);
        rec.clear_image(&volumes.precomputed, [1.0; 4])?;
        rec.clear_image(&volumes.ambient, [1.0; 4])?;
        rec.submit_and_wait()?;
        Ok(volumes)
    }
}

/// A 3D image of the field's size that kernels sample and store to.
pub fn volume_image(gpu: &Gpu, name: &str, field: &Field, format: Format) -> Result<Image> {
    let usage = ImageUse::SAMPLED | ImageUse::STORAGE;
    gpu.image(name, &ImageDesc { dims: field.dims, layers: 1, format, kind: ImageKind::D3, usage })
}

/// Texels of a volume, x fastest; slices at a time, a sixteenth of it, so that reading takes little memory. Uses the device's queue and
/// waits for it.
pub fn read_texels(gpu: &Gpu, image: &Image) -> Result<Vec<u8>> {
    let [x, y, z] = image.desc().dims;
    let slice = u64::from(x) * u64::from(y) * image.desc().format.bytes();
    let slices = ((64 << 20) / slice).clamp(1, u64::from(z.div_ceil(16))) as u32;
    let read_back = gpu.buffer("volume read-back", slice * u64::from(slices), BufferUse::Readback)?;
    let mut all = Vec::with_capacity((slice * u64::from(z)) as usize);
    let mut first = 0;
    while first < z {
        let count = slices.min(z - first);
        let mut rec = gpu.recorder("read volume")?;
        rec.copy_image_to_buffer(image, 0, [0, 0, first], [x, y, count], &read_back, 0)?;
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        rec.submit_and_wait()?;
        all.extend(read_back.read(0, slice * u64::from(count))?);
        first += count;
    }
    Ok(all)
}

/// What the texels of an r32float or r16unorm volume stand for, x fastest. Uses the device's queue and waits for it.
pub fn read_values(gpu: &Gpu, image: &Image) -> Result<Vec<f32>> {
    let texels = read_texels(gpu, image)?;
    Ok(match image.desc().format {
        Format::R16Unorm => bytemuck::pod_collect_to_vec::<u8, u16>(&texels)
            .into_iter()
            .map(|texel| f32::from(texel) / 65535.0)
            .collect(),
        _ => bytemuck::pod_collect_to_vec(&texels),
    })
}

/// The kernels that methods share.
pub struct Kernels {
    /// What bounds say of whole bricks, for stage 4.
    pub clip_bricks: ClipBricks,
    /// Stage 4, and the reach of its clips.
    pub classify: Classify,
    /// Compaction.
    pub bricks: Bricks,
    /// Stages 1 and 5.
    pub lao: Lao,
}

impl Kernels {
    /// Builds the pipelines. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            clip_bricks: ClipBricks::new(gpu)?,
            classify: Classify::new(gpu)?,
            bricks: Bricks::new(gpu)?,
            lao: Lao::new(gpu)?,
        })
    }
}

/// What every method is told.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Rays, quadrature, radius.
    pub occlusion: Occlusion,
    /// Which voxels get a value.
    pub scope: Scope,
    /// Reference length of the opacity in mm.
    pub reference_mm: f32,
}
