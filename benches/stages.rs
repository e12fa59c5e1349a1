//! Kernels, by the device's timestamps: the time that a stage takes inside an update or a frame, not that of the calls
//! around it. 32³ voxels, 8 voxels radius, 128² pixels for each eye; rays of meshes at 80 × 45 pixels for each eye. On a software driver only ratios mean
//! anything.

#![forbid(unsafe_code)]

use cao::glam::Vec3;
use cao::mesh::ambient::ByRays;
use cao::mesh_renderer::MeshRenderer;
use cao::renderer::COLOUR;
use cao::{
    Clip, Gpu, Method, OpenOptions, Pose, Quadrature, RaySet, Renderer, Setup, Shape, StereoRig,
    TransferFunction, TriangleMesh,
};
use cao_gpu::Timings;
use cao_model::look::Look;
use cao_model::scenes::BuiltScene;
use cao_model::surface::World;
use criterion::{Criterion, criterion_group, criterion_main};
use std::sync::Arc;
use std::time::Duration;

const EDGE: usize = 32;

/// Time of all stages of this name.
fn of(stage: &str, timings: &Timings) -> Duration {
    let found: Vec<f64> = timings.iter().filter(|t| t.stage.name == stage).map(|t| t.ms).collect();
    assert!(!found.is_empty(), "no stage {stage} in {timings:?}");
    // Criterion asks for more than nothing, which is what a fast device's clock may say.
    Duration::from_secs_f64(found.iter().sum::<f64>() / 1e3).max(Duration::from_nanos(1))
}

struct Bench<'a> {
    renderer: Renderer,
    /// Edits made.
    turn: u32,
    transfer: TransferFunction,
    group: criterion::BenchmarkGroup<'a, criterion::measurement::WallTime>,
}

impl Bench<'_> {
    /// Measures one stage of an update after an edit, which is told a number that is even and odd in turn.
    fn stage(&mut self, name: &str, stage: &str, mut edit: impl FnMut(&mut Renderer, u32)) {
        let (renderer, turn) = (&mut self.renderer, &mut self.turn);
        self.group.bench_function(name, |b| {
            b.iter_custom(|iterations| {
                let mut total = Duration::ZERO;
                for _ in 0..iterations {
                    *turn += 1;
                    edit(renderer, *turn);
                    total += of(stage, &renderer.update(&mut |_| ()).expect("an update"));
                }
                total
            });
        });
    }
}

fn sphere(x: f32) -> Clip {
    let pose = Pose { translate_mm: Vec3::new(x, 4.0, -6.0), scale: Vec3::splat(9.0), ..Pose::default() };
    Clip { pose, ..Clip::remove(Shape::Sphere) }
}

