//! Any calls in any order, with any numbers: the renderer does them or refuses them, never panics, leaks nothing, gives the validation layer
//! nothing to say, and works on as soon as it is told something sound. A run is short and always the same; CONTRIBUTING.md has the
//! command for a long one.

use cao::Budget;
use cao::renderer::{COLOUR, LateViews, Over, Renderer, Target, Targets, Views};
use cao_gpu::{Access, Format, Gpu, ImageDesc, ImageKind, ImageUse};
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::look::Look;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::options::Options;
use cao_model::settings::{AntiAliasing, MapSettings, Scope, Setup};
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::view::StereoRig;
use cao_model::volume::Volume;
use cao_testing::fuzz::config;
use cao_testing::meshes::join;
use cao_testing::*;
use glam::Vec3;
use proptest::prelude::*;
use proptest::sample::select;
use std::sync::Arc;

/// Sequences of a short run, of a hundred calls on average: two thousand calls.
const CASES: u32 = 20;

#[derive(Clone, Debug)]
enum Call {
    Transfer(TransferFunction),
    Setup(Setup),
    Clips(Vec<(usize, Mode, Pose)>),
    Values([u32; 3], [usize; 3], u8),
    Update,
    Record,
    RecordAndDrop,
    Within(Budget, f64),
    Invalidate,
    Draw(StereoRig, Look, [u32; 2]),
    /// Into images of a host, of 16×16 pixels; whether views come late.
    Into(StereoRig, Look, [u32; 2], Over, bool),
    Read,
}

/// Mostly sound, sometimes at the edge of what numbers are.
fn length() -> impl Strategy<Value = f32> {
    prop_oneof![
        8 => 0.0..12.0_f32,
        1 => select(vec![0.0, -0.0, -1.0, 1e-30, 1e-3, 1e30, f32::MAX, f32::NAN, f32::INFINITY, f32::NEG_INFINITY]),
    ]
}

fn vector() -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(length()).prop_map(Vec3::from_array)
}

fn transfer() -> impl Strategy<Value = TransferFunction> {
    let points = prop::collection::vec([length(), length()], 0..4);
    let own = (points, prop::option::of(length())).prop_map(|(opacity, reference_mm)| TransferFunction {
        opacity,
        colour: vec![[0.0, 1.0, 0.5, 0.2]],
        reference_mm,
    });
    let sound = (0.0..100.0_f32, 1.0..100.0_f32, 0.0..1.0_f32).prop_map(|(from, width, opacity)| {
        TransferFunction::new(vec![[from, 0.0], [from + width, opacity]], vec![[0.0; 4]], None).unwrap()
    });
    prop_oneof![1 => own, 3 => sound]
}

fn setup() -> impl Strategy<Value = Setup> {
    let rays = select(vec![
        RaySet::R6,
        RaySet::W14,
        RaySet::Spiral(20),
        RaySet::Spiral(3),
        RaySet::Spiral(0),
        RaySet::Spiral(255),
    ]);
    let method = prop_oneof![
        4 => select(vec![Method::FeatureDriven, Method::Lao, Method::Cao, Method::Rays]).prop_map(|m| (m, m.quadrature())),
        1 => (select(vec![Method::Cao, Method::Rays]), select(Quadrature::ALL.to_vec())),
    ];
    let maps = (
        select(vec![0_u32, 8, 64, 64, 64, 5000]),
        select(vec![0_u32, 4, 32, 64, 5000]),
        0..10_u32,
        any::<bool>(),
    );
    let lengths = (length(), prop::option::weighted(0.3, length()), prop::option::weighted(0.3, length()));
    (rays, method, maps, lengths, any::<bool>(), any::<bool>()).prop_map(
        |(rays, (method, quadrature), maps, lengths, all, smooth)| Setup {
            occlusion: Occlusion {
                rays,
                quadrature,
                radius_mm: lengths.0,
                offset_mm: lengths.1,
                step_mm: lengths.2,
                ..Occlusion::paper(1.0)
            },
            method,
            options: Options::DEFAULT,
            scope: if all { Scope::All } else { Scope::Needed },
            anti_aliasing: if smooth { AntiAliasing::N8 } else { AntiAliasing::N0 },
            maps: MapSettings { resolution: maps.0, cells: maps.1, pairs: maps.2, literal: maps.3 },
        },
    )
}

