//! The network of deep volumetric ambient occlusion (DVAO §3.2, Fig. 2, as its authors programmed it; docs/dvao.md): its shape, its layers in order,
//! its weights. Everything that runs, reads or trains one takes its shape from here.
//!
//! A net of `levels` L and `filters` n works on a grid whose edges are multiples of 2^L; level l is the grid halved l times. With
//! c(l) = min(n · 2^l, cap), convolutions of 3³ voxels without bias, zeros outside:
//!
//! ```text
//! first          1 → c(0)                                    at level 0, of the grid itself
//! encoder i      halve; c(i) → c(i) → c(i + 1)               at level i + 1,  i = 0 … L - 1
//! middle         c(L) → c(L)                                 at level L
//! decoder i      beside the skip of its level, double;
//!                2 c(L - i) → c(L - i) → c(L - i - 1)        at level L - i - 1
//! last           beside the skip, 2 c(0) → 1, sigmoid        at level 0
//! ```
//!
//! Every convolution but the first is of what Mish and instance normalisation make of its input. Halving takes every second voxel, doubling
//! repeats each: the paper says trilinear, the authors' program nearest. *Skips* are what `first` and each encoder's second convolution give.

use crate::{Error, Result};
use std::sync::{Arc, OnceLock};

/// The shape of a network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Edge of the cubes that it was trained on, in voxels.
    pub edge: u32,
    /// Channels at level 0.
    pub filters: u32,
    /// Most channels of a level.
    pub cap: u32,
    /// Halvings.
    pub levels: u32,
    /// What it was trained to give.
    pub label: Label,
}

/// What a net was trained to give of the rays around a voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Label {
    /// The mean transmittance along them: V_AO. Of opacity per voxel of the grid.
    Mean,
    /// The transmittance at their ends (DVAO eq. (1)). Of opacity per half voxel of the grid.
    End,
}

impl Label {
    /// All.
    pub const ALL: [Self; 2] = [Self::Mean, Self::End];

    /// As weight files have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::End => "end",
        }
    }

    /// Reference length of its opacities, in voxels of the grid.
    pub fn reference(self) -> f32 {
        match self {
            Self::Mean => 1.0,
            Self::End => 0.5,
        }
    }
}

/// What a convolution takes and gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Takes the grid.
    First,
    /// Takes one tensor.
    Plain,
    /// Takes two tensors beside each other, doubled.
    Doubled,
    /// Takes two tensors beside each other and gives the grid.
    Last,
}

impl Form {
    /// Tensors that go in, the grid being one; each has the same number of channels.
    pub fn tensors(self) -> u32 {
        match self {
            Self::First | Self::Plain => 1,
            Self::Doubled | Self::Last => 2,
        }
    }
}

/// A convolution.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// What it takes and gives.
    pub form: Form,
    /// Its name in weight files: `first`, `encoder.2.1`, `middle`, `decoder.0.0`, `last`.
    pub name: String,
    /// The level of what it gives.
    pub level: u32,
    /// Channels that go in.
    pub inputs: u32,
    /// Channels that come out.
    pub outputs: u32,
    /// Whether what goes in is normalised.
    pub normalised: bool,
}

impl Layer {
    /// Weights.
    pub fn weights(&self) -> usize {
        27 * self.inputs as usize * self.outputs as usize
    }
}

/// Most levels and most channels.
const MOST: (u32, u32) = (9, 1024);

impl Shape {
    /// That of the paper, for cubes of 128³: 108,498,960 weights.
    pub const PUBLISHED: Self = Self { edge: 128, filters: 16, cap: 512, levels: 7, label: Label::End };

    /// The one that is used unless another is given: 1,688,904 weights.
    pub const SMALL: Self = Self { edge: 64, filters: 8, cap: 64, levels: 5, label: Label::Mean };

    /// Refuses shapes that there are none of.
    ///
    /// # Errors
    /// [`Error::Config`] naming the number.
    pub fn check(&self) -> Result<()> {
        let within = |what: &str, number: u32, least: u32, most: u32| {
            let problem = || Error::refused(what, format!("is {number}; must be {least} to {most}"));
            (least..=most).contains(&number).then_some(()).ok_or_else(problem)
        };
        within("levels of the network", self.levels, 1, MOST.0)?;
        within("filters of the network", self.filters, 1, MOST.1)?;
        within("cap of the network", self.cap, self.filters, MOST.1)?;
        within("edge of the network", self.edge, 1 << self.levels, 1024)?;
        if !self.edge.is_multiple_of(1 << self.levels) {
            let problem = format!("is {}; must be a multiple of {}", self.edge, 1 << self.levels);
            return Err(Error::refused("edge of the network", problem));
        }
        Ok(())
    }

