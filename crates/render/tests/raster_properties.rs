//! Properties of the splatting rasterizer: the definition in f64, order, threads, background, bad numbers, extremes.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/random_scene.rs"]
mod random_scene;

use glam::{Mat3, Vec3};
use proptest::prelude::*;
use random_scene::{Random, Settings, camera, chosen, has_distinct_depths, posed};
use skinsplat_core::scene::{Camera, OwnedPosed, Rendered};
use skinsplat_render::View;
use skinsplat_render::definition as reference_splatting;
use skinsplat_render::splat::{Renderer, SimdLevel, render};

/// A scene of up to `most` Gaussians, a camera and settings, all from a seed.
fn scene(seed: u64, most: usize, width: u32, height: u32) -> (OwnedPosed, Camera, Settings) {
    let mut random = Random(seed);
    let count = random.below(most + 1);
    let posed = posed(&mut random, count);
    let camera = camera(&mut random, width, height);
    let settings = Settings::random(&mut random);
    (posed, camera, settings)
}

/// Red, green, blue, alpha and depth of every pixel.
fn channels(rendered: &Rendered) -> Vec<[f32; 5]> {
    let pixels = rendered.image.pixels().iter().zip(rendered.alpha.values()).zip(rendered.depth.values());
    pixels.map(|((&[r, g, b], &alpha), &depth)| [r, g, b, alpha, depth]).collect()
}

fn with_threads(threads: usize, posed: &OwnedPosed, view: &View) -> Rendered {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| render(&posed.as_posed(), view)).unwrap()
}

/// One Gaussian in front of a camera at the origin that looks along z.
fn single(mean: Vec3, factor: Mat3, opacity: f32) -> OwnedPosed {
    OwnedPosed {
        means: vec![mean],
        factors: vec![factor],
        opacities: vec![opacity],
        sh_degree: 0,
        sh: vec![[1.0, 0.5, 0.0]],
        view_frames: None,
        colour_clamp: Default::default(),
        rotations: None,
    }
}

