//! The picture of a world: its light by a look, alone or behind a volume's picture (`spirv/mesh/light.wgsl` has the equation).
//!
//! In: geometry, hits, accessibility, a world. Out: a picture's colour and depth. Cost: one evaluation a pixel.

use crate::Result;
use crate::draw::picture::Picture;
use crate::mesh::geometry::Geometry;
use crate::mesh::surfaces::Surfaces;
use cao_gpu::{Buffer, Format, Gpu, Image, Pipeline, Recorder, Sampler, SamplerDesc};
use cao_kernels::light as kernel;
use cao_model::look::{Look, Occluded};
use cao_model::view::View;

/// The kernel `light`.
pub struct Light {
    alone: Pipeline,
    ends: Pipeline,
    over: Pipeline,
    edge: Sampler,
}

/// The ambient values of a volume, whose centre is the world's origin.
#[derive(Clone, Copy)]
pub struct VolumeShade<'a> {
    /// V_AO.
    pub ambient: &'a Image,
    /// Whether it is of coloured light.
    pub coloured: bool,
    /// Size of a voxel in mm.
    pub spacing: [f32; 3],
    /// What it is in the open: 1, or ½ where its opacities know the surface as a solid.
    pub open: f32,
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
        Ok(Self {
            alone: pipeline("alone")?,
            ends: pipeline("ends")?,
            over: pipeline("over")?,
            edge: gpu.sampler("edge", SamplerDesc { linear: true, border_zero: false })?,
        })
    }

    /// Writes where a volume's rays end into a picture's depth.
    pub fn record_ends(&self, rec: &mut Recorder, geometry: &Geometry, picture: &Picture) -> Result<()> {
        let [width, height] = geometry.size();
        let params = kernel::LightParams { size: [width, height], ..bytemuck::Zeroable::zeroed() };
        let binds = kernel::EndsBindings { geometry: &geometry.pixels, depths: &picture.depth };
        let over = [width, height, geometry.views() as u32];
        Ok(rec.dispatch_over(&self.ends, &binds, bytemuck::bytes_of(&params), over)?)
    }

    /// Writes colour and depth of a picture, or lays what is there of a volume over the world. The light is that of the first view's head.
    pub fn record(
        &self,
        rec: &mut Recorder,
        lit: Lit,
        views: &[View],
        look: &Look,
        picture: &Picture,
        volume: Option<VolumeShade>,
    ) -> Result<()> {
        let Lit { surfaces, geometry, hits, accessibility } = lit;
        let [width, height] = geometry.size();
        let flag = |on| f32::from(u8::from(on));
        let [ambient, diffuse, specular] = look.parts();
        let light = look.towards_light(views[0].orientation);
        let mut params = kernel::LightParams {
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
            ..bytemuck::Zeroable::zeroed()
        };
        let extent = [width, height, geometry.views() as u32];
        if let Some(VolumeShade { ambient, coloured, spacing, open }) = volume {
            let dims = ambient.desc().dims.map(|voxels| voxels as f32);
            [params.dims_x, params.dims_y, params.dims_z] = dims;
            [params.spacing_x, params.spacing_y, params.spacing_z] = spacing;
            params.open = open;
            params.texels = match (ambient.desc().format, coloured) {
                (_, true) => kernel::COLOURED,
                (Format::Rgba16Unorm, false) => kernel::PARTS_OF_FOUR,
                _ => kernel::GREY,
            };
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
                ambient,
                edge: &self.edge,
            };
            return Ok(rec.dispatch_over(&self.over, &binds, bytemuck::bytes_of(&params), extent)?);
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
        Ok(rec.dispatch_over(&self.alone, &binds, bytemuck::bytes_of(&params), extent)?)
    }
}
