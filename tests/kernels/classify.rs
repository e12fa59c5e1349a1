//! The kernel `classify` against its twin: clipped opacity, category of every voxel, counts.

use crate::clipping::{Clipped, Kernels};
use cao::clip::clip_bricks::ClipBricks;
use cao::field::volume_image;
use cao_gpu::{Access, Format, Gpu};
use cao_measure::random::Random;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::occlusion::{Occlusion, Quadrature, RaySet};
use cao_model::settings::{AntiAliasing, Estimator, MapSettings, Samples, Support};
use cao_testing::*;
use cao_twin as twin;
use cao_twin::Grid;
use cao_twin::clip::classify::{CLIPPED, UNTOUCHED, sample_positions};
use cao_twin::clip::clips::{ClipField, Dilation, Maps, MeshLayers, NO_BACK, NO_FRONT, visible};
use glam::Vec3;

/// Positions of clip samples go through three rotations' worth of f32 products on the device: relative to the distances
/// that enter them. A sample nearer than this to a clip's surface, or a voxel nearer to a limit of reach, may fall to either
/// side of it; such a disagreement is not counted, any other is an error.
const POSITION: f32 = 1e-6;

/// The same for meshes, whose surface is the columns of pixels: distances are in pixels and depths of the clip camera, which
/// round once more, and depths are those of a rasterizer.
const MESH_POSITION: f32 = 1e-5;

/// Share of the voxels that may be so near.
const UNDECIDED: f32 = 0.02;

struct Found {
    opacity: Vec<f32>,
    mask: Vec<u8>,
    count: [u32; 3],
}

struct Bench<'a>(Kernels<'a>);

impl<'a> Bench<'a> {
    fn new(gpu: &'a Gpu) -> Self {
        Self(Kernels::new(gpu))
    }

    fn run(
        &self,
        grid: &Grid,
        full: &[f32],
        clips: &[Clip],
        occlusion: &Occlusion,
        samples: AntiAliasing,
        maps: MapSettings,
    ) -> Found {
        let Kernels { gpu, classify, clip_bricks, .. } = &self.0;
        let Clipped { field, features, set, reach, support } =
            self.0.clipped(grid, clips, occlusion, maps, samples.support);
        let full = float_image(gpu, &field, full);
        let opacity = volume_image(gpu, "opacity", &field, Format::R32Float).unwrap();
        let mask = volume_image(gpu, "mask", &field, Format::R8Uint).unwrap();
        let count = &classify.count;
        let words = ClipBricks::buffer(gpu, &field).unwrap();
        run(gpu, |rec| {
            rec.discard(&opacity);
            rec.discard(&mask);
            rec.fill(count, 0, count.bytes(), 0).unwrap();
            clip_bricks.record(rec, &field, &set, reach, support, &words).unwrap();
            rec.barrier(
                &[Access::TransferWrite, Access::StorageWrite],
                &[Access::StorageRead, Access::StorageWrite],
            );
            let literal = maps.literal;
            classify
                .record(rec, &field, &features, &set, samples, reach, literal, &words, &full, &opacity, &mask)
                .unwrap();
        });
        Found {
            opacity: read_floats(gpu, &opacity),
            mask: read_image(gpu, &mask),
            count: bytemuck::pod_read_unaligned(&read_buffer(gpu, count)),
        }
    }

    /// The twin's clips, with the device's own depth layers, so that what is compared is the classification.
    fn twins(
        &self,
        grid: &Grid,
        clips: &[Clip],
        occlusion: &Occlusion,
        maps: MapSettings,
        support: Support,
    ) -> Vec<ClipField> {
        let reach = occlusion.reach(grid.min_spacing());
        let cells = maps.cells;
        let dilation =
            if maps.literal { Dilation::Literal { half: false } } else { Dilation::Conservative(cells) };
        let field = |clip: &Clip| {
            let plan = Maps { layers: 2, resolution: maps.resolution, dilation, support };
            let mut field = ClipField::new(clip, grid, reach, &plan).unwrap();
            if let (Shape::Mesh(mesh), Some(twin)) = (&clip.shape, &mut field.mesh) {
                let camera = twin.layers.camera;
                let found = self.0.peel.run(self.0.gpu, mesh, clip.pose.scale, camera, 2).unwrap();
                let size = (camera.resolution * camera.resolution) as usize;
                let map = |n: usize, none: f32| -> Vec<f32> {
                    found.depth[n * size..(n + 1) * size]
                        .iter()
                        .map(|&z| if z >= 1.0 { none } else { z })
                        .collect()
                };
                let pairs = 0..found.pairs as usize;
                twin.layers = MeshLayers {
                    camera,
                    front: pairs.clone().map(|k| map(2 * k, NO_FRONT)).collect(),
                    back: pairs.map(|k| map(2 * k + 1, NO_BACK)).collect(),
                };
                twin.dilated = if maps.literal {
                    twin::clip::dilate::literal(&twin.layers, clip.mode, field.radius_mm, false)
                } else {
                    twin::clip::dilate::conservative(&twin.layers, clip.mode, field.radius_mm, cells).unwrap()
                };
            }
            field
        };
        clips.iter().map(field).collect()
    }
}

