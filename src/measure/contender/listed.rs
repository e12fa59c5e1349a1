//! Contenders that are methods of [`cao_model::METHODS`], each with the ray sets and rules of its entry.

use super::{Asked, Entrant, HALF_SPHERE, Setting, rendered};
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, RaySet};
use cao_model::options::Options;
use cao_model::settings::Setup;

/// What the chart has to know of a method beside its entry.
pub struct Listed {
    /// Which one.
    pub method: Method,
    /// What an update computes.
    pub computes: &'static str,
    /// Cost of a ray in rays cast from every voxel, told R in voxels.
    pub ray: fn(f64) -> f64,
    /// Its ray sets for a first look: the cheapest and the dearest, and those of the default size.
    pub few: &'static [RaySet],
    /// Whether such values are means over half the sphere: 1 at a flat wall, where the others and the reference have about ½. Errors are
    /// those of half the values, and pictures have half the gain.
    pub half_sphere: fn(&Options) -> bool,
}

impl Listed {
    /// Every rule with every set; for a first look some of each.
    pub fn entrants(&self, name: &'static str, asked: &Asked) -> Vec<Entrant> {
        let entry = self.method.entry();
        let sets = if asked.quick { self.few } else { entry.sets };
        let mut rules = entry.quadratures.to_vec();
        if asked.quick && rules.len() > 2 {
            // The method's own and the most accurate.
            rules.drain(1..rules.len() - 1);
        }
        let own = Setup::of(self.method, asked.min_spacing);
        let rays = rules.iter().flat_map(|&quadrature| {
            sets.iter().map(move |&rays| Occlusion { rays, quadrature, ..own.occlusion })
        });
        // For a first look every other variant: with the entry's order, one of each kind.
        let every = if asked.quick { 2 } else { 1 };
        let settings = rays.flat_map(|occlusion| {
            self.method.variants().step_by(every).map(move |options| Setup { occlusion, options, ..own })
        });
        settings.map(|setup| self.entrant(name, setup, asked)).collect()
    }

    fn entrant(&self, name: &'static str, setup: Setup, asked: &Asked) -> Entrant {
        let occlusion = &setup.occlusion;
        let mut setting = match occlusion.rays {
            RaySet::None => Setting {
                label: occlusion.quadrature.name().into(),
                quadrature: None,
                details: self.computes.into(),
            },
            _ => Setting::rays(occlusion, asked.min_spacing, self.computes),
        };
        let half_sphere = (self.half_sphere)(&setup.options);
        if half_sphere {
            setting.details += ", halved";
        }
        setting.label = with_options(setting.label, &setup.options);
        let work = (self.ray)(asked.radius) * occlusion.rays.count().max(1) as f64;
        rendered::entrant(name, setup, setting, work, if half_sphere { HALF_SPHERE } else { 1.0 })
    }
}

/// A label, and which options are not as every method starts.
pub fn with_options(mut label: String, options: &Options) -> String {
    for (option, value) in options.other_than(&Options::DEFAULT) {
        label += &format!(" {option} {value}");
    }
    label
}
