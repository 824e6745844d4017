//! The triangle rasterizer against analytic coverage, ray casting, and its own promises (watertight, deterministic).
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use glam::{DMat3, DVec2, DVec3, Vec3};
use proptest::prelude::*;
use skinsplat_core::scene::Camera;
use skinsplat_render::mesh::{Drawing, Fragment, Mesh, SamplePattern, draw, silhouette, visible_faces};

/// A camera whose pixel coordinates are x and y of world points at z = 1.
fn pixel_camera(width: u32, height: u32) -> Camera {
    let camera_from_world = glam::DMat4::IDENTITY;
    Camera { width, height, fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, camera_from_world }
}

/// A camera with nothing special about it: off-centre, unequal focal lengths, tilted.
fn general_camera(width: u32, height: u32) -> Camera {
    let mut camera =
        Camera::look_at(DVec3::new(0.4, 0.3, 3.0), DVec3::ZERO, DVec3::Y, f64::from(width), width, height);
    camera.fy *= 1.13;
    camera.cx += 2.7;
    camera.cy -= 1.3;
    camera
}

fn flat(points: &[[f32; 2]]) -> Vec<Vec3> {
    points.iter().map(|p| Vec3::new(p[0], p[1], 1.0)).collect()
}

fn coverage(vertices: &[Vec3], faces: &[[u32; 3]], camera: &Camera, per_axis: usize) -> Vec<f32> {
    let mesh = Mesh::new(vertices, faces).unwrap();
    silhouette(&mesh, camera, SamplePattern::new(per_axis)).unwrap().values().to_vec()
}

#[test]
fn a_rectangle_has_its_exact_coverage_to_the_pitch_of_the_pattern() {
    let (left, top, right, bottom) = (3.37f32, 2.81f32, 12.14f32, 9.45f32);
    let vertices = flat(&[[left, top], [right, top], [right, bottom], [left, bottom]]);
    for n in [1usize, 2, 4, 8] {
        let found = coverage(&vertices, &[[0, 1, 2], [0, 2, 3]], &pixel_camera(16, 13), n);
        let overlap = |i: usize, lo: f32, hi: f32| (hi.min(i as f32 + 1.0) - lo.max(i as f32)).max(0.0);
        for (i, &value) in found.iter().enumerate() {
            let (x, y) = (i % 16, i / 16);
            let exact = overlap(x, left, right) * overlap(y, top, bottom);
            // an edge along an axis is met by n² equidistant sample rows: at most half a row is lost per edge; in a
            // corner pixel the samples of an n x n lattice count the area to about one row
            let is_corner = (x == 3 || x == 12) && (y == 2 || y == 9);
            let tolerance = if is_corner { 1.0 / n as f32 } else { 0.5 / (n * n) as f32 + 1e-3 };
            assert!((value - exact).abs() <= tolerance, "n = {n}, pixel {x}, {y}: {value} for {exact}");
        }
    }
}

/// Area of a triangle inside a pixel: clip the polygon against the four sides, shoelace.
fn exact_coverage(triangle: [DVec2; 3], x: f64, y: f64) -> f64 {
    let mut polygon = triangle.to_vec();
    let sides = [(DVec2::X, x), (-DVec2::X, -x - 1.0), (DVec2::Y, y), (-DVec2::Y, -y - 1.0)];
    for (normal, offset) in sides {
        let inside = |p: DVec2| p.dot(normal) - offset;
        let mut kept = Vec::new();
        for (k, &p) in polygon.iter().enumerate() {
            let q = polygon[(k + 1) % polygon.len()];
            if inside(p) >= 0.0 {
                kept.push(p);
            }
            if (inside(p) >= 0.0) != (inside(q) >= 0.0) {
                kept.push(p + (q - p) * (inside(p) / (inside(p) - inside(q))));
            }
        }
        polygon = kept;
    }
    let area = |k: usize| polygon[k].perp_dot(polygon[(k + 1) % polygon.len()]);
    (0..polygon.len()).map(area).sum::<f64>().abs() / 2.0
}

