//! Pictures of meshes: what holds for every method whose values belong to pixels, and meshes together with a volume.

use cao::draw::picture::Picture;
use cao::mesh_renderer::MeshRenderer;
use cao::renderer::{COLOUR, Renderer};
use cao_gpu::Access;
use cao_model::builtin::builtin_box;
use cao_model::clip::{Clip, Pose, Shape};
use cao_model::look::{Look, Shading};
use cao_model::mesh::TriangleMesh;
use cao_model::pixel_occlusion::{PIXEL_METHODS, PixelMethod, PixelOcclusion};
use cao_model::settings::Setup;
use cao_model::surface::{Material, World};
use cao_model::transfer::TransferFunction;
use cao_testing::worlds::{clips, corner, corner_eyes, sheet, solid, solids_eyes, world_of};
use cao_testing::*;
use glam::Vec3;

/// No multiple of a workgroup, nor of a block.
const SIZE: [u32; 2] = [77, 59];

/// Every method as its entry has it, with fewer rays, and at every distance of pixels; of volumes those whose corners are clamped, too.
fn settings() -> Vec<PixelOcclusion> {
    let of = |entry: &cao_model::pixel_occlusion::PixelEntry| {
        let usual = PixelOcclusion { delta_mm: Some(30.0), ..PixelOcclusion::of(entry.method) };
        let rays = usual.rays.min(20);
        let clamped = entry.volumes.then_some(PixelOcclusion { clamp: true, ..usual });
        let sparse = entry.sparse.iter().map(move |&sparse| PixelOcclusion { sparse, rays, ..usual });
        sparse.chain(clamped).collect::<Vec<_>>()
    };
    PIXEL_METHODS.iter().flat_map(of).collect()
}

#[test]
fn every_method_gives_pixels_their_light_however_it_is_recorded() {
    let gpu = open();
    let (world, views, look) = (corner(), corner_eyes(SIZE), Look::default());
    let mut all: Vec<Vec<f32>> = Vec::new();
    for occlusion in settings() {
        let mut renderer = MeshRenderer::new(&gpu, &world, occlusion).unwrap();
        let (image, timings) = renderer.draw(&views, &look, SIZE, None, &mut |_| ()).unwrap();
        let values = renderer.accessibility().unwrap();
        assert!(timings.total() > 0.0);
        assert!(values.iter().all(|value| (0.0..=1.0).contains(value)), "{occlusion:?}");
        let dark = values.iter().filter(|value| **value < 0.95).count();
        assert!(dark > 100, "{occlusion:?}: {dark} dark pixels");
        for (eye, colours) in image.colour.iter().enumerate() {
            let values = &values[eye * colours.len()..][..colours.len()];
            for (colour, value) in colours.iter().zip(values) {
                assert!(colour.iter().all(|part| part.is_finite()));
                assert!(colour[3] == 1.0 || (*colour == [0.0; 4] && *value == 1.0), "{occlusion:?}");
            }
        }
        // Another size between, and all parts into one recording, as a host does.
        renderer.draw(&views, &look, [16, 16], None, &mut |_| ()).unwrap();
        renderer.prepare(SIZE, 2).unwrap();
        let picture = Picture::new(&gpu, SIZE, 2).unwrap();
        run(&gpu, |rec| {
            renderer.record_geometry(rec, &views).unwrap();
            for part in 0..renderer.occlusion_parts().unwrap() {
                renderer.record_occlusion(rec, part).unwrap();
            }
            renderer.record_picture(rec, &views, &look, None, &picture).unwrap();
        });
        assert_eq!(renderer.accessibility().unwrap(), values, "{occlusion:?}");
        all.push(values);
        drop((renderer, picture));
    }
    let same = (1..all.len()).any(|i| all[..i].contains(&all[i]));
    assert!(!same, "two settings give the same");
    close(gpu);
}

