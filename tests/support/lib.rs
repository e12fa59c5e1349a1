//! What tests share: a device under validation, fields on it and back, sizes, random fields, meshes ([`meshes`] of several
//! parts too), [`image_space`]: what pixels show, [`scan`]s as files, [`networks`] and what PyTorch makes of them; [`fuzz`] for inputs near valid ones; [`wgsl`] for tests that bring kernels of their own.

#![deny(unsafe_code)]

pub mod fuzz;
pub mod image_space;
pub mod meshes;
pub mod networks;
pub mod scan;
pub mod wgsl;
pub mod worlds;

pub use cao_model::network::half as half_float;
pub use networks::{Reference, network, network_bytes, network_references};

use cao::field::Field;
use cao::field::volume_image;
use cao::renderer::{COLOUR, Renderer};
use cao_gpu::{Access, Buffer, BufferUse, DeviceKind, Format, Gpu, Image, OpenOptions, Recorder};
use cao_measure::random::Random;
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::light::AmbientLight;
use cao_model::mesh::TriangleMesh;
use cao_model::methods::{METHODS, Method};
use cao_model::network::{Label, Shape as NetworkShape};
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::view::{StereoRig, View};
use cao_model::volume::Volume;
use cao_twin::Grid;
use glam::{DMat3, DVec3, Vec3};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

/// Every method, the default first: what holds for one holds for all.
pub fn methods() -> impl Iterator<Item = Method> {
    METHODS.iter().rev().map(|entry| entry.method)
}

/// One for each way to take clips in, the default first: by brick, where all methods share every line of it, and by the paper's dilation maps. For
/// tests of what clip meshes need, and for the longest histories, of which other methods have shorter ones.
pub fn kinds() -> [Method; 3] {
    [Method::Rays, Method::Cao, Method::Lao]
}

/// Whether devices that tests open are under validation: unless `CAO_VALIDATION=0` says that there is no layer here.
pub fn validated() -> bool {
    std::env::var_os("CAO_VALIDATION").is_none_or(|value| value != "0")
}

/// A file or folder of the repository that a test reads when it runs. `CAO_SOURCE` says where the repository lies now, by
/// default where it was built.
pub fn source(path: &str) -> PathBuf {
    let root = std::env::var_os("CAO_SOURCE");
    let root = root.unwrap_or_else(|| concat!(env!("CARGO_MANIFEST_DIR"), "/../..").into());
    PathBuf::from(root).join(path)
}

/// A device under core and synchronization validation, see [`validated`]. Tests end with [`close`].
pub fn open() -> Gpu {
    Gpu::open(&OpenOptions { validation: validated(), ..OpenOptions::default() })
        .expect("these tests need Vulkan and its validation layer")
}

/// Asserts that nothing is left allocated and that the validation layer has nothing to say, also about the destruction
/// of the device.
pub fn close(gpu: Gpu) {
    assert_eq!(gpu.memory_report(), [], "leaked");
    let log = gpu.validation_log();
    drop(gpu);
    log.assert_clean().unwrap();
}

/// One voxel, one row, a sheet, odd, larger than a workgroup of 8x8x4 and than a brick, none of them cubic; spacings from
/// equal to 1 : 4.
pub const GRIDS: [Grid; 6] = [
    Grid { dims: [1, 1, 1], spacing: [1.0; 3] },
    Grid { dims: [13, 1, 1], spacing: [0.7, 1.0, 1.0] },
    Grid { dims: [1, 9, 4], spacing: [1.0, 1.0, 2.5] },
    Grid { dims: [7, 5, 3], spacing: [0.5, 1.0, 2.0] },
    Grid { dims: [17, 8, 9], spacing: [1.0; 3] },
    Grid { dims: [10, 19, 12], spacing: [1.25, 0.8, 1.0] },
];

/// How far a texture filter may be off in an interpolated value of a field that ranges over 0 ... 1, beside the rounding
/// of the position: software drivers weight in f32; hardware weights have 8 bits (Vulkan's subTexelPrecisionBits), half a
/// unit of 2^-8 on each of three axes.
pub fn filter_error(gpu: &Gpu) -> f64 {
    match gpu.info().kind {
        DeviceKind::Cpu => 1e-6,
        _ => 3.0 * 0.5 / 256.0,
    }
}

/// Volume of f32 values.
pub fn volume_of(grid: &Grid, values: Vec<f32>) -> Volume {
    Volume::new(grid.dims, grid.spacing, Values::F32(values)).unwrap()
}

/// A field of this shape on the device whose data are of no interest.
pub fn blank(gpu: &Gpu, grid: &Grid) -> Field {
    Field::upload(gpu, &volume_of(grid, vec![0.0; grid.len()])).unwrap()
}

