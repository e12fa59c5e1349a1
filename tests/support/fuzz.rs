//! Fuzzing on stable Rust by proptest: inputs near valid ones, shrunk where they fail.
//!
//! Without variables a run is short and always the same. `PROPTEST_CASES` makes it longer, `PROPTEST_RNG_SEED` another (both proptest's own).

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::Index;
use proptest::test_runner::RngSeed;
use std::env::var_os;

/// So many cases of seed 1, unless the environment says otherwise.
pub fn config(cases: u32) -> ProptestConfig {
    let mut config = ProptestConfig { failure_persistence: None, ..ProptestConfig::default() };
    if var_os("PROPTEST_CASES").is_none() {
        config.cases = cases;
    }
    if var_os("PROPTEST_RNG_SEED").is_none() {
        config.rng_seed = RngSeed::Fixed(1);
    }
    config
}

/// One change of an input.
#[derive(Clone, Debug)]
pub enum Change {
    /// A bit is turned.
    Flip(Index, u8),
    /// A byte becomes this one.
    Set(Index, u8),
    /// Some bytes are cut out.
    Cut(Index, usize),
    /// Some bytes are there again, elsewhere.
    Copy(Index, usize, Index),
    /// The rest is missing.
    Truncate(Index),
    /// A number in the text becomes this one.
    Number(Index, &'static str),
    /// Four bytes become this number, in one order or the other.
    Word(Index, u32, bool),
    /// A line is there again, elsewhere.
    Line(Index, Index),
}

/// Numbers at which programs break.
const NUMBERS: [&str; 24] = [
    "0",
    "-0",
    "1",
    "-1",
    "2",
    "7",
    "1e-30",
    "1e30",
    "1e308",
    "-1e39",
    "1e999",
    "nan",
    "inf",
    "-inf",
    "255",
    "65536",
    "2147483647",
    "-2147483648",
    "4294967295",
    "4294967300",
    "9223372036854775807",
    "99999999999999999999",
    "0.1",
    "",
];

/// One to six changes.
pub fn changes() -> impl Strategy<Value = Vec<Change>> {
    let at = any::<Index>;
    let words = [0, 1, 2, 348, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 0x7fc0_0000, 0x7f80_0000, 65536];
    let change = prop_oneof![
        (at(), 0..8_u8).prop_map(|(at, bit)| Change::Flip(at, bit)),
        (at(), any::<u8>()).prop_map(|(at, byte)| Change::Set(at, byte)),
        (at(), 1..40_usize).prop_map(|(at, length)| Change::Cut(at, length)),
        (at(), 1..40_usize, at()).prop_map(|(from, length, to)| Change::Copy(from, length, to)),
        at().prop_map(Change::Truncate),
        (at(), prop::sample::select(&NUMBERS[..])).prop_map(|(at, number)| Change::Number(at, number)),
        (at(), prop::sample::select(words.to_vec()), any::<bool>())
            .prop_map(|(at, word, big)| Change::Word(at, word, big)),
        (at(), at()).prop_map(|(from, to)| Change::Line(from, to)),
    ];
    vec(change, 1..7)
}

/// The input after these changes.
pub fn changed(input: &[u8], changes: &[Change]) -> Vec<u8> {
    let mut bytes = input.to_vec();
    for change in changes {
        if bytes.is_empty() {
            break;
        }
        let length = bytes.len();
        match change {
            Change::Flip(at, bit) => bytes[at.index(length)] ^= 1 << bit,
            Change::Set(at, byte) => bytes[at.index(length)] = *byte,
            Change::Cut(at, count) => {
                let at = at.index(length);
                bytes.drain(at..(at + count).min(length));
            }
            Change::Copy(from, count, to) => {
                let from = from.index(length);
                let part = bytes[from..(from + count).min(length)].to_vec();
                let to = to.index(length);
                bytes.splice(to..to, part);
            }
            Change::Truncate(at) => bytes.truncate(at.index(length)),
            Change::Number(at, number) => {
                let digit = |b: &u8| b.is_ascii_digit() || b".+-e".contains(b);
                // The number at that place or behind it.
                let from = at.index(length);
                let Some(start) = bytes[from..].iter().position(u8::is_ascii_digit).map(|n| from + n) else {
                    continue;
                };
                let end = bytes[start..].iter().position(|b| !digit(b)).map_or(length, |n| start + n);
                bytes.splice(start..end, number.bytes());
            }
            Change::Word(at, word, big) => {
                let at = at.index(length);
                let word = if *big { word.to_be_bytes() } else { word.to_le_bytes() };
                let end = (at + 4).min(length);
                bytes[at..end].copy_from_slice(&word[..end - at]);
            }
            Change::Line(from, to) => {
                let lines: Vec<&[u8]> = bytes.split_inclusive(|b| *b == b'\n').collect();
                let line = lines[from.index(lines.len())].to_vec();
                let to: usize = lines[..to.index(lines.len())].iter().map(|line| line.len()).sum();
                bytes.splice(to..to, line);
            }
        }
    }
    bytes
}
