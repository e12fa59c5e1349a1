//! The kernel `tiles` against its twin: which cells of each level an edit concerns; and levels that were brought up to date by it, which equal
//! those that were made whole, bit for bit.

use cao::drive::Take;
use cao::field::near::FAR;
use cao::field::volume_image;
use cao::pyramid::level::Means;
use cao::pyramid::levels::{LevelImages, MakeLevels};
use cao::pyramid::plan::Plan;
use cao::pyramid::tiles::{TileLists, Tiles};
use cao_gpu::{Access, Format, Gpu, Image};
use cao_measure::random::Random;
use cao_model::options::Levels;
use cao_testing::*;
use cao_twin::Grid;
use cao_twin::field::bricks::bricks;
use cao_twin::pyramid::tiles::{self as twin, tiles};

const FORMS: [Levels; 4] = [Levels::Nbuffer, Levels::Mip, Levels::Mixed(1), Levels::Reversed(2)];

fn extra() -> [Grid; 3] {
    [
        Grid { dims: [45, 17, 21], spacing: [1.0; 3] },
        Grid { dims: [26, 40, 9], spacing: [1.0, 0.5, 1.6] },
        Grid { dims: [64, 8, 8], spacing: [1.0; 3] },
    ]
}

/// What `change` holds where these bricks changed.
fn change_of(changed: &[bool]) -> Vec<u32> {
    changed.iter().map(|changed| if *changed { 0 } else { FAR }).collect()
}

#[test]
fn listed_are_the_tiles_that_changed_bricks_go_into() {
    let gpu = open();
    let kernel = Tiles::new(&gpu).unwrap();
    let mut random = Random::new(33);
    let (mut listed, mut left) = (0, 0);
    for (turn, grid) in
        GRIDS.iter().chain(&extra()).flat_map(|grid| FORMS.map(|form| (form, grid))).enumerate()
    {
        let (form, grid) = grid;
        let dims = grid.dims.map(|d| d as u32);
        let plan = Plan::of(dims, grid.spacing.map(|s| s as f32), 4, form, [0.0, 2.0][turn % 2]);
        let lists = TileLists::new(&gpu, &plan).unwrap();
        let share = [0, 5, 40][turn % 3];
        let mut concerned: Vec<bool> =
            (0..bricks(grid).len()).map(|i| share > 0 && i == 0 || random.below(100) < share).collect();
        let change = buffer(&gpu, "change", bytemuck::cast_slice(&change_of(&concerned)));
        let read = |level: usize| -> Vec<u32> {
            let words: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&gpu, &lists.of(level).buffer));
            let mut all = words[4..4 + words[3] as usize].to_vec();
            all.sort_unstable();
            all
        };
        let places = |of: &[bool]| -> Vec<u32> { (0..of.len() as u32).filter(|i| of[*i as usize]).collect() };
        run(&gpu, |rec| kernel.record_changed(rec, &plan, &change, &lists).unwrap());
        assert_eq!(read(0), places(&concerned), "{grid:?} {form:?}");
        for l in 1..=4 {
            run(&gpu, |rec| {
                lists.record_clear(rec).unwrap();
                kernel.record_marks(rec, &plan, l, &lists).unwrap();
            });
            let cells = [&plan.cells[l - 1], &plan.cells[l]];
            let Means { stride, first, second } = Means::of(cells);
            let [before, now] = cells.map(|cells| cells.dims.map(|n| n as usize));
            concerned = tiles(before, now, twin::Means { stride, first, second }, &concerned);
            let expected = places(&concerned);
            assert_eq!(read(l), expected, "{grid:?} {form:?} level {l}");
            listed += expected.len();
            left += concerned.len() - expected.len();
        }
    }
    assert!(listed > 500 && left > 500, "{listed} {left}");
    drop(kernel);
    close(gpu);
}

/// The levels of `opacity`: made whole, or from what is there where `changed` says which bricks it has been changed in since.
fn make(gpu: &Gpu, by: &MakeLevels, levels: &LevelImages, opacity: &Image, changed: Option<&[bool]>) {
    let change = changed.map(|changed| buffer(gpu, "change", bytemuck::cast_slice(&change_of(changed))));
    let parts = by.parts(0.7, levels, opacity, change.as_ref());
    run(gpu, |rec| {
        parts.iter().for_each(|part| part.record(rec, &Take::All).unwrap());
        rec.barrier(&[Access::StorageWrite], &[Access::TransferRead]);
    });
}

fn texels(gpu: &Gpu, levels: &LevelImages, opacity: &Image) -> Vec<Vec<u8>> {
    let count = levels.plan.levels() as usize;
    levels.bound(opacity)[..count].iter().map(|image| read_image(gpu, image)).collect()
}

#[test]
fn levels_after_edits_equal_those_made_whole() {
    let gpu = open();
    let by = MakeLevels::new(&gpu).unwrap();
    let mut random = Random::new(34);
    let mut missed = 0;
    for grid in extra() {
        let field = blank(&gpu, &grid);
        let all = bricks(&grid);
        let opacity = volume_image(&gpu, "test opacity", &field, Format::R16Unorm).unwrap();
        let mut values: Vec<u16> = (0..grid.len()).map(|_| random.below(65536) as u16).collect();
        write_image(&gpu, &opacity, bytemuck::cast_slice(&values));
        for form in FORMS {
            let plan = Plan::of(field.dims, field.spacing, 4, form, 1.0);
            let levels = LevelImages::new(&gpu, plan.clone()).unwrap();
            let whole = LevelImages::new(&gpu, plan).unwrap();
            make(&gpu, &by, &levels, &opacity, None);
            for _ in 0..3 {
                // New values in some voxels of some bricks.
                let changed: Vec<bool> = (0..all.len()).map(|i| i == 1 || random.below(12) == 0).collect();
                for i in 0..grid.len() {
                    if changed[all.index(grid.voxel(i).map(|c| c / 8))] && random.below(9) == 0 {
                        values[i] = random.below(65536) as u16;
                    }
                }
                write_image(&gpu, &opacity, bytemuck::cast_slice(&values));
                make(&gpu, &by, &whole, &opacity, None);
                // The control: a brick that is not said to have changed.
                let but_one: Vec<bool> = (0..all.len()).map(|i| changed[i] && i != 1).collect();
                make(&gpu, &by, &levels, &opacity, Some(&but_one));
                let expected = texels(&gpu, &whole, &opacity);
                missed += usize::from(texels(&gpu, &levels, &opacity) != expected);
                make(&gpu, &by, &levels, &opacity, Some(&changed));
                assert!(texels(&gpu, &levels, &opacity) == expected, "{grid:?} {form:?}");
            }
        }
    }
    // Where no neighbour has it made.
    assert!(missed > 18, "a brick that was left out made no difference: {missed} of 36");
    drop(by);
    close(gpu);
}
