//! Clip shapes, their poses, and which points they hide (CAO §3.2).

use crate::error::quoted;
use crate::mesh::TriangleMesh;
use crate::{Error, Result};
use glam::{Mat3, Quat, Vec2, Vec3};
use std::sync::Arc;

/// A clip shape in its local coordinates: millimetres at scale 1, centred on the volume's centre until moved.
#[derive(Clone, Debug)]
pub enum Shape {
    /// The half-space z > 0.
    Plane,
    /// The cube |x|, |y|, |z| < 1.
    Box,
    /// The ball of radius 1.
    Sphere,
    /// Axis z, radius 1, |z| < 1.
    Cylinder,
    /// Axis z, apex at z = 1, base of radius 1 at z = −1.
    Cone,
    /// Ring of radius 1 in the xy plane, tube of radius 0.4.
    Torus,
    /// A closed triangle mesh in millimetres.
    Mesh(Arc<TriangleMesh>),
}

impl Shape {
    /// The analytic shapes.
    pub const ANALYTIC: [Self; 6] =
        [Self::Plane, Self::Box, Self::Sphere, Self::Cylinder, Self::Cone, Self::Torus];

    /// Name on the command line and in scene files; a mesh answers its own name.
    pub fn name(&self) -> &str {
        match self {
            Self::Plane => "plane",
            Self::Box => "box",
            Self::Sphere => "sphere",
            Self::Cylinder => "cylinder",
            Self::Cone => "cone",
            Self::Torus => "torus",
            Self::Mesh(mesh) => &mesh.name,
        }
    }

    /// Largest coordinate of its points in local units; none of a half-space.
    fn size(&self) -> Option<f32> {
        match self {
            Self::Plane => None,
            Self::Mesh(mesh) => {
                let (low, high) = mesh.bounds();
                Some(low.abs().max(high.abs()).max_element())
            }
            _ => Some(1.0),
        }
    }

    /// The analytic shape called `name`.
    pub fn parse(name: &str) -> Result<Self> {
        Self::ANALYTIC.into_iter().find(|shape| shape.name() == name).ok_or_else(|| Error::Config {
            what: "clip".into(),
            problem: format!(
                "{} is no shape; there are plane, box, sphere, cylinder, cone, torus, and any file.obj",
                quoted(name)
            ),
        })
    }

    /// Signed distance in local units, negative inside, exact; `None` for a mesh, whose inside is its depth layers'.
    pub fn distance(&self, p: Vec3) -> Option<f32> {
        let ring = Vec2::new(p.x, p.y).length();
        Some(match self {
            Self::Plane => -p.z,
            Self::Box => box_distance(p, Vec3::ONE),
            Self::Sphere => p.length() - 1.0,
            Self::Cylinder => {
                let d = Vec2::new(ring - 1.0, p.z.abs() - 1.0);
                d.max_element().min(0.0) + d.max(Vec2::ZERO).length()
            }
            Self::Cone => {
                // Nearest of the base disc and the flank from (1,-1) to (0,1), in the half-plane of p.
                let q = Vec2::new(ring, p.z);
                let base = Vec2::new(q.x - q.x.min(1.0), q.y + 1.0);
                let flank = Vec2::new(-1.0, 2.0);
                let along = ((q - Vec2::new(1.0, -1.0)).dot(flank) / 5.0).clamp(0.0, 1.0);
                let side = q - Vec2::new(1.0, -1.0) - flank * along;
                let nearest = base.length_squared().min(side.length_squared()).sqrt();
                let inside = q.y > -1.0 && q.x * 2.0 + q.y < 1.0;
                if inside { -nearest } else { nearest }
            }
            Self::Torus => Vec2::new(ring - 1.0, p.z).length() - 0.4,
            Self::Mesh(_) => return None,
        })
    }
}

fn box_distance(p: Vec3, half: Vec3) -> f32 {
    let d = p.abs() - half;
    d.max_element().min(0.0) + d.max(Vec3::ZERO).length()
}

