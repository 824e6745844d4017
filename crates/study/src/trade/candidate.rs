//! Every way to make one rotation of several, in either precision.

use skinsplat_core::math::average::{Solver, Start, average_rotation};
use skinsplat_core::math::{Matrix3, Quaternion, Real, matrix3, rotation};

/// Power steps that are swept.
const STEPS: [u32; 14] = [1, 2, 3, 4, 5, 7, 10, 15, 20, 30, 40, 50, 70, 100];
/// Squarings that are swept: 2^n power steps each.
const DOUBLINGS: [u32; 6] = [1, 2, 3, 4, 6, 8];
/// Start vectors of power iterations.
const STARTS: [Start; 6] =
    [Start::Heaviest, Start::First, Start::Ones, Start::Identity, Start::Nlerp, Start::LargestColumn];

/// A way to make one rotation of several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Candidate {
    /// The average of quaternions (Eq. 7) by one of its solvers. `polar` reads the singular value decomposition.
    Average(Solver),
    /// The nearest rotation by Newton's iteration on the blended matrix.
    Newton,
    /// Gram-Schmidt over the columns of the blended matrix.
    GramSchmidtColumns,
    /// Gram-Schmidt over its rows.
    GramSchmidtRows,
    /// PyTorch3D's conversion of the blended matrix, normalised.
    MatrixToQuaternion,
}

impl Candidate {
    /// Everything that is swept, quick or in full.
    pub(super) fn all(quick: bool) -> Vec<Self> {
        let keep = |i: usize| !quick || i % 4 == 3;
        let steps = STEPS.iter().enumerate().filter(|&(i, _)| keep(i)).map(|(_, &steps)| steps);
        let power = steps.flat_map(|steps| STARTS.map(|start| Self::Average(Solver::Power { steps, start })));
        let squaring = DOUBLINGS.map(|doublings| Self::Average(Solver::Squaring { doublings }));
        let mut all = Self::EXACT.to_vec();
        all.extend([
            Self::Average(Solver::Nlerp),
            Self::GramSchmidtColumns,
            Self::GramSchmidtRows,
            Self::MatrixToQuaternion,
        ]);
        all.extend(squaring.into_iter().chain(power));
        if quick && !all.contains(&Self::ENGINE) {
            all.push(Self::ENGINE);
        }
        all
    }

    /// Those that are exact up to rounding.
    const EXACT: [Self; 4] = [
        Self::Average(Solver::ClosedForm),
        Self::Average(Solver::Eigen),
        Self::Average(Solver::Polar),
        Self::Newton,
    ];

    /// The paper's engine path.
    pub(super) const ENGINE: Self = Self::Average(Solver::Power { steps: 15, start: Start::Heaviest });

    /// The few that are swept against other axes.
    pub(super) fn representative() -> Vec<Self> {
        let mut few = Self::EXACT.to_vec();
        let power = |steps| Self::Average(Solver::Power { steps, start: Start::Heaviest });
        few.extend([power(3), Self::ENGINE, power(50)]);
        few.extend([Self::Average(Solver::Squaring { doublings: 4 }), Self::Average(Solver::Nlerp)]);
        few.extend([Self::GramSchmidtColumns, Self::MatrixToQuaternion]);
        few
    }

    /// The id in tables.
    pub(super) fn id(self) -> String {
        match self {
            Self::Average(Solver::Polar) => "polar-svd".to_owned(),
            Self::Average(solver) => solver.to_string(),
            Self::Newton => "polar-newton".to_owned(),
            Self::GramSchmidtColumns => "gram-schmidt-columns".to_owned(),
            Self::GramSchmidtRows => "gram-schmidt-rows".to_owned(),
            Self::MatrixToQuaternion => "matrix-to-quaternion".to_owned(),
        }
    }

