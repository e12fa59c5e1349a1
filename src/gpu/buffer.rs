//! Buffers.

use super::{
    Gpu,
    device::{Inner, vulkan},
    hazard::ResourceId,
};
use crate::{Error, Result};
use ash::vk;
use gpu_allocator::{MemoryLocation, vulkan::Allocation};
use std::sync::{Arc, Mutex, PoisonError};

/// What a buffer is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BufferUse {
    /// Device memory: storage, uniform, indirect arguments, source and destination of copies; where there are ray queries also what
    /// acceleration structures are built of.
    Device,
    /// Mapped, written by the program, read by the device: source of copies, storage, uniform.
    Upload,
    /// Mapped, destination of copies, read by the program.
    Readback,
}

/// A buffer. Dropping it frees it, once the recorders that used it are gone too; with a host's command buffer the host must keep the
/// [`Recorded`](super::Recorded) until the device has run it.
#[derive(Clone)]
pub struct Buffer(pub(crate) Arc<BufferInner>);

pub(crate) struct BufferInner {
    pub gpu: Arc<Inner>,
    pub id: ResourceId,
    pub name: String,
    pub bytes: u64,
    pub kind: BufferUse,
    pub raw: vk::Buffer,
    /// Locked for mapped access, so that two threads never touch the bytes at once. `None` only inside `drop`.
    memory: Mutex<Option<Allocation>>,
}

impl Gpu {
    /// A buffer of `bytes` bytes, content undefined.
    ///
    /// # Errors
    /// [`Error::Config`] for 0 bytes, [`Error::Limit`] beyond the device's largest, [`Error::Memory`] or [`Error::Vulkan`] if the device refuses.
    pub fn buffer(&self, name: &str, bytes: u64, kind: BufferUse) -> Result<Buffer> {
        self.buffer_also(name, bytes, kind, vk::BufferUsageFlags::empty())
    }

    /// The same, with usages beside those of its kind.
    pub(crate) fn buffer_also(
        &self,
        name: &str,
        bytes: u64,
        kind: BufferUse,
        also: vk::BufferUsageFlags,
    ) -> Result<Buffer> {
        use vk::BufferUsageFlags as U;
        if bytes == 0 {
            return Err(Error::Config {
                what: format!("buffer {name}"),
                problem: "has 0 bytes, needs at least 1".into(),
            });
        }
        if bytes > self.0.info.max_buffer {
            return Err(Error::Limit {
                what: format!("buffer {name}: bytes"),
                needed: bytes,
                limit: self.0.info.max_buffer,
                hint: "work on smaller bricks".into(),
            });
        }
        let (usage, location) = match kind {
            BufferUse::Device => (
                U::STORAGE_BUFFER
                    | U::UNIFORM_BUFFER
                    | U::INDIRECT_BUFFER
                    | U::TRANSFER_SRC
                    | U::TRANSFER_DST,
                MemoryLocation::GpuOnly,
            ),
            BufferUse::Upload => {
                (U::STORAGE_BUFFER | U::UNIFORM_BUFFER | U::TRANSFER_SRC, MemoryLocation::CpuToGpu)
            }
            BufferUse::Readback => (U::TRANSFER_DST, MemoryLocation::GpuToCpu),
        };
        let gpu = &self.0;
        let of_rays = match kind {
            BufferUse::Device if gpu.rays.is_some() => {
                U::SHADER_DEVICE_ADDRESS | U::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR
            }
            _ => U::empty(),
        };
        let create = vk::BufferCreateInfo::default().size(bytes).usage(usage | of_rays | also);
        // SAFETY: the device is alive; sizes above its limits are refused by it.
        let raw =
            unsafe { gpu.device.create_buffer(&create, None) }.map_err(vulkan("vkCreateBuffer", name))?;
        let id = Inner::new_id();
        // From here on the drop of `buffer` cleans up.
        let buffer = BufferInner {
            gpu: gpu.clone(),
            id,
            name: name.into(),
            bytes,
            kind,
            raw,
            memory: Mutex::new(None),
        };
        gpu.hazards().add_buffer(id);
        gpu.set_name(raw, name);
        // SAFETY: `raw` was just made of this device.
        let requirements = unsafe { gpu.device.get_buffer_memory_requirements(raw) };
        let memory = gpu.memory.allocate(name, requirements, location, true)?;
        // SAFETY: the allocation fits the requirements and is bound to nothing else.
        let bound = unsafe { gpu.device.bind_buffer_memory(raw, memory.memory(), memory.offset()) };
        *buffer.memory.lock().unwrap_or_else(PoisonError::into_inner) = Some(memory);
        bound.map_err(vulkan("vkBindBufferMemory", name))?;
        Ok(Buffer(Arc::new(buffer)))
    }
}

