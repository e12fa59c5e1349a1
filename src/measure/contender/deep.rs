//! What a network costs beside rays: the time to foresee.
//!
//! R says how large a voxel of its grid is, and every voxel of the grid costs the same: a shorter R costs more, by its cube.

use cao_model::network::Shape;

/// A voxel of the grid in samples of rays, with the net that is shipped: on a software driver 2.5 s of 64³ voxels, where a sample takes some 10 ns.
const VOXEL: f64 = 1000.0;

/// Cost in rays cast from every voxel, of R voxels each: (radius of the net / R)³ voxels of the grid for one of the volume. Edges of grids are multiples
/// of 32, which is not known here.
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
