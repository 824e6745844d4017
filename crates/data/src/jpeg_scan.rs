//! Damage in the entropy-coded data of a JPEG (ITU T.81) that decoders paper over.
//!
//! A decoder takes zeros for data that a scan lacks, skips what is too much, and resumes at whatever restart
//! marker comes next: the picture has its size, and a part of it is of somewhere else. libjpeg says so on
//! standard error alone. The walk here decodes each code and throws the values away.

/// Whole bytes between the last code of a segment and the marker behind it. The standard allows none, yet
/// pictures that are whole have a few: encoders that flush once too often.
const LEFT_OVER: usize = 4;
/// A larger image is not walked.
const MAX_PIXELS: u64 = 1 << 26;
/// The decoder reads no more scans. Runs of empty blocks cost a file next to nothing and the walk one step
/// per block.
const MAX_SCANS: usize = 100;

const SOI: u8 = 0xD8;
const EOI: u8 = 0xD9;
const SOS: u8 = 0xDA;
const DHT: u8 = 0xC4;
const DRI: u8 = 0xDD;
const RST0: u8 = 0xD0;
const TEM: u8 = 0x01;

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
    /// Of DC and of AC coefficients, by destination.
    tables: [[Option<Huffman>; 4]; 2],
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

/// What is wrong with a code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Damage {
    Ends,
    NoCode,
    PastLast,
}

impl Damage {
    fn at(self, mcu: usize, of: usize, scan: usize) -> String {
        match self {
            Self::Ends => format!("truncated: scan {scan} ends after {mcu} of {of} MCUs"),
            Self::NoCode => format!("damaged: no Huffman code in MCU {} of {of} of scan {scan}", mcu + 1),
            Self::PastLast => {
                format!("damaged: a coefficient past the last in MCU {} of {of} of scan {scan}", mcu + 1)
            }
        }
    }
}

/// The file between entropy-coded segments.
struct Markers<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Bytes that the last segment left in its bit buffer.
    left: usize,
}

enum Next {
    Marker(u8),
    /// More than [`LEFT_OVER`] bytes that belong to none.
    LeftOver,
    /// The end of the file.
    End,
}

impl<'a> Markers<'a> {
    fn next(&mut self) -> Next {
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
    fn segment(&mut self) -> Option<&'a [u8]> {
        let rest = self.bytes.get(self.at..)?;
        let length = usize::from(u16::from_be_bytes(*rest.first_chunk()?));
        let content = rest.get(2..length)?;
        self.at += length;
        Some(content)
    }
}

/// What a frame header says, with what the scans so far have said.
struct Frame {
    progressive: bool,
    components: Vec<Component>,
    /// Of an interleaved scan.
    mcus: usize,
}

struct Component {
    id: u8,
    /// Blocks per MCU of an interleaved scan.
    per_mcu: usize,
    /// Blocks of a scan of this component alone: those with a pixel of the image.
    blocks: usize,
    /// One bit per coefficient that is not zero so far, by block; empty before the first AC scan.
    nonzero: Vec<u64>,
    /// The lowest bit that the scans so far have, by coefficient.
    lowest: [Option<u8>; 64],
}

impl Frame {
    /// `None` for what is not walked.
    fn read(content: &[u8], progressive: bool) -> Option<Self> {
        let &[8, h1, h0, w1, w0, count, ref rest @ ..] = content else { return None };
        let size = [u16::from_be_bytes([w1, w0]), u16::from_be_bytes([h1, h0])].map(usize::from);
        let pixels = size[0] as u64 * size[1] as u64;
        if pixels == 0
            || pixels > MAX_PIXELS
            || !(1..=4).contains(&count)
            || rest.len() != 3 * usize::from(count)
        {
            return None;
        }
        let factors = |sampling: u8| [usize::from(sampling >> 4), usize::from(sampling & 15)];
        let mut most = [1; 2];
        for component in rest.chunks_exact(3) {
            for (axis, factor) in factors(component[1]).into_iter().enumerate() {
                if !(1..=4).contains(&factor) {
                    return None;
                }
                most[axis] = most[axis].max(factor);
            }
        }
        let component = |bytes: &[u8]| {
            let factors = factors(bytes[1]);
            let blocks = |axis: usize| (size[axis] * factors[axis]).div_ceil(8 * most[axis]);
            Component {
                id: bytes[0],
                per_mcu: factors[0] * factors[1],
                blocks: blocks(0) * blocks(1),
                nonzero: Vec::new(),
                lowest: [None; 64],
            }
        };
        let components: Vec<_> = rest.chunks_exact(3).map(component).collect();
        let alike = |i: usize| components[..i].iter().any(|before| before.id == components[i].id);
        if (1..components.len()).any(alike) {
            return None;
        }
        let mcus = size[0].div_ceil(8 * most[0]) * size[1].div_ceil(8 * most[1]);
        Some(Self { progressive, components, mcus })
    }
}

