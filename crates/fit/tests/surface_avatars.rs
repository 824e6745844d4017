//! Avatars made directly from training frames: a sphere of known colours, seen from a ring of cameras.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use glam::{DVec3, Vec3};
use skinsplat_core::scene::{Avatar, Camera, Image, Pose, PosedBody, RestBody, Skeleton, SkinWeights, Uv};
use skinsplat_data::{FrameGenerator, FrameRef, FrameSource, Sequence, Truth};
use skinsplat_fit::options::{Clothing, Sighting};
use skinsplat_fit::surface::{BindTo, Placement, SurfaceInit, surface_init};
use skinsplat_fit::texture::{TextureInit, gather_texture};
use skinsplat_fit::{Error, clothing};
use skinsplat_posing::{BoundAvatar, Strategy, pose};
use skinsplat_render::View;
use skinsplat_render::mesh::{Fragment, Mesh, SamplePattern, draw};
use skinsplat_render::splat::render;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

const RADIUS: f64 = 0.3;

/// A sphere around the origin with a seam and poles, of `2 n (n - 1)` faces or so, with a latitude-longitude atlas.
fn sphere(n: u32, radius: f64) -> RestBody {
    let direction = |i: u32, j: u32| {
        let (theta, phi) = (PI * f64::from(j) / f64::from(n), TAU * f64::from(i) / f64::from(2 * n));
        DVec3::new(theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos())
    };
    // rows of 2n vertices between two poles
    let row = |j: u32, i: u32| 1 + (j - 1) * 2 * n + i % (2 * n);
    let (north, south) = (0, 1 + (n - 1) * 2 * n);
    let mut vertices = vec![direction(0, 0) * radius];
    vertices.extend((1..n).flat_map(|j| (0..2 * n).map(move |i| direction(i, j) * radius)));
    vertices.push(direction(0, n) * radius);
    let (mut faces, mut uv_faces) = (Vec::new(), Vec::new());
    let uv = |j: u32, i: u32| j * (2 * n + 1) + i;
    for i in 0..2 * n {
        faces.push([north, row(1, i), row(1, i + 1)]);
        uv_faces.push([uv(0, i), uv(1, i), uv(1, i + 1)]);
        for j in 1..n - 1 {
            faces.push([row(j, i), row(j + 1, i), row(j + 1, i + 1)]);
            uv_faces.push([uv(j, i), uv(j + 1, i), uv(j + 1, i + 1)]);
            faces.push([row(j, i), row(j + 1, i + 1), row(j, i + 1)]);
            uv_faces.push([uv(j, i), uv(j + 1, i + 1), uv(j, i + 1)]);
        }
        faces.push([row(n - 1, i), south, row(n - 1, i + 1)]);
        uv_faces.push([uv(n - 1, i), uv(n, i), uv(n - 1, i + 1)]);
    }
    let coordinates = (0..(n + 1) * (2 * n + 1)).map(|k| {
        let (i, j) = (k % (2 * n + 1), k / (2 * n + 1));
        [i as f32 / (2 * n) as f32, 1.0 - j as f32 / n as f32]
    });
    let body = RestBody {
        skeleton: Skeleton::from_joint_positions(vec!["root".into()], vec![None], &[DVec3::ZERO]).unwrap(),
        weights: SkinWeights::from_rows(vertices.iter().map(|_| [(0, 1.0)]), 1).unwrap(),
        vertices,
        faces,
        uv: Some(Uv { coordinates: coordinates.collect(), faces: uv_faces }),
        pose_directions: Vec::new(),
    };
    body.validate().unwrap();
    body
}

type Shade = fn(&Fragment, Vec3) -> [f32; 3];

/// Smooth colours that differ everywhere on the sphere.
fn painted(fragment: &Fragment, _eye: Vec3) -> [f32; 3] {
    let p = fragment.position / RADIUS as f32;
    [0.5 + 0.3 * p.x, 0.5 + 0.3 * (2.0 * p.y).sin(), 0.5 + 0.3 * p.z * p.x]
}

/// Colours that depend linearly on the view direction only.
fn glossy(fragment: &Fragment, eye: Vec3) -> [f32; 3] {
    let d = (fragment.position - eye).normalize();
    [0.5 + 0.3 * d.x, 0.5 + 0.2 * d.y, 0.5 - 0.3 * d.z]
}

/// True frames of a body that may differ from the one that the avatar is made for.
#[derive(Debug)]
struct Studio {
    body: RestBody,
    cameras: Vec<Camera>,
    shade: Shade,
}

impl FrameGenerator for Studio {
    fn truth(&self, frame: usize) -> Result<Truth, skinsplat_data::Error> {
        let camera = &self.cameras[frame];
        let vertices: Vec<Vec3> = self.body.vertices.iter().map(|v| v.as_vec3()).collect();
        let mesh = Mesh::new(&vertices, &self.body.faces).unwrap();
        let eye = camera.position().as_vec3();
        let drawing = draw(&mesh, camera, SamplePattern::new(4), |f| (self.shade)(f, eye)).unwrap();
        Ok(Truth::new(drawing.colour, drawing.coverage))
    }

