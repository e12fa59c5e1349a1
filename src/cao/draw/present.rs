//! A picture into a host's images: whatever colour and depth formats they have.
//!
//! In: a [`Picture`], or its upper left. Out: a rectangle a view of colour and, where asked, of depth, each in a pass of its own. Cost: a
//! read and a write a pixel; five reads where it is enlarged, colours interpolated and depths taken from the nearest pixel.

use crate::Result;
use crate::draw::picture::Picture;
use crate::draw::target::{Coding, Over, Place, Targets};
use cao_gpu::{Access, Attachments, Blend, Format, Gpu, GraphicsDesc, Pipeline, Recorder};
use cao_kernels::present as kernel;
use cao_model::view::View;
use std::sync::{Arc, Mutex, PoisonError};

/// The kernel `present`.
pub struct Present {
    gpu: Gpu,
    /// By what they draw to.
    pipelines: Mutex<Vec<(Kind, Arc<Pipeline>)>>,
}

/// What a pipeline is made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Colour(Format, Over),
    Depth(Format),
}

impl Present {
    /// Builds the pipelines that replace colours of this format, and depths of `D32Float`.
    pub fn new(gpu: &Gpu, colour: Format) -> Result<Self> {
        let present = Self { gpu: gpu.clone(), pipelines: Mutex::default() };
        present.pipeline(Kind::Colour(colour, Over::Nothing))?;
        present.pipeline(Kind::Depth(Format::D32Float))?;
        Ok(present)
    }

    /// The pipeline for this, built when it is first asked for.
    fn pipeline(&self, kind: Kind) -> Result<Arc<Pipeline>> {
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, pipeline)) = pipelines.iter().find(|(of, _)| *of == kind) {
            return Ok(pipeline.clone());
        }
        let colours = match kind {
            Kind::Colour(format, _) => vec![format],
            Kind::Depth(_) => Vec::new(),
        };
        let desc = GraphicsDesc { vertex: "vertex", colours: &colours, ..GraphicsDesc::default() };
        let desc = match kind {
            Kind::Colour(_, Over::Nothing) => GraphicsDesc { fragment: "colour", ..desc },
            Kind::Colour(_, Over::Scene) => {
                GraphicsDesc { fragment: "colour", blend: Blend::Premultiplied, ..desc }
            }
            Kind::Depth(format) => {
                GraphicsDesc { fragment: "depth", depth: Some(format), depth_write: true, ..desc }
            }
        };
        let pipeline = Arc::new(self.gpu.graphics(&kernel::SHADER, &desc)?);
        pipelines.push((kind, pipeline.clone()));
        Ok(pipeline)
    }

    /// Draws each view of a picture, of which the upper left was drawn to, `drawn` pixels, into its target.
    ///
    /// # Errors
    /// Targets that have no room, or that nothing can be drawn to.
    pub fn record(
        &self,
        rec: &mut Recorder,
        picture: &Picture,
        drawn: [u32; 2],
        views: &[View],
        targets: &Targets,
    ) -> Result<()> {
        for (i, (view, target)) in views.iter().zip(targets.views).enumerate() {
            let params = |place: Place| kernel::PresentParams {
                first: place.at,
                size: targets.size,
                drawn,
                view: i as u32,
                coded: u32::from(targets.coding == Coding::Srgb),
                nothing: view.depth_of_nothing(),
                over: u32::from(targets.over == Over::Scene),
            };
            let onto = |place: Place| Attachments {
                colours: &[],
                depth: None,
                layer: Some(place.layer),
                at: place.at,
                size: targets.size,
            };
            if i > 0 {
                // Views may share a layer.
                rec.barrier(&[Access::AttachmentWrite], &[Access::AttachmentWrite]);
            }
            let place = target.colour;
            let pipeline = self.pipeline(Kind::Colour(place.image.desc().format, targets.over))?;
            let (binds, push) = (kernel::VertexColourBindings { colours: &picture.colour }, params(place));
            let attachments = Attachments { colours: &[(place.image, None)], ..onto(place) };
            rec.draw(&pipeline, &binds, bytemuck::bytes_of(&push), attachments, kernel::CORNERS)?;
            if let Some(place) = target.depth {
                let pipeline = self.pipeline(Kind::Depth(place.image.desc().format))?;
                let (binds, push) = (kernel::VertexDepthBindings { depths: &picture.depth }, params(place));
                let attachments = Attachments { depth: Some((place.image, None)), ..onto(place) };
                rec.draw(&pipeline, &binds, bytemuck::bytes_of(&push), attachments, kernel::CORNERS)?;
            }
        }
        Ok(())
    }
}
