//! How much consecutive frames say: a posterior of their autocorrelation.

use skinsplat_core::math::portable::{exp, ln, pow, sin};
use std::f64::consts::PI;

/// Cells of the angle asin ρ, from -π/2 to π/2.
const CELLS: usize = 96;

/// Least autocorrelation that is considered.
const LEAST: f64 = -0.9;

/// Greatest autocorrelation that is considered.
const GREATEST: f64 = 0.9995;

/// What a series says about its autocorrelation: everything that a likelihood needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moments {
    /// Values.
    n: f64,
    /// Their mean.
    mean: f64,
    /// Σ y², y = value - mean.
    squares: f64,
    /// Σ y_i y_(i-1).
    products: f64,
    /// y² of the two ends.
    end_squares: f64,
    /// y of the two ends, summed.
    ends: f64,
}

impl Moments {
    /// Of at least two values.
    pub(crate) fn new(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let y = |i: usize| values[i] - mean;
        let last = values.len() - 1;
        Self {
            n,
            mean,
            squares: (0..=last).map(|i| y(i) * y(i)).sum(),
            products: (1..=last).map(|i| y(i) * y(i - 1)).sum(),
            end_squares: y(0) * y(0) + y(last) * y(last),
            ends: y(0) + y(last),
        }
    }

    /// True if the values differ by no more than rounding.
    pub(crate) fn is_constant(&self) -> bool {
        let rounding = 4.0 * f64::EPSILON * self.mean.abs();
        self.squares <= self.n * rounding * rounding
    }

    /// Under a first-order autoregression with autocorrelation ρ: the logarithm of the restricted likelihood (Harville 1974), with
    /// the variance integrated out under 1/σ², and the estimate of the variance of one value.
    fn fit(&self, rho: f64) -> (f64, f64) {
        // The inverse correlation matrix is tridiagonal: rows sum to (1 - ρ)², those of the ends to 1 - ρ, over 1 - ρ².
        let (gap, scale) = (1.0 - rho, 1.0 - rho * rho);
        let ones = ((self.n - 2.0) * gap * gap + 2.0 * gap) / scale;
        let cross = rho * gap * self.ends / scale;
        let square =
            (self.squares * (1.0 + rho * rho) - rho * rho * self.end_squares - 2.0 * rho * self.products)
                / scale;
        let rest = (square - cross * cross / ones).max(f64::MIN_POSITIVE);
        let df = self.n - 1.0;
        (-0.5 * (df * ln(scale) + ln(ones) + df * ln(rest)), rest / df)
    }
}

/// Variance of the mean of n values of variance 1 with autocorrelation ρ^k at distance k.
fn variance_of_mean(n: f64, rho: f64) -> f64 {
    let gap = 1.0 - rho;
    // ρ^n by its size: a power of a negative number needs whole exponents, and n is one.
    let size = pow(rho.abs(), n);
    let power = if rho < 0.0 && n % 2.0 == 1.0 { -size } else { size };
    (n * gap * (1.0 + rho) - 2.0 * rho * (1.0 - power)) / (n * n * gap * gap)
}

/// One autocorrelation that may be, given the data.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// Probability.
    pub(crate) weight: f64,
    /// Estimated variance of the mean of the sequences' means.
    pub(crate) variance: f64,
    /// Degrees of freedom of that estimate (Satterthwaite 1946, for several sequences).
    pub(crate) df: f64,
    /// Of how many independent values the sequences have the information.
    effective: f64,
}

