//! Depth layers of a clip mesh (CAO §3.4 step 2, Everitt 2001): depth-only passes from the orthographic clip camera, 32-bit depth,
//! each of which finds the next surface behind every pixel, until there is none.
//!
//! Along the ray of a pixel each face adds 1 to the winding number or takes 1 away, as it faces the clip camera or not.
//! A layer pair begins where the number leaves 0 and ends where it is 0 again, so that the pairs are the solid itself: parts that
//! touch or overlap are one, and it does not matter which way the whole mesh faces.
//!
//! In: a mesh without border. Out: depth maps of `resolution²` f32, rows of y, front and back of each pair in turn.
//! Cost: a rasterization of the mesh for each surface behind one another and one more, once for each mesh, scale and margin.

use crate::Result;
use crate::stages;
use cao_gpu::{
    Access, Attachments, BufferUse, Cull, DepthTest, Flat, Format, Gpu, GraphicsDesc, Image, ImageDesc,
    ImageKind, ImageUse, Pipeline,
};
use cao_kernels::peel as kernel;
use cao_kernels::shared::layers::{EMPTY, ONE_DEPTH};
use cao_model::clip::{Clip, ClipCamera};
use cao_model::mesh::TriangleMesh;
use cao_model::settings::MapSettings;
use glam::Vec3;

/// Most layer pairs of a mesh.
pub const MAX_PAIRS: u32 = MapSettings::MAX_PAIRS;

/// Most surfaces behind one another, of which touching and nested parts have more than the layer pairs show.
pub const MAX_SURFACES: u32 = 128;

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
    pipeline: Pipeline,
}

/// What a pass draws: depths, and which face of the mesh each is.
struct Surface {
    depth: Image,
    face: Image,
}

impl Surface {
    fn new(gpu: &Gpu, edge: u32) -> cao_gpu::Result<Self> {
        let image = |name, format| {
            let usage = ImageUse::SAMPLED | ImageUse::ATTACHMENT;
            gpu.image(
                name,
                &ImageDesc { dims: [edge, edge, 1], layers: 1, format, kind: ImageKind::D2, usage },
            )
        };
        Ok(Self {
            depth: image("clip layer", Format::D32Float)?,
            face: image("clip faces", Format::R32Uint)?,
        })
    }
}

impl Peel {
    /// Builds the pipeline.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = gpu.graphics(
            &kernel::SHADER,
            &GraphicsDesc {
                vertex: "vertex",
                fragment: "fragment",
                colours: &[Format::R32Uint],
                depth: Some(Format::D32Float),
                depth_test: DepthTest::Less,
                depth_write: true,
                cull: Cull::None,
                ..GraphicsDesc::default()
            },
        )?;
        Ok(Self { pipeline })
    }

    /// Draws the layers of a mesh without border, scaled by `scale`. Uses the device's queue and waits for it.
    ///
    /// Errors: more than `max_pairs` pairs at some pixel, more than [`MAX_SURFACES`] surfaces, or a border; each says at how many pixels.
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
        // Depths, then faces.
        let read_back = gpu.buffer("layer read-back", 2 * map_bytes, BufferUse::Readback)?;
        let mut milliseconds = 0.0;
        let mut pairs = Pairs::new((edge * edge) as usize, max_pairs as usize);
        let (mut before, mut now) = (Surface::new(gpu, edge)?, Surface::new(gpu, edge)?);
        for surface in 0.. {
            let params = kernel::PeelParams {
                corner: camera.corner.to_array(),
                per_half: 2.0 / (camera.pixel_mm * edge as f32),
                scale: scale.to_array(),
                per_depth: 1.0 / camera.depth_mm,
                first: u32::from(surface == 0),
                pad: Default::default(),
            };
            let mut rec = gpu.recorder("peel")?;
            if surface == 0 {
                rec.discard(&before.depth);
                rec.discard(&before.face);
            }
            rec.discard(&now.depth);
            rec.discard(&now.face);
            rec.barrier(&[], &[Access::AttachmentWrite, Access::GraphicsRead]);
            rec.stage(stages::PEEL)?;
            rec.draw(
                &self.pipeline,
                &kernel::DrawBindings {
                    vertices: &vertices,
                    before: Flat::Only(&before.depth),
                    face_before: Flat::Only(&before.face),
                },
                bytemuck::bytes_of(&params),
                Attachments {
                    colours: &[(&now.face, Some([0.0; 4]))],
                    depth: Some((&now.depth, Some(EMPTY))),
                    layer: None,
                    at: [0; 2],
                    size: [edge, edge],
                },
                corners.len() as u32,
            )?;
            rec.end_stage()?;
            rec.barrier(&[Access::AttachmentWrite], &[Access::TransferRead]);
            rec.copy_image_to_buffer(&now.depth, 0, [0; 3], [edge, edge, 1], &read_back, 0)?;
            rec.copy_image_to_buffer(&now.face, 0, [0; 3], [edge, edge, 1], &read_back, map_bytes)?;
            rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
            milliseconds += rec.submit_and_wait()?.total();
            let depth: Vec<f32> = bytemuck::pod_collect_to_vec(&read_back.read(0, map_bytes)?);
            let face: Vec<u32> = bytemuck::pod_collect_to_vec(&read_back.read(map_bytes, map_bytes)?);
            let seen = depth.iter().filter(|&&z| z < EMPTY).count();
            if seen == 0 {
                break;
            }
            if surface >= MAX_SURFACES {
                return Err(refuse(
                    mesh,
                    format!(
                        "more than {MAX_SURFACES} surfaces lie behind one another at {seen} of {} pixels of the clip camera; \
                         join its parts into fewer in a mesh editor",
                        depth.len()
                    ),
                ));
            }
            pairs.add(&depth, &face);
            std::mem::swap(&mut before, &mut now);
        }
        let pairs = pairs.finish(mesh, edge)?;
        let count = (pairs.len() / 2) as u32;
        Ok(Layers { camera, pairs: count, depth: pairs.concat(), milliseconds })
    }
}

