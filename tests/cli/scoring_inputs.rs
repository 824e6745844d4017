//! `score`: every kind of image file, and images that do not go together.

use crate::args;
use crate::program::Desk;
use crate::support::{fixture, png};
use serde_json::Value;
use skinsplat_core::scene::{Image, Mask};
use skinsplat_data::{frames, npy};

const WIDTH: usize = 40;
const HEIGHT: usize = 36;

/// A value of 16 bits that uses all of them.
fn sample(x: usize, y: usize, channel: usize) -> u16 {
    (x * 1571 + y * 977 + channel * 20_011 + x * y) as u16
}

/// The values of a file in their order, and what they mean as 3 or 4 channels.
fn file(depth: u8, channels: &[usize]) -> (Vec<u8>, Vec<f32>) {
    let (mut bytes, mut values) = (Vec::new(), Vec::new());
    for (y, x) in (0..HEIGHT * WIDTH).map(|i| (i / WIDTH, i % WIDTH)) {
        let read: Vec<f32> = channels
            .iter()
            .map(|&c| match depth {
                16 => {
                    bytes.extend(sample(x, y, c).to_be_bytes());
                    f32::from(sample(x, y, c)) / 65535.0
                }
                _ => {
                    bytes.push((sample(x, y, c) >> 8) as u8);
                    f32::from(sample(x, y, c) >> 8) / 255.0
                }
            })
            .collect();
        match read[..] {
            [v] => values.extend([v; 3]),
            [v, a] => values.extend([v, v, v, a]),
            _ => values.extend(read),
        }
    }
    (bytes, values)
}

fn expect_identical(desk: &Desk, found: &str, expected: &[f32], what: &str) {
    let channels = expected.len() / (WIDTH * HEIGHT);
    npy::write_f32(&desk.path("expected.npy"), &[HEIGHT, WIDTH, channels], expected.iter().copied()).unwrap();
    for pair in [[found, "expected.npy"], ["expected.npy", found]] {
        let text = desk.ok(args!["score", pair[0], pair[1], "--format", "json"]);
        let scores: Value = serde_json::from_str(&text).unwrap();
        assert_eq!((&scores["mse"], &scores["psnr"]), (&Value::from(0.0), &Value::Null), "{what}: {pair:?}");
    }
}

#[test]
fn pngs_of_every_kind_are_read_at_full_precision() {
    let desk = Desk::new();
    for (colour_type, channels, what) in
        [(0, 1, "grey"), (2, 3, "RGB"), (4, 2, "grey with alpha"), (6, 4, "RGBA")]
    {
        for depth in [8, 16] {
            let (bytes, values) = file(depth, &[0, 1, 2, 3][..channels]);
            let content = png::encode((WIDTH, HEIGHT), depth, colour_type, &[], &bytes);
            desk.put("image.png", content);
            expect_identical(&desk, "image.png", &values, &format!("{what}, {depth} bits"));
        }
    }
}

#[test]
fn palettes_are_looked_up() {
    let desk = Desk::new();
    let colours: Vec<u8> = (0..=255u8).flat_map(|i| [i, 255 - i, i.wrapping_mul(7)]).collect();
    let alphas: Vec<u8> = (0..=199u8).map(|i| i.wrapping_mul(3)).collect();
    let indices: Vec<u8> = (0..WIDTH * HEIGHT).map(|i| (i * 5 % 256) as u8).collect();
    let of = |value: u8| f32::from(value) / 255.0;
    let colour = |&i: &u8| colours[3 * usize::from(i)..][..3].iter().map(|&v| of(v)).collect::<Vec<_>>();
    let opaque: Vec<f32> = indices.iter().flat_map(colour).collect();
    desk.put("palette.png", png::encode((WIDTH, HEIGHT), 8, 3, &[(b"PLTE", &colours)], &indices));
    expect_identical(&desk, "palette.png", &opaque, "opaque palette");
    // Entries beyond the list of alphas are opaque.
    let alpha = |i: &u8| alphas.get(usize::from(*i)).map_or(1.0, |&alpha| of(alpha));
    let straight = |i: &u8| colour(i).into_iter().chain([alpha(i)]).collect::<Vec<_>>();
    let transparent: Vec<f32> = indices.iter().flat_map(straight).collect();
    let chunks: [(&[u8; 4], &[u8]); 2] = [(b"PLTE", &colours), (b"tRNS", &alphas)];
    desk.put("palette.png", png::encode((WIDTH, HEIGHT), 8, 3, &chunks, &indices));
    expect_identical(&desk, "palette.png", &transparent, "palette with transparency");
}

