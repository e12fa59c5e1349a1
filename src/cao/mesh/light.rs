//! The picture of a world: its light by a look, alone or behind a volume's picture (`spirv/mesh/light.wgsl` has the equation).
//!
//! In: geometry, hits, accessibility, a world. Out: a picture's colour and depth. Cost: one evaluation a pixel.

use crate::Result;
use crate::draw::picture::Picture;
use crate::mesh::geometry::Geometry;
use crate::mesh::surfaces::Surfaces;
use cao_gpu::{Buffer, Gpu, Pipeline, Recorder};
use cao_kernels::light as kernel;
use cao_model::look::{Look, Occluded};
use cao_model::view::View;

/// The kernel `light`.
pub struct Light {
    alone: Pipeline,
    ends: Pipeline,
    over: Pipeline,
}

/// What is lit.
#[derive(Clone, Copy)]
pub struct Lit<'a> {
    /// The world.
    pub surfaces: &'a Surfaces,
    /// What pixels show of it,
    pub geometry: &'a Geometry,
    /// and where on it.
    pub hits: &'a Buffer,
    /// 1 − AO a pixel.
    pub accessibility: &'a Buffer,
}

impl Light {
    /// Builds the pipelines.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let pipeline = |entry| gpu.compute(&kernel::SHADER, entry);
        Ok(Self { alone: pipeline("alone")?, ends: pipeline("ends")?, over: pipeline("over")? })
    }

    /// Writes where a volume's rays end into a picture's depth.
    pub fn record_ends(&self, rec: &mut Recorder, geometry: &Geometry, picture: &Picture) -> Result<()> {
        let [width, height] = geometry.size();
        let params = kernel::LightParams { size: [width, height], ..bytemuck::Zeroable::zeroed() };
        let binds = kernel::EndsBindings { geometry: &geometry.pixels, depths: &picture.depth };
        let over = [width, height, geometry.views() as u32];
        Ok(rec.dispatch_over(&self.ends, &binds, bytemuck::bytes_of(&params), over)?)
    }

    /// Writes colour and depth of a picture, or lays what is there over the world. The light is that of the first view's head.
    pub fn record(
        &self,
        rec: &mut Recorder,
        lit: Lit,
        views: &[View],
        look: &Look,
        picture: &Picture,
        over_world: bool,
    ) -> Result<()> {
        let Lit { surfaces, geometry, hits, accessibility } = lit;
        let [width, height] = geometry.size();
        let flag = |on| f32::from(u8::from(on));
        let [ambient, diffuse, specular] = look.parts();
        let light = look.towards_light(views[0].orientation);
        let params = kernel::LightParams {
            size: [width, height],
            ambient,
            diffuse,
            specular,
            shininess: look.shininess,
            occluded: flag(look.shading.occluded()),
            occluded_rest: flag(look.shading.occluded() && look.occluded == Occluded::All),
            gain: look.gain,
            light_x: light.x,
            light_y: light.y,
            light_z: light.z,
        };
        let extent = [width, height, geometry.views() as u32];
        let push = bytemuck::bytes_of(&params);
        if over_world {
            let binds = kernel::OverBindings {
                eyes: &geometry.eyes,
                looks: &surfaces.looks,
                triangles: &surfaces.triangles,
                materials: &surfaces.materials,
                texels: &surfaces.texels,
                geometry: &geometry.pixels,
                hits,
                accessibility,
                colours: &picture.colour,
                depths: &picture.depth,
            };
            return Ok(rec.dispatch_over(&self.over, &binds, push, extent)?);
        }
        let binds = kernel::AloneBindings {
            eyes: &geometry.eyes,
            looks: &surfaces.looks,
            triangles: &surfaces.triangles,
            materials: &surfaces.materials,
            texels: &surfaces.texels,
            geometry: &geometry.pixels,
            hits,
            accessibility,
            colours: &picture.colour,
            depths: &picture.depth,
        };
        Ok(rec.dispatch_over(&self.alone, &binds, push, extent)?)
    }
}
