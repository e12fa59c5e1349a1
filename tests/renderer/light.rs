//! Ambient light in a renderer: what turns with it and what stays, and which values its colours have.

use cao::renderer::{COLOUR, Renderer};
use cao_gpu::{Gpu, Phase};
use cao_measure::random::Random;
use cao_model::builtin::builtin_box;
use cao_model::clip::Shape;
use cao_model::light::AmbientLight;
use cao_model::look::{Look, Shading};
use cao_model::methods::Method;
use cao_model::occlusion::Occlusion;
use cao_model::options::Options;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::view::StereoRig;
use cao_model::volume::Volume;
use cao_testing::*;
use cao_twin::Grid;

fn setup(method: Method, light: AmbientLight) -> Setup {
    let of_method = Setup::of(method, 1.0);
    Setup { occlusion: Occlusion { radius_mm: 6.0, light, ..of_method.occlusion }, ..of_method }
}

/// The values after an update, which are those of a full computation.
fn updated(renderer: &mut Renderer) -> Vec<[u32; 3]> {
    let found = fresh(renderer);
    assert_eq!(cao::verify::verify(renderer, &mut |_| ()).unwrap().0.different, 0);
    found
}

fn fresh(renderer: &mut Renderer) -> Vec<[u32; 3]> {
    renderer.update(&mut |_| ()).unwrap();
    let colours = renderer.read_ambient_colours().unwrap();
    let least = |c: &[f32; 3]| c.iter().copied().fold(1.0, f32::min);
    assert!(colours.iter().map(least).eq(renderer.read_ambient().unwrap()), "read_ambient has the least");
    colours.into_iter().map(|c| c.map(f32::to_bits)).collect()
}

