//! Worlds of few triangles, and what pixels show of them on the device.

use cao::mesh::gbuffer::Gbuffer;
use cao::mesh::geometry::Geometry;
use cao::mesh::surfaces::Surfaces;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Image};
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::mesh::TriangleMesh;
use cao_model::settings::MapSettings;
use cao_model::surface::{Instance, Material, Surface, Texture, World};
use cao_model::view::{StereoRig, Tangents, View};
use glam::{Quat, Vec2, Vec3};
use std::sync::Arc;

/// A parallelogram of 2·n² triangles, counter-clockwise from `u` to `v`.
pub fn sheet(origin: Vec3, u: Vec3, v: Vec3, n: u32, material: Material) -> Surface {
    let mut surface = Surface { name: "sheet".into(), materials: vec![material], ..Surface::default() };
    let at = |i: u32, j: u32| j * (n + 1) + i;
    for j in 0..=n {
        for i in 0..=n {
            let place = Vec2::new(i as f32, j as f32) / n as f32;
            surface.positions.push(origin + u * place.x + v * place.y);
            surface.uvs.push(2.0 * place);
        }
    }
    for j in 0..n {
        for i in 0..n {
            surface.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            surface.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    surface.material_of = vec![0; surface.triangles.len()];
    surface
}

/// A box, its faces outward.
pub fn cuboid(low: Vec3, high: Vec3) -> Surface {
    let mut surface =
        Surface { name: "cuboid".into(), materials: vec![Material::default()], ..Surface::default() };
    surface.positions = (0..8u32)
        .map(|i| {
            Vec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 1 { high[axis] } else { low[axis] }))
        })
        .collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    for [a, b, c, d] in faces {
        surface.triangles.extend([[a, b, c], [a, c, d]]);
    }
    surface.material_of = vec![0; 12];
    surface
}

/// A closed mesh whose cuts are of this colour.
pub fn solid(mesh: &TriangleMesh, cap: [f32; 3]) -> Surface {
    Surface {
        name: mesh.name.clone(),
        positions: mesh.vertices.clone(),
        triangles: mesh.triangles.clone(),
        material_of: vec![0; mesh.triangles.len()],
        materials: vec![Material { cap: Some(cap), ..Material::default() }],
        ..Surface::default()
    }
}

/// A ball with another in it and a box that runs into it, all with caps, over a floor without.
pub fn solids() -> World {
    let at = |translate_mm: Vec3, rotate_deg: Vec3, scale: Vec3, surface: Surface| Instance {
        surface: Arc::new(surface),
        pose: Pose { translate_mm, rotate_deg, scale },
    };
    let floor =
        sheet(Vec3::new(-60.0, -60.0, -36.0), Vec3::X * 120.0, Vec3::Y * 120.0, 2, Material::default());
    World::new(&[
        at(
            Vec3::ZERO,
            Vec3::new(20.0, 40.0, 60.0),
            Vec3::new(30.0, 34.0, 28.0),
            solid(&TriangleMesh::sphere(2), [0.8, 0.1, 0.1]),
        ),
        at(
            Vec3::new(5.0, -4.0, 3.0),
            Vec3::ZERO,
            Vec3::splat(12.0),
            solid(&TriangleMesh::sphere(1), [0.1, 0.1, 0.8]),
        ),
        at(
            Vec3::new(34.0, 8.0, 0.0),
            Vec3::new(30.0, 0.0, 45.0),
            Vec3::new(12.0, 9.0, 16.0),
            solid(&TriangleMesh::cuboid(), [0.1, 0.8, 0.1]),
        ),
        at(Vec3::ZERO, Vec3::ZERO, Vec3::ONE, floor),
    ])
    .unwrap()
}

/// Both eyes that look at them from a place.
pub fn solids_eyes(position: Vec3, size: [u32; 2]) -> [View; 2] {
    let rig =
        StereoRig { position, target: Vec3::ZERO, up: Vec3::Z, ipd_mm: 8.0, fov_deg: 45.0, screen_mm: None };
    rig.views(size[0] as f32 / size[1] as f32, 1.0, 1000.0).unwrap()
}

/// All of them where they are.
pub fn world_of(surfaces: Vec<Surface>) -> World {
    let place = |surface| Instance { surface: Arc::new(surface), pose: Pose::default() };
    World::new(&surfaces.into_iter().map(place).collect::<Vec<_>>()).unwrap()
}

