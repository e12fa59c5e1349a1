//! Pipelines, built from what reflection says about the shader.

use super::{
    Gpu,
    device::{Inner, vulkan},
    draw::COLOURS,
    feature,
    format::{Format, VulkanFormat},
    shader::{Binding, BindingKind, EntryPoint, Shader, Stage, Texel},
};
use crate::{Error, Result};
use ash::vk;
use std::{
    ffi::CString,
    sync::{Arc, Weak},
};

/// A compute or graphics pipeline.
pub struct Pipeline(pub(crate) Arc<PipelineInner>);

pub(crate) struct PipelineInner {
    pub gpu: Arc<Inner>,
    /// `shader.entry`, for messages and labels.
    pub name: String,
    pub slots: Vec<Slot>,
    pub push_bytes: u32,
    pub stages: vk::ShaderStageFlags,
    /// Compute: invocations of a workgroup.
    pub workgroup: [u32; 3],
    /// Graphics: what it draws to.
    pub targets: Option<Targets>,
    set_layout: vk::DescriptorSetLayout,
    pub layout: vk::PipelineLayout,
    pub raw: vk::Pipeline,
}

/// A binding as this pipeline uses it.
pub(crate) struct Slot {
    pub binding: &'static Binding,
    pub reads: bool,
    pub writes: bool,
}

/// Attachments that a graphics pipeline was made for.
pub(crate) struct Targets {
    pub colours: Vec<Format>,
    pub depth: Option<Format>,
}

/// How to draw. There is no vertex input: vertex shaders fetch from storage buffers. Viewport and scissor are the whole picture.
/// Triangles are counter-clockwise as seen in the picture when they face front.
#[derive(Debug, Clone, Copy)]
pub struct GraphicsDesc<'a> {
    /// Entry point of the vertex shader.
    pub vertex: &'a str,
    /// Entry point of the fragment shader.
    pub fragment: &'a str,
    /// Formats of the colour attachments.
    pub colours: &'a [Format],
    /// Format of the depth attachment.
    pub depth: Option<Format>,
    /// Which fragments pass against the stored depth.
    pub depth_test: DepthTest,
    /// Passing fragments store their depth.
    pub depth_write: bool,
    /// Which faces are dropped.
    pub cull: Cull,
    /// How colours are combined with the stored ones.
    pub blend: Blend,
}

impl Default for GraphicsDesc<'_> {
    /// No attachment yet, no depth test, all faces, no blending.
    fn default() -> Self {
        Self {
            vertex: "",
            fragment: "",
            colours: &[],
            depth: None,
            depth_test: DepthTest::Always,
            depth_write: false,
            cull: Cull::None,
            blend: Blend::None,
        }
    }
}

/// Which fragments pass against the stored depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DepthTest {
    /// All.
    Always,
    /// Nearer ones.
    Less,
    /// Nearer or equal ones.
    LessOrEqual,
    /// Farther ones.
    Greater,
    /// Farther or equal ones.
    GreaterOrEqual,
}

/// Which faces are dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cull {
    /// None.
    None,
    /// Those facing the viewer.
    Front,
    /// Those facing away.
    Back,
}

/// How colours are combined with the stored ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Blend {
    /// Replace.
    None,
    /// `new + (1 - new alpha) * stored`, for colours already multiplied by their alpha.
    Premultiplied,
    /// `new + stored`.
    Add,
}

impl Gpu {
    /// A compute pipeline of one entry point; while one is in use, that one: drivers compile for long, some at first use only.
    ///
    /// # Errors
    /// [`Error::Config`] if the shader has no such compute entry point, [`Error::Limit`] if it needs more than the device has,
    /// [`Error::Vulkan`] if the driver refuses.
    pub fn compute(&self, shader: &'static Shader, entry: &str) -> Result<Pipeline> {
        let point = entry_point(shader, entry, Stage::Compute)?;
        let gpu = &self.0;
        let key = (std::ptr::from_ref(shader).addr(), entry.to_owned());
        if let Some(made) = gpu.pipelines().get(&key).and_then(Weak::upgrade) {
            return Ok(Pipeline(made));
        }
        let name = format!("{}.{entry}", shader.name);
        let size: u32 = point.workgroup.iter().product();
        if size > gpu.info.max_invocations {
            return Err(Error::Limit {
                what: format!("{name}: invocations of a workgroup"),
                needed: size.into(),
                limit: gpu.info.max_invocations.into(),
                hint: "make the workgroup smaller".into(),
            });
        }
        let mut pipeline = layout(gpu, name, shader, &[point], vk::ShaderStageFlags::COMPUTE)?;
        pipeline.workgroup = point.workgroup;
        let module = Module::new(gpu, shader)?;
        let name = c_name(point)?;
        let create = vk::ComputePipelineCreateInfo::default()
            .stage(module.stage(vk::ShaderStageFlags::COMPUTE, &name))
            .layout(pipeline.layout);
        // SAFETY: module and layout are alive and were made for this entry point.
        let made = unsafe { gpu.device.create_compute_pipelines(vk::PipelineCache::null(), &[create], None) };
        let made = pipeline.finish(made, "vkCreateComputePipelines")?;
        gpu.pipelines().insert(key, Arc::downgrade(&made.0));
        Ok(made)
    }