/// Reads the Huffman tables of a segment; `None` if they make no sense.
fn read_tables(mut content: &[u8], tables: &mut [[Option<Huffman>; 4]; 2]) -> Option<()> {
    while let Some((&place, rest)) = content.split_first() {
        let (counts, rest) = rest.split_first_chunk::<16>()?;
        let (symbols, rest) = rest.split_at_checked(counts.iter().map(|&n| usize::from(n)).sum())?;
        let table = tables.get_mut(usize::from(place >> 4))?.get_mut(usize::from(place & 15))?;
        *table = Some(Huffman::new(counts, symbols)?);
        content = rest;
    }
    Some(())
}

/// The codes of a table, by their first bits.
struct Huffman {
    /// Length and symbol of the code that the next eight bits begin with; length 0 for none so short.
    short: [(u8, u8); 256],
    /// By length: the first 16 bits that are past all codes of this length and shorter ones, and the symbol
    /// of code 0 of this length, were there one.
    long: [(u32, i32); 17],
    symbols: Vec<u8>,
}

impl Huffman {
    /// `None` for more codes than fit.
    fn new(counts: &[u8; 16], symbols: &[u8]) -> Option<Self> {
        let mut table = Self { short: [(0, 0); 256], long: [(0, 0); 17], symbols: symbols.to_vec() };
        let (mut code, mut index) = (0_u32, 0_usize);
        for (length, &count) in (1_u8..).zip(counts) {
            let first = code;
            code += u32::from(count);
            if code > 1 << length {
                return None;
            }
            let codes = symbols.get(index..index + usize::from(count))?;
            if length <= 8 {
                let each = 1 << (8 - length);
                let places = table.short.get_mut(first as usize * each..code as usize * each)?;
                for (place, &symbol) in places.chunks_exact_mut(each).zip(codes) {
                    place.fill((length, symbol));
                }
            }
            table.long[usize::from(length)] = (code << (16 - length), index as i32 - first as i32);
            index += usize::from(count);
            code <<= 1;
        }
        Some(table)
    }

    /// Length and symbol of the code that 16 bits begin with.
    fn find(&self, bits: u16) -> Option<(u8, u8)> {
        let short = self.short[usize::from(bits >> 8)];
        if short.0 > 0 {
            return Some(short);
        }
        let length = (9..=16_u8).find(|&length| u32::from(bits) < self.long[usize::from(length)].0)?;
        let code = i32::from(bits >> (16 - length));
        let symbol = self.symbols.get((self.long[usize::from(length)].1 + code) as usize)?;
        Some((length, *symbol))
    }
}

/// Bits of an entropy-coded segment. At its end (a marker, the end of the file) there are none; there are no
/// zeros instead.
struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
    /// The next bits, from the top; zero below.
    buffer: u64,
    count: u32,
    ended: bool,
}