    /// One rotation for unit quaternions and weights that sum to one; `None` where the way has no answer.
    pub(super) fn rotate<T: Real>(self, quats: &[Quaternion<T>], weights: &[T]) -> Option<Quaternion<T>> {
        match self {
            Self::Average(solver) => average_rotation(quats, weights, solver),
            Self::Newton => newton(blend(quats, weights)).map(rotation::matrix_to_quaternion),
            Self::GramSchmidtColumns => {
                rotation::gram_schmidt_columns(blend(quats, weights)).map(rotation::matrix_to_quaternion)
            }
            Self::GramSchmidtRows => {
                rotation::gram_schmidt_rows(blend(quats, weights)).map(rotation::matrix_to_quaternion)
            }
            Self::MatrixToQuaternion => {
                rotation::normalize(rotation::matrix_to_quaternion_raw(blend(quats, weights)))
            }
        }
    }
}

/// B = Σ w R(q).
fn blend<T: Real>(quats: &[Quaternion<T>], weights: &[T]) -> Matrix3<T> {
    let mut sum = [[T::ZERO; 3]; 3];
    for (&q, &weight) in quats.iter().zip(weights) {
        let r = rotation::quaternion_to_matrix_raw(q);
        for i in 0..3 {
            for j in 0..3 {
                sum[i][j] += weight * r[i][j];
            }
        }
    }
    sum
}

/// Most Newton iterations; quadratic convergence needs about ten from a condition number of 1e3.
const NEWTON_ITERATIONS: usize = 40;

/// The nearest rotation by Newton's iteration X ← (X + X⁻ᵀ) / 2 (Higham 1986). `None` if the determinant is not
/// positive, where it would find a reflection or nothing.
fn newton<T: Real>(m: Matrix3<T>) -> Option<Matrix3<T>> {
    let half = T::from_f64(0.5);
    let enough = T::from_f64(8.0) * T::EPSILON;
    let mut x = m;
    for _ in 0..NEWTON_ITERATIONS {
        let determinant = matrix3::determinant(x);
        if !(determinant > T::ZERO && determinant.is_finite()) {
            return None;
        }
        let [a, b, c] = x;
        // Rows of the cofactor matrix are vector products of the others; divided by the determinant they are X⁻ᵀ.
        let cofactors = [matrix3::cross(b, c), matrix3::cross(c, a), matrix3::cross(a, b)];
        let mut change = T::ZERO;
        for i in 0..3 {
            for j in 0..3 {
                let next = half * (x[i][j] + cofactors[i][j] / determinant);
                change = change.max((next - x[i][j]).abs());
                x[i][j] = next;
            }
        }
        if change <= enough {
            return Some(x);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use skinsplat_core::math::random::SplitMix64;

    fn quat(random: &mut SplitMix64) -> Quaternion<f64> {
        let q = [(); 4].map(|()| f64::from(random.unit_f32()) - 0.5);
        rotation::normalize(q).expect("not zero")
    }

    #[test]
    fn newton_and_the_decomposition_find_the_same_rotation() {
        let mut random = SplitMix64::new(5);
        let mut compared = 0;
        for _ in 0..500 {
            let quats = [quat(&mut random), quat(&mut random), quat(&mut random)];
            let weights = [0.5, 0.3, 0.2];
            let Some(found) = Candidate::Newton.rotate(&quats, &weights) else {
                assert!(matrix3::determinant(blend(&quats, &weights)) < 1e-6);
                continue;
            };
            let exact = Candidate::Average(Solver::Eigen).rotate(&quats, &weights).expect("an average");
            // Newton squares the condition number of nearly singular blends.
            assert!(rotation::angle_between(found, exact) < 1e-6, "{quats:?}");
            compared += 1;
        }
        assert!(compared > 200, "{compared}");
    }

    #[test]
    fn ids_are_unique_and_the_engine_path_is_always_there() {
        for quick in [true, false] {
            let mut ids: Vec<String> = Candidate::all(quick).into_iter().map(Candidate::id).collect();
            assert!(ids.contains(&"power-15".to_owned()));
            let count = ids.len();
            ids.sort();
            ids.dedup();
            assert_eq!(ids.len(), count);
        }
    }

    #[test]
    fn reflections_have_no_newton_answer() {
        let flipped = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -0.5]];
        assert_eq!(newton(flipped), None);
        assert_eq!(newton::<f32>([[0.0; 3]; 3]), None);
    }
}
