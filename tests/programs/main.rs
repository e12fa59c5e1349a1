//! The real programs, in folders of their own.

mod bundle;
mod chart;
mod chart_meshes;
mod cli;
mod cli_outputs;
mod cli_refusals;
mod dicom;
mod features;
mod gallery;
mod image_space;
mod meshes;
mod orders;
mod peers;
mod readings;
mod stereo_bench;
mod support;
mod targets;
mod train;
