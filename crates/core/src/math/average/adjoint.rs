//! Averages walked backwards: from the derivative with respect to the average to those with respect to the bones.

use super::super::rotation::{adjoint, normalize};
use super::super::{Quaternion, dot4, is_distinct, rotation};
use super::eigen::SymmetricEigen;
use super::squaring::rows;
use super::{Bones, Solver, Start, average_rotation};

/// A 4x4 matrix, row-major.
type Matrix4 = [[f64; 4]; 4];

/// Of [`average_rotation`]: calls `add` with the index of each bone that counts and the derivative with respect to its
/// quaternion (of unit length; the part along it means nothing), from that with respect to the average. Weights are constants.
///
/// * The exact solvers: with q the eigenvector of λ1 and z = Σ v_k (v_k · g) / (λ1 − λ_k) over the other eigenpairs of
///   A = Σ w q_j q_jᵀ, bone j has w_j ((q_j · q) z + (q_j · z) q). Where the gap λ1 − λ2 cannot be told from 0 the average is a
///   choice, and v_2 is left out.
/// * Power iteration and squaring: of what they compute, step by step, and of where they start.
/// * The normalised sum: signs are constants.
///
/// Nothing where there is no average.
pub fn average_rotation_adjoint(
    quats: &[Quaternion<f64>],
    weights: &[f64],
    solver: Solver,
    upstream: Quaternion<f64>,
    mut add: impl FnMut(usize, Quaternion<f64>),
) {
    let (Some(bones), Some(average)) =
        (Bones::<f64>::new(quats, weights), average_rotation(quats, weights, solver))
    else {
        return;
    };
    if bones.count == 1 {
        return bones.of_bone(bones.heaviest, average, upstream, &mut add);
    }
    match solver {
        Solver::ClosedForm | Solver::Eigen | Solver::Polar => {
            bones.of_eigenvector(average, upstream, &mut add)
        }
        Solver::Nlerp => bones.of_sum(average, upstream, &mut add),
        Solver::Power { steps, start } => bones.of_power(steps, start, average, upstream, &mut add),
        Solver::Squaring { doublings } => bones.of_squaring(doublings, average, upstream, &mut add),
    }
}

