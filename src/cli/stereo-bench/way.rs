//! The ways to draw a frame that are compared: how each sets up a renderer and lights its samples.

use cao_model::METHODS;
use cao_model::look::{Look, Shading};
use cao_model::methods::Method;
use cao_model::settings::{MapSettings, Setup};
use std::fmt;

/// A way to draw a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// No ambient occlusion, the paper's "solid colour" (CAO Table 3): clipped like the others.
    Solid,
    /// A method of the list.
    By(Method),
    /// [`Method::Cao`] with the dilation maps of the paper to the letter, which leave voxels stale.
    CaoLiteral,
}

impl Way {
    /// What speed-ups are quoted against: everything anew in every frame, as the paper has it.
    pub const BASELINE: Self = Self::By(Method::Lao);

    /// Every way: the methods in the order of their list, the variant after what it varies.
    pub fn all() -> Vec<Self> {
        let varied = |method| (method == Method::Cao).then_some(Self::CaoLiteral);
        let of = |method| [Self::By(method)].into_iter().chain(varied(method));
        std::iter::once(Self::Solid).chain(METHODS.iter().flat_map(|entry| of(entry.method))).collect()
    }

    /// Name on the command line and in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Solid => "solid",
            Self::By(method) => method.name(),
            Self::CaoLiteral => "cao-literal",
        }
    }

    /// The way of this name.
    pub fn parse(text: &str) -> Result<Self, String> {
        let all = Self::all();
        let names: Vec<_> = all.iter().map(|way| way.name()).collect();
        let found = all.iter().find(|way| way.name() == text).copied();
        found.ok_or_else(|| format!("expected one of {}", names.join(", ")))
    }

    /// The renderer's settings, from those that all share: a method that lacks the rule takes its own.
    pub fn setup(self, shared: Setup) -> Setup {
        let mut setup = shared;
        match self {
            // What is not shown is not computed: without a neighbourhood nothing is occluded. So does `cao render --shading phong`.
            Self::Solid => setup.occlusion.radius_mm = 0.0,
            Self::By(method) => setup.method = method,
            Self::CaoLiteral => {
                setup.method = Method::Cao;
                // The literal recipe has one resolution for both maps.
                let resolution = shared.maps.resolution;
                setup.maps = MapSettings { literal: true, cells: resolution, ..shared.maps };
            }
        }
        if !setup.method.has(setup.occlusion.quadrature) {
            setup.occlusion.quadrature = setup.method.quadrature();
        }
        setup.occlusion.rays = setup.method.rays_like(setup.occlusion.rays);
        setup
    }

    /// How samples are lit.
    pub fn look(self) -> Look {
        let shading = if self == Self::Solid { Shading::Phong } else { Shading::PhongAo };
        Look { shading, ..Look::default() }
    }
}

impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::occlusion::Quadrature;

    /// Files of earlier runs have these names.
    #[test]
    fn names_stay_and_every_method_is_there() {
        let names: Vec<_> = Way::all().into_iter().map(Way::name).collect();
        let methods = ["sat", "shells", "vicinity", "histograms", "dvao", "fdao", "spao", "cones"];
        let ways = methods.into_iter().chain(["lao", "cao", "cao-literal", "rays"]);
        assert_eq!(names, std::iter::once("solid").chain(ways).collect::<Vec<_>>());
        for way in Way::all() {
            assert_eq!(Way::parse(way.name()), Ok(way));
        }
        assert!(Way::parse("none").is_err_and(|said| said.contains("cao-literal, rays")));
    }

    #[test]
    fn every_way_has_settings_that_its_method_has() {
        for shared in Quadrature::ALL {
            let mut setup = Setup::of(Method::Cao, 1.0);
            setup.occlusion.quadrature = shared;
            for way in Way::all() {
                let own = way.setup(setup);
                own.check(1.0).unwrap_or_else(|error| panic!("{way} {shared:?}: {error}"));
            }
        }
    }
}