fn call() -> impl Strategy<Value = Call> {
    let pose = (vector(), vector(), vector()).prop_map(|(translate_mm, rotate_deg, scale)| Pose {
        translate_mm,
        rotate_deg,
        scale,
    });
    let clip = (0..9_usize, select(vec![Mode::Remove, Mode::Keep]), pose);
    let rig = (vector(), vector(), vector(), length(), length(), prop::option::of(length())).prop_map(
        |(position, target, up, ipd_mm, fov_deg, screen_mm)| StereoRig {
            position,
            target,
            up,
            ipd_mm,
            fov_deg,
            screen_mm,
        },
    );
    let rig = prop_oneof![rig, (length(), length()).prop_map(|(a, e)| StereoRig::framing([9.0; 3], a, e))];
    let look = (length(), prop::option::weighted(0.3, length()), vector()).prop_map(|(n, step_mm, light)| {
        Look { ambient: n, gain: n, tolerance: n, step_mm, light, ..Look::default() }
    });
    let look = prop_oneof![Just(Look::default()), look];
    let size = select(vec![[0, 4], [1, 1], [9, 7], [16, 16], [u32::MAX, 1], [1, u32::MAX]]);
    let (rig2, look2, size2) = (rig.clone(), look.clone(), size.clone());
    let over = select(vec![Over::Nothing, Over::Scene]);
    let budget = prop_oneof![
        (0..9_u32).prop_map(Budget::Bricks),
        Just(Budget::Bricks(u32::MAX)),
        length().prop_map(Budget::Ms)
    ];
    let place = prop::array::uniform3(prop_oneof![8 => 0..9_u32, 1 => Just(u32::MAX)]);
    prop_oneof![
        2 => transfer().prop_map(Call::Transfer),
        3 => setup().prop_map(Call::Setup),
        4 => prop::collection::vec(clip, 0..4).prop_map(Call::Clips),
        1 => Just(Call::Clips(vec![(0, Mode::Remove, Pose::default()); 9])),
        2 => (place, prop::array::uniform3(1..9_usize), any::<u8>()).prop_map(|(at, size, n)| Call::Values(at, size, n)),
        4 => Just(Call::Update),
        1 => Just(Call::Record),
        1 => Just(Call::RecordAndDrop),
        3 => (budget, any::<f64>()).prop_map(|(budget, ms)| Call::Within(budget, ms)),
        1 => Just(Call::Invalidate),
        3 => (rig, look, size).prop_map(|(rig, look, size)| Call::Draw(rig, look, size)),
        2 => (rig2, look2, size2, over, any::<bool>())
            .prop_map(|(rig, look, size, over, late)| Call::Into(rig, look, size, over, late)),
        1 => Just(Call::Read),
    ]
}

/// The shapes that clips name by number; the last is no solid.
fn shapes() -> Vec<Shape> {
    let cube = cao_model::mesh::TriangleMesh::cuboid();
    let touching = join(&[(&cube, 1.0, Vec3::ZERO, false), (&cube, 1.0, Vec3::new(2.0, 2.0, 0.0), true)]);
    let mut open = cube.clone();
    open.triangles.pop();
    let meshes = [convex(), Arc::new(touching), Arc::new(open)].map(Shape::Mesh);
    Shape::ANALYTIC.into_iter().chain(meshes).collect()
}

