//! A network on the device: its weights, the buffers that its tensors share in turn, and what it does to a grid, in pieces none of which takes a
//! software driver a tenth of a second.
//!
//! Memory: 2 bytes a weight, 64 / 27 of that where what goes in is doubled; tensors as [`Plan`] has them; 8 bytes a voxel of
//! the grid.

use super::conv3::{self, Conv3, Given, Input, Over};
use super::moments::{self, Moments, NORM, PARTIAL};
use super::plan::{Plan, Step};
use super::resize::{self, Resize};
use crate::drive::Part;
use crate::host::device_buffer;
use crate::stages;
use cao_gpu::Result;
use cao_gpu::{Access, Buffer, BufferUse, DeviceKind, Gpu, Image, Recorder};
use cao_kernels::shared::bricks::GROUPS_PER_ROW;
use cao_model::network::Network;
use std::ops::Range;

/// Floating-point operations of a piece on a software driver: some 60 ms of two cores.
const SLICE: f64 = 5e8;
/// Operations for which a read and a write of a voxel of a tensor stands.
const TOUCHED: f64 = 200.0;

/// The kernels.
pub struct Kernels {
    conv3: Conv3,
    moments: Moments,
    resize: Resize,
}

impl Kernels {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { conv3: Conv3::new(gpu)?, moments: Moments::new(gpu)?, resize: Resize::new(gpu)? })
    }
}

/// A network's weights on the device, a buffer a layer.
pub struct Weights(Vec<Buffer>);

impl Weights {
    /// Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu, network: &Network) -> Result<Self> {
        let buffer = |(layer, weights): (cao_model::network::Layer, &[u16])| {
            device_buffer(gpu, &layer.name, bytemuck::cast_slice(&conv3::packed(&layer, weights)))
        };
        Ok(Self(network.layers().map(buffer).collect::<Result<_>>()?))
    }
}

/// What a network needs for grids of one size.
pub struct Scratch {
    /// Its steps.
    pub plan: Plan,
    tensors: Vec<Buffer>,
    partials: Buffer,
    norms: Buffer,
    /// What goes in, an f32 a voxel.
    pub grid: Buffer,
    /// What comes out, an f32 a voxel of the volume's whole grid.
    pub values: Buffer,
    /// Voxels of that grid.
    pub given: [u32; 3],
    slice: f64,
}

/// A part of the volume's grid that the network sees at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Where in it the volume begins.
    pub before: [i32; 3],
    /// Where it begins in the volume's grid.
    pub at: [i32; 3],
    /// Its values are taken from this voxel of it
    pub low: [u32; 3],
    /// up to this one.
    pub high: [u32; 3],
}

impl Scratch {
    /// Allocates it, for windows of the plan's grid and a volume's grid of `given` voxels. Uses the device's queue and waits for it.
    pub fn new(gpu: &Gpu, plan: Plan, given: [u32; 3]) -> Result<Self> {
        let device = |name: &str, bytes: u64| gpu.buffer(name, bytes, BufferUse::Device);
        let voxels: u64 = plan.dims.iter().map(|d| u64::from(*d)).product();
        let most =
            |(t, tensor): (usize, &super::plan::Tensor)| moments::parts(plan.voxels(t)) * tensor.blocks;
        let parts = plan.tensors.iter().enumerate().map(most).max().unwrap_or(0);
        let plain = vec![moments::plain(); plan.plain as usize];
        let norms = device("norms", NORM * u64::from(plan.norms))?;
        let identity = device_buffer(gpu, "not normalised", bytemuck::cast_slice(&plain))?;
        let mut rec = gpu.recorder("norms")?;
        rec.barrier(&[], &[Access::TransferRead, Access::TransferWrite]);
        rec.copy_buffer(&identity, 0, &norms, 0, identity.bytes())?;
        rec.submit_and_wait()?;
        Ok(Self {
            tensors: plan.buffers.iter().map(|size| device("tensor", 16 * size)).collect::<Result<_>>()?,
            partials: device("partial moments", PARTIAL * u64::from(parts))?,
            norms,
            grid: device("grid", 4 * voxels)?,
            values: device("values", 4 * given.iter().map(|d| u64::from(*d)).product::<u64>())?,
            given,
            slice: if gpu.info().kind == DeviceKind::Cpu { SLICE } else { f64::INFINITY },
            plan,
        })
    }

    /// Workgroups of a step, and what one of them costs.
    fn items(&self, step: &Step) -> (u32, f64) {
        let tensors = &self.plan.tensors;
        let touched = TOUCHED * f64::from(cao_kernels::resize::TEAM);
        match *step {
            Step::First { to } => {
                (conv3::items(self.plan.dims, tensors[to].blocks, false), conv3::flops(1, false) / 8.0)
            }
            Step::Halve { to, .. } => (resize::items(self.plan.voxels(to) * tensors[to].blocks), touched),
            Step::Moments { of } => {
                let part = f64::from(cao_kernels::moments::PART);
                (moments::parts(self.plan.voxels(of)) * tensors[of].blocks, TOUCHED * part)
            }
            Step::Conv { of, beside, doubled, to, .. } => {
                let blocks = tensors[of].blocks + beside.map_or(0, |t| tensors[t].blocks);
                let dims = self.plan.dims(tensors[of].level);
                (conv3::items(dims, tensors[to].blocks, doubled), conv3::flops(blocks, doubled))
            }
            Step::Last { of, beside, .. } => {
                let blocks = tensors[of].blocks + tensors[beside].blocks;
                (conv3::items(self.plan.dims, 1, false), conv3::flops(blocks, false) / 4.0)
            }
        }
    }

