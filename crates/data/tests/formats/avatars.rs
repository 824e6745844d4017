//! Avatars as other programs wrote them (`tests/data/make/avatars.py`): plyfile, splat-transform, NumPy, torch.

use crate::support::data;
use glam::Vec3;
use skinsplat_core::scene::{Binding, Gaussians};
use skinsplat_data::avatar::{Canonical, Format, LoadedAvatar, read_avatar};
use skinsplat_data::npz::Archive;
use std::path::{Path, PathBuf};

fn file(name: &str) -> PathBuf {
    data("small/avatars").join(name)
}

fn read(name: &str) -> LoadedAvatar {
    read_avatar(&file(name)).unwrap_or_else(|e| panic!("{e}"))
}

/// The first Gaussians of `base.ply`.
fn base(n: usize) -> Gaussians {
    let mut g = read("base.ply").avatar.gaussians;
    g.means.truncate(n);
    g.rotations.truncate(n);
    g.log_scales.truncate(n);
    g.opacity_logits.truncate(n);
    g.sh.truncate(n * 4);
    g
}

/// The largest difference of any number; infinite ones must be equal.
fn distance(a: &Gaussians, b: &Gaussians) -> f32 {
    assert_eq!((a.len(), a.sh_degree), (b.len(), b.sh_degree));
    let flat = |g: &Gaussians| -> Vec<f32> {
        let vectors = g.means.iter().chain(&g.log_scales).flat_map(Vec3::to_array);
        let rest = g.rotations.iter().flatten().chain(g.sh.iter().flatten()).chain(&g.opacity_logits);
        vectors.chain(rest.copied()).collect()
    };
    let apart = |(a, b): (f32, f32)| if a == b { 0.0 } else { (a - b).abs() };
    flat(a).into_iter().zip(flat(b)).map(apart).fold(0.0, f32::max)
}

#[test]
fn every_spelling_of_a_ply_gives_the_same_bits() {
    let expected = read("six.ply").avatar;
    assert_eq!(expected.gaussians, base(6));
    for name in ["six_big_endian.ply", "six_ascii.ply", "six_double.ply"] {
        let loaded = read(name);
        assert_eq!((loaded.avatar, loaded.format), (expected.clone(), Format::Ply), "{name}");
    }
    assert_eq!(read("six_big_endian.ply").ignored, ["element face", "element zone"]);
    assert_eq!(read("six_ascii.ply").comments, ["von Hand"]);
}

/// Unpacked as splat-transform unpacks it, which has sorted the Gaussians.
#[test]
fn a_compressed_ply_is_what_splat_transform_makes_of_it() {
    let (packed, plain) = (read("base.compressed.ply"), read("base_decompressed.ply"));
    assert_eq!((packed.format, plain.format), (Format::CompressedPly, Format::Ply));
    let off = distance(&packed.avatar.gaussians, &plain.avatar.gaussians);
    assert!(off <= 1e-6, "{off}");
    assert!(packed.ignored.is_empty(), "{:?}", packed.ignored);
}

#[test]
fn infinite_logits_of_a_compressed_ply_are_opacities_of_0_and_1() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = std::fs::read(file("base.compressed.ply")).unwrap();
    let header = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let vertices = header + 2 * 18 * 4;
    (bytes[vertices + 12], bytes[vertices + 16 + 12]) = (255, 0);
    let path = folder.path().join("ends.ply");
    std::fs::write(&path, bytes).unwrap();
    let g = read_avatar(&path).unwrap().avatar.gaussians;
    assert_eq!(g.opacity_logits[..2], [f32::INFINITY, f32::NEG_INFINITY]);
    assert_eq!(g.opacities()[..2], [1.0, 0.0]);
}

