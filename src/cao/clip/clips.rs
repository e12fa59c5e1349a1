//! The clips on the device (`spirv/shared/clips.wgsl`): shapes at their poses, and for meshes their depth layers and dilation
//! maps (CAO §3.2–§3.4).
//!
//! The clip camera moves rigidly with a mesh, so its layers are drawn once and serve every translation and rotation, and every scale of the
//! same shape: they are those of the mesh with its x axis as long as in its file, and the camera grows with it. Another ratio of the axes, or
//! another mesh, draws them again; another radius or scale makes other dilation maps, for methods that have them.

use crate::clip::dilate::Dilate;
use crate::clip::peel::{Layers, Peel};
use crate::stages;
use crate::{Error, Result};
use bytemuck::Zeroable;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Recorder, Timings};
use cao_kernels::shared::clip_bits::MOST_CLIPS;
use cao_kernels::shared::clips::{self as kinds, Clips};
use cao_kernels::shared::layers::{self, NO_BACK, NO_FRONT};
use cao_model::clip::{Clip, ClipCamera, Mode, Shape};
use cao_model::mesh::TriangleMesh;
use cao_model::settings::MapSettings;
use glam::Vec3;
use std::sync::Arc;

const _: () = assert!(MOST_CLIPS as usize == Clip::MAX);

/// Where one mesh clip's maps are in the shared buffers.
#[derive(Clone, Copy, Debug)]
pub struct MeshClip {
    /// The clip camera.
    pub camera: ClipCamera,
    /// Layer pairs.
    pub pairs: u32,
    /// The camera of the dilation maps.
    pub cells: ClipCamera,
    /// First f32 of the layers.
    pub layers_at: u32,
    /// First f32 of the dilation maps.
    pub dilation_at: u32,
    /// First f32 of the bounds of blocks of the layers, behind all layers.
    pub blocks_at: u32,
    /// The outside is hidden.
    pub keep: bool,
    /// See [`MapSettings::literal`].
    pub literal: bool,
}

/// The layers of a mesh at one ratio of its axes and one margin.
struct Peeled {
    mesh: Arc<TriangleMesh>,
    shape: Vec3,
    margin: f32,
    settings: MapSettings,
    layers: Layers,
}

/// A mesh as a clip shows it.
struct Wanted<'a> {
    mesh: &'a Arc<TriangleMesh>,
    /// What its vertices are scaled by for the layers, and how much larger than there it stands.
    shape: Vec3,
    larger: f32,
    /// The outside is hidden.
    keep: bool,
    /// Radius of the dilation.
    radius: Option<f32>,
}

/// Mesh, scale, side and radius of each mesh that dilation maps were made for.
type MadeFor = Vec<(Vec3, f32, bool, Option<f32>)>;

/// The clips of a scene in device memory.
pub struct ClipSet {
    /// Bound as `clips`.
    pub clips: Buffer,
    /// Bound as `layers`.
    pub layers: Buffer,
    /// Bound as `dilation`.
    pub dilation: Buffer,
    peeled: Vec<Peeled>,
    meshes: Vec<MeshClip>,
    made_for: MadeFor,
}