/// What a voxel may be: clip samples that are surely visible and that may be, of the first nine and of those that count where these
/// disagree, and whether
/// the voxel may be within reach and may be out of it.
struct Possible {
    nine: [usize; 2],
    all: [usize; 2],
    within: bool,
    beyond: bool,
}

/// Samples that do not count where the first nine disagree.
fn uncounted(how: AntiAliasing) -> usize {
    if how.estimator == Estimator::Interior && how.samples != Samples::N0 { 9 } else { 0 }
}

fn possible(grid: &Grid, voxel: [usize; 3], clips: &[ClipField], how: AntiAliasing) -> Possible {
    let size = size_mm(grid).length();
    let largest = clips
        .iter()
        .map(|c| c.clip.pose.translate_mm.length() + c.clip.pose.scale.max_element())
        .fold(size, f32::max);
    let mesh = clips.iter().any(|clip| clip.mesh.is_some());
    let shift = largest * if mesh { MESH_POSITION } else { POSITION };
    let around: Vec<Vec3> = (0..27)
        .map(|n| Vec3::new((n % 3) as f32 - 1.0, (n / 3 % 3) as f32 - 1.0, (n / 9) as f32 - 1.0) * shift)
        .collect();
    let world: Vec<Vec3> = sample_positions(how)
        .iter()
        .map(|p| {
            let at = std::array::from_fn(|a| voxel[a] as f64 + p[a]);
            Vec3::from_array(grid.to_world(at).map(|c| c as f32))
        })
        .collect();
    let surely = |p: &Vec3| usize::from(around.iter().all(|&d| visible(clips, *p + d)));
    let maybe = |p: &Vec3| usize::from(around.iter().any(|&d| visible(clips, *p + d)));
    let count = |samples: &[Vec3]| [samples.iter().map(surely).sum(), samples.iter().map(maybe).sum()];
    let affected = |d: &Vec3| {
        let moved: Vec<Vec3> = world[..9].iter().map(|&p| p + *d).collect();
        clips.iter().any(|clip| clip.affects(&moved))
    };
    Possible {
        nine: count(&world[..9]),
        all: count(&world[uncounted(how)..]),
        within: around.iter().any(affected),
        beyond: !around.iter().all(affected),
    }
}

/// Compares; returns how many voxels are so near to a surface that either side is right.
fn compare(
    grid: &Grid,
    full: &[f32],
    clips: &[ClipField],
    how: AntiAliasing,
    literal: bool,
    found: &Found,
    context: &str,
) -> usize {
    let (opacity, mask) = twin::clip::classify::classify(grid, full, clips, how);
    let mut undecided = 0;
    for i in 0..grid.len() {
        // One rounding of the share and one of the product.
        let same = (found.opacity[i] - opacity[i]).abs() <= 2e-7 * full[i];
        if same && found.mask[i] == mask[i] {
            continue;
        }
        undecided += 1;
        let p = possible(grid, grid.voxel(i), clips, how);
        let context = format!(
            "{context} {:?} voxel {:?}: {} category {}, expected {} category {}",
            grid.dims,
            grid.voxel(i),
            found.opacity[i],
            found.mask[i],
            opacity[i],
            mask[i]
        );
        let share =
            |count: usize| count as f32 / (9 - uncounted(how) + how.samples as usize) as f32 * full[i];
        let cut = share(p.all[0]) - 1e-6..=share(p.all[1]) + 1e-6;
        let possible_opacity = (p.nine[0] == 0 && found.opacity[i] == 0.0)
            || (p.nine[1] == 9 && found.opacity[i] == full[i])
            || (p.nine[1] > 0 && p.nine[0] < 9 && cut.contains(&found.opacity[i]));
        assert!(possible_opacity, "{context}; nine {:?} all {:?}", p.nine, p.all);
        let possible_category = match found.mask[i] {
            UNTOUCHED => p.beyond,
            CLIPPED => p.within && (p.nine[0] == 0 || p.all[0] == 0),
            _ => p.within && p.nine[1] > 0,
        };
        assert!(possible_category, "{context}; nine {:?}", p.nine);
        // What makes untouched voxels safe to leave alone.
        assert!(literal || found.mask[i] != UNTOUCHED || found.opacity[i] == full[i], "{context}");
    }
    let counts = [0, 1, 2].map(|c| found.mask.iter().filter(|&&m| m == c).count() as u32);
    assert_eq!(found.count, counts, "{context}");
    undecided
}

