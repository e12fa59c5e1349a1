//! Binding by name: what the host passes against what the shader declares.

use super::{
    AccelerationStructure, Buffer, Image, ImageUse, Sampler,
    access::Access,
    hazard::Touch,
    pipeline::{PipelineInner, Slot, descriptor_type},
    shader::{BindingKind, ViewDim},
};
use crate::{Error, Result};
use ash::vk;
use std::{any::Any, sync::Arc};

/// Something to bind.
#[derive(Clone, Copy)]
pub enum Bind<'a> {
    /// A whole buffer.
    Buffer(&'a Buffer),
    /// A part of a buffer: offset and size in bytes.
    BufferRange(&'a Buffer, u64, u64),
    /// A whole image: all layers of a flat one for `texture_2d_array`, its only layer for `texture_2d`, a volume for `texture_3d`.
    Image(&'a Image),
    /// One layer of a flat image, for `texture_2d`.
    Layer(&'a Image, u32),
    /// A sampler.
    Sampler(&'a Sampler),
    /// What ray queries go through.
    Acceleration(&'a AccelerationStructure),
}

impl<'a> From<&'a Buffer> for Bind<'a> {
    fn from(buffer: &'a Buffer) -> Self {
        Self::Buffer(buffer)
    }
}

impl<'a> From<&'a Image> for Bind<'a> {
    fn from(image: &'a Image) -> Self {
        Self::Image(image)
    }
}

impl<'a> From<&'a Sampler> for Bind<'a> {
    fn from(sampler: &'a Sampler) -> Self {
        Self::Sampler(sampler)
    }
}

impl<'a> From<&'a AccelerationStructure> for Bind<'a> {
    fn from(structure: &'a AccelerationStructure) -> Self {
        Self::Acceleration(structure)
    }
}

/// What a `texture_2d` takes: a flat image's only layer, or one of several.
#[derive(Clone, Copy)]
pub enum Flat<'a> {
    /// The only one.
    Only(&'a Image),
    /// The one of this number.
    Layer(&'a Image, u32),
}

impl<'a> From<Flat<'a>> for Bind<'a> {
    fn from(flat: Flat<'a>) -> Self {
        match flat {
            Flat::Only(image) => Self::Image(image),
            Flat::Layer(image, layer) => Self::Layer(image, layer),
        }
    }
}

/// Everything that a pipeline touches, by name. Each entry point of a built-in kernel has a struct of them, of which none can be
/// forgotten or misspelt; for other shaders, a slice of pairs is checked when it is bound.
pub trait Bindings {
    /// Names and what is bound.
    fn list(&self) -> Vec<(&str, Bind<'_>)>;
}

impl Bindings for [(&str, Bind<'_>)] {
    fn list(&self) -> Vec<(&str, Bind<'_>)> {
        self.to_vec()
    }
}

impl<const N: usize> Bindings for [(&str, Bind<'_>); N] {
    fn list(&self) -> Vec<(&str, Bind<'_>)> {
        self.to_vec()
    }
}

impl<B: Bindings + ?Sized> Bindings for &B {
    fn list(&self) -> Vec<(&str, Bind<'_>)> {
        (*self).list()
    }
}

/// Keeps an object alive.
pub(crate) type Keep = Arc<dyn Any + Send + Sync>;

/// Names checked and turned into descriptors.
#[derive(Default)]
pub(crate) struct Resolved<'a> {
    pub touches: Vec<Touch<'a>>,
    pub keep: Vec<Keep>,
    descriptors: Vec<(u32, vk::DescriptorType, Descriptor<'a>)>,
}

enum Descriptor<'a> {
    Buffer([vk::DescriptorBufferInfo; 1]),
    Image([vk::DescriptorImageInfo; 1]),
    Acceleration(vk::WriteDescriptorSetAccelerationStructureKHR<'a>),
}

impl Resolved<'_> {
    /// Descriptors for `vkCmdPushDescriptorSetKHR`.
    pub fn writes(&self) -> Vec<vk::WriteDescriptorSet<'_>> {
        self.descriptors
            .iter()
            .map(|(binding, kind, descriptor)| {
                let write = vk::WriteDescriptorSet::default().dst_binding(*binding).descriptor_type(*kind);
                match descriptor {
                    Descriptor::Buffer(info) => write.buffer_info(info),
                    Descriptor::Image(info) => write.image_info(info),
                    Descriptor::Acceleration(info) => {
                        // What `push_next` does, of a struct that stays as it is; it lives as long as `self`, as the result says.
                        let mut write = write.descriptor_count(1);
                        write.p_next = std::ptr::from_ref(info).cast();
                        write
                    }
                }
            })
            .collect()
    }
}

/// Matches binds with the pipeline's slots: each slot exactly once, nothing else.
pub(crate) fn resolve<'a>(pipeline: &PipelineInner, binds: &[(&'a str, Bind<'a>)]) -> Result<Resolved<'a>> {
    let refuse = |name: &str, problem: String| {
        Err(Error::Config { what: format!("{}: binding `{name}`", pipeline.name), problem })
    };
    for (i, (name, _)) in binds.iter().enumerate() {
        if binds[..i].iter().any(|(other, _)| other == name) {
            return refuse(name, "is given twice".into());
        }
        if !pipeline.slots.iter().any(|slot| slot.binding.name == *name) {
            let known: Vec<_> = pipeline.slots.iter().map(|slot| slot.binding.name).collect();
            return refuse(name, format!("is not used by this entry point; it uses {}", known.join(", ")));
        }
    }
    let mut resolved = Resolved::default();
    for slot in &pipeline.slots {
        match binds.iter().find(|(name, _)| *name == slot.binding.name) {
            Some((name, bind)) => {
                if let Err(problem) = one(pipeline, slot, name, *bind, &mut resolved)? {
                    return refuse(name, problem);
                }
            }
            None => return refuse(slot.binding.name, "is missing".into()),
        }
    }
    Ok(resolved)
}

/// Resolves one slot; the inner error is a problem to be told with the binding's name.
fn one<'a>(
    pipeline: &PipelineInner,
    slot: &Slot,
    name: &'a str,
    bind: Bind<'a>,
    out: &mut Resolved<'a>,
) -> Result<Result<(), String>> {
    let kind = slot.binding.kind;
    let descriptor = match (kind, bind) {
        (BindingKind::Uniform | BindingKind::Storage, Bind::Buffer(buffer)) => {
            buffer_range(pipeline, slot, name, buffer, 0, buffer.bytes(), out)?
        }
        (BindingKind::Uniform | BindingKind::Storage, Bind::BufferRange(buffer, offset, size)) => {
            buffer_range(pipeline, slot, name, buffer, offset, size, out)?
        }
        (BindingKind::Sampled | BindingKind::StorageImage, Bind::Image(image)) => {
            image_view(pipeline, slot, name, image, None, out)
        }
        (BindingKind::Sampled | BindingKind::StorageImage, Bind::Layer(image, layer)) => {
            image_view(pipeline, slot, name, image, Some(layer), out)
        }
        (BindingKind::Sampler, Bind::Sampler(sampler)) if !Arc::ptr_eq(&sampler.0.gpu, &pipeline.gpu) => {
            Err("is given a sampler of another device".into())
        }
        (BindingKind::Sampler, Bind::Sampler(sampler)) => {
            out.keep.push(sampler.0.clone());
            Ok(Descriptor::Image([vk::DescriptorImageInfo::default().sampler(sampler.0.raw)]))
        }
        (BindingKind::AccelerationStructure, Bind::Acceleration(structure)) => {
            acceleration(pipeline, slot, name, structure, out)
        }
        (kind, bind) => Err(format!("is a {kind:?} in the shader, given is {}", describe(bind))),
    };
    Ok(descriptor.map(|d| out.descriptors.push((slot.binding.binding, descriptor_type(kind), d))))
}

fn describe(bind: Bind<'_>) -> String {
    match bind {
        Bind::Buffer(b) | Bind::BufferRange(b, ..) => format!("buffer {}", b.name()),
        Bind::Image(i) | Bind::Layer(i, _) => format!("image {}", i.name()),
        Bind::Sampler(_) => "a sampler".into(),
        Bind::Acceleration(a) => format!("acceleration structure {}", a.name()),
    }
}

fn buffer_range<'a>(
    pipeline: &PipelineInner,
    slot: &Slot,
    name: &'a str,
    buffer: &'a Buffer,
    offset: u64,
    size: u64,
    out: &mut Resolved<'a>,
) -> Result<Result<Descriptor<'a>, String>> {
    let info = &pipeline.gpu.info;
    let (limit, alignment) = match slot.binding.kind {
        BindingKind::Uniform => (info.max_uniform_range, info.uniform_alignment),
        _ => (info.max_storage_range, info.storage_alignment),
    };
    buffer.0.check_range(offset, size)?;
    if size > limit {
        return Err(Error::Limit {
            what: format!("{}: binding `{name}`: bytes of buffer {}", pipeline.name, buffer.name()),
            needed: size,
            limit,
            hint: "bind a part of it, or work on smaller bricks".into(),
        });
    }
    let least = slot.binding.min_bytes;
    if size < least.into() {
        return Ok(Err(format!(
            "is given {size} bytes of buffer {}, the shader takes at least {least}",
            buffer.name()
        )));
    }
    if buffer.0.kind == super::BufferUse::Readback {
        return Ok(Err(format!("is given buffer {}, which is for reading back only", buffer.name())));
    }
    if !offset.is_multiple_of(alignment) || size == 0 {
        return Ok(Err(format!(
            "is given {size} bytes at {offset} of buffer {}; the offset must be a multiple of {alignment}, the size at least 1",
            buffer.name()
        )));
    }
    touch(
        pipeline,
        slot,
        Touch {
            id: buffer.0.id,
            name: buffer.name(),
            via: name,
            range: offset..offset + size,
            access: Access::StorageRead,
        },
        out,
    );
    out.keep.push(buffer.0.clone());
    Ok(Ok(Descriptor::Buffer([vk::DescriptorBufferInfo { buffer: buffer.0.raw, offset, range: size }])))
}

