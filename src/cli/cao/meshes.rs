//! `cao render` of a scene with meshes: alone, or together with a volume, each in front of and behind the other.

use crate::args::{self, Global, Render, usage};
use crate::render::Pictures;
use anyhow::Result;
use cao::mesh_renderer::MeshRenderer;
use cao::renderer::{COLOUR, Renderer, StereoImage};
use cao_cli::output::{Out, Progress, check_validation, open_gpu};
use cao_cli::targets::Targets;
use cao_formats::mesh_keys::{MeshFrom, MeshSource};
use cao_formats::scene::{Scene, Stereo};
use cao_model::clip::{Clip, Shape};
use cao_model::frame::Turn;
use cao_model::look::Look;
use cao_model::mesh::TriangleMesh;
use cao_model::settings::Scope;
use cao_model::surface::{Instance, World};
use cao_model::view::StereoRig;
use cao_model::volume::Volume;
use glam::Vec3;
use std::process::ExitCode;
use std::sync::Arc;

/// Most pixels along the edge of one that are drawn for it: four are sixteen samples.
const MOST_FINER: u32 = 4;

pub fn run(
    global: &Global,
    args: &Render,
    scene: Scene,
    targets: &Targets,
    mut progress: Progress,
) -> Result<ExitCode> {
    let of_each = scene.meshes.iter().map(MeshSource::instances).collect::<cao_formats::Result<Vec<_>>>()?;
    let world = World::new(&of_each.concat())?;
    if args.budget.given() {
        return Err(usage(
            "--budget-error, --budget-ms: they choose a volume's occlusion, and this scene has meshes",
        ));
    }
    let (volume, turn) = match &scene.volume {
        Some(source) => {
            let volume = args::open(source, args.raw.choices.or(scene.reading), &args.input)?;
            let (volume, turn) = scene.frame.arrange(volume)?;
            (Some(volume), turn)
        }
        None => (None, Turn::NONE),
    };
    let world = world.turned(turn.rotation());
    let look = turn.look(&scene.look);
    let size = [scene.image.width, scene.image.height];
    let finer = ((look.samples as f32).sqrt().round() as u32).clamp(1, MOST_FINER);
    let rig = eyes(&scene, &world, volume.as_ref(), turn);
    let reach = (rig.position - rig.target).length() + (world.bounds().1 - world.bounds().0).length();
    let views = rig.views(size[0] as f32 / size[1] as f32, reach * 1e-4, reach * 10.0)?;
    targets.spare_inputs()?;
    progress.stage("preparing");
    let gpu = open_gpu(global)?;
    let occlusion = scene.mesh_occlusion.unwrap_or_default();
    let mut meshes = MeshRenderer::new(&gpu, &world, occlusion)?;
    meshes.set_clips(&turn.clips(&scene.clips))?;
    let mut timings = cao_gpu::Timings::new();
    let mut out = Out::new(global);
    out.device(&gpu);
    let renderer = match volume {
        Some(mut volume) => {
            let transfer = match &args.settings.transfer {
                Some(spec) => cao_formats::transfer::load(spec, volume.range()),
                None => scene.transfer(volume.range()),
            };
            let transfer = args::transfer(transfer, &mut volume, &args.input)?;
            let features = args.parts.of(scene.features.clone(), &volume, scene.frame)?;
            let mut setup = scene.occlusion.setup(volume.min_spacing())?;
            if scene.meshes.iter().any(|mesh| !mesh.solid) {
                // Meshes stand where the volume has nothing, too; solids are something.
                setup.scope = Scope::All;
            }
            setup.occlusion.light = turn.ambient_light(&setup.occlusion.light);
            let mut renderer = Renderer::new(&gpu, &volume, transfer, setup, COLOUR)?;
            args.settings.give_network(&mut renderer)?;
            renderer.set_clips(&turn.clips(&scene.clips))?;
            renderer.set_features(features)?;
            let (solids, spared) = solids(&scene, &of_each)?;
            renderer.set_solids(&turn.clips(&solids), spared)?;
            progress.stage("occlusion");
            timings.extend(renderer.update(&mut |done| progress.set(done))?);
            out.volume(&args.input, &volume);
            out.setup(renderer.setup(), &volume);
            Some(renderer)
        }
        None if scene.meshes.iter().any(|mesh| mesh.solid) => {
            return Err(usage("mesh.solid: this scene has no volume whose opacity it could fill"));
        }
        None => None,
    };
    progress.stage("drawing");
    let one = Look { samples: 1, ..look };
    let large = size.map(|pixels| pixels * finer);
    let (image, drawn) =
        meshes.draw(&views, &one, large, renderer.as_ref(), &mut |done| progress.set(done))?;
    timings.extend(drawn);
    let image = means(&image, finer);
    targets.write(|files| {
        let mut pictures = Pictures::begin(files, args, size, scene.image.background)?;
        pictures.add(&image)?;
        check_validation(&gpu)?;
        pictures.finish(files)
    })?;
    drop(progress);
    out.meshes(&world, &occlusion, meshes.delta_mm());
    out.image(size);
    out.timings(&timings);
    for path in targets.paths() {
        out.wrote(path);
    }
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}

