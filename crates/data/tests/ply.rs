//! 3DGS PLY files: bit-exact round trips, the layout that viewers expect, errors by name.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use glam::Vec3;
use proptest::prelude::*;
use skinsplat_core::scene::{Avatar, Binding, FaceBinding, Gaussians, SkinWeights};
use skinsplat_data::ply::{self, Encoding, Metadata};
use std::path::Path;

fn finite() -> impl Strategy<Value = f32> {
    prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO
}

fn vec3() -> impl Strategy<Value = Vec3> {
    [finite(), finite(), finite()].prop_map(Vec3::from_array)
}

fn rotation() -> impl Strategy<Value = [f32; 4]> {
    [finite(), finite(), finite(), finite()].prop_filter("zero", |q| q.iter().any(|&v| v != 0.0))
}

fn weight_row() -> impl Strategy<Value = Vec<(usize, f32)>> {
    (1usize..6, 0usize..60).prop_map(|(n, first)| (0..n).map(|k| (first + k, 1.0 / n as f32)).collect())
}

fn gaussians(n: usize) -> impl Strategy<Value = Gaussians> {
    use prop::collection::vec;
    (0usize..4).prop_flat_map(move |sh_degree| {
        let sh = vec([finite(), finite(), finite()], n * (sh_degree + 1).pow(2));
        let scales = vec([-20f32..5.0, -20f32..5.0, -20f32..5.0].prop_map(Vec3::from_array), n);
        (vec(vec3(), n), vec(rotation(), n), scales, vec(finite(), n), sh).prop_map(
            move |(means, rotations, log_scales, opacity_logits, sh)| Gaussians {
                means,
                rotations,
                log_scales,
                opacity_logits,
                sh_degree,
                sh,
            },
        )
    })
}

fn binding(n: usize) -> impl Strategy<Value = Binding> {
    use prop::collection::vec;
    let vertex =
        vec(weight_row(), n).prop_map(|rows| Binding::Vertex(SkinWeights::from_rows(rows, 70).unwrap()));
    let barycentric = (-1f32..2.0, -1f32..2.0).prop_map(|(a, b)| [a, b, 1.0 - a - b]);
    let face = (vec(any::<u32>(), n), vec(barycentric, n), vec(finite(), n))
        .prop_map(|(faces, barycentric, offsets)| Binding::Face(FaceBinding { faces, barycentric, offsets }));
    prop_oneof![Just(Binding::Static), vertex, face]
}

fn avatar() -> impl Strategy<Value = Avatar> {
    (1usize..9).prop_flat_map(|n| {
        (gaussians(n), binding(n)).prop_map(|(gaussians, binding)| Avatar { gaussians, binding })
    })
}

/// Every float as its bits, so that -0 differs from 0.
fn bits(avatar: &Avatar) -> Vec<u32> {
    let g = &avatar.gaussians;
    let vectors = g.means.iter().chain(&g.log_scales).flat_map(|v| v.to_array());
    let rest = g.rotations.iter().flatten().chain(g.sh.iter().flatten()).chain(&g.opacity_logits).copied();
    vectors.chain(rest).map(f32::to_bits).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn writing_and_reading_gives_the_same_bits(avatar in avatar(), ascii in any::<bool>()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("avatar.ply");
        let encoding = if ascii { Encoding::Ascii } else { Encoding::LittleEndian };
        let metadata = Metadata { body: Some("body one.npz".into()), comments: vec!["two\nlines".into()] };
        ply::write_avatar(&path, &avatar, &metadata, encoding).unwrap();
        let stored = ply::read(&path).unwrap();
        prop_assert_eq!(&stored.avatar, &avatar);
        prop_assert_eq!(bits(&stored.avatar), bits(&avatar));
        prop_assert_eq!((stored.encoding, stored.body.as_deref()), (encoding, Some("body one.npz")));
        prop_assert_eq!(&stored.comments[2], "two lines");
        prop_assert!(stored.ignored.is_empty());
        let again = folder.path().join("again.ply");
        ply::write_avatar(&again, &stored.avatar, &metadata, encoding).unwrap();
        prop_assert_eq!(std::fs::read(&path).unwrap(), std::fs::read(&again).unwrap());
    }
}

