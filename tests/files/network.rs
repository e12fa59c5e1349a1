//! Weight files: read to the bit, and refused by what is wrong with them.

use cao_formats::network::{Trained, from_bytes, load};
use cao_model::network::{Label, Network, Shape};
use cao_testing::networks::{hashed, network_file, network_header};
use cao_testing::{network, network_bytes, source};
use std::fs;
use std::path::Path;

const SHAPE: Shape = Shape { edge: 8, filters: 2, cap: 4, levels: 2, label: Label::End };

fn net() -> Network {
    network(SHAPE, 1)
}

fn read(bytes: &[u8]) -> cao_formats::Result<Trained> {
    from_bytes(Path::new("a.net"), bytes)
}

#[track_caller]
fn refused(bytes: &[u8], expected: &str) {
    let message = read(bytes).expect_err(expected).to_string();
    assert!(
        message.starts_with("a.net: ") && message.contains(expected),
        "{message:?} should say {expected:?}"
    );
    assert!(message.len() < 1200, "{message}");
}

/// The file of another header.
fn headed(header: &str) -> Vec<u8> {
    network_file(header, net().weights())
}

/// The file with this part of its header replaced.
#[track_caller]
fn edited(from: &str, to: &str) -> Vec<u8> {
    let header = network_header(&net(), "");
    assert!(header.contains(from), "{from} is not in {header}");
    headed(&header.replace(from, to))
}

#[test]
fn a_weight_file_is_read_to_the_bit_with_its_card() {
    let card = "\"seed\":7,\"data\":\"two phantoms\",\"errors\":{\"mse\":0.004}";
    let bytes = network_bytes(&net(), card);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.net");
    fs::write(&path, &bytes).unwrap();
    let found = load(&path).unwrap();
    assert_eq!(found, read(&bytes).unwrap());
    assert_eq!(found.network, net());
    let said = [("data", "two phantoms"), ("errors", "{\"mse\":0.004}"), ("seed", "7")];
    assert_eq!(found.card, said.map(|(what, said)| (what.to_owned(), said.to_owned())));
    let end: String = bytes[bytes.len() - 32..].iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(found.hash, end);
    // Of another shape, all of it.
    let other = network(Shape { edge: 48, filters: 3, cap: 5, levels: 4, label: Label::Mean }, 2);
    assert_eq!(read(&network_bytes(&other, "")).unwrap().network, other);
}

#[test]
fn files_of_the_training_script_are_read() {
    let found = load(&source("tests/data/network/slab.net")).unwrap();
    let shape = Shape { edge: 8, filters: 12, cap: 20, levels: 1, label: Label::Mean };
    assert_eq!(*found.network.shape(), shape);
    assert!(found.card.contains(&("name".into(), "slab".into())), "{:?}", found.card);
}

#[test]
fn what_is_no_weight_file_is_refused_by_what_it_is() {
    let bytes = network_bytes(&net(), "");
    refused(b"", "first bytes: no weight file of a network");
    refused(b"NRRD0005\ntype: uint8\n", "no weight file of a network");
    let text: Vec<u8> = [b"caonet\n", &bytes[8..]].concat();
    refused(&text, "its line ends were changed");
    refused(&bytes[..13], "header: cut within: the file has 13 bytes");
    let mut other = bytes.clone();
    other[8] = 2;
    refused(&other, "version: 2, expected 1");
    let missing = load(Path::new("/nowhere/a.net")).unwrap_err().to_string();
    assert!(missing.contains("/nowhere/a.net"), "{missing}");
}

/// What a length claims is compared with what there is before memory is asked for.
#[test]
fn headers_are_refused_by_what_is_wrong_with_them() {
    let mut bytes = network_bytes(&net(), "");
    bytes[12..16].copy_from_slice(&0xffff_fff0_u32.to_le_bytes());
    refused(&bytes, "header: 4294967280 bytes, expected at most 1048576");
    bytes[12..16].copy_from_slice(&(1_u32 << 20).to_le_bytes());
    refused(&bytes, "header: cut within: ");
    bytes[12..16].copy_from_slice(&17_u32.to_le_bytes());
    refused(&bytes, "a multiple of 16");

    refused(&headed("weights"), "header: not the JSON of a network: expected value at line 1 column 1");
    refused(&headed("[1, 2]"), "not the JSON of a network");
    refused(&edited("\"edge\":8", "\"depth\":8"), "unknown field `depth`");
    refused(&edited("\"edge\":8,", ""), "missing field `edge`");
    refused(&edited("\"edge\":8", "\"edge\":8,\"edge\":8"), "duplicate field `edge`");
    refused(&edited("\"edge\":8", "\"edge\":-8"), "invalid value: integer `-8`");
    refused(&edited("\"edge\":8", "\"edge\":\"8\""), "invalid type: string \"8\"");
    refused(&edited("\"card\":{}", "\"card\":[]"), "invalid type");
    refused(&edited("\"card\":{}", &format!("\"card\":{}", "[".repeat(5000))), "header: ");
    refused(
        &edited("\"label\":\"end\"", "\"label\":\"\\u001b[2J\""),
        "label: \"\\u{1b}[2J\", expected one of mean, end",
    );

    refused(&edited("\"edge\":8", "\"edge\":10"), "edge of the network: is 10; must be a multiple of 4");
    refused(&edited("\"edge\":8", "\"edge\":1048576"), "edge of the network: is 1048576; must be 4 to 1024");
    refused(&edited("\"levels\":2", "\"levels\":0"), "levels of the network: is 0; must be 1 to 9");
    refused(&edited("\"levels\":2", "\"levels\":4000000000"), "levels of the network");
    refused(&edited("\"filters\":2", "\"filters\":4096"), "filters of the network: is 4096");
    refused(&edited("\"cap\":4", "\"cap\":1"), "cap of the network: is 1; must be 2 to 1024");
}