/// The meshes that fill the volume's opacity, and whether clips leave all of them whole.
fn solids(scene: &Scene, of_each: &[Vec<Instance>]) -> Result<(Vec<Clip>, bool)> {
    let mut solids = Vec::new();
    for (_, instances) in scene.meshes.iter().zip(of_each).filter(|(source, _)| source.solid) {
        for Instance { surface, pose } in instances {
            let mesh = TriangleMesh::new(&surface.name, &surface.positions, &surface.triangles)?;
            solids.push(Clip { pose: *pose, ..Clip::remove(Shape::Mesh(Arc::new(mesh))) });
        }
    }
    Ok((solids, scene.meshes.iter().all(|source| source.spared || !source.solid)))
}

/// The scene's eyes, or those of a built-in scene that stands alone; framed is the box of volume and meshes.
fn eyes(scene: &Scene, world: &World, volume: Option<&Volume>, turn: Turn) -> StereoRig {
    let given = scene.stereo != Stereo::default();
    if let ([MeshSource { from: MeshFrom::Builtin(built, _), .. }], None, false) =
        (&scene.meshes[..], volume, given)
    {
        return built.eye;
    }
    let (mut low, mut high) = world.bounds();
    if let Some(volume) = volume {
        let half = Vec3::from_array(volume.size_mm().map(|size| 0.5 * size as f32));
        (low, high) = (low.min(-half), high.max(half));
    }
    let extent = turn.extent((high - low).to_array().map(f64::from));
    let rig = turn.rig(&scene.stereo.rig(extent));
    match scene.stereo.viewpoint {
        cao_formats::scene::Viewpoint::Placed { .. } => rig,
        cao_formats::scene::Viewpoint::Framing { .. } => {
            let middle = 0.5 * (low + high);
            StereoRig { position: rig.position + middle, target: rig.target + middle, ..rig }
        }
    }
}

/// Means over squares of `finer` pixels along an edge; the nearest depth of each.
fn means(image: &StereoImage, finer: u32) -> StereoImage {
    let [width, height] = image.size.map(|pixels| pixels / finer);
    let mut all =
        StereoImage { size: [width, height], colour: Default::default(), depth: Default::default() };
    let share = 1.0 / (finer * finer) as f32;
    for eye in 0..2 {
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let (mut sum, mut nearest) = ([0.0; 4], f32::INFINITY);
            for (dx, dy) in (0..finer).flat_map(|dy| (0..finer).map(move |dx| (dx, dy))) {
                let at = ((y * finer + dy) * image.size[0] + x * finer + dx) as usize;
                for (sum, part) in sum.iter_mut().zip(image.colour[eye][at]) {
                    *sum += share * part;
                }
                nearest = nearest.min(image.depth[eye][at]);
            }
            all.colour[eye].push(sum);
            all.depth[eye].push(nearest);
        }
    }
    all
}
