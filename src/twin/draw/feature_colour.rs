//! The colour of a place of a volume with features.
//!
//! ```text
//! k(p) = argmax_k Σ w V_f [f = k] over the eight voxels round p, the lowest where two have as much
//! c(p) = c_k, or where the feature has none TF_c(Σ w V [f = k] / Σ w [f = k])
//! l(p) = k(p), or where that is none the feature with the most Σ w V_f [f = k] > 0, whose light it has
//! ```
//!
//! Where a clip hides p only voxels that it leaves whole count.

use crate::Grid;
use cao_model::feature::Features;
use cao_model::transfer::TransferFunction;
use glam::{DVec3, Vec3};

/// What of a volume belongs to which feature, x fastest.
#[derive(Clone, Copy)]
pub struct Parts<'a> {
    /// How they are shown.
    pub features: &'a Features,
    /// The number of each voxel's.
    pub index: &'a [u8],
    /// Data values V.
    pub values: &'a [f32],
    /// Opacities that clips leave, 0 in all other voxels.
    pub spared: &'a [f32],
    /// Ambient factors of features side by side, and the greatest of them, which counts where there is none: 1 but where all four are beside it.
    pub channels: Option<&'a [Vec<f32>; 5]>,
}

/// The number of the feature at index coordinates, of voxels with these opacities.
pub fn owner_at(grid: &Grid, parts: &Parts, opacity: &[f32], position: [f64; 3]) -> usize {
    let first = around(grid, position)[0].0;
    most(grid, parts, opacity, position, 0).unwrap_or(usize::from(parts.index[first]))
}

/// The number of the feature whose light the place has, 0 where there is none beside it.
pub fn light_at(grid: &Grid, parts: &Parts, opacity: &[f32], position: [f64; 3]) -> usize {
    match owner_at(grid, parts, opacity, position) {
        0 => most(grid, parts, opacity, position, 1).unwrap_or(0),
        own => own,
    }
}

/// The number, from the first on, of the feature that has the most opacity, if any has some.
fn most(grid: &Grid, parts: &Parts, opacity: &[f32], position: [f64; 3], first: usize) -> Option<usize> {
    let voxels = around(grid, position);
    let share = |k: usize| -> f64 {
        let own = voxels.iter().filter(|(i, _)| usize::from(parts.index[*i]) == k);
        own.map(|(i, w)| w * f64::from(opacity[*i])).sum()
    };
    let (mut own, mut most) = (None, 0.0);
    for k in first..=parts.features.list.len() {
        if share(k) > most {
            (own, most) = (Some(k), share(k));
        }
    }
    own
}

/// Linear red, green and blue at index coordinates, of voxels with these opacities.
pub fn colour_at(
    grid: &Grid,
    parts: &Parts,
    opacity: &[f32],
    transfer: &TransferFunction,
    position: [f64; 3],
) -> DVec3 {
    let voxels = around(grid, position);
    let own = owner_at(grid, parts, opacity, position);
    let colour = own.checked_sub(1).and_then(|k| parts.features.list[k].colour);
    let colour = colour.unwrap_or_else(|| {
        let of = |what: &dyn Fn(usize) -> f64| -> f64 {
            let own = voxels.iter().filter(|(i, _)| usize::from(parts.index[*i]) == own);
            own.map(|(i, w)| w * what(*i)).sum()
        };
        transfer.colour_at((of(&|i| f64::from(parts.values[i])) / of(&|_| 1.0)) as f32)
    });
    Vec3::from_array(colour).as_dvec3()
}

/// The eight voxels round a place, continued outside by the edge, and their linear weights.
fn around(grid: &Grid, position: [f64; 3]) -> [(usize, f64); 8] {
    let at: [f64; 3] = std::array::from_fn(|a| position[a].clamp(0.0, grid.dims[a] as f64 - 1.0));
    std::array::from_fn(|corner| {
        let up: [usize; 3] = std::array::from_fn(|a| corner >> a & 1);
        let voxel = std::array::from_fn(|a| (at[a].floor() as usize + up[a]).min(grid.dims[a] - 1));
        let weight = |a: usize| {
            let t = at[a] - at[a].floor();
            if up[a] == 1 { t } else { 1.0 - t }
        };
        (grid.index(voxel), (0..3).map(weight).product())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::feature::Feature;

    /// Two voxels, a feature without a colour and a blue one.
    #[test]
    fn the_feature_with_more_of_the_opacity_has_the_place() {
        let grid = Grid { dims: [2, 1, 1], spacing: [1.0; 3] };
        let transfer =
            TransferFunction::new(vec![[0.0, 1.0]], vec![[0.0, 0.0, 0.0, 0.0], [10.0, 1.0, 1.0, 0.0]], None)
                .unwrap();
        let list = vec![Feature::new("a"), Feature { colour: Some([0.0, 0.0, 1.0]), ..Feature::new("b") }];
        let features = Features::by_labels(list, grid.dims, vec![1, 2]).unwrap();
        let parts = Parts {
            features: &features,
            index: &[1, 2],
            values: &[10.0, 0.0],
            spared: &[0.0, 0.0],
            channels: None,
        };
        let at = |opacity: [f32; 2], x| colour_at(&grid, &parts, &opacity, &transfer, [x, 0.0, 0.0]);
        // Not the colour of the value between, 6, which is half as bright.
        assert_eq!(at([0.5, 0.5], 0.4), DVec3::new(1.0, 1.0, 0.0));
        assert_eq!(at([0.5, 0.5], 0.6), DVec3::Z);
        assert_eq!(at([0.2, 0.8], 0.4), DVec3::Z);
        assert_eq!(at([0.5, 0.0], 0.9), DVec3::new(1.0, 1.0, 0.0));
    }

    /// Matter of nobody's has the light of the feature beside it, and none where there is no matter of one.
    #[test]
    fn a_place_of_nobodys_has_the_light_of_the_feature_beside_it() {
        let grid = Grid { dims: [2, 1, 1], spacing: [1.0; 3] };
        let list = vec![Feature::new("a"), Feature::new("b")];
        let features = Features::by_labels(list, grid.dims, vec![0, 2]).unwrap();
        let parts = Parts {
            features: &features,
            index: &[0, 2],
            values: &[0.0; 2],
            spared: &[0.0; 2],
            channels: None,
        };
        let at = |opacity: [f32; 2], x| {
            let place = [x, 0.0, 0.0];
            (owner_at(&grid, &parts, &opacity, place), light_at(&grid, &parts, &opacity, place))
        };
        assert_eq!(at([0.5, 0.5], 0.3), (0, 2));
        assert_eq!(at([0.5, 0.5], 0.7), (2, 2));
        assert_eq!(at([0.5, 0.0], 0.3), (0, 0));
    }
}
