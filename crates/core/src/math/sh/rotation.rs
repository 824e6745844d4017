//! Rotation of spherical-harmonic coefficients (Eq. 9 of the paper).

use super::super::rotation::{matrix_to_quaternion, normalize};
use super::super::{Matrix3, Quaternion, Real};
use super::{MAX_DEGREE, count};

/// The Wigner matrices D1, D2, D3 of a rotation R in the 3DGS basis, in factors: `evaluate(D c, d)` is
/// `evaluate(c, Rᵀ d)`.
///
/// R = Rz(α) Ry(β) Rz(γ) and Ry(β) = J Rz(−β) J with J the exchange of y and z, so that
/// D(R) = Z(α) J Z(−β) J Z(γ). A turn Z about the polar axis mixes only m and −m, and the constant J of a degree has at
/// most two entries a row (Pinchon, Hoggan 2007, "Rotation matrices for real spherical harmonics"): 104 multiplications
/// per channel for degrees 1 to 3 and nothing to set up but three angles, against 83 with dense matrices that cost some
/// 400 to build. The angles come from the half-angles in the quaternion, cos and sin only, so nothing is lost where
/// β is 0 or π.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotation<T> {
    degree: usize,
    /// γ, −β, α in the order of application.
    turns: [Turn<T>; 3],
}

/// (cos kθ, sin kθ) for k = 1, 2, 3.
type Turn<T> = [[T; 2]; 3];

impl<T: Real> Rotation<T> {
    /// The rotation by a proper rotation matrix `r`, up to `degree` (at most 3; more counts as 3). An improper or
    /// sheared matrix has no D: project it first.
    pub fn new(r: Matrix3<T>, degree: usize) -> Self {
        Self::from_unit_quaternion(matrix_to_quaternion(r), degree)
    }

    /// The rotation by a quaternion of any length and sign; the identity if it is zero or not finite.
    pub fn from_quaternion(q: Quaternion<T>, degree: usize) -> Self {
        Self::from_unit_quaternion(normalize(q).unwrap_or_else(super::super::rotation::identity), degree)
    }

    /// [`Rotation::from_quaternion`] for a quaternion that has unit length.
    #[inline]
    pub fn from_unit_quaternion([w, x, y, z]: Quaternion<T>, degree: usize) -> Self {
        // (w, z) = cos β/2 · (cos, sin)((α + γ)/2), (y, −x) = sin β/2 · (cos, sin)((α − γ)/2).
        let (cos2, half_sum) = direction(w, z);
        let (sin2, half_difference) = direction(y, -x);
        let alpha = compose(half_sum, half_difference);
        let gamma = compose(half_sum, [half_difference[0], -half_difference[1]]);
        let sin_beta = T::from_f64(2.0) * (cos2 * sin2).sqrt();
        Self {
            degree: degree.min(MAX_DEGREE),
            turns: [gamma, [cos2 - sin2, -sin_beta], alpha].map(multiples),
        }
    }

    /// Rotates coefficients in place: `coefficients[1..4]`, `[4..9]`, `[9..16]` by D1, D2, D3. Bands above the degree,
    /// or that the slice does not hold in full, are left alone.
    #[inline]
    pub fn apply(&self, coefficients: &mut [[T; 3]]) {
        if self.degree >= 1
            && let Some(band) = band_mut::<T, 3>(coefficients)
        {
            *band = self.band(*band, exchange_1::<T>);
        }
        if self.degree >= 2
            && let Some(band) = band_mut::<T, 5>(coefficients)
        {
            *band = self.band(*band, exchange_2::<T>);
        }
        if self.degree >= 3
            && let Some(band) = band_mut::<T, 7>(coefficients)
        {
            *band = self.band(*band, exchange_3::<T>);
        }
    }

