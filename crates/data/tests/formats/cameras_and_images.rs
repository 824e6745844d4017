//! Cameras, images and masks.

use crate::files::{self, Values};
use crate::support::png::encode;
use skinsplat_core::scene::{Image, Mask};
use skinsplat_data::{camera, frames, npy};
use std::path::{Path, PathBuf};

const CAMERA: &str = r#"{
  "convention": "OpenCV", "width": 640, "height": 480, "fx": 700.5, "fy": 701.5, "cx": 320.25, "cy": 239.75,
  "world_to_camera": [[1, 0, 0, 0.5], [0, -1, 0, 1.5], [0, 0, -1, 3], [0, 0, 0, 1]], "background": [0.1, 0.2, 0.3]
}"#;

const LISTED: &str = r#"{ "cameras": [{ "id": 0, "width": 8, "height": 6, "K": [[9, 0, 4], [0, 9, 3], [0, 0, 1]],
  "w2c": [[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]] }] }"#;
const TRAINED: &str = r#"[{ "id": 0, "img_name": "0001", "width": 64, "height": 48, "fx": 60, "fy": 60,
  "position": [0, 0, -3], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]] }]"#;
const NERF: &str = r#"{ "w": 64, "h": 48, "fl_x": 60, "frames": [{ "file_path": "a.png",
  "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]] }] }"#;

