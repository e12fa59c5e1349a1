//! How far what is visible reaches along a direction `d`: its support function `h(d) = max { d·p : p in a voxel that shows something }`
//! in mm from the volume's centre. A voxel is the box around its centre, and shows something if its clipped opacity is more than a
//! 64th ([`FAINT`](kernel::FAINT)) of the largest there is, so that a wide fog does not count beside what stands in it, and counts alone.
//!
//! In: `opacity` V_o, `occupancy`, the words of `clip_bricks`. Out: `h` of up to [`MOST_WAYS`] directions. Cost: two reads a voxel of
//! the bricks that can show something at most; bricks that reach no further than what is found already are not read.

use crate::Result;
use crate::field::Field;
use crate::host::row_of_groups;
use bytemuck::Zeroable;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Image, Pipeline};
use cao_kernels::extent as kernel;
use glam::Vec3;

/// Most directions that are asked for at once.
pub const MOST_WAYS: usize = kernel::MOST_WAYS as usize;

/// The kernel `extent`.
pub struct Extent {
    largest: Pipeline,
    main: Pipeline,
}

impl Extent {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        Ok(Self { largest: pipeline("largest")?, main: pipeline("main")? })
    }

    /// `h` of each direction, of any length, in mm times that length; `None` where nothing is visible. Uses the device's queue and waits
    /// for it.
    ///
    /// # Errors
    /// [`cao_model::Error::Limit`] for more than [`MOST_WAYS`] directions, [`cao_model::Error::Config`] for one that is not finite.
    pub fn run(
        &self,
        gpu: &Gpu,
        field: &Field,
        opacity: &Image,
        occupancy: &Buffer,
        clip_bricks: &Buffer,
        directions: &[Vec3],
    ) -> Result<Option<Vec<f32>>> {
        check(directions)?;
        // From voxels to mm, so that the kernel counts in voxels.
        let ways: Vec<Vec3> = directions.iter().map(|d| *d * Vec3::from_array(field.spacing)).collect();
        let mut content = kernel::Ways::zeroed();
        for (to, way) in content.way.iter_mut().zip(&ways) {
            *to = way.extend(0.0).to_array();
        }
        let bytes = size_of::<kernel::Extent>() as u64;
        let given = gpu.buffer("ways", size_of::<kernel::Ways>() as u64, BufferUse::Device)?;
        let extent = gpu.buffer("extent", bytes, BufferUse::Device)?;
        let read_back = gpu.buffer("extent read-back", bytes, BufferUse::Readback)?;

        let mut rec = gpu.recorder("extent")?;
        rec.update(&given, 0, bytemuck::bytes_of(&content))?;
        rec.fill(&extent, 0, bytes, 0)?;
        rec.barrier(
            &[Access::TransferWrite, Access::StorageWrite],
            &[Access::UniformRead, Access::SampledRead, Access::StorageRead, Access::StorageWrite],
        );
        let params = kernel::ExtentParams { dims: field.dims, pad: Default::default() };
        let groups = row_of_groups(field.brick_count());
        let binds = kernel::LargestBindings { opacity, occupancy, clip_bricks, extent: &extent };
        rec.dispatch(&self.largest, &binds, bytemuck::bytes_of(&params), groups)?;
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
        let binds = kernel::MainBindings { opacity, occupancy, clip_bricks, ways: &given, extent: &extent };
        rec.dispatch(&self.main, &binds, bytemuck::bytes_of(&params), groups)?;
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        rec.copy_buffer(&extent, 0, &read_back, 0, bytes)?;
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        rec.submit_and_wait()?;

        let found: kernel::Extent = bytemuck::pod_read_unaligned(&read_back.read(0, bytes)?);
        if found.largest == 0 {
            return Ok(None);
        }
        // The kernel has the voxels' centres: all boxes reach the same way further.
        let reach = |(way, bits): (&Vec3, u32)| unordered(bits) + 0.5 * way.abs().element_sum();
        Ok(Some(ways.iter().zip(found.reached).map(reach).collect()))
    }
}

fn check(directions: &[Vec3]) -> cao_model::Result<()> {
    if directions.len() > MOST_WAYS {
        return Err(cao_model::Error::Limit {
            what: "directions of the visible extent".into(),
            needed: directions.len() as u64,
            limit: MOST_WAYS as u64,
            hint: "ask for them in several calls".into(),
        });
    }
    match directions.iter().find(|d| !d.is_finite()) {
        Some(direction) => Err(cao_model::Error::Config {
            what: "direction of the visible extent".into(),
            problem: format!("{direction}; expected finite numbers"),
        }),
        None => Ok(()),
    }
}

/// The float whose place in the order this is.
fn unordered(bits: u32) -> f32 {
    f32::from_bits(if bits >> 31 == 1 { bits & !(1 << 31) } else { !bits })
}
