//! Clipped opacity and categories (CAO §3.5 step 4).
//!
//! ```text
//! O_AA = C_visible/(N+9) · O_voxel                                                 CAO eq. (5)
//! ```
//!
//! A voxel has nine samples, its centre and corners; only where they disagree it has N more. The estimator of its own takes
//! these N alone. Category a: the share is 0; b: it is not, the neighbourhood changed; c: the neighbourhood is as it was.

use crate::clip::clips::{ClipField, visible};
use crate::{Grid, each};
use cao_kernels::shared::categories;
use cao_model::settings::{AntiAliasing, Estimator, Samples};
use glam::Vec3;

/// Category a, clipped.
pub const CLIPPED: u8 = categories::CLIPPED as u8;
/// Category b, its rays may meet something that changed.
pub const AFFECTED: u8 = categories::AFFECTED as u8;
/// Category c, every ray meets what it met before.
pub const UNTOUCHED: u8 = categories::UNTOUCHED as u8;

/// Sample positions in voxels from the centre: the centre, the 8 corners, and N points of a lattice of rank 1: with u odd and factors
/// 1, a, b the odd number that a factor times u is modulo 2N, nearest to 0, over N, of the support; each followed by its mirror image, so
/// that their mean is the centre.
pub fn sample_positions(how: AntiAliasing) -> Vec<[f64; 3]> {
    let [corner, support] = [how.support.corner(), how.support.extent()].map(f64::from);
    let corners = (0..8_u32).map(|i| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { corner } else { -corner }));
    let (n, factors) = match how.samples {
        Samples::N0 => (0, [0; 3]),
        Samples::N8 => (8, [1, 5, 7]),
        Samples::N32 => (32, [1, 19, 23]),
    };
    let place = |u: i32| {
        factors.map(|factor| {
            let product = f64::from(factor * u) / f64::from(n);
            support * (product - 2.0 * (product / 2.0).round())
        })
    };
    let lattice = (0..n / 2).map(|k| place(2 * k + 1)).flat_map(|p| [p, p.map(|c| -c)]);
    std::iter::once([0.0; 3]).chain(corners).chain(lattice).collect()
}

