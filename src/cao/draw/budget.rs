//! What an interactive frame can afford: resolution and distance of samples from the times of former frames. Host only, no device.
//!
//! A drawing at `scale` of the pixels along each axis, with samples `coarser` times as far apart, costs `scale² / coarser` of a full one. Each time that is measured
//! says so what a full one takes; of the last three the median counts, so that one hiccup changes nothing and a heavier scene is met two
//! measurements later. There are 17 levels, at each the same share of both bounds: `scale = 2^-s`, `coarser = most^s`, `s = level/16`. A level that is
//! expected to miss the budget is left at once; a better one is taken when it has been expected to take at most 85 % of it for eight
//! frames in a row. Where that was in vain the next attempt waits twice as long, so that a device that does not follow the rule does not
//! swing between two pictures.
//!
//! The rule is proportional, and a device where a part of the time is there at any quality gains less than foreseen and comes back in
//! some steps; to full quality surely where a full drawing takes at most 0.71 of the budget, the margin times a level.

/// Smallest scale: half of the pixels along each axis.
pub const LEAST_SCALE: f32 = 0.5;
/// The last level, which has both bounds.
pub const LAST: u32 = 16;
/// Share of the budget that a better picture may be expected to take: two levels are 19 % apart at most.
const MARGIN: f64 = 0.85;
/// Frames in a row for which a better picture must have been affordable, at first and at most.
const PATIENCE: [u32; 2] = [8, 256];

/// How well a frame is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Share of the pixels along each axis, ½ … 1.
    pub scale: f32,
    /// How many times as far apart samples are as the look says.
    pub coarser: f32,
    /// What the drawing is expected to take, ms, where one was measured.
    pub expected_ms: Option<f32>,
}

impl Quality {
    /// As the look says.
    pub const FULL: Self = Self { scale: 1.0, coarser: 1.0, expected_ms: None };

    /// At a level, 0 … [`LAST`], where samples may be this many times as far apart.
    pub fn at(level: u32, most: f32) -> Self {
        let share = level as f32 / LAST as f32;
        Self { scale: LEAST_SCALE.powf(share), coarser: most.max(1.0).powf(share), expected_ms: None }
    }

    /// Its share of the work of a full one.
    fn cost(&self) -> f64 {
        f64::from(self.scale).powi(2) / f64::from(self.coarser)
    }
}

/// What a recording draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drawn {
    /// Width and height in pixels of a view, the picture's upper left.
    pub size: [u32; 2],
    /// Distance of samples in mm.
    pub step_mm: f32,
    /// What was chosen, and what it is expected to take.
    pub quality: Quality,
}

/// Chooses the quality of frames.
#[derive(Debug)]
pub struct Controller {
    /// What full drawings would have taken, ms, the latest last.
    full: Vec<f64>,
    level: u32,
    /// Frames in a row for which a better level was affordable, and how many it takes.
    calm: u32,
    patience: u32,
    /// Frames since the last change for the better.
    since: u32,
}

impl Default for Controller {
    fn default() -> Self {
        Self { full: Vec::new(), level: 0, calm: 0, patience: PATIENCE[0], since: u32::MAX }
    }
}

impl Controller {
    /// The quality of the next frame, which is to take `budget_ms`; samples may be `most` times as far apart as at full quality. Full
    /// as long as nothing was measured.
    pub fn choose(&mut self, budget_ms: f64, most: f32) -> Quality {
        let Some(full) = self.full_ms() else { return Quality::FULL };
        let fits = |level: u32, share: f64| full * Quality::at(level, most).cost() <= share * budget_ms;
        self.since = self.since.saturating_add(1);
        if self.since > PATIENCE[1] {
            self.patience = PATIENCE[0];
        }
        let finer = (0..self.level).find(|level| fits(*level, MARGIN));
        if self.level < LAST && !fits(self.level, 1.0) {
            if self.since <= PATIENCE[0] {
                self.patience = (2 * self.patience).min(PATIENCE[1]);
            }
            self.level = (self.level + 1..LAST).find(|level| fits(*level, MARGIN)).unwrap_or(LAST);
            self.calm = 0;
        } else if let Some(finer) = finer {
            self.calm += 1;
            if self.calm >= self.patience {
                (self.level, self.calm, self.since) = (finer, 0, 0);
            }
        } else {
            self.calm = 0;
        }
        let quality = Quality::at(self.level, most);
        Quality { expected_ms: Some((full * quality.cost()) as f32), ..quality }
    }

    /// A drawing of this quality took this long.
    pub fn learn(&mut self, quality: &Quality, ms: f64) {
        if !(ms.is_finite() && ms > 0.0) {
            return;
        }
        if self.full.len() == 3 {
            self.full.remove(0);
        }
        self.full.push(ms / quality.cost());
    }

