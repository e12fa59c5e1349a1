//! Solids in a volume's opacity: an edit like any other, exact and contextual, whatever the method; not drawn.

use cao::renderer::{COLOUR, Renderer};
use cao_gpu::Gpu;
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Mode, Pose, Shape};
use cao_model::look::{Look, Shading};
use cao_model::methods::Method;
use cao_model::settings::Setup;
use cao_model::transfer::TransferFunction;
use cao_model::volume::Volume;
use cao_testing::*;
use glam::Vec3;

fn skeleton() -> Volume {
    builtin_box("skeleton", [40, 36, 34], [1.0, 1.0, 1.2]).unwrap()
}

fn renderer(gpu: &Gpu, volume: &Volume, method: Method, radius_mm: f32) -> Renderer {
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let mut setup = Setup::of(method, volume.min_spacing());
    setup.occlusion.radius_mm = radius_mm;
    renderer_of(gpu, volume, transfer, setup, COLOUR).unwrap()
}

fn at(shape: Shape, x: f32, scale: f32) -> Clip {
    let pose = Pose {
        translate_mm: Vec3::new(x, -3.0, 2.0),
        rotate_deg: Vec3::new(0.0, 30.0, 0.0),
        scale: Vec3::splat(scale),
    };
    Clip { pose, ..Clip::remove(shape) }
}

#[test]
fn every_method_takes_them_in_exactly_or_refuses_them() {
    let gpu = open();
    let volume = skeleton();
    let ball = at(Shape::Sphere, 4.0, 6.0);
    for method in methods() {
        let mut renderer = renderer(&gpu, &volume, method, 5.0);
        renderer.set_clips(&[at(Shape::Box, -9.0, 7.0)]).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        let without = (renderer.read_opacity().unwrap(), renderer.read_ambient().unwrap());
        if matches!(method, Method::Lao | Method::Cao) {
            let error = renderer.set_solids(std::slice::from_ref(&ball), false).unwrap_err().to_string();
            assert!(error.contains("choose rays or another"), "{error}");
            continue;
        }
        let mesh = at(Shape::Mesh(convex()), 7.0, 5.0);
        for solids in [vec![ball.clone()], vec![mesh.clone(), ball.clone()]] {
            renderer.set_solids(&solids, false).unwrap();
            renderer.update(&mut |_| ()).unwrap();
            let (found, _) = cao::verify::verify(&renderer, &mut |_| ()).unwrap();
            assert_eq!(found.different, 0, "{}: {found:?}", method.name());
            let mut fresh = self::renderer(&gpu, &volume, method, 5.0);
            fresh.set_clips(&[at(Shape::Box, -9.0, 7.0)]).unwrap();
            fresh.set_solids(&solids, false).unwrap();
            fresh.update(&mut |_| ()).unwrap();
            assert_eq!(renderer.read_opacity().unwrap(), fresh.read_opacity().unwrap(), "{}", method.name());
            assert_eq!(renderer.read_ambient().unwrap(), fresh.read_ambient().unwrap(), "{}", method.name());
        }
        let opacity = renderer.read_opacity().unwrap();
        assert!(opacity.iter().zip(&without.0).all(|(with, without)| with >= without));
        assert!(opacity.iter().filter(|opacity| **opacity == 1.0).count() > 300);
        renderer.set_solids(&[], false).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        assert_eq!(renderer.read_opacity().unwrap(), without.0, "{}", method.name());
        assert_eq!(renderer.read_ambient().unwrap(), without.1, "{}", method.name());
    }
    close(gpu);
}

#[test]
fn what_moves_is_computed_and_nothing_else_and_none_of_it_is_drawn() {
    let gpu = open();
    let volume = skeleton();
    let mut renderer = renderer(&gpu, &volume, Method::default(), 5.0);
    let look = Look { shading: Shading::None, ..Look::default() };
    let views = eyes(&volume, 30.0);
    renderer.update(&mut |_| ()).unwrap();
    let (before, _) = renderer.draw(&views, &look, [40, 40]).unwrap();
    renderer.set_solids(&[at(Shape::Sphere, 6.0, 4.0)], false).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let (after, _) = renderer.draw(&views, &look, [40, 40]).unwrap();
    assert!(before.colour == after.colour, "a solid is drawn");
    // Of the occlusion that it is there for something is to be seen.
    let lit = |renderer: &Renderer| renderer.draw(&views, &Look::default(), [40, 40]).unwrap().0.colour;
    let with = lit(&renderer);
    renderer.set_solids(&[at(Shape::Sphere, 6.2, 4.0)], false).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let counted = renderer.categories().unwrap();
    assert!(counted.affected > 0 && counted.untouched > counted.affected / 2, "{counted:?}");
    renderer.set_solids(&[], false).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    assert!(with != lit(&renderer), "nothing is darker");
    // A clip cuts it, unless it is spared.
    let count = |renderer: &Renderer| {
        renderer.read_opacity().unwrap().iter().filter(|opacity| **opacity == 1.0).count()
    };
    renderer.set_clips(&[at(Shape::Sphere, 6.0, 9.0)]).unwrap();
    for (spared, least, most) in [(false, 0, 0), (true, 100, 1000)] {
        renderer.set_solids(&[at(Shape::Sphere, 6.0, 4.0)], spared).unwrap();
        renderer.update(&mut |_| ()).unwrap();
        let found = count(&renderer);
        assert!((least..=most).contains(&found), "{found} voxels, spared: {spared}");
    }
    // Other methods wait until it is gone; a side that keeps has no inside.
    let setup = Setup::of(Method::Cao, volume.min_spacing());
    assert!(renderer.set_setup(setup).unwrap_err().to_string().contains("take the solids away"));
    let keep = Clip { mode: Mode::Keep, ..at(Shape::Sphere, 6.0, 4.0) };
    assert!(renderer.set_solids(&[keep], true).is_err());
    renderer.update(&mut |_| ()).unwrap();
    assert_eq!(renderer.setup().method, Method::default());
    drop(renderer);
    close(gpu);
}
