//! Device memory: gpu-allocator behind a lock, with names and totals.

use crate::{Error, Result};
use ash::vk;
use gpu_allocator::{
    AllocationSizes, AllocatorDebugSettings, MemoryLocation,
    vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc},
};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Smallest block that the allocator asks the driver for, bytes: device-local and mapped. Larger resources get blocks of their own.
const BLOCK: [u64; 2] = [64 << 20, 16 << 20];

/// All device memory of one device.
pub(crate) struct Memory(Mutex<State>);

struct State {
    allocator: Allocator,
    peak: u64,
    /// Allocations until one is refused.
    left: Option<u32>,
}

impl Memory {
    /// `addressed`: shaders and acceleration structures may know buffers by their addresses.
    pub fn new(
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        device: &ash::Device,
        addressed: bool,
    ) -> Result<Self> {
        // What leaks is said by `report`, to who asks.
        let mut debug_settings = AllocatorDebugSettings::default();
        debug_settings.log_leaks_on_shutdown = false;
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.clone(),
            device: device.clone(),
            physical_device: physical,
            debug_settings,
            buffer_device_address: addressed,
            allocation_sizes: AllocationSizes::new(BLOCK[0], BLOCK[1]),
        });
        let allocator =
            allocator.map_err(|e| Error::Device { problem: format!("cannot manage device memory: {e}") })?;
        Ok(Self(Mutex::new(State { allocator, peak: 0, left: None })))
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Memory for a buffer (`linear`) or an image.
    pub fn allocate(
        &self,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> Result<Allocation> {
        let mut state = self.lock();
        if state.left == Some(0) {
            return Err(Error::Memory {
                object: name.into(),
                bytes: requirements.size,
                problem: "refused, as Gpu::fail_after asked for".into(),
            });
        }
        state.left = state.left.map(|left| left - 1);
        let wanted = AllocationCreateDesc {
            name,
            requirements,
            location,
            linear,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        };
        let allocation = state.allocator.allocate(&wanted).map_err(|e| Error::Memory {
            object: name.into(),
            bytes: requirements.size,
            problem: e.to_string(),
        })?;
        // The report counts alignment too, as `Allocation::size` does not.
        state.peak = state.peak.max(state.allocator.generate_report().total_allocated_bytes);
        Ok(allocation)
    }

    pub fn free(&self, allocation: Allocation) {
        // The allocator only fails for memory that is not its own.
        let freed = self.lock().allocator.free(allocation);
        debug_assert!(freed.is_ok(), "{freed:?}");
    }

    /// Name and size in bytes of everything that is allocated, sorted by name.
    pub fn report(&self) -> Vec<(String, u64)> {
        let report = self.lock().allocator.generate_report();
        let mut list: Vec<_> = report.allocations.into_iter().map(|a| (a.name, a.size)).collect();
        list.sort();
        list
    }

    /// Refuses all allocations after so many more; `None` refuses none.
    pub fn fail_after(&self, count: Option<u32>) {
        self.lock().left = count;
    }

    /// Most bytes ever allocated at once.
    pub fn peak(&self) -> u64 {
        self.lock().peak
    }
}
