//! Clip meshes that are new or another form in every frame: made by what the host records, as `update` makes them, and what is wrong with one is
//! said when the device knows.

use crate::host::Host;
use cao::renderer::{COLOUR, Renderer};
use cao_gpu::Gpu;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::mesh::TriangleMesh;
use cao_model::methods::Method;
use cao_model::settings::{MapSettings, Setup};
use cao_model::transfer::TransferFunction;
use cao_testing::meshes::join;
use cao_testing::{concave, convex, kinds, row_of_boxes};
use glam::Vec3;
use std::sync::Arc;

fn renderer(gpu: &Gpu, method: Method, pairs: u32) -> Renderer {
    let volume = cao_formats::open("builtin:engine:24").unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let maps = MapSettings { resolution: 96, cells: 32, pairs, literal: false };
    let setup = Setup { maps, ..Setup::of(method, volume.min_spacing()) };
    Renderer::new(gpu, &volume, transfer, setup, COLOUR).unwrap()
}

fn clip(mesh: &Arc<TriangleMesh>, mode: Mode, at: f32, scale: f32) -> Clip {
    let pose = Pose { translate_mm: Vec3::splat(at), scale: Vec3::splat(scale), ..Pose::default() };
    Clip { shape: Shape::Mesh(mesh.clone()), mode, pose }
}

/// A wave along z that swells and shrinks it.
fn deformed(mesh: &TriangleMesh, phase: f32) -> Arc<TriangleMesh> {
    let vertices = mesh.vertices.iter().map(|&v| v * (1.0 + 0.3 * (phase + 2.0 * v.z).sin())).collect();
    Arc::new(TriangleMesh { vertices, ..mesh.clone() })
}

/// A frame of a host: its number of submissions to our queue, apart from the host's own.
fn record(gpu: &Gpu, renderer: &mut Renderer, clips: &[Clip]) -> cao::Result<u64> {
    let before = gpu.counts().submissions;
    renderer.set_clips(clips)?;
    let mut rec = gpu.recorder("host frame")?;
    renderer.record_update(&mut rec)?;
    let submissions = gpu.counts().submissions - before;
    rec.submit_and_wait()?;
    Ok(submissions)
}

fn assert_same(renderer: &Renderer, other: &Renderer, context: &str) {
    let bits = |values: Vec<f32>| values.into_iter().map(f32::to_bits).collect::<Vec<_>>();
    assert!(renderer.read_opacity().unwrap() == other.read_opacity().unwrap(), "{context}");
    let [found, expected] = [renderer, other].map(|r| bits(r.read_ambient().unwrap()));
    assert!(found == expected, "{context}");
}

#[test]
fn meshes_of_another_form_in_every_frame_are_made_by_what_is_recorded() {
    let gpu = cao_testing::open();
    let (one, other) = (concave(), convex());
    for method in kinds() {
        let (mut hosted, mut opacities) = (renderer(&gpu, method, 4), Vec::new());
        for frame in 0..6 {
            let form = deformed(&one, frame as f32);
            let mut clips = vec![clip(&form, Mode::Remove, 1.0, 6.0), clip(&other, Mode::Keep, -1.0, 9.0)];
            match frame {
                // A mesh more and a mesh less, and the other way round.
                3 => clips.insert(0, clip(&deformed(&other, 2.0), Mode::Remove, 5.0, 3.0)),
                4 => clips.truncate(1),
                5 => clips.reverse(),
                _ => (),
            }
            let context = format!("{method:?} frame {frame}");
            assert_eq!(record(&gpu, &mut hosted, &clips).unwrap(), 0, "{context}");
            let mut own = renderer(&gpu, method, 4);
            own.set_clips(&clips).unwrap();
            own.update(&mut |_| ()).unwrap();
            assert_same(&hosted, &own, &context);
            let opacity = own.read_opacity().unwrap();
            assert!(!opacities.contains(&opacity), "{context} is another cut");
            opacities.push(opacity);
        }
        // Within a budget, too: the cut is the newest in every frame, the values those of the last form in the end.
        for frame in 0..40 {
            let form = deformed(&one, frame.min(3) as f32 - 7.0);
            let clips = [clip(&form, Mode::Remove, 1.0, 6.0)];
            let mut rec = gpu.recorder("host frame").unwrap();
            if frame < 4 {
                hosted.set_clips(&clips).unwrap();
            }
            let updated = hosted
                .record_update_within(&mut rec, cao::build::Budget::Bricks(if frame < 8 { 2 } else { 20 }));
            let updated = updated.unwrap();
            rec.submit_and_wait().unwrap();
            hosted.updated(&updated, 1.0).unwrap();
            if hosted.stale().is_settled() && frame > 4 {
                let mut own = renderer(&gpu, method, 4);
                own.set_clips(&clips).unwrap();
                own.update(&mut |_| ()).unwrap();
                assert_same(&hosted, &own, &format!("{method:?} within a budget"));
                break;
            }
            assert!(frame < 39);
        }
    }
    cao_testing::close(gpu);
}

