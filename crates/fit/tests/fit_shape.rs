//! Shapes fitted to silhouettes: spheres that are larger, dented or bent with a joint, seen from a ring of cameras.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use glam::{DVec3, Vec3};
use skinsplat_core::scene::{Camera, Image, Mask, Pose, PosedBody, RestBody, Skeleton, SkinWeights};
use skinsplat_data::{FrameGenerator, FrameRef, FrameSource, Sequence, Truth};
use skinsplat_fit::Error;
use skinsplat_fit::options::Clothing;
use skinsplat_fit::shape::{Ended, FittedShape, ShapeFit, ShapeOptions, fit_shape};
use skinsplat_fit::subdivide::Subdivided;
use skinsplat_render::mesh::{Mesh, SamplePattern, silhouette};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

const RADIUS: f64 = 0.3;

/// A closed ellipsoid, three times as long as wide, whose upper half follows a second joint.
fn limb(n: u32) -> RestBody {
    let at = |i: u32, j: u32| {
        let (theta, phi) = (PI * f64::from(j) / f64::from(n), TAU * f64::from(i) / f64::from(2 * n));
        DVec3::new(theta.sin() * phi.sin(), 3.0 * theta.cos(), theta.sin() * phi.cos()) * RADIUS
    };
    let row = |j: u32, i: u32| 1 + (j - 1) * 2 * n + i % (2 * n);
    let south = 1 + (n - 1) * 2 * n;
    let mut vertices = vec![at(0, 0)];
    vertices.extend((1..n).flat_map(|j| (0..2 * n).map(move |i| at(i, j))));
    vertices.push(at(0, n));
    let mut faces = Vec::new();
    for i in 0..2 * n {
        faces.push([0, row(1, i), row(1, i + 1)]);
        for j in 1..n - 1 {
            faces.push([row(j, i), row(j + 1, i), row(j + 1, i + 1)]);
            faces.push([row(j, i), row(j + 1, i + 1), row(j, i + 1)]);
        }
        faces.push([row(n - 1, i), south, row(n - 1, i + 1)]);
    }
    let upper = |v: &DVec3| (0.5 + v.y / RADIUS).clamp(0.0, 1.0) as f32;
    let names = vec!["lower".into(), "upper".into()];
    let joints = [DVec3::ZERO, DVec3::ZERO];
    RestBody {
        skeleton: Skeleton::from_joint_positions(names, vec![None, Some(0)], &joints).unwrap(),
        weights: SkinWeights::from_rows(vertices.iter().map(|v| [(0, 1.0 - upper(v)), (1, upper(v))]), 2)
            .unwrap(),
        vertices,
        faces,
        uv: None,
        pose_directions: Vec::new(),
    }
}

fn bend(body: &RestBody, degrees: f64) -> Pose {
    let about = DVec3::X * degrees.to_radians();
    Pose::from_axis_angles(&body.skeleton, &[DVec3::ZERO, about], DVec3::ZERO)
}

/// Masks of a body that may differ from the one that is fitted.
#[derive(Debug)]
struct Masks(Vec<Mask>);

impl FrameGenerator for Masks {
    fn truth(&self, frame: usize) -> Result<Truth, skinsplat_data::Error> {
        let alpha = self.0[frame].clone();
        Ok(Truth::new(Image::filled(alpha.width(), alpha.height(), [0.5; 3]), alpha))
    }

    fn key(&self) -> Result<String, skinsplat_data::Error> {
        Ok("masks".into())
    }
}

fn camera(degrees: f64, height: f64) -> Camera {
    let angle = degrees.to_radians();
    let eye = DVec3::new(angle.sin(), height, angle.cos()).normalize() * 4.0;
    Camera::look_at(eye, DVec3::ZERO, DVec3::Y, 260.0, 112, 144)
}

fn drawn(body: &RestBody, pose: &Pose, camera: &Camera) -> Mask {
    let posed = PosedBody::new(body, pose).unwrap();
    let mesh = Mesh::new(&posed.mesh().vertices, &body.faces).unwrap();
    silhouette(&mesh, camera, SamplePattern::new(8)).unwrap()
}