fn text(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn a_camera_is_read_from_json_and_npz_alike() {
    let folder = tempfile::tempdir().unwrap();
    let view = camera::load_views(&text(folder.path(), "camera.json", CAMERA)).unwrap().remove(0);
    assert_eq!(view.background, Some([0.1, 0.2, 0.3]));
    let camera = &view.camera;
    assert_eq!((camera.width, camera.height, camera.fx, camera.cy), (640, 480, 700.5, 239.75));
    let (pixel, depth) = camera.project(glam::DVec3::ZERO).unwrap();
    assert_eq!((pixel.x, pixel.y, depth), (700.5 * 0.5 / 3.0 + 320.25, 701.5 * 1.5 / 3.0 + 239.75, 3.0));

    let k = vec![700.5, 0., 320.25, 0., 701.5, 239.75, 0., 0., 1.];
    let w2c = vec![1., 0., 0., 0.5, 0., -1., 0., 1.5, 0., 0., -1., 3., 0., 0., 0., 1.];
    let path = folder.path().join("cameras.npz");
    let size = || [("width", &[][..], Values::I64(vec![640])), ("height", &[1][..], Values::I64(vec![480]))];
    let [width, height] = size();
    let single: [(&str, &[u64], Values); 2] =
        [("intrinsic", &[3, 3], Values::F64(k.clone())), ("extrinsic", &[4, 4], Values::F64(w2c.clone()))];
    let [intrinsic, extrinsic] = single;
    files::npz(&path, &[intrinsic, extrinsic, width, height]);
    assert_eq!(camera::load(&path).unwrap(), std::slice::from_ref(camera));
    let [width, height] = size();
    let twice = |v: &[f64]| Values::F64([v, v].concat());
    files::npz(&path, &[("K", &[2, 3, 3], twice(&k)), ("w2c", &[2, 4, 4], twice(&w2c)), width, height]);
    assert_eq!(camera::load(&path).unwrap(), [camera.clone(), camera.clone()]);
}

#[test]
fn what_is_wrong_with_a_camera_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        (CAMERA.replace("700.5", "0"), "fx"),
        (CAMERA.replace("701.5", "-1"), "fy"),
        (CAMERA.replace("320.25", "1e400"), "camera"),
        (CAMERA.replace("\"width\": 640", "\"width\": 0"), "width"),
        (CAMERA.replace("\"width\": 640", "\"width\": 4000000000"), "width"),
        (CAMERA.replace("\"width\": 640", "\"width\": 32768"), "width"),
        (CAMERA.replace("640", "16384").replace("480", "16384"), "size"),
        (CAMERA.replace("\"width\": 640, ", ""), "width"),
        (CAMERA.replace("640", "\"wide\""), "width"),
        (CAMERA.replace("[0.1, 0.2, 0.3]", "[1, 1]"), "background"),
        (CAMERA.replace("[1, 0, 0, 0.5]", "[3, 0, 0, 0.5]"), "world_to_camera"),
        (CAMERA.replace("[1, 0, 0, 0.5]", "[-1, 0, 0, 0.5]"), "world_to_camera"),
        (CAMERA.replace("[1, 0, 0, 0.5]", "[1, 0.02, 0, 0.5]"), "world_to_camera"),
        (CAMERA.replace("[0, 0, -1, 3]", "[0, 0, 0, 3]"), "world_to_camera"),
        (CAMERA.replace("[0, 0, 0, 1]", "[0, 0, 1, 1]"), "world_to_camera"),
        (CAMERA.replace("[0, 0, -1, 3]", "[0, 0, -1]"), "world_to_camera"),
        (CAMERA.replace('}', ""), "camera"),
        ("[]".to_owned(), "camera"),
        ("3".to_owned(), "camera"),
        (r#"[{"a": 1}]"#.to_owned(), "camera"),
        (format!(r#"{{"cameras": {{"a": {CAMERA}}}}}"#), "cameras"),
        (format!(r#"{{"cameras": [{CAMERA}]}}"#), "cameras[0].id"),
        (LISTED.replace("[1, 0, 0, 0.5]", "[2, 0, 0, 0.5]"), "cameras[0].w2c"),
        (LISTED.replace("[9, 0, 4]", "[9, 1, 4]"), "cameras[0].K"),
        (TRAINED.replace("\"fx\": 60, ", ""), "cameras[0].fx"),
        (TRAINED.replace("\"rotation\"", "\"turn\""), "cameras[0].rotation"),
        (TRAINED.replace("[1, 0, 0]", "[5, 0, 0]"), "cameras[0].rotation"),
        (NERF.replace("[1, 0, 0, 0]", "[7, 0, 0, 0]"), "frames[0].transform_matrix"),
        (NERF.replace("frames", "pictures"), "frames"),
    ];
    for (json, field) in cases {
        let path = text(folder.path(), "camera.json", &json);
        let error = camera::load(&path).unwrap_err();
        assert_eq!((error.field(), error.path()), (field, path.as_path()), "{error}");
        let line = error.to_string().replace(path.to_str().unwrap(), "");
        assert!(line.lines().count() == 1 && line.contains("; expected "), "{line}");
        assert!(!["u32", "f64", "struct", "map"].iter().any(|word| line.contains(word)), "{line}");
    }
    let scaled =
        CAMERA.replace("[1,", "[2,").replace("0, -1, 0, 1.5", "0, -2, 0, 1.5").replace("-1, 3]", "-2, 3]");
    let error = camera::load(&text(folder.path(), "camera.json", &scaled)).unwrap_err().to_string();
    assert!(error.contains("a rotation times 2.0000: of a world in other units"), "{error}");
    for good in [LISTED, TRAINED, NERF, &CAMERA.replace("[1, 0, 0, 0.5]", "[1, 0.002, 0, 0.5]")] {
        camera::load(&text(folder.path(), "camera.json", good)).unwrap();
    }
    let k = Values::F64(vec![700., 2., 320., 0., 700., 240., 0., 0., 1.]);
    let mut w2c = vec![0.0; 16];
    [0, 5, 10, 15].iter().for_each(|&i| w2c[i] = 1.0);
    let path = folder.path().join("cameras.npz");
    let side = || Values::I64(vec![64]);
    files::npz(
        &path,
        &[
            ("K", &[3, 3], k),
            ("w2c", &[4, 4], Values::F64(w2c)),
            ("width", &[], side()),
            ("height", &[], side()),
        ],
    );
    assert_eq!(camera::load(&path).unwrap_err().field(), "K");
    let flat = |matrix: &[f64]| Values::F64(matrix.to_vec());
    let k = [700., 0., 320., 0., 700., 240., 0., 0., 1.];
    let mut mirrored = [0.0; 16];
    [0, 5, 10, 15].iter().for_each(|&i| mirrored[i] = if i == 0 { -1.0 } else { 1.0 });
    let sides = [("width", &[][..], side()), ("height", &[][..], side())];
    let [width, height] = sides;
    files::npz(&path, &[("K", &[3, 3], flat(&k)), ("w2c", &[4, 4], flat(&mirrored)), width, height]);
    let error = camera::load(&path).unwrap_err();
    assert!(error.field() == "w2c" && error.to_string().contains("a mirror image"), "{error}");
}

#[test]
fn what_a_camera_leaves_out_or_guesses_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let note = |json: &str| {
        camera::load_views(&text(folder.path(), "camera.json", json))
            .unwrap()
            .remove(0)
            .note
            .unwrap_or_default()
    };
    let guesses = ["no fl_y", "no cx", "no cy"];
    assert!(guesses.iter().all(|guess| note(NERF).contains(guess)), "{}", note(NERF));
    let complete = NERF.replace("\"w\": 64", "\"fl_y\": 60, \"cx\": 32, \"cy\": 24, \"w\": 64");
    assert_eq!(note(&complete), "");
    let path = folder.path().join("cameras.npz");
    let identity =
        |n: usize| Values::F64((0..n * n).map(|i| f64::from(u8::from(i % (n + 1) == 0))).collect());
    let side = || Values::I64(vec![64]);
    let fields = [
        ("K", &[3, 3][..], identity(3)),
        ("w2c", &[4, 4], identity(4)),
        ("width", &[], side()),
        ("height", &[], side()),
        ("dist", &[5], Values::F64(vec![0.1; 5])),
    ];
    files::npz(&path, &fields);
    let views = camera::load_views(&path).unwrap();
    assert_eq!(views[0].note.as_deref(), Some("not read: dist"));
}

/// How the one row of a PNG is stored.
#[derive(Clone, Copy)]
struct Colour {
    bit_depth: u8,
    colour_type: u8,
    palette: &'static [u8],
}

fn png(folder: &Path, name: &str, colour: Colour, width: usize, data: &[u8]) -> PathBuf {
    let Colour { bit_depth, colour_type, palette } = colour;
    let palette: &[(&[u8; 4], &[u8])] = if palette.is_empty() { &[] } else { &[(b"PLTE", palette)] };
    let path = folder.join(name);
    std::fs::write(&path, encode((width, 1), bit_depth, colour_type, palette, data)).unwrap();
    path
}

#[test]
fn every_kind_of_png_is_read_as_straight_values() {
    let folder = tempfile::tempdir().unwrap();
    let kind = |bit_depth, colour_type| Colour { bit_depth, colour_type, palette: &[] };
    let load = |path: PathBuf| {
        let (image, alpha) = frames::load_image(&path).unwrap();
        (image.pixels().to_vec(), alpha.map(|a| a.values().to_vec()))
    };
    let of = |v: f32| v / 255.0;
    let rgba = png(folder.path(), "rgba.png", kind(8, 6), 2, &[10, 20, 30, 0, 255, 1, 2, 128]);
    let straight = vec![[of(10.), of(20.), of(30.)], [1.0, of(1.), of(2.)]];
    assert_eq!(load(rgba), (straight, Some(vec![0.0, of(128.)])), "colour is not multiplied by alpha");
    let rgb = png(folder.path(), "rgb.png", kind(8, 2), 1, &[51, 102, 204]);
    assert_eq!(load(rgb), (vec![[of(51.), of(102.), of(204.)]], None));
    let rgb16 = png(folder.path(), "rgb16.png", kind(16, 2), 1, &[0x12, 0x34, 0, 1, 0xFF, 0xFF]);
    assert_eq!(load(rgb16), (vec![[f32::from(0x1234u16) / 65535.0, 1.0 / 65535.0, 1.0]], None));
    let grey = png(folder.path(), "grey.png", kind(8, 0), 2, &[7, 8]);
    assert_eq!(load(grey.clone()), (vec![[of(7.); 3], [of(8.); 3]], None));
    assert_eq!(frames::load_mask(&grey).unwrap_err().field(), "mask", "8 of 255 is a label");
    let mask = png(folder.path(), "mask.png", kind(8, 0), 2, &[7, 80]);
    assert_eq!(frames::load_mask(&mask).unwrap().values(), [of(7.), of(80.)]);
    let bits = png(folder.path(), "bits.png", kind(1, 0), 8, &[0b1010_0000]);
    assert_eq!(frames::load_mask(&bits).unwrap().values(), [1., 0., 1., 0., 0., 0., 0., 0.]);
    let grey_alpha = png(folder.path(), "grey_alpha.png", kind(8, 4), 1, &[9, 128]);
    assert_eq!(load(grey_alpha), (vec![[of(9.); 3]], Some(vec![of(128.)])));
    let palette = Colour { bit_depth: 8, colour_type: 3, palette: &[1, 2, 3, 40, 50, 60] };
    let palette = png(folder.path(), "palette.png", palette, 2, &[1, 0]);
    assert_eq!(load(palette.clone()).0, [[of(40.), of(50.), of(60.)], [of(1.), of(2.), of(3.)]]);
    assert_eq!(frames::load_mask(&palette).unwrap_err().field(), "pixel (0, 0)");
}

#[test]
fn masks_are_read_from_arrays() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mask.npy");
    npy::write_f32(&path, &[1, 2], [0.0, 255.0]).unwrap();
    assert_eq!(frames::load_mask(&path).unwrap().values(), [0.0, 1.0]);
    npy::write_f32(&path, &[1, 2], [0.0, 1.0]).unwrap();
    assert_eq!(frames::load_mask(&path).unwrap().values(), [0.0, 1.0]);
    npy::write_f32(&path, &[1, 2, 3], [0.0; 6]).unwrap();
    assert_eq!(frames::load_mask(&path).unwrap_err().field(), "array");
    npy::write_f32(&path, &[1, 2], [0.0, f32::NAN]).unwrap();
    assert_eq!(frames::load_mask(&path).unwrap_err().field(), "value 1");
}

#[test]
fn images_are_written_rounded_to_8_bits_or_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let pixels = vec![[0.5, -1.0, 2.0], [1.49 / 255.0, 1.51 / 255.0, f32::NAN]];
    let image = Image::new(2, 1, pixels).unwrap();
    let png = folder.path().join("image.png");
    frames::save_png(&png, &image).unwrap();
    let expected = vec![[128.0, 0.0, 255.0].map(|v: f32| v / 255.0), [1.0, 2.0, 0.0].map(|v: f32| v / 255.0)];
    assert_eq!(frames::load_image(&png).unwrap().0.pixels(), expected);
    let alpha = Mask::new(2, 1, vec![0.0, 0.25]).unwrap();
    frames::save_png_with_alpha(&png, &image, &alpha).unwrap();
    let (read, read_alpha) = frames::load_image(&png).unwrap();
    assert_eq!((read.pixels(), read_alpha.unwrap().values()), (&expected[..], &[0.0, 64.0 / 255.0][..]));
    frames::save_mask_png(&png, &alpha).unwrap();
    assert_eq!(frames::load_mask(&png).unwrap().values(), [0.0, 64.0 / 255.0]);
    assert_eq!(
        frames::save_png_with_alpha(&png, &image, &Mask::filled(1, 1, 0.0)).unwrap_err().field(),
        "alpha"
    );

    let finite = Image::new(2, 1, vec![[0.1, -0.25, 7.25], [0.2, 1e-40, 0.3]]).unwrap();
    let npy = folder.path().join("image.npy");
    frames::save_npy(&npy, &finite).unwrap();
    assert_eq!(frames::load_image(&npy).unwrap(), (finite, None));
}

/// Black, 16,384 pixels a side, in a quarter of a megabyte: within what deflate reaches, and refused by its header.
#[test]
fn an_image_of_more_pixels_than_the_limit_is_refused_before_it_is_decoded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bomb.png");
    std::fs::write(&path, encode((16_384, 16_384), 8, 0, &[], &[0; 16_384])).unwrap();
    // The limit speaks before the data that are missing could.
    let error = frames::load_image(&path).unwrap_err().to_string();
    assert!(error.contains("image: size: 16384x16384 pixels; expected at most 67108864 pixels"), "{error}");
}

#[test]
fn bad_images_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let good = crate::support::data("blender/datasets/snapshot_ava/test_twist/images/image_0000.png");
    let bytes = std::fs::read(good).unwrap();
    let path = folder.path().join("image.png");
    // A header that claims 30000 x 30000 pixels, with its checksum.
    let mut huge = Vec::new();
    huge.extend(30000u32.to_be_bytes());
    huge.extend(30000u32.to_be_bytes());
    for (case, content) in [
        ("truncated", bytes[..bytes.len() / 2].to_vec()),
        ("empty", Vec::new()),
        ("text", b"not an image".to_vec()),
        ("gif", b"GIF89a\x01\x00\x01\x00\x00\x00\x00;".to_vec()),
        ("damaged size", [&bytes[..16], &huge, &bytes[24..]].concat()),
    ] {
        std::fs::write(&path, content).unwrap();
        let error = frames::load_image(&path).unwrap_err();
        assert_eq!((error.field(), error.path()), ("image", path.as_path()), "{case}: {error}");
    }
    let missing = frames::load_image(&folder.path().join("missing.png")).unwrap_err();
    assert!(missing.to_string().contains("missing.png: image: cannot read"), "{missing}");
}
