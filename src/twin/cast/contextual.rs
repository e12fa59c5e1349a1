//! Contextual ambient occlusion (CAO §3.5 step 5).
//!
//! ```text
//! V_AO(x) = A(x) of the clipped V_o   if x is b, or is a and touches a voxel that is not a
//!           V_PAO(x)                  if x is c
//!           no value                  otherwise: clipped, among clipped voxels; nobody samples it
//! ```
//!
//! The paper stores 1 in every clipped voxel. Those that touch a visible one are interpolated with it at the cut, so
//! they are computed here (method.md §5).

use crate::cast::lao::{along, rays};
use crate::clip::classify::{AFFECTED, CLIPPED, UNTOUCHED};
use crate::{Grid, each};
use cao_model::occlusion::Occlusion;

/// Whether a voxel's ambient value has to be computed from the clipped opacity.
pub fn computed(grid: &Grid, mask: &[u8], voxel: [usize; 3]) -> bool {
    match mask[grid.index(voxel)] {
        AFFECTED => true,
        CLIPPED => grid.neighbours(voxel).any(|n| mask[grid.index(n)] != CLIPPED),
        _ => false,
    }
}

/// Ambient value of every voxel that has one, from the clipped opacity, the ambient values `unclipped` (V_PAO) and
/// the categories.
pub fn contextual(
    grid: &Grid,
    clipped: &[f32],
    unclipped: &[f64],
    mask: &[u8],
    occlusion: &Occlusion,
    reference_mm: f64,
) -> Vec<Option<f64>> {
    let rays = rays(grid, occlusion);
    each(grid.len(), |i| {
        let voxel = grid.voxel(i);
        if mask[i] == UNTOUCHED {
            Some(unclipped[i])
        } else {
            computed(grid, mask, voxel).then(|| along(&rays, grid, clipped, occlusion, reference_mm, voxel))
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cast::lao::lao;
    use crate::clip::classify::classify;
    use crate::clip::classify::tests::{MAPS, field, random_clip, shapes};
    use crate::clip::clips::{ClipField, Dilation, Maps};
    use crate::random::Random;
    use cao_model::clip::{Clip, Mode, Pose, Shape};
    use cao_model::mesh::TriangleMesh;
    use cao_model::occlusion::{Quadrature, RaySet};
    use cao_model::settings::{AntiAliasing, Estimator};
    use glam::Vec3;
    use std::sync::Arc;

    /// Shares change with a voxel's first corner, which asks most of the reach.
    const PRINTED: AntiAliasing = AntiAliasing { estimator: Estimator::Paper, ..AntiAliasing::N8 };

    struct Case {
        grid: Grid,
        opacity: Vec<f32>,
        occlusion: Occlusion,
        unclipped: Vec<f64>,
    }

    impl Case {
        fn new(spacing: [f64; 3], occlusion: Occlusion) -> Self {
            let grid = Grid { dims: [14, 12, 11], spacing };
            // Thin fog with some holes: every ray reaches its end, every change shows.
            let mut random = Random(9);
            let opacity: Vec<f32> = (0..grid.len()).map(|_| random.within(-0.05, 0.2).max(0.0)).collect();
            let unclipped = lao(&grid, &opacity, &occlusion, 1.0);
            Self { grid, opacity, occlusion, unclipped }
        }

        fn reach(&self) -> f32 {
            self.occlusion.reach(self.grid.min_spacing())
        }

        /// (voxels with a value, of them computed, of them different from a full recomputation)
        fn compare(&self, clips: &[ClipField]) -> [usize; 3] {
            let Self { grid, opacity, occlusion, unclipped } = self;
            let (clipped, mask) = classify(grid, opacity, clips, PRINTED);
            let found = contextual(grid, &clipped, unclipped, &mask, occlusion, 1.0);
            let full = lao(grid, &clipped, occlusion, 1.0);
            let mut counts = [0; 3];
            for (i, value) in found.into_iter().enumerate() {
                if let Some(value) = value {
                    counts[0] += 1;
                    counts[1] += usize::from(mask[i] != UNTOUCHED);
                    counts[2] += usize::from(value.to_bits() != full[i].to_bits());
                }
            }
            counts
        }
    }

    fn settings(rays: RaySet, quadrature: Quadrature, radius_mm: f32, offset_mm: Option<f32>) -> Occlusion {
        Occlusion { rays, quadrature, radius_mm, offset_mm, step_mm: None, ..Occlusion::paper(1.0) }
    }

    fn cases() -> [Case; 3] {
        [
            Case::new([1.0; 3], settings(RaySet::R26, Quadrature::Left, 4.0, None)),
            Case::new([1.0, 0.8, 2.0], settings(RaySet::W14, Quadrature::Segment, 3.2, Some(1.1))),
            Case::new([1.0; 3], settings(RaySet::R54, Quadrature::Cell, 3.0, Some(0.0))),
        ]
    }

    #[test]
    fn contextual_equals_full_recomputation_bit_for_bit() {
        let mut random = Random(77);
        for case in cases() {
            let (mut compared, mut computed) = (0, 0);
            for shape in shapes() {
                for _ in 0..4 {
                    let clip = random_clip(&shape, &case.grid, &mut random);
                    let found = case.compare(&[field(&clip, &case.grid, case.reach())]);
                    assert_eq!(found[2], 0, "{clip:?}");
                    compared += found[0];
                    computed += found[1];
                }
            }
            // Neither everything nor nothing was recomputed.
            assert!(computed * 20 > compared && computed * 20 < 19 * compared, "{computed} of {compared}");
        }
    }

    #[test]
    fn contextual_equals_full_recomputation_under_several_clips() {
        let mut random = Random(78);
        let all = shapes();
        for case in cases() {
            for _ in 0..6 {
                let fields: Vec<_> = (0..3)
                    .map(|_| {
                        let shape = &all[(random.unit() * all.len() as f32) as usize];
                        field(&random_clip(shape, &case.grid, &mut random), &case.grid, case.reach())
                    })
                    .collect();
                assert_eq!(case.compare(&fields)[2], 0);
            }
        }
    }

    /// The comparison can fail: two voxels less of dilation leave stale values, for analytic clips and for meshes.
    #[test]
    fn a_reach_that_is_too_short_leaves_stale_values() {
        let case = &cases()[0];
        let mut random = Random(79);
        for shape in shapes() {
            let stale: usize = (0..4)
                .map(|_| {
                    let clip = inside(&shape, &mut random);
                    case.compare(&[field(&clip, &case.grid, case.reach() - 2.0)])[2]
                })
                .sum();
            assert!(stale > 0, "{}", shape.name());
        }
    }

    /// A clip whose surface lies within the volume.
    fn inside(shape: &Shape, random: &mut Random) -> Clip {
        let pose = Pose {
            translate_mm: random.vector(-2.0, 2.0),
            rotate_deg: random.vector(-180.0, 180.0),
            scale: Vec3::splat(random.within(2.0, 4.0)),
        };
        Clip { shape: shape.clone(), mode: Mode::Remove, pose }
    }

    /// So does the paper's recipe, though its samples at the voxel's corners win back half a voxel.
    #[test]
    fn the_literal_dilation_leaves_stale_values() {
        let case = &cases()[0];
        let mut random = Random(80);
        let mesh = Shape::Mesh(Arc::new(TriangleMesh::sphere(3)));
        for half in [false, true] {
            let maps = Maps { resolution: 64, dilation: Dilation::Literal { half }, ..MAPS };
            let stale: usize = (0..10)
                .map(|_| {
                    let clip = inside(&mesh, &mut random);
                    case.compare(&[ClipField::new(&clip, &case.grid, case.reach(), &maps).unwrap()])[2]
                })
                .sum();
            assert!(stale > 0, "half {half}");
        }
    }

    /// A clipped half: one layer of clipped voxels beside the cut has values, the rest has none.
    #[test]
    fn clipped_voxels_have_a_value_only_beside_visible_ones() {
        let grid = Grid { dims: [7, 7, 7], spacing: [1.0; 3] };
        let mask: Vec<u8> =
            (0..grid.len()).map(|i| if grid.voxel(i)[2] >= 3 { CLIPPED } else { UNTOUCHED }).collect();
        let occlusion = settings(RaySet::R6, Quadrature::Left, 2.0, None);
        let values =
            contextual(&grid, &vec![0.0; grid.len()], &vec![0.25; grid.len()], &mask, &occlusion, 1.0);
        for (i, value) in values.into_iter().enumerate() {
            let expected = match grid.voxel(i)[2] {
                0..3 => Some(0.25),
                3 => Some(1.0),
                _ => None,
            };
            assert_eq!(value.map(|v| (v * 1e9).round() / 1e9), expected);
        }
    }
}
