//! Synthetic subjects: their bodies, motions, images and parameters.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use glam::DVec3;
use proptest::prelude::*;
use skinsplat_core::scene::{Pose, PosedBody, RestBody};
use skinsplat_data::Capture;
use skinsplat_data::Sequence;
use skinsplat_synthetic::{ArmShape, FigureShape, Motion, Parameters, Rig, SUBJECTS, Subject, subjects};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::LazyLock;

/// The subjects that come with the program, with small images.
fn default_subjects() -> &'static [(String, Subject)] {
    static BUILT: LazyLock<Vec<(String, Subject)>> = LazyLock::new(|| {
        let small = |p: &Parameters| Parameters { resolution: 64, samples: 2, ..p.clone() };
        let all = subjects(SUBJECTS).unwrap();
        all.iter().map(|(name, p)| (name.clone(), Subject::new(&small(p)).unwrap())).collect()
    });
    &BUILT
}

fn arm(bones: u32, motion: Motion) -> Subject {
    let rig = Rig::Arm(ArmShape { bones, ..ArmShape::default() });
    Subject::new(&Parameters { rig, motion, resolution: 64, samples: 1, ..Parameters::default() }).unwrap()
}

/// Every edge is used once in each direction, and the faces enclose a positive volume.
fn assert_closed_and_outward(name: &str, body: &RestBody) {
    let mut edges = BTreeSet::new();
    let mut volume = 0.0;
    for f in &body.faces {
        for k in 0..3 {
            assert!(edges.insert((f[k], f[(k + 1) % 3])), "{name}: edge used twice in one direction");
        }
        let [a, b, c] = f.map(|i| body.vertices[i as usize]);
        volume += a.dot(b.cross(c)) / 6.0;
    }
    assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))), "{name}: open edge");
    assert!(volume > 0.0, "{name}: inside out");
    let euler = body.vertices.len() as i64 - body.faces.len() as i64 / 2;
    assert_eq!(euler, 2, "{name}: no handles, one piece");
    let used: BTreeSet<u32> = body.faces.iter().flatten().copied().collect();
    assert_eq!(used.len(), body.vertices.len(), "{name}: loose vertices");
}

#[test]
fn default_bodies_are_closed_spheres_of_good_triangles() {
    for (name, subject) in default_subjects() {
        let body = subject.body();
        assert_closed_and_outward(name, body);
        if matches!(subject.parameters().rig, Rig::Figure(_)) {
            assert!((5_000..=15_000).contains(&body.vertices.len()), "{name}: {}", body.vertices.len());
        }
        let smallest_angle = |f: &[u32; 3]| {
            let p = f.map(|i| body.vertices[i as usize]);
            let angle = |k: usize| (p[(k + 1) % 3] - p[k]).angle_between(p[(k + 2) % 3] - p[k]).to_degrees();
            (0..3).map(angle).fold(180.0, f64::min)
        };
        let mut angles: Vec<f64> = body.faces.iter().map(smallest_angle).collect();
        angles.sort_by(f64::total_cmp);
        assert!(angles[0] > 4.0, "{name}: worst angle {}", angles[0]);
        assert!(angles[angles.len() / 100] > 18.0, "{name}: 1 % below {}", angles[angles.len() / 100]);
        assert!(angles[angles.len() / 2] > 37.0, "{name}: median {}", angles[angles.len() / 2]);
    }
}

#[test]
fn weights_are_few_smooth_and_use_every_joint() {
    for (name, subject) in default_subjects() {
        let (body, weights) = (subject.body(), &subject.body().weights);
        assert!(weights.max_influences() <= 4);
        let mut held = vec![0.0f64; body.skeleton.num_joints()];
        for i in 0..weights.len() {
            let (joints, shares) = weights.row(i);
            let sum: f64 = shares.iter().map(|&w| f64::from(w)).sum();
            // four f32 roundings
            assert!((sum - 1.0).abs() < 3e-7, "{name}: row {i} sums to {sum}");
            joints.iter().zip(shares).for_each(|(&j, &w)| held[usize::from(j)] += f64::from(w));
        }
        for (joint, total) in held.iter().enumerate() {
            assert!(*total > 5.0, "{name}: {} moves {total} vertices", body.skeleton.names[joint]);
        }
        // A transition is several edges wide, so that no weight jumps.
        let dense = |i: u32| -> BTreeMap<u16, f32> {
            let (joints, shares) = weights.row(i as usize);
            joints.iter().copied().zip(shares.iter().copied()).collect()
        };
        for f in &body.faces {
            let (a, b) = (dense(f[0]), dense(f[1]));
            let joints: BTreeSet<u16> = a.keys().chain(b.keys()).copied().collect();
            for j in joints {
                let jump = (a.get(&j).unwrap_or(&0.0) - b.get(&j).unwrap_or(&0.0)).abs();
                assert!(jump < 0.6, "{name}: {} jumps by {jump}", body.skeleton.names[usize::from(j)]);
            }
        }
    }
}