proptest! {
    #[test]
    fn a_triangle_has_its_analytic_coverage(points in prop::array::uniform3([-4.0f32..20.0, -4.0f32..20.0])) {
        let found = coverage(&flat(&points), &[[0, 1, 2]], &pixel_camera(16, 16), 8);
        let triangle = points.map(|p| DVec2::new(p[0].into(), p[1].into()));
        for (i, &value) in found.iter().enumerate() {
            let exact = exact_coverage(triangle, (i % 16) as f64, (i / 16) as f64);
            // an edge along a row of the lattice misjudges at most half a row of 8, 1/16; a thin triangle has two
            // edges in a pixel
            prop_assert!((f64::from(value) - exact).abs() < 0.13, "pixel {i}: {value} for {exact}");
        }
    }

    /// Random points, triangulated as a fan around each of a grid of cells: every sample in the square belongs to
    /// exactly one face, wherever the inner vertices lie.
    #[test]
    fn adjacent_triangles_neither_overlap_nor_leave_gaps(jitter in prop::collection::vec([-0.3f32..0.3, -0.3f32..0.3], 81)) {
        // a 9 x 9 grid of vertices, jittered inside; the border stays on a square larger than the image
        let vertices: Vec<Vec3> = (0..81).map(|k| {
            let (i, j) = (k % 9, k / 9);
            let border = i == 0 || j == 0 || i == 8 || j == 8;
            let [dx, dy] = if border { [0.0, 0.0] } else { jitter[k] };
            Vec3::new((i as f32 + dx) * 4.25 - 1.0, (j as f32 + dy) * 4.25 - 1.0, 1.0)
        }).collect();
        let corner = |i: u32, j: u32| j * 9 + i;
        let faces: Vec<[u32; 3]> = (0..64u32).flat_map(|k| {
            let (i, j) = (k % 8, k / 8);
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            // the two ways to split a cell, with both orientations
            if (i + j) % 2 == 0 { [[a, b, c], [a, d, c]] } else { [[b, a, d], [b, c, d]] }
        }).collect();
        let camera = pixel_camera(32, 32);
        // jitter may fold a cell that is not convex over its neighbour, so count only unfolded meshes
        let area = |f: &[u32; 3], sign: f32| {
            let [a, b, c] = f.map(|i| vertices[i as usize].truncate());
            sign * (b - a).perp_dot(c - a)
        };
        let sign = |k: usize| match ((k / 2 % 8 + k / 16) % 2, k % 2) { (0, 0) | (1, 1) => 1.0, _ => -1.0 };
        prop_assume!(faces.iter().enumerate().all(|(k, f)| area(f, sign(k)) > 0.0));
        prop_assert!(coverage(&vertices, &faces, &camera, 4).iter().all(|&c| c == 1.0), "a gap");
        let single: Vec<Vec<f32>> = faces.iter().map(|&f| coverage(&vertices, &[f], &camera, 4)).collect();
        for pixel in 0..32 * 32 {
            // sums of multiples of 1/16 are exact
            prop_assert_eq!(single.iter().map(|c| c[pixel]).sum::<f32>(), 1.0, "pixel {} is covered twice", pixel);
        }
    }

    #[test]
    fn fragments_agree_with_ray_triangle_intersection(
        corners in prop::array::uniform3([-1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0]),
    ) {
        let vertices = corners.map(Vec3::from_array);
        let camera = general_camera(24, 20);
        let mesh = Mesh::new(&vertices, &[[0, 1, 2]]).unwrap();
        let centre = camera.position();
        let seen = visible_faces(&mesh, &camera).unwrap();
        let fragments = std::sync::Mutex::new(Vec::new());
        draw(&mesh, &camera, SamplePattern::new(1), |f| { fragments.lock().unwrap().push(*f); [0.0; 3] }).unwrap();
        let edge_on = {
            let [a, b, c] = vertices.map(|v| v.as_dvec3());
            let normal = (b - a).cross(c - a);
            normal.dot((a - centre).normalize()).abs() < 0.02
        };
        // the snapping of 1/8192 pixel is magnified without bound on a face seen edge-on
        prop_assume!(!edge_on);
        for f in fragments.into_inner().unwrap() {
            let (pixel, depth) = camera.project(f.position.as_dvec3()).unwrap();
            prop_assert!((pixel - pixel.floor() - 0.5).abs().max_element() < 2e-3, "not at a pixel centre: {pixel}");
            prop_assert!((depth - f64::from(f.depth)).abs() < 1e-5 * depth);
            let (x, y) = (pixel.x as usize, pixel.y as usize);
            prop_assert_eq!(seen.depth(x, y), f.depth);
            let expected = intersect(&camera, DVec2::new(x as f64 + 0.5, y as f64 + 0.5), vertices);
            for k in 0..3 {
                prop_assert!((expected[k] - f64::from(f.barycentric[k])).abs() < 2e-3, "{expected:?} {f:?}");
            }
        }
    }

    #[test]
    fn any_mesh_in_any_place_is_drawn_without_panic(
        corners in prop::collection::vec(prop::array::uniform3(prop_oneof![
            -2.0f32..2.0, Just(0.0), Just(f32::NAN), Just(f32::INFINITY), Just(1e30), Just(-1e30), Just(1e-30), -1e6f32..1e6,
        ]), 6),
        focal in prop_oneof![1e-6f64..1e6, Just(1e300), Just(1e-300)],
        centre in prop_oneof![-1e4f64..1e4, Just(1e300), Just(-1e300)],
    ) {
        let vertices: Vec<Vec3> = corners.into_iter().map(Vec3::from_array).collect();
        let mut camera = general_camera(19, 17);
        (camera.fx, camera.cx) = (focal, centre);
        let mesh = Mesh::new(&vertices, &[[0, 1, 2], [3, 4, 5], [0, 0, 1]]).unwrap();
        let drawing = draw(&mesh, &camera, SamplePattern::new(2), |f| f.barycentric).unwrap();
        prop_assert!(drawing.coverage.values().iter().all(|c| (0.0..=1.0).contains(c)));
        let barycentric = drawing.colour.pixels().iter().zip(drawing.coverage.values()).filter(|(_, c)| **c > 0.0);
        for (mean, _) in barycentric {
            prop_assert!((mean.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{mean:?}");
        }
    }
}

/// Möller and Trumbore: barycentric coordinates where the ray through a pixel position meets the triangle's plane.
fn intersect(camera: &Camera, pixel: DVec2, triangle: [Vec3; 3]) -> [f64; 3] {
    let rotation = DMat3::from_mat4(camera.camera_from_world).inverse();
    let ray =
        rotation * DVec3::new((pixel.x - camera.cx) / camera.fx, (pixel.y - camera.cy) / camera.fy, 1.0);
    let [a, b, c] = triangle.map(|v| v.as_dvec3());
    let (e1, e2, s) = (b - a, c - a, camera.position() - a);
    let p = ray.cross(e2);
    let determinant = e1.dot(p);
    let (u, v) = (s.dot(p) / determinant, ray.dot(s.cross(e1)) / determinant);
    [1.0 - u - v, u, v]
}

/// A bumpy sphere of `2 * n * n` faces.
fn blob(n: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let point = |i: u32, j: u32| {
        let (theta, phi) =
            (std::f32::consts::PI * j as f32 / n as f32, std::f32::consts::TAU * i as f32 / n as f32);
        let radius = 0.8 + 0.1 * (3.0 * phi).sin() * theta.sin() + 0.1 * (5.0 * theta).cos();
        radius * Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
    };
    let vertices = (0..(n + 1) * (n + 1)).map(|k| point(k % (n + 1), k / (n + 1))).collect();
    let corner = |i: u32, j: u32| j * (n + 1) + i;
    let cell = |k: u32| {
        let (i, j) = (k % n, k / n);
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    (vertices, (0..n * n).flat_map(cell).collect())
}

fn rainbow(fragment: &Fragment) -> [f32; 3] {
    std::array::from_fn(|c| 0.5 + 0.5 * (fragment.position[c] * 9.0 + fragment.face as f32 * 0.01).sin())
}

fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

#[test]
fn the_image_is_the_same_for_any_number_of_threads() {
    let (vertices, faces) = blob(40);
    let render = || {
        let mesh = Mesh::new(&vertices, &faces).unwrap();
        draw(&mesh, &general_camera(150, 130), SamplePattern::new(3), rainbow).unwrap()
    };
    let one = with_threads(1, render);
    assert!(one.coverage.values().iter().sum::<f32>() > 3000.0, "something is drawn");
    for threads in [2, 3, 8] {
        assert!(with_threads(threads, render) == one, "{threads} threads");
    }
}

#[test]
fn the_first_of_coinciding_faces_wins_and_a_nearer_one_wins_over_both() {
    let mut vertices = flat(&[[2.0, 2.0], [14.0, 2.0], [2.0, 14.0]]);
    vertices.extend(vertices.clone().iter().map(|&v| v * 0.5));
    let face_at = |faces: &[[u32; 3]]| {
        let mesh = Mesh::new(&vertices, faces).unwrap();
        visible_faces(&mesh, &pixel_camera(16, 16)).unwrap().face(4, 4)
    };
    assert_eq!(face_at(&[[0, 1, 2], [0, 1, 2], [0, 1, 2]]), Some(0));
    assert_eq!(face_at(&[[0, 1, 2], [0, 1, 2], [3, 4, 5], [3, 4, 5]]), Some(2));
}

#[test]
fn degenerate_and_hidden_triangles_cover_nothing() {
    let camera = general_camera(32, 32);
    let behind = camera.position() * 2.0;
    let nothing = |vertices: [DVec3; 3]| {
        let vertices = vertices.map(|v| v.as_vec3());
        assert!(coverage(&vertices, &[[0, 1, 2]], &camera, 4).iter().all(|&c| c == 0.0), "{vertices:?}");
    };
    nothing([DVec3::ZERO, DVec3::X, DVec3::X * 2.0]);
    nothing([DVec3::ZERO; 3]);
    nothing([behind, behind + DVec3::X, behind + DVec3::Y]);
    nothing([DVec3::X * 100.0, DVec3::X * 101.0, DVec3::X * 100.0 + DVec3::Y]);
    nothing([DVec3::splat(f64::NAN), DVec3::X, DVec3::Y]);
}

#[test]
fn a_floor_under_the_camera_is_clipped_at_the_near_plane() {
    // a huge floor one metre below a camera that looks along z: it fills exactly what is below the horizon
    let (near, far) = (-1e4f32, 1e6f32);
    let vertices = [(-far, near), (far, near), (far, far), (-far, far)].map(|(x, z)| Vec3::new(x, 1.0, z));
    let camera = Camera { fx: 40.0, fy: 40.0, cx: 32.0, cy: 20.0, ..pixel_camera(64, 48) };
    let mesh = Mesh::new(&vertices, &[[0, 1, 2], [0, 2, 3]]).unwrap();
    let drawing = draw(&mesh, &camera, SamplePattern::new(4), |f| [f.position.z, 0.0, 0.0]).unwrap();
    for y in 0..48 {
        for x in 0..64 {
            assert_eq!(drawing.coverage.at(x, y), if y < 20 { 0.0 } else { 1.0 }, "pixel {x}, {y}");
            if y > 24 {
                let exact = 40.0 / (y as f32 + 0.5 - 20.0);
                // the mean of 1/y over a pixel is a little above its value at the centre
                assert!((drawing.depth.at(x, y) / exact - 1.0).abs() < 0.006, "pixel {x}, {y}");
                assert!((drawing.depth.at(x, y) - drawing.colour.at(x, y)[0]).abs() < 2e-2 * exact);
            }
        }
    }
}

/// The centre of mass of a drawn disc follows the projected vertices to a small part of a pixel.
#[test]
fn coverage_has_no_sub_pixel_shift() {
    for step in 0..32 {
        let (x, y) = (10.0 + step as f32 / 32.0, 9.3 + step as f32 * 0.0171);
        let rim = (0..24).map(|k| std::f32::consts::TAU * (k as f32 + 0.37) / 24.0);
        let vertices: Vec<[f32; 2]> = rim.map(|a| [x + 7.3 * a.cos(), y + 7.3 * a.sin()]).collect();
        let faces: Vec<[u32; 3]> = (2..24).map(|k| [0, k - 1, k]).collect();
        let found = coverage(&flat(&vertices), &faces, &pixel_camera(20, 20), 8);
        let total: f32 = found.iter().sum();
        let mean = |position: fn(usize) -> usize| {
            found.iter().enumerate().map(|(i, &c)| c * (position(i) as f32 + 0.5)).sum::<f32>() / total
        };
        let shift = [mean(|i| i % 20) - x, mean(|i| i / 20) - y];
        assert!(shift.iter().all(|s| s.abs() < 0.008), "step {step}: {shift:?}");
    }
}

#[test]
fn the_background_shows_through_uncovered_samples_only() {
    let vertices = flat(&[[0.0, 0.0], [0.0, 8.0], [4.5, 8.0], [4.5, 0.0]]);
    let mesh = Mesh::new(&vertices, &[[0, 1, 2], [0, 2, 3]]).unwrap();
    let drawing: Drawing =
        draw(&mesh, &pixel_camera(8, 8), SamplePattern::new(2), |_| [0.25, 0.5, 1.0]).unwrap();
    assert_eq!(drawing.colour.at(4, 3), [0.25, 0.5, 1.0], "colour is not premultiplied");
    let rendered = drawing.over([1.0, 0.0, 0.5]);
    assert_eq!(rendered.image.at(4, 3), [0.625, 0.25, 0.75]);
    assert_eq!((rendered.alpha.at(4, 3), rendered.depth.at(4, 3)), (0.5, 0.5));
    assert_eq!(rendered.image.at(6, 3), [1.0, 0.0, 0.5]);
    assert_eq!(rendered.image.at(2, 3), [0.25, 0.5, 1.0]);
}

#[test]
fn indices_out_of_range_and_bad_cameras_are_refused() {
    let vertices = [Vec3::ZERO; 3];
    assert_eq!(Mesh::new(&vertices, &[[0, 1, 2], [0, 1, 3]]).unwrap_err().field, "faces[1]");
    let mesh = Mesh::new(&vertices, &[[0, 1, 2]]).unwrap();
    let camera = Camera { fx: 0.0, ..pixel_camera(8, 8) };
    assert_eq!(silhouette(&mesh, &camera, SamplePattern::new(1)).unwrap_err().field, "fx");
}
