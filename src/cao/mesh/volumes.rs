//! Ambient occlusion volumes, drawn (AOV §5): the paper's own way, whose cost is the fragments that volumes cover.
//!
//! In: geometry, a world. Out: 1 − AO a pixel, sums of f32 in the order of the triangles. Cost: 24 vertices a triangle, 36 of a sliver, and a
//! fragment for each pixel behind which the back of a volume lies.

use crate::host::{device_buffer, rows_over};
use crate::mesh::ambient::{PixelAmbient, Pixels};
use crate::mesh::surfaces::is_sliver;
use crate::{Error, Result, stages};
use cao_gpu::{
    Access, Attachments, Blend, Buffer, BufferUse, Cull, DepthTest, Flat, Format, Gpu, GraphicsDesc, Image,
    ImageDesc, ImageKind, ImageUse, Pipeline, Recorder,
};
use cao_kernels::volumes as kernel;
use cao_model::surface::Triangle;

/// Vertices of a prism, and of a box.
const PRISM: u32 = 24;
const BOX: u32 = 36;

/// The kernel `volumes`, as a method.
pub struct Volumes {
    dynamic: Pipeline,
    made: Pipeline,
    corners: Pipeline,
    depth: Pipeline,
    settle: Pipeline,
    /// Corners are made once, and not by each vertex.
    is_static: bool,
    clamped: bool,
    world: Option<Ready>,
}

/// What belongs to a world and a size.
struct Ready {
    items: Buffer,
    /// How many are prisms, and how many boxes.
    prisms: u32,
    boxes: u32,
    made: Option<Buffer>,
    /// A layer for all views one after the other.
    sums: Image,
    depths: Image,
}

impl Volumes {
    /// Builds the pipelines; with corners made once where the world is `is_static`, and `clamped` as printed (AOV §5.2) or not.
    ///
    /// # Errors
    /// A queue that does no graphics; a device that cannot blend floats of 32 bits: gather the volumes there.
    pub fn new(gpu: &Gpu, is_static: bool, clamped: bool) -> Result<Self> {
        let [dynamic, occlude, corners] = match clamped {
            true => ["dynamic_volume_clamped", "occlude_clamped", "corners_clamped"],
            false => ["dynamic_volume", "occlude", "corners"],
        };
        let pipeline = |vertex| {
            gpu.graphics(
                &kernel::SHADER,
                &GraphicsDesc {
                    vertex,
                    fragment: occlude,
                    colours: &[Format::R32Float],
                    depth: Some(Format::D32Float),
                    depth_test: DepthTest::LessOrEqual,
                    cull: Cull::Front,
                    blend: Blend::Add,
                    ..GraphicsDesc::default()
                },
            )
        };
        Ok(Self {
            dynamic: pipeline(dynamic)?,
            made: pipeline("static_volume")?,
            corners: gpu.compute(&kernel::SHADER, corners)?,
            depth: gpu.graphics(
                &kernel::SHADER,
                &GraphicsDesc {
                    vertex: "whole",
                    fragment: "depth",
                    depth: Some(Format::D32Float),
                    depth_write: true,
                    ..GraphicsDesc::default()
                },
            )?,
            settle: gpu.compute(&kernel::SHADER, "settle")?,
            is_static,
            clamped,
            world: None,
        })
    }

    /// Whether a triangle's volume is a box.
    fn is_box(&self, triangle: &Triangle) -> bool {
        !self.clamped && is_sliver(triangle.corners)
    }

    fn params(on: &Pixels, view: u32, corners: u32, first: u32, count: u32) -> kernel::VolumesParams {
        kernel::VolumesParams {
            size: on.geometry.size(),
            view,
            corners,
            first,
            count,
            delta: on.delta_mm,
            pad: Default::default(),
        }
    }