fn image_view<'a>(
    pipeline: &PipelineInner,
    slot: &Slot,
    name: &'a str,
    image: &'a Image,
    layer: Option<u32>,
    out: &mut Resolved<'a>,
) -> Result<Descriptor<'a>, String> {
    let desc = image.desc();
    let Some(wanted) = slot.binding.image else { return Err("is not an image in the shader".into()) };
    let needs = if slot.binding.kind == BindingKind::Sampled { ImageUse::SAMPLED } else { ImageUse::STORAGE };
    if !desc.usage.contains(needs) {
        return Err(format!(
            "is given image {}, which was not made for use as {:?}",
            image.name(),
            slot.binding.kind
        ));
    }
    // Depth images may be read as plain floats.
    let texel = desc.format.texel();
    let same = texel == wanted.texel
        || (texel == super::shader::Texel::Depth && wanted.texel == super::shader::Texel::Float);
    if !same || wanted.format.is_some_and(|format| format != desc.format) {
        let wanted = wanted.format.map_or_else(|| format!("{:?} texels", wanted.texel), |f| format!("{f:?}"));
        return Err(format!("takes {wanted}, image {} has {:?}", image.name(), desc.format));
    }
    let (view, range) = match (wanted.view, desc.kind, layer) {
        (ViewDim::D3, super::ImageKind::D3, None) => (image.0.whole, 0..1),
        (ViewDim::D2Array, super::ImageKind::D2, None) => (image.0.whole, 0..desc.layers.into()),
        (ViewDim::D2, super::ImageKind::D2, None) if desc.layers == 1 => (image.0.layers[0], 0..1),
        (ViewDim::D2, super::ImageKind::D2, Some(layer)) if layer < desc.layers => {
            (image.0.layers[layer as usize], layer.into()..u64::from(layer) + 1)
        }
        (view, kind, layer) => {
            return Err(format!(
                "takes a {view:?} view, given is {} of {kind:?} image {} with {} layers",
                layer.map_or("all".into(), |l| format!("layer {l}")),
                image.name(),
                desc.layers
            ));
        }
    };
    out.keep.push(image.0.clone());
    touch(
        pipeline,
        slot,
        Touch { id: image.0.id, name: image.name(), via: name, range, access: Access::SampledRead },
        out,
    );
    let info = vk::DescriptorImageInfo::default().image_view(view).image_layout(image.0.layout);
    Ok(Descriptor::Image([info]))
}

