//! Convolutions of 3³ voxels (DVAO §3.2; `cao_twin::network::conv3` has the equations).
//!
//! In: tensors of 2 bytes a voxel and channel, means and deviations of their channels, weights. Out: a tensor, or the grid of the net's values. Cost:
//! 54 floating-point operations for each pair of an input and an output of a voxel, 16 where what goes in is doubled.

use super::plan::CHANNELS;
use cao_gpu::Result;
use cao_gpu::{Buffer, Gpu, Pipeline, Recorder};
use cao_kernels::conv3 as kernel;
use cao_kernels::shared::tile::{TILE_X, TILE_Y, TILE_Z};
use cao_model::network::{Form, Layer, half, half_bits};
use std::ops::Range;

/// The kernel `conv3`.
pub struct Conv3 {
    plain: Pipeline,
    doubled: Pipeline,
    first: Pipeline,
    last: Pipeline,
}

/// A tensor that goes in.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// Where it is.
    pub tensor: &'a Buffer,
    /// Its blocks of channels.
    pub blocks: u32,
    /// Where its first block's mean and deviation are.
    pub norm: u32,
}

/// What the last convolution gives, and to where.
#[derive(Clone, Copy)]
pub struct Given<'a> {
    /// A grid of f32,
    pub values: &'a Buffer,
    /// of so many voxels.
    pub dims: [u32; 3],
    /// Where in it the first voxel would be.
    pub at: [i32; 3],
    /// The voxels that are given begin at this one
    pub low: [u32; 3],
    /// and end before this one.
    pub high: [u32; 3],
}

/// What a convolution goes over.
#[derive(Clone, Copy)]
pub struct Over<'a> {
    /// Voxels of the grid of what goes in.
    pub dims: [u32; 3],
    /// Means and deviations.
    pub norms: &'a Buffer,
    /// As [`packed`] has them.
    pub weights: &'a Buffer,
}

impl Conv3 {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        Ok(Self {
            plain: pipeline("plain")?,
            doubled: pipeline("doubled")?,
            first: pipeline("first")?,
            last: pipeline("last")?,
        })
    }

    /// Some items of the first convolution, of the grid.
    pub fn record_first(
        &self,
        rec: &mut Recorder,
        over: Over,
        grid: &Buffer,
        to: (&Buffer, u32),
        items: Range<u32>,
    ) -> Result<()> {
        let (out, out_blocks) = to;
        let params = params(over.dims, &[], out_blocks, items.start);
        let binds = kernel::FirstBindings { weights: over.weights, out, grid };
        rec.dispatch(&self.first, &binds, bytemuck::bytes_of(&params), [items.len() as u32, 1, 1])
    }

    /// Some items of a convolution of one tensor or of two beside each other, whose voxels are repeated 2³ times where `doubled`.
    pub fn record(
        &self,
        rec: &mut Recorder,
        over: Over,
        inputs: &[Input],
        doubled: bool,
        to: (&Buffer, u32),
        items: Range<u32>,
    ) -> Result<()> {
        let (out, out_blocks) = to;
        let params = params(over.dims, inputs, out_blocks, items.start);
        let binds = kernel::PlainBindings {
            source: inputs[0].tensor,
            beside: inputs[inputs.len() - 1].tensor,
            norms: over.norms,
            weights: over.weights,
            out,
        };
        let pipeline = if doubled { &self.doubled } else { &self.plain };
        rec.dispatch(pipeline, &binds, bytemuck::bytes_of(&params), [items.len() as u32, 1, 1])
    }

    /// Some items of the last convolution.
    pub fn record_last(
        &self,
        rec: &mut Recorder,
        over: Over,
        inputs: [Input; 2],
        to: Given,
        items: Range<u32>,
    ) -> Result<()> {
        let Given { values, dims, at, low, high } = to;
        let params =
            kernel::Conv3Params { given: dims, at, low, high, ..params(over.dims, &inputs, 1, items.start) };
        let binds = kernel::LastBindings {
            source: inputs[0].tensor,
            beside: inputs[1].tensor,
            norms: over.norms,
            weights: over.weights,
            values,
        };
        rec.dispatch(&self.last, &binds, bytemuck::bytes_of(&params), [items.len() as u32, 1, 1])
    }
}

