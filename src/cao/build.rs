//! Updates that span frames: what a frame may do of one, what is left, and how bricks follow from milliseconds. Host only, no device.
//!
//! A brick of a stage takes what the latest frames say, the median of three, once its update's opening, which is never split, has been
//! taken off. A frame gets `(0.85 · budget − opening) / brick` of them, and one at least, so that every build ends.

use crate::ambient::Changed;
use crate::{Error, Result};
use cao_gpu::{Buffer, Stage};

/// Share of a budget that is planned for.
const MARGIN: f64 = 0.85;

/// What a recorded update may take of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// Ambient values of so many bricks of 8³ voxels, at least 1.
    Bricks(u32),
    /// So many ms on the device, above 0: as many bricks as the times of former updates allow, which the host tells
    /// ([`Renderer::updated`](crate::Renderer::updated)); until it does, a few.
    Ms(f32),
}

impl Budget {
    /// Refuses what allows nothing.
    pub(crate) fn check(self) -> Result<()> {
        match self {
            Self::Bricks(0) => {
                Err(Error::refused("budget", "allows 0 bricks; 1 is the least, or nothing would ever end"))
            }
            Self::Ms(ms) if !(ms.is_finite() && ms > 0.0) => {
                Err(Error::refused("budget", format!("is {ms} ms; must be a number above 0")))
            }
            _ => Ok(()),
        }
    }
}

/// What a recording does of an update; kept with the frame for [`Renderer::updated`](crate::Renderer::updated).
#[derive(Clone, Default)]
pub struct Updated {
    /// Number of the build; 0 where it is none.
    pub(crate) build: u64,
    /// Which of its parts, and what it is.
    pub(crate) part: usize,
    pub(crate) stage: Option<Stage>,
    /// From this brick of the list on, so many at most.
    pub(crate) first: u32,
    pub(crate) most: u32,
    /// What it takes in, where it opens.
    pub(crate) opens: Option<Changed>,
    /// Where the number of bricks on the list will be.
    pub(crate) counted: Option<Buffer>,
}

impl Updated {
    /// Bricks of 8³ voxels whose ambient values it computes, at most.
    pub fn bricks(&self) -> u32 {
        self.most
    }

    /// Whether it takes in all edits so far: later ones wait until it has ended.
    pub fn opens(&self) -> bool {
        self.opens.is_some()
    }
}

/// How much of the scene the ambient volume that is shown does not know yet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stale {
    /// Edits wait for an update to take them in.
    pub waiting: bool,
    /// Bricks of the running update that are not recorded yet: as many as its list has where [`updated`](crate::Renderer::updated) told, else as
    /// the volume has; 0 where none runs. Method `cao` has another list before, of the unclipped scene, when more than clips changed.
    pub bricks: u32,
    /// Recorded updates since the scene that is shown was the newest; 0 where it still is.
    pub frames: u64,
}

impl Stale {
    /// Whether the ambient volume is that of the newest scene.
    pub fn is_settled(&self) -> bool {
        !self.waiting && self.bricks == 0
    }
}

/// An update that spans frames.
pub(crate) struct Build {
    /// That of the update that opened it.
    pub number: u64,
    /// The edits that it takes in.
    pub changed: Changed,
    /// The part that it is at, and whether that is the one with the new values.
    pub part: usize,
    pub last: bool,
    /// Bricks of the part's list that are recorded, and how many it has, where that was told.
    pub first: u32,
    pub count: Option<u32>,
    /// Where the device writes that.
    pub counted: Option<Buffer>,
}

impl Build {
    pub fn new(number: u64, changed: Changed) -> Self {
        Self { number, changed, part: 0, last: false, first: 0, count: None, counted: None }
    }

    /// Bricks of its part's list that are left, where the volume has `most`.
    pub fn left(&self, most: u32) -> u32 {
        self.count.unwrap_or(most).saturating_sub(self.first)
    }

    /// Whether the list of its part is done. Of an empty one, too, a slice was recorded.
    pub fn listed(&self, most: u32) -> bool {
        self.first > 0 && self.left(most) == 0
    }

    /// Whether all is recorded, as far as the host knows: the device may be there earlier.
    pub fn ended(&self, most: u32) -> bool {
        self.last && self.listed(most)
    }

    /// The next part.
    pub fn advance(&mut self) {
        (self.part, self.first, self.count, self.counted) = (self.part + 1, 0, None, None);
    }

    /// Takes in what a recording of it, whose commands have run, counted.
    pub fn told(&mut self, updated: &Updated, count: u32) {
        if (updated.build, updated.part) == (self.number, self.part) {
            self.count = Some(count);
        }
    }
}

/// The latest three of some times.
#[derive(Default)]
struct Recent(Vec<f64>);

impl Recent {
    fn push(&mut self, ms: f64) {
        if self.0.len() == 3 {
            self.0.remove(0);
        }
        self.0.push(ms);
    }

    /// Their median; of two the latest.
    fn middle(&self) -> Option<f64> {
        match self.0[..] {
            [a, b, c] => Some(a.max(b).min(a.min(b).max(c))),
            _ => self.0.last().copied(),
        }
    }
}

/// What bricks take, ms.
#[derive(Default)]
pub(crate) struct Rates {
    brick: Vec<(Stage, Recent)>,
    /// What opens an update: of clips alone, of more.
    opening: [Recent; 2],
}

impl Rates {
    fn brick_ms(&self, stage: Stage) -> Option<f64> {
        self.brick.iter().find(|(of, _)| *of == stage).and_then(|(_, recent)| recent.middle())
    }