fn occlusion(voxels: f32, grid: &Grid) -> Occlusion {
    Occlusion {
        rays: RaySet::R6,
        quadrature: Quadrature::Left,
        radius_mm: voxels * grid.min_spacing() as f32,
        offset_mm: None,
        step_mm: None,
        ..Occlusion::paper(1.0)
    }
}

const MAPS: MapSettings = MapSettings { resolution: 64, cells: 32, pairs: 4, literal: false };

#[test]
fn opacity_and_categories_are_those_of_the_twin_for_every_shape() {
    const SEED: u64 = 12;
    let gpu = open();
    let bench = Bench::new(&gpu);
    let mut random = Random::new(SEED);
    let (mut undecided, mut voxels) = (0, 0);
    for grid in GRIDS {
        // Without zeros: what is hidden must be seen to be.
        let full: Vec<f32> = (0..grid.len()).map(|_| random.between(0.1, 1.0)).collect();
        for shape in shapes() {
            let several = [AntiAliasing::N0, AntiAliasing::N8, AntiAliasing::N32];
            for (turn, samples) in several.into_iter().enumerate() {
                let occlusion = occlusion([0.0, 2.0, 5.0][turn], &grid);
                let clips = [random_clip(&mut random, &shape, size_mm(&grid))];
                let context = format!("seed {SEED} {samples:?} {:?} {:?}", clips[0].mode, clips[0].pose);
                let found = bench.run(&grid, &full, &clips, &occlusion, samples, MAPS);
                let twins = bench.twins(&grid, &clips, &occlusion, MAPS, samples.support);
                let context = format!("{} {context}", shape.name());
                undecided += compare(&grid, &full, &twins, samples, false, &found, &context);
                voxels += grid.len();
            }
        }
    }
    assert!(undecided as f32 <= UNDECIDED * voxels as f32, "{undecided} of {voxels}");
    drop(bench);
    close(gpu);
}

/// Both supports with both estimators. Of meshes those of one pair: the twin's dilation map is the hull of all pairs.
#[test]
fn every_way_to_sample_is_that_of_the_twin() {
    const SEED: u64 = 15;
    let gpu = open();
    let bench = Bench::new(&gpu);
    let mut random = Random::new(SEED);
    let (mut undecided, mut voxels) = (0, 0);
    for grid in &GRIDS[4..] {
        let full: Vec<f32> = (0..grid.len()).map(|_| random.between(0.1, 1.0)).collect();
        for shape in Shape::ANALYTIC.into_iter().chain([Shape::Mesh(convex())]) {
            for (turn, support) in [Support::Voxel, Support::Neighbours].into_iter().enumerate() {
                for (estimator, samples) in [
                    (Estimator::Paper, Samples::N32),
                    (Estimator::Interior, Samples::N32),
                    (Estimator::Interior, Samples::N8),
                ] {
                    let how = AntiAliasing { samples, support, estimator };
                    let occlusion = occlusion([2.0, 0.0][turn], grid);
                    let clips = [random_clip(&mut random, &shape, size_mm(grid))];
                    let found = bench.run(grid, &full, &clips, &occlusion, how, MAPS);
                    let twins = bench.twins(grid, &clips, &occlusion, MAPS, support);
                    let context = format!("{} seed {SEED} {how:?} {:?}", shape.name(), clips[0].pose);
                    undecided += compare(grid, &full, &twins, how, false, &found, &context);
                    voxels += grid.len();
                }
            }
        }
    }
    assert!(undecided as f32 <= UNDECIDED * voxels as f32, "{undecided} of {voxels}");
    drop(bench);
    close(gpu);
}

