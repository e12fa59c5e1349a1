//! Numbers in, numbers out: whether the claims hold, and how far results are from the truth.

pub mod chart;
pub mod contender;
pub mod error;
pub mod exactness;
pub mod flip;
pub mod plot;
pub mod random;
pub mod reference;
pub mod ssim;