    /// A graphics pipeline.
    ///
    /// # Errors
    /// [`Error::Config`] if the shader has no such entry points, writes buffers or images while drawing, or the description contradicts
    /// itself, has no attachment or blends into a format that cannot; [`Error::Vulkan`] if the driver refuses.
    pub fn graphics(&self, shader: &'static Shader, desc: &GraphicsDesc<'_>) -> Result<Pipeline> {
        let gpu = &self.0;
        let vertex = entry_point(shader, desc.vertex, Stage::Vertex)?;
        let fragment = entry_point(shader, desc.fragment, Stage::Fragment)?;
        let name = format!("{}.{}+{}", shader.name, desc.vertex, desc.fragment);
        check_graphics(gpu, &name, desc)?;
        let stages = vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
        let mut pipeline = layout(gpu, name, shader, &[vertex, fragment], stages)?;
        if let Some(slot) = pipeline.slots.iter().find(|slot| slot.writes) {
            return Err(Error::Config {
                what: format!("{}: binding `{}`", pipeline.name, slot.binding.name),
                problem: "is written while drawing; vertex and fragment shaders may only read".into(),
            });
        }
        pipeline.targets = Some(Targets { colours: desc.colours.to_vec(), depth: desc.depth });
        let module = Module::new(gpu, shader)?;
        let names = (c_name(vertex)?, c_name(fragment)?);
        let stages = [
            module.stage(vk::ShaderStageFlags::VERTEX, &names.0),
            module.stage(vk::ShaderStageFlags::FRAGMENT, &names.1),
        ];
        let input = vk::PipelineVertexInputStateCreateInfo::default();
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default()
            .topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let raster = vk::PipelineRasterizationStateCreateInfo::default()
            .cull_mode(match desc.cull {
                Cull::None => vk::CullModeFlags::NONE,
                Cull::Front => vk::CullModeFlags::FRONT,
                Cull::Back => vk::CullModeFlags::BACK,
            })
            .front_face(vk::FrontFace::COUNTER_CLOCKWISE)
            .line_width(1.0);
        let samples = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::TYPE_1);
        let depth = vk::PipelineDepthStencilStateCreateInfo::default()
            .depth_test_enable(desc.depth.is_some())
            .depth_write_enable(desc.depth_write)
            .depth_compare_op(match desc.depth_test {
                DepthTest::Always => vk::CompareOp::ALWAYS,
                DepthTest::Less => vk::CompareOp::LESS,
                DepthTest::LessOrEqual => vk::CompareOp::LESS_OR_EQUAL,
                DepthTest::Greater => vk::CompareOp::GREATER,
                DepthTest::GreaterOrEqual => vk::CompareOp::GREATER_OR_EQUAL,
            });
        let kept = match desc.blend {
            Blend::Add => vk::BlendFactor::ONE,
            Blend::None | Blend::Premultiplied => vk::BlendFactor::ONE_MINUS_SRC_ALPHA,
        };
        let attachment = vk::PipelineColorBlendAttachmentState::default()
            .color_write_mask(vk::ColorComponentFlags::RGBA)
            .blend_enable(desc.blend != Blend::None)
            .src_color_blend_factor(vk::BlendFactor::ONE)
            .dst_color_blend_factor(kept)
            .src_alpha_blend_factor(vk::BlendFactor::ONE)
            .dst_alpha_blend_factor(kept);
        let attachments = vec![attachment; desc.colours.len()];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&attachments);
        let dynamic = vk::PipelineDynamicStateCreateInfo::default()
            .dynamic_states(&[vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR]);
        let formats: Vec<_> = desc.colours.iter().map(|format| format.vk()).collect();
        let mut rendering = vk::PipelineRenderingCreateInfo::default()
            .color_attachment_formats(&formats)
            .depth_attachment_format(desc.depth.map_or(vk::Format::UNDEFINED, Format::vk));
        let create = vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&samples)
            .depth_stencil_state(&depth)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(pipeline.layout)
            .push_next(&mut rendering);
        // SAFETY: module and layout are alive and were made for these entry points; all states outlive the call.
        let made =
            unsafe { gpu.device.create_graphics_pipelines(vk::PipelineCache::null(), &[create], None) };
        pipeline.finish(made, "vkCreateGraphicsPipelines")
    }
}

