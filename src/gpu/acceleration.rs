//! Triangles as a device keeps them to find what rays hit (VK_KHR_acceleration_structure): a bottom level of all triangles, a top level of
//! one instance of it, each in a buffer of its own, by which the hazard checker knows it. lavapipe takes 104 bytes a triangle.

use super::{
    Access, Buffer, BufferUse, Gpu, Recorder,
    device::{Inner, vulkan},
    hazard::Touch,
};
use crate::{Error, Result};
use ash::vk;
use std::{ffi::CStr, sync::Arc};

/// Calls and limits of ray queries, of a device that was made for them.
pub(crate) struct Rays {
    structures: ash::khr::acceleration_structure::Device,
    address: vk::PFN_vkGetBufferDeviceAddress,
    /// What the address of scratch memory must be a multiple of, bytes.
    scratch_alignment: u64,
    /// Most triangles of a structure.
    most_triangles: u64,
}

impl Rays {
    /// Asks the device for them; a host may have said that there are some and not have enabled them.
    pub fn new(instance: &ash::Instance, physical: vk::PhysicalDevice, device: &ash::Device) -> Result<Self> {
        let call = |name: &CStr| {
            // SAFETY: instance and device are alive and belong together.
            unsafe { instance.get_device_proc_addr(device.handle(), name.as_ptr()) }
        };
        let address = call(c"vkGetBufferDeviceAddress").or_else(|| call(c"vkGetBufferDeviceAddressKHR"));
        let (Some(address), Some(_)) = (address, call(c"vkCmdBuildAccelerationStructuresKHR")) else {
            return Err(Error::Device {
                problem: "the device has no vkGetBufferDeviceAddress or no vkCmdBuildAccelerationStructuresKHR; make it with feature::RAY_QUERIES and the feature bufferDeviceAddress, or adopt it without ray_queries".into(),
            });
        };
        let mut limits = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
        let mut chain = vk::PhysicalDeviceProperties2::default().push_next(&mut limits);
        // SAFETY: `physical` was enumerated from `instance`; the chained struct outlives the call.
        unsafe { instance.get_physical_device_properties2(physical, &mut chain) };
        Ok(Self {
            structures: ash::khr::acceleration_structure::Device::new(instance, device),
            // SAFETY: the loader gives the function of this name, whose type this is.
            address: unsafe {
                std::mem::transmute::<unsafe extern "system" fn(), vk::PFN_vkGetBufferDeviceAddress>(address)
            },
            scratch_alignment: limits.min_acceleration_structure_scratch_offset_alignment.into(),
            most_triangles: limits.max_primitive_count,
        })
    }

    fn address(&self, buffer: &Buffer) -> u64 {
        let info = vk::BufferDeviceAddressInfo::default().buffer(buffer.0.raw);
        // SAFETY: the buffer is alive and was made for it, as all device buffers are where there are ray queries.
        unsafe { (self.address)(buffer.0.gpu.device.handle(), &info) }
    }
}

/// What a device without ray queries is told.
pub(crate) fn without(gpu: &Inner) -> String {
    format!(
        "needs ray queries, which {} does not have or was not made for; ask Gpu::ray_queries first",
        gpu.info.name
    )
}

/// Corners of triangles in a buffer, three after another.
#[derive(Clone, Copy)]
pub struct Corners<'a> {
    /// Each corner begins with its place, x y z, an f32 each.
    pub buffer: &'a Buffer,
    /// Bytes from a corner to the next.
    pub stride: u64,
    /// How many triangles.
    pub triangles: u32,
}

/// What ray queries go through. Cheap to clone. Freed when dropped, once the recorders that used it are gone too.
#[derive(Clone)]
pub struct AccelerationStructure(pub(crate) Arc<Levels>);

pub(crate) struct Levels {
    name: String,
    top: Level,
    bottom: Level,
}

/// One level and the memory that it lies in.
pub(crate) struct Level {
    pub buffer: Buffer,
    raw: vk::AccelerationStructureKHR,
}

impl Drop for Level {
    fn drop(&mut self) {
        if let Some(rays) = &self.buffer.0.gpu.rays {
            // SAFETY: ours, and nothing recorded refers to it: recorders hold an `Arc` until their commands have run.
            unsafe { rays.structures.destroy_acceleration_structure(self.raw, None) };
        }
    }
}

