//! The method `dvao` (docs/dvao.md): V_o on the grid of a net, the net, its values in the voxels of V_o.
//!
//! A net is tied to its voxel: its rays are [`Shape::radius`](cao_model::network::Shape::radius) voxels long, so that a radius of R mm has a grid of
//! R / radius mm. Its opacities are per [`Label::reference`](cao_model::network::Label::reference) voxels of the grid.

use super::forward;
use super::output::output;
use super::resize::{Placed, shrink};
use crate::Grid;
use cao_model::network::Network;

/// V_AO of every voxel, 1 where none is needed unless `unneeded`; of V_o per `reference_mm`.
pub fn predicted(
    network: &Network,
    grid: &Grid,
    opacity: &[f32],
    reference_mm: f64,
    radius_mm: f64,
    unneeded: bool,
) -> Vec<f32> {
    let shape = network.shape();
    let step = radius_mm / f64::from(shape.radius());
    let placed = Placed::new(grid, step, 1 << shape.levels);
    let exponent = f64::from(shape.label.reference()) * step / reference_mm;
    let values = forward(network, placed.dims, &shrink(grid, opacity, &placed, exponent)).output;
    output(grid, opacity, &placed, &values, unneeded)
}

#[cfg(test)]
mod tests {
    use super::*;
    use cao_model::network::{Label, Shape};

    /// Without weights the sigmoid of 0.
    #[test]
    fn a_net_of_zeros_gives_a_half_where_a_value_is_needed() {
        let shape = Shape { edge: 4, filters: 1, cap: 2, levels: 1, label: Label::End };
        let network = Network::new(shape, vec![0; shape.weights()].into()).unwrap();
        let grid = Grid { dims: [5, 3, 2], spacing: [1.0, 1.5, 2.0] };
        let mut opacity = vec![0.0; grid.len()];
        opacity[0] = 1.0;
        let found = predicted(&network, &grid, &opacity, 1.0, 0.7, false);
        assert_eq!(found.iter().filter(|value| **value == 0.5).count(), 8);
        assert_eq!(found.iter().filter(|value| **value == 1.0).count(), grid.len() - 8);
    }
}