/// Which side of a shape disappears.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// The inside is invisible: the shape is subtracted.
    Remove,
    /// The outside is invisible: the shape probes the volume.
    Keep,
}

impl Mode {
    /// `remove` or `keep`.
    pub fn parse(name: &str) -> Result<Self> {
        match name {
            "remove" => Ok(Self::Remove),
            "keep" => Ok(Self::Keep),
            _ => Err(Error::Config {
                what: "clip mode".into(),
                problem: format!("{}; expected remove or keep", quoted(name)),
            }),
        }
    }
}

/// Where a shape stands: `p_world = T + Rz·Ry·Rx·(S·p_local)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Translation in mm from the volume's centre along its axes.
    pub translate_mm: Vec3,
    /// Rotation in degrees about the fixed axes x, then y, then z.
    pub rotate_deg: Vec3,
    /// Scale along the shape's own axes, each > 0.
    pub scale: Vec3,
}

impl Default for Pose {
    fn default() -> Self {
        Self { translate_mm: Vec3::ZERO, rotate_deg: Vec3::ZERO, scale: Vec3::ONE }
    }
}

impl Pose {
    /// Refuses what is no pose in any volume: numbers that are not finite, scales that are not above 0.
    pub fn check(&self) -> Result<()> {
        let refuse = |what: &str, problem: String| Err(Error::Config { what: what.into(), problem });
        if !self.translate_mm.is_finite() {
            return refuse("clip translation", format!("{} mm; expected numbers", self.translate_mm));
        }
        if !self.rotate_deg.is_finite() {
            return refuse("clip rotation", format!("{} degrees; expected numbers", self.rotate_deg));
        }
        if !(self.scale.is_finite() && self.scale.min_element() > 0.0) {
            return refuse("clip scale", format!("{}; expected a number > 0 on each axis", self.scale));
        }
        Ok(())
    }

    /// Rotation matrix `Rz·Ry·Rx`.
    pub fn rotation(&self) -> Mat3 {
        let r = self.rotate_deg.map(f32::to_radians);
        Mat3::from_quat(Quat::from_rotation_z(r.z) * Quat::from_rotation_y(r.y) * Quat::from_rotation_x(r.x))
    }

    /// World point → the shape's rigid frame: millimetres, before scaling.
    pub fn to_rigid(&self, world: Vec3) -> Vec3 {
        self.rotation().transpose() * (world - self.translate_mm)
    }
}

/// A clip shape at its pose.
#[derive(Clone, Debug)]
pub struct Clip {
    /// The shape.
    pub shape: Shape,
    /// Which side disappears.
    pub mode: Mode,
    /// Where it stands.
    pub pose: Pose,
}

impl Clip {
    /// Most clips in a scene at once.
    pub const MAX: usize = 8;

    /// A clip that removes the inside of `shape`, unmoved and unscaled.
    pub fn remove(shape: Shape) -> Self {
        Self { shape, mode: Mode::Remove, pose: Pose::default() }
    }

    /// How much farther away or larger than the volume's half diagonal a clip may be, and how much smaller: beyond, f32 has no digits left
    /// for the place of its surface.
    const MOST: f32 = 1e7;

    /// Refuses poses that are none, or none in a volume whose half diagonal is `half_mm`.
    ///
    /// # Errors
    /// [`Error::Config`] naming what is refused, and the lengths that would do.
    pub fn check(&self, half_mm: f32) -> Result<()> {
        self.pose.check()?;
        let (shape, most) = (self.shape.name(), Self::MOST * half_mm);
        let refuse = |what: &str, problem: String| Err(Error::Config { what: what.into(), problem });
        if self.pose.translate_mm.abs().max_element() > most {
            let problem = format!(
                "{} mm of {shape}; expected at most {most:e} mm in this volume",
                self.pose.translate_mm
            );
            return refuse("clip translation", problem);
        }
        let least = half_mm / Self::MOST;
        // A half-space has no size.
        let Some(size) = self.shape.size() else { return Ok(()) };
        if !(self.pose.scale.min_element() * size >= least && self.pose.scale.max_element() * size <= most) {
            let sizes = self.pose.scale * size;
            let problem = format!(
                "{shape} is {sizes} mm large; expected {least:e} … {most:e} mm along each axis in this volume"
            );
            return refuse("clip scale", problem);
        }
        Ok(())
    }

