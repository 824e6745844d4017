//! The rasterizer's derivatives against central differences of the definition in f64, and properties that they share
//! with the image: order, threads, vector widths.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/differences.rs"]
mod differences;
#[path = "../../../tests/support/random_scene.rs"]
mod random_scene;

use differences::{assert_close, assert_gradient, difference};
use glam::{Mat3, Vec3};
use proptest::prelude::*;
use random_scene::{Random, Settings, camera, chosen, has_distinct_depths, posed};
use skinsplat_core::scene::{Camera, ColourClamp, Image, Mask, OwnedPosed, PosedGradient, RenderedGradient};
use skinsplat_render::View;
use skinsplat_render::definition as reference_splatting;
use skinsplat_render::definition::Blended;
use skinsplat_render::splat::{Derivatives, Renderer, SimdLevel};

/// Everything that a loss needs, from a seed.
struct Scene {
    posed: OwnedPosed,
    camera: Camera,
    settings: Settings,
    upstream: RenderedGradient,
}

impl Scene {
    fn new(seed: u64, count: usize, width: u32, height: u32) -> Self {
        let mut random = Random(seed);
        let posed = posed(&mut random, count);
        let camera = camera(&mut random, width, height);
        let settings = Settings::random(&mut random);
        let (w, h) = (width as usize, height as usize);
        let mut value = || random.between(-1.0, 1.0) as f32;
        let image = (0..w * h).map(|_| [value(), value(), value()]).collect();
        let alpha = (0..w * h).map(|_| value()).collect();
        let alpha = (!seed.is_multiple_of(3)).then(|| Mask::new(w, h, alpha).unwrap());
        let upstream = RenderedGradient { image: Image::new(w, h, image).unwrap(), alpha };
        Self { posed, camera, settings, upstream }
    }

    fn view(&self) -> View<'_> {
        self.settings.view(&self.camera)
    }

    fn gradient(&self, renderer: &mut Renderer, derivatives: Derivatives) -> PosedGradient {
        let Self { posed, upstream, .. } = self;
        let (view, mut gradient) = (self.view(), PosedGradient::default());
        renderer.render(&posed.as_posed(), &view).unwrap();
        renderer.backward(&posed.as_posed(), &view, upstream, &mut gradient, derivatives).unwrap();
        gradient
    }

    fn exact(&self) -> PosedGradient {
        self.gradient(&mut Renderer::new(), Derivatives::Exact)
    }

    /// The loss in f64 whose derivatives by pixel are `upstream`.
    fn loss(&self, posed: &OwnedPosed, camera: &Camera, chosen: &[Vec<Blended>]) -> f64 {
        let view = self.settings.view(camera);
        let pixels = reference_splatting::render_selected(&posed.as_posed(), &view, chosen).unwrap();
        let of = |i: usize, pixel: [f64; 5]| {
            let colour = self.upstream.image.pixels()[i];
            let alpha = self.upstream.alpha.as_ref().map_or(0.0, |alpha| alpha.values()[i]);
            (0..3).map(|c| f64::from(colour[c]) * pixel[c]).sum::<f64>() + f64::from(alpha) * pixel[3]
        };
        pixels.into_iter().enumerate().map(|(i, pixel)| of(i, pixel)).sum()
    }

    fn chosen(&self) -> Vec<Vec<Blended>> {
        reference_splatting::selected(&self.posed.as_posed(), &self.view()).unwrap()
    }
}

#[test]
fn every_kind_of_parameter_has_the_derivative_of_the_definition() {
    let mut seen = std::collections::BTreeSet::new();
    for seed in 0..24 {
        let scene = Scene::new(seed, 14, 24, 20);
        let posed = &scene.posed;
        seen.extend([
            format!("degree {}", posed.sh_degree),
            format!("frames {}", posed.view_frames.is_some()),
            format!("{:?}", posed.colour_clamp),
            format!("antialiased {}", scene.settings.antialiased),
            format!("alpha {}", scene.upstream.alpha.is_some()),
        ]);
        let chosen = scene.chosen();
        let gradient = scene.exact();
        println!("seed {seed}");
        assert_gradient(posed, &gradient, |p| scene.loss(p, &scene.camera, &chosen));
    }
    assert_eq!(seen.len(), 4 + 2 + 2 + 2 + 2, "{seen:?}");
}

