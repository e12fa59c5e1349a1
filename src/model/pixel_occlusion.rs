//! Ambient occlusion of surfaces, whose values belong to pixels: the list of its methods, and their settings.
//!
//! Lengths mm. Counts are a pixel's. [`PIXEL_METHODS`] is the one list that scene files, programs and charts read; a method's defaults
//! stand in its entry and nowhere else.

use crate::error::quoted;
use crate::{Error, Result};

/// A method whose values belong to pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PixelMethod {
    /// Ambient occlusion volumes: the projected solid angle of each triangle, within its prism.
    Aov,
    /// Rays through a tree of all triangles: the truth, as far as their number goes.
    Rays,
    /// Points of a sphere that lie behind the depth.
    Crytek,
    /// Lengths of lines through a sphere that lie before the depth.
    Volumetric,
    /// Horizons along directions of the image.
    Hbao,
}

/// What is known of such a method, and how it is used unless one says otherwise.
#[derive(Debug)]
pub struct PixelEntry {
    /// Which one.
    pub method: PixelMethod,
    /// Name in scene files, on the command line and in tables.
    pub name: &'static str,
    /// Name in full.
    pub title: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// Whether it reads triangles of the world, so that both eyes see one value of a place; else only what the image shows.
    pub world: bool,
    /// Rays of a pixel; `None` of methods that follow none.
    pub rays: Option<u32>,
    /// Texels that are read around a pixel, as AOV §3 counts them: all of all directions; `None` of methods that read none.
    pub samples: Option<u32>,
    /// Whether it has a volume a triangle, whose corners can be clamped.
    pub volumes: bool,
    /// Distances of the pixels that can be computed, in pixels along each direction; the others are interpolated.
    pub sparse: &'static [u32],
}

/// Every method of pixels, the one to use first.
pub static PIXEL_METHODS: &[PixelEntry] = &[
    PixelEntry {
        method: PixelMethod::Aov,
        name: "aov",
        title: "Ambient occlusion volumes",
        source: "AOV",
        world: true,
        rays: None,
        samples: None,
        volumes: true,
        // AOV figure 9: 1, 1/9, 1/25 and 1/225 samples a pixel.
        sparse: &[1, 3, 5, 15],
    },
    PixelEntry {
        method: PixelMethod::Rays,
        name: "rays",
        title: "Ray-traced obscurance",
        source: "AOV eq. (5)–(8)",
        world: true,
        rays: Some(256),
        samples: None,
        volumes: false,
        sparse: &[1],
    },
    PixelEntry {
        method: PixelMethod::Crytek,
        name: "crytek",
        title: "Screen-space ambient occlusion",
        source: "after Mittring",
        world: false,
        rays: None,
        // 16, as published.
        samples: None,
        volumes: false,
        sparse: &[1],
    },
    PixelEntry {
        method: PixelMethod::Volumetric,
        name: "volumetric",
        title: "Volumetric ambient occlusion",
        source: "after Szirmay-Kalos",
        world: false,
        rays: None,
        samples: Some(32),
        volumes: false,
        sparse: &[1],
    },
    PixelEntry {
        method: PixelMethod::Hbao,
        name: "hbao",
        title: "Horizon-based ambient occlusion",
        source: "after Bavoil",
        world: false,
        rays: None,
        // Six directions of six steps.
        samples: Some(36),
        volumes: false,
        sparse: &[1],
    },
];

impl PixelMethod {
    /// The method called `name`.
    ///
    /// # Errors
    /// [`Error::Config`] with the names that there are.
    pub fn parse(name: &str) -> Result<Self> {
        let found = PIXEL_METHODS.iter().find(|entry| entry.name == name);
        found.map(|entry| entry.method).ok_or_else(|| {
            let names: Vec<_> = PIXEL_METHODS.iter().map(|entry| entry.name).collect();
            Error::refused("method", format!("{}: expected {}", quoted(name), names.join(", ")))
        })
    }

    /// What is known of it.
    ///
    /// # Panics
    /// Never: a test holds that every method has an entry.
    pub fn entry(self) -> &'static PixelEntry {
        PIXEL_METHODS.iter().find(|entry| entry.method == self).expect("every method has an entry")
    }

    /// Names of those that read nothing but an image.
    pub fn of_images() -> Vec<&'static str> {
        PIXEL_METHODS.iter().filter(|entry| !entry.world).map(|entry| entry.name).collect()
    }

    /// Its name in scene files.
    pub fn name(self) -> &'static str {
        self.entry().name
    }
}

/// How surfaces are occluded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelOcclusion {
    /// By which method.
    pub method: PixelMethod,
    /// How far obscurance reaches, δ of AOV §5.1, in mm; `None` is [`Self::SHARE`] of the half diagonal of all meshes.
    pub delta_mm: Option<f32>,
    /// Rays of a pixel, 1 … [`Self::MOST_RAYS`]; of methods that follow rays.
    pub rays: u32,
    /// Every so many-th pixel in each direction is computed, the others are interpolated; 1 computes all.
    pub sparse: u32,
    /// Texels that are read around a pixel, 1 … [`Self::MOST_SAMPLES`]; of methods that read any.
    pub samples: u32,
    /// Whether corners of volumes are clamped to 2 δ from those of their triangles, as printed (AOV §5.2), which cuts off what corners from 60° on
    /// occlude; of methods that have volumes.
    pub clamp: bool,
}

impl Default for PixelOcclusion {
    /// Of the first method of the list.
    fn default() -> Self {
        Self::of(PIXEL_METHODS[0].method)
    }
}

