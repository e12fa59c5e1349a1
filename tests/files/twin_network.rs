//! The twin of DVAO's network against PyTorch, layer by layer.

use cao_model::network::Network;
use cao_testing::{Reference, network_references};
use cao_twin::network::forward;

/// Of the largest value of a layer: sums of some hundred products in f32 differ by their order, and each layer reads the one before.
const PYTORCH: f32 = 1e-5;

/// The largest difference, in largest values.
fn off(ours: &[f32], theirs: &[f32]) -> f32 {
    assert_eq!(ours.len(), theirs.len());
    let most = |values: &mut dyn Iterator<Item = f32>| values.fold(0.0, |most, v| v.abs().max(most));
    let difference = most(&mut ours.iter().zip(theirs).map(|(a, b)| a - b));
    if difference == 0.0 { 0.0 } else { difference / most(&mut theirs.iter().copied()) }
}

#[test]
fn every_layer_is_that_of_pytorch() {
    for Reference { name, network, dims, input, layers, output } in network_references() {
        let found = forward(&network, dims, &input);
        assert_eq!(found.layers.len(), layers.len());
        for ((layer, theirs), ours) in layers.iter().zip(&found.layers) {
            let off = off(&ours.values, theirs);
            assert!(off <= PYTORCH, "{name}: {layer}: {off}");
        }
        assert!(off(&found.output, &output) <= PYTORCH, "{name}");

        // Not so with one weight of the first layer changed by a sixteenth of itself.
        let mut weights = network.weights().to_vec();
        weights[13] ^= 1 << 6;
        let other = Network::new(*network.shape(), weights.into()).unwrap();
        let other = forward(&other, dims, &input);
        let first = off(&other.layers[0].values, &layers[0].1);
        assert!(first.min(off(&other.output, &output)) > 10.0 * PYTORCH, "{name}: {first}");
    }
}

/// What a single voxel holds is the same everywhere once it is doubled, and normalised it is nothing: a level of 1³ changes no output.
#[test]
fn a_level_of_one_voxel_is_lost_in_pytorch_too() {
    let deep = network_references().into_iter().find(|reference| reference.name == "deep").unwrap();
    let of = |name: &str| &deep.layers.iter().find(|(layer, _)| layer == name).unwrap().1;
    assert!(of("middle").iter().any(|value| *value != 0.0));
    assert!(of("decoder.0.0").iter().chain(of("decoder.0.1")).all(|value| *value == 0.0));
}