/// A principal point moves every splat by as much.
#[test]
fn screen_derivatives_are_per_half_image_size() {
    let scene = Scene::new(11, 40, 40, 24);
    let (chosen, gradient) = (scene.chosen(), scene.exact());
    let moved = |axis: usize, by: f64| {
        let mut camera = scene.camera.clone();
        *[&mut camera.cx, &mut camera.cy][axis] += by;
        scene.loss(&scene.posed, &camera, &chosen)
    };
    for (axis, size) in [40.0, 24.0].into_iter().enumerate() {
        let expected = (moved(axis, 1e-4) - moved(axis, -1e-4)) / 2e-4;
        let found: f64 = gradient.screen.iter().map(|s| f64::from(s[axis]) * 2.0 / size).sum();
        assert!((found - expected).abs() <= 1e-4 * expected.abs(), "{found} instead of {expected}");
    }
}

/// More splats than a strip takes at a time.
#[test]
fn long_lists_have_the_derivatives_of_the_definition() {
    let mut scene = Scene::new(17, 20_000, 64, 16);
    scene.posed.factors.iter_mut().for_each(|factor| *factor *= 0.2);
    scene.posed.opacities.iter_mut().for_each(|opacity| *opacity *= 0.05);
    let mut renderer = Renderer::new();
    let gradient = scene.gradient(&mut renderer, Derivatives::Exact);
    assert!(renderer.visible() > 2 * 4096, "{} splats", renderer.visible());
    let chosen = scene.chosen();
    let gaussian = |blended: &Blended| match *blended {
        Blended::Gaussian(i) => Some(i),
        Blended::Underlay => None,
    };
    let mut drawn: Vec<usize> = chosen.iter().flatten().filter_map(gaussian).collect();
    drawn.sort_unstable();
    drawn.dedup();
    let some: Vec<usize> = drawn.into_iter().step_by(400).collect();
    assert!(some.len() > 10);
    let loss = |p: &OwnedPosed| scene.loss(p, &scene.camera, &chosen);
    let expected: Vec<f64> =
        some.iter().map(|&i| difference(&scene.posed, loss, 1e-4, |p| &mut p.opacities[i])).collect();
    let found: Vec<f32> = some.iter().map(|&i| gradient.opacities[i]).collect();
    assert_close("opacities", &found, &expected, 1e-5);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn threads_and_vector_widths_do_not_change_a_bit(seed: u64, width in 1_u32..600, height in 1_u32..70) {
        let scene = Scene::new(seed, 900, width, height);
        for derivatives in [Derivatives::Exact, Derivatives::OriginalKernels] {
            let with_threads = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| scene.gradient(&mut Renderer::new(), derivatives))
            };
            let one = with_threads(1);
            prop_assert_eq!(&with_threads(2), &one);
            prop_assert_eq!(&with_threads(5), &one);
            for level in SimdLevel::ALL {
                if let Some(mut renderer) = Renderer::with_simd_level(level) {
                    prop_assert_eq!(&scene.gradient(&mut renderer, derivatives), &one);
                }
            }
        }
    }

    #[test]
    fn the_order_of_gaussians_does_not_matter(seed: u64) {
        let mut scene = Scene::new(seed, 400, 48, 40);
        prop_assume!(has_distinct_depths(&scene.posed, &scene.camera));
        let mut order: Vec<usize> = (0..scene.posed.len()).collect();
        let mut random = Random(seed ^ 1);
        (1..order.len()).for_each(|i| order.swap(i, random.below(i + 1)));
        let gradient = scene.exact();
        scene.posed = chosen(&scene.posed, &order);
        let shuffled = scene.exact();
        let k = (scene.posed.sh_degree + 1).pow(2);
        for (new, &old) in order.iter().enumerate() {
            prop_assert_eq!(shuffled.means[new], gradient.means[old]);
            prop_assert_eq!(shuffled.factors[new], gradient.factors[old]);
            prop_assert_eq!(shuffled.opacities[new], gradient.opacities[old]);
            prop_assert_eq!(shuffled.screen[new], gradient.screen[old]);
            prop_assert_eq!(shuffled.radii[new], gradient.radii[old]);
            prop_assert_eq!(&shuffled.sh[k * new..][..k], &gradient.sh[k * old..][..k]);
        }
    }

    /// A number that is not finite takes its own Gaussian's derivatives and no other's.
    #[test]
    fn bad_numbers_do_not_spread(seed: u64) {
        let mut scene = Scene::new(seed, 60, 40, 40);
        let mut random = Random(seed ^ 2);
        let victim = random.below(60);
        scene.posed.means[victim][random.below(3)] = f32::NAN;
        let gradient = scene.exact();
        let k = (scene.posed.sh_degree + 1).pow(2);
        prop_assert_eq!(gradient.means[victim], Vec3::ZERO);
        prop_assert_eq!(gradient.factors[victim], Mat3::ZERO);
        prop_assert_eq!((gradient.opacities[victim], gradient.radii[victim]), (0.0, 0.0));
        prop_assert!(gradient.sh[k * victim..][..k].as_flattened().iter().all(|&v| v == 0.0));
        prop_assert!(gradient.sh.as_flattened().iter().all(|v| v.is_finite()));
        prop_assert!(gradient.means.iter().all(|v| v.is_finite()));
        prop_assert!(gradient.factors.iter().all(|v| v.is_finite()));
    }
}

