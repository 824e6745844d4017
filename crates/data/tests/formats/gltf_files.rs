//! Skinned glTF: containers, component types, several sets and primitives, animations.

use crate::gltf_builder::{U8, U16, U32, arm, close, posed};
use glam::DQuat;
use serde_json::json;
use skinsplat_core::scene::Pose;
use skinsplat_data::gltf::{self, Rig};
use skinsplat_data::{body, poses};
use std::f64::consts::FRAC_PI_2;

#[test]
fn joints_come_first_and_ancestors_carry_them() {
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::load(&arm().glb(folder.path())).unwrap();
    let skeleton = &rig.body.rest.skeleton;
    assert_eq!(skeleton.names, ["elbow", "shoulder", "root"]);
    assert_eq!((skeleton.num_joints(), &skeleton.parents[..]), (2, &[Some(1), Some(2), None][..]));
    // The root's transform counts, the mesh node's does not (glTF 2.0, 3.7.3.3).
    close(&posed(&rig, &Pose::rest(skeleton)), &[[4., 0., 5.], [1., 0., 5.], [2., 0.5, 5.]]);
    let mut pose = Pose::rest(skeleton);
    pose.locals[0].rotation = DQuat::from_rotation_z(FRAC_PI_2);
    close(&posed(&rig, &pose), &[[2., 2., 5.], [1., 0., 5.], [1.75, 0.25, 5.]]);
    let uv = rig.body.rest.uv.as_ref().unwrap();
    assert_eq!(uv.coordinates, [[0., 1.], [0.25, 0.25], [1., 0.]], "v runs up, as in OBJ");
    assert_eq!((&uv.faces, &rig.body.rest.faces), (&vec![[0, 1, 2]], &vec![[0, 1, 2]]));
    assert!(gltf::base_colour(&folder.path().join("rig.glb")).unwrap().is_none());
}

#[test]
fn the_container_makes_no_difference() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let b = arm();
    let expected = body::load(&b.glb(folder)).unwrap();
    let mut binary = b.binary.clone();
    binary.resize(binary.len().next_multiple_of(4), 0);
    std::fs::write(folder.join("my buffer.bin"), &binary).unwrap();
    let encoded = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, &binary);
    for uri in ["my%20buffer.bin".to_owned(), format!("data:application/octet-stream;base64,{encoded}")] {
        let mut json = b.document();
        json["buffers"][0]["uri"] = json!(uri);
        let path = folder.join("rig.gltf");
        std::fs::write(&path, json.to_string()).unwrap();
        assert_eq!(body::load(&path).unwrap(), expected);
    }
    for uri in
        ["missing.bin", "data:text/plain,abc", "data:;base64,%%%", "http://127.0.0.1/rig.bin", "%FF.bin"]
    {
        let mut json = b.document();
        json["buffers"][0]["uri"] = json!(uri);
        let path = folder.join("rig.gltf");
        std::fs::write(&path, json.to_string()).unwrap();
        let error = body::load(&path).unwrap_err();
        assert_eq!((error.field(), error.path()), ("buffers[0].uri", path.as_path()), "{error}");
    }
}

