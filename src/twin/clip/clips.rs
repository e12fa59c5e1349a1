//! Which points the clips hide: shadow test volume clipping (CAO §3.2).
//!
//! ```text
//! visible(p) = (z_p ≤ z_front) ∨ (z_p ≥ z_back)                                   CAO eq. (1)
//! ```
//!
//! For a mesh with P layer pairs in its clip camera, inside(p) holds when some pair has front_k < z_p < back_k, at
//! the pixel that contains p. Analytic shapes use their signed distance. Removing hides the inside, keeping hides the
//! outside; a point is visible when no clip hides it.

use crate::Grid;
use crate::clip::dilate::{self, DilationMap};
use crate::clip::peel::{Report, peel};
use cao_model::Result;
use cao_model::clip::{Clip, ClipCamera, Mode, Shape};
use cao_model::settings::Support;
use glam::{DVec3, Vec3};

/// Depth in `front` of a pixel without a surface, behind everything, and in `back`, before everything.
pub use cao_kernels::shared::layers::{NO_BACK, NO_FRONT};

/// Depth layers of a mesh in its clip camera.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshLayers {
    /// The camera, rigidly attached to the scaled mesh.
    pub camera: ClipCamera,
    /// `front[k][y · resolution + x]`: depth 0 … 1 of the k-th nearest front face, or [`NO_FRONT`].
    pub front: Vec<Vec<f32>>,
    /// The same for back faces, or [`NO_BACK`].
    pub back: Vec<Vec<f32>>,
}

impl MeshLayers {
    /// Whether a point of the mesh's rigid frame (mm) lies between the faces of a pair; never outside the map.
    pub fn inside(&self, rigid: Vec3) -> bool {
        let p = self.camera.map(rigid);
        pixel(&self.camera, p).is_some_and(|pixel| {
            self.front.iter().zip(&self.back).any(|(front, back)| front[pixel] < p.z && p.z < back[pixel])
        })
    }
}

/// Row-major index of the pixel of a camera's map that contains a mapped point, `None` outside the map.
pub(crate) fn pixel(camera: &ClipCamera, mapped: Vec3) -> Option<usize> {
    let side = camera.resolution as f32;
    let on_map = |c: f32| (0.0..side).contains(&c);
    (on_map(mapped.x) && on_map(mapped.y))
        .then(|| mapped.y as usize * camera.resolution as usize + mapped.x as usize)
}

/// How the depth maps of mesh clips are made.
#[derive(Clone, Copy, Debug)]
pub struct Maps {
    /// P, layer pairs that are peeled.
    pub layers: usize,
    /// Z, pixels along an edge of the layers.
    pub resolution: u32,
    /// Recipe of the dilation maps.
    pub dilation: Dilation,
    /// Where the clip samples of voxels lie.
    pub support: Support,
}

/// Recipe of the dilation maps.
#[derive(Clone, Copy, Debug)]
pub enum Dilation {
    /// No point within the radius is missed; cells along an edge.
    Conservative(u32),
    /// CAO eq. (4) as printed, at the layers' resolution; depth in half floats if `half`.
    Literal {
        /// 16-bit depths, as the authors' program stores them.
        half: bool,
    },
}

/// A clip with all that deciding visibility and change needs.
#[derive(Clone, Debug)]
pub struct ClipField {
    /// The clip.
    pub clip: Clip,
    /// Radius in mm around the hidden region within which voxels count as changed.
    pub radius_mm: f32,
    /// Layers and dilation map of a mesh.
    pub mesh: Option<MeshField>,
}

/// Depth maps of a mesh clip.
#[derive(Clone, Debug)]
pub struct MeshField {
    /// Surface.
    pub layers: MeshLayers,
    /// Region of changed voxels.
    pub dilated: DilationMap,
    /// Whether `dilated` follows eq. (4), which asks for every clip sample of a voxel to be tested against it.
    pub literal: bool,
    /// What the peeling found.
    pub report: Report,
}

impl ClipField {
    /// Peels and dilates a mesh clip for rays that reach `reach_mm` in `grid`; an analytic clip needs no maps.
    ///
    /// # Errors
    /// [`cao_model::Error::Config`] when the dilation map has fewer than 4 cells along an edge.
    pub fn new(clip: &Clip, grid: &Grid, reach_mm: f32, maps: &Maps) -> Result<Self> {
        let radius_mm = match maps.dilation {
            Dilation::Conservative(_) => {
                let radius = dilate::changed_radius(grid, reach_mm, maps.support);
                let edge = |axis: usize| grid.dims[axis] as f64 * grid.spacing[axis];
                let half = 0.5 * DVec3::new(edge(0), edge(1), edge(2)).length();
                radius + clip.rounding_mm(half as f32, radius)
            }
            Dilation::Literal { .. } => reach_mm,
        };
        let mut field = Self { clip: clip.clone(), radius_mm, mesh: None };
        if let Shape::Mesh(mesh) = &clip.shape {
            // Only the literal recipe's layers leave room for the dilation.
            let margin = if matches!(maps.dilation, Dilation::Literal { .. }) { radius_mm } else { 0.0 };
            let camera = ClipCamera::around(mesh, clip.pose.scale, margin, maps.resolution);
            let (layers, report) = peel(mesh, clip.pose.scale, &camera, maps.layers);
            let dilated = match maps.dilation {
                Dilation::Conservative(side) => dilate::conservative(&layers, clip.mode, radius_mm, side)?,
                Dilation::Literal { half } => dilate::literal(&layers, clip.mode, radius_mm, half),
            };
            let literal = matches!(maps.dilation, Dilation::Literal { .. });
            field.mesh = Some(MeshField { layers, dilated, literal, report });
        }
        Ok(field)
    }