impl ClipSet {
    /// No clips.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            clips: gpu.buffer("clips", size_of::<Clips>() as u64, BufferUse::Device)?,
            layers: gpu.buffer("clip layers", 16, BufferUse::Device)?,
            dilation: gpu.buffer("dilation maps", 16, BufferUse::Device)?,
            peeled: Vec::new(),
            meshes: Vec::new(),
            made_for: Vec::new(),
        })
    }

    /// Draws the layers and dilation maps that these clips need and that are not there yet; does nothing when only poses changed that
    /// need no others. `radius` in mm is the reach of a change (ray length, footprint and sample cell), `None` where no dilation maps are
    /// needed, `half_mm` half the volume's diagonal.
    /// Uses the device's queue and waits for it when there is something to draw; returns the times of the stages.
    #[expect(clippy::too_many_arguments, reason = "kernels, clips and settings, each named once")]
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        peel: &Peel,
        dilate: &Dilate,
        clips: &[Clip],
        radius: Option<f32>,
        half_mm: f32,
        settings: MapSettings,
    ) -> Result<Timings> {
        check(clips, half_mm)?;
        settings.check()?;
        let wanted: Vec<_> =
            clips.iter().filter_map(|clip| Wanted::of(clip, radius, half_mm, settings)).collect();
        let key: MadeFor =
            wanted.iter().map(|want| (want.shape, want.larger, want.keep, want.radius)).collect();
        // Only the literal recipe's layers leave room for the dilation.
        let margin = if settings.literal { radius.unwrap_or(0.0) } else { 0.0 };
        let same_layers = |have: &Peeled, want: &Wanted| {
            Arc::ptr_eq(&have.mesh, want.mesh)
                && have.shape == want.shape
                && have.margin == margin
                && have.settings == settings
        };
        let drawn = self.meshes.len() == wanted.len()
            && self.peeled.len() == wanted.len()
            && self.peeled.iter().zip(&wanted).all(|(have, want)| same_layers(have, want));
        if drawn && key == self.made_for {
            return Ok(Timings::new());
        }
        // Nothing is there until all of it is, whatever fails on the way.
        self.made_for.clear();
        self.meshes.clear();

        let mut timings = Timings::new();
        if !drawn {
            let mut peeled = Vec::new();
            for want in &wanted {
                let found = self.peeled.iter().position(|have| same_layers(have, want));
                peeled.push(match found {
                    Some(index) => self.peeled.swap_remove(index),
                    None => {
                        let (mesh, shape) = (want.mesh, want.shape);
                        // Layer pairs have their meaning only where there is an inside.
                        mesh.check_solid()?;
                        let camera = ClipCamera::around(mesh, shape, margin, settings.resolution);
                        let layers = peel.run(gpu, mesh, shape, camera, settings.pairs)?;
                        timings.push(stages::PEEL, layers.milliseconds);
                        Peeled { mesh: mesh.clone(), shape, margin, settings, layers }
                    }
                });
            }
            self.peeled = peeled;
        }
        let mut meshes: Vec<MeshClip> = Vec::new();
        let (mut layers_at, mut dilation_at) = (0, 0);
        for (have, want) in self.peeled.iter().zip(&wanted) {
            let (pairs, camera) = (have.layers.pairs, have.layers.camera.larger(want.larger));
            meshes.push(MeshClip {
                camera,
                pairs,
                cells: match want.radius {
                    Some(radius) if !settings.literal => camera.widened(radius, settings.cells),
                    Some(_) => camera,
                    None => ClipCamera { resolution: 0, ..camera },
                },
                layers_at,
                dilation_at,
                blocks_at: 0,
                keep: want.keep,
                literal: settings.literal,
            });
            layers_at += 2 * pairs * settings.resolution * settings.resolution;
            dilation_at += 2 * pairs * settings.cells * settings.cells;
        }
        // Bounds of blocks are behind all layers.
        let edge = settings.resolution.div_ceil(layers::BLOCK);
        for mesh in &mut meshes {
            mesh.blocks_at = layers_at;
            layers_at += mesh.pairs * layers::BLOCK_BOUNDS * edge * edge;
        }
        if !drawn && !meshes.is_empty() {
            let depths = || self.peeled.iter().map(|have| &have.layers.depth);
            let mut all: Vec<f32> = depths().flatten().copied().collect();
            all.extend(depths().flat_map(|depth| block_bounds(depth, settings.resolution as usize)));
            self.layers = crate::host::device_buffer(gpu, "clip layers", bytemuck::cast_slice(&all))?;
        }
        if radius.is_some() && !meshes.is_empty() {
            timings.extend(self.dilate(gpu, dilate, &meshes, &wanted, dilation_at, settings)?);
        }
        self.meshes = meshes;
        self.made_for = key;
        Ok(timings)
    }

    /// Makes the dilation maps, of so many f32.
    fn dilate(
        &mut self,
        gpu: &Gpu,
        dilate: &Dilate,
        meshes: &[MeshClip],
        wanted: &[Wanted],
        room: u32,
        settings: MapSettings,
    ) -> Result<Timings> {
        self.dilation = gpu.buffer("dilation maps", 4 * u64::from(room), BufferUse::Device)?;
        let most = meshes.iter().map(|mesh| mesh.pairs).max().unwrap_or(1);
        let blocks = Dilate::blocks(gpu, settings.cells, most)?;
        let mut rec = gpu.recorder("dilate")?;
        for (mesh, want) in meshes.iter().zip(wanted) {
            let Some(radius) = want.radius else { continue };
            rec.barrier(
                &[Access::StorageRead, Access::StorageWrite],
                &[Access::StorageRead, Access::StorageWrite],
            );
            rec.stage(stages::DILATE)?;
            dilate.record(&mut rec, mesh, radius, &self.layers, &blocks, &self.dilation)?;
            rec.end_stage()?;
        }
        Ok(rec.submit_and_wait()?)
    }

    /// Whether the maps of all meshes among these clips are there.
    pub(crate) fn fits(&self, clips: &[Clip]) -> bool {
        self.meshes.len() == clips.iter().filter(|clip| matches!(clip.shape, Shape::Mesh(_))).count()
    }

    /// Writes the clips at their poses and makes them visible to all shaders. Meshes must have been prepared.
    pub fn record(&self, rec: &mut Recorder, clips: &[Clip], half_mm: f32) -> Result<()> {
        check(clips, half_mm)?;
        let mut data = Clips::zeroed();
        data.count = clips.len() as u32;
        let mut meshes = self.meshes.iter();
        for (slot, clip) in data.clip.iter_mut().zip(clips) {
            let rows = clip.pose.rotation().transpose();
            let moved = -(rows * clip.pose.translate_mm);
            slot.to_rigid = std::array::from_fn(|i| rows.row(i).extend(moved[i]).to_array());
            // That of a half-space says nothing.
            let scale = if matches!(clip.shape, Shape::Plane) { Vec3::ONE } else { clip.pose.scale };
            slot.scale = scale.extend(scale.min_element()).to_array();
            slot.keep = u32::from(clip.mode == Mode::Keep);
            slot.cells[3] = clip.rounding_mm(half_mm, 0.0);
            slot.kind = match &clip.shape {
                Shape::Plane => kinds::PLANE,
                Shape::Box => kinds::BOX,
                Shape::Sphere => kinds::SPHERE,
                Shape::Cylinder => kinds::CYLINDER,
                Shape::Cone => kinds::CONE,
                Shape::Torus => kinds::TORUS,
                Shape::Mesh(mesh) => {
                    let map = meshes.next().ok_or_else(|| {
                        Error::refused(
                            &format!("clip {}", mesh.name),
                            "its depth layers could not be made; call set_clips again",
                        )
                    })?;
                    slot.corner = map.camera.corner.extend(1.0 / map.camera.pixel_mm).to_array();
                    slot.pairs = map.pairs;
                    slot.layers_at = map.layers_at;
                    slot.resolution = map.camera.resolution;
                    slot.dilation_at = map.dilation_at;
                    slot.blocks_at = map.blocks_at;
                    slot.dilation_resolution = map.cells.resolution;
                    let corner = map.cells.corner;
                    slot.cells[..3].copy_from_slice(&[corner.x, corner.y, 1.0 / map.cells.pixel_mm]);
                    slot.per_depth = 1.0 / map.camera.depth_mm;
                    kinds::MESH
                }
            };
        }
        rec.barrier(&[Access::StorageRead, Access::GraphicsRead], &[Access::TransferWrite]);
        rec.update(&self.clips, 0, bytemuck::bytes_of(&data))?;
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::GraphicsRead]);
        Ok(())
    }
}