impl<'a> Bits<'a> {
    fn new(bytes: &'a [u8], at: usize) -> Self {
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

    fn skip(&mut self, count: u32) -> Result<(), Damage> {
        self.count = self.count.checked_sub(count).ok_or(Damage::Ends)?;
        self.buffer <<= count;
        Ok(())
    }

    /// Skips as many bits as a block may have to correct.
    fn skip_many(&mut self, mut count: u32) -> Result<(), Damage> {
        while count > 0 {
            self.refill();
            let part = count.min(32);
            self.skip(part)?;
            count -= part;
        }
        Ok(())
    }

    /// A symbol; the 16 bits behind it are in the buffer.
    fn symbol(&mut self, table: &Huffman) -> Result<u8, Damage> {
        self.refill();
        match table.find((self.buffer >> 48) as u16) {
            Some((length, symbol)) => self.skip(u32::from(length)).map(|()| symbol),
            None if self.count < 16 => Err(Damage::Ends),
            None => Err(Damage::NoCode),
        }
    }

    /// A number of bits behind a symbol.
    fn number(&mut self, bits: u32) -> Result<u32, Damage> {
        let value = self.buffer.unbounded_shr(64 - bits) as u32;
        self.skip(bits).map(|()| value)
    }

    /// Ends the segment; the bits up to the next byte are padding.
    fn leave(&self, markers: &mut Markers<'_>) {
        markers.at = self.at;
        markers.left = self.count as usize / 8;
    }
}

/// What a scan header says, with the tables of the time.
struct Scan<'a> {
    /// It begins at the bits at which those before it ended.
    in_turn: bool,
    mcus: usize,
    /// Of one MCU.
    blocks: Vec<Block<'a>>,
    band: Band,
    /// Of the blocks of an AC scan, else empty.
    nonzero: &'a mut [u64],
}

/// The coefficients of an AC scan.
struct Band {
    first: u32,
    last: u32,
    /// Blocks that follow and have no new coefficient.
    run: u32,
}

