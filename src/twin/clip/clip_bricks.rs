//! What the clips do to each brick (method.md §6), by asking every sample of every voxel in it.

use crate::clip::classify::sample_positions;
use crate::clip::clips::{ClipField, visible};
use crate::field::bricks::{EDGE, bricks};
use crate::{Grid, each};
use cao_model::settings::AntiAliasing;
use glam::Vec3;

/// How many of a brick's points, or voxels, have a property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Share {
    /// None has it.
    None,
    /// Some have it and some have not.
    Some,
    /// All have it.
    All,
}

impl Share {
    fn of(has: impl Iterator<Item = bool>) -> Self {
        let mut seen = [false; 2];
        has.for_each(|has| seen[usize::from(has)] = true);
        match seen {
            [true, true] => Self::Some,
            [_, has] => {
                if has {
                    Self::All
                } else {
                    Self::None
                }
            }
        }
    }
}

/// What the clips do to one brick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Brick {
    /// Of all samples of its voxels, the N further ones included, which are visible.
    pub visible: Share,
    /// Of its voxels, which have a point that some clip hides within reach.
    pub affected: Share,
}

/// Every brick of [`bricks`], x fastest.
pub fn clip_bricks(grid: &Grid, clips: &[ClipField], how: AntiAliasing) -> Vec<Brick> {
    let positions = sample_positions(how);
    let world = |voxel: [usize; 3]| -> Vec<Vec3> {
        let place = |p: &[f64; 3]| {
            let at = grid.to_world(std::array::from_fn(|axis| voxel[axis] as f64 + p[axis]));
            Vec3::from_array(at.map(|c| c as f32))
        };
        positions.iter().map(place).collect()
    };
    let all = bricks(grid);
    each(all.len(), |brick| {
        let first = all.voxel(brick).map(|c| c * EDGE);
        let range = |axis: usize| first[axis]..(first[axis] + EDGE).min(grid.dims[axis]);
        let voxels: Vec<Vec<Vec3>> = range(2)
            .flat_map(|z| range(1).flat_map(move |y| range(0).map(move |x| [x, y, z])))
            .map(world)
            .collect();
        Brick {
            visible: Share::of(voxels.iter().flatten().map(|&p| visible(clips, p))),
            affected: Share::of(voxels.iter().map(|samples| clips.iter().any(|c| c.affects(samples)))),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::classify::tests::field;
    use cao_model::clip::{Clip, Mode, Pose, Shape};

    const GRID: Grid = Grid { dims: [8, 8, 40], spacing: [1.0; 3] };

    /// The plane z = 0 runs through the third brick of five (voxels 16 … 23, z from −4 to 4); what lies above it is hidden,
    /// and the reach of a voxel's footprint ends in the same brick.
    #[test]
    fn a_plane_cuts_one_brick_of_a_column() {
        let clip = |mode| [field(&Clip { shape: Shape::Plane, mode, pose: Pose::default() }, &GRID, 0.0)];
        let [all, cut, none] = [Share::All, Share::Some, Share::None];
        let of = |mode| {
            let found = clip_bricks(&GRID, &clip(mode), AntiAliasing::N8);
            (found.iter().map(|b| b.visible).collect(), found.iter().map(|b| b.affected).collect())
        };
        let (visible, affected): (Vec<_>, Vec<_>) = of(Mode::Remove);
        assert_eq!(visible, [all, all, cut, none, none]);
        assert_eq!(affected, [none, none, cut, all, all]);
        let (visible, affected): (Vec<_>, Vec<_>) = of(Mode::Keep);
        assert_eq!(visible, [none, none, cut, all, all]);
        assert_eq!(affected, [all, all, cut, none, none]);
    }

    #[test]
    fn without_clips_all_is_visible_and_nothing_affected() {
        let clear = Brick { visible: Share::All, affected: Share::None };
        assert_eq!(clip_bricks(&Grid { dims: [9, 8, 8], ..GRID }, &[], AntiAliasing::N0), [clear; 2]);
    }
}
