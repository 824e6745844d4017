//! Averages of rotations, spherical harmonics.

use crate::arrays::{array, invalid, rows, values};
use numpy::{PyArrayDyn, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use skinsplat_core::math::average::{Solver, average_rotation};
use skinsplat_core::math::{rotation, sh};

/// quats (n, k, 4), weights (n, k) -> (n, 4).
#[pyfunction]
pub fn average<'py>(
    py: Python<'py>,
    quats: PyReadonlyArrayDyn<'py, f64>,
    weights: PyReadonlyArrayDyn<'py, f64>,
    solver: &str,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let solver: Solver = solver.parse().map_err(invalid)?;
    let (quats, ahead) = values(&quats, "quats", &[4])?;
    let (weights, shape) = values(&weights, "weights", &[])?;
    if ahead != shape || shape.len() != 2 {
        return Err(invalid(format!("weights: shape {shape:?}; expected {ahead:?}, one per quaternion")));
    }
    let (n, k) = (shape[0], shape[1]);
    let quats: Vec<[f64; 4]> = rows(&quats);
    let averages = py.detach(|| {
        let of =
            |i: usize| average_rotation(&quats[i * k..(i + 1) * k], &weights[i * k..(i + 1) * k], solver);
        (0..n).map(|i| of(i).ok_or(i)).collect::<Result<Vec<[f64; 4]>, usize>>()
    });
    let averages = averages.map_err(|i| {
        invalid(format!(
            "quats[{i}]: no average; expected finite quaternions, and weights of 0 or more of which one is above 0"
        ))
    })?;
    array(py, averages.into_iter().flatten().collect(), &[n, 4])
}

/// sh (n, c, 3) with c = 1, 4, 9 or 16, quats (n, 4) -> (n, c, 3).
#[pyfunction]
pub fn rotate_sh<'py>(
    py: Python<'py>,
    sh: PyReadonlyArrayDyn<'py, f64>,
    quats: PyReadonlyArrayDyn<'py, f64>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let (coefficients, shape) = values(&sh, "sh", &[3])?;
    let (quats, ahead) = values(&quats, "quats", &[4])?;
    let degree = match shape[..] {
        [_, 1] => 0,
        [_, 4] => 1,
        [_, 9] => 2,
        [_, 16] => 3,
        _ => return Err(invalid(format!("sh: shape {shape:?} of RGB; expected (n, 1, 4, 9 or 16) of RGB"))),
    };
    let (n, count) = (shape[0], shape[1]);
    if ahead != [n] {
        return Err(invalid(format!(
            "quats: shape {ahead:?} of quaternions; expected [{n}], one per row of sh"
        )));
    }
    let mut coefficients: Vec<[f64; 3]> = rows(&coefficients);
    for (i, (own, quat)) in coefficients.chunks_exact_mut(count).zip(rows::<f64, 4>(&quats)).enumerate() {
        let unit = rotation::normalize(quat).ok_or_else(|| {
            invalid(format!("quats[{i}]: {quat:?}; expected a finite quaternion, not zero"))
        })?;
        let turn = rotation::quaternion_to_matrix(unit);
        sh::Rotation::<f64>::new(turn, degree).apply(own);
    }
    array(py, coefficients.into_iter().flatten().collect(), &[n, count, 3])
}