#[test]
fn a_volume_is_in_front_of_meshes_and_behind_them() {
    let gpu = open();
    let volume = builtin_box("engine", [32, 28, 30], [1.0; 3]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let mut renderer =
        Renderer::new(&gpu, &volume, transfer, Setup::new(volume.min_spacing()), COLOUR).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let views = eyes(&volume, 30.0);
    // One in front of the volume's left half, one through the middle of the right.
    let half = |x: f32, y: f32| {
        sheet(Vec3::new(x, y, -40.0), Vec3::X * 40.0, Vec3::Z * 80.0, 1, Material::default())
    };
    let world = world_of(vec![half(-40.0, -16.0), half(0.0, 0.0)]);
    let mut meshes = MeshRenderer::new(&gpu, &world, PixelOcclusion::default()).unwrap();
    let look = Look { shading: Shading::None, ..Look::default() };
    let (volume_alone, _) = renderer.draw(&views, &look, SIZE).unwrap();
    let (mesh_alone, _) = meshes.draw(&views, &look, SIZE, None, &mut |_| ()).unwrap();
    let (both, _) = meshes.draw(&views, &look, SIZE, Some(&renderer), &mut |_| ()).unwrap();
    let (mut in_front, mut behind) = (0, 0);
    for eye in 0..2 {
        for i in 0..both.depth[eye].len() {
            let at = |image: &cao::renderer::StereoImage| (image.colour[eye][i], image.depth[eye][i]);
            let ((volume, near), (mesh, far), (both, depth)) =
                (at(&volume_alone), at(&mesh_alone), at(&both));
            if volume[3] == 0.0 {
                // Nothing of the volume is there at all.
                assert_eq!((both, depth), (mesh, far));
                continue;
            }
            if volume[3] > 0.999 && near < far - 3e-4 {
                let off = (0..3).map(|k| (both[k] - volume[k]).abs()).fold(0.0, f32::max);
                assert!(off < 2e-3 && depth == near, "{off}");
                in_front += 1;
            } else if volume[3] > 0.999 && far < near - 1e-4 {
                behind += u32::from(both == mesh);
            }
        }
    }
    assert!(in_front > 100 && behind > 50, "{in_front} in front, {behind} behind");
    // The volume darkens the plane, where light is occluded.
    let look = Look::default();
    let (lit_alone, _) = meshes.draw(&views, &look, SIZE, None, &mut |_| ()).unwrap();
    let (lit, _) = meshes.draw(&views, &look, SIZE, Some(&renderer), &mut |_| ()).unwrap();
    let darker = (0..both.depth[0].len())
        .filter(|&i| mesh_alone.colour[0][i] == both.colour[0][i] && both.colour[0][i][3] == 1.0)
        .filter(|&i| lit.colour[0][i][0] < 0.95 * lit_alone.colour[0][i][0]);
    assert!(darker.count() > 30);
    drop((renderer, meshes));
    close(gpu);
}

/// A plane cuts a volume and a ball in it: nothing of the volume is in front of the ball's cap, and nothing behind it shows.
#[test]
fn volumes_end_at_caps() {
    let gpu = open();
    let volume = builtin_box("engine", [32, 28, 30], [1.0; 3]).unwrap();
    let transfer = TransferFunction::preset("auto", volume.range()).unwrap();
    let mut renderer =
        Renderer::new(&gpu, &volume, transfer, Setup::new(volume.min_spacing()), COLOUR).unwrap();
    let front = Pose { translate_mm: Vec3::Y * -1.0, rotate_deg: Vec3::X * 90.0, ..Pose::default() };
    let cut = [Clip { pose: front, ..Clip::remove(Shape::Plane) }];
    renderer.set_clips(&cut).unwrap();
    renderer.update(&mut |_| ()).unwrap();
    let views = eyes(&volume, 30.0);
    let look = Look { shading: Shading::None, ..Look::default() };
    let mut ball = solid(&TriangleMesh::sphere(3), [0.9, 0.1, 0.1]);
    ball.positions.iter_mut().for_each(|position| *position *= 9.0);
    let mut meshes = MeshRenderer::new(&gpu, &world_of(vec![ball]), PixelOcclusion::default()).unwrap();
    let mut draw = |clips: &[Clip]| {
        meshes.set_clips(clips).unwrap();
        let alone = meshes.draw(&views, &look, SIZE, None, &mut |_| ()).unwrap().0;
        (alone, meshes.draw(&views, &look, SIZE, Some(&renderer), &mut |_| ()).unwrap().0)
    };
    let (_, whole) = draw(&[]);
    let (alone, both) = draw(&cut);
    let (volume_alone, _) = renderer.draw(&views, &look, SIZE).unwrap();
    let (mut on_cap, mut in_volume) = (0, 0);
    for eye in 0..2 {
        for i in 0..both.depth[eye].len() {
            let [r, g, _, a] = alone.colour[eye][i];
            if a == 1.0 && r > 2.0 * g {
                let off = (0..3).map(|k| (both.colour[eye][i][k] - alone.colour[eye][i][k]).abs());
                assert!(off.fold(0.0, f32::max) < 2e-3 && both.depth[eye][i] == alone.depth[eye][i]);
                on_cap += 1;
                in_volume += u32::from(volume_alone.colour[eye][i][3] > 0.5);
            }
        }
    }
    assert!(
        on_cap > 300 && in_volume > 100,
        "{on_cap} pixels on the cap, {in_volume} of them in front of the volume"
    );
    assert!(whole.colour != both.colour);
    drop((renderer, meshes));
    close(gpu);
}

/// A bowl, half a ball of 15 mm taken out of a block: to rays its cap occludes itself; to occlusion volumes, which are of triangles, it does not.
#[test]
fn caps_occlude_rays_and_no_volumes() {
    let gpu = open();
    let mut block = solid(&TriangleMesh::cuboid(), [0.9, 0.1, 0.1]);
    block.positions.iter_mut().for_each(|position| *position *= 20.0);
    let world = world_of(vec![block]);
    let bowl = Pose { translate_mm: Vec3::Z * 20.0, scale: Vec3::splat(15.0), ..Pose::default() };
    let views = solids_eyes(Vec3::new(10.0, -30.0, 90.0), SIZE);
    let open_at = |method: PixelMethod| {
        let delta = if method == PixelMethod::Aov { 18.0 } else { 30.0 };
        let occlusion = PixelOcclusion { delta_mm: Some(delta), ..PixelOcclusion::of(method) };
        let mut renderer = MeshRenderer::new(&gpu, &world, occlusion).unwrap();
        renderer.set_clips(&[Clip { pose: bowl, ..Clip::remove(Shape::Sphere) }]).unwrap();
        renderer.draw(&views, &Look::default(), SIZE, None, &mut |_| ()).unwrap();
        let values = renderer.accessibility().unwrap();
        let unlit = Look { shading: Shading::None, ..Look::default() };
        let image = renderer.draw(&views, &unlit, SIZE, None, &mut |_| ()).unwrap().0;
        let colours = image.colour.concat();
        let on_cap = |i: &usize| {
            let [r, g, ..] = colours[*i];
            r > 2.0 * g
        };
        let pixels: Vec<usize> = (0..values.len()).filter(on_cap).collect();
        assert!(pixels.len() > 500, "{} pixels on caps", pixels.len());
        pixels.iter().map(|i| f64::from(values[*i])).sum::<f64>() / pixels.len() as f64
    };
    let (rays, volumes) = (open_at(PixelMethod::Rays), open_at(PixelMethod::Aov));
    assert!((0.5..0.8).contains(&rays) && volumes > 0.95, "{rays} by rays, {volumes} by volumes");
    close(gpu);
}

#[test]
fn what_is_impossible_is_refused_and_clips_stay() {
    let gpu = open();
    let (world, views, look) = (corner(), corner_eyes(SIZE), Look::default());
    assert!(MeshRenderer::new(&gpu, &World::default(), PixelOcclusion::default()).is_err());
    let mut renderer = MeshRenderer::new(&gpu, &world, PixelOcclusion::default()).unwrap();
    let mut rec = gpu.recorder("unprepared").unwrap();
    let error = renderer.record_geometry(&mut rec, &views).unwrap_err().to_string();
    assert!(error.contains("call prepare first"), "{error}");
    drop(rec);
    renderer.set_clips(&clips()).unwrap();
    let draw = |renderer: &mut MeshRenderer| renderer.draw(&views, &look, SIZE, None, &mut |_| ()).unwrap().0;
    let cut = draw(&mut renderer);
    assert!(renderer.set_clips(&vec![Clip::remove(Shape::Box); 9]).is_err());
    assert_eq!(draw(&mut renderer).colour, cut.colour);
    renderer.set_clips(&[]).unwrap();
    let whole = draw(&mut renderer);
    assert_ne!(whole.colour, cut.colour);
    let mut fresh = MeshRenderer::new(&gpu, &world, PixelOcclusion::default()).unwrap();
    assert_eq!(draw(&mut fresh).colour, whole.colour);
    assert!(renderer.prepare([0, 5], 2).is_err() && renderer.prepare([5, 5], 5).is_err());
    // After a refusal it draws on.
    renderer.prepare(SIZE, 2).unwrap();
    let picture = Picture::new(&gpu, [8, 8], 2).unwrap();
    run(&gpu, |rec| {
        renderer.record_geometry(rec, &views).unwrap();
        rec.barrier(&[Access::StorageWrite], &[Access::StorageRead]);
        assert!(renderer.record_picture(rec, &views, &look, None, &picture).is_err());
    });
    drop((renderer, fresh, picture));
    close(gpu);
}