#[test]
fn a_mesh_with_too_few_pairs_is_refused_when_the_device_knows() {
    let gpu = cao_testing::open();
    for method in kinds() {
        let (mut hosted, mut own) = (renderer(&gpu, method, 2), renderer(&gpu, method, 2));
        let good = [clip(&convex(), Mode::Remove, 1.0, 6.0)];
        let row = Arc::new(row_of_boxes(3));
        let bad = [good[0].clone(), clip(&row, Mode::Remove, 0.0, 3.0)];
        own.set_clips(&bad).unwrap();
        for _ in 0..2 {
            let refused = own.update(&mut |_| ()).unwrap_err().to_string();
            assert!(
                refused.contains("row of boxes") && refused.contains("more than 2 layer pairs"),
                "{refused}"
            );
            assert!(own.read_ambient().is_err());
        }
        record(&gpu, &mut hosted, &bad).unwrap();
        let refused = record(&gpu, &mut hosted, &good).unwrap_err().to_string();
        assert!(refused.contains("row of boxes") && refused.contains("more than 2 layer pairs"), "{refused}");
        // It is said once; where the mesh stays, again when it was made again.
        record(&gpu, &mut hosted, &bad).unwrap();
        assert!(record(&gpu, &mut hosted, &bad).is_err());
        record(&gpu, &mut hosted, &bad).unwrap();
        // What never ran has found nothing.
        hosted.invalidate();
        own.set_clips(&good).unwrap();
        own.update(&mut |_| ()).unwrap();
        record(&gpu, &mut hosted, &good).unwrap();
        assert_same(&hosted, &own, &format!("{method:?}"));
        record(&gpu, &mut hosted, &good).unwrap();
    }
    cao_testing::close(gpu);
}

/// Many parts that touch are one pair of many surfaces, more than a mesh has at first: the frames after the first few have them all.
#[test]
fn a_mesh_of_many_surfaces_gets_more_passes() {
    let gpu = cao_testing::open();
    let cube = TriangleMesh::cuboid();
    let parts: Vec<_> = (0..30).map(|i| (&cube, 0.5, Vec3::Z * (i - 15) as f32, i % 2 == 1)).collect();
    let row = Arc::new(join(&parts));
    for method in kinds() {
        let (mut hosted, mut own) = (renderer(&gpu, method, 1), renderer(&gpu, method, 1));
        let at = |form: &Arc<TriangleMesh>| {
            let mut clip = clip(form, Mode::Remove, 0.0, 1.0);
            clip.pose.scale = Vec3::new(9.0, 9.0, 0.7);
            [clip]
        };
        own.set_clips(&at(&row)).unwrap();
        own.update(&mut |_| ()).unwrap();
        // 5 passes, 10, 20, 40, 80.
        record(&gpu, &mut hosted, &at(&row)).unwrap();
        assert!(hosted.read_opacity().unwrap() != own.read_opacity().unwrap());
        for _ in 0..4 {
            let mut rec = gpu.recorder("host frame").unwrap();
            hosted.record_update(&mut rec).unwrap();
            rec.submit_and_wait().unwrap();
        }
        assert_same(&hosted, &own, &format!("{method:?}"));
        let mut rec = gpu.recorder("host frame").unwrap();
        hosted.record_update(&mut rec).unwrap();
        assert_eq!(*rec.submit_and_wait().unwrap(), [], "all is there");
        // Another form begins with as many.
        let vertices = row.vertices.iter().map(|&v| v * Vec3::new(0.8, 0.7, 1.0)).collect();
        let form = Arc::new(TriangleMesh { vertices, ..row.as_ref().clone() });
        record(&gpu, &mut hosted, &at(&form)).unwrap();
        own.set_clips(&at(&form)).unwrap();
        own.update(&mut |_| ()).unwrap();
        assert_same(&hosted, &own, &format!("{method:?}, another form"));
    }
    cao_testing::close(gpu);
}

/// Frames of a host that are recorded before the first of them runs, each with a form of its own; what is wrong with a mesh is heard when the
/// host lets go of the recording.
#[test]
fn frames_in_flight_have_forms_of_their_own() {
    let host = Host::new();
    let gpu = host.adopted(Some(host.queue));
    for method in kinds() {
        let mut hosted = renderer(&gpu, method, 4);
        let forms = [0.0, 1.0, 2.5].map(|phase| [clip(&deformed(&concave(), phase), Mode::Remove, 1.0, 6.0)]);
        let mut record = |clips: &[Clip]| {
            hosted.set_clips(clips)?;
            let cmd = host.begin();
            // SAFETY: the command buffer is recording and submitted once below; the `Recorded` is kept until it has run.
            let mut rec = unsafe { gpu.record_into(cmd) };
            hosted.record_update(&mut rec)?;
            Ok((cmd, rec.finish()?))
        };
        let frames =
            forms.each_ref().map(|clips| record(clips).map_err(|e: cao::Error| e.to_string()).unwrap());
        let bad = [clip(&Arc::new(row_of_boxes(5)), Mode::Remove, 0.0, 3.0)];
        let (last, recorded) = record(&bad).unwrap();
        for ((cmd, _), clips) in frames.iter().zip(&forms) {
            host.submit_and_wait(&[*cmd]);
            let mut own = renderer(&gpu, method, 4);
            own.set_clips(clips).unwrap();
            own.update(&mut |_| ()).unwrap();
            assert_same(&hosted, &own, &format!("{method:?}"));
        }
        host.submit_and_wait(&[last]);
        // It ran, but who knows.
        let update = |hosted: &mut Renderer| {
            hosted.set_clips(&forms[0]).unwrap();
            hosted.update(&mut |_| ())
        };
        update(&mut hosted).unwrap();
        drop((frames, recorded));
        assert!(update(&mut hosted).unwrap_err().to_string().contains("row of boxes"));
        update(&mut hosted).unwrap();
    }
    let log = gpu.validation_log();
    drop(gpu);
    log.assert_clean().unwrap();
    host.destroy();
}
