//! What a network does to a grid, in order: its steps, the tensors between them, and the buffers that tensors share in turn. Host only, no device.
//!
//! A tensor takes 2 bytes a voxel and channel, channels in blocks of 8. It holds its buffer from the step that makes it to the last that reads it;
//! a buffer goes to the next tensor that fits best.

use cao_model::network::Shape;

/// Of the grid halved `level` times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tensor {
    /// Halvings.
    pub level: u32,
    /// Blocks of channels.
    pub blocks: u32,
    /// Which buffer it is in.
    pub buffer: usize,
    /// Where its first block's mean and deviation are.
    pub norm: u32,
}

/// A step; tensors by their numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The first convolution, of the grid.
    First {
        /// What it makes.
        to: usize,
    },
    /// Every second voxel.
    Halve {
        /// Of this.
        of: usize,
        /// What it makes.
        to: usize,
    },
    /// Mean and deviation of every channel.
    Moments {
        /// Of this.
        of: usize,
    },
    /// A convolution.
    Conv {
        /// Its number in the list of layers.
        layer: usize,
        /// Of this,
        of: usize,
        /// and of this beside it.
        beside: Option<usize>,
        /// Whether to a grid twice as fine.
        doubled: bool,
        /// Whether what goes in is normalised.
        normalised: bool,
        /// What it makes.
        to: usize,
    },
    /// The last one, to the grid.
    Last {
        /// Its number.
        layer: usize,
        /// Of this,
        of: usize,
        /// and of this beside it.
        beside: usize,
    },
}

/// What a network does to a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Voxels of the grid.
    pub dims: [u32; 3],
    /// The tensors.
    pub tensors: Vec<Tensor>,
    /// The steps, in order.
    pub steps: Vec<Step>,
    /// Sizes of the buffers, in voxels of a block: 16 bytes each.
    pub buffers: Vec<u64>,
    /// Entries of means and deviations; the first [`Self::plain`] are those of what is not normalised.
    pub norms: u32,
    /// Blocks of the tensor with the most.
    pub plain: u32,
}

/// Channels of a block.
pub const CHANNELS: u32 = cao_kernels::shared::tensors::CHANNELS;

impl Plan {
    /// For a grid whose edges are multiples of 2^levels.
    pub fn new(shape: &Shape, dims: [u32; 3]) -> Self {
        let blocks = |channels: u32| channels.div_ceil(CHANNELS);
        let mut made = Maker { tensors: Vec::new(), steps: Vec::new() };
        let layers = shape.layers();
        let mut x = made.tensor(0, blocks(layers[0].outputs));
        made.steps.push(Step::First { to: x });
        let (mut skips, mut layer) = (vec![x], 1);
        for level in 1..=shape.levels {
            let halved = made.tensor(level, made.tensors[x].blocks);
            made.steps.push(Step::Halve { of: x, to: halved });
            x = halved;
            for _ in 0..2 {
                let normalised = layers[layer].normalised;
                x = made.conv(layer, x, None, false, normalised, level, blocks(layers[layer].outputs));
                layer += 1;
            }
            skips.push(x);
        }
        x = made.conv(
            layer,
            x,
            None,
            false,
            layers[layer].normalised,
            shape.levels,
            blocks(layers[layer].outputs),
        );
        layer += 1;
        for level in (0..shape.levels).rev() {
            let skip = skips.pop();
            x = made.conv(layer, x, skip, true, true, level, blocks(layers[layer].outputs));
            x = made.conv(layer + 1, x, None, false, true, level, blocks(layers[layer + 1].outputs));
            layer += 2;
        }
        let beside = skips[0];
        for of in [x, beside] {
            made.normalise(of);
        }
        made.steps.push(Step::Last { layer, of: x, beside });
        made.placed(dims)
    }

    /// Voxels of a level.
    pub fn dims(&self, level: u32) -> [u32; 3] {
        self.dims.map(|d| d >> level)
    }

    /// Voxels of a block of a tensor.
    pub fn voxels(&self, tensor: usize) -> u32 {
        self.dims(self.tensors[tensor].level).iter().product()
    }
}

struct Maker {
    tensors: Vec<Tensor>,
    steps: Vec<Step>,
}

impl Maker {
    fn tensor(&mut self, level: u32, blocks: u32) -> usize {
        self.tensors.push(Tensor { level, blocks, buffer: 0, norm: 0 });
        self.tensors.len() - 1
    }

    fn normalise(&mut self, of: usize) {
        if !self.steps.contains(&Step::Moments { of }) {
            self.steps.push(Step::Moments { of });
        }
    }

    #[expect(clippy::too_many_arguments, reason = "a convolution's own, each named once")]
    fn conv(
        &mut self,
        layer: usize,
        of: usize,
        beside: Option<usize>,
        doubled: bool,
        normalised: bool,
        level: u32,
        blocks: u32,
    ) -> usize {
        if normalised {
            [Some(of), beside].into_iter().flatten().for_each(|tensor| self.normalise(tensor));
        }
        let to = self.tensor(level, blocks);
        self.steps.push(Step::Conv { layer, of, beside, doubled, normalised, to });
        to
    }

