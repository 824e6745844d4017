//! Skinned glTF as others write it: what is wrong is named, what is unusual is read or named.

use crate::files;
use crate::gltf_builder::{Builder, F32, U8, arm};
use serde_json::{Value, json};
use skinsplat_data::body;
use skinsplat_data::gltf::Rig;

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
        (
            |j| {
                j["accessors"][0].as_object_mut().unwrap().remove("bufferView");
                j["accessors"][0]["count"] = json!(4_000_000_000u64);
            },
            "meshes[0].primitives[0].POSITION",
        ),
        (|j| j["accessors"][0]["bufferView"] = json!(99), "glTF"),
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
    for weight in [-0.25, f32::NEG_INFINITY, f32::NAN] {
        let b = with_weights(&[1., 0., 0., 0., 1., 0., 0., 0., 1.25, weight, 0., 0.]);
        let error = body::load(&b.glb(folder.path())).unwrap_err();
        assert_eq!(error.field(), "meshes[0].primitives[0].WEIGHTS_0[2]", "{error}");
        assert!(error.to_string().contains(&format!(": weight {weight}; ")), "{error}");
    }
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
        assert!(load("endless.bin").unwrap_err().to_string().contains("not a regular file"));
        use std::os::unix::fs::symlink;
        symlink(folder.path().join("outside.bin"), inner.join("out.bin")).unwrap();
        let error = load("out.bin").unwrap_err().to_string();
        assert!(error.contains("buffers[0].uri") && error.contains("leads out of the folder"), "{error}");
        symlink("parts/rig.bin", inner.join("near.bin")).unwrap();
        load("near.bin").unwrap();
        // The folder, or the document, may be a link itself.
        symlink(&inner, folder.path().join("linked")).unwrap();
        let expected = body::load(&inner.join("rig.gltf")).unwrap();
        assert_eq!(body::load(&folder.path().join("linked/rig.gltf")).unwrap(), expected);
        let cache = folder.path().join("cache");
        std::fs::create_dir(&cache).unwrap();
        symlink(inner.join("rig.gltf"), cache.join("rig.gltf")).unwrap();
        symlink(inner.join("near.bin"), cache.join("near.bin")).unwrap();
        assert_eq!(body::load(&cache.join("rig.gltf")).unwrap(), expected);
    }
}

/// Accessors without data are zeros, with or without sparse values; as many as the file has bytes.
#[test]
fn accessors_without_a_view_are_zeros() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = arm();
    let index = b.accessor(U8, "SCALAR", 1, &[1]);
    let value = b.floats("VEC3", 1, &[4., 5., 6.]);
    let view = |accessor: usize| b.json["accessors"][accessor]["bufferView"].clone();
    let sparse = json!({ "count": 1, "indices": { "bufferView": view(index), "componentType": U8 },
        "values": { "bufferView": view(value) } });
    let path = folder.path().join("zeros.glb");
    let load = |edit: &dyn Fn(&mut Value)| {
        let mut json = b.document();
        json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
        edit(&mut json["accessors"][0]);
        files::glb(&path, &json, &b.binary);
        body::load(&path).map(|body| body.rest.vertices)
    };
    assert_eq!(load(&|_| ()).unwrap(), [glam::DVec3::ZERO; 3]);
    let filled = load(&|accessor| accessor["sparse"] = sparse.clone()).unwrap();
    assert_eq!(filled, [glam::DVec3::ZERO, glam::DVec3::new(4.0, 5.0, 6.0), glam::DVec3::ZERO]);
    assert!(load(&|accessor| accessor["count"] = json!(1 << 20)).is_err());
}

/// Clips of many channels over one accessor take no more memory than the file could hold.
#[test]
fn clips_that_repeat_an_accessor_over_and_over_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = arm();
    let times: Vec<f32> = (0..2000u16).map(f32::from).collect();
    b.channel("clip", 0, "rotation", "LINEAR", &times, &[0., 0., 0., 1.].repeat(2000));
    let clip = b.json["animations"][0].clone();
    b.json["animations"] = json!(vec![clip.clone(); 200]);
    let rig = Rig::load(&b.glb(folder.path())).unwrap();
    assert!(rig.clips.iter().all(|clip| clip.key_times().len() == 2000) && rig.clips.len() == 200);
    b.json["animations"] = json!(vec![clip; 600]);
    let error = Rig::load(&b.glb(folder.path())).unwrap_err();
    assert_eq!(error.field(), "animations[524].channels[0]", "{error}");
    assert!(error.to_string().contains("over and over"), "{error}");
}

#[test]
fn joints_that_mirror_or_scale_by_0_are_said() {
    let folder = tempfile::tempdir().unwrap();
    let load = |b: &Builder| Rig::load(&b.glb(folder.path())).unwrap();
    let mirrored = "mirrored, which the shape of Gaussians does not follow (covariance=affine does)";
    let mut b = arm();
    b.json["nodes"][0]["scale"] = json!([1, -1, 1]);
    b.channel("same", 0, "scale", "LINEAR", &[0., 1.], &[1., -1., 1., 2., -2., 2.]);
    b.channel("back", 0, "scale", "LINEAR", &[0., 1.], &[1., -1., 1., 1., 1., 1.]);
    b.channel("gone", 2, "scale", "STEP", &[0., 1.], &[1., 1., 1., 0., 0., 0.]);
    let rig = load(&b);
    assert_eq!(rig.notes, [format!("joint elbow: {mirrored}")]);
    let notes: Vec<Vec<String>> = rig.clips.iter().map(|clip| clip.notes(&rig)).collect();
    let back = format!("clip back: joint elbow: {mirrored}");
    let gone = "clip gone: joint root: scaled by 0, where Gaussians vanish".to_owned();
    assert_eq!(notes, [vec![], vec![back], vec![gone.clone()]]);
    let track = skinsplat_data::poses::load_clip(&folder.path().join("rig.glb"), Some("gone")).unwrap();
    assert_eq!(track.notes()[1], gone);
    let mut b = arm();
    b.json["nodes"][1]["scale"] = json!([0, 0, 0]);
    assert_eq!(load(&b).notes, ["joint elbow and 1 more: scaled by 0, where Gaussians vanish"]);
    // What carries the joints mirrors them all.
    let mut b = arm();
    b.json["nodes"][2]["scale"] = json!([-2, 2, 2]);
    assert_eq!(load(&b).notes, [format!("joint elbow and 1 more: {mirrored}")]);
}
