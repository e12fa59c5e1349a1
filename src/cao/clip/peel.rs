//! Depth layers of a clip mesh (CAO §3.4 step 2, Everitt 2001): depth-only passes from the orthographic clip camera, 32-bit depth,
//! each of which finds the next surface behind every pixel. What they find becomes layer pairs on the device (`pairs`).
//!
//! How many passes a mesh needs is known when they have run. So a number of them is recorded, those behind a pass that drew nothing
//! draw no fragment, and what was found is read when the device got there ([`verdict`]).
//!
//! In: a mesh without border. Out: depth maps of `resolution²` f32, rows of y, front and back of each pair in turn.
//! Cost: a rasterization of the mesh for each surface behind one another and one more, once for each mesh, shape and margin.

use crate::Result;
use crate::clip::pairs::{Pairs, Place};
use crate::stages;
use cao_gpu::{
    Access, Attachments, Buffer, BufferUse, Cull, DepthTest, Flat, Format, Gpu, GraphicsDesc, Image,
    ImageDesc, ImageKind, ImageUse, Pipeline, Recorder,
};
use cao_kernels::peel as kernel;
use cao_kernels::shared::layers::EMPTY;
use cao_kernels::shared::peeled::Peeled;
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

/// The kernel `peel`, and the one that makes pairs of what it draws.
pub struct Peel {
    pipeline: Pipeline,
    pairs: Pairs,
}

/// What a pass draws: depths, and which face of the mesh each is, twice its number and 1 if it faces the clip camera.
pub struct Surface {
    /// Empty pixels [`EMPTY`].
    pub depth: Image,
    /// As `R32Uint`.
    pub face: Image,
}

/// Working memory: the last two surfaces, and the pairs of each pixel so far.
pub struct Work {
    surfaces: [Surface; 2],
    pixels: Buffer,
}

impl Work {
    /// For maps with so many pixels along an edge.
    pub fn new(gpu: &Gpu, edge: u32) -> cao_gpu::Result<Self> {
        let surfaces = [Surface::new(gpu, edge)?, Surface::new(gpu, edge)?];
        Ok(Self { surfaces, pixels: Pairs::pixels(gpu, edge)? })
    }
}

/// The corners of a mesh's triangles: written by the host, and on the device.
#[derive(Clone)]
pub struct Corners {
    written: Buffer,
    there: Buffer,
    count: u32,
}

impl Corners {
    /// Memory with the corners of this mesh.
    pub fn new(gpu: &Gpu, mesh: &TriangleMesh) -> cao_gpu::Result<Self> {
        let corners: Vec<[f32; 4]> = mesh
            .triangles
            .iter()
            .flatten()
            .map(|&i| mesh.vertices[i as usize].extend(1.0).to_array())
            .collect();
        let bytes: &[u8] = bytemuck::cast_slice(&corners);
        let written = gpu.buffer("clip mesh as written", bytes.len() as u64, BufferUse::Upload)?;
        written.write(0, bytes)?;
        let there = gpu.buffer("clip mesh", bytes.len() as u64, BufferUse::Device)?;
        Ok(Self { written, there, count: corners.len() as u32 })
    }
}

/// A mesh to be peeled.
#[derive(Clone, Copy)]
pub struct Peeling<'a> {
    /// Its corners.
    pub corners: &'a Corners,
    /// What they are scaled by.
    pub scale: Vec3,
    /// From where.
    pub camera: ClipCamera,
    /// How many surfaces are looked for.
    pub passes: u32,
    /// Cells along an edge of its dilation maps.
    pub cells: u32,
    /// What is found, [`Peeled`].
    pub peeled: &'a Buffer,
}

/// Whether the passes were enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// They found all surfaces.
    Complete,
    /// The last one found some, too: so many may do.
    More(u32),
}

/// Passes over a mesh of which nothing is known: one for each surface of one pair more than are kept, so that one too many is seen, and one
/// that finds nothing.
pub fn first_passes(pairs: u32) -> u32 {
    2 * pairs + 3
}

/// What the passes over a mesh found, of which at most `max_pairs` layer pairs are kept.
///
/// Errors: more than `max_pairs` pairs at some pixel, more than [`MAX_SURFACES`] surfaces, or a border; each says at how many pixels.
pub fn verdict(
    found: &Peeled,
    mesh: &TriangleMesh,
    edge: u32,
    max_pairs: u32,
    passes: u32,
) -> Result<Verdict> {
    let pixels = edge * edge;
    let Peeled { surfaces, seen, most, beyond, open, from_first, .. } = *found;
    let problem = if surfaces >= passes && passes <= MAX_SURFACES && most <= max_pairs {
        return Ok(Verdict::More((2 * passes).min(MAX_SURFACES + 1)));
    } else if surfaces >= passes && most <= max_pairs {
        format!(
            "more than {MAX_SURFACES} surfaces lie behind one another at {seen} of {pixels} pixels of the clip camera; \
             join its parts into fewer in a mesh editor"
        )
    } else if surfaces < passes && open > 0 {
        let first = pixels - from_first.min(pixels);
        format!(
            "front and back faces differ in number at {open} of {pixels} pixels of the clip camera, first at ({}, {}): the \
             mesh is open or wrongly wound there; close it",
            first % edge,
            first / edge
        )
    } else if most > max_pairs {
        // Turning the clip is no remedy: its camera turns with it. Turning the vertices within their file is one.
        let more = match max_pairs < MAX_PAIRS {
            true => format!(", or allow up to {MAX_PAIRS} pairs"),
            false => String::new(),
        };
        // A pair that has ended stays one, whatever lies behind it.
        let least = if surfaces < passes { "" } else { "at least " };
        format!(
            "more than {max_pairs} layer pairs at {beyond} of {pixels} pixels of the clip camera: {least}{most} found; split the mesh into \
             several clips (up to {}), or turn the mesh's vertices in its file{more}",
            Clip::MAX
        )
    } else {
        return Ok(Verdict::Complete);
    };
    Err(cao_model::Error::Mesh { name: mesh.name.clone(), problem }.into())
}

