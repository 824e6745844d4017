//! Weighted averages of rotations: Eq. 7 of the paper (Markley et al. 2007, "Averaging Quaternions") and what is used
//! in its place.
//!
//! The average of unit quaternions q_j with weights w_j is the eigenvector of A = Σ w_j q_j q_jᵀ with the largest
//! eigenvalue. It is also the rotation nearest to the linear blend B = Σ w_j R(q_j), because
//! tr(R(q)ᵀB) = 4 qᵀAq − Σ w_j: [`Solver::Eigen`] and [`Solver::Polar`] are each other's oracle.
//!
//! # Ties
//! Where the largest eigenvalue is not simple (its distance to the next is within 16 ulp of it: two equally weighted
//! bones 180° apart, for example), every unit vector of the top eigenspace is an average. The exact solvers then answer
//! with the one nearest to the heaviest bone, the first of equally heavy ones; a bone that lies more than 60° (as a
//! line in R⁴) off the eigenspace is passed over. For two bones that is the first bone itself. The rule commutes with
//! rotations of the world and of the rest pose, like the average.

mod adjoint;
pub mod eigen;
pub mod lanes;
mod power;
mod solver;
mod squaring;
mod two_bones;

pub use adjoint::average_rotation_adjoint;
pub use power::power_iterate;
pub use solver::{ParseSolverError, Solver, Start};
pub use two_bones::two_bones;

use super::rotation::{self, SignPolicy};
use super::{Matrix3, Quaternion, Real, dot4, is_distinct};
use eigen::SymmetricEigen;
use squaring::Symmetric;
use std::marker::PhantomData;

/// A weighted average of rotations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Average<T> {
    /// The average, of unit length, the component of largest magnitude positive (the first of equals).
    pub quat: Quaternion<T>,
    /// (λ1 − λ2) / λ1 of A = Σ w q qᵀ, in \[0, 1\]: how well the problem (not the solver) determines the answer.
    /// An error ε in the quaternions moves the average by about ε / gap. Computed in `f64`.
    pub gap: T,
    /// The gap is wider than 16 ulp (of `T`); otherwise `quat` is the choice that the module documents.
    pub unique: bool,
}

/// The average of rotations, and how well it is determined. See [`average_rotation`] for the arguments and for `None`.
pub fn average<T: Real>(quats: &[Quaternion<T>], weights: &[T], solver: Solver) -> Option<Average<T>> {
    let quat = average_rotation(quats, weights, solver)?;
    let gap = Bones::<f64>::new(quats, weights)?.relative_gap();
    let unique = is_distinct(T::from_f64(gap), T::ONE);
    Some(Average { quat, gap: T::from_f64(gap), unique })
}

/// The average of rotations alone: `average(..).quat`, without the cost of the gap.
///
/// Quaternions need not have unit length (they are normalised first) and their signs do not matter. Weights need not
/// sum to one. Bones with weight 0 do not count; a single bone left is returned as it is, whatever the solver.
///
/// `None` where there is no average: slices of different length, a weight that is negative or not finite, a quaternion
/// that is not finite, a zero quaternion with a positive weight, no positive weight.
pub fn average_rotation<T: Real>(
    quats: &[Quaternion<T>],
    weights: &[T],
    solver: Solver,
) -> Option<Quaternion<T>> {
    let quat = match solver {
        // Decides near degeneracy, so it accumulates in f64 for both precisions.
        Solver::ClosedForm => Bones::<f64>::new(quats, weights)?.closed_form().map(T::from_f64),
        _ => Bones::<T>::new(quats, weights)?.solve(solver),
    };
    Some(SignPolicy::LargestPositive.apply(quat, quat))
}

/// Checked input, read in the precision `T` of the solver and held in the precision `S` of the storage.
struct Bones<'a, T, S = T> {
    quats: &'a [Quaternion<S>],
    weights: &'a [S],
    /// Index of the first bone that has the largest weight.
    heaviest: usize,
    /// Indices of the first and the last bone with a positive weight.
    first: usize,
    last: usize,
    /// Number of positive weights.
    count: usize,
    precision: PhantomData<T>,
}

