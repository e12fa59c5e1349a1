//! Eyes and frame settings on the device (`spirv/shared/eyes.wgsl`).

use crate::field::Field;
use crate::{Error, Result};
use bytemuck::Zeroable;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Recorder};
use cao_kernels::shared::eye::{Eye, MOST_VIEWS};
use cao_kernels::shared::eyes::{self, Frame};
use cao_model::look::{Look, Occluded};
use cao_model::samples::MOST_SAMPLES;
use cao_model::view::View;
use glam::{Vec2, Vec3};
use std::mem::offset_of;

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
    /// [`View::MAX`]. Of late views the eyes and the light are those that are there when the commands run.
    pub fn record(
        &self,
        rec: &mut Recorder,
        field: &Field,
        views: Views,
        look: &Look,
        reference_mm: f32,
    ) -> Result<()> {
        look.check()?;
        let step = checked_step(field, look)?;
        let mut data = Frame { eye: eyes_of(views.planned())?, ..Frame::zeroed() };
        data.dims = [field.dims[0] as f32, field.dims[1] as f32, field.dims[2] as f32, 0.0];
        data.spacing = [field.spacing[0], field.spacing[1], field.spacing[2], step];
        data.light = light_of(views.planned(), look).extend(reference_mm).to_array();
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
        if let Views::Late(late) = views {
            rec.barrier(
                &[Access::TransferWrite, Access::HostWrite],
                &[Access::TransferWrite, Access::TransferRead],
            );
            let from = &late.buffer;
            rec.copy_buffer(from, 0, &self.buffer, offset_of!(Frame, eye) as u64, EYES)?;
            rec.copy_buffer(from, EYES, &self.buffer, offset_of!(Frame, light) as u64, LIGHT)?;
        }
        rec.barrier(&[Access::TransferWrite], &[Access::UniformRead, Access::GraphicsRead]);
        Ok(())
    }
}

/// Bytes of all eyes, and of a direction.
const EYES: u64 = size_of::<[Eye; View::MAX]>() as u64;
const LIGHT: u64 = size_of::<[f32; 3]>() as u64;

/// Checked eyes as kernels read them.
pub fn eyes_of(views: &[View]) -> Result<[Eye; View::MAX]> {
    check_count(views.len())?;
    let mut eyes = [Eye::zeroed(); View::MAX];
    for (eye, view) in eyes.iter_mut().zip(views) {
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
    Ok(eyes)
}

/// Towards the light. The first view is the head, so that all views see the same.
fn light_of(views: &[View], look: &Look) -> Vec3 {
    look.towards_light(views[0].orientation)
}

/// The eyes of a frame: known when it is recorded, or later.
#[derive(Clone, Copy)]
pub enum Views<'a> {
    /// Known.
    Now(&'a [View]),
    /// Written until the commands run.
    Late(&'a LateViews),
}

impl<'a> Views<'a> {
    /// As known when the frame is recorded.
    pub fn planned(self) -> &'a [View] {
        match self {
            Self::Now(views) => views,
            Self::Late(late) => &late.planned,
        }
    }
}

impl<'a> From<&'a [View]> for Views<'a> {
    fn from(views: &'a [View]) -> Self {
        Self::Now(views)
    }
}

impl<'a, const N: usize> From<&'a [View; N]> for Views<'a> {
    fn from(views: &'a [View; N]) -> Self {
        Self::Now(views)
    }
}

impl<'a> From<&'a Vec<View>> for Views<'a> {
    fn from(views: &'a Vec<View>) -> Self {
        Self::Now(views)
    }
}

impl<'a> From<&'a LateViews> for Views<'a> {
    fn from(late: &'a LateViews) -> Self {
        Self::Late(late)
    }
}

/// Views in memory that a host writes after it has recorded a frame and submitted it to wait for a timeline semaphore: a headset's pose as
/// late as it is known. The host signals when it has written. Only pictures depend on views; the ambient volume does not.
pub struct LateViews {
    buffer: Buffer,
    planned: Vec<View>,
}

impl LateViews {
    /// Memory for as many views as planned, of their planes, holding these. One for each frame in flight.
    ///
    /// # Errors
    /// Those of impossible views, and of a device without memory.
    pub fn new(gpu: &Gpu, planned: &[View], look: &Look) -> Result<Self> {
        let buffer = gpu.buffer("late views", EYES + LIGHT, BufferUse::Upload)?;
        let late = Self { buffer, planned: planned.to_vec() };
        late.write(planned, look)?;
        Ok(late)
    }

    /// Puts views there, and the direction towards the light, which follows the head where the look says so. Before the signal that the
    /// commands wait for, and not while earlier ones that read it may still run.
    ///
    /// # Errors
    /// [`cao_model::Error::Config`] for another number of views, or other planes, than planned: depth is by those.
    pub fn write(&self, views: &[View], look: &Look) -> Result<()> {
        let planes = |view: &View| (view.near_mm, view.far_mm, view.reversed);
        let same = views.len() == self.planned.len()
            && views.iter().zip(&self.planned).all(|(a, b)| planes(a) == planes(b));
        if !same {
            let problem =
                "other views than planned; their number and near and far planes are fixed when it is made";
            return Err(Error::refused("late views", problem));
        }
        self.buffer.write(0, bytemuck::bytes_of(&eyes_of(views)?))?;
        Ok(self.buffer.write(EYES, bytemuck::bytes_of(&light_of(views, look).to_array()))?)
    }
}
