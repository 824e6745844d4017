//! Gaussians drawn over, among and behind a mesh: the definition in f64, occlusion by a mesh that the triangle rasterizer
//! drew, derivatives, threads and vector widths.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/differences.rs"]
mod differences;
#[path = "../../../tests/support/random_scene.rs"]
mod random_scene;

use differences::{assert_close, assert_gradient, difference};
use glam::{DVec3, Mat3, Vec3};
use proptest::prelude::*;
use random_scene::{Random, Settings, camera, posed};
use skinsplat_core::scene::{
    Camera, ColourClamp, Image, Mask, OwnedPosed, PosedGradient, Rendered, RenderedGradient, Underlay,
};
use skinsplat_render::View;
use skinsplat_render::definition as reference_splatting;
use skinsplat_render::definition::Blended;
use skinsplat_render::mesh::{Mesh, SamplePattern, draw};
use skinsplat_render::splat::{Derivatives, Renderer, SimdLevel, render};

/// A mesh's drawing, or something like it.
#[derive(Clone)]
struct Layer {
    colour: Image,
    coverage: Mask,
    depth: Mask,
}

impl Layer {
    /// A slope with holes, soft edges and steps in depth, within the depths of [`posed`].
    fn random(random: &mut Random, camera: &Camera) -> Self {
        let (width, height) = (camera.width as usize, camera.height as usize);
        let distance = camera.camera_from_world.transform_point3(DVec3::ZERO).z;
        let slope = [random.between(-0.05, 0.05), random.between(-0.05, 0.05)];
        let (mut colour, mut coverage, mut depth) = (Vec::new(), Vec::new(), Vec::new());
        for pixel in 0..width * height {
            let share = match random.below(4) {
                0 => 0.0,
                1 => random.unit(),
                _ => 1.0,
            };
            let covered = share > 0.0;
            let z = distance
                + slope[0] * (pixel % width) as f64
                + slope[1] * (pixel / width) as f64
                + random.between(-0.3, 0.3);
            let any = || if covered { random.unit() as f32 } else { 0.0 };
            colour.push(std::array::from_fn({
                let mut any = any;
                move |_| any()
            }));
            coverage.push(share as f32);
            depth.push(if covered { z.max(0.05) as f32 } else { 0.0 });
        }
        Self {
            colour: Image::new(width, height, colour).unwrap(),
            coverage: Mask::new(width, height, coverage).unwrap(),
            depth: Mask::new(width, height, depth).unwrap(),
        }
    }

    /// The same everywhere.
    fn even(camera: &Camera, colour: [f32; 3], coverage: f32, depth: f32) -> Self {
        let (width, height) = (camera.width as usize, camera.height as usize);
        Self {
            colour: Image::filled(width, height, colour),
            coverage: Mask::filled(width, height, coverage),
            depth: Mask::filled(width, height, depth),
        }
    }

    fn underlay(&self) -> Underlay<'_> {
        Underlay { colour: &self.colour, coverage: &self.coverage, depth: &self.depth }
    }
}

struct Scene {
    posed: OwnedPosed,
    camera: Camera,
    settings: Settings,
    layer: Layer,
    upstream: RenderedGradient,
}

impl Scene {
    fn new(seed: u64, count: usize, width: u32, height: u32) -> Self {
        let mut random = Random(seed);
        let posed = posed(&mut random, count);
        let camera = camera(&mut random, width, height);
        let settings = Settings::random(&mut random);
        let layer = Layer::random(&mut random, &camera);
        let (w, h) = (width as usize, height as usize);
        let mut value = || random.between(-1.0, 1.0) as f32;
        let image = (0..w * h).map(|_| [value(), value(), value()]).collect();
        let alpha = (0..w * h).map(|_| value()).collect();
        let alpha = (!seed.is_multiple_of(3)).then(|| Mask::new(w, h, alpha).unwrap());
        let upstream = RenderedGradient { image: Image::new(w, h, image).unwrap(), alpha };
        Self { posed, camera, settings, layer, upstream }
    }

