//! The Gaussians of an avatar by the joints that they hang on: what bounds need to know of their weights, once per avatar.

use super::layout::{Block, Chunk};
use std::collections::BTreeMap;

/// Influences up to which pairs of weights are remembered. Beyond, only distances to the heaviest bone are used.
const PAIRED: usize = 24;

/// How many influences one may ask to keep.
pub(crate) const KEPT: usize = 4;

/// Gaussians on the same joints with the same heaviest one (the first of equals).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Group {
    /// The joints, ascending.
    pub(crate) joints: Vec<u16>,
    /// Position of the heaviest in `joints`.
    pub(crate) heaviest: usize,
    /// Gaussians.
    pub(crate) count: u64,
    /// The largest share of each joint in the weights of a Gaussian.
    pub(crate) share: Vec<f64>,
    /// The largest share of all joints but the heaviest together.
    pub(crate) light: f64,
    /// The largest product of the shares of i < j, row after row; empty beyond [`PAIRED`] joints.
    pub(crate) products: Vec<f64>,
    /// The smallest Σ share².
    pub(crate) concentration: f64,
    /// The smallest difference between the two heaviest shares.
    pub(crate) imbalance: f64,
    /// `dropped[k - 1]`: the largest share of all but the k heaviest.
    pub(crate) dropped: [f64; KEPT],
    /// The largest |Σ w − 1|.
    pub(crate) excess: f64,
}

/// The shares of one Gaussian.
struct Shares {
    shares: Vec<f64>,
    heaviest: usize,
    excess: f64,
}

impl Shares {
    fn of(chunk: &Chunk, block: &Block, lane: usize) -> Self {
        let (_, weights) = chunk.influences(block);
        let weights: Vec<f64> = weights.iter().map(|w| f64::from(w[lane])).collect();
        let sum: f64 = weights.iter().sum();
        let mut heaviest = 0;
        for (k, weight) in weights.iter().enumerate() {
            heaviest = if *weight > weights[heaviest] { k } else { heaviest };
        }
        Self { shares: weights.iter().map(|w| w / sum).collect(), heaviest, excess: (sum - 1.0).abs() }
    }
}

/// The groups of all chunks, by joints, then by heaviest.
pub(crate) fn groups(chunks: &[Chunk]) -> Vec<Group> {
    let mut found: BTreeMap<(Vec<u16>, usize), Group> = BTreeMap::new();
    for chunk in chunks {
        for block in &chunk.blocks {
            let (joints, _) = chunk.influences(block);
            for lane in 0..if joints.is_empty() { 0 } else { block.count } {
                let own = Shares::of(chunk, block, lane);
                let group = found
                    .entry((joints.to_vec(), own.heaviest))
                    .or_insert_with(|| Group::empty(joints.to_vec(), own.heaviest));
                group.add(&own);
            }
        }
    }
    found.into_values().collect()
}

/// The weights of every Gaussian of a group, a row each.
pub(crate) fn weights(chunks: &[Chunk], group: &Group) -> Vec<Vec<f64>> {
    let blocks = chunks.iter().flat_map(|chunk| chunk.blocks.iter().map(move |block| (chunk, block)));
    let own = blocks.filter(|(chunk, block)| chunk.influences(block).0 == group.joints);
    let lanes =
        own.flat_map(|(chunk, block)| (0..block.count).map(move |lane| Shares::of(chunk, block, lane)));
    lanes.filter(|own| own.heaviest == group.heaviest).map(|own| own.shares).collect()
}

impl Group {
    /// The joints, ascending.
    pub(crate) fn joints(&self) -> &[u16] {
        &self.joints
    }

    fn empty(joints: Vec<u16>, heaviest: usize) -> Self {
        let n = joints.len();
        let pairs = if n <= PAIRED { n * (n - 1) / 2 } else { 0 };
        Self {
            joints,
            heaviest,
            count: 0,
            share: vec![0.0; n],
            light: 0.0,
            products: vec![0.0; pairs],
            concentration: 1.0,
            imbalance: 1.0,
            dropped: [0.0; KEPT],
            excess: 0.0,
        }
    }

    fn add(&mut self, own: &Shares) {
        let Shares { shares, excess, .. } = own;
        self.count += 1;
        for (most, share) in self.share.iter_mut().zip(shares) {
            *most = most.max(*share);
        }
        let pairs = (0..shares.len()).flat_map(|i| (i + 1..shares.len()).map(move |j| (i, j)));
        for (most, (i, j)) in self.products.iter_mut().zip(pairs) {
            *most = most.max(shares[i] * shares[j]);
        }
        let mut sorted = shares.clone();
        sorted.sort_by(|a, b| b.total_cmp(a));
        let rest = |kept: usize| sorted[kept.min(sorted.len())..].iter().sum::<f64>();
        self.light = self.light.max(rest(1));
        for (k, most) in self.dropped.iter_mut().enumerate() {
            *most = most.max(rest(k + 1));
        }
        self.concentration = self.concentration.min(shares.iter().map(|s| s * s).sum());
        self.imbalance = self.imbalance.min(sorted[0] - sorted.get(1).copied().unwrap_or(0.0));
        self.excess = self.excess.max(*excess);
    }

    /// An upper bound of Σ share_j value_j over the joints but the heaviest: the largest values first, as far as shares
    /// allow.
    pub(crate) fn most(&self, order: &[usize], value: impl Fn(usize) -> f64) -> f64 {
        let (mut left, mut sum) = (self.light, 0.0);
        for &j in order {
            let share = self.share[j].min(left);
            sum += share * value(j).max(0.0);
            left -= share;
        }
        sum
    }

    /// The joint numbers of the pairs of `products`.
    pub(crate) fn pairs(&self) -> impl Iterator<Item = (u16, u16)> + '_ {
        let n = self.joints.len();
        (0..n).flat_map(move |i| (i + 1..n).map(move |j| (self.joints[i], self.joints[j])))
    }
}