#[test]
fn weights_keep_to_their_limb() {
    let subject = Subject::new(&Parameters { resolution: 32, ..Parameters::default() }).unwrap();
    let body = subject.body();
    for (i, vertex) in body.vertices.iter().enumerate() {
        let (joints, shares) = body.weights.row(i);
        for (&j, &w) in joints.iter().zip(shares) {
            let name = &body.skeleton.names[usize::from(j)];
            let side = if name.starts_with("left") { 1.0 } else { -1.0 };
            let sided = name.contains('_');
            assert!(
                !sided || w < 0.5 || vertex.x * side > -0.005,
                "{name} holds {w} of the other side's {vertex}"
            );
        }
    }
    // The middle of a bone belongs to it alone.
    for (point, joint) in [
        (DVec3::new(0.3, 1.415, 0.05), "left_shoulder"),
        (DVec3::new(-0.56, 1.415, 0.0), "right_elbow"),
        (DVec3::new(0.1, 0.3, 0.05), "left_knee"),
        (DVec3::new(0.0, 1.72, -0.1), "head"),
    ] {
        let nearest = (0..body.vertices.len())
            .min_by(|&a, &b| {
                (body.vertices[a] - point).length().total_cmp(&(body.vertices[b] - point).length())
            })
            .unwrap();
        let (joints, shares) = body.weights.row(nearest);
        let strongest = usize::from(joints[0]);
        assert_eq!(body.skeleton.names[strongest], joint);
        assert!(shares[0] > 0.99, "{joint}: {}", shares[0]);
    }
}

#[test]
fn the_rest_pose_is_the_template() {
    for (name, subject) in default_subjects() {
        let body = subject.body();
        let posed = PosedBody::new(body, &Pose::rest(&body.skeleton)).unwrap();
        for (posed, rest) in posed.mesh().vertices.iter().zip(&body.vertices) {
            // the rounding of f32 weights and positions
            assert!((*posed - rest.as_vec3()).length() < 1e-6, "{name}");
        }
    }
}

#[test]
fn a_half_turn_between_two_bones_collapses_the_joint() {
    let subject = arm(2, Motion { twist_degrees: 180.0, ..Motion::default() });
    let sequence = subject.test().into_iter().find(|s| s.id == "test_twist").unwrap();
    let (body, pose) = (subject.body(), sequence.poses.last().unwrap());
    let joint = pose.locals[1].rotation.to_scaled_axis();
    assert!((joint.x.to_degrees().abs() - 180.0).abs() < 1e-9, "the last frame holds the whole angle");
    let posed = PosedBody::new(body, pose).unwrap();
    let mut narrow = 0;
    for (i, rest) in body.vertices.iter().enumerate() {
        let (joints, shares) = body.weights.row(i);
        let child: f64 = joints.iter().zip(shares).map(|(&j, &w)| f64::from(j) * f64::from(w)).sum();
        let radius = |v: DVec3| v.y.hypot(v.z);
        let (before, after) = (radius(*rest), radius(posed.mesh().vertices[i].as_dvec3()));
        // (1 - w) + w R(180°): the cross-section shrinks by |1 - 2 w|.
        assert!((after - before * (1.0 - 2.0 * child).abs()).abs() < 1e-6);
        narrow += usize::from(after < 0.1 * before);
    }
    assert!(narrow > 50, "{narrow} vertices at the wrapper's neck");
}

