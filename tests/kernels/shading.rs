//! Normals as pictures show them: of matter under light from ±x, ±y and ±z in turn, diffuse and from one side only, the six
//! pictures are the normal. It is compared with that of analytic solids, with that of the clip on cut faces, and cut faces
//! with the light that they should have, level by level.

use cao::renderer::{COLOUR, Renderer};
use cao_measure::random::Random;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::look::{LightFrom, Look, Shading};
use cao_model::mesh::TriangleMesh;
use cao_model::methods::Method;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::view::{StereoRig, View};
use cao_model::volume::Volume;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::draw::clip_normal::clip_normal;
use glam::{DVec3, Vec2, Vec3};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Pixels along the edges of a picture.
const SIZE: u32 = 64;

/// Degrees between the shown and the true normal: the mean, and what 99 % stay below. The eye tells 1° of a smooth surface from
/// the next, as an edge of facets; single places hide in the texture of any material.
const MEAN: f64 = 1.0;
const MOST: f64 = 4.0;

/// Diffuse light from one side of the world, and nothing else.
fn only_diffuse(light: Vec3) -> Look {
    Look {
        shading: Shading::Phong,
        ambient: 0.0,
        diffuse: 1.0,
        specular: 0.0,
        two_sided: false,
        light,
        light_from: LightFrom::World,
        ..Look::default()
    }
}

