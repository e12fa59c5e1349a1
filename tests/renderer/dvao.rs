//! The method `dvao` from volume to V_AO: its twin's values, tiles, other networks, radii that it has no grid for.

use cao::renderer::{COLOUR, Renderer};
use cao::{Gpu, Method, Setup};
use cao_measure::random::Random;
use cao_model::network::{Label, Network, Shape};
use cao_model::settings::Scope;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::network::predicted::predicted;

const SHAPE: Shape = Shape { edge: 16, filters: 4, cap: 8, levels: 2, label: Label::Mean };

/// Two layers of f16 (tests/kernels/conv3.rs), and V_o and V_AO in 65535ths.
const ROUNDED: f32 = 3e-3;

fn setup(radius_mm: f32, tiles: bool) -> Setup {
    let mut setup = Setup { scope: Scope::All, ..Setup::of(Method::Deep, 1.0) };
    setup.occlusion.radius_mm = radius_mm;
    setup.options.set("grid", if tiles { "tiles" } else { "whole" }).unwrap();
    setup
}

fn rendered(gpu: &Gpu, grid: &Grid, opacity: &[f32], network: &Network, setup: Setup) -> Renderer {
    let volume = volume_of(grid, opacity.to_vec());
    let mut renderer = Renderer::new(gpu, &volume, identity(), Setup::new(1.0), COLOUR).unwrap();
    renderer.set_network(network.clone()).unwrap();
    renderer.set_setup(setup).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    renderer
}

#[test]
fn values_are_the_twins_with_either_label() {
    let gpu = open();
    let mut random = Random::new(4);
    for (label, grid, radius) in [
        (Label::Mean, Grid { dims: [14, 9, 11], spacing: [1.0, 1.5, 0.7] }, 2.0),
        (Label::End, Grid { dims: [9, 20, 8], spacing: [1.0; 3] }, 4.1),
    ] {
        let network = network(Shape { label, ..SHAPE }, 7);
        let opacity = opacities(&mut random, &grid, 0.9);
        let setup = setup(radius, false);
        let renderer = rendered(&gpu, &grid, &opacity, &network, setup);
        let reference_mm = grid.min_spacing();
        let expected = predicted(&network, &grid, &opacity, reference_mm, f64::from(radius), true);
        let found = renderer.read_ambient().unwrap();
        let worst = found.iter().zip(&expected).map(|(f, e)| (f - e).abs()).fold(0.0, f32::max);
        let range = expected.iter().fold([1.0_f32, 0.0], |[l, h], v| [l.min(*v), h.max(*v)]);
        assert!(range[1] - range[0] > 0.1, "{range:?}");
        assert!(worst <= ROUNDED, "{label:?}: {worst}");
    }
    close(gpu);
}

/// Tiles begin 10 voxels apart: of what repeats after 10 they give what repeats after 10, but for those at the ends. Every voxel has a value:
/// without weights a half.
#[test]
fn tiles_give_every_voxel_its_value_in_its_place() {
    let gpu = open();
    let zeros = Network::new(SHAPE, vec![0; SHAPE.weights()].into()).unwrap();
    let network = network(SHAPE, 3);
    let mut random = Random::new(9);
    for axis in 0..3 {
        let mut dims = [12; 3];
        // Places of samples are shares of the edge: of a power of two none is rounded, so that nothing may differ.
        dims[axis] = 64;
        let grid = Grid { dims, spacing: [1.0; 3] };
        let one = opacities(&mut random, &Grid { dims: [12; 3], ..grid }, 0.9);
        let opacity: Vec<f32> = (0..grid.len())
            .map(|i| {
                let mut voxel = grid.voxel(i);
                voxel[axis] %= 10;
                one[Grid { dims: [12; 3], ..grid }.index(voxel)]
            })
            .collect();
        // A voxel of the grid is one of the volume.
        let setup = setup(SHAPE.radius(), true);
        let halves = rendered(&gpu, &grid, &opacity, &zeros, setup).read_ambient().unwrap();
        assert!(halves.iter().all(|value| (value - 0.5).abs() < 1e-4));
        let found = rendered(&gpu, &grid, &opacity, &network, setup).read_ambient().unwrap();
        let (mut compared, mut varied) = (0, 0.0_f32);
        for (i, value) in found.iter().enumerate() {
            let mut voxel = grid.voxel(i);
            // Of the second tile; the third, which sees the same, has those 10 farther on.
            if (13..23).contains(&voxel[axis]) {
                voxel[axis] += 10;
                assert_eq!(found[grid.index(voxel)], *value, "{voxel:?}");
                compared += 1;
                varied = varied.max((value - 0.5).abs());
            }
        }
        assert!(compared == 1440 && varied > 0.05, "{compared} {varied}");
    }
    close(gpu);
}

/// Of cubes of two voxels nothing can be left out for overlap.
#[test]
fn the_smallest_cubes_give_every_voxel_its_value() {
    let gpu = open();
    let shape = Shape { edge: 2, filters: 1, cap: 1, levels: 1, label: Label::Mean };
    let zeros = Network::new(shape, vec![0; shape.weights()].into()).unwrap();
    let grid = Grid { dims: [5, 3, 4], spacing: [1.0; 3] };
    let renderer = rendered(&gpu, &grid, &[0.5; 60], &zeros, setup(shape.radius(), true));
    assert!(renderer.read_ambient().unwrap().iter().all(|value| (value - 0.5).abs() < 1e-4));
    drop(renderer);
    close(gpu);
}

#[test]
fn another_network_is_another_volume_and_what_has_no_grid_is_refused() {
    let gpu = open();
    let grid = Grid { dims: [20, 17, 18], spacing: [1.0; 3] };
    let opacity = opacities(&mut Random::new(2), &grid, 0.8);
    let mut renderer = rendered(&gpu, &grid, &opacity, &network(SHAPE, 1), setup(4.0, false));
    let one = renderer.read_ambient().unwrap();
    renderer.set_network(network(SHAPE, 2)).unwrap();
    assert!(renderer.read_ambient().is_err(), "out of date");
    renderer.update(&mut |_| ()).unwrap();
    let other = renderer.read_ambient().unwrap();
    assert!(one != other);
    // A voxel of the grid would be a seventieth of the volume's.
    let refused = renderer.set_setup(setup(0.04, false)).unwrap_err().to_string();
    assert!(refused.contains("grid=tiles") && refused.contains("voxels"), "{refused}");
    // A net of long rays in voxels has no grid for a radius that another has one for.
    let long = Shape { edge: 512, ..SHAPE };
    let refused = renderer.set_network(network(long, 1)).unwrap_err().to_string();
    assert!(refused.contains("radius"), "{refused}");
    renderer.update(&mut |_| ()).unwrap();
    assert!(renderer.read_ambient().unwrap() == other, "what was refused left a trace");
    // Without rays nothing is occluded.
    renderer.set_setup(setup(0.0, false)).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    assert!(renderer.read_ambient().unwrap().iter().all(|value| *value == 1.0));
    drop(renderer);
    close(gpu);
}
