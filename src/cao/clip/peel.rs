//! Depth layers of a clip mesh (CAO §3.4 step 2, Everitt 2001): 2·P depth-only passes from the orthographic clip camera,
//! P front and P back layers, 32-bit depth, plus one pass of each facing that finds out whether more would be needed.
//!
//! The k-th front and the k-th back layer make a pair; the union of a closed, outward mesh's pairs is the set of points
//! that it winds around. In: the mesh. Out: depth maps of `resolution²` f32, rows of y, front and back of each pair in turn.
//! Cost: 2·P + 2 rasterizations of the mesh, once for each mesh, scale and margin.

use crate::Result;
use crate::stages;
use cao_gpu::{
    Access, Attachments, BufferUse, Cull, DepthTest, Flat, Format, Gpu, GraphicsDesc, Image, ImageDesc,
    ImageKind, ImageUse, Pipeline,
};
use cao_kernels::peel as kernel;
use cao_kernels::shared::layers::EMPTY;
use cao_model::clip::{Clip, ClipCamera};
use cao_model::mesh::TriangleMesh;
use cao_model::settings::MapSettings;
use glam::Vec3;

/// Most layer pairs of a mesh.
pub const MAX_PAIRS: u32 = MapSettings::MAX_PAIRS;

/// The depth layers of one mesh.
pub struct Layers {
    /// The clip camera they were drawn from.
    pub camera: ClipCamera,
    /// Layer pairs that hold anything, at least 1.
    pub pairs: u32,
    /// `pairs` × (front, back) × resolution² depths, rows of y, x fastest; empty pixels [`EMPTY`].
    pub depth: Vec<f32>,
    /// Time that drawing them took on the device.
    pub milliseconds: f64,
}

/// The kernel `peel`.
pub struct Peel {
    front: Pipeline,
    back: Pipeline,
}

impl Peel {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let facing = |cull| {
            gpu.graphics(
                &kernel::SHADER,
                &GraphicsDesc {
                    vertex: "vertex",
                    fragment: "fragment",
                    colours: &[],
                    depth: Some(Format::D32Float),
                    depth_test: DepthTest::Less,
                    depth_write: true,
                    cull,
                    ..GraphicsDesc::default()
                },
            )
        };
        // The map's y is the image's y, so that Vulkan's counter-clockwise faces are those whose normal points at the
        // clip camera.
        Ok(Self { front: facing(Cull::Back)?, back: facing(Cull::Front)? })
    }

    /// Draws the layers of a mesh that faces outward, scaled by `scale`. Uses the device's queue and waits for it.
    ///
    /// Errors: a pixel whose front and back layers differ in number (the mesh is open or wrongly wound there), or more than
    /// `max_pairs` pairs at some pixel; both say how many pixels and where.
    pub fn run(
        &self,
        gpu: &Gpu,
        mesh: &TriangleMesh,
        scale: Vec3,
        camera: ClipCamera,
        max_pairs: u32,
    ) -> Result<Layers> {
        let corners: Vec<[f32; 4]> = mesh
            .triangles
            .iter()
            .flatten()
            .map(|&i| mesh.vertices[i as usize].extend(1.0).to_array())
            .collect();
        let bytes: &[u8] = bytemuck::cast_slice(&corners);
        let vertices = gpu.buffer("clip mesh", bytes.len() as u64, BufferUse::Upload)?;
        vertices.write(0, bytes)?;

        let edge = camera.resolution;
        let map_bytes = u64::from(edge) * u64::from(edge) * 4;
        let read_back = gpu.buffer("layer read-back", map_bytes, BufferUse::Readback)?;
        let mut milliseconds = 0.0;
        let mut maps: [Vec<Vec<f32>>; 2] = [Vec::new(), Vec::new()];
        for (pipeline, maps) in [&self.front, &self.back].into_iter().zip(&mut maps) {
            let mut before = depth_image(gpu, edge)?;
            let mut now = depth_image(gpu, edge)?;
            for layer in 0..=max_pairs {
                let params = kernel::PeelParams {
                    corner: camera.corner.to_array(),
                    per_half: 2.0 / (camera.pixel_mm * edge as f32),
                    scale: scale.to_array(),
                    per_depth: 1.0 / camera.depth_mm,
                    first: u32::from(layer == 0),
                    pad: Default::default(),
                };
                let mut rec = gpu.recorder("peel")?;
                if layer == 0 {
                    rec.discard(&before);
                }
                rec.discard(&now);
                rec.barrier(&[], &[Access::AttachmentWrite, Access::GraphicsRead]);
                rec.stage(stages::PEEL)?;
                rec.draw(
                    pipeline,
                    &kernel::DrawBindings { vertices: &vertices, before: Flat::Only(&before) },
                    bytemuck::bytes_of(&params),
                    Attachments {
                        colours: &[],
                        depth: Some((&now, Some(EMPTY))),
                        layer: None,
                        size: [edge, edge],
                    },
                    corners.len() as u32,
                )?;
                rec.end_stage()?;
                rec.barrier(&[Access::AttachmentWrite], &[Access::TransferRead]);
                rec.copy_image_to_buffer(&now, 0, [0; 3], [edge, edge, 1], &read_back, 0)?;
                rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
                milliseconds += rec.submit_and_wait()?.total();
                let map: Vec<f32> = bytemuck::pod_collect_to_vec(&read_back.read(0, map_bytes)?);
                if map.iter().all(|&z| z >= EMPTY) {
                    break;
                }
                maps.push(map);
                std::mem::swap(&mut before, &mut now);
            }
        }
        let pairs = check(mesh, &maps, edge, max_pairs)?;

        let empty = vec![EMPTY; (edge * edge) as usize];
        let layer = |side: usize, pair: usize| maps[side].get(pair).unwrap_or(&empty);
        let depth = (0..pairs as usize)
            .flat_map(|pair| [layer(0, pair), layer(1, pair)])
            .flatten()
            .copied()
            .collect();
        Ok(Layers { camera, pairs, depth, milliseconds })
    }
}

