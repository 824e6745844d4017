//! The splatting rasterizer against images that the original 3DGS kernels computed, and against reference values in f64.
#![expect(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    clippy::print_stdout,
    reason = "tests; the agreement is printed"
)]

#[path = "../../../tests/support/splat_scene.rs"]
mod splat_scene;
#[path = "../../../tests/support/mod.rs"]
mod support;

use glam::{DMat4, Quat, Vec3};
use serde_json::Value;
use skinsplat_core::scene::{Camera, Gaussians, OwnedPosed};
use skinsplat_render::View;
use skinsplat_render::splat::{Renderer, SimdLevel, render};
use support::{fixture, json};

/// p99.9 and maximum of the absolute difference.
fn difference(a: &[f32], b: &[f32]) -> (f32, f32) {
    assert_eq!(a.len(), b.len());
    let mut d: Vec<f32> = a.iter().zip(b).map(|(a, b)| (a - b).abs()).collect();
    d.sort_unstable_by(f32::total_cmp);
    (d[d.len() * 999 / 1000], d[d.len() - 1])
}

/// Fails unless p99.9 is at most 1e-5 (exp and multiply-add round differently) and the maximum at most 4/255 (where
/// alpha is about 1/255 or the transmittance about 1e-4, rounding decides whether a splat is blended).
#[track_caller]
fn assert_same_image(name: &str, found: &[f32], expected: &[f32]) {
    let (p999, max) = difference(found, expected);
    println!("{name}: p99.9 {p999:e}, maximum {max:e}");
    assert!(p999 <= 1e-5, "{name}: p99.9 {p999:e}");
    assert!(max <= 4.0 / 255.0, "{name}: maximum {max:e}");
}

#[test]
fn scene_s_is_the_image_of_the_original_kernels() {
    let bytes = std::fs::read(fixture("raster/S_front_512_image.npy")).unwrap();
    let golden: Vec<f32> = npyz::NpyFile::new(&bytes[..]).unwrap().into_vec().unwrap();
    let (camera, background) = splat_scene::camera(&json("raster/front_512.json"));
    let gaussians = splat_scene::gaussians(&fixture("raster/scene_S.ply"));
    let posed = OwnedPosed::from_static(&gaussians);
    let view = View::new(&camera).over(background);
    let mut images = Vec::new();
    for level in SimdLevel::ALL {
        let Some(mut renderer) = Renderer::with_simd_level(level) else { continue };
        let rendered = renderer.render(&posed.as_posed(), &view).unwrap().clone();
        assert_same_image(&format!("{level:?}"), rendered.image.pixels().as_flattened(), &golden);
        images.push(rendered);
    }
    assert!(images.windows(2).all(|pair| pair[0] == pair[1]), "every vector width gives the same bits");
}

fn numbers(v: &Value) -> Vec<f32> {
    v.as_array().unwrap().iter().map(|v| v.as_f64().unwrap() as f32).collect()
}

/// The Gaussians of `tiny_render.json`.
fn tiny_gaussians(cases: &Value) -> (Gaussians, Vec<f32>) {
    let mut out = Gaussians { sh_degree: 3, ..Gaussians::default() };
    let mut opacities = Vec::new();
    for case in cases.as_array().unwrap() {
        out.means.push(Vec3::from_slice(&numbers(&case["mean"])));
        out.rotations.push(numbers(&case["quat_wxyz"]).try_into().unwrap());
        out.log_scales.push(Vec3::from_slice(&numbers(&case["scale"])).map(f32::ln));
        out.sh.extend(numbers(&case["sh_16x3"]).chunks_exact(3).map(|c| [c[0], c[1], c[2]]));
        opacities.push(case["opacity"].as_f64().unwrap() as f32);
    }
    out.opacity_logits = vec![0.0; opacities.len()];
    (out, opacities)
}

#[test]
fn tiny_render_has_the_reference_colours_and_transmittance_with_the_tile_cull() {
    let case = json("gs_math/tiny_render.json");
    let (gaussians, opacities) = tiny_gaussians(&case["gaussians"]);
    let mut posed = OwnedPosed::from_static(&gaussians);
    posed.opacities = opacities;
    posed.factors = std::iter::zip(case["gaussians"].as_array().unwrap(), gaussians.unit_rotations())
        .map(|(case, [w, x, y, z])| {
            let scale = Vec3::from_slice(&numbers(&case["scale"]));
            glam::Mat3::from_quat(Quat::from_xyzw(x, y, z, w)) * glam::Mat3::from_diagonal(scale)
        })
        .collect();
    let size = |key: &str| u32::try_from(case[key].as_u64().unwrap()).unwrap();
    let view: Vec<f64> =
        case["view_row_major"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    let camera = Camera {
        width: size("width"),
        height: size("height"),
        fx: case["fx"].as_f64().unwrap(),
        fy: case["fy"].as_f64().unwrap(),
        cx: f64::from(size("width")) / 2.0,
        cy: f64::from(size("height")) / 2.0,
        camera_from_world: DMat4::from_cols_slice(&view).transpose(),
    };
    let background = numbers(&case["background"]).try_into().unwrap();
    let rendered = render(&posed.as_posed(), &View::new(&camera).over(background)).unwrap();
    let found = rendered.image.pixels().as_flattened();
    assert_same_image("colour", found, &numbers(&case["image_hwc_tilecull"]));
    let transmittance: Vec<f32> = rendered.alpha.values().iter().map(|alpha| 1.0 - alpha).collect();
    assert_same_image("transmittance", &transmittance, &numbers(&case["final_T_tilecull"]));
    // No threshold flips here, and leaving out the tile cull would change the image by 0.011.
    assert!(difference(found, &numbers(&case["image_hwc_tilecull"])).1 <= 1e-5);
}
