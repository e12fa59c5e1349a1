//! Instruments: is it exact, do both eyes see the same, what would other settings give.

pub mod compare;
pub mod consistency;
pub mod exact;
pub mod probe;

pub use consistency::seen_by_both;
pub use exact::verify;
pub use probe::probe;
