//! Eyes and frame settings on the device (`spirv/shared/eyes.wgsl`).

use crate::Result;
use crate::field::Field;
use bytemuck::Zeroable;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Recorder};
use cao_kernels::shared::eyes::{self, Eye, Frame, MOST_VIEWS};
use cao_model::look::{Look, Occluded};
use cao_model::samples::MOST_SAMPLES;
use cao_model::view::View;
use glam::{Vec2, Vec3};

const _: () = assert!(MOST_VIEWS as usize == View::MAX);
const _: () = assert!(eyes::MOST_SAMPLES == MOST_SAMPLES && 2 * eyes::PAIRS_OF_SAMPLES == MOST_SAMPLES);

/// Most samples on a ray. A frame of more is no better and keeps a device busy for so long that its driver gives up.
const MAX_SAMPLES: f32 = 1e5;

/// The distance between samples in mm, refused where a ray along the volume's diagonal would take too many.
fn checked_step(field: &Field, look: &Look) -> cao_model::Result<f32> {
    let step = look.step(field.min_spacing());
    let size = Vec3::from_array(std::array::from_fn(|i| field.dims[i] as f32 * field.spacing[i]));
    let samples = size.length() / step;
    if samples <= MAX_SAMPLES {
        return Ok(step);
    }
    Err(cao_model::Error::Limit {
        what: format!("image.step_mm = {step}: samples along the volume's diagonal"),
        needed: samples as u64,
        limit: MAX_SAMPLES as u64,
        hint: format!("choose a step of at least {} mm", size.length() / MAX_SAMPLES),
    })
}

/// Refuses what is no count of views.
pub fn check_count(views: usize) -> cao_model::Result<()> {
    match views {
        0 => Err(cao_model::Error::Config {
            what: "views".into(),
            problem: "none; expected at least one".into(),
        }),
        1..=View::MAX => Ok(()),
        _ => Err(cao_model::Error::Limit {
            what: "views drawn at once".into(),
            needed: views as u64,
            limit: View::MAX as u64,
            hint: "draw them in several passes".into(),
        }),
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
    /// [`cao_model::Error::Limit`] where the step is so small that a ray has more than 10⁵ samples, or for more views than
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
            let [a, b] = view.depth_terms();
            *eye = Eye {
                origin: origin.extend(1.0).to_array(),
                base: base.extend(0.0).to_array(),
                along_u: (view.ray(Vec2::X).1 - base).extend(0.0).to_array(),
                along_v: (view.ray(Vec2::Y).1 - base).extend(0.0).to_array(),
                // No device has to know infinity.
                depth: [a, b, view.near_mm, view.far_mm.min(f32::MAX)],
                view_projection: view.view_projection().to_cols_array_2d(),
            };
        }
        data.dims = [field.dims[0] as f32, field.dims[1] as f32, field.dims[2] as f32, 0.0];
        data.spacing = [field.spacing[0], field.spacing[1], field.spacing[2], step];
        // The first view is the head, so that all views see the same light.
        data.light = look.towards_light(views[0].orientation).extend(reference_mm).to_array();
        [data.ambient, data.diffuse, data.specular] = look.parts();
        data.shininess = look.shininess;
        let flag = |on| f32::from(u8::from(on));
        data.two_sided = flag(look.two_sided);
        data.occluded = flag(look.shading.occluded());
        data.occluded_rest = flag(look.shading.occluded() && look.occluded == Occluded::All);
        data.gain = look.gain;
        data.remainder = look.remainder();
        data.bias = field.bias;
        data.scale = field.scale;
        (data.samples, data.share) = (look.samples, 1.0 / look.samples as f32);
        let places = data.places.as_flattened_mut().chunks_exact_mut(2);
        places.zip(look.offsets()).for_each(|(place, at)| place.copy_from_slice(&at.to_array()));
        rec.barrier(&[Access::UniformRead, Access::GraphicsRead], &[Access::TransferWrite]);
        rec.update(&self.buffer, 0, bytemuck::bytes_of(&data))?;
        rec.barrier(&[Access::TransferWrite], &[Access::UniformRead, Access::GraphicsRead]);
        Ok(())
    }
}
