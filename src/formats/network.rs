//! Weight files of networks (`*.net`): what `tools/train` writes and method `dvao` reads. docs/formats.md has them byte by byte.
//!
//! ```text
//! 8          "caonet\r\n"
//! 4, 4       version 1; N, the header's length, so that 16 + N is a multiple of 16
//! N          JSON: edge, filters, cap, levels, label; tensors, a list of { name, shape }; card: what is known of the training. Then spaces
//! 2 a weight f16, tensor after tensor in the order of the layers, of each [output][input][z][y][x]
//! 32         SHA-256 of everything before
//! ```
//!
//! Numbers are little-endian. What is not such a file is refused by what is wrong, as far as it is known by its tensor.

use crate::{Error, Result, file};
use cao_model::error::{MOST_SAID, quoted, shown};
use cao_model::network::{Label, Layer, Network, Shape};
use serde::Deserialize;
use serde_json::{Map, Value};
use sha2::{Digest, Sha256};
use std::path::Path;

/// What such a file begins with: bytes that a change of line ends would change.
pub const MAGIC: [u8; 8] = *b"caonet\r\n";

/// The one version there is.
pub const VERSION: u32 = 1;

/// Longest file. That of the published net has 217 MB.
const MOST_BYTES: u64 = 1 << 30;

/// Longest header.
const MOST_HEADER: usize = 1 << 20;

/// Bytes before the header.
const START: usize = 16;

/// Bytes of the hash.
const END: usize = 32;

/// A network and what its file says of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Trained {
    /// The network.
    pub network: Network,
    /// How it came about: data, seed, steps, errors. What is said, and what of it.
    pub card: Vec<(String, String)>,
    /// The file's SHA-256, in hexadecimal.
    pub hash: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    edge: u32,
    filters: u32,
    cap: u32,
    levels: u32,
    label: String,
    tensors: Vec<Tensor>,
    card: Map<String, Value>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Tensor {
    name: String,
    shape: Vec<u64>,
}

/// The network in a weight file.
///
/// # Errors
/// [`Error::Io`] when the file cannot be read, and what [`from_bytes`] refuses.
pub fn load(path: &Path) -> Result<Trained> {
    from_bytes(path, &file::read_bytes(path, MOST_BYTES)?)
}

/// The network in the bytes of a weight file, which messages call `path`.
///
/// # Errors
/// [`Error::File`] with the part of the file or the tensor that is wrong, and what was expected.
pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Trained> {
    let refuse = |part: &str, problem: String| Err(Error::file(path, part, problem));
    if !bytes.starts_with(&MAGIC) {
        let text = match bytes.starts_with(&MAGIC[..6]) {
            true => "its line ends were changed, as of text: it has to be copied as binary data",
            false => "no weight file of a network, which begins with \"caonet\\r\\n\"",
        };
        return refuse("first bytes", text.into());
    }
    let Some(start) = bytes.get(..START) else {
        return refuse("header", format!("cut within: the file has {} bytes", bytes.len()));
    };
    let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| start[at + i]));
    if word(8) != VERSION {
        return refuse("version", format!("{}, expected {VERSION}", word(8)));
    }
    let length = word(12) as usize;
    if length > MOST_HEADER || !(START + length).is_multiple_of(16) {
        let expected = format!("at most {MOST_HEADER} and a multiple of 16");
        return refuse("header", format!("{length} bytes, expected {expected}"));
    }
    let Some(header) = bytes.get(START..START + length) else {
        let there = bytes.len() - START;
        return refuse("header", format!("cut within: {there} of {length} bytes"));
    };
    let header: Header = serde_json::from_slice(header)
        .map_err(|error| Error::file(path, "header", format!("not the JSON of a network: {error}")))?;
    let Some(label) = Label::ALL.into_iter().find(|label| label.name() == header.label) else {
        let names = Label::ALL.map(Label::name).join(", ");
        return refuse("label", format!("{}, expected one of {names}", quoted(&header.label)));
    };
    let Header { edge, filters, cap, levels, tensors, card, .. } = header;
    let shape = Shape { edge, filters, cap, levels, label };
    shape.check().map_err(|error| Error::from(error).in_file(path))?;
    let layers = shape.layers();
    compare(path, &layers, &tensors)?;

    let mut end = START + length;
    for layer in &layers {
        let whole = 2 * layer.weights();
        if bytes.len() - end < whole {
            return refuse(&layer.name, format!("cut within: {} of {whole} bytes", bytes.len() - end));
        }
        end += whole;
    }
    let weights = &bytes[START + length..end];
    let hash = &bytes[end..];
    if hash.len() != END {
        return refuse("SHA-256", format!("{} bytes after the last tensor, expected {END}", hash.len()));
    }
    let found = Sha256::digest(&bytes[..end]);
    if hash != found.as_slice() {
        let problem = format!("{}, but that of the content is {}: it was changed", hex(hash), hex(&found));
        return refuse("SHA-256", problem);
    }
    let weights = weights.as_chunks().0.iter().map(|two| u16::from_le_bytes(*two)).collect();
    let network = Network::new(shape, weights).map_err(|error| Error::from(error).in_file(path))?;
    let card =
        card.into_iter().map(|(what, said)| (shown(&what, MOST_SAID), shown(&plain(&said), MOST_SAID)));
    Ok(Trained { network, card: card.collect(), hash: hex(hash) })
}

/// Refuses a list of tensors that are not those of the layers.
fn compare(path: &Path, layers: &[Layer], tensors: &[Tensor]) -> Result<()> {
    let refuse = |tensor: &str, problem: String| Err(Error::file(path, tensor, problem));
    for (i, layer) in layers.iter().enumerate() {
        let tensor = match tensors.get(i) {
            Some(tensor) if tensor.name == layer.name => tensor,
            Some(other) if layers.iter().all(|layer| layer.name != other.name) => {
                let problem = format!("no tensor of this network, expected {}", layer.name);
                return refuse(&other.name, problem);
            }
            Some(other) if tensors.iter().any(|tensor| tensor.name == layer.name) => {
                return refuse(&other.name, format!("out of order, expected {}", layer.name));
            }
            _ => return refuse(&layer.name, "is missing".into()),
        };
        let expected = [layer.outputs, layer.inputs, 3, 3, 3].map(u64::from);
        if tensor.shape != expected {
            return refuse(&layer.name, format!("of shape {}, expected {expected:?}", few(&tensor.shape)));
        }
    }
    match tensors.get(layers.len()) {
        Some(other) => {
            let problem = format!(
                "surplus, expected {} tensors, the last {}",
                layers.len(),
                layers[layers.len() - 1].name
            );
            refuse(&other.name, problem)
        }
        None => Ok(()),
    }
}

/// A shape for a message.
fn few(shape: &[u64]) -> String {
    match shape.len() {
        ..9 => format!("{shape:?}"),
        long => format!("of {long} numbers"),
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A value of the card as text.
fn plain(said: &Value) -> String {
    match said {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}
