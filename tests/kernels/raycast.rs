//! The kernel `raycast` against its twin on small pictures, and what no picture may show: NaN, or the bricks that were
//! skipped.

use cao::cast::volumes::Volumes;
use cao::clip::clip_bricks::ClipBricks;
use cao::clip::clips::ClipSet;
use cao::clip::dilate::Dilate;
use cao::clip::peel::Peel;
use cao::draw::band::Band;
use cao::draw::bounds::Bounds;
use cao::draw::brick_distance::BrickDistance;
use cao::draw::eyes::FrameBuffer;
use cao::draw::picture::Picture;
use cao::draw::raycast::{Bindings, Raycast};
use cao::field::Field;
use cao::field::features::{Classes, FeatureSet};
use cao::field::occupancy::Occupancy;
use cao::field::opacity::Opacity;
use cao::field::transfer::TransferBuffer;
use cao::renderer::{COLOUR, Renderer, StereoImage, Target, Targets};
use cao_gpu::{Access, Buffer, BufferUse, DeviceKind, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse};
use cao_measure::random::Random;
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::feature::{Feature, Features};
use cao_model::light::AmbientLight;
use cao_model::look::{Look, Shading};
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::options::Options;
use cao_model::samples::Filter;
use cao_model::settings::MapSettings;
use cao_model::settings::Scope;
use cao_model::settings::Setup;
use cao_model::settings::{AntiAliasing, Support};
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::view::{StereoRig, Tangents, View, with_insets};
use cao_model::volume::Volume;
use cao_testing::*;
use cao_twin as twin;
use cao_twin::Grid;
use cao_twin::clip::clips::{ClipField, Dilation, Maps};
use glam::{Quat, Vec3};

/// Width and height of an eye's picture; neither is a multiple of a tile or a workgroup.
pub const SIZE: [u32; 2] = [47, 41];

/// What a colour component (0 ... about 1) of a pixel may be off by. The kernel snaps positions in V_AO to 1/256 voxel, over
/// which a factor shown twice over changes by up to 2 · √3/512; the opacities of some hundred samples round to f32 and
/// end the ray one sample earlier or later, at less than 1/100 of the light.
const COLOUR_TOLERANCE: f32 = 2.0 * 0.0034 + 0.01;

/// The same for Vulkan depth, which ranges over 0 ... 1 between near and far: one sample earlier or later.
fn depth_tolerance(view: &View, step_mm: f32, nearest_mm: f32) -> f32 {
    let (n, f) = (view.near_mm, view.far_mm);
    1e-5 + f * n / (f - n) * step_mm / (nearest_mm * nearest_mm)
}

/// Share of the pixels that may be further off: where a ray grazes a clip, an edge of a depth layer's pixel or the box, f32
/// and f64 may take another side, and a whole sample differs.
const GRAZING: f32 = 0.02;

pub fn setup(maps: MapSettings) -> Setup {
    Setup {
        occlusion: Occlusion {
            rays: RaySet::R14,
            quadrature: Quadrature::Left,
            radius_mm: 4.0,
            offset_mm: None,
            step_mm: None,
            ..Occlusion::paper(1.0)
        },
        method: Method::Cao,
        options: Options::DEFAULT,
        scope: Scope::All,
        anti_aliasing: AntiAliasing::N32,
        maps,
    }
}

pub const MAPS: MapSettings = MapSettings { resolution: 96, cells: 32, pairs: 4, literal: false };

/// Both eyes of the renderer's scene by the twin, from the device's own V_AO.
fn twin(
    renderer: &Renderer,
    volume: &Volume,
    transfer: &TransferFunction,
    clips: &[Clip],
    views: &[View; 2],
    look: &Look,
) -> [twin::draw::raycast::Image; 2] {
    let grid = grid_of(volume);
    let values: Vec<f32> = (0..volume.len()).map(|i| volume.value(i) as f32).collect();
    let ambient = renderer.read_ambient().unwrap();
    let reach = renderer.setup().occlusion.reach(grid.min_spacing());
    let support = renderer.setup().anti_aliasing.support;
    let dilation = Dilation::Conservative(MAPS.cells);
    let maps = Maps { layers: 4, resolution: MAPS.resolution, dilation, support };
    let fields: Vec<_> =
        clips.iter().map(|clip| ClipField::new(clip, &grid, reach, &maps).unwrap()).collect();
    let frame = twin::draw::raycast::Frame {
        grid,
        values: &values,
        parts: None,
        transfer,
        reference_mm: f64::from(transfer.reference_mm(volume.min_spacing())),
        ambient: &ambient,
        clips: &fields,
        step_mm: f64::from(look.step_mm.unwrap()),
        look: *look,
    };
    [0, 1].map(|eye| twin::draw::raycast::raycast(&frame, &views[eye], SIZE.map(|s| s as usize)))
}

fn assert_finite(image: &StereoImage, context: &str) {
    for eye in 0..2 {
        assert!(image.colour[eye].iter().flatten().all(|c| c.is_finite() && *c >= 0.0), "{context}: colour");
        assert!(image.colour[eye].iter().all(|c| c[3] <= 1.0 + 1e-6), "{context}: alpha");
        assert!(image.depth[eye].iter().all(|d| (0.0..=1.0).contains(d)), "{context}: depth");
    }
}

/// Compares both eyes; `nearest_mm` is the depth of the nearest thing that could be seen.
pub fn compare(
    found: &StereoImage,
    expected: &[twin::draw::raycast::Image; 2],
    views: &[View; 2],
    step: f32,
    nearest_mm: f32,
    context: &str,
) {
    assert_finite(found, context);
    for eye in 0..2 {
        let depth_limit = depth_tolerance(&views[eye], step, nearest_mm);
        let pixels = found.colour[eye].len();
        let (mut off, mut sum, mut shown) = (0, 0.0, 0);
        for i in 0..pixels {
            let (f, e) = (found.colour[eye][i], expected[eye].colour[i]);
            let colour = (0..4).map(|c| (f[c] - e[c]).abs()).fold(0.0, f32::max);
            let depth = (found.depth[eye][i] - expected[eye].depth[i]).abs();
            off += usize::from(colour > COLOUR_TOLERANCE || depth > depth_limit);
            sum += f64::from(colour);
            shown += usize::from(e[3] > 0.5);
        }
        assert!(shown > pixels / 20, "{context} eye {eye}: only {shown} of {pixels} pixels show something");
        let mean = sum / pixels as f64;
        assert!(
            off as f32 <= GRAZING * pixels as f32,
            "{context} eye {eye}: {off} of {pixels} pixels are off; mean {mean}"
        );
        assert!(mean < f64::from(COLOUR_TOLERANCE) / 4.0, "{context} eye {eye}: mean {mean}");
    }
}

