//! Eyes and frame settings on the device (`spirv/shared/eyes.wgsl`).

use super::field::Field;
use crate::gpu::{Access, Buffer, BufferUse, Gpu, Recorder, shaders};
use crate::layout_check;
use crate::view::View;
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Eye {
    origin: [f32; 4],
    base: [f32; 4],
    along_u: [f32; 4],
    along_v: [f32; 4],
    depth: [f32; 4],
    view_projection: [[f32; 4]; 4],
}
layout_check!(Eye => shaders::raycast::EYE { origin, base, along_u, along_v, depth, view_projection });

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Frame {
    eye: [Eye; View::MAX],
    dims: [f32; 4],
    spacing: [f32; 4],
    light: [f32; 4],
    ambient: f32,
    diffuse: f32,
    remainder: f32,
    bias: f32,
    scale: f32,
    occluded: f32,
    jitter: f32,
    gain: f32,
}
layout_check!(Frame => shaders::raycast::FRAME {
    eye, dims, spacing, light, ambient, diffuse, remainder, bias, scale, occluded, jitter, gain
});

/// How samples are lit and where they lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Part of the light that comes from everywhere; times the ambient factor.
    pub ambient: f32,
    /// Part of the light that depends on the surface's direction; times the ambient factor too.
    pub diffuse: f32,
    /// Direction towards the light in the world; the same for both eyes.
    pub light: Vec3,
    /// Distance between samples along a ray in mm; `None` is a quarter of the smallest spacing: at half of it,
    /// steep transfer functions show wood-grain.
    pub step_mm: Option<f32>,
    /// A ray ends where what remains of it cannot change an 8-bit sRGB pixel, over any background, by more than this many
    /// levels of 255; 0: only where nothing remains.
    pub tolerance: f32,
    /// The ambient factor is shown times this. A flat wall's is 1/2, so that 2 shows it at full light; the paper's authors do
    /// the same.
    pub gain: f32,
    /// Whether samples start at another fraction of a step in every pixel, against banding.
    pub jitter: bool,
    /// Whether the ambient factor is shown; without it the picture is the paper's "solid colour".
    pub occluded: bool,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            ambient: 0.6,
            diffuse: 0.6,
            light: Vec3::new(-0.4, -0.7, 0.6),
            step_mm: None,
            tolerance: 0.5,
            gain: 2.0,
            jitter: true,
            occluded: true,
        }
    }
}

/// Most samples on a ray. A frame of more is no better and keeps a device busy for so long that its driver gives up.
const MAX_SAMPLES: f32 = 1e5;

/// The distance between samples in mm, refused where a ray along the volume's diagonal would take too many.
fn checked_step(field: &Field, look: &Look) -> Result<f32> {
    let step = look.step(field.min_spacing());
    let size = Vec3::from_array(std::array::from_fn(|i| field.dims[i] as f32 * field.spacing[i]));
    let samples = size.length() / step;
    if samples <= MAX_SAMPLES {
        return Ok(step);
    }
    Err(Error::Limit {
        what: format!("image.step_mm = {step}: samples along the volume's diagonal"),
        needed: samples as u64,
        limit: MAX_SAMPLES as u64,
        hint: format!("choose a step of at least {} mm", size.length() / MAX_SAMPLES),
    })
}

/// Refuses what is no count of views.
pub fn check_count(views: usize) -> Result<()> {
    match views {
        0 => Err(Error::Config { what: "views".into(), problem: "none; expected at least one".into() }),
        1..=View::MAX => Ok(()),
        _ => Err(Error::Limit {
            what: "views drawn at once".into(),
            needed: views as u64,
            limit: View::MAX as u64,
            hint: "draw them in several passes".into(),
        }),
    }
}

impl Look {
    /// What may remain of a ray's light, times the slope of sRGB coding: the tolerance over the brightest light there is, a
    /// white background's or that of a white sample, unoccluded and facing the light.
    fn remainder(&self) -> f32 {
        let brightest = (self.ambient + self.diffuse) * if self.occluded { self.gain } else { 1.0 };
        self.tolerance / 255.0 / brightest.max(1.0)
    }

    /// The distance between samples in mm, for a volume whose smallest spacing is `min_spacing` mm.
    pub fn step(&self, min_spacing: f32) -> f32 {
        self.step_mm.unwrap_or(0.25 * min_spacing)
    }

    fn check(&self) -> Result<()> {
        let refuse = |what: &str, problem: String| Err(Error::Config { what: what.into(), problem });
        for (what, value) in [
            ("shading.ambient", self.ambient),
            ("shading.diffuse", self.diffuse),
            ("shading.gain", self.gain),
            ("shading.tolerance", self.tolerance),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return refuse(what, format!("{value}; expected a number >= 0"));
            }
        }
        if self.light.try_normalize().is_none() {
            return refuse("shading.light", format!("{}; expected a direction", self.light));
        }
        match self.step_mm {
            Some(step) if !(step.is_finite() && step > 0.0) => {
                refuse("image.step_mm", format!("{step}; expected a length > 0 mm"))
            }
            _ => Ok(()),
        }
    }
}

/// The views and the frame's settings in device memory.
pub struct FrameBuffer {
    /// Bound as `frame`.
    pub buffer: Buffer,
}

impl FrameBuffer {
    /// Memory for one frame.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { buffer: gpu.buffer("frame", size_of::<Frame>() as u64, BufferUse::Device)? })
    }

    /// Writes the frame and makes it visible to all shaders. Fails on impossible values in `views` or `look`, and with
    /// [`Error::Limit`] where the step is so small that a ray has more than 10⁵ samples, or for more views than
    /// [`View::MAX`].
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        views: &[View],
        look: &Look,
        reference_mm: f32,
    ) -> Result<()> {
        check_count(views.len())?;
        look.check()?;
        let step = checked_step(field, look)?;
        let mut data = Frame::zeroed();
        for (eye, view) in data.eye.iter_mut().zip(views) {
            view.check()?;
            let (origin, base) = view.ray(Vec2::ZERO);
            let (n, f) = (view.near_mm, view.far_mm);
            *eye = Eye {
                origin: origin.extend(1.0).to_array(),
                base: base.extend(0.0).to_array(),
                along_u: (view.ray(Vec2::X).1 - base).extend(0.0).to_array(),
                along_v: (view.ray(Vec2::Y).1 - base).extend(0.0).to_array(),
                depth: [f / (f - n), -f * n / (f - n), n, f],
                view_projection: view.view_projection().to_cols_array_2d(),
            };
        }
        data.dims = [field.dims[0] as f32, field.dims[1] as f32, field.dims[2] as f32, 0.0];
        data.spacing = [field.spacing[0], field.spacing[1], field.spacing[2], step];
        data.light = look.light.normalize().extend(reference_mm).to_array();
        data.ambient = look.ambient;
        data.diffuse = look.diffuse;
        data.remainder = look.remainder();
        data.bias = field.bias;
        data.scale = field.scale;
        data.occluded = f32::from(u8::from(look.occluded));
        data.gain = look.gain;
        data.jitter = f32::from(u8::from(look.jitter));
        rec.barrier(&[Access::UniformRead, Access::GraphicsRead], &[Access::TransferWrite]);
        rec.update(&self.buffer, 0, bytemuck::bytes_of(&data))?;
        rec.barrier(&[Access::TransferWrite], &[Access::UniformRead, Access::GraphicsRead]);
        Ok(())
    }
}
