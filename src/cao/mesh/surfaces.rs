//! A world on the device (`spirv/shared/world.wgsl`): its triangles in a tree, what they look like, their textures.
//!
//! 48 bytes a triangle for its corners, 36 for its look, some 24 for the tree; 4 a texel.

use crate::clip::clips::ClipSet;
use crate::clip::dilate::Dilate;
use crate::clip::peel::Peel;
use crate::host::device_buffer;
use crate::mesh::shares::Shares;
use crate::{Error, Result};
use bytemuck::Zeroable;
use cao_gpu::{AccelerationStructure, Access, Buffer, Corners, Gpu, Pipeline, Shader};
use cao_kernels::gather::CLAMP;
use cao_kernels::gbuffer as kernel;
use cao_model::bvh::{Bounds, Bvh, Node};
use cao_model::clip::Clip;
use cao_model::mesh::bounds_of;
use cao_model::settings::MapSettings;
use cao_model::surface::{Triangle, World};
use glam::Vec3;
use std::mem::offset_of;
use std::sync::OnceLock;

/// A world's triangles on the device.
pub struct Surfaces {
    /// Bound as `tree`: over the boxes of triangles.
    pub tree: Buffer,
    /// Bound as `triangles`.
    pub triangles: Buffer,
    /// Bound as `looks`.
    pub looks: Buffer,
    /// Bound as `materials`.
    pub materials: Buffer,
    /// Bound as `texels`.
    pub texels: Buffer,
    /// Bound as `shares`: what clips and masks leave of each triangle.
    pub shares: Buffer,
    /// The clips.
    pub clips: ClipSet,
    /// The triangles as they lie there,
    pub ordered: Vec<Triangle>,
    /// and whether their backs are surfaces too.
    pub two_sided: Vec<bool>,
    /// Whether any mesh shows caps where it is cut.
    capped: bool,
    nodes: Vec<Node>,
    share_out: Shares,
    /// Some triangles have masks.
    masked: bool,
    /// There are clips.
    clipped: bool,
    /// Half the diagonal of a box about the origin that holds them all.
    half_mm: f32,
}

/// The boxes of what triangles may occlude, in the tree of the triangles.
pub struct VolumeTree {
    /// Bound as `tree`.
    pub tree: Buffer,
    /// Whether they end where their corners are clamped.
    pub clamped: bool,
}