impl PixelOcclusion {
    /// Most rays of a pixel: their sum in whole numbers of 2⁻¹⁶ fits 32 bits.
    pub const MOST_RAYS: u32 = 1 << 16;
    /// Most samples of a pixel: what AOV figure 9 goes up to.
    pub const MOST_SAMPLES: u32 = 1024;
    /// δ where nobody names one, as a share of the half diagonal of all meshes.
    pub const SHARE: f32 = 0.1;

    /// A method as its entry has it.
    pub fn of(method: PixelMethod) -> Self {
        let entry = method.entry();
        Self {
            method,
            delta_mm: None,
            rays: entry.rays.unwrap_or(1),
            sparse: 1,
            samples: entry.samples.unwrap_or(1),
            clamp: false,
        }
    }

    /// δ in mm among meshes within these bounds.
    pub fn delta_mm(&self, (low, high): (glam::Vec3, glam::Vec3)) -> f32 {
        self.delta_mm.unwrap_or(Self::SHARE * 0.5 * (high - low).length())
    }

    /// Refuses what the method does not have.
    ///
    /// # Errors
    /// [`Error::Config`] naming the setting, what was found and what is allowed.
    pub fn check(&self) -> Result<()> {
        let (entry, name) = (self.method.entry(), self.method.name());
        if let Some(mm) = self.delta_mm.filter(|mm| !(mm.is_finite() && *mm > 0.0)) {
            return Err(Error::refused("delta_mm", format!("{mm}: expected a length > 0 mm")));
        }
        for (what, given, usual, most) in [
            ("rays", self.rays, entry.rays, Self::MOST_RAYS),
            ("samples", self.samples, entry.samples, Self::MOST_SAMPLES),
        ] {
            match usual {
                None if given != 1 => {
                    return Err(Error::refused(what, format!("{given}: the method {name} has no {what}")));
                }
                Some(_) if !(1..=most).contains(&given) => {
                    return Err(Error::refused(what, format!("{given}: expected 1 to {most}")));
                }
                _ => {}
            }
        }
        if self.clamp && !entry.volumes {
            return Err(Error::refused("clamp", format!("true: the method {name} has no volumes")));
        }
        if !entry.sparse.contains(&self.sparse) {
            let allowed: Vec<_> = entry.sparse.iter().map(u32::to_string).collect();
            let problem = format!("{}: expected {} of the method {name}", self.sparse, allowed.join(", "));
            return Err(Error::refused("sparse", problem));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn every_method_has_one_entry_and_passes_as_it_stands() {
        let all = [
            PixelMethod::Aov,
            PixelMethod::Rays,
            PixelMethod::Crytek,
            PixelMethod::Volumetric,
            PixelMethod::Hbao,
        ];
        assert_eq!(all.len(), PIXEL_METHODS.len());
        for method in all {
            assert_eq!(PIXEL_METHODS.iter().filter(|entry| entry.method == method).count(), 1);
            assert_eq!(PixelMethod::parse(method.name()), Ok(method));
            assert_eq!(PixelOcclusion::of(method).check(), Ok(()));
        }
        assert_eq!(PixelOcclusion::default().method, PixelMethod::Aov);
        let refusal = PixelMethod::parse("ssao").unwrap_err().to_string();
        assert_eq!(refusal, "method: \"ssao\": expected aov, rays, crytek, volumetric, hbao");
    }

    #[test]
    fn what_a_method_does_not_have_is_refused_by_name() {
        let of = PixelOcclusion::of;
        for (settings, expected) in [
            (
                PixelOcclusion { delta_mm: Some(0.0), ..of(PixelMethod::Aov) },
                "delta_mm: 0: expected a length",
            ),
            (PixelOcclusion { delta_mm: Some(f32::NAN), ..of(PixelMethod::Hbao) }, "delta_mm: NaN"),
            (PixelOcclusion { rays: 0, ..of(PixelMethod::Rays) }, "rays: 0: expected 1 to 65536"),
            (PixelOcclusion { rays: 9, ..of(PixelMethod::Aov) }, "rays: 9: the method aov has no rays"),
            (
                PixelOcclusion { samples: 1025, ..of(PixelMethod::Volumetric) },
                "samples: 1025: expected 1 to 1024",
            ),
            (PixelOcclusion { samples: 2, ..of(PixelMethod::Rays) }, "the method rays has no samples"),
            (
                PixelOcclusion { clamp: true, ..of(PixelMethod::Hbao) },
                "clamp: true: the method hbao has no volumes",
            ),
            (PixelOcclusion { sparse: 4, ..of(PixelMethod::Aov) }, "sparse: 4: expected 1, 3, 5, 15 of"),
            (
                PixelOcclusion { sparse: 3, ..of(PixelMethod::Hbao) },
                "sparse: 3: expected 1 of the method hbao",
            ),
        ] {
            let found = settings.check().unwrap_err().to_string();
            assert!(found.starts_with(expected) || found.ends_with(expected), "{found}, not {expected}");
        }
    }

    #[test]
    fn delta_is_a_tenth_of_the_half_diagonal_unless_given() {
        let bounds = (Vec3::splat(-1.0), Vec3::new(2.0, 3.0, -1.0));
        assert!((PixelOcclusion::default().delta_mm(bounds) - 0.25).abs() < 1e-6);
        let given = PixelOcclusion { delta_mm: Some(7.0), ..PixelOcclusion::default() };
        assert_eq!(given.delta_mm(bounds), 7.0);
    }
}
