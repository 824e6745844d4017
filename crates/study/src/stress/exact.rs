//! The exact average of rotations, to some thirty digits: the reference that solvers are held against.
//!
//! A = Σ w q qᵀ is summed in double-double arithmetic and squared [`DOUBLINGS`] times: what is left is the projector on the
//! top eigenspace, also where that has several dimensions (a tie).

use super::double_double::DoubleDouble;
use skinsplat_core::math::average::{Solver, average};
use skinsplat_core::math::portable;
use skinsplat_core::math::{Quaternion, dot4};

/// 2^70 power steps: a relative gap of 1e-18 is resolved.
const DOUBLINGS: usize = 70;

/// Eigenvalues closer than this (relative) are a tie.
const TIE: f64 = 1e-17;

type Matrix4<T> = [[T; 4]; 4];

/// The exact average of one problem.
#[derive(Clone, Debug)]
pub(super) struct Exact {
    /// On the top eigenspace.
    projector: Matrix4<f64>,
    /// A over its largest eigenvalue.
    scaled: Matrix4<f64>,
    /// (λ1 − λ2) / λ1.
    pub(super) gap: f64,
    /// Dimensions of the top eigenspace: above 1 in a tie.
    pub(super) dimensions: usize,
}

impl Exact {
    /// `None` where there is no average.
    pub(super) fn new(quats: &[Quaternion<f64>], weights: &[f64]) -> Option<Self> {
        let gap = average(quats, weights, Solver::Eigen)?.gap;
        let a = outer_sum(quats, weights);
        let mut power = unit_trace(&a);
        for _ in 0..DOUBLINGS {
            power = unit_trace(&product(&power, &power));
        }
        // The trace of the square is one over the dimension.
        let spread = trace(&product(&power, &power)).to_f64();
        let dimensions = (1.0 / spread).round().clamp(1.0, 4.0);
        let projector = power.map(|row| row.map(|c| (c * DoubleDouble::new(dimensions)).to_f64()));
        let largest = trace(&product(&a, &power)).reciprocal();
        let scaled = a.map(|row| row.map(|c| (c * largest).to_f64()));
        let dimensions = dimensions as usize;
        Some(Self { projector, scaled, gap: if dimensions > 1 { 0.0 } else { gap.max(TIE) }, dimensions })
    }

    /// The angle between the rotation of a unit quaternion and the nearest average, degrees.
    pub(super) fn error_degrees(&self, q: Quaternion<f64>) -> f64 {
        let near = self.projector.map(|row| dot4(row, q));
        let off = [0, 1, 2, 3].map(|k: usize| q[k] - near[k]);
        2.0 * portable::asin(dot4(off, off).sqrt().min(1.0)).to_degrees()
    }

    /// 1 − qᵀAq/λ1 of a unit quaternion: how much worse than the average it is, whatever the gap.
    pub(super) fn loss(&self, q: Quaternion<f64>) -> f64 {
        (1.0 - dot4(q, self.scaled.map(|row| dot4(row, q)))).max(0.0)
    }
}

/// Σ w q qᵀ of unit quaternions, weights relative to the heaviest.
fn outer_sum(quats: &[Quaternion<f64>], weights: &[f64]) -> Matrix4<DoubleDouble> {
    let heaviest = weights.iter().copied().fold(0.0, f64::max);
    let inverse = DoubleDouble::new(1.0 / heaviest);
    let mut sum = [[DoubleDouble::default(); 4]; 4];
    for (q, &weight) in quats.iter().zip(weights).filter(|(_, weight)| **weight > 0.0) {
        let largest = q.iter().fold(0.0f64, |m, c| m.max(c.abs()));
        // A power of two, so that nothing is rounded.
        let scale = portable::exp2(-portable::log2(largest).floor());
        let q = q.map(|c| DoubleDouble::new(c * scale));
        let squared = q.iter().fold(DoubleDouble::default(), |sum, &c| sum + c * c);
        let weight = DoubleDouble::new(weight) * inverse * squared.reciprocal();
        for i in 0..4 {
            for j in 0..4 {
                sum[i][j] = sum[i][j] + weight * q[i] * q[j];
            }
        }
    }
    sum
}

fn trace(m: &Matrix4<DoubleDouble>) -> DoubleDouble {
    m[0][0] + m[1][1] + m[2][2] + m[3][3]
}

fn unit_trace(m: &Matrix4<DoubleDouble>) -> Matrix4<DoubleDouble> {
    let inverse = trace(m).reciprocal();
    m.map(|row| row.map(|c| c * inverse))
}

/// Of two symmetric matrices that commute.
fn product(a: &Matrix4<DoubleDouble>, b: &Matrix4<DoubleDouble>) -> Matrix4<DoubleDouble> {
    let mut product = [[DoubleDouble::default(); 4]; 4];
    for i in 0..4 {
        for j in i..4 {
            let entry = (0..4).fold(DoubleDouble::default(), |sum, k| sum + a[i][k] * b[k][j]);
            (product[i][j], product[j][i]) = (entry, entry);
        }
    }
    product
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    fn numbers(value: &Value) -> Vec<f64> {
        value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
    }

    fn quaternion(value: &Value) -> Quaternion<f64> {
        numbers(value).try_into().unwrap()
    }

    /// The fixtures' answers have fifty digits, written with seventeen.
    #[test]
    fn the_reference_set_agrees() {
        let mut seen = [0; 2];
        for file in ["random", "extreme"] {
            let path =
                format!("{}/../../tests/data/fixtures/rotation/{file}.json", env!("CARGO_MANIFEST_DIR"));
            let cases: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
            for case in cases.as_array().unwrap() {
                let quats: Vec<_> = case["quats_wxyz"].as_array().unwrap().iter().map(quaternion).collect();
                let exact = Exact::new(&quats, &numbers(&case["weights"])).unwrap();
                let name = &case["name"];
                if case["degenerate"].as_bool().unwrap() {
                    seen[1] += 1;
                    let basis = case["top_eigenspace_basis_wxyz"].as_array().unwrap();
                    assert_eq!(exact.dimensions, basis.len(), "{name}");
                    for axis in basis {
                        assert!(exact.error_degrees(quaternion(axis)) < 2e-13, "{name}");
                    }
                } else {
                    seen[0] += 1;
                    let answer = quaternion(&case["markley_wxyz"]);
                    // Seventeen digits and the projector in f64: some 1e-16 per component, twice that as an angle.
                    assert!(exact.error_degrees(answer) < 2e-13, "{name}: {}", exact.error_degrees(answer));
                    assert!(exact.loss(answer) < 1e-15, "{name}: {}", exact.loss(answer));
                    assert_eq!(exact.dimensions, 1, "{name}");
                }
            }
        }
        assert!(seen[0] > 490 && seen[1] > 2, "{seen:?}");
    }
}