#[test]
fn several_clips_hide_what_any_of_them_hides() {
    const SEED: u64 = 13;
    let gpu = open();
    let bench = Bench::new(&gpu);
    let mut random = Random::new(SEED);
    let grid = GRIDS[5];
    let full: Vec<f32> = (0..grid.len()).map(|_| random.between(0.1, 1.0)).collect();
    let (mut undecided, mut voxels) = (0, 0);
    for count in [0, 2, 3, 5, Clip::MAX] {
        for _ in 0..2 {
            let all = shapes();
            let clips: Vec<Clip> = (0..count)
                .map(|_| {
                    let shape = &all[random.below(all.len() as u64) as usize];
                    let mut clip = random_clip(&mut random, shape, size_mm(&grid));
                    // Several kept shapes share hardly anything.
                    if random.below(3) > 0 {
                        clip.mode = Mode::Remove;
                        clip.pose.scale *= 0.3;
                    }
                    clip
                })
                .collect();
            let occlusion = occlusion(2.0, &grid);
            let found = bench.run(&grid, &full, &clips, &occlusion, AntiAliasing::N32, MAPS);
            let twins = bench.twins(&grid, &clips, &occlusion, MAPS, Support::Voxel);
            let context = format!("seed {SEED} {count} clips {clips:?}");
            undecided += compare(&grid, &full, &twins, AntiAliasing::N32, false, &found, &context);
            voxels += grid.len();
        }
    }
    assert!(undecided as f32 <= UNDECIDED * voxels as f32, "{undecided} of {voxels}");
    drop(bench);
    close(gpu);
}

/// The paper's recipe, nine samples against a map dilated by the ray's length from centre to centre, convex and concave.
#[test]
fn the_literal_recipe_is_that_of_the_twin() {
    const SEED: u64 = 14;
    let gpu = open();
    let bench = Bench::new(&gpu);
    let mut random = Random::new(SEED);
    let maps = MapSettings { resolution: 48, cells: 48, literal: true, ..MAPS };
    let (mut undecided, mut voxels) = (0, 0);
    for grid in &GRIDS[3..] {
        let full: Vec<f32> = (0..grid.len()).map(|_| random.between(0.1, 1.0)).collect();
        for turn in 0..6 {
            // The twin's map is the hull of all pairs, the kernel's one for each: the same for a mesh of one pair.
            let clips = [random_clip(&mut random, &Shape::Mesh(convex()), size_mm(grid))];
            let occlusion = occlusion(3.0, grid);
            let found = bench.run(grid, &full, &clips, &occlusion, AntiAliasing::N8, maps);
            let twins = bench.twins(grid, &clips, &occlusion, maps, Support::Voxel);
            let context = format!("seed {SEED} turn {turn} {:?} {:?}", clips[0].mode, clips[0].pose);
            undecided += compare(grid, &full, &twins, AntiAliasing::N8, true, &found, &context);
            voxels += grid.len();
        }
    }
    assert!(undecided as f32 <= UNDECIDED * voxels as f32, "{undecided} of {voxels}");
    drop(bench);
    close(gpu);
}

/// Which way the faces of a mesh look is a matter of its file, not of what it hides.
#[test]
fn a_mesh_that_is_inside_out_hides_its_inside() {
    let gpu = open();
    let bench = Bench::new(&gpu);
    let grid = GRIDS[4];
    let full = vec![1.0; grid.len()];
    let mut turned = convex().as_ref().clone();
    turned.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let hidden = |mesh| {
        let pose = Pose { scale: Vec3::splat(3.0), ..Pose::default() };
        let clip = Clip { shape: Shape::Mesh(mesh), mode: Mode::Remove, pose };
        bench.run(&grid, &full, &[clip], &occlusion(2.0, &grid), AntiAliasing::N8, MAPS)
    };
    let (right, inside_out) = (hidden(convex()), hidden(turned.into()));
    assert!(right.count[0] > 10);
    assert_eq!((right.opacity, right.mask), (inside_out.opacity, inside_out.mask));
    drop(bench);
    close(gpu);
}
