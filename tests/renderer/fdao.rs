//! Feature-driven ambient occlusion in a renderer: what it is without features, with too many, and what pictures read of it.

use cao::renderer::{COLOUR, Renderer};
use cao_gpu::Gpu;
use cao_measure::random::Random;
use cao_model::builtin::builtin_box;
use cao_model::clip::Shape;
use cao_model::feature::{Feature, Features};
use cao_model::look::{Look, Shading};
use cao_model::methods::Method;
use cao_model::options::Options;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::volume::Volume;
use cao_testing::*;
use cao_twin::Grid;

fn renderer(
    gpu: &Gpu,
    volume: &Volume,
    transfer: &TransferFunction,
    method: Method,
    radius: f32,
) -> Renderer {
    let mut setup = Setup::of(method, volume.min_spacing());
    setup.occlusion.radius_mm = radius;
    Renderer::new(gpu, volume, transfer.clone(), setup, COLOUR).unwrap()
}

fn combine(renderer: &mut Renderer, rule: &str) {
    let options = Options::DEFAULT.with(&[("combine", rule)]).unwrap();
    renderer.set_setup(Setup { options, ..*renderer.setup() }).unwrap();
}

fn bits(renderer: &mut Renderer) -> Vec<u32> {
    renderer.update(&mut |_| ()).unwrap();
    renderer.read_ambient().unwrap().into_iter().map(f32::to_bits).collect()
}

/// Of one feature, which is everything, its values are those of rays by brick to the bit; of two they are not.
#[test]
fn without_features_it_has_the_values_of_rays_by_brick() {
    let gpu = open();
    let volume = builtin_box("fruit", [30, 26, 28], [1.0, 0.9, 1.2]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let mut both =
        [Method::Rays, Method::FeatureDriven].map(|method| renderer(&gpu, &volume, &transfer, method, 8.0));
    let mut random = Random::new(9);
    for rule in ["own", "neighbours", "max", "sample"] {
        let clip = random_clip(&mut random, &Shape::Sphere, size_mm(&grid_of(&volume)));
        both.iter_mut().for_each(|renderer| renderer.set_clips(std::slice::from_ref(&clip)).unwrap());
        combine(&mut both[1], rule);
        let [rays, own] = both.each_mut().map(bits);
        assert_eq!(own, rays, "{rule}");
    }
    let two = vec![(Feature::new("soft"), [20.0, 130.0]), (Feature::new("hard"), [130.0, 256.0])];
    let features = Features::by_intervals(two).unwrap();
    both.iter_mut().for_each(|renderer| renderer.set_features(features.clone()).unwrap());
    let [rays, own] = both.each_mut().map(bits);
    assert_ne!(own, rays);
    drop(both);
    close(gpu);
}

/// A texel has four channels: of more features `sample` is `max`, and of four it is not.
#[test]
fn with_more_than_four_features_the_darkest_counts() {
    let gpu = open();
    let volume = builtin_box("fruit", [24; 3], [1.0; 3]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let mut renderer = renderer(&gpu, &volume, &transfer, Method::FeatureDriven, 6.0);
    for count in [4, 5] {
        let bounds = [20.0, 60.0, 100.0, 135.0, 190.0, 256.0];
        let each = (0..count).map(|k| (Feature::new(k.to_string()), [bounds[k], bounds[k + 1]]));
        renderer.set_features(Features::by_intervals(each.collect()).unwrap()).unwrap();
        combine(&mut renderer, "max");
        let most = bits(&mut renderer);
        combine(&mut renderer, "sample");
        assert_eq!(bits(&mut renderer) == most, count == 5, "{count} features");
    }
    drop(renderer);
    close(gpu);
}

/// A white floor and a red wall on it, of two features. Hiding the wall changes what the floor's pixels show by every rule that joins
/// features before pictures do, and not where the picture reads the floor's own values.
#[test]
fn pictures_show_a_feature_in_its_own_light() {
    let gpu = open();
    let grid = Grid { dims: [32; 3], spacing: [1.0; 3] };
    let part = |i: usize| match grid.voxel(i) {
        [x, _, z] if x >= 20 && z >= 8 => 2_u8,
        [_, _, z] if z < 8 => 1,
        _ => 0,
    };
    let labels: Vec<u8> = (0..grid.len()).map(part).collect();
    let values = labels.iter().map(|label| if *label > 0 { 255 } else { 0 }).collect();
    let volume = Volume::new(grid.dims, grid.spacing, Values::U8(values)).unwrap();
    let transfer =
        TransferFunction::new(vec![[100.0, 0.0], [200.0, 1.0]], vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap();
    let shown = |visible| {
        let floor = Feature { colour: Some([1.0; 3]), ..Feature::new("floor") };
        let wall = Feature { colour: Some([1.0, 0.0, 0.0]), visible, ..Feature::new("wall") };
        Features::by_labels(vec![floor, wall], grid.dims, labels.clone()).unwrap()
    };
    let look = Look { shading: Shading::Ao, gain: 1.0, ..Look::default() };
    let changed = |rule: &str| {
        let mut renderer = renderer(&gpu, &volume, &transfer, Method::FeatureDriven, 10.0);
        combine(&mut renderer, rule);
        let mut picture = |visible| {
            renderer.set_features(shown(visible)).unwrap();
            renderer.update(&mut |_| ()).unwrap();
            renderer.draw(&eyes(&volume, 0.0), &look, [96; 2]).unwrap().0.colour
        };
        let [with, without] = [true, false].map(&mut picture);
        let pixels = with.iter().flatten().zip(without.iter().flatten());
        // Of the floor alone: white, and nothing comes through.
        let floor: Vec<_> =
            pixels.filter(|(a, _)| a[3] > 0.99 && a[1] > 0.0 && a[0] - a[1] < 1e-3 * a[0]).collect();
        assert!(floor.len() > 500, "{rule}: {} pixels of the floor", floor.len());
        floor.iter().filter(|(a, b)| (a[0] - b[0]).abs() > 0.02).count()
    };
    let (most, sample) = (changed("max"), changed("sample"));
    // Along the foot of the wall both have the same cells.
    assert!(most > 200 && sample * 4 < most, "{most} {sample}");
    close(gpu);
}
