//! Drawing into images.

use super::{
    Format, Gpu, Image, ImageKind, ImageUse, Pipeline, Recorder,
    access::Access,
    bind::Bindings,
    device::Inner,
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
    /// The layer to draw to. Images of one layer are drawn to as they are.
    pub layer: Option<u32>,
    /// The pixel that is the upper left one of the viewport.
    pub at: [u32; 2],
    /// `[width, height]` of the viewport in pixels; nothing is drawn, cleared or kept outside.
    pub size: [u32; 2],
}

/// Names of the colour attachments, as many as every device of Vulkan 1.3 has.
pub(crate) const COLOURS: [&str; 4] =
    ["colour attachment 0", "colour attachment 1", "colour attachment 2", "colour attachment 3"];

impl Gpu {
    /// Refuses where nothing can be drawn, in the name of what would be.
    ///
    /// # Errors
    /// [`Error::Config`] on a queue family that does no graphics.
    pub fn check_graphics(&self, what: &str) -> Result<()> {
        check_graphics(&self.0, what)
    }
}

fn check_graphics(gpu: &Inner, what: &str) -> Result<()> {
    if gpu.graphics {
        return Ok(());
    }
    Err(Error::Config {
        what: what.into(),
        problem: format!(
            "draws, which queue family {} does not do here; adopt a device with a queue of graphics, or do without clip meshes \
             and present pictures yourself (record_picture)",
            gpu.queue_family
        ),
    })
}

impl Recorder {
    /// Draws `vertices / 3` triangles; the vertex shader makes its vertices from their index.
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
        check_graphics(&self.gpu, &pipeline.0.name)?;
        let binds = binds.list();
        let mut resolved = self.prepare(pipeline, vk::PipelineBindPoint::GRAPHICS, &binds, push)?;
        let Some(targets) = &pipeline.0.targets else { return Ok(()) };
        let refuse = |problem| Error::Config { what: pipeline.0.name.clone(), problem };
        check_formats(targets, &attachments).map_err(refuse)?;
        let mut colours = Vec::new();
        for ((image, clear), via) in attachments.colours.iter().zip(COLOURS) {
            let (view, touch) = attachment(image, via, &attachments).map_err(refuse)?;
            let value = clear_colour(image.desc().format.texel(), clear.unwrap_or_default());
            colours.push(info(image, view, clear.is_some()).clear_value(vk::ClearValue { color: value }));
            resolved.touches.push(touch);
            resolved.keep.push(image.0.clone());
        }
        let mut depth = None;
        if let Some((image, clear)) = attachments.depth {
            let (view, touch) = attachment(image, "depth attachment", &attachments).map_err(refuse)?;
            let value = clear_depth(image, clear.unwrap_or_default())?;
            depth =
                Some(info(image, view, clear.is_some()).clear_value(vk::ClearValue { depth_stencil: value }));
            resolved.touches.push(touch);
            resolved.keep.push(image.0.clone());
        }
        self.order(&pipeline.0.name, &resolved.touches)?;
        let ([x, y], [width, height]) = (attachments.at, attachments.size);
        let offset = vk::Offset2D { x: x as i32, y: y as i32 };
        let area = vk::Rect2D { offset, extent: vk::Extent2D { width, height } };
        let mut rendering =
            vk::RenderingInfo::default().render_area(area).layer_count(1).color_attachments(&colours);
        if let Some(depth) = &depth {
            rendering = rendering.depth_attachment(depth);
        }
        let viewport = vk::Viewport {
            x: x as f32,
            y: y as f32,
            width: width as f32,
            height: height as f32,
            max_depth: 1.0,
            ..Default::default()
        };
        self.set(pipeline, vk::PipelineBindPoint::GRAPHICS, resolved, push);
        self.count(4, 0);
        let device = &self.gpu.device;
        // SAFETY: `cmd` is recording, outside a rendering pass; attachments fit the pipeline and are kept; all state is set.
        unsafe {
            (self.gpu.v13.cmd_begin_rendering)(self.cmd, &rendering);
            device.cmd_set_viewport(self.cmd, 0, &[viewport]);
            device.cmd_set_scissor(self.cmd, 0, &[area]);
            device.cmd_draw(self.cmd, vertices, 1, 0, 0);
            (self.gpu.v13.cmd_end_rendering)(self.cmd);
        }
        Ok(())
    }
}

fn info(image: &Image, view: vk::ImageView, clear: bool) -> vk::RenderingAttachmentInfo<'static> {
    vk::RenderingAttachmentInfo::default()
        .image_view(view)
        .image_layout(image.0.layout)
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
    image: &'a Image,
    via: &'static str,
    attachments: &Attachments<'_>,
) -> Result<(vk::ImageView, Touch<'a>), String> {
    let desc = image.desc();
    let name = image.name();
    if desc.kind != ImageKind::D2 || !desc.usage.contains(ImageUse::ATTACHMENT) {
        return Err(format!("image {name} was not made for use as an attachment"));
    }
    let ([x, y], [width, height]) = (attachments.at, attachments.size);
    let fits = |at: u32, size: u32, of: u32| size > 0 && at.checked_add(size).is_some_and(|end| end <= of);
    if !fits(x, width, desc.dims[0]) || !fits(y, height, desc.dims[1]) {
        return Err(format!(
            "{width}×{height} pixels at {x}, {y} do not fit image {name} of {}×{}",
            desc.dims[0], desc.dims[1]
        ));
    }
    let layer = match attachments.layer {
        _ if desc.layers == 1 => 0,
        Some(layer) if layer < desc.layers => layer,
        layer => return Err(format!("image {name} has {} layers, `layer` is {layer:?}", desc.layers)),
    };
    let range = layer.into()..u64::from(layer) + 1;
    let view = image.0.layers[layer as usize];
    Ok((view, Touch { id: image.0.id, name, via, range, access: Access::AttachmentWrite }))
}