/// White and opaque from this value on.
fn opaque_from(value: f32) -> TransferFunction {
    let step = vec![[value, 0.0], [value, 1.0]];
    TransferFunction::new(step, vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap()
}

/// Two views from opposite sides, planes close round the volume so that depths are fine.
fn sides(volume: &Volume, azimuth: f32, elevation: f32) -> [View; 2] {
    [(azimuth, elevation), (azimuth + 180.0, -elevation)].map(|(azimuth, elevation)| {
        let rig = StereoRig::framing(volume.size_mm(), azimuth, elevation);
        let (away, half) =
            (rig.position.length(), 0.5 * Vec3::from_array(volume.size_mm().map(|s| s as f32)));
        let [left, _] = rig.views(1.0, away - half.length(), away + half.length()).unwrap();
        left
    })
}

/// A place that a pixel shows.
struct Place {
    world: DVec3,
    towards_eye: DVec3,
    normal: DVec3,
}

/// Places and normals of all pixels that show something, more than `inset` mm inside the volume's faces.
fn places(renderer: &Renderer, volume: &Volume, views: &[View; 2], inset: f64) -> Vec<Place> {
    let axes = [Vec3::X, Vec3::Y, Vec3::Z];
    let draw = |light| renderer.draw(views, &only_diffuse(light), [SIZE; 2]).unwrap().0;
    let lit = axes.map(|axis| [draw(axis), draw(-axis)]);
    let half = 0.5 * DVec3::from_array(volume.size_mm()) - inset;
    let mut found = Vec::new();
    for (eye, view) in views.iter().enumerate() {
        for i in 0..(SIZE * SIZE) as usize {
            let depth = lit[0][0].depth[eye][i];
            if depth == 1.0 {
                continue;
            }
            let pixel = Vec2::new((i as u32 % SIZE) as f32 + 0.5, (i as u32 / SIZE) as f32 + 0.5);
            let (origin, direction) = view.ray(pixel / SIZE as f32);
            let (near, far) = (f64::from(view.near_mm), f64::from(view.far_mm));
            let way = far * near / (far - f64::from(depth) * (far - near));
            let world = origin.as_dvec3() + way * direction.as_dvec3();
            if world.abs().cmpge(half).any() {
                continue;
            }
            let normal = DVec3::from_array(std::array::from_fn(|axis| {
                let [from, against] = &lit[axis];
                f64::from(from.colour[eye][i][0] - against.colour[eye][i][0])
            }));
            found.push(Place { world, towards_eye: -direction.as_dvec3().normalize(), normal });
        }
    }
    found
}

/// Degrees between the normals and the true ones: mean, and what a share of them stays below.
fn angles(places: &[Place], truth: impl Fn(&Place) -> DVec3, share: f64) -> (f64, f64) {
    let mut angles: Vec<f64> =
        places.iter().map(|place| place.normal.angle_between(truth(place)).to_degrees()).collect();
    angles.sort_by(f64::total_cmp);
    let mean = angles.iter().sum::<f64>() / angles.len() as f64;
    (mean, angles[(share * (angles.len() - 1) as f64) as usize])
}

/// A solid: signed distance in mm, near its surface, and normal at points from the volume's centre.
type Solid = fn(DVec3) -> (f64, DVec3);

fn ball(p: DVec3) -> (f64, DVec3) {
    (p.length() - 40.3, p.normalize_or_zero())
}

fn torus(p: DVec3) -> (f64, DVec3) {
    let outwards = p.with_z(0.0);
    let from_ring = p - 36.0 * outwards.normalize_or_zero();
    (from_ring.length() - 15.2, from_ring.normalize_or_zero())
}

fn gyroid(p: DVec3) -> (f64, DVec3) {
    let wave = TAU / 48.0;
    let (sin, cos) = ((p * wave).map(f64::sin), (p * wave).map(f64::cos));
    let value = sin.x * cos.y + sin.y * cos.z + sin.z * cos.x;
    let gradient = wave
        * DVec3::new(
            cos.x * cos.y - sin.z * sin.x,
            cos.y * cos.z - sin.x * sin.y,
            cos.z * cos.x - sin.y * sin.z,
        );
    (value / gradient.length().max(1e-3), gradient.normalize_or_zero())
}

/// The solid in 128³ voxels, its edge a ramp of so many of them.
fn scanned(solid: Solid, edge: f64, bytes: bool) -> Volume {
    let grid = Grid { dims: [128; 3], spacing: [1.0; 3] };
    let value = |i: usize| {
        let p = DVec3::from_array(grid.to_world(grid.voxel(i).map(|c| c as f64)));
        (0.5 - solid(p).0 / edge).clamp(0.0, 1.0)
    };
    let values = match bytes {
        true => Values::U8((0..grid.len()).map(|i| (255.0 * value(i)).round() as u8).collect()),
        false => Values::F32((0..grid.len()).map(|i| (255.0 * value(i)) as f32).collect()),
    };
    Volume::new(grid.dims, grid.spacing, values).unwrap()
}

#[test]
fn surfaces_have_the_normals_of_the_solids_that_were_scanned() {
    let gpu = open();
    for (name, solid) in [("ball", ball as Solid), ("torus", torus), ("gyroid", gyroid)] {
        for (n, edge) in [1.0, 2.0, 4.0].into_iter().enumerate() {
            let volume = scanned(solid, edge, n % 2 == 0);
            let renderer = unoccluded(&gpu, &volume, opaque_from(127.5), &[]);
            // The filter reaches two voxels; nearer to the volume's faces it takes their voxels twice.
            let views = sides(&volume, 30.0 + 50.0 * n as f32, 25.0);
            let places = places(&renderer, &volume, &views, 3.0);
            assert!(places.len() > 500, "{name}: {} places", places.len());
            let (mean, most) = angles(&places, |place| solid(place.world).1, 0.99);
            println!("{name}, edge {edge}: {mean:.2} and {most:.2} degrees at {} places", places.len());
            assert!(mean <= MEAN && most <= MOST, "{name}, edge {edge}: {mean} and {most} degrees");
            // A normal, not just its direction: half of it is the light of what faces away.
            let short = places.iter().filter(|place| (place.normal.length() - 1.0).abs() > 0.01).count();
            assert!(short * 100 <= places.len(), "{name}, edge {edge}: {short} are no unit vectors");
        }
    }
    close(gpu);
}

/// What fills a volume with opaque noise, so that only a clip can give its faces a direction.
fn noise(size: usize, random: &mut Random) -> Volume {
    let grid = Grid { dims: [size; 3], spacing: [1.0; 3] };
    let values = (0..grid.len()).map(|_| random.between(0.5, 1.0)).collect();
    Volume::new(grid.dims, grid.spacing, Values::F32(values)).unwrap()
}

fn pose(random: &mut Random, scale: [f32; 2]) -> Pose {
    let mut vector = |low, high| Vec3::from_array([(); 3].map(|()| random.between(low, high)));
    Pose {
        translate_mm: vector(-6.0, 6.0),
        rotate_deg: vector(-180.0, 180.0),
        scale: vector(scale[0], scale[1]),
    }
}

/// A prism on five corners, whose walls run along the clip camera's view, none of them along its pixels.
fn prism() -> TriangleMesh {
    let corner = |i: u32, z: f32| {
        let (sin, cos) = (std::f32::consts::TAU * (i as f32 / 5.0 + 0.03)).sin_cos();
        Vec3::new(cos, sin, z)
    };
    let positions: Vec<Vec3> = (0..10).map(|i| corner(i % 5, if i < 5 { -1.0 } else { 1.0 })).collect();
    let mut faces = Vec::new();
    for i in 0..5 {
        let next = (i + 1) % 5;
        faces.extend([[i, next, next + 5], [i, next + 5, i + 5]]);
    }
    faces.extend((1..4).flat_map(|i| [[0, i + 1, i], [5, 5 + i, 6 + i]]));
    TriangleMesh::new("prism", &positions, &faces).unwrap()
}

/// Of every analytic shape at any pose and scale, to rounding; of meshes by their depth maps.
#[test]
fn cut_faces_have_the_normals_of_what_cut() {
    const SEED: u64 = 70;
    /// Degrees that a normal is off where a position is off by what the halvings of a step leave, a 64th of a voxel, on the tube of a
    /// torus, some 4 voxels thick.
    const ANALYTIC: f64 = 0.25;
    /// Within a pixel of an edge a face beside may be as near, and few places of coarse meshes are far from all edges: up to 15 %
    /// of them, by half a right angle at most. Elsewhere walls are off by a degree in the mean, and by 4 (method.md §10).
    const EDGES: f64 = 0.15;
    /// Of all poses together: where one shows few places, those at edges are most of its mean.
    const MESH_MEAN: f64 = 1.5;

    let gpu = open();
    let mut random = Random::new(SEED);
    let volume = noise(40, &mut random);
    let mut renderer = unoccluded(&gpu, &volume, opaque_from(0.25), &[]);
    let meshes = [convex(), concave(), Arc::new(TriangleMesh::cuboid()), Arc::new(prism())].map(Shape::Mesh);
    let (mut meshes_sum, mut meshes_places) = (0.0, 0);
    for shape in Shape::ANALYTIC.into_iter().chain(meshes) {
        let mut seen = 0;
        for mode in [Mode::Remove, Mode::Keep] {
            for turn in 0..2 {
                // What is removed has to be as large as the volume to be seen, what is kept to lie in it.
                let scale = if mode == Mode::Keep { [9.0, 15.0] } else { [12.0, 22.0] };
                let clip = Clip { shape: shape.clone(), mode, pose: pose(&mut random, scale) };
                renderer.set_clips(std::slice::from_ref(&clip)).unwrap();
                renderer.update(&mut |_| ()).unwrap();
                let views = sides(&volume, 40.0 + 70.0 * turn as f32, 20.0);
                let places = places(&renderer, &volume, &views, 0.5);
                if places.len() < 50 {
                    continue;
                }
                seen += 1;
                let truth = |place: &Place| clip_normal(&clip, place.world, place.towards_eye);
                let context = format!("seed {SEED} {} {mode:?} {:?}", shape.name(), clip.pose);
                match shape {
                    Shape::Mesh(_) => {
                        let (mean, most) = angles(&places, truth, 1.0 - EDGES);
                        assert!(most <= MOST, "{context}: {mean} and {most} degrees");
                        meshes_sum += mean * places.len() as f64;
                        meshes_places += places.len();
                    }
                    _ => {
                        let (mean, most) = angles(&places, truth, 0.99);
                        assert!(mean <= ANALYTIC && most <= ANALYTIC, "{context}: {mean} and {most} degrees");
                    }
                }
            }
        }
        assert!(seen >= 2, "{}: {seen} of 4 poses show a cut", shape.name());
    }
    let mean = meshes_sum / meshes_places as f64;
    assert!(mean <= MESH_MEAN, "{mean} degrees at {meshes_places} places of meshes");
    drop(renderer);
    close(gpu);
}

/// Levels of 255 of linear light, coded as sRGB.
fn level(linear: f64) -> f64 {
    let coded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    255.0 * coded.clamp(0.0, 1.0)
}

/// What a picture's levels are off by from those of places whose normal is known, for all pixels that look at them.
fn deviations(
    image: &[[f32; 4]],
    view: &View,
    head: &View,
    look: &Look,
    normal: impl Fn(DVec3, DVec3) -> Option<DVec3>,
) -> Vec<f64> {
    let light = look.towards_light(head.orientation).as_dvec3();
    let mut found = Vec::new();
    for (i, colour) in image.iter().enumerate() {
        let pixel = Vec2::new((i as u32 % SIZE) as f32 + 0.5, (i as u32 / SIZE) as f32 + 0.5);
        let (origin, direction) = view.ray(pixel / SIZE as f32);
        if let Some(normal) = normal(origin.as_dvec3(), direction.as_dvec3()) {
            let expected = f64::from(look.ambient) + f64::from(look.diffuse) * normal.dot(light).max(0.0);
            found.push(level(f64::from(colour[0])) - level(expected));
        }
    }
    found
}

fn rms(of: &[f64]) -> f64 {
    (of.iter().map(|d| d * d).sum::<f64>() / of.len() as f64).sqrt()
}

/// The light of the default head, matt.
fn matt() -> Look {
    Look { shading: Shading::Phong, specular: 0.0, ambient: 0.2, diffuse: 0.7, ..Look::default() }
}

/// A ball cut out of noise shows the light of a ball, without rings: in opaque matter and where half of the light goes on.
#[test]
fn a_spherical_cut_has_no_rings() {
    /// Levels of 255, root mean square.
    const BAND: f64 = 1.0;

    let gpu = open();
    let volume = noise(48, &mut Random::new(71));
    let centre = Vec3::new(10.0, -24.0, 6.0);
    let clip = Clip {
        pose: Pose { translate_mm: centre, scale: Vec3::splat(17.3), ..Pose::default() },
        ..Clip::remove(Shape::Sphere)
    };
    let renderer = unoccluded(&gpu, &volume, opaque_from(0.25), std::slice::from_ref(&clip));
    let rig = StereoRig::framing(volume.size_mm(), 20.0, 15.0);
    let views = rig.views(1.0, 1.0, 400.0).unwrap();
    let look = matt();
    let (image, _) = renderer.draw(&views, &look, [SIZE; 2]).unwrap();
    let half = 23.5;
    for eye in 0..2 {
        let off = deviations(&image.colour[eye], &views[eye], &views[0], &look, |origin, direction| {
            // The farther crossing of ray and ball, where it lies inside the volume and the way to it is free.
            let (from, direction) = (origin - centre.as_dvec3(), direction.normalize());
            let middle = -from.dot(direction);
            let root = (middle * middle - from.length_squared() + 17.3 * 17.3).sqrt();
            let place = origin + (middle + root) * direction;
            let enters = origin + (middle - root) * direction;
            // Into the ball before the volume, through its front face.
            let into = origin + (-24.0 - origin.y) / direction.y * direction;
            let free = enters.y < -24.0 || (into - centre.as_dvec3()).length() < 17.0;
            (root > 0.0 && free && place.abs().cmplt(DVec3::splat(half)).all())
                .then(|| -(place - centre.as_dvec3()).normalize())
        });
        assert!(off.len() > 200, "{} pixels look at the cut", off.len());
        assert!(rms(&off) <= BAND, "{} levels", rms(&off));
    }
    drop(renderer);
    close(gpu);
}

/// Planes and boxes at any angle have one light all over: no stripe of voxels, steps or pixels of depth maps.
#[test]
fn flat_cuts_at_any_angle_are_flat() {
    const SEED: u64 = 72;
    /// Levels of 255.
    const STRIPE: f64 = 2.0;

    let gpu = open();
    let mut random = Random::new(SEED);
    let volume = noise(48, &mut random);
    let mut renderer = unoccluded(&gpu, &volume, opaque_from(0.25), &[]);
    let look = matt();
    let mut compared = 0;
    for turn in 0..12 {
        let shape =
            [Shape::Plane, Shape::Box, Shape::Mesh(Arc::new(TriangleMesh::cuboid()))][turn % 3].clone();
        let clip = Clip { shape, mode: Mode::Keep, pose: pose(&mut random, [13.0, 16.0]) };
        renderer.set_clips(std::slice::from_ref(&clip)).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        let views = sides(&volume, 30.0 * turn as f32, 25.0);
        let (image, _) = renderer.draw(&views, &look, [SIZE; 2]).unwrap();
        for (colour, view) in image.colour.iter().zip(&views) {
            let off = deviations(colour, view, &views[0], &look, |origin, direction| {
                let local = |p: DVec3| {
                    (clip.pose.rotation().transpose().as_dmat3() * (p - clip.pose.translate_mm.as_dvec3()))
                        / clip.pose.scale.as_dvec3()
                };
                let (from, along) = (local(origin), local(origin + direction) - local(origin));
                // Where the ray enters the half-space or the box, and by which face.
                let mut entry = (f64::NEG_INFINITY, DVec3::ZERO);
                for axis in if matches!(clip.shape, Shape::Plane) { 2..3 } else { 0..3 } {
                    let face = if matches!(clip.shape, Shape::Plane) { 0.0 } else { -along[axis].signum() };
                    let way = (face - from[axis]) / along[axis];
                    if way > entry.0 {
                        let mut normal = DVec3::ZERO;
                        normal[axis] = -along[axis].signum();
                        entry = (way, normal);
                    }
                }
                let place = from + entry.0 * along;
                let world = origin + entry.0 * direction;
                // Well on the face, by more than a pixel of the depth map and a step.
                let on_face = (0..3).all(|axis| {
                    entry.1[axis] != 0.0 || place[axis].abs() < 0.97 || matches!(clip.shape, Shape::Plane)
                });
                // A plane hides what is in front of it only on the side that it faces.
                let faces = !matches!(clip.shape, Shape::Plane) || along.z > 0.0;
                let seen = on_face && faces && world.abs().cmplt(DVec3::splat(23.5)).all();
                seen.then(|| clip.pose.rotation().as_dmat3() * entry.1)
            });
            let worst = off.iter().fold(0.0_f64, |worst, off| worst.max(off.abs()));
            assert!(worst <= STRIPE, "seed {SEED} turn {turn} {clip:?}: {worst} levels");
            compared += off.len();
        }
    }
    assert!(compared > 5000, "{compared} pixels");
    drop(renderer);
    close(gpu);
}

/// The head's light is that of the first view for all views, however an eye is turned on the head; the world's stays.
#[test]
fn all_views_see_the_light_of_the_first_ones_head() {
    let gpu = open();
    let volume = scanned(ball, 2.0, true);
    let renderer = unoccluded(&gpu, &volume, opaque_from(127.5), &[]);
    let [first, second] = sides(&volume, 30.0, 20.0);
    let look = Look { shading: Shading::Phong, ..Look::default() };
    let draw = |views: &[View; 2], look: &Look| renderer.draw(views, look, [SIZE; 2]).unwrap().0;
    let seen = draw(&[first, second], &look);
    let world = Look { light: look.towards_light(first.orientation), light_from: LightFrom::World, ..look };
    let fixed = draw(&[second, first], &world);
    let differ = |a: &[[f32; 4]], b: &[[f32; 4]]| {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    // A light that is turned twice rounds twice, and a highlight takes its 24th power.
    assert!(
        differ(&seen.colour[0], &fixed.colour[1]) < 1e-4 && differ(&seen.colour[1], &fixed.colour[0]) < 1e-4
    );
    assert!(
        differ(&seen.colour[1], &draw(&[second, first], &look).colour[0]) > 0.1,
        "another head, another light"
    );
    drop(renderer);
    close(gpu);
}

/// A volume of bytes and what shows it: grey, opacity from a tenth of the largest value on.
fn grey(dims: [usize; 3], value: impl Fn([f64; 3]) -> f64) -> (Volume, TransferFunction) {
    let grid = Grid { dims, spacing: [1.0; 3] };
    let byte = |i| (200.0 * value(grid.voxel(i).map(|c| c as f64))).round() as u8;
    let volume =
        Volume::new(grid.dims, grid.spacing, Values::U8((0..grid.len()).map(byte).collect())).unwrap();
    let ramp =
        TransferFunction::new(vec![[20.0, 0.0], [140.0, 0.95]], vec![[0.0, 0.5, 0.5, 0.5]], None).unwrap();
    (volume, ramp)
}

/// Under light from everywhere, occluded within so many mm.
fn occluded(
    gpu: &cao_gpu::Gpu,
    (volume, transfer): &(Volume, TransferFunction),
    radius_mm: f32,
    clips: &[Clip],
) -> Renderer {
    let mut setup = Setup::of(Method::default(), 1.0);
    setup.occlusion.radius_mm = radius_mm;
    let mut renderer = Renderer::new(gpu, volume, transfer.clone(), setup, COLOUR).unwrap();
    renderer.set_clips(clips).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    renderer
}

/// A cube under light from everywhere: walls have all of it, and no edge has more, however much the ambient factor is raised.
#[test]
fn edges_have_no_white_rims() {
    /// Levels of 255 between the lightest pixel and the walls: 2 % of the light, the least contrast that eyes see in a picture. Read at
    /// the place itself there are 24.
    const RIM: f64 = 2.0;
    /// Of all light, on walls.
    const WALL: f64 = 0.97;

    let gpu = open();
    let along = |c: f64| (0.5 - ((c - 31.8).abs() - 19.0)).clamp(0.0, 1.0);
    let cube = grey([64; 3], |at| at.map(along).iter().product());
    let renderer = occluded(&gpu, &cube, 16.0, &[]);
    let full = level(0.5);
    for gain in [2.0, 4.0] {
        let look = Look { shading: Shading::Ao, gain, ..Look::default() };
        let (image, _) = renderer.draw(&sides(&cube.0, 30.0, 25.0), &look, [SIZE; 2]).unwrap();
        for colour in &image.colour {
            let mut light: Vec<f64> =
                colour.iter().filter(|c| c[3] > 0.99).map(|c| f64::from(c[0]) / 0.5).collect();
            light.sort_by(f64::total_cmp);
            let (wall, lightest) = (light[light.len() / 2], light[light.len() - 1]);
            let rim = level(0.5 * lightest) - level(0.5 * wall);
            println!(
                "gain {gain}: walls {:.1}, lightest {:.1} levels",
                level(0.5 * wall),
                level(0.5 * lightest)
            );
            assert!(rim <= RIM, "gain {gain}: {rim} levels between walls and the lightest edge");
            assert!(level(0.5 * lightest) <= full + 0.5, "gain {gain}: an edge has {lightest} of all light");
            assert!(wall >= WALL, "gain {gain}: walls have {wall} of all light");
        }
    }
    drop(renderer);
    close(gpu);
}

/// A bowl in a block, cut by a ball or scanned so, under light from everywhere: its light changes over many voxels, not from one to the next.
#[test]
fn bowls_under_ambient_light_have_no_rings() {
    /// Levels of 255, root mean square, of a cut and of partial volumes: two and three times what rounding to whole levels would make
    /// of no rings. Read at the place itself they are 0.7 and 1.4.
    const BANDS: [f64; 2] = [0.6, 1.0];
    /// Voxels round a place, whose mean its light is compared with: rings are a voxel apart or two.
    const NEAR: f64 = 2.0;
    const BOWL: f64 = 14.3;
    const PIXELS: u32 = 4 * SIZE;
    /// Angle at the ball's centre to which it is looked at.
    const RIM: f64 = 1.1;

    let gpu = open();
    let centre = DVec3::new(0.3, -0.4, 12.2);
    let block = |at: [f64; 3]| (0.5 + centre.z - (at[2] - 31.5)).clamp(0.0, 1.0);
    let scanned = |at: [f64; 3]| {
        let way = (DVec3::from_array(at) - 31.5).distance(centre);
        block(at).min((0.5 + way - BOWL).clamp(0.0, 1.0))
    };
    let pose = Pose { translate_mm: centre.as_vec3(), scale: Vec3::splat(BOWL as f32), ..Pose::default() };
    let clip = Clip { pose, ..Clip::remove(Shape::Sphere) };
    let scenes = [("cut", grey([64; 3], block), vec![clip]), ("scanned", grey([64; 3], scanned), vec![])];
    for ((name, volume, clips), band) in scenes.into_iter().zip(BANDS) {
        let renderer = occluded(&gpu, &volume, 12.0, &clips);
        let rig = StereoRig::framing(volume.0.size_mm(), 20.0, 70.0);
        let views = rig.views(1.0, 1.0, 400.0).unwrap();
        let look = Look { shading: Shading::Ao, gain: 1.5, ..Look::default() };
        let (image, _) = renderer.draw(&views, &look, [PIXELS; 2]).unwrap();
        for (colour, view) in image.colour.iter().zip(&views) {
            // Place from the ball's centre, and light.
            let mut seen = Vec::new();
            for (i, colour) in colour.iter().enumerate() {
                let pixel = Vec2::new((i as u32 % PIXELS) as f32 + 0.5, (i as u32 / PIXELS) as f32 + 0.5);
                let (origin, direction) = view.ray(pixel / PIXELS as f32);
                let (from, direction) = (origin.as_dvec3() - centre, direction.as_dvec3().normalize());
                let middle = -from.dot(direction);
                let root = (middle * middle - from.length_squared() + BOWL * BOWL).sqrt();
                let place = from + (middle + root) * direction;
                // Below the rim, which has light of its own.
                if place.angle_between(-DVec3::Z) < RIM {
                    seen.push((place, level(f64::from(colour[0]))));
                }
            }
            let inner = seen.iter().filter(|(place, _)| place.angle_between(-DVec3::Z) < RIM - NEAR / BOWL);
            let off: Vec<f64> = inner
                .map(|(place, light)| {
                    let near = seen.iter().filter(|(other, _)| other.distance_squared(*place) < NEAR * NEAR);
                    let (sum, count) =
                        near.fold((0.0, 0.0), |(sum, count), (_, light)| (sum + light, count + 1.0));
                    light - sum / count
                })
                .collect();
            println!(
                "{name}: {:.2} levels at {} pixels, from {:.0} levels on",
                rms(&off),
                off.len(),
                seen.iter().map(|(_, light)| *light).fold(255.0, f64::min)
            );
            assert!(off.len() > 1000, "{name}: {} pixels look into the bowl", off.len());
            assert!(rms(&off) <= band, "{name}: rings of {} levels", rms(&off));
        }
        drop(renderer);
    }
    close(gpu);
}