/// From uniform to a sky, to colours, turned, and back, with clips that move between: the values are those of a renderer made for it, opacities
/// stay, and a light that turns computes ambient values alone.
#[test]
fn a_light_is_an_edit_of_ambient_values_alone() {
    let gpu = open();
    let volume = builtin_box("fruit", [19, 17, 18], [1.0; 3]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let make =
        |light| Renderer::new(&gpu, &volume, transfer.clone(), setup(Method::Rays, light), COLOUR).unwrap();
    let mut random = Random::new(15);
    let mut renderer = make(AmbientLight::Uniform);
    let uniform = updated(&mut renderer);
    let coloured = coloured_light();
    let mut seen = vec![uniform.clone()];
    for light in [AmbientLight::SKY, coloured, coloured.turned(third_turn()), AmbientLight::Uniform] {
        let opacity = renderer.read_opacity().unwrap();
        renderer.set_ambient_light(light).unwrap();
        let found = updated(&mut renderer);
        assert_eq!(renderer.read_opacity().unwrap(), opacity, "{light:?}");
        let mut other = make(light);
        assert!(found == fresh(&mut other), "{light:?}");
        let again = seen.iter().filter(|other| **other == found).count();
        assert_eq!(again, usize::from(light == AmbientLight::Uniform), "{light:?}");
        seen.push(found);
        let clips = [random_clip(&mut random, &Shape::Sphere, size_mm(&grid_of(&volume)))];
        for renderer in [&mut renderer, &mut other] {
            renderer.set_clips(&clips).unwrap();
        }
        assert!(updated(&mut renderer) == fresh(&mut other), "{light:?}: with a clip");
        renderer.set_clips(&[]).unwrap();
        renderer.update(&mut |_| ()).unwrap();
    }
    // Which opacities there are is not asked again.
    renderer.set_ambient_light(AmbientLight::SKY).unwrap();
    let timings = renderer.update(&mut |_| ()).unwrap();
    let opacities = timings.iter().filter(|timing| timing.stage.phase == Phase::Opacity);
    assert_eq!(opacities.count(), 0, "{timings:?}");
    drop(renderer);
    close(gpu);
}

/// Red, green and blue are those of three lights of one colour each, to the bit, whatever the rule.
#[test]
fn colours_are_the_values_of_their_grey_lights() {
    let gpu = open();
    let volume = builtin_box("skeleton", [17, 15, 18], [1.0, 1.2, 0.9]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let light = coloured_light();
    let mut renderer = Renderer::new(&gpu, &volume, transfer, setup(Method::Rays, light), COLOUR).unwrap();
    for &quadrature in Method::Rays.entry().quadratures {
        let mut asked = *renderer.setup();
        (asked.occlusion.quadrature, asked.occlusion.light) = (quadrature, light);
        renderer.set_setup(asked).unwrap();
        let colours = updated(&mut renderer);
        for c in 0..3 {
            renderer.set_ambient_light(light.channel(c)).unwrap();
            let grey = fresh(&mut renderer);
            assert!(grey.iter().zip(&colours).all(|(g, own)| g[0] == own[c]), "{quadrature:?} {c}");
        }
        assert!(colours.iter().any(|[r, g, b]| r != g && g != b), "{quadrature:?}: no colours");
    }
    drop(renderer);
    close(gpu);
}

/// A plate under a sky: what lies on it has all of the light, what lies below it none, of every method that has such light.
#[test]
fn a_plate_takes_all_of_the_sky_from_below_and_none_from_above() {
    let gpu = open();
    let grid = Grid { dims: [14, 14, 14], spacing: [1.0; 3] };
    let plate = (0..grid.len()).map(|i| if (5..9).contains(&grid.voxel(i)[2]) { 200 } else { 0 }).collect();
    let volume = Volume::new(grid.dims, grid.spacing, Values::U8(plate)).unwrap();
    let transfer =
        TransferFunction::new(vec![[100.0, 0.0], [100.0, 1.0]], vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap();
    for method in [Method::Lao, Method::Cao, Method::Rays] {
        for up in [1.0, -1.0] {
            let light = AmbientLight::Sky([0.0, 0.0, up]);
            let mut renderer = made(&gpu, &volume, &transfer, setup(method, light));
            fresh(&mut renderer);
            let ambient = renderer.read_ambient().unwrap();
            let [below, under, on] = [4, 5, 9].map(|z| ambient[grid.index([7, 7, z])]);
            let name = method.name();
            if up > 0.0 {
                // Weights of f32 that sum to one.
                assert!(on > 1.0 - 1e-6, "{name}: {on}");
                assert!(under < 0.2 && below < 0.3, "{name}: {under} {below}");
            } else {
                assert!(on < 0.3 && below > 1.0 - 1e-6, "{name}: {on} {below}");
            }
        }
    }
    close(gpu);
}

fn made(gpu: &Gpu, volume: &Volume, transfer: &TransferFunction, setup: Setup) -> Renderer {
    Renderer::new(gpu, volume, transfer.clone(), setup, COLOUR).unwrap()
}

/// Matter lends its colour, with method `histograms`: values are those of a renderer made for it, after edits too, and the picture shows them.
/// White matter that gives back what it hides has ones, and a picture as without ambient occlusion; red matter leaves red its light and no other.
#[test]
fn matter_lends_its_colour() {
    let gpu = open();
    let volume = builtin_box("fruit", [17, 14, 15], [1.0; 3]).unwrap();
    let of_colour = |rgb: [f32; 3]| {
        let auto = TransferFunction::preset("auto", volume.range()).unwrap();
        TransferFunction::new(auto.opacity, vec![[0.0, rgb[0], rgb[1], rgb[2]]], None).unwrap()
    };
    let bleeding = |bleeding: f32| {
        let of_method = setup(Method::Histograms, AmbientLight::Uniform);
        Setup { options: Options { bleeding, ..of_method.options }, ..of_method }
    };
    let size = size_mm(&grid_of(&volume));
    let rig = StereoRig::framing([size.x.into(), size.y.into(), size.z.into()], 20.0, 30.0);
    let far = 3.0 * rig.position.length();
    let views = rig.views(1.0, 0.01 * far, far).unwrap();
    let picture = |renderer: &Renderer, shading: Shading| {
        renderer.draw(&views, &Look { shading, gain: 1.0, ..Look::default() }, [24, 24]).unwrap().0.colour
    };
    let mut renderer = made(&gpu, &volume, &of_colour([1.0; 3]), bleeding(0.0));
    let grey = updated(&mut renderer);
    for (rgb, share) in [([1.0; 3], 1.0), ([1.0, 0.0, 0.0], 1.0)] {
        renderer.set_transfer(of_colour(rgb)).unwrap();
        renderer.set_setup(bleeding(share)).unwrap();
        let found = updated(&mut renderer);
        assert!(found == updated(&mut made(&gpu, &volume, &of_colour(rgb), bleeding(share))), "{rgb:?}");
        if rgb == [1.0; 3] {
            assert!(found.iter().all(|c| *c == [1.0_f32.to_bits(); 3]));
            assert!(picture(&renderer, Shading::Ao) == picture(&renderer, Shading::None));
        } else {
            // Black in blue: as without bleeding.
            assert!(found.iter().zip(&grey).all(|(c, grey)| c[2] == grey[2] && c[0] >= c[2]), "{rgb:?}");
            assert!(found.iter().any(|c| c[0] > c[2]), "{rgb:?}");
            // Of red matter only red is seen, and that has its light.
            assert!(picture(&renderer, Shading::Ao) == picture(&renderer, Shading::None));
            renderer.set_setup(bleeding(0.0)).unwrap();
            assert!(updated(&mut renderer) == grey);
            assert!(picture(&renderer, Shading::Ao) != picture(&renderer, Shading::None));
        }
    }
    // An edit of colours alone.
    renderer.set_setup(bleeding(1.0)).unwrap();
    updated(&mut renderer);
    renderer.set_transfer(of_colour([0.0, 1.0, 0.0])).unwrap();
    let found = updated(&mut renderer);
    assert!(found.iter().zip(&grey).all(|(c, grey)| c[0] == grey[0]) && found.iter().any(|c| c[1] > c[0]));
    drop(renderer);
    close(gpu);
}
