//! What is asked for the rotation of a blend: every solver of Eq. 7, and every way to make the matrix B a rotation.

use skinsplat_core::math::average::{Solver, Start, average_rotation};
use skinsplat_core::math::dual_quaternion::{self, DualQuaternion};
use skinsplat_core::math::{Matrix3, Quaternion, Real, rotation};

/// A way to the rotation of a blend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Method {
    /// A solver of Eq. 7.
    Solver(Solver),
    /// The rotation nearest to B = Σ w R(q).
    Polar,
    /// Gram-Schmidt over the columns of B.
    GramSchmidtColumns,
    /// Gram-Schmidt over the rows of B.
    GramSchmidtRows,
    /// PyTorch3D's conversion of B, normalised.
    MatrixToQuaternion,
    /// The same, drawn as it is.
    MatrixToQuaternionRaw,
    /// The rotation of the dual-quaternion blend.
    DualQuaternion,
}

/// Every method, the exact ones first.
pub(super) const METHODS: [Method; 19] = [
    Method::Solver(Solver::ClosedForm),
    Method::Solver(Solver::Eigen),
    Method::Solver(Solver::Polar),
    Method::Polar,
    power(1, Start::Heaviest),
    power(5, Start::Heaviest),
    power(15, Start::Heaviest),
    power(15, Start::Ones),
    power(15, Start::Identity),
    power(15, Start::LargestColumn),
    power(100, Start::Heaviest),
    Method::Solver(Solver::Squaring { doublings: 4 }),
    Method::Solver(Solver::Squaring { doublings: 8 }),
    Method::Solver(Solver::Nlerp),
    Method::DualQuaternion,
    Method::GramSchmidtColumns,
    Method::GramSchmidtRows,
    Method::MatrixToQuaternion,
    Method::MatrixToQuaternionRaw,
];

const fn power(steps: u32, start: Start) -> Method {
    Method::Solver(Solver::Power { steps, start })
}

/// What a method answered, in `f64`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Answer {
    /// What is drawn; a rotation, or it should be.
    pub(super) matrix: Matrix3<f64>,
    /// The rotation that is meant, of unit length.
    pub(super) quat: Quaternion<f64>,
}

impl std::fmt::Display for Method {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Solver(solver) => return write!(f, "{solver}"),
            Self::Polar => "lbs-polar",
            Self::GramSchmidtColumns => "gram-schmidt-columns",
            Self::GramSchmidtRows => "gram-schmidt-rows",
            Self::MatrixToQuaternion => "matrix-to-quaternion",
            Self::MatrixToQuaternionRaw => "matrix-to-quaternion-raw",
            Self::DualQuaternion => "dual-quaternion",
        })
    }
}

impl Method {
    /// The answer of the method in the precision `T`; `None` where it says that there is none, or it is not finite.
    pub(super) fn answer<T: Real>(self, quats: &[Quaternion<T>], weights: &[T]) -> Option<Answer> {
        match self {
            Self::Solver(solver) => average_rotation(quats, weights, solver).and_then(of_quaternion),
            Self::DualQuaternion => {
                let motion =
                    |q: &Quaternion<T>| rotation::normalize(*q).map(|q| DualQuaternion::new(q, [T::ZERO; 3]));
                let motions = quats.iter().map(motion).collect::<Option<Vec<_>>>()?;
                of_quaternion(dual_quaternion::blend(&motions, weights)?.real)
            }
            Self::Polar => of_quaternion(rotation::polar(blend(quats, weights)?)?),
            Self::GramSchmidtColumns => {
                rotation::gram_schmidt_columns(blend(quats, weights)?).and_then(of_matrix)
            }
            Self::GramSchmidtRows => rotation::gram_schmidt_rows(blend(quats, weights)?).and_then(of_matrix),
            Self::MatrixToQuaternion => {
                let raw = rotation::matrix_to_quaternion_raw(blend(quats, weights)?);
                of_quaternion(rotation::normalize(raw)?)
            }
            Self::MatrixToQuaternionRaw => {
                of_quaternion(rotation::matrix_to_quaternion_raw(blend(quats, weights)?))
            }
        }
    }
}

/// B = Σ w R(q) in the precision `T`, weights as they are.
fn blend<T: Real>(quats: &[Quaternion<T>], weights: &[T]) -> Option<Matrix3<T>> {
    let mut sum = [[T::ZERO; 3]; 3];
    for (&q, &weight) in quats.iter().zip(weights) {
        let r = rotation::quaternion_to_matrix_raw(rotation::normalize(q)?);
        for i in 0..3 {
            for j in 0..3 {
                sum[i][j] += weight * r[i][j];
            }
        }
    }
    Some(sum)
}

fn of_quaternion<T: Real>(q: Quaternion<T>) -> Option<Answer> {
    let q = q.map(T::to_f64);
    let quat = rotation::normalize(q)?;
    Some(Answer { matrix: rotation::quaternion_to_matrix_raw(q), quat })
}

fn of_matrix<T: Real>(m: Matrix3<T>) -> Option<Answer> {
    let matrix = m.map(|row| row.map(T::to_f64));
    Some(Answer { matrix, quat: rotation::polar(matrix)? })
}
