//! Pictures of volumes with features (`shared/feature_colour.wgsl` and the entry points `featured` of `raycast`) against their twin, and no
//! shells of a third feature where two meet.

use crate::raycast::{MAPS, SIZE, compare, framing, setup};
use cao::renderer::{COLOUR, Renderer};
use cao_gpu::{Format, Gpu};
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::feature::{Feature, Features};
use cao_model::look::{Look, Shading};
use cao_model::methods::Method;
use cao_model::occlusion::Occlusion;
use cao_model::settings::{Setup, Support};
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::view::View;
use cao_model::volume::Volume;
use cao_testing::*;
use cao_twin as twin;
use cao_twin::clip::clips::{ClipField, Dilation, Maps};
use cao_twin::draw::feature_colour::Parts;
use cao_twin::field::features::{classified, index, spared};
use glam::Vec3;

fn renderer(
    gpu: &Gpu,
    volume: &Volume,
    transfer: &TransferFunction,
    features: &Features,
    clips: &[Clip],
) -> Renderer {
    renderer_by(Method::Cao, gpu, volume, transfer, features, clips)
}

fn renderer_by(
    method: Method,
    gpu: &Gpu,
    volume: &Volume,
    transfer: &TransferFunction,
    features: &Features,
    clips: &[Clip],
) -> Renderer {
    let base = setup(MAPS);
    let occlusion = Occlusion { quadrature: method.quadrature(), ..base.occlusion };
    let setup = Setup { method, occlusion, ..base };
    let mut renderer = renderer_of(gpu, volume, transfer.clone(), setup, COLOUR).unwrap();
    renderer.set_clips(clips).unwrap();
    renderer.set_features(features.clone()).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    renderer
}

/// Both eyes by the twin, from the device's own V_AO.
fn twin(
    renderer: &Renderer,
    volume: &Volume,
    transfer: &TransferFunction,
    features: &Features,
    clips: &[Clip],
    views: &[View; 2],
    look: &Look,
) -> [twin::draw::raycast::Image; 2] {
    let grid = grid_of(volume);
    let values: Vec<f32> = (0..volume.len()).map(|i| volume.value(i) as f32).collect();
    let opacity = classified(volume, transfer, features);
    let left: Vec<f32> =
        opacity.iter().zip(spared(volume, features)).map(|(a, s)| if s { *a } else { 0.0 }).collect();
    let index = index(volume, features);
    let reach = renderer.setup().occlusion.reach(grid.min_spacing());
    let maps = Maps {
        layers: 4,
        support: Support::Voxel,
        resolution: MAPS.resolution,
        dilation: Dilation::Conservative(MAPS.cells),
    };
    let fields: Vec<_> =
        clips.iter().map(|clip| ClipField::new(clip, &grid, reach, &maps).unwrap()).collect();
    let ambient = renderer.ambient().fields().ambient;
    let channels = (ambient.desc().format == Format::Rgba16Unorm).then(|| {
        let texels: Vec<[u16; 4]> = bytemuck::pod_collect_to_vec(&read_image(renderer.gpu(), ambient));
        let greatest = |texel: &[u16; 4]| *texel.iter().max().unwrap();
        std::array::from_fn(|c| {
            let of = |texel: &[u16; 4]| f32::from(if c < 4 { texel[c] } else { greatest(texel) }) / 65535.0;
            texels.iter().map(of).collect()
        })
    });
    let frame = twin::draw::raycast::Frame {
        grid,
        values: &opacity,
        parts: Some(Parts {
            features,
            index: &index,
            values: &values,
            spared: &left,
            channels: channels.as_ref(),
        }),
        transfer: &TransferFunction { opacity: identity().opacity, ..transfer.clone() },
        reference_mm: f64::from(transfer.reference_mm(volume.min_spacing())),
        ambient: &renderer.read_ambient().unwrap(),
        clips: &fields,
        step_mm: f64::from(look.step_mm.unwrap()),
        look: *look,
    };
    [0, 1].map(|eye| twin::draw::raycast::raycast(&frame, &views[eye], SIZE.map(|s| s as usize)))
}

fn coloured(name: &str, colour: [f32; 3]) -> Feature {
    Feature { colour: Some(colour), ..Feature::new(name) }
}

