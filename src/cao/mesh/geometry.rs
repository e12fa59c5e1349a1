//! What pixels show (`spirv/shared/geometry.wgsl`), and values that belong to them: the ground of every method of ambient occlusion of pixels.
//!
//! 16 bytes a pixel and view for normal and depth, 4 for a value.

use crate::draw::eyes::{check_count, eyes_of};
use crate::{Error, Result};
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Recorder};
use cao_kernels::shared::geometry::Eyes;
use cao_model::view::View;

/// Normals and depths of several views of one size, and the views.
pub struct Geometry {
    /// Bound as `geometry`: for each pixel, rows from the top, view after view, a unit normal and a view depth in mm, f32 each; depth 0 where
    /// nothing is.
    pub pixels: Buffer,
    /// Bound as `eyes`.
    pub eyes: Buffer,
    size: [u32; 2],
    views: usize,
}

impl Geometry {
    /// Bytes of a pixel.
    pub const BYTES: u64 = 16;

    /// Memory for so many views of `size` pixels.
    ///
    /// # Errors
    /// No pixels, no views or more than [`View::MAX`]; a device without memory.
    pub fn new(gpu: &Gpu, size: [u32; 2], views: usize) -> Result<Self> {
        check_count(views)?;
        let pixels = count(size, views);
        if pixels == 0 {
            return Err(Error::refused("picture", "has no pixels"));
        }
        Ok(Self {
            pixels: gpu.buffer("geometry", Self::BYTES * pixels, BufferUse::Device)?,
            eyes: gpu.buffer("eyes", size_of::<Eyes>() as u64, BufferUse::Device)?,
            size,
            views,
        })
    }

    /// Pixels across and down a view.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Number of views.
    pub fn views(&self) -> usize {
        self.views
    }

    /// Writes the eyes and makes them visible to kernels.
    ///
    /// # Errors
    /// Another number of views than there is room for, or impossible ones.
    pub fn record_eyes(&self, rec: &mut Recorder, views: &[View]) -> Result<()> {
        if views.len() != self.views {
            let problem = format!("has room for {} views, given are {}", self.views, views.len());
            return Err(Error::refused("geometry", problem));
        }
        let eyes = Eyes { eye: eyes_of(views)? };
        rec.barrier(&[Access::UniformRead, Access::GraphicsRead], &[Access::TransferWrite]);
        rec.update(&self.eyes, 0, bytemuck::bytes_of(&eyes))?;
        rec.barrier(&[Access::TransferWrite], &[Access::UniformRead, Access::GraphicsRead]);
        Ok(())
    }

    /// Memory for an f32 a pixel, in the order of the pixels.
    ///
    /// # Errors
    /// A device without memory.
    pub fn values(&self, gpu: &Gpu, name: &str) -> Result<Buffer> {
        Ok(gpu.buffer(name, 4 * count(self.size, self.views), BufferUse::Device)?)
    }
}

/// Pixels of all views.
fn count([width, height]: [u32; 2], views: usize) -> u64 {
    u64::from(width) * u64::from(height) * views as u64
}
