//! Metrics against reference values that scikit-image, PyTorch (3DGS, torchmetrics) and piq computed, and against a
//! direct evaluation of the definition.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/mod.rs"]
mod support;

use proptest::prelude::*;
use serde_json::Value;
use skinsplat_core::scene::{Image, Mask};
use skinsplat_metrics::{
    ErrorSums, FrameScore, MetricsError, Planes, Protocol, PsnrVariant, SsimVariant, Truth, VARIANT_IDS,
    all_variants, ssim,
};

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

/// SSIM by its definition: every window gathered pixel by pixel in two dimensions, variances from centred values.
fn naive_ssim(a: &Image, b: &Image, variant: SsimVariant) -> f64 {
    let (width, height) = (a.width() as isize, a.height() as isize);
    let (radius, uniform) = if variant == SsimVariant::Uniform7 { (3, true) } else { (5, false) };
    let weight = |d: isize| if uniform { 1.0 } else { (-((d * d) as f64) / 4.5).exp() };
    let total: f64 = (-radius..=radius).map(weight).sum();
    let mirror = |i: isize, n: isize| if i < 0 { -i } else { i.min(2 * (n - 1) - i) };
    let value = |image: &Image, x: isize, y: isize, c: usize| {
        let inside = (0..width).contains(&x) && (0..height).contains(&y);
        match (inside, variant) {
            (false, SsimVariant::ZeroPad) => 0.0,
            _ => f64::from(image.at(mirror(x, width) as usize, mirror(y, height) as usize)[c]),
        }
    };
    let margin = if matches!(variant, SsimVariant::Valid | SsimVariant::Uniform7) { radius } else { 0 };
    let bessel = if uniform { 49.0 / 48.0 } else { 1.0 };
    let (mut sum, mut count) = (0.0, 0.0);
    for y in margin..height - margin {
        for x in margin..width - margin {
            for c in 0..3 {
                let window: Vec<(f64, f64, f64)> = (-radius..=radius)
                    .flat_map(|dy| (-radius..=radius).map(move |dx| (dx, dy)))
                    .map(|(dx, dy)| {
                        let w = weight(dx) * weight(dy) / (total * total);
                        (w, value(a, x + dx, y + dy, c), value(b, x + dx, y + dy, c))
                    })
                    .collect();
                let mean =
                    |f: &dyn Fn(f64, f64) -> f64| window.iter().map(|&(w, a, b)| w * f(a, b)).sum::<f64>();
                let (ma, mb) = (mean(&|a, _| a), mean(&|_, b| b));
                let va = bessel * mean(&|a, _| (a - ma).powi(2));
                let vb = bessel * mean(&|_, b| (b - mb).powi(2));
                let cov = bessel * mean(&|a, b| (a - ma) * (b - mb));
                let (c1, c2) = (1e-4, 9e-4);
                sum += (2.0 * ma * mb + c1) * (2.0 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
                count += 1.0;
            }
        }
    }
    sum / count
}

const MAIN_VARIANTS: [SsimVariant; 4] =
    [SsimVariant::ZeroPad, SsimVariant::Valid, SsimVariant::Reflect, SsimVariant::Uniform7];

prop_compose! {
    fn pair(sizes: std::ops::Range<usize>)(width in sizes.clone(), height in sizes)(
        a in prop::collection::vec(prop::array::uniform3(0.0f32..1.0), width * height),
        noise in prop::collection::vec(prop::array::uniform3(-0.2f32..0.2), width * height),
        width in Just(width),
        height in Just(height),
    ) -> (Image, Image) {
        let add = |(a, n): (&[f32; 3], &[f32; 3])| [a[0] + n[0], a[1] + n[1], a[2] + n[2]];
        let b = a.iter().zip(&noise).map(add).collect();
        (Image::new(width, height, a).unwrap(), Image::new(width, height, b).unwrap())
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn ssim_is_its_definition((a, b) in pair(11..29)) {
        for variant in MAIN_VARIANTS {
            let (found, naive) = (ssim(&a, &b, variant).unwrap(), naive_ssim(&a, &b, variant));
            // Levels may be restored by up to 2^-24; everything else is rounding in f64.
            prop_assert!((found - naive).abs() < 1e-6, "{}: {} {}", variant.id(), found, naive);
        }
    }

    #[test]
    fn ssim_is_symmetric_bounded_and_one_for_the_same_image((a, b) in pair(11..40)) {
        for variant in SsimVariant::ALL {
            let found = ssim(&a, &b, variant).unwrap();
            prop_assert_eq!(found, ssim(&b, &a, variant).unwrap(), "{}", variant.id());
            prop_assert!(found < 1.0 && found > -1.0);
            prop_assert!((ssim(&a, &a, variant).unwrap() - 1.0).abs() < 1e-12, "{}", variant.id());
        }
    }

    #[test]
    fn psnr_is_symmetric_and_does_not_see_a_common_shift((a, b) in pair(1..30), shift in -2.0f32..2.0) {
        let moved = |image: &Image| {
            let pixels = image.pixels().iter().map(|p| p.map(|v| v + shift)).collect();
            Image::new(image.width(), image.height(), pixels).unwrap()
        };
        let psnr = |a: &Image, b: &Image| {
            let sums = ErrorSums::new(&planes(a), &planes(b), None).unwrap();
            [PsnrVariant::Image, PsnrVariant::MeanOfChannels].map(|v| v.psnr(sums.channel_mse()))
        };
        prop_assert_eq!(psnr(&a, &b), psnr(&b, &a));
        for (still, moved) in psnr(&a, &b).iter().zip(psnr(&moved(&a), &moved(&b))) {
            // The shifted values are rounded to f32.
            prop_assert!((still - moved).abs() < 1e-3, "{} {}", still, moved);
        }
    }

    #[test]
    fn a_mask_of_ones_changes_nothing((a, b) in pair(11..30)) {
        let mask = Mask::filled(a.width(), a.height(), 1.0);
        let scores = all_variants(&a, &b, Some(&mask)).unwrap();
        for (i, (name, value)) in scores.iter().enumerate() {
            let (value, whole) = (value.clone().unwrap(), scores[i % 8].1.clone().unwrap());
            prop_assert!((value - whole).abs() < 1e-12, "{}: {} {}", name, value, whole);
        }
    }

    #[test]
    fn the_bounding_box_is_scored_as_the_crop((a, b) in pair(26..40), left in 0usize..6, top in 0usize..6) {
        let (width, height) = (a.width() - 9 - left, a.height() - 7 - top);
        let inside = |i: usize| {
            let (x, y) = (i % a.width(), i / a.width());
            // Corners of the box only: the rest follows.
            (x == left && y == top) || (x == left + width - 1 && y == top + height - 1)
        };
        let values = (0..a.width() * a.height()).map(|i| f32::from(u8::from(inside(i)))).collect();
        let mask = Mask::new(a.width(), a.height(), values).unwrap();
        let crop = |image: &Image, width: usize, height: usize| {
            let pixel = |i: usize| image.at(left + i % width, top + i / width);
            Image::new(width, height, (0..width * height).map(pixel).collect()).unwrap()
        };
        for (region, beyond) in [("mask-bounding-box", 0), ("mask-bounding-box-exclusive", 1)] {
            let boxed = Protocol::parse(&format!("default+region={region}")).unwrap();
            let (a_crop, b_crop) = (crop(&a, width - beyond, height - beyond), crop(&b, width - beyond, height - beyond));
            let found = boxed.score(&a, Truth::Composited { rgb: &b, mask: Some(&mask) }).unwrap();
            let whole = Protocol::default();
            let direct = whole.score(&a_crop, Truth::Composited { rgb: &b_crop, mask: None }).unwrap();
            prop_assert_eq!(FrameScore { protocol: whole.key(), ..found }, direct);
        }
    }
}

/// A pair larger than a tile in both directions, with a mask of irregular shape.
fn large_pair() -> (Image, Image, Mask) {
    let (width, height) = (157, 71);
    let image = |phase: f32| {
        let pixel = |i: usize| {
            let (x, y) = ((i % width) as f32, (i / width) as f32);
            [0.13, 0.41, 0.07].map(|f| 0.5 + 0.5 * (x * f + phase).sin() * (y * f * 0.7).cos())
        };
        Image::new(width, height, (0..width * height).map(pixel).collect()).unwrap()
    };
    let mask = (0..width * height).map(|i| f32::from(u8::from((i * i) % 7 < 3))).collect();
    (image(0.0), image(0.2), Mask::new(width, height, mask).unwrap())
}

#[test]
fn every_thread_count_gives_the_same_bits() {
    let (a, b, mask) = large_pair();
    let bits = |threads: usize| -> Vec<u64> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let scores = pool.install(|| all_variants(&a, &b, Some(&mask)).unwrap());
        scores.into_iter().map(|(_, value)| value.unwrap().to_bits()).collect()
    };
    let one = bits(1);
    assert_eq!(one.len(), 32);
    for threads in [2, 3, 8] {
        assert_eq!(one, bits(threads), "{threads} threads");
    }
}

#[test]
fn tiles_and_shared_interiors_change_nothing() {
    let (a, b, mask) = large_pair();
    let scores = all_variants(&a, &b, Some(&mask)).unwrap();
    let ids: Vec<&str> = scores.iter().map(|(id, _)| *id).collect();
    let expected: Vec<&str> = VARIANT_IDS.iter().flat_map(|(_, ids)| *ids).collect();
    assert_eq!(ids, expected);
    for variant in MAIN_VARIANTS {
        let found = scores.iter().find(|(id, _)| *id == variant.id()).unwrap().1.clone().unwrap();
        assert_eq!(found.to_bits(), ssim(&a, &b, variant).unwrap().to_bits(), "{}", variant.id());
        let naive = naive_ssim(&a, &b, variant);
        assert!((found - naive).abs() < 1e-9, "{}: {found} {naive}", variant.id());
    }
}