/// Layers of the fruit: what is left out is nobody's.
fn layers() -> Features {
    let hidden = Feature { visible: false, ..Feature::new("rind") };
    let spared = Feature { spared: true, scale: 2.0, ..coloured("core", [0.1, 0.3, 0.9]) };
    Features::by_intervals(vec![
        (Feature { spared: true, ..coloured("seeds", [0.9, 0.8, 0.1]) }, [225.0, 256.0]),
        (Feature { scale: 0.5, ..Feature::new("flesh") }, [30.0, 130.0]),
        (spared, [160.0, 190.0]),
        (hidden, [190.0, 225.0]),
    ])
    .unwrap()
}

#[test]
fn pictures_of_features_are_those_of_the_twin() {
    let gpu = open();
    let clip = |shape, mode, at: [f32; 3], scale| Clip {
        shape,
        mode,
        pose: Pose {
            translate_mm: at.into(),
            rotate_deg: Vec3::new(10.0, 0.0, 50.0),
            scale: Vec3::splat(scale),
        },
    };
    let ball = clip(Shape::Sphere, Mode::Remove, [4.0, -6.0, 5.0], 9.0);
    let slab = clip(Shape::Plane, Mode::Remove, [1.0, -2.0, 0.0], 1.0);
    let volume = builtin_box("fruit", [21, 25, 19], [1.0, 1.1, 1.2]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let labels = {
        let grid = grid_of(&volume);
        let of = |i| (grid.voxel(i)[0] / 7 + grid.voxel(i)[2] / 10) as u8;
        let list = vec![Feature { spared: true, ..Feature::new("a") }, coloured("b", [0.8, 0.1, 0.1])];
        let third = Feature { visible: false, ..Feature::new("c") };
        let list = list.into_iter().chain([third]).collect();
        Features::by_labels(list, volume.dims, (0..grid.len()).map(of).collect()).unwrap()
    };
    // Every third stripe is nobody's, between two features.
    let stripes = {
        let grid = grid_of(&volume);
        let of = |i| (grid.voxel(i)[0] / 2 % 3) as u8;
        let list = vec![coloured("a", [0.9; 3]), coloured("b", [0.9; 3])];
        Features::by_labels(list, volume.dims, (0..grid.len()).map(of).collect()).unwrap()
    };
    for (n, (method, features, clips)) in [
        (Method::Cao, layers(), vec![]),
        (Method::Cao, layers(), vec![ball.clone()]),
        (Method::Cao, labels, vec![ball.clone(), slab]),
        // Which reads the factor of the feature that it shows.
        (Method::FeatureDriven, layers(), vec![ball]),
        (Method::FeatureDriven, stripes, vec![]),
    ]
    .iter()
    .enumerate()
    {
        let renderer = renderer_by(*method, &gpu, &volume, &transfer, features, clips);
        for turn in 0..2 {
            // Twice over, as others are shown, most of what features leave of their own light is all of it.
            let gain = if *method == Method::FeatureDriven { 1.0 } else { Look::default().gain };
            let look = Look {
                step_mm: Some([0.5, 0.35][turn]),
                shading: [Shading::PhongAo, Shading::Phong][turn],
                gain,
                ..Look::default()
            };
            let views = framing(&volume, -30.0 + 70.0 * (turn + n) as f32, 35.0 - 20.0 * turn as f32);
            let (found, _) = renderer.draw(&views, &look, SIZE).unwrap();
            let expected = twin(&renderer, &volume, &transfer, features, clips, &views, &look);
            let nearest = views[0].position.length()
                - 0.5 * Vec3::from_array(volume.size_mm().map(|s| s as f32)).length();
            let context = format!("scene {n} turn {turn}");
            compare(&found, &expected, &views, look.step_mm.unwrap(), nearest.max(1.0), &context);
        }
    }
    close(gpu);
}

/// A white ball in air, where values between are those of a red skin: drawn by values it has a skin that is not there.
#[test]
fn where_two_features_meet_there_is_no_shell_of_a_third() {
    let gpu = open();
    let grid = twin::Grid { dims: [24; 3], spacing: [1.0; 3] };
    let ball = |i: usize| {
        let r2: f64 = grid.to_world(grid.voxel(i).map(|c| c as f64)).iter().map(|c| c * c).sum();
        if r2 < 64.0 { 200 } else { 0 }
    };
    let volume =
        Volume::new(grid.dims, grid.spacing, Values::U8((0..grid.len()).map(ball).collect())).unwrap();
    let opacity = vec![[70.0, 0.0], [80.0, 0.9], [120.0, 0.9], [130.0, 0.0], [180.0, 0.0], [190.0, 1.0]];
    let colour = vec![[130.0, 1.0, 0.0, 0.0], [180.0, 1.0, 1.0, 1.0]];
    let transfer = TransferFunction::new(opacity, colour, None).unwrap();
    let parts = vec![(Feature::new("skin"), [60.0, 140.0]), (Feature::new("bone"), [170.0, 256.0])];
    let look = Look { step_mm: Some(0.5), ..Look::default() };
    // Pixels that are more red than white.
    let red = |features: &Features| {
        let renderer = renderer(&gpu, &volume, &transfer, features, &[]);
        let (image, _) = renderer.draw(&framing(&volume, 20.0, 30.0), &look, SIZE).unwrap();
        let shown = image.colour[0].iter().filter(|c| c[3] > 0.5).count();
        assert!(shown > 100, "{shown}");
        image.colour[0].iter().filter(|[r, g, _, _]| *r > 0.02 && *g < 0.5 * r).count()
    };
    let (without, with) = (red(&Features::NONE), red(&Features::by_intervals(parts).unwrap()));
    assert!(without > 100, "{without}");
    assert_eq!(with, 0);
    close(gpu);
}

/// What hides nothing changes no opacity: the same V_o and V_AO, to the bit, of every method; a toggle computes anew only what is near the
/// feature, and one back brings back every bit.
#[test]
fn a_feature_that_changes_nothing_changes_no_bit_and_a_toggle_touches_only_what_is_near_it() {
    let gpu = open();
    let volume = builtin_box("fruit", [48, 44, 48], [1.0; 3]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let state = |renderer: &Renderer| (renderer.read_opacity().unwrap(), renderer.read_ambient().unwrap());
    for method in methods() {
        let quadrature = method.quadrature();
        let base = setup(MAPS);
        let occlusion = Occlusion { quadrature, rays: method.rays(), ..base.occlusion };
        let setup = Setup { method, occlusion, ..base };
        let mut renderer = renderer_of(&gpu, &volume, transfer.clone(), setup, COLOUR).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        let before = state(&renderer);
        let grid = grid_of(&volume);
        let core = |i: usize| {
            let p = grid.to_world(grid.voxel(i).map(|c| c as f64));
            u8::from(p.iter().map(|c| c * c).sum::<f64>() < 36.0)
        };
        let labels = (0..grid.len()).map(core).collect();
        let mut features = Features::by_labels(vec![Feature::new("core")], volume.dims, labels).unwrap();
        renderer.set_features(features.clone()).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        // Beside a feature other matter has none, which is all the same to all methods but one.
        let own = method == Method::FeatureDriven;
        assert!(own || state(&renderer) == before, "{}", method.name());
        let before = state(&renderer);
        features.list[0].visible = false;
        renderer.set_features(features.clone()).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        let hidden = state(&renderer);
        let [seen, shaded] = [hidden.0 != before.0, hidden.1 != before.1];
        // Histograms of values know nothing of features.
        let all = if method == Method::Histograms { seen || shaded } else { seen && shaded };
        assert!(all, "{}", method.name());
        if [Method::Rays, Method::FeatureDriven].contains(&method) {
            // A ball of 6 mm and what is within 6 mm of it, in whole bricks, of a volume of 48 mm; boxes, cubes and cones reach farther.
            let found = renderer.categories().unwrap();
            let computed = found.affected as f64 / volume.len() as f64;
            assert!(computed > 0.02 && computed < 0.5, "{}: {computed}", method.name());
        }
        features.list[0].visible = true;
        renderer.set_features(features).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        assert!(state(&renderer) == before, "{}", method.name());
    }
    close(gpu);
}
