//! Updates that fail on the way: the next one makes everything.

use super::*;
use crate::ambient::{Fields, Recomputation, Written};
use crate::build::Budget;
use crate::drive::Part;
use crate::stages;
use cao_gpu::{OpenOptions, Timings};
use cao_model::METHODS;
use cao_model::builtin::builtin_box;
use cao_model::clip::Shape;
use cao_model::mesh::TriangleMesh;
use cao_model::methods::Method;
use glam::Vec3;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A place that no part has.
const NOWHERE: usize = usize::MAX;

/// A method whose updates have one more part, which fails.
struct Failing {
    method: Box<dyn Ambient>,
    /// Before which of the others.
    at: Arc<AtomicUsize>,
}

impl Ambient for Failing {
    fn update<'a>(&'a self, on: &'a Subject, changed: Changed, into: Option<&'a Image>) -> Vec<Part<'a>> {
        let mut parts = self.method.update(on, changed, into);
        let at = self.at.load(Ordering::Relaxed);
        if at <= parts.len() {
            parts.insert(at, Part::long(stages::LAO, |_| Err(Error::refused("part", "fails"))));
        }
        parts
    }

    fn clips<'a>(&'a self, on: &'a Subject) -> Part<'a> {
        self.method.clips(on)
    }

    fn written(&self, changed: Changed) -> Written<'_> {
        self.method.written(changed)
    }

    fn fields(&self) -> Fields<'_> {
        self.method.fields()
    }

    fn recompute(
        &self,
        on: &Subject,
        into: &Image,
        progress: &mut dyn FnMut(f64),
    ) -> Result<(Recomputation<'_>, Timings)> {
        self.method.recompute(on, into, progress)
    }

    fn mask(&self, on: &Subject) -> Result<Vec<u8>> {
        self.method.mask(on)
    }
}

/// How an update is made.
#[derive(Clone, Copy, PartialEq)]
enum Way {
    Run,
    Recorded,
    Within,
}

fn open() -> Gpu {
    let validation = std::env::var_os("CAO_VALIDATION").is_none_or(|value| value != "0");
    Gpu::open(&OpenOptions { validation, ..OpenOptions::default() }).unwrap()
}

fn close(gpu: Gpu) {
    let log = gpu.validation_log();
    drop(gpu);
    log.assert_clean().unwrap();
}

fn renderer(gpu: &Gpu, method: Method) -> Renderer {
    let volume = builtin_box("engine", [20, 18, 22], [1.0; 3]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let mut setup = Setup::of(method, 1.0);
    setup.occlusion.radius_mm = 4.0;
    Renderer::new(gpu, &volume, transfer, setup, COLOUR).unwrap()
}

fn clips(at: f32) -> Vec<Clip> {
    let mesh = Shape::Mesh(Arc::new(TriangleMesh::cuboid()));
    let placed = |shape, x: f32| {
        let mut clip = Clip::remove(shape);
        (clip.pose.scale, clip.pose.translate_mm.x) = (Vec3::splat(4.0), x);
        clip
    };
    vec![placed(Shape::Sphere, at), placed(mesh, -at)]
}

#[test]
fn an_update_that_failed_is_done_anew() {
    let gpu = open();
    for entry in METHODS {
        let (mut failing, mut fresh) = (renderer(&gpu, entry.method), renderer(&gpu, entry.method));
        let at = Arc::new(AtomicUsize::new(NOWHERE));
        failing.ambient = Box::new(Failing { method: method::of(&failing.subject).unwrap(), at: at.clone() });
        failing.update(&mut |_| ()).unwrap();
        // All ways of one method by brick, each in turn of those that share its updates.
        let shares = ![Method::Rays, Method::Cao, Method::Lao].contains(&entry.method);
        let mut failures = 0;
        for place in 0..8 {
            let before = failures;
            let ways = [Way::Run, Way::Recorded, Way::Within];
            for &way in if shares { &ways[place % 3..=place % 3] } else { &ways[..] } {
                let clips = clips(place as f32 + 0.25 * way as i32 as f32);
                failing.set_clips(&clips).unwrap();
                at.store(place, Ordering::Relaxed);
                let mut rec = gpu.recorder("dropped").unwrap();
                let result = match way {
                    Way::Run => failing.update(&mut |_| ()).map(drop),
                    Way::Recorded => failing.record_update(&mut rec),
                    Way::Within => failing.record_update_within(&mut rec, Budget::Bricks(2)).map(drop),
                };
                drop(rec);
                assert_eq!(failing.current().is_err(), result.is_err(), "{} part {place}", entry.name);
                match result {
                    Err(_) => failures += 1,
                    Ok(()) if way == Way::Run => (),
                    Ok(()) => failing.invalidate(),
                }
                at.store(NOWHERE, Ordering::Relaxed);
                failing.update(&mut |_| ()).unwrap();
                fresh.set_clips(&clips).unwrap();
                fresh.update(&mut |_| ()).unwrap();
                let same = failing.read_ambient().unwrap() == fresh.read_ambient().unwrap();
                assert!(same, "{} part {place}", entry.name);
            }
            // Behind the last part: nothing fails there, nor farther on.
            if failures == before {
                break;
            }
        }
        // Before each of three parts at least, and behind the last, where it is reached.
        let least = if shares { 4 } else { 11 };
        assert!(failures >= least, "{}: {failures}", entry.name);
    }
    close(gpu);
}