    fn view(&self) -> View<'_> {
        self.settings.view(&self.camera).with_underlay(Some(self.layer.underlay()))
    }

    fn draw(&self, renderer: &mut Renderer) -> (Rendered, Mask) {
        drawn(renderer, &self.posed, &self.view())
    }

    fn gradient(&self, renderer: &mut Renderer) -> PosedGradient {
        let mut gradient = PosedGradient::default();
        let (posed, view) = (&self.posed, self.view());
        renderer.render(&posed.as_posed(), &view).unwrap();
        renderer
            .backward(&posed.as_posed(), &view, &self.upstream, &mut gradient, Derivatives::Exact)
            .unwrap();
        gradient
    }

    fn selected(&self) -> Vec<Vec<Blended>> {
        reference_splatting::selected(&self.posed.as_posed(), &self.view()).unwrap()
    }

    fn expected(&self, posed: &OwnedPosed, layer: &Layer, selected: &[Vec<Blended>]) -> Vec<[f64; 5]> {
        let view = self.settings.view(&self.camera).with_underlay(Some(layer.underlay()));
        reference_splatting::render_selected(&posed.as_posed(), &view, selected).unwrap()
    }

    /// The loss in f64 whose derivatives by pixel are `upstream`.
    fn loss(&self, posed: &OwnedPosed, layer: &Layer, selected: &[Vec<Blended>]) -> f64 {
        let of = |(i, pixel): (usize, [f64; 5])| {
            let colour = self.upstream.image.pixels()[i];
            let alpha = self.upstream.alpha.as_ref().map_or(0.0, |alpha| alpha.values()[i]);
            (0..3).map(|c| f64::from(colour[c]) * pixel[c]).sum::<f64>() + f64::from(alpha) * pixel[3]
        };
        self.expected(posed, layer, selected).into_iter().enumerate().map(of).sum()
    }
}

/// A frame with an underlay, and what is shown of that.
fn drawn(renderer: &mut Renderer, posed: &OwnedPosed, view: &View) -> (Rendered, Mask) {
    let rendered = renderer.render(&posed.as_posed(), view).unwrap().clone();
    (rendered, renderer.underlay_weight().unwrap().clone())
}

fn channels(rendered: &Rendered) -> Vec<[f32; 5]> {
    let pixels = rendered.image.pixels().iter().zip(rendered.alpha.values()).zip(rendered.depth.values());
    pixels.map(|((&[r, g, b], &alpha), &depth)| [r, g, b, alpha, depth]).collect()
}