/// Opacity after clipping and category of every voxel.
pub fn classify(grid: &Grid, opacity: &[f32], clips: &[ClipField], how: AntiAliasing) -> (Vec<f32>, Vec<u8>) {
    let positions = sample_positions(how);
    let interior = how.estimator == Estimator::Interior && how.samples != Samples::N0;
    each(grid.len(), |i| {
        let centre = grid.voxel(i).map(|c| c as f64);
        let world: Vec<Vec3> = positions
            .iter()
            .map(|p| {
                let at = grid.to_world(std::array::from_fn(|axis| centre[axis] + p[axis]));
                Vec3::from_array(at.map(|c| c as f32))
            })
            .collect();
        let seen = |samples: &[Vec3]| samples.iter().filter(|&&p| visible(clips, p)).count();
        let cut = !matches!(seen(&world[..9]), 0 | 9);
        let tested = if cut { &world } else { &world[..9] };
        let counted = if cut && interior { &world[9..] } else { tested };
        let count = seen(counted);
        let share = count as f64 / counted.len() as f64;
        let category = match clips.iter().any(|clip| clip.affects(tested)) {
            false => UNTOUCHED,
            true if count == 0 => CLIPPED,
            true => AFFECTED,
        };
        ((share * f64::from(opacity[i])) as f32, category)
    })
    .into_iter()
    .unzip()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::clip::clips::{Dilation, Maps};
    use crate::clip::peel::tests::from_the_side;
    use crate::random::Random;
    use cao_model::clip::{Clip, Mode, Pose, Shape};
    use cao_model::mesh::TriangleMesh;
    use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
    use cao_model::settings::Support;
    use std::sync::Arc;

    pub const MAPS: Maps =
        Maps { layers: 4, resolution: 128, dilation: Dilation::Conservative(96), support: Support::Voxel };

    /// Every way to sample with so many.
    pub fn ways(samples: Samples) -> impl Iterator<Item = AntiAliasing> {
        let supports = [Support::Voxel, Support::Neighbours];
        let of = move |support| {
            [Estimator::Paper, Estimator::Interior].map(|estimator| AntiAliasing {
                samples,
                support,
                estimator,
            })
        };
        supports.into_iter().flat_map(of)
    }

    /// Every analytic shape, a convex and a concave mesh.
    pub fn shapes() -> Vec<Shape> {
        let meshes = [TriangleMesh::sphere(2), from_the_side(&TriangleMesh::torus(32, 16))];
        Shape::ANALYTIC.into_iter().chain(meshes.map(|mesh| Shape::Mesh(Arc::new(mesh)))).collect()
    }

    /// A clip somewhere around a grid, from a fraction of a voxel to more than the whole volume.
    pub fn random_clip(shape: &Shape, grid: &Grid, random: &mut Random) -> Clip {
        let size = Vec3::from_array(std::array::from_fn(|i| (grid.dims[i] as f64 * grid.spacing[i]) as f32));
        let largest = size.max_element();
        let scale = largest * 0.02 * 50.0_f32.powf(random.unit());
        let pose = Pose {
            translate_mm: random.vector(-0.6, 0.6) * size,
            rotate_deg: random.vector(-180.0, 180.0),
            scale: random.vector(0.5, 1.5) * scale,
        };
        Clip { shape: shape.clone(), mode: if random.unit() < 0.6 { Mode::Remove } else { Mode::Keep }, pose }
    }

    pub fn field(clip: &Clip, grid: &Grid, reach_mm: f32) -> ClipField {
        ClipField::new(clip, grid, reach_mm, &MAPS).unwrap()
    }

    /// The same for samples that lie elsewhere.
    pub fn field_of(clip: &Clip, grid: &Grid, reach_mm: f32, support: Support) -> ClipField {
        ClipField::new(clip, grid, reach_mm, &Maps { support, ..MAPS }).unwrap()
    }

    const UNIT: Grid = Grid { dims: [11, 11, 11], spacing: [1.0; 3] };

    #[test]
    fn samples_are_the_centre_the_corners_and_points_inside() {
        for how in ways(Samples::N32) {
            let positions = sample_positions(how);
            assert_eq!(positions.len(), 41);
            assert_eq!(positions[0], [0.0; 3]);
            let mut corners = positions[1..9].to_vec();
            let [corner, extent] = match how.support {
                Support::Voxel => [0.5, 0.5],
                Support::Neighbours => [f64::from(1.025_f32), 1.0],
            };
            assert!(corners.iter().flatten().all(|c| c.abs() == corner));
            corners.dedup();
            assert_eq!(corners.len(), 8);
            let farthest = positions[9..].iter().flatten().fold(0.0_f64, |far, c| far.max(c.abs()));
            assert!(farthest < extent && farthest > 0.9 * extent, "{farthest}");
            // Evenly spread: the mean is the centre, and each octant has some.
            for axis in 0..3 {
                assert_eq!(positions[9..].iter().map(|p| p[axis]).sum::<f64>(), 0.0);
            }
            for octant in &positions[1..9] {
                let same = |p: &&[f64; 3]| (0..3).all(|i| p[i] * octant[i] > 0.0);
                assert!((1..=8).contains(&positions[9..].iter().filter(same).count()));
            }
        }
    }

    /// A plane through voxel centres, tilted or not, keeps the centre, the corners on its visible side, and the share
    /// of the further samples there.
    #[test]
    fn plane_through_voxel_centres_halves_them() {
        let opacity = vec![0.5; UNIT.len()];
        let clip = field(&Clip::remove(Shape::Plane), &UNIT, 0.0);
        for samples in [Samples::N0, Samples::N8, Samples::N32] {
            let more = samples as u32;
            for how in ways(samples).filter(|how| how.support == Support::Voxel) {
                let below = sample_positions(how)[9..].iter().filter(|p| p[2] <= 0.0).count();
                // The mirror images of the N halve them exactly where they alone count.
                let share = match how.estimator {
                    Estimator::Interior if more > 0 => 0.5,
                    _ => (5 + below) as f64 / f64::from(9 + more),
                };
                assert!((share - 0.5).abs() < 0.08, "{how:?}: {share}");
                let (clipped, _) = classify(&UNIT, &opacity, std::slice::from_ref(&clip), how);
                for (i, &found) in clipped.iter().enumerate() {
                    let expected = match UNIT.voxel(i)[2] {
                        0..5 => 0.5,
                        5 => (share * 0.5) as f32,
                        _ => 0.0,
                    };
                    assert_eq!(found, expected, "{how:?}");
                }
            }
        }
    }

    /// A plane between voxels leaves those above it their four corners on it, which are visible by eq. (1).
    #[test]
    fn corners_on_the_plane_are_visible() {
        let mut clip = Clip::remove(Shape::Plane);
        clip.pose.translate_mm.z = 0.5;
        let (clipped, _) =
            classify(&UNIT, &vec![1.0; UNIT.len()], &[field(&clip, &UNIT, 0.0)], AntiAliasing::N0);
        for (i, &found) in clipped.iter().enumerate() {
            let expected = match UNIT.voxel(i)[2] {
                0..=5 => 1.0,
                6 => (4.0 / 9.0_f64) as f32,
                _ => 0.0,
            };
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn volume_of_a_kept_sphere_converges() {
        let sphere = |scale| {
            let pose = Pose {
                translate_mm: Vec3::new(0.3, -0.2, 0.45),
                scale: Vec3::splat(scale),
                ..Pose::default()
            };
            Clip { shape: Shape::Sphere, mode: Mode::Keep, pose }
        };
        let exact = 4.0 / 3.0 * std::f64::consts::PI * 4.6_f64.powi(3);
        let error = |refine: usize, how: AntiAliasing| {
            let spacing = 1.0 / refine as f64;
            let grid = Grid { dims: [12 * refine; 3], spacing: [spacing; 3] };
            let (kept, _) = classify(&grid, &vec![1.0; grid.len()], &[field(&sphere(4.6), &grid, 0.0)], how);
            let volume = kept.iter().map(|&o| f64::from(o)).sum::<f64>() * spacing.powi(3);
            (volume / exact - 1.0).abs()
        };
        // Counted corners favour neither side; what is left shrinks with the voxel.
        for how in ways(Samples::N32) {
            let of = [1, 2, 4].map(|refine| error(refine, how));
            assert!(of[0] < 0.01 && of[1] < 0.004 && of[2] < 0.001, "{how:?}: {of:?}");
        }
        assert!(error(4, AntiAliasing::N0) < 0.005);
    }

    /// A plane that moves through a voxel by 1/256 voxel a step. Known answers were computed in float64 outside the program: RMS error of the
    /// share over the way and its largest jump, as printed and from the N alone.
    #[test]
    fn shares_follow_a_plane_best_by_the_interior_samples() {
        /// Of the numbers below; the places of this test lie elsewhere between the samples.
        const DIGITS: f64 = 0.001;
        const ONE: Grid = Grid { dims: [1; 3], spacing: [1.0; 3] };
        let numbers = |how: AntiAliasing, degrees: f32| {
            let slanted = degrees != 0.0;
            let reach = if slanted { 0.5_f64.sqrt() } else { 0.5 };
            let steps = (256.0 * reach) as i32;
            let (mut squares, mut jump, mut last) = (0.0, 0.0_f64, 0.0);
            for n in -steps..=steps {
                // Not on the samples themselves.
                let place = (f64::from(n) + 0.37) / 256.0;
                let turn = Vec3::new(0.0, degrees.to_radians().sin(), degrees.to_radians().cos());
                let pose = Pose {
                    translate_mm: turn * place as f32,
                    rotate_deg: Vec3::new(-degrees, 0.0, 0.0),
                    ..Pose::default()
                };
                let clip = Clip { pose, ..Clip::remove(Shape::Plane) };
                let field = field_of(&clip, &ONE, 0.0, how.support);
                let share = f64::from(classify(&ONE, &[1.0], &[field], how).0[0]);
                let t = (place / reach).min(1.0);
                let exact = match slanted {
                    true if t < 0.0 => (1.0 + t).powi(2) / 2.0,
                    true => 1.0 - (1.0 - t).powi(2) / 2.0,
                    false => (1.0 + t) / 2.0,
                };
                squares += (share - exact).powi(2);
                jump = jump.max((share - last).abs());
                last = share;
            }
            [(squares / f64::from(2 * steps + 1)).sqrt(), jump]
        };
        for (degrees, known) in
            [(0.0, [[0.0535, 0.0976], [0.0090, 0.0313]]), (45.0, [[0.0342, 0.1220], [0.0197, 0.0625]])]
        {
            for (how, known) in ways(Samples::N32).zip(known) {
                let found = numbers(how, degrees);
                let off = [0, 1].map(|n| (found[n] - known[n]).abs());
                assert!(off.iter().all(|&off| off < DIGITS), "{how:?} {degrees}°: {found:?}");
            }
        }
    }

    #[test]
    fn everything_outside_is_c_and_everything_inside_is_a() {
        let opacity = vec![0.7; UNIT.len()];
        for shape in shapes() {
            for mode in [Mode::Remove, Mode::Keep] {
                let at = |x: f32, scale: f32| {
                    let pose = Pose {
                        translate_mm: Vec3::new(x, 0.0, if matches!(shape, Shape::Plane) { x } else { 0.0 }),
                        scale: Vec3::splat(scale),
                        ..Pose::default()
                    };
                    let clip = Clip { shape: shape.clone(), mode, pose };
                    classify(&UNIT, &opacity, &[field(&clip, &UNIT, 2.0)], AntiAliasing::N8)
                };
                let far = at(100.0, 2.0);
                let (value, category) = if mode == Mode::Remove { (0.7, UNTOUCHED) } else { (0.0, CLIPPED) };
                assert!(far.0.iter().all(|&o| o == value), "{} {mode:?}", shape.name());
                assert!(far.1.iter().all(|&c| c == category), "{} {mode:?}", shape.name());
                // Around everything: far above a plane, in the tube of a torus of 200 mm, in any other shape of 200 mm.
                let near = match shape {
                    Shape::Plane => at(-100.0, 1.0),
                    Shape::Torus => at(200.0, 200.0),
                    Shape::Mesh(_) => continue,
                    _ => at(0.0, 200.0),
                };
                let (value, category) = if mode == Mode::Remove { (0.0, CLIPPED) } else { (0.7, UNTOUCHED) };
                assert!(near.0.iter().all(|&o| o == value), "{} {mode:?}", shape.name());
                assert!(near.1.iter().all(|&c| c == category), "{} {mode:?}", shape.name());
            }
        }
        let mesh = Shape::Mesh(Arc::new(TriangleMesh::sphere(3)));
        let pose = Pose { scale: Vec3::splat(60.0), ..Pose::default() };
        let (remove, keep) = (Mode::Remove, Mode::Keep);
        for (mode, value, category) in [(remove, 0.0, CLIPPED), (keep, 0.7, UNTOUCHED)] {
            let clip = Clip { shape: mesh.clone(), mode, pose };
            let (clipped, mask) = classify(&UNIT, &opacity, &[field(&clip, &UNIT, 2.0)], AntiAliasing::N8);
            assert!(clipped.iter().all(|&o| o == value) && mask.iter().all(|&c| c == category), "{mode:?}");
        }
    }

    #[test]
    fn several_clips_hide_what_any_of_them_hides() {
        let mut random = Random(41);
        let opacity = random.opacities(UNIT.len());
        for _ in 0..20 {
            let all = shapes();
            let fields: Vec<_> = (0..3)
                .map(|_| {
                    let shape = &all[(random.unit() * all.len() as f32) as usize];
                    field(&random_clip(shape, &UNIT, &mut random), &UNIT, 2.0)
                })
                .collect();
            let (clipped, mask) = classify(&UNIT, &opacity, &fields, AntiAliasing::N32);
            let single: Vec<_> = fields
                .iter()
                .map(|f| classify(&UNIT, &opacity, std::slice::from_ref(f), AntiAliasing::N32))
                .collect();
            for i in 0..UNIT.len() {
                let least = single.iter().map(|s| s.0[i]).fold(f32::INFINITY, f32::min);
                assert!(clipped[i] <= least);
                assert_eq!(mask[i] == UNTOUCHED, single.iter().all(|s| s.1[i] == UNTOUCHED));
                assert!(mask[i] == CLIPPED || single.iter().all(|s| s.1[i] != CLIPPED));
            }
        }
    }

    /// Indices of the voxels that the rays from `voxel` interpolate, written from the definition of the samples.
    fn footprint(grid: &Grid, occlusion: &Occlusion, voxel: [usize; 3]) -> Vec<usize> {
        let step = f64::from(occlusion.step(grid.min_spacing()));
        let samples = occlusion.samples(grid.min_spacing());
        let offset = occlusion.offset_mm.map_or(step / 2.0, f64::from);
        let mut found = Vec::new();
        for (v, _) in occlusion.rays.directions() {
            for m in 0..=samples {
                let s = offset + (f64::from(m) - 0.5) * step;
                let at: [f64; 3] = std::array::from_fn(|i| voxel[i] as f64 + s * v[i] / grid.spacing[i]);
                for corner in 0..8 {
                    let c: [i64; 3] =
                        std::array::from_fn(|i| at[i].floor() as i64 + i64::from(corner >> i & 1));
                    if (0..3)
                        .all(|i| c[i] >= 0 && c[i] < grid.dims[i] as i64 && (c[i] as f64 - at[i]).abs() < 1.0)
                    {
                        found.push(grid.index(c.map(|x| x as usize)));
                    }
                }
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    #[test]
    fn untouched_voxels_see_no_change() {
        let mut random = Random(2);
        for spacing in [[1.0, 1.0, 1.0], [0.6, 1.0, 2.3]] {
            let grid = Grid { dims: [12, 11, 10], spacing };
            let opacity = vec![1.0; grid.len()];
            for rays in [RaySet::R26, RaySet::W50] {
                let radius_mm = (3.0 * grid.min_spacing()) as f32;
                let occlusion = Occlusion {
                    rays,
                    quadrature: Quadrature::Segment,
                    radius_mm,
                    offset_mm: Some(0.9),
                    step_mm: None,
                    ..Occlusion::paper(1.0)
                };
                let footprints: Vec<_> =
                    (0..grid.len()).map(|i| footprint(&grid, &occlusion, grid.voxel(i))).collect();
                let (mut untouched, mut changed) = (0, 0);
                for shape in shapes() {
                    for how in ways(Samples::N8) {
                        let clip = random_clip(&shape, &grid, &mut random);
                        let reach = occlusion.reach(grid.min_spacing());
                        let fields = [field_of(&clip, &grid, reach, how.support)];
                        let (clipped, mask) = classify(&grid, &opacity, &fields, how);
                        changed += clipped.iter().filter(|&&o| o != 1.0).count();
                        for (i, &category) in mask.iter().enumerate() {
                            if category == UNTOUCHED {
                                untouched += 1;
                                let same = footprints[i].iter().all(|&j| clipped[j] == 1.0);
                                assert!(same, "{clip:?} voxel {:?}", grid.voxel(i));
                            }
                        }
                    }
                }
                assert!(untouched > 1000 && changed > 1000, "{untouched} {changed}");
            }
        }
    }
}
