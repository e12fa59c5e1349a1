//! Nothing that a renderer allocates outlives it: after any work, and after failures in the middle of it.

use cao::renderer::{COLOUR, Renderer};
use cao_gpu::Gpu;
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::look::Look;
use cao_model::mesh::TriangleMesh;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, RaySet};
use cao_model::options::Options;
use cao_model::settings::AntiAliasing;
use cao_model::settings::MapSettings;
use cao_model::settings::Scope;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::StereoRig;
use cao_model::volume::Volume;
use cao_testing::*;
use glam::Vec3;
use std::sync::Arc;

fn renderer(gpu: &Gpu, volume: &Volume, method: Method) -> Renderer {
    let setup = Setup {
        occlusion: Occlusion {
            rays: method.rays_like(RaySet::R6),
            quadrature: method.quadrature(),
            radius_mm: 3.0,
            offset_mm: None,
            step_mm: None,
            ..Occlusion::paper(1.0)
        },
        method,
        options: Options::DEFAULT,
        scope: Scope::Needed,
        anti_aliasing: AntiAliasing::N8,
        maps: MapSettings { resolution: 64, cells: 32, pairs: 2, literal: false },
    };
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    renderer_of(gpu, volume, transfer, setup, COLOUR).unwrap()
}

fn mesh(mesh: Arc<TriangleMesh>, scale: f32) -> Clip {
    Clip {
        shape: Shape::Mesh(mesh),
        mode: Mode::Remove,
        pose: Pose { scale: Vec3::splat(scale), ..Pose::default() },
    }
}

fn work(renderer: &mut Renderer, volume: &Volume) {
    let rig = StereoRig::framing(volume.size_mm(), 30.0, 20.0);
    let views = rig.views(1.0, 1.0, 500.0).unwrap();
    for clips in [vec![], vec![mesh(convex(), 5.0), mesh(concave(), 4.0)], vec![Clip::remove(Shape::Sphere)]]
    {
        renderer.set_clips(&clips).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        assert_eq!(cao::verify::verify(renderer, &mut |_| ()).unwrap().0.different, 0);
        renderer.draw(&views, &Look::default(), [33, 21]).unwrap();
        cao::verify::seen_by_both(renderer, &views, &Look::default(), &[Vec3::ZERO]).unwrap();
        renderer.read_ambient().unwrap();
        renderer.categories().unwrap();
    }
}

#[test]
fn nothing_is_left_after_a_renderer_and_its_work() {
    let gpu = open();
    assert_eq!(gpu.memory_report(), []);
    let volume = builtin_box("engine", [20, 18, 22], [1.0; 3]).unwrap();
    for method in methods().flat_map(|method| [method; 2]) {
        let mut one = renderer(&gpu, &volume, method);
        work(&mut one, &volume);
        assert!(!gpu.memory_report().is_empty());
        drop(one);
        assert_eq!(gpu.memory_report(), [], "leaked");
    }
    close(gpu);
}

/// Names, and bytes together.
fn summary(gpu: &Gpu) -> (Vec<String>, u64) {
    let report = gpu.memory_report();
    (report.iter().map(|(name, _)| name.clone()).collect(), report.iter().map(|(_, bytes)| bytes).sum())
}

/// Work does not pile up: the same work again takes no more memory.
#[test]
fn repeated_work_takes_no_more_memory() {
    /// The allocator counts what it leaves free to align a resource, which depends on its place.
    const ALIGNMENT: u64 = 4096;

    let gpu = open();
    let volume = builtin_box("engine", [20, 18, 22], [1.0; 3]).unwrap();
    for method in methods() {
        let mut one = renderer(&gpu, &volume, method);
        // Twice: maps of clip meshes stay until others replace them.
        work(&mut one, &volume);
        work(&mut one, &volume);
        let ((names, bytes), peak) = (summary(&gpu), gpu.memory_peak());
        for _ in 0..3 {
            work(&mut one, &volume);
            let (names_now, bytes_now) = summary(&gpu);
            assert_eq!(names_now, names);
            assert!(bytes_now <= bytes + ALIGNMENT, "{bytes} grew to {bytes_now}");
            assert!(gpu.memory_peak() <= peak + ALIGNMENT, "{peak} grew to {}", gpu.memory_peak());
        }
        drop(one);
    }
    close(gpu);
}

#[test]
fn failures_in_the_middle_leave_nothing_behind() {
    let gpu = open();
    let volume = builtin_box("engine", [20, 18, 22], [1.0; 3]).unwrap();
    for method in methods() {
        let mut one = renderer(&gpu, &volume, method);
        one.set_clips(&[mesh(convex(), 5.0)]).unwrap();
        one.update(&mut |_| ()).unwrap();
        let (before, _) = summary(&gpu);

        let mut open_mesh = TriangleMesh::cuboid();
        open_mesh.triangles.pop();
        for bad in [
            // After memory for the first mesh was taken.
            vec![mesh(convex(), 6.0), mesh(Arc::new(open_mesh), 3.0)],
            vec![Clip::remove(Shape::Sphere); Clip::MAX + 1],
            vec![mesh(convex(), f32::NAN)],
        ] {
            one.set_clips(&bad).unwrap_err();
            assert_eq!(summary(&gpu).0, before);
        }
        // Three pairs where two are allowed: known when they are drawn.
        one.set_clips(&[mesh(Arc::new(row_of_boxes(3)), 3.0)]).unwrap();
        one.update(&mut |_| ()).unwrap_err();
        assert_eq!(summary(&gpu).0, before);
        let views = StereoRig::framing(volume.size_mm(), 0.0, 0.0).views(1.0, 1.0, 500.0).unwrap();
        let look = Look { tolerance: -1.0, ..Look::default() };
        one.draw(&views, &look, [16, 16]).unwrap_err();
        one.draw(&views, &Look::default(), [0, 16]).unwrap_err();
        one.draw(&views, &Look::default(), [1 << 20, 16]).unwrap_err();
        assert_eq!(summary(&gpu).0, before);
        // And it still works.
        work(&mut one, &volume);

        let mut transfer = TransferFunction::preset("auto", volume.range()).unwrap();
        transfer.opacity.clear();
        let setup = *one.setup();
        drop(one);
        assert!(renderer_of(&gpu, &volume, transfer, setup, COLOUR).is_err());
        assert_eq!(gpu.memory_report(), []);
    }
    close(gpu);
}
