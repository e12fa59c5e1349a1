//! The central claim (CAO §4): contextual ambient occlusion equals a full recomputation bit for bit, on every voxel that
//! has a value; the check itself is checked, and made to fail.

use cao::ambient::Recomputed;
use cao::field::Field;
use cao::field::bricks::{BrickList, Bricks, Which};
use cao::renderer::{COLOUR, Renderer};
use cao::verify::compare::{Compare, Difference};
use cao_gpu::Gpu;
use cao_measure::exactness;
use cao_measure::random::Random;
use cao_model::builtin::{NAMES, builtin_box};
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::light::AmbientLight;
use cao_model::look::Look;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::options::Options;
use cao_model::settings::MapSettings;
use cao_model::settings::Scope;
use cao_model::settings::Setup;
use cao_model::settings::{AntiAliasing, Estimator, Support};
use cao_model::transfer::TransferFunction;
use cao_model::view::StereoRig;
use cao_model::volume::Volume;
use cao_testing::*;
use glam::Vec3;

const MAPS: MapSettings = MapSettings { resolution: 128, cells: 64, pairs: 4, literal: false };

fn setup(rays: RaySet, quadrature: Quadrature, radius_mm: f32, scope: Scope) -> Setup {
    Setup {
        occlusion: Occlusion { rays, quadrature, radius_mm, ..Occlusion::paper(1.0) },
        method: Method::Cao,
        options: Options::DEFAULT,
        scope,
        anti_aliasing: AntiAliasing::N32,
        maps: MAPS,
    }
}

fn renderer(gpu: &Gpu, volume: &Volume, setup: Setup) -> Renderer {
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    renderer_of(gpu, volume, transfer, setup, COLOUR).unwrap()
}

/// Updates and compares with a full recomputation.
fn verify(renderer: &mut Renderer) -> Difference {
    renderer.update(&mut |_| ()).unwrap();
    cao::verify::verify(renderer, &mut |_| ()).unwrap().0
}

fn add(sum: &mut Difference, one: Difference) {
    sum.compared += one.compared;
    sum.different += one.different;
    sum.largest = sum.largest.max(one.largest);
    sum.recomputed += one.recomputed;
}

/// Scenes of other sizes and spacings than a cube's, each with a ray set, rule and scope of its own.
fn scenes() -> Vec<(&'static str, Volume, Setup)> {
    let boxes = [
        ([26, 26, 26], [1.0, 1.0, 1.0]),
        ([31, 20, 25], [0.5, 0.8, 0.6]),
        ([24, 29, 18], [1.0, 1.0, 2.5]),
        ([40, 17, 16], [1.5, 1.5, 1.5]),
    ];
    let make = |(n, (name, _)): (usize, (&'static str, &'static str))| {
        let (dims, spacing) = boxes[n % boxes.len()];
        let volume = builtin_box(name, dims, spacing).unwrap();
        let rays = RaySet::ALL[n % RaySet::ALL.len()];
        // Some 80 samples a voxel, whatever the rays.
        let radius = (80.0 / rays.count() as f32).clamp(2.0, 7.0) * volume.min_spacing() as f32;
        let few = matches!(name, "empty" | "voxel");
        let scope = if n % 3 == 1 || few { Scope::All } else { Scope::Needed };
        (name, volume, setup(rays, Quadrature::CAST[n % 3], radius, scope))
    };
    NAMES.into_iter().enumerate().map(make).collect()
}

