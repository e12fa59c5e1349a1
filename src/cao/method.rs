//! The methods of the list, each with what makes it.

use crate::Result;
use crate::ambient::Ambient;
use crate::by_brick::ByBrick;
use crate::cast::contextual::Contextual;
use crate::cast::full::Full;
use crate::cones::traced::Cones;
use crate::features::driven::Driven;
use crate::histograms::clustered::Clustered;
use crate::network::predicted::Predicted;
use crate::rays::traced::Traced;
use crate::spao::shells::Shells;
use crate::subject::Subject;
use crate::tables::summed::Summed;
use crate::vicinity::shaded::Shaded;
use cao_model::methods::Method;

/// What the library knows of a method beside its entry in [`cao_model::METHODS`].
struct Maker {
    method: Method,
    new: fn(&Subject) -> Result<Box<dyn Ambient>>,
    /// How far in mm it wants the maps of clip meshes dilated, if it wants any.
    map_radius: fn(&Subject) -> Option<f32>,
}

const MAKERS: &[Maker] = &[
    // Changes are found in the opacities and the features; nothing is dilated.
    Maker {
        method: Method::FeatureDriven,
        new: |on| Ok(Box::new(ByBrick::<Driven>::new(on)?)),
        map_radius: |_| None,
    },
    Maker {
        method: Method::Lao,
        new: |on| Ok(Box::new(Full::new(on)?)),
        map_radius: |on| Some(crate::cast::map_radius(on)),
    },
    Maker {
        method: Method::Cao,
        new: |on| Ok(Box::new(Contextual::new(on)?)),
        map_radius: |on| Some(crate::cast::map_radius(on)),
    },
    Maker { method: Method::Cones, new: |on| Ok(Box::new(ByBrick::<Cones>::new(on)?)), map_radius: |_| None },
    Maker { method: Method::Spao, new: |on| Ok(Box::new(ByBrick::<Shells>::new(on)?)), map_radius: |_| None },
    // Changes are found in the opacities; nothing is dilated.
    Maker { method: Method::Rays, new: |on| Ok(Box::new(ByBrick::<Traced>::new(on)?)), map_radius: |_| None },
    Maker {
        method: Method::Sat,
        new: |on| Ok(Box::new(ByBrick::<Summed<false>>::new(on)?)),
        map_radius: |_| None,
    },
    Maker {
        method: Method::Shells,
        new: |on| Ok(Box::new(ByBrick::<Summed<true>>::new(on)?)),
        map_radius: |_| None,
    },
    Maker {
        method: Method::Vicinity,
        new: |on| Ok(Box::new(ByBrick::<Shaded>::new(on)?)),
        map_radius: |_| None,
    },
    Maker {
        method: Method::Deep,
        new: |on| Ok(Box::new(ByBrick::<Predicted>::new(on)?)),
        map_radius: |_| None,
    },
    Maker {
        method: Method::Histograms,
        new: |on| Ok(Box::new(ByBrick::<Clustered>::new(on)?)),
        map_radius: |_| None,
    },
];

fn maker(on: &Subject) -> &'static Maker {
    MAKERS.iter().find(|maker| maker.method == on.setup.method).expect("every method has a maker")
}

/// The method that the subject's settings name.
pub(crate) fn of(on: &Subject) -> Result<Box<dyn Ambient>> {
    (maker(on).new)(on)
}

/// How far in mm this method wants the maps of clip meshes dilated, if it wants any.
pub(crate) fn map_radius(on: &Subject) -> Option<f32> {
    (maker(on).map_radius)(on)
}

/// Whether its opacities take in solids: those of methods that find what changed in the opacities themselves.
pub(crate) fn takes_solids(on: &Subject) -> bool {
    map_radius(on).is_none()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_listed_method_has_a_maker() {
        for entry in cao_model::METHODS {
            assert_eq!(
                MAKERS.iter().filter(|maker| maker.method == entry.method).count(),
                1,
                "{}",
                entry.name
            );
        }
    }
}
