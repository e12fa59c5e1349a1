//! A summed-area table of V_o (docs/tables.md; after Crow 1984, in three dimensions): `table(x, y, z) = Σ_{i<x, j<y, k<z} q(i, j, k)` modulo
//! 2³², q the opacity or the extinction in whole numbers of b bits.
//!
//! Sums of floats fail: the difference of numbers as large as the volume has no digits left for a small box. Whole numbers that wrap around
//! lose nothing: the sum of a box is exact if `(2^b − 1) · voxels < 2³²`, whatever order it was added up in.
//!
//! In: `opacity` V_o (3D r16unorm). Out: `table` (3D r32uint, one texel more along each axis, 4 bytes a voxel). Cost: three passes, of which
//! two are in place; 26 bytes a voxel.

use crate::field::Field;
use cao_gpu::Result;
use cao_gpu::{Access, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse, Pipeline, Recorder};
use cao_kernels::sums as kernel;

pub use kernel::MOST_EXTINCTION;

/// What a table adds up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counted {
    /// b.
    pub bits: u32,
    /// −ln(1 − a) up to [`MOST_EXTINCTION`] instead of opacity.
    pub extinction: bool,
}

impl Counted {
    /// Fewest bits: coarser opacities than a byte's are none.
    pub const FEWEST: u32 = 8;

    /// With as many bits as sums over a box of so many voxels leave, up to the 16 of V_o; `None` where these are fewer than
    /// [`Self::FEWEST`].
    pub fn of(voxels: u64, extinction: bool) -> Option<Self> {
        // ⌊32 − log2 voxels⌋: one less than the numbers whose product stays below 2³².
        let bits = (1..=16).rev().find(|bits| voxels << bits <= 1 << 32)?;
        (bits >= Self::FEWEST).then_some(Self { bits, extinction })
    }

    /// 2^b − 1, what 1 is.
    pub fn levels(self) -> u32 {
        (1 << self.bits) - 1
    }
}

/// The kernel `sums`, and the table.
pub struct Sums {
    begin: Pipeline,
    onward: Pipeline,
    /// r32uint, one texel more than the volume along each axis.
    pub table: Image,
}

impl Sums {
    /// Builds the pipelines and allocates the table. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu, field: &Field) -> Result<Self> {
        let shader = &kernel::SHADER;
        let desc = ImageDesc {
            dims: field.dims.map(|d| d + 1),
            layers: 1,
            format: Format::R32Uint,
            kind: ImageKind::D3,
            usage: ImageUse::SAMPLED | ImageUse::STORAGE,
        };
        let table = gpu.image("summed-area table", &desc)?;
        let mut rec = gpu.recorder("summed-area table")?;
        rec.discard(&table);
        rec.submit_and_wait()?;
        Ok(Self { begin: gpu.compute(shader, "begin")?, onward: gpu.compute(shader, "onward")?, table })
    }

    /// Fills the table from V_o and makes it visible to kernels that read it as a texture.
    pub fn record(&self, rec: &mut Recorder, field: &Field, opacity: &Image, counted: Counted) -> Result<()> {
        let mut params = kernel::SumsParams {
            dims: field.dims,
            axis: 0,
            levels: counted.levels(),
            extinction: u32::from(counted.extinction),
            pad: Default::default(),
        };
        let [x, y, z] = field.dims.map(|d| d + 1);
        let over = |a: u32, b: u32| [a.div_ceil(8), b.div_ceil(8), 1];
        rec.barrier(&[Access::SampledRead, Access::StorageWrite], &[Access::StorageWrite]);
        let binds = kernel::BeginBindings { opacity, table: &self.table };
        rec.dispatch(&self.begin, &binds, bytemuck::bytes_of(&params), over(y, z))?;
        for (axis, groups) in [(1, over(x, z)), (2, over(x, y))] {
            params.axis = axis;
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
            let binds = kernel::OnwardBindings { table: &self.table };
            rec.dispatch(&self.onward, &binds, bytemuck::bytes_of(&params), groups)?;
        }
        rec.barrier(&[Access::StorageWrite], &[Access::SampledRead]);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the largest boxes that have them, and that no sum of theirs wraps around.
    #[test]
    fn bits_are_as_many_as_boxes_leave() {
        for (half, bits) in
            [(0_u64, 16), (19, 16), (20, 15), (32, 13), (50, 12), (64, 10), (100, 9), (127, 8)]
        {
            let voxels = (2 * half + 1).pow(3);
            let counted = Counted::of(voxels, false).unwrap();
            assert_eq!(counted.bits, bits, "{half}");
            assert!(u64::from(counted.levels()) * voxels < 1 << 32, "{half}");
        }
        assert_eq!(Counted::of(257_u64.pow(3), false), None);
    }
}
