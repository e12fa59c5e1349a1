//! Stereo consistency (CAO §5, method.md §7): what each eye reads at given points of the volume.
//!
//! In: world points, both eyes, V_o, V_AO. Out: for every point and eye the transmittance in front of it (−1 outside the
//! image) and the ambient factor that the ray cast reads there, of coloured light the least of three. Cost: one ray a point and eye.

use crate::draw::eyes::FrameBuffer;
use crate::draw::eyes::Views;
use crate::host::device_buffer;
use crate::renderer::Renderer;
use cao_gpu::Result;
use cao_gpu::{Access, BufferUse, Format, Gpu, Image, Pipeline, Sampler, SamplerDesc};
use cao_kernels::consistency as kernel;
use cao_model::look::Look;
use cao_model::view::View;
use glam::Vec3;

pub use kernel::Seen;

/// The kernel `consistency`.
pub struct Consistency {
    pipeline: Pipeline,
    field: Sampler,
    edge: Sampler,
}

impl Consistency {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            pipeline: gpu.compute(&kernel::SHADER, "main")?,
            field: gpu.sampler("field", SamplerDesc { linear: true, border_zero: true })?,
            edge: gpu.sampler("edge", SamplerDesc { linear: true, border_zero: false })?,
        })
    }

    /// What the left and the right eye read at each world point (mm). Uses the device's queue and waits for it.
    pub fn run(
        &self,
        gpu: &Gpu,
        frame: &FrameBuffer,
        opacity: &Image,
        (ambient, coloured): (&Image, bool),
        points: &[Vec3],
    ) -> Result<Vec<[Seen; 2]>> {
        if points.is_empty() {
            return Ok(Vec::new());
        }
        let world: Vec<[f32; 4]> = points.iter().map(|p| p.extend(1.0).to_array()).collect();
        let points_buffer = device_buffer(gpu, "points", bytemuck::cast_slice(&world))?;
        let bytes = size_of::<[Seen; 2]>() as u64 * points.len() as u64;
        let seen = gpu.buffer("seen", bytes, BufferUse::Device)?;
        let read_back = gpu.buffer("seen read-back", bytes, BufferUse::Readback)?;
        let mut rec = gpu.recorder("consistency")?;
        let params = kernel::ConsistencyParams {
            count: points.len() as u32,
            channels: match ambient.desc().format {
                Format::Rgba16Unorm if coloured => kernel::COLOURS,
                Format::Rgba16Unorm => kernel::FEATURES,
                _ => kernel::ONE,
            },
        };
        let binds = kernel::MainBindings {
            opacity,
            ambient,
            field: &self.field,
            edge: &self.edge,
            frame: &frame.buffer,
            points: &points_buffer,
            seen: &seen,
        };
        rec.dispatch_over(&self.pipeline, &binds, bytemuck::bytes_of(&params), [params.count, 1, 1])?;
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        rec.copy_buffer(&seen, 0, &read_back, 0, bytes)?;
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        rec.submit_and_wait()?;
        Ok(bytemuck::pod_collect_to_vec(&read_back.read(0, bytes)?))
    }
}

/// What the left and the right eye read at world points in mm, in the order given. Refuses while the ambient volume is out of date.
/// Uses the device's queue and waits for it.
pub fn seen_by_both(
    renderer: &Renderer,
    views: &[View; 2],
    look: &Look,
    points: &[Vec3],
) -> crate::Result<Vec<[Seen; 2]>> {
    renderer.current()?;
    let (subject, fields) = (renderer.subject(), renderer.ambient().fields());
    let mut rec = subject.gpu.recorder("frame")?;
    renderer.frame().record(&mut rec, &subject.field, Views::Now(views), look, subject.reference_mm())?;
    rec.submit_and_wait()?;
    let consistency = Consistency::new(&subject.gpu)?;
    let ambient = (fields.ambient, subject.coloured());
    Ok(consistency.run(&subject.gpu, renderer.frame(), fields.opacity, ambient, points)?)
}