/// The same volume in floats: drivers filter 8-bit texels to 8 bits, which a steep transfer function magnifies.
fn in_floats(volume: &Volume) -> Volume {
    volume_of(&grid_of(volume), (0..volume.len()).map(|i| volume.value(i) as f32).collect())
}

/// Outside, looking at the volume as a scene file's rig does.
pub fn framing(volume: &Volume, azimuth: f32, elevation: f32) -> [View; 2] {
    let rig = StereoRig::framing(volume.size_mm(), azimuth, elevation);
    let far = 3.0 * rig.position.length();
    rig.views(SIZE[0] as f32 / SIZE[1] as f32, 0.02 * far, far).unwrap()
}

#[test]
fn pictures_are_those_of_the_twin() {
    let gpu = open();
    let mesh = |mesh, mode, scale: f32| {
        let pose = Pose {
            translate_mm: Vec3::new(2.0, -3.0, 4.0),
            rotate_deg: Vec3::new(20.0, 30.0, 40.0),
            scale: Vec3::splat(scale),
        };
        Clip { shape: Shape::Mesh(mesh), mode, pose }
    };
    let shape = |shape, mode, at: Vec3, scale: f32| {
        let pose =
            Pose { translate_mm: at, rotate_deg: Vec3::new(10.0, 0.0, 50.0), scale: Vec3::splat(scale) };
        Clip { shape, mode, pose }
    };
    let cut = Vec3::new(4.0, -6.0, 5.0);
    let scenes = [
        ("engine", [24, 20, 22], [1.0, 1.0, 1.0], vec![]),
        ("fruit", [21, 25, 17], [1.0, 1.2, 1.5], vec![shape(Shape::Sphere, Mode::Remove, cut, 7.0)]),
        ("engine", [20, 20, 20], [1.1; 3], vec![mesh(convex(), Mode::Remove, 8.0)]),
        (
            "fruit",
            [20, 20, 20],
            [1.1; 3],
            vec![mesh(concave(), Mode::Remove, 6.0), shape(Shape::Plane, Mode::Remove, cut, 1.0)],
        ),
        ("skeleton", [22, 22, 30], [1.0; 3], vec![shape(Shape::Box, Mode::Keep, Vec3::ZERO, 9.0)]),
    ];
    for (n, (name, dims, spacing, clips)) in scenes.into_iter().enumerate() {
        let volume = builtin_box(name, dims, spacing).unwrap();
        let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
        let mut renderer = Renderer::new(&gpu, &volume, transfer.clone(), setup(MAPS), COLOUR).unwrap();
        renderer.set_clips(&clips).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        for turn in 0..3 {
            let look = Look {
                step_mm: Some([0.5, 0.35, 0.8][turn]),
                shading: if turn == 2 { Shading::Phong } else { Shading::PhongAo },
                ..Look::default()
            };
            let views = framing(&volume, -30.0 + 70.0 * (turn + n) as f32, 35.0 - 20.0 * turn as f32);
            let (found, _) = renderer.draw(&views, &look, SIZE).unwrap();
            let expected = twin(&renderer, &volume, &transfer, &clips, &views, &look);
            let nearest = views[0].position.length()
                - 0.5 * Vec3::from_array(volume.size_mm().map(|s| s as f32)).length();
            compare(
                &found,
                &expected,
                &views,
                look.step_mm.unwrap(),
                nearest.max(1.0),
                &format!("{name} {n} turn {turn}"),
            );
        }
    }
    close(gpu);
}

