//! `cao render`: a picture for both eyes.

use crate::args::{self, Global, Render, usage};
use crate::{budget, meshes};
use anyhow::Result;
use cao::image_space::method::image_method;
use cao::picture_occlusion::PictureOcclusion;
use cao::renderer::{Bands, COLOUR, Renderer, StereoImage};
use cao_cli::output::{Out, Progress, check_validation, open_gpu};
use cao_cli::targets::Targets;
use cao_formats::scene::{Scene, Stereo, Viewpoint};
use cao_formats::{GrowingPng, Outputs, Picture};
use cao_model::error::shown_path;
use cao_model::fit::{Fit, Fitting};
use cao_model::frame::Turn;
use cao_model::methods::Method;
use cao_model::options::Options;
use cao_model::view::StereoRig;
use clap::ArgMatches;
use glam::Vec3;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

pub fn run(global: &Global, args: &Render, matches: &ArgMatches) -> Result<ExitCode> {
    if !matches!(args.eyes.len(), 0 | 2) {
        return Err(usage(format!("--eyes: {} files, expected two, LEFT,RIGHT", args.eyes.len())));
    }
    let targets = Targets::files(args.output.iter().chain(&args.eyes), "png")?;
    let mut progress = Progress::default();
    progress.stage("reading");
    let is_scene = args::has_extension(&args.input, "toml");
    if let Some(flag) = args.raw.given().filter(|_| is_scene) {
        let scene = shown_path(&args.input);
        return Err(usage(format!("{flag}: the scene {scene} says what its volume is")));
    }
    let mut scene = match is_scene {
        true => Scene::load(Path::new(&args.input))?,
        false => Scene::default_for(args.raw.source(&args.input)?),
    };
    override_scene(&mut scene, args, matches)?;
    if !scene.meshes.is_empty() {
        return meshes::run(global, args, scene, &targets, progress);
    }
    let volume =
        args::open(args::volume_of(&scene, &args.input)?, args.raw.choices.or(scene.reading), &args.input)?;
    let (mut volume, turn) = scene.frame.arrange(volume)?;
    let transfer = match &args.settings.transfer {
        Some(spec) => cao_formats::transfer::load(spec, volume.range()),
        None => scene.transfer(volume.range()),
    };
    let transfer = args::transfer(transfer, &mut volume, &args.input)?;
    let features = args.parts.of(std::mem::take(&mut scene.features), &volume, scene.frame)?;
    let mut setup = scene.occlusion.setup(volume.min_spacing())?;
    setup.occlusion.light = turn.ambient_light(&setup.occlusion.light);
    let look = turn.look(&scene.look);
    let image_space = scene.mesh_occlusion.map(|pixels| {
        let half = Vec3::from_array(volume.size_mm().map(|size| 0.5 * size as f32));
        (pixels, pixels.delta_mm((-half, half)))
    });
    if image_space.is_some() && args.method.is_some() {
        return Err(usage("--method: the scene's [mesh_occlusion] takes the place of a volume's methods"));
    }
    if image_space.is_some() || !look.shading.occluded() {
        if args.budget.given() {
            return Err(usage(
                "--budget-error, --budget-ms: they choose a volume's occlusion, and --shading or the scene shows none",
            ));
        }
        // What is not shown is not computed: without a neighbourhood nothing is occluded.
        setup.occlusion.radius_mm = 0.0;
    }
    let size = [scene.image.width, scene.image.height];
    let aspect = size[0] as f32 / size[1] as f32;
    let views = |rig: &StereoRig| {
        let reach = rig.position.length() + volume.size_mm().iter().map(|s| *s as f32).sum::<f32>();
        rig.views(aspect, reach * 1e-4, reach * 2.0)
    };
    // What is visible is known after the work, and impossible eyes before it.
    let unfitted = turn.rig(&scene.stereo.rig(turn.extent(volume.size_mm())));
    views(&unfitted)?;
    targets.spare_inputs()?;
    progress.stage("preparing");
    let gpu = open_gpu(global)?;
    let bands = match image_space {
        Some(_) => None,
        None => Some(Bands::new(&gpu, size, 2)?),
    };
    let mut renderer = Renderer::new(&gpu, &volume, transfer, setup, COLOUR)?;
    args.settings.give_network(&mut renderer)?;
    renderer.set_clips(&turn.clips(&scene.clips))?;
    renderer.set_features(features.clone())?;
    let planned = budget::plan(&mut renderer, &args.budget, &args.settings, args.method, &mut progress)?;
    progress.stage("occlusion");
    let mut timings = renderer.update(&mut |done| progress.set(done))?;
    progress.stage("drawing");
    let fitting = scene.stereo.fitting(aspect);
    let rig = fitting.map_or(Ok(None), |fitting| fitted(&renderer, &fitting, turn))?.unwrap_or(unfitted);
    let views = views(&rig)?;
    targets.write(|files| {
        let mut pictures = Pictures::begin(files, args, size, scene.image.background)?;
        if let Some(bands) = bands {
            timings.extend(renderer.draw_bands(&views, &look, bands, &mut |first, band| {
                files.go_on()?;
                pictures.add(band)?;
                progress.set(f64::from(first + band.size[1]) / f64::from(size[1]));
                anyhow::Ok(())
            })?);
        }
        if let Some(method) = image_space.and_then(|(pixels, delta_mm)| image_method(&pixels, delta_mm)) {
            // Its values depend on what else the picture shows: no bands.
            let (image, drawn) = PictureOcclusion::draw(&gpu, &renderer, &views, &look, size, &method)?;
            pictures.add(&image)?;
            timings.extend(drawn);
        }
        check_validation(&gpu)?;
        pictures.finish(files)
    })?;
    drop(progress);
    let mut out = Out::new(global);
    out.device(&gpu);
    out.volume(&args.input, &volume);
    out.features(&features);
    match &image_space {
        Some((pixels, delta_mm)) => out.pixels(pixels, *delta_mm),
        None => out.setup(renderer.setup(), &volume),
    }
    if let Some(planned) = &planned {
        planned.print(&mut out);
    }
    out.image(size);
    out.timings(&timings);
    out.memory(&gpu, &volume);
    for path in targets.paths() {
        out.wrote(path);
    }
    out.finish()?;
    Ok(ExitCode::SUCCESS)
}