fn bits(rendered: &Rendered) -> Vec<[u32; 5]> {
    channels(rendered).into_iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

fn forward_camera(size: u32) -> Camera {
    Camera {
        width: size,
        height: size,
        fx: 100.0,
        fy: 100.0,
        cx: f64::from(size) / 2.0,
        cy: f64::from(size) / 2.0,
        camera_from_world: glam::DMat4::IDENTITY,
    }
}

/// One wide red Gaussian two metres ahead.
fn ahead(opacity: f32) -> OwnedPosed {
    OwnedPosed {
        means: vec![Vec3::new(0.0, 0.0, 2.0)],
        factors: vec![Mat3::IDENTITY * 0.5],
        opacities: vec![opacity],
        sh_degree: 0,
        sh: vec![[0.5 / 0.282_094_8, -0.5 / 0.282_094_8, -0.5 / 0.282_094_8]],
        view_frames: None,
        colour_clamp: ColourClamp::NonNegative,
        rotations: None,
    }
}

#[test]
fn a_layer_in_front_hides_one_behind_is_seen_through_and_soft_edges_mix() {
    let camera = forward_camera(1);
    let posed = ahead(0.75);
    let green = [0.0, 1.0, 0.0];
    let draw = |coverage: f32, depth: f32| {
        let layer = Layer::even(&camera, green, coverage, depth);
        let view = View::new(&camera).over([0.0, 0.0, 1.0]).with_underlay(Some(layer.underlay()));
        let (rendered, shown) = drawn(&mut Renderer::new(), &posed, &view);
        (channels(&rendered)[0], shown.values()[0])
    };
    let close = |(found, shown): ([f32; 5], f32), expected: [f32; 5], seen: f32| {
        for (a, b) in std::iter::zip(found, expected) {
            assert!((a - b).abs() < 1e-6, "{found:?} instead of {expected:?}");
        }
        assert!((shown - seen).abs() < 1e-6, "{shown} instead of {seen}");
    };
    close(draw(1.0, 1.5), [0.0, 1.0, 0.0, 1.0, 1.5], 1.0);
    close(draw(1.0, 2.5), [0.75, 0.25, 0.0, 1.0, 0.75 * 2.0 + 0.25 * 2.5], 0.25);
    close(draw(0.5, 1.5), [0.375, 0.5, 0.125, 0.875, 0.5 * 1.5 + 0.375 * 2.0], 0.5);
    close(draw(0.5, 2.5), [0.75, 0.125, 0.125, 0.875, 0.75 * 2.0 + 0.125 * 2.5], 0.125);
    // No depth lies behind everything, no coverage is nothing, at the same depth the layer comes first.
    let (found, shown) = draw(1.0, f32::NAN);
    assert!((found[1] - 0.25).abs() < 1e-6 && (shown - 0.25).abs() < 1e-6, "{found:?}");
    close(draw(0.0, 1.5), [0.75, 0.0, 0.25, 0.75, 1.5], 0.0);
    close(draw(1.0, 2.0), [0.0, 1.0, 0.0, 1.0, 2.0], 1.0);
}

#[test]
fn little_light_is_enough_for_a_layer_but_not_for_a_splat() {
    let camera = forward_camera(1);
    let mut posed = ahead(0.99);
    for z in [2.1, 2.2] {
        posed.means.push(Vec3::new(0.0, 0.0, z));
        posed.factors.push(Mat3::IDENTITY * 0.5);
        posed.opacities.push(0.99);
        posed.sh.push([0.5 / 0.282_094_8; 3]);
    }
    let layer = Layer::even(&camera, [0.0, 1.0, 0.0], 1.0, 3.0);
    let view = View::new(&camera).with_underlay(Some(layer.underlay()));
    let (rendered, shown) = drawn(&mut Renderer::new(), &posed, &view);
    // The first leaves a hundredth, the second would leave a ten-thousandth less a rounding: whatever it does, the rest
    // is the layer's.
    let red = channels(&rendered)[0];
    assert_eq!(red[3], 1.0);
    assert!(shown.values()[0] > 0.9e-4 && shown.values()[0] < 1.1e-2);
    assert!((red[0] + shown.values()[0] - 1.0).abs() < 1e-6);
}

/// A tilted triangle through a cloud of Gaussians, drawn by the triangle rasterizer.
#[test]
fn a_drawn_mesh_hides_what_lies_behind_it() {
    let camera = forward_camera(32);
    let vertices = [Vec3::new(-4.0, -4.0, 1.0), Vec3::new(4.0, -4.0, 1.0), Vec3::new(0.0, 4.0, 3.0)];
    let mesh = Mesh::new(&vertices, &[[0, 1, 2]]).unwrap();
    let drawing = draw(&mesh, &camera, SamplePattern::new(4), |_| [0.0, 1.0, 0.0]).unwrap();
    let draw = |z: f32| {
        let mut posed = ahead(0.9);
        posed.means[0].z = z;
        let view = View::new(&camera).with_underlay(Some(drawing.underlay()));
        render(&posed.as_posed(), &view).unwrap().image
    };
    // On the middle column the triangle's depth rises from about 1.7 to 2.3 over the image.
    let image = draw(2.0);
    let boundary = (0..32).find(|&y| image.at(16, y)[0] > 0.5).expect("red below");
    assert!((10..22).contains(&boundary), "the Gaussian comes through at row {boundary}");
    for y in 0..32 {
        assert_eq!(image.at(16, y)[0] > 0.5, y >= boundary, "row {y}");
        let depth = f64::from(drawing.depth.at(16, y));
        assert_eq!(depth > 2.0, y >= boundary, "row {y} at {depth}");
    }
    assert!(draw(4.0).pixels().iter().all(|p| p[0] == 0.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// As without a layer, rounding decides at a few pixels whether a splat is drawn; and whether it lies in front.
    #[test]
    fn images_are_those_of_the_definition(seed: u64, width in 1_u32..70, height in 1_u32..70) {
        let count = Random(seed ^ 5).below(61);
        let scene = Scene::new(seed, count, width, height);
        let (rendered, shown) = scene.draw(&mut Renderer::new());
        let found = channels(&rendered);
        let selected = scene.selected();
        let expected = scene.expected(&scene.posed, &scene.layer, &selected);
        let mut errors: Vec<f64> = std::iter::zip(&found, &expected)
            .flat_map(|(a, b)| (0..5).map(|c| (f64::from(a[c]) - b[c]).abs() / [1.0, 1.0, 1.0, 1.0, 10.0][c]))
            .collect();
        let mut brighter = scene.layer.clone();
        brighter.colour.pixels_mut().as_flattened_mut().iter_mut().for_each(|c| *c += 1.0);
        let lit = scene.expected(&scene.posed, &brighter, &selected);
        let weights = std::iter::zip(&lit, &expected).map(|(a, b)| a[0] - b[0]);
        errors.extend(std::iter::zip(weights, shown.values()).map(|(a, &b)| (a - f64::from(b)).abs()));
        errors.sort_unstable_by(f64::total_cmp);
        let flips = errors.iter().filter(|&&e| e > 2e-5).count();
        prop_assert!(flips * 100 <= errors.len() + 500, "{flips} of {} differ", errors.len());
    }

    #[test]
    fn threads_and_vector_widths_do_not_change_a_bit(seed: u64, width in 1_u32..600, height in 1_u32..70) {
        let scene = Scene::new(seed, 900, width, height);
        let all = |renderer: &mut Renderer| {
            let (rendered, shown) = scene.draw(renderer);
            (bits(&rendered), shown, scene.gradient(renderer))
        };
        let with_threads = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| all(&mut Renderer::new()))
        };
        let one = with_threads(1);
        prop_assert!(with_threads(2) == one);
        prop_assert!(with_threads(5) == one);
        for level in SimdLevel::ALL {
            if let Some(mut renderer) = Renderer::with_simd_level(level) {
                prop_assert!(all(&mut renderer) == one, "{level:?}");
            }
        }
    }

    #[test]
    fn where_nothing_is_covered_the_pixel_is_as_without_a_layer(seed: u64, width in 1_u32..300, height in 1_u32..50) {
        let mut scene = Scene::new(seed, 500, width, height);
        let plain = bits(&render(&scene.posed.as_posed(), &scene.settings.view(&scene.camera)).unwrap());
        let (over, shown) = scene.draw(&mut Renderer::new());
        let over = bits(&over);
        for (i, &coverage) in scene.layer.coverage.values().iter().enumerate() {
            if coverage == 0.0 {
                prop_assert_eq!(over[i], plain[i]);
                prop_assert_eq!(shown.values()[i], 0.0);
            }
        }
        scene.layer.coverage.values_mut().fill(0.0);
        prop_assert_eq!(bits(&scene.draw(&mut Renderer::new()).0), plain);
        let mut gradient = PosedGradient::default();
        let mut renderer = Renderer::new();
        let Scene { posed, camera, settings, upstream, .. } = &scene;
        let view = settings.view(camera);
        renderer.render(&posed.as_posed(), &view).unwrap();
        prop_assert_eq!(renderer.underlay_weight(), None);
        renderer.backward(&posed.as_posed(), &view, upstream, &mut gradient, Derivatives::Exact).unwrap();
        prop_assert_eq!(scene.gradient(&mut Renderer::new()), gradient);
    }
}

#[test]
fn every_kind_of_parameter_has_the_derivative_of_the_definition() {
    let mut parts = [0; 2];
    for seed in 0..24 {
        let scene = Scene::new(seed, 14, 24, 20);
        let posed = &scene.posed;
        let selected = scene.selected();
        for blended in &selected {
            let front = blended.iter().position(|part| *part == Blended::Underlay);
            parts[0] += front.unwrap_or(blended.len());
            parts[1] += front.map_or(0, |front| blended.len() - front - 1);
        }
        let gradient = scene.gradient(&mut Renderer::new());
        println!("seed {seed}");
        assert_gradient(posed, &gradient, |p| scene.loss(p, &scene.layer, &selected));
    }
    assert!(parts.iter().all(|&n| n > 1500), "{parts:?}");
}

#[test]
fn the_layers_colour_has_the_derivative_that_is_shown() {
    let scene = Scene::new(3, 40, 24, 20);
    let selected = scene.selected();
    let (_, shown) = scene.draw(&mut Renderer::new());
    let (mut found, mut expected) = (Vec::new(), Vec::new());
    for i in 0..shown.values().len() {
        for c in 0..3 {
            // The image is linear in the layer's colour.
            let at = |value: f32| {
                let mut layer = scene.layer.clone();
                layer.colour.pixels_mut()[i][c] = value;
                scene.loss(&scene.posed, &layer, &selected)
            };
            expected.push(at(1.0) - at(0.0));
            found.push(scene.upstream.image.pixels()[i][c] * shown.values()[i]);
        }
    }
    assert_close("colour", &found, &expected, 1e-5);
}

/// More splats than a strip takes at a time, with layers in front of, between and behind its batches.
#[test]
fn long_lists_have_the_image_and_the_derivatives_of_the_definition() {
    let mut scene = Scene::new(17, 20_000, 64, 16);
    scene.posed.factors.iter_mut().for_each(|factor| *factor *= 0.2);
    scene.posed.opacities.iter_mut().for_each(|opacity| *opacity *= 0.05);
    let mut random = Random(4);
    for depth in scene.layer.depth.values_mut() {
        *depth = random.between(0.3, 7.0) as f32;
    }
    let mut renderer = Renderer::new();
    let (rendered, _) = scene.draw(&mut renderer);
    assert!(renderer.visible() > 2 * 4096, "{} splats", renderer.visible());
    let selected = scene.selected();
    let expected = scene.expected(&scene.posed, &scene.layer, &selected);
    let far = std::iter::zip(channels(&rendered), &expected)
        .filter(|(a, b)| (0..5).any(|c| (f64::from(a[c]) - b[c]).abs() > 5e-4))
        .count();
    assert!(far < 8, "{far} pixels differ");
    let gradient = scene.gradient(&mut renderer);
    let gaussian = |blended: &Blended| match *blended {
        Blended::Gaussian(i) => Some(i),
        Blended::Underlay => None,
    };
    let mut drawn: Vec<usize> = selected.iter().flatten().filter_map(gaussian).collect();
    drawn.sort_unstable();
    drawn.dedup();
    let some: Vec<usize> = drawn.into_iter().step_by(400).collect();
    assert!(some.len() > 10);
    let loss = |p: &OwnedPosed| scene.loss(p, &scene.layer, &selected);
    let expected: Vec<f64> =
        some.iter().map(|&i| difference(&scene.posed, loss, 1e-4, |p| &mut p.opacities[i])).collect();
    let found: Vec<f32> = some.iter().map(|&i| gradient.opacities[i]).collect();
    assert_close("opacities", &found, &expected, 1e-4);
}

#[test]
fn a_layer_of_another_size_is_refused() {
    let mut scene = Scene::new(1, 3, 8, 8);
    scene.layer.coverage = Mask::filled(7, 8, 1.0);
    let error = render(&scene.posed.as_posed(), &scene.view()).unwrap_err().to_string();
    assert_eq!(error, "underlay.coverage: 7x8 pixels; expected the camera's 8x8");
}