/// A floor and two walls, a box, a net of two sides with holes, a needle that clips spare: 70 triangles in a room of 100 mm.
pub fn corner() -> World {
    let plain = Material::default;
    let (x, y, z) = (Vec3::X * 100.0, Vec3::Y * 100.0, Vec3::Z * 60.0);
    let texels = (0..16).map(|i| [200, 150, 100, if (i / 4 + i % 4) % 2 == 0 { 255 } else { 0 }]).collect();
    let texture = Arc::new(Texture { name: "net".into(), size: [4, 4], texels });
    let net = Material { texture: Some(texture), cutoff: Some(0.5), two_sided: true, ..plain() };
    let needle = Surface {
        positions: vec![Vec3::new(60.0, 20.0, 5.0), Vec3::new(95.0, 25.0, 8.0), Vec3::new(95.0, 27.0, 8.0)],
        uvs: Vec::new(),
        triangles: vec![[0, 1, 2]],
        material_of: vec![0],
        ..sheet(Vec3::ZERO, Vec3::X, Vec3::Y, 1, Material { two_sided: true, spared: true, ..plain() })
    };
    world_of(vec![
        sheet(Vec3::ZERO, x, y, 4, plain()),
        sheet(Vec3::Y * 100.0, x, z, 2, plain()),
        sheet(Vec3::ZERO, y, z, 2, plain()),
        cuboid(Vec3::new(45.0, 55.0, 0.0), Vec3::new(75.0, 85.0, 30.0)),
        sheet(Vec3::new(15.0, 30.0, 18.0), 0.4 * x, 0.35 * y + 0.2 * z, 1, net),
        needle,
    ])
}

/// A ball out of the box, and what is beyond a plane.
pub fn clips() -> Vec<Clip> {
    let ball =
        Pose { translate_mm: Vec3::new(75.0, 55.0, 30.0), scale: Vec3::splat(18.0), ..Pose::default() };
    let plane = Pose {
        translate_mm: Vec3::new(20.0, 0.0, 0.0),
        rotate_deg: Vec3::new(0.0, 80.0, 0.0),
        ..Pose::default()
    };
    vec![
        Clip { pose: ball, ..Clip::remove(Shape::Sphere) },
        Clip { pose: plane, mode: Mode::Keep, shape: Shape::Plane },
    ]
}

/// Both eyes that look into the corner.
pub fn corner_eyes(size: [u32; 2]) -> [View; 2] {
    let rig = StereoRig {
        position: Vec3::new(150.0, -90.0, 110.0),
        target: Vec3::new(45.0, 50.0, 12.0),
        up: Vec3::Z,
        ipd_mm: 12.0,
        fov_deg: 40.0,
        screen_mm: None,
    };
    rig.views(size[0] as f32 / size[1] as f32, 1.0, 1000.0).unwrap()
}

/// A view straight along +y from `place`, of one pixel.
pub fn ahead(place: Vec3) -> View {
    View {
        position: place,
        orientation: Quat::from_rotation_x(std::f32::consts::FRAC_PI_2),
        tan: Tangents { left: -0.01, right: 0.01, up: 0.01, down: -0.01 },
        near_mm: 0.1,
        far_mm: 1e5,
        reversed: false,
    }
}

/// A world on the device and what views show of it.
pub struct Pixels {
    /// The world.
    pub surfaces: Surfaces,
    /// Normals and depths.
    pub geometry: Geometry,
    /// Triangles.
    pub hits: Buffer,
}

impl Pixels {
    /// Drawn.
    pub fn new(gpu: &Gpu, world: &World, views: &[View], size: [u32; 2]) -> Self {
        Self::clipped(gpu, world, &[], views, size)
    }

    /// Drawn, cut by clips.
    pub fn clipped(gpu: &Gpu, world: &World, clips: &[Clip], views: &[View], size: [u32; 2]) -> Self {
        let mut surfaces = Surfaces::new(gpu, world).unwrap();
        surfaces.set_clips(gpu, clips, MapSettings::default()).unwrap();
        let geometry = Geometry::new(gpu, size, views.len()).unwrap();
        let bytes = Gbuffer::HIT * geometry.pixels.bytes() / Geometry::BYTES;
        let hits = gpu.buffer("hits", bytes, BufferUse::Device).unwrap();
        let gbuffer = Gbuffer::new(gpu).unwrap();
        super::run(gpu, |rec| {
            geometry.record_eyes(rec, views).unwrap();
            gbuffer.record(rec, &surfaces, &geometry, &hits).unwrap();
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
        });
        Self { surfaces, geometry, hits }
    }

    /// An f32 a pixel, undefined yet.
    pub fn values(&self, gpu: &Gpu) -> Buffer {
        self.geometry.values(gpu, "accessibility").unwrap()
    }
}

/// What such a buffer holds.
pub fn floats(gpu: &Gpu, buffer: &Buffer) -> Vec<f32> {
    bytemuck::pod_collect_to_vec(&super::read_buffer(gpu, buffer))
}

/// The numbers of all layers of a flat image of floats.
pub fn layers(gpu: &Gpu, image: &Image) -> Vec<f32> {
    let [width, height, _] = image.desc().dims;
    let bytes = u64::from(width) * u64::from(height) * image.desc().format.bytes();
    let count = u64::from(image.desc().layers);
    let back = gpu.buffer("layers read-back", bytes * count, BufferUse::Readback).unwrap();
    super::run(gpu, |rec| {
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
        for layer in 0..count {
            rec.copy_image_to_buffer(image, layer as u32, [0; 3], [width, height, 1], &back, layer * bytes)
                .unwrap();
        }
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    });
    bytemuck::pod_collect_to_vec(&back.read(0, bytes * count).unwrap())
}