    /// Whether an analytic clip hides this world point (mm); `None` for a mesh. A point on the surface is visible,
    /// as in CAO eq. (1).
    pub fn hides(&self, world: Vec3) -> Option<bool> {
        let inside = self.shape.distance(self.pose.to_rigid(world) / self.pose.scale)? < 0.0;
        Some(inside == (self.mode == Mode::Remove))
    }

    /// What rounding of distances in f32 asks for beyond `radius_mm` around what this clip hides, in mm, in a volume whose
    /// half diagonal is `half_mm`. For a mesh it is a thousandth of the radius where that is enough, else the next power of
    /// two, so that a mesh that moves rarely needs new maps.
    pub fn rounding_mm(&self, half_mm: f32, radius_mm: f32) -> f32 {
        let size = self.shape.size().unwrap_or(0.0);
        // In f64, which holds the square of every f32.
        let away = self.pose.translate_mm.as_dvec3().length() as f32;
        let extent = away + 2.0 * size * self.pose.scale.max_element() + half_mm;
        // A handful of operations on numbers of this size, each right to half a unit in the last place.
        let bound = 16.0 * f32::EPSILON * extent;
        match self.shape {
            Shape::Mesh(_) if bound < 1e-3 * radius_mm => 1e-3 * radius_mm,
            Shape::Mesh(_) => bound.log2().ceil().exp2(),
            _ => bound,
        }
    }

    /// A lower bound in mm of the distance from this world point to the region that an analytic clip hides, ≤ 0
    /// inside it; `None` for a mesh. Exact for planes, boxes and uniformly scaled shapes.
    pub fn distance_to_hidden(&self, world: Vec3) -> Option<f32> {
        let rigid = self.pose.to_rigid(world);
        let distance = match self.shape {
            Shape::Plane => -rigid.z,
            Shape::Box => box_distance(rigid, self.pose.scale),
            _ => self.shape.distance(rigid / self.pose.scale)? * self.pose.scale.min_element(),
        };
        Some(if self.mode == Mode::Remove { distance } else { -distance })
    }
}

/// The orthographic clip camera of a mesh (CAO §3.4 step 2): rigidly attached to the scaled mesh, looking along its
/// +z, square pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipCamera {
    /// Corner of pixel (0, 0) at depth 0, in the mesh's rigid frame, mm.
    pub corner: Vec3,
    /// Edge of a pixel in mm.
    pub pixel_mm: f32,
    /// Millimetres from depth 0 to depth 1.
    pub depth_mm: f32,
    /// Pixels along each edge of the map.
    pub resolution: u32,
}

impl ClipCamera {
    /// The camera of a mesh scaled by `scale`, with `margin_mm` and a pixel around its bounds.
    pub fn around(mesh: &TriangleMesh, scale: Vec3, margin_mm: f32, resolution: u32) -> Self {
        let (low, high) = mesh.bounds();
        let (low, high) = (low * scale - margin_mm, high * scale + margin_mm);
        let size = high - low;
        // One pixel of border on each side keeps silhouettes off the map's edge, and faces off its first and last depth.
        let pixel_mm = (size.x.max(size.y) / (resolution - 2) as f32).max(f32::EPSILON * size.z);
        let centre = (low + high) * 0.5;
        let edge = pixel_mm * resolution as f32;
        Self {
            corner: Vec3::new(centre.x - edge * 0.5, centre.y - edge * 0.5, low.z - pixel_mm),
            pixel_mm,
            depth_mm: size.z + 2.0 * pixel_mm,
            resolution,
        }
    }

