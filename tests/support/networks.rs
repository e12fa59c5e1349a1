//! Networks: small ones of random weights, their files, and those of `tests/data/network` with what PyTorch makes of them.

use crate::source;
use cao_measure::random::Random;
use cao_model::network::{Layer, Network, Shape};
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::fs;

/// A net of this shape with random weights, the same for the same seed: 2⁻ᵉ to 2¹⁻ᵉ of either sign, where 4⁻ᵉ is about one divided by
/// the products that a value sums, so that values of all layers are near 1.
pub fn network(shape: Shape, seed: u64) -> Network {
    let mut random = Random::new(seed);
    let mut weights = Vec::with_capacity(shape.weights());
    for layer in shape.layers() {
        let exponent = 15 - (27.0 * layer.inputs as f32).sqrt().log2().round() as u16;
        let weight = |_| (random.bits() & 0x83ff) as u16 | exponent << 10;
        weights.extend((0..layer.weights()).map(weight));
    }
    Network::new(shape, weights.into()).expect("finite weights of its shape")
}

/// Its weight file, with the members of a JSON object as card: `"\"seed\":1"`.
pub fn network_bytes(network: &Network, card: &str) -> Vec<u8> {
    network_file(&network_header(network, card), network.weights())
}

/// The header of its weight file.
pub fn network_header(network: &Network, card: &str) -> String {
    let Shape { edge, filters, cap, levels, label } = *network.shape();
    let tensor = |layer: Layer| {
        format!("{{\"name\":\"{}\",\"shape\":[{},{},3,3,3]}}", layer.name, layer.outputs, layer.inputs)
    };
    let tensors: Vec<_> = network.shape().layers().into_iter().map(tensor).collect();
    let mut header = format!("{{\"edge\":{edge},\"filters\":{filters},\"cap\":{cap},\"levels\":{levels},");
    let _ = write!(header, "\"label\":\"{}\",\"tensors\":[{}],", label.name(), tensors.join(","));
    header + &format!("\"card\":{{{card}}}}}")
}

/// A weight file of a header and weights, whatever they are, with the hash of its content.
pub fn network_file(header: &str, weights: &[u16]) -> Vec<u8> {
    let padded = (16 + header.len()).next_multiple_of(16) - 16;
    let mut bytes = b"caonet\r\n".to_vec();
    bytes.extend([1, padded as u32].iter().flat_map(|word| word.to_le_bytes()));
    bytes.extend(format!("{header:padded$}").into_bytes());
    bytes.extend(weights.iter().flat_map(|bits| bits.to_le_bytes()));
    hashed(bytes)
}

/// A file's content with its SHA-256 behind it.
pub fn hashed(mut content: Vec<u8>) -> Vec<u8> {
    let hash = Sha256::digest(&content);
    content.extend_from_slice(&hash);
    content
}

/// A net of `tests/data/network`, an input, and what PyTorch makes of it in f32 (`tools/train.d/reference.py`).
pub struct Reference {
    /// The stem of its files.
    pub name: &'static str,
    /// The net.
    pub network: Network,
    /// Voxels of the grid along x, y, z.
    pub dims: [usize; 3],
    /// The grid, x fastest: numbers of f16, 0 to 1.
    pub input: Vec<f32>,
    /// What each layer gives, before Mish: channel after channel, x fastest in each.
    pub layers: Vec<(String, Vec<f32>)>,
    /// The sigmoid of the last.
    pub output: Vec<f32>,
}

/// The nets and the grids, as in `tools/train.d/reference.py`: several workgroups; down to one voxel; channels that are no multiples of 8.
const REFERENCES: [(&str, [usize; 3]); 3] = [("cube", [16; 3]), ("deep", [8; 3]), ("slab", [12, 6, 10])];

/// All of them.
pub fn network_references() -> Vec<Reference> {
    REFERENCES.into_iter().map(|(name, dims)| reference(name, dims)).collect()
}

fn reference(name: &'static str, dims: [usize; 3]) -> Reference {
    let folder = source("tests/data/network");
    let path = folder.join(format!("{name}.net"));
    let network = cao_formats::network::load(&path).unwrap_or_else(|e| panic!("{e}")).network;
    let path = folder.join(format!("{name}.f32"));
    let bytes = fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut values = bytes.as_chunks().0.iter().map(|four| f32::from_le_bytes(*four));
    let mut take = |count: usize| -> Vec<f32> { values.by_ref().take(count).collect() };
    let voxels: usize = dims.iter().product();
    let input = take(voxels);
    let given = |layer: Layer| {
        let count = layer.outputs as usize * (voxels >> (3 * layer.level));
        (layer.name, take(count))
    };
    let layers = network.shape().layers().into_iter().map(given).collect();
    let output = take(voxels);
    assert!(output.len() == voxels && values.next().is_none(), "{}: not of this net", path.display());
    Reference { name, network, dims, input, layers, output }
}
