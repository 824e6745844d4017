//! The codes of one block, decoded and thrown away.

use super::bits::{Bits, Damage};
use super::tables::Huffman;

/// The coefficients of an AC scan.
pub(super) struct Band {
    pub(super) first: u32,
    pub(super) last: u32,
    /// Blocks that follow and have no new coefficient.
    pub(super) run: u32,
}

/// How a block is coded.
pub(super) enum Block<'a> {
    Sequential { dc: &'a Huffman, ac: &'a Huffman },
    DcFirst(&'a Huffman),
    DcRefine,
    AcFirst(&'a Huffman),
    AcRefine(&'a Huffman),
}

impl Block<'_> {
    pub(super) fn walk(&self, bits: &mut Bits<'_>, band: &mut Band, nonzero: &mut u64) -> Result<(), Damage> {
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
    }
}
