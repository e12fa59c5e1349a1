//! The clips on the device (`spirv/shared/clips.wgsl`): shapes at their poses, and for meshes their depth layers and dilation
//! maps (CAO §3.2–§3.4).
//!
//! The clip camera moves rigidly with a mesh, so its layers are drawn once and serve every translation and rotation, and every scale of the
//! same shape: they are those of the mesh with its x axis as long as in its file, and the camera grows with it. Another ratio of the axes, or
//! another mesh, draws them again; another radius or scale makes other dilation maps, for methods that have them.
//!
//! [`ClipSet::planned`] checks clips and takes memory, [`ClipSet::record_maps`] records what is to be drawn, and [`ClipSet::heard`] says what
//! was found when that has run. Nothing waits: how many layer pairs a mesh has only the device knows, which writes it into `clips`.

use crate::clip::dilate::Dilate;
use crate::clip::pairs::{Pairs, Place};
use crate::clip::peel::{Corners, Peel, Peeling, Verdict, Work, first_passes, verdict};
use crate::stages;
use crate::{Error, Result};
use bytemuck::Zeroable;
use cao_gpu::{Access, Buffer, BufferUse, Gpu, Recorder, Timings};
use cao_kernels::shared::clip_bits::MOST_CLIPS;
use cao_kernels::shared::clips::{self as kinds, Clips};
use cao_kernels::shared::peeled::Peeled;
use cao_model::clip::{Clip, ClipCamera, Mode, Shape};
use cao_model::mesh::TriangleMesh;
use cao_model::settings::MapSettings;
use glam::Vec3;
use std::mem::offset_of;
use std::sync::Arc;

const _: () = assert!(MOST_CLIPS as usize == Clip::MAX);

/// What earlier frames may still be doing with maps and working memory, and what making maps may do.
const ANYTHING: [Access; 8] = [
    Access::TransferRead,
    Access::TransferWrite,
    Access::StorageRead,
    Access::StorageWrite,
    Access::SampledRead,
    Access::IndirectRead,
    Access::GraphicsRead,
    Access::AttachmentWrite,
];

/// Reports that are waited for. A host that keeps more recordings than that learns nothing of the oldest.
const MOST_REPORTS: usize = 32;

/// Where one mesh clip's maps are in the shared buffers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshClip {
    /// The clip camera.
    pub camera: ClipCamera,
    /// Layer pairs that there is room for; the device knows how many hold anything.
    pub pairs: u32,
    /// The camera of the dilation maps.
    pub cells: ClipCamera,
    /// First f32 of the layers.
    pub layers_at: u32,
    /// First f32 of the dilation maps.
    pub dilation_at: u32,
    /// First f32 of the bounds of blocks of the layers.
    pub blocks_at: u32,
    /// The outside is hidden.
    pub keep: bool,
    /// See [`MapSettings::literal`].
    pub literal: bool,
}

/// What there is to make of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Todo {
    Nothing,
    Dilation,
    All,
}