fn forward_camera(width: u32, height: u32) -> Camera {
    Camera {
        width,
        height,
        fx: 100.0,
        fy: 100.0,
        cx: f64::from(width) / 2.0,
        cy: f64::from(height) / 2.0,
        camera_from_world: glam::DMat4::IDENTITY,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// Rounding decides at a few pixels whether alpha reaches 1/255, whether the transmittance reaches 1e-4, or which
    /// whole number a radius is rounded up to: a splat of alpha up to 0.011 more or less.
    #[test]
    fn images_are_those_of_the_definition(seed: u64, width in 1_u32..70, height in 1_u32..70) {
        let (posed, camera, settings) = scene(seed, 60, width, height);
        let found = channels(&render(&posed.as_posed(), &settings.view(&camera)).unwrap());
        let expected = reference_splatting::render(&posed.as_posed(), &settings.view(&camera)).unwrap();
        let mut errors: Vec<f64> = std::iter::zip(&found, &expected)
            .flat_map(|(a, b)| (0..5).map(|c| (f64::from(a[c]) - b[c]).abs() / [1.0, 1.0, 1.0, 1.0, 10.0][c]))
            .collect();
        errors.sort_unstable_by(f64::total_cmp);
        let flips = errors.iter().filter(|&&e| e > 2e-5).count();
        prop_assert!(flips * 100 <= errors.len() + 500, "{flips} of {} differ", errors.len());
        prop_assert!(errors[errors.len() - 1] <= 0.03, "by {}", errors[errors.len() - 1]);
    }

    #[test]
    fn threads_and_vector_widths_do_not_change_a_bit(seed: u64, width in 1_u32..600, height in 1_u32..70) {
        let (posed, camera, settings) = scene(seed, 900, width, height);
        let one = with_threads(1, &posed, &settings.view(&camera));
        prop_assert_eq!(&with_threads(2, &posed, &settings.view(&camera)), &one);
        prop_assert_eq!(&with_threads(5, &posed, &settings.view(&camera)), &one);
        for level in SimdLevel::ALL {
            if let Some(mut renderer) = Renderer::with_simd_level(level) {
                prop_assert_eq!(renderer.render(&posed.as_posed(), &settings.view(&camera)).unwrap(), &one);
            }
        }
    }

    #[test]
    fn the_order_of_gaussians_does_not_matter(seed: u64) {
        let (posed, camera, settings) = scene(seed, 400, 48, 40);
        prop_assume!(has_distinct_depths(&posed, &camera));
        let mut order: Vec<usize> = (0..posed.len()).collect();
        let mut random = Random(seed ^ 1);
        (1..order.len()).for_each(|i| order.swap(i, random.below(i + 1)));
        prop_assert_eq!(render(&chosen(&posed, &order).as_posed(), &settings.view(&camera)).unwrap(), render(&posed.as_posed(), &settings.view(&camera)).unwrap());
    }

    #[test]
    fn the_background_enters_by_the_transmittance_left(seed: u64) {
        let (posed, camera, settings) = scene(seed, 80, 40, 30);
        let over = render(&posed.as_posed(), &settings.view(&camera)).unwrap();
        let black = render(&posed.as_posed(), &settings.view(&camera).over([0.0; 3])).unwrap();
        prop_assert_eq!((&over.alpha, &over.depth), (&black.alpha, &black.depth));
        for (a, b) in std::iter::zip(channels(&over), channels(&black)) {
            prop_assert!((0.0..=1.0).contains(&a[3]));
            for c in 0..3 {
                prop_assert!((a[c] - (b[c] + (1.0 - b[3]) * settings.background[c])).abs() <= 5e-7);
            }
        }
    }

    /// A number that is not finite removes its Gaussian and nothing else.
    #[test]
    fn bad_numbers_remove_their_gaussian(
        seed: u64,
        field in 0_usize..5,
        bad in prop::sample::select(vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY]),
    ) {
        let (mut posed, camera, settings) = scene(seed, 60, 40, 40);
        prop_assume!(!posed.is_empty());
        let mut random = Random(seed ^ 2);
        let (victim, axis) = (random.below(posed.len()), random.below(3));
        match field {
            0 => posed.means[victim][axis] = bad,
            1 => posed.factors[victim].col_mut(axis)[random.below(3)] = bad,
            2 => posed.opacities[victim] = bad,
            3 => {
                let first = victim * (posed.sh_degree + 1).pow(2);
                posed.sh[first][axis] = bad;
            }
            _ => match &mut posed.view_frames {
                Some(frames) if posed.sh_degree > 0 => frames[victim].col_mut(axis)[0] = bad,
                _ => return Ok(()),
            },
        }
        let others: Vec<usize> = (0..posed.len()).filter(|&i| i != victim).collect();
        let found = render(&posed.as_posed(), &settings.view(&camera)).unwrap();
        prop_assert!(channels(&found).as_flattened().iter().all(|v| v.is_finite()));
        prop_assert_eq!(found, render(&chosen(&posed, &others).as_posed(), &settings.view(&camera)).unwrap());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// Any finite number anywhere: the image is finite, and alpha a share.
    #[test]
    fn extreme_numbers_stay_finite(seed: u64) {
        let mut random = Random(seed);
        let extreme = |random: &mut Random| {
            let size = 10f64.powf(random.between(-38.0, 38.0)) as f32;
            [0.0, 1.0, -1.0, size, -size, 0.2, 1.0 / 255.0, f32::MAX, f32::MIN_POSITIVE][random.below(9)]
        };
        let mut posed = posed(&mut random, 40);
        for i in 0..posed.len() {
            match random.below(4) {
                0 => posed.means[i][random.below(3)] = extreme(&mut random),
                1 => posed.factors[i].col_mut(random.below(3))[random.below(3)] = extreme(&mut random),
                2 => posed.opacities[i] = extreme(&mut random).clamp(0.0, 1.0),
                _ => {
                    let k = random.below(posed.sh.len());
                    posed.sh[k][random.below(3)] = extreme(&mut random).clamp(-1e30, 1e30);
                }
            }
        }
        let camera = camera(&mut random, 40, 30);
        let rendered = render(&posed.as_posed(), &Settings::random(&mut random).view(&camera)).unwrap();
        for pixel in channels(&rendered) {
            prop_assert!(pixel[..3].iter().all(|v| v.is_finite()), "{pixel:?}");
            prop_assert!((0.0..=1.0).contains(&pixel[3]) && pixel[4].is_finite(), "{pixel:?}");
        }
    }
}

#[test]
fn nothing_in_view_leaves_the_background() {
    let (all, camera, settings) = scene(5, 50, 37, 21);
    let mut behind = chosen(&all, &(0..all.len()).collect::<Vec<_>>());
    behind.means.iter_mut().for_each(|mean| *mean = (camera.position() * 2.0).as_vec3());
    for posed in [chosen(&all, &[]), behind] {
        let rendered = render(&posed.as_posed(), &settings.view(&camera)).unwrap();
        assert!(rendered.image.pixels().iter().all(|&p| p == settings.background));
        assert!(rendered.alpha.values().iter().chain(rendered.depth.values()).all(|&v| v == 0.0));
    }
}

#[test]
fn equal_depths_are_drawn_in_index_order() {
    let mut posed = single(Vec3::new(0.0, 0.0, 2.0), Mat3::IDENTITY * 0.1, 0.8);
    posed.means.push(posed.means[0]);
    posed.factors.push(posed.factors[0]);
    posed.opacities.push(0.8);
    posed.sh.push([-1.0, 0.0, 2.0]);
    let camera = forward_camera(9, 9);
    let first = render(&posed.as_posed(), &View::new(&camera)).unwrap().image.at(4, 4);
    let swapped = render(&chosen(&posed, &[1, 0]).as_posed(), &View::new(&camera)).unwrap().image.at(4, 4);
    assert!(first[0] > swapped[0] + 0.2 && first[2] < swapped[2] - 0.2, "{first:?} {swapped:?}");
}

#[test]
fn a_single_pixel_has_the_alpha_of_the_peak() {
    let posed = single(Vec3::new(0.0, 0.0, 2.0), Mat3::IDENTITY * 0.5, 0.6);
    let rendered = render(&posed.as_posed(), &View::new(&forward_camera(1, 1))).unwrap();
    assert!((rendered.alpha.at(0, 0) - 0.6).abs() < 1e-6);
    assert!((rendered.depth.at(0, 0) - 1.2).abs() < 2e-6);
}

#[test]
fn a_splat_larger_than_the_image_covers_all_of_it() {
    for scale in [1e2, 1e4, 1e6] {
        let posed = single(Vec3::new(0.0, 0.0, 2.0), Mat3::IDENTITY * scale, 0.5);
        let rendered = render(&posed.as_posed(), &View::new(&forward_camera(300, 50))).unwrap();
        assert!(rendered.alpha.values().iter().all(|a| (a - 0.5).abs() < 1e-3), "scale {scale}");
    }
    // Beyond f32: dropped, not drawn as garbage.
    let posed = single(Vec3::new(0.0, 0.0, 2.0), Mat3::IDENTITY * 1e18, 0.5);
    let rendered = render(&posed.as_posed(), &View::new(&forward_camera(30, 50))).unwrap();
    assert!(rendered.alpha.values().iter().all(|&a| a == 0.0));
}

#[test]
fn a_million_splats_in_one_tile_blend_as_their_product() {
    let count = 1_000_000;
    let one = single(Vec3::new(0.0, 0.0, 2.0), Mat3::IDENTITY * 10.0, 0.005);
    let posed = chosen(&one, &vec![0; count]);
    let rendered = render(&posed.as_posed(), &View::new(&forward_camera(16, 16))).unwrap();
    // Until 0.995^n falls below 1e-4.
    let blended = (1e-4_f64.ln() / 0.995_f64.ln()).floor();
    let expected = 1.0 - 0.995_f64.powf(blended);
    assert!(rendered.alpha.values().iter().all(|&a| (f64::from(a) - expected).abs() < 1e-5));
}

#[test]
fn a_renderer_carries_nothing_over_from_frame_to_frame() {
    let mut renderer = Renderer::new();
    for (seed, most, width, height) in [(7, 700, 300, 90), (8, 3, 17, 16), (9, 2000, 64, 64), (10, 0, 1, 5)] {
        let (posed, camera, settings) = scene(seed, most, width, height);
        let view = settings.view(&camera);
        assert_eq!(
            renderer.render(&posed.as_posed(), &view).unwrap(),
            &render(&posed.as_posed(), &view).unwrap()
        );
    }
}

#[test]
fn identity_view_frames_are_no_view_frames() {
    let (mut posed, camera, settings) = scene(3, 100, 50, 50);
    posed.view_frames = None;
    let without = render(&posed.as_posed(), &settings.view(&camera)).unwrap();
    posed.view_frames = Some(vec![Mat3::IDENTITY; posed.len()]);
    assert_eq!(render(&posed.as_posed(), &settings.view(&camera)).unwrap(), without);
}