fn params(dims: [u32; 3], inputs: &[Input], out_blocks: u32, base: u32) -> kernel::Conv3Params {
    kernel::Conv3Params {
        dims,
        blocks: inputs.iter().map(|input| input.blocks).sum(),
        first_blocks: inputs.first().map_or(0, |input| input.blocks),
        norm: inputs.first().map_or(0, |input| input.norm),
        norm_beside: inputs.last().map_or(0, |input| input.norm),
        out_blocks,
        base,
        ..bytemuck::Zeroable::zeroed()
    }
}

/// Workgroups of a convolution over a grid of these voxels for so many output blocks.
pub fn items(dims: [u32; 3], out_blocks: u32, doubled: bool) -> u32 {
    let tiles = dims[0].div_ceil(TILE_X) * dims[1].div_ceil(TILE_Y) * dims[2].div_ceil(TILE_Z);
    tiles * out_blocks * if doubled { 8 } else { 1 }
}

/// Floating-point operations of an item with so many input blocks.
pub fn flops(blocks: u32, doubled: bool) -> f64 {
    let taps = if doubled { 8 } else { 27 };
    f64::from(2 * TILE_X * TILE_Y * TILE_Z * taps * CHANNELS) * f64::from(CHANNELS * blocks)
}

/// Weights as the kernel takes them: of each output block and input block, each voxel of the kernel, each input, 8 outputs. Two tensors beside each
/// other have half the inputs each, and begin a block each. Channels beyond the last have weights 0. In f16, two a word: sums of weights are rounded
/// once more, as tensors are.
pub fn packed(layer: &Layer, weights: &[u16]) -> Vec<u16> {
    let (form, tensors) = (layer.form, layer.form.tensors());
    let each = layer.inputs / tensors;
    let (in_blocks, out_blocks) = (each.div_ceil(CHANNELS) * tensors, layer.outputs.div_ceil(CHANNELS));
    let lanes = CHANNELS as usize;
    let size = match form {
        Form::First => out_blocks as usize * 27 * lanes,
        Form::Plain => (in_blocks * out_blocks) as usize * 27 * lanes * lanes,
        Form::Doubled => (in_blocks * out_blocks) as usize * 64 * lanes * lanes,
        Form::Last => in_blocks as usize * 27 * lanes,
    };
    let mut all = vec![0.0_f32; size];
    for (i, bits) in weights.iter().enumerate() {
        let (weight, tap) = (half(*bits), i % 27);
        let (input, output) = ((i / 27) as u32 % layer.inputs, (i / 27) as u32 / layer.inputs);
        let in_block = (input / each * each.div_ceil(CHANNELS) + input % each / CHANNELS) as usize;
        let lane = (input % each % CHANNELS) as usize;
        let pair = (output / CHANNELS * in_blocks) as usize + in_block;
        let out = (output % CHANNELS) as usize;
        match form {
            Form::First => all[((output / CHANNELS) as usize * 27 + tap) * lanes + out] = weight,
            Form::Plain => all[((pair * 27 + tap) * lanes + lane) * lanes + out] = weight,
            Form::Last => all[(in_block * 27 + tap) * lanes + lane] = weight,
            // Each of the 27 meets one of the 2³ coarse voxels around, which one depends on the child.
            Form::Doubled => {
                let at = [tap % 3, tap / 3 % 3, tap / 9];
                for child in 0..8 {
                    // Of the low child tap 0 lies in the coarse voxel before, of the high one taps 0 and 1 in its own.
                    let met =
                        (0..3).map(|axis| usize::from(at[axis] > child >> axis & 1) << axis).sum::<usize>();
                    all[((pair * 64 + child * 8 + met) * lanes + lane) * lanes + out] += weight;
                }
            }
        }
    }
    all.into_iter().map(half_bits).collect()
}
