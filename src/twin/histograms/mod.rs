//! Clustered local histograms.

pub mod clusters;
pub mod expand;
pub mod histogram;
