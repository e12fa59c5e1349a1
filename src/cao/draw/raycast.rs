//! Stage 6 of CAO §3.5: all views by ray casting, in one multiview pass into an image of a layer each.
//!
//! `C = Σ_i Π_{j<i} (1 − α_j) α_i L_i c_i`, `α = 1 − (1 − a)^(Δ/ℓ)`, `L = A(x)·(k_a + k_d |n·l|)`. In: `volume`, `transfer`,
//! `opacity` V_o (gradients), `ambient` V_AO, `distances`, clips, frame. Out: colour, premultiplied, linear; depth, Vulkan's
//! 0 … 1, where a ray's opacity passes one half. Cost: rays × samples in bricks that show something.

use crate::Result;
use crate::clip::clips::ClipSet;
use crate::draw::eyes::{FrameBuffer, check_count};
use crate::field::Field;
use crate::field::transfer::TransferBuffer;
use cao_gpu::{
    Attachments, Buffer, Cull, DepthTest, Format, Gpu, GraphicsDesc, Image, Pipeline, Recorder, Sampler,
    SamplerDesc,
};
use cao_kernels::raycast as kernel;
use cao_model::view::View;
use std::sync::OnceLock;

/// What the kernel reads.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// The volume.
    pub field: &'a Field,
    /// Transfer function.
    pub transfer: &'a TransferBuffer,
    /// V_o, clipped.
    pub opacity: &'a Image,
    /// V_AO.
    pub ambient: &'a Image,
    /// How far rays may leap.
    pub distances: &'a Buffer,
    /// The clips.
    pub clips: &'a ClipSet,
    /// The frame.
    pub frame: &'a FrameBuffer,
}

/// The kernel `raycast`.
pub struct Raycast {
    gpu: Gpu,
    colour: Format,
    /// By number of views, less one: a pipeline's view mask is fixed.
    pipelines: [OnceLock<Pipeline>; View::MAX],
    field: Sampler,
    edge: Sampler,
}

impl Raycast {
    /// Builds the pipeline for two views, a colour attachment of this format and a depth attachment `D32Float`.
    pub fn new(gpu: &Gpu, colour: Format) -> Result<Self> {
        let raycast = Self {
            gpu: gpu.clone(),
            colour,
            pipelines: Default::default(),
            field: gpu.sampler("field", SamplerDesc { linear: true, border_zero: true })?,
            edge: gpu.sampler("edge", SamplerDesc { linear: true, border_zero: false })?,
        };
        raycast.pipeline(2)?;
        Ok(raycast)
    }

    /// The pipeline for this many views, built when it is first asked for.
    fn pipeline(&self, views: usize) -> Result<&Pipeline> {
        check_count(views)?;
        let slot = &self.pipelines[views - 1];
        if let Some(pipeline) = slot.get() {
            return Ok(pipeline);
        }
        let pipeline = self.gpu.graphics(
            &kernel::SHADER,
            &GraphicsDesc {
                vertex: "vertex",
                fragment: "fragment",
                colours: &[self.colour],
                depth: Some(Format::D32Float),
                depth_test: DepthTest::Always,
                depth_write: true,
                cull: Cull::None,
                view_mask: (1 << views) - 1,
                ..GraphicsDesc::default()
            },
        )?;
        Ok(slot.get_or_init(|| pipeline))
    }

    /// Draws the first `views` views of the frame over the whole of as many layers. A number other than two builds its pipeline
    /// when it first comes. Fails for more views than [`View::MAX`] or than the images have layers.
    pub fn record(
        &self,
        rec: &mut Recorder,
        bindings: Bindings,
        views: usize,
        colour: &Image,
        depth: &Image,
        size: [u32; 2],
    ) -> Result<()> {
        let b = bindings;
        let params = kernel::RaycastParams { size: size.map(|s| s as f32) };
        let binds = kernel::DrawBindings {
            volume: &b.field.volume,
            transfer: &b.transfer.buffer,
            opacity: b.opacity,
            ambient: b.ambient,
            field: &self.field,
            edge: &self.edge,
            frame: &b.frame.buffer,
            distances: b.distances,
            clips: &b.clips.clips,
            layers: &b.clips.layers,
        };
        let attachments = Attachments {
            colours: &[(colour, Some([0.0; 4]))],
            depth: Some((depth, Some(1.0))),
            layer: None,
            size,
        };
        Ok(rec.draw(
            self.pipeline(views)?,
            &binds,
            bytemuck::bytes_of(&params),
            attachments,
            kernel::CORNERS,
        )?)
    }
}
