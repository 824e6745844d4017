//! 3DGS PLY files: bit-exact round trips, the layout that viewers expect, errors by name.
#![expect(clippy::unwrap_used, reason = "tests")]

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
        let scale = || prop_oneof![9 => -20f32..5.0, 1 => Just(f32::NEG_INFINITY)];
        let scales = vec([scale(), scale(), scale()].prop_map(Vec3::from_array), n);
        let infinite = prop_oneof![Just(f32::INFINITY), Just(f32::NEG_INFINITY)];
        let opacity = prop_oneof![9 => finite(), 1 => infinite];
        (vec(vec3(), n), vec(rotation(), n), scales, vec(opacity, n), sh).prop_map(
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
    assert_eq!(stored.ignored, ["label", "element camera", "element face"]);
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
        (vertex.replace(" 0.25 -4 ", " nan -4 "), "opacity[0]"),
        (vertex.replace(" -4 ", " inf "), "scale[0]"),
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
fn comments_are_free_text_and_names_are_not_read_as_text() {
    let folder = tempfile::tempdir().unwrap();
    let text = ascii(folder.path(), &one_gaussian(Binding::Static));
    let path = folder.path().join("gbk.ply");
    let write = |comment: &[u8]| {
        let (first, rest) = text.split_once('\n').unwrap();
        std::fs::write(&path, [first.as_bytes(), b"\ncomment ", comment, b"\n", rest.as_bytes()].concat())
            .unwrap();
    };
    write(b"\xc4\xe3\xba\xc3 D:/\xcd\xbc");
    let stored = ply::read(&path).unwrap();
    assert!(
        stored.comments[0].contains('\u{fffd}') && stored.comments[0].contains("D:/"),
        "{:?}",
        stored.comments
    );
    write("élan vital".as_bytes());
    assert_eq!(ply::read(&path).unwrap().comments[0], "élan vital");
    std::fs::write(
        &path,
        b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float \xff\xfe\x1b[31m\nend_header\n1\n",
    )
    .unwrap();
    assert_eq!(ply::read(&path).unwrap_err().field(), "x");
}

/// A header is at most a megabyte, and its reader's time grows with it.
#[test]
fn long_headers_are_refused_in_no_time() {
    let folder = tempfile::tempdir().unwrap();
    let start = std::time::Instant::now();
    let properties: String = (0..45_000).map(|k| format!("property float f_rest_{k}\n")).collect();
    let elements: String = (0..45_000).map(|k| format!("element e{k} 0\n")).collect();
    let comments = "comment x\n".repeat(200_000);
    let cases = [
        (format!("element vertex 1\n{properties}"), "element vertex"),
        (elements, "header"),
        (comments, "header"),
        (format!("element vertex 1\nproperty list uchar {}int x\n", "int ".repeat(100_000)), "header"),
    ];
    for (lines, field) in cases {
        let path = folder.path().join("long.ply");
        std::fs::write(&path, format!("ply\nformat ascii 1.0\n{lines}end_header\n")).unwrap();
        let error = ply::read(&path).unwrap_err();
        assert_eq!(error.field(), field, "{error}");
        assert!(error.to_string().len() < 400, "{error}");
    }
    assert!(start.elapsed().as_secs_f64() < 2.0, "{:?}", start.elapsed());
}

/// Lists before the vertices are walked over, and the walk ends with the file.
#[test]
fn lists_that_claim_more_than_the_file_holds_are_truncated_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lists.ply");
    let header = |rows: u64| {
        format!(
            "ply\nformat binary_little_endian 1.0\nelement face {rows}\nproperty list int int v\n\
             element vertex 1\nproperty float x\nend_header\n"
        )
    };
    for (rows, body) in [(1, &[0xff, 0xff, 0xff, 0x7f][..]), (u64::MAX, &[0; 8]), (2, &[0, 0, 0, 0, 1, 0])] {
        std::fs::write(&path, [header(rows).as_bytes(), body].concat()).unwrap();
        let error = ply::read(&path).unwrap_err();
        assert_eq!(error.field(), "element face", "{error}");
    }
    std::fs::write(&path, [header(1).as_bytes(), &[0xff; 4], &[0; 4]].concat()).unwrap();
    assert_eq!(ply::read(&path).unwrap_err().field(), "y", "a negative count holds nothing");
}

#[test]
fn weights_that_nearly_sum_to_one_are_divided_by_their_sum() {
    let folder = tempfile::tempdir().unwrap();
    let weights = SkinWeights::from_rows([[(3, 0.25), (1, 0.75)]], 4).unwrap();
    let text = ascii(folder.path(), &one_gaussian(Binding::Vertex(weights)));
    let path = folder.path().join("sum.ply");
    std::fs::write(&path, text.replace(" 0.25 0.75", " 0.24 0.74")).unwrap();
    let stored = ply::read(&path).unwrap();
    let Binding::Vertex(weights) = &stored.avatar.binding else { panic!() };
    let (joints, weights) = weights.row(0);
    assert_eq!(joints, [3, 1]);
    assert!(
        (weights[0] - 0.24 / 0.98).abs() < 1e-6 && (weights[1] - 0.74 / 0.98).abs() < 1e-6,
        "{weights:?}"
    );
    assert!(stored.notes[0].contains("1 of 1 rows summed to 0.98"), "{:?}", stored.notes);
}

#[test]
fn two_scales_are_a_disc_and_comments_name_the_rasterizer() {
    let folder = tempfile::tempdir().unwrap();
    let text = ascii(folder.path(), &one_gaussian(Binding::Static));
    let path = folder.path().join("2dgs.ply");
    let text = text.replace("property float scale_2\n", "").replace("0.25 -4 -4 -4 ", "0.25 -4 -4 ");
    std::fs::write(&path, text.replace("end_header", "comment SplatRenderMode: mip\nend_header")).unwrap();
    let stored = ply::read(&path).unwrap();
    assert_eq!(stored.avatar.gaussians.log_scales[0], Vec3::new(-4.0, -4.0, f32::NEG_INFINITY));
    assert_eq!(stored.notes.len(), 2, "{:?}", stored.notes);
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
