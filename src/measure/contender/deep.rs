//! What a network costs beside rays: the time to foresee.
//!
//! R says how large a voxel of its grid is, and every voxel of the grid costs the same: a shorter R costs more, by its cube.

use cao_model::network::Shape;

/// A voxel of the grid in samples of rays, with the net that is shipped: 500 on a software driver, and for edges that are rounded up to multiples of 32
/// half as much again.
const VOXEL: f64 = 750.0;

/// Cost in rays cast from every voxel, of R voxels each: (radius of the net / R)³ voxels of the grid for one of the volume.
pub fn ray(radius: f64) -> f64 {
    let grid = (f64::from(Shape::SMALL.radius()) / radius.max(1.0)).powi(3);
    VOXEL * grid / radius.max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_the_radius_costs_eight_times_as_much() {
        let update = |radius: f64| ray(radius) * radius;
        assert!((update(4.0) / update(8.0) - 8.0).abs() < 1e-9);
        assert!(ray(0.0).is_finite());
    }
}
