//! Frames as a host records them: any kind may follow any other, and what they leave is what a fresh renderer makes, to the bit.

use crate::host::Host;
use crate::scenes::{NAMES, Scene, assert_as_fresh, scene};
use cao::renderer::{COLOUR, Renderer, Target, Targets};
use cao_gpu::{Access, Buffer, BufferUse, Format, Gpu, Image, ImageDesc, ImageKind, ImageUse, Recorder};
use cao_measure::random::Random;
use cao_model::look::Look;
use cao_model::methods::Method;
use cao_model::view::View;
use cao_testing::*;

const SIZE: [u32; 2] = [24, 20];

/// What a host draws into.
struct Window {
    colour: Image,
    depth: Image,
    back: Buffer,
    views: [View; 2],
    look: Look,
}

impl Window {
    fn new(gpu: &Gpu, scene: &Scene) -> Self {
        let target = |format| {
            let (dims, usage) = ([SIZE[0], SIZE[1], 1], ImageUse::ATTACHMENT | ImageUse::SAMPLED);
            gpu.image("target", &ImageDesc { dims, layers: 2, format, kind: ImageKind::D2, usage }).unwrap()
        };
        Self {
            colour: target(COLOUR),
            depth: target(Format::D32Float),
            back: gpu.buffer("back", u64::from(SIZE[0] * SIZE[1]) * 16, BufferUse::Readback).unwrap(),
            views: eyes(&scene.volume, 30.0),
            look: Look::default(),
        }
    }

    fn draw(&self, rec: &mut Recorder, renderer: &Renderer) -> cao::Result<()> {
        rec.discard(&self.colour);
        rec.discard(&self.depth);
        rec.barrier(&[], &[Access::AttachmentWrite]);
        renderer
            .record_draw(
                rec,
                &self.views,
                &self.look,
                &Targets::new(&Target::layers(&self.colour, &self.depth, self.views.len()), SIZE),
            )
            .map(drop)
    }

    fn read_later(&self, rec: &mut Recorder) {
        rec.barrier(
            &[Access::AttachmentWrite, Access::TransferWrite],
            &[Access::TransferRead, Access::TransferWrite],
        );
        rec.copy_image_to_buffer(&self.colour, 1, [0; 3], [SIZE[0], SIZE[1], 1], &self.back, 0).unwrap();
        rec.barrier(&[Access::TransferWrite], &[Access::HostRead]);
    }

    /// The right eye's picture, and that of a renderer on its own.
    fn pictures(&self, fresh: &Renderer) -> [Vec<[f32; 4]>; 2] {
        let recorded = bytemuck::pod_collect_to_vec(&self.back.read(0, self.back.bytes()).unwrap());
        let [_, drawn] = fresh.draw(&self.views, &self.look, SIZE).unwrap().0.colour;
        [recorded, drawn]
    }
}

/// Frames of one method on an adopted device; how many fresh renderers they were compared with.
fn frames(host: &Host, gpu: &Gpu, name: &str, method: Method, seed: u64, frames: usize) -> usize {
    let mut random = Random::new(seed);
    let mut scene = scene(&mut random, name, method);
    let mut renderer = renderer_of(gpu, &scene.volume, scene.transfer.clone(), scene.setup, COLOUR).unwrap();
    let window = Window::new(gpu, &scene);
    let (mut history, mut compared) = (Vec::new(), 0);
    for frame in 0..frames {
        let cmd = host.begin();
        // SAFETY: the command buffer is recording, and submitted once below or never; the `Recorded` is kept until then.
        let mut rec = unsafe { gpu.record_into(cmd) };
        let done = match random.below(8) {
            0 => "nothing".into(),
            1 => {
                renderer.invalidate();
                "invalidate".into()
            }
            // A frame that the host dropped.
            2 => {
                let edit = scene.edit(&mut random, &mut renderer);
                renderer.record_update(&mut rec).unwrap();
                window.draw(&mut rec, &renderer).unwrap();
                drop(rec);
                renderer.invalidate();
                history.push(format!("{edit}, dropped"));
                continue;
            }
            // On the lent queue, before more of it is recorded.
            3 => {
                let edits = [(); 2].map(|()| {
                    let edit = scene.edit(&mut random, &mut renderer);
                    renderer.update(&mut |_| ()).unwrap();
                    edit
                });
                format!("{}, run", edits.join(", "))
            }
            // Several updates in one command buffer, and pictures between them.
            4 => {
                let edits = [(); 3].map(|()| {
                    let edit = scene.edit_recorded(&mut random, &mut renderer);
                    let early = window.draw(&mut rec, &renderer).unwrap_err().to_string();
                    assert!(early.contains("out of date"), "{early}");
                    renderer.record_update(&mut rec).unwrap();
                    window.draw(&mut rec, &renderer).unwrap();
                    edit
                });
                format!("{} in one", edits.join(", "))
            }
            _ => scene.edit(&mut random, &mut renderer),
        };
        history.push(done);
        let context = || {
            let last = &history[history.len().saturating_sub(3)..];
            format!("{} seed {seed} frame {frame}: after {}", method.name(), last.join("; "))
        };
        renderer.record_update(&mut rec).unwrap_or_else(|error| panic!("{error}; {}", context()));
        window.draw(&mut rec, &renderer).unwrap_or_else(|error| panic!("{error}; {}", context()));
        window.read_later(&mut rec);
        let recorded = rec.finish().unwrap();
        host.submit_and_wait(&[cmd]);
        drop(recorded);
        if random.below(6) == 0 {
            let fresh = scene.renderer(gpu);
            assert_as_fresh(&scene, &renderer, &fresh, &context);
            let [found, expected] = window.pictures(&fresh);
            assert!(found == expected, "picture {}", context());
            compared += 1;
        }
    }
    compared
}

#[test]
fn any_sequence_of_recorded_frames_is_that_of_a_fresh_renderer() {
    const FRAMES: [usize; 2] = [200, 35];
    let host = Host::new();
    let gpu = host.adopted(Some(host.queue));
    for (case, method) in methods().enumerate() {
        let count = FRAMES[usize::from(!kinds().contains(&method))];
        let compared = frames(&host, &gpu, NAMES[case % NAMES.len()], method, 81 + case as u64, count);
        assert!(compared > count / 15, "{}: {compared}", method.name());
    }
    assert_eq!(gpu.memory_report(), []);
    drop(gpu);
    host.destroy();
}

#[test]
fn a_picture_needs_an_update_first() {
    let gpu = open();
    for method in methods() {
        let mut random = Random::new(80);
        let scene = scene(&mut random, "engine", method);
        let mut renderer =
            renderer_of(&gpu, &scene.volume, scene.transfer.clone(), scene.setup, COLOUR).unwrap();
        let window = Window::new(&gpu, &scene);
        run(&gpu, |rec| {
            let error = window.draw(rec, &renderer).unwrap_err().to_string();
            assert!(error.contains("record_update"), "{error}");
            renderer.record_update(rec).unwrap();
            window.draw(rec, &renderer).unwrap();
        });
        drop((renderer, window));
    }
    close(gpu);
}
