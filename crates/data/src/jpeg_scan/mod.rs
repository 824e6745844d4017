//! Damage in the entropy-coded data of a JPEG (ITU T.81) that decoders paper over.
//!
//! A decoder takes zeros for data that a scan lacks, skips what is too much, and resumes at whatever restart
//! marker comes next: the picture has its size, and a part of it is of somewhere else. libjpeg says so on
//! standard error alone. The walk here decodes each code and throws the values away.

mod bits;
mod block;
mod frame;
mod markers;
mod scan;
mod tables;

use bits::{Bits, Damage};
use frame::Frame;
use markers::{DHT, DRI, EOI, LEFT_OVER, Markers, Next, RST0, SOI, SOS, TEM};
use scan::Scan;
use tables::{Tables, read_tables};

/// The decoder reads no more scans. Runs of empty blocks cost a file next to nothing and the walk one step
/// per block.
const MAX_SCANS: usize = 100;

/// Walks the scans of a JPEG without reconstructing pixels.
///
/// Sequential and progressive Huffman coding of 8 bits; other processes pass, and so do headers that a
/// decoder refuses, as does everything behind the end-of-image marker or the end of the file in its place.
///
/// # Errors
/// What is wrong, in a phrase: a scan that ends before its last MCU, a code that is in no table, a
/// coefficient past the last one, a restart marker missing or out of turn, bytes left over, a scan that
/// is missing.
pub(super) fn check(bytes: &[u8]) -> Result<(), String> {
    if !bytes.starts_with(&[0xFF, SOI]) {
        return Ok(());
    }
    let mut walk = Walk {
        markers: Markers { bytes, at: 2, left: 0 },
        tables: Default::default(),
        frame: None,
        interval: 0,
        scans: 0,
        headed: false,
    };
    while walk.step()? {}
    Ok(())
}

/// The state between two markers.
struct Walk<'a> {
    markers: Markers<'a>,
    tables: Tables,
    frame: Option<Frame>,
    /// MCUs between restart markers, 0 for none.
    interval: usize,
    scans: usize,
    /// A header has come since the last scan.
    headed: bool,
}

impl Walk<'_> {
    /// One marker with what belongs to it; false where there is nothing more to look at.
    fn step(&mut self) -> Result<bool, String> {
        let marker = match self.markers.next() {
            Next::Marker(marker) => marker,
            Next::LeftOver if self.scans == 0 => return Ok(false),
            Next::LeftOver => return Err(left_over(self.scans)),
            Next::End if self.headed && self.scans > 0 => return Err(self.no_scan()),
            Next::End => EOI,
        };
        match marker {
            EOI => return self.complete().map(|()| false),
            SOI => return Ok(false),
            // Some encoders put a restart marker behind the last MCU too.
            TEM | RST0..=0xD7 => return Ok(true),
            _ => {}
        }
        let Some(content) = self.markers.segment() else {
            return if self.scans > 0 { Err(self.no_scan()) } else { Ok(false) };
        };
        self.headed = marker != SOS;
        let understood = match marker {
            0xC0..=0xC2 if self.frame.is_none() => {
                self.frame = Frame::read(content, marker == 0xC2);
                self.frame.is_some()
            }
            DHT => read_tables(content, &mut self.tables).is_some(),
            // Arithmetic coding, lossless, hierarchical.
            0xC0..=0xCF | 0xDE | 0xDF => false,
            DRI => match content {
                &[high, low] => {
                    self.interval = usize::from(u16::from_be_bytes([high, low]));
                    true
                }
                _ => false,
            },
            SOS => self.scan(content)?,
            _ => true,
        };
        Ok(understood)
    }

    fn no_scan(&self) -> String {
        format!("truncated: no scan behind a header behind scan {}", self.scans)
    }

    /// At the end of the image: every component has had a scan (of DC coefficients at least).
    fn complete(&self) -> Result<(), String> {
        let components = self.frame.as_ref().map_or(&[][..], |frame| &frame.components);
        match components.iter().position(|component| component.lowest[0].is_none()) {
            Some(missing) if self.scans > 0 => {
                Err(format!("truncated: no scan of component {} of {}", missing + 1, components.len()))
            }
            _ => Ok(()),
        }
    }

    /// The scan behind a header; false for a header that makes no sense.
    fn scan(&mut self, header: &[u8]) -> Result<bool, String> {
        let Some(frame) = self.frame.as_mut().filter(|_| self.scans < MAX_SCANS) else { return Ok(false) };
        let Some(mut scan) = Scan::read(header, frame, &self.tables) else { return Ok(false) };
        self.scans += 1;
        if !scan.in_turn {
            return Err(format!("damaged: a scan is missing before scan {}", self.scans));
        }
        let mut bits = Bits::new(self.markers.bytes, self.markers.at);
        let mut restart = RST0;
        for mcu in 0..scan.mcus {
            if self.interval > 0 && mcu > 0 && mcu.is_multiple_of(self.interval) {
                bits.leave(&mut self.markers);
                match self.markers.next() {
                    Next::Marker(marker) if marker == restart => {}
                    Next::Marker(marker) => {
                        let (number, scan) = (restart - RST0, self.scans);
                        return Err(format!("damaged: marker FF{marker:02X} for RST{number} in scan {scan}"));
                    }
                    Next::LeftOver => return Err(left_over(self.scans)),
                    Next::End => return Err(Damage::Ends.at(mcu, scan.mcus, self.scans)),
                }
                restart = RST0 + (restart - RST0 + 1) % 8;
                bits = Bits::new(self.markers.bytes, self.markers.at);
                scan.band.run = 0;
            }
            let mut unused = 0;
            let nonzero = scan.nonzero.get_mut(mcu).unwrap_or(&mut unused);
            for block in &scan.blocks {
                let walked = block.walk(&mut bits, &mut scan.band, nonzero);
                walked.map_err(|damage| damage.at(mcu, scan.mcus, self.scans))?;
            }
        }
        bits.leave(&mut self.markers);
        Ok(true)
    }
}