/// Does it, or hears why not.
fn act(
    gpu: &Gpu,
    renderer: &mut Renderer,
    shapes: &[Shape],
    call: &Call,
) -> Result<(), Box<dyn std::error::Error>> {
    match call {
        Call::Transfer(transfer) => renderer.set_transfer(transfer.clone())?,
        Call::Setup(setup) => renderer.set_setup(*setup)?,
        Call::Clips(list) => {
            let clip = |(shape, mode, pose): &(usize, Mode, Pose)| Clip {
                shape: shapes[*shape].clone(),
                mode: *mode,
                pose: *pose,
            };
            renderer.set_clips(&list.iter().map(clip).collect::<Vec<_>>())?;
        }
        Call::Values(first, size, value) => {
            let values = Values::U8(vec![*value; size.iter().product()]);
            renderer.set_values(*first, &Volume::new(*size, [1.0; 3], values)?)?;
        }
        Call::Update => drop(renderer.update(&mut |_| ())?),
        Call::Record => {
            let mut rec = gpu.recorder("calls")?;
            renderer.record_update(&mut rec)?;
            rec.submit_and_wait()?;
        }
        Call::RecordAndDrop => {
            let recorded = renderer.record_update(&mut gpu.recorder("calls")?);
            renderer.invalidate();
            recorded?;
        }
        Call::Within(budget, ms) => {
            let mut rec = gpu.recorder("calls")?;
            let updated = renderer.record_update_within(&mut rec, *budget)?;
            rec.submit_and_wait()?;
            renderer.updated(&updated, *ms)?;
        }
        Call::Invalidate => renderer.invalidate(),
        Call::Draw(rig, look, size) => drop(renderer.draw(&rig.views(1.0, 0.1, 100.0)?, look, *size)?),
        Call::Into(rig, look, size, over, late) => {
            let views = rig.views(1.0, 0.1, 100.0)?;
            let late = if *late { Some(LateViews::new(gpu, &views, look)?) } else { None };
            let views = late.as_ref().map_or(Views::Now(&views), Views::Late);
            let target = |format| {
                let usage = ImageUse::ATTACHMENT | ImageUse::SAMPLED;
                let desc = ImageDesc { dims: [16, 16, 1], layers: 2, format, kind: ImageKind::D2, usage };
                gpu.image("target", &desc)
            };
            let (colour, depth) = (target(Format::Rgba16Float)?, target(Format::D32Float)?);
            let targets = Target::layers(&colour, &depth, 2);
            let targets: Vec<_> =
                targets.into_iter().map(|target| Target { scene: target.depth, ..target }).collect();
            let mut rec = gpu.recorder("calls")?;
            rec.discard(&colour);
            rec.discard(&depth);
            rec.clear_image(&depth, [1.0; 4])?;
            rec.barrier(&[Access::TransferWrite], &[Access::SampledRead, Access::AttachmentWrite]);
            let targets = Targets { over: *over, ..Targets::new(&targets, *size) };
            renderer.record_draw(&mut rec, views, look, &targets)?;
            rec.submit_and_wait()?;
        }
        Call::Read => drop((renderer.read_ambient()?, renderer.read_opacity()?, renderer.read_mask()?)),
    }
    Ok(())
}

proptest! {
    #![proptest_config(config(CASES))]

    #[test]
    fn any_calls_are_done_or_refused(calls in prop::collection::vec(call(), 1..200)) {
        let gpu = open();
        let volume = builtin_box("engine", [9, 10, 8], [1.0, 0.8, 1.5]).unwrap();
        let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
        let sound = Setup { maps: MapSettings { resolution: 64, cells: 32, ..MapSettings::default() }, ..Setup::new(0.8) };
        let mut renderer = renderer_of(&gpu, &volume, transfer.clone(), sound, COLOUR).unwrap();
        let shapes = shapes();
        let (mut done, mut refused) = (0, 0);
        for call in &calls {
            match act(&gpu, &mut renderer, &shapes, call) {
                Ok(()) => done += 1,
                Err(error) => {
                    prop_assert!(!error.to_string().is_empty());
                    refused += 1;
                }
            }
        }
        prop_assert_eq!(done + refused, calls.len());
        // Whatever was refused, it works on.
        renderer.set_clips(&[Clip::remove(Shape::Sphere)]).unwrap();
        renderer.set_transfer(transfer).unwrap();
        renderer.set_setup(sound).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        let views = StereoRig::framing(volume.size_mm(), 30.0, 25.0).views(1.0, 1.0, 1000.0).unwrap();
        let (picture, _) = renderer.draw(&views, &Look::default(), [8, 8]).unwrap();
        prop_assert!(picture.colour.iter().flatten().flatten().all(|c| c.is_finite()));
        drop(renderer);
        close(gpu);
    }
}