/// Every built-in scene, every shape, both sides, poses that are ordinary, across the border, tiny, around everything and
/// outside, one renderer a scene.
#[test]
fn contextual_equals_full_for_every_scene_shape_and_pose() {
    const SEED: u64 = 20;
    let gpu = open();
    for (name, volume, setup) in scenes() {
        let mut renderer = renderer(&gpu, &volume, setup);
        let mut random = Random::new(SEED);
        let mut total = Difference::default();
        for shape in shapes() {
            for turn in 0..5 {
                let mut clip = exactness::random_clip(&mut random, &renderer, &shape, turn);
                for mode in [Mode::Remove, Mode::Keep] {
                    clip.mode = mode;
                    renderer.set_clips(std::slice::from_ref(&clip)).unwrap();
                    let found = verify(&mut renderer);
                    assert_eq!(
                        found.different,
                        0,
                        "{name} {:?} seed {SEED} turn {turn}: {} {mode:?} {:?}: {found:?}",
                        setup.occlusion,
                        shape.name(),
                        clip.pose
                    );
                    add(&mut total, found);
                }
            }
        }
        assert!(total.compared > 20_000, "{name}: {total:?}");
        // Both kinds of voxels were among them.
        assert!(total.recomputed > 5000 && total.recomputed < total.compared, "{name}: {total:?}");
    }
    close(gpu);
}

/// A random step of a session: clips, transfer function, radius, rays, rule, scope, maps, method, or a picture.
fn edit(random: &mut Random, renderer: &mut Renderer, volume: &Volume, shapes: &[Shape]) -> String {
    let size = size_mm(&grid_of(volume));
    let pick = |random: &mut Random, n: usize| random.below(n as u64) as usize;
    match random.below(8) {
        0 => {
            let (low, high) = volume.range();
            let at = |share: f32| low as f32 + share * (high - low) as f32;
            let first = random.between(0.05, 0.6);
            let opacity = vec![[at(first), 0.0], [at(first + 0.2), random.between(0.1, 1.0)], [at(2.0), 1.0]];
            let reference = [None, Some(random.between(0.5, 3.0))][pick(random, 2)];
            let transfer = TransferFunction::new(opacity, vec![[0.0, 1.0, 0.9, 0.8]], reference).unwrap();
            let said = format!("{transfer:?}");
            renderer.set_transfer(transfer).unwrap();
            said
        }
        1 | 2 => {
            let smallest = volume.min_spacing() as f32;
            let mut next = *renderer.setup();
            match random.below(5) {
                0 => next.occlusion.radius_mm = random.between(0.0, 5.0) * smallest,
                1 => {
                    next.occlusion.rays = [RaySet::R6, RaySet::W14, RaySet::R26][pick(random, 3)];
                    next.occlusion.quadrature = Quadrature::CAST[pick(random, 3)];
                    next.occlusion.light = next.occlusion.light.turned(third_turn());
                }
                2 => {
                    let between = |random: &mut Random, low, high| Some(random.between(low, high) * smallest);
                    next.occlusion.offset_mm = [None, between(random, 0.0, 3.0)][pick(random, 2)];
                    next.occlusion.step_mm = [None, between(random, 0.4, 1.5)][pick(random, 2)];
                }
                3 => {
                    next.scope = [Scope::All, Scope::Needed][pick(random, 2)];
                    next.method = [Method::Cao, Method::Cao, Method::Lao][pick(random, 3)];
                }
                _ => {
                    let (resolution, cells) = [(16, 4), (33, 11), (48, 48), (128, 32)][pick(random, 4)];
                    next.maps = MapSettings { resolution, cells, ..next.maps };
                    next.anti_aliasing = AntiAliasing {
                        support: [Support::Voxel, Support::Neighbours][pick(random, 2)],
                        estimator: [Estimator::Paper, Estimator::Interior][pick(random, 2)],
                        ..[AntiAliasing::N0, AntiAliasing::N8, AntiAliasing::N32][pick(random, 3)]
                    };
                }
            }
            renderer.set_setup(next).unwrap();
            format!("{next:?}")
        }
        3 => {
            let rig = StereoRig::framing([size.x.into(), size.y.into(), size.z.into()], 20.0, 30.0);
            let far = 3.0 * rig.position.length();
            let views = rig.views(1.0, 0.01 * far, far).unwrap();
            renderer.update(&mut |_| ()).unwrap();
            renderer.draw(&views, &Look::default(), [9, 7]).unwrap();
            "picture".into()
        }
        _ => {
            let count = [0, 1, 1, 1, 2, 3, 5][pick(random, 7)];
            let clips: Vec<Clip> = (0..count)
                .map(|_| {
                    let shape = &shapes[pick(random, shapes.len())];
                    random_clip(random, shape, size)
                })
                .collect();
            renderer.set_clips(&clips).unwrap();
            format!("{clips:?}")
        }
    }
}

