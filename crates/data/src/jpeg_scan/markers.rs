//! Markers with their segments.

/// Whole bytes between the last code of a segment and the marker behind it. The standard allows none, yet
/// pictures that are whole have a few: encoders that flush once too often.
pub(super) const LEFT_OVER: usize = 4;

pub(super) const SOI: u8 = 0xD8;
pub(super) const EOI: u8 = 0xD9;
pub(super) const SOS: u8 = 0xDA;
pub(super) const DHT: u8 = 0xC4;
pub(super) const DRI: u8 = 0xDD;
pub(super) const RST0: u8 = 0xD0;
pub(super) const TEM: u8 = 0x01;

/// The file between entropy-coded segments.
pub(super) struct Markers<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) at: usize,
    /// Bytes that the last segment left in its bit buffer.
    pub(super) left: usize,
}

pub(super) enum Next {
    Marker(u8),
    /// More than [`LEFT_OVER`] bytes that belong to none.
    LeftOver,
    /// The end of the file.
    End,
}

impl<'a> Markers<'a> {
    pub(super) fn next(&mut self) -> Next {
        let mut left = std::mem::take(&mut self.left);
        if self.is_padded(left) {
            return Next::Marker(EOI);
        }
        while left <= LEFT_OVER {
            match self.bytes.get(self.at..).unwrap_or_default() {
                [0xFF, 0xFF, ..] => self.at += 1,
                [0xFF, 0x00, ..] => (self.at, left) = (self.at + 2, left + 1),
                [0xFF, marker, ..] => {
                    self.at += 2;
                    return Next::Marker(*marker);
                }
                [] | [0xFF] => return Next::End,
                [_, ..] => (self.at, left) = (self.at + 1, left + 1),
            }
        }
        Next::LeftOver
    }

    /// True if nothing but zeros stands before the end of the image, however many: cameras fill blocks of their memory.
    fn is_padded(&self, left: usize) -> bool {
        let from = self.at.saturating_sub(left);
        let rest = self.bytes.get(from..).unwrap_or_default();
        let zeros = rest.iter().take_while(|&&byte| byte == 0).count();
        zeros > left && rest[zeros..].starts_with(&[0xFF, EOI])
    }

    /// The content of a marker's segment, `None` if the file ends before.
    pub(super) fn segment(&mut self) -> Option<&'a [u8]> {
        let rest = self.bytes.get(self.at..)?;
        let length = usize::from(u16::from_be_bytes(*rest.first_chunk()?));
        let content = rest.get(2..length)?;
        self.at += length;
        Some(content)
    }
}