#[test]
fn what_is_wrong_with_a_compressed_ply_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(file("base.compressed.ply")).unwrap();
    let header = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let (text, body) = (String::from_utf8(bytes[..header].to_vec()).unwrap(), &bytes[header..]);
    for (from, to, field) in [
        ("property float min_scale_x\n", "property float least\n", "min_scale_x"),
        ("property float max_g\n", "property float most\n", "max_g"),
        ("element chunk 2", "element chunk 1", "element chunk"),
        ("element chunk", "element lump", "element chunk"),
        ("uint packed_scale", "uint scale", "packed_scale"),
        ("uint packed_scale", "float packed_scale", "packed_*"),
        ("element sh 260", "element sh 259", "element sh"),
        ("uchar f_rest_8", "uchar f_more", "f_rest"),
    ] {
        let path = folder.path().join("broken.ply");
        assert!(text.contains(from), "{from}");
        std::fs::write(&path, [text.replace(from, to).as_bytes(), body].concat()).unwrap();
        let error = read_avatar(&path).unwrap_err();
        assert_eq!(error.field(), field, "{error}");
        assert!(field == "packed_*" || error.to_string().contains("SuperSplat compressed PLY"), "{error}");
    }
    for length in [header, header + 70, bytes.len() / 2, bytes.len() - 1] {
        let path = folder.path().join("cut.ply");
        std::fs::write(&path, &bytes[..length]).unwrap();
        assert!(read_avatar(&path).unwrap_err().field().starts_with("element "));
    }
}

#[test]
fn ihumans_values_are_recognised_and_its_colours_reordered() {
    let (activated, plain) = (read("ihuman.ply"), read("ihuman_plain.ply"));
    assert_eq!((activated.format, plain.format), (Format::IHumanPly, Format::Ply));
    let off = distance(&activated.avatar.gaussians, &plain.avatar.gaussians);
    assert!(off <= 2e-6, "{off}");
    assert!(activated.notes[0].contains("iHuman") && plain.notes.is_empty());
    // Nothing else is taken for it.
    for name in ["base.ply", "six.ply", "base_decompressed.ply"] {
        assert_eq!(read(name).format, Format::Ply, "{name}");
    }
}

#[test]
fn an_npz_of_gaussians_is_read_in_both_spellings() {
    let [linear, logs] = ["gaussians.npz", "gaussians_logs.npz"].map(read);
    for loaded in [&linear, &logs] {
        assert_eq!((loaded.format, &loaded.canonical), (Format::Npz, &Canonical::Rest));
        let off = distance(&loaded.avatar.gaussians, &base(40));
        assert!(off <= 1e-6, "{off}");
    }
    let [Binding::Vertex(dense), Binding::Vertex(sparse)] =
        [&linear, &logs].map(|loaded| &loaded.avatar.binding)
    else {
        panic!("no weights")
    };
    for i in 0..40 {
        let full = |(joints, weights): (&[u16], &[f32])| {
            let mut row = [0.0f32; 3];
            joints.iter().zip(weights).for_each(|(&j, &w)| row[usize::from(j)] = w);
            row
        };
        let apart = full(dense.row(i)).into_iter().zip(full(sparse.row(i))).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f32::max) < 0.5);
    }
    assert!(linear.notes.contains(&"an avatar of Someone et al.".to_owned()), "{:?}", linear.notes);
    assert_eq!(logs.ignored, ["features"]);
}

