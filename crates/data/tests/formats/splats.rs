//! KHR_gaussian_splatting: what is written is what is read, and names are those of the extension.

use crate::files;
use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use skinsplat_core::scene::{Avatar, Binding, Gaussians, Pose, PosedBody, RestBody, Skeleton, SkinWeights};
use skinsplat_data::avatar::{Format, read_avatar};
use skinsplat_data::{body, gltf, poses};
use std::path::{Path, PathBuf};

/// Gaussians with values of every kind: saturated opacities, flat scales, quaternions of either sign.
fn gaussians(count: usize, sh_degree: usize) -> Gaussians {
    let value = |i: usize, k: usize| ((i * 7919 + k * 104_729) % 2001) as f32 / 1000.0 - 1.0;
    let mut g = Gaussians { sh_degree, ..Gaussians::default() };
    for i in 0..count {
        g.means.push(Vec3::new(value(i, 0), value(i, 1), value(i, 2)));
        let q = [value(i, 3), value(i, 4), value(i, 5), value(i, 6) + 0.01];
        let length = q.iter().map(|c| c * c).sum::<f32>().sqrt();
        g.rotations.push(q.map(|c| c / length));
        g.log_scales.push(Vec3::new(value(i, 7) * 3.0 - 4.0, value(i, 8) - 3.0, -6.0));
        g.opacity_logits.push(value(i, 9) * 6.0);
        g.sh.extend((0..g.sh_count()).map(|k| [value(i, 10 + k), value(i, 30 + k), value(i, 50 + k)]));
    }
    g
}

fn arm() -> RestBody {
    let names = ["upper", "lower", "hand"].map(str::to_owned).to_vec();
    let positions = [DVec3::ZERO, DVec3::X, DVec3::X * 1.5];
    let skeleton = Skeleton::from_joint_positions(names, vec![None, Some(0), Some(1)], &positions).unwrap();
    let vertices = vec![DVec3::ZERO, DVec3::Y, DVec3::X, DVec3::X * 2.0];
    let rows = [vec![(0, 1.0)], vec![(0, 0.5), (1, 0.5)], vec![(1, 1.0)], vec![(2, 0.75), (1, 0.25)]];
    RestBody {
        skeleton,
        vertices,
        faces: vec![[0, 1, 2], [1, 2, 3]],
        weights: SkinWeights::from_rows(rows, 3).unwrap(),
        uv: None,
        pose_directions: Vec::new(),
    }
}

fn motion(body: &RestBody) -> Vec<Pose> {
    let bend = |k: usize| [DVec3::Y * 0.25, DVec3::Z * (0.5 * k as f64), DVec3::X * 1.25];
    let pose = |k: usize| Pose::from_axis_angles(&body.skeleton, &bend(k), DVec3::X * (0.125 * k as f64));
    (0..4).map(pose).collect()
}

/// The JSON chunk of a `.glb`.
fn document(path: &Path) -> Value {
    let bytes = std::fs::read(path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&bytes[20..20 + length]).unwrap()
}

#[test]
fn a_posed_file_round_trips() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["a.glb", "b.glb"].map(|name| folder.path().join(name));
    for degree in 0..=3 {
        let written = gaussians(200, degree);
        gltf::write_splats(&first, &written).unwrap();
        let loaded = read_avatar(&first).unwrap();
        assert_eq!((loaded.format, &loaded.avatar.binding), (Format::Gltf, &Binding::Static));
        let read = &loaded.avatar.gaussians;
        assert_eq!(
            (&read.means, &read.rotations, &read.sh),
            (&written.means, &written.rotations, &written.sh)
        );
        assert_eq!(read.opacities(), written.opacities());
        // Logarithms below -1 are told apart by their exponentials.
        assert_eq!(read.log_scales, written.log_scales);
        gltf::write_splats(&second, read).unwrap();
        assert_eq!(std::fs::read(&first).unwrap(), std::fs::read(&second).unwrap());
    }
}

