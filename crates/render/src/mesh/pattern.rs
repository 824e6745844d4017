//! Where in a pixel the samples lie.

/// n x n samples per pixel on a rotated grid: a square lattice turned by atan(1/n), so that no two samples of a pixel
/// share a column or a row and a nearly horizontal or vertical edge meets n² levels of coverage rather than n.
///
/// Sample (i, j) lies at `x = (i + (j + ½)/n)/n`, `y = (j + (n - i - ½)/n)/n` from the top-left corner; for n = 1 that
/// is the pixel centre, for n = 2 the usual rotated-grid pattern. The mean of the positions is the pixel centre.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SamplePattern {
    per_axis: usize,
}

impl SamplePattern {
    /// The largest grid.
    pub const MAX_PER_AXIS: usize = 16;

    /// A pattern of `per_axis` x `per_axis` samples, clamped to 1..=[`SamplePattern::MAX_PER_AXIS`].
    pub fn new(per_axis: usize) -> Self {
        Self { per_axis: per_axis.clamp(1, Self::MAX_PER_AXIS) }
    }

    /// Samples per pixel.
    #[expect(clippy::len_without_is_empty, reason = "a pattern is never empty")]
    #[inline]
    pub fn len(self) -> usize {
        self.per_axis * self.per_axis
    }

    /// Positions in units of `1 / scale` pixel from the pixel's top-left corner, rounded to integers.
    pub(super) fn positions(self, scale: i64) -> Vec<[i64; 2]> {
        let n = self.per_axis as i64;
        // (2 n i + 2 j + 1) / (2 n²), rounded to the nearest unit
        let unit = |twice: i64| (twice * scale + n * n) / (2 * n * n);
        let sample = |i: i64, j: i64| [unit(2 * n * i + 2 * j + 1), unit(2 * n * j + 2 * (n - i) - 1)];
        (0..n).flat_map(|j| (0..n).map(move |i| sample(i, j))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sample_has_its_own_row_and_column_and_the_mean_is_the_centre() {
        for n in 1..=16 {
            let pattern = SamplePattern::new(n);
            let scale = 2 * (n * n) as i64;
            let positions = pattern.positions(scale);
            assert_eq!(positions.len(), pattern.len());
            for axis in 0..2 {
                let mut along: Vec<i64> = positions.iter().map(|p| p[axis]).collect();
                along.sort_unstable();
                // the n² odd positions 1, 3, 5, ...: each once
                assert_eq!(along, (0..scale / 2).map(|k| 2 * k + 1).collect::<Vec<_>>(), "n = {n}");
            }
        }
    }

    #[test]
    fn absurd_counts_are_clamped() {
        assert_eq!(SamplePattern::new(0).len(), 1);
        assert_eq!(SamplePattern::new(usize::MAX).len(), 256);
    }
}
