//! Parts of a volume that are shown each for itself, and the ambient light of a renderer.

use crate::edge::{numbers, one_of, read, read_all, versioned};
use crate::error::{CaoResult, Result, guard, refuse};
use crate::handle::get;
use crate::renderer::CaoRenderer;
use crate::volume::{CaoVolume, of_labels};
use cao_model::feature::{Feature, Features};
use cao_model::light::{AmbientLight, HARMONICS};

/// A part of a volume. Features are called by their numbers, "1" the first.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CaoFeature {
    /// sizeof(CaoFeature).
    pub size: u32,
    /// Whether it shows: 0 or 1.
    pub visible: u32,
    /// What its opacities are multiplied with, 0 … 16; they end at 1.
    pub opacity: f32,
    /// Whether clips leave it whole: 0 or 1.
    pub spared: u32,
    /// Whether it has a colour of its own, 0 or 1; else it has the transfer function's.
    pub has_colour: u32,
    /// Red, green, blue; linear, 0 … 1.
    pub colour: [f32; 3],
    /// Without labels: its voxels' values are from the first number on and below the second. Intervals lie apart.
    pub values: [f32; 2],
    /// With labels: how many it has,
    pub label_count: u32,
    /// 0.
    pub reserved: u32,
    /// and which; each belongs to one feature.
    pub labels: *const u32,
}
versioned!(CaoFeature);

/// Where ambient light comes from.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaoLightKind {
    /// The same from everywhere; the default.
    Uniform = 0,
    /// As a sky's: the cosine to a direction.
    Sky = 1,
    /// Spherical harmonics.
    Harmonics = 2,
}

const KINDS: [CaoLightKind; 3] = [CaoLightKind::Uniform, CaoLightKind::Sky, CaoLightKind::Harmonics];

/// Ambient light by the direction that it comes from, along the volume's axes (docs/method.md, 2.1).
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CaoAmbientLight {
    /// sizeof(CaoAmbientLight).
    pub size: u32,
    /// A CaoLightKind.
    pub kind: u32,
    /// Of a sky: the direction that is up, of any length.
    pub up: [f64; 3],
    /// Of harmonics: three doubles each, red, green and blue, in the order 1, y, z, x, xy, yz, 3z² - 1, xz, x² - y².
    pub coefficients: *const f64,
    /// Of harmonics: how many, 1 … 9; the others are 0.
    pub coefficient_count: u32,
    /// 0.
    pub reserved: u32,
}
versioned!(CaoAmbientLight);

fn feature(place: usize, given: &CaoFeature) -> Feature {
    Feature {
        name: (place + 1).to_string(),
        visible: given.visible != 0,
        scale: given.opacity,
        colour: (given.has_colour != 0).then_some(given.colour),
        spared: given.spared != 0,
    }
}

/// Whose each label is, by the features' numbers; 0 of none.
///
/// # Safety
/// The features' labels are as the header asks.
unsafe fn owners(given: &[CaoFeature]) -> Result<Vec<u8>> {
    let mut owners = vec![0; usize::from(u16::MAX) + 1];
    for (number, feature) in (1..).zip(given) {
        let what = "CaoFeature.labels";
        // SAFETY: the caller's promise.
        for &label in unsafe { numbers(what, feature.labels, feature.label_count.into()) }? {
            let problem = match owners.get_mut(label as usize) {
                Some(owner @ 0) => {
                    *owner = number;
                    continue;
                }
                Some(owner) => format!("is of features {owner} and {number}; expected one for each"),
                None => format!("expected 0 … {}", u16::MAX),
            };
            return refuse(CaoResult::BadValue, format!("{what}: {label}: {problem}"));
        }
    }
    Ok(owners)
}

/// Changes the features, all of them, at most 8; 0 and NULL for none. Voxels belong to them by their values where `labels` is 0, else by a
/// volume of CAO_VOXEL_U8 or CAO_VOXEL_U16 on the renderer's grid, which may be freed afterwards; those with no feature's label are of
/// none. How features are shown never uses a queue; other voxels use the lent queue and wait for it.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_renderer_set_features(
    renderer: CaoRenderer,
    features: *const CaoFeature,
    feature_count: u32,
    labels: CaoVolume,
) -> CaoResult {
    guard(|| {
        let shared = get(renderer)?;
        // SAFETY: the header asks for it.
        let given = unsafe { read_all(features, feature_count, Features::MOST) }?;
        let list = given.iter().enumerate().map(|(place, given)| feature(place, given));
        let features = if given.is_empty() {
            Features::NONE
        } else if labels.id == 0 {
            Features::by_intervals(list.zip(given.iter().map(|given| given.values)).collect())?
        } else {
            // SAFETY: as above.
            let owners = unsafe { owners(&given) }?;
            let each = of_labels(&*get(labels)?, shared.dims, shared.spacing, &owners)?;
            Features::by_labels(list.collect(), shared.dims, each)?
        };
        shared.enter(|renderer| Ok(renderer.set_features(features)?))
    })
}

/// Changes the ambient light; NULL is uniform. Of CAO_METHOD_RAYS all, of CAO_METHOD_CAO and CAO_METHOD_LAO light of one colour; other
/// methods have uniform light only. Uses the lent queue where light becomes coloured or ceases to be.
// SAFETY: the name is ours alone; pointers are as the header asks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cao_renderer_set_ambient_light(
    renderer: CaoRenderer,
    light: *const CaoAmbientLight,
) -> CaoResult {
    guard(|| {
        let shared = get(renderer)?;
        let light = if light.is_null() {
            AmbientLight::Uniform
        } else {
            // SAFETY: the header asks for it.
            let given = unsafe { read(light) }?;
            match one_of("CaoAmbientLight.kind", given.kind, &KINDS)? {
                CaoLightKind::Uniform => AmbientLight::Uniform,
                CaoLightKind::Sky => AmbientLight::Sky(given.up),
                CaoLightKind::Harmonics => {
                    let count = given.coefficient_count;
                    if count as usize > HARMONICS {
                        let what =
                            format!("CaoAmbientLight.coefficient_count: {count}; expected 1 … {HARMONICS}");
                        return refuse(CaoResult::Limit, what);
                    }
                    let what = "CaoAmbientLight.coefficients";
                    // SAFETY: as above.
                    let numbers = unsafe { numbers(what, given.coefficients, 3 * u64::from(count)) }?;
                    AmbientLight::harmonics(numbers.as_chunks().0)?
                }
            }
        };
        shared.enter(|renderer| Ok(renderer.set_ambient_light(light)?))
    })
}
