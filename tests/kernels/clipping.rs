//! What the tests of `classify` and `clip_bricks` share: the kernels, and clips ready for them.

use cao::clip::classify::Classify;
use cao::clip::clip_bricks::ClipBricks;
use cao::clip::clips::ClipSet;
use cao::clip::dilate::Dilate;
use cao::clip::peel::Peel;
use cao::field::Field;
use cao::field::features::FeatureSet;
use cao_gpu::Gpu;
use cao_model::clip::Clip;
use cao_model::feature::Features;
use cao_model::occlusion::Occlusion;
use cao_model::settings::{MapSettings, Support};
use cao_testing::{blank, run, size_mm};
use cao_twin::Grid;

pub struct Kernels<'a> {
    pub gpu: &'a Gpu,
    pub classify: Classify,
    pub clip_bricks: ClipBricks,
    pub peel: Peel,
    dilate: Dilate,
}

/// Clips on the device in front of a volume.
pub struct Clipped {
    pub field: Field,
    pub features: FeatureSet,
    pub set: ClipSet,
    pub reach: f32,
    pub support: Support,
}

impl<'a> Kernels<'a> {
    pub fn new(gpu: &'a Gpu) -> Self {
        Self {
            gpu,
            classify: Classify::new(gpu).unwrap(),
            clip_bricks: ClipBricks::new(gpu).unwrap(),
            peel: Peel::new(gpu).unwrap(),
            dilate: Dilate::new(gpu).unwrap(),
        }
    }

    pub fn clipped(
        &self,
        grid: &Grid,
        clips: &[Clip],
        occlusion: &Occlusion,
        maps: MapSettings,
        support: Support,
    ) -> Clipped {
        let gpu = self.gpu;
        let field = blank(gpu, grid);
        let reach = Classify::reach(&field, occlusion, support);
        let radius = if maps.literal { occlusion.reach(grid.min_spacing()) } else { reach };
        let half_mm = 0.5 * size_mm(grid).length();
        let none = ClipSet::new(gpu).unwrap();
        let mut set = none.planned(gpu, clips, Some(radius), half_mm, maps).unwrap();
        set.make(gpu, &self.peel, &self.dilate).unwrap();
        run(gpu, |rec| set.record(rec, clips, half_mm).unwrap());
        Clipped {
            features: FeatureSet::new(gpu, &field, Features::NONE).unwrap(),
            field,
            set,
            reach,
            support,
        }
    }
}