fn acceleration<'a>(
    pipeline: &PipelineInner,
    slot: &Slot,
    name: &'a str,
    structure: &'a AccelerationStructure,
    out: &mut Resolved<'a>,
) -> Result<Descriptor<'a>, String> {
    if pipeline.targets.is_some() {
        return Err("is queried while drawing; only compute shaders query rays".into());
    }
    for level in structure.levels() {
        let read = Touch {
            id: level.buffer.0.id,
            name: level.buffer.name(),
            via: name,
            range: 0..level.buffer.bytes(),
            access: Access::QueryRead,
        };
        touch(pipeline, slot, read, out);
    }
    out.keep.push(structure.0.clone());
    let top = std::slice::from_ref(structure.top());
    Ok(Descriptor::Acceleration(
        vk::WriteDescriptorSetAccelerationStructureKHR::default().acceleration_structures(top),
    ))
}

/// Notes what the entry points do through this slot; the access in `touch` is replaced.
fn touch<'a>(pipeline: &PipelineInner, slot: &Slot, touch: Touch<'a>, out: &mut Resolved<'a>) {
    let read = match slot.binding.kind {
        _ if pipeline.targets.is_some() => Access::GraphicsRead,
        BindingKind::Uniform => Access::UniformRead,
        BindingKind::Sampled => Access::SampledRead,
        BindingKind::AccelerationStructure => Access::QueryRead,
        BindingKind::Storage | BindingKind::StorageImage | BindingKind::Sampler => Access::StorageRead,
    };
    if slot.reads {
        out.touches.push(Touch { access: read, ..touch.clone() });
    }
    if slot.writes {
        out.touches.push(Touch { access: Access::StorageWrite, ..touch });
    }
}