#[test]
fn nothing_carries_over_from_frame_to_frame() {
    let mut renderer = Renderer::new();
    let mut gradient = PosedGradient::default();
    for (seed, count, width, height) in [(7, 700, 300, 90), (8, 3, 17, 16), (9, 2000, 64, 64), (10, 0, 1, 5)]
    {
        let scene = Scene::new(seed, count, width, height);
        let (posed, view) = (&scene.posed, scene.view());
        renderer.render(&posed.as_posed(), &view).unwrap();
        renderer
            .backward(&posed.as_posed(), &view, &scene.upstream, &mut gradient, Derivatives::Exact)
            .unwrap();
        assert_eq!(gradient, scene.exact());
    }
}

/// One Gaussian straight ahead, one pixel.
fn single(opacity: f32) -> Scene {
    let posed = OwnedPosed {
        means: vec![Vec3::new(0.0, 0.0, 2.0)],
        factors: vec![Mat3::IDENTITY * 0.5],
        opacities: vec![opacity],
        sh_degree: 0,
        sh: vec![[1.0, 0.5, 0.0]],
        view_frames: None,
        colour_clamp: ColourClamp::NonNegative,
        rotations: None,
    };
    let camera = Camera {
        width: 1,
        height: 1,
        fx: 100.0,
        fy: 100.0,
        cx: 0.5,
        cy: 0.5,
        camera_from_world: glam::DMat4::IDENTITY,
    };
    let upstream = RenderedGradient { image: Image::filled(1, 1, [1.0, 0.0, 0.0]), alpha: None };
    Scene { posed, camera, settings: Settings { background: [0.0; 3], antialiased: false }, upstream }
}

#[test]
fn the_original_kernels_pass_derivatives_through_the_cap_of_alpha() {
    let red = 0.5 + 0.282_094_79;
    for (opacity, exact) in [(0.9, red), (1.0, 0.0)] {
        let scene = single(opacity);
        assert!((scene.exact().opacities[0] - exact).abs() < 1e-6);
        let original = scene.gradient(&mut Renderer::new(), Derivatives::OriginalKernels);
        assert!((original.opacities[0] - red).abs() < 1e-6);
        // The colour's own derivative knows the cap.
        let weight = opacity.min(0.99) * 0.282_094_79;
        assert!((original.sh[0][0] - weight).abs() < 1e-6 && original.sh[0][1] == 0.0);
    }
}

