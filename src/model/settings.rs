//! How occlusion is computed: everything that a renderer can be told about it, as plain data.

use crate::light::Lights;
use crate::methods::{METHODS, Method};
use crate::occlusion::{Occlusion, RaySet};
use crate::options::Options;
use crate::{Error, Result};

/// How occlusion is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    /// Rays, quadrature, radius.
    pub occlusion: Occlusion,
    /// Which method.
    pub method: Method,
    /// What this method takes beside.
    pub options: Options,
    /// Which voxels get a value.
    pub scope: Scope,
    /// Samples at cut voxels.
    pub anti_aliasing: AntiAliasing,
    /// Depth maps of clip meshes.
    pub maps: MapSettings,
}

impl Setup {
    /// A method with its own rays and rule, 20 voxels of the smallest spacing (mm) far, only needed voxels.
    pub fn of(method: Method, min_spacing: f64) -> Self {
        let paper = Occlusion::paper(min_spacing);
        Self {
            occlusion: Occlusion { rays: method.rays(), quadrature: method.quadrature(), ..paper },
            method,
            options: Options::DEFAULT,
            scope: Scope::Needed,
            anti_aliasing: AntiAliasing::N32,
            maps: MapSettings::default(),
        }
    }

    /// Refuses lengths, rays and lights that there are none of, and a rule, rays, a light or an option that the method does not have.
    ///
    /// # Errors
    /// As [`Occlusion::check`], and [`Error::Config`] naming what the method has not, and what it has.
    pub fn check(&self, min_spacing: f64) -> Result<()> {
        self.occlusion.check(min_spacing)?;
        let (rule, entry) = (self.occlusion.quadrature, self.method.entry());
        if !self.method.has(rule) {
            let own: Vec<&str> = entry.quadratures.iter().map(|rule| rule.name()).collect();
            let problem = format!(
                "{:?} is no rule of method {}, which has {}",
                rule.name(),
                entry.name,
                own.join(", ")
            );
            return Err(Error::refused("quadrature", problem));
        }
        let rays = self.occlusion.rays;
        if !self.method.follows(rays) {
            let problem = match rays {
                RaySet::None => {
                    format!("method {} follows rays; expected {}, say", entry.name, entry.rays.name())
                }
                _ => format!("{:?}, but method {} follows no rays", rays.name(), entry.name),
            };
            return Err(Error::refused("rays", problem));
        }
        let needs = self.occlusion.light.needs();
        if entry.lights < needs {
            let having = METHODS.iter().filter(|entry| entry.lights >= needs).map(|entry| entry.name);
            let (what, having) = (needs.name(), having.collect::<Vec<_>>().join(", "));
            let has = entry.lights.name();
            let problem =
                format!("{what}, but method {} has {has} only; methods with it: {having}", entry.name);
            return Err(Error::refused("light", problem));
        }
        for (name, _) in self.options.other_than(&Options::DEFAULT) {
            if !entry.options.contains(&name) {
                let has = match entry.options {
                    [] => "none".to_owned(),
                    some => some.join(", "),
                };
                let problem = format!("{name:?} is no option of method {}, which has {has}", entry.name);
                return Err(Error::refused("option", problem));
            }
        }
        Ok(())
    }

    /// Whether V_AO has red, green and blue: in coloured light, and where matter lends its colour.
    pub fn coloured(&self) -> bool {
        self.occlusion.light.needs() == Lights::Coloured || self.options.bleeding > 0.0
    }

    /// The default method: what to use where the paper's numbers are not the point.
    pub fn new(min_spacing: f64) -> Self {
        Self::of(Method::default(), min_spacing)
    }
}

/// Which voxels get a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// Every voxel.
    All,
    /// Only voxels with opacity in their 3³: no sample that has opacity interpolates any other. The rest hold 1.
    Needed,
}

/// How voxels that a clip's surface passes through are sampled (CAO eq. (5), method.md §6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AntiAliasing {
    /// Samples beyond centre and corners: N.
    pub samples: Samples,
    /// How far from the centre they lie.
    pub support: Support,
    /// Which of them make the share.
    pub estimator: Estimator,
}

impl AntiAliasing {
    /// The default but for N = 0.
    pub const N0: Self = Self { samples: Samples::N0, ..Self::N32 };
    /// The default but for N = 8.
    pub const N8: Self = Self { samples: Samples::N8, ..Self::N32 };
    /// The default: the paper's N = 32.
    pub const N32: Self =
        Self { samples: Samples::N32, support: Support::Voxel, estimator: Estimator::Interior };
}

