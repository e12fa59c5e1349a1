//! Both eyes see the same shading (CAO §5): at points of the volume that both see, both read the same bits of V_AO; shading
//! in image space fails the same check at the same points.

use cao::renderer::{COLOUR, Renderer};
use cao_gpu::Gpu;
use cao_measure::exactness;
use cao_measure::exactness::compare_eyes;
use cao_measure::random::Random;
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::look::Look;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, RaySet};
use cao_model::options::Options;
use cao_model::settings::AntiAliasing;
use cao_model::settings::MapSettings;
use cao_model::settings::Scope;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::{StereoRig, View};
use cao_model::volume::Volume;
use cao_testing::*;
use cao_twin::draw::air::ambient_at;
use cao_twin::measure::ssao::{Settings, ssao};
use cao_twin::trilinear;
use glam::Vec3;

fn renderer(gpu: &Gpu, volume: &Volume, rays: RaySet, method: Method) -> Renderer {
    let setup = Setup {
        occlusion: Occlusion {
            rays: method.rays_like(rays),
            quadrature: method.quadrature(),
            radius_mm: 5.0 * volume.min_spacing() as f32,
            offset_mm: None,
            step_mm: None,
            ..Occlusion::paper(1.0)
        },
        method,
        options: Options::DEFAULT,
        scope: Scope::Needed,
        anti_aliasing: AntiAliasing::N32,
        maps: MapSettings { resolution: 128, cells: 64, pairs: 4, literal: false },
    };
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    renderer_of(gpu, volume, transfer, setup, COLOUR).unwrap()
}

#[test]
fn both_eyes_read_identical_bits_wherever_both_see() {
    const SEED: u64 = 40;
    let gpu = open();
    for (n, (name, dims, spacing)) in [
        ("engine", [40, 32, 36], [1.0, 1.0, 1.0]),
        ("fruit", [36, 30, 24], [0.7, 0.9, 1.3]),
        ("skeleton", [48, 40, 56], [1.0, 1.0, 1.0]),
        ("half-space", [24, 24, 24], [2.0, 2.0, 2.0]),
    ]
    .into_iter()
    .enumerate()
    {
        let volume = builtin_box(name, dims, spacing).unwrap();
        // Of methods that share their updates each takes two of the volumes.
        let takes = |(case, method): &(usize, Method)| kinds().contains(method) || case % 2 == n % 2;
        for (_, method) in methods().enumerate().filter(takes) {
            let mut renderer = renderer(&gpu, &volume, [RaySet::R14, RaySet::W14][n % 2], method);
            let mut random = Random::new(SEED);
            let mut points = 0;
            for turn in 0..4 {
                let shape = [Shape::Sphere, Shape::Plane, Shape::Mesh(concave())][turn % 3].clone();
                let clip = exactness::random_clip(&mut random, &renderer, &shape, turn as u32 % 2);
                let clip = Clip { mode: Mode::Remove, ..clip };
                renderer.set_clips(if turn == 0 { &[] } else { std::slice::from_ref(&clip) }).unwrap();
                renderer.update(&mut |_| ()).unwrap();
                let seen = compare_eyes(&renderer, &mut random).unwrap();
                assert_eq!(seen.different, 0, "{name} seed {SEED} turn {turn} {clip:?}: {seen:?}");
                points += seen.points;
            }
            assert!(points > 500, "{name}: only {points} points were seen by both eyes");
        }
    }
    close(gpu);
}