    /// The camera of this one's dilation maps: `resolution` cells along an edge that leaves `radius_mm` around the map, the
    /// same depths.
    pub fn widened(&self, radius_mm: f32, resolution: u32) -> Self {
        let edge = self.pixel_mm * self.resolution as f32;
        let cell = (edge + 2.0 * radius_mm) / (resolution - 2) as f32;
        let shift = 0.5 * (edge - cell * resolution as f32);
        Self {
            corner: self.corner + Vec3::new(shift, shift, 0.0),
            pixel_mm: cell,
            depth_mm: self.depth_mm,
            resolution,
        }
    }

    /// The camera that sees a mesh so many times as large as this one sees it.
    pub fn larger(&self, times: f32) -> Self {
        Self {
            corner: self.corner * times,
            pixel_mm: self.pixel_mm * times,
            depth_mm: self.depth_mm * times,
            resolution: self.resolution,
        }
    }

    /// Point of the rigid frame (mm) → (pixel x, pixel y, depth 0 … 1).
    pub fn map(&self, rigid: Vec3) -> Vec3 {
        (rigid - self.corner) / Vec3::new(self.pixel_mm, self.pixel_mm, self.depth_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Brute force: no surface point of the shape is nearer than |distance|, and some point comes close.
    #[test]
    fn distances_are_exact() {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as f32 / (1 << 24) as f32 * 4.0 - 2.0
        };
        for shape in Shape::ANALYTIC {
            for _ in 0..40 {
                let p = Vec3::new(random(), random(), random());
                let d = shape.distance(p).unwrap();
                // March to the surface along the gradient: it must be hit at |d|.
                let h = 1e-3;
                let axis = [Vec3::X, Vec3::Y, Vec3::Z];
                let g = Vec3::from_array(axis.map(|a| {
                    (shape.distance(p + a * h).unwrap() - shape.distance(p - a * h).unwrap()) / (2.0 * h)
                }));
                if (g.length() - 1.0).abs() < 1e-2 {
                    let surface = shape.distance(p - g.normalize() * d).unwrap();
                    assert!(surface.abs() < 2e-2, "{} {p}: {surface}", shape.name());
                }
                // 1-Lipschitz: nothing nearer than |d| changes side.
                for _ in 0..40 {
                    let q = p + Vec3::new(random(), random(), random()).normalize_or_zero() * d.abs() * 0.99;
                    assert!(shape.distance(q).unwrap() * d >= 0.0, "{} {p} {q}", shape.name());
                }
            }
        }
    }

    #[test]
    fn the_bound_never_exceeds_the_distance_under_any_scale() {
        let mut state = 7_u32;
        let mut random = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as f32 / (1 << 24) as f32 * 2.0 - 1.0
        };
        for shape in Shape::ANALYTIC {
            for mode in [Mode::Remove, Mode::Keep] {
                for _ in 0..200 {
                    let pose = Pose {
                        translate_mm: Vec3::new(random(), random(), random()) * 5.0,
                        rotate_deg: Vec3::new(random(), random(), random()) * 180.0,
                        scale: Vec3::new(random(), random(), random()) * 4.0 + 5.0,
                    };
                    let clip = Clip { shape: shape.clone(), mode, pose };
                    let p = Vec3::new(random(), random(), random()) * 15.0;
                    let bound = clip.distance_to_hidden(p).unwrap();
                    assert_eq!(bound < 0.0, clip.hides(p).unwrap(), "{} at {p}", shape.name());
                    for _ in 0..20 {
                        let q = p + Vec3::new(random(), random(), random()).normalize_or_zero()
                            * bound.abs()
                            * 0.999;
                        assert_eq!(clip.hides(p), clip.hides(q), "{} {p} {q} bound {bound}", shape.name());
                    }
                }
            }
        }
    }

    #[test]
    fn rotation_is_about_fixed_x_then_y_then_z() {
        let pose = Pose { rotate_deg: Vec3::new(90.0, 0.0, 90.0), ..Pose::default() };
        // y → z by x, z stays z by z.
        assert!((pose.rotation() * Vec3::Y - Vec3::Z).length() < 1e-6);
        // x stays x by x, x → y by z.
        assert!((pose.rotation() * Vec3::X - Vec3::Y).length() < 1e-6);
    }
}
