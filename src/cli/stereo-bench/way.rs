//! The methods that are compared: how each sets up a renderer and lights its samples.

use cao_model::look::Look;
use cao_model::methods;
use cao_model::settings::MapSettings;
use cao_model::settings::Setup;
use std::fmt;

/// A way to draw a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// No ambient occlusion, the paper's "solid colour" (CAO Table 3): clipped like the others.
    Solid,
    /// Everything anew in every frame, the paper's baseline.
    Lao,
    /// What the clip changed.
    Cao,
    /// The same with the dilation maps of the paper to the letter, which leave voxels stale.
    CaoLiteral,
    /// Line sweeps, where opacities changed; rays by their own rule.
    Sweep,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 5] = [Self::Solid, Self::Lao, Self::Cao, Self::CaoLiteral, Self::Sweep];

    /// Name on the command line and in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Solid => "solid",
            Self::Lao => "lao",
            Self::Cao => "cao",
            Self::CaoLiteral => "cao-literal",
            Self::Sweep => "sweep",
        }
    }

    /// The method of this name.
    pub fn parse(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|method| method.name() == text);
        found.ok_or_else(|| format!("expected one of {}", Self::ALL.map(Self::name).join(", ")))
    }

    /// The renderer's settings, from those that all methods share.
    pub fn setup(self, shared: Setup) -> Setup {
        let mut setup = Setup { method: methods::Method::Cao, ..shared };
        match self {
            // What is not shown is not computed: without a neighbourhood nothing is occluded. So does `cao render --solid`.
            Self::Solid => setup.occlusion.radius_mm = 0.0,
            Self::Lao => setup.method = methods::Method::Lao,
            Self::Cao => {}
            Self::CaoLiteral => {
                // The literal recipe has one resolution for both maps.
                let resolution = shared.maps.resolution;
                setup.maps = MapSettings { literal: true, cells: resolution, ..shared.maps };
            }
            Self::Sweep => {
                setup.method = methods::Method::Sweep;
                setup.occlusion.quadrature = methods::Method::Sweep.quadrature();
            }
        }
        setup
    }

    /// How samples are lit.
    pub fn look(self) -> Look {
        Look { occluded: self != Self::Solid, ..Look::default() }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