    /// Channels of a level.
    pub fn channels(&self, level: u32) -> u32 {
        (self.filters << level).min(self.cap)
    }

    /// The length of its rays in voxels of the grid: 10 % of a cube's diagonal (DVAO §3.1).
    pub fn radius(&self) -> f32 {
        0.1 * 3.0_f32.sqrt() * self.edge as f32
    }

    /// The convolutions, in the order in which they run and in which files have their weights.
    pub fn layers(&self) -> Vec<Layer> {
        let (last, c) = (self.levels, |level| self.channels(level));
        // Of a single voxel there is no variance.
        let normalised = |level: u32| self.edge >> level > 1;
        let layer = |form, name: String, level, inputs, outputs, normalised| Layer {
            form,
            name,
            level,
            inputs,
            outputs,
            normalised,
        };
        let mut layers = vec![layer(Form::First, "first".into(), 0, 1, c(0), false)];
        for i in 0..last {
            let level = i + 1;
            let of = |k: u32, outputs| {
                layer(Form::Plain, format!("encoder.{i}.{k}"), level, c(i), outputs, normalised(level))
            };
            layers.extend([of(0, c(i)), of(1, c(level))]);
        }
        layers.push(layer(Form::Plain, "middle".into(), last, c(last), c(last), normalised(last)));
        for i in 0..last {
            let (from, level) = (last - i, last - i - 1);
            layers.push(layer(Form::Doubled, format!("decoder.{i}.0"), level, 2 * c(from), c(from), true));
            layers.push(layer(Form::Plain, format!("decoder.{i}.1"), level, c(from), c(level), true));
        }
        layers.push(layer(Form::Last, "last".into(), 0, 2 * c(0), 1, true));
        layers
    }

    /// All weights.
    pub fn weights(&self) -> usize {
        self.layers().iter().map(Layer::weights).sum()
    }
}

/// The weight file of [`Network::small`]; `cao_formats::network` reads such files.
static SMALL: &[u8] = include_bytes!("small.net");

/// A network with its weights.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    shape: Shape,
    weights: Arc<[u16]>,
}

impl Network {
    /// Of weights as bits of f16, a layer after the other: of each the inputs of each output, of these the 27 of x, y, z, x fastest.
    ///
    /// # Errors
    /// [`Error::Config`] for a shape that there is none of, another number of weights, and one that is no finite number, naming its layer.
    pub fn new(shape: Shape, weights: Arc<[u16]>) -> Result<Self> {
        shape.check()?;
        let network = Self { shape, weights };
        if network.weights.len() != shape.weights() {
            let problem = format!("has {} weights; its shape has {}", network.weights.len(), shape.weights());
            return Err(Error::refused("network", problem));
        }
        let infinite = |bits: &u16| bits & 0x7c00 == 0x7c00;
        if let Some((layer, _)) = network.layers().find(|(_, weights)| weights.iter().any(infinite)) {
            return Err(Error::refused(&layer.name, "has weights that are no finite numbers"));
        }
        Ok(network)
    }

    /// The one that is used unless another is given, of [`Shape::SMALL`] (docs/training.md).
    pub fn small() -> Self {
        static READ: OnceLock<Network> = OnceLock::new();
        let read = || {
            // The file is ours: a test holds that this is what the reader makes of it.
            let head = 16 + u32::from_le_bytes([SMALL[12], SMALL[13], SMALL[14], SMALL[15]]) as usize;
            let weights = SMALL[head..head + 2 * Shape::SMALL.weights()].chunks_exact(2);
            let weights = weights.map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
            Self::new(Shape::SMALL, weights).expect("the network that is shipped is one")
        };
        READ.get_or_init(read).clone()
    }

    /// Its shape.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Its weights, all layers.
    pub fn weights(&self) -> &[u16] {
        &self.weights
    }

    /// Its layers, each with its weights.
    pub fn layers(&self) -> impl Iterator<Item = (Layer, &[u16])> {
        let mut at = 0;
        self.shape.layers().into_iter().map(move |layer| {
            let from = at;
            at += layer.weights();
            (layer, &self.weights[from..at])
        })
    }
}