/// Archives that NumPy wrote, with one array left out or replaced by another.
#[test]
fn what_is_wrong_with_an_npz_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("broken.npz");
    let three = |values: &[f32]| (&[2u64, 3][..], values.to_vec());
    let base: Vec<(&str, &[u64], Vec<f32>)> = vec![
        ("means", &[2, 3], vec![0.0; 6]),
        ("quats", &[2, 4], vec![1.0; 8]),
        ("scales", &[2, 3], vec![0.01; 6]),
        ("opacities", &[2], vec![0.5; 2]),
        ("sh", &[2, 1, 3], vec![0.0; 6]),
        ("weights", &[2, 2], vec![0.5; 4]),
    ];
    type Case<'a> = (&'a str, Option<(&'a [u64], Vec<f32>)>, &'a str);
    let cases: Vec<Case<'_>> = vec![
        ("quats", None, "quats"),
        ("scales", None, "scales"),
        ("opacities", None, "opacities"),
        ("sh", None, "sh"),
        ("means", Some((&[0, 3], vec![])), "means"),
        ("means", Some((&[2, 2], vec![0.0; 4])), "means"),
        ("quats", Some((&[3, 4], vec![1.0; 12])), "quats"),
        ("quats", Some((&[2, 4], vec![0.0; 8])), "rot[0]"),
        ("scales", Some(three(&[0.1, 0.1, 0.1, 0.1, -0.1, 0.1])), "scales[1]"),
        ("scales", Some(three(&[0.1, f32::NAN, 0.1, 0.1, 0.1, 0.1])), "scales[0]"),
        ("opacities", Some((&[2], vec![0.5, 1.5])), "opacities[1]"),
        ("opacities", Some((&[2, 2], vec![0.5; 4])), "opacities"),
        ("sh", Some((&[2, 2, 3], vec![0.0; 12])), "sh"),
        ("weights", Some((&[2, 2], vec![0.5, 0.5, 0.5, 0.4])), "weights[1]"),
        ("log_scales", Some(three(&[0.0; 6])), "log_scales"),
        ("joint_indices", Some((&[2, 2], vec![0.0; 4])), ""),
        ("canonical_pose", Some((&[4], vec![0.0; 4])), "canonical_pose"),
        ("faces", Some((&[2], vec![0.0, 0.5])), "barycentric"),
    ];
    for (name, replaced, field) in cases {
        let mut arrays = base.clone();
        arrays.retain(|(own, ..)| *own != name);
        arrays.extend(replaced.map(|(shape, values)| (name, shape, values)));
        let arrays: Vec<_> =
            arrays.into_iter().map(|(name, shape, v)| (name, shape, crate::files::Values::F32(v))).collect();
        crate::files::npz(&path, &arrays);
        match read_avatar(&path) {
            Ok(_) => assert_eq!(field, "", "{name}"),
            Err(error) => assert_eq!(error.field(), field, "{name}: {error}"),
        }
    }
    let whole = std::fs::read(file("gaussians.npz")).unwrap();
    for length in [0, 1, 4, 100, whole.len() / 2, whole.len() - 1] {
        std::fs::write(&path, &whole[..length]).unwrap();
        let error = read_avatar(&path).unwrap_err().to_string();
        assert!(
            error.contains("broken.npz") && error.contains("expected") && error.lines().count() == 1,
            "{error}"
        );
    }
}

#[test]
fn formats_that_are_not_read_are_named_with_what_converts_them() {
    let folder = tempfile::tempdir().unwrap();
    let cases: [(&str, &[u8], &str, &str); 12] = [
        ("a.spz", b"\x1f\x8b\x08\0", ".spz", "splat-transform"),
        ("b.spz", b"NGSP\x04\0\0\0", ".spz", "splat-transform"),
        ("a.gz", b"\x1f\x8b\x08\0", "gzip", "the file inside"),
        ("a.splat", &[7; 64], ".splat", "splat-transform"),
        ("a.ksplat", &[0; 64], ".ksplat", "splat-transform"),
        ("meta.json", b"{\"version\": 2}", "SOG", "splat-transform"),
        ("a.pkl", b"\x80\x04\x95", "pickle", "npz"),
        ("a.glb", b"glTF\x02\0\0\0", "glTF", "--body"),
        ("a.h5", b"\x89HDF\r\n", "HDF5", "3DGS PLY"),
        ("a.safetensors", &[8, 0, 0, 0], ".safetensors", "savez"),
        ("a.bin", b"what is this", "unknown format", "3DGS PLY"),
        ("empty", b"", "an empty file", "3DGS PLY"),
    ];
    for (name, content, what, expected) in cases {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        let error = read_avatar(&path).unwrap_err();
        let text = error.to_string();
        assert!(text.contains(what) && text.contains(expected) && text.contains(name), "{text}");
        assert_eq!((error.field(), text.lines().count()), ("avatar", 1), "{text}");
    }
    let sog = folder.path().join("a.sog");
    crate::files::npz(&sog, &[("means", &[1], crate::files::Values::F32(vec![0.0]))]);
    assert!(read_avatar(&sog).unwrap_err().to_string().contains("a zip archive of something else"));
    let legacy = read_avatar(&file("legacy.pth")).unwrap_err().to_string();
    assert!(legacy.contains("torch file of the old form") && legacy.contains("torch.save"), "{legacy}");
}

