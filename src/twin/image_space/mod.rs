//! Ambient occlusion from what the pixels of one view show.

pub mod blur;
pub mod crytek;
pub mod first_hit;
pub mod hbao;
pub mod scenes;
pub mod shown;
pub mod volumetric;

use cao_model::image_space::ImageMethod;
use shown::Shown;

/// Accessibility of every pixel by a method and its filter: 1 is open; 1 where nothing is.
pub fn accessibility(shown: &Shown, method: &ImageMethod) -> Vec<f64> {
    match method {
        ImageMethod::Crytek(settings) => blur::square(shown, &crytek::crytek(shown, settings)),
        ImageMethod::Volumetric(settings) => volumetric::volumetric(shown, settings),
        ImageMethod::Hbao(settings) => blur::bilateral(shown, settings, &hbao::hbao(shown, settings)),
    }
}
