//! How far a change reaches (method.md §5.2), of methods that read boxes: bricks that a value of it can be in are computed, the next are not.

use cao::renderer::{COLOUR, Renderer};
use cao_gpu::Gpu;
use cao_model::light::AmbientLight;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, RaySet};
use cao_model::options::{Levels, Options};
use cao_model::settings::{AntiAliasing, MapSettings, Scope, Setup};
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::volume::Volume;
use cao_testing::*;
use cao_twin::Grid;

/// The changed voxel: the low corner of the brick (6, 1, 1), where bricks are 8 voxels wide; or its upper end along x.
const LOW: [usize; 3] = [48, 8, 8];
const HIGH: [usize; 3] = [55, 8, 8];

const DIMS: [usize; 3] = [104, 16, 16];

/// After a change of one voxel: x of the bricks that were computed, and of the voxels in a row through it of which the value changed.
fn touched(gpu: &Gpu, method: Method, levels: Levels, radius_mm: f32, at: [usize; 3]) -> [Vec<usize>; 2] {
    let grid = Grid { dims: DIMS, spacing: [1.0; 3] };
    let values = (0..grid.len()).map(|i| 4 + (i * 7 % 11) as u8).collect();
    let volume = Volume::new(DIMS, grid.spacing, Values::U8(values)).unwrap();
    let (rays, quadrature, light) =
        (method.rays_like(RaySet::W14), method.quadrature(), AmbientLight::Uniform);
    let setup = Setup {
        occlusion: Occlusion { rays, quadrature, radius_mm, offset_mm: None, step_mm: None, light },
        method,
        options: Options { levels, ..Options::DEFAULT },
        scope: Scope::Needed,
        anti_aliasing: AntiAliasing::N0,
        maps: MapSettings { resolution: 16, cells: 4, pairs: 1, literal: false },
    };
    // Thin around an opaque one, so that its light comes from everywhere.
    let points = vec![[0.0, 0.0], [255.0, 1.0]];
    let transfer = TransferFunction::new(points, vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap();
    let mut renderer = Renderer::new(gpu, &volume, transfer, setup, COLOUR).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let before = renderer.read_ambient().unwrap();
    let one = Volume::new([1; 3], grid.spacing, Values::U8(vec![255])).unwrap();
    renderer.set_values(at.map(|c| c as u32), &one).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let (after, mask) = (renderer.read_ambient().unwrap(), renderer.read_mask().unwrap());
    let row = |x: usize| grid.index([x, at[1], at[2]]);
    let bricks = (0..DIMS[0] / 8).filter(|b| u32::from(mask[row(8 * b)]) == cao::clip::classify::AFFECTED);
    let found = [bricks.collect(), (0..DIMS[0]).filter(|&x| before[row(x)] != after[row(x)]).collect()];
    assert_eq!(cao::verify::verify(&renderer, &mut |_| ()).unwrap().0.different, 0);
    found
}

#[test]
fn bricks_beyond_the_box_are_left_alone_and_the_last_in_it_have_to_be_computed() {
    let gpu = open();
    let nbuffer = Levels::Nbuffer;
    for (method, levels, radius, at, bricks, different) in [
        // Nine voxels reach into the second brick.
        (Method::Sat, nbuffer, 9.0, LOW, 4..=8, [4, 7]),
        (Method::Sat, nbuffer, 8.0, LOW, 5..=7, [5, 7]),
        (Method::Shells, nbuffer, 9.0, LOW, 4..=8, [4, 7]),
        (Method::Spao, nbuffer, 8.0, LOW, 5..=7, [5, 7]),
        // In the cell of the voxels 48 to 63, which is looked up from 40 to 71.
        (Method::Spao, Levels::Mip, 8.0, HIGH, 4..=8, [5, 8]),
    ] {
        let [computed, changed] = touched(&gpu, method, levels, radius, at);
        assert_eq!(computed, bricks.collect::<Vec<_>>(), "{} {levels:?} {radius}", method.name());
        let ends = [changed[0] / 8, changed[changed.len() - 1] / 8];
        assert_eq!(ends, different, "{} {levels:?} {radius}", method.name());
    }
    close(gpu);
}