    /// Bricks of a stage that a budget allows, `first` where nothing is known, in a frame that opens an update with these edits or goes on
    /// with one.
    pub fn bricks(&self, budget: Budget, stage: Stage, first: u32, opens: Option<Changed>) -> u32 {
        match (budget, self.brick_ms(stage)) {
            (Budget::Bricks(bricks), _) => bricks,
            (Budget::Ms(_), None) => first,
            (Budget::Ms(ms), Some(brick_ms)) => {
                let opening = opens.and_then(|changed| self.opening[kind(changed)].middle()).unwrap_or(0.0);
                // Saturates.
                (((MARGIN * f64::from(ms) - opening) / brick_ms) as u32).max(1)
            }
        }
    }

    /// An update took this long, in ms, for so many bricks.
    pub fn learn(&mut self, updated: &Updated, bricks: u32, ms: f64) {
        let Some(stage) = updated.stage.filter(|_| ms.is_finite() && ms > 0.0) else { return };
        let bricks = f64::from(bricks);
        let known = self.brick_ms(stage);
        if let Some(changed) = updated.opens {
            self.opening[kind(changed)].push((ms - bricks * known.unwrap_or(0.0)).max(0.0));
        }
        // An opening says something of bricks only where nothing else did.
        if bricks > 0.0 && (updated.opens.is_none() || known.is_none()) {
            match self.brick.iter_mut().find(|(of, _)| *of == stage) {
                Some((_, recent)) => recent.push(ms / bricks),
                None => self.brick.push((stage, Recent(vec![ms / bricks]))),
            }
        }
    }

    /// Nothing is known: other settings take another time.
    pub fn clear(&mut self) {
        *self = Self::default();
    }
}

fn kind(changed: Changed) -> usize {
    usize::from(changed.opacities || changed.anew)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::{LAO, RAYS};

    const CLIPS: Changed = Changed { clips: true, ..Changed::NOTHING };

    fn updated(bricks: u32, opens: Option<Changed>) -> Updated {
        Updated { stage: Some(RAYS), most: bricks, opens, ..Updated::default() }
    }

    /// A device on which openings take 2 ms and bricks 0.01, in frames of 6 ms, lists of 4000 bricks.
    #[test]
    fn a_budget_in_ms_is_kept_once_two_frames_were_told() {
        let (mut rates, mut times) = (Rates::default(), Vec::new());
        for _ in 0..4 {
            let (mut left, mut opens) = (4000, Some(CLIPS));
            while left > 0 {
                let bricks = rates.bricks(Budget::Ms(6.0), RAYS, 3, opens).min(left);
                let ms = 0.01 * f64::from(bricks) + if opens.is_some() { 2.0 } else { 0.0 };
                rates.learn(&updated(bricks, opens), bricks, ms);
                times.push(ms);
                (left, opens) = (left - bricks, None);
            }
        }
        assert!(times.iter().all(|ms| *ms <= 6.0), "{times:?}");
        // Of 4 · 40 ms for bricks and 4 · 2 for openings, most frames are nearly full.
        assert!(times.len() < 50, "{}: {times:?}", times.len());
        // What edits of more than clips open is not known by that, nor another stage.
        assert!(rates.bricks(Budget::Ms(6.0), RAYS, 3, Some(Changed::ALL)) >= 500);
        assert_eq!(rates.bricks(Budget::Ms(6.0), LAO, 3, None), 3);
        rates.clear();
        assert_eq!(rates.bricks(Budget::Ms(6.0), RAYS, 3, None), 3);
    }

    #[test]
    fn one_hiccup_and_times_that_are_none_change_nothing() {
        let mut rates = Rates::default();
        for ms in [1.0, 1.0, 50.0, 0.0, -1.0, f64::NAN, f64::INFINITY] {
            rates.learn(&updated(100, None), 100, ms);
        }
        assert_eq!(rates.bricks(Budget::Ms(1.0), RAYS, 3, None), 85);
        // Whatever the budget, one is done.
        assert_eq!(rates.bricks(Budget::Ms(1e-6), RAYS, 3, None), 1);
        assert_eq!(rates.bricks(Budget::Bricks(7), RAYS, 3, None), 7);
    }

    #[test]
    fn a_build_ends_when_its_last_list_does() {
        let mut build = Build::new(5, CLIPS);
        let told = Updated { build: 5, part: 0, ..Updated::default() };
        build.first = 40;
        assert_eq!((build.left(100), build.listed(100), build.ended(100)), (60, false, false));
        build.told(&Updated { build: 4, ..told.clone() }, 30);
        assert_eq!(build.left(100), 60);
        build.told(&told, 30);
        assert_eq!((build.left(100), build.listed(100), build.ended(100)), (0, true, false));
        build.advance();
        (build.first, build.last) = (100, true);
        assert!(build.ended(100));
        // A list that was counted before the next part says nothing of that.
        build.first = 1;
        build.told(&told, 0);
        assert_eq!(build.left(100), 99);
    }

    #[test]
    fn budgets_of_nothing_are_refused() {
        for budget in [Budget::Bricks(0), Budget::Ms(0.0), Budget::Ms(-1.0), Budget::Ms(f32::NAN)] {
            assert!(budget.check().is_err(), "{budget:?}");
        }
        assert!(Budget::Bricks(1).check().is_ok() && Budget::Ms(0.1).check().is_ok());
    }
}
