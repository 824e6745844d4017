//! The way back from a drawn mesh to its texture.

use super::texture::{Bilinear, coordinates};
use super::{Mesh, PixelSamples, SamplePattern, raster};
use skinsplat_core::scene::{Camera, Image, SceneError, Uv};

/// The derivatives of a loss with respect to the texels of a mesh's texture, from those with respect to the straight
/// colours of its [`Drawing`](super::Drawing) with the same arguments, row by row from the top. `gradient` is overwritten;
/// its size is the texture's. Pixels are added in their order: the result has the same bits for any number of threads.
///
/// # Errors
/// As [`super::draw`].
///
/// # Panics
/// If `upstream` is not of the camera's size.
pub fn texture_gradient(
    mesh: &Mesh<'_>,
    camera: &Camera,
    pattern: SamplePattern,
    uv: &Uv,
    upstream: &Image,
    gradient: &mut Image,
) -> Result<(), SceneError> {
    let scene = raster::Scene::new(mesh, camera, pattern)?;
    let size = [gradient.width(), gradient.height()];
    let width = camera.width as usize;
    assert_eq!([upstream.width(), upstream.height()], [width, camera.height as usize], "the camera's size");
    let footprint = |pixel: PixelSamples<'_>| -> Vec<Bilinear> {
        pixel.fragments().map(|fragment| Bilinear::at(coordinates(uv, &fragment), size)).collect()
    };
    let footprints = scene.resolve(footprint);
    let texels = gradient.pixels_mut();
    texels.fill([0.0; 3]);
    for (samples, &colour) in footprints.iter().zip(upstream.pixels()) {
        if colour == [0.0; 3] {
            continue;
        }
        let share = colour.map(|c| c / samples.len() as f32);
        for (place, weight) in samples.iter().flat_map(Bilinear::corners) {
            let texel = &mut texels[place[1] * size[0] + place[0]];
            *texel = std::array::from_fn(|c| texel[c] + weight * share[c]);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{Texture, draw};
    use super::*;
    use glam::{DMat4, Vec3};

    #[test]
    fn texels_have_the_derivatives_of_the_drawing() {
        let camera = Camera {
            width: 12,
            height: 10,
            fx: 9.0,
            fy: 9.0,
            cx: 6.0,
            cy: 5.0,
            camera_from_world: DMat4::IDENTITY,
        };
        let vertices = [Vec3::new(-0.6, -0.5, 1.0), Vec3::new(0.7, -0.4, 1.4), Vec3::new(0.1, 0.6, 0.9)];
        let mesh = Mesh::new(&vertices, &[[0, 1, 2]]).unwrap();
        let uv = Uv { coordinates: vec![[0.05, 0.1], [0.9, 0.2], [0.4, 1.1]], faces: vec![[0, 1, 2]] };
        let pattern = SamplePattern::new(3);
        let value = |i: usize| ((i * 37 + 11) % 64) as f32 / 64.0;
        let texels =
            Image::new(5, 4, (0..20).map(|i| [value(i), value(i + 7), value(i + 50)]).collect()).unwrap();
        let upstream =
            Image::new(12, 10, (0..120).map(|i| [value(i) - 0.5, value(i + 3) - 0.5, 0.0]).collect())
                .unwrap();
        let loss = |texels: &Image| -> f64 {
            let texture = Texture::new(texels.clone());
            let drawing = draw(&mesh, &camera, pattern, texture.shader(&uv)).unwrap();
            let products =
                drawing.colour.pixels().as_flattened().iter().zip(upstream.pixels().as_flattened());
            products.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
        };
        let mut gradient = Image::filled(5, 4, [9.0; 3]);
        texture_gradient(&mesh, &camera, pattern, &uv, &upstream, &mut gradient).unwrap();
        let mut seen = 0;
        for i in 0..20 {
            for c in 0..3 {
                let at = |step: f32| {
                    let mut moved = texels.clone();
                    moved.pixels_mut()[i][c] += step;
                    loss(&moved)
                };
                // The drawing is linear in its texels.
                let expected = (at(0.5) - at(-0.5)) as f32;
                let found = gradient.pixels()[i][c];
                assert!((found - expected).abs() < 2e-5, "texel {i}: {found} instead of {expected}");
                seen += usize::from(found != 0.0);
            }
        }
        assert!(seen > 20, "{seen}");
    }
}
