//! Avatars in the formats of other programs, drawn: each as the PLY that it was made from.

use crate::args;
use crate::made_up::Ply;
use crate::program::{Answer, Desk};
use crate::support::data;
use glam::{DMat3, DVec3};
use skinsplat::run::foreign::{OnBody, on_body};
use skinsplat_core::scene::{Avatar, Binding, PosedBody};
use skinsplat_data::avatar::read_avatar;
use skinsplat_data::npz::Archive;
use skinsplat_data::ply::{self, Encoding, Metadata};
use skinsplat_data::{body, npy};
use skinsplat_posing::{BoundAvatar, Strategy, pose};
use std::path::PathBuf;

fn file(name: &str) -> PathBuf {
    data("small/avatars").join(name)
}

fn tiny() -> PathBuf {
    data("small/tiny/models/body.npz")
}

/// A desk with a camera that sees the tiny body, and poses of it.
fn desk() -> Desk {
    let desk = Desk::new();
    let camera = serde_json::json!({
        "width": 96, "height": 96, "fx": 200.0, "fy": 200.0, "cx": 48.0, "cy": 48.0,
        "world_to_camera": [[1, 0, 0, 0], [0, -1, 0, 0.1], [0, 0, -1, 0.6], [0, 0, 0, 1]],
    });
    desk.put("camera.json", camera.to_string());
    let thetas: Vec<f32> =
        [0.0; 9].into_iter().chain([0.2, 0.3, -0.1, 0.0, 0.0, 0.9, 0.4, 0.0, -0.7]).collect();
    crate::files::npz(
        &desk.path("poses.npz"),
        &[
            ("thetas", &[2, 9], crate::files::Values::F32(thetas)),
            ("transl", &[2, 3], crate::files::Values::F32(vec![0.0; 6])),
        ],
    );
    desk
}

/// The picture of an avatar, as it stands or posed.
fn picture(desk: &Desk, avatar: &PathBuf, more: &[&str]) -> (Vec<f64>, Answer) {
    let mut all = args!["render", avatar, "--camera", "camera.json", "--out", "out.npy"];
    all.extend(more.iter().map(std::ffi::OsString::from));
    let answer = desk.run(all).exits(0, "render");
    (npy::read(&desk.path("out.npy")).unwrap().values, answer)
}

/// The largest and the mean difference of two pictures.
fn apart(a: &[f64], b: &[f64]) -> (f64, f64) {
    assert_eq!(a.len(), b.len());
    let off: Vec<f64> = a.iter().zip(b).map(|(a, b)| (a - b).abs()).collect();
    (off.iter().copied().fold(0.0, f64::max), off.iter().sum::<f64>() / off.len() as f64)
}

/// What is drawn of the first 40 Gaussians of the base.
fn plain(desk: &Desk, binding: Binding) -> PathBuf {
    let mut g = read_avatar(&file("base.ply")).unwrap().avatar.gaussians;
    g.means.truncate(40);
    g.rotations.truncate(40);
    g.log_scales.truncate(40);
    g.opacity_logits.truncate(40);
    g.sh.truncate(160);
    let path = desk.path("plain.ply");
    let avatar = Avatar { gaussians: g, binding };
    ply::write_avatar(&path, &avatar, &Metadata::default(), Encoding::LittleEndian).unwrap();
    path
}