fn depth_image(gpu: &Gpu, edge: u32) -> cao_gpu::Result<Image> {
    gpu.image(
        "clip layer",
        &ImageDesc {
            dims: [edge, edge, 1],
            layers: 1,
            format: Format::D32Float,
            kind: ImageKind::D2,
            usage: ImageUse::SAMPLED | ImageUse::ATTACHMENT,
        },
    )
}

/// Number of pairs, or what is wrong and where.
fn check(
    mesh: &TriangleMesh,
    [fronts, backs]: &[Vec<Vec<f32>>; 2],
    edge: u32,
    max_pairs: u32,
) -> Result<u32> {
    let refuse = |problem| Err(cao_model::Error::Mesh { name: mesh.name.clone(), problem }.into());
    let found = fronts.len().max(backs.len());
    if found > max_pairs as usize {
        let beyond = |maps: &[Vec<f32>]| {
            maps.get(max_pairs as usize).map_or(0, |map| map.iter().filter(|&&z| z < EMPTY).count())
        };
        // Turning the clip is no remedy: its camera turns with it. Turning the vertices within their file is one.
        let more = match max_pairs < MAX_PAIRS {
            true => format!(", or allow up to {MAX_PAIRS} pairs"),
            false => String::new(),
        };
        return refuse(format!(
            "more than {max_pairs} layer pairs at {} of {} pixels of the clip camera: at least {} found; split the mesh into \
             several clips (up to {}), or turn the mesh's vertices in its file{more}",
            beyond(fronts).max(beyond(backs)),
            edge * edge,
            max_pairs + 1,
            Clip::MAX
        ));
    }
    let at = |maps: &[Vec<f32>], layer: usize, pixel: usize| maps.get(layer).map_or(EMPTY, |map| map[pixel]);
    let mut odd = (0..(edge * edge) as usize)
        .filter(|&pixel| (0..found).any(|k| (at(fronts, k, pixel) < EMPTY) != (at(backs, k, pixel) < EMPTY)));
    if let Some(first) = odd.next() {
        return refuse(format!(
            "front and back layers differ in number at {} of {} pixels of the clip camera, first at ({}, {}): the mesh is open or \
             wrongly wound there; close it or orient its faces outward",
            1 + odd.count(),
            edge * edge,
            first as u32 % edge,
            first as u32 / edge
        ));
    }
    // A solid so small or thin that it falls between all pixels hides nothing: one pair of empty layers.
    Ok(found.max(1) as u32)
}