impl Buffer {
    /// Name given at creation.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Size in bytes.
    pub fn bytes(&self) -> u64 {
        self.0.bytes
    }

    /// Whether both are handles of one.
    pub fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// Whether another handle of it is there: of the program, or of commands that are recorded and, as far as is known, have not run. What a
    /// host records counts until it drops its [`Recorded`](super::Recorded).
    pub fn is_shared(&self) -> bool {
        Arc::strong_count(&self.0) > 1
    }

    /// Copies `data` to `offset` (bytes) of a mapped buffer. The device must not be using those bytes.
    ///
    /// # Errors
    /// [`Error::Config`] if the buffer is not mapped or the range is outside it.
    pub fn write(&self, offset: u64, data: &[u8]) -> Result<()> {
        self.mapped(offset, data.len() as u64, |bytes| bytes.copy_from_slice(data))
    }

    /// Copies `length` bytes from `offset` (bytes) of a mapped buffer. The device must have finished writing them.
    ///
    /// # Errors
    /// [`Error::Config`] if the buffer is not mapped or the range is outside it.
    pub fn read(&self, offset: u64, length: u64) -> Result<Vec<u8>> {
        self.mapped(offset, length, |bytes| bytes.to_vec())
    }

    /// Copies as many bytes as `into` has from `offset` (bytes) of a mapped buffer. The device must have finished writing them.
    ///
    /// # Errors
    /// As [`Buffer::read`].
    pub fn read_into(&self, offset: u64, into: &mut [u8]) -> Result<()> {
        self.mapped(offset, into.len() as u64, |bytes| into.copy_from_slice(bytes))
    }

    fn mapped<T>(&self, offset: u64, length: u64, action: impl FnOnce(&mut [u8]) -> T) -> Result<T> {
        self.0.check_range(offset, length)?;
        let mut memory = self.0.memory.lock().unwrap_or_else(PoisonError::into_inner);
        // Where all memory is the processor's, device memory is mapped too; programs must not come to rely on that.
        let mapped = if self.0.kind == BufferUse::Device { None } else { memory.as_mut() };
        let bytes = mapped.and_then(Allocation::mapped_slice_mut).ok_or_else(|| Error::Config {
            what: format!("buffer {}", self.0.name),
            problem: "is in device memory; only Upload and Readback buffers are mapped".into(),
        })?;
        Ok(action(&mut bytes[offset as usize..(offset + length) as usize]))
    }
}

impl BufferInner {
    /// Refuses a range that is not inside the buffer.
    pub fn check_range(&self, offset: u64, length: u64) -> Result<()> {
        if offset.checked_add(length).is_some_and(|end| end <= self.bytes) {
            return Ok(());
        }
        Err(Error::Config {
            what: format!("buffer {}", self.name),
            problem: format!("range of {length} bytes at {offset} is outside its {} bytes", self.bytes),
        })
    }
}

impl Drop for BufferInner {
    fn drop(&mut self) {
        self.gpu.hazards().remove(self.id);
        // SAFETY: ours, and nothing recorded refers to it: recorders hold an `Arc` until their commands have run.
        unsafe { self.gpu.device.destroy_buffer(self.raw, None) };
        let memory = self.memory.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(memory) = memory {
            self.gpu.memory.free(memory);
        }
    }
}