#[test]
fn every_format_draws_the_picture_of_the_ply_that_it_was_made_from() {
    let desk = desk();
    let expected = picture(&desk, &plain(&desk, Binding::Static), &[]).0;
    assert!(expected.iter().filter(|v| **v > 0.05).count() > 2000, "something is seen");
    for (name, most) in [
        ("gsplat.pt", 0.0),
        ("capture.pth", 0.0),
        ("splatfacto.ckpt", 0.0),
        // values that were rounded once more on their way
        ("gaussians.npz", 1e-5),
        ("gaussians_logs.npz", 1e-5),
        // 11 bits
        ("half.pth", 0.02),
    ] {
        let (found, _) = apart(&picture(&desk, &file(name), &[]).0, &expected);
        assert!(found <= most, "{name}: {found}");
    }
    let six = picture(&desk, &file("six.ply"), &[]).0;
    for name in ["six_big_endian.ply", "six_ascii.ply", "six_double.ply"] {
        assert_eq!(picture(&desk, &file(name), &[]).0, six, "{name}");
    }
    let plain = picture(&desk, &file("ihuman_plain.ply"), &[]).0;
    let (found, answer) = picture(&desk, &file("ihuman.ply"), &[]);
    assert!(apart(&found, &plain).0 < 1e-5);
    assert!(answer.err.contains("ihuman.ply: scales of 1 mm"), "{}", answer.err);
    let unpacked = picture(&desk, &file("base_decompressed.ply"), &[]).0;
    let packed = picture(&desk, &file("base.compressed.ply"), &[]).0;
    assert!(apart(&packed, &unpacked).0 < 1e-5);
    // 8 bits of colour, 10 of rotation, 11 of position and scale
    let (_, mean) = apart(&packed, &picture(&desk, &file("base.ply"), &[]).0);
    assert!(mean < 0.01, "{mean}");
}

#[test]
fn an_npz_with_weights_is_posed_as_the_ply_with_the_same_weights() {
    let desk = desk();
    let posed = |avatar: &PathBuf| {
        let body = tiny();
        picture(&desk, avatar, &["--body", body.to_str().unwrap(), "--poses", "poses.npz", "--frame", "1"])
    };
    let avatar = read_avatar(&file("gaussians.npz")).unwrap().avatar;
    let (expected, _) = posed(&plain(&desk, avatar.binding));
    let (found, answer) = posed(&file("gaussians.npz"));
    assert!(apart(&found, &expected).0 < 1e-4);
    assert!(answer.err.contains("an avatar of Someone et al."), "{}", answer.err);
    // Without weights it takes those of the nearest points, and says so.
    let (_, answer) = posed(&file("gsplat.pt"));
    assert!(answer.err.contains("gsplat.pt: no binding in the file"), "{}", answer.err);
}

/// An avatar that is canonical in a pose is drawn in that pose as it was stored, and bends from there.
#[test]
fn a_canonical_pose_takes_the_place_of_the_rest_pose() {
    let desk = desk();
    let body = tiny();
    let stored = picture(&desk, &plain(&desk, Binding::Static), &[]).0;
    let source = read_avatar(&file("gaussians.npz")).unwrap().avatar;
    let g = &source.gaussians;
    let Binding::Vertex(weights) = &source.binding else { panic!() };
    let flat = |values: &[glam::Vec3]| values.iter().flat_map(|v| v.to_array()).collect::<Vec<f32>>();
    let dense: Vec<f32> = (0..40)
        .flat_map(|i| {
            let (joints, own) = weights.row(i);
            let mut row = [0.0; 3];
            joints.iter().zip(own).for_each(|(&j, &w)| row[usize::from(j)] = w);
            row
        })
        .collect();
    use crate::files::Values::F32;
    let arrays = |pose: Vec<f32>| {
        vec![
            ("means", &[40u64, 3][..], F32(flat(&g.means))),
            ("quats", &[40, 4], F32(g.rotations.concat())),
            ("log_scales", &[40, 3], F32(flat(&g.log_scales))),
            ("logit_opacities", &[40], F32(g.opacity_logits.clone())),
            ("sh", &[40, 4, 3], F32(g.sh.concat())),
            ("weights", &[40, 3], F32(dense.clone())),
            ("canonical_pose", &[3, 3], F32(pose)),
        ]
    };
    let pose = vec![0.2, 0.3, -0.1, 0.0, 0.0, 0.9, 0.4, 0.0, -0.7];
    crate::files::npz(&desk.path("canonical.npz"), &arrays(pose));
    let avatar = desk.path("canonical.npz");
    let posed = |frame: &str| {
        let body = body.to_str().unwrap();
        picture(&desk, &avatar, &["--body", body, "--poses", "poses.npz", "--frame", frame])
    };
    // Frame 1 is the canonical pose itself.
    let (found, answer) = posed("1");
    assert!(apart(&found, &stored).0 < 2e-3, "{:?}", apart(&found, &stored));
    assert!(answer.err.contains("its canonical pose (3 joints turned by up to"), "{}", answer.err);
    assert!(apart(&posed("0").0, &stored).1 > 0.01, "another pose is another picture");
    let text = desk.ok(args!["inspect", &avatar]);
    assert!(text.contains("a pose of 3 joints"), "{text}");
    // Poses of more joints than the body has do not fit.
    crate::files::npz(&avatar, &{
        let mut arrays = arrays(Vec::new());
        arrays.pop();
        arrays.push(("canonical_pose", &[4, 3], F32(vec![0.5; 12])));
        arrays
    });
    let arguments = args!["skin", &avatar, "--body", &body, "--poses", "poses.npz", "--out", "o.ply"];
    desk.run(arguments).refuses(&["canonical_pose", "4 joints", "at most the body's 3"], "too many joints");
}

