//! Skinned glTF: containers, component types, several sets and primitives, animations.

use crate::files;
use glam::{DQuat, Vec3};
use serde_json::{Value, json};
use skinsplat_core::scene::{Pose, PosedBody};
use skinsplat_data::gltf::{self, Rig};
use skinsplat_data::{body, poses};
use std::f64::consts::FRAC_PI_2;
use std::path::Path;

const F32: u32 = 5126;
const U8: u32 = 5121;
const U16: u32 = 5123;
const U32: u32 = 5125;

/// A document under construction; every accessor has a buffer view of its own.
struct Builder {
    json: Value,
    binary: Vec<u8>,
}

impl Builder {
    fn accessor(&mut self, component: u32, kind: &str, count: usize, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let view = json!({ "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len() });
        self.binary.extend(bytes);
        let views = self.json["bufferViews"].as_array_mut().unwrap();
        views.push(view);
        let view = views.len() - 1;
        let normalized = component != F32 && kind == "VEC4";
        let mut accessor =
            json!({ "bufferView": view, "componentType": component, "type": kind, "count": count });
        if normalized {
            accessor["normalized"] = json!(true);
        }
        if kind == "VEC3" {
            (accessor["min"], accessor["max"]) = (json!([-9, -9, -9]), json!([9, 9, 9]));
        }
        let accessors = self.json["accessors"].as_array_mut().unwrap();
        accessors.push(accessor);
        accessors.len() - 1
    }

    fn floats(&mut self, kind: &str, count: usize, values: &[f32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(F32, kind, count, &bytes)
    }

    fn channel(
        &mut self,
        clip: &str,
        node: usize,
        path: &str,
        interpolation: &str,
        times: &[f32],
        values: &[f32],
    ) {
        let input = self.floats("SCALAR", times.len(), times);
        let width = if path == "rotation" { 4 } else { 3 };
        let kind = if width == 4 { "VEC4" } else { "VEC3" };
        let output = self.floats(kind, values.len() / width, values);
        let animations = self.json["animations"].as_array_mut().unwrap();
        if !animations.iter().any(|a| a["name"] == clip) {
            animations.push(json!({ "name": clip, "samplers": [], "channels": [] }));
        }
        let animation = animations.iter_mut().find(|a| a["name"] == clip).unwrap();
        let samplers = animation["samplers"].as_array_mut().unwrap();
        samplers.push(json!({ "input": input, "output": output, "interpolation": interpolation }));
        let sampler = samplers.len() - 1;
        let target = json!({ "node": node, "path": path });
        animation["channels"].as_array_mut().unwrap().push(json!({ "sampler": sampler, "target": target }));
    }

    fn document(&self) -> Value {
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.binary.len().next_multiple_of(4) }]);
        json
    }

    fn glb(&self, folder: &Path) -> std::path::PathBuf {
        let path = folder.join("rig.glb");
        files::glb(&path, &self.document(), &self.binary);
        path
    }
}

/// An arm along x: shoulder at x = 0 (node 1), elbow at x = 1 (node 0), both under node 2, which moves everything by
/// (0, 0, 5) and doubles it. The skin lists the elbow first. Vertex 0 is the hand at x = 2, vertex 1 the upper arm at
/// x = 0.5, vertex 2 is shared half and half at x = 1.
fn arm() -> Builder {
    let mut b = Builder {
        json: json!({
            "asset": { "version": "2.0" },
            "nodes": [
                { "name": "elbow", "translation": [1, 0, 0] },
                { "name": "shoulder", "children": [0] },
                { "name": "root", "children": [1], "translation": [0, 0, 5], "scale": [2, 2, 2] },
                { "name": "mesh", "mesh": 0, "skin": 0, "translation": [100, 100, 100] },
            ],
            "bufferViews": [], "accessors": [], "animations": [],
        }),
        binary: Vec::new(),
    };
    let position = b.floats("VEC3", 3, &[2., 0., 0., 0.5, 0., 0., 1., 0.25, 0.]);
    let uv = b.floats("VEC2", 3, &[0., 0., 0.25, 0.75, 1., 1.]);
    let joints = b.accessor(U8, "VEC4", 3, &[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0]);
    b.json["accessors"][joints].as_object_mut().unwrap().remove("normalized");
    let weights = b.floats("VEC4", 3, &[1., 0., 0., 0., 1., 0., 0., 0., 0.5, 0.5, 0., 0.]);
    let indices = b.accessor(U16, "SCALAR", 3, &[0, 0, 1, 0, 2, 0]);
    let mut binds = vec![0.0f32; 32];
    for (matrix, x) in [(0, -1.0), (1, 0.0)] {
        [0, 5, 10, 15].iter().for_each(|&k| binds[16 * matrix + k] = 1.0);
        binds[16 * matrix + 12] = x;
    }
    let binds = b.floats("MAT4", 2, &binds);
    b.json["meshes"] = json!([{ "primitives": [{
        "attributes": { "POSITION": position, "TEXCOORD_0": uv, "JOINTS_0": joints, "WEIGHTS_0": weights },
        "indices": indices,
    }] }]);
    b.json["skins"] = json!([{ "joints": [0, 1], "inverseBindMatrices": binds }]);
    b
}

