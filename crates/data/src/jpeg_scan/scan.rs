//! The blocks of a scan, in the order in which they are coded.

use super::block::{Band, Block};
use super::frame::Frame;
use super::tables::Tables;

/// What a scan header says, with the tables of the time.
pub(super) struct Scan<'a> {
    /// It begins at the bits at which those before it ended.
    pub(super) in_turn: bool,
    pub(super) mcus: usize,
    /// Of one MCU.
    pub(super) blocks: Vec<Block<'a>>,
    pub(super) band: Band,
    /// Of the blocks of an AC scan, else empty.
    pub(super) nonzero: &'a mut [u64],
}

impl<'a> Scan<'a> {
    pub(super) fn read(header: &[u8], frame: &'a mut Frame, tables: &'a Tables) -> Option<Self> {
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
