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
use crate::field::features::FeatureSet;
use crate::field::transfer::TransferBuffer;
use crate::host::row_of_groups;
use cao_gpu::{Buffer, Format, Gpu, Image, Pipeline, Recorder, Sampler, SamplerDesc};
use cao_kernels::raycast as kernel;
use std::ops::Range;
use std::sync::OnceLock;

/// What the kernel reads.
#[derive(Clone, Copy)]
pub struct Bindings<'a> {
    /// The volume; with features that of opacities after them.
    pub field: &'a Field,
    /// Its transfer function.
    pub transfer: &'a TransferBuffer,
    /// Values, for colours.
    pub values: &'a Image,
    /// Features.
    pub features: &'a FeatureSet,
    /// V_AO.
    pub ambient: &'a Image,
    /// Whether it is of coloured light.
    pub coloured: bool,
    /// How far rays may leap.
    pub distances: &'a Buffer,
    /// Beyond which nothing is to be seen.
    pub bounds: &'a Buffer,
    /// The clips.
    pub clips: &'a ClipSet,
    /// The frame.
    pub frame: &'a FrameBuffer,
}

/// The pipelines of one kind of pixels, built when such a picture first comes.
#[derive(Default)]
struct Pipelines {
    floats: OnceLock<Pipeline>,
    halves: OnceLock<Pipeline>,
}

/// The kernel `raycast`.
pub struct Raycast {
    gpu: Gpu,
    plain: Pipelines,
    featured: Pipelines,
    coloured: Pipelines,
    featured_coloured: Pipelines,
    /// Of 8-bit texels.
    coarse: bool,
    edge: Sampler,
}

/// The bindings of an entry point, which are the same but for the image of colours.
macro_rules! bindings {
    ($of:ident, $b:expr, $edge:expr, $picture:expr, $colours:ident) => {
        kernel::$of {
            volume: &$b.field.volume,
            transfer: &$b.transfer.buffer,
            ambient: $b.ambient,
            edge: $edge,
            frame: &$b.frame.buffer,
            distances: $b.distances,
            bounds: $b.bounds,
            clips: &$b.clips.clips,
            layers: &$b.clips.layers,
            values: $b.values,
            feature_index: &$b.features.index,
            features: &$b.features.table,
            $colours: &$picture.colour,
            depths: &$picture.depth,
        }
    };
}

impl Raycast {
    /// Builds the pipeline for a volume without features. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu, field: &Field) -> Result<Self> {
        let coarse = field.volume.desc().format == Format::R8Unorm && !filter::keeps_fractions(gpu)?;
        let raycast = Self {
            gpu: gpu.clone(),
            plain: Pipelines::default(),
            featured: Pipelines::default(),
            coloured: Pipelines::default(),
            featured_coloured: Pipelines::default(),
            coarse,
            edge: gpu.sampler("edge", SamplerDesc { linear: true, border_zero: false })?,
        };
        raycast.built(&raycast.plain.floats, "main")?;
        Ok(raycast)
    }

    /// Builds what is not there yet.
    fn built<'a>(&self, pipeline: &'a OnceLock<Pipeline>, entry: &str) -> Result<&'a Pipeline> {
        if let Some(pipeline) = pipeline.get() {
            return Ok(pipeline);
        }
        let built = self.gpu.compute(&kernel::SHADER, entry)?;
        Ok(pipeline.get_or_init(|| built))
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
        let (b, edge) = (bindings, &self.edge);
        let featured = !b.features.features.is_empty();
        let params = kernel::RaycastParams {
            size: band.size,
            by_hand: u32::from(self.coarse && !featured),
            first_row: band.first,
            rows: band.rows,
            first_tile: tiles.start,
            tiles: tiles.len() as u32,
            ended: u32::from(ended),
            channels: u32::from(b.ambient.desc().format == Format::Rgba16Unorm && !b.coloured),
            pad: Default::default(),
        };
        let [x, y, _] = row_of_groups(tiles.len() as u32);
        let groups = [x, y, picture.views() as u32];
        let push = bytemuck::bytes_of(&params);
        let halves = picture.colour.desc().format == HALF_COLOUR;
        let (of, [floats, half_floats]) = match (featured, b.coloured) {
            (false, false) => (&self.plain, ["main", "half_floats"]),
            (true, false) => (&self.featured, ["featured", "featured_half_floats"]),
            (false, true) => (&self.coloured, ["coloured", "coloured_half_floats"]),
            (true, true) => (&self.featured_coloured, ["featured_coloured", "featured_coloured_half_floats"]),
        };
        // What entry points bind is the same but for the image of colours.
        if halves {
            let binds = bindings!(HalfFloatsBindings, b, edge, picture, half_colours);
            rec.dispatch(self.built(&of.halves, half_floats)?, &binds, push, groups)?;
        } else {
            let binds = bindings!(MainBindings, b, edge, picture, colours);
            rec.dispatch(self.built(&of.floats, floats)?, &binds, push, groups)?;
        }
        Ok(())
    }
}