fn posed(rig: &Rig, pose: &Pose) -> Vec<Vec3> {
    PosedBody::new(&rig.body.rest, pose).unwrap().mesh().vertices.clone()
}

fn close(found: &[Vec3], expected: &[[f32; 3]]) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!((*a - Vec3::from_array(*b)).length() < 1e-6, "{a} and {b:?}");
    }
}

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

#[test]
fn what_is_wrong_with_a_rig_is_named() {
    let folder = tempfile::tempdir().unwrap();
    type Edit = fn(&mut Value);
    let cases: Vec<(Edit, &str)> = vec![
        (|j| j["asset"]["version"] = json!("1.0"), "asset.version"),
        (
            |j| j["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(99),
            "meshes[0].primitives[0].attributes",
        ),
        (|j| drop(j["nodes"][3].as_object_mut().unwrap().remove("skin")), "skins"),
        (|j| j["accessors"][0]["count"] = json!(4_000_000_000u64), "meshes[0].primitives[0].POSITION"),
        (|j| j["accessors"][0]["count"] = json!(0), "meshes[0].primitives[0].POSITION"),
        (|j| j["accessors"][0]["type"] = json!("VEC2"), "meshes[0].primitives[0].POSITION"),
        (|j| j["accessors"][0]["byteOffset"] = json!(8), "meshes[0].primitives[0].POSITION"),
        (|j| j["bufferViews"][0]["byteLength"] = json!(1u64 << 40), "meshes[0].primitives[0].POSITION"),
        (|j| j["bufferViews"][0]["byteStride"] = json!(8), "meshes[0].primitives[0].POSITION"),
        (|j| drop(j["accessors"][0].as_object_mut().unwrap().remove("bufferView")), "glTF"),
        (|j| j["accessors"][1]["count"] = json!(2), "meshes[0].primitives[0].TEXCOORD_0"),
        (|j| j["accessors"][4]["count"] = json!(2), "meshes[0].primitives[0].indices"),
        (|j| j["accessors"][2]["componentType"] = json!(F32), "meshes[0].primitives[0].JOINTS_0"),
        (|j| j["accessors"][5]["count"] = json!(1), "skins[0]"),
        (|j| j["skins"][0]["joints"] = json!([0]), "meshes[0].primitives[0].JOINTS_0[1]"),
        (|j| j["meshes"][0]["primitives"][0]["mode"] = json!(5), "meshes[0].primitives[0].mode"),
        (
            |j| {
                drop(
                    j["meshes"][0]["primitives"][0]["attributes"]
                        .as_object_mut()
                        .unwrap()
                        .remove("WEIGHTS_0"),
                )
            },
            "meshes[0].primitives[0].JOINTS_0, WEIGHTS_0",
        ),
        (|j| j["nodes"][0]["children"] = json!([2]), "nodes[0]"),
        (|j| j["nodes"][3]["children"] = json!([0]), "nodes[0]"),
        (|j| j["nodes"][0]["rotation"] = json!([0, 0, 0, 0]), "rest transform[0]"),
        (|j| j["buffers"][0]["byteLength"] = json!(1 << 30), "buffers[0]"),
    ];
    for (i, (edit, field)) in cases.iter().enumerate() {
        let b = arm();
        let mut json = b.document();
        edit(&mut json);
        let path = folder.path().join(format!("case{i}.glb"));
        files::glb(&path, &json, &b.binary);
        let error = body::load(&path).expect_err(&format!("case {i}"));
        assert_eq!((error.field(), error.path()), (*field, path.as_path()), "case {i}: {error}");
        assert_eq!(error.to_string().lines().count(), 1, "case {i}: {error}");
    }
    let mut heavy = arm();
    let weights = heavy.floats("VEC4", 3, &[1., 0., 0., 0., 0.9, 0., 0., 0., 0.5, 0.5, 0., 0.]);
    heavy.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(weights);
    let error = body::load(&heavy.glb(folder.path())).unwrap_err();
    assert_eq!(error.field(), "meshes[0].primitives[0].WEIGHTS_0[1]", "{error}");
    for (times, values, field) in [
        (&[1.0f32, 1.0][..], &[0.0f32; 6][..], "animations[0].channels[0].input"),
        (&[0.0, f32::NAN], &[0.0; 6], "animations[0].channels[0].input"),
        (&[0.0, 1.0], &[0.0; 3], "animations[0].channels[0].output"),
        (&[0.0, 1.0], &[f32::INFINITY; 6], "animations[0].channels[0].output"),
    ] {
        let mut b = arm();
        b.channel("clip", 0, "translation", "LINEAR", times, values);
        assert_eq!(body::load(&b.glb(folder.path())).unwrap_err().field(), field);
    }
}

fn with_weights(weights: &[f32]) -> Builder {
    let mut b = arm();
    let accessor = b.floats("VEC4", 3, weights);
    b.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(accessor);
    b
}

#[test]
fn weights_that_are_off_by_little_are_made_one_and_said() {
    let folder = tempfile::tempdir().unwrap();
    let b = with_weights(&[1., 0., 0., 0., 0.0, 0., 0., 0., 0.49, 0.49, 0., 0.]);
    let rig = Rig::load(&b.glb(folder.path())).unwrap();
    assert_eq!(rig.body.rest.weights.row(2), (&[0u16, 1][..], &[0.5f32, 0.5][..]));
    assert_eq!(rig.body.rest.weights.row(1), (&[1u16][..], &[1.0f32][..]), "the first joint that it names");
    let place = "meshes[0].primitives[0]: ";
    let empty = format!("{place}1 of 3 vertices have no weights and hang on the first joint that they name");
    let off = format!("{place}1 of 3 rows summed to 0.9800 to 0.9800 and were divided by their sum");
    assert_eq!(rig.notes, [empty, off]);
    for (sum, good) in [(0.97, true), (1.03, true), (0.96, false), (1.04, false), (f32::NAN, false)] {
        let b = with_weights(&[1., 0., 0., 0., sum, 0., 0., 0., 0.5, 0.5, 0., 0.]);
        assert_eq!(Rig::load(&b.glb(folder.path())).is_ok(), good, "{sum}");
    }
    let file = Rig::load(&crate::support::data("small/foreign_bodies/weights.gltf")).unwrap();
    assert_eq!(file.body.rest.weights.row(2).1, [0.5, 0.5]);
}

#[test]
fn what_others_write_into_their_documents_is_read_or_named() {
    let folder = tempfile::tempdir().unwrap();
    let expected = body::load(&arm().glb(folder.path())).unwrap();
    let edited = |edit: &dyn Fn(&mut Value)| {
        let b = arm();
        let mut json = b.document();
        edit(&mut json);
        let path = folder.path().join("edited.glb");
        files::glb(&path, &json, &b.binary);
        Rig::load(&path)
    };
    // Channels without a node are to be ignored (glTF 2.0, 5.1).
    let rig = edited(&|json| {
        json["animations"] = json!([{
            "name": "blink", "samplers": [{ "input": 5, "output": 5 }],
            "channels": [{ "sampler": 0, "target": { "path": "rotation" } },
                { "sampler": 0, "target": { "path": "pointer", "extensions": { "KHR_animation_pointer": {} } } }],
        }]);
    });
    let rig = rig.unwrap();
    assert_eq!((&rig.body, rig.clips.len(), rig.clips[0].key_times().len()), (&expected, 1, 0));
    for (extension, word) in [
        ("KHR_draco_mesh_compression", "Draco"),
        ("EXT_meshopt_compression", "meshopt"),
        ("KHR_meshopt_compression", "meshopt"),
    ] {
        let error = edited(&|json| json["extensionsRequired"] = json!([extension])).unwrap_err();
        assert_eq!(error.field(), "extensionsRequired");
        assert!(error.to_string().contains(extension) && error.to_string().contains(word), "{error}");
    }
    let rig =
        edited(&|json| json["extensionsRequired"] = json!(["KHR_mesh_quantization", "ACME_hair"])).unwrap();
    assert_eq!(rig.notes, ["it requires the extension ACME_hair, which is not read"]);
    // A byte order mark.
    let mut text = b"\xEF\xBB\xBF".to_vec();
    let mut json = arm().document();
    let encoded = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, &arm().binary);
    json["buffers"][0] =
        json!({ "uri": format!("data:;base64,{encoded}"), "byteLength": arm().binary.len() });
    text.extend(json.to_string().into_bytes());
    let path = folder.path().join("marked.gltf");
    std::fs::write(&path, text).unwrap();
    assert_eq!(body::load(&path).unwrap(), expected);
    for name in ["bom.gltf", "channel_without_node.gltf"] {
        body::load(&crate::support::data("small/foreign_bodies").join(name)).unwrap();
    }
    let draco = body::load(&crate::support::data("small/foreign_bodies/draco_required.gltf")).unwrap_err();
    assert!(draco.to_string().contains("KHR_draco_mesh_compression"), "{draco}");
    // A mesh of a hundred primitives that is shown a thousand times.
    let many = edited(&|json| {
        let primitive = json["meshes"][0]["primitives"][0].clone();
        json["meshes"][0]["primitives"] = json!(vec![primitive; 100]);
        let nodes = json["nodes"].as_array_mut().unwrap();
        (0..1000).for_each(|_| nodes.push(json!({ "mesh": 0, "skin": 0 })));
    });
    assert!(many.unwrap_err().to_string().contains("over and over"));
}

