//! The kernel `near` against its twin: which bricks an edit concerns.

use cao::field::bricks::BrickList;
use cao::field::near::{Bindings, FAR, Near, Reach, TODO, VALUED};
use cao_gpu::BufferUse;
use cao_measure::random::Random;
use cao_model::settings::Scope;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::clip::carve::contact;
use cao_twin::field::bricks::bricks;
use cao_twin::field::near::{Reach as TwinReach, near};

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
        for turn in 0..20 {
            // A few voxels with opacity, a few changed bricks.
            let share = [1, 20, 600][turn % 3];
            let opacity: Vec<u16> = (0..grid.len()).map(|_| u16::from(random.below(1000) < share)).collect();
            let changed: Vec<bool> =
                (0..all).map(|_| random.below(100) < [2, 15, 0, 100][turn % 4]).collect();
            // Not at a multiple of the spacing, where rounding decides.
            let mm = random.between(0.0, 30.0) + 0.01;
            let voxels = [(); 3].map(|()| random.below(27) as u32);
            let (reach, twin_reach) = match turn % 2 {
                0 => (Reach::Ball(mm), TwinReach::Ball(f64::from(mm))),
                _ => (Reach::Box(voxels), TwinReach::Box(voxels.map(|v| v as usize))),
            };
            let scope = if turn % 5 == 4 { Scope::All } else { Scope::Needed };
            let bits = contact(grid, &opacity);
            let distance: Vec<u32> = changed.iter().map(|changed| if *changed { 0 } else { FAR }).collect();
            let change = buffer(&gpu, "change", bytemuck::cast_slice(&distance));
            let contact = buffer(&gpu, "contact", bytemuck::cast_slice(&bits));
            let other = gpu.buffer("other", change.bytes(), BufferUse::Device).unwrap();
            // Whatever was to do before.
            let valued: Vec<bool> = (0..all).map(|_| random.below(3) == 0).collect();
            let before: Vec<u32> = valued.iter().map(|valued| if *valued { !0 } else { !VALUED }).collect();
            let todo = buffer(&gpu, "todo", bytemuck::cast_slice(&before));
            let list = BrickList::new(&gpu, &field).unwrap();
            let b = Bindings { change: &change, other: &other, contact: &contact, todo: &todo, list: &list };
            run(&gpu, |rec| kernel.record(rec, &field, scope, reach, b).unwrap());

            let found: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &todo));
            let expected = near(grid, &opacity, &changed, &valued, twin_reach, scope == Scope::All);
            let word = |[to_do, valued]: [bool; 2]| u32::from(to_do) * TODO + u32::from(valued) * VALUED;
            let words: Vec<u32> = expected.iter().copied().map(word).collect();
            assert_eq!(found, words, "{grid:?} turn {turn} {reach:?}");
            // Each once, in any order, and one group for each.
            let mut listed: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &list.buffer));
            let number = expected.iter().filter(|brick| brick[0]).count();
            assert_eq!(listed[..4], [number as u32, u32::from(number > 0), 1, number as u32]);
            listed[4..4 + number].sort_unstable();
            let places: Vec<u32> = (0..all as u32).filter(|&i| expected[i as usize][0]).collect();
            assert_eq!(listed[4..4 + number], places, "{grid:?} turn {turn}");
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
