//! A picture into a host's attachments: whatever colour format they have, and depth `D32Float`.
//!
//! In: a [`Picture`], or its upper left. Out: the layers of two attachments, one a view, in one multiview pass. Cost: a read and a write a
//! pixel; five reads where it is enlarged, colours interpolated and depths taken from the nearest pixel.

use crate::Result;
use crate::draw::eyes::check_count;
use crate::draw::picture::Picture;
use cao_gpu::{Attachments, Cull, DepthTest, Format, Gpu, GraphicsDesc, Image, Pipeline, Recorder};
use cao_kernels::present as kernel;
use cao_model::view::View;
use std::sync::OnceLock;

/// The kernel `present`.
pub struct Present {
    gpu: Gpu,
    colour: Format,
    /// By number of views, less one: a pipeline's view mask is fixed.
    pipelines: [OnceLock<Pipeline>; View::MAX],
}

impl Present {
    /// Builds the pipeline for two views and a colour attachment of this format.
    pub fn new(gpu: &Gpu, colour: Format) -> Result<Self> {
        let present = Self { gpu: gpu.clone(), colour, pipelines: Default::default() };
        present.pipeline(2)?;
        Ok(present)
    }

    /// The pipeline for this many views, built when it is first asked for.
    fn pipeline(&self, views: usize) -> Result<&Pipeline> {
        check_count(views)?;
        let slot = &self.pipelines[views - 1];
        if let Some(pipeline) = slot.get() {
            return Ok(pipeline);
        }
        let pipeline = self.gpu.graphics(
            &kernel::SHADER,
            &GraphicsDesc {
                vertex: "vertex",
                fragment: "fragment",
                colours: &[self.colour],
                depth: Some(Format::D32Float),
                depth_test: DepthTest::Always,
                depth_write: true,
                cull: Cull::None,
                view_mask: (1 << views) - 1,
                ..GraphicsDesc::default()
            },
        )?;
        Ok(slot.get_or_init(|| pipeline))
    }

    /// Draws all views of a picture, of which the upper left was drawn to, `drawn` pixels, over as many pixels as the picture has in the
    /// upper left of as many layers. A number of views other than two builds its pipeline when it first comes.
    ///
    /// # Errors
    /// Attachments of another format, of fewer layers or pixels.
    pub fn record(
        &self,
        rec: &mut Recorder,
        picture: &Picture,
        drawn: [u32; 2],
        colour: &Image,
        depth: &Image,
    ) -> Result<()> {
        let binds = kernel::DrawBindings { colours: &picture.colour, depths: &picture.depth };
        let attachments = Attachments {
            colours: &[(colour, Some([0.0; 4]))],
            depth: Some((depth, Some(1.0))),
            layer: None,
            size: picture.size(),
        };
        let params = kernel::PresentParams { drawn, size: picture.size() };
        let push = bytemuck::bytes_of(&params);
        Ok(rec.draw(self.pipeline(picture.views())?, &binds, push, attachments, kernel::CORNERS)?)
    }
}