/// Whatever is done in whatever order with one renderer, updates leave what a full recomputation gives: nothing of an
/// earlier state is left.
#[test]
fn contextual_equals_full_after_any_sequence_of_edits() {
    const SEED: u64 = 21;
    const STEPS: usize = 60;
    let gpu = open();
    let shapes = shapes();
    for case in 0..4 {
        let seed = SEED + 100 * case;
        let mut random = Random::new(seed);
        let dims = std::array::from_fn(|_| 9 + random.below(18) as usize);
        let spacing = std::array::from_fn(|_| f64::from(random.between(0.4, 2.0)));
        let name = ["engine", "fruit", "skeleton", "sheets"][case as usize];
        let volume = builtin_box(name, dims, spacing).unwrap();
        let radius = 3.0 * volume.min_spacing() as f32;
        let mut setup = setup(RaySet::R14, Quadrature::Left, radius, Scope::Needed);
        // Light from above, which edits turn.
        if case == 1 {
            setup.occlusion.light = AmbientLight::SKY;
        }
        let mut renderer = renderer(&gpu, &volume, setup);
        let mut total = Difference::default();
        let mut history = Vec::new();
        for step in 0..STEPS {
            history.push(edit(&mut random, &mut renderer, &volume, &shapes));
            // Several edits in one update, too.
            if random.below(4) == 0 {
                continue;
            }
            if random.below(2) == 0 {
                run(&gpu, |rec| renderer.record_update(rec).unwrap());
            }
            let found = verify(&mut renderer);
            assert_eq!(
                found.different,
                0,
                "{name} {dims:?} {spacing:?} seed {seed} step {step}: {found:?} under {:?}, after {}",
                renderer.setup(),
                history[history.len().saturating_sub(4)..].join("; ")
            );
            add(&mut total, found);
        }
        assert!(total.compared > 10_000 && total.recomputed > 1000, "{total:?}");
    }
    close(gpu);
}

/// Shapes as large as a pose may be: their distances are rounded by more than a voxel's thousandth.
#[test]
fn contextual_equals_full_for_shapes_far_larger_than_the_volume() {
    const SEED: u64 = 22;
    let gpu = open();
    let mut random = Random::new(SEED);
    let volume = builtin_box("engine", [24, 20, 22], [0.1, 0.1, 0.12]).unwrap();
    let mut renderer = renderer(&gpu, &volume, setup(RaySet::R26, Quadrature::Left, 0.3, Scope::All));
    let mut total = Difference::default();
    for turn in 0..24 {
        for shape in [Shape::Box, Shape::Sphere, Shape::Cylinder, Shape::Cone, Shape::Plane] {
            let scale = 10.0_f32.powf(random.between(2.0, 4.7));
            let turned = Vec3::from_array([(); 3].map(|()| random.between(-180.0, 180.0)));
            let mut pose = Pose { rotate_deg: turned, scale: Vec3::splat(scale), ..Pose::default() };
            // A place of its surface is in the volume: the end of an axis, or for a cone its flank.
            let surface = if matches!(shape, Shape::Plane) { Vec3::ZERO } else { Vec3::X };
            let surface = if matches!(shape, Shape::Cone) { Vec3::new(0.5, 0.0, 0.0) } else { surface };
            let jitter = Vec3::from_array([(); 3].map(|()| random.between(-0.5, 0.5)));
            pose.translate_mm = jitter - pose.rotation() * (surface * scale);
            let mode = [Mode::Remove, Mode::Keep][turn % 2];
            renderer.set_clips(&[Clip { shape: shape.clone(), mode, pose }]).unwrap();
            let found = verify(&mut renderer);
            assert_eq!(
                found.different,
                0,
                "seed {SEED} turn {turn} {} {mode:?} {pose:?}: {found:?}",
                shape.name()
            );
            add(&mut total, found);
        }
    }
    assert!(total.recomputed > 10_000 && total.recomputed < total.compared, "{total:?}");
    drop(renderer);
    close(gpu);
}

