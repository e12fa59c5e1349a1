//! Places of surfaces: poses behind poses, and those that are none, which go into the positions.

use std::sync::Arc;

use cao_model::clip::Pose;
use cao_model::surface::{Instance, Surface};
use glam::{DMat3, DMat4, DVec3, EulerRot, Vec3};

/// What a pose may differ by from a matrix, as a share of its largest entry: a rotation in degrees of f32 has no more digits.
const ROUNDING: f64 = 2e-6;

/// The matrix of a pose: `T · Rz·Ry·Rx · S`.
pub(super) fn matrix(pose: &Pose) -> DMat4 {
    let [x, y, z] = pose.rotate_deg.as_dvec3().to_array().map(f64::to_radians);
    let turn = DMat3::from_rotation_z(z) * DMat3::from_rotation_y(y) * DMat3::from_rotation_x(x);
    let linear = turn * DMat3::from_diagonal(pose.scale.as_dvec3());
    DMat4::from_translation(pose.translate_mm.as_dvec3()) * DMat4::from_mat3(linear)
}

/// The surface at this place: by a pose where one has this matrix, else with the matrix in its positions.
pub(super) fn placed(surface: &Arc<Surface>, at: DMat4) -> Instance {
    match pose_of(at) {
        Some(pose) => Instance { surface: surface.clone(), pose },
        None => Instance { surface: Arc::new(baked(surface, at)), pose: Pose::default() },
    }
}

/// An instance, its own pose behind another.
pub fn moved(instance: Instance, pose: &Pose) -> Instance {
    // The usual case, and exact.
    if instance.pose == Pose::default() {
        return Instance { pose: *pose, ..instance };
    }
    placed(&instance.surface, matrix(pose) * matrix(&instance.pose))
}

/// The pose with this matrix; `None` of mirrors, shears, what flattens, and what is no number.
fn pose_of(at: DMat4) -> Option<Pose> {
    let (scale, turn, translate) = at.to_scale_rotation_translation();
    if !(at.is_finite() && scale.min_element() > 0.0) {
        return None;
    }
    let (z, y, x) = turn.to_euler(EulerRot::ZYX);
    let pose = Pose {
        translate_mm: translate.as_vec3(),
        rotate_deg: DVec3::new(x, y, z).map(f64::to_degrees).as_vec3(),
        scale: scale.as_vec3(),
    };
    let difference = matrix(&pose) - at;
    let size = at.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
    let worst = difference.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
    // Far from the origin digits of the place are lost that those of the shape do not have.
    let shape = DMat3::from_mat4(at).to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
    let apart = DMat3::from_mat4(difference).to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
    (pose.check().is_ok() && worst <= ROUNDING * size && apart <= ROUNDING * shape).then_some(pose)
}

/// The surface with a matrix in its positions and normals; mirrored triangles are turned round, so that they face as before.
fn baked(surface: &Surface, at: DMat4) -> Surface {
    let linear = DMat3::from_mat4(at);
    let mirror = linear.determinant() < 0.0;
    // Normals go by the inverse transpose; by the matrix of cofactors they do so also where a matrix flattens.
    let cofactors = DMat3::from_cols(
        linear.y_axis.cross(linear.z_axis),
        linear.z_axis.cross(linear.x_axis),
        linear.x_axis.cross(linear.y_axis),
    ) * if mirror { -1.0 } else { 1.0 };
    let normal = |n: &Vec3| (cofactors * n.as_dvec3()).normalize_or_zero().as_vec3();
    Surface {
        positions: surface.positions.iter().map(|p| at.transform_point3(p.as_dvec3()).as_vec3()).collect(),
        normals: surface.normals.iter().map(normal).collect(),
        triangles: surface
            .triangles
            .iter()
            .map(|&[a, b, c]| if mirror { [a, c, b] } else { [a, b, c] })
            .collect(),
        ..surface.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::surface::{Material, World};
    use glam::Quat;

    fn surface() -> Arc<Surface> {
        Arc::new(Surface {
            name: "corner".into(),
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z],
            normals: vec![Vec3::new(0.0, 0.6, 0.8); 4],
            triangles: vec![[0, 2, 1], [1, 2, 3]],
            material_of: vec![0; 2],
            materials: vec![Material::default()],
            ..Surface::default()
        })
    }

    /// Corners and normals of a world against the matrix.
    fn assert_at(instance: Instance, at: DMat4) {
        let (from, to) = (surface(), World::new(&[instance]).unwrap());
        let inverse = DMat3::from_mat4(at).inverse().transpose();
        for (corners, found) in from.triangles.iter().zip(&to.triangles) {
            let place = |c: u32| at.transform_point3(from.positions[c as usize].as_dvec3()).as_vec3();
            let mut expected = corners.map(place);
            if DMat3::from_mat4(at).determinant() < 0.0 {
                expected.swap(1, 2);
            }
            let size = at.to_cols_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs())) as f32;
            for (found, expected) in found.corners.iter().zip(expected) {
                assert!((found - expected).length() < 1e-5 * size, "{found} {expected}, {at}");
            }
            let normal = (inverse * from.normals[0].as_dvec3()).normalize().as_vec3();
            assert!(found.normals.iter().all(|n| (n - normal).length() < 1e-5), "{found:?} {normal}");
        }
    }

    #[test]
    fn poses_behind_poses_are_poses_where_there_is_one() {
        let pose = |turn: [f32; 3], scale: [f32; 3]| Pose {
            translate_mm: Vec3::new(3.0, -20.0, 700.0),
            rotate_deg: Vec3::from_array(turn),
            scale: Vec3::from_array(scale),
        };
        for (inner, outer, shears) in [
            (Pose::default(), pose([10.0, 20.0, 30.0], [1.0, 2.0, 3.0]), false),
            (pose([10.0, 90.0, 30.0], [1.0, 2.0, 3.0]), pose([70.0, -90.0, 200.0], [5.0; 3]), false),
            (pose([0.0; 3], [1.0, 2.0, 3.0]), pose([5.0, 6.0, 7.0], [0.5, 1.0, 9.0]), false),
            (pose([10.0, 20.0, 30.0], [1.0; 3]), pose([5.0, 6.0, 7.0], [0.5, 1.0, 9.0]), true),
        ] {
            let found = moved(Instance { surface: surface(), pose: inner }, &outer);
            assert_eq!(found.surface.positions != surface().positions, shears, "{inner:?} {outer:?}");
            assert_at(found, matrix(&outer) * matrix(&inner));
        }
    }

    #[test]
    fn mirrors_and_shears_go_into_positions() {
        let shear = DMat4::from_mat3(DMat3::from_cols(DVec3::X, DVec3::new(0.4, 1.0, 0.0), DVec3::Z));
        for at in
            [DMat4::from_scale(DVec3::new(-2.0, 1.0, 1.0)), DMat4::from_scale(DVec3::splat(-1.0)), shear]
        {
            let found = placed(&surface(), at);
            assert_eq!(found.pose, Pose::default());
            assert_at(found, at);
        }
        let turn = DMat4::from_quat(Quat::from_rotation_z(1.0).as_dquat());
        assert_eq!(placed(&surface(), turn).surface, surface());
    }
}
