//! Encapsulated pixels: a table of offsets, perhaps empty, then fragments, of which one or more make a frame (PS3.5 §A.4).

use std::io::SeekFrom;

use super::data_set::{ITEM, Pixels, SEQUENCE_END, Source, Tag, name};

/// Bytes of a file: start, length.
pub(super) type Piece = (u64, u64);

/// The pieces of each of so many `frames`; `end` is where the file ends. Beside the number stands a table of offsets with 64
/// bits, which may be empty.
pub(super) fn pieces(
    source: &mut dyn Source,
    pixels: Pixels,
    end: u64,
    (frames, table): (usize, &[u64]),
) -> Result<Vec<Vec<Piece>>, String> {
    let mut items = items(source, pixels.start, end)?;
    let fragments = items.split_off(items.len().min(1));
    let own = items.first().map(|(start, length)| offsets(source, *start, *length)).transpose()?;
    let own = own.unwrap_or_default();
    assigned(&fragments, if table.is_empty() { &own } else { table }, frames)
}

/// Every item, of which the first holds the table.
fn items(source: &mut dyn Source, start: u64, end: u64) -> Result<Vec<Piece>, String> {
    let mut at = start;
    let mut list = Vec::new();
    // Some writers leave out the delimiter at the end.
    while at < end || list.is_empty() {
        let mut head = [0; 8];
        source.seek(SeekFrom::Start(at)).map_err(|e| e.to_string())?;
        source.read_exact(&mut head).map_err(|_| "the fragments are cut off".to_owned())?;
        let tag: Tag = (u16::from_le_bytes([head[0], head[1]]), u16::from_le_bytes([head[2], head[3]]));
        let length = u64::from(u32::from_le_bytes([head[4], head[5], head[6], head[7]]));
        match tag {
            SEQUENCE_END => break,
            ITEM if length <= end.saturating_sub(at + 8) => list.push((at + 8, length)),
            ITEM => {
                return Err(format!(
                    "a fragment of {length} bytes at byte {at} runs past the end of the file"
                ));
            }
            other => return Err(format!("{} among the fragments, expected an item", name(other))),
        }
        at += 8 + length;
    }
    Ok(list)
}

/// The table of 32 bits.
fn offsets(source: &mut dyn Source, start: u64, length: u64) -> Result<Vec<u64>, String> {
    let mut table = vec![0; length as usize];
    source.seek(SeekFrom::Start(start)).map_err(|e| e.to_string())?;
    source.read_exact(&mut table).map_err(|e| e.to_string())?;
    Ok(table.as_chunks::<4>().0.iter().map(|c| u32::from_le_bytes(*c).into()).collect())
}

/// Which fragments make up which frame.
fn assigned(fragments: &[Piece], offsets: &[u64], frames: usize) -> Result<Vec<Vec<Piece>>, String> {
    if frames == 1 {
        return Ok(vec![fragments.to_vec()]);
    }
    if frames == fragments.len() {
        return Ok(fragments.iter().map(|fragment| vec![*fragment]).collect());
    }
    if offsets.len() != frames || fragments.len() < frames {
        return Err(format!(
            "{} fragments and a table of {} offsets for {frames} frames, expected as many of either",
            fragments.len(),
            offsets.len()
        ));
    }
    let first = fragments.first().map_or(0, |fragment| fragment.0);
    let mut pieces = vec![Vec::new(); frames];
    for fragment in fragments {
        // Offsets are those of the fragments' heads, from that of the first.
        let frame = offsets.partition_point(|offset| *offset <= fragment.0 - first);
        pieces[frame.saturating_sub(1)].push(*fragment);
    }
    Ok(pieces)
}