/// Means and covariances of HAHA's runner (NumPy), on the body at rest and in a pose that bends it.
#[test]
fn a_haha_checkpoint_is_posed_as_haha_poses_it() {
    let expected = |name: &str, pattern: &str| {
        Archive::open(&file("haha_expected.npz"), "expected").unwrap().require(name, pattern).unwrap().values
    };
    let loaded = read_avatar(&file("haha.ckpt")).unwrap();
    let model = body::load(&tiny()).unwrap();
    let rest = model.shaped(loaded.betas.as_deref().unwrap()).unwrap();
    let OnBody { avatar, mesh, notes, .. } = on_body(loaded, &rest).unwrap();
    assert_eq!(notes.len(), 2, "{notes:?}");
    assert!(mesh.is_some());
    let bound = BoundAvatar::new(&avatar, &rest).unwrap();
    let strategy: Strategy = "face-tbn+rotation=face-haha-scaled".parse().unwrap();
    let angles = expected("pose", "3,3");
    let turned: Vec<DVec3> = angles.chunks_exact(3).map(DVec3::from_slice).collect();
    let transl = DVec3::from_slice(&expected("transl", "3"));
    let poses = [("rest", vec![DVec3::ZERO; 3], DVec3::ZERO), ("posed", turned, transl)];
    for (name, angles, transl) in poses {
        let at = skinsplat_core::scene::Pose::from_axis_angles(&rest.skeleton, &angles, transl);
        let posed_body = PosedBody::new(&rest, &at).unwrap();
        let posed = pose(&bound, &posed_body, &strategy).unwrap();
        let means = expected(&format!("{name}_means"), "N,3");
        let covariances = expected(&format!("{name}_covariances"), "N,3,3");
        for i in 0..avatar.gaussians.len() {
            let off = (posed.means[i].as_dvec3() - DVec3::from_slice(&means[3 * i..])).length();
            assert!(off < 2e-6, "{name} {i}: mean off by {off}");
            let factor = posed.factors[i].as_dmat3();
            let covariance = factor * factor.transpose();
            let wanted = DMat3::from_cols_slice(&covariances[9 * i..]);
            let scale = wanted.to_cols_array().iter().fold(0.0f64, |a, b| a.max(b.abs()));
            let error = (covariance - wanted).to_cols_array().iter().fold(0.0f64, |a, b| a.max(b.abs()));
            assert!(error < 1e-4 * scale, "{name} {i}: covariance off by {error} of {scale}");
        }
    }
}