fn one_gaussian(binding: Binding) -> Avatar {
    let gaussians = Gaussians {
        means: vec![Vec3::new(1.0, 2.0, 3.0)],
        rotations: vec![[0.5, -0.5, 0.5, 0.5]],
        log_scales: vec![Vec3::splat(-4.0)],
        opacity_logits: vec![0.25],
        sh_degree: 1,
        sh: vec![[0.1, 0.2, 0.3], [1.1, 1.2, 1.3], [2.1, 2.2, 2.3], [3.1, 3.2, 3.3]],
    };
    Avatar { gaussians, binding }
}

fn ascii(folder: &Path, avatar: &Avatar) -> String {
    let path = folder.join("ascii.ply");
    ply::write_avatar(&path, avatar, &Metadata::default(), Encoding::Ascii).unwrap();
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn the_file_is_laid_out_as_viewers_expect() {
    let folder = tempfile::tempdir().unwrap();
    let weights = SkinWeights::from_rows([[(3, 0.25), (1, 0.75)]], 4).unwrap();
    let text = ascii(folder.path(), &one_gaussian(Binding::Vertex(weights)));
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[..3], ["ply", "format ascii 1.0", "element vertex 1"]);
    let properties: Vec<&str> = lines.iter().filter_map(|l| l.strip_prefix("property ")).collect();
    let names: Vec<&str> = properties.iter().map(|p| p.split(' ').nth(1).unwrap()).collect();
    let expected = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 f_rest_0 f_rest_1 f_rest_2 f_rest_3 f_rest_4 f_rest_5 f_rest_6 \
                    f_rest_7 f_rest_8 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3 joint_0 joint_1 weight_0 \
                    weight_1";
    assert_eq!(names, expected.split_whitespace().collect::<Vec<_>>());
    // f_rest channel by channel: all R, all G, all B.
    let row = "1 2 3 0 0 0 0.1 0.2 0.3 1.1 2.1 3.1 1.2 2.2 3.2 1.3 2.3 3.3 0.25 -4 -4 -4 0.5 -0.5 0.5 0.5 3 1 0.25 0.75";
    assert_eq!(*lines.last().unwrap(), row);
}

#[test]
fn big_endian_doubles_unknown_properties_and_other_elements_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let avatar = one_gaussian(Binding::Static);
    let text = ascii(folder.path(), &avatar);
    let (header, row) = text.split_once("end_header\n").unwrap();
    let header = header
        .replace("format ascii", "format binary_big_endian")
        .replace("element vertex", "element camera 2\nproperty uchar id\nelement vertex")
        .replace("property float x", "property short label\r\nproperty double x")
        + "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let mut bytes = header.into_bytes();
    bytes.extend([7, 8]);
    bytes.extend(12i16.to_be_bytes());
    for (k, word) in row.split_whitespace().enumerate() {
        let value: f32 = word.parse().unwrap();
        match k {
            0 => bytes.extend(f64::from(value).to_be_bytes()),
            _ => bytes.extend(value.to_be_bytes()),
        }
    }
    let path = folder.path().join("big.ply");
    std::fs::write(&path, bytes).unwrap();
    let stored = ply::read(&path).unwrap();
    assert_eq!((stored.avatar, stored.encoding), (avatar, Encoding::BigEndian));
    assert_eq!(stored.ignored, ["label"]);
}