#[test]
fn tensors_that_are_not_those_of_the_shape_are_named() {
    let middle = "{\"name\":\"middle\",\"shape\":[4,4,3,3,3]},";
    refused(&edited(middle, ""), "a.net: middle: is missing");
    let last = ",{\"name\":\"last\",\"shape\":[1,4,3,3,3]}";
    refused(&edited(last, ""), "a.net: last: is missing");
    refused(&edited(last, &last.repeat(2)), "a.net: last: surplus, expected 11 tensors");
    refused(&edited(middle, &middle.repeat(2)), "a.net: middle: out of order, expected decoder.0.0");
    refused(&edited("\"middle\"", "\"latent\""), "a.net: latent: no tensor of this network, expected middle");
    let shaped = |to: &str| edited("\"middle\",\"shape\":[4,4,3,3,3]", &format!("\"middle\",\"shape\":{to}"));
    refused(&shaped("[4,8,3,3,3]"), "a.net: middle: of shape [4, 8, 3, 3, 3], expected [4, 4, 3, 3, 3]");
    refused(&shaped("[4,4,27]"), "a.net: middle: of shape [4, 4, 27], expected");
    refused(
        &shaped(&format!("[{}4]", "4,".repeat(999))),
        "a.net: middle: of shape of 1000 numbers, expected",
    );
    refused(&shaped("[4,4,3,3,18446744073709551616]"), "header: not the JSON of a network");
    // Two names changed with each other.
    let swapped = network_header(&net(), "")
        .replace("encoder.0.0", "x")
        .replace("encoder.1.0", "encoder.0.0")
        .replace("\"x\"", "\"encoder.1.0\"");
    refused(&headed(&swapped), "a.net: encoder.1.0: out of order, expected encoder.0.0");
    // A shape of other tensors than are listed.
    refused(
        &edited("\"filters\":2", "\"filters\":3"),
        "a.net: first: of shape [2, 1, 3, 3, 3], expected [3, 1, 3, 3, 3]",
    );
}

#[test]
fn cut_and_changed_files_are_refused_and_the_tensor_is_named() {
    let bytes = network_bytes(&net(), "");
    let start = 16 + u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let mut at = start;
    for (layer, weights) in net().layers() {
        let whole = 2 * weights.len();
        refused(&bytes[..at], &format!("a.net: {}: cut within: 0 of {whole} bytes", layer.name));
        at += whole;
        refused(
            &bytes[..at - 1],
            &format!("a.net: {}: cut within: {} of {whole} bytes", layer.name, whole - 1),
        );
    }
    refused(&bytes[..at], "SHA-256: 0 bytes after the last tensor, expected 32");
    refused(&bytes[..at + 31], "SHA-256: 31 bytes");
    refused(&[&bytes[..], b"\n"].concat(), "SHA-256: 33 bytes");
    for changed in [17, start, at - 1, at, at + 31] {
        let mut other = bytes.clone();
        other[changed] ^= 1;
        assert!(read(&other).is_err(), "byte {changed}");
        if changed >= start {
            refused(&other, "it was changed");
        }
    }
    // Whole and as it was written, but no numbers.
    for (infinite, expected) in [(0x7c00_u16, "encoder.1.1"), (0xfe00, "last")] {
        let mut content = bytes[..at].to_vec();
        let before: usize =
            net().layers().take_while(|(layer, _)| layer.name != expected).map(|(_, w)| w.len()).sum();
        content[start + 2 * before..][..2].copy_from_slice(&infinite.to_le_bytes());
        refused(&hashed(content), &format!("a.net: {expected}: has weights that are no finite numbers"));
    }
}

#[test]
fn the_network_that_is_built_in_is_what_the_reader_makes_of_its_file() {
    let read = load(&source("src/model/small.net")).unwrap();
    assert_eq!(read.network, Network::small());
    assert_eq!(*read.network.shape(), Shape::SMALL);
    // Who made it, of what.
    for what in ["data", "seed", "steps"] {
        assert!(read.card.iter().any(|(name, _)| name == what), "{what}");
    }
}
