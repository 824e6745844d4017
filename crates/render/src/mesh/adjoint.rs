//! The way back from a drawn mesh to its texture and to its vertices.

use super::texture::{Bilinear, coordinates};
use super::{Mesh, PixelSamples, SamplePattern, raster};
use glam::DVec3;
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

/// The derivatives of a loss with respect to the vertices of a mesh, from those with respect to where the point of the surface
/// that a pixel shows is seen, pixels per axis, row by row from the top. Summed onto `gradient`, one per vertex. Which face is in
/// front has none; a pixel's covered samples share its derivative.
///
/// # Errors
/// As [`super::draw`].
///
/// # Panics
/// If there is not one derivative per pixel of the camera, or not one gradient per vertex.
pub fn motion_gradient(
    mesh: &Mesh<'_>,
    camera: &Camera,
    pattern: SamplePattern,
    of_places: &[[f32; 2]],
    gradient: &mut [DVec3],
) -> Result<(), SceneError> {
    let scene = raster::Scene::new(mesh, camera, pattern)?;
    assert_eq!(of_places.len(), camera.width as usize * camera.height as usize, "one derivative per pixel");
    assert_eq!(gradient.len(), mesh.vertices.len(), "one gradient per vertex");
    let seen = scene.resolve(|pixel| pixel.fragments().collect::<Vec<_>>());
    for (fragments, of_place) in seen.iter().zip(of_places) {
        if *of_place == [0.0; 2] {
            continue;
        }
        for fragment in fragments {
            let of_point = of_world(camera, fragment.position.as_dvec3(), of_place.map(f64::from));
            let share = of_point / fragments.len() as f64;
            for (corner, weight) in mesh.faces[fragment.face as usize].iter().zip(fragment.barycentric) {
                gradient[*corner as usize] += share * f64::from(weight);
            }
        }
    }
    Ok(())
}

/// From derivatives with respect to where a point is seen, pixels, to those with respect to the point, metres.
fn of_world(camera: &Camera, point: DVec3, [of_x, of_y]: [f64; 2]) -> DVec3 {
    let seen = camera.camera_from_world.transform_point3(point);
    let (of_x, of_y) = (camera.fx * of_x / seen.z, camera.fy * of_y / seen.z);
    let of_seen = DVec3::new(of_x, of_y, -(of_x * seen.x + of_y * seen.y) / seen.z);
    camera.camera_from_world.transpose().transform_vector3(of_seen)
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

    #[test]
    fn vertices_have_the_derivatives_of_where_points_are_seen() {
        let turn = DMat4::from_rotation_y(0.4) * DMat4::from_translation(glam::DVec3::new(0.1, -0.05, 0.3));
        let camera =
            Camera { width: 12, height: 10, fx: 9.0, fy: 11.0, cx: 6.0, cy: 5.0, camera_from_world: turn };
        let vertices = [Vec3::new(-0.6, -0.5, 1.0), Vec3::new(0.7, -0.4, 1.4), Vec3::new(0.1, 0.6, 0.9)];
        let faces = [[0, 1, 2]];
        let pattern = SamplePattern::new(3);
        let upstream: Vec<[f32; 2]> =
            (0..120).map(|i| [((i * 7) % 5) as f32 - 2.0, ((i * 3) % 7) as f32 - 3.0]).collect();
        // Where the points that pixels show are seen after the vertices have moved.
        let mesh = Mesh::new(&vertices, &faces).unwrap();
        let scene = raster::Scene::new(&mesh, &camera, pattern).unwrap();
        let seen = scene.resolve(|pixel| pixel.fragments().collect::<Vec<_>>());
        let loss = |vertices: &[DVec3; 3]| -> f64 {
            let mut sum = 0.0;
            for (fragments, of_place) in seen.iter().zip(&upstream) {
                for fragment in fragments {
                    let point: DVec3 = (0..3).map(|k| vertices[k] * f64::from(fragment.barycentric[k])).sum();
                    let (place, _) = camera.project(point).unwrap();
                    let weighted = place.x * f64::from(of_place[0]) + place.y * f64::from(of_place[1]);
                    sum += weighted / fragments.len() as f64;
                }
            }
            sum
        };
        let mut gradient = vec![DVec3::ZERO; 3];
        motion_gradient(&mesh, &camera, pattern, &upstream, &mut gradient).unwrap();
        let own = vertices.map(Vec3::as_dvec3);
        for vertex in 0..3 {
            for axis in 0..3 {
                let at = |step: f64| {
                    let mut moved = own;
                    moved[vertex][axis] += step;
                    loss(&moved)
                };
                let expected = (at(1e-5) - at(-1e-5)) / 2e-5;
                let found = gradient[vertex][axis];
                assert!((found - expected).abs() < 1e-4 * expected.abs().max(1.0), "{found} {expected}");
            }
        }
    }
}