fn entry_point(shader: &'static Shader, name: &str, stage: Stage) -> Result<&'static EntryPoint> {
    shader.entry_points.iter().find(|e| e.name == name && e.stage == stage).ok_or_else(|| {
        let list: Vec<_> =
            shader.entry_points.iter().map(|e| format!("{} ({:?})", e.name, e.stage)).collect();
        Error::Config {
            what: format!("shader {}", shader.name),
            problem: format!("has no {stage:?} entry point `{name}`; it has {}", list.join(", ")),
        }
    })
}

fn check_graphics(gpu: &Inner, name: &str, desc: &GraphicsDesc<'_>) -> Result<()> {
    let blends = |format: &Format| feature::blends(&gpu.instance, gpu.physical, format.vk());
    let unblended = match desc.blend {
        Blend::None => None,
        Blend::Premultiplied | Blend::Add => desc.colours.iter().find(|format| !blends(format)),
    };
    if let Some(format) = unblended {
        return Err(Error::Config {
            what: name.into(),
            problem: format!(
                "blends into {format:?}, which {} cannot; draw to a format that blends",
                gpu.info.name
            ),
        });
    }
    let problem = if desc.colours.is_empty() && desc.depth.is_none() {
        "draws to nothing; it needs a colour or a depth attachment"
    } else if desc.depth.is_none() && (desc.depth_write || desc.depth_test != DepthTest::Always) {
        "tests or writes depth but has no depth attachment"
    } else if desc.colours.iter().any(|c| c.texel() == Texel::Depth) {
        "has a depth format among its colour attachments"
    } else if desc.depth.is_some_and(|d| d.texel() != Texel::Depth) {
        "has a colour format as its depth attachment"
    } else if desc.colours.len() > COLOURS.len() {
        "has more than 4 colour attachments"
    } else {
        return Ok(());
    };
    Err(Error::Config { what: name.into(), problem: problem.into() })
}

/// WGSL names hold no zero byte; a shader made by hand might.
fn c_name(point: &EntryPoint) -> Result<CString> {
    CString::new(point.name)
        .map_err(|e| Error::Config { what: format!("entry point {:?}", point.name), problem: e.to_string() })
}

/// Set and pipeline layout for what these entry points use, without the pipeline itself.
fn layout(
    gpu: &Arc<Inner>,
    name: String,
    shader: &'static Shader,
    points: &[&'static EntryPoint],
    stages: vk::ShaderStageFlags,
) -> Result<PipelineInner> {
    let mut slots: Vec<Slot> = Vec::new();
    for (index, binding) in shader.bindings.iter().enumerate() {
        let mut uses = points.iter().flat_map(|p| p.uses).filter(|u| u.binding == index).peekable();
        if uses.peek().is_some() {
            let (reads, writes) = uses.fold((false, false), |(r, w), u| (r | u.reads, w | u.writes));
            slots.push(Slot { binding, reads, writes });
        }
    }
    let queried = slots.iter().find(|slot| slot.binding.kind == BindingKind::AccelerationStructure);
    if let (Some(slot), None) = (queried, &gpu.rays) {
        return Err(Error::Config {
            what: format!("{name}: binding `{}`", slot.binding.name),
            problem: super::acceleration::without(gpu),
        });
    }
    let push_bytes = points.iter().map(|p| p.push_bytes).max().unwrap_or(0);
    if push_bytes > gpu.info.max_push_bytes {
        return Err(Error::Limit {
            what: format!("{name}: immediate block in bytes"),
            needed: push_bytes.into(),
            limit: gpu.info.max_push_bytes.into(),
            hint: "move some of it to a uniform buffer".into(),
        });
    }
    let bindings: Vec<_> = slots
        .iter()
        .map(|slot| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(slot.binding.binding)
                .descriptor_type(descriptor_type(slot.binding.kind))
                .descriptor_count(1)
                .stage_flags(stages)
        })
        .collect();
    let create = vk::DescriptorSetLayoutCreateInfo::default()
        .flags(vk::DescriptorSetLayoutCreateFlags::PUSH_DESCRIPTOR_KHR)
        .bindings(&bindings);
    // SAFETY: the device is alive and has VK_KHR_push_descriptor.
    let set_layout = unsafe { gpu.device.create_descriptor_set_layout(&create, None) }
        .map_err(vulkan("vkCreateDescriptorSetLayout", &name))?;
    // From here on the drop of `pipeline` cleans up.
    let mut pipeline = PipelineInner {
        gpu: gpu.clone(),
        name,
        slots,
        push_bytes,
        stages,
        workgroup: [0; 3],
        targets: None,
        set_layout,
        layout: vk::PipelineLayout::null(),
        raw: vk::Pipeline::null(),
    };
    let sets = [set_layout];
    let ranges = [vk::PushConstantRange::default().stage_flags(stages).size(push_bytes)];
    let create = vk::PipelineLayoutCreateInfo::default()
        .set_layouts(&sets)
        .push_constant_ranges(if push_bytes > 0 { &ranges } else { &[] });
    // SAFETY: the set layout is alive.
    pipeline.layout = unsafe { gpu.device.create_pipeline_layout(&create, None) }
        .map_err(vulkan("vkCreatePipelineLayout", &pipeline.name))?;
    Ok(pipeline)
}

/// The one map from reflected kinds to Vulkan's.
pub(crate) fn descriptor_type(kind: BindingKind) -> vk::DescriptorType {
    match kind {
        BindingKind::Uniform => vk::DescriptorType::UNIFORM_BUFFER,
        BindingKind::Storage => vk::DescriptorType::STORAGE_BUFFER,
        BindingKind::Sampled => vk::DescriptorType::SAMPLED_IMAGE,
        BindingKind::StorageImage => vk::DescriptorType::STORAGE_IMAGE,
        BindingKind::Sampler => vk::DescriptorType::SAMPLER,
        BindingKind::AccelerationStructure => vk::DescriptorType::ACCELERATION_STRUCTURE_KHR,
    }
}

/// A shader module, needed only while pipelines are made of it.
struct Module<'a> {
    gpu: &'a Inner,
    raw: vk::ShaderModule,
}