    fn key(&self) -> Result<String, skinsplat_data::Error> {
        Ok("sphere".into())
    }
}

/// Cameras around the sphere at the given angles (degrees) and heights.
fn ring(angles: impl IntoIterator<Item = f64>, heights: &[f64]) -> Vec<Camera> {
    let eye = |angle: f64, height: f64| {
        DVec3::new(angle.to_radians().sin(), height, angle.to_radians().cos()).normalize() * 2.0
    };
    let camera = |angle, height| Camera::look_at(eye(angle, height), DVec3::ZERO, DVec3::Y, 300.0, 120, 110);
    angles.into_iter().flat_map(|angle| heights.iter().map(move |&h| camera(angle, h))).collect()
}

fn sequence(body: &RestBody, truth: RestBody, cameras: Vec<Camera>, shade: Shade) -> Sequence {
    let studio = Arc::new(Studio { body: truth, cameras: cameras.clone(), shade });
    let frame = |k: usize| FrameRef {
        name: format!("image_{k:04}"),
        time: 0,
        pose: 0,
        camera: k,
        source: FrameSource::Generated { generator: studio.clone(), frame: k },
    };
    Sequence {
        id: "train".into(),
        body: Arc::new(body.clone()),
        poses: vec![Pose::rest(&body.skeleton)].into(),
        frames: (0..cameras.len()).map(frame).collect(),
        cameras: cameras.into(),
        stored_sizes: None,
    }
}

fn all_round(shade: Shade) -> Sequence {
    let body = sphere(16, RADIUS);
    sequence(&body, body.clone(), ring((0..8).map(|k| 45.0 * f64::from(k)), &[-0.8, 0.8]), shade)
}

fn held_out(body: &RestBody, shade: Shade) -> Sequence {
    sequence(body, body.clone(), ring([20.0, 110.0, 250.0], &[0.1]), shade)
}

