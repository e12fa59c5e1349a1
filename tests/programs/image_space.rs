//! What the chart has of methods of image space, by known answers.

use cao_measure::contender::{Arena, Asked, Change, Contender, State, Values as Measured, all};
use cao_model::clip::{Clip, Pose, Shape};
use cao_model::transfer::TransferFunction;
use cao_model::values::Values;
use cao_model::view::StereoRig;
use cao_model::volume::Volume;
use cao_testing::{close, open};
use glam::Vec3;

/// Of a flat wall a hemisphere has 1, which counts half, and a ball one half.
#[test]
fn methods_of_image_space_have_one_half_at_flat_walls() {
    let gpu = open();
    // A full box: nothing but flat faces.
    let volume = Volume::new([24; 3], [1.0; 3], Values::U8(vec![255; 24 * 24 * 24])).unwrap();
    let opacity = vec![[100.0, 0.0], [101.0, 1.0]];
    let transfer = TransferFunction::new(opacity, vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap();
    let state = State { clips: Vec::new(), transfer, radius_mm: 3.0 };
    // Along its normal: aslant, depths of pixels' middles err.
    let framing = StereoRig::framing(volume.size_mm(), 30.0, 25.0);
    let rig = StereoRig { position: Vec3::new(0.0, -80.0, 0.0), target: Vec3::ZERO, ipd_mm: 2.0, ..framing };
    let views = rig.views(1.0, 1.0, 500.0).unwrap();
    let arena = Arena { gpu: &gpu, volume: &volume, views: &views, size: [48; 2] };
    let asked = Asked { min_spacing: 1.0, radius: 3.0, quick: false };
    let entrants = all(&asked).into_iter().filter(|e| e.method == "image space");
    let mut labels = Vec::new();
    for entrant in entrants {
        let label = entrant.setting.label.clone();
        let mut contender = (entrant.open)(arena, &state).unwrap();
        let middle = |contender: &dyn Contender| {
            let Measured::Pixels(values) = contender.ambient().unwrap() else {
                panic!("{label}: not of pixels");
            };
            // The picture's middle, which the box fills.
            let mut near: Vec<f32> =
                (16..32).flat_map(|y| values[48 * y + 16..48 * y + 32].to_vec()).collect();
            near.sort_by(f32::total_cmp);
            near[near.len() / 2]
        };
        let wall = middle(contender.as_ref());
        assert!((wall - 0.5).abs() < 0.005, "{label}: {wall}");
        // A slot narrower than R, and less deep: its floor is nearer to black than any wall.
        let least = |contender: &dyn Contender| match contender.ambient().unwrap() {
            Measured::Pixels(values) => values.into_iter().reduce(f32::min).unwrap(),
            Measured::Voxels(_) => panic!("{label}: not of pixels"),
        };
        let before = least(contender.as_ref());
        let pose = Pose {
            translate_mm: Vec3::new(0.0, -12.0, 0.0),
            scale: Vec3::new(1.0, 2.0, 8.0),
            ..Pose::default()
        };
        let clips = vec![Clip { pose, ..Clip::remove(Shape::Box) }];
        let cut = State { clips, ..state.clone() };
        contender.update(Change::Clip, &cut).unwrap();
        let after = least(contender.as_ref());
        // Four times what walls differ by; HBAO counts no horizon below 30 degrees, and sees least.
        assert!(after < before - 0.02, "{label}: {before}, {after}");
        labels.push(label);
    }
    let expected = ["8 samples", "32 samples", "128 samples", "Crytek SSAO", "Volumetric AO", "HBAO"];
    assert_eq!(labels, expected);
    close(gpu);
}
