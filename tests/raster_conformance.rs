//! The splatting rasterizer against images that the original 3DGS kernels computed, and by property.
#![allow(clippy::unwrap_used, reason = "tests")]

#[path = "support/splat_scene.rs"]
mod splat_scene;
mod support;

use skinsplat::render::splat::{RenderSettings, Renderer, SimdLevel};
use skinsplat::scene::Posed;
use support::{fixture, json};

/// The image of the original kernels for scene S, 512 x 512.
fn golden() -> Vec<f32> {
    let bytes = std::fs::read(fixture("raster/S_front_512_image.npy")).unwrap();
    npyz::NpyFile::new(&bytes[..]).unwrap().into_vec().unwrap()
}

/// p99.9 and maximum of the absolute difference.
fn difference(a: &[f32], b: &[f32]) -> (f32, f32) {
    assert_eq!(a.len(), b.len());
    let mut d: Vec<f32> = a.iter().zip(b).map(|(a, b)| (a - b).abs()).collect();
    d.sort_unstable_by(f32::total_cmp);
    (d[d.len() * 999 / 1000], d[d.len() - 1])
}

#[test]
fn scene_s_is_the_image_of_the_original_kernels() {
    let (camera, background) = splat_scene::camera(&json("raster/front_512.json"));
    let gaussians = splat_scene::gaussians(&fixture("raster/scene_S.ply"));
    let posed = Posed::from_static(&gaussians);
    let settings = RenderSettings { background, antialiased: false };
    for level in [SimdLevel::Portable, SimdLevel::Avx2, SimdLevel::Avx512] {
        let Some(mut renderer) = Renderer::with_simd_level(level) else { continue };
        let rendered = renderer.render(&posed, &camera, &settings);
        let (p999, max) = difference(rendered.image.pixels().as_flattened(), &golden());
        println!("{level:?}: p99.9 {p999:e}, max {max:e}");
        assert!(p999 <= 1e-5, "{level:?}: p99.9 {p999:e}");
        assert!(max <= 4.0 / 255.0, "{level:?}: max {max:e}");
    }
}