/// Sights of `truth`, bent by each of the angles, from around; the body of the sequence is `body`.
fn sequence(body: &RestBody, truth: &RestBody, directions: &[f64], bends: &[f64]) -> Sequence {
    let cameras: Vec<Camera> = directions.iter().map(|&d| camera(d, 0.3)).collect();
    let poses: Vec<Pose> = bends.iter().map(|&b| bend(body, b)).collect();
    let pairs: Vec<(usize, usize)> =
        (0..poses.len()).flat_map(|p| (0..cameras.len()).map(move |c| (p, c))).collect();
    let masks = pairs.iter().map(|&(p, c)| drawn(truth, &poses[p], &cameras[c])).collect();
    let generator = Arc::new(Masks(masks));
    let frame = |(k, &(pose, camera)): (usize, &(usize, usize))| FrameRef {
        name: format!("image_{k:04}"),
        time: pose,
        pose,
        camera,
        source: FrameSource::Generated { generator: generator.clone(), frame: k },
    };
    Sequence {
        id: "train".into(),
        frames: pairs.iter().enumerate().map(frame).collect(),
        body: Arc::new(body.clone()),
        poses: poses.into(),
        cameras: cameras.into(),
        stored_sizes: None,
    }
}

/// The body in clothes: 3 cm all round, and a belt of 3 cm more.
fn clothed(body: &RestBody) -> RestBody {
    let offset = |v: &DVec3| 0.03 + 0.03 * (-(v.y / 0.15).powi(2)).exp() as f32;
    let offsets: Vec<f32> = body.vertices.iter().map(offset).collect();
    body.clone().with_normal_offset(&offsets).unwrap()
}

fn all_round() -> Vec<f64> {
    (0..8).map(|k| 22.5 * f64::from(k)).collect()
}

fn with(options: ShapeOptions) -> ShapeFit {
    ShapeFit { iterations: 120, options, ..ShapeFit::default() }
}

fn rounds(rounds: usize) -> Clothing {
    Clothing { rounds, ..Clothing::default() }
}

fn brief() -> ShapeFit {
    with(ShapeOptions { learning_rate: 2e-3, ..ShapeOptions::default() })
}

fn fitted(sequence: &Sequence, settings: &ShapeFit) -> Result<FittedShape, Error> {
    fit_shape(sequence, settings)
}

fn overlap(a: &Mask, b: &Mask) -> f64 {
    let pairs = || a.values().iter().zip(b.values()).map(|(&a, &b)| (f64::from(a), f64::from(b)));
    pairs().map(|(a, b)| a.min(b)).sum::<f64>() / pairs().map(|(a, b)| a.max(b)).sum::<f64>()
}

#[test]
fn clothes_are_found_and_hold_in_other_poses_and_views() {
    let body = limb(24);
    let truth = clothed(&body);
    let train = sequence(&body, &truth, &all_round(), &[0.0, 50.0]);
    for clothing in [0, 2].map(rounds) {
        let shape = fitted(&train, &ShapeFit { clothing, ..brief() }).unwrap();
        assert_eq!((&shape.ended, shape.warnings.len()), (&Ended::Finished, 0));
        shape.body.validate().unwrap();
        assert_eq!(shape.body.faces.len(), 4 * body.faces.len());
        assert_eq!(shape.body.skeleton, body.skeleton);
        for (degrees, direction) in [(-40.0, 11.0), (80.0, 100.0)] {
            let (pose, camera) = (bend(&body, degrees), camera(direction, 0.1));
            let wanted = drawn(&truth, &pose, &camera);
            let before = overlap(&drawn(&body, &pose, &camera), &wanted);
            let after = overlap(&drawn(&shape.body, &pose, &camera), &wanted);
            assert!(before < 0.9 && after > 0.985, "{before} {after}");
        }
        // 0.6 pixels, of clothes of two to four
        let rest = Subdivided::new(&truth).unwrap().body;
        let mut apart: Vec<f64> =
            rest.vertices.iter().zip(&shape.body.vertices).map(|(a, b)| a.distance(*b)).collect();
        apart.sort_by(f64::total_cmp);
        assert!(apart[apart.len() * 9 / 10] < 0.009, "90 % are within {}", apart[apart.len() * 9 / 10]);
    }
}

#[test]
fn a_body_that_fits_stays() {
    let body = limb(24);
    let shape = fitted(&sequence(&body, &body, &all_round(), &[0.0, 50.0]), &brief()).unwrap();
    // half a pixel, at the poles, where faces are tiny
    let farthest = shape.offsets.iter().fold(0.0, |most: f32, o| most.max(o.abs()));
    assert!(farthest < 0.0075, "{farthest}");
    assert!(shape.curve[0].2 > 0.999, "{:?}", shape.curve[0]);
}

#[test]
fn the_shape_is_the_same_for_any_number_of_threads_and_another_for_another_seed() {
    let body = limb(12);
    let train = sequence(&body, &clothed(&body), &all_round(), &[0.0]);
    let options = ShapeOptions { batch: 3, ..ShapeOptions::default() };
    let settings = ShapeFit { iterations: 12, options, ..ShapeFit::default() };
    let make = |threads, settings: &ShapeFit| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fitted(&train, settings).unwrap())
    };
    let one = make(1, &settings);
    for threads in [2, 5] {
        assert!(make(threads, &settings) == one, "{threads} threads");
    }
    assert_ne!(make(2, &ShapeFit { seed: 1, ..settings.clone() }).offsets, one.offsets);
}