#[test]
fn names_are_those_of_the_extension() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    gltf::write_splats(&path, &gaussians(3, 3)).unwrap();
    let json = document(&path);
    assert_eq!(json["extensionsUsed"], json!(["KHR_gaussian_splatting"]));
    let primitive = &json["meshes"][0]["primitives"][0];
    assert_eq!(primitive["mode"], 0);
    let extension = json!({ "kernel": "ellipse", "colorSpace": "srgb_rec709_display" });
    assert_eq!(primitive["extensions"]["KHR_gaussian_splatting"], extension);
    let mut names: Vec<&String> = primitive["attributes"].as_object().unwrap().keys().collect();
    names.sort();
    let mut expected = vec!["POSITION".to_owned()];
    expected.extend(["ROTATION", "SCALE", "OPACITY"].map(|name| format!("KHR_gaussian_splatting:{name}")));
    for (l, count) in [(0, 1), (1, 3), (2, 5), (3, 7)] {
        expected.extend((0..count).map(|n| format!("KHR_gaussian_splatting:SH_DEGREE_{l}_COEF_{n}")));
    }
    expected.sort();
    assert_eq!(names, expected.iter().collect::<Vec<_>>());
    let of = |name: &str| {
        let accessor = primitive["attributes"][name].as_u64().unwrap() as usize;
        json["accessors"][accessor]["type"].as_str().unwrap().to_owned()
    };
    assert_eq!(of("KHR_gaussian_splatting:ROTATION"), "VEC4");
    assert_eq!(of("KHR_gaussian_splatting:OPACITY"), "SCALAR");
    assert_eq!(of("KHR_gaussian_splatting:SH_DEGREE_3_COEF_6"), "VEC3");
}

#[test]
fn a_skinned_file_is_avatar_body_and_poses() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("skinned.glb");
    let (rest, splats) = (arm(), gaussians(5, 2));
    let rows = [
        vec![(2, 0.5), (0, 0.5)],
        vec![(1, 1.0)],
        vec![(0, 0.25), (1, 0.25), (2, 0.5)],
        vec![(0, 1.0)],
        vec![(1, 0.75), (0, 0.25)],
    ];
    let weights = SkinWeights::from_rows(rows, 3).unwrap();
    let avatar = Avatar { gaussians: splats, binding: Binding::Vertex(weights) };
    let track = motion(&rest);
    let clip = gltf::Motion { name: "bend", poses: &track, framerate: 8.0 };
    gltf::write_skinned_splats(&path, &avatar, &rest, Some(clip)).unwrap();
    let read = read_avatar(&path).unwrap().avatar;
    // Several logits are drawn with the same opacity.
    assert_eq!(read.gaussians.opacities(), avatar.gaussians.opacities());
    let opacity_logits = avatar.gaussians.opacity_logits.clone();
    let read = Avatar { gaussians: Gaussians { opacity_logits, ..read.gaussians }, ..read };
    assert_eq!(read, avatar);
    let body = body::load(&path).unwrap().rest;
    assert_eq!(body.skeleton.names, rest.skeleton.names);
    assert_eq!(body.skeleton.inverse_binds, rest.skeleton.inverse_binds);
    let read = poses::load(&path).unwrap().poses(&body.skeleton).unwrap();
    assert_eq!(read.len(), track.len());
    for (read, written) in read.iter().zip(&track) {
        let [a, b] = [PosedBody::new(&body, read).unwrap(), PosedBody::new(&rest, written).unwrap()];
        for (a, b) in a.joints.iter().zip(&b.joints) {
            assert!(a.linear.abs_diff_eq(b.linear, 1e-6) && a.translation.abs_diff_eq(b.translation, 1e-6));
        }
    }
}

#[test]
fn a_body_round_trips() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("body.glb");
    let rest = arm();
    gltf::write_body(&path, &rest, None).unwrap();
    let read = body::load(&path).unwrap().rest;
    assert_eq!((read.vertices, read.faces, read.weights), (rest.vertices, rest.faces, rest.weights));
}