fn left_over(scan: usize) -> String {
    format!("damaged: more than {LEFT_OVER} bytes left over in scan {scan}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 32x24 pixels by libjpeg-turbo: 4:2:2, a restart marker after each of six MCUs but the last.
    const RESTARTS: &str = "\
        ffd8ffe000104a46494600010100000100010000ffdb004300281c1e231e19282321232d2b28303c64413c37373c7b58\
        5d4964918099968f808c8aa0b4e6c3a0aadaad8a8cc8ffcbdaeef5ffffff9bc1fffffffaffe6fdfff8ffdb0043012b2d\
        2d3c353c76414176f8a58ca5f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8f8\
        f8f8f8f8f8f8f8f8f8f8f8f8f8f8ffc00011080018002003012100021101031101ffc400160001010100000000000000\
        000000000000030402ffc4002710000104010204070100000000000000000100020311210431126181a1143233414251\
        c1f0ffc400160101010100000000000000000000000000020103ffc40021110001030304030000000000000000000001\
        000221031131124151716181f0ffdd00040001ffda000c03010002110311003f00863686c676ce15fa7600c02c64a351\
        ade53ab0df4bffd0389a3c396e3ca4f649c20c9a76e317f8b32d6df2ab8c9fb65fffd19685b5b7cd58c3c3647c1b791e\
        e83f4729d598e97fffd2c47e93c83b5376e6922734cb1ef805dd3f82cc864ca4737f257fffd318e8ca49ba184e1e19a6\
        9642d271b5fde1071698b24ec8ed7fffd4cb006e81f8de8770b44b63734906b8013d2d0d4d37852d042fffd9";

    /// 21x19 pixels by libjpeg-turbo: 4:2:0, ten progressive scans.
    const PROGRESSIVE: &str = "\
        ffd8ffe000104a46494600010100000100010000ffdb0043001b12141714111b1716171e1c1b2028422b28252528513a\
        3d3042605565645f555d5b6a7899816a7190735b5d85b586909ea3abadab6780bcc9baa6c799a8aba4ffdb0043011c1e\
        1e2823284e2b2b4ea46e5d6ea4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4a4\
        a4a4a4a4a4a4a4a4a4a4a4a4a4a4ffc20011080013001503012200021101031101ffc400170001010101000000000000\
        00000000000000040203ffc4001501010100000000000000000000000000000203ffda000c0301000210031000000196\
        a9e92b9b433e740de401ffc4001a100002030101000000000000000000000000010221320331ffda0008010100010502\
        4aa0aa3484445a5e72cfffc4001a110100010500000000000000000000000002001011213151ffda0008010301013f01\
        7c892be22dd3ffc4001811010100030000000000000000000000000002011131ffda0008010201013f01a674a575ffc4\
        001810000203000000000000000000000000000010010271ffda0008010100063f027063b2ffc4001b10000300020300\
        0000000000000000000000011110214151a1ffda0008010100013f21523a0bb1e321168696701534f0791883ffda000c\
        030100020003000000107710ff00ffc4001a110002020300000000000000000000000000113171012191ffda00080103\
        01013f108a57472da20b307fffc400191101000301010000000000000000000000010011912141ffda0008010201013f\
        10aa79b05fa1b090169fffc4001d10010002010501000000000000000000000100112131415161f0b1ffda0008010100\
        013f1064e3256b00b8644a358b96e165bda57bb882b52a09bd5ce043062017d57c846cf030364fffd9";

    fn bytes(hex: &str) -> Vec<u8> {
        (0..hex.len()).step_by(2).map(|i| u8::from_str_radix(&hex[i..i + 2], 16).unwrap()).collect()
    }

    /// Where a marker stands, in order.
    fn places(jpeg: &[u8], marker: u8) -> Vec<usize> {
        (0..jpeg.len() - 1).filter(|&i| jpeg[i] == 0xFF && jpeg[i + 1] == marker).collect()
    }

    /// Where the data of each scan begin and end.
    fn scans(jpeg: &[u8]) -> Vec<[usize; 2]> {
        let ends = |i: &usize| jpeg[*i] == 0xFF && !matches!(jpeg[*i + 1], 0 | RST0..=0xD7);
        let data = |i: usize| i + 2 + usize::from(jpeg[i + 3]);
        places(jpeg, SOS).into_iter().map(|i| [data(i), (data(i)..).find(ends).unwrap()]).collect()
    }

    fn problem(jpeg: &[u8]) -> String {
        check(jpeg).expect_err("damaged")
    }

    #[test]
    fn whole_files_pass() {
        for hex in [RESTARTS, PROGRESSIVE] {
            let jpeg = bytes(hex);
            assert_eq!(check(&jpeg), Ok(()));
            let body = &jpeg[..jpeg.len() - 2];
            assert_eq!(check(body), Ok(()), "no end-of-image marker");
            assert_eq!(check(&[&jpeg[..], b"\xFF\xDA\x00trailer"].concat()), Ok(()));
            for end in
                [&b"\xFF\xFF\xFF\xD9"[..], b"\x7F\xFF\xD9", b"\xFF\xD5\xFF\xD9", b"\xFF\xFE\0\x03!\xFF\xD9"]
            {
                assert_eq!(check(&[body, end].concat()), Ok(()), "{end:X?}");
            }
            assert_eq!(check(&[body, &[0; 300], b"\xFF\xD9"].concat()), Ok(()), "a camera's padding");
            let longer = problem(&[body, b"\0\0\0\0\x01\xFF\xD9"].concat());
            assert!(longer.starts_with("damaged: more than 4 bytes left over"), "{longer}");
        }
        for other in [&b""[..], b"P6", b"\xFF\xD8", b"\xFF\xD8\xFF\xD9"] {
            assert_eq!(check(other), Ok(()), "{other:X?}");
        }
    }

    /// The end-of-image marker behind the cut is what a decoder wants to see.
    #[test]
    fn scans_cut_short_are_refused() {
        for hex in [RESTARTS, PROGRESSIVE] {
            let jpeg = bytes(hex);
            for [start, end] in scans(&jpeg) {
                for cut in start..end {
                    let damaged = [&jpeg[..cut], &[0xFF, EOI]].concat();
                    assert!(check(&damaged).is_err(), "{cut} of {start}..{end}");
                    assert!(check(&jpeg[..cut]).is_err(), "{cut} of {start}..{end}");
                }
            }
        }
        let jpeg = bytes(RESTARTS);
        let second = places(&jpeg, RST0)[0];
        let cut = [&jpeg[..second], &[0xFF, EOI]].concat();
        assert_eq!(problem(&cut), "damaged: marker FFD9 for RST0 in scan 1");
        assert_eq!(problem(&jpeg[..second]), "truncated: scan 1 ends after 1 of 6 MCUs");
    }

    #[test]
    fn restart_markers_come_in_turn() {
        let jpeg = bytes(RESTARTS);
        let [first, second] = [RST0, RST0 + 1].map(|marker| places(&jpeg, marker)[0]);
        let without = [&jpeg[..first], &jpeg[second..]].concat();
        assert_eq!(problem(&without), "damaged: marker FFD1 for RST0 in scan 1");
        assert!(check(&[&jpeg[..first], &jpeg[first + 2..]].concat()).is_err());
        let mut swapped = jpeg.clone();
        (swapped[first + 1], swapped[second + 1]) = (RST0 + 1, RST0);
        assert_eq!(problem(&swapped), "damaged: marker FFD1 for RST0 in scan 1");
    }

    #[test]
    fn scans_that_are_missing() {
        let jpeg = bytes(PROGRESSIVE);
        let scans = scans(&jpeg);
        let without =
            |from: usize, to: usize| [&jpeg[..scans[from - 1][1]], &jpeg[scans[to - 1][1]..]].concat();
        assert_eq!(check(&without(9, 10)), Ok(()), "the last bits of a component");
        assert_eq!(problem(&without(5, 6)), "damaged: a scan is missing before scan 9");
        let header = &jpeg[..scans[9][0] - 3];
        assert_eq!(problem(header), "truncated: no scan behind a header behind scan 9");
    }

    #[test]
    fn other_processes_are_not_walked() {
        let mut jpeg = bytes(RESTARTS);
        let frame = places(&jpeg, 0xC0)[0];
        jpeg.truncate(jpeg.len() - 40);
        assert!(check(&jpeg).is_err());
        for process in [0xC3, 0xC9, 0xDE] {
            jpeg[frame + 1] = process;
            assert_eq!(check(&jpeg), Ok(()));
        }
    }
}
