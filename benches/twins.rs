//! The CPU twins, which tests wait for. 24³ voxels, 6 voxels radius.

#![forbid(unsafe_code)]

use cao_model::clip::{Clip, Pose, Shape};
use cao_model::glam::Vec3;
use cao_model::look::Look;
use cao_model::mesh::TriangleMesh;
use cao_model::occlusion::{Integral, Occlusion, Quadrature, RaySet};
use cao_model::settings::{AntiAliasing, Support};
use cao_model::view::StereoRig;
use cao_twin as twin;
use cao_twin::Grid;
use cao_twin::clip::clips::{ClipField, Dilation, Maps};
use cao_twin::draw::raycast::Frame;
use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::sync::Arc;

const EDGE: usize = 24;
const MAPS: Maps =
    Maps { layers: 2, resolution: 64, dilation: Dilation::Conservative(48), support: Support::Voxel };

fn twins(criterion: &mut Criterion) {
    let name = format!("builtin:engine:{EDGE}");
    let volume = cao_formats::open(&name).expect("a volume");
    let transfer = cao_formats::transfer::load("auto", volume.range()).expect("a preset");
    let grid = Grid { dims: volume.dims, spacing: volume.spacing };
    let reference_mm = f64::from(transfer.reference_mm(volume.min_spacing()));
    let values: Vec<f32> = (0..volume.len()).map(|i| volume.value(i) as f32).collect();
    let opacity = twin::field::opacity::opacity(&volume, &transfer);
    let occlusion = Occlusion { radius_mm: 6.0, ..Occlusion::paper(volume.min_spacing()) };
    let reach = occlusion.reach(volume.min_spacing());
    let clip = |shape| {
        let pose = Pose { translate_mm: Vec3::splat(4.0), scale: Vec3::splat(7.0), ..Pose::default() };
        Clip { pose, ..Clip::remove(shape) }
    };
    let field = |clip: &Clip| ClipField::new(clip, &grid, reach, &MAPS).expect("maps");
    let mesh = clip(Shape::Mesh(Arc::new(TriangleMesh::sphere(2))));
    let clips = [field(&clip(Shape::Sphere)), field(&mesh)];
    let (clipped, mask) = twin::clip::classify::classify(&grid, &opacity, &clips, AntiAliasing::N32);
    let unclipped = twin::cast::lao::lao(&grid, &opacity, &occlusion, reference_mm);
    let ambient: Vec<f32> = unclipped.iter().map(|a| *a as f32).collect();
    let view = StereoRig::framing(volume.size_mm(), 30.0, 25.0).views(1.0, 1.0, 1e3).expect("views")[0];
    let frame = Frame {
        grid,
        values: &values,
        parts: None,
        transfer: &transfer,
        reference_mm,
        ambient: &ambient,
        clips: &clips,
        step_mm: 0.5,
        look: Look::default(),
    };
    let size = [48; 2];
    let image = twin::draw::raycast::raycast(&frame, &view, size);
    let ssao = twin::measure::ssao::Settings { radius_mm: 3.0, samples: 32, bias_mm: 0.1 };
    let integral = Integral::ambient(6.0, 0.5, 8, 250, 1.0);
    let points: Vec<[f64; 3]> = (4..12).map(|i| [f64::from(i); 3]).collect();

    let mut group = criterion.benchmark_group("twins");
    group.bench_function("opacity", |b| {
        b.iter(|| twin::field::opacity::opacity(&volume, black_box(&transfer)))
    });
    group.bench_function("occupancy", |b| {
        b.iter(|| twin::field::occupancy::occupancy(&grid, black_box(&values), &transfer));
    });
    for quadrature in Quadrature::CAST {
        let occlusion = Occlusion { rays: RaySet::R6, quadrature, ..occlusion };
        group.bench_function(format!("lao 6 {}", quadrature.name()), |b| {
            b.iter(|| twin::cast::lao::lao(&grid, black_box(&opacity), &occlusion, reference_mm));
        });
    }
    group.bench_function("reference, 8 points", |b| {
        b.iter(|| {
            twin::measure::reference::reference(&grid, black_box(&opacity), &integral, reference_mm, &points)
        });
    });
    group.bench_function("peel and dilate", |b| b.iter(|| field(black_box(&mesh))));
    group.bench_function("classify", |b| {
        b.iter(|| twin::clip::classify::classify(&grid, black_box(&opacity), &clips, AntiAliasing::N32));
    });
    group.bench_function("bricks", |b| b.iter(|| twin::field::bricks::to_compute(&grid, black_box(&mask))));
    group.bench_function("contextual", |b| {
        b.iter(|| {
            let black = black_box(&clipped);
            twin::cast::contextual::contextual(&grid, black, &unclipped, &mask, &occlusion, reference_mm)
        });
    });
    group.bench_function("raycast", |b| {
        b.iter(|| twin::draw::raycast::raycast(black_box(&frame), &view, size));
    });
    group.bench_function("ssao", |b| {
        b.iter(|| twin::measure::ssao::ssao(black_box(&image.depth), size, &view, &ssao));
    });
    group.finish();
}

criterion_group! { name = benches; config = cao_benches::brief(); targets = twins }
criterion_main!(benches);