#[test]
fn nodes_turn_gaussians_and_their_colours() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let written = gaussians(4, 1);
    gltf::write_splats(&path, &written).unwrap();
    let mut json = document(&path);
    let bytes = std::fs::read(&path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let binary = &bytes[20 + length + 8..];
    let half = 0.5f32.sqrt();
    // A quarter turn about z: x becomes y. Twice as large, one metre along x.
    json["nodes"][0]["rotation"] = json!([0.0, 0.0, half, half]);
    json["nodes"][0]["scale"] = json!([2.0, 2.0, 2.0]);
    json["nodes"][0]["translation"] = json!([1.0, 0.0, 0.0]);
    let turned: PathBuf = folder.path().join("turned.glb");
    files::glb(&turned, &json, binary);
    let read = read_avatar(&turned).unwrap().avatar.gaussians;
    for i in 0..4 {
        let m = written.means[i] * 2.0;
        assert!((read.means[i] - Vec3::new(1.0 - m.y, m.x, m.z)).length() < 1e-5);
        assert!((read.log_scales[i] - written.log_scales[i] - Vec3::splat(2f32.ln())).length() < 1e-5);
        // SH of degree 1 are (-y, z, -x): what pointed along x points along y.
        let (old, new) = (&written.sh[4 * i..4 * i + 4], &read.sh[4 * i..4 * i + 4]);
        for c in 0..3 {
            let off = [new[1][c] - old[3][c], new[2][c] - old[2][c], new[3][c] + old[1][c]];
            assert!(off.iter().all(|d| d.abs() < 1e-5), "{off:?}");
        }
    }
    json["nodes"][0]["scale"] = json!([2.0, 1.0, 2.0]);
    files::glb(&turned, &json, binary);
    let error = read_avatar(&turned).unwrap_err().to_string();
    assert!(error.contains("unequally"), "{error}");
}

#[test]
fn what_is_wrong_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    gltf::write_splats(&path, &gaussians(4, 1)).unwrap();
    let json = document(&path);
    let bytes = std::fs::read(&path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let binary = &bytes[20 + length + 8..];
    let bad = folder.path().join("bad.glb");
    let primitive = "/meshes/0/primitives/0";
    let refused = |edit: &dyn Fn(&mut Value)| {
        let mut json = json.clone();
        edit(&mut json);
        files::glb(&bad, &json, binary);
        read_avatar(&bad).unwrap_err().to_string()
    };
    let without = |name: &'static str| {
        refused(&move |json: &mut Value| {
            let attributes = json.pointer_mut(&format!("{primitive}/attributes")).unwrap();
            attributes.as_object_mut().unwrap().remove(name);
        })
    };
    let spz = "KHR_gaussian_splatting_compression_spz_2";
    assert!(refused(&|json| json["extensionsRequired"] = json!([spz])).contains(spz));
    assert!(refused(&|json| json["extensionsRequired"] = json!(["ACME_hair"])).contains("ACME_hair"));
    let scale = without("KHR_gaussian_splatting:SCALE");
    assert!(scale.contains("KHR_gaussian_splatting:SCALE: missing"), "{scale}");
    let band = without("KHR_gaussian_splatting:SH_DEGREE_1_COEF_1");
    assert!(band.contains("SH_DEGREE_1_COEF_1: missing"), "{band}");
    let kernel = refused(&|json| {
        let place = format!("{primitive}/extensions/KHR_gaussian_splatting/kernel");
        *json.pointer_mut(&place).unwrap() = json!("customShape");
    });
    assert!(kernel.contains("customShape") && kernel.contains("ellipse"), "{kernel}");
    let mode = refused(&|json| *json.pointer_mut(&format!("{primitive}/mode")).unwrap() = json!(4));
    assert!(mode.contains("Triangles") && mode.contains("points"), "{mode}");
}
