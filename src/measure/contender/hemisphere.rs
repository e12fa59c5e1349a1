//! [`Ssao`]: a hemisphere of points around what each eye's depth image shows.

use super::image_space::{IMAGE_SPACE, Passes};
use super::{Arena, surface_look};
use crate::Result;
use crate::kernels::ssao::Ssao;
use cao::host::read_buffer;
use cao::renderer::{COLOUR, Renderer, Target, Targets};
use cao_gpu::{Access, Buffer, BufferUse, Format, Image, ImageDesc, ImageKind, ImageUse, Timings};

/// A surface hides a point only if it is nearer by more than this many voxels: what the step of the rays that drew it leaves open.
const BIAS_VOXELS: f64 = 0.25;

/// Its kernel and what it writes.
pub struct Hemisphere {
    ssao: Ssao,
    samples: u32,
    colour: Image,
    depth: Image,
    /// One value a pixel, each eye.
    occlusion: [Buffer; 2],
}

impl Hemisphere {
    /// Its setting in words.
    pub fn details() -> String {
        format!("both eyes' depth images, bias {BIAS_VOXELS} voxel; halved")
    }

    /// With so many points.
    pub fn new(Arena { gpu, size: [width, height], .. }: Arena, samples: u32) -> Result<Self> {
        let target = |name, format| {
            let usage = ImageUse::ATTACHMENT | ImageUse::SAMPLED;
            gpu.image(
                name,
                &ImageDesc { dims: [width, height, 1], layers: 2, format, kind: ImageKind::D2, usage },
            )
        };
        let bytes = 4 * u64::from(width) * u64::from(height);
        Ok(Self {
            ssao: Ssao::new(gpu)?,
            samples,
            colour: target("image-space colour", COLOUR)?,
            depth: target("image-space depth", Format::D32Float)?,
            occlusion: [
                gpu.buffer("image-space occlusion", bytes, BufferUse::Device)?,
                gpu.buffer("image-space occlusion", bytes, BufferUse::Device)?,
            ],
        })
    }
}

impl Passes for Hemisphere {
    fn shade(&mut self, arena: Arena, renderer: &Renderer, radius_mm: f32) -> Result<Timings> {
        let Arena { gpu, volume, views, size } = arena;
        let mut rec = gpu.recorder("image-space frame")?;
        rec.discard(&self.colour);
        rec.discard(&self.depth);
        rec.barrier(&[], &[Access::AttachmentWrite]);
        let targets = Target::layers(&self.colour, &self.depth, views.len());
        renderer.record_draw(&mut rec, views, &surface_look(), &Targets::new(&targets, size))?;
        rec.submit_and_wait()?;

        let mut rec = gpu.recorder("image-space occlusion")?;
        let bias_mm = (BIAS_VOXELS * volume.min_spacing()) as f32;
        rec.stage(IMAGE_SPACE)?;
        for (eye, to) in self.occlusion.iter().enumerate() {
            let (view, layer) = (&views[eye], eye as u32);
            self.ssao.record(&mut rec, view, &self.depth, layer, radius_mm, self.samples, bias_mm, to)?;
        }
        rec.end_stage()?;
        Ok(rec.submit_and_wait()?)
    }

    fn factors(&self, arena: Arena, eye: usize) -> Result<Vec<f32>> {
        Ok(bytemuck::pod_collect_to_vec(&read_buffer(arena.gpu, &self.occlusion[eye])?))
    }
}
