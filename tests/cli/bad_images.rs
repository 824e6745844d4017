//! Images that are wrong.

use crate::args;
use crate::files::{Values, npz};
use crate::program::Desk;
use crate::support::{data, fixture};

const GOOD: &str = "metrics/png/rocket_67x53_noise_a.png";

/// The chunk of a PNG: length, type, content, CRC.
fn chunk(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let mut crc = u32::MAX;
    for &byte in kind.iter().chain(content) {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { 0xEDB8_8320 ^ (crc >> 1) } else { crc >> 1 };
        }
    }
    let length = (content.len() as u32).to_be_bytes();
    [&length[..], kind, content, &(!crc).to_be_bytes()].concat()
}

#[test]
fn images_that_are_wrong() {
    let desk = Desk::new();
    let good = std::fs::read(fixture(GOOD)).unwrap();
    let mut flipped = good.clone();
    flipped[good.len() / 2] ^= 0xFF;
    let mut claim = b"\x89PNG\r\n\x1a\n".to_vec();
    let size = 65_000_u32.to_be_bytes();
    claim.extend(chunk(b"IHDR", &[&size[..], &size[..], &[8, 6, 0, 0, 0]].concat()));
    claim.extend(chunk(b"IDAT", &[0x78, 0x9c, 1]));
    let cuts = [1, 20, 40, good.len() / 2, good.len() - 20].map(|n| (good[..n].to_vec(), "cut off"));
    let others = [
        (Vec::new(), "empty"),
        (b"GIF89a".to_vec(), "another format"),
        (flipped, "a flipped byte"),
        (claim, "65,000 pixels a side"),
    ];
    for (content, what) in cuts.into_iter().chain(others) {
        desk.put("bad.png", &content);
        let before = desk.contents();
        desk.run(args!["score", "bad.png", fixture(GOOD)]).refuses(&["bad.png", "expected"], what);
        desk.run(args!["score", fixture(GOOD), "bad.png"]).refuses(&["bad.png", "expected"], what);
        desk.run(args!["score", fixture(GOOD), fixture(GOOD), "--mask", "bad.png"])
            .refuses(&["bad.png"], what);
        desk.run(args!["inspect", "bad.png"]).refuses(&["bad.png", "expected"], what);
        assert!(desk.contents() == before, "{what}: files changed");
    }
}

#[test]
fn images_that_do_not_go_together() {
    let desk = Desk::new();
    let good = fixture(GOOD);
    let other = fixture("metrics/png/tiny_11x11_a.png");
    let sizes = ["rocket_67x53_noise_a.png", "tiny_11x11_a.png", "67x53", "11x11"];
    desk.run(args!["score", good, other]).refuses(&sizes, "sizes");
    let mask = skinsplat_core::scene::Mask::new(11, 11, vec![1.0; 121]).unwrap();
    skinsplat_data::frames::save_mask_png(&desk.path("mask.png"), &mask).unwrap();
    desk.run(args!["score", good, good, "--mask", "mask.png"]).refuses(&["67x53", "11x11"], "mask's size");
    desk.run(args!["score", good, good, "--mask", good])
        .refuses(&["rocket_67x53", "grey mask"], "a colour mask");
    desk.run(args!["score", good, "nothing.png"]).refuses(&["nothing.png", "No such file"], "missing truth");
    desk.run(args!["score", "nothing.png", good]).refuses(&["nothing.png", "No such file"], "missing render");
    desk.run(args!["score", "nothing", data("blender")]).refuses(&["nothing"], "missing folder");
    desk.run(args!["score", good, fixture("metrics/png")]).refuses(&["rocket_67x53"], "file and folder");
    desk.run(args!["score", fixture("metrics/png"), good]).refuses(&["expected a folder"], "folder and file");
    desk.run(args!["score", data("blender"), data("blender")])
        .refuses(&["blender", "no frames"], "no images");
    desk.run(args!["score", good, good, "--protocol", "mine"]).refuses(&["mine", "avatar-v1"], "protocol");
    desk.run(args!["score", good, good, "--protocol", "3dgs+ssim=best"]).refuses(&["best"], "variant");
    desk.run(args!["score", good, good, "--background", "1,1"]).refuses(&["--background", "R,G,B"], "colour");
}

#[test]
fn arrays_that_are_no_images() {
    let desk = Desk::new();
    let write = |shape: &[usize], values: Vec<f32>| {
        skinsplat_data::npy::write_f32(&desk.path("bad.npy"), shape, values).unwrap();
    };
    let inspect = |parts: &[&str], what: &str| desk.run(args!["inspect", "bad.npy"]).refuses(parts, what);
    write(&[4, 4, 3], vec![0.5; 48]);
    desk.ok(args!["inspect", "bad.npy"]);
    write(&[4, 4, 2], vec![0.5; 32]);
    inspect(&["bad.npy", "[4, 4, 2]"], "two channels");
    write(&[48], vec![0.5; 48]);
    assert!(desk.ok(args!["inspect", "bad.npy"]).contains("[48]"), "an array of another kind");
    write(&[0, 4, 3], vec![]);
    inspect(&["bad.npy"], "no pixels");
    let mut values = vec![0.5; 48];
    values[7] = f32::NAN;
    write(&[4, 4, 3], values);
    inspect(&["bad.npy", "finite"], "NaN");
    desk.put("bad.npy", b"\x93NUMPY\x01\x00");
    inspect(&["bad.npy"], "half a header");
}

/// Files that are evidently something else than their names say.
#[test]
fn what_a_file_is_instead_is_said() {
    let desk = Desk::new();
    desk.put("lfs.png", "version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 9\n");
    desk.put("lfs.ply", "version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 9\n");
    desk.put("gzip.npz", b"\x1f\x8b\x08\0\0\0\0\0");
    desk.put("gzip.json", b"\x1f\x8b\x08\0\0\0\0\0");
    desk.put("wide.json", b"\xff\xfe{\0}\0");
    npz(&desk.path("out.npz"), &[("../../poses", &[1], Values::F32(vec![0.0]))]);
    for (file, what) in [
        ("lfs.png", "git lfs pull"),
        ("lfs.ply", "git lfs pull"),
        ("gzip.npz", "compressed by gzip"),
        ("gzip.json", "compressed by gzip"),
        ("wide.json", "UTF-16 text"),
        ("out.npz", "an entry named `../../poses.npy`"),
    ] {
        desk.run(args!["inspect", file]).refuses(&[file, what], what);
    }
}

#[test]
fn masks_may_have_one_channel() {
    let desk = Desk::new();
    skinsplat_data::npy::write_f32(&desk.path("image.npy"), &[4, 4, 3], [0.5; 48]).unwrap();
    for shape in [vec![4, 4], vec![4, 4, 1]] {
        skinsplat_data::npy::write_f32(&desk.path("mask.npy"), &shape, [1.0; 16]).unwrap();
        desk.ok(args!["score", "image.npy", "image.npy", "--mask", "mask.npy"]);
    }
    skinsplat_data::npy::write_f32(&desk.path("mask.npy"), &[1, 4, 4], [1.0; 16]).unwrap();
    desk.run(args!["score", "image.npy", "image.npy", "--mask", "mask.npy"])
        .refuses(&["mask.npy", "(H, W) or (H, W, 1)"], "channels first");
}
