//! The kernel `near` against its twin: which bricks an edit concerns.

mod common;

use cao::cpu::carve::contact;
use cao::cpu::near::near;
use cao::cpu::{Grid, bricks::bricks};
use cao::gpu::BufferUse;
use cao::measure::random::Random;
use cao::stage::lao::Scope;
use cao::stage::near::{Bindings, FAR, Near};
use common::*;

#[test]
fn chosen_are_the_bricks_within_reach_of_a_change_that_need_values() {
    let gpu = open();
    let kernel = Near::new(&gpu).unwrap();
    let mut random = Random::new(81);
    let large = Grid { dims: [75, 50, 66], spacing: [1.0, 0.7, 1.6] };
    let (mut chosen, mut left) = (0, 0);
    for grid in GRIDS.iter().chain([&large]) {
        let field = blank(&gpu, grid);
        let all = bricks(grid).len();
        for turn in 0..12 {
            // A few voxels with opacity, a few changed bricks.
            let share = [1, 20, 600][turn % 3];
            let opacity: Vec<u16> = (0..grid.len()).map(|_| u16::from(random.below(1000) < share)).collect();
            let changed: Vec<bool> =
                (0..all).map(|_| random.below(100) < [2, 15, 0, 100][turn % 4]).collect();
            // Not at a multiple of the spacing, where rounding decides.
            let reach = random.between(0.0, 30.0) + 0.01;
            let scope = if turn % 5 == 4 { Scope::All } else { Scope::Needed };
            let bits = contact(grid, &opacity);
            let distance: Vec<u32> = changed.iter().map(|changed| if *changed { 0 } else { FAR }).collect();
            let change = buffer(&gpu, "change", bytemuck::cast_slice(&distance));
            let contact = buffer(&gpu, "contact", bytemuck::cast_slice(&bits));
            let other = gpu.buffer("other", change.bytes(), BufferUse::Device).unwrap();
            let todo = gpu.buffer("todo", change.bytes(), BufferUse::Device).unwrap();
            let count = gpu.buffer("count", 4, BufferUse::Device).unwrap();
            let b =
                Bindings { change: &change, other: &other, contact: &contact, todo: &todo, count: &count };
            run(&gpu, |rec| kernel.record(rec, &field, scope, reach, b).unwrap());

            let found: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &todo));
            let expected = near(grid, &opacity, &changed, f64::from(reach), scope == Scope::All);
            assert_eq!(found.iter().map(|f| *f == 1).collect::<Vec<_>>(), expected, "{grid:?} turn {turn}");
            let number = expected.iter().filter(|chosen| **chosen).count();
            assert_eq!(bytemuck::pod_read_unaligned::<u32>(&read_buffer(&gpu, &count)), number as u32);
            let after: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &change));
            assert_eq!(after, vec![FAR; all], "ready for the next edit");
            chosen += number;
            left += all - number;
        }
    }
    assert!(chosen > 500 && left > 500, "{chosen} {left}");
    drop(kernel);
    close(gpu);
}