/// What both kernels' eyes read is the volume's: at voxel centres V_AO of the air in front of them, and before them the transmittance of
/// V_o along the ray, in plain loops.
#[test]
fn eyes_read_the_volumes_own_ambient_factor_and_transmittance() {
    /// Of the interpolation in f32: three coordinates of up to 36 voxels, half a step of f32 twice each, of the place and of its air.
    const AMBIENT: f32 = 2.0 * 3.0 * 36.0 * f32::EPSILON;
    /// Filters weigh in steps of 1/256 on many devices; a ray crosses a few voxels in which that matters.
    const TRANSMITTANCE: f64 = 0.02;

    let gpu = open();
    let volume = builtin_box("fruit", [36, 30, 32], [1.0, 0.8, 1.2]).unwrap();
    let grid = grid_of(&volume);
    let mut renderer = renderer(&gpu, &volume, RaySet::R14, Method::default());
    renderer.update(&mut |_| ()).unwrap();
    let (ambient, opacity) = (renderer.read_ambient().unwrap(), renderer.read_opacity().unwrap());
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let reference = f64::from(transfer.reference_mm(volume.min_spacing()));
    let step = 0.25 * volume.min_spacing();
    let voxels: Vec<usize> = (0..grid.len()).step_by(7).collect();
    let points: Vec<Vec3> = voxels
        .iter()
        .map(|&i| Vec3::from_array(grid.to_world(grid.voxel(i).map(|c| c as f64)).map(|c| c as f32)))
        .collect();
    let views = eyes(&volume, 30.0);
    let half = 0.5 * size_mm(&grid);
    let (mut compared, mut opaque) = (0, 0);
    for (n, seen) in
        cao::verify::seen_by_both(&renderer, &views, &Look::default(), &points).unwrap().iter().enumerate()
    {
        for (view, seen) in views.iter().zip(seen) {
            if seen.transmittance < 0.0 {
                continue;
            }
            if opacity[voxels[n]] > 0.0 {
                let place = grid.voxel(voxels[n]).map(|c| c as f64);
                let expected = ambient_at(&grid, &ambient, place) as f32;
                assert!((seen.ambient - expected).abs() <= AMBIENT, "{} {expected}", seen.ambient);
                opaque += 1;
            }
            let (uv, _) = view.project(points[n]).unwrap();
            let (origin, direction) = view.ray(uv);
            let at_depth = |t: f64| origin.as_dvec3() + t * direction.as_dvec3();
            let slant = direction.as_dvec3().length();
            let (a, b) = ((-half - origin) / direction, (half - origin) / direction);
            let begin = f64::from(a.min(b).max_element().max(view.near_mm));
            let depth = f64::from((points[n] - view.position).dot(view.orientation * -Vec3::Z));
            let end = depth - 1.5 * 1.2 / slant;
            let samples = (end - begin) * slant / step;
            // One sample more or less is a matter of rounding there.
            if (samples - samples.round()).abs() < 1e-3 {
                continue;
            }
            let mut transmittance = 1.0;
            for i in 0..samples.ceil().max(0.0) as u32 {
                let place = at_depth(begin + f64::from(i) * step / slant).to_array();
                let a = trilinear(&grid, &opacity, grid.to_index(place));
                transmittance *= (1.0 - a).max(0.0).powf(step / reference);
                if transmittance <= 0.01 {
                    break;
                }
            }
            let off = (f64::from(seen.transmittance) - transmittance).abs();
            assert!(off <= TRANSMITTANCE, "{} {transmittance} at {}", seen.transmittance, points[n]);
            compared += 1;
        }
    }
    assert!(compared > 2000 && opaque > 200, "{compared} points, {opaque} in matter");
    drop(renderer);
    close(gpu);
}

/// Points between voxels, too: the snapped positions of the two eyes agree but where rounding puts one on either side of
/// a boundary between two of them, a 256th of a voxel apart.
#[test]
fn between_voxels_both_eyes_read_the_same_but_at_the_snaps_own_borders() {
    const SEED: u64 = 41;
    /// Share of the points whose position is so near to a border of the snap on one of three axes: at some 100 mm the two
    /// eyes' positions differ by some rounding, 4e-6 voxel in the mean, and the snap is 1/256 voxel.
    const BORDER: f64 = 3.0 * 256.0 * 4e-6;
    /// There V_AO is read at places 1/256 voxel apart on up to three axes, and the way out of the matter turns little in between.
    const STEP: f32 = 3.0 / 256.0;

    let gpu = open();
    let volume = builtin_box("fruit", [36, 30, 32], [1.0; 3]).unwrap();
    let mut renderer = renderer(&gpu, &volume, RaySet::R14, Method::default());
    let pose = Pose { translate_mm: Vec3::new(6.0, -9.0, 6.0), scale: Vec3::splat(11.0), ..Pose::default() };
    renderer.set_clips(&[Clip { shape: Shape::Sphere, mode: Mode::Remove, pose }]).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let mut random = Random::new(SEED);
    let half = 0.5 * size_mm(&grid_of(&volume));
    let points: Vec<Vec3> =
        (0..20_000).map(|_| Vec3::from_array([(); 3].map(|()| random.between(-1.0, 1.0))) * half).collect();
    let (mut both, mut different) = (0, 0);
    for azimuth in [20.0, 60.0, 200.0] {
        let views = eyes(&volume, azimuth);
        for [left, right] in cao::verify::seen_by_both(&renderer, &views, &Look::default(), &points).unwrap()
        {
            if left.transmittance >= 0.3 && right.transmittance >= 0.3 {
                both += 1;
                let off = (left.ambient - right.ambient).abs();
                different += usize::from(left.ambient.to_bits() != right.ambient.to_bits());
                assert!(off <= STEP, "seed {SEED}: {left:?} {right:?}");
            }
        }
    }
    assert!(both > 2000, "{both}");
    assert!(different as f64 <= BORDER * f64::from(both), "{different} of {both}");
    drop(renderer);
    close(gpu);
}