    /// D of degree l as a matrix, N = 2 l + 1 (3, 5 or 7): column vectors of coefficients, m = −l … l.
    pub fn matrix<const N: usize>(&self) -> [[T; N]; N] {
        const { assert!(N == 3 || N == 5 || N == 7, "degree 1, 2 or 3") }
        let full = Self { degree: MAX_DEGREE, ..*self };
        let offset = count((N - 1) / 2 - 1);
        let mut matrix = [[T::ZERO; N]; N];
        for column in 0..N {
            let mut coefficients = [[T::ZERO; 3]; count(MAX_DEGREE)];
            coefficients[offset + column][0] = T::ONE;
            full.apply(&mut coefficients);
            for row in 0..N {
                matrix[row][column] = coefficients[offset + row][0];
            }
        }
        matrix
    }

    /// Z(α) J Z(−β) J Z(γ) of one band.
    #[inline(always)]
    fn band<const N: usize>(
        &self,
        band: [[T; 3]; N],
        exchange: impl Fn([T::Triple; N]) -> [T::Triple; N],
    ) -> [[T; 3]; N] {
        let [gamma, beta, alpha] = &self.turns;
        let c = about_z::<T, N>(band.map(T::Triple::from), gamma);
        let c = about_z::<T, N>(exchange(c), beta);
        about_z::<T, N>(exchange(c), alpha).map(Into::into)
    }
}

/// The derivative of `⟨gradient, D(ω) coefficients⟩` with respect to a further rotation by ω (axis times angle), at
/// ω = 0: how a loss changes when SH that are already rotated are turned on, about x, y and z. Degrees as in
/// [`Rotation::apply`].
///
/// With L the derivative of D about an axis: L_z mixes m and −m, L_y = −J L_z J, and L_x = \[L_y, L_z\]; all are
/// antisymmetric.
pub fn torque<T: Real>(degree: usize, coefficients: &[[T; 3]], gradient: &[[T; 3]]) -> [T; 3] {
    let mut sum = [T::ZERO; 3];
    let mut add = |band: Option<[T; 3]>| {
        for (sum, own) in sum.iter_mut().zip(band.unwrap_or_default()) {
            *sum += own;
        }
    };
    if degree >= 1 {
        add(torque_of_band(coefficients, gradient, exchange_1::<T>));
    }
    if degree >= 2 {
        add(torque_of_band(coefficients, gradient, exchange_2::<T>));
    }
    if degree >= 3 {
        add(torque_of_band(coefficients, gradient, exchange_3::<T>));
    }
    sum
}

fn torque_of_band<T: Real, const N: usize>(
    coefficients: &[[T; 3]],
    gradient: &[[T; 3]],
    exchange: impl Fn([T::Triple; N]) -> [T::Triple; N],
) -> Option<[T; 3]> {
    let offset = count((N - 1) / 2 - 1);
    let band = |values: &[[T; 3]]| -> Option<[T::Triple; N]> {
        let own: [[T; 3]; N] = values.get(offset..offset + N)?.try_into().ok()?;
        Some(own.map(T::Triple::from))
    };
    let (c, u) = (band(coefficients)?, band(gradient)?);
    let generators = |v| (exchange(spin_z::<T, N>(exchange(v))).map(|e| -e), spin_z::<T, N>(v));
    let ((y_c, z_c), (y_u, z_u)) = (generators(c), generators(u));
    let dot = |a: [T::Triple; N], b: [T::Triple; N]| {
        let products = a.into_iter().zip(b).map(|(a, b)| super::super::matrix3::dot(a.into(), b.into()));
        products.fold(T::ZERO, |sum, product| sum + product)
    };
    Some([dot(z_u, y_c) - dot(y_u, z_c), dot(u, y_c), dot(u, z_c)])
}

/// The derivative of [`about_z`] at the angle 0.
fn spin_z<T: Real, const N: usize>(c: [T::Triple; N]) -> [T::Triple; N] {
    let centre = N / 2;
    std::array::from_fn(|i| {
        let m = T::from_f64(i as f64 - centre as f64);
        -(c[N - 1 - i] * m)
    })
}

/// The coefficients of the band with N = 2 l + 1 members.
#[inline(always)]
fn band_mut<T, const N: usize>(coefficients: &mut [[T; 3]]) -> Option<&mut [[T; 3]; N]> {
    let offset = count((N - 1) / 2 - 1);
    coefficients.get_mut(offset..offset + N)?.try_into().ok()
}

