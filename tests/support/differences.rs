//! Derivatives against central differences.
#![allow(dead_code, unreachable_pub, reason = "shared by tests")]
#![expect(clippy::print_stdout, reason = "tests; the agreement is printed")]

use glam::Mat3;
use skinsplat_core::scene::{OwnedPosed, PosedGradient};

/// The central difference of a loss along one number of `posed`.
pub fn difference(
    posed: &OwnedPosed,
    loss: impl Fn(&OwnedPosed) -> f64,
    step: f32,
    number: impl for<'a> Fn(&'a mut OwnedPosed) -> &'a mut f32,
) -> f64 {
    let moved = |by: f32| {
        let mut posed = posed.clone();
        let value = number(&mut posed);
        *value += by;
        (f64::from(*value), loss(&posed))
    };
    let ((low, before), (high, after)) = (moved(-step), moved(step));
    (after - before) / (high - low)
}

/// Fails unless the found numbers are those expected, to a part of the norm that rounding explains.
#[track_caller]
pub fn assert_close(name: &str, found: &[f32], expected: &[f64], tolerance: f64) {
    let norm = expected.iter().map(|v| v * v).sum::<f64>().sqrt();
    let error = std::iter::zip(found, expected).map(|(a, b)| (f64::from(*a) - b).powi(2)).sum::<f64>().sqrt();
    println!("{name}: {:.1e} of {norm:.1e}", error / norm);
    assert!(error <= tolerance * norm + 1e-7, "{name}: {error:e} of {norm:e}");
}

/// Fails unless the gradient is that of the loss, for every kind of parameter.
#[track_caller]
pub fn assert_gradient(posed: &OwnedPosed, gradient: &PosedGradient, loss: impl Fn(&OwnedPosed) -> f64) {
    let n = posed.len();
    let along = |step, number: &dyn for<'a> Fn(&'a mut OwnedPosed) -> &'a mut f32| {
        difference(posed, &loss, step, number)
    };
    let means: Vec<f64> = (0..3 * n).map(|i| along(1e-5, &|p| &mut p.means[i / 3][i % 3])).collect();
    let factors: Vec<f64> =
        (0..9 * n).map(|i| along(1e-6, &|p| &mut p.factors[i / 9].col_mut(i % 9 / 3)[i % 3])).collect();
    let opacities: Vec<f64> = (0..n).map(|i| along(1e-4, &|p| &mut p.opacities[i])).collect();
    let sh: Vec<f64> = (0..3 * posed.sh.len()).map(|i| along(1e-4, &|p| &mut p.sh[i / 3][i % 3])).collect();
    let found: Vec<f32> = gradient.means.iter().flat_map(|v| v.to_array()).collect();
    assert_close("means", &found, &means, 1e-5);
    let found: Vec<f32> = gradient.factors.iter().flat_map(Mat3::to_cols_array).collect();
    assert_close("factors", &found, &factors, 1e-5);
    assert_close("opacities", &gradient.opacities, &opacities, 1e-5);
    assert_close("sh", gradient.sh.as_flattened(), &sh, 1e-5);
    let frames = posed.view_frames.as_ref().map_or(0, Vec::len);
    assert_eq!(gradient.view_frames.len(), frames);
    let expected: Vec<f64> = (0..9 * frames).map(|i| along(1e-4, &|p| frame_entry(p, i))).collect();
    let found: Vec<f32> = gradient.view_frames.iter().flat_map(Mat3::to_cols_array).collect();
    assert_close("view frames", &found, &expected, 1e-5);
}

/// Entry `i` of all view frames, column by column.
fn frame_entry(posed: &mut OwnedPosed, i: usize) -> &mut f32 {
    let frames = posed.view_frames.as_mut().expect("asked only where there are some");
    &mut frames[i / 9].col_mut(i % 9 / 3)[i % 3]
}
