//! Drawing into images.

use super::{
    Format, Image, ImageKind, ImageUse, Pipeline, Recorder,
    access::Access,
    bind::Bindings,
    hazard::Touch,
    pipeline::Targets,
    transfer::{clear_colour, clear_depth},
};
use crate::{Error, Result};
use ash::vk;

/// What to draw to. Everything drawn is stored.
#[derive(Clone, Copy)]
pub struct Attachments<'a> {
    /// Colour images, each with the r g b a it is cleared to first, or `None` to keep what it holds.
    pub colours: &'a [(&'a Image, Option<[f32; 4]>)],
    /// Depth image, with the depth 0 ... 1 it is cleared to first, or `None` to keep what it holds.
    pub depth: Option<(&'a Image, Option<f32>)>,
    /// The layer to draw to; `None` for the layers of the pipeline's view mask. Images of one layer are drawn to as they are.
    pub layer: Option<u32>,
    /// `[width, height]` in pixels from the upper left corner; all of it is viewport.
    pub size: [u32; 2],
}

/// Names of the colour attachments, as many as every device of Vulkan 1.3 has.
pub(crate) const COLOURS: [&str; 4] =
    ["colour attachment 0", "colour attachment 1", "colour attachment 2", "colour attachment 3"];

impl Recorder {
    /// Draws `vertices / 3` triangles; the vertex shader makes its vertices from their index.
    ///
    /// Under multiview, cover the picture with a rectangle of two triangles and not with one large triangle: the software driver of Mesa
    /// 22.3 draws every other triangle into the first layer for all views (`tests/gpu/draw.rs` watches for it).
    ///
    /// # Errors
    /// [`Error::Config`] if bindings, immediates or attachments do not fit the pipeline, [`Error::Hazard`] for a missing barrier.
    pub fn draw(
        &mut self,
        pipeline: &Pipeline,
        binds: &(impl Bindings + ?Sized),
        push: &[u8],
        attachments: Attachments<'_>,
        vertices: u32,
    ) -> Result<()> {
        let binds = binds.list();
        let mut resolved = self.prepare(pipeline, vk::PipelineBindPoint::GRAPHICS, &binds, push)?;
        let Some(targets) = &pipeline.0.targets else { return Ok(()) };
        let refuse = |problem| Error::Config { what: pipeline.0.name.clone(), problem };
        check_formats(targets, &attachments).map_err(refuse)?;
        let mut colours = Vec::new();
        for ((image, clear), via) in attachments.colours.iter().zip(COLOURS) {
            let (view, touch) = attachment(targets, image, via, &attachments).map_err(refuse)?;
            let value = clear_colour(image.desc().format.texel(), clear.unwrap_or_default());
            colours.push(info(view, clear.is_some()).clear_value(vk::ClearValue { color: value }));
            resolved.touches.push(touch);
            resolved.keep.push(image.0.clone());
        }
        let mut depth = None;
        if let Some((image, clear)) = attachments.depth {
            let (view, touch) =
                attachment(targets, image, "depth attachment", &attachments).map_err(refuse)?;
            let value = clear_depth(image, clear.unwrap_or_default())?;
            depth = Some(info(view, clear.is_some()).clear_value(vk::ClearValue { depth_stencil: value }));
            resolved.touches.push(touch);
            resolved.keep.push(image.0.clone());
        }
        self.order(&pipeline.0.name, &resolved.touches)?;
        let [width, height] = attachments.size;
        let area = vk::Rect2D { offset: vk::Offset2D::default(), extent: vk::Extent2D { width, height } };
        let mut rendering = vk::RenderingInfo::default()
            .render_area(area)
            .layer_count(1)
            .view_mask(targets.view_mask)
            .color_attachments(&colours);
        if let Some(depth) = &depth {
            rendering = rendering.depth_attachment(depth);
        }
        let viewport =
            vk::Viewport { width: width as f32, height: height as f32, max_depth: 1.0, ..Default::default() };
        self.set(pipeline, vk::PipelineBindPoint::GRAPHICS, resolved, push);
        self.count(4, 0);
        let device = &self.gpu.device;
        // SAFETY: `cmd` is recording, outside a rendering pass; attachments fit the pipeline and are kept; all state is set.
        unsafe {
            device.cmd_begin_rendering(self.cmd, &rendering);
            device.cmd_set_viewport(self.cmd, 0, &[viewport]);
            device.cmd_set_scissor(self.cmd, 0, &[area]);
            device.cmd_draw(self.cmd, vertices, 1, 0, 0);
            device.cmd_end_rendering(self.cmd);
        }
        Ok(())
    }
}

fn info(view: vk::ImageView, clear: bool) -> vk::RenderingAttachmentInfo<'static> {
    vk::RenderingAttachmentInfo::default()
        .image_view(view)
        .image_layout(vk::ImageLayout::GENERAL)
        .load_op(if clear { vk::AttachmentLoadOp::CLEAR } else { vk::AttachmentLoadOp::LOAD })
        .store_op(vk::AttachmentStoreOp::STORE)
}

fn check_formats(targets: &Targets, attachments: &Attachments<'_>) -> Result<(), String> {
    let colours: Vec<Format> = attachments.colours.iter().map(|(image, _)| image.desc().format).collect();
    let depth = attachments.depth.map(|(image, _)| image.desc().format);
    if colours == targets.colours && depth == targets.depth {
        return Ok(());
    }
    Err(format!(
        "draws to colours {:?} and depth {:?}, given are {colours:?} and {depth:?}",
        targets.colours, targets.depth
    ))
}

/// View and touch of one attachment.
fn attachment<'a>(
    targets: &Targets,
    image: &'a Image,
    via: &'static str,
    attachments: &Attachments<'_>,
) -> Result<(vk::ImageView, Touch<'a>), String> {
    let desc = image.desc();
    let name = image.name();
    if desc.kind != ImageKind::D2 || !desc.usage.contains(ImageUse::ATTACHMENT) {
        return Err(format!("image {name} was not made for use as an attachment"));
    }
    let [width, height] = attachments.size;
    if width == 0 || height == 0 || width > desc.dims[0] || height > desc.dims[1] {
        return Err(format!(
            "{width}×{height} pixels do not fit image {name} of {}×{}",
            desc.dims[0], desc.dims[1]
        ));
    }
    let views = u32::BITS - targets.view_mask.leading_zeros();
    let (view, range) = match attachments.layer {
        Some(_) if targets.view_mask != 0 => {
            return Err("draws the layers of its view mask, so `layer` must be None".into());
        }
        None if targets.view_mask != 0 => {
            if views > desc.layers {
                return Err(format!("view mask needs {views} layers, image {name} has {}", desc.layers));
            }
            (image.0.whole, 0..views.into())
        }
        _ if desc.layers == 1 => (image.0.layers[0], 0..1),
        Some(layer) if layer < desc.layers => {
            (image.0.layers[layer as usize], layer.into()..u64::from(layer) + 1)
        }
        layer => return Err(format!("image {name} has {} layers, `layer` is {layer:?}", desc.layers)),
    };
    Ok((view, Touch { id: image.0.id, name, via, range, access: Access::AttachmentWrite }))
}
