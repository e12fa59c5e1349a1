//! `cao render`: a picture for both eyes.

use crate::args::{self, Global, Render, usage};
use crate::budget;
use anyhow::Result;
use cao::renderer::{COLOUR, Renderer, StereoImage};
use cao_cli::output::{Out, Progress, check_targets, check_validation, open_gpu};
use cao_formats::Picture;
use cao_formats::scene::{Scene, Viewpoint};
use cao_model::methods::Method;
use clap::ArgMatches;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

pub fn run(global: &Global, args: &Render, matches: &ArgMatches) -> Result<ExitCode> {
    let targets: Vec<&Path> =
        args.output.iter().chain(args.eyes.iter().flatten()).map(PathBuf::as_path).collect();
    check_targets(&targets, "png", inputs(args))?;
    let mut progress = Progress::default();
    progress.stage("reading");
    let is_scene = args.input.to_lowercase().ends_with(".toml");
    if let Some(flag) = args.raw.given().filter(|_| is_scene) {
        return Err(usage(format!("{flag}: the scene {} says what its volume is", args.input)));
    }
    let mut scene = match is_scene {
        true => Scene::load(Path::new(&args.input))?,
        false => Scene::default_for(args.raw.source(&args.input)?),
    };
    override_scene(&mut scene, args, matches)?;
    let volume = args::open(&scene.volume, &args.input)?;
    let transfer = match &args.settings.transfer {
        Some(spec) => cao_formats::transfer::load(spec, volume.range())?,
        None => scene.transfer(volume.range())?,
    };
    let mut setup = scene.occlusion.setup(volume.min_spacing())?;
    let look = scene.look;
    if !look.occluded {
        // What is not shown is not computed: without a neighbourhood nothing is occluded.
        setup.occlusion.radius_mm = 0.0;
    }
    let size = [scene.image.width, scene.image.height];
    let rig = scene.stereo.rig(volume.size_mm());
    let reach = (rig.position.length() + volume.size_mm().iter().map(|s| *s as f32).sum::<f32>()).max(1.0);
    let views = rig.views(size[0] as f32 / size[1] as f32, reach * 1e-4, reach * 2.0)?;
    progress.stage("preparing");
    let gpu = open_gpu(global)?;
    let mut renderer = Renderer::new(&gpu, &volume, transfer, setup, COLOUR)?;
    renderer.set_clips(&scene.clips)?;
    let planned = budget::plan(&mut renderer, &args.budget, &args.settings, args.method, &mut progress)?;
    progress.stage("occlusion");
    let mut timings = renderer.update(&mut |done| progress.set(done))?;
    progress.stage("drawing");
    let (image, draw) = renderer.draw(&views, &look, size)?;
    timings.extend(draw);
    check_validation(&gpu)?;

    progress.stage("writing");
    write(args, &image, scene.image.background)?;
    drop(progress);
    let mut out = Out::new(global);
    out.device(&gpu);
    out.volume(&args.input, &volume);
    out.setup(renderer.setup(), &volume);
    if let Some(planned) = &planned {
        planned.print(&mut out);
    }
    out.image(size);
    out.timings(&timings);
    out.memory(&gpu, &volume);
    for path in targets {
        out.wrote(path);
    }
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}

/// Flags win over the scene file; clips from flags are added to the scene's.
fn override_scene(scene: &mut Scene, args: &Render, matches: &ArgMatches) -> Result<()> {
    let s = &args.settings;
    let o = &mut scene.occlusion;
    // A rule that the scene's method does not have asks for another method.
    let method = args.method.unwrap_or(match s.quadrature {
        Some(rule) if !o.method.has(rule) => Method::for_rule(Some(rule)),
        _ => o.method,
    });
    if method != o.method {
        // What the scene left to its method is left to this one.
        if o.rays == o.method.rays() {
            o.rays = method.rays();
        }
        (o.method, o.quadrature) = (method, method.quadrature());
    }
    o.rays = s.rays.unwrap_or(o.rays);
    o.quadrature = s.quadrature.unwrap_or(o.quadrature);
    o.radius_mm = s.radius_mm.or(o.radius_mm);
    o.offset_mm = s.offset_mm.or(o.offset_mm);
    o.step_mm = s.step_mm.or(o.step_mm);
    scene.clips.extend(args::clips(matches)?);
    if let Some([width, height]) = args.size {
        (scene.image.width, scene.image.height) = (width, height);
    }
    if args.azimuth.is_some() || args.elevation.is_some() || args.distance.is_some() {
        let (mut azimuth, mut elevation, mut distance) = (30.0, 25.0, None);
        if let Viewpoint::Framing { azimuth_deg, elevation_deg, distance_mm } = scene.stereo.viewpoint {
            (azimuth, elevation, distance) = (azimuth_deg, elevation_deg, distance_mm);
        }
        scene.stereo.viewpoint = Viewpoint::Framing {
            azimuth_deg: args.azimuth.unwrap_or(azimuth),
            elevation_deg: args.elevation.unwrap_or(elevation),
            distance_mm: args.distance.or(distance),
        };
    }
    scene.stereo.ipd_mm = args.ipd.or(scene.stereo.ipd_mm);
    scene.look.occluded &= !args.solid;
    Ok(())
}

fn write(args: &Render, image: &StereoImage, background: [f32; 3]) -> Result<()> {
    let [width, height] = image.size;
    let [left, right] = image.colour.each_ref().map(|eye| Picture::over(width, height, eye, background));
    if let Some(path) = &args.output {
        Picture::beside(&left, &right).write_png(path)?;
    }
    if let Some([left_path, right_path]) = &args.eyes {
        left.write_png(left_path)?;
        right.write_png(right_path)?;
    }
    Ok(())
}

/// Files that must not be overwritten.
fn inputs(args: &Render) -> impl Iterator<Item = &Path> {
    let given = [Some(&args.input), args.settings.transfer.as_ref()].into_iter().flatten();
    given.chain(&args.clips.clip).map(Path::new)
}