#[test]
fn charts_cover_the_surface_without_overlap() {
    const SIDE: usize = 512;
    for (name, subject) in default_subjects() {
        let uv = subject.body().uv.as_ref().unwrap();
        let mut owner = vec![None; SIDE * SIDE];
        let (mut covered, mut clashes) = (0, 0);
        for (face, corners) in uv.faces.iter().enumerate() {
            let p = corners.map(|i| uv.coordinates[i as usize].map(|c| f64::from(c) * SIDE as f64));
            assert!(
                p.iter().flatten().all(|&c| (0.0..=SIDE as f64).contains(&c)),
                "{name}: outside of the atlas"
            );
            let cross = |a: [f64; 2], b: [f64; 2], x: f64, y: f64| {
                (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
            };
            let range = |axis: usize| {
                let low = p.iter().map(|c| c[axis]).fold(f64::INFINITY, f64::min);
                let high = p.iter().map(|c| c[axis]).fold(0.0, f64::max);
                low as usize..(high.ceil() as usize).min(SIDE)
            };
            for (y, x) in range(1).flat_map(|y| range(0).map(move |x| (y, x))) {
                let at = (x as f64 + 0.5, y as f64 + 0.5);
                let sides = [0, 1, 2].map(|k| cross(p[k], p[(k + 1) % 3], at.0, at.1));
                if sides.iter().all(|&s| s > 0.0) {
                    covered += 1;
                    clashes += usize::from(owner[y * SIDE + x].replace(face).is_some());
                }
            }
        }
        assert_eq!(clashes, 0, "{name}: texels with two faces");
        assert!(covered > SIDE * SIDE / 3, "{name}: {covered} texels used");
    }
}

fn bits(sequence: &Sequence, frame: usize) -> Vec<u32> {
    let truth = sequence.truth(frame).unwrap();
    let colours = truth.rgb.pixels().iter().flatten().map(|c| c.to_bits()).collect::<Vec<_>>();
    colours.into_iter().chain(truth.alpha.values().iter().map(|a| a.to_bits())).collect()
}

#[test]
fn images_and_bodies_are_the_same_bits_for_any_number_of_threads() {
    let parameters = Parameters { resolution: 96, samples: 2, ..Parameters::default() };
    let make = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let subject = Subject::new(&parameters).unwrap();
            let frame = bits(&subject.test()[0], 5);
            (subject.body().as_ref().clone(), frame)
        })
    };
    assert_eq!(make(1), make(2));
}

#[test]
fn sequences_follow_the_capture() {
    let ids = |s: &Subject| {
        s.sequences().iter().map(|q| (q.id.clone(), q.cameras.len(), q.frames.len())).collect::<Vec<_>>()
    };
    let expected = |list: &[(&str, usize, usize)]| {
        list.iter().map(|&(id, c, f)| (id.to_owned(), c, f)).collect::<Vec<_>>()
    };
    let small =
        Parameters { resolution: 32, samples: 1, train_frames: 6, test_frames: 3, ..Parameters::default() };
    let one = Subject::new(&small).unwrap();
    assert_eq!(ids(&one), expected(&[("train", 1, 6), ("test_twist", 1, 3), ("test_bend", 1, 3)]));
    let ring = Parameters { capture: Capture::Multiview, train_cameras: 4, test_cameras: 2, ..small.clone() };
    let ring = Subject::new(&ring).unwrap();
    let tests = [("train", 4, 24), ("test_novel_view", 2, 6), ("test_twist", 2, 6), ("test_bend", 2, 6)];
    assert_eq!(ids(&ring), expected(&tests));
    let hands = Subject::new(&Parameters { capture: Capture::Hands, ..small }).unwrap();
    assert_eq!(ids(&hands), expected(&[("train", 1, 6), ("test_fingers", 1, 3)]));
    assert_eq!(hands.body().skeleton.num_joints(), 52);
    assert_eq!(one.body().skeleton.num_joints(), 24);
    for sequence in ring.sequences() {
        let names: BTreeSet<&String> = sequence.frames.iter().map(|f| &f.name).collect();
        assert_eq!(names.len(), sequence.frames.len());
        let digest = |i: usize| sequence.selected(&[i]).unwrap().digest().unwrap();
        let digests: BTreeSet<String> = (0..names.len()).map(digest).collect();
        assert_eq!(digests.len(), names.len());
    }
}