#[test]
fn every_component_type_and_a_second_set_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let expected = Rig::load(&arm().glb(folder.path())).unwrap();
    let u16s = |values: &[u16]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let mut b = arm();
    let weights = b.accessor(U8, "VEC4", 3, &[255, 0, 0, 0, 255, 0, 0, 0, 127, 128, 0, 0]);
    b.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(weights);
    let rig = Rig::load(&b.glb(folder.path())).unwrap();
    assert_eq!(rig.body.rest.weights.row(2), (&[0u16, 1][..], &[127.0f32 / 255.0, 128.0 / 255.0][..]));

    let mut b = arm();
    let joints = b.accessor(U16, "VEC4", 3, &u16s(&[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0]));
    b.json["accessors"][joints].as_object_mut().unwrap().remove("normalized");
    let weights = b.accessor(U16, "VEC4", 3, &u16s(&[65535, 0, 0, 0, 65535, 0, 0, 0, 32767, 32768, 0, 0]));
    let indices = b.accessor(U32, "SCALAR", 3, &[0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
    let primitive = &mut b.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["JOINTS_0"] = json!(joints);
    primitive["attributes"]["WEIGHTS_0"] = json!(weights);
    primitive["indices"] = json!(indices);
    let rig = Rig::load(&b.glb(folder.path())).unwrap();
    assert_eq!(rig.body.rest.faces, expected.body.rest.faces);
    assert_eq!(rig.body.rest.weights.row(2).1, [32767.0 / 65535.0, 32768.0 / 65535.0]);

    let mut b = arm();
    let joints = b.accessor(U8, "VEC4", 3, &[1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
    b.json["accessors"][joints].as_object_mut().unwrap().remove("normalized");
    let first = b.floats("VEC4", 3, &[0.5, 0., 0., 0., 1., 0., 0., 0., 0.5, 0.25, 0., 0.]);
    let second = b.floats("VEC4", 3, &[0.5, 0., 0., 0., 0., 0., 0., 0., 0.25, 0., 0., 0.]);
    let attributes = &mut b.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["WEIGHTS_0"] = json!(first);
    attributes["JOINTS_1"] = json!(joints);
    attributes["WEIGHTS_1"] = json!(second);
    let rig = Rig::load(&b.glb(folder.path())).unwrap();
    assert_eq!(rig.body.rest.weights.row(0), (&[0u16, 1][..], &[0.5f32, 0.5][..]));
    assert_eq!(rig.body.rest.weights.row(2), (&[0u16, 1, 1][..], &[0.5f32, 0.25, 0.25][..]));
}

#[test]
fn primitives_meshes_and_skins_become_one_body() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = arm();
    let primitive = b.json["meshes"][0]["primitives"][0].clone();
    let mut without_uv = primitive.clone();
    without_uv["attributes"].as_object_mut().unwrap().remove("TEXCOORD_0");
    without_uv.as_object_mut().unwrap().remove("indices");
    b.json["meshes"][0]["primitives"] = json!([primitive, without_uv]);
    // A second skin with one of the joints, numbered differently.
    b.json["meshes"].as_array_mut().unwrap().push(json!({ "primitives": [primitive] }));
    let mut binds = vec![0.0f32; 32];
    for (matrix, x) in [(0, 0.0), (1, -1.0)] {
        [0, 5, 10, 15].iter().for_each(|&k| binds[16 * matrix + k] = 1.0);
        binds[16 * matrix + 12] = x;
    }
    let binds = b.floats("MAT4", 2, &binds);
    b.json["skins"].as_array_mut().unwrap().push(json!({ "joints": [1, 0], "inverseBindMatrices": binds }));
    b.json["nodes"].as_array_mut().unwrap().push(json!({ "mesh": 1, "skin": 1 }));
    let rig = Rig::load(&b.glb(folder.path())).unwrap();
    assert_eq!(rig.body.rest.faces, [[0, 1, 2], [3, 4, 5], [6, 7, 8]]);
    assert!(rig.body.rest.uv.is_none(), "one primitive has none");
    assert_eq!(rig.body.rest.skeleton.num_joints(), 2);
    assert_eq!((rig.body.rest.weights.row(0).0, rig.body.rest.weights.row(6).0), (&[0u16][..], &[1u16][..]));
}

#[test]
fn animations_are_sampled_as_they_interpolate() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = arm();
    let (s, c) = (std::f32::consts::FRAC_PI_4.sin(), std::f32::consts::FRAC_PI_4.cos());
    // A quarter turn about z, its second key with the other sign of the quaternion.
    let turn = [0., 0., 0., 1., 0., 0., -s, -c];
    b.channel("linear", 0, "rotation", "LINEAR", &[1., 3.], &turn);
    b.channel("linear", 2, "translation", "STEP", &[0., 2.], &[0., 0., 5., 0., 0., 6.]);
    // From 0 to 1 in 2 seconds, leaving with slope 1 and arriving with slope 0.
    let spline = [9., 0., 0., 0., 0., 0., 1., 0., 0., 0., 0., 0., 1., 0., 0., 9., 0., 0.];
    b.channel("spline", 0, "translation", "CUBICSPLINE", &[0., 2.], &spline);
    b.channel("spline", 3, "translation", "LINEAR", &[0.], &[0., 0., 0.]);
    let path = b.glb(folder.path());
    let rig = Rig::load(&path).unwrap();
    let linear = rig.clip(Some("linear")).unwrap();
    assert_eq!(linear.key_times(), [0.0, 1.0, 2.0, 3.0]);
    let turned = |time: f64| linear.pose_at(&rig, time).locals[0].rotation;
    for (time, share) in [(0.0, 0.0), (1.0, 0.0), (1.5, 0.25), (2.0, 0.5), (3.0, 1.0), (9.0, 1.0)] {
        let error = turned(time).angle_between(DQuat::from_rotation_z(FRAC_PI_2 * share));
        assert!(error < 1e-7, "{time}: {}", turned(time));
    }
    let height = |time: f64| linear.pose_at(&rig, time).locals[2].translation.z;
    assert_eq!([-1.0, 0.0, 1.999, 2.0, 7.0].map(height), [5.0, 5.0, 5.0, 6.0, 6.0]);
    let spline = rig.clip(Some("spline")).unwrap();
    let x = |time: f64| spline.pose_at(&rig, time).locals[0].translation.x;
    // Hermite basis at t = 1/2: 1/2 p1 + 1/8 m0 with m0 = slope 1 times 2 seconds.
    for (time, expected) in [(0.0, 0.0), (1.0, 0.5 + 0.25), (2.0, 1.0)] {
        assert!((x(time) - expected).abs() < 1e-12, "{time}: {}", x(time));
    }
    let track = poses::load_clip(&path, Some("linear")).unwrap();
    let expected = linear.key_poses(&rig).unwrap();
    assert_eq!(*track.poses(&rig.body.rest.skeleton).unwrap(), expected);
    let error = poses::load(&path).unwrap_err().to_string();
    assert!(error.ends_with("animations: 2 clips and no name; expected one of: linear, spline"), "{error}");
    // A skeleton with the same names in another order gets the same motion.
    let mut other = arm();
    other.json["skins"][0]["joints"] = json!([1, 0]);
    let other = Rig::load(&other.glb(folder.path())).unwrap();
    let moved = track.poses(&other.body.rest.skeleton).unwrap();
    assert_eq!(moved[3].locals[1], expected[3].locals[0]);
}