/// A mesh at one ratio of its axes and one margin, and its maps.
#[derive(Clone)]
struct Mesh {
    mesh: Arc<TriangleMesh>,
    shape: Vec3,
    margin: f32,
    settings: MapSettings,
    /// The camera that its layers are drawn from.
    camera: ClipCamera,
    corners: Corners,
    /// What was found, on the device.
    peeled: Buffer,
    map: MeshClip,
    /// Radius of the dilation.
    radius: Option<f32>,
    todo: Todo,
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

/// What a recording finds of meshes, for the host to read when it has run.
#[derive(Clone)]
struct Report {
    found: Buffer,
    /// Surfaces that were looked for.
    passes: u32,
    /// Place among the meshes, mesh and settings of each.
    meshes: Vec<(usize, Arc<TriangleMesh>, MapSettings)>,
}

/// Memory for making maps.
struct Scratch {
    work: Work,
    /// Hulls of the blocks that are dilated.
    blocks: Option<Buffer>,
    settings: MapSettings,
}

/// The clips of a scene in device memory.
#[derive(Clone)]
pub struct ClipSet {
    /// Bound as `clips`.
    pub clips: Buffer,
    /// Bound as `layers`.
    pub layers: Buffer,
    /// Bound as `dilation`.
    pub dilation: Buffer,
    meshes: Vec<Mesh>,
    scratch: Option<Arc<Scratch>>,
    /// Surfaces that are looked for: as many as any mesh had so far.
    passes: u32,
    /// Of the recording that is being made.
    recorded: Option<Report>,
    /// Of those that were made.
    late: Vec<Report>,
}

/// f32 that a mesh's layers, the bounds of their blocks and its dilation maps take.
fn room(settings: MapSettings) -> [u32; 3] {
    let MapSettings { resolution, cells, pairs, .. } = settings;
    [
        Pairs::layers_len(resolution, pairs),
        Pairs::bounds_len(resolution, pairs),
        Pairs::layers_len(cells, pairs),
    ]
}

impl ClipSet {
    /// No clips.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            clips: gpu.buffer("clips", size_of::<Clips>() as u64, BufferUse::Device)?,
            layers: gpu.buffer("clip layers", 16, BufferUse::Device)?,
            dilation: gpu.buffer("dilation maps", 16, BufferUse::Device)?,
            meshes: Vec::new(),
            scratch: None,
            passes: 0,
            recorded: None,
            late: Vec::new(),
        })
    }

    /// The set for these clips: what is there and fits stays, and there is memory for the rest. `radius` in mm is the reach of a change (ray
    /// length, footprint and sample cell), `None` where no dilation maps are needed, `half_mm` half the volume's diagonal. Of a mesh with
    /// the triangles of one that is here nothing but the vertices is looked at.
    pub fn planned(
        &self,
        gpu: &Gpu,
        clips: &[Clip],
        radius: Option<f32>,
        half_mm: f32,
        settings: MapSettings,
    ) -> Result<Self> {
        check(clips, half_mm)?;
        settings.check()?;
        let wanted: Vec<_> =
            clips.iter().filter_map(|clip| Wanted::of(clip, radius, half_mm, settings)).collect();
        if !wanted.is_empty() {
            gpu.check_graphics("peel")?;
        }
        let mut planned = self.clone();
        planned.meshes.clear();
        planned.passes = self.passes.max(first_passes(settings.pairs));
        for (place, want) in wanted.iter().enumerate() {
            // Only the literal recipe's layers leave room for the dilation.
            let margin = if settings.literal { radius.unwrap_or(0.0) } else { 0.0 };
            let have = self.meshes.get(place).filter(|have| have.settings == settings);
            planned.meshes.push(match have.filter(|have| have.has_layers_of(want, margin)) {
                Some(have) => have.shown_as(want, place),
                None => self.drawn(gpu, want, place, margin, settings)?,
            });
        }
        let count = wanted.len() as u64;
        let [layers, bounds, maps] = room(settings).map(|len| 4 * u64::from(len) * count);
        let fitting = |have: &Buffer, bytes: u64| match have.bytes() == bytes.max(16) {
            true => Ok(have.clone()),
            false => gpu.buffer(have.name(), bytes.max(16), BufferUse::Device),
        };
        planned.layers = fitting(&self.layers, layers + bounds)?;
        planned.dilation = fitting(&self.dilation, if radius.is_some() { maps } else { 0 })?;
        planned.scratch = match &self.scratch {
            _ if wanted.is_empty() => None,
            Some(have) if have.settings == settings && (have.blocks.is_some() || radius.is_none()) => {
                Some(have.clone())
            }
            _ => Some(Arc::new(Scratch::new(gpu, settings, radius.is_some())?)),
        };
        for mesh in &mut planned.meshes {
            // Bytes of another buffer are none.
            if !planned.layers.is(&self.layers) {
                mesh.todo = Todo::All;
            } else if !planned.dilation.is(&self.dilation) {
                mesh.todo = mesh.todo.max(Todo::Dilation);
            }
        }
        Ok(planned)
    }

    /// A mesh of which there are no layers.
    fn drawn(
        &self,
        gpu: &Gpu,
        want: &Wanted,
        place: usize,
        margin: f32,
        settings: MapSettings,
    ) -> Result<Mesh> {
        let (mesh, shape) = (want.mesh, want.shape);
        let same = |have: &Mesh| {
            have.mesh.triangles == mesh.triangles && have.mesh.vertices.len() == mesh.vertices.len()
        };
        if !self.meshes.iter().any(same) {
            // Layer pairs have their meaning only where there is an inside.
            mesh.check_solid()?;
        }
        if let Some(vertex) = mesh.vertices.iter().find(|vertex| !vertex.is_finite()) {
            let problem = format!("has a vertex at {vertex}; coordinates must be finite");
            return Err(cao_model::Error::Mesh { name: mesh.name.clone(), problem }.into());
        }
        let camera = ClipCamera::around(mesh, shape, margin, settings.resolution);
        Ok(Mesh {
            mesh: mesh.clone(),
            shape,
            margin,
            settings,
            camera,
            corners: Corners::new(gpu, mesh)?,
            peeled: Pairs::peeled(gpu)?,
            map: MeshClip::new(camera, want, place, settings),
            radius: want.radius,
            todo: Todo::All,
        })
    }

    /// Whether there are layers or dilation maps to make.
    pub fn has_todo(&self) -> bool {
        self.meshes.iter().any(|mesh| mesh.todo != Todo::Nothing)
    }

    /// Takes no map on the device for granted, nor what was recorded for run.
    pub fn forget(&mut self) {
        self.meshes.iter_mut().for_each(|mesh| mesh.todo = Todo::All);
        self.late.clear();
    }

    /// Records what makes the maps that are not there. They count as made when [`Self::settle`] says so.
    pub fn record_maps(&mut self, gpu: &Gpu, rec: &mut Recorder, peel: &Peel, dilate: &Dilate) -> Result<()> {
        self.recorded = None;
        let Some(scratch) = self.scratch.as_ref().filter(|_| self.has_todo()) else { return Ok(()) };
        rec.barrier(&ANYTHING, &ANYTHING);
        let mut meshes = Vec::new();
        for (place, mesh) in self.meshes.iter().enumerate().filter(|(_, mesh)| mesh.todo == Todo::All) {
            rec.stage(stages::PEEL)?;
            let peeling = Peeling {
                corners: &mesh.corners,
                scale: mesh.shape,
                camera: mesh.camera,
                passes: self.passes,
                cells: mesh.settings.cells,
                peeled: &mesh.peeled,
            };
            let to = Place {
                resolution: mesh.camera.resolution,
                pairs: mesh.map.pairs,
                layers: &self.layers,
                layers_at: mesh.map.layers_at,
                blocks_at: mesh.map.blocks_at,
            };
            peel.record(rec, &peeling, &to, &scratch.work)?;
            rec.end_stage()?;
            rec.barrier(&ANYTHING, &ANYTHING);
            meshes.push((place, mesh.mesh.clone(), mesh.settings));
        }
        for mesh in self.meshes.iter().filter(|mesh| mesh.todo != Todo::Nothing) {
            let (Some(radius), Some(blocks)) = (mesh.radius, &scratch.blocks) else { continue };
            rec.stage(stages::DILATE)?;
            dilate.record(rec, &mesh.map, radius, &self.layers, blocks, &self.dilation, &mesh.peeled)?;
            rec.end_stage()?;
            rec.barrier(&ANYTHING, &ANYTHING);
        }
        if !meshes.is_empty() {
            const BYTES: u64 = size_of::<Peeled>() as u64;
            let found =
                gpu.buffer("found of clip meshes", BYTES * meshes.len() as u64, BufferUse::Readback)?;
            for (at, (place, ..)) in (0..).zip(&meshes) {
                rec.copy_buffer(&self.meshes[*place].peeled, 0, &found, BYTES * at, BYTES)?;
            }
            rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
            self.recorded = Some(Report { found, passes: self.passes, meshes });
        }
        Ok(())
    }

    /// The maps that were recorded last count as made.
    pub fn settle(&mut self) {
        self.meshes.iter_mut().for_each(|mesh| mesh.todo = Todo::Nothing);
        self.late.extend(self.recorded.take());
        let surplus = self.late.len().saturating_sub(MOST_REPORTS);
        self.late.drain(..surplus);
    }

    /// What the recordings that have run found. Where a mesh has more surfaces than were looked for, its maps are to be made again, with more
    /// passes; whether there is one.
    ///
    /// # Errors
    /// Those of [`verdict`]: the mesh cannot clip as it is. Its maps are never made.
    pub fn heard(&mut self) -> Result<bool> {
        let (mut again, mut refused) = (false, None);
        let (running, run): (Vec<_>, Vec<_>) =
            self.late.drain(..).partition(|report| report.found.is_shared());
        self.late = running;
        for report in run {
            let all: Vec<Peeled> = bytemuck::pod_collect_to_vec(&report.found.read(0, report.found.bytes())?);
            for (found, (place, mesh, settings)) in all.iter().zip(report.meshes) {
                let judged = verdict(found, &mesh, settings.resolution, settings.pairs, report.passes);
                if matches!(judged, Ok(Verdict::Complete)) {
                    continue;
                }
                // Another one that came after it has a report of its own.
                let same = |now: &&mut Mesh| Arc::ptr_eq(&now.mesh, &mesh) && now.settings == settings;
                if let Some(now) = self.meshes.get_mut(place).filter(same) {
                    (now.todo, again) = (Todo::All, true);
                }
                match judged {
                    Ok(Verdict::More(passes)) => self.passes = self.passes.max(passes),
                    Ok(Verdict::Complete) => (),
                    Err(error) => refused = refused.or(Some(error)),
                }
            }
        }
        refused.map_or(Ok(again), Err)
    }

    /// Makes the maps that are not there. Uses the device's queue and waits for it; returns the times of the stages.
    ///
    /// # Errors
    /// As [`Self::heard`], of what was recorded before, too.
    pub fn make(&mut self, gpu: &Gpu, peel: &Peel, dilate: &Dilate) -> Result<Timings> {
        let mut timings = Timings::new();
        while self.heard()? || self.has_todo() {
            let mut rec = gpu.recorder("clip maps")?;
            self.record_maps(gpu, &mut rec, peel, dilate)?;
            timings.extend(rec.submit_and_wait()?);
            self.settle();
        }
        Ok(timings)
    }

    /// Writes the clips at their poses and makes them visible to all shaders. The set must be theirs, and the maps of meshes have been made.
    pub fn record(&self, rec: &mut Recorder, clips: &[Clip], half_mm: f32) -> Result<()> {
        check(clips, half_mm)?;
        let mut data = Clips::zeroed();
        data.count = clips.len() as u32;
        let mut meshes = self.meshes.iter().map(|mesh| mesh.map);
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
                            "has no place for its maps; the set is that of other clips",
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
        rec.barrier(
            &[Access::StorageRead, Access::StorageWrite, Access::GraphicsRead],
            &[Access::TransferRead, Access::TransferWrite],
        );
        rec.update(&self.clips, 0, bytemuck::bytes_of(&data))?;
        if !self.meshes.is_empty() {
            rec.barrier(&[Access::TransferWrite], &[Access::TransferRead, Access::TransferWrite]);
        }
        let is_mesh = |(_, clip): &(usize, &Clip)| matches!(clip.shape, Shape::Mesh(_));
        for ((slot, _), mesh) in clips.iter().enumerate().filter(is_mesh).zip(&self.meshes) {
            let at =
                offset_of!(Clips, clip) + slot * size_of::<kinds::Clip>() + offset_of!(kinds::Clip, pairs);
            rec.copy_buffer(&mesh.peeled, offset_of!(Peeled, pairs) as u64, &self.clips, at as u64, 4)?;
        }
        rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::GraphicsRead]);
        Ok(())
    }
}

