//! What a frame is spent on, as CAO Fig. 9 splits it.

use cao_gpu::{Phase, Timings};

/// Times in ms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Split {
    /// Step 4: classification, and whatever depth maps a clip mesh asks for.
    pub clipping: f64,
    /// Step 5, the spherical ray cast, and what it is prepared by: all that is neither of the others.
    pub rays: f64,
    /// Step 6: the picture, and what its rays may leap over.
    pub rendering: f64,
}

impl Split {
    /// The names of the parts.
    pub const PARTS: [&str; 3] = ["clipping", "spherical ray cast", "rendering"];

    /// The split of a frame's stages.
    pub fn of(timings: &Timings) -> Self {
        let clipping = timings.of(Phase::Clip);
        let rendering = timings.of(Phase::Draw);
        Self { clipping, rays: timings.total() - clipping - rendering, rendering }
    }

    /// All parts.
    pub fn total(&self) -> f64 {
        self.parts().iter().sum()
    }

    /// The parts in the order of [`Split::PARTS`].
    pub fn parts(&self) -> [f64; 3] {
        [self.clipping, self.rays, self.rendering]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao::stages;

    #[test]
    fn every_stage_belongs_to_one_part() {
        let mut timings = Timings::new();
        for (stage, ms) in [
            (stages::CLASSIFY, 1.0),
            (stages::BRICKS, 0.5),
            (stages::CONTEXTUAL, 4.0),
            (stages::DISTANCES, 0.25),
            (stages::RAYCAST, 1.75),
            (stages::DILATE, 2.0),
            (stages::OCCUPANCY, 8.0),
            (stages::PRECOMPUTE, 16.0),
        ] {
            timings.push(stage, ms);
        }
        assert_eq!(Split::of(&timings).parts(), [3.0, 28.5, 2.0]);
        assert_eq!(Split::of(&Timings::new()), Split::default());
    }
}