/// How a block is coded.
enum Block<'a> {
    Sequential { dc: &'a Huffman, ac: &'a Huffman },
    DcFirst(&'a Huffman),
    DcRefine,
    AcFirst(&'a Huffman),
    AcRefine(&'a Huffman),
}

impl<'a> Scan<'a> {
    fn read(header: &[u8], frame: &'a mut Frame, tables: &'a [[Option<Huffman>; 4]; 2]) -> Option<Self> {
        let (&count, rest) = header.split_first()?;
        let (parts, rest) = rest.split_at_checked(2 * usize::from(count))?;
        let &[first, last, approximation] = rest else { return None };
        let (high, low) = (approximation >> 4, approximation & 15);
        let refining = high != 0;
        let of_ac = frame.progressive && first > 0;
        let sensible = match (frame.progressive, first) {
            (false, _) => true,
            (true, 0) => last == 0,
            (true, _) => first <= last && last <= 63 && count == 1,
        };
        let mut members = Vec::new();
        let mut blocks = Vec::new();
        for part in parts.chunks_exact(2) {
            let member = frame.components.iter().position(|component| component.id == part[0])?;
            if members.contains(&member) {
                return None;
            }
            members.push(member);
            let table = |class: usize, place: u8| tables[class].get(usize::from(place))?.as_ref();
            let (dc, ac) = (table(0, part[1] >> 4), table(1, part[1] & 15));
            let repeated = if count == 1 { 1 } else { frame.components[member].per_mcu };
            for _ in 0..repeated {
                blocks.push(match (frame.progressive, of_ac, refining) {
                    (false, ..) => Block::Sequential { dc: dc?, ac: ac? },
                    (true, false, false) => Block::DcFirst(dc?),
                    (true, false, true) => Block::DcRefine,
                    (true, true, false) => Block::AcFirst(ac?),
                    (true, true, true) => Block::AcRefine(ac?),
                });
            }
        }
        if !sensible || members.is_empty() {
            return None;
        }
        let (covered, low) = if frame.progressive { (first..=last, low) } else { (0..=63, 0) };
        let mut in_turn = !refining || !frame.progressive || low + 1 == high;
        for &member in &members {
            let lowest = &mut frame.components[member].lowest;
            in_turn &= !of_ac || lowest[0].is_some();
            for coefficient in covered.clone() {
                let before = lowest[usize::from(coefficient)].replace(low);
                in_turn &= !frame.progressive || before.unwrap_or(0) == high;
            }
        }
        let alone = &mut frame.components[members[0]];
        let mcus = if count == 1 { alone.blocks } else { frame.mcus };
        if of_ac {
            alone.nonzero.resize(alone.blocks, 0);
        }
        let nonzero = if of_ac { &mut alone.nonzero[..] } else { &mut [] };
        let band = Band { first: u32::from(first), last: u32::from(last), run: 0 };
        Some(Self { in_turn, mcus, blocks, band, nonzero })
    }
}

impl Block<'_> {
    fn walk(&self, bits: &mut Bits<'_>, band: &mut Band, nonzero: &mut u64) -> Result<(), Damage> {
        match self {
            Self::Sequential { dc, ac } => {
                difference(bits, dc)?;
                sequential(bits, ac)
            }
            Self::DcFirst(dc) => difference(bits, dc),
            Self::DcRefine => bits.skip_many(1),
            Self::AcFirst(ac) => first(bits, ac, band, nonzero),
            Self::AcRefine(ac) => refine(bits, ac, band, nonzero),
        }
    }
}

/// A DC coefficient (F.2.2.1, G.1.2.1).
fn difference(bits: &mut Bits<'_>, dc: &Huffman) -> Result<(), Damage> {
    match bits.symbol(dc)? {
        size @ 0..=15 => bits.skip(u32::from(size)),
        _ => Err(Damage::NoCode),
    }
}

/// The AC coefficients of a block (F.2.2.2).
fn sequential(bits: &mut Bits<'_>, ac: &Huffman) -> Result<(), Damage> {
    let mut next = 1;
    while next < 64 {
        let symbol = bits.symbol(ac)?;
        let (run, size) = (u32::from(symbol >> 4), u32::from(symbol & 15));
        if size == 0 && run < 15 {
            break;
        }
        next += run + 1;
        if next > 64 {
            return Err(Damage::PastLast);
        }
        bits.skip(size)?;
    }
    Ok(())
}

/// A band of a block for the first time (G.1.2.2).
fn first(bits: &mut Bits<'_>, ac: &Huffman, band: &mut Band, nonzero: &mut u64) -> Result<(), Damage> {
    if band.run > 0 {
        band.run -= 1;
        return Ok(());
    }
    let mut next = band.first;
    while next <= band.last {
        let symbol = bits.symbol(ac)?;
        let (run, size) = (u32::from(symbol >> 4), u32::from(symbol & 15));
        if size == 0 && run < 15 {
            band.run = (1 << run) + bits.number(run)? - 1;
            break;
        }
        next += run + 1;
        if next > band.last + 1 {
            return Err(Damage::PastLast);
        }
        if size > 0 {
            bits.skip(size)?;
            *nonzero |= 1 << (next - 1);
        }
    }
    Ok(())
}

/// One more bit of a band of a block (G.1.2.3): of each coefficient that is not zero, as it is passed, and of
/// new ones.
fn refine(bits: &mut Bits<'_>, ac: &Huffman, band: &mut Band, nonzero: &mut u64) -> Result<(), Damage> {
    let mut next = band.first;
    while next <= band.last && band.run == 0 {
        let symbol = bits.symbol(ac)?;
        let mut run = u32::from(symbol >> 4);
        match symbol & 15 {
            0 if run < 15 => {
                band.run = (1 << run) + bits.number(run)?;
                break;
            }
            0 => {}
            1 => bits.skip(1)?,
            _ => return Err(Damage::NoCode),
        }
        let mut corrected = 0;
        while next <= band.last {
            if *nonzero >> next & 1 == 1 {
                corrected += 1;
            } else if run == 0 {
                break;
            } else {
                run -= 1;
            }
            next += 1;
        }
        bits.skip_many(corrected)?;
        if next > band.last {
            return Err(Damage::PastLast);
        }
        *nonzero |= u64::from(symbol & 1) << next;
        next += 1;
    }
    if band.run > 0 {
        if next <= band.last {
            let rest = (*nonzero >> next) & (u64::MAX >> (63 - (band.last - next)));
            bits.skip_many(rest.count_ones())?;
        }
        band.run -= 1;
    }
    Ok(())
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

    /// A table with one code, for sixteen coefficients of which the last is not zero.
    #[test]
    fn codes_that_do_not_fit() {
        let mut counts = [0; 16];
        counts[1] = 1;
        let table = Huffman::new(&counts, &[0xF1]).unwrap();
        let sequential = |bytes: &[u8]| super::sequential(&mut Bits::new(bytes, 0), &table);
        assert_eq!(sequential(&[0; 9]), Err(Damage::PastLast));
        assert_eq!(sequential(&[0]), Err(Damage::Ends));
        assert_eq!(sequential(&[0, 0xFF, 0, 0, 0]), Err(Damage::NoCode));
        assert!(Huffman::new(&[3; 16], &[0; 48]).is_none());
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