/// What 16 bits stand for as f16.
pub fn half(bits: u16) -> f32 {
    let (sign, exponent) = (u32::from(bits & 0x8000) << 16, u32::from(bits >> 10 & 31));
    let fraction = u32::from(bits & 0x3ff);
    match exponent {
        // 2^-24 each.
        0 => f32::from_bits(sign | (fraction as f32 * 2.0_f32.powi(-24)).to_bits()),
        31 => f32::from_bits(sign | 0x7f80_0000 | fraction << 13),
        _ => f32::from_bits(sign | (exponent + 112) << 23 | fraction << 13),
    }
}

/// The bits of the f16 nearest to a finite number, of two the even one; beyond the largest, infinity's.
pub fn half_bits(value: f32) -> u16 {
    let (sign, size) = ((value.to_bits() >> 16 & 0x8000) as u16, value.abs());
    // Below 2^-14 all steps are 2^-24; above, what rounds the fraction to 10 bits is added in its own place. Both round to even.
    let bits = if size < 2.0_f32.powi(-14) {
        (size * 2.0_f32.powi(24)).round_ties_even() as u32
    } else {
        let bits = size.to_bits();
        ((bits + 0xfff + (bits >> 13 & 1)) >> 13) - (112 << 10)
    };
    sign | bits.min(0x7c00) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_and_small_nets_have_the_weights_that_the_specification_counts() {
        let of = |filters, cap, levels| Shape { filters, cap, levels, ..Shape::PUBLISHED };
        assert_eq!(Shape::PUBLISHED.weights(), 108_498_960);
        assert_eq!(of(8, 64, 5).weights(), 1_688_904);
        assert!((of(8, 512, 7).weights() as f64 / 1e6 - 73.1).abs() < 0.05);
        assert!((of(24, 512, 7).weights() as f64 / 1e6 - 123.8).abs() < 0.05);
        assert!((of(4, 32, 5).weights() as f64 / 1e6 - 0.42).abs() < 0.005);
    }

    #[test]
    fn what_is_not_normalised_is_the_grid_and_a_single_voxel() {
        let bare = |shape: Shape| -> Vec<String> {
            shape.layers().into_iter().filter(|layer| !layer.normalised).map(|layer| layer.name).collect()
        };
        assert_eq!(bare(Shape::PUBLISHED), ["first", "encoder.6.0", "encoder.6.1", "middle"]);
        assert_eq!(bare(Shape { levels: 5, ..Shape::PUBLISHED }), ["first"]);
    }

    #[test]
    fn halves_are_what_their_bits_say() {
        let known = [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x0001, 5.960_464_5e-8),
            (0x83ff, -6.097_555e-5),
            (0x7bff, 65504.0),
            (0x3555, 0.333_251_95),
        ];
        for (bits, value) in known {
            assert_eq!(half(bits), value, "{bits:04x}");
        }
        for bits in (0..0x7c00).chain(0x8000..0xfc00) {
            assert_eq!(half_bits(half(bits)), bits);
        }
        // Between two, and half-way.
        assert_eq!(
            (half_bits(1.0 + 0.6 / 1024.0), half_bits(1.0 + 1.5 / 1024.0), half_bits(1.0 + 2.5 / 1024.0)),
            (0x3c01, 0x3c02, 0x3c02)
        );
        assert_eq!((half_bits(1e6), half_bits(3.0e-8), half_bits(2.0_f32.powi(-25))), (0x7c00, 1, 0));
        assert!(half(0x7c00).is_infinite() && half(0x7e00).is_nan() && half(0x8000).is_sign_negative());
    }

    #[test]
    fn what_is_no_network_is_refused_by_what_is_wrong() {
        let shape = Shape { edge: 8, filters: 2, cap: 4, levels: 2, label: Label::Mean };
        let weights = |n: usize| vec![0x3c00_u16; n].into();
        assert!(Network::new(shape, weights(shape.weights())).is_ok());
        let told = |shape: Shape, weights| Network::new(shape, weights).unwrap_err().to_string();
        assert!(told(shape, weights(5)).contains("has 5 weights"));
        for (wrong, what) in [
            (Shape { levels: 0, ..shape }, "levels"),
            (Shape { filters: 0, ..shape }, "filters"),
            (Shape { cap: 1, ..shape }, "cap"),
            (Shape { edge: 10, ..shape }, "multiple of 4"),
        ] {
            assert!(told(wrong, weights(0)).contains(what), "{what}");
        }
        let mut bad = vec![0_u16; shape.weights()];
        let first = shape.layers()[0].weights();
        bad[first] = 0x7e00;
        assert!(told(shape, bad.into()).contains("encoder.0.0"));
    }
}
