//! The three methods as what gives pixels their light.

use super::shade::ImageSpace;
use crate::mesh::ambient::{PixelAmbient, Pixels};
use crate::{Error, Result, stages};
use cao_gpu::{Buffer, Gpu, Recorder};
use cao_model::image_space::{Crytek, Hbao, ImageMethod, Volumetric};
use cao_model::pixel_occlusion::{PixelMethod, PixelOcclusion};

/// Steps along each direction of HBAO.
const STEPS: u32 = 6;

/// One of the three.
pub struct ByImage {
    shade: ImageSpace,
    method: ImageMethod,
    scratch: Option<Buffer>,
}

/// The method of these settings, with a radius of `delta_mm`; `None` where its values are not of an image.
pub fn image_method(occlusion: &PixelOcclusion, delta_mm: f32) -> Option<ImageMethod> {
    Some(match occlusion.method {
        PixelMethod::Crytek => ImageMethod::Crytek(Crytek { radius_mm: delta_mm }),
        PixelMethod::Volumetric => {
            ImageMethod::Volumetric(Volumetric { radius_mm: delta_mm, samples: occlusion.samples })
        }
        PixelMethod::Hbao => ImageMethod::Hbao(Hbao {
            radius_mm: delta_mm,
            directions: occlusion.samples.div_ceil(STEPS).clamp(1, Hbao::MOST_DIRECTIONS),
            bias_deg: 30.0,
            falloff: true,
            reach: 7,
        }),
        PixelMethod::Aov | PixelMethod::Rays => return None,
    })
}

impl ByImage {
    /// Builds the pipelines.
    ///
    /// # Errors
    /// Settings that the method does not have.
    pub fn new(gpu: &Gpu, method: ImageMethod) -> Result<Self> {
        method.check()?;
        Ok(Self { shade: ImageSpace::new(gpu)?, method, scratch: None })
    }
}

impl PixelAmbient for ByImage {
    fn prepare(&mut self, on: &Pixels) -> Result<()> {
        self.scratch = Some(on.geometry.values(on.gpu, "accessibility before its filter")?);
        Ok(())
    }

    fn parts(&self, _: &Pixels) -> u32 {
        1
    }

    fn record(&self, rec: &mut Recorder, on: &Pixels, _: u32, accessibility: &Buffer) -> Result<()> {
        let Some(scratch) = &self.scratch else {
            return Err(Error::refused("ambient occlusion of pixels", "is not prepared"));
        };
        rec.stage(stages::IMAGE_SPACE)?;
        self.shade.record(rec, on.geometry, &self.method, scratch, accessibility)?;
        Ok(rec.end_stage()?)
    }
}