impl Surfaces {
    /// Brings a world to the device. Uses its queue and waits for it.
    ///
    /// # Errors
    /// A world without triangles; a device without memory.
    pub fn new(gpu: &Gpu, world: &World) -> Result<Self> {
        if world.triangles.is_empty() {
            return Err(Error::refused("meshes", "there are none; give at least one"));
        }
        let boxes: Vec<Bounds> = world.triangles.iter().map(|t| bounds_of(t.corners)).collect();
        let bvh = Bvh::new(&boxes);
        let ordered: Vec<Triangle> = bvh.order.iter().map(|item| world.triangles[*item as usize]).collect();
        let two_sided: Vec<bool> =
            ordered.iter().map(|t| world.materials[t.material as usize].two_sided).collect();
        let mut texels: Vec<u8> = Vec::new();
        let mut materials = Vec::new();
        for (material, body) in world.materials.iter().zip(&world.instance_of) {
            let mut on_device = kernel::SurfaceMaterial {
                colour: glam::Vec3::from(material.colour).extend(material.alpha).to_array(),
                cutoff: material.cutoff.unwrap_or_default(),
                cap: material.cap.unwrap_or_default(),
                body: *body,
                ..kernel::SurfaceMaterial::zeroed()
            };
            if let Some(texture) = &material.texture {
                on_device.texture_at = (texels.len() / 4) as u32;
                [on_device.width, on_device.height] = texture.size;
                texels.extend(texture.texels.as_flattened());
            }
            materials.push(on_device);
        }
        texels.resize(texels.len().max(4), 0);
        if materials.is_empty() {
            return Err(Error::refused("meshes", "have no materials"));
        }
        let triangles: Vec<_> = ordered.iter().map(|t| on_device(t, world)).collect();
        let looks: Vec<_> = ordered.iter().map(look_of).collect();
        let (low, high) = world.bounds();
        let half_mm = low.abs().max(high.abs()).length();
        let clips = ClipSet::new(gpu)?;
        let mut rec = gpu.recorder("no clips")?;
        clips.record(&mut rec, &[], half_mm)?;
        rec.submit_and_wait()?;
        let whole: Vec<f32> = ordered.iter().map(|triangle| triangle.opacity).collect();
        Ok(Self {
            shares: device_buffer(gpu, "shares", bytemuck::cast_slice(&whole))?,
            clips,
            half_mm,
            capped: world.materials.iter().any(|material| material.cap.is_some()),
            share_out: Shares::new(gpu)?,
            masked: ordered.iter().any(|t| world.materials[t.material as usize].cutoff.is_some()),
            clipped: false,
            tree: device_buffer(gpu, "tree", bytemuck::cast_slice(&packed(&bvh.nodes)))?,
            triangles: device_buffer(gpu, "triangles", bytemuck::cast_slice(&triangles))?,
            looks: device_buffer(gpu, "looks", bytemuck::cast_slice(&looks))?,
            materials: device_buffer(gpu, "materials", bytemuck::cast_slice(&materials))?,
            texels: device_buffer(gpu, "texels", &texels)?,
            ordered,
            two_sided,
            nodes: bvh.nodes,
        })
    }

    /// Cuts them by other clips, with maps of meshes as `settings` say. Uses the device's queue and waits for it; of the maps and shares of before nothing
    /// may be in use.
    ///
    /// # Errors
    /// More than [`Clip::MAX`], impossible poses, meshes that bound no solid: then the clips before stay.
    pub fn set_clips(&mut self, gpu: &Gpu, clips: &[Clip], settings: MapSettings) -> Result<()> {
        let mut planned = self.clips.planned(gpu, clips, None, self.half_mm, settings)?;
        if planned.has_todo() {
            planned.make(gpu, &Peel::new(gpu)?, &Dilate::new(gpu)?)?;
        }
        let mut rec = gpu.recorder("clips of meshes")?;
        planned.record(&mut rec, clips, self.half_mm)?;
        rec.barrier(&[Access::StorageRead], &[Access::StorageWrite]);
        self.share_out.record(&mut rec, &self.triangles, &planned, &self.shares)?;
        rec.submit_and_wait()?;
        self.clips = planned;
        self.clipped = !clips.is_empty();
        Ok(())
    }

    /// Neither masks nor clips take anything of the triangles.
    pub fn whole(&self) -> bool {
        !self.masked && !self.clipped
    }

    /// The triangles for ray queries, in their order; whatever the clips are. Uses the device's queue and waits for it.
    ///
    /// # Errors
    /// A device without ray queries, or without memory.
    pub fn structure(&self, gpu: &Gpu) -> Result<AccelerationStructure> {
        let corners = Corners {
            buffer: &self.triangles,
            stride: offset_of!(kernel::WorldTriangle, b) as u64,
            triangles: self.ordered.len() as u32,
        };
        Ok(gpu.acceleration_structure("world", corners)?)
    }

    /// Whether rays have to look for caps: clips cut meshes that ask for them.
    pub fn caps(&self) -> bool {
        self.capped && self.clipped
    }