#[test]
fn silhouettes_are_those_of_the_projected_mesh() {
    let parameters =
        Parameters { resolution: 128, samples: 4, train_frames: 8, test_frames: 4, ..Parameters::default() };
    let subject = Subject::new(&parameters).unwrap();
    for sequence in subject.sequences() {
        for (index, frame) in sequence.frames.iter().enumerate() {
            let posed = PosedBody::new(&sequence.body, &sequence.poses[frame.pose]).unwrap();
            let camera = &sequence.cameras[frame.camera];
            let truth = sequence.truth(index).unwrap();
            let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            for vertex in &posed.mesh().vertices {
                let (pixel, _) = camera.project(vertex.as_dvec3()).unwrap();
                (low, high) = (low.min(pixel.extend(0.0)), high.max(pixel.extend(0.0)));
                let (x, y) = (pixel.x as usize, pixel.y as usize);
                assert!(
                    pixel.min_element() > 1.0 && pixel.max_element() < 127.0,
                    "{}: out of the image",
                    frame.name
                );
                let near = (y - 1..=y + 1).flat_map(|y| (x - 1..=x + 1).map(move |x| (x, y)));
                assert!(
                    near.into_iter().any(|(x, y)| truth.alpha.at(x, y) > 0.0),
                    "{}: nothing at {pixel}",
                    frame.name
                );
            }
            for y in 0..128 {
                for x in 0..128 {
                    let (rgb, a) = (truth.rgb.at(x, y), truth.alpha.at(x, y));
                    assert!((0.0..=1.0).contains(&a) && rgb.iter().all(|c| (0.0..=1.0).contains(c)));
                    assert!(a > 0.0 || rgb == [0.0; 3]);
                    let outside = (x as f64) > high.x
                        || (x as f64 + 1.0) < low.x
                        || (y as f64) > high.y
                        || (y as f64 + 1.0) < low.y;
                    assert!(!(outside && a > 0.0), "{}: coverage outside of the mesh", frame.name);
                }
            }
        }
    }
}

#[test]
fn motions_are_smooth_and_stand_on_the_ground() {
    let motion = Motion { twist_degrees: 180.0, bend_degrees: 150.0, liveliness: 1.5, turns: 1.0 };
    for capture in [Capture::Monocular, Capture::Multiview, Capture::Hands] {
        let parameters = Parameters {
            capture,
            motion,
            resolution: 16,
            train_frames: 120,
            test_frames: 120,
            ..Parameters::default()
        };
        let subject = Subject::new(&parameters).unwrap();
        for sequence in subject.sequences() {
            for pair in sequence.poses.windows(2) {
                for (a, b) in pair[0].locals.iter().zip(&pair[1].locals) {
                    let step = a.rotation.angle_between(b.rotation).to_degrees();
                    assert!(step < 16.0, "{}: {step} degrees in one frame", sequence.id);
                }
            }
            for pose in sequence.poses.iter().step_by(20) {
                let posed = PosedBody::new(&sequence.body, pose).unwrap();
                let lowest = posed.mesh().vertices.iter().map(|v| v.y).fold(f32::INFINITY, f32::min);
                assert!(lowest.abs() < 0.06, "{}: lowest point at {lowest} m", sequence.id);
            }
        }
    }
}

#[test]
fn parameters_out_of_range_are_refused_by_name() {
    let cases = [
        ("resolution = 0", "resolution"),
        ("samples = 9", "samples"),
        ("train_frames = 0", "train_frames"),
        ("train_cameras = 4", "train_cameras"),
        ("test_cameras = 2", "test_cameras"),
        ("rig = { kind = \"figure\", height = nan }", "rig.height"),
        ("rig = { kind = \"figure\", edge = 1e-6 }", "rig.edge"),
        ("rig = { kind = \"figure\", girth = -1.0 }", "rig.girth"),
        ("rig = { kind = \"arm\", bones = 0 }", "rig.bones"),
        ("rig = { kind = \"arm\", radius = inf }", "rig.radius"),
        ("rig = { kind = \"arm\" }\ncapture = \"hands\"", "rig.kind"),
        ("motion = { twist_degrees = 181.0 }", "motion.twist_degrees"),
        ("motion = { bend_degrees = -1.0 }", "motion.bend_degrees"),
        ("look = { gloss = 3.0 }", "look.gloss"),
        ("look = { contrast = nan }", "look.contrast"),
    ];
    for (text, field) in cases {
        let parameters: Parameters = toml::from_str(text).unwrap();
        assert_eq!(Subject::new(&parameters).unwrap_err().field, field, "{text}");
        let table = format!("[name]\n{text}");
        assert_eq!(subjects(&table).unwrap_err().field, format!("name.{field}"), "{text}");
    }
}

