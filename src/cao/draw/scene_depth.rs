//! Where a view's rays end at what a host has drawn.
//!
//! In: the host's depth, of any format, by the view's planes. Out: a [`Picture`]'s depth, which holds distances in mm until the
//! ray cast has read and replaced them. Cost: a read and a write a pixel.

use crate::Result;
use crate::draw::picture::Picture;
use crate::draw::target::Place;
use cao_gpu::{Flat, Gpu, Pipeline, Recorder};
use cao_kernels::scene_depth as kernel;
use cao_model::view::View;

/// The kernel `scene_depth`.
pub struct SceneDepth {
    pipeline: Pipeline,
}

impl SceneDepth {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { pipeline: gpu.compute(&kernel::SHADER, "main")? })
    }

    /// Writes the ends of the rays of one view of the picture, of which the upper left, `drawn` pixels, will be drawn; from a rectangle of
    /// `size` pixels.
    ///
    /// # Errors
    /// Images that shaders cannot read.
    pub fn record(
        &self,
        rec: &mut Recorder,
        view: (u32, &View),
        scene: Place,
        size: [u32; 2],
        picture: &Picture,
        drawn: [u32; 2],
    ) -> Result<()> {
        let (index, view) = view;
        let [a, b] = view.depth_terms();
        let params = kernel::SceneDepthParams {
            first: scene.at,
            size,
            drawn,
            view: index,
            a,
            b,
            pad: Default::default(),
        };
        let binds =
            kernel::MainBindings { scene: Flat::Layer(scene.image, scene.layer), ends: &picture.depth };
        Ok(rec.dispatch_over(&self.pipeline, &binds, bytemuck::bytes_of(&params), [drawn[0], drawn[1], 1])?)
    }
}