/// The posterior of the one autocorrelation of several sequences, each with a mean and a variance of its own.
///
/// The prior has density (1 + ρ)^(-3/4) (1 - ρ²)^(-1/2): the reference prior of the autocorrelation (Berger and Yang 1994) with
/// some weight moved from ρ near 1 to ρ near -1. It was chosen because the intervals that follow from it cover as they should at
/// every ρ from 0 to 0.8, and not only on average (`tests/coverage.rs`).
pub(crate) fn posterior(sequences: &[Moments]) -> Vec<Candidate> {
    let q = sequences.len() as f64;
    let mut logs = Vec::with_capacity(CELLS);
    let mut candidates = Vec::with_capacity(CELLS);
    for cell in 0..CELLS {
        let rho: f64 = sin(PI * ((cell as f64 + 0.5) / CELLS as f64 - 0.5));
        if !(LEAST..=GREATEST).contains(&rho) {
            continue;
        }
        // Cells of equal angle carry the factor (1 - ρ²)^(-1/2).
        let mut log = -0.75 * ln(1.0 + rho);
        let (mut variance, mut spread, mut effective) = (0.0, 0.0, 0.0);
        for moments in sequences {
            let (likelihood, of_one) = moments.fit(rho);
            let factor = variance_of_mean(moments.n, rho);
            let own = of_one * factor / (q * q);
            log += likelihood;
            variance += own;
            spread += own * own / (moments.n - 1.0);
            effective += (1.0 / factor).min(moments.n);
        }
        logs.push(log);
        candidates.push(Candidate { weight: 0.0, variance, df: variance * variance / spread, effective });
    }
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    for (candidate, log) in candidates.iter_mut().zip(&logs) {
        candidate.weight = exp(log - most);
    }
    let total: f64 = candidates.iter().map(|candidate| candidate.weight).sum();
    candidates.iter_mut().for_each(|candidate| candidate.weight /= total);
    candidates.retain(|candidate| candidate.weight > 1e-8);
    candidates
}

/// The expected effective number of values.
pub(crate) fn effective(candidates: &[Candidate]) -> f64 {
    candidates.iter().map(|candidate| candidate.weight * candidate.effective).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against sums over the whole correlation matrix.
    #[test]
    fn the_variance_of_a_mean_is_that_of_its_matrix() {
        for n in [2usize, 5, 8, 33] {
            for rho in [-0.8, -0.3, 0.0, 0.4, 0.9, 0.999] {
                let power = |k: usize| (0..k).fold(1.0, |p, _| p * rho);
                let sum: f64 = (0..n).flat_map(|i| (0..n).map(move |j| i.abs_diff(j))).map(power).sum();
                let exact = sum / (n * n) as f64;
                let found = variance_of_mean(n as f64, rho);
                assert!((found / exact - 1.0).abs() < 1e-8, "{n} {rho}: {found} {exact}");
            }
        }
    }

    /// Without autocorrelation the variance is the usual one, and the restricted likelihood that of independent values.
    #[test]
    fn without_autocorrelation_it_is_the_textbook() {
        let values = [1.0, 4.0, -2.0, 0.5, 3.0];
        let (log, variance) = Moments::new(&values).fit(0.0);
        let mean = 1.3;
        let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
        assert!((variance - squares / 4.0).abs() < 1e-12);
        assert!((log + 0.5 * (ln(5.0) + 4.0 * ln(squares))).abs() < 1e-12);
    }

    /// y' R⁻¹ y with the matrix inverted by hand: R = [[1, ρ, ρ²], [ρ, 1, ρ], [ρ², ρ, 1]].
    #[test]
    fn the_residual_is_that_of_generalised_least_squares() {
        let (rho, values) = (0.5, [1.0, 2.0, 6.0]);
        let inverse = [[4.0, -2.0, 0.0], [-2.0, 5.0, -2.0], [0.0, -2.0, 4.0]].map(|row| row.map(|v| v / 3.0));
        let product = |a: [f64; 3], b: [f64; 3]| -> f64 {
            (0..3).flat_map(|i| (0..3).map(move |j| (i, j))).map(|(i, j)| a[i] * inverse[i][j] * b[j]).sum()
        };
        let (ones, cross) = (product([1.0; 3], [1.0; 3]), product([1.0; 3], values));
        let rest = product(values, values) - cross * cross / ones;
        assert!((Moments::new(&values).fit(rho).1 - rest / 2.0).abs() < 1e-12);
    }
}
