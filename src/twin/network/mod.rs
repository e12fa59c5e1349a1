//! The network of DVAO (§3.2, Fig. 2, as its authors programmed it; docs/dvao.md) from a grid of opacities to one of ambient factors.
//!
//! Layers, their order and their weights are those of [`cao_model::network`]. A convolution but the first is of
//!
//! ```text
//! (a − mean) / √(variance + 10⁻⁵),  a = Mish(x)        of each channel; a itself where the layer is not normalised
//! ```
//!
//! What follows here is Mish'd at once, as every reader of x begins with it: halving, doubling and laying channels beside each other
//! do not mix values. Values are f32, sums f64; weights the f16 that they are. 64³ of a net with 8 filters takes a second on two processors.

pub mod conv3;
pub mod moments;
pub mod output;
pub mod predicted;
pub mod resize;

use crate::each;
use cao_model::network::{Layer, Network, half};
use conv3::conv3;
use moments::{Moments, moments};
use resize::halve;

/// Channels of values on a grid: one after the other, x fastest in each.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Of each channel its voxels.
    pub values: Vec<f32>,
}

impl Tensor {
    /// Voxels of a channel.
    pub fn voxels(&self) -> usize {
        self.dims.iter().product()
    }

    /// Each channel's values.
    pub fn channels(&self) -> impl ExactSizeIterator<Item = &[f32]> {
        self.values.chunks_exact(self.voxels())
    }

    /// The same grid with other values.
    fn map(&self, f: impl Fn(f32) -> f32 + Sync) -> Self {
        let voxels = self.voxels();
        let planes = each(self.channels().len(), |c| {
            self.values[c * voxels..][..voxels].iter().map(|v| f(*v)).collect::<Vec<_>>()
        });
        Self { dims: self.dims, values: planes.concat() }
    }
}

/// x tanh(ln(1 + eˣ)) (Misra 2019). eˣ has no f32 far above 20, where the logarithm is x to the last place.
pub fn mish(x: f32) -> f32 {
    let x = f64::from(x);
    let softplus = if x > 20.0 { x } else { x.exp().ln_1p() };
    (x * softplus.tanh()) as f32
}

/// 1 / (1 + e⁻ˣ).
pub fn sigmoid(x: f32) -> f32 {
    (1.0 / (1.0 + (-f64::from(x)).exp())) as f32
}

/// What a net makes of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Forward {
    /// What each convolution gives, before Mish, in the order of the layers.
    pub layers: Vec<Tensor>,
    /// 1 where nothing occludes: the sigmoid of the last.
    pub output: Vec<f32>,
}

/// The whole net. The grid's edges are multiples of 2^levels; x is fastest.
pub fn forward(network: &Network, dims: [usize; 3], grid: &[f32]) -> Forward {
    let levels = network.shape().levels;
    assert!(dims.iter().all(|d| *d > 0 && d % (1 << levels) == 0), "{dims:?} halved {levels} times");
    let mut convolve = Convolve { left: network.layers(), before_mish: Vec::new() };
    let mut x = convolve.next(&[&Tensor { dims, values: grid.to_vec() }], false);
    let mut skips = vec![x.clone()];
    for _ in 0..levels {
        x = convolve.next(&[&halve(&x)], false);
        x = convolve.next(&[&x], false);
        skips.push(x.clone());
    }
    x = convolve.next(&[&x], false);
    while skips.len() > 1 {
        x = convolve.next(&[&x, &skips.pop().expect("more than one")], true);
        x = convolve.next(&[&x], false);
    }
    convolve.next(&[&x, &skips[0]], false);
    let layers = convolve.before_mish;
    let output = layers.last().map(|last| last.values.iter().map(|v| sigmoid(*v)).collect());
    Forward { output: output.unwrap_or_default(), layers }
}

/// The layers that are still to run.
struct Convolve<L> {
    left: L,
    before_mish: Vec<Tensor>,
}