#[test]
fn quantised_vertices_are_what_their_integers_stand_for() {
    let folder = tempfile::tempdir().unwrap();
    let wide = |values: &[i16]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let quantised = |component: u32, count: usize, bytes: &[u8], normalized: bool| {
        let mut b = arm();
        let positions = b.accessor(component, "VEC3", count, bytes);
        b.json["accessors"][positions]["normalized"] = json!(normalized);
        b.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(positions);
        let mut json = b.document();
        json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        let path = folder.path().join("quantised.glb");
        files::glb(&path, &json, &b.binary);
        body::load(&path).unwrap().rest.vertices
    };
    let shorts = wide(&[2, 0, 0, -3, 4, 0, 0, 0, -32768]);
    let plain = quantised(5122, 3, &shorts, false);
    assert_eq!(plain[1], glam::DVec3::new(-3.0, 4.0, 0.0));
    let units = quantised(5122, 3, &shorts, true);
    assert_eq!((units[0].x, units[2].z), (2.0 / 32767.0, -1.0));
    let bytes = [127u8, 0, 0, 129, 0, 0, 0, 128, 0];
    assert_eq!(quantised(5120, 3, &bytes, true)[..2], [glam::DVec3::X, -glam::DVec3::X]);
    assert_eq!(quantised(U8, 3, &bytes, false)[1].x, 129.0);
}