/// A setup that is refused changes nothing: maps of one radius under rays of another would be inexact.
#[test]
fn a_refused_setup_leaves_the_renderer_as_it_was() {
    let gpu = open();
    let volume = builtin_box("engine", [24, 24, 24], [1.0; 3]).unwrap();
    let good = setup(RaySet::R14, Quadrature::Left, 3.0, Scope::All);
    let mut renderer = renderer(&gpu, &volume, good);
    let pose = Pose { scale: Vec3::splat(5.0), ..Pose::default() };
    let clip = Clip { shape: Shape::Mesh(convex()), mode: Mode::Remove, pose };
    renderer.set_clips(&[clip]).unwrap();
    assert_eq!(verify(&mut renderer).different, 0);
    let before = renderer.read_ambient().unwrap();
    let occlusion = Occlusion { radius_mm: 6.0, ..good.occlusion };
    for bad in [
        Setup { occlusion, maps: MapSettings { cells: 3, ..MAPS }, ..good },
        Setup { occlusion, maps: MapSettings { pairs: 0, ..MAPS }, ..good },
        Setup { occlusion: Occlusion { radius_mm: f32::NAN, ..occlusion }, ..good },
    ] {
        renderer.set_setup(bad).unwrap_err();
        assert_eq!(*renderer.setup(), good);
        assert_eq!(verify(&mut renderer).different, 0);
        assert!(renderer.read_ambient().unwrap() == before);
    }
    drop(renderer);
    close(gpu);
}

/// What the kernel `compare` has to find, in plain loops.
fn difference(
    grid: &cao_twin::Grid,
    scope: Scope,
    opacity: &[f32],
    mask: &[u8],
    expected: &[f32],
    actual: &[f32],
) -> Difference {
    let mut found = Difference::default();
    for i in 0..grid.len() {
        let cube = || grid.neighbours(grid.voxel(i)).map(|n| grid.index(n)).chain([i]);
        let has_value =
            cube().any(|n| mask[n] != 0) && (scope == Scope::All || cube().any(|n| opacity[n] > 0.0));
        if has_value {
            found.compared += 1;
            found.recomputed += u64::from(mask[i] != 2);
            if expected[i].to_bits() != actual[i].to_bits() {
                found.different += 1;
                found.largest = found.largest.max((expected[i] - actual[i]).abs());
            }
        }
    }
    found
}

/// The same claim without the kernel `compare` and without `verify`: a renderer that only ever recomputes in full against one
/// that only ever updates, read back and compared here, with the same count of voxels as the kernel's.
#[test]
fn a_renderer_that_recomputes_agrees_with_one_that_updates() {
    const SEED: u64 = 23;
    let gpu = open();
    let mut random = Random::new(SEED);
    let volume = builtin_box("fruit", [33, 26, 21], [1.0, 1.2, 1.4]).unwrap();
    let grid = grid_of(&volume);
    for (quadrature, scope) in Quadrature::CAST.into_iter().zip([Scope::Needed, Scope::All, Scope::Needed]) {
        let contextual = setup(RaySet::R26, quadrature, 4.0, scope);
        let mut updates = renderer(&gpu, &volume, contextual);
        let mut recomputes = renderer(&gpu, &volume, Setup { method: Method::Lao, ..contextual });
        for (turn, shape) in shapes().iter().enumerate() {
            let clips = [random_clip(&mut random, shape, size_mm(&grid))];
            for one in [&mut updates, &mut recomputes] {
                one.set_clips(&clips).unwrap();
                one.update(&mut |_| ()).unwrap();
            }
            let (opacity, mask) = (updates.read_opacity().unwrap(), updates.read_mask().unwrap());
            assert_eq!(recomputes.read_opacity().unwrap(), opacity);
            let (actual, expected) = (updates.read_ambient().unwrap(), recomputes.read_ambient().unwrap());
            let found = difference(&grid, scope, &opacity, &mask, &expected, &actual);
            assert_eq!(found.different, 0, "seed {SEED} turn {turn} {clips:?}: {found:?}");
            assert_eq!(verify(&mut updates), found);
        }
    }
    close(gpu);
}

