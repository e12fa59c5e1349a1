//! Numbers in, numbers out: whether the claims hold, and where methods stop holding.

pub mod exactness;
pub mod random;
pub mod stability;
