//! Metrics against reference values that scikit-image, PyTorch (3DGS, torchmetrics) and piq computed, and against a
//! direct evaluation of the definition.
#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use proptest::prelude::*;
use serde_json::Value;
use skinsplat::metrics::{
    ErrorSums, FrameScore, MetricsError, Planes, Protocol, PsnrVariant, SsimVariant, Truth, VARIANT_IDS,
    all_variants, ssim,
};
use skinsplat::scene::{Image, Mask};

/// f64 against f64: the references differ in the order of additions only.
const F64_TOLERANCE: f64 = 1e-9;
/// 3DGS filters in f32: `E[x²] - µ²` of values up to 1 is off by about 4 * 2^-24, against a C2 of 9e-4.
const F32_TOLERANCE: f64 = 4.0 / (1 << 24) as f64 / 9e-4;

fn load(path: &str) -> Image {
    let path = support::fixture(&format!("metrics/{path}"));
    let decoded = image::open(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())).to_rgb8();
    let pixels = decoded.pixels().map(|p| p.0.map(|v| f32::from(v) / 255.0)).collect();
    Image::new(decoded.width() as usize, decoded.height() as usize, pixels).unwrap()
}

/// A number of the fixture file: `null` is +inf.
fn expected(value: &Value) -> f64 {
    if value.is_null() { f64::INFINITY } else { value.as_f64().unwrap() }
}

fn assert_close(found: f64, expected: f64, tolerance: f64, what: &str) {
    let close = found == expected || (found - expected).abs() <= tolerance;
    assert!(close, "{what}: {found}, expected {expected}, off by {:e}", (found - expected).abs());
}

/// Which variant computes each SSIM of the fixture file, and how closely.
const SSIM_KEYS: [(&str, SsimVariant, f64); 10] = [
    ("inria_f64", SsimVariant::ZeroPad, F64_TOLERANCE),
    ("inria_f32window_f64", SsimVariant::ZeroPadF32Window, F64_TOLERANCE),
    ("inria_f32", SsimVariant::ZeroPadF32Window, F32_TOLERANCE),
    ("skimage_gaussian", SsimVariant::Valid, F64_TOLERANCE),
    ("skimage_default_7x7_uniform", SsimVariant::Uniform7, F64_TOLERANCE),
    ("skimage_default_data_range_2", SsimVariant::Uniform7Range2, F64_TOLERANCE),
    ("torchmetrics", SsimVariant::Reflect, F64_TOLERANCE),
    ("torchmetrics_default_data_range", SsimVariant::ReflectExtent, F64_TOLERANCE),
    ("piq", SsimVariant::ValidDownsampled, F64_TOLERANCE),
    ("piq_no_downsample", SsimVariant::Valid, F64_TOLERANCE),
];

#[test]
fn reference_values() {
    let fixture = support::json("metrics/expected.json");
    let pairs = fixture["pairs"].as_object().unwrap();
    let (mut errors, mut indices, mut refusals, mut undefined) = (0, 0, 0, 0);
    for (name, pair) in pairs {
        let file = |i: usize| load(pair["files"][i].as_str().unwrap());
        let (a, b) = (file(0), file(1));
        let sums = ErrorSums::new(&planes(&a), &planes(&b), None).unwrap();
        let mse = sums.channel_mse();
        for (key, found) in [
            ("mse", sums.mse()),
            ("mae", sums.mae()),
            ("psnr", PsnrVariant::Image.psnr(mse)),
            ("psnr_mean_of_channels", PsnrVariant::MeanOfChannels.psnr(mse)),
        ] {
            assert_close(found, expected(&pair[key]), F64_TOLERANCE, &format!("{name} {key}"));
            errors += 1;
        }
        let keys = pair["ssim"].as_object().unwrap();
        assert_eq!(keys.len(), SSIM_KEYS.len(), "{name}: an SSIM that no variant is checked against");
        for (key, variant, tolerance) in SSIM_KEYS {
            let (what, found) = (format!("{name} {key}"), ssim(&a, &b, variant));
            if keys[key].as_str().is_some_and(|text| text.starts_with("error: ")) {
                assert!(matches!(found, Err(MetricsError::TooSmall { .. })), "{what}: {found:?}");
                refusals += 1;
            } else if variant == SsimVariant::ReflectExtent && is_constant(&a) && is_constant(&b) {
                // L = 0: the reference divides rounding noise by rounding noise.
                assert!(matches!(found, Err(MetricsError::ZeroRange { .. })), "{what}: {found:?}");
                undefined += 1;
            } else {
                assert_close(found.unwrap(), keys[key].as_f64().unwrap(), tolerance, &what);
                indices += 1;
            }
        }
    }
    assert_eq!((pairs.len(), errors, indices, refusals, undefined), (16, 64, 150, 7, 3));
}

fn planes(image: &Image) -> Planes {
    Planes::new(image, "image").unwrap()
}

fn is_constant(image: &Image) -> bool {
    image.pixels().iter().all(|pixel| *pixel == image.pixels()[0])
}
