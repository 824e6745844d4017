//! Huffman tables, and the look-up of a code.

/// Those of DC and of AC coefficients, by destination.
pub(super) type Tables = [[Option<Huffman>; 4]; 2];

/// Reads the Huffman tables of a segment; `None` if they make no sense.
pub(super) fn read_tables(mut content: &[u8], tables: &mut Tables) -> Option<()> {
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
pub(super) struct Huffman {
    /// Length and symbol of the code that the next eight bits begin with; length 0 for none so short.
    short: [(u8, u8); 256],
    /// By length: the first 16 bits that are past all codes of this length and shorter ones, and the symbol
    /// of code 0 of this length, were there one.
    long: [(u32, i32); 17],
    symbols: Vec<u8>,
}

impl Huffman {
    /// `None` for more codes than fit.
    pub(super) fn new(counts: &[u8; 16], symbols: &[u8]) -> Option<Self> {
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
    pub(super) fn find(&self, bits: u16) -> Option<(u8, u8)> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_codes_than_fit() {
        assert!(Huffman::new(&[3; 16], &[0; 48]).is_none());
    }
}
