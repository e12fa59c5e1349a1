//! The kernel `conv3` layer by layer in small nets: against the twin with what the device gave it, and against PyTorch.

use cao::drive::Take;
use cao::network::net::{Kernels, Scratch, Weights, Window};
use cao::network::plan::{CHANNELS, Plan, Step};
use cao_gpu::{Access, Gpu};
use cao_model::network::{Layer, half};
use cao_testing::*;
use cao_twin::network::conv3::conv3;
use cao_twin::network::moments::{Moments, moments};
use cao_twin::network::{Tensor, mish, sigmoid};

/// Normalised inputs, sums of weights where what goes in is doubled, and Mish of the outputs are rounded to f16: 2^-11 of a value each, some
/// hundred of which are summed with both signs. In shares of the layer's largest output.
const OF_A_LAYER: f32 = 1.5e-3;
/// What that makes of a whole net: the bar.
const OF_A_NET: f32 = 2e-3;

/// What a net makes of a grid, one step after the other.
struct Run<'a> {
    gpu: &'a Gpu,
    net: Scratch,
    kernels: Kernels,
    weights: Weights,
}

impl<'a> Run<'a> {
    fn new(gpu: &'a Gpu, reference: &Reference) -> Self {
        let dims = reference.dims.map(|d| d as u32);
        let plan = Plan::new(reference.network.shape(), dims);
        let net = Scratch::new(gpu, plan, dims).unwrap();
        let grid = buffer(gpu, "test grid", bytemuck::cast_slice(&reference.input));
        run(gpu, |rec| {
            rec.copy_buffer(&grid, 0, &net.grid, 0, grid.bytes()).unwrap();
            rec.barrier(&[Access::TransferWrite], &[Access::StorageRead]);
        });
        let weights = Weights::new(gpu, &reference.network).unwrap();
        Self { gpu, net, kernels: Kernels::new(gpu).unwrap(), weights }
    }

    fn step(&self, step: &Step) {
        let whole = Window { before: [0; 3], at: [0; 3], low: [0; 3], high: self.net.given };
        for part in self.net.step(&self.kernels, &self.weights, step, &whole) {
            run(self.gpu, |rec| part.record(rec, &Take::All).unwrap());
        }
    }

    /// A tensor with so many channels.
    fn tensor(&self, tensor: usize, channels: u32) -> Tensor {
        let words: Vec<u16> = bytemuck::pod_collect_to_vec(&read_buffer(self.gpu, self.net.tensor(tensor)));
        let dims = self.net.plan.dims(self.net.plan.tensors[tensor].level).map(|d| d as usize);
        let voxels: usize = dims.iter().product();
        let lanes = CHANNELS as usize;
        let of = |c: usize| {
            let words = &words;
            (0..voxels).map(move |v| half(words[(c / lanes * voxels + v) * lanes + c % lanes]))
        };
        // What is beyond the channels is 0.
        let blocks = self.net.plan.tensors[tensor].blocks;
        assert!((channels as usize..(blocks * CHANNELS) as usize).flat_map(of).all(|v| v == 0.0));
        Tensor { dims, values: (0..channels as usize).flat_map(of).collect() }
    }
}

fn close_to(what: &str, found: &[f32], expected: &[f32], share: f32) {
    assert_eq!(found.len(), expected.len());
    let largest = expected.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
    let worst = found.iter().zip(expected).map(|(f, e)| (f - e).abs()).fold(0.0, f32::max);
    assert!(worst <= share * largest.max(1e-3), "{what}: {worst} of {largest}");
}

fn weights_of(bits: &[u16]) -> Vec<f32> {
    bits.iter().map(|bits| half(*bits)).collect()
}

/// What the twin makes of the tensors that went into a layer.
fn twins(layer: &Layer, bits: &[u16], inputs: &[Tensor], doubled: bool) -> Vec<f32> {
    let norms: Vec<Moments> = inputs
        .iter()
        .flat_map(|input| {
            let of = moments(input);
            if layer.normalised { of } else { vec![Moments::NONE; of.len()] }
        })
        .collect();
    conv3(&inputs.iter().collect::<Vec<_>>(), &norms, doubled, &weights_of(bits)).values
}

#[test]
fn every_layer_is_the_twins_and_pytorchs() {
    let gpu = open();
    for reference in network_references() {
        let run = Run::new(&gpu, &reference);
        let layers: Vec<_> = reference.network.layers().collect();
        for step in run.net.plan.steps.clone() {
            // What goes in may be overwritten.
            let inputs: Vec<Tensor> = match step {
                Step::Conv { layer, of, beside, .. } => {
                    let each = layers[layer].0.inputs / if beside.is_some() { 2 } else { 1 };
                    [Some(of), beside].into_iter().flatten().map(|t| run.tensor(t, each)).collect()
                }
                Step::Last { layer, of, beside } => {
                    [of, beside].map(|t| run.tensor(t, layers[layer].0.inputs / 2)).into()
                }
                _ => Vec::new(),
            };
            run.step(&step);
            let (number, to, doubled) = match step {
                Step::First { to } => (0, Some(to), false),
                Step::Conv { layer, to, doubled, .. } => (layer, Some(to), doubled),
                Step::Last { layer, .. } => (layer, None, false),
                Step::Halve { .. } | Step::Moments { .. } => continue,
            };
            let (layer, bits) = &layers[number];
            let what = format!("{}: {}", reference.name, layer.name);
            let (found, then): (_, fn(f32) -> f32) = match to {
                Some(to) => (run.tensor(to, layer.outputs).values, mish),
                None => (bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &run.net.values)), sigmoid),
            };
            let after = |values: &[f32]| values.iter().map(|v| then(*v)).collect::<Vec<_>>();
            let (name, torch) = &reference.layers[number];
            assert_eq!(name, &layer.name);
            close_to(&format!("{what}, PyTorch"), &found, &after(torch), OF_A_NET);
            let twin = if number == 0 {
                let grid = Tensor { dims: reference.dims, values: reference.input.clone() };
                twins(layer, bits, &[grid], false)
            } else {
                twins(layer, bits, &inputs, doubled)
            };
            close_to(&format!("{what}, twin"), &found, &after(&twin), OF_A_LAYER);
        }
        let values: Vec<f32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &run.net.values));
        let worst = values.iter().zip(&reference.output).map(|(f, e)| (f - e).abs()).fold(0.0, f32::max);
        assert!(worst <= OF_A_NET, "{}: {worst}", reference.name);
    }
    close(gpu);
}