#[test]
fn buffers_are_files_of_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("inner");
    std::fs::create_dir_all(inner.join("parts/nested")).unwrap();
    let b = arm();
    let mut long = b.binary.clone();
    long.resize(long.len().next_multiple_of(4) + 1000, 7);
    std::fs::write(folder.path().join("outside.bin"), &long).unwrap();
    std::fs::write(inner.join("parts/rig.bin"), &long).unwrap();
    let load = |uri: &str| {
        let mut json = b.document();
        json["buffers"][0]["uri"] = json!(uri);
        let path = inner.join("rig.gltf");
        std::fs::write(&path, json.to_string()).unwrap();
        body::load(&path)
    };
    load("parts/rig.bin").unwrap();
    load("./parts/rig.bin").unwrap();
    let absolute = folder.path().join("outside.bin");
    for uri in [
        "../outside.bin",
        "parts/../../outside.bin",
        absolute.to_str().unwrap(),
        "/dev/zero",
        "%2e%2e/outside.bin",
        "parts/nested",
    ] {
        let error = load(uri).unwrap_err();
        assert_eq!(error.field(), "buffers[0].uri", "{uri}: {error}");
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("/dev/zero", inner.join("endless.bin")).unwrap();
        assert!(load("endless.bin").unwrap_err().to_string().contains("no regular file"));
    }
}
