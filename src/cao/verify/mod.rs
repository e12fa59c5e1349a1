//! Instruments: is it exact, do both eyes see the same, what would other settings give.

pub mod compare;
pub mod consistency;
pub mod probe;