impl MeshClip {
    fn new(camera: ClipCamera, want: &Wanted, place: usize, settings: MapSettings) -> Self {
        let camera = camera.larger(want.larger);
        let [layers, bounds, maps] = room(settings);
        let layers_at = place as u32 * (layers + bounds);
        Self {
            camera,
            pairs: settings.pairs,
            cells: match want.radius {
                Some(radius) if !settings.literal => camera.widened(radius, settings.cells),
                Some(_) => camera,
                None => ClipCamera { resolution: 0, ..camera },
            },
            layers_at,
            dilation_at: place as u32 * maps,
            blocks_at: layers_at + layers,
            keep: want.keep,
            literal: settings.literal,
        }
    }
}

impl Mesh {
    /// Whether its layers are those of another clip.
    fn has_layers_of(&self, want: &Wanted, margin: f32) -> bool {
        Arc::ptr_eq(&self.mesh, want.mesh) && self.shape == want.shape && self.margin == margin
    }

    /// With its layers, and other dilation maps where they are others.
    fn shown_as(&self, want: &Wanted, place: usize) -> Self {
        let map = MeshClip::new(self.camera, want, place, self.settings);
        let same = map == self.map && want.radius == self.radius;
        let todo = match want.radius {
            Some(_) if !same => self.todo.max(Todo::Dilation),
            None if self.todo == Todo::Dilation => Todo::Nothing,
            _ => self.todo,
        };
        Self { map, radius: want.radius, todo, ..self.clone() }
    }
}

impl Scratch {
    fn new(gpu: &Gpu, settings: MapSettings, dilates: bool) -> Result<Self> {
        let MapSettings { resolution, cells, pairs, .. } = settings;
        let blocks = if dilates { Some(Dilate::blocks(gpu, cells, pairs)?) } else { None };
        Ok(Self { work: Work::new(gpu, resolution)?, blocks, settings })
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