    /// Of two the latest.
    fn full_ms(&self) -> Option<f64> {
        match self.full[..] {
            [a, b, c] => Some(a.max(b).min(a.min(b).max(c))),
            [.., latest] => Some(latest),
            [] => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::VecDeque;

    /// Milliseconds of a frame's number and quality.
    type Device<'a> = &'a dyn Fn(u32, &Quality) -> f64;

    /// Draws frames on a device that takes `time` of a frame's number and quality, and tells its times two frames late; returns the
    /// qualities and the times.
    fn simulate(
        controller: &mut Controller,
        budget: f64,
        frames: u32,
        time: impl Fn(u32, &Quality) -> f64,
    ) -> Vec<(Quality, f64)> {
        let mut flying = VecDeque::new();
        let frame = |number| {
            let quality = controller.choose(budget, 4.0);
            assert!((LEAST_SCALE..=1.0).contains(&quality.scale) && (1.0..=4.0).contains(&quality.coarser));
            let ms = time(number, &quality);
            flying.push_back((quality, ms));
            if flying.len() > 2 {
                let (quality, ms) = flying.pop_front().unwrap();
                controller.learn(&quality, ms);
            }
            (quality, ms)
        };
        (0..frames).map(frame).collect()
    }

    /// Frames whose quality is another than that before.
    fn changes(frames: &[(Quality, f64)]) -> Vec<usize> {
        let other = |i: &usize| frames[*i].0.scale != frames[*i - 1].0.scale;
        (1..frames.len()).filter(other).collect()
    }

    /// 5 % up and down, other in every frame.
    fn noise(number: u32) -> f64 {
        0.95 + 0.1 * f64::from(number * 37 % 101) / 100.0
    }

    #[test]
    fn it_meets_the_budget_within_a_few_frames_and_stays() {
        for full in [4.0, 11.0, 20.0, 55.0, 140.0] {
            let frames = simulate(&mut Controller::default(), 10.0, 600, |n, q| full * q.cost() * noise(n));
            let late = frames[8..].iter().map(|(_, ms)| *ms).fold(0.0, f64::max);
            assert!(late < 10.0 * 1.11, "{full}: {late}");
            // As good as it can be: half of the budget is used, where there is anything to gain.
            let poor = frames[300..].iter().all(|(q, ms)| q.scale == 1.0 || *ms > 5.0);
            assert!(poor, "{full}: {:?}", frames[599]);
            assert!(changes(&frames).len() <= 4, "{full}: {:?}", changes(&frames));
        }
    }

    #[test]
    fn what_cannot_be_met_is_drawn_at_the_bounds() {
        let frames = simulate(&mut Controller::default(), 1.0, 50, |_, q| 500.0 * q.cost());
        let Quality { scale, coarser, expected_ms } = frames[49].0;
        assert_eq!((scale, coarser), (LEAST_SCALE, 4.0));
        assert!((expected_ms.unwrap() - 500.0 / 16.0).abs() < 0.1);
    }

    #[test]
    fn full_quality_comes_back_when_it_can() {
        let mut controller = Controller::default();
        let heavy = simulate(&mut controller, 10.0, 40, |_, q| 60.0 * q.cost());
        assert!(heavy[39].0.scale < 0.8);
        let light = simulate(&mut controller, 10.0, 40, |_, q| 8.0 * q.cost());
        assert_eq!((light[39].0.scale, light[39].0.coarser), (1.0, 1.0));
        assert_eq!(changes(&light).len(), 1, "{:?}", changes(&light));
        // Half of the time is there at any quality, so that a poor one promises too little: it takes a few steps.
        let rule = |_: u32, q: &Quality| 3.0 + 3.0 * q.cost();
        let mut controller = Controller::default();
        simulate(&mut controller, 10.0, 40, |_, q| 500.0 * q.cost());
        let back = simulate(&mut controller, 10.0, 80, rule);
        assert_eq!(back[79].0.scale, 1.0, "{:?}", changes(&back));
    }

    /// Devices that keep to another rule: a part that no quality changes, or more gained than foreseen. Changes become rare.
    #[test]
    fn it_does_not_swing_between_two_pictures() {
        let fixed = |n: u32, q: &Quality| (4.0 + 9.0 * q.cost()) * noise(n);
        let steep = |n: u32, q: &Quality| 24.0 * q.cost().powf(1.6) * noise(n);
        let edge = |n: u32, q: &Quality| 10.0 * q.cost() * noise(n);
        let devices: [Device; 3] = [&fixed, &steep, &edge];
        for (i, device) in devices.into_iter().enumerate() {
            let frames = simulate(&mut Controller::default(), 10.0, 2000, device);
            let changes = changes(&frames);
            let near = changes.windows(2).filter(|pair| pair[1] - pair[0] < 3).count();
            assert!(changes.len() < 60 && near <= 2, "device {i}: {changes:?}");
            let over = frames.iter().filter(|(_, ms)| *ms > 11.0).count();
            assert!(over < 100, "device {i}: {over} of 2000 frames are late");
        }
    }

    #[test]
    fn one_hiccup_changes_nothing() {
        let spikes = |n: u32, q: &Quality| 8.0 * q.cost() * if n % 20 == 13 { 10.0 } else { 1.0 };
        let frames = simulate(&mut Controller::default(), 10.0, 200, spikes);
        assert_eq!(changes(&frames), [0; 0]);
        // Times that are none do not count.
        let mut controller = Controller::default();
        [0.0, -1.0, f64::NAN, f64::INFINITY].into_iter().for_each(|ms| controller.learn(&Quality::FULL, ms));
        assert_eq!(controller.choose(1.0, 4.0), Quality::FULL);
    }
}
