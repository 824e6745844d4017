//! Bounds on how far a solver or a projection can be from the exact average, proved from angles and weights alone.
//!
//! Rotations are unit quaternions q_j with weights w_j, Σ w_j = 1; A = Σ w_j q_j q_jᵀ has eigenvalues λ1 ≥ … ≥ λ4 ≥ 0 that
//! sum to 1, and v, the eigenvector of λ1, is the average. A quaternion angle (between lines of R⁴) is half the angle of
//! the rotation. h_j is the quaternion angle from the heaviest bone q_0 to q_j, at most 90°. All angles here are radians.
//!
//! **Gap.** tr A² = Σ_ij w_i w_j cos² h_ij = 1 − D with D = 2 Σ_{i<j} w_i w_j sin² h_ij. The other eigenvalues sum to
//! 1 − λ1, so 1 − D ≤ λ1² + (1 − λ1)²; and λ1 ≥ Σ λ² = 1 − D. For D < 1/2 the two give λ1 ≥ (1 + ρ)/2 with
//! ρ = √(1 − 2D). Also λ1 ≥ q_0ᵀ A q_0 = m = 1 − Σ w_j sin² h_j, so λ1 ≥ (1 + ρ)/2 with ρ = 2m − 1. (Where all bones are
//! within the rotation angle a of the heaviest, this is at least cos a, the known corollary.) Either way
//! λ1 − λ2 ≥ 2 λ1 − 1 ≥ ρ and r = λ2/λ1 ≤ (1 − ρ)/(1 + ρ). For two bones √(1 − 2D) is the gap itself.
//!
//! **Heaviest bone.** Write v = cos θ q_0 + sin θ u, u ⟂ q_0. Eliminating λ1 from A v = λ1 v along q_0 and u leaves
//! tan 2θ = 2 uᵀA q_0 / (m − uᵀA u), and |uᵀA q_0| ≤ b = Σ w_j sin h_j cos h_j, uᵀA u ≤ tr A − m = 1 − m. So for
//! m > 1/2, tan 2θ ≤ 2b / (2m − 1); θ ≤ 45°, else −u would serve better. Equality for two bones.
//!
//! **Power iteration** multiplies what is off v by at most r a step: tan θ_k ≤ rᵏ tan θ_0. Equality for two bones.
//!
//! **A column of A** (matrix to quaternion; the start of `power-N-column`; squaring, of A^(2^N)): one power step from the
//! axis e_i with the largest A_ii. A_ii ≥ tr A / 4 = 1/4 and A_ii ≤ λ1 c² + λ2 (1 − c²) for c = |v·e_i|, so
//! c² ≥ (1/4 − λ2)/(λ1 − λ2), and with λ1 ≤ 1/(1 + r): tan θ_0 ≤ √((3 − r)/(1 − 3r)), r < 1/3. After the step
//! tan θ ≤ r √((3 − r)/(1 − 3r)). Attained by two bones in an adverse frame.
//!
//! **Normalised sum** of quaternions on q_0's side. Let β bound the quaternion angle β_j of every bone to v, β < 90°, and
//! q_j = cos β_j v + sin β_j e_j. Since A v = λ1 v, Σ w_j cos β_j sin β_j e_j = 0; subtracting 2/(1 + cos β) times that from
//! what is off v in the sum, |Σ w_j sin β_j e_j| ≤ tan²(β/2) Σ w_j sin β_j ≤ tan²(β/2) √(1 − λ1) (Cauchy-Schwarz, because
//! Σ w_j sin² β_j = 1 − λ1), while along v it is at least Σ w_j cos² β_j = λ1. So
//! tan θ ≤ tan²(β/2) √(1 − λ1) / λ1. Two bones: see [`two_bone_sum`].
//!
//! **Gram-Schmidt** of B = Σ w_j R_j = R P, R the average, P symmetric with eigenvalues s1 ≥ s2 ≥ s3; here
//! s1 = 2(λ1 + λ2) − 1 ≤ 1 and s3 = 2(λ1 + λ4) − 1 ≥ ρ. The result is R Q with Q that of P, whose first column is P e_1 and
//! whose third is P⁻¹ e_3, normalised. A positive definite matrix of condition s1/s3 turns a vector by at most α,
//! cos α = 2 √ρ/(1 + ρ) (Kantorovich). A rotation (w, x, y, z) that moves e_1 and e_3 by at most α has
//! y² + z² ≤ sin²(α/2) ≥ x² + y², so x² + y² + z² ≤ 2 sin²(α/2) = (1 − √ρ)²/(1 + ρ). Rows: of the transpose.
//!
//! **Fewer influences.** Leaving out bones of total weight ε (and dividing by 1 − ε) changes A, seen along v and off it, by
//! at most ε max(sin β_j cos β_j)/(1 − ε) across and takes at most ε/(1 − ε) off the distance on the diagonal. As for the
//! heaviest bone, tan 2θ ≤ ε max(sin 2β_j) / (ρ − ε).