impl<'a, T: Real> Bones<'a, T> {
    /// Checks the input. See [`average_rotation`].
    #[inline]
    fn new<S: Real>(quats: &'a [Quaternion<S>], weights: &'a [S]) -> Option<Bones<'a, T, S>> {
        if quats.len() != weights.len() {
            return None;
        }
        let mut bones =
            Bones { quats, weights, heaviest: 0, first: 0, last: 0, count: 0, precision: PhantomData };
        for index in 0..quats.len() {
            let (quat, weight) = (quats[index], weights[index]);
            if !is_usable(quat, weight) {
                return None;
            }
            if weight > S::ZERO {
                if bones.count == 0 {
                    (bones.first, bones.heaviest) = (index, index);
                }
                bones.heaviest = if weight > weights[bones.heaviest] { index } else { bones.heaviest };
                bones.last = index;
                bones.count += 1;
            }
        }
        (bones.count > 0).then_some(bones)
    }
}

/// Weight finite and not negative, quaternion finite, and not zero if it counts.
#[inline]
fn is_usable<T: Real>(quat: Quaternion<T>, weight: T) -> bool {
    let squared = dot4(quat, quat);
    let weight_is_usable = weight >= T::ZERO && weight.is_finite();
    // The square decides unless it overflowed or underflowed.
    let is_plain = squared > T::MIN_POSITIVE && squared.is_finite();
    weight_is_usable
        && (is_plain
            || quat.iter().all(|c| c.is_finite())
                && (weight == T::ZERO || quat.iter().any(|&c| c != T::ZERO)))
}