/// In coloured light, from the device's own V_AO; from the least of its colours it is another picture.
#[test]
fn pictures_in_coloured_light_are_those_of_the_twin() {
    let gpu = open();
    // A ball with a sharp edge: two voxels out none has a value, so that what stands for them is read.
    let grid = Grid { dims: [20, 22, 18], spacing: [1.0, 0.9, 1.2] };
    let ball = |i: usize| {
        let r2: f64 = grid.to_world(grid.voxel(i).map(|c| c as f64)).iter().map(|c| c * c).sum();
        if r2 < 49.0 { 200 } else { 0 }
    };
    let volume =
        Volume::new(grid.dims, grid.spacing, Values::U8((0..grid.len()).map(ball).collect())).unwrap();
    // What is lit lies most of a voxel out of the ball, so that most of what stands for its air is risen.
    let transfer =
        TransferFunction::new(vec![[10.0, 0.0], [40.0, 0.9]], vec![[0.0, 0.9, 0.9, 0.9]], None).unwrap();
    let clip = Clip {
        shape: Shape::Sphere,
        mode: Mode::Remove,
        pose: Pose { translate_mm: Vec3::new(4.0, -6.0, 5.0), scale: Vec3::splat(7.0), ..Pose::default() },
    };
    let mut setup = Setup::of(Method::Rays, volume.min_spacing());
    // Red from one side, blue from the other, green from a third: what is taken for another colour's is far from it.
    let sides = [[1.0; 3], [0.0, 2.0, 0.0], [0.0; 3], [2.5, 0.0, -2.5]];
    setup.occlusion.light = AmbientLight::harmonics(&sides).unwrap();
    setup.occlusion.radius_mm = 5.0;
    let mut renderer = Renderer::new(&gpu, &volume, transfer.clone(), setup, COLOUR).unwrap();
    renderer.set_clips(std::slice::from_ref(&clip)).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let views = framing(&volume, 40.0, 15.0);
    let values: Vec<f32> = (0..volume.len()).map(|i| volume.value(i) as f32).collect();
    let colours = renderer.read_ambient_colours().unwrap();
    let colours: [Vec<f32>; 3] = std::array::from_fn(|c| colours.iter().map(|v| v[c]).collect());
    let maps = Maps {
        layers: 4,
        support: Support::Voxel,
        resolution: MAPS.resolution,
        dilation: Dilation::Conservative(MAPS.cells),
    };
    let ambient = renderer.read_ambient().unwrap();
    let fields = [ClipField::new(&clip, &grid, 5.0, &maps).unwrap()];
    // The ambient term alone, and beside diffuse light, which has no colour.
    for shading in [Shading::Ao, Shading::PhongAo] {
        let look = Look { step_mm: Some(0.5), gain: 1.0, shading, ..Look::default() };
        let (found, _) = renderer.draw(&views, &look, SIZE).unwrap();
        let frame = twin::draw::raycast::Frame {
            grid,
            values: &values,
            parts: None,
            transfer: &transfer,
            reference_mm: f64::from(transfer.reference_mm(volume.min_spacing())),
            ambient: &ambient,
            clips: &fields,
            step_mm: 0.5,
            look,
        };
        let size = SIZE.map(|s| s as usize);
        let drawn = |eye: usize| twin::draw::raycast::raycast_coloured(&frame, &colours, &views[eye], size);
        let nearest =
            views[0].position.length() - 0.5 * Vec3::from_array(volume.size_mm().map(|s| s as f32)).length();
        compare(&found, &[drawn(0), drawn(1)], &views, 0.5, nearest.max(1.0), &format!("{shading:?}"));
        let grey = twin::draw::raycast::raycast(&frame, &views[0], size);
        let apart = |(f, g): (&[f32; 4], &[f32; 4])| (0..3).any(|c| (f[c] - g[c]).abs() > COLOUR_TOLERANCE);
        let other = found.colour[0].iter().zip(&grey.colour).filter(|pair| apart(*pair)).count();
        assert!(other > 100, "{shading:?}: {other} pixels have a colour");
    }
    drop(renderer);
    close(gpu);
}

/// Eyes and planes in the volume, a field of view that does not contain its own axis: as the twin has it, and without NaN.
#[test]
fn eyes_inside_the_volume_and_skew_fields_of_view() {
    let gpu = open();
    let volume = in_floats(&builtin_box("fruit", [24, 22, 26], [1.0; 3]).unwrap());
    let transfer = TransferFunction::preset("ct-soft", volume.range()).unwrap();
    let pose = Pose { scale: Vec3::splat(6.0), ..Pose::default() };
    let clips = [Clip { shape: Shape::Sphere, mode: Mode::Remove, pose }];
    let mut renderer = Renderer::new(&gpu, &volume, transfer.clone(), setup(MAPS), COLOUR).unwrap();
    renderer.set_clips(&clips).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let eye = |position: Vec3, tan: Tangents, near_mm: f32| View {
        position,
        orientation: Quat::from_rotation_y(0.4) * Quat::from_rotation_x(-0.3),
        tan,
        near_mm,
        far_mm: 90.0,
        reversed: false,
    };
    let even = Tangents { left: -0.8, right: 0.8, up: 0.7, down: -0.7 };
    let skew = Tangents { left: 0.1, right: 1.3, up: 0.9, down: 0.2 };
    let cases = [
        ("in the cut", [eye(Vec3::ZERO, even, 0.1), eye(Vec3::new(0.6, 0.0, 0.0), even, 0.1)]),
        (
            "in the flesh",
            [eye(Vec3::new(7.5, 2.0, 1.0), even, 0.5), eye(Vec3::new(8.0, 2.0, 1.0), skew, 0.5)],
        ),
        (
            "near plane inside",
            [eye(Vec3::new(6.0, 4.0, 20.0), even, 15.0), eye(Vec3::new(7.0, 4.0, 20.0), even, 12.0)],
        ),
        ("skew", [eye(Vec3::new(-4.0, -9.0, 30.0), skew, 1.0), eye(Vec3::new(-3.0, -9.0, 30.0), skew, 1.0)]),
    ];
    let look = Look { step_mm: Some(0.4), ..Look::default() };
    for (name, views) in cases {
        let (found, _) = renderer.draw(&views, &look, SIZE).unwrap();
        let expected = twin(&renderer, &volume, &transfer, &clips, &views, &look);
        let nearest = views[0].near_mm.min(views[1].near_mm).max(1.0);
        compare(&found, &expected, &views, 0.4, nearest, name);
    }
    drop(renderer);
    close(gpu);
}