impl<'a> Module<'a> {
    fn new(gpu: &'a Inner, shader: &Shader) -> Result<Self> {
        let create = vk::ShaderModuleCreateInfo::default().code(shader.spirv);
        // SAFETY: the code is valid by the promise of `Shader::new`; the device has the capabilities of the feature table.
        let raw = unsafe { gpu.device.create_shader_module(&create, None) }
            .map_err(vulkan("vkCreateShaderModule", shader.name))?;
        gpu.set_name(raw, shader.name);
        Ok(Self { gpu, raw })
    }

    fn stage<'b>(
        &self,
        stage: vk::ShaderStageFlags,
        name: &'b CString,
    ) -> vk::PipelineShaderStageCreateInfo<'b> {
        vk::PipelineShaderStageCreateInfo::default().stage(stage).module(self.raw).name(name)
    }
}

impl Drop for Module<'_> {
    fn drop(&mut self) {
        // SAFETY: ours; pipelines do not need it after they are made.
        unsafe { self.gpu.device.destroy_shader_module(self.raw, None) };
    }
}

impl PipelineInner {
    fn finish(
        mut self,
        made: Result<Vec<vk::Pipeline>, (Vec<vk::Pipeline>, vk::Result)>,
        call: &'static str,
    ) -> Result<Pipeline> {
        // One was asked for; on failure it is null.
        let list = made.map_err(|(_, result)| Error::Vulkan { call, object: self.name.clone(), result })?;
        self.raw = list.first().copied().unwrap_or_default();
        self.gpu.set_name(self.raw, &self.name);
        Ok(Pipeline(Arc::new(self)))
    }
}

impl Drop for PipelineInner {
    fn drop(&mut self) {
        // SAFETY: ours, and nothing recorded refers to them: recorders hold an `Arc` until their commands have run. Null is allowed.
        unsafe {
            self.gpu.device.destroy_pipeline(self.raw, None);
            self.gpu.device.destroy_pipeline_layout(self.layout, None);
            self.gpu.device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}