/// The checkpoint draws Gaussians and mesh together, as the hybrid does that this program keeps as a PLY, a texture and
/// vertices.
#[test]
fn a_haha_checkpoint_draws_its_mesh_under_its_gaussians() {
    let desk = desk();
    let loaded = read_avatar(&file("haha.ckpt")).unwrap();
    let model = body::load(&tiny()).unwrap();
    let betas = loaded.betas.clone().unwrap();
    let rest = model.shaped(&betas).unwrap();
    let texture = loaded.texture.clone().unwrap();
    let OnBody { avatar, .. } = on_body(loaded, &rest).unwrap();
    ply::write_avatar(&desk.path("hybrid.ply"), &avatar, &Metadata::default(), Encoding::LittleEndian)
        .unwrap();
    skinsplat_data::frames::save_npy(&desk.path("t.npy"), &texture).unwrap();
    skinsplat_data::frames::save_png(&desk.path("hybrid.texture.png"), &texture).unwrap();
    let vertices = rest.vertices.iter().flat_map(|v| v.as_vec3().to_array());
    npy::write_f32(&desk.path("hybrid.vertices.npy"), &[rest.vertices.len(), 3], vertices).unwrap();
    use crate::files::Values::F32;
    let thetas = vec![0.2, 0.3, -0.1, 0.0, 0.0, 0.9, 0.4, 0.0, -0.7];
    let betas: Vec<f32> = betas.iter().map(|&b| b as f32).collect();
    let named = [("thetas", &[1u64, 9][..], F32(thetas.clone())), ("transl", &[1, 3], F32(vec![0.0; 3]))];
    let [thetas_only, transl] = named;
    crate::files::npz(&desk.path("shaped.npz"), &[thetas_only, transl, ("betas", &[2], F32(betas))]);
    crate::files::npz(
        &desk.path("unshaped.npz"),
        &[("thetas", &[1, 9], F32(thetas)), ("transl", &[1, 3], F32(vec![0.0; 3]))],
    );
    let body = tiny();
    let drawn = |avatar: &PathBuf, poses: &str, strategy: &str| {
        let more = ["--body", body.to_str().unwrap(), "--poses", poses, "--strategy", strategy];
        picture(&desk, avatar, &more)
    };
    let own = "face-tbn+rotation=face-haha-scaled";
    let (expected, _) = drawn(&desk.path("hybrid.ply"), "shaped.npz", own);
    // The file's own shape counts, whatever the poses say.
    let (found, answer) = drawn(&file("haha.ckpt"), "unshaped.npz", own);
    assert!(apart(&found, &expected).0 < 1e-3, "{:?}", apart(&found, &expected));
    assert!(answer.err.contains("haha.ckpt: a HAHA checkpoint"), "{}", answer.err);
    assert!(answer.err.contains("haha.ckpt: the body has the shape"), "{}", answer.err);
    // Without its mesh it looks different.
    for part in ["texture.png", "vertices.npy"] {
        std::fs::remove_file(desk.path(&format!("hybrid.{part}"))).unwrap();
    }
    assert!(apart(&drawn(&desk.path("hybrid.ply"), "shaped.npz", own).0, &expected).1 > 0.01);
    let text = desk.ok(args!["inspect", file("haha.ckpt")]);
    for part in ["HAHA checkpoint", "12x16", "the frame of each Gaussian's face", "_body_pose_dict"] {
        assert!(text.contains(part), "no `{part}` in {text}");
    }
    let render = args!["render", file("haha.ckpt"), "--camera", "camera.json", "--out", "o.npy"];
    desk.run(render).refuses(&["haha.ckpt", "--body"], "no body");
}