impl AccelerationStructure {
    /// Name given at creation.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    pub(crate) fn levels(&self) -> [&Level; 2] {
        [&self.0.top, &self.0.bottom]
    }

    pub(crate) fn top(&self) -> &vk::AccelerationStructureKHR {
        &self.0.top.raw
    }
}

/// Bytes of an instance, and what its address must be a multiple of.
const INSTANCE: u64 = 64;
const INSTANCE_ALIGNMENT: u64 = 16;

/// An instance where its triangles are, which every ray may hit from either side.
fn instance(of: u64) -> [u32; 16] {
    let one = 1.0_f32.to_bits();
    let mut words = [0; 16];
    // Three rows of four.
    for diagonal in [0, 5, 10] {
        words[diagonal] = one;
    }
    words[12] = 0xff << 24;
    words[13] = vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE.as_raw() << 24;
    words[14] = of as u32;
    words[15] = (of >> 32) as u32;
    words
}

/// How a level is built: to be traced fast.
fn build<'a>(
    kind: vk::AccelerationStructureTypeKHR,
    geometry: &'a [vk::AccelerationStructureGeometryKHR<'a>],
) -> vk::AccelerationStructureBuildGeometryInfoKHR<'a> {
    vk::AccelerationStructureBuildGeometryInfoKHR::default()
        .ty(kind)
        .flags(vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE)
        .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
        .geometries(geometry)
}

impl Gpu {
    /// Triangles for ray queries, numbered as they lie in the buffer. None is opaque: kernels confirm the hits that they want, or force
    /// all to be opaque. Uses the device's queue and waits for it.
    ///
    /// # Errors
    /// [`Error::Config`] on a device without ray queries, for no triangles, or corners outside the buffer; [`Error::Limit`] for more
    /// triangles than the device takes; as [`Gpu::buffer`] and [`Gpu::recorder`].
    pub fn acceleration_structure(&self, name: &str, corners: Corners<'_>) -> Result<AccelerationStructure> {
        let Corners { buffer, stride, triangles } = corners;
        let refuse =
            |problem: String| Err(Error::Config { what: format!("acceleration structure {name}"), problem });
        let Some(rays) = &self.0.rays else { return refuse(without(&self.0)) };
        if !Arc::ptr_eq(&buffer.0.gpu, &self.0) || buffer.0.kind != BufferUse::Device {
            return refuse(format!(
                "is of buffer {}, which is no Device buffer of this device",
                buffer.name()
            ));
        }
        if triangles == 0 || stride < 12 || !stride.is_multiple_of(4) || u32::try_from(stride).is_err() {
            return refuse(format!(
                "is of {triangles} triangles, {stride} bytes from corner to corner; expected at least one, and a multiple of 4 from 12 on"
            ));
        }
        buffer.0.check_range(0, (3 * u64::from(triangles) - 1).saturating_mul(stride).saturating_add(12))?;
        if u64::from(triangles) > rays.most_triangles {
            return Err(Error::Limit {
                what: format!("acceleration structure {name}: triangles"),
                needed: triangles.into(),
                limit: rays.most_triangles,
                hint: "trace them without ray queries".into(),
            });
        }
        let places = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
            .vertex_format(vk::Format::R32G32B32_SFLOAT)
            .vertex_data(vk::DeviceOrHostAddressConstKHR { device_address: rays.address(buffer) })
            .vertex_stride(stride)
            .max_vertex(3 * triangles - 1)
            .index_type(vk::IndexType::NONE_KHR);
        let geometry = [vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { triangles: places })];
        let instances =
            self.buffer(&format!("{name}: instance"), INSTANCE + INSTANCE_ALIGNMENT, BufferUse::Device)?;
        let (instance_at, instance_address) = rays.aligned(&instances, INSTANCE_ALIGNMENT);
        let of_instances = vk::AccelerationStructureGeometryInstancesDataKHR::default()
            .data(vk::DeviceOrHostAddressConstKHR { device_address: instance_address });
        let instance_geometry = [vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances: of_instances })];
        let mut bottom_build = build(vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL, &geometry);
        let mut top_build = build(vk::AccelerationStructureTypeKHR::TOP_LEVEL, &instance_geometry);
        let (bottom, bottom_scratch) =
            self.level(rays, &format!("{name}: triangles"), &mut bottom_build, triangles)?;
        let (top, top_scratch) = self.level(rays, &format!("{name}: instances"), &mut top_build, 1)?;
        let scratch_bytes = bottom_scratch.max(top_scratch) + rays.scratch_alignment;
        let scratch = self.buffer(&format!("{name}: scratch"), scratch_bytes, BufferUse::Device)?;
        let (_, scratch_address) = rays.aligned(&scratch, rays.scratch_alignment);
        for build in [&mut bottom_build, &mut top_build] {
            build.scratch_data = vk::DeviceOrHostAddressKHR { device_address: scratch_address };
        }
        let info =
            vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(bottom.raw);
        // SAFETY: the structure is alive.
        let bottom_address = unsafe { rays.structures.get_acceleration_structure_device_address(&info) };
        let structure = AccelerationStructure(Arc::new(Levels { name: name.into(), top, bottom }));
        let [top, bottom] = structure.levels();
        let mut rec = self.recorder(name)?;
        rec.update(&instances, instance_at, bytemuck::cast_slice(&instance(bottom_address)))?;
        rec.build(&bottom_build, triangles, [("corners", buffer)], [&bottom.buffer, &scratch])?;
        rec.barrier(&[Access::TransferWrite, Access::BuildWrite], &[Access::BuildRead, Access::BuildWrite]);
        rec.build(
            &top_build,
            1,
            [("instances", &instances), ("bottom", &bottom.buffer)],
            [&top.buffer, &scratch],
        )?;
        rec.submit_and_wait()?;
        Ok(structure)
    }

    /// An empty level of so many triangles or instances, named as what `build` makes, and how much scratch memory that takes in bytes.
    fn level(
        &self,
        rays: &Rays,
        name: &str,
        build: &mut vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
        count: u32,
    ) -> Result<(Level, u64)> {
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        let on = vk::AccelerationStructureBuildTypeKHR::DEVICE;
        // SAFETY: `build` has one geometry, and what it points to lives until the call returns.
        unsafe { rays.structures.get_acceleration_structure_build_sizes(on, build, &[count], &mut sizes) };
        let storage = vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR;
        let bytes = sizes.acceleration_structure_size;
        let buffer = self.buffer_also(name, bytes, BufferUse::Device, storage)?;
        let create =
            vk::AccelerationStructureCreateInfoKHR::default().ty(build.ty).buffer(buffer.0.raw).size(bytes);
        // SAFETY: the buffer is alive, of this size and made for it.
        let raw = unsafe { rays.structures.create_acceleration_structure(&create, None) }
            .map_err(vulkan("vkCreateAccelerationStructureKHR", name))?;
        self.0.set_name(raw, name);
        build.dst_acceleration_structure = raw;
        Ok((Level { buffer, raw }, sizes.build_scratch_size))
    }
}