impl Surface {
    /// Images of so many pixels along an edge.
    pub fn new(gpu: &Gpu, edge: u32) -> cao_gpu::Result<Self> {
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
        Ok(Self { pipeline, pairs: Pairs::new(gpu)? })
    }

    /// Records the passes over a mesh, and what makes layer pairs of them. Recordings before have to have left the buffers alone; the
    /// barriers in between are its own, and what it wrote is storage.
    pub fn record(&self, rec: &mut Recorder, mesh: &Peeling, to: &Place, work: &Work) -> cao_gpu::Result<()> {
        let Peeling { corners, scale, camera, passes, peeled, .. } = *mesh;
        let edge = camera.resolution;
        for Surface { depth, face } in &work.surfaces {
            rec.discard(depth);
            rec.discard(face);
        }
        rec.copy_buffer(&corners.written, 0, &corners.there, 0, corners.there.bytes())?;
        rec.barrier(&[Access::TransferWrite], &[Access::GraphicsRead]);
        Pairs::record_begin(rec, peeled, mesh.cells)?;
        for surface in 0..passes {
            let (now, before) = (surface as usize % 2, (surface as usize + 1) % 2);
            let (now, before) = (&work.surfaces[now], &work.surfaces[before]);
            let params = kernel::PeelParams {
                corner: camera.corner.to_array(),
                per_half: 2.0 / (camera.pixel_mm * edge as f32),
                scale: scale.to_array(),
                per_depth: 1.0 / camera.depth_mm,
                surface,
                pad: Default::default(),
            };
            rec.barrier(
                &[Access::SampledRead, Access::StorageWrite, Access::GraphicsRead, Access::AttachmentWrite],
                &[Access::GraphicsRead, Access::AttachmentWrite],
            );
            rec.draw(
                &self.pipeline,
                &kernel::DrawBindings {
                    vertices: &corners.there,
                    before: Flat::Only(&before.depth),
                    face_before: Flat::Only(&before.face),
                    peeled,
                },
                bytemuck::bytes_of(&params),
                Attachments {
                    colours: &[(&now.face, Some([0.0; 4]))],
                    depth: Some((&now.depth, Some(EMPTY))),
                    layer: None,
                    at: [0; 2],
                    size: [edge, edge],
                },
                corners.count,
            )?;
            rec.barrier(
                &[Access::AttachmentWrite, Access::GraphicsRead, Access::StorageRead, Access::StorageWrite],
                &[Access::SampledRead, Access::StorageRead, Access::StorageWrite],
            );
            let number = (surface, surface + 1 == passes);
            self.pairs.record_add(rec, to, now, number, &work.pixels, peeled)?;
        }
        self.pairs.record_finish(rec, to, &work.pixels, peeled)
    }

    /// Draws the layers of a mesh without border, scaled by `scale`. Uses the device's queue and waits for it.
    ///
    /// Errors: those of [`verdict`].
    pub fn run(
        &self,
        gpu: &Gpu,
        mesh: &TriangleMesh,
        scale: Vec3,
        camera: ClipCamera,
        max_pairs: u32,
    ) -> Result<Layers> {
        let edge = camera.resolution;
        let layers_len = Pairs::layers_len(edge, max_pairs);
        let bytes = 4 * u64::from(layers_len + Pairs::bounds_len(edge, max_pairs));
        let layers = gpu.buffer("clip layers", bytes, BufferUse::Device)?;
        let (corners, work, peeled) = (Corners::new(gpu, mesh)?, Work::new(gpu, edge)?, Pairs::peeled(gpu)?);
        let to = Place {
            resolution: edge,
            pairs: max_pairs,
            layers: &layers,
            layers_at: 0,
            blocks_at: layers_len,
        };
        let mut passes = first_passes(max_pairs);
        let mut milliseconds = 0.0;
        let found = loop {
            let mut rec = gpu.recorder("peel")?;
            rec.stage(stages::PEEL)?;
            let mesh_to_peel =
                Peeling { corners: &corners, scale, camera, passes, cells: 1, peeled: &peeled };
            self.record(&mut rec, &mesh_to_peel, &to, &work)?;
            rec.end_stage()?;
            milliseconds += rec.submit_and_wait()?.total();
            let found: Peeled = bytemuck::pod_read_unaligned(&crate::host::read_buffer(gpu, &peeled)?);
            match verdict(&found, mesh, edge, max_pairs, passes)? {
                Verdict::Complete => break found,
                Verdict::More(more) => passes = more,
            }
        };
        let mut depth: Vec<f32> = bytemuck::pod_collect_to_vec(&crate::host::read_buffer(gpu, &layers)?);
        depth.truncate(Pairs::layers_len(edge, found.pairs) as usize);
        Ok(Layers { camera, pairs: found.pairs, depth, milliseconds })
    }
}
