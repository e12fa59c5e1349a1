//! The kernel `light` against its twin, alone and behind a picture.

use cao::draw::picture::Picture;
use cao::field::volume_of;
use cao::mesh::light::{Light, Lit, VolumeShade};
use cao_gpu::{Access, Format, Gpu};
use cao_model::clip::{Clip, Pose, Shape};
use cao_model::look::{Look, Occluded};
use cao_model::surface::World;
use cao_model::view::View;
use cao_testing::worlds::{Pixels, corner, corner_eyes, layers, solids, solids_eyes};
use cao_testing::{close, open, run, write_image};
use cao_twin::mesh::gbuffer::gbuffer;
use cao_twin::mesh::light::lit;
use glam::{DVec3, Vec3};

const SIZE: [u32; 2] = [45, 35];

/// Largest difference of a colour: normals of 16 bits and weights of 16 bits, times a highlight's exponent.
const ERROR: f64 = 3e-3;
/// Share of pixels beyond it: other triangles at edges, and textures that change within a weight's rounding.
const OTHER: f64 = 0.01;

#[test]
fn pictures_are_lit_as_the_twin_lights_them() {
    let gpu = open();
    compared(&gpu, &corner(), &[], &corner_eyes(SIZE));
    let plane =
        Pose { translate_mm: Vec3::Z * 5.0, rotate_deg: Vec3::new(60.0, 15.0, 0.0), ..Pose::default() };
    let cut = [Clip { pose: plane, ..Clip::remove(Shape::Plane) }];
    compared(&gpu, &solids(), &cut, &solids_eyes(Vec3::new(50.0, -95.0, 60.0), SIZE));
    close(gpu);
}

fn compared(gpu: &Gpu, world: &World, clips: &[Clip], views: &[View]) {
    let pixels = Pixels::clipped(gpu, world, clips, views, SIZE);
    let (light, picture) = (Light::new(gpu).unwrap(), Picture::new(gpu, SIZE, 2).unwrap());
    let count = (2 * SIZE[0] * SIZE[1]) as usize;
    // Another accessibility at each pixel.
    let open_at = |i: usize| (i % 17) as f32 / 16.0;
    let values: Vec<f32> = (0..count).map(open_at).collect();
    let accessibility =
        cao::host::device_buffer(gpu, "accessibility", bytemuck::cast_slice(&values)).unwrap();
    let scene = Lit {
        surfaces: &pixels.surfaces,
        geometry: &pixels.geometry,
        hits: &pixels.hits,
        accessibility: &accessibility,
    };
    // A volume around half of the room, of factors from 0 to 1 along x.
    let dims = [8, 4, 4];
    let factor = |x: usize| x as f32 / 7.0;
    let texels: Vec<f32> = (0..128).map(|i| factor(i % 8)).collect();
    let ambient = volume_of(gpu, "ambient", dims, Format::R32Float).unwrap();
    write_image(gpu, &ambient, bytemuck::cast_slice(&texels));
    let shade = VolumeShade { ambient: &ambient, coloured: false, spacing: [20.0, 50.0, 50.0], open: 0.8 };
    for occluded in [Occluded::Ambient, Occluded::All] {
        let look = Look { occluded, two_sided: true, ..Look::default() };
        run(gpu, |rec| {
            rec.discard(&picture.colour);
            rec.discard(&picture.depth);
            rec.barrier(&[Access::TransferWrite], &[Access::StorageRead]);
            light.record(rec, scene, views, &look, &picture, None).unwrap();
        });
        let (colours, depths) = (layers(gpu, &picture.colour), layers(gpu, &picture.depth));
        // Laid over what is there, which covers three quarters.
        run(gpu, |rec| {
            rec.barrier(&[Access::TransferRead], &[Access::TransferWrite]);
            rec.clear_image(&picture.colour, [0.1, 0.2, 0.3, 0.75]).unwrap();
            rec.barrier(&[Access::TransferWrite], &[Access::StorageRead, Access::StorageWrite]);
            light.record(rec, scene, views, &look, &picture, Some(shade)).unwrap();
        });
        let over = layers(gpu, &picture.colour);
        let towards = look.towards_light(views[0].orientation).as_dvec3();
        let mut other = 0;
        for (view, eye) in views.iter().enumerate() {
            for (i, shown) in gbuffer(world, clips, eye, SIZE).iter().enumerate() {
                let at = view * count / 2 + i;
                let (alone, behind) = (&colours[4 * at..4 * at + 4], &over[4 * at..4 * at + 4]);
                let Some(shown) = shown else {
                    assert_eq!((alone, behind), (&[0.0; 4][..], &[0.1, 0.2, 0.3, 0.75][..]));
                    assert_eq!(depths[at], 1.0);
                    continue;
                };
                let position = eye.position.as_dvec3();
                let open = f64::from(open_at(at));
                let expected = lit(world, shown, open, &look, towards, position);
                let air = shown.place + 20.0 * shown.normal;
                let inside = (air / DVec3::new(80.0, 100.0, 100.0)).abs().max_element() <= 1.0;
                let factor = if inside { ((air.x / 20.0 + 3.5) / 7.0 / 0.8).clamp(0.0, 1.0) } else { 1.0 };
                let shaded = lit(world, shown, open * factor, &look, towards, position);
                let [a, b] = eye.depth_terms().map(f64::from);
                let wrong = |found: f32, expected: f64| (f64::from(found) - expected).abs() > ERROR;
                let front = [0.1, 0.2, 0.3];
                let any = (0..3)
                    .any(|k| wrong(alone[k], expected[k]) || wrong(behind[k], front[k] + 0.25 * shaded[k]));
                other += u32::from(any || wrong(depths[at], a + b / shown.hit.t));
                assert_eq!((alone[3], behind[3]), (1.0, 1.0));
            }
        }
        assert!(f64::from(other) < OTHER * count as f64, "{occluded:?}: {other} of {count}");
    }
}