    /// Whether this clip hides a world point (mm).
    pub fn hides(&self, world: Vec3) -> bool {
        match &self.mesh {
            Some(mesh) => {
                let inside = mesh.layers.inside(self.clip.pose.to_rigid(world));
                inside == (self.clip.mode == Mode::Remove)
            }
            None => self.clip.hides(world).unwrap_or(false),
        }
    }

    /// Whether the ambient value of a voxel may change by this clip; `samples` are the voxel's clip samples (world,
    /// mm), its centre first.
    pub fn affects(&self, samples: &[Vec3]) -> bool {
        match &self.mesh {
            Some(mesh) => {
                // The conservative radius covers the whole voxel around its centre; the paper counts samples.
                let tested = if mesh.literal { samples } else { &samples[..1] };
                tested.iter().any(|&world| mesh.dilated.dilated(self.clip.pose.to_rigid(world)))
            }
            None => self.clip.distance_to_hidden(samples[0]).is_some_and(|d| d <= self.radius_mm),
        }
    }
}

/// Whether no clip hides a world point (mm).
pub fn visible(clips: &[ClipField], world: Vec3) -> bool {
    !clips.iter().any(|clip| clip.hides(world))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use cao_model::clip::Pose;
    use cao_model::mesh::TriangleMesh;
    use std::sync::Arc;

    const GRID: Grid = Grid { dims: [9; 3], spacing: [1.0; 3] };
    const MAPS: Maps =
        Maps { layers: 4, resolution: 256, dilation: Dilation::Conservative(64), support: Support::Voxel };

    fn field(shape: Shape, mode: Mode, pose: Pose) -> ClipField {
        ClipField::new(&Clip { shape, mode, pose }, &GRID, 2.0, &MAPS).unwrap()
    }

    /// A mesh's layers against the analytic shape that the mesh approximates, away from the surface by more than a
    /// pixel and the facets' sagitta.
    #[test]
    fn meshes_hide_what_their_analytic_twins_hide() {
        let pose = Pose {
            translate_mm: Vec3::new(1.0, -2.0, 0.5),
            rotate_deg: Vec3::new(30.0, 70.0, -20.0),
            scale: Vec3::new(4.0, 5.0, 6.0),
        };
        let mut random = Random(5);
        for (mesh, shape) in [
            (TriangleMesh::sphere(4), Shape::Sphere),
            (TriangleMesh::cuboid(), Shape::Box),
            (TriangleMesh::torus(96, 48), Shape::Torus),
        ] {
            for mode in [Mode::Remove, Mode::Keep] {
                let layered = field(Shape::Mesh(Arc::new(mesh.clone())), mode, pose);
                let analytic = field(shape.clone(), mode, pose);
                let mut compared = [0, 0];
                for _ in 0..20_000 {
                    let p = random.vector(-10.0, 10.0);
                    if analytic.clip.distance_to_hidden(p).unwrap().abs() > 0.15 {
                        assert_eq!(layered.hides(p), analytic.hides(p), "{} {mode:?} {p}", shape.name());
                        compared[usize::from(layered.hides(p))] += 1;
                    }
                }
                assert!(compared[0] > 500 && compared[1] > 500);
            }
        }
    }

    #[test]
    fn a_point_is_visible_when_no_clip_hides_it() {
        let at = |x: f32| Pose {
            translate_mm: Vec3::new(x, 0.0, 0.0),
            scale: Vec3::splat(3.0),
            ..Pose::default()
        };
        let ball = field(Shape::Sphere, Mode::Remove, at(0.0));
        let plane = field(Shape::Plane, Mode::Keep, Pose::default());
        let up = Vec3::new(0.0, 0.0, 1.0);
        assert!(visible(&[], up));
        assert!(!visible(std::slice::from_ref(&ball), up));
        assert!(visible(std::slice::from_ref(&plane), up) && !visible(std::slice::from_ref(&plane), -up));
        let both = [ball, plane];
        assert!(!visible(&both, up) && !visible(&both, up * -5.0) && visible(&both, up * 5.0));
    }

    /// CAO eq. (1) has ≤ and ≥: the surface itself is visible.
    #[test]
    fn the_surface_is_outside() {
        let camera = ClipCamera { corner: Vec3::ZERO, pixel_mm: 1.0, depth_mm: 1.0, resolution: 1 };
        let layers = MeshLayers { camera, front: vec![vec![0.25]], back: vec![vec![0.75]] };
        let at = |z: f32| layers.inside(Vec3::new(0.5, 0.5, z));
        assert!(!at(0.25) && at(0.5) && !at(0.75));
        assert!(!layers.inside(Vec3::new(1.5, 0.5, 0.5)) && !layers.inside(Vec3::new(-0.5, 0.5, 0.5)));
    }
}