/// The kernel `compare` finds what there is to find: nothing in two copies, every planted bit, and two radii apart.
#[test]
fn planted_differences_are_all_reported() {
    const SEED: u64 = 24;
    let gpu = open();
    let compare = Compare::new(&gpu).unwrap();
    let bricks = Bricks::new(&gpu).unwrap();
    let in_list = |field: &Field, scope, [opacity, expected, actual]: [&[f32]; 3], mask: &[u8]| {
        let [opacity, expected, actual] = [opacity, expected, actual].map(|f| float_image(&gpu, field, f));
        let mask = byte_image(&gpu, field, mask);
        let list = BrickList::new(&gpu, field).unwrap();
        let before = buffer(&gpu, "changed before", &vec![0; 4 * field.brick_count() as usize]);
        let which = if scope == Scope::All { Which::All } else { Which::Needed };
        run(&gpu, |rec| bricks.record(rec, field, which, &opacity, &mask, &before, &list).unwrap());
        compare.run(&gpu, field, scope, &list, &opacity, Recomputed::Mask(&mask), &expected, &actual).unwrap()
    };
    let mut random = Random::new(SEED);
    for grid in GRIDS {
        let field = blank(&gpu, &grid);
        for turn in 0..6 {
            let opacity: Vec<f32> =
                (0..grid.len()).map(|_| if random.below(20) == 0 { 0.5 } else { 0.0 }).collect();
            let hidden = random.below(3);
            let mask: Vec<u8> = (0..grid.len())
                .map(|i| if grid.voxel(i)[2] as u64 % 3 < hidden { 0 } else { 1 + random.below(2) as u8 })
                .collect();
            let expected: Vec<f32> = (0..grid.len()).map(|_| random.between(0.0, 1.0)).collect();
            let mut actual = expected.clone();
            for _ in 0..turn {
                let i = random.below(grid.len() as u64) as usize;
                // From the last bit of the mantissa up.
                actual[i] = f32::from_bits(actual[i].to_bits() ^ 1 << random.below(22));
            }
            for scope in [Scope::All, Scope::Needed] {
                let found = in_list(&field, scope, [&opacity, &expected, &actual], &mask);
                let counted = difference(&grid, scope, &opacity, &mask, &expected, &actual);
                assert_eq!(found, counted, "seed {SEED} {:?} turn {turn} {scope:?}", grid.dims);
            }
        }
    }

    let volume = builtin_box("engine", [24, 24, 24], [1.0; 3]).unwrap();
    let ambient = |radius| {
        let mut renderer = renderer(&gpu, &volume, setup(RaySet::R14, Quadrature::Left, radius, Scope::All));
        renderer.update(&mut |_| ()).unwrap();
        (renderer.read_opacity().unwrap(), renderer.read_mask().unwrap(), renderer.read_ambient().unwrap())
    };
    let ((opacity, mask, near), (_, _, far)) = (ambient(3.0), ambient(4.0));
    let field = blank(&gpu, &grid_of(&volume));
    let found = in_list(&field, Scope::All, [&opacity, &near, &far], &mask);
    assert!(found.different > 1000 && found.largest > 0.05, "{found:?}");
    drop((field, compare, bricks));
    close(gpu);
}