/// The shape of a volume, for the twins.
pub fn grid_of(volume: &Volume) -> Grid {
    Grid { dims: volume.dims, spacing: volume.spacing }
}

/// Data values are opacities, white.
pub fn identity() -> TransferFunction {
    TransferFunction::new(vec![[0.0, 0.0], [1.0, 1.0]], vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap()
}

/// Runs commands and waits.
pub fn run(gpu: &Gpu, commands: impl FnOnce(&mut Recorder)) {
    let mut rec = gpu.recorder("test").unwrap();
    commands(&mut rec);
    rec.submit_and_wait().unwrap();
}

/// Device buffer with this content.
pub fn buffer(gpu: &Gpu, name: &str, content: &[u8]) -> Buffer {
    let bytes = content.len() as u64;
    let staging = gpu.buffer("staging", bytes, BufferUse::Upload).unwrap();
    staging.write(0, content).unwrap();
    let buffer = gpu.buffer(name, bytes, BufferUse::Device).unwrap();
    run(gpu, |rec| rec.copy_buffer(&staging, 0, &buffer, 0, bytes).unwrap());
    buffer
}

/// Content of a device buffer.
pub fn read_buffer(gpu: &Gpu, buffer: &Buffer) -> Vec<u8> {
    let back = gpu.buffer("read-back", buffer.bytes(), BufferUse::Readback).unwrap();
    run(gpu, |rec| {
        rec.copy_buffer(buffer, 0, &back, 0, buffer.bytes()).unwrap();
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    });
    back.read(0, buffer.bytes()).unwrap()
}

/// Content of a 3D image, x fastest.
pub fn read_image(gpu: &Gpu, image: &Image) -> Vec<u8> {
    let dims = image.desc().dims;
    let bytes = dims.iter().map(|&d| u64::from(d)).product::<u64>() * image.desc().format.bytes();
    let back = gpu.buffer("read-back", bytes, BufferUse::Readback).unwrap();
    run(gpu, |rec| {
        rec.copy_image_to_buffer(image, 0, [0; 3], dims, &back, 0).unwrap();
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    });
    back.read(0, bytes).unwrap()
}

/// Content of a 3D image of floats.
pub fn read_floats(gpu: &Gpu, image: &Image) -> Vec<f32> {
    bytemuck::pod_collect_to_vec(&read_image(gpu, image))
}

/// Overwrites a 3D image, x fastest.
pub fn write_image(gpu: &Gpu, image: &Image, content: &[u8]) {
    let staging = gpu.buffer("staging", content.len() as u64, BufferUse::Upload).unwrap();
    staging.write(0, content).unwrap();
    run(gpu, |rec| {
        rec.discard(image);
        rec.barrier(&[], &[Access::TransferWrite]);
        rec.copy_buffer_to_image(&staging, 0, image, [0; 3], image.desc().dims).unwrap();
    });
}

/// A 3D image of floats of the field's size.
pub fn float_image(gpu: &Gpu, field: &Field, content: &[f32]) -> Image {
    let image = volume_image(gpu, "test floats", field, Format::R32Float).unwrap();
    write_image(gpu, &image, bytemuck::cast_slice(content));
    image
}

/// A 3D image of bytes of the field's size.
pub fn byte_image(gpu: &Gpu, field: &Field, content: &[u8]) -> Image {
    let image = volume_image(gpu, "test bytes", field, Format::R8Uint).unwrap();
    write_image(gpu, &image, content);
    image
}

/// Random opacities, half of them 0, up to `largest`.
pub fn opacities(random: &mut Random, grid: &Grid, largest: f32) -> Vec<f32> {
    (0..grid.len()).map(|_| random.between(-largest, largest).max(0.0)).collect()
}

/// The same mesh by way of an OBJ file's text.
pub fn through_obj(mesh: &TriangleMesh) -> TriangleMesh {
    let mut text = String::new();
    for v in &mesh.vertices {
        writeln!(text, "v {} {} {}", v.x, v.y, v.z).unwrap();
    }
    for t in &mesh.triangles {
        writeln!(text, "f {} {} {}", t[0] + 1, t[1] + 1, t[2] + 1).unwrap();
    }
    cao_formats::obj::parse(mesh.name.as_str(), &text).unwrap()
}

/// A convex mesh from an OBJ file: a ball of 320 triangles.
pub fn convex() -> Arc<TriangleMesh> {
    Arc::new(through_obj(&TriangleMesh::sphere(2)))
}

/// A concave mesh from an OBJ file: a torus that the clip camera sees from the side, which takes two layer pairs.
pub fn concave() -> Arc<TriangleMesh> {
    let mut torus = TriangleMesh::torus(24, 12);
    torus.vertices.iter_mut().for_each(|v| *v = Vec3::new(v.z, v.x, v.y));
    Arc::new(through_obj(&torus))
}

/// Several boxes in a row along the clip camera's axis: as many layer pairs as boxes.
pub fn row_of_boxes(count: u32) -> TriangleMesh {
    let cuboid = TriangleMesh::cuboid();
    let mut positions = Vec::new();
    let mut faces = Vec::new();
    for n in 0..count {
        let first = positions.len() as u32;
        let moved = |v: &Vec3| Vec3::new(v.x, v.y, v.z * 0.3 + n as f32);
        positions.extend(cuboid.vertices.iter().map(moved));
        faces.extend(cuboid.triangles.iter().map(|t| t.map(|i| i + first)));
    }
    TriangleMesh::new("row of boxes", &positions, &faces).unwrap()
}

/// Every analytic shape, a convex and a concave mesh.
pub fn shapes() -> Vec<Shape> {
    Shape::ANALYTIC.into_iter().chain([convex(), concave()].map(Shape::Mesh)).collect()
}

/// Ambient light of another colour from each side, some from everywhere.
pub fn coloured_light() -> AmbientLight {
    let sides = [[2.0; 3], [0.3, -0.2, 1.0], [1.0, 1.2, 0.4], [-0.8, 0.1, 0.6], [0.4, -0.5, 0.2]];
    AmbientLight::harmonics(&sides).expect("five of nine")
}

/// A turn by a third about a diagonal, and a little more.
pub fn third_turn() -> DMat3 {
    DMat3::from_axis_angle(DVec3::ONE.normalize(), 2.2)
}

/// A clip around a volume of this size in mm: of any scale from a fiftieth of it to more than all of it.
pub fn random_clip(random: &mut Random, shape: &Shape, size: Vec3) -> Clip {
    let largest = size.max_element();
    let scale = largest * 0.02 * 50.0_f32.powf(random.between(0.0, 1.0));
    let mut vector = |low, high| Vec3::from_array([(); 3].map(|()| random.between(low, high)));
    let pose = Pose {
        translate_mm: vector(-0.6, 0.6) * size,
        rotate_deg: vector(-180.0, 180.0),
        scale: vector(0.5, 1.5) * scale,
    };
    let mode = if random.below(5) < 3 { Mode::Remove } else { Mode::Keep };
    Clip { shape: shape.clone(), mode, pose }
}

/// Edges of a volume in mm.
pub fn size_mm(grid: &Grid) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|i| (grid.dims[i] as f64 * grid.spacing[i]) as f32))
}