/// A JPEG with an Exif block that holds nothing but an orientation.
fn with_orientation(jpeg: &[u8], orientation: u8) -> Vec<u8> {
    let tiff =
        [b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0", &[orientation, 0, 0, 0, 0, 0, 0, 0][..]].concat();
    let block = [b"Exif\0\0", &tiff[..]].concat();
    let length = (block.len() as u16 + 2).to_be_bytes();
    [&jpeg[..2], &[0xFF, 0xE1], &length, &block, &jpeg[2..]].concat()
}

#[test]
fn jpegs_are_turned_as_their_exif_orientation_says() {
    let desk = Desk::new();
    let (width, height) = (48, 32);
    let pixels: Vec<u8> =
        (0..width * height).flat_map(|i| [i % width * 5, i / width * 7, i % 251].map(|v| v as u8)).collect();
    let mut jpeg = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new(&mut jpeg);
    image::ImageEncoder::write_image(encoder, &pixels, 48, 32, image::ExtendedColorType::Rgb8).unwrap();
    let stored = frames::load_image(&desk.put("stored.jpg", &jpeg)).unwrap().0;
    let (w, h) = (width, height);
    // Where the shown pixel (x, y) is stored: the table of the Exif standard.
    type Place = fn(usize, usize, usize, usize) -> (usize, usize);
    let places: [(u8, bool, Place); 8] = [
        (1, false, |x, y, _, _| (x, y)),
        (2, false, |x, y, w, _| (w - 1 - x, y)),
        (3, false, |x, y, w, h| (w - 1 - x, h - 1 - y)),
        (4, false, |x, y, _, h| (x, h - 1 - y)),
        (5, true, |x, y, _, _| (y, x)),
        (6, true, |x, y, _, h| (y, h - 1 - x)),
        (7, true, |x, y, w, h| (w - 1 - y, h - 1 - x)),
        (8, true, |x, y, w, _| (w - 1 - y, x)),
    ];
    for (orientation, turned, place) in places {
        let (columns, rows) = if turned { (h, w) } else { (w, h) };
        let pixel = |i: usize| {
            let (x, y) = place(i % columns, i / columns, w, h);
            stored.at(x, y)
        };
        let shown = Image::new(columns, rows, (0..w * h).map(pixel).collect()).unwrap();
        frames::save_npy(&desk.path("shown.npy"), &shown).unwrap();
        desk.put("turned.jpg", with_orientation(&jpeg, orientation));
        let text = desk.ok(args!["score", "turned.jpg", "shown.npy", "--format", "json"]);
        let scores: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(scores["psnr"], Value::Null, "orientation {orientation}: {text}");
    }
}

#[test]
fn sizes_must_agree_and_files_are_named() {
    let desk = Desk::new();
    let save = |name: &str, width: usize, height: usize| {
        frames::save_png(&desk.put(name, ""), &Image::filled(width, height, [0.5; 3])).unwrap();
    };
    for frame in ["1.png", "2.png"] {
        save(&format!("renders/{frame}"), 40, 36);
        save(&format!("truths/{frame}"), 40, 36);
        let mask = Mask::filled(40, if frame == "2.png" { 35 } else { 36 }, 1.0);
        frames::save_mask_png(&desk.put(&format!("masks/{frame}"), ""), &mask).unwrap();
    }
    desk.run(args!["score", "renders", "truths", "--mask", "masks"])
        .refuses(&["masks/2.png", "40x35", "40x36"], "a mask of another size");
    for protocol in ["all", "hugs-human"] {
        desk.run(args!["score", "renders", "truths", "--mask", "masks", "--protocol", protocol])
            .refuses(&["masks/2.png", "40x35", "40x36"], "a mask of another size");
    }
    save("renders/2.png", 41, 36);
    desk.run(args!["score", "renders", "truths"])
        .refuses(&["renders/2.png", "truths/2.png", "41x36", "40x36"], "sizes");
    std::fs::remove_file(desk.path("masks/2.png")).unwrap();
    desk.run(args!["score", "renders", "truths", "--mask", "masks"])
        .refuses(&["masks: no mask for frame 2", "truths"], "masks");
    save("renders/2.png", 40, 36);
    std::fs::rename(desk.path("masks"), desk.path("old")).unwrap();
    for frame in ["1", "2"] {
        let bytes = desk.bytes("old/1.png");
        desk.put(&format!("masks/m_{frame}.png"), bytes);
    }
    let answer = desk.run(args!["score", "renders", "truths", "--mask", "masks"]).exits(0, "masks by number");
    assert!(answer.err.contains("masks paired by their numbers: m_1 for 1"), "{}", answer.err);
    let bytes = desk.bytes("old/1.png");
    desk.put("masks/m_003.png", &bytes);
    desk.ok(args!["score", "renders", "truths", "--mask", "masks"]);
    desk.put("masks/other_02.png", bytes);
    desk.run(args!["score", "renders", "truths", "--mask", "masks"])
        .refuses(&["masks: no mask for frame 2", "one mask with its last number"], "two of a number");
    desk.run(args!["score", "renders/1.png", "truths"])
        .refuses(&["renders/1.png: a file", "folder"], "a file");
}

#[test]
fn a_render_over_another_background_is_warned_of() {
    let desk = Desk::new();
    let truth = Image::filled(WIDTH, HEIGHT, [0.4, 0.5, 0.6]);
    let alpha = (0..WIDTH * HEIGHT).map(|i| f32::from(u8::from(i % WIDTH < 10))).collect();
    let alpha = Mask::new(WIDTH, HEIGHT, alpha).unwrap();
    frames::save_png_with_alpha(&desk.path("truth.png"), &truth, &alpha).unwrap();
    let black = truth.composited(&alpha, [0.0; 3]).unwrap();
    frames::save_png(&desk.path("render.png"), &black).unwrap();
    let score = |more: &[&str]| {
        let mut arguments = args!["score", "render.png", "truth.png"];
        arguments.extend(more.iter().map(std::ffi::OsString::from));
        desk.run(arguments).exits(0, "score")
    };
    for (more, warned) in [
        (&["--protocol", "ihuman"][..], true),
        (&["--protocol", "hugs-human"], false),
        (&["--protocol", "ihuman", "--background", "0,0,0"], false),
        (&["--protocol", "ihuman", "--quiet"], false),
        (&[], true),
    ] {
        let answer = score(more);
        assert_eq!(answer.err.contains("--background"), warned, "{more:?}: {}", answer.err);
    }
    let all = score(&["--protocol", "all"]).out;
    assert!(all.contains("ihuman: 1 of 1 renders lie over another background"), "{all}");
    assert!(!all.contains("hugs-full: 1 of"), "{all}");
}

/// A frame that a protocol cannot score is not in its mean, and the mean says so.
#[test]
fn a_mean_says_of_how_many_frames_it_is() {
    let desk = Desk::new();
    let truth = Image::filled(WIDTH, HEIGHT, [0.4, 0.5, 0.6]);
    for (name, alpha) in [("a.png", 1.0), ("b.png", 0.0)] {
        let path = desk.put(&format!("truths/{name}"), "");
        frames::save_png_with_alpha(&path, &truth, &Mask::filled(WIDTH, HEIGHT, alpha)).unwrap();
        frames::save_png(&desk.put(&format!("renders/{name}"), ""), &truth).unwrap();
    }
    let text = desk.ok(args!["score", "renders", "truths", "--protocol", "hugs-human"]);
    assert!(text.contains("mean of 1 of 2") && text.matches("holds no pixel").count() == 1, "{text}");
    assert!(desk.ok(args!["score", "renders", "truths", "--protocol", "hugs-full"]).contains("mean of 2  "));
}

#[test]
fn images_below_the_size_of_the_network_have_no_lpips() {
    let desk = Desk::new();
    let [a, b] = ["a", "b"].map(|side| fixture(&format!("metrics/png/tiny_11x11_{side}.png")));
    let text = desk.ok(args!["score", a, b, "--lpips", "--protocol", "avatar-v1", "--format", "json"]);
    let scores: Value = serde_json::from_str(&text).unwrap();
    assert!(scores.get("lpips_alex_pm1").is_none(), "{text}");
    let reason = "lpips_alex_pm1: the scored image has 11x11 pixels; expected at least 31x31";
    assert_eq!(scores["not_computed"]["lpips_alex_pm1"], reason);
    assert_eq!(scores["protocol"]["values"].get("lpips"), None);
    assert_eq!(scores["protocol"]["not_computed"]["lpips"], reason);
    let text = desk.ok(args!["score", a, b, "--protocol", "avatar-v1"]);
    assert!(text.contains(&format!("LPIPS not computed: {reason}")), "{text}");
}
