//! `image space`: ambient occlusion from each eye's depth image ([`Ssao`]), as renderers without data-space values have
//! it. Its time is that of both eyes' passes; the depth images it takes are those of the frame, which is drawn anyway.
//!
//! It has values at what the eyes see only: its errors are at points of the surface in the left eye's image. It shades half
//! a sphere where the others shade all of it; twice their ambient factor is what it stands for, and so its values are halved.

use super::rendered::{change_to, with_radius};
use super::{Arena, Asked, Change, Contender, Entrant, HALF_SPHERE, Setting, State, Values, surface_look};
use crate::Result;
use crate::kernels::ssao::Ssao;
use cao::renderer::{COLOUR, Renderer, StereoImage, Target, Targets};
use cao_gpu::{
    Access, Buffer, BufferUse, Format, Image, ImageDesc, ImageKind, ImageUse, Phase, Stage, Timings,
};
use cao_model::look::{Look, Shading};
use cao_model::methods::Method;
use cao_model::settings::Setup;

const IMAGE_SPACE: Stage = Stage::new("image space", Phase::Ambient);

/// A surface hides a point only if it is nearer by more than this many voxels: what the step of the rays that drew it leaves open.
const BIAS_VOXELS: f64 = 0.25;

/// Numbers of points in the hemisphere.
pub fn entrants(name: &'static str, asked: &Asked) -> Vec<Entrant> {
    let samples: &[u32] = if asked.quick { &[32] } else { &[8, 32, 128] };
    samples.iter().map(|&samples| entrant(name, samples)).collect()
}

fn entrant(name: &'static str, samples: u32) -> Entrant {
    Entrant {
        method: name,
        setting: Setting {
            label: format!("{samples} samples"),
            quadrature: None,
            details: format!("both eyes' depth images, bias {BIAS_VOXELS} voxel; halved"),
        },
        work: 0.5,
        has_values: true,
        open: Box::new(move |arena, state| Ok(Box::new(ImageSpace::open(arena, state, samples)?))),
    }
}

struct ImageSpace<'a> {
    arena: Arena<'a>,
    renderer: Renderer,
    setup: Setup,
    ssao: Ssao,
    samples: u32,
    radius_mm: f32,
    colour: Image,
    depth: Image,
    /// One value a pixel, each eye.
    occlusion: [Buffer; 2],
    read_back: Buffer,
}

impl<'a> ImageSpace<'a> {
    fn open(arena: Arena<'a>, state: &State, samples: u32) -> Result<Self> {
        let Arena { gpu, volume, size: [width, height], .. } = arena;
        let setup = with_radius(Setup::of(Method::Cao, volume.min_spacing()), 0.0);
        let mut renderer = Renderer::new(gpu, volume, state.transfer.clone(), setup, COLOUR)?;
        renderer.set_clips(&state.clips)?;
        let target = |name, format| {
            let usage = ImageUse::ATTACHMENT | ImageUse::SAMPLED;
            gpu.image(
                name,
                &ImageDesc { dims: [width, height, 1], layers: 2, format, kind: ImageKind::D2, usage },
            )
        };
        let bytes = 4 * u64::from(width) * u64::from(height);
        let mut made = Self {
            arena,
            renderer,
            setup,
            ssao: Ssao::new(gpu)?,
            samples,
            radius_mm: state.radius_mm,
            colour: target("image-space colour", COLOUR)?,
            depth: target("image-space depth", Format::D32Float)?,
            occlusion: [
                gpu.buffer("image-space occlusion", bytes, BufferUse::Device)?,
                gpu.buffer("image-space occlusion", bytes, BufferUse::Device)?,
            ],
            read_back: gpu.buffer("image-space read-back", bytes, BufferUse::Readback)?,
        };
        made.shade()?;
        Ok(made)
    }

    /// Draws the frame, then shades both eyes' depth. The time is that of the shading.
    fn shade(&mut self) -> Result<Timings> {
        self.renderer.update(&mut |_| ())?;
        let Arena { gpu, volume, views, size, .. } = self.arena;
        let mut rec = gpu.recorder("image-space frame")?;
        rec.discard(&self.colour);
        rec.discard(&self.depth);
        rec.barrier(&[], &[Access::AttachmentWrite]);
        let targets = Target::layers(&self.colour, &self.depth, views.len());
        self.renderer.record_draw(&mut rec, views, &surface_look(), &Targets::new(&targets, size))?;
        rec.submit_and_wait()?;

        let mut rec = gpu.recorder("image-space occlusion")?;
        let bias_mm = (BIAS_VOXELS * volume.min_spacing()) as f32;
        rec.stage(IMAGE_SPACE)?;
        for (eye, to) in self.occlusion.iter().enumerate() {
            let (view, radius) = (&views[eye], self.radius_mm);
            self.ssao.record(&mut rec, view, &self.depth, eye as u32, radius, self.samples, bias_mm, to)?;
        }
        rec.end_stage()?;
        Ok(rec.submit_and_wait()?)
    }

    /// One a pixel.
    fn factors(&self, eye: usize) -> Result<Vec<f32>> {
        let (from, to) = (&self.occlusion[eye], &self.read_back);
        let mut rec = self.arena.gpu.recorder("read image space")?;
        rec.copy_buffer(from, 0, to, 0, from.bytes())?;
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        rec.submit_and_wait()?;
        Ok(bytemuck::pod_collect_to_vec(&to.read(0, to.bytes())?))
    }
}

impl Contender for ImageSpace<'_> {
    fn update(&mut self, change: Change, state: &State) -> Result<Timings> {
        let unoccluded = State { radius_mm: 0.0, ..state.clone() };
        change_to(&mut self.renderer, self.setup, change, &unoccluded)?;
        self.radius_mm = state.radius_mm;
        self.shade()
    }

    fn ambient(&self) -> Result<Values> {
        let halved = self.factors(0)?.into_iter().map(|factor| HALF_SPHERE * factor);
        Ok(Values::Pixels(halved.collect()))
    }

    fn draw(&self, look: &Look) -> Result<(StereoImage, Timings)> {
        let look = Look { shading: Shading::Phong, ..*look };
        let (mut image, timings) = self.renderer.draw(self.arena.views, &look, self.arena.size)?;
        for eye in 0..2 {
            // The picture's own gain, for what is half of the data-space values.
            let factors = self.factors(eye)?;
            for (pixel, factor) in image.colour[eye].iter_mut().zip(factors) {
                let light = look.gain * HALF_SPHERE * factor;
                (pixel[0], pixel[1], pixel[2]) = (pixel[0] * light, pixel[1] * light, pixel[2] * light);
            }
        }
        Ok((image, timings))
    }
}