fn psnr(found: &Image, wanted: &Image) -> f64 {
    let squared = |(a, b): (&[f32; 3], &[f32; 3])| -> f64 {
        (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>() / 3.0
    };
    let sum: f64 = found.pixels().iter().zip(wanted.pixels()).map(squared).sum();
    -10.0 * (sum / found.pixels().len() as f64).log10()
}

/// The lowest PSNR over the frames of a sequence, on white.
fn worst(test: &Sequence, image: impl Fn(&Camera) -> Image) -> f64 {
    let frame = |k: usize| {
        let truth = test.truth(k).unwrap();
        psnr(&image(&test.cameras[k]), &truth.rgb.composited(&truth.alpha, [1.0; 3]).unwrap())
    };
    (0..test.frames.len()).map(frame).fold(f64::INFINITY, f64::min)
}

fn drawn(avatar: &Avatar, test: &Sequence, camera: &Camera) -> Image {
    let bound = BoundAvatar::new(avatar, &test.body).unwrap();
    let body = PosedBody::new(&test.body, &test.poses[0]).unwrap();
    let strategy = Strategy::preset("quaternion-average").unwrap();
    let posed = pose(&bound, &body, &strategy).unwrap();
    render(&posed.as_posed(), &View::new(camera).over([1.0; 3])).unwrap().image
}

fn avatar_psnr(train: &Sequence, test: &Sequence, init: &SurfaceInit) -> f64 {
    let avatar = surface_init(train, init).unwrap();
    avatar.validate(Some(&train.body)).unwrap();
    worst(test, |camera| drawn(&avatar, test, camera))
}

fn coarse() -> SurfaceInit {
    SurfaceInit { longest_edge: 0.03, ..SurfaceInit::default() }
}

#[test]
fn a_texture_recovers_the_colours_of_a_sphere() {
    let train = all_round(painted);
    let init = TextureInit { size: 256, ..TextureInit::default() };
    let textured = gather_texture(&train, &init).unwrap();
    let test = held_out(&train.body, painted);
    let found = worst(&test, |camera| {
        textured.draw(&test.poses[0], camera, SamplePattern::new(4), [1.0; 3]).unwrap().image
    });
    assert!(found > 42.0, "{found} dB");
}

#[test]
fn gaussians_recover_the_colours_of_a_sphere() {
    let train = all_round(painted);
    let test = held_out(&train.body, painted);
    for (placement, bind_to) in [(Placement::Vertices, BindTo::Joints), (Placement::Faces, BindTo::Faces)] {
        let init = SurfaceInit { placement, bind_to, longest_edge: 0.015, ..SurfaceInit::default() };
        let found = avatar_psnr(&train, &test, &init);
        assert!(found > 30.0, "{placement:?}: {found} dB");
    }
}

#[test]
fn refinement_sharpens() {
    let train = all_round(|f, _| if (f.position.x * 40.0).sin() > 0.0 { [0.9; 3] } else { [0.1; 3] });
    let test = train.clone();
    let found =
        [0, 2].map(|refinements| avatar_psnr(&train, &test, &SurfaceInit { refinements, ..coarse() }));
    assert!(found[1] > found[0] + 0.25, "{found:?}");
}

#[test]
fn spherical_harmonics_recover_view_dependence() {
    let train = all_round(glossy);
    let test = held_out(&train.body, glossy);
    let found = [0, 1, 3].map(|sh_degree| avatar_psnr(&train, &test, &SurfaceInit { sh_degree, ..coarse() }));
    assert!(found[1] > found[0] + 1.0 && found[2] > found[0] + 1.0, "{found:?}");
}

#[test]
fn what_no_frame_shows_is_filled_from_its_surroundings() {
    let body = sphere(16, RADIUS);
    // cameras on one side only, and a colour gradient that fades out towards the other
    let train = sequence(&body, body.clone(), ring([-30.0, 0.0, 30.0], &[0.0]), |_, _| [0.8, 0.4, 0.2]);
    let avatar = surface_init(&train, &coarse()).unwrap();
    let hidden: Vec<usize> =
        (0..avatar.gaussians.len()).filter(|&i| avatar.gaussians.means[i].z < -0.5 * RADIUS as f32).collect();
    assert!(hidden.len() > 100);
    for i in hidden {
        let colour = avatar.gaussians.sh[i].map(|c| 0.5 + 0.282_094_8 * c);
        for (found, wanted) in colour.iter().zip([0.8, 0.4, 0.2]) {
            // refinement gives the visible ones a little more contrast against what shines through
            assert!((found - wanted).abs() < 0.06, "{colour:?}");
        }
    }
}

#[test]
fn clothing_is_found_from_the_outlines() {
    let body = sphere(16, RADIUS);
    let cameras = ring((0..12).map(|k| 30.0 * f64::from(k)), &[-0.8, 0.0, 0.8]);
    let train = sequence(&body, sphere(16, RADIUS + 0.02), cameras, painted);
    let (options, sighting) = (Clothing { rounds: 3, ..Clothing::default() }, Sighting::default());
    let offsets = clothing::offsets_from_outlines(&train, &options, &sighting).unwrap();
    // a pixel is 7 mm
    for (vertex, &offset) in body.vertices.iter().zip(&offsets) {
        assert!((offset - 0.02).abs() < 0.004, "{vertex}: {offset}");
    }
    let naked = sequence(&body, body.clone(), train.cameras.to_vec(), painted);
    let none = clothing::offsets_from_outlines(&naked, &options, &sighting).unwrap();
    assert!(
        none.iter().all(|o| o.abs() < 0.001),
        "{:?}",
        none.iter().copied().fold(0.0f32, |m, o| m.max(o.abs()))
    );
}

#[test]
fn avatars_are_the_same_for_any_number_of_threads() {
    let mut train = all_round(painted);
    train.frames.truncate(5);
    let make = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let init = SurfaceInit { sh_degree: 1, ..coarse() };
        let texture = TextureInit { size: 64, ..TextureInit::default() };
        pool.install(|| (surface_init(&train, &init).unwrap(), gather_texture(&train, &texture).unwrap()))
    };
    let one = make(1);
    for threads in [2, 5] {
        assert!(make(threads) == one, "{threads} threads");
    }
}

#[test]
fn impossible_requests_name_what_is_wrong() {
    let train = all_round(painted);
    let field = |result: Result<Avatar, Error>| match result {
        Err(Error::Invalid { field, .. }) => field,
        other => panic!("{other:?}"),
    };
    assert_eq!(field(surface_init(&train, &SurfaceInit { opacity: 1.0, ..coarse() })), "opacity");
    assert_eq!(field(surface_init(&train, &SurfaceInit { scale: f64::NAN, ..coarse() })), "scale");
    assert_eq!(field(surface_init(&train, &SurfaceInit { sh_degree: 4, ..coarse() })), "sh_degree");
    assert_eq!(field(surface_init(&train, &SurfaceInit { longest_edge: 0.0, ..coarse() })), "longest_edge");
    let empty = Sequence { frames: Vec::new(), ..train.clone() };
    assert_eq!(field(surface_init(&empty, &coarse())), "sequence train: frames");
    let mut giant = (*train.body).clone();
    giant.vertices.iter_mut().for_each(|v| *v *= 100.0);
    let giant = Sequence { body: Arc::new(giant), ..train.clone() };
    assert_eq!(
        surface_init(&giant, &coarse()).unwrap_err().to_string(),
        "sequence train: body: its surface is 60.0 m across; expected at most 10 m: vertices in metres (are these \
         centimetres?)"
    );
    let mut body = (*train.body).clone();
    body.uv = None;
    let bare = Sequence { body: Arc::new(body), ..train };
    let message = gather_texture(&bare, &TextureInit::default()).unwrap_err().to_string();
    assert_eq!(
        message,
        "sequence train: body: no texture coordinates; expected uv per face corner (vt and ft)"
    );
}