    /// The pieces of so many workgroups of such a cost.
    fn slices(&self, (items, cost): (u32, f64)) -> impl Iterator<Item = Range<u32>> {
        let each = ((self.slice / cost) as u32).clamp(1, GROUPS_PER_ROW);
        (0..items).step_by(each as usize).map(move |first| first..(first + each).min(items))
    }

    /// The grid from V_o, in which the volume lies as this window has it, whose opacities are raised to `exponent`.
    pub fn shrink<'a>(
        &'a self,
        kernels: &'a Kernels,
        opacity: &'a Image,
        window: &'a Window,
        voxel: [f32; 3],
        exponent: f32,
    ) -> impl Iterator<Item = Part<'a>> {
        let dims = self.plan.dims;
        let samples = f64::from(resize::samples(voxel).iter().product::<u32>());
        let cost = TOUCHED * samples * f64::from(cao_kernels::resize::TEAM);
        self.slices((resize::items(dims.iter().product()), cost)).map(move |items| {
            Part::long(stages::GRID, move |rec| {
                rec.barrier(&ALL, &ALL);
                let (resize, before) = (&kernels.resize, window.before);
                Ok(resize.record_shrink(
                    rec,
                    opacity,
                    &self.grid,
                    dims,
                    before,
                    voxel,
                    exponent,
                    items.clone(),
                )?)
            })
        })
    }

    /// A step of the [plan](Self::plan), of which each needs those before.
    pub fn step<'a>(
        &'a self,
        kernels: &'a Kernels,
        weights: &'a Weights,
        step: &'a Step,
        window: &'a Window,
    ) -> impl Iterator<Item = Part<'a>> {
        self.slices(self.items(step)).map(move |items| {
            let record =
                move |rec: &mut Recorder| self.record(rec, kernels, weights, (step, window), items.clone());
            Part::long(stages::NETWORK, move |rec| Ok(record(rec)?))
        })
    }

    /// Where a tensor of the plan is from the step that makes it to the last that reads it.
    pub fn tensor(&self, tensor: usize) -> &Buffer {
        &self.tensors[self.plan.tensors[tensor].buffer]
    }

    fn input(&self, tensor: usize, normalised: bool) -> Input<'_> {
        let of = &self.plan.tensors[tensor];
        Input {
            tensor: &self.tensors[of.buffer],
            blocks: of.blocks,
            norm: if normalised { of.norm } else { 0 },
        }
    }

    fn output(&self, tensor: usize) -> (&Buffer, u32) {
        (self.tensor(tensor), self.plan.tensors[tensor].blocks)
    }

    /// Some workgroups of a step.
    fn record(
        &self,
        rec: &mut Recorder,
        kernels: &Kernels,
        weights: &Weights,
        (step, window): (&Step, &Window),
        items: Range<u32>,
    ) -> Result<()> {
        rec.barrier(&ALL, &ALL);
        let plan = &self.plan;
        let over = |layer: usize, level| Over {
            dims: plan.dims(level),
            norms: &self.norms,
            weights: &weights.0[layer],
        };
        match *step {
            Step::First { to } => {
                kernels.conv3.record_first(rec, over(0, 0), &self.grid, self.output(to), items)
            }
            Step::Halve { of, to } => {
                let (out, blocks) = self.output(to);
                let dims = plan.dims(plan.tensors[to].level);
                kernels.resize.record_halve(rec, [self.output(of).0, out], dims, blocks, items)
            }
            Step::Moments { of } => {
                let (Input { tensor, blocks, norm }, voxels) = (self.input(of, true), plan.voxels(of));
                let both = [&self.partials, &self.norms];
                kernels.moments.record(rec, tensor, voxels, blocks, norm, both, items)
            }
            Step::Conv { layer, of, beside, doubled, normalised, to } => {
                let inputs: Vec<_> =
                    [Some(of), beside].into_iter().flatten().map(|t| self.input(t, normalised)).collect();
                let over = over(layer, plan.tensors[of].level);
                kernels.conv3.record(rec, over, &inputs, doubled, self.output(to), items)
            }
            Step::Last { layer, of, beside } => {
                let inputs = [self.input(of, true), self.input(beside, true)];
                let Window { at, low, high, .. } = *window;
                let to = Given { values: &self.values, dims: self.given, at, low, high };
                kernels.conv3.record_last(rec, over(layer, 0), inputs, to, items)
            }
        }
    }
}

const ALL: [Access; 3] = [Access::StorageRead, Access::StorageWrite, Access::SampledRead];