/// Rays along an axis, through voxel centres and brick borders, in the box's faces, past its edges: every division by
/// zero there is, with an odd picture whose middle column and row have it.
#[test]
fn no_pixel_is_ever_nan() {
    const SEED: u64 = 30;
    let gpu = open();
    let mut random = Random::new(SEED);
    for (dims, turn) in [([17, 17, 17], 0), ([1, 1, 1], 1), ([33, 1, 9], 2)] {
        let grid = Grid { dims, spacing: [1.0; 3] };
        let volume = volume_of(&grid, opacities(&mut random, &grid, 1.0));
        let mut renderer = Renderer::new(&gpu, &volume, identity(), setup(MAPS), COLOUR).unwrap();
        if turn == 0 {
            let pose = Pose { scale: Vec3::splat(3.0), ..Pose::default() };
            renderer.set_clips(&[Clip { shape: Shape::Box, mode: Mode::Remove, pose }]).unwrap();
        }
        renderer.update(&mut |_| ()).unwrap();
        let even = Tangents { left: -1.0, right: 1.0, up: 1.0, down: -1.0 };
        let half = 0.5 * size_mm(&grid);
        let places = [
            Vec3::ZERO,
            Vec3::new(0.0, 0.0, 30.0),
            Vec3::new(half.x, 0.0, 30.0),
            Vec3::new(half.x, half.y, 30.0),
            Vec3::new(half.x, half.y, half.z),
            Vec3::new(-half.x, 0.5, 0.0),
            Vec3::new(8.0, -8.0, 30.0),
            Vec3::new(0.0, 0.0, -30.0),
        ];
        for position in places {
            for near_mm in [1e-4, 0.5, 31.0] {
                for orientation in [Quat::IDENTITY, Quat::from_rotation_y(std::f32::consts::FRAC_PI_2)] {
                    let view =
                        View { position, orientation, tan: even, near_mm, far_mm: 100.0, reversed: false };
                    let views = [view, View { position: position + Vec3::X, ..view }];
                    let look = Look { step_mm: Some(0.7), ..Look::default() };
                    let (found, _) = renderer.draw(&views, &look, [15, 13]).unwrap();
                    assert_finite(&found, &format!("{dims:?} {view:?}"));
                }
            }
        }
        for _ in 0..30 {
            let mut between = |low, high| random.between(low, high);
            let position = Vec3::new(between(-1.0, 1.0), between(-1.0, 1.0), between(-1.0, 1.0)) * 1.2 * half;
            let orientation =
                Quat::from_rotation_y(between(-3.1, 3.1)) * Quat::from_rotation_x(between(-1.5, 1.5));
            let near_mm = 10.0_f32.powf(between(-4.0, 1.5));
            let view = View {
                position,
                orientation,
                tan: even,
                near_mm,
                far_mm: near_mm * between(1.01, 1e4),
                reversed: false,
            };
            let views = [view, View { position: position + Vec3::Y * 0.1, ..view }];
            let (found, _) = renderer.draw(&views, &Look::default(), [15, 13]).unwrap();
            assert_finite(&found, &format!("seed {SEED} {dims:?} {view:?}"));
        }
    }
    close(gpu);
}

