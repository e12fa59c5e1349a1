//! The members of a gzip file, one after the other, up to what is no member: RFC 1952 §2.2, and the padding that tapes leave.

use flate2::bufread::GzDecoder;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};

const MAGIC: [u8; 2] = [0x1f, 0x8b];

/// The next bytes of a file, at least two where it has them.
fn next_bytes<F: Read + Seek>(file: &mut BufReader<F>) -> io::Result<&[u8]> {
    if file.buffer().len() < MAGIC.len() {
        // Throws away what is buffered, so that the buffer begins at the next byte.
        let here = file.stream_position()?;
        file.seek(SeekFrom::Start(here))?;
    }
    file.fill_buf()
}

/// Whether a gzip member comes next.
pub(crate) fn is_next<F: Read + Seek>(file: &mut BufReader<F>) -> io::Result<bool> {
    Ok(next_bytes(file)?.starts_with(&MAGIC))
}

/// What is in the members; afterwards the file stands behind the last one.
pub(crate) struct Members<'a, F>(Option<GzDecoder<&'a mut BufReader<F>>>);

impl<'a, F: Read + Seek> Members<'a, F> {
    pub(crate) fn new(file: &'a mut BufReader<F>) -> Self {
        Self(Some(GzDecoder::new(file)))
    }
}

impl<F: Read + Seek> Read for Members<'_, F> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while let Some(member) = &mut self.0 {
            let got = member.read(buffer)?;
            if got > 0 || buffer.is_empty() {
                return Ok(got);
            }
            let Some(ended) = self.0.take() else { break };
            let file = ended.into_inner();
            if is_next(file)? {
                self.0 = Some(GzDecoder::new(file));
            }
        }
        Ok(0)
    }
}
