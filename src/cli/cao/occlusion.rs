//! `cao occlusion`: the ambient volume of a volume, as a file.

use crate::args::{self, Global, Occlusion, setup};
use crate::budget;
use anyhow::Result;
use cao::renderer::{COLOUR, Renderer};
use cao_cli::output::{Out, Progress, check_validation, open_gpu};
use cao_cli::targets::Targets;
use cao_formats::feature::FeatureSettings;
use clap::ArgMatches;
use std::ffi::OsStr;
use std::process::ExitCode;

pub fn run(global: &Global, args: &Occlusion, matches: &ArgMatches) -> Result<ExitCode> {
    let also = [&args.opacity_out, &args.mask_out];
    let targets = Targets::files([&args.output].into_iter().chain(also.into_iter().flatten()), "nrrd")?;
    let transfer = args.settings.transfer.as_deref().unwrap_or(OsStr::new("auto"));
    let mut progress = Progress::default();
    let clips = args::clips(matches)?;
    progress.stage("reading");
    let frame = args.frame.unwrap_or_default();
    let (mut volume, turn) = frame.arrange(args.raw.open(&args.input)?)?;
    let method = args.method.unwrap_or(args::OCCLUSION);
    let mut setup = setup(&args.settings, &volume, method, !args.needed_only)?;
    setup.occlusion.light = turn.ambient_light(&setup.occlusion.light);
    let transfer = cao_formats::transfer::load(transfer, volume.range());
    let transfer = args::transfer(transfer, &mut volume, &args.input)?;
    let features = args.parts.of(FeatureSettings::default(), &volume, frame)?;
    targets.spare_inputs()?;
    progress.stage("preparing");
    let gpu = open_gpu(global)?;
    let mut renderer = Renderer::new(&gpu, &volume, transfer, setup, COLOUR)?;
    args.settings.give_network(&mut renderer)?;
    renderer.set_clips(&turn.clips(&clips))?;
    renderer.set_features(features.clone())?;
    let planned = budget::plan(&mut renderer, &args.budget, &args.settings, args.method, &mut progress)?;
    progress.stage("occlusion");
    let timings = renderer.update(&mut |done| progress.set(done))?;
    check_validation(&gpu)?;

    progress.stage("writing");
    targets.write(|files| {
        if renderer.subject().coloured() {
            let colours = renderer.read_ambient_colours()?;
            files.nrrd_colours(
                &args.output,
                &volume,
                &colours,
                "ambient factor of red, green and blue light",
            )?;
        } else {
            files.nrrd(&args.output, &volume, &renderer.read_ambient()?, "ambient factor")?;
        }
        if let Some(path) = &args.opacity_out {
            files.nrrd(path, &volume, &renderer.read_opacity()?, "opacity per reference length, clipped")?;
        }
        if let Some(path) = &args.mask_out {
            let mask: Vec<f32> = renderer.read_mask()?.into_iter().map(|m| f32::from(m) / 2.0).collect();
            files.nrrd(path, &volume, &mask, "mask: 0 clipped, 0.5 affected, 1 untouched")?;
        }
        Ok(())
    })?;
    let categories = renderer.categories()?;
    drop(progress);

    let mut out = Out::new(global);
    out.device(&gpu);
    out.volume(&args.input, &volume);
    out.features(&features);
    out.setup(renderer.setup(), &volume);
    if let Some(planned) = &planned {
        planned.print(&mut out);
    }
    out.categories(&categories);
    out.timings(&timings);
    out.memory(&gpu, &volume);
    for path in targets.paths() {
        out.wrote(path);
    }
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}