fn refuse(mesh: &TriangleMesh, problem: String) -> crate::Error {
    cao_model::Error::Mesh { name: mesh.name.clone(), problem }.into()
}

/// The layer pairs of each pixel, from its surfaces in the order of depth.
struct Pairs {
    /// At most that many pairs are kept.
    max: usize,
    /// Winding number behind the last surface.
    winding: Vec<i32>,
    /// Pairs so far, the one that has not ended yet too.
    count: Vec<usize>,
    /// Where the last pair began and ended.
    last: Vec<[f32; 2]>,
    /// Front and back map of each pair that is kept.
    maps: Vec<Vec<f32>>,
}

impl Pairs {
    fn new(pixels: usize, max: usize) -> Self {
        Self {
            max,
            winding: vec![0; pixels],
            count: vec![0; pixels],
            last: vec![[EMPTY; 2]; pixels],
            // A solid so small or thin that it falls between all pixels hides nothing: one pair of empty layers.
            maps: vec![vec![EMPTY; pixels]; 2],
        }
    }

    fn add(&mut self, depth: &[f32], face: &[u32]) {
        for (pixel, (&z, &face)) in depth.iter().zip(face).enumerate() {
            if z >= EMPTY {
                continue;
            }
            let before = self.winding[pixel];
            self.winding[pixel] += if face & 1 == 1 { 1 } else { -1 };
            let (count, last) = (&mut self.count[pixel], &mut self.last[pixel]);
            if before == 0 {
                // A gap of nothing is none: the last pair goes on.
                if *count == 0 || z - last[1] > ONE_DEPTH {
                    *count += 1;
                    *last = [z, z];
                }
            } else if self.winding[pixel] == 0 {
                last[1] = z;
                if z - last[0] <= ONE_DEPTH {
                    // Nor is a pair of nothing one.
                    *count -= 1;
                    last[1] = f32::NEG_INFINITY;
                } else if *count <= self.max {
                    while self.maps.len() < 2 * *count {
                        self.maps.push(vec![EMPTY; depth.len()]);
                    }
                    self.maps[2 * *count - 2][pixel] = last[0];
                    self.maps[2 * *count - 1][pixel] = z;
                }
            }
        }
    }

    /// The maps, or what is wrong and where.
    fn finish(self, mesh: &TriangleMesh, edge: u32) -> Result<Vec<Vec<f32>>> {
        let pixels = self.count.len();
        if let Some(first) = self.winding.iter().position(|&w| w != 0) {
            let count = self.winding.iter().filter(|&&w| w != 0).count();
            return Err(refuse(
                mesh,
                format!(
                    "front and back faces differ in number at {count} of {pixels} pixels of the clip camera, first at ({}, {}): the \
                     mesh is open or wrongly wound there; close it",
                    first as u32 % edge,
                    first as u32 / edge
                ),
            ));
        }
        let most = self.count.iter().copied().max().unwrap_or(0);
        if most > self.max {
            let beyond = self.count.iter().filter(|&&count| count > self.max).count();
            // Turning the clip is no remedy: its camera turns with it. Turning the vertices within their file is one.
            let more = match self.max < MAX_PAIRS as usize {
                true => format!(", or allow up to {MAX_PAIRS} pairs"),
                false => String::new(),
            };
            return Err(refuse(
                mesh,
                format!(
                    "more than {} layer pairs at {beyond} of {pixels} pixels of the clip camera: {most} found; split the mesh into \
                     several clips (up to {}), or turn the mesh's vertices in its file{more}",
                    self.max,
                    Clip::MAX
                ),
            ));
        }
        Ok(self.maps)
    }
}
