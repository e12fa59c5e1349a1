//! Contextual updates against their twin: from the device's own opacity and categories, every value or none.

use cao::renderer::{COLOUR, Renderer};
use cao_gpu::Gpu;
use cao_measure::random::Random;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::light::AmbientLight;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::options::Options;
use cao_model::settings::AntiAliasing;
use cao_model::settings::MapSettings;
use cao_model::settings::Scope;
use cao_model::settings::Setup;
use cao_testing::*;
use cao_twin as twin;
use cao_twin::Grid;
use glam::Vec3;

/// Error of an ambient value of a few samples a ray: positions and filter as in `kernels::lao`, functions of a software
/// driver to 1e-5.
fn tolerance(gpu: &Gpu, occlusion: &Occlusion, smallest: f64) -> f64 {
    f64::from(occlusion.samples(smallest)).sqrt() * (1e-5 + filter_error(gpu)) + 1e-5
}

const SETUP: Setup = Setup {
    occlusion: Occlusion {
        rays: RaySet::R14,
        quadrature: Quadrature::Left,
        radius_mm: 3.0,
        offset_mm: None,
        step_mm: None,
        light: AmbientLight::Uniform,
    },
    method: Method::Cao,
    options: Options::DEFAULT,
    scope: Scope::All,
    anti_aliasing: AntiAliasing::N8,
    maps: MapSettings { resolution: 64, cells: 32, pairs: 4, literal: false },
};

fn check(renderer: &Renderer, grid: &Grid, full: &[f32], context: &str) -> [usize; 3] {
    let Setup { occlusion, .. } = *renderer.setup();
    let reference = grid.min_spacing();
    let (opacity, mask) = (renderer.read_opacity().unwrap(), renderer.read_mask().unwrap());
    let unclipped = twin::cast::lao::lao(grid, full, &occlusion, reference);
    let expected =
        twin::cast::contextual::contextual(grid, &opacity, &unclipped, &mask, &occlusion, reference);
    let found = renderer.read_ambient().unwrap();
    let tolerance = tolerance(renderer.gpu(), &occlusion, grid.min_spacing());
    for i in 0..grid.len() {
        // The twin has no value for voxels inside a clip; the paper stores 1 there, and so does the kernel.
        let expected = expected[i].unwrap_or(1.0);
        assert!(
            (f64::from(found[i]) - expected).abs() <= tolerance,
            "{context} {:?} voxel {:?} category {}: {} instead of {expected}, tolerance {tolerance:e}",
            grid.dims,
            grid.voxel(i),
            mask[i],
            found[i]
        );
    }
    [0, 1, 2].map(|c| mask.iter().filter(|&&m| m == c).count())
}

/// On one renderer a size, one edit after the other: what an update leaves of the one before would show.
#[test]
fn values_are_those_of_the_twin_after_every_edit() {
    const SEED: u64 = 15;
    let gpu = open();
    let mut random = Random::new(SEED);
    let mut seen = [0; 3];
    for (g, grid) in GRIDS.iter().enumerate() {
        let full = opacities(&mut random, grid, 0.9);
        let smallest = grid.min_spacing() as f32;
        let occlusion =
            Occlusion { quadrature: Quadrature::CAST[g % 3], radius_mm: 3.0 * smallest, ..SETUP.occlusion };
        let setup = Setup { occlusion, ..SETUP };
        let volume = volume_of(grid, full.clone());
        let mut renderer = Renderer::new(&gpu, &volume, identity(), setup, COLOUR).unwrap();
        let all = shapes();
        for turn in 0..10 {
            let clips: Vec<Clip> = (0..turn % 3)
                .map(|n| random_clip(&mut random, &all[(3 * turn + n) % all.len()], size_mm(grid)))
                .collect();
            renderer.set_clips(&clips).unwrap();
            renderer.update(&mut |_| ()).unwrap();
            let counts = check(&renderer, grid, &full, &format!("seed {SEED} turn {turn} {clips:?}"));
            (0..3).for_each(|c| seen[c] += counts[c]);
        }
    }
    assert!(seen.iter().all(|&count| count > 1000), "every category occurs: {seen:?}");
    close(gpu);
}

/// Without clips, and after the last clip is gone, V_AO is V_PAO to the bit.
#[test]
fn without_clips_the_precomputed_values_return() {
    let gpu = open();
    let mut random = Random::new(16);
    let grid = Grid { dims: [19, 10, 12], spacing: [1.0, 1.5, 0.8] };
    let full = opacities(&mut random, &grid, 1.0);
    let volume = volume_of(&grid, full);
    let mut renderer = Renderer::new(&gpu, &volume, identity(), SETUP, COLOUR).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let before = renderer.read_ambient().unwrap();
    assert!(before.iter().any(|&a| a < 0.9));
    assert!(renderer.read_mask().unwrap().iter().all(|&category| category == 2));
    let sphere = |x: f32| {
        let pose = Pose { translate_mm: Vec3::new(x, 0.0, 0.0), scale: Vec3::splat(3.0), ..Pose::default() };
        Clip { shape: Shape::Sphere, mode: Mode::Remove, pose }
    };
    for clips in [vec![sphere(-4.0)], vec![sphere(5.0)], vec![sphere(0.0), sphere(3.0)], vec![]] {
        renderer.set_clips(&clips).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        let now = renderer.read_ambient().unwrap();
        let same = now.iter().zip(&before).all(|(a, b)| a.to_bits() == b.to_bits());
        assert_eq!(same, clips.is_empty(), "{} clips", clips.len());
    }
    drop(renderer);
    close(gpu);
}

/// One command buffer, as a host records it, or parts on the device's own queue: the same bits.
#[test]
fn recorded_and_own_updates_give_the_same_bits() {
    const SEED: u64 = 17;
    let gpu = open();
    let mut random = Random::new(SEED);
    let grid = Grid { dims: [18, 11, 9], spacing: [1.0; 3] };
    let volume = volume_of(&grid, opacities(&mut random, &grid, 1.0));
    for method in [Method::Cao, Method::Lao] {
        let setup = Setup { method, ..SETUP };
        let mut own = Renderer::new(&gpu, &volume, identity(), setup, COLOUR).unwrap();
        let mut host = Renderer::new(&gpu, &volume, identity(), setup, COLOUR).unwrap();
        for (turn, shape) in shapes().iter().enumerate() {
            let clips = [random_clip(&mut random, shape, size_mm(&grid))];
            own.set_clips(&clips).unwrap();
            host.set_clips(&clips).unwrap();
            own.update(&mut |_| ()).unwrap();
            run(&gpu, |rec| host.record_update(rec).unwrap());
            let bits = |r: &Renderer| -> Vec<u32> {
                r.read_ambient().unwrap().into_iter().map(f32::to_bits).collect()
            };
            assert!(bits(&own) == bits(&host), "seed {SEED} turn {turn} {clips:?}");
            assert_eq!(own.read_mask().unwrap(), host.read_mask().unwrap());
            assert_eq!(own.categories().unwrap(), host.categories().unwrap());
        }
    }
    close(gpu);
}