fn stages(criterion: &mut Criterion) {
    let volume = cao_formats::open(format!("builtin:engine:{EDGE}")).expect("a volume");
    let transfer = cao_formats::transfer::load("auto", volume.range()).expect("a preset");
    let gpu = Gpu::open(&OpenOptions::default()).expect("a Vulkan device");
    let mut setup = Setup::of(cao_model::methods::Method::Cao, volume.min_spacing());
    setup.method = Method::Cao;
    setup.occlusion.radius_mm = 8.0;
    let renderer = Renderer::new(&gpu, &volume, transfer.clone(), setup, COLOUR).expect("a renderer");
    let mut bench = Bench { renderer, turn: 0, transfer, group: criterion.benchmark_group("stages") };

    let transfer = bench.transfer.clone();
    let retransfer = move |renderer: &mut Renderer, _| {
        renderer.set_transfer(transfer.clone()).expect("a transfer function");
    };
    let set = |bench: &mut Bench, setup: Setup| bench.renderer.set_setup(setup).expect("a setup");
    // Without rays, so that what is measured is most of what runs.
    let mut short = Setup { method: Method::Lao, ..setup };
    short.occlusion.radius_mm = 0.0;
    set(&mut bench, short);
    for stage in ["opacity", "occupancy", "bricks"] {
        bench.stage(stage, stage, retransfer.clone());
    }
    for quadrature in Quadrature::CAST {
        let mut lao = Setup { method: Method::Lao, ..setup };
        lao.occlusion.quadrature = quadrature;
        set(&mut bench, lao);
        bench.stage(&format!("lao 26 {}", quadrature.name()), "lao", retransfer.clone());
    }
    let mut lao = Setup { method: Method::Lao, ..setup };
    lao.occlusion.rays = RaySet::W50;
    set(&mut bench, lao);
    bench.stage("lao 50w left", "lao", retransfer.clone());

    set(&mut bench, setup);
    // To and fro by one voxel.
    let to_and_fro = |turn: u32| 5.0 + (turn % 2) as f32;
    for stage in ["classify", "contextual"] {
        bench.stage(stage, stage, |renderer, turn| {
            renderer.set_clips(&[sphere(to_and_fro(turn))]).expect("a clip");
        });
    }
    let mesh = Arc::new(TriangleMesh::sphere(3));
    for stage in ["peel", "dilate"] {
        bench.stage(stage, stage, |renderer, turn| {
            // Another form needs new layers.
            let pose = Pose { scale: Vec3::splat(5.0).with_x(to_and_fro(turn)), ..Pose::default() };
            let clip = Clip { pose, ..Clip::remove(Shape::Mesh(mesh.clone())) };
            renderer.set_clips(&[clip]).expect("a mesh clip");
        });
    }
    bench.stage("contextual, clip elsewhere", "contextual", |renderer, turn| {
        renderer.set_clips(&[sphere(if turn % 2 == 0 { -8.0 } else { 8.0 })]).expect("a clip");
    });

    for quadrature in Quadrature::BRICK {
        let mut by_brick = Setup { method: Method::Rays, ..setup };
        by_brick.occlusion.quadrature = quadrature;
        by_brick.occlusion.rays = RaySet::Spiral(50);
        set(&mut bench, by_brick);
        let name = format!("rays spiral:50 {}", quadrature.name());
        bench.stage(&name, "rays", |renderer, _| renderer.invalidate());
    }
    for stage in ["carve", "choose"] {
        bench.stage(stage, stage, |renderer, turn| {
            renderer.set_clips(&[sphere(to_and_fro(turn))]).expect("a clip");
        });
    }

    let views = StereoRig::framing(volume.size_mm(), 30.0, 25.0).views(1.0, 1.0, 1e3).expect("views");
    let renderer = &bench.renderer;
    bench.group.bench_function("raycast", |b| {
        b.iter_custom(|iterations| {
            (0..iterations)
                .map(|_| {
                    let drawn = renderer.draw(&views, &Look::default(), [128; 2]).expect("a picture");
                    of("raycast", &drawn.1)
                })
                .sum()
        });
    });
    bench.group.finish();
}

/// 16 rays a pixel of meshes, without masks and with: walks through the tree, and queries where the device has them.
fn rays(criterion: &mut Criterion) {
    let gpu = Gpu::open(&OpenOptions::default()).expect("a Vulkan device");
    let mut group = criterion.benchmark_group("rays of meshes");
    let size = [80, 45];
    for name in ["colonnade", "trees"] {
        let scene = BuiltScene::parse(name).expect("a scene");
        let world = World::new(&(scene.make)(scene.detail)).expect("a world");
        let views = scene.eye.views(size[0] as f32 / size[1] as f32, 1.0, 1e5).expect("views");
        let mut ways = vec![("walks", ByRays::walks(&gpu, 16).expect("rays"))];
        if gpu.ray_queries() {
            ways.push(("queries", ByRays::queries(&gpu, 16).expect("rays")));
        }
        for (way, rays) in ways {
            let made = MeshRenderer::with(&gpu, &world, Box::new(rays), scene.delta_mm);
            let mut renderer = made.expect("a renderer");
            group.bench_function(format!("{name}, {way}"), |b| {
                b.iter_custom(|iterations| {
                    (0..iterations)
                        .map(|_| {
                            let drawn = renderer.draw(&views, &Look::default(), size, None, &mut |_| ());
                            of("trace", &drawn.expect("a picture").1)
                        })
                        .sum()
                });
            });
        }
    }
    group.finish();
}

criterion_group! { name = benches; config = cao_benches::brief(); targets = stages, rays }
criterion_main!(benches);
