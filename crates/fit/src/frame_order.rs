//! In which order an optimiser sees its frames.

/// Every frame once, in an order that depends on the seed and the round only: a run that is resumed needs no state.
pub(crate) fn shuffled(frames: usize, seed: u64, round: u64) -> Vec<usize> {
    let mut keys: Vec<(u64, usize)> = (0..frames).map(|f| (mixed([seed, round, f as u64]), f)).collect();
    keys.sort_unstable();
    keys.into_iter().map(|(_, frame)| frame).collect()
}

/// A hash of three numbers: the finaliser of SplitMix64 (Steele, Lea and Flood 2014) after each.
fn mixed(words: [u64; 3]) -> u64 {
    words.into_iter().fold(0, |state: u64, word| {
        let mut z = (state ^ word).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_round_has_every_frame_once_and_an_order_of_its_own() {
        let rounds: Vec<Vec<usize>> = (0..4).map(|round| shuffled(20, 7, round)).collect();
        for (k, round) in rounds.iter().enumerate() {
            let mut sorted = round.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, (0..20).collect::<Vec<_>>());
            assert!(rounds[..k].iter().all(|other| other != round));
        }
        assert_eq!(shuffled(20, 7, 2), rounds[2]);
        assert_ne!(shuffled(20, 8, 2), rounds[2]);
    }
}