impl Rays {
    /// The first offset in a buffer whose address is such a multiple, and that address.
    fn aligned(&self, buffer: &Buffer, alignment: u64) -> (u64, u64) {
        let begin = self.address(buffer);
        let address = begin.next_multiple_of(alignment);
        (address - begin, address)
    }
}

fn touch<'a>(via: &'a str, buffer: &'a Buffer, access: Access) -> Touch<'a> {
    Touch { id: buffer.0.id, name: buffer.name(), via, range: 0..buffer.bytes(), access }
}

impl Recorder {
    /// Builds a level from what it reads into what it writes: its own memory and scratch.
    fn build<const READ: usize>(
        &mut self,
        build: &vk::AccelerationStructureBuildGeometryInfoKHR<'_>,
        count: u32,
        reads: [(&str, &Buffer); READ],
        writes: [&Buffer; 2],
    ) -> Result<()> {
        let reads_of = reads.into_iter().map(|(via, buffer)| touch(via, buffer, Access::BuildRead));
        let [level, scratch] = writes;
        let written =
            [touch("level", level, Access::BuildWrite), touch("scratch", scratch, Access::BuildWrite)];
        let touches: Vec<_> = reads_of.chain(written).collect();
        self.order(&format!("build {}", level.name()), &touches)?;
        for buffer in reads.map(|(_, buffer)| buffer).into_iter().chain(writes) {
            self.keep(buffer.0.clone());
        }
        let range = [vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(count)];
        let gpu = self.gpu.clone();
        if let Some(rays) = &gpu.rays {
            // SAFETY: `cmd` is recording, what is built and of what is alive and kept, sizes and alignments are those that the device asked for.
            unsafe {
                rays.structures.cmd_build_acceleration_structures(
                    self.cmd,
                    std::slice::from_ref(build),
                    &[&range],
                );
            }
        }
        Ok(())
    }
}