    fn record_view(
        &self,
        rec: &mut Recorder,
        on: &Pixels,
        world: &Ready,
        view: u32,
        accessibility: &Buffer,
    ) -> Result<()> {
        let Pixels { geometry, surfaces, .. } = *on;
        let size = geometry.size();
        let attachments =
            Attachments { colours: &[], depth: Some((&world.depths, None)), layer: None, at: [0; 2], size };
        let binds = kernel::WholeDepthBindings { eyes: &geometry.eyes, geometry: &geometry.pixels };
        let params = Self::params(on, view, 0, 0, 0);
        rec.draw(&self.depth, &binds, bytemuck::bytes_of(&params), attachments, 3)?;
        rec.barrier(&[Access::AttachmentWrite], &[Access::AttachmentWrite]);
        let mut clear = Some([0.0; 4]);
        for (corners, vertices, first, count) in
            [(3, PRISM, 0, world.prisms), (4, BOX, world.prisms, world.boxes)]
        {
            // The first of the two clears, though it draws nothing.
            if count == 0 && clear.is_none() {
                continue;
            }
            let attachments = Attachments { colours: &[(&world.sums, clear.take())], ..attachments };
            let params = Self::params(on, view, corners, first, count);
            let push = bytemuck::bytes_of(&params);
            if let Some(made) = &world.made {
                let binds = kernel::StaticVolumeOccludeBindings {
                    eyes: &geometry.eyes,
                    items: &world.items,
                    triangles: &surfaces.triangles,
                    shares: &surfaces.shares,
                    geometry: &geometry.pixels,
                    made,
                };
                rec.draw(&self.made, &binds, push, attachments, vertices * count)?;
            } else {
                let binds = kernel::DynamicVolumeOccludeBindings {
                    eyes: &geometry.eyes,
                    items: &world.items,
                    triangles: &surfaces.triangles,
                    shares: &surfaces.shares,
                    geometry: &geometry.pixels,
                };
                rec.draw(&self.dynamic, &binds, push, attachments, vertices * count)?;
            }
            rec.barrier(&[Access::AttachmentWrite], &[Access::AttachmentWrite]);
        }
        rec.barrier(&[Access::AttachmentWrite], &[Access::SampledRead]);
        let binds = kernel::SettleBindings { sums: Flat::Only(&world.sums), accessibility };
        let params = Self::params(on, view, 0, 0, 0);
        Ok(rec.dispatch_over(&self.settle, &binds, bytemuck::bytes_of(&params), [size[0], size[1], 1])?)
    }
}

impl PixelAmbient for Volumes {
    fn prepare(&mut self, on: &Pixels) -> Result<()> {
        let Pixels { gpu, geometry, surfaces, .. } = *on;
        let mut items: Vec<u32> = (0..surfaces.ordered.len() as u32).collect();
        // Stable: of each kind the order of the tree, which is that of places.
        items.sort_by_key(|item| self.is_box(&surfaces.ordered[*item as usize]));
        let boxes = surfaces.ordered.iter().filter(|triangle| self.is_box(triangle)).count() as u32;
        let count = items.len() as u32;
        if count.checked_mul(BOX).is_none() {
            let problem =
                format!("{count} triangles are more than can be drawn at once; gather their volumes");
            return Err(Error::refused("volumes", problem));
        }
        let [width, height] = geometry.size();
        let image = |name, format, usage| {
            gpu.image(
                name,
                &ImageDesc { dims: [width, height, 1], layers: 1, format, kind: ImageKind::D2, usage },
            )
        };
        let mut ready = Ready {
            items: device_buffer(gpu, "volumes", bytemuck::cast_slice(&items))?,
            prisms: count - boxes,
            boxes,
            made: None,
            sums: image("occlusion", Format::R32Float, ImageUse::ATTACHMENT | ImageUse::SAMPLED)?,
            depths: image("depths of surfaces", Format::D32Float, ImageUse::ATTACHMENT)?,
        };
        if self.is_static {
            let made = gpu.buffer("corners of volumes", 128 * u64::from(count), BufferUse::Device)?;
            let params = Self::params(on, 0, 0, 0, count);
            let binds = kernel::CornersBindings {
                items: &ready.items,
                triangles: &surfaces.triangles,
                corners_to_make: &made,
            };
            let mut rec = gpu.recorder("corners of volumes")?;
            let groups = rows_over(8 * count, kernel::CORNERS_WORKGROUP);
            rec.dispatch(&self.corners, &binds, bytemuck::bytes_of(&params), groups)?;
            rec.submit_and_wait()?;
            ready.made = Some(made);
        }
        self.world = Some(ready);
        Ok(())
    }

    fn parts(&self, on: &Pixels) -> u32 {
        on.geometry.views() as u32
    }

    fn record(&self, rec: &mut Recorder, on: &Pixels, part: u32, accessibility: &Buffer) -> Result<()> {
        let Some(world) = &self.world else {
            return Err(Error::refused("ambient occlusion of pixels", "is not prepared"));
        };
        rec.barrier(
            &[Access::StorageWrite, Access::SampledRead],
            &[Access::GraphicsRead, Access::AttachmentWrite],
        );
        rec.discard(&world.sums);
        rec.discard(&world.depths);
        rec.barrier(&[], &[Access::AttachmentWrite]);
        rec.stage(stages::VOLUMES)?;
        self.record_view(rec, on, world, part, accessibility)?;
        Ok(rec.end_stage()?)
    }
}
