//! Converged ambient occlusion at given points (measure.md §1): the mean over very many directions of
//! `1/(R − o) ∫_o^R exp(−∫_o^s τ) ds`, τ = −ln(1 − a)/ℓ of the trilinear opacity, in very short steps; or of the sum of CAO eq. (2).
//!
//! In: opacity and its clearance, each with a rim of one transparent voxel; points in index coordinates; an [`Integral`].
//! Out: an f32 a point. Cost: 8 texel reads for each direction and step in or near opacity; steps through what is clear are skipped.

use crate::{Error, Result};
use cao::field::Field;
use cao::host::{device_buffer, row_of_groups};
use cao_gpu::{
    Access, Buffer, BufferUse, DeviceKind, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse, Pipeline,
    Recorder, Sampler, SamplerDesc,
};
use cao_kernels::reference as kernel;
use cao_model::occlusion::{Integral, Rule};

/// The kernel `reference`.
pub struct Reference {
    pipeline: Pipeline,
    field: Sampler,
    /// Whether the device's filter interpolates, which is faster, or the kernel. Filters of software drivers work in f32, those of
    /// others in 8 bits, which is no truth; set accordingly at first.
    pub filtered: bool,
}

/// Points to evaluate, the directions, and the values found.
pub struct Points {
    directions: Buffer,
    at: Buffer,
    found: Buffer,
    direction_count: u32,
    /// Number of points.
    pub count: u32,
}

impl Points {
    /// Copies points (index coordinates of the volume without its rim) and an integral's directions to the device. Uses the device's queue
    /// and waits for it.
    pub fn upload(gpu: &Gpu, positions: &[[f64; 3]], integral: &Integral) -> Result<Self> {
        let directions = integral.directions;
        if positions.is_empty() || directions == 0 {
            return Err(Error::refused(
                "reference",
                format!(
                    "{} points and {directions} directions; expected at least 1 of each",
                    positions.len()
                ),
            ));
        }
        // The rim moves every voxel by one.
        let at: Vec<[f32; 4]> =
            positions.iter().map(|p| [p[0], p[1], p[2], 0.0].map(|c| c as f32 + 1.0)).collect();
        let mut units = integral.lit_directions()?;
        // Neighbours in the list, which a device works on side by side, take ways of similar length.
        units.sort_by_key(|(d, _)| octant_order(d));
        let units: Vec<[f32; 4]> =
            units.iter().map(|([x, y, z], light)| [*x, *y, *z, *light].map(|c| c as f32)).collect();
        Ok(Self {
            directions: device_buffer(gpu, "reference directions", bytemuck::cast_slice(&units))?,
            found: gpu.buffer("reference found", 4 * at.len() as u64, BufferUse::Device)?,
            direction_count: units.len() as u32,
            count: at.len() as u32,
            at: device_buffer(gpu, "reference points", bytemuck::cast_slice(&at))?,
        })
    }

    /// The values found. Uses the device's queue and waits for it.
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<f32>> {
        let bytes = self.found.bytes();
        let read_back = gpu.buffer("reference read-back", bytes, BufferUse::Readback)?;
        let mut rec = gpu.recorder("read reference")?;
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        rec.copy_buffer(&self.found, 0, &read_back, 0, bytes)?;
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        rec.submit_and_wait()?;
        Ok(bytemuck::pod_collect_to_vec(&read_back.read(0, bytes)?))
    }
}

/// Place on a curve that fills the directions cell by cell: octant first, then interleaved bits of the coordinates.
fn octant_order(d: &[f64; 3]) -> u32 {
    let cell = d.map(|c| ((c * 0.5 + 0.5) * 15.999) as u32);
    (0..4).rev().fold(0, |code, bit| cell.iter().fold(code, |code, c| code << 1 | (c >> bit & 1)))
}

/// `clearance`: steps of one voxel, diagonals included, from each voxel to the nearest one with opacity, at most 255; as an
/// image of the field's size. Uses the device's queue and waits for it.
pub fn upload_clearance(gpu: &Gpu, field: &Field, opacity: &[f32]) -> Result<Image> {
    let usage = ImageUse::SAMPLED;
    let desc = ImageDesc { dims: field.dims, layers: 1, format: Format::R8Uint, kind: ImageKind::D3, usage };
    let image = gpu.image("clearance", &desc)?;
    let clear = clearance(field.dims.map(|d| d as usize), opacity);
    let staging = gpu.buffer("clearance staging", clear.len() as u64, BufferUse::Upload)?;
    staging.write(0, &clear)?;
    let mut rec = gpu.recorder("upload clearance")?;
    rec.discard(&image);
    rec.barrier(&[], &[Access::TransferWrite]);
    rec.copy_buffer_to_image(&staging, 0, &image, [0; 3], field.dims)?;
    rec.submit_and_wait()?;
    Ok(image)
}

