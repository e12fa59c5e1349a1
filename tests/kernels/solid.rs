//! The kernel `solid` against its twin.

use cao::clip::clips::ClipSet;
use cao::clip::solid::{Solid, Solids};
use cao::field::Field;
use cao_gpu::Access;
use cao_model::clip::{Clip, Pose, Shape};
use cao_model::settings::AntiAliasing;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::clip::clips::{ClipField, Dilation, Maps};
use cao_twin::clip::solid::solid;
use glam::Vec3;

/// Of a unorm texel of 16 bits.
const TEXEL: f32 = 1.0 / 65535.0;

#[test]
fn every_voxel_is_filled_as_the_twin_fills_it() {
    let gpu = open();
    let grid = Grid { dims: [19, 14, 11], spacing: [1.0, 1.3, 0.8] };
    let field = Field::upload(&gpu, &volume_of(&grid, vec![0.0; grid.len()])).unwrap();
    let at = |shape, x: f32, scale: f32| {
        let pose = Pose {
            translate_mm: Vec3::new(x, 0.5, -0.3),
            rotate_deg: Vec3::new(20.0, 40.0, 10.0),
            scale: Vec3::new(scale, 0.8 * scale, scale),
        };
        Clip { pose, ..Clip::remove(shape) }
    };
    let shapes = [at(Shape::Box, -4.0, 2.2), at(Shape::Torus, 4.0, 3.1), at(Shape::Cone, 0.0, 2.0)];
    let how = AntiAliasing::N32;
    let set = ClipSet::new(&gpu).unwrap();
    let (kernel, solids) = (Solid::new(&gpu).unwrap(), Solids::of(&gpu, &field, false).unwrap());
    run(&gpu, |rec| {
        set.record(rec, &shapes, 0.5 * size_mm(&grid).length()).unwrap();
        rec.discard(&solids.solid);
        rec.barrier(&[], &[Access::StorageWrite]);
        kernel.record(rec, &field, how, &set, &solids).unwrap();
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
    });
    let texels: Vec<u16> = bytemuck::pod_collect_to_vec(&read_image(&gpu, &solids.solid));
    let maps = Maps { layers: 1, resolution: 16, dilation: Dilation::Conservative(8), support: how.support };
    let fields: Vec<ClipField> =
        shapes.iter().map(|shape| ClipField::new(shape, &grid, 1.0, &maps).unwrap()).collect();
    let expected = solid(&grid, &fields, how);
    let (mut partly, mut whole) = (0, 0);
    for (texel, expected) in texels.iter().zip(&expected) {
        assert!((f32::from(*texel) * TEXEL - expected).abs() <= TEXEL, "{texel}, expected {expected}");
        partly += u32::from(*expected > 0.0 && *expected < 1.0);
        whole += u32::from(*expected == 1.0);
    }
    assert!(partly > 50 && whole > 20, "{partly} partly, {whole} wholly filled");
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &solids.bricks));
    for (brick, word) in words.iter().enumerate() {
        let bricks = [3, 2, 2];
        let of = [brick % bricks[0], brick / bricks[0] % bricks[1], brick / (bricks[0] * bricks[1])];
        let inside = |i: &usize| grid.voxel(*i).map(|c| c / 8) == of;
        let any = (0..grid.len()).filter(inside).any(|i| expected[i] > 0.0);
        assert_eq!(*word == 1, any, "brick {of:?}");
    }
    drop((field, set, solids, kernel));
    close(gpu);
}
