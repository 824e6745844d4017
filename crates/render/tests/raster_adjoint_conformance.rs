//! The rasterizer's derivatives against those that the original 3DGS kernels computed, with respect to the parameters as
//! a PLY file holds them.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../../tests/support/splat_scene.rs"]
mod splat_scene;
#[path = "../../../tests/support/mod.rs"]
mod support;

use glam::{Mat3, Quat, Vec3, Vec4};
use skinsplat_core::scene::{Gaussians, Image, OwnedPosed, PosedGradient, RenderedGradient};
use skinsplat_data::npz::Archive;
use skinsplat_render::View;
use skinsplat_render::splat::{Derivatives, Renderer, SimdLevel};
use support::{fixture, json};

fn array(archive: &str, name: &str) -> Vec<f32> {
    let mut archive = Archive::open(&fixture(archive), "fixture").unwrap();
    archive.array(name).unwrap().unwrap().values.into_iter().map(|v| v as f32).collect()
}

/// Derivatives with respect to log scales and raw quaternions, from those with respect to R(q / |q|) diag(s).
fn shape(gaussians: &Gaussians, gradient: &PosedGradient) -> (Vec<f32>, Vec<f32>) {
    let (mut log_scales, mut quaternions) = (Vec::new(), Vec::new());
    for (i, by_factor) in gradient.factors.iter().enumerate() {
        let [w, x, y, z] = gaussians.rotations[i];
        let norm = Vec4::new(w, x, y, z).length();
        let q = Quat::from_xyzw(x, y, z, w) * (1.0 / norm);
        let scale = gaussians.log_scales[i].map(f32::exp);
        let rotation = Mat3::from_quat(q);
        let columns = [by_factor.x_axis, by_factor.y_axis, by_factor.z_axis];
        for (k, column) in columns.into_iter().enumerate() {
            log_scales.push(column.dot(rotation.col(k)) * scale[k]);
        }
        let by_rotation = *by_factor * Mat3::from_diagonal(scale);
        // A small turn t moves R to [t]× R, and q to q + ½ (0, t) q.
        let turn: Vec3 = (0..3).map(|k| rotation.col(k).cross(by_rotation.col(k))).sum();
        // The tangent vectors ½ (0, e_k) q have length ½: along each, dL is turn_k, so the gradient is 4 turn_k ½ (0, e_k) q.
        let tangent = Quat::from_xyzw(turn.x, turn.y, turn.z, 0.0) * q * (2.0 / norm);
        quaternions.extend([tangent.w, tangent.x, tangent.y, tangent.z]);
    }
    (log_scales, quaternions)
}

/// |found - expected| / |expected| of all Gaussians, and of all but the hundredth that differs most.
fn relative(found: &[f32], expected: &[f32], count: usize) -> [f64; 2] {
    assert_eq!(found.len(), expected.len());
    let width = found.len() / count;
    let difference = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b)).powi(2);
    let rows = found.chunks(width).zip(expected.chunks(width));
    let mut squares: Vec<f64> = rows.map(|(a, b)| a.iter().zip(b).map(difference).sum()).collect();
    squares.sort_unstable_by(f64::total_cmp);
    let norm: f64 = expected.iter().map(|&v| f64::from(v).powi(2)).sum();
    [count, count - count / 100].map(|n| (squares[..n].iter().sum::<f64>() / norm).sqrt())
}

/// Where alpha is about 1/255 or the transmittance about 1e-4, rounding decides whether a splat is blended at a pixel: that
/// is all of the difference, at a few Gaussians.
#[test]
fn scene_s_has_the_derivatives_of_the_original_kernels() {
    let (camera, background) = splat_scene::camera(&json("raster/front_512.json"));
    let gaussians = splat_scene::gaussians(&fixture("raster/scene_S.ply"));
    let posed = OwnedPosed::from_static(&gaussians);
    let view = View::new(&camera).over(background);
    // The upstream that the kernels were given, less the pixels that nothing was drawn to.
    let upstream = array("raster/S_front_512_dl_dimage.npz", "dl_dimage");
    let upstream = upstream.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
    let upstream = RenderedGradient { image: Image::new(512, 512, upstream).unwrap(), alpha: None };
    let mut gradients = Vec::new();
    for level in SimdLevel::ALL {
        let Some(mut renderer) = Renderer::with_simd_level(level) else { continue };
        renderer.render(&posed.as_posed(), &view).unwrap();
        let mut gradient = PosedGradient::default();
        let original = Derivatives::OriginalKernels;
        renderer.backward(&posed.as_posed(), &view, &upstream, &mut gradient, original).unwrap();
        gradients.push(gradient);
    }
    assert!(gradients.windows(2).all(|pair| pair[0] == pair[1]), "every vector width gives the same bits");
    let gradient = &gradients[0];
    let (log_scales, quaternions) = shape(&gaussians, gradient);
    let logits: Vec<f32> =
        posed.opacities.iter().zip(&gradient.opacities).map(|(o, g)| g * o * (1.0 - o)).collect();
    let flat = |values: &[Vec3]| values.iter().flat_map(|v| v.to_array()).collect::<Vec<f32>>();
    let screen: Vec<f32> = gradient.screen.iter().flat_map(|&[x, y]| [x, y, 0.0]).collect();
    let found = [
        ("xyz", flat(&gradient.means), 3e-4),
        ("sh", gradient.sh.as_flattened().to_vec(), 1.5e-4),
        ("logit", logits, 2e-4),
        ("logscale", log_scales, 4e-4),
        ("rawquat", quaternions, 2e-4),
        ("mean2d", screen, 3e-4),
    ];
    for (name, found, tolerance) in found {
        let expected = array("raster/S_front_512_grads.npz", name);
        let [all, most] = relative(&found, &expected, gaussians.len());
        println!("{name}: {all:.1e} of the norm, {most:.1e} without the worst hundredth");
        assert!(all <= tolerance, "{name}: {all:e}");
        assert!(most <= 1.5e-5, "{name}: {most:e} without the worst hundredth");
    }
}
