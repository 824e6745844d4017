//! Power iteration.

use super::super::rotation::normalize;
use super::super::{Quaternion, Real, dot4};

/// Power iteration: `steps` times v ← A v / |A v|. The error shrinks by λ2/λ1 a step, if `start` is not orthogonal to
/// the answer. With no step, `start` normalised. Where A v vanishes, v stays.
pub fn power_iterate<T: Real>(a: [[T; 4]; 4], start: Quaternion<T>, steps: u32) -> Quaternion<T> {
    let mut v = normalize(start).unwrap_or(start);
    for _ in 0..steps {
        match normalize(a.map(|row| dot4(row, v))) {
            Some(next) => v = next,
            None => break,
        }
    }
    v
}