/// The paper's dilation, eq. (4) as printed, leaves stale voxels; with the same poses and maps of the same resolution the
/// conservative one leaves none. So the test that shows equality can fail.
#[test]
fn the_literal_dilation_fails_where_the_conservative_one_does_not() {
    const SEED: u64 = 25;
    const POSES: usize = 12;
    let gpu = open();
    let volume = builtin_box("engine", [32, 32, 32], [1.0; 3]).unwrap();
    let total = |literal: bool| {
        let maps = MapSettings { resolution: 16, cells: 16, pairs: 4, literal };
        let setup = Setup { maps, ..setup(RaySet::R26, Quadrature::Left, 5.0, Scope::Needed) };
        let mut renderer = renderer(&gpu, &volume, setup);
        let mut random = Random::new(SEED);
        let mut total = Difference::default();
        for turn in 0..POSES {
            let shape = Shape::Mesh([convex(), concave()][turn % 2].clone());
            let mut clip = exactness::random_clip(&mut random, &renderer, &shape, 0);
            clip.mode = Mode::Remove;
            renderer.set_clips(&[clip]).unwrap();
            add(&mut total, verify(&mut renderer));
        }
        total
    };
    let (literal, conservative) = (total(true), total(false));
    assert_eq!(conservative.different, 0, "seed {SEED}: {conservative:?}");
    assert!(conservative.recomputed > 1000, "{conservative:?}");
    assert!(literal.different > 0, "seed {SEED}: {literal:?}");
    assert!(literal.largest > 0.0);
    println!(
        "literal: {} of {} voxels stale in {POSES} poses, by up to {}; conservative: none of {}",
        literal.different, literal.compared, literal.largest, conservative.compared
    );
    close(gpu);
}

/// The layers of a mesh are drawn without regard to the rays: the longest leave the cut as the shortest do.
#[test]
fn the_cut_of_a_mesh_does_not_depend_on_the_radius() {
    let gpu = open();
    let volume = builtin_box("uniform", [16; 3], [1.0; 3]).unwrap();
    let short = setup(RaySet::R6, Quadrature::Left, 1.0, Scope::All);
    let mut renderer = renderer(&gpu, &volume, short);
    let pose = Pose { scale: Vec3::splat(5.0), ..Pose::default() };
    renderer.set_clips(&[Clip { shape: Shape::Mesh(concave()), mode: Mode::Remove, pose }]).unwrap();
    let mut cut = None;
    for radius_mm in [1.0, 20.0, 2000.0] {
        let occlusion = Occlusion { radius_mm, ..short.occlusion };
        renderer.set_setup(Setup { occlusion, ..short }).unwrap();
        assert_eq!(verify(&mut renderer).different, 0, "radius {radius_mm}");
        let opacity = renderer.read_opacity().unwrap();
        assert!(opacity.contains(&0.0), "radius {radius_mm}: nothing is cut");
        assert!(cut.get_or_insert_with(|| opacity.clone()) == &opacity, "radius {radius_mm}");
    }
    drop(renderer);
    close(gpu);
}

/// Clips whose coordinates round to more than a voxel: far away, far larger than the volume, voxels of micrometres. Both were
/// inexact before rounding had a bound of its own.
#[test]
fn contextual_equals_full_where_rounding_is_coarser_than_voxels() {
    let gpu = open();
    for (spacing, shape, mode, scale, at, radius) in [
        (0.003, Shape::Cone, Mode::Remove, 287_824.78, Vec3::new(41_700.2, -137_738.4, 0.0), 0.006),
        (0.001, Shape::Cylinder, Mode::Keep, 21_928.494, Vec3::new(20_880.557, 6_697.85, 0.0), 0.001),
    ] {
        let volume = builtin_box("uniform", [16; 3], [spacing; 3]).unwrap();
        let setup = setup(RaySet::R26, Quadrature::Cell, radius, Scope::All);
        let mut renderer = renderer(&gpu, &volume, setup);
        let pose = Pose { translate_mm: at, scale: Vec3::splat(scale), ..Pose::default() };
        renderer.set_clips(&[Clip { shape, mode, pose }]).unwrap();
        assert_eq!(verify(&mut renderer).different, 0, "spacing {spacing}");
        drop(renderer);
    }
    close(gpu);
}