#[test]
fn a_training_output_is_read_at_its_last_iteration() {
    let folder = tempfile::tempdir().unwrap();
    for (iteration, name) in [("7000", "six.ply"), ("30000", "ihuman_plain.ply")] {
        let place = folder.path().join(format!("point_cloud/iteration_{iteration}"));
        std::fs::create_dir_all(&place).unwrap();
        std::fs::copy(file(name), place.join("point_cloud.ply")).unwrap();
    }
    for path in [folder.path(), &folder.path().join("point_cloud")] {
        assert_eq!(read_avatar(path).unwrap().avatar.gaussians.len(), 30);
    }
}

#[test]
fn arrays_of_any_of_several_shapes() {
    let mut archive = Archive::open(Path::new(&file("gaussians.npz")), "avatar").unwrap();
    assert!(archive.any_of("opacities", &["N,1", "N"]).unwrap().is_some());
    assert!(archive.any_of("nothing", &["N"]).unwrap().is_none());
    assert_eq!(archive.any_of("sh", &["N", "N,3"]).unwrap_err().field(), "sh");
}

#[test]
fn torch_checkpoints_of_gaussians_are_read_whatever_their_names() {
    for name in ["capture.pth", "gsplat.pt", "splatfacto.ckpt"] {
        let loaded = read(name);
        assert_eq!((loaded.format, &loaded.avatar.binding), (Format::Checkpoint, &Binding::Static), "{name}");
        assert_eq!(loaded.avatar.gaussians, base(40), "{name}: every bit");
    }
    assert_eq!(read("splatfacto.ckpt").ignored, ["pipeline._model.lpips.half"]);
    let half = distance(&read("half.pth").avatar.gaussians, &base(40));
    assert!(half > 0.0 && half < 2e-3, "{half}");
}

#[test]
fn torch_files_that_cannot_be_read_say_why_and_run_nothing() {
    for (name, parts) in [
        ("foreign.pth", ["foreign.pth", "system, which is not read"]),
        ("networks.pth", ["networks", "experiments/exporters/hugs.py"]),
        ("expanded.pth", ["_xyz", "in a storage of 1"]),
    ] {
        let error = read_avatar(&file(name)).unwrap_err().to_string();
        assert!(parts.iter().all(|part| error.contains(part)) && error.lines().count() == 1, "{error}");
    }
    assert!(!Path::new("/tmp/skinsplat_was_here").exists());
}

#[test]
fn torch_files_that_break_off_or_are_damaged_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("broken.pth");
    for name in ["gsplat.pt", "haha.ckpt"] {
        let whole = std::fs::read(file(name)).unwrap();
        for length in [0, 4, 100, whole.len() / 2, whole.len() - 1] {
            std::fs::write(&path, &whole[..length]).unwrap();
            let error = read_avatar(&path).unwrap_err().to_string();
            assert!(error.contains("broken.pth") && error.contains("expected"), "{error}");
        }
        for at in (0..whole.len()).step_by(7) {
            let mut bytes = whole.clone();
            bytes[at] ^= 1 << (at % 8);
            std::fs::write(&path, bytes).unwrap();
            if let Err(error) = read_avatar(&path) {
                assert!(error.path() == path && error.to_string().lines().count() == 1, "{error}");
            }
        }
    }
}

#[test]
fn a_haha_checkpoint_keeps_its_faces_its_texture_and_its_shape() {
    let loaded = read("haha.ckpt");
    assert_eq!((loaded.format, &loaded.canonical), (Format::Haha, &Canonical::Faces));
    assert_eq!(loaded.betas.as_deref().map(<[f64]>::len), Some(2));
    let texture = loaded.texture.as_ref().unwrap();
    assert_eq!((texture.width(), texture.height()), (12, 16));
    let Binding::Face(binding) = &loaded.avatar.binding else { panic!("no faces") };
    assert_eq!(binding.faces.len(), 30);
    let left = |part: &str| loaded.ignored.iter().any(|name| name.contains(part));
    assert!(left("_body_pose_dict") && left("lpips") && left("_smplx_model"), "{:?}", loaded.ignored);
    assert_eq!(loaded.avatar.gaussians.sh_degree, 0);
}