impl<'a, L: Iterator<Item = (Layer, &'a [u16])>> Convolve<L> {
    /// The next layer of these inputs beside each other, Mish'd.
    fn next(&mut self, inputs: &[&Tensor], doubled: bool) -> Tensor {
        let (layer, weights) = self.left.next().expect("a net has its layers");
        let weights: Vec<f32> = weights.iter().map(|bits| half(*bits)).collect();
        let moments: Vec<Moments> = match layer.normalised {
            true => inputs.iter().flat_map(|input| moments(input)).collect(),
            false => vec![Moments::NONE; layer.inputs as usize],
        };
        let given = conv3(inputs, &moments, doubled, &weights);
        assert_eq!(given.channels().len(), layer.outputs as usize, "{}", layer.name);
        self.before_mish.push(given);
        self.before_mish.last().map(|given| given.map(mish)).expect("just pushed")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use cao_model::network::{Label, Shape};

    #[test]
    fn mish_and_sigmoid_have_their_known_values() {
        for (x, expected) in [(0.0, 0.0), (1.0, 0.865_098_4), (-1.0, -0.303_401_46), (3.0, 2.986_535)] {
            assert!((mish(x) - expected).abs() < 1e-7, "{x}: {}", mish(x));
        }
        assert_eq!([20.5, 1e4, f32::MAX].map(mish), [20.5, 1e4, f32::MAX]);
        assert_eq!([-1e4, f32::MIN].map(mish), [0.0, 0.0]);
        assert_eq!([0.0, 1e4, -1e4].map(sigmoid), [0.5, 1.0, 0.0]);
        assert!((sigmoid(1.0) - 0.731_058_6).abs() < 1e-7);
    }

    /// Only the middle of each kernel is not 0, so that every convolution multiplies by a number.
    #[test]
    fn a_net_of_one_channel_and_one_level_is_what_it_is_by_hand() {
        let shape = Shape { edge: 2, filters: 1, cap: 1, levels: 1, label: Label::Mean };
        let [zero, one, two, minus] = [0, 0x3c00, 0x4000, 0xbc00];
        // first, encoder.0.0, encoder.0.1, middle, the two of decoder.0.0, decoder.0.1, the two of last: of these only the skip counts.
        let middles = [two, one, one, minus, one, zero, one, zero, one];
        let mut weights = vec![0_u16; shape.weights()];
        assert_eq!(weights.len(), 27 * middles.len());
        for (i, middle) in middles.into_iter().enumerate() {
            weights[27 * i + 13] = middle;
        }
        let network = Network::new(shape, weights.into()).unwrap();
        let mut random = Random(1);
        let grid: Vec<f32> = (0..8).map(|_| random.unit()).collect();
        let found = forward(&network, [2; 3], &grid);
        assert_eq!(found.layers.len(), 7);
        // The grid twice; then its first voxel alone, not normalised, Mish'd again and again.
        let first = grid.iter().map(|x| 2.0 * x).collect::<Vec<_>>();
        assert_eq!(found.layers[0].values, first);
        let e = mish(first[0]);
        assert_eq!((found.layers[1].values[0], found.layers[2].values[0]), (e, mish(e)));
        assert_eq!(found.layers[3].values, [-mish(mish(e))]);
        // One voxel doubled is the same everywhere: normalised it is nothing.
        assert_eq!(found.layers[4].values, [0.0; 8]);
        // The skip, normalised: it is the second of two inputs.
        let skip: Vec<f64> = first.iter().map(|x| f64::from(mish(*x))).collect();
        let mean = skip.iter().sum::<f64>() / 8.0;
        let variance = skip.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / 8.0;
        for (value, s) in found.layers[6].values.iter().zip(&skip) {
            assert!((f64::from(*value) - (s - mean) / (variance + 1e-5).sqrt()).abs() < 1e-6);
        }
        assert_eq!(found.output[3], sigmoid(found.layers[6].values[3]));
    }
}
