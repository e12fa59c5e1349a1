//! Deep volumetric ambient occlusion: a network that was trained to give V_AO (docs/dvao.md).

pub mod conv3;
pub mod moments;
pub mod net;
pub mod output;
pub mod plan;
pub mod predicted;
pub mod resize;
