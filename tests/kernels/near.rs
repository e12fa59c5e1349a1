//! The kernel `near` against its twin: which bricks an edit concerns.

use cao::sweep::near::{ANEW, Bindings, CHANGED, Chosen, FAR, Near, TODO};
use cao::sweep::past::PastBricks;
use cao_gpu::BufferUse;
use cao_measure::random::Random;
use cao_model::settings::Scope;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::field::bricks::bricks;
use cao_twin::sweep::carve::contact;
use cao_twin::sweep::near::near;

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
            // As carve leaves it: octants that changed, of the changed bricks.
            let octants: Vec<u32> =
                changed.iter().map(|c| u32::from(*c) * (1 + random.below(255) as u32)).collect();
            let words: Vec<u32> = octants.iter().map(|o| o * CHANGED).collect();
            let todo = buffer(&gpu, "todo", bytemuck::cast_slice(&words));
            let had: Vec<u32> = (0..all).map(|_| u32::from(random.below(100) < 70)).collect();
            let valued = buffer(&gpu, "valued", bytemuck::cast_slice(&had));
            let past = PastBricks::new(&gpu, &field).unwrap();
            let listed = [changed.iter().filter(|c| **c).count() as u32, past.capacity + 1][turn % 6 / 5];
            run(&gpu, |rec| rec.update(&past.list.buffer, 12, &listed.to_le_bytes()).unwrap());
            let count = gpu.buffer("count", size_of::<Chosen>() as u64, BufferUse::Device).unwrap();
            let solid = gpu.buffer("solid", change.bytes(), BufferUse::Device).unwrap();
            let b = Bindings {
                change: &change,
                other: &other,
                contact: &contact,
                todo: &todo,
                chosen: &count,
                solid: &solid,
                valued: &valued,
                past: &past,
            };
            let forced = turn % 7 == 6;
            run(&gpu, |rec| kernel.record(rec, &field, scope, reach, forced, b).unwrap());

            let found: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &todo));
            let expected = near(grid, &opacity, &changed, f64::from(reach), scope == Scope::All);
            let anew = |i: usize| forced || had[i] == 0 || listed > past.capacity;
            let word = |i: usize| words[i] | if expected[i] { TODO | (u32::from(anew(i)) * ANEW) } else { 0 };
            assert_eq!(found, (0..all).map(word).collect::<Vec<_>>(), "{grid:?} turn {turn}");
            let number = expected.iter().filter(|chosen| **chosen).count();
            let summary: Chosen = bytemuck::pod_read_unaligned(&read_buffer(&gpu, &count));
            assert_eq!(summary.bricks, number as u32);
            let places = bricks(grid);
            let bounds = |which: &dyn Fn(usize) -> bool| {
                let mut bounds = ([u32::MAX; 3], [0; 3]);
                for place in (0..all).filter(|&i| which(i)).map(|i| places.voxel(i).map(|c| c as u32)) {
                    bounds.0 = std::array::from_fn(|axis| place[axis].min(bounds.0[axis]));
                    bounds.1 = std::array::from_fn(|axis| place[axis].max(bounds.1[axis]));
                }
                bounds
            };
            for (at, (low, high)) in [(0, bounds(&|i| found[i] & ANEW != 0)), (3, bounds(&|i| changed[i]))] {
                assert_eq!((&summary.low[at..at + 3], &summary.high[at..at + 3]), (&low[..], &high[..]));
            }
            let found: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &solid));
            assert_eq!(found, cao_twin::sweep::near::solid(grid, &opacity), "{grid:?} turn {turn}");
            let has: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &valued));
            let needed = near(grid, &opacity, &vec![true; all], f64::INFINITY, scope == Scope::All);
            assert_eq!(has, needed.into_iter().map(u32::from).collect::<Vec<_>>(), "{grid:?} turn {turn}");
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