/// N of CAO eq. (5).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Samples {
    /// None.
    N0 = 0,
    /// 8.
    N8 = 8,
    /// 32, as the paper has it.
    N32 = 32,
}

/// How far from a voxel's centre its clip samples lie along each axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Support {
    /// Half a voxel: they fill the voxel.
    Voxel,
    /// A voxel, the corners a little more, as the paper's authors have it: they fill eight times the voxel's room.
    Neighbours,
}

impl Support {
    /// The N further samples, in voxels, at most.
    pub fn extent(self) -> f32 {
        match self {
            Self::Voxel => 0.5,
            Self::Neighbours => 1.0,
        }
    }

    /// The corners, in voxels: no sample lies farther out.
    pub fn corner(self) -> f32 {
        match self {
            Self::Voxel => 0.5,
            Self::Neighbours => 1.025,
        }
    }
}

/// Which samples make the share of a cut voxel that is visible. The first nine decide in either whether it is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Estimator {
    /// C_visible / (N + 9), all of them: CAO eq. (5).
    Paper,
    /// The N alone. The corners are shared by eight voxels, and a plane along the axes passes four of them at once. With N = 0 as
    /// [`Self::Paper`].
    Interior,
}

/// Settings of the depth maps of clip meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapSettings {
    /// Pixels along the edge of the depth layers.
    pub resolution: u32,
    /// Cells along the edge of the dilation maps.
    pub cells: u32,
    /// Most layer pairs, 1 … [`MapSettings::MAX_PAIRS`].
    pub pairs: u32,
    /// The paper's recipe instead of the conservative one: eq. (4) as printed, at the layers' resolution and with the ray's
    /// length as radius. It leaves stale voxels; it exists to show that.
    pub literal: bool,
}

impl Default for MapSettings {
    fn default() -> Self {
        Self { resolution: 512, cells: 128, pairs: Self::MAX_PAIRS, literal: false }
    }
}

impl MapSettings {
    /// Most layer pairs of one mesh.
    pub const MAX_PAIRS: u32 = 8;

    /// Refuses what no map can be made of.
    ///
    /// # Errors
    /// [`Error::Config`] naming the setting.
    pub fn check(&self) -> Result<()> {
        let refuse = |what: &str, problem: String| Err(Error::refused(what, problem));
        if !(8..=4096).contains(&self.resolution) {
            return refuse("depth map resolution", format!("{}; expected 8 … 4096 pixels", self.resolution));
        }
        if self.literal && self.cells != self.resolution {
            let wanted = format!("the depth map's, {}, for the literal recipe", self.resolution);
            return refuse("dilation map resolution", format!("{}; expected {wanted}", self.cells));
        }
        if !(4..=4096).contains(&self.cells) {
            return refuse("dilation map resolution", format!("{}; expected 4 … 4096 cells", self.cells));
        }
        if !(1..=Self::MAX_PAIRS).contains(&self.pairs) {
            return refuse("layer pairs", format!("{}; expected 1 … {}", self.pairs, Self::MAX_PAIRS));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::{AmbientLight, Lights};

    /// By name, and with the methods that have it.
    #[test]
    fn a_method_without_a_light_says_which_have_it() {
        let coloured = AmbientLight::harmonics(&[[3.0; 3], [0.5, 0.0, -0.5]]).unwrap();
        for entry in METHODS {
            for (light, needs, having) in [
                (AmbientLight::Uniform, Lights::Uniform, ""),
                (AmbientLight::SKY, Lights::Grey, "methods with it: lao, cao, rays"),
                (coloured, Lights::Coloured, "methods with it: rays"),
            ] {
                let mut setup = Setup::of(entry.method, 1.0);
                setup.occlusion.light = light;
                match setup.check(1.0) {
                    Ok(()) => assert!(entry.lights >= needs, "{} {needs:?}", entry.name),
                    Err(error) => {
                        let said = error.to_string();
                        assert!(entry.lights < needs, "{} {needs:?}", entry.name);
                        let told = said.starts_with("light: ") && said.ends_with(having);
                        assert!(told && said.contains(entry.name) && said.contains(needs.name()), "{said}");
                    }
                }
            }
        }
    }
}
