//! Arrays to slices of small arrays and back, and errors in one line.

use numpy::ndarray::{Array, Dimension, IxDyn};
use numpy::{Element, IntoPyArray, PyArrayDyn, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::fmt::Display;

/// Whatever is wrong with the input, as `ValueError`: the same line that the program prints.
pub(crate) fn invalid(problem: impl Display) -> PyErr {
    PyValueError::new_err(problem.to_string().split_whitespace().collect::<Vec<_>>().join(" "))
}

/// The values of an array whose last axes have these sizes, and the sizes of the axes before.
pub(crate) fn values<T: Element + Copy>(
    array: &PyReadonlyArrayDyn<'_, T>,
    name: &str,
    last: &[usize],
) -> PyResult<(Vec<T>, Vec<usize>)> {
    let shape = array.as_array().shape().to_vec();
    let ahead = shape.len().checked_sub(last.len());
    match ahead {
        Some(ahead) if shape[ahead..] == *last => {
            Ok((array.as_array().iter().copied().collect(), shape[..ahead].to_vec()))
        }
        _ => {
            let last: Vec<String> = last.iter().map(ToString::to_string).collect();
            Err(invalid(format!("{name}: shape {shape:?}; expected (..., {})", last.join(", "))))
        }
    }
}

/// Values in rows of `N`.
pub(crate) fn rows<T: Copy, const N: usize>(values: &[T]) -> Vec<[T; N]> {
    values.as_chunks::<N>().0.to_vec()
}

/// An array of this shape.
pub(crate) fn array<'py, T: Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let array = Array::from_shape_vec(IxDyn(shape), values).map_err(invalid)?;
    debug_assert_eq!(array.raw_dim().ndim(), shape.len());
    Ok(array.into_pyarray(py))
}
