//! Stage 6 of CAO §3.5: all views by ray casting, in one dispatch, a workgroup a tile, into a layer each of a picture, which holds
//! whole views or a band of their rows.
//!
//! `C = Σ_i Π_{j<i} (1 − α_j) α_i L_i`, `α = 1 − exp ∫ ln(1 − a) dt/ℓ`, L by `spirv/shared/shading.wgsl`. In: `volume`, `transfer`,
//! `ambient` V_AO, `distances`, `bounds`, clips, frame; where rays end. Out: colour, premultiplied, linear; depth by the
//! view's planes, where a ray's opacity passes one half. Cost: rays × samples in bricks that show something.

use crate::Result;
use crate::clip::clips::ClipSet;
use crate::draw::band::Band;
use crate::draw::eyes::FrameBuffer;
use crate::draw::filter;
use crate::draw::picture::{HALF_COLOUR, Picture};
use crate::field::Field;
use crate::field::transfer::TransferBuffer;
use crate::host::row_of_groups;
use cao_gpu::{Buffer, Format, Gpu, Image, Pipeline, Recorder, Sampler, SamplerDesc};
use cao_kernels::raycast as kernel;
use std::ops::Range;
use std::sync::OnceLock;

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
    gpu: Gpu,
    pipeline: Pipeline,
    /// Into half floats; built when such a picture first comes.
    half: OnceLock<Pipeline>,
    by_hand: u32,
    edge: Sampler,
}

impl Raycast {
    /// Builds the pipeline for a volume. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu, field: &Field) -> Result<Self> {
        let coarse = field.volume.desc().format == Format::R8Unorm && !filter::keeps_fractions(gpu)?;
        Ok(Self {
            gpu: gpu.clone(),
            half: OnceLock::new(),
            by_hand: u32::from(coarse),
            pipeline: gpu.compute(&kernel::SHADER, "main")?,
            edge: gpu.sampler("edge", SamplerDesc { linear: true, border_zero: false })?,
        })
    }

    /// Builds what draws into half floats, when it is first asked for.
    fn half(&self) -> Result<&Pipeline> {
        if let Some(pipeline) = self.half.get() {
            return Ok(pipeline);
        }
        let pipeline = self.gpu.compute(&kernel::SHADER, "half_floats")?;
        Ok(self.half.get_or_init(|| pipeline))
    }

    /// Writes the pixels of these tiles of a band, whose first row is the picture's; the frame has as many views. No bit of a pixel
    /// depends on the band. With `ended` the picture's depth holds how far each pixel's rays go, as [`SceneDepth`] writes it.
    ///
    /// [`SceneDepth`]: crate::draw::scene_depth::SceneDepth
    pub fn record(
        &self,
        rec: &mut Recorder,
        bindings: Bindings,
        picture: &Picture,
        band: Band,
        tiles: Range<u32>,
        ended: bool,
    ) -> Result<()> {
        let b = bindings;
        let params = kernel::RaycastParams {
            size: band.size,
            by_hand: self.by_hand,
            first_row: band.first,
            rows: band.rows,
            first_tile: tiles.start,
            tiles: tiles.len() as u32,
            ended: u32::from(ended),
        };
        let [x, y, _] = row_of_groups(tiles.len() as u32);
        let groups = [x, y, picture.views() as u32];
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
        let push = bytemuck::bytes_of(&params);
        if picture.colour.desc().format != HALF_COLOUR {
            return Ok(rec.dispatch(&self.pipeline, &binds, push, groups)?);
        }
        let kernel::MainBindings { colours: half_colours, .. } = binds;
        let binds = kernel::HalfFloatsBindings {
            volume: binds.volume,
            transfer: binds.transfer,
            bounds: binds.bounds,
            ambient: binds.ambient,
            edge: binds.edge,
            frame: binds.frame,
            distances: binds.distances,
            clips: binds.clips,
            layers: binds.layers,
            depths: binds.depths,
            half_colours,
        };
        Ok(rec.dispatch(self.half()?, &binds, push, groups)?)
    }
}