#[test]
fn equal_eyes_see_equal_pictures_bit_for_bit() {
    let gpu = open();
    let volume = builtin_box("engine", [24, 20, 22], [1.0; 3]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let mut renderer = Renderer::new(&gpu, &volume, transfer, setup(MAPS), COLOUR).unwrap();
    let pose = Pose { translate_mm: Vec3::new(5.0, -8.0, 4.0), scale: Vec3::splat(8.0), ..Pose::default() };
    renderer.set_clips(&[Clip { shape: Shape::Mesh(concave()), mode: Mode::Remove, pose }]).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    for azimuth in [0.0, 50.0, 200.0] {
        let [left, right] = framing(&volume, azimuth, 20.0);
        let bits = view_bits::<2>;
        let same = renderer.draw(&[left, left], &Look::default(), SIZE).unwrap().0;
        assert!(bits(&same, 0) == bits(&same, 1));
        // And what an eye sees does not depend on the other eye, or on which of the two it is.
        let both = renderer.draw(&[left, right], &Look::default(), SIZE).unwrap().0;
        let swapped = renderer.draw(&[right, left], &Look::default(), SIZE).unwrap().0;
        assert!(bits(&both, 0) == bits(&same, 0));
        assert!(bits(&both, 0) == bits(&swapped, 1) && bits(&both, 1) == bits(&swapped, 0));
        assert!(bits(&both, 0) != bits(&both, 1));
    }
    drop(renderer);
    close(gpu);
}

/// One view's colour and depth as bits.
fn view_bits<const VIEWS: usize>(image: &StereoImage<VIEWS>, view: usize) -> (Vec<u32>, Vec<u32>) {
    let colour = image.colour[view].iter().flatten().map(|c| c.to_bits()).collect();
    (colour, image.depth[view].iter().map(|d| d.to_bits()).collect())
}

/// What a view shows depends on nothing but the view: one, two, three or four at once give the pixels that it has as an eye of
/// two, whatever its place among them.
#[test]
fn one_to_four_views_show_what_each_shows_as_an_eye_of_two() {
    let gpu = open();
    let volume = builtin_box("fruit", [24, 20, 22], [1.0, 1.1, 0.9]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let mut renderer = Renderer::new(&gpu, &volume, transfer, setup(MAPS), COLOUR).unwrap();
    let pose = Pose { translate_mm: Vec3::new(5.0, -8.0, 4.0), scale: Vec3::splat(8.0), ..Pose::default() };
    renderer.set_clips(&[Clip { pose, ..Clip::remove(Shape::Sphere) }]).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let look = Look { step_mm: Some(0.4), ..Look::default() };
    let eyes = framing(&volume, 40.0, 20.0);
    let four = with_insets(eyes, 0.45).unwrap();
    let [a, b, c, d] = four;
    let pair = |first, second| renderer.draw(&[first, second], &look, SIZE).unwrap().0;
    let (outer, inner) = (pair(a, b), pair(c, d));
    let expected = [(&outer, 0), (&outer, 1), (&inner, 0), (&inner, 1)].map(|(i, eye)| view_bits(i, eye));
    for (n, picture) in expected.iter().enumerate() {
        // An insensitive comparison would take any picture for any other.
        assert!(expected[..n].iter().all(|other| other != picture), "view {n} is another one");
    }

    let all = renderer.draw(&four, &look, SIZE).unwrap().0;
    let turned = renderer.draw(&[d, c, b, a], &look, SIZE).unwrap().0;
    let three = renderer.draw(&[c, a, d], &look, SIZE).unwrap().0;
    for (n, expected) in expected.iter().enumerate() {
        assert!(view_bits(&all, n) == *expected, "view {n} of four");
        assert!(view_bits(&turned, 3 - n) == *expected, "view {n} of four, in reverse");
        assert!(
            view_bits(&renderer.draw(&[four[n]], &look, SIZE).unwrap().0, 0) == *expected,
            "view {n} alone"
        );
    }
    for (place, n) in [2, 0, 3].into_iter().enumerate() {
        assert!(view_bits(&three, place) == expected[n], "view {n} of three");
    }
    drop(renderer);
    close(gpu);
}

/// Counts that no pass can draw, and images with fewer layers than views, are refused; more layers than views do no harm.
#[test]
fn views_that_do_not_fit_are_refused_by_name() {
    let gpu = open();
    let volume = builtin_box("engine", [12, 10, 9], [1.0; 3]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let mut renderer = Renderer::new(&gpu, &volume, transfer, setup(MAPS), COLOUR).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let look = Look::default();
    let [left, right] = framing(&volume, 40.0, 20.0);
    let five = renderer.draw(&[left; 5], &look, SIZE).unwrap_err().to_string();
    assert!(five.contains("views") && five.contains('5') && five.contains('4'), "{five}");
    let none = renderer.draw(&[], &look, SIZE).unwrap_err().to_string();
    assert!(none.contains("views") && none.contains("at least one"), "{none}");

    let target = |layers, format| {
        let dims = [SIZE[0], SIZE[1], 1];
        let usage = ImageUse::ATTACHMENT;
        gpu.image("host's", &ImageDesc { dims, layers, format, kind: ImageKind::D2, usage }).unwrap()
    };
    let record = |views: &[View], layers| -> cao::Result<()> {
        let (colour, depth) = (target(layers, COLOUR), target(layers, Format::D32Float));
        let mut rec = gpu.recorder("host's frame").unwrap();
        rec.discard(&colour);
        rec.discard(&depth);
        rec.barrier(&[], &[Access::AttachmentWrite]);
        renderer.record_draw(
            &mut rec,
            views,
            &look,
            &Targets::new(&Target::layers(&colour, &depth, views.len()), SIZE),
        )?;
        Ok(rec.submit_and_wait().map(drop)?)
    };
    for (views, layers) in
        [(&[left][..], 1), (&[left, right], 2), (&[left, right, left, right], 4), (&[left], 3)]
    {
        record(views, layers).unwrap();
    }
    let few = record(&[left, right, left, right], 2).unwrap_err().to_string();
    assert!(few.contains("view 2") && few.contains("layer 2") && few.contains("in 2 layers"), "{few}");
    assert!(record(&[left; 6], 6).unwrap_err().to_string().contains("views"));
    drop(renderer);
    close(gpu);
}

/// Everything that the kernel reads, apart from the renderer, so that the leaps can be replaced.
struct Stages {
    field: Field,
    volumes: Volumes,
    occupancy: Buffer,
    transfer: TransferBuffer,
    features: FeatureSet,
    clips: ClipSet,
    frame: FrameBuffer,
    raycast: Raycast,
    distances: Buffer,
    bounds: Buffer,
}

impl Stages {
    fn new(
        gpu: &Gpu,
        volume: &Volume,
        transfer: &TransferFunction,
        clips: &[Clip],
        features: Features,
    ) -> Self {
        let field = Field::upload(gpu, volume).unwrap();
        let stages = Self {
            volumes: Volumes::new(gpu, &field).unwrap(),
            occupancy: gpu
                .buffer("occupancy", 4 * u64::from(field.brick_count()), BufferUse::Device)
                .unwrap(),
            transfer: TransferBuffer::new(gpu).unwrap(),
            features: FeatureSet::new(gpu, &field, features).unwrap(),
            clips: ClipSet::new(gpu).unwrap(),
            frame: FrameBuffer::new(gpu).unwrap(),
            raycast: Raycast::new(gpu, &field).unwrap(),
            distances: BrickDistance::buffer(gpu, &field).unwrap(),
            bounds: Bounds::buffer(gpu).unwrap(),
            field,
        };
        let (opacity, occupancy) = (Opacity::new(gpu).unwrap(), Occupancy::new(gpu).unwrap());
        let clip_bricks = ClipBricks::new(gpu).unwrap();
        let distance = BrickDistance::new(gpu, &stages.field).unwrap();
        let bounds = Bounds::new(gpu).unwrap();
        let mut stages = stages;
        let (peel, dilate) = (Peel::new(gpu).unwrap(), Dilate::new(gpu).unwrap());
        stages.clips = stages.clips.planned(gpu, clips, Some(2.0), 50.0, MAPS).unwrap();
        stages.clips.make(gpu, &peel, &dilate).unwrap();
        let volumes = &stages.volumes;
        let classes = Classes::new(gpu).unwrap();
        run(gpu, |rec| {
            stages.transfer.record(rec, transfer).unwrap();
            stages.features.record(rec, &classes, &stages.field, transfer, &stages.transfer).unwrap();
            let (field, transfer) = stages.opacities();
            stages.clips.record(rec, clips, 50.0).unwrap();
            rec.barrier(&[], &[Access::StorageWrite]);
            opacity.record(rec, field, transfer, &volumes.full_opacity).unwrap();
            occupancy.record(rec, field, transfer, &stages.features, &stages.occupancy).unwrap();
            clip_bricks
                .record(rec, &stages.field, &stages.clips, 2.0, Support::Voxel, &volumes.clip_bricks)
                .unwrap();
            rec.barrier(&[Access::StorageWrite], &[Access::StorageRead, Access::StorageWrite]);
            distance
                .record(rec, &stages.field, &stages.occupancy, &volumes.clip_bricks, &stages.distances)
                .unwrap();
            bounds.record(rec, &stages.field, &stages.distances, &stages.bounds).unwrap();
        });
        stages
    }

    fn opacities(&self) -> (&Field, &TransferBuffer) {
        self.features.opacities().unwrap_or((&self.field, &self.transfer))
    }

    /// How many bricks have opacity that the clips hide whole.
    fn hidden(&self, gpu: &Gpu, words: &[u32]) -> usize {
        let opaque: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(gpu, &self.occupancy));
        opaque.iter().zip(words).filter(|&(&opaque, &word)| opaque == 1 && leap(word) > 0).count()
    }

    /// The words of the bricks' distances.
    fn distances(&self, gpu: &Gpu) -> Vec<u32> {
        bytemuck::pod_collect_to_vec(&read_buffer(gpu, &self.distances))
    }

    /// The box of what shows something: bricks from the first on, and to the last.
    fn bounds(&self, gpu: &Gpu) -> [u32; 6] {
        bytemuck::pod_read_unaligned(&read_buffer(gpu, &self.bounds))
    }

    /// Left and right colour and depth as bytes, with these words of the bricks' distances; every ray goes through all of the volume.
    fn draw(&self, gpu: &Gpu, views: &[View; 2], look: &Look, distances: &[u32]) -> Vec<Vec<u8>> {
        let [x, y, z] = self.field.bricks();
        self.draw_within(gpu, views, look, distances, [x, y, z, x, y, z])
    }

    /// The same with rays that end where these bounds do.
    fn draw_within(
        &self,
        gpu: &Gpu,
        views: &[View; 2],
        look: &Look,
        distances: &[u32],
        bounds: [u32; 6],
    ) -> Vec<Vec<u8>> {
        let picture = Picture::new(gpu, SIZE, 2).unwrap();
        let Picture { colour, depth } = &picture;
        let distances = buffer(gpu, "words", bytemuck::cast_slice(distances));
        let bounds = buffer(gpu, "bounds", bytemuck::bytes_of(&bounds));
        let (field, transfer) = self.opacities();
        let bindings = Bindings {
            field,
            transfer,
            values: &self.field.volume,
            features: &self.features,
            ambient: &self.volumes.ambient,
            coloured: false,
            distances: &distances,
            bounds: &bounds,
            clips: &self.clips,
            frame: &self.frame,
        };
        let texels = u64::from(SIZE[0] * SIZE[1]);
        let back = |image: &Image| {
            gpu.buffer("back", texels * image.desc().format.bytes(), BufferUse::Readback).unwrap()
        };
        let backs = [back(colour), back(colour), back(depth), back(depth)];
        run(gpu, |rec| {
            rec.discard(colour);
            rec.discard(depth);
            self.frame.record(rec, field, views.into(), look, 1.0).unwrap();
            rec.barrier(&[], &[Access::StorageWrite]);
            let band = Band::whole(SIZE);
            self.raycast.record(rec, bindings, &picture, band, 0..band.tiles(), false).unwrap();
            rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
            for (n, back) in backs.iter().enumerate() {
                let image = if n < 2 { colour } else { depth };
                rec.copy_image_to_buffer(image, n as u32 % 2, [0; 3], [SIZE[0], SIZE[1], 1], back, 0)
                    .unwrap();
            }
            rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
        });
        backs.iter().map(|back| back.read(0, back.bytes()).unwrap()).collect()
    }
}

/// The word of a brick that no ray leaps over and that every clip may cut.
const NO_LEAP: u32 = 0xff << 24;

/// The distance in a word.
fn leap(word: u32) -> u32 {
    word & 0xff_ffff
}

/// Volumes and clips that leave much to leap over: empty, and wholly clipped; and features, of which some are hidden and some are left
/// whole by clips.
fn sparse_scenes() -> Vec<(&'static str, Volume, Vec<Clip>, Features)> {
    let clip = |shape, mode, at: [f32; 3], scale| {
        let pose = Pose {
            translate_mm: at.into(),
            rotate_deg: Vec3::new(20.0, 0.0, 50.0),
            scale: Vec3::splat(scale),
        };
        Clip { shape, mode, pose }
    };
    let tube = clip(Shape::Cylinder, Mode::Remove, [3.0, 0.0, 9.0], 7.0);
    let slab = clip(Shape::Plane, Mode::Remove, [2.0, 1.0, -3.0], 1.0);
    let ball = clip(Shape::Sphere, Mode::Keep, [4.0, -3.0, 2.0], 13.0);
    let hole = clip(Shape::Mesh(concave()), Mode::Remove, [-4.0, 2.0, 3.0], 9.0);
    // Half a voxel and a little below voxel 16, the face of a brick's box; to a ray the brick begins at 16 itself, so that long
    // steps come out of it and of the clip at once.
    let mut flat = clip(Shape::Plane, Mode::Remove, [0.0, 0.0, 15.49 - 12.5], 1.0);
    flat.pose.rotate_deg = Vec3::ZERO;
    let volume = |name, dims, spacing| builtin_box(name, dims, spacing).unwrap();
    let part = |name: &str, visible, spared| Feature { visible, spared, ..Feature::new(name) };
    let parts = Features::by_intervals(vec![
        (part("flesh", false, false), [30.0, 160.0]),
        (part("core", true, true), [160.0, 190.0]),
        (part("seeds", true, false), [225.0, 256.0]),
    ]);
    let none = Features::NONE;
    vec![
        ("flat", volume("engine", [40, 33, 26], [1.0; 3]), vec![flat], none.clone()),
        ("skeleton", volume("skeleton", [41, 33, 50], [1.0, 1.0, 0.8]), vec![tube.clone()], none.clone()),
        ("engine", volume("engine", [40, 33, 26], [1.0; 3]), vec![tube.clone(), slab.clone()], none.clone()),
        ("fruit", volume("fruit", [44, 40, 41], [1.0; 3]), vec![slab.clone(), hole], none.clone()),
        ("block", volume("engine", [48, 48, 40], [1.0; 3]), vec![ball], none.clone()),
        ("voxel", volume("voxel", [33; 3], [1.0; 3]), vec![tube], none),
        ("parts", volume("fruit", [44, 40, 41], [1.0; 3]), vec![slab], parts.unwrap()),
    ]
}

/// Pairs of views on a volume: along axes and brick borders, and from anywhere.
fn pairs_of_views(random: &mut Random, volume: &Volume) -> Vec<[View; 2]> {
    let even = Tangents { left: -0.4, right: 0.4, up: 0.4, down: -0.4 };
    let along = |position, orientation| View {
        position,
        orientation,
        tan: even,
        near_mm: 1.0,
        far_mm: 200.0,
        reversed: false,
    };
    let mut pairs = vec![
        // Along an axis through voxel centres: column 23 of 47 and row 20 of 41 have a direction of 0; in a volume of
        // 33 voxels they run in the border of two bricks.
        [along(Vec3::new(0.0, 0.0, 70.0), Quat::IDENTITY), along(Vec3::new(8.0, 8.0, 70.0), Quat::IDENTITY)],
        [along(Vec3::ZERO, Quat::IDENTITY), along(Vec3::new(-8.0, 0.0, 0.0), Quat::IDENTITY)],
    ];
    for _ in 0..4 {
        pairs.push(framing(volume, random.between(0.0, 360.0), random.between(-80.0, 80.0)));
    }
    pairs
}

/// Texels that differ between two pictures.
fn differing(a: &[Vec<u8>], b: &[Vec<u8>]) -> usize {
    let texels = |part: usize| if part < 2 { 16 } else { 4 };
    let differ = |part: usize| {
        a[part].chunks(texels(part)).zip(b[part].chunks(texels(part))).filter(|(a, b)| a != b).count()
    };
    (0..a.len()).map(differ).sum()
}

/// Leaping over bricks that show nothing, and asking only the clips that cut a brick, changes no bit of a picture; also along
/// axes and brick borders, and at the cuts behind what is leapt over.
#[test]
fn leaping_over_empty_and_clipped_space_changes_no_bit() {
    const SEED: u64 = 31;
    let gpu = open();
    let mut random = Random::new(SEED);
    let mut hidden = 0;
    for (name, volume, clips, features) in sparse_scenes() {
        let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
        let stages = Stages::new(&gpu, &volume, &transfer, &clips, features);
        let words = stages.distances(&gpu);
        let empty = words.iter().filter(|&&word| leap(word) > 0).count();
        assert!(empty > 10, "{name}: only {empty} bricks to leap over");
        hidden += stages.hidden(&gpu, &words);
        let every_sample = vec![NO_LEAP; words.len()];
        let mut shown = 0;
        for (n, views) in pairs_of_views(&mut random, &volume).iter().enumerate() {
            for step in [0.5, 0.31, 0.95] {
                let look = Look { step_mm: Some(step), ..Look::default() };
                let leapt = stages.draw(&gpu, views, &look, &words);
                let every = stages.draw(&gpu, views, &look, &every_sample);
                let differ = differing(&leapt, &every);
                assert_eq!(differ, 0, "{name} seed {SEED} views {n}: {:?}", views[0]);
                shown += every[..2].iter().flatten().filter(|&&byte| byte != 0).count();
            }
        }
        assert!(shown > 0, "{name}");
    }
    assert!(hidden > 20, "only {hidden} bricks with opacity are wholly clipped");
    close(gpu);
}

/// Rays that end where what shows something ends change no bit of a picture either; one brick less, on any side, and they do.
#[test]
fn bounds_change_no_bit_and_wrong_ones_are_caught() {
    const SEED: u64 = 33;
    let gpu = open();
    let mut random = Random::new(SEED);
    let (mut smaller, mut caught) = (0, [0; 6]);
    for (name, volume, clips, features) in sparse_scenes() {
        let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
        let stages = Stages::new(&gpu, &volume, &transfer, &clips, features);
        let (words, bounds) = (stages.distances(&gpu), stages.bounds(&gpu));
        let bricks = stages.field.bricks();
        smaller += (0..6).filter(|&i| bounds[i] < bricks[i % 3]).count();
        for (n, views) in pairs_of_views(&mut random, &volume).iter().enumerate() {
            for step in [0.5, 0.95, 3.0] {
                let look = Look { step_mm: Some(step), ..Look::default() };
                let whole = stages.draw(&gpu, views, &look, &words);
                let draw = |bounds| stages.draw_within(&gpu, views, &look, &words, bounds);
                let differ = differing(&draw(bounds), &whole);
                assert_eq!(differ, 0, "{name} seed {SEED} views {n} step {step}: {:?}", views[0]);
                if step == 0.5 {
                    for (i, caught) in caught.iter_mut().enumerate() {
                        let mut less = bounds;
                        less[i] -= 1;
                        *caught += differing(&draw(less), &whole);
                    }
                }
            }
        }
    }
    assert!(smaller > 6, "only {smaller} sides are nearer than the volume's");
    assert!(caught.iter().all(|differ| *differ > 50), "{caught:?}");
    close(gpu);
}

/// Distances that are one too large skip what shows; clips that are not asked hide nothing.
#[test]
fn a_wrong_distance_is_caught() {
    let gpu = open();
    let mut random = Random::new(32);
    let (mut too_far, mut not_asked) = (0, 0);
    for (_, volume, clips, features) in sparse_scenes() {
        let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
        let stages = Stages::new(&gpu, &volume, &transfer, &clips, features);
        let words = stages.distances(&gpu);
        let further = |word: &u32| if leap(*word) == 0 { *word } else { word + 1 };
        let further: Vec<u32> = words.iter().map(further).collect();
        let uncut: Vec<u32> = words.iter().map(|word| word & !NO_LEAP).collect();
        let look = Look { step_mm: Some(0.95), ..Look::default() };
        for views in &pairs_of_views(&mut random, &volume) {
            let right = stages.draw(&gpu, views, &look, &words);
            too_far += differing(&right, &stages.draw(&gpu, views, &look, &further));
            not_asked += differing(&right, &stages.draw(&gpu, views, &look, &uncut));
        }
    }
    assert!(too_far > 100 && not_asked > 100, "{too_far} {not_asked}");
    close(gpu);
}

/// sRGB level (0 ... 255, not rounded) of a premultiplied linear component over a background.
fn level(component: f32, alpha: f32, background: f32) -> f32 {
    let linear = (component + (1.0 - alpha) * background).clamp(0.0, 1.0);
    let coded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    255.0 * coded
}

/// Rounding of the sums of some hundred f32 samples, in levels: 2^-24 each, spread by the slope of sRGB coding at 0.
const LEVEL_ROUNDING: f32 = 100.0 * 255.0 * 12.92 * 6e-8;

/// A ray that ends early shows, to half a level of an 8-bit picture over any background, what the whole ray shows; a tolerance of
/// several levels does not, so that the comparison can tell.
#[test]
fn a_ray_that_ends_early_changes_no_pixel_by_more_than_half_a_level() {
    let gpu = open();
    let volume = in_floats(&builtin_box("engine", [32, 30, 31], [1.0; 3]).unwrap());
    let (low, high) = volume.range();
    let at = |share: f64| (low + share * (high - low)) as f32;
    let white = vec![[0.0, 1.0, 1.0, 1.0]];
    // The last is dark all the way to a bright end, where sRGB coding is steepest and most is still to come.
    let dark = vec![[at(0.2), 0.0, 0.0, 0.0], [at(0.6), 1e-4, 2e-4, 1e-4], [at(1.0), 1.0, 1.0, 1.0]];
    let steep = vec![[at(0.2), 0.0], [at(0.3), 0.9]];
    let faint = vec![[at(0.1), 0.0], [at(0.4), 0.35]];
    let (mut ended, mut loose) = (0, 0.0_f32);
    for (opacity, colour) in
        [(steep.clone(), white.clone()), (faint.clone(), white), (steep, dark.clone()), (faint, dark)]
    {
        let transfer = TransferFunction::new(opacity, colour, None).unwrap();
        let mut renderer = Renderer::new(&gpu, &volume, transfer, setup(MAPS), COLOUR).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        for turn in 0..3 {
            let views = framing(&volume, 70.0 * turn as f32, 35.0 - 30.0 * turn as f32);
            let draw = |tolerance| {
                let look = Look {
                    tolerance,
                    shading: if turn == 2 { Shading::Phong } else { Shading::PhongAo },
                    step_mm: Some(0.3),
                    ..Look::default()
                };
                renderer.draw(&views, &look, SIZE).unwrap().0
            };
            let whole = draw(0.0);
            let worst = |image: &StereoImage| {
                let mut worst = 0.0_f32;
                for (a, b) in image.colour.iter().flatten().zip(whole.colour.iter().flatten()) {
                    for background in [0.0, 0.5, 1.0] {
                        for c in 0..3 {
                            worst = worst
                                .max((level(a[c], a[3], background) - level(b[c], b[3], background)).abs());
                        }
                    }
                }
                worst
            };
            let early = draw(0.5);
            let off = worst(&early);
            assert!(off <= 0.5 + LEVEL_ROUNDING, "turn {turn}: {off} levels");
            assert!(early.depth == whole.depth);
            ended += early
                .colour
                .iter()
                .flatten()
                .zip(whole.colour.iter().flatten())
                .filter(|(a, b)| a != b)
                .count();
            loose = loose.max(worst(&draw(8.0)));
        }
    }
    assert!(ended > 1000, "only {ended} rays end early");
    assert!(loose > 1.0, "{loose} levels");
    close(gpu);
}

/// Levels that a picture of bytes may differ from that of floats by, and the share of pixels that may differ by more than one: filters of
/// GPUs round what they interpolate in another way for each format, and where a mask rises from 0 to 255 in a voxel that moves its surface.
fn by_filter(gpu: &Gpu) -> (f32, f32) {
    match gpu.info().kind {
        DeviceKind::Cpu => (1.0, 0.0),
        _ => (8.0, 0.01),
    }
}

/// Masks, few labels, everything that 8 bits hold: the same numbers in bytes and in floats.
#[test]
fn pictures_do_not_depend_on_the_type_that_values_are_stored_in() {
    let gpu = open();
    let engine = builtin_box("engine", [24, 20, 22], [1.0; 3]).unwrap();
    let Values::U8(full) = &engine.values else { panic!("the built-in engine has bytes") };
    let mask = full.iter().map(|v| u8::from(*v > 60)).collect();
    let labels = full.iter().map(|v| v >> 5).collect();
    for (name, values) in [("mask", mask), ("labels", labels), ("all", full.clone())] {
        let bytes = Volume::new(engine.dims, engine.spacing, Values::U8(values)).unwrap();
        let transfer = TransferFunction::preset("auto", bytes.range()).unwrap();
        let views = framing(&bytes, 30.0, 25.0);
        let mut pictures = [in_floats(&bytes), bytes].map(|volume| {
            let mut renderer = Renderer::new(&gpu, &volume, transfer.clone(), setup(MAPS), COLOUR).unwrap();
            renderer.update(&mut |_| ()).unwrap();
            renderer.draw(&views, &Look::default(), SIZE).unwrap().0
        });
        for eye in 0..2 {
            let [floats, bytes] = pictures.each_mut().map(|p| std::mem::take(&mut p.colour[eye]));
            assert!(
                floats.iter().filter(|c| c[3] > 0.5).count() > floats.len() / 20,
                "{name}: nothing shows"
            );
            let off = |(f, b): (&[f32; 4], &[f32; 4])| {
                let off = |i: usize| (level(f[i], f[3], 0.5) - level(b[i], b[3], 0.5)).abs();
                off(0).max(off(1)).max(off(2))
            };
            let off: Vec<f32> = floats.iter().zip(&bytes).map(off).collect();
            let worst = off.iter().copied().fold(0.0, f32::max);
            let beyond = off.iter().filter(|off| **off > 1.0).count();
            let (most, few) = by_filter(&gpu);
            assert!(
                worst <= most && beyond as f32 <= few * off.len() as f32,
                "{name}: {worst} levels between bytes and floats, {beyond} pixels beyond 1"
            );
        }
    }
    close(gpu);
}

/// Several samples a pixel: the twin takes the mean of whole pictures.
#[test]
fn samples_are_those_of_the_twin() {
    let gpu = open();
    let volume = in_floats(&builtin_box("engine", [20, 22, 18], [1.0, 1.1, 0.9]).unwrap());
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let mut renderer = Renderer::new(&gpu, &volume, transfer.clone(), setup(MAPS), COLOUR).unwrap();
    let clips = [Clip::remove(Shape::Plane)];
    renderer.set_clips(&clips).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let views = framing(&volume, 50.0, 30.0);
    for (samples, filter) in [(3, Filter::Box), (4, Filter::Gaussian)] {
        let look = Look { step_mm: Some(0.4), samples, filter, ..Look::default() };
        let (found, _) = renderer.draw(&views, &look, SIZE).unwrap();
        let expected = twin(&renderer, &volume, &transfer, &clips, &views, &look);
        compare(&found, &expected, &views, 0.4, 10.0, &format!("{samples} {filter:?}"));
    }
    drop(renderer);
    close(gpu);
}
