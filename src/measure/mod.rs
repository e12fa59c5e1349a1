//! Numbers in, numbers out: whether the claims hold.

pub mod contender;
pub mod exactness;
pub mod plot;
pub mod random;