/// Both eyes in front of a volume, from `azimuth_deg` about +z.
pub fn eyes(volume: &Volume, azimuth_deg: f32) -> [View; 2] {
    let far = 8.0 * volume.size_mm().iter().sum::<f64>() as f32;
    StereoRig::framing(volume.size_mm(), azimuth_deg, 20.0).views(1.0, far * 1e-3, far).unwrap()
}

/// As [`Renderer::new`]; of method `dvao` with a network of some hundred weights, since what holds for one holds for all, and the one that is shipped
/// takes a software driver a second for a small volume.
pub fn renderer_of(
    gpu: &Gpu,
    volume: &Volume,
    transfer: TransferFunction,
    setup: Setup,
    colour: Format,
) -> cao::Result<Renderer> {
    let deep = setup.method == Method::Deep;
    let first = if deep { Setup::new(volume.min_spacing()) } else { setup };
    let mut renderer = Renderer::new(gpu, volume, transfer, first, colour)?;
    let shape = NetworkShape { edge: 16, filters: 4, cap: 8, levels: 2, label: Label::Mean };
    renderer.set_network(network(shape, 1))?;
    if deep {
        renderer.set_setup(setup)?;
    }
    Ok(renderer)
}

/// A renderer without occlusion, up to date: for what knows opacities and light only.
pub fn unoccluded(gpu: &Gpu, volume: &Volume, transfer: TransferFunction, clips: &[Clip]) -> Renderer {
    let mut setup = Setup::of(Method::default(), volume.min_spacing());
    setup.occlusion.radius_mm = 0.0;
    let mut renderer = Renderer::new(gpu, volume, transfer, setup, COLOUR).unwrap();
    renderer.set_clips(clips).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    renderer
}

/// A renderer of a small volume by the default method, up to date, that draws into this format.
pub fn fruit(gpu: &Gpu, colour: Format) -> Renderer {
    let volume = builtin_box("fruit", [16, 18, 14], [1.0; 3]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let setup = Setup::new(volume.min_spacing());
    let mut renderer = Renderer::new(gpu, &volume, transfer, setup, colour).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    renderer
}