    /// Gives each tensor a buffer, and each that is normalised a place for its moments.
    fn placed(mut self, dims: [u32; 3]) -> Plan {
        let plain = self.tensors.iter().map(|tensor| tensor.blocks).max().unwrap_or(0);
        let mut norms = plain;
        for step in &self.steps {
            if let Step::Moments { of } = *step {
                self.tensors[of].norm = norms;
                norms += self.tensors[of].blocks;
            }
        }
        let last_use =
            |tensor: usize| self.steps.iter().rposition(|step| reads(step).contains(&Some(tensor)));
        let ends: Vec<_> = (0..self.tensors.len()).map(last_use).collect();
        let size = |tensor: &Tensor| {
            let voxels: u64 = dims.iter().map(|d| u64::from(d >> tensor.level)).product();
            voxels * u64::from(tensor.blocks)
        };
        let (mut buffers, mut free): (Vec<u64>, Vec<usize>) = (Vec::new(), Vec::new());
        for (i, step) in self.steps.iter().enumerate() {
            if let Some(to) = makes(step) {
                let need = size(&self.tensors[to]);
                let fits = free.iter().copied().filter(|b| buffers[*b] >= need).min_by_key(|b| buffers[*b]);
                let buffer = fits.or_else(|| free.iter().copied().max_by_key(|b| buffers[*b]));
                let buffer = buffer.unwrap_or_else(|| {
                    buffers.push(0);
                    buffers.len() - 1
                });
                free.retain(|b| *b != buffer);
                buffers[buffer] = buffers[buffer].max(need);
                self.tensors[to].buffer = buffer;
            }
            let ended = reads(step).into_iter().flatten().filter(|tensor| ends[*tensor] == Some(i));
            free.extend(ended.map(|tensor| self.tensors[tensor].buffer));
        }
        Plan { dims, tensors: self.tensors, steps: self.steps, buffers, norms, plain }
    }
}

/// What a step reads.
fn reads(step: &Step) -> [Option<usize>; 2] {
    match *step {
        Step::First { .. } => [None; 2],
        Step::Halve { of, .. } | Step::Moments { of } => [Some(of), None],
        Step::Conv { of, beside, .. } => [Some(of), beside],
        Step::Last { of, beside, .. } => [Some(of), Some(beside)],
    }
}

/// What a step makes.
fn makes(step: &Step) -> Option<usize> {
    match *step {
        Step::First { to } | Step::Halve { to, .. } | Step::Conv { to, .. } => Some(to),
        Step::Moments { .. } | Step::Last { .. } => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::network::Label;

    const SMALL: Shape = Shape { edge: 64, filters: 8, cap: 64, levels: 5, label: Label::Mean };

    #[test]
    fn no_tensor_is_made_where_another_is_still_read() {
        for shape in [SMALL, Shape::PUBLISHED] {
            let plan = Plan::new(&shape, [128; 3]);
            let convolutions = plan.steps.iter().filter(|s| matches!(s, Step::Conv { .. })).count();
            assert_eq!(convolutions + 2, shape.layers().len());
            let mut holds = vec![None; plan.buffers.len()];
            for step in &plan.steps {
                for read in reads(step).into_iter().flatten() {
                    assert_eq!(holds[plan.tensors[read].buffer], Some(read), "{step:?}");
                }
                if let Some(to) = makes(step) {
                    assert!(
                        reads(step)
                            .into_iter()
                            .flatten()
                            .all(|t| plan.tensors[t].buffer != plan.tensors[to].buffer)
                    );
                    holds[plan.tensors[to].buffer] = Some(to);
                    let size = u64::from(plan.voxels(to)) * u64::from(plan.tensors[to].blocks);
                    assert!(size <= plan.buffers[plan.tensors[to].buffer]);
                }
            }
        }
    }

    #[test]
    fn the_published_net_takes_less_than_half_a_gigabyte_of_tensors() {
        let bytes = |shape: &Shape| 16 * Plan::new(shape, [128; 3]).buffers.iter().sum::<u64>();
        assert!(bytes(&Shape::PUBLISHED) < 400 << 20, "{}", bytes(&Shape::PUBLISHED));
        assert!(bytes(&SMALL) < 200 << 20, "{}", bytes(&SMALL));
    }

    #[test]
    fn what_is_not_normalised_has_no_moments() {
        let plan = Plan::new(&Shape::PUBLISHED, [128; 3]);
        for step in &plan.steps {
            if let Step::Conv { of, normalised: false, .. } = *step {
                // That of a skip is taken for the decoder.
                assert!(plan.tensors[of].level == 7, "{step:?}");
            }
        }
    }
}
