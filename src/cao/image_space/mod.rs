//! Image-space ambient occlusion (docs/image-space.md): three published methods that know what the pixels of a view show, and nothing else.
//!
//! In: [`Geometry`], unit normals and view depths of up to four views, and the eyes. Out: an f32 a pixel and view, accessibility, 1 = open and 1 where
//! nothing is. All views in one dispatch. Lengths are mm of the world.
//!
//! A value belongs to an image: it changes with the eye, with what else the image shows and with its resolution. Methods whose values belong to places are
//! in the other rooms.
//!
//! [`Geometry`]: crate::mesh::geometry::Geometry

pub mod blur;
pub mod crytek;
pub mod first_hit;
pub mod hbao;
pub mod method;
pub mod shade;
pub mod volumetric;