#[test]
fn frames_that_say_nothing_are_named_and_left_out() {
    let body = limb(12);
    let good = sequence(&body, &body, &all_round(), &[0.0]);
    let masks = |change: &dyn Fn(&mut Vec<Mask>)| {
        let mut masks: Vec<Mask> = (0..good.frames.len()).map(|k| good.truth(k).unwrap().alpha).collect();
        change(&mut masks);
        let generator = Arc::new(Masks(masks));
        let mut train = good.clone();
        for (k, frame) in train.frames.iter_mut().enumerate() {
            frame.source = FrameSource::Generated { generator: generator.clone(), frame: k };
        }
        train
    };
    let corner = |mask: &mut Mask| {
        mask.values_mut().fill(0.0);
        mask.values_mut()[..5].fill(1.0);
    };
    let some = masks(&|masks| {
        masks[1].values_mut().fill(0.0);
        masks[2].values_mut().fill(1.0);
        corner(&mut masks[5]);
        masks[6].values_mut()[3] = f32::NAN;
    });
    let settings = ShapeFit { iterations: 6, ..ShapeFit::default() };
    let mut warnings = fitted(&some, &settings).unwrap().warnings;
    warnings.sort();
    assert_eq!(
        warnings,
        [
            "frame image_0001: the mask is empty",
            "frame image_0002: the mask covers the whole image",
            "frame image_0005: the mask misses the body",
            "frame image_0006: the mask has a value that is not finite",
        ]
    );
    let none = fitted(&masks(&|masks| masks.iter_mut().for_each(corner)), &settings).unwrap_err().to_string();
    assert!(none.starts_with("sequence train: masks: none of 8 frames is usable: frame image_"), "{none}");
    assert!(
        none.ends_with("the mask misses the body; expected masks that overlap with the projected body"),
        "{none}"
    );
    let mut away = good.clone();
    away.poses = vec![Pose { translation: DVec3::X * 50.0, ..good.poses[0].clone() }].into();
    let outside = fitted(&away, &settings).unwrap_err().to_string();
    assert!(outside.contains("the body's projection lies outside of the image"), "{outside}");
    let empty = Sequence { frames: Vec::new(), ..good };
    assert_eq!(
        fitted(&empty, &settings).unwrap_err().to_string(),
        "sequence train: frames: none; expected at least one"
    );
}

#[test]
fn what_is_not_finite_ends_the_fit_and_keeps_the_last_good_shape() {
    let body = limb(8);
    let train = sequence(&body, &clothed(&body), &[0.0, 90.0], &[0.0]);
    // weights so large that their gradient overflows at the first step away from the rest mesh
    let options =
        ShapeOptions { edge_length: 1e308, laplacian: 1e308, learning_rate: 1.0, ..brief().options };
    let wild = ShapeFit { clothing: rounds(0), options, ..brief() };
    let shape = fitted(&train, &wild).unwrap();
    let Ended::NotFinite { iteration, frame } = &shape.ended else { panic!("{:?}", shape.ended) };
    assert_eq!((*iteration, frame.as_str(), shape.curve.len()), (1, "regularisers", 1));
    shape.body.validate().unwrap();
    let positions: Vec<Vec3> = shape.body.vertices.iter().map(|v| v.as_vec3()).collect();
    assert!(positions.iter().all(|p| p.is_finite()));
}

#[test]
fn settings_out_of_range_are_named() {
    let body = limb(8);
    let train = sequence(&body, &body, &[0.0], &[0.0]);
    let base = ShapeOptions::default();
    for (options, field) in [
        (ShapeOptions { batch: 0, ..base.clone() }, "batch"),
        (ShapeOptions { learning_rate: f64::NAN, ..base.clone() }, "learning_rate"),
        (ShapeOptions { laplacian: -1.0, ..base.clone() }, "laplacian"),
        (ShapeOptions { softness: 1e9, ..base.clone() }, "softness"),
        (ShapeOptions { longest_side: 0, ..base.clone() }, "longest_side"),
    ] {
        match fitted(&train, &with(options)) {
            Err(Error::Invalid { field: found, .. }) => assert_eq!(found, field),
            other => panic!("{field}: {other:?}"),
        }
    }
    let unmoved = fitted(&train, &ShapeFit { iterations: 0, clothing: rounds(0), ..with(base) }).unwrap();
    assert!(unmoved.offsets.iter().all(|&o| o == 0.0) && unmoved.curve.is_empty());
}
