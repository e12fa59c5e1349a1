//! Opacity of every voxel before clipping: V_o(x) = TF_o(V(x)) (CAO §3.1).

use crate::each;
use cao_model::transfer::TransferFunction;
use cao_model::volume::Volume;

/// Opacity per reference length of every voxel, x fastest.
pub fn opacity(volume: &Volume, transfer: &TransferFunction) -> Vec<f32> {
    each(volume.len(), |i| transfer.opacity_at(volume.value(i) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::values::Values;

    /// Values 0 … 7 stored as bytes with slope 10 and intercept −20, under a ramp from 0 at −10 to ½ at 30.
    #[test]
    fn ramp_over_rescaled_bytes_is_the_line_between_its_points() {
        let mut volume = Volume::new([2, 2, 2], [1.0; 3], Values::U8((0..8).collect())).unwrap();
        (volume.slope, volume.intercept) = (10.0, -20.0);
        let transfer =
            TransferFunction::new(vec![[-10.0, 0.0], [30.0, 0.5]], vec![[0.0, 1.0, 1.0, 1.0]], None).unwrap();
        let expected = [0.0, 0.0, 0.125, 0.25, 0.375, 0.5, 0.5, 0.5];
        for (found, expected) in opacity(&volume, &transfer).iter().zip(expected) {
            assert!((found - expected).abs() < 1e-7, "{found} {expected}");
        }
    }
}
