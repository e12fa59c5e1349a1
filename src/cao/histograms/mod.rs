//! The method `histograms`: clustered local histograms.

pub mod clustered;
pub mod clusters;
pub mod expand;
pub mod histogram;
