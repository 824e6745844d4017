//! The covariance axis: factors M with Σ = M Mᵀ, a block at a time.

use super::CovarianceChoice;
use super::blend::Blend;
use super::bound::Surface;
use super::layout::{Block, LANES, Lanes};
use super::rotate::take;
use crate::math::{Matrix3, matrix3, rotation};

/// Thickness of iHuman's discs along the normal: a standard deviation, metres.
const SURFEL_THICKNESS: f32 = 1e-3;

/// What is turned: R_c and S.
pub(super) struct Canonical {
    /// Unit quaternions.
    pub(super) rotations: [Lanes; 4],
    /// Standard deviations, metres.
    pub(super) scales: [Lanes; 3],
}

impl Canonical {
    /// The Gaussians of a block as stored, or as discs.
    #[inline(always)]
    pub(super) fn new(
        choice: CovarianceChoice,
        block: &Block,
        start: usize,
        surface: Option<&Surface>,
    ) -> Self {
        let mut canonical = Self { rotations: block.rotations, scales: block.scales };
        if let (CovarianceChoice::Surfel, Some(surface)) = (choice, surface) {
            canonical.flatten(block, start, surface);
        }
        canonical
    }

    /// iHuman's parameters: `R_c = [n | c r1 + s r2 | c r2 − s r1]` on the rest face and `S = (1 mm, e^s0, e^s1)`. The
    /// axis of R_c nearest to the normal becomes n, the in-plane angle (c, s) is the one nearest to the other two.
    /// Gaussians on a face without area are left as they are.
    #[inline(never)]
    fn flatten(&mut self, block: &Block, start: usize, surface: &Surface) {
        for lane in 0..LANES {
            let seat = &surface.seats[start + usize::from(block.index[lane])];
            let Some(frame) = surface.faces.edge01[seat.face as usize] else { continue };
            let own = rotation::quaternion_to_matrix_raw(take(&self.rotations, lane));
            // The columns of the shared frame are [d × n, −n, d]; iHuman's are [n, −d, d × n].
            let [n, r1, r2] = [(1, -1.0), (2, -1.0), (0, 1.0)]
                .map(|(k, sign): (usize, f32)| [frame[0][k], frame[1][k], frame[2][k]].map(|c| c * sign));
            let axes = matrix3::transpose(own);
            let height = axes.map(|axis| matrix3::dot(axis, n).abs());
            let thin = (0..3).fold(0, |best, k| if height[k] > height[best] { k } else { best });
            let [first, second] = [(thin + 1) % 3, (thin + 2) % 3];
            let flip = if matrix3::dot(axes[thin], n) < 0.0 { -1.0 } else { 1.0 };
            let (u, v) = (axes[first], axes[second].map(|c| c * flip));
            let cosine = matrix3::dot(u, r1) + matrix3::dot(v, r2);
            let sine = matrix3::dot(u, r2) - matrix3::dot(v, r1);
            let length = (cosine * cosine + sine * sine).sqrt();
            let (c, s) = if length > 1e-6 { (cosine / length, sine / length) } else { (1.0, 0.0) };
            let turned: Matrix3<f32> =
                std::array::from_fn(|row| [n[row], c * r1[row] + s * r2[row], c * r2[row] - s * r1[row]]);
            let quat = rotation::matrix_to_quaternion(turned);
            for k in 0..4 {
                self.rotations[k][lane] = quat[k];
            }
            let scales = [SURFEL_THICKNESS, self.scales[first][lane], self.scales[second][lane]];
            for axis in 0..3 {
                self.scales[axis][lane] = scales[axis];
            }
        }
    }
}

/// M per lane, row-major, from the posed quaternions or the blend.
#[inline(always)]
pub(super) fn factors(
    choice: CovarianceChoice,
    posed: &[Lanes; 4],
    blend: &Blend,
    canonical: &[Lanes; 4],
    scales: &[Lanes; 3],
) -> [Lanes; 9] {
    let mut factors = [[0.0; LANES]; 9];
    match choice {
        CovarianceChoice::Rotate | CovarianceChoice::Surfel => {
            for lane in 0..LANES {
                let rotation = rotation::quaternion_to_matrix_raw(take(posed, lane));
                put(&mut factors, lane, &rotation, scales);
            }
        }
        CovarianceChoice::Affine | CovarianceChoice::AffineConjugate => {
            let sign = if choice == CovarianceChoice::Affine { 1.0 } else { -1.0 };
            for lane in 0..LANES {
                let [w, x, y, z] = take(canonical, lane);
                let own = rotation::quaternion_to_matrix_raw([w, sign * x, sign * y, sign * z]);
                put(&mut factors, lane, &product(&blend.matrix(lane), &own), scales);
            }
        }
    }
    factors
}

/// Sets one lane to `matrix diag(scales)`.
#[inline(always)]
fn put(factors: &mut [Lanes; 9], lane: usize, matrix: &Matrix3<f32>, scales: &[Lanes; 3]) {
    for row in 0..3 {
        for column in 0..3 {
            factors[3 * row + column][lane] = matrix[row][column] * scales[column][lane];
        }
    }
}

/// a b, without the array adaptors that keep a loop from being vectorised.
#[inline(always)]
fn product(a: &Matrix3<f32>, b: &Matrix3<f32>) -> Matrix3<f32> {
    let mut product = [[0.0; 3]; 3];
    for row in 0..3 {
        for column in 0..3 {
            product[row][column] =
                a[row][0] * b[0][column] + a[row][1] * b[1][column] + a[row][2] * b[2][column];
        }
    }
    product
}