#[test]
fn opacities_of_0_and_1_and_discs_without_thickness_are_drawn() {
    let desk = crate::made_up::desk();
    for (value, name) in [("inf", "opacity"), ("-inf", "opacity"), ("-inf", "scale_1")] {
        desk.put("ends.ply", Ply::bound().set(2, name, value).text());
        desk.ok(args!["render", "ends.ply", "--camera", "camera.json", "--out", "o.npy"]);
        let drawn = npy::read(&desk.path("o.npy")).unwrap().values;
        assert!(drawn.iter().all(|v| v.is_finite()));
        let skin = ["skin", "ends.ply", "--body", "body.npz", "--poses", "poses.npz", "--frame", "1"];
        for strategy in ["quaternion-average", "view-canonical", "ihuman-original"] {
            let mut all: Vec<_> = skin.iter().map(std::ffi::OsString::from).collect();
            all.extend(args!["--out", "posed.ply", "--strategy", strategy]);
            desk.ok(all);
            ply::read(&desk.path("posed.ply")).unwrap();
        }
    }
    // sigmoid(-inf) = 0: as if it were not there.
    desk.put("none.ply", Ply::bound().set(2, "opacity", "-inf").text());
    let mut without = Ply::bound();
    without.rows.remove(2);
    desk.put("five.ply", without.text());
    let drawn = |name: &str| {
        desk.ok(args!["render", name, "--camera", "camera.json", "--out", "o.npy"]);
        npy::read(&desk.path("o.npy")).unwrap().values
    };
    assert_eq!(drawn("none.ply"), drawn("five.ply"));
}

#[test]
fn cameras_of_3dgs_and_nerfstudio_are_read() {
    let desk = crate::made_up::desk();
    let own = serde_json::json!({
        "width": 64, "height": 48, "fx": 60.0, "fy": 60.0, "cx": 32.0, "cy": 24.0,
        "world_to_camera": [[1, 0, 0, 0], [0, -1, 0, 0.1], [0, 0, -1, 1], [0, 0, 0, 1]],
    });
    desk.put("own.json", own.to_string());
    // The same camera: at (0, 0.1, 1), looking along -z, y up.
    let trained = serde_json::json!([{
        "id": 0, "img_name": "0001", "width": 64, "height": 48, "position": [0, 0.1, 1],
        "rotation": [[1, 0, 0], [0, -1, 0], [0, 0, -1]], "fx": 60, "fy": 60,
    }]);
    desk.put("cameras.json", trained.to_string());
    let c2w = serde_json::json!([[1, 0, 0, 0], [0, 1, 0, 0.1], [0, 0, 1, 1], [0, 0, 0, 1]]);
    let nerf = |lens: serde_json::Value| {
        let mut file = lens;
        file["frames"] = serde_json::json!([{ "file_path": "a.png", "transform_matrix": c2w }]);
        file.to_string()
    };
    desk.put(
        "transforms.json",
        nerf(serde_json::json!({ "w": 64, "h": 48, "fl_x": 60, "cx": 32, "cy": 24, "k1": 0.1 })),
    );
    let angle = 2.0 * (32.0f64 / 60.0).atan();
    desk.put("angle.json", nerf(serde_json::json!({ "w": 64, "h": 48, "camera_angle_x": angle })));
    use crate::files::Values::{F64, I64};
    let w2c = vec![1., 0., 0., 0., 0., -1., 0., 0.1, 0., 0., -1., 1., 0., 0., 0., 1.];
    let own = [
        ("intrinsic", &[3u64, 3][..], F64(vec![60., 0., 32., 0., 60., 24., 0., 0., 1.])),
        ("extrinsic", &[4, 4], F64(w2c)),
        ("width", &[], I64(vec![64])),
        ("height", &[], I64(vec![48])),
        ("dist", &[5], F64(vec![0.1; 5])),
    ];
    crate::files::npz(&desk.path("own.npz"), &own);
    let drawn = |camera: &str| {
        let answer = desk.run(args!["render", "avatar.ply", "--camera", camera, "--out", "o.npy"]);
        let answer = answer.exits(0, camera);
        (npy::read(&desk.path("o.npy")).unwrap().values, answer.err)
    };
    let (expected, _) = drawn("own.json");
    for (camera, note) in [
        ("cameras.json", "no principal point"),
        ("transforms.json", "lens distortion of the file is left out; the file has no fl_y"),
        ("angle.json", "no cx"),
        ("own.npz", "own.npz: not read: dist"),
    ] {
        let (found, said) = drawn(camera);
        assert!(apart(&found, &expected).0 < 1e-6, "{camera}");
        assert!(said.contains(note), "{camera}: {said}");
        assert!(desk.ok(args!["inspect", camera]).contains("64x48, focal 60.0 60.0"), "{camera}");
    }
    desk.put("synthetic.json", nerf(serde_json::json!({ "camera_angle_x": 0.7 })));
    let render = args!["render", "avatar.ply", "--camera", "synthetic.json", "--out", "a.npy"];
    desk.run(render).refuses(&["synthetic.json", "frames[0].w", "missing"], "no size");
    desk.put(
        "fish.json",
        nerf(serde_json::json!({ "w": 8, "h": 8, "fl_x": 6, "camera_model": "OPENCV_FISHEYE" })),
    );
    desk.run(args!["inspect", "fish.json"]).refuses(&["camera_model", "OPENCV_FISHEYE"], "a fish eye");
}