use skinsplat_core::math::portable::{self, atan, pow, tan};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

/// Unit round-off of `f32`.
const UNIT: f64 = f32::EPSILON as f64 / 2.0;

/// Below this gap nothing is claimed: `f64` does not tell it from a tie.
const LEAST_GAP: f64 = 1e-6;

/// What rounding can take from the pairs of diagonal entries that decide which column is read.
const COLUMN_SLACK: f64 = 1e-5;

/// What is known of the bones of every Gaussian of a group in one pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spread {
    /// ρ: at most λ1 − λ2, and (1 + ρ)/2 at most λ1. 0 if nothing is known.
    pub(super) gap: f64,
    /// At least the quaternion angle of the heaviest bone to the average.
    pub(super) heaviest: f64,
    /// The largest quaternion angle of a bone to the heaviest.
    pub(super) reach: f64,
    /// Bones.
    pub(super) bones: usize,
    /// For two bones: the smallest difference of their weights over the sum.
    pub(super) imbalance: f64,
}

impl Spread {
    /// One bone: its own average.
    pub(super) const ONE: Self = Self { gap: 1.0, heaviest: 0.0, reach: 0.0, bones: 1, imbalance: 1.0 };

    /// From upper bounds of D, of Σ w_j sin² h_j and of Σ w_j sin h_j cos h_j (see the module).
    pub(super) fn new(bones: usize, imbalance: f64, reach: f64, [d, off, across]: [f64; 3]) -> Self {
        let lead = 1.0 - 2.0 * off;
        let gap = (1.0 - 2.0 * d).max(0.0).sqrt().max(lead).clamp(0.0, 1.0);
        let known = lead > LEAST_GAP || bones == 2 && gap > LEAST_GAP;
        let heaviest = if known { 0.5 * portable::atan2(2.0 * across, lead) } else { FRAC_PI_2 };
        Self { gap, heaviest, reach, bones, imbalance }
    }

    /// An upper bound of λ2/λ1.
    pub(super) fn ratio(&self) -> f64 {
        if self.gap > LEAST_GAP { (1.0 - self.gap) / (1.0 + self.gap) } else { 1.0 }
    }

    /// At least the quaternion angle of any bone to the average.
    fn farthest(&self) -> f64 {
        if self.bones == 2 { self.reach.max(self.heaviest) } else { self.reach + self.heaviest }
    }
}

/// The angle of the rotation by which `steps` power steps miss, from a start at most `start` (quaternion angle) off.
pub(super) fn power(spread: &Spread, start: f64, steps: u32) -> f64 {
    if spread.gap <= LEAST_GAP || start >= FRAC_PI_2 {
        return f64::INFINITY;
    }
    2.0 * atan(pow(spread.ratio(), f64::from(steps)) * tan(start))
}

/// The quaternion angle by which any bone can miss.
pub(super) fn any_bone(spread: &Spread, from_heaviest: f64) -> f64 {
    if spread.bones == 2 { from_heaviest.max(spread.heaviest) } else { spread.heaviest + from_heaviest }
}

/// The angle of the rotation by which the largest column of A^power misses, `excess` = |Σ w − 1| added to the diagonal of 4 A
/// where it is read from a blend.
pub(super) fn column(ratio: f64, power: f64, excess: f64) -> f64 {
    let r = pow(ratio, power);
    let denominator = 1.0 - 3.0 * r - COLUMN_SLACK;
    if denominator <= 0.0 {
        return f64::INFINITY;
    }
    // 4 W λ + (1 − W) in place of λ, with λ1 at least 1/4.
    let step = if excess > 0.0 {
        let leading = 1.0 / (1.0 + r) - excess;
        (r / (1.0 + r) + excess) / leading
    } else {
        r
    };
    2.0 * atan(step * ((3.0 - r + COLUMN_SLACK) / denominator).sqrt())
}

