//! Every quantity of the first phase against reference values in f64 (`gs_math/gaussians.json`): covariance, projection,
//! conic, radius, culling, colour per SH degree, antialiasing factor, alpha at pixels.
//!
//! The fixture's `cov3d_kernel_unnormalised_q_upper6` (a quaternion that is not normalised first) has no counterpart
//! here: the renderer starts from factors.

use super::blend::alpha_at;
use super::colour;
use super::lanes::Arrays;
use super::preprocess::ScreenGaussian;
use super::project::{Projected, Projection, project};
use super::wide::Wide;
use glam::{DMat3, DMat4, DQuat, DVec3, Mat3};
use serde_json::Value;
use skinsplat_core::scene::{Camera, ColourClamp};

fn cases() -> Vec<Value> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/fixtures/gs_math/gaussians.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn number(v: &Value) -> f64 {
    v.as_f64().unwrap()
}

fn numbers<const N: usize>(v: &Value) -> [f64; N] {
    std::array::from_fn(|i| number(&v[i]))
}

/// Fails unless `found` is within `tolerance` of `expected`, relative to `scale`.
#[track_caller]
fn close(name: &str, case: usize, found: f32, expected: f64, scale: f64, tolerance: f64) {
    let error = (f64::from(found) - expected).abs() / scale;
    assert!(error <= tolerance, "case {case}, {name}: {found} instead of {expected} (error {error:e})");
}

fn camera_of(case: &Value) -> Camera {
    let size = |key: &str| u32::try_from(case[key].as_u64().unwrap()).unwrap();
    let (width, height) = (size("width"), size("height"));
    Camera {
        width,
        height,
        fx: number(&case["fx"]),
        fy: number(&case["fy"]),
        cx: f64::from(width) / 2.0,
        cy: f64::from(height) / 2.0,
        camera_from_world: DMat4::from_cols_array(&numbers(&case["view_row_major"])).transpose(),
    }
}

fn factor_of(case: &Value) -> DMat3 {
    let [w, x, y, z] = numbers(&case["quat_wxyz"]);
    let scale = DVec3::from_array(numbers(&case["scale"]));
    DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize()) * DMat3::from_diagonal(scale)
}

fn wide(value: f32) -> Wide<Arrays> {
    Wide::splat(Arrays, value)
}

fn project_case(case: &Value, antialiased: bool) -> Projected<f32> {
    let projection = Projection::new(&camera_of(case), antialiased);
    let mean = numbers::<3>(&case["mean"]).map(|v| v as f32);
    let factor: Mat3 = factor_of(case).as_mat3();
    let factor = factor.to_cols_array_2d().map(|column| column.map(wide));
    let projected = project(&projection, mean.map(wide), factor, wide(number(&case["opacity"]) as f32));
    projected.map(|row| row.store()[0])
}

#[test]
fn factors_give_the_covariance() {
    for (i, case) in cases().iter().enumerate() {
        let m = factor_of(case);
        let sigma = m * m.transpose();
        let expected = numbers::<6>(&case["cov3d_upper6"]);
        let [x, y, z] = sigma.to_cols_array_2d();
        for (found, expected) in [x[0], x[1], x[2], y[1], y[2], z[2]].into_iter().zip(expected) {
            assert!((found - expected).abs() <= 1e-14 * sigma.x_axis.length().max(1.0), "case {i}");
        }
    }
}

#[test]
fn projection_has_the_reference_values() {
    for (i, case) in cases().iter().enumerate() {
        let p = project_case(case, false);
        let depth = number(&case["mean_cam"][2]);
        close("depth", i, p.depth, depth, 1.0, 2e-6);
        assert_eq!(p.depth <= 0.2, case["culled_near_0p2"].as_bool().unwrap(), "case {i}");
        let covariance = numbers::<3>(&case["cov2d"]);
        let conic = numbers::<3>(&case["conic"]);
        let sizes = [covariance[0] + covariance[2], conic[0] + conic[2]];
        let condition = covariance[0] * covariance[2] / number(&case["det"]);
        for k in 0..3 {
            close("covariance", i, p.covariance[k], covariance[k], sizes[0], 2e-6);
            close("conic", i, p.conic[k], conic[k], sizes[1], 2e-6 * condition);
        }
        close("radius", i, p.radius, number(&case["radius"]), 1.0, 0.0);
        for axis in 0..2 {
            let size = number(&case[["width", "height"][axis]]);
            let expected = number(&case["mean2d_kernel_w_eps1e7"][axis]);
            close("mean", i, p.mean[axis], expected, size + expected.abs(), 1e-6);
        }
        close("opacity", i, p.opacity, number(&case["opacity"]), 1.0, 1e-7);
        let compensated = project_case(case, true).opacity / p.opacity;
        close(
            "antialias scale",
            i,
            compensated,
            number(&case["antialias_opacity_scale"]),
            1.0,
            2e-6 * condition,
        );
    }
}

#[test]
fn colours_have_the_reference_values_at_every_degree() {
    for (i, case) in cases().iter().enumerate() {
        let sh: Vec<[f32; 3]> =
            numbers::<48>(&case["sh_16x3"]).chunks_exact(3).map(|c| [0, 1, 2].map(|k| c[k] as f32)).collect();
        let mean = numbers::<3>(&case["mean"]).map(|v| v as f32);
        let camera = camera_of(case).position().as_vec3().to_array();
        for (found, expected) in camera.into_iter().zip(numbers::<3>(&case["cam_pos"])) {
            close("camera position", i, found, expected, 1.0, 1e-6);
        }
        let direction = colour::direction(mean.map(wide), camera, None).unit;
        let basis = colour::basis(direction).map(|row| row.store()[0]);
        for (found, expected) in
            direction.map(|row| row.store()[0]).into_iter().zip(numbers::<3>(&case["view_dir"]))
        {
            close("direction", i, found, expected, 1.0, 1e-6);
        }
        for degree in 0..=3 {
            let expected = &case["sh_rgb"][degree.to_string()];
            let count = (degree + 1) * (degree + 1);
            let unclamped = colour::evaluate(Arrays, &sh[..count], |k| basis[k]);
            let rgb = colour::clamped(unclamped, ColourClamp::NonNegative);
            for c in 0..3 {
                close("unclamped", i, unclamped[c], number(&expected["unclamped"][c]), 1.0, 1e-5);
                close("rgb", i, rgb[c], number(&expected["rgb"][c]), 1.0, 1e-5);
                assert_eq!(unclamped[c] < 0.0, expected["clamped"][c].as_bool().unwrap(), "case {i}");
            }
        }
    }
}

#[test]
fn alphas_have_the_reference_values() {
    let mut drawn = 0;
    for (i, case) in cases().iter().enumerate() {
        let screen = ScreenGaussian::new(&project_case(case, false), [0.0; 3]);
        for pixel in case["alpha"].as_array().unwrap() {
            let [x, y] = numbers::<2>(&pixel["pixel"]).map(|v| v as f32);
            let expected = if pixel["skipped"].as_bool().unwrap() { 0.0 } else { number(&pixel["alpha"]) };
            // An f32 position near 1000 is known to 6e-5 pixels; alpha changes by up to 1 per pixel.
            close("alpha", i, alpha_at(&screen, x, y), expected, 1.0, 1e-4);
            drawn += usize::from(expected > 0.0);
        }
    }
    assert!(drawn > 40, "only {drawn} pixels are not skipped");
}