    /// The tree of what each triangle may occlude within `delta_mm`; with corners `clamped` as printed. Uses the device's queue and waits for it.
    ///
    /// # Errors
    /// A reach that is no length; a device without memory.
    pub fn volumes(&self, gpu: &Gpu, delta_mm: f32, clamped: bool) -> Result<VolumeTree> {
        if !(delta_mm.is_finite() && delta_mm > 0.0) {
            return Err(Error::refused("delta_mm", format!("{delta_mm}; expected a length > 0 mm")));
        }
        let boxes: Vec<Bounds> = self
            .ordered
            .iter()
            .zip(&self.two_sided)
            .map(|(triangle, two_sided)| volume_box(triangle.corners, delta_mm, *two_sided, clamped))
            .collect();
        // The tree names items by the order of the world; here they lie in the order of its leaves.
        let in_place = Bvh { nodes: self.nodes.clone(), order: (0..boxes.len() as u32).collect() };
        let nodes = in_place.refit(&boxes);
        let tree = device_buffer(gpu, "tree of volumes", bytemuck::cast_slice(&packed(&nodes)))?;
        Ok(VolumeTree { tree, clamped })
    }
}

/// A kernel with an entry point `capped` for worlds with [caps](Surfaces::caps) beside `main`: most do without, and it is built when it is needed.
pub struct ByCaps {
    gpu: Gpu,
    shader: &'static Shader,
    plain: Pipeline,
    capped: OnceLock<Pipeline>,
}

impl ByCaps {
    /// Builds the pipeline for worlds without caps.
    pub fn new(gpu: &Gpu, shader: &'static Shader) -> Result<Self> {
        let plain = gpu.compute(shader, "main")?;
        Ok(Self { gpu: gpu.clone(), shader, plain, capped: OnceLock::new() })
    }

    /// That of a world.
    pub fn of(&self, surfaces: &Surfaces) -> Result<&Pipeline> {
        if !surfaces.caps() {
            return Ok(&self.plain);
        }
        if let Some(pipeline) = self.capped.get() {
            return Ok(pipeline);
        }
        let built = self.gpu.compute(self.shader, "capped")?;
        Ok(self.capped.get_or_init(|| built))
    }
}

/// Corners that stick out of a volume farther than this, in deltas, make it a sliver's, unless they are clamped (AOV §5.2: at 2, which cuts
/// volumes where falloff is above 0: a corner of 60° already asks for 2).
const MOST_MITRE: f32 = 4.0;

/// The inward normals of a triangle's edges, from each corner to the next (AOV eq. 22), and the normal of its face.
fn edges([a, b, c]: [Vec3; 3]) -> ([Vec3; 3], Vec3) {
    let face = (b - a).cross(c - a).normalize_or_zero();
    ([(a, b), (b, c), (c, a)].map(|(from, to)| face.cross(to - from).normalize_or_zero()), face)
}

/// Whether a volume is cut by its triangle's box: some corner is so sharp that δ on both edges is far away (eq. 28).
pub fn is_sliver(corners: [Vec3; 3]) -> bool {
    let (inward, _) = edges(corners);
    // The sine of half a corner's angle, squared.
    let sharp = |i: usize| 0.5 * (1.0 + inward[i].dot(inward[(i + 2) % 3]));
    (0..3).any(|i| sharp(i) < 1.0 / (MOST_MITRE * MOST_MITRE))
}

/// The corner of a clamped volume that is `corner`'s, between the one `before` and the `next`: at most [`CLAMP`] deltas from it.
fn clamped_corner([before, corner, next]: [Vec3; 3], face: Vec3, delta: f32) -> Vec3 {
    let (along_next, along_before) =
        ((next - corner).normalize_or_zero(), (corner - before).normalize_or_zero());
    let inward = face.cross(along_next) + face.cross(along_before);
    // Twice the sine of half the corner's angle.
    let away = (2.0 / inward.length()).min(CLAMP);
    corner - (inward + along_next - along_before).normalize_or_zero() * (away * delta)
}