#[test]
fn what_is_wrong_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let weights = SkinWeights::from_rows([[(3, 0.25), (1, 0.75)]], 4).unwrap();
    let vertex = ascii(folder.path(), &one_gaussian(Binding::Vertex(weights)));
    let binding = FaceBinding { faces: vec![8], barycentric: vec![[0.2, 0.3, 0.5]], offsets: vec![0.01] };
    let face = ascii(folder.path(), &one_gaussian(Binding::Face(binding)));
    let cases = [
        (vertex.replace("ply\n", "plx\n"), "header"),
        (vertex.replace("format ascii 1.0\n", ""), "header"),
        (vertex.replace("format ascii", "format text"), "format"),
        (vertex.replace("end_header\n", ""), "header"),
        (vertex.replace("vertex 1", "vertex -1"), "element vertex"),
        (vertex.replace("vertex 1", "vertex 0"), "element vertex"),
        (vertex.replace("vertex 1", "vertex 2"), "element vertex"),
        (vertex.replace("vertex 1", "vertex 18446744073709551615"), "element vertex"),
        (vertex.replace("vertex 1", "splat 1"), "element vertex"),
        (vertex.replace("float opacity", "list uchar float opacity"), "element vertex"),
        (vertex.replace("float opacity", "float alpha"), "opacity"),
        (vertex.replace("float opacity", "float scale_0"), "scale_0"),
        (vertex.replace("float opacity", "half opacity"), "property half opacity"),
        (vertex.replace("f_rest_8", "f_more_8"), "f_rest"),
        (vertex.replace("f_rest_8", "f_rest_9"), "f_rest_8"),
        (vertex.replace("f_dc_1", "green"), "f_dc_1"),
        (vertex.replace("\n1 2 3 ", "\n1 NaN 3 "), "x, y, z[0]"),
        (vertex.replace("\n1 2 3 ", "\n1 two 3 "), "y[0]"),
        (vertex.replace(" 0.25 -4 ", " inf -4 "), "opacity[0]"),
        (vertex.replace(" -4 ", " 400 "), "scale[0]"),
        (vertex.replace(" 0.5 -0.5 0.5 0.5 ", " 0 0 0 0 "), "rot[0]"),
        (vertex.replace(" 3.3 ", " NaN "), "f_dc/f_rest[0]"),
        (vertex.replace(" 0.25 0.75", " 0.25 0.5"), "weights[0]"),
        (vertex.replace(" 0.25 0.75", " 0 0"), "weights[0]"),
        (vertex.replace(" 0.25 0.75", " -0.25 1.25"), "weights[0]"),
        (vertex.replace(" 3 1 0.25 ", " 65536 1 0.25 "), "joints[0]"),
        (vertex.replace(" 3 1 0.25 ", " 3 -1 0.25 "), "joint_1[0]"),
        (vertex.replace("weight_1", "mass_1"), "weight_*"),
        (face.replace(" 0.2 0.3 0.5 ", " 0.2 0.3 0.6 "), "barycentric[0]"),
        (face.replace(" 0.5 0.01", " 0.5 NaN"), "offset[0]"),
        (face.replace("float bary_2", "float bary_3"), "bary_2"),
        (face.replace("uint face", "float face").replace(" 8 0.2 ", " 8.5 0.2 "), "face[0]"),
    ];
    for (i, (text, field)) in cases.iter().enumerate() {
        assert!(*text != vertex && *text != face, "case {i} changes nothing");
        let path = folder.path().join(format!("case{i}.ply"));
        std::fs::write(&path, text).unwrap();
        let error = ply::read(&path).unwrap_err();
        assert_eq!((error.field(), error.path()), (*field, path.as_path()), "case {i}: {error}");
    }
}

#[test]
fn an_avatar_that_is_wrong_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("avatar.ply");
    let mut avatar = one_gaussian(Binding::Static);
    avatar.gaussians.opacity_logits[0] = f32::NAN;
    let error = ply::write_avatar(&path, &avatar, &Metadata::default(), Encoding::default()).unwrap_err();
    assert_eq!(error.field(), "opacity[0]");
    assert!(!path.exists());
}