#[test]
fn the_original_kernels_enlarge_the_squared_determinant() {
    let mut scene = single(0.5);
    // Off the pixel's centre, so that the covariance matters; a covariance that is the low-pass and little more.
    scene.posed.means[0] = Vec3::new(0.004, 0.0, 2.0);
    scene.posed.factors[0] = Mat3::IDENTITY * 0.002;
    let exact = scene.exact().factors[0];
    let original = scene.gradient(&mut Renderer::new(), Derivatives::OriginalKernels).factors[0];
    let determinant: f64 = 0.31 * 0.31;
    let expected = 1.0 / (1.0 + 1e-7 / determinant.powi(2));
    let ratio = f64::from(original.x_axis.x) / f64::from(exact.x_axis.x);
    assert!((ratio - expected).abs() < 2e-6 && expected < 1.0 - 1e-5, "{ratio} instead of {expected}");
}

#[test]
fn the_original_kernels_differentiate_the_limited_jacobian_by_depth_as_if_it_were_not() {
    let mut scene = single(0.5);
    scene.posed.means[0] = Vec3::new(0.05, -0.04, 2.0);
    scene.posed.factors[0] = Mat3::from_cols_array(&[0.03, 0.0, 0.01, 0.0, 0.04, 0.02, 0.01, 0.02, 0.05]);
    let exact = scene.exact();
    let original = scene.gradient(&mut Renderer::new(), Derivatives::OriginalKernels);
    // The rows of the Jacobian are f/z (1, 0, -t) and f/z (0, 1, -t') with t, t' at the limit; by their last entries the
    // loss changes as the third row of M times its change by the rows of J M, which is what the first two rows of M show.
    let (scale, limit) = (100.0 / 2.0, 1.3 * 0.005);
    let factor = scene.posed.factors[0];
    let by_last = |axis: usize| factor.row(2).dot(exact.factors[0].row(axis)) / scale;
    let expected = scale / 2.0 * limit * (by_last(0) - by_last(1));
    let found = original.means[0] - exact.means[0];
    assert!(expected.abs() > 1e-3 * exact.means[0].z.abs(), "{expected} of {:?}", exact.means[0]);
    assert!((found.z - expected).abs() <= 1e-3 * expected.abs(), "{found} instead of {expected}");
    assert!(found.truncate().length() <= 1e-5 * exact.means[0].length());
}

#[test]
fn the_original_kernels_differentiate_the_antialiasing_factor_at_the_low_passed_covariance() {
    let mut scene = single(0.5);
    scene.settings.antialiased = true;
    // Screen covariance: the identity. At the pixel's centre nothing but the factor depends on it.
    scene.posed.factors[0] = Mat3::IDENTITY * 0.02;
    let by_opacity = scene.exact().opacities[0];
    let low_pass = 0.3;
    // d/dx of x y / ((x + w) (y + w)) for x = y.
    let slope = |x: f32| low_pass * x / (x + low_pass).powi(3);
    let by_ratio = 0.5 * by_opacity * 0.5 * (1.0_f32 + low_pass).powi(2);
    let scale = 100.0 / 2.0;
    for (derivatives, at) in [(Derivatives::Exact, 1.0), (Derivatives::OriginalKernels, 1.0 + low_pass)] {
        let found = scene.gradient(&mut Renderer::new(), derivatives).factors[0].x_axis.x;
        let expected = by_ratio * slope(at) * 2.0 * scale * scale * 0.02;
        assert!((found - expected).abs() <= 1e-5 * expected.abs(), "{found} instead of {expected}");
    }
}

#[test]
fn a_frame_that_was_not_drawn_is_refused() {
    let mut scene = single(0.5);
    let backward = |renderer: &mut Renderer, scene: &Scene| {
        let (exact, mut gradient) = (Derivatives::Exact, PosedGradient::default());
        renderer.backward(&scene.posed.as_posed(), &scene.view(), &scene.upstream, &mut gradient, exact)
    };
    let mut renderer = Renderer::new();
    assert_eq!(backward(&mut renderer, &scene).unwrap_err().field, "frame");
    renderer.render(&scene.posed.as_posed(), &scene.view()).unwrap();
    backward(&mut renderer, &scene).unwrap();
    scene.upstream.image = Image::filled(2, 1, [0.0; 3]);
    assert_eq!(backward(&mut renderer, &scene).unwrap_err().field, "gradient of the image");
}
