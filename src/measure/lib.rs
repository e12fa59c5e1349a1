//! Numbers in, numbers out: whether the claims hold, how far results are from the truth, which settings a budget affords, and
//! where methods stop holding.

#![forbid(unsafe_code)]

pub mod chart;
pub mod contender;
pub mod error;
pub mod exactness;
pub mod examples;
pub mod failure;
pub mod flip;
pub mod kernels;
pub mod planner;
pub mod plot;
pub mod random;
pub mod reference;
pub mod shown;
pub mod split;
pub mod ssim;
pub mod stability;

pub use failure::{Error, Result};