fn eyes(volume: &Volume, azimuth: f32) -> [View; 2] {
    let rig = StereoRig::framing(volume.size_mm(), azimuth, 25.0);
    let far = 3.0 * rig.position.length();
    rig.views(1.0, 0.02 * far, far).unwrap()
}

/// How many of the pairs of values (left, right) are not the same bits.
fn mismatches(pairs: &[[f32; 2]]) -> usize {
    pairs.iter().filter(|[left, right]| left.to_bits() != right.to_bits()).count()
}

/// Points on the surface that the left eye sees, as its depth picture has them, that the right eye sees too: V_AO passes the
/// check, image-space occlusion from the same two pictures does not.
#[test]
fn image_space_occlusion_fails_the_check_that_data_space_passes() {
    const SIZE: [usize; 2] = [192, 192];
    let gpu = open();
    for (name, azimuth) in [("engine", 30.0), ("fruit", 80.0)] {
        let volume = builtin_box(name, [40, 40, 40], [1.0; 3]).unwrap();
        let grid = grid_of(&volume);
        let mut renderer = renderer(&gpu, &volume, RaySet::R26, Method::default());
        let pose =
            Pose { translate_mm: Vec3::new(9.0, -12.0, 9.0), scale: Vec3::splat(12.0), ..Pose::default() };
        renderer.set_clips(&[Clip { shape: Shape::Sphere, mode: Mode::Remove, pose }]).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        let views = eyes(&volume, azimuth);
        let look = Look::default();
        let (picture, _) = renderer.draw(&views, &look, SIZE.map(|s| s as u32)).unwrap();

        // Voxel centres within a voxel of the surface that each eye's picture shows at their place.
        let on_surface = |world: Vec3| -> Option<[usize; 2]> {
            let mut pixels = [0; 2];
            for eye in 0..2 {
                let (uv, depth) = views[eye].project(world)?;
                let place = uv.to_array().map(|c| c * SIZE[0] as f32);
                if place.iter().any(|&c| !(0.0..SIZE[0] as f32).contains(&c)) {
                    return None;
                }
                let pixel = place[1] as usize * SIZE[0] + place[0] as usize;
                let (n, f) = (views[eye].near_mm, views[eye].far_mm);
                let distance = |depth: f32| n * f / (f - depth * (f - n));
                if (distance(depth) - distance(picture.depth[eye][pixel])).abs() > 1.0 {
                    return None;
                }
                pixels[eye] = pixel;
            }
            Some(pixels)
        };
        let candidates = (0..grid.len()).filter_map(|i| {
            let world = Vec3::from_array(grid.to_world(grid.voxel(i).map(|c| c as f64)).map(|c| c as f32));
            on_surface(world).map(|pixels| (world, pixels))
        });
        let (points, pixels): (Vec<Vec3>, Vec<[usize; 2]>) = candidates.unzip();
        assert!(points.len() > 500, "{name}: {} points", points.len());

        let seen = cao::verify::seen_by_both(&renderer, &views, &look, &points).unwrap();
        let data_space: Vec<_> = seen.iter().map(|eyes| eyes.map(|eye| eye.ambient)).collect();
        assert_eq!(mismatches(&data_space), 0, "{name}");
        // Not because all is alike.
        let [low, high] = [f32::min, f32::max].map(|f| data_space.iter().map(|p| p[0]).reduce(f).unwrap());
        assert!(high - low > 0.3, "{name}: {low} ... {high}");

        let settings = Settings { radius_mm: 5.0, samples: 32, bias_mm: 0.2 };
        let images = [0, 1].map(|eye| ssao(&picture.depth[eye], SIZE, &views[eye], &settings));
        let image_space: Vec<_> = pixels.iter().map(|p| [images[0][p[0]], images[1][p[1]]]).collect();
        let different = mismatches(&image_space);
        assert!(different > points.len() / 3, "{name}: only {different} of {} differ", points.len());
        let mean =
            image_space.iter().map(|[l, r]| f64::from((l - r).abs())).sum::<f64>() / points.len() as f64;
        assert!(mean > 0.01, "{name}: by {mean} in the mean");
        println!(
            "{name}: of {} points image space differs at {different}, by {mean:.3} in the mean",
            points.len()
        );
    }
    close(gpu);
}
