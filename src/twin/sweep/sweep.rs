//! Local ambient occlusion along lattice directions (method.md §4), each window evaluated directly.
//!
//! For direction k, a lattice vector v of length |v| in mm, with W = round(R/|v|) segments (at least one) and start offset o:
//!
//! ```text
//! A_k(x) = 1/(W|v| − o) ∫_o^{W|v|} exp(−∫_o^s τ) ds,   A(x) = 1 − Σ_k w_k (1 − A_k(x))
//! ```
//!
//! with the weights w_k of [`LatticeRays::parts`], whole 65535ths. Segment j runs from x + jv to x + (j+1)v, in n = ceil(|v|/s_max) pieces; q = 1 − a is the trilinear transmittance at the
//! pieces' ends and linear between them: the exact segment rule of method.md §3. The first piece begins at o. A piece with q
//! below [`OPAQUE`] at both ends lets nothing through.

use crate::cast::lao::{OPAQUE, mean_extinction, mean_transmittance};
use crate::{Grid, each, trilinear};
use cao_kernels::shared::parts::PARTS;
use cao_model::lattice::LatticeRays;
use cao_model::occlusion::Occlusion;

/// Ambient value of every voxel, 0 = fully occluded … 1 = unobstructed. `opacity` is V_o, per `reference_mm`.
pub fn sweep(grid: &Grid, opacity: &[f32], occlusion: &Occlusion, reference_mm: f64) -> Vec<f64> {
    let rays = LatticeRays::new(occlusion.rays, grid.spacing);
    each(grid.len(), |i| along(&rays, grid, opacity, occlusion, reference_mm, grid.voxel(i)))
}

fn along(
    rays: &LatticeRays,
    grid: &Grid,
    opacity: &[f32],
    occlusion: &Occlusion,
    reference_mm: f64,
    voxel: [usize; 3],
) -> f64 {
    if occlusion.radius_mm == 0.0 {
        return 1.0;
    }
    let offset = f64::from(occlusion.lattice_offset(grid.min_spacing()));
    let longest = f64::from(occlusion.lattice_step(grid.min_spacing()));
    let mut ambient = 1.0;
    for (ray, parts) in rays.rays.iter().zip(rays.parts()) {
        let length = ray.length_mm(grid.spacing);
        let pieces = ray.pieces(grid.spacing, longest);
        let segments = ray.segments(grid.spacing, f64::from(occlusion.radius_mm));
        // Transmittance at a distance in steps.
        let clear = |s: f64| {
            let at = std::array::from_fn(|i| voxel[i] as f64 + s * f64::from(ray.step[i]));
            1.0 - trilinear(grid, opacity, at).min(1.0)
        };
        let (mut sum, mut transmittance) = (0.0, 1.0);
        let start = offset / length;
        for piece in 0..segments * pieces {
            let (near, far) =
                (f64::from(piece) / f64::from(pieces), f64::from(piece + 1) / f64::from(pieces));
            if far <= start {
                continue;
            }
            let (mut q0, q1) = (clear(near), clear(far));
            let begin = near.max(start);
            q0 += (q1 - q0) * (begin - near) / (far - near);
            if q0.max(q1) < OPAQUE {
                break;
            }
            let depth = mean_extinction(q0, q1) * (far - begin) * length / reference_mm;
            sum += transmittance * (far - begin) * mean_transmittance(depth);
            transmittance *= (-depth).exp();
        }
        ambient -= f64::from(parts) / f64::from(PARTS) * (1.0 - sum / (f64::from(segments) - start));
    }
    ambient
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use cao_model::occlusion::{Quadrature, RaySet};

    fn settings(rays: RaySet, radius_mm: f32) -> Occlusion {
        Occlusion { rays, quadrature: Quadrature::Segment, radius_mm, offset_mm: None, step_mm: None }
    }

    #[test]
    fn empty_volume_and_radius_zero_are_unobstructed() {
        let grid = Grid { dims: [4, 5, 3], spacing: [1.0, 0.7, 2.0] };
        for rays in RaySet::ALL {
            for value in sweep(&grid, &[0.0; 60], &settings(rays, 4.0), 1.0) {
                assert!((value - 1.0).abs() < 1e-12);
            }
            assert_eq!(sweep(&grid, &[1.0; 60], &settings(rays, 0.0), 1.0), [1.0; 60]);
        }
    }

    /// (1 − e^−τL)/(τL) for every direction, with L its own length behind the offset.
    #[test]
    fn uniform_opacity_has_the_closed_form() {
        let grid = Grid { dims: [25, 25, 25], spacing: [1.0; 3] };
        for rays in RaySet::ALL {
            for a in [0.0_f32, 0.1, 0.5, 0.97] {
                let occlusion = settings(rays, 6.0);
                let set = LatticeRays::new(rays, grid.spacing);
                let tau = -f64::from(1.0 - a).ln() / 2.0;
                let occluded: f64 = (set.rays.iter().zip(set.parts()))
                    .map(|(ray, parts)| {
                        let length = ray.length_mm(grid.spacing);
                        let x = tau * (f64::from(ray.segments(grid.spacing, 6.0)) * length - 0.5);
                        let clear = if x == 0.0 { 1.0 } else { (1.0 - (-x).exp()) / x };
                        f64::from(parts) / 65535.0 * (1.0 - clear)
                    })
                    .sum();
                let expected = 1.0 - occluded;
                let found = along(&set, &grid, &vec![a; grid.len()], &occlusion, 2.0, [12, 12, 12]);
                assert!((found - expected).abs() < 1e-6, "{} a={a}: {found}, {expected}", rays.name());
            }
        }
    }

    /// A wall that fills the half-space beyond x = 8: rays that meet it are cut there, the others are free.
    #[test]
    fn an_opaque_wall_cuts_the_rays_that_meet_it() {
        let grid = Grid { dims: [17, 17, 17], spacing: [1.0; 3] };
        let wall: Vec<f32> =
            (0..grid.len()).map(|i| if grid.voxel(i)[0] >= 12 { 1.0 } else { 0.0 }).collect();
        let set = LatticeRays::new(RaySet::R6, grid.spacing);
        let found = along(&set, &grid, &wall, &settings(RaySet::R6, 6.0), 1.0, [8, 8, 8]);
        // Along +x: free from 0.5 to 3, then q falls from 1 to 0 over one voxel.
        let last = mean_transmittance(1.0);
        let along_x = set.rays.iter().position(|ray| ray.step == [1, 0, 0]).unwrap();
        let expected = 1.0 - f64::from(set.parts()[along_x]) / 65535.0 * (1.0 - (2.5 + last) / 5.5);
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }

    /// Nothing beyond the window has an influence, and something within it has.
    #[test]
    fn a_value_depends_on_its_window_only() {
        let grid = Grid { dims: [21, 21, 21], spacing: [1.0; 3] };
        let occlusion = settings(RaySet::W26, 5.0);
        let set = LatticeRays::new(occlusion.rays, grid.spacing);
        let mut random = Random(5);
        let field: Vec<f32> = (0..grid.len()).map(|_| random.within(0.0, 0.2)).collect();
        let value = |field: &[f32]| along(&set, &grid, field, &occlusion, 1.0, [10, 10, 10]);
        let before = value(&field);
        for (voxel, changes) in
            [([15, 10, 10], true), ([16, 10, 10], false), ([14, 14, 10], true), ([12, 11, 10], false)]
        {
            let mut edited = field.clone();
            edited[grid.index(voxel)] = 0.9;
            assert_eq!(value(&edited) != before, changes, "{voxel:?}");
        }
    }
}
