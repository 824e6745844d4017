//! Avatars that SplattingAvatar exports.

use glam::Vec3;
use skinsplat_core::scene::{Avatar, Binding, Gaussians};
use skinsplat_data::avatar::{Canonical, Format, file_digest, mesh_beside, read_avatar};
use skinsplat_data::ply::{self, Encoding, Metadata};
use skinsplat_data::splatting_avatar;
use std::path::Path;

const EMBEDDING: &str = r#"{"cano_mesh": "embedding.obj", "sample_fidxs": [1, 0],
  "sample_bary": [[0.5, 0.25, 0.25], [1, 0, 0]], "_xyz": [[0, 0, 0.5], [9, 9, -0.25]],
  "_rotation": [[1, 0, 0, 0], [0.5, 0.5, 0.5, 0.5]]}"#;
/// Two triangles of the plane y = 2, facing up, in three spellings of a corner.
const MESH: &str =
    "# mesh\nv 0 2 0\nv 0 2 4\nv 4 2 0\nv 4 2 4\nvt 0 0\nvn 0 1 0\nf 1/1 2/1 3/1\nf 2//1 4/1/1 3\n";

fn export(folder: &Path, embedding: &str, mesh: &str) -> std::path::PathBuf {
    let gaussians = Gaussians {
        means: vec![Vec3::splat(7.0); 2],
        rotations: vec![[0.0, 1.0, 0.0, 0.0]; 2],
        log_scales: vec![Vec3::splat(-3.0); 2],
        opacity_logits: vec![1.0, 2.0],
        sh_degree: 0,
        sh: vec![[0.1, 0.2, 0.3]; 2],
    };
    let path = folder.join("point_cloud.ply");
    let avatar = Avatar { gaussians, binding: Binding::Static };
    ply::write_avatar(&path, &avatar, &Metadata::default(), Encoding::LittleEndian).unwrap();
    std::fs::write(folder.join("embedding.json"), embedding).unwrap();
    std::fs::write(folder.join("embedding.obj"), mesh).unwrap();
    path
}

#[test]
fn geometry_comes_from_the_embedding_and_appearance_from_the_ply() {
    let folder = tempfile::tempdir().unwrap();
    let exported = splatting_avatar::load(&export(folder.path(), EMBEDDING, MESH)).unwrap();
    let g = &exported.avatar.gaussians;
    assert_eq!(g.means, [Vec3::new(2.0, 2.5, 3.0), Vec3::new(0.0, 1.75, 0.0)]);
    assert_eq!(g.rotations, [[1.0, 0.0, 0.0, 0.0], [0.5; 4]]);
    assert_eq!(g.opacity_logits, [1.0, 2.0]);
    assert_eq!(exported.faces, [[0, 1, 2], [1, 3, 2]]);
    let Binding::Face(binding) = &exported.avatar.binding else { panic!() };
    assert_eq!((&binding.faces[..], &binding.offsets[..]), (&[1, 0][..], &[0.5, -0.25][..]));
}

/// Names as other machines and later versions write them.
#[test]
fn the_mesh_is_found_by_a_relative_name_an_absolute_one_and_a_later_key() {
    let folder = tempfile::tempdir().unwrap();
    let path = export(folder.path(), EMBEDDING, MESH);
    let expected = splatting_avatar::load(&path).unwrap();
    std::fs::create_dir(folder.path().join("mesh")).unwrap();
    std::fs::write(folder.path().join("mesh/cano.obj"), MESH).unwrap();
    let renamed = EMBEDDING.replace("cano_mesh", "mesh_fn").replace("sample_bary", "_sample_bary");
    for (name, file) in [
        ("mesh/cano.obj", "mesh/cano.obj"),
        ("/home/neil/avatars/embedding.obj", "embedding.obj"),
        ("D:\\\\runs\\\\embedding.obj", "embedding.obj"),
        ("../../embedding.obj", "embedding.obj"),
    ] {
        for text in [EMBEDDING, &renamed] {
            let path = export(folder.path(), &text.replace("embedding.obj", name), MESH);
            let loaded = splatting_avatar::load(&path).unwrap();
            assert_eq!(loaded.avatar, expected.avatar, "{name}");
            assert_eq!(loaded.files[2], folder.path().join(file), "{name}");
        }
    }
}

#[test]
fn what_is_wrong_with_an_export_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        (EMBEDDING.replace("[1, 0],", "[1, 2],"), MESH.into(), "sample_fidxs[1]"),
        (EMBEDDING.replace("[1, 0],", "[1],"), MESH.into(), "sample_fidxs"),
        (EMBEDDING.replace("0.5, 0.25, 0.25", "0.5, 0.25, 0.5"), MESH.into(), "barycentric[0]"),
        (EMBEDDING.replace("[1, 0, 0, 0]", "[0, 0, 0, 0]"), MESH.into(), "rot[0]"),
        (EMBEDDING.replace("sample_bary", "bary"), MESH.into(), "embedding"),
        (EMBEDDING.replace("embedding.obj", "other.obj"), MESH.into(), "cano_mesh"),
        (EMBEDDING.into(), MESH.replace("f 1/1", "f 5/1"), "face 0"),
        (EMBEDDING.into(), MESH.replace("f 1/1", "f 0/1"), "line 8"),
        (EMBEDDING.into(), MESH.replace("2//1 4/1/1 3", "1 2 3 4"), "line 9"),
        (EMBEDDING.into(), MESH.replace("v 0 2 0", "v 0 2 nan"), "line 2"),
    ];
    for (embedding, mesh, field) in cases {
        let mesh: String = mesh;
        let error = splatting_avatar::load(&export(folder.path(), &embedding, &mesh)).unwrap_err();
        assert_eq!(error.field(), field, "{error}");
    }
}

#[test]
fn formats_are_told_apart_by_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let path = export(folder.path(), EMBEDDING, MESH);
    for place in [folder.path(), &path] {
        let loaded = read_avatar(place).unwrap();
        assert_eq!(
            (loaded.format, loaded.is_bound(), loaded.files.len()),
            (Format::SplattingAvatar, true, 3)
        );
        assert!(matches!(loaded.canonical, Canonical::Mesh(_)) && loaded.notes.len() == 1);
    }
    let exported = read_avatar(&path).unwrap().digest().unwrap();
    std::fs::remove_file(folder.path().join("embedding.json")).unwrap();
    let plain = read_avatar(folder.path()).unwrap();
    assert_eq!((plain.format, plain.is_bound(), &plain.files[..]), (Format::Ply, false, &[path.clone()][..]));
    assert_eq!(plain.digest().unwrap(), file_digest(&path).unwrap(), "that of the one file");
    assert_ne!(plain.digest().unwrap(), exported);
    for part in mesh_beside(&path) {
        std::fs::write(part, "x").unwrap();
    }
    assert_eq!(read_avatar(&path).unwrap().files.len(), 3, "the mesh of a hybrid belongs to it");
    let error = read_avatar(tempfile::tempdir().unwrap().path()).unwrap_err().to_string();
    assert!(error.contains("point_cloud.ply") && error.lines().count() == 1, "{error}");
}