impl<'a> Wanted<'a> {
    /// What a mesh clip needs; `None` of other clips.
    fn of(clip: &'a Clip, radius: Option<f32>, half_mm: f32, settings: MapSettings) -> Option<Self> {
        let Shape::Mesh(mesh) = &clip.shape else { return None };
        let scale = clip.pose.scale;
        // The literal recipe's room is in mm.
        let larger = if settings.literal { 1.0 } else { scale.x };
        let rounding = |radius| if settings.literal { 0.0 } else { clip.rounding_mm(half_mm, radius) };
        Some(Self {
            mesh,
            shape: scale / larger,
            larger,
            keep: clip.mode == Mode::Keep,
            radius: radius.map(|radius| radius + rounding(radius)),
        })
    }
}

/// Edge in pixels of the blocks of depth layers that `clip_bricks` looks at instead of pixels.
const BLOCK: usize = layers::BLOCK as usize;

/// Of layers as [`Layers::depth`] has them, for each pair: nearest front, farthest back, farthest front and nearest back
/// of each block of pixels, rows of y. A pixel with nothing inside counts as [`NO_FRONT`] and [`NO_BACK`], behind and before
/// everything.
fn block_bounds(depth: &[f32], resolution: usize) -> Vec<f32> {
    let edge = resolution.div_ceil(BLOCK);
    let mut bounds = Vec::new();
    for pair in depth.chunks_exact(2 * resolution * resolution) {
        let (front, back) = pair.split_at(resolution * resolution);
        let mut pair = [(); layers::BLOCK_BOUNDS as usize].map(|()| Vec::with_capacity(edge * edge));
        for block in 0..edge * edge {
            let range = |at: usize| at * BLOCK..((at + 1) * BLOCK).min(resolution);
            let mut b = [NO_FRONT, NO_BACK, NO_BACK, NO_FRONT];
            for pixel in
                range(block / edge).flat_map(|y| range(block % edge).map(move |x| y * resolution + x))
            {
                let (f, k) = match (front[pixel], back[pixel]) {
                    (f, k) if f < k => (f, k),
                    _ => (NO_FRONT, NO_BACK),
                };
                b = [b[0].min(f), b[1].max(k), b[2].max(f), b[3].min(k)];
            }
            pair.iter_mut().zip(b).for_each(|(list, bound)| list.push(bound));
        }
        bounds.extend(pair.into_iter().flatten());
    }
    bounds
}

fn check(clips: &[Clip], half_mm: f32) -> cao_model::Result<()> {
    if clips.len() > Clip::MAX {
        return Err(cao_model::Error::Limit {
            what: "clips".into(),
            needed: clips.len() as u64,
            limit: Clip::MAX as u64,
            hint: "join meshes into one file, or leave some out".into(),
        });
    }
    clips.iter().try_for_each(|clip| clip.check(half_mm))
}