/// The eyes that frame what is visible after an update, on the volume's axes; none where nothing is.
fn fitted(renderer: &Renderer, fitting: &Fitting, turn: Turn) -> Result<Option<StereoRig>> {
    let reach = |ways: &[Vec3]| {
        let ways: Vec<Vec3> = ways.iter().map(|way| turn.vector(*way)).collect();
        renderer.visible_extent(&ways)
    };
    let rig = fitting.rig(reach)?;
    if rig.is_none() {
        cao_cli::say(
            "warning: nothing is visible, so the volume's box is framed; other clips or another transfer function (--transfer) would show \
             something",
        );
    }
    Ok(rig.map(|rig| turn.rig(&rig)))
}

/// Flags win over the scene file; clips from flags are added to the scene's.
fn override_scene(scene: &mut Scene, args: &Render, matches: &ArgMatches) -> Result<()> {
    scene.frame = args.frame.unwrap_or(scene.frame);
    let s = &args.settings;
    let o = &mut scene.occlusion;
    // A rule that the scene's method does not have asks for another method.
    let method = args.method.unwrap_or(match s.quadrature {
        Some(rule) if !o.method.has(rule) => Method::for_rule(Some(rule)),
        _ => o.method,
    });
    if method != o.method {
        // What the scene left to its method is left to this one.
        if o.rays == o.method.rays() || !method.follows(o.rays) {
            o.rays = method.rays();
        }
        (o.method, o.quadrature, o.options) = (method, method.quadrature(), Options::DEFAULT);
    }
    o.rays = s.rays.unwrap_or(o.rays);
    o.quadrature = s.quadrature.unwrap_or(o.quadrature);
    o.radius_mm = s.radius_mm.or(o.radius_mm);
    o.offset_mm = s.offset_mm.or(o.offset_mm);
    o.step_mm = s.step_mm.or(o.step_mm);
    o.options = s.options(o.options)?;
    o.light = s.ambient_light.unwrap_or(o.light);
    scene.clips.extend(args::clips(matches)?);
    if let Some([width, height]) = args.size {
        (scene.image.width, scene.image.height) = (width, height);
    }
    let side = [args.azimuth, args.elevation, args.distance];
    if args.fit.is_some() || side.iter().any(Option::is_some) {
        let (mut fit, mut distance) = (Fit::default(), None);
        let (mut azimuth, mut elevation) = (Stereo::AZIMUTH_DEG, Stereo::ELEVATION_DEG);
        if let Viewpoint::Framing { fit: what, azimuth_deg, elevation_deg, distance_mm } =
            scene.stereo.viewpoint
        {
            (fit, azimuth, elevation, distance) = (what, azimuth_deg, elevation_deg, distance_mm);
        }
        scene.stereo.viewpoint = Viewpoint::Framing {
            fit: args.fit.unwrap_or(fit),
            azimuth_deg: args.azimuth.unwrap_or(azimuth),
            elevation_deg: args.elevation.unwrap_or(elevation),
            distance_mm: args.distance.or(distance),
        };
    }
    scene.stereo.ipd_mm = args.ipd.or(scene.stereo.ipd_mm);
    scene.look.shading = args.shading.unwrap_or(scene.look.shading);
    scene.look.light_from = args.light_from.unwrap_or(scene.look.light_from);
    scene.look.samples = args.samples.unwrap_or(scene.look.samples);
    scene.look.filter = args.filter.unwrap_or(scene.look.filter);
    Ok(())
}

/// The files, which grow from band to band.
pub struct Pictures {
    background: [f32; 3],
    /// Left and right, side by side.
    both: Option<GrowingPng>,
    /// Left, right.
    eyes: Vec<GrowingPng>,
}

impl Pictures {
    /// As the flags ask for, of this size.
    pub fn begin(
        files: &Outputs,
        args: &Render,
        [width, height]: [u32; 2],
        background: [f32; 3],
    ) -> Result<Self> {
        let begin = |path: &PathBuf, width| Ok(GrowingPng::new(files.open(path)?, width, height)?);
        Ok(Self {
            background,
            both: args.output.as_ref().map(|path| begin(path, 2 * width)).transpose()?,
            eyes: args.eyes.iter().map(|path| begin(path, width)).collect::<Result<_>>()?,
        })
    }

    /// The next rows.
    pub fn add(&mut self, band: &StereoImage) -> Result<()> {
        let [width, rows] = band.size;
        let eyes = band.colour.each_ref().map(|eye| Picture::over(width, rows, eye, self.background));
        if let Some(both) = &mut self.both {
            both.add(&Picture::beside(&eyes[0], &eyes[1]).pixels)?;
        }
        self.eyes.iter_mut().zip(&eyes).try_for_each(|(png, eye)| Ok(png.add(&eye.pixels)?))
    }

    /// Keeps them.
    pub fn finish(self, files: &mut Outputs) -> Result<()> {
        self.both.into_iter().chain(self.eyes).try_for_each(|png| Ok(files.keep(png.finish()?)?))
    }
}
