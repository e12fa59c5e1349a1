//! The three methods under one call, each with its filter.

use super::blur::Blur;
use super::crytek::CrytekShading;
use super::hbao::HbaoShading;
use super::volumetric::VolumetricShading;
use crate::mesh::geometry::Geometry;
use crate::{Error, Result};
use cao_gpu::{Access, Buffer, Gpu, Recorder};
use cao_model::image_space::ImageMethod;

/// Everything that shades an image.
pub struct ImageSpace {
    crytek: CrytekShading,
    volumetric: VolumetricShading,
    hbao: HbaoShading,
    blur: Blur,
}

impl ImageSpace {
    /// Builds the pipelines.
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            crytek: CrytekShading::new(gpu)?,
            volumetric: VolumetricShading::new(gpu)?,
            hbao: HbaoShading::new(gpu)?,
            blur: Blur::new(gpu)?,
        })
    }

    /// Shades all views: 1 is open, and 1 where nothing is. `scratch` and `accessibility` are of [`Geometry::values`]; the caller has made the geometry
    /// visible to storage reads, and earlier uses of both buffers over.
    ///
    /// # Errors
    /// Impossible settings, buffers of another size.
    pub fn record(
        &self,
        rec: &mut Recorder,
        geometry: &Geometry,
        method: &ImageMethod,
        scratch: &Buffer,
        accessibility: &Buffer,
    ) -> Result<()> {
        method.check()?;
        let [width, height] = geometry.size();
        let expected = 4 * u64::from(width) * u64::from(height) * geometry.views() as u64;
        for (what, buffer) in [("accessibility", accessibility), ("scratch", scratch)] {
            if buffer.bytes() != expected {
                let problem = format!("{} bytes; expected {expected}, an f32 a pixel", buffer.bytes());
                return Err(Error::refused(what, problem));
            }
        }
        match method {
            ImageMethod::Crytek(settings) => {
                self.crytek.record(rec, geometry, settings, scratch)?;
                rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
                self.blur.record_square(rec, geometry, scratch, accessibility)
            }
            ImageMethod::Volumetric(settings) => {
                self.volumetric.record(rec, geometry, settings, accessibility)
            }
            ImageMethod::Hbao(settings) => {
                self.hbao.record(rec, geometry, settings, accessibility)?;
                rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
                self.blur.record_bilateral(rec, geometry, settings, scratch, accessibility)
            }
        }
    }
}
