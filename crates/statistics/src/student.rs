//! Student's t: tails and quantiles, from portable functions.

use skinsplat_core::math::portable::{exp, ln};

/// The distribution with some degrees of freedom, which need not be a whole number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StudentT {
    /// Degrees of freedom, above 0.
    df: f64,
    /// ln B(df/2, 1/2).
    ln_beta: f64,
}

impl StudentT {
    /// The distribution with `df` degrees of freedom, above 0.
    pub fn new(df: f64) -> Self {
        let a = 0.5 * df;
        Self { df, ln_beta: ln_gamma(a) + ln_gamma(0.5) - ln_gamma(a + 0.5) }
    }

    /// Its degrees of freedom.
    pub fn df(&self) -> f64 {
        self.df
    }

    /// P(|T| > t) for t >= 0: the regularised incomplete beta function I_x(df/2, 1/2) at x = df / (df + t²)
    /// (Abramowitz and Stegun 26.7.1).
    pub fn outside(&self, t: f64) -> f64 {
        let (a, square) = (0.5 * self.df, t * t);
        if square == 0.0 {
            return 1.0;
        }
        let (x, rest) = (self.df / (self.df + square), square / (self.df + square));
        let front = exp(a * ln(x) + 0.5 * ln(rest) - self.ln_beta);
        if x < (a + 1.0) / (a + 2.5) {
            front * beta_fraction(a, 0.5, x) / a
        } else {
            1.0 - front * beta_fraction(0.5, a, rest) / 0.5
        }
    }

    /// The t with P(|T| > t) = p, for p in (0, 1).
    pub fn beyond(&self, p: f64) -> f64 {
        falling_root(|t| self.outside(t) - p, 1.0)
    }
}

/// Where a falling function, positive at 0, is 0: bracketed by doubling, then narrowed.
pub(crate) fn falling_root(f: impl Fn(f64) -> f64, guess: f64) -> f64 {
    let (mut low, mut high) = (0.0, guess);
    while f(high) > 0.0 && high < f64::MAX / 4.0 {
        low = high;
        high *= 2.0;
    }
    let (mut f_low, mut f_high) = (f(low), f(high));
    // Regula falsi, an end that stays being halved (the Illinois rule): some ten steps.
    for _ in 0..60 {
        let middle = (low * f_high - high * f_low) / (f_high - f_low);
        if !(low < middle && middle < high) || high - low < 1e-10 * high {
            break;
        }
        let value = f(middle);
        if value > 0.0 {
            (low, f_low) = (middle, value);
            f_high *= 0.5;
        } else {
            (high, f_high) = (middle, value);
            f_low *= 0.5;
        }
    }
    high
}

/// The continued fraction of the incomplete beta function (DLMF 8.17.22), by Lentz's method.
fn beta_fraction(a: f64, b: f64, x: f64) -> f64 {
    let away_from_0 = |v: f64| if v.abs() < 1e-300 { 1e-300 } else { v };
    let mut c = 1.0;
    let mut d = 1.0 / away_from_0(1.0 - (a + b) * x / (a + 1.0));
    let mut value = d;
    for m in 1..500 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut factor = 1.0;
        for step in [even, odd] {
            d = 1.0 / away_from_0(1.0 + step * d);
            c = away_from_0(1.0 + step / c);
            factor = c * d;
            value *= factor;
        }
        if (factor - 1.0).abs() < 1e-15 {
            break;
        }
    }
    value
}

/// ln Γ(x) for x > 0: Stirling's series (DLMF 5.11.1) from x + k >= 10 down.
fn ln_gamma(mut x: f64) -> f64 {
    let mut product = 1.0;
    while x < 10.0 {
        product *= x;
        x += 1.0;
    }
    let inverse = 1.0 / x;
    let square = inverse * inverse;
    let series = inverse
        * (1.0 / 12.0
            - square * (1.0 / 360.0 - square * (1.0 / 1260.0 - square * (1.0 / 1680.0 - square / 1188.0))));
    let half_ln_tau = 0.918_938_533_204_672_8;
    (x - 0.5) * ln(x) - x + half_ln_tau + series - ln(product)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two-sided 5 % and 1 % points as every table prints them.
    #[test]
    fn quantiles_are_those_of_tables() {
        for (df, five, one) in [
            (1.0, 12.706, 63.657),
            (2.0, 4.303, 9.925),
            (3.0, 3.182, 5.841),
            (5.0, 2.571, 4.032),
            (10.0, 2.228, 3.169),
            (30.0, 2.042, 2.750),
            (120.0, 1.980, 2.617),
            (1e7, 1.960, 2.576),
        ] {
            let t = StudentT::new(df);
            assert!((t.beyond(0.05) - five).abs() < 6e-4, "{df}: {}", t.beyond(0.05));
            assert!((t.beyond(0.01) - one).abs() < 6e-4, "{df}: {}", t.beyond(0.01));
        }
    }

    /// With 1 and 2 degrees of freedom the tails are elementary.
    #[test]
    fn tails_are_exact_where_they_are_elementary() {
        for t in [1e-6, 0.1, 0.7, 1.0, 3.0, 40.0, 1e4] {
            let cauchy = 1.0 - 2.0 * skinsplat_core::math::portable::atan(t) / std::f64::consts::PI;
            assert!((StudentT::new(1.0).outside(t) - cauchy).abs() < 1e-13, "{t}");
            let two = 1.0 - t / (2.0 + t * t).sqrt();
            assert!((StudentT::new(2.0).outside(t) - two).abs() < 1e-13, "{t}");
        }
        assert_eq!(StudentT::new(3.0).outside(0.0), 1.0);
    }

    #[test]
    fn quantiles_undo_tails() {
        for df in [0.7, 1.0, 2.5, 7.0, 39.0, 1e4] {
            let t = StudentT::new(df);
            for p in [0.5, 0.05, 0.001] {
                assert!((t.outside(t.beyond(p)) / p - 1.0).abs() < 1e-9, "{df} {p}");
            }
        }
    }

    #[test]
    fn the_gamma_function_is_known_at_whole_and_half_numbers() {
        let pi = std::f64::consts::PI;
        for (x, gamma) in [(1.0, 1.0), (2.0, 1.0), (5.0, 24.0), (0.5, pi.sqrt()), (12.0, 39_916_800.0)] {
            assert!((ln_gamma(x) - ln(gamma)).abs() < 1e-13, "{x}");
        }
    }
}