/// The box of a triangle's occlusion volume: its prism (eq. 23 to 29), whose corners may be `clamped`; or of a sliver that of its box in its plane.
pub fn volume_box(corners: [Vec3; 3], delta: f32, two_sided: bool, clamped: bool) -> Bounds {
    let (inward, face) = edges(corners);
    let mut base = Vec::with_capacity(4);
    if clamped {
        let [a, b, c] = corners;
        base.extend([[c, a, b], [a, b, c], [b, c, a]].map(|around| clamped_corner(around, face, delta)));
    } else if is_sliver(corners) {
        let [a, b, c] = corners;
        let along = [b - a, c - b, a - c].into_iter().fold(Vec3::ZERO, |longest, edge| {
            if edge.length_squared() > longest.length_squared() { edge } else { longest }
        });
        let along = along.normalize_or_zero();
        let across = face.cross(along);
        let (low, high) = bounds_of(corners.map(|p| Vec3::new((p - a).dot(along), (p - a).dot(across), 0.0)));
        for (x, y) in [(low.x, low.y), (high.x, low.y), (high.x, high.y), (low.x, high.y)] {
            let grown = |at: f32, low: f32| if at == low { at - delta } else { at + delta };
            base.push(a + along * grown(x, low.x) + across * grown(y, low.y));
        }
    } else {
        for (i, corner) in corners.into_iter().enumerate() {
            let (next, before) = (inward[i], inward[(i + 2) % 3]);
            base.push(corner - (next + before) * (delta / (1.0 + next.dot(before))));
        }
    }
    let under = if two_sided { -delta } else { 0.0 };
    let (low, high) = bounds_of(base.iter().flat_map(|p| [*p + face * under, *p + face * delta]));
    // What the kernel's arithmetic may differ by.
    let margin = 1e-5 * (low.abs().max(high.abs()) + delta);
    (low - margin, high + margin)
}

fn on_device(triangle: &Triangle, world: &World) -> kernel::WorldTriangle {
    let material = &world.materials[triangle.material as usize];
    let mut kind = 0;
    if material.cutoff.is_some() {
        kind |= kernel::MASKED;
    }
    if material.two_sided {
        kind |= kernel::TWO_SIDED;
    }
    if material.spared {
        kind |= kernel::SPARED;
    }
    if material.cap.is_some() {
        kind |= kernel::CAPPED;
    }
    if is_sliver(triangle.corners) {
        kind |= kernel::SLIVER;
    }
    let with = |corner: usize, w: f32| triangle.corners[corner].extend(w).to_array();
    kernel::WorldTriangle {
        a: with(0, triangle.opacity),
        b: with(1, triangle.material as f32),
        c: with(2, kind as f32),
    }
}

fn look_of(triangle: &Triangle) -> kernel::Look {
    let [uv_a, uv_b, uv_c] = triangle.uvs.map(|uv| uv.to_array());
    let [normal_a, normal_b, normal_c] = triangle.normals.map(octahedron);
    kernel::Look { uv_a, uv_b, uv_c, normal_a, normal_b, normal_c, pad: Default::default() }
}

/// A unit vector in two 16-bit numbers (Meyer 2010).
fn octahedron(normal: Vec3) -> u32 {
    let n = normal / (normal.x.abs() + normal.y.abs() + normal.z.abs());
    let fold = |this: f32, other: f32| {
        let side = if this >= 0.0 { 1.0 } else { -1.0 };
        if n.z < 0.0 { (1.0 - other.abs()) * side } else { this }
    };
    let part = |at: f32| (at.clamp(-1.0, 1.0) * 32767.0).round() as i16 as u16;
    u32::from(part(fold(n.x, n.y))) | u32::from(part(fold(n.y, n.x))) << 16
}

fn packed(nodes: &[Node]) -> Vec<kernel::TreeNode> {
    let pack = |node: &Node| kernel::TreeNode {
        low: node.low.to_array(),
        skip: node.skip,
        high: node.high.to_array(),
        leaf: node.first * 8 + node.count,
    };
    nodes.iter().map(pack).collect()
}
