//! Which voxel belongs to which feature, and the opacity that this makes of its own: `V_f(x) = min(s_k TF_o(V(x)), 1)` (`cao_model::feature`);
//! and how much of a voxel clips leave.

use crate::each;
use crate::field::opacity::opacity;
use cao_model::feature::Features;
use cao_model::transfer::TransferFunction;
use cao_model::volume::Volume;

/// The number of the feature of every voxel, x fastest, 0 where there is none.
pub fn index(volume: &Volume, features: &Features) -> Vec<u8> {
    each(volume.len(), |i| features.of(i, volume.value(i) as f32))
}

/// Opacity per reference length of every voxel, x fastest, before clips.
pub fn classified(volume: &Volume, transfer: &TransferFunction, features: &Features) -> Vec<f32> {
    let factor = |k: u8| k.checked_sub(1).map_or(1.0, |k| features.list[usize::from(k)].factor());
    let all = opacity(volume, transfer).into_iter().zip(index(volume, features));
    all.map(|(opacity, k)| (factor(k) * opacity).min(1.0)).collect()
}

/// Whether clips leave each voxel whole, x fastest.
pub fn spared(volume: &Volume, features: &Features) -> Vec<bool> {
    let spares = |k: u8| k.checked_sub(1).is_some_and(|k| features.list[usize::from(k)].spared);
    index(volume, features).into_iter().map(spares).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::feature::Feature;
    use cao_model::values::Values;

    #[test]
    fn a_hidden_feature_has_no_opacity_a_scaled_one_at_most_1_and_the_rest_its_own() {
        let volume = Volume::new([5, 1, 1], [1.0; 3], Values::U8(vec![0, 2, 4, 6, 8])).unwrap();
        let transfer =
            TransferFunction::new(vec![[0.0, 0.0], [8.0, 0.8]], vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap();
        let features = Features::by_intervals(vec![
            (Feature { visible: false, ..Feature::new("a") }, [1.0, 4.0]),
            (Feature { scale: 1.5, spared: true, ..Feature::new("b") }, [6.0, 9.0]),
        ])
        .unwrap();
        assert_eq!(index(&volume, &features), [0, 1, 0, 2, 2]);
        let found = classified(&volume, &transfer, &features);
        for (found, expected) in found.iter().zip([0.0, 0.0, 0.4, 0.9, 1.0]) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
        assert_eq!(spared(&volume, &features), [false, false, false, true, true]);
    }
}