impl<T: Real, S: Real> Bones<'_, T, S> {
    /// A bone that counts, of unit length.
    #[inline]
    fn unit(&self, index: usize) -> Quaternion<T> {
        let [w, x, y, z] = self.quats[index];
        let q = [
            T::from_f64(w.to_f64()),
            T::from_f64(x.to_f64()),
            T::from_f64(y.to_f64()),
            T::from_f64(z.to_f64()),
        ];
        rotation::normalize(q).expect("checked to be finite and not zero")
    }

    /// The weight of a bone relative to the heaviest, which keeps sums in range.
    #[inline]
    fn relative_weight(&self, index: usize) -> T {
        T::from_f64(self.weights[index].to_f64() / self.weights[self.heaviest].to_f64())
    }

    /// Bones that count: (unit quaternion, weight relative to the heaviest).
    #[inline]
    fn iter(&self) -> impl Iterator<Item = (Quaternion<T>, T)> {
        (self.first..=self.last)
            .filter(|&index| self.weights[index] > S::ZERO)
            .map(|index| (self.unit(index), self.relative_weight(index)))
    }

    /// The heaviest bone, of unit length.
    #[inline]
    fn heaviest(&self) -> Quaternion<T> {
        self.unit(self.heaviest)
    }

    /// Both bones with their weights, if two count.
    #[inline]
    fn pair(&self) -> Option<[(Quaternion<T>, T); 2]> {
        (self.count == 2).then(|| [self.first, self.last].map(|i| (self.unit(i), self.relative_weight(i))))
    }

    /// A = Σ w q qᵀ with weights relative to the heaviest.
    fn outer_sum(&self) -> Symmetric<T> {
        let mut sum = [T::ZERO; 10];
        for ([w, x, y, z], weight) in self.iter() {
            let [sw, sx, sy, sz] = [weight * w, weight * x, weight * y, weight * z];
            let terms = [sw * w, sw * x, sw * y, sw * z, sx * x, sx * y, sx * z, sy * y, sy * z, sz * z];
            for (entry, term) in sum.iter_mut().zip(terms) {
                *entry += term;
            }
        }
        sum
    }

    /// B = Σ w R(q) with weights relative to the heaviest.
    fn blend(&self) -> Matrix3<T> {
        let mut b = [[T::ZERO; 3]; 3];
        for (q, weight) in self.iter() {
            let r = rotation::quaternion_to_matrix_raw(q);
            for i in 0..3 {
                for j in 0..3 {
                    b[i][j] += weight * r[i][j];
                }
            }
        }
        b
    }

    /// Σ w q, each q in the hemisphere of the heaviest bone, normalised. Not zero: no term has an inner product with the
    /// heaviest bone that is less than 0 by more than rounding, and that bone's own is 1.
    fn nlerp(&self) -> Quaternion<T> {
        let reference = self.heaviest();
        let mut sum = [T::ZERO; 4];
        for (q, weight) in self.iter() {
            let weight = if rotation::is_opposite(q, reference) { -weight } else { weight };
            for k in 0..4 {
                sum[k] += weight * q[k];
            }
        }
        rotation::normalize(sum).unwrap_or(reference)
    }

    /// The documented choice where the average is not unique.
    fn tie_break(&self, eigen: &SymmetricEigen<T>) -> Quaternion<T> {
        eigen::nearest_in_top_space(eigen, eigen.values[0], self.iter())
    }

    /// The leading eigenvector by Jacobi, or the choice for ties.
    fn eigen(&self, a: &Symmetric<T>) -> Quaternion<T> {
        let eigen = SymmetricEigen::new(squaring::rows(a));
        if is_distinct(eigen.values[0] - eigen.values[1], eigen.values[0]) {
            // The product of some thirty plane rotations has drifted from unit length by a few ulp.
            rotation::normalize(eigen.vectors[0]).unwrap_or(eigen.vectors[0])
        } else {
            self.tie_break(&eigen)
        }
    }

    /// No work for one bone, the formula for two, repeated squaring for more with Jacobi behind it.
    fn closed_form(&self) -> Quaternion<T> {
        if self.count == 1 {
            return self.heaviest();
        }
        if let Some([(p, u), (q, v)]) = self.pair() {
            return two_bones(p, u, q, v).unwrap_or_else(|| self.heaviest());
        }
        let a = self.outer_sum();
        squaring::dominant_eigenvector(&a).unwrap_or_else(|| self.eigen(&a))
    }

    /// Every solver but the closed form, in the precision `T`.
    fn solve(&self, solver: Solver) -> Quaternion<T> {
        if self.count == 1 {
            return self.heaviest();
        }
        match solver {
            Solver::ClosedForm => self.closed_form(),
            Solver::Eigen => self.eigen(&self.outer_sum()),
            Solver::Polar => rotation::proper_polar_factor(self.blend())
                .map_or_else(|| self.eigen(&self.outer_sum()), rotation::matrix_to_quaternion),
            Solver::Power { steps, start } => {
                let a = self.outer_sum();
                power_iterate(squaring::rows(&a), self.start(start, &a), steps)
            }
            Solver::Squaring { doublings } => squaring::square_times(&self.outer_sum(), doublings),
            Solver::Nlerp => self.nlerp(),
        }
    }

    /// The start vector of a power iteration.
    fn start(&self, start: Start, a: &Symmetric<T>) -> Quaternion<T> {
        match start {
            Start::Heaviest => self.heaviest(),
            Start::First => self.iter().next().map_or_else(rotation::identity, |(q, _)| q),
            Start::Ones => [T::from_f64(0.5); 4],
            Start::Identity => rotation::identity(),
            Start::Nlerp => self.nlerp(),
            Start::LargestColumn => squaring::largest_column(a),
        }
    }

    /// (λ1 − λ2) / λ1.
    fn relative_gap(&self) -> T {
        if self.count == 1 {
            return T::ONE;
        }
        if let Some([(p, u), (q, v)]) = self.pair() {
            return two_bones::relative_gap(p, u, q, v);
        }
        let [first, second, ..] = SymmetricEigen::new(squaring::rows(&self.outer_sum())).values;
        ((first - second) / first).max(T::ZERO).min(T::ONE)
    }
}
