//! Deep volumetric ambient occlusion: a network that was trained to give V_AO (docs/dvao.md).

use cao_model::network::{Network, Shape};
use std::sync::OnceLock;

pub mod conv3;
pub mod moments;
pub mod net;
pub mod output;
pub mod plan;
pub mod predicted;
pub mod resize;

/// The weight file of [`small`]; `cao_formats::network` reads such files.
static SMALL: &[u8] = include_bytes!("small.net");

/// The network that is used unless another is given, trained on grids of 64³ (docs/training.md).
pub fn small() -> Network {
    static READ: OnceLock<Network> = OnceLock::new();
    READ.get_or_init(|| {
        // The file is ours: a test holds that this is what the reader makes of it.
        let head = 16 + u32::from_le_bytes([SMALL[12], SMALL[13], SMALL[14], SMALL[15]]) as usize;
        let weights = SMALL[head..head + 2 * Shape::SMALL.weights()].chunks_exact(2);
        let weights = weights.map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
        Network::new(Shape::SMALL, weights).expect("the network that is shipped is one")
    })
    .clone()
}