/// Two sweeps over the voxels, each taking what the 13 neighbours before it have; those after it are before it in the
/// reversed volume.
fn clearance(dims: [usize; 3], opacity: &[f32]) -> Vec<u8> {
    let mut clear: Vec<u8> = opacity.iter().map(|a| if *a > 0.0 { 0 } else { 255 }).collect();
    for _ in 0..2 {
        sweep(dims, &mut clear);
        clear.reverse();
    }
    clear
}

fn sweep([nx, ny, nz]: [usize; 3], clear: &mut [u8]) {
    let mut least = vec![255; nx];
    for row in 0..ny * nz {
        let (before, own) = clear.split_at_mut(row * nx);
        let own = &mut own[..nx];
        let (y, z) = (row % ny, row / ny);
        // The rows before this one that touch it: one in its slice, three in the slice before.
        least.fill(255);
        for (dy, dz) in [(-1, 0), (-1, -1), (0, -1), (1, -1)] {
            let (y, z) = (y as isize + dy, z as isize + dz);
            if y >= 0 && y < ny as isize && z >= 0 {
                let first = (z as usize * ny + y as usize) * nx;
                least
                    .iter_mut()
                    .zip(&before[first..first + nx])
                    .for_each(|(least, c)| *least = (*least).min(*c));
            }
        }
        for x in 0..nx {
            let beside = least[x].min(least[x.saturating_sub(1)]).min(least[(x + 1).min(nx - 1)]);
            let behind = if x > 0 { own[x - 1] } else { 255 };
            own[x] = own[x].min(beside.min(behind).saturating_add(1));
        }
    }
}

impl Reference {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            pipeline: gpu.compute(&kernel::SHADER, "main")?,
            field: gpu.sampler("field", SamplerDesc { linear: true, border_zero: true })?,
            filtered: gpu.info().kind == DeviceKind::Cpu,
        })
    }

    /// Evaluates `count` points from `base` on. `field` is the opacity, `clearance` from [`upload_clearance`], both with
    /// their rim.
    #[expect(clippy::too_many_arguments, reason = "settings and bindings of the kernel, each named once")]
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        clearance: &Image,
        integral: &Integral,
        reference_mm: f64,
        points: &Points,
        base: u32,
        count: u32,
    ) -> cao_gpu::Result<()> {
        let params = kernel::ReferenceParams {
            dims: field.dims,
            samples: integral.samples,
            per_mm: field.spacing.map(f32::recip),
            directions: points.direction_count,
            first: integral.first_mm as f32,
            step: integral.step_mm as f32,
            exponent: (integral.step_mm / reference_mm) as f32,
            rule: match integral.rule {
                Rule::Ambient => kernel::AMBIENT,
                Rule::Literal => kernel::LITERAL,
                Rule::End => kernel::END,
            },
            base,
            count,
            filtered: u32::from(self.filtered),
            pad: Default::default(),
        };
        let binds = kernel::MainBindings {
            opacity: &field.volume,
            clearance,
            field: &self.field,
            directions: &points.directions,
            points: &points.at,
            found: &points.found,
        };
        rec.dispatch(&self.pipeline, &binds, bytemuck::bytes_of(&params), row_of_groups(count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clearance_is_the_largest_step_along_an_axis() {
        let dims = [7, 5, 6];
        let solid = [[1, 2, 3], [6, 4, 0]];
        let mut opacity = vec![0.0; 210];
        assert!(clearance(dims, &opacity).iter().all(|c| *c == 255));
        for [x, y, z] in solid {
            opacity[(z * 5 + y) * 7 + x] = 0.1;
        }
        for (i, found) in clearance(dims, &opacity).into_iter().enumerate() {
            let at = [i % 7, i / 7 % 5, i / 35];
            let to = |s: [usize; 3]| (0..3).map(|a| at[a].abs_diff(s[a])).max().unwrap();
            assert_eq!(usize::from(found), solid.map(to).into_iter().min().unwrap(), "{at:?}");
        }
    }
}
