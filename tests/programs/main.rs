//! The real programs, in folders of their own.

mod bundle;
mod chart;
mod cli;
mod cli_refusals;
mod dicom;
mod peers;
mod stereo_bench;
mod support;