#[test]
fn unknown_fields_are_refused() {
    for text in [
        "colour = 1",
        "rig = { kind = \"figure\", bones = 3 }",
        "rig = { kind = \"robot\" }",
        "motion = { twist = 1.0 }",
    ] {
        assert!(toml::from_str::<Parameters>(text).is_err(), "{text}");
        let error = subjects(&format!("[name]\n{text}")).unwrap_err();
        assert!(error.field == "subjects" && !error.to_string().contains('\n'), "{error}");
    }
}

#[test]
fn parameters_survive_toml_and_every_one_changes_the_key() {
    let base = Parameters::default();
    let text = toml::to_string(&base).unwrap();
    assert_eq!(toml::from_str::<Parameters>(&text).unwrap(), base);
    let variants = [
        "seed = 2",
        "samples = 4",
        "lights = \"body\"",
        "lights = \"camera\"",
        "rig = { kind = \"figure\", girth = 1.1 }",
        "rig = { kind = \"arm\" }",
        "motion = { twist_degrees = 1.0 }",
        "look = { gloss = 0.5 }",
        "capture = \"multiview\"",
    ];
    let keys = variants.iter().map(|text| toml::from_str::<Parameters>(text).unwrap().key());
    let distinct: BTreeSet<String> = keys.chain([base.key()]).collect();
    assert_eq!(distinct.len(), variants.len() + 1);
}

fn rig() -> impl Strategy<Value = Rig> {
    let figure = (1.1f64..2.3, 0.8f64..1.3, 0.87f64..1.13, 0.2f64..1.6, 0.017f64..0.027).prop_map(
        |(height, girth, shoulders, softness, edge)| {
            Rig::Figure(FigureShape { height, girth, shoulders, softness, edge })
        },
    );
    let arm = (0u32..8, 0.1f64..3.2, 0.01f64..0.4, 0.0f64..0.6, 0.2f64..0.6).prop_map(
        |(bones, length, radius, softness, relative_edge)| {
            Rig::Arm(ArmShape { bones, length, radius, softness, edge: relative_edge * radius })
        },
    );
    prop_oneof![2 => figure, 3 => arm]
}

proptest! {
    // A case builds a body and draws a frame.
    #![proptest_config(ProptestConfig { cases: 20, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn any_parameters_give_a_closed_body_and_images_or_a_named_error(
        rig in rig(),
        capture in prop_oneof![Just(Capture::Monocular), Just(Capture::Multiview), Just(Capture::Hands)],
        motion in (-12.0f64..12.0, -200.0f64..200.0, -10.0f64..160.0, 0.0f64..1.6),
        frame in 0usize..40,
        seed: u32,
    ) {
        let (turns, twist_degrees, bend_degrees, liveliness) = motion;
        let motion = Motion { turns, twist_degrees, bend_degrees, liveliness };
        let parameters = Parameters { rig, capture, motion, seed, resolution: 32, samples: 4, ..Parameters::default() };
        match Subject::new(&parameters) {
            Err(error) => {
                // Refused for a range, never for what the mesher made of valid parameters.
                prop_assert_eq!(parameters.validate().unwrap_err(), error);
            }
            Ok(subject) => {
                assert_closed_and_outward("random", subject.body());
                for sequence in subject.sequences() {
                    let truth = sequence.truth(frame % sequence.frames.len()).unwrap();
                    prop_assert!(truth.rgb.pixels().iter().flatten().all(|c| c.is_finite()));
                    prop_assert!(truth.alpha.values().iter().any(|&a| a > 0.0));
                }
            }
        }
    }
}