impl Bones<'_, f64> {
    /// Indices of the bones that count.
    fn indices(&self) -> impl Iterator<Item = usize> {
        (self.first..=self.last).filter(|&index| self.weights[index] > 0.0)
    }

    /// The average is this bone, of either sign.
    fn of_bone(
        &self,
        bone: usize,
        average: Quaternion<f64>,
        g: Quaternion<f64>,
        add: &mut impl FnMut(usize, Quaternion<f64>),
    ) {
        let sign = 1.0f64.copysign(dot4(self.unit(bone), average));
        add(bone, g.map(|c| sign * c));
    }

    fn of_eigenvector(
        &self,
        q: Quaternion<f64>,
        g: Quaternion<f64>,
        add: &mut impl FnMut(usize, Quaternion<f64>),
    ) {
        let SymmetricEigen { values, vectors } = SymmetricEigen::new(rows(&self.outer_sum()));
        let mut z = [0.0; 4];
        for k in 1..4 {
            let gap = values[0] - values[k];
            if is_distinct(gap, values[0]) {
                let along = dot4(vectors[k], g) / gap;
                (0..4).for_each(|i| z[i] += along * vectors[k][i]);
            }
        }
        for index in self.indices() {
            let (own, weight) = (self.unit(index), self.relative_weight(index));
            let (along_q, along_z) = (weight * dot4(own, q), weight * dot4(own, z));
            add(index, [0, 1, 2, 3].map(|k: usize| along_q * z[k] + along_z * q[k]));
        }
    }

    fn of_sum(
        &self,
        average: Quaternion<f64>,
        g: Quaternion<f64>,
        add: &mut impl FnMut(usize, Quaternion<f64>),
    ) {
        let reference = self.heaviest();
        let signed = |index: usize| {
            let own = self.unit(index);
            let sign = if rotation::is_opposite(own, reference) { -1.0 } else { 1.0 };
            (own, sign * self.relative_weight(index))
        };
        let mut sum = [0.0; 4];
        for (own, weight) in self.indices().map(signed) {
            (0..4).for_each(|k| sum[k] += weight * own[k]);
        }
        // Of either sign, as the average is.
        let of_sum = adjoint::normalize(average, 1.0 / dot4(average, sum), g);
        for index in self.indices() {
            let weight = signed(index).1;
            add(index, of_sum.map(|c| weight * c));
        }
    }

    /// v ← A v / |A v|, from the last step to the first.
    fn of_power(
        &self,
        steps: u32,
        start: Start,
        average: Quaternion<f64>,
        g: Quaternion<f64>,
        add: &mut impl FnMut(usize, Quaternion<f64>),
    ) {
        let sum = self.outer_sum();
        let a = rows(&sum);
        let first = normalize(self.start(start, &sum)).unwrap_or([1.0, 0.0, 0.0, 0.0]);
        let mut way = vec![(first, 1.0)];
        for _ in 0..steps {
            let pushed = a.map(|row| dot4(row, way[way.len() - 1].0));
            let Some(next) = normalize(pushed) else { break };
            way.push((next, dot4(next, pushed)));
        }
        let last = way[way.len() - 1].0;
        let sign = 1.0f64.copysign(dot4(last, average));
        let (mut of_vector, mut of_a) = (g.map(|c| sign * c), [[0.0; 4]; 4]);
        for pair in way.windows(2).rev() {
            let ((before, _), (after, length)) = (pair[0], pair[1]);
            let of_pushed = adjoint::normalize(after, 1.0 / length, of_vector);
            add_outer(&mut of_a, of_pushed, before);
            of_vector = a.map(|row| dot4(row, of_pushed));
        }
        match start {
            Start::Heaviest => self.of_bone(self.heaviest, self.heaviest(), of_vector, add),
            Start::First => self.of_bone(self.first, self.unit(self.first), of_vector, add),
            Start::Ones | Start::Identity => {}
            Start::Nlerp => self.of_sum(first, of_vector, add),
            Start::LargestColumn => of_largest_column(&a, of_vector, &mut of_a),
        }
        self.of_outer_sum(&of_a, add);
    }

    /// A ← A² / tr A², from the last squaring to the first.
    fn of_squaring(
        &self,
        doublings: u32,
        average: Quaternion<f64>,
        g: Quaternion<f64>,
        add: &mut impl FnMut(usize, Quaternion<f64>),
    ) {
        let a = rows(&self.outer_sum());
        let scale = trace(&a);
        let mut way = vec![(a.map(|row| row.map(|c| c / scale)), 1.0)];
        for _ in 0..doublings {
            let square = multiply(&way[way.len() - 1].0, &way[way.len() - 1].0);
            let trace = trace(&square);
            way.push((square.map(|row| row.map(|c| c / trace)), trace));
        }
        let last = way[way.len() - 1].0;
        let mut of_last = [[0.0; 4]; 4];
        let sign = 1.0f64.copysign(dot4(largest_column(&last).1, average));
        of_largest_column(&last, g.map(|c| sign * c), &mut of_last);
        for pair in way.windows(2).rev() {
            let ((before, _), (after, trace)) = (&pair[0], &pair[1]);
            let of_square = of_unit_trace(&of_last, after, *trace);
            let (left, right) = (multiply(&of_square, before), multiply(before, &of_square));
            of_last = left;
            (0..16).for_each(|k| of_last[k / 4][k % 4] += right[k / 4][k % 4]);
        }
        self.of_outer_sum(&of_unit_trace(&of_last, &way[0].0, scale), add);
    }

    /// From the entries of A = Σ w q qᵀ, each by itself.
    fn of_outer_sum(&self, of_a: &Matrix4, add: &mut impl FnMut(usize, Quaternion<f64>)) {
        for index in self.indices() {
            let (own, weight) = (self.unit(index), self.relative_weight(index));
            let of_own = [0, 1, 2, 3].map(|i: usize| {
                let both = [0, 1, 2, 3].map(|j: usize| of_a[i][j] + of_a[j][i]);
                weight * dot4(both, own)
            });
            add(index, of_own);
        }
    }
}

fn trace(a: &Matrix4) -> f64 {
    (a[0][0] + a[1][1]) + (a[2][2] + a[3][3])
}

