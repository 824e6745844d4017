//! Numbers, quaternions and matrices read from JSON fixtures.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part of this module")]

use serde_json::Value;
use skinsplat_core::math::{Matrix3, Quaternion, Real};

/// The numbers of nested arrays, flattened.
pub fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().unwrap()],
    }
}

/// (w, x, y, z).
pub fn quaternion<T: Real>(value: &Value) -> Quaternion<T> {
    let components: [f64; 4] = numbers(value).try_into().unwrap();
    components.map(T::from_f64)
}

/// Nine numbers, row-major.
pub fn matrix<T: Real>(value: &Value) -> Matrix3<T> {
    let m: [f64; 9] = numbers(value).try_into().unwrap();
    [[m[0], m[1], m[2]], [m[3], m[4], m[5]], [m[6], m[7], m[8]]].map(|row| row.map(T::from_f64))
}

/// Largest absolute difference between a matrix or quaternion and the reference.
pub fn difference<T: Real>(found: impl IntoIterator<Item = T>, expected: &Value) -> f64 {
    let found: Vec<f64> = found.into_iter().map(Real::to_f64).collect();
    let expected = numbers(expected);
    assert_eq!(found.len(), expected.len());
    found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Inner product.
pub fn dot(a: Quaternion<f64>, b: Quaternion<f64>) -> f64 {
    (0..4).map(|k| a[k] * b[k]).sum()
}