/// The angle of the rotation by which the normalised sum on the heaviest bone's side misses.
pub(super) fn sum(spread: &Spread) -> f64 {
    if spread.bones == 2 {
        return two_bone_sum(spread.reach, spread.imbalance);
    }
    let beta = spread.farthest();
    if spread.gap <= LEAST_GAP || beta >= FRAC_PI_2 - 1e-6 {
        return f64::INFINITY;
    }
    let leading = 0.5 * (1.0 + spread.gap);
    let slope = tan(0.5 * beta);
    2.0 * atan(slope * slope * (1.0 - leading).sqrt() / leading)
}

/// Two bones at the quaternion angle h, weights (1 ± κ)/2 with κ at least `imbalance`. In the frame of the bisector the
/// average is at φ with tan 2φ = κ tan h and the normalised sum at ψ with tan ψ = κ tan(h/2): the rotation misses by
/// 2(φ − ψ) ≥ 0. With τ = tan(h/2) the derivative in κ vanishes where κ² (3 + τ²) = 1 − τ², the maximum; beyond it the
/// difference falls.
fn two_bone_sum(h: f64, imbalance: f64) -> f64 {
    let tau = tan(0.5 * h);
    let worst = ((1.0 - tau * tau).max(0.0) / (3.0 + tau * tau)).sqrt();
    let kappa = worst.max(imbalance);
    if h >= FRAC_PI_2 - LEAST_GAP && kappa <= LEAST_GAP {
        return f64::INFINITY;
    }
    let miss = portable::atan2(kappa * portable::sin(h), portable::cos(h)) - 2.0 * atan(kappa * tau);
    miss.max(0.0)
}

/// The angle of the rotation by which Gram-Schmidt of a blend misses.
pub(super) fn gram_schmidt(gap: f64) -> f64 {
    if gap <= LEAST_GAP {
        return f64::INFINITY;
    }
    2.0 * portable::asin(((1.0 - gap.sqrt()) / (1.0 + gap).sqrt()).clamp(0.0, 1.0))
}

/// The angle of the rotation by which the average misses when bones of total weight `dropped` are left out.
pub(super) fn fewer(spread: &Spread, dropped: f64) -> f64 {
    if dropped == 0.0 {
        return 0.0;
    }
    let beta = spread.farthest();
    let across = if beta < FRAC_PI_4 { portable::sin(2.0 * beta) } else { 1.0 };
    let room = spread.gap - dropped;
    if room > LEAST_GAP { portable::atan2(dropped * across, room) } else { f64::INFINITY }
}

/// What rounding may add, radians of rotation. An allowance, not a theorem: the first-order terms of the error analysis,
/// counted generously, and held against sweeps in the tests.
pub(in super::super) mod rounding {
    use super::{Spread, UNIT};

    /// A unit quaternion that is stored in `f32`, and the products that make it the posed one.
    pub(in super::super::super) const STORED: f64 = 24.0 * UNIT;

    /// The blend of n rotations in `f32` is off by (n + 2) unit round-offs of its norm, and what is read from it by that
    /// over the gap, besides `deviation`, by which the joints are no rotations. Lanes whose gap is too narrow for `f32`
    /// (λ2/λ1 above about 0.93) are decided in `f64`.
    pub(in super::super) fn blended(spread: &Spread, deviation: f64) -> f64 {
        const SETTLED_GAP: f64 = 0.0175;
        let own = (32.0 + 4.0 * spread.bones as f64) * UNIT + 4.0 * deviation;
        STORED + own / spread.gap.max(SETTLED_GAP)
    }

    /// A sum of n quaternions in `f32` that is at least half as long as its weights.
    pub(in super::super) fn summed(spread: &Spread) -> f64 {
        STORED + 6.0 * (spread.bones as f64 + 2.0) * UNIT
    }

    /// Projections in `f32`, which have no `f64` behind them.
    pub(in super::super) fn projected(spread: &Spread, deviation: f64) -> f64 {
        let own = (48.0 + 4.0 * spread.bones as f64) * UNIT + 8.0 * deviation;
        STORED + own / spread.gap.max(1e-12)
    }
}
