//! Data from the host's memory: volumes, and meshes to clip with. Copied; no device yet.

use crate::edge::{answer, numbers, one_of, read, versioned};
use crate::error::{CaoResult, Result, guard, refuse};
use crate::handle::{free, handle, insert};
use cao_model::mesh::TriangleMesh;
use cao_model::values::Values;
use cao_model::volume::{Volume, voxel_count};
use glam::Vec3;
use std::ffi::c_void;

/// Types of voxels.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaoVoxel {
    /// Unsigned, 8 bits.
    U8 = 0,
    /// Unsigned, 16 bits.
    U16 = 1,
    /// Signed, 16 bits.
    I16 = 2,
    /// IEEE 754, 32 bits.
    F32 = 3,
}

const VOXELS: [CaoVoxel; 4] = [CaoVoxel::U8, CaoVoxel::U16, CaoVoxel::I16, CaoVoxel::F32];

/// A volume in memory, on no device. 0 is none.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CaoVolume {
    /// Without meaning for a host.
    pub id: u64,
}
handle!(CaoVolume, 2, "volume", Volume);

/// A mesh to clip with. 0 is none.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CaoMesh {
    /// Without meaning for a host.
    pub id: u64,
}
handle!(CaoMesh, 3, "mesh", std::sync::Arc<TriangleMesh>);

/// Voxels and where they are.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CaoVolumeInfo {
    /// sizeof(CaoVolumeInfo).
    pub size: u32,
    /// A CaoVoxel.
    pub voxel: u32,
    /// Voxels along x, y, z.
    pub dims: [u32; 3],
    /// 0.
    pub reserved: u32,
    /// Distance of their centres along x, y, z in mm.
    pub spacing_mm: [f64; 3],
    /// The values, x fastest, in the machine's byte order; at any address.
    pub data: *const c_void,
    /// Bytes there: the product of dims and of a voxel's bytes.
    pub bytes: u64,
}
versioned!(CaoVolumeInfo);

/// Values of one type, copied.
///
/// # Safety
/// As many bytes as `count` values have can be read; every pattern of bits is a value.
unsafe fn copied<T: Copy + Default>(data: *const c_void, count: usize) -> Result<Vec<T>> {
    let mut values = Vec::new();
    if values.try_reserve_exact(count).is_err() {
        let bytes = count.saturating_mul(size_of::<T>());
        return refuse(CaoResult::OutOfMemory, format!("volume: no memory for {bytes} bytes"));
    }
    values.resize(count, T::default());
    // SAFETY: the caller's promise; the copy is of bytes, which lie anywhere.
    unsafe {
        std::ptr::copy_nonoverlapping(
            data.cast::<u8>(),
            values.as_mut_ptr().cast::<u8>(),
            count * size_of::<T>(),
        );
    }
    Ok(values)
}

/// Copies a volume from memory. Free it with cao_volume_free; a renderer that was made of it needs it no more.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_volume_from_memory(
    info: *const CaoVolumeInfo,
    volume: *mut CaoVolume,
) -> CaoResult {
    let make = || {
        // SAFETY: the header asks for it.
        let info = unsafe { read(info) }?;
        let voxel = one_of("CaoVolumeInfo.voxel", info.voxel, &VOXELS)?;
        let count = match voxel_count(info.dims.map(u64::from)) {
            Ok(count) => count,
            Err(problem) => return refuse(CaoResult::BadValue, format!("CaoVolumeInfo.dims: {problem}")),
        };
        let wide = match voxel {
            CaoVoxel::U8 => 1,
            CaoVoxel::U16 | CaoVoxel::I16 => 2,
            CaoVoxel::F32 => 4,
        };
        // `voxel_count` leaves room for eight bytes each.
        let bytes = count as u64 * wide;
        if info.bytes != bytes {
            let what =
                format!("CaoVolumeInfo.bytes: {}, expected {bytes} for these dims and voxels", info.bytes);
            return refuse(CaoResult::WrongSize, what);
        }
        // SAFETY: the header asks for it; only whether it is NULL is looked at.
        unsafe { numbers("CaoVolumeInfo.data", info.data.cast::<u8>(), bytes) }?;
        // SAFETY: the header asks for as many bytes as `bytes` says, and these are as many.
        let values = unsafe {
            match voxel {
                CaoVoxel::U8 => Values::U8(copied(info.data, count)?),
                CaoVoxel::U16 => Values::U16(copied(info.data, count)?),
                CaoVoxel::I16 => Values::I16(copied(info.data, count)?),
                CaoVoxel::F32 => Values::F32(copied(info.data, count)?),
            }
        };
        Ok(insert(Volume::new(info.dims.map(|d| d as usize), info.spacing_mm, values)?, 0))
    };
    // SAFETY: the header asks for it.
    guard(|| unsafe { answer(volume, CaoVolume { id: 0 }, make) })
}

/// What belongs to each label of a volume of such voxels on this grid, for each voxel.
pub(crate) fn of_labels(
    labels: &Volume,
    dims: [usize; 3],
    spacing: [f64; 3],
    each: &[u8],
) -> Result<Vec<u8>> {
    if labels.dims != dims || labels.spacing != spacing {
        let (found, apart) = (labels.dims, labels.spacing);
        let what = format!(
            "labels: {found:?} voxels, {apart:?} mm apart; expected those of the volume, {dims:?}, {spacing:?} mm"
        );
        return refuse(CaoResult::BadValue, what);
    }
    match &labels.values {
        Values::U8(all) => Ok(all.iter().map(|label| each[usize::from(*label)]).collect()),
        Values::U16(all) => Ok(all.iter().map(|label| each[usize::from(*label)]).collect()),
        _ => refuse(CaoResult::BadValue, "labels: expected voxels of CAO_VOXEL_U8 or CAO_VOXEL_U16"),
    }
}

/// Frees a volume.
// SAFETY: the name is ours alone.
#[unsafe(no_mangle)]
pub extern "C" fn cao_volume_free(volume: CaoVolume) -> CaoResult {
    guard(|| free(volume))
}

/// Copies a mesh: three floats a vertex, in mm; three indices a triangle. It must enclose something and have no hole. Free it with
/// cao_mesh_free; clips that are set keep it.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_mesh_from_memory(
    vertices: *const f32,
    vertex_count: u32,
    indices: *const u32,
    index_count: u32,
    mesh: *mut CaoMesh,
) -> CaoResult {
    let make = || {
        // SAFETY: the header asks for it.
        let places = unsafe { numbers("vertices", vertices, 3 * u64::from(vertex_count)) }?;
        // SAFETY: as above.
        let corners = unsafe { numbers("indices", indices, index_count.into()) }?;
        let (faces, rest) = corners.as_chunks::<3>();
        if !rest.is_empty() {
            let what = format!("index_count: {index_count}, expected three indices a triangle");
            return refuse(CaoResult::WrongSize, what);
        }
        let places: Vec<Vec3> = places.as_chunks::<3>().0.iter().copied().map(Vec3::from_array).collect();
        let made = TriangleMesh::new("of the host", &places, faces)?;
        made.check_solid()?;
        Ok(insert(std::sync::Arc::new(made), 0))
    };
    // SAFETY: the header asks for it.
    guard(|| unsafe { answer(mesh, CaoMesh { id: 0 }, make) })
}

/// Frees a mesh.
// SAFETY: the name is ours alone.
#[unsafe(no_mangle)]
pub extern "C" fn cao_mesh_free(mesh: CaoMesh) -> CaoResult {
    guard(|| free(mesh))
}
