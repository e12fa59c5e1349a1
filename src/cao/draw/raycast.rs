//! Stage 6 of CAO §3.5: all views by ray casting, in one dispatch, an invocation a pixel, into a layer each of a picture.
//!
//! `C = Σ_i Π_{j<i} (1 − α_j) α_i L_i`, `α = 1 − exp ∫ ln(1 − a) dt/ℓ`, L by `spirv/shared/shading.wgsl`. In: `volume`, `transfer`,
//! `ambient` V_AO, `distances`, `bounds`, clips, frame. Out: colour, premultiplied, linear; depth, Vulkan's
//! 0 … 1, where a ray's opacity passes one half. Cost: rays × samples in bricks that show something.

use crate::Result;
use crate::clip::clips::ClipSet;
use crate::draw::eyes::FrameBuffer;
use crate::draw::filter;
use crate::draw::picture::Picture;
use crate::field::Field;
use crate::field::transfer::TransferBuffer;
use cao_gpu::{Buffer, Format, Gpu, Image, Pipeline, Recorder, Sampler, SamplerDesc};
use cao_kernels::raycast as kernel;

/// What the kernel reads.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// The volume.
    pub field: &'a Field,
    /// Transfer function.
    pub transfer: &'a TransferBuffer,
    /// V_AO.
    pub ambient: &'a Image,
    /// How far rays may leap.
    pub distances: &'a Buffer,
    /// Beyond which nothing is to be seen.
    pub bounds: &'a Buffer,
    /// The clips.
    pub clips: &'a ClipSet,
    /// The frame.
    pub frame: &'a FrameBuffer,
}

/// The kernel `raycast`.
pub struct Raycast {
    pipeline: Pipeline,
    by_hand: u32,
    edge: Sampler,
}

impl Raycast {
    /// Builds the pipeline for a volume. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu, field: &Field) -> Result<Self> {
        let coarse = field.volume.desc().format == Format::R8Unorm && !filter::keeps_fractions(gpu)?;
        Ok(Self {
            by_hand: u32::from(coarse),
            pipeline: gpu.compute(&kernel::SHADER, "main")?,
            edge: gpu.sampler("edge", SamplerDesc { linear: true, border_zero: false })?,
        })
    }

    /// Writes every pixel of a picture; the frame has as many views.
    pub fn record(&self, rec: &mut Recorder, bindings: Bindings, picture: &Picture) -> Result<()> {
        let b = bindings;
        let [width, height] = picture.size();
        let params =
            kernel::RaycastParams { size: [width, height], by_hand: self.by_hand, pad: Default::default() };
        let binds = kernel::MainBindings {
            volume: &b.field.volume,
            transfer: &b.transfer.buffer,
            ambient: b.ambient,
            edge: &self.edge,
            frame: &b.frame.buffer,
            distances: b.distances,
            bounds: b.bounds,
            clips: &b.clips.clips,
            layers: &b.clips.layers,
            colours: &picture.colour,
            depths: &picture.depth,
        };
        let pixels = [width, height, picture.views() as u32];
        Ok(rec.dispatch_over(&self.pipeline, &binds, bytemuck::bytes_of(&params), pixels)?)
    }
}
