//! The bits of an entropy-coded segment.

use super::markers::Markers;
use super::tables::Huffman;

/// What is wrong with a code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Damage {
    Ends,
    NoCode,
    PastLast,
}

impl Damage {
    pub(super) fn at(self, mcu: usize, of: usize, scan: usize) -> String {
        match self {
            Self::Ends => format!("truncated: scan {scan} ends after {mcu} of {of} MCUs"),
            Self::NoCode => format!("damaged: no Huffman code in MCU {} of {of} of scan {scan}", mcu + 1),
            Self::PastLast => {
                format!("damaged: a coefficient past the last in MCU {} of {of} of scan {scan}", mcu + 1)
            }
        }
    }
}

/// Bits of an entropy-coded segment. At its end (a marker, the end of the file) there are none; there are no
/// zeros instead.
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
    /// The next bits, from the top; zero below.
    buffer: u64,
    count: u32,
    ended: bool,
}

impl<'a> Bits<'a> {
    pub(super) fn new(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at, buffer: 0, count: 0, ended: false }
    }

    /// The next byte of data. 0xFF is one with a zero behind it; before a marker it is none.
    fn byte(&mut self) -> Option<u8> {
        let rest = self.bytes.get(self.at..)?;
        let filled = rest.iter().take_while(|&&byte| byte == 0xFF).count();
        match (filled, *rest.get(filled)?) {
            (0, byte) => {
                self.at += 1;
                Some(byte)
            }
            (_, 0) => {
                self.at += filled + 1;
                Some(0xFF)
            }
            _ => None,
        }
    }

    /// At least 32 bits, if the segment has them: a code and what follows it.
    fn refill(&mut self) {
        if self.count >= 32 {
            return;
        }
        let word = self
            .bytes
            .get(self.at..)
            .and_then(|rest| rest.first_chunk())
            .filter(|word| !word.contains(&0xFF));
        if let Some(word) = word {
            self.buffer |= u64::from(u32::from_be_bytes(*word)) << (32 - self.count);
            self.count += 32;
            self.at += 4;
            return;
        }
        while self.count < 32 && !self.ended {
            match self.byte() {
                Some(byte) => {
                    self.buffer |= u64::from(byte) << (56 - self.count);
                    self.count += 8;
                }
                None => self.ended = true,
            }
        }
    }

    pub(super) fn skip(&mut self, count: u32) -> Result<(), Damage> {
        self.count = self.count.checked_sub(count).ok_or(Damage::Ends)?;
        self.buffer <<= count;
        Ok(())
    }

    /// Skips as many bits as a block may have to correct.
    pub(super) fn skip_many(&mut self, mut count: u32) -> Result<(), Damage> {
        while count > 0 {
            self.refill();
            let part = count.min(32);
            self.skip(part)?;
            count -= part;
        }
        Ok(())
    }

    /// A symbol; the 16 bits behind it are in the buffer.
    pub(super) fn symbol(&mut self, table: &Huffman) -> Result<u8, Damage> {
        self.refill();
        match table.find((self.buffer >> 48) as u16) {
            Some((length, symbol)) => self.skip(u32::from(length)).map(|()| symbol),
            None if self.count < 16 => Err(Damage::Ends),
            None => Err(Damage::NoCode),
        }
    }

    /// A number of bits behind a symbol.
    pub(super) fn number(&mut self, bits: u32) -> Result<u32, Damage> {
        let value = self.buffer.unbounded_shr(64 - bits) as u32;
        self.skip(bits).map(|()| value)
    }

    /// Ends the segment; the bits up to the next byte are padding.
    pub(super) fn leave(&self, markers: &mut Markers<'_>) {
        markers.at = self.at;
        markers.left = self.count as usize / 8;
    }
}