/// (a² + b², (a, b) / √(a² + b²)), the direction (1, 0) where a² + b² is too small to matter.
#[inline(always)]
fn direction<T: Real>(a: T, b: T) -> (T, [T; 2]) {
    let squared = a * a + b * b;
    let epsilon2 = T::EPSILON * T::EPSILON;
    if squared < epsilon2 * epsilon2 {
        return (squared, [T::ONE, T::ZERO]);
    }
    let inverse = T::ONE / squared.sqrt();
    (squared, [a * inverse, b * inverse])
}

/// The sum of two angles given by cosine and sine.
#[inline(always)]
fn compose<T: Real>([c, s]: [T; 2], [d, t]: [T; 2]) -> [T; 2] {
    [c * d - s * t, s * d + c * t]
}

#[inline(always)]
fn multiples<T: Real>(angle: [T; 2]) -> Turn<T> {
    let double = compose(angle, angle);
    [angle, double, compose(double, angle)]
}

/// A turn about the polar axis: m and −m mix by the angle m θ.
#[inline(always)]
fn about_z<T: Real, const N: usize>(mut c: [T::Triple; N], turn: &Turn<T>) -> [T::Triple; N] {
    let centre = N / 2;
    for m in 1..=centre {
        let [cos, sin] = turn[m - 1];
        let (plus, minus) = (c[centre + m], c[centre - m]);
        c[centre + m] = plus * cos - minus * sin;
        c[centre - m] = plus * sin + minus * cos;
    }
    c
}

/// The exchange of y and z (an improper map, its own inverse) on degree 1.
#[inline(always)]
fn exchange_1<T: Real>([a, b, c]: [T::Triple; 3]) -> [T::Triple; 3] {
    [-b, -a, c]
}

/// The exchange of y and z on degree 2.
#[inline(always)]
fn exchange_2<T: Real>([a, b, c, d, e]: [T::Triple; 5]) -> [T::Triple; 5] {
    let (half, root) = (T::from_f64(0.5), T::from_f64(0.866_025_403_784_438_6)); // √3/2
    [-d, b, -(c * half + e * root), -a, e * half - c * root]
}

/// The exchange of y and z on degree 3.
#[inline(always)]
fn exchange_3<T: Real>([a, b, c, d, e, f, g]: [T::Triple; 7]) -> [T::Triple; 7] {
    let (quarter, root15) = (T::from_f64(0.25), T::from_f64(0.968_245_836_551_854_2)); // √15/4
    let (root10, root6) = (T::from_f64(0.790_569_415_042_094_8), T::from_f64(0.612_372_435_695_794_5)); // √10/4, √6/4
    [
        d * root10 - f * root6,
        b,
        d * root6 + f * root10,
        a * root10 + c * root6,
        -(e * quarter + g * root15),
        c * root10 - a * root6,
        g * quarter - e * root15,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torque_is_the_derivative_of_the_rotation() {
        let wave = |k: usize, f: f64| [0, 1, 2].map(|c| ((k * 3 + c) as f64 * f + 1.0).sin());
        let coefficients: Vec<[f64; 3]> = (0..16).map(|k| wave(k, 0.7)).collect();
        let gradient: Vec<[f64; 3]> = (0..16).map(|k| wave(k, 1.9)).collect();
        for degree in 0..=MAX_DEGREE {
            let loss = |axis: usize, angle: f64| {
                let mut q = [(angle / 2.0).cos(), 0.0, 0.0, 0.0];
                q[1 + axis] = (angle / 2.0).sin();
                let mut turned = coefficients.clone();
                Rotation::from_quaternion(q, degree).apply(&mut turned);
                turned.iter().flatten().zip(gradient.iter().flatten()).map(|(a, b)| a * b).sum::<f64>()
            };
            let h = 1e-5;
            for (axis, found) in torque(degree, &coefficients, &gradient).into_iter().enumerate() {
                let expected = (loss(axis, h) - loss(axis, -h)) / (2.0 * h);
                assert!((found - expected).abs() < 1e-8, "degree {degree}, axis {axis}: {found} {expected}");
            }
        }
        assert_eq!(torque(3, &coefficients[..9], &gradient), torque(2, &coefficients, &gradient));
    }
}