fn multiply(a: &Matrix4, b: &Matrix4) -> Matrix4 {
    a.map(|row| [0, 1, 2, 3].map(|j: usize| dot4(row, [b[0][j], b[1][j], b[2][j], b[3][j]])))
}

fn add_outer(sum: &mut Matrix4, a: Quaternion<f64>, b: Quaternion<f64>) {
    for i in 0..4 {
        (0..4).for_each(|j| sum[i][j] += a[i] * b[j]);
    }
}

/// The column with the largest diagonal entry (the first of equals) and where it is.
fn largest_column(a: &Matrix4) -> (usize, Quaternion<f64>) {
    let best = (1..4).fold(0, |best, k| if a[k][k] > a[best][best] { k } else { best });
    (best, [a[0][best], a[1][best], a[2][best], a[3][best]])
}

/// From that column, normalised, to the entries; which one it is is a constant.
fn of_largest_column(a: &Matrix4, g: Quaternion<f64>, of_a: &mut Matrix4) {
    let (best, column) = largest_column(a);
    let Some(unit) = normalize(column) else { return };
    let of_column = adjoint::normalize(unit, 1.0 / dot4(unit, column), g);
    (0..4).for_each(|k| of_a[k][best] += of_column[k]);
}

/// From m / tr m, given that and the trace, to m.
fn of_unit_trace(g: &Matrix4, scaled: &Matrix4, trace: f64) -> Matrix4 {
    let along: f64 = g.iter().zip(scaled).map(|(g, row)| dot4(*g, *row)).sum();
    let mut of_m = g.map(|row| row.map(|c| c / trace));
    (0..4).for_each(|k| of_m[k][k] -= along / trace);
    of_m
}

#[cfg(test)]
mod tests {
    use super::super::super::random::SplitMix64;
    use super::super::average;
    use super::*;

    /// Against central differences in f64, for every solver and start. Averages that are hardly determined (a relative gap below
    /// 0.05) are left out and counted: there the derivative grows as one over the gap, and a difference crosses the tie.
    #[test]
    fn every_solver_follows_its_bones() {
        let ids = [
            "closed-form",
            "eigen",
            "polar",
            "nlerp",
            "power-15",
            "power-0",
            "power-3-first",
            "power-2-ones",
            "power-2-identity",
            "power-2-nlerp",
            "power-2-column",
            "squaring-1",
            "squaring-4",
        ];
        let mut random = SplitMix64::new(4);
        let mut number = || f64::from(2.0 * random.unit_f32() - 1.0);
        let (mut close, mut checked) = (0, 0);
        for case in 0..120 {
            let count = 1 + case % 5;
            let quats: Vec<_> =
                (0..count).map(|_| normalize([number(), number(), number(), number()]).unwrap()).collect();
            let weights: Vec<f64> = (0..count).map(|k| if k == 3 { 0.0 } else { 1.2 + number() }).collect();
            let g = [number(), number(), number(), number()];
            if average(&quats, &weights, Solver::Eigen).unwrap().gap < 0.05 {
                close += 1;
                continue;
            }
            checked += 1;
            for id in ids {
                let solver: Solver = id.parse().unwrap();
                let mut found = vec![[0.0; 3]; count];
                average_rotation_adjoint(&quats, &weights, solver, g, |k, own| {
                    let own = adjoint::to_torque(quats[k], own);
                    (0..3).for_each(|axis| found[k][axis] += own[axis]);
                });
                let at = average_rotation(&quats, &weights, solver).unwrap();
                for k in 0..count {
                    for axis in 0..3 {
                        let moved = |step: f64| {
                            let mut turn = [1.0, 0.0, 0.0, 0.0];
                            turn[1 + axis] = step / 2.0;
                            let mut quats = quats.clone();
                            quats[k] = normalize(rotation::multiply(turn, quats[k])).unwrap();
                            let q = average_rotation(&quats, &weights, solver).unwrap();
                            dot4(q, g) * 1.0f64.copysign(dot4(q, at))
                        };
                        let expected = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                        let error = (found[k][axis] - expected).abs();
                        assert!(
                            error < 1e-6 * (1.0 + expected.abs()),
                            "{id}: {} is not {expected}",
                            found[k][axis]
                        );
                    }
                }
            }
        }
        assert!(checked > 80 && close < 40, "{checked} checked, {close} left out");
    }
}
