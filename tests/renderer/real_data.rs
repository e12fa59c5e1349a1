//! Real volumes, with their noise, odd sizes, anisotropic spacing and stored types: updates stay exact, pictures hold numbers.
//!
//! `CAO_DATA` names a folder with `volumes/NAME_XxYxZ_TYPE.EXT` files; without it, or without a volume, a test says that it was
//! skipped.

use cao::renderer::{COLOUR, Renderer};
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::look::Look;
use cao_model::methods::Method;
use cao_model::occlusion::{Occlusion, RaySet};
use cao_model::settings::Scope;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::view::StereoRig;

use glam::Vec3;
use std::path::{Path, PathBuf};

/// The header of the volume of this name, if the environment leads to one.
fn find(name: &str) -> Option<PathBuf> {
    let Some(data) = std::env::var_os("CAO_DATA").filter(|data| !data.is_empty()) else {
        eprintln!("skipped: set CAO_DATA=FOLDER, with FOLDER/volumes/{name}_XxYxZ_TYPE.nrrd in it");
        return None;
    };
    let folder = Path::new(&data).join("volumes");
    let files = std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let fits = |path: &PathBuf| {
        let stem = path.file_stem().and_then(|stem| stem.to_str());
        // NAME may hold underscores itself: what follows it are two parts.
        let named = stem.and_then(|stem| stem.rsplitn(3, '_').nth(2)) == Some(name);
        named
            && path.extension().is_some_and(|e| ["nrrd", "nhdr", "mha", "mhd", "nii"].iter().any(|k| e == *k))
    };
    let found = files.map(|file| file.unwrap().path()).find(fits);
    if found.is_none() {
        eprintln!("skipped: {} holds no {name}_XxYxZ_TYPE.nrrd", folder.display());
    }
    found
}

fn exact_and_visible(name: &str, preset: &str) {
    let Some(path) = find(name) else { return };
    let volume = cao_formats::read(&path).unwrap();
    let transfer = TransferFunction::preset(preset, volume.range()).unwrap();
    let gpu = cao_testing::open();
    // Short rays and few of them: the software driver works on millions of voxels.
    let radius_mm = 4.0f32.max(2.0 * volume.min_spacing() as f32);
    let paper = Setup::of(Method::Cao, volume.min_spacing());
    let setup = Setup {
        occlusion: Occlusion { rays: RaySet::R6, radius_mm, ..paper.occlusion },
        scope: Scope::Needed,
        ..paper
    };
    let mut renderer = Renderer::new(&gpu, &volume, transfer, setup, COLOUR).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let shortest = volume.size_mm().into_iter().fold(f64::INFINITY, f64::min) as f32;
    let pose = Pose { scale: Vec3::splat(0.3 * shortest), ..Pose::default() };
    renderer.set_clips(&[Clip { shape: Shape::Sphere, mode: Mode::Remove, pose }]).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let found = renderer.categories().unwrap();
    assert!(found.clipped > 0 && found.affected > 0 && found.untouched > 0, "{found:?}");

    let (difference, _) = cao::verify::verify(&renderer, &mut |_| ()).unwrap();
    assert_eq!(difference.different, 0, "{difference:?}");
    assert!(difference.compared > 0, "{difference:?}");

    let rig = StereoRig::framing(volume.size_mm(), 30.0, 25.0);
    let far = 4.0 * rig.position.length();
    let views = rig.views(1.0, 1e-4 * far, far).unwrap();
    let (image, _) = renderer.draw(&views, &Look::default(), [64, 64]).unwrap();
    for (eye, (colour, depth)) in image.colour.iter().zip(&image.depth).enumerate() {
        assert!(colour.iter().flatten().chain(depth).all(|v| v.is_finite()), "eye {eye}");
        assert!(colour.iter().any(|pixel| pixel[3] > 0.5), "eye {eye} sees nothing");
    }
    eprintln!("{name}: {} voxels compared", difference.compared);
    drop(renderer);
    cao_testing::close(gpu);
}

#[test]
fn engine_is_exact_and_visible() {
    exact_and_visible("engine", "auto");
}

#[test]
fn vhm_head_is_exact_and_visible() {
    exact_and_visible("vhm_head", "ct-bone");
}

#[test]
fn torso_is_exact_and_visible() {
    exact_and_visible("torso_s0024", "auto");
}

#[test]
fn cranium_is_exact_and_visible() {
    exact_and_visible("cranium", "ct-bone");
}

#[test]
fn stent_is_exact_and_visible() {
    exact_and_visible("stent", "auto");
}