#[test]
fn avatars_of_any_format_are_measured_and_their_needs_named() {
    let desk = desk();
    let body = tiny();
    let needs = args!["inspect", file("gsplat.pt"), "--needs", "--poses", "poses.npz", "--body", &body];
    let answer = desk.run(needs).exits(0, "needs");
    assert!(answer.out.contains("joints used") && answer.err.contains("no binding"), "{}", answer.err);
    let trade = args![
        "trade",
        "tiny",
        "--data",
        data("small"),
        "--avatar",
        file("gaussians.npz"),
        "--quick",
        "--only",
        "solver",
        "--out",
        "trade",
    ];
    let answer = desk.run(trade).exits(0, "trade");
    assert!(answer.err.contains("an avatar of Someone et al."), "{}", answer.err);
    desk.put("a.spz", b"\x1f\x8b\x08\0");
    desk.run(args!["inspect", "a.spz"]).refuses(&["a.spz", "Niantic", "splat-transform"], "an spz");
}

/// What the exporters of `experiments/exporters` write of stand-ins (their `test_exporters.py`): the committed files, and
/// those that they write now if there is a Python with NumPy.
#[test]
fn what_the_exporters_write_is_read() {
    let desk = Desk::new();
    let exporters = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments/exporters");
    let mut folders = vec![file("exported")];
    let has_numpy = std::process::Command::new("python3").args(["-c", "import numpy"]).output();
    if has_numpy.is_ok_and(|output| output.status.success()) {
        let fresh = desk.path("fresh");
        let mut test = std::process::Command::new("python3");
        test.args(["-B", "test_exporters.py"]).arg(&fresh).current_dir(&exporters);
        let output = test.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        folders.push(fresh);
    } else {
        println!("no python3 with NumPy: only the committed files are read");
    }
    for folder in folders {
        for (name, method, strategy, degree) in [
            ("hugs", "HUGS", "hugs-original", 2),
            ("ihuman", "iHuman", "ihuman-original", 2),
            ("animatable", "Animatable 3D Gaussians", "animatable-original", 1),
            ("gs3davatar", "3DGS-Avatar", "view-canonical", 0),
            ("gauhuman", "GauHuman", "view-canonical+colour=none", 1),
        ] {
            let loaded = read_avatar(&folder.join(format!("{name}.npz"))).unwrap();
            assert!(loaded.is_bound(), "{name}");
            assert!(loaded.ignored.is_empty(), "{name}: {:?}", loaded.ignored);
            assert_eq!(loaded.avatar.gaussians.sh_degree, degree, "{name}");
            assert_eq!(loaded.notes[0], format!("an avatar of {method}"));
            assert!(loaded.notes[1].ends_with(&format!("poses it by {strategy}")), "{:?}", loaded.notes);
            strategy.parse::<Strategy>().unwrap();
            let is_moved = matches!(loaded.canonical, skinsplat_data::avatar::Canonical::Pose(_));
            assert_eq!(is_moved, name != "animatable", "{name}");
        }
    }
}
