//! Images, masks and scores as other people's tools write them. The inputs under `tests/data/small/cases` were written by
//! Pillow and numpy; the values are numpy's.

use crate::args;
use crate::files::npy;
use crate::program::Desk;
use crate::support;
use serde_json::Value;
use skinsplat_data::frames::{load_image, load_mask};

fn case(path: &str) -> std::path::PathBuf {
    support::data(&format!("small/cases/{path}"))
}

fn scores(desk: &Desk, arguments: Vec<std::ffi::OsString>) -> Value {
    let text = desk.ok([args!["score"], arguments, args!["--format", "json"]].concat());
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

fn close(value: &Value, expected: f64) {
    let value = value.as_f64().unwrap_or_else(|| panic!("{value}"));
    assert!((value - expected).abs() < 5e-7, "{value} for {expected}");
}

#[test]
fn names_that_start_with_a_dot_are_no_frames() {
    let desk = Desk::new();
    let found = scores(&desk, args![case("appledouble/render"), case("appledouble/truth")]);
    assert_eq!(found["frames"].as_object().unwrap().len(), 1, "{found}");
}

#[test]
fn pictures_of_other_kinds_beside_frames_are_said() {
    let desk = Desk::new();
    let (render, truth) = (case("background-255/render_on_white.png"), case("background-255/truth_rgba.png"));
    for (folder, image) in [("mine", &render), ("true", &truth)] {
        desk.put(&format!("{folder}/a.png"), std::fs::read(image).unwrap());
    }
    desk.put("mine/b.webp", "RIFF");
    let answer = desk.run(args!["score", "mine", "true"]);
    assert_eq!(answer.code, Some(0), "{answer:?}");
    assert!(answer.err.contains("mine: b.webp is of a kind that is not read: passed over"), "{}", answer.err);
    desk.put("none/c.webp", "RIFF");
    desk.put("none/d.tiff", "II");
    let refused = desk.run(args!["score", "none", "true"]);
    refused.refuses(&["none: 2 pictures are of kinds that are not read (c.webp, …)", ".png"], "other kinds");
}

#[test]
fn backgrounds_are_between_0_and_1() {
    let desk = Desk::new();
    let (render, truth) = (case("background-255/render_on_white.png"), case("background-255/truth_rgba.png"));
    close(&scores(&desk, args![render, truth, "--background", "1,1,1"])["psnr"], 32.558756);
    let refused = [
        args!["score", render, truth, "--background", "255,255,255"],
        args!["score", render, truth, "--protocol", "default+background=[0, 0, 2]"],
        args![
            "render",
            case("background-255/far.ply"),
            "--camera",
            case("background-255/camera.json"),
            "--out",
            "o.png"
        ],
        args![
            "render",
            case("background-255/far.ply"),
            "--camera",
            case("background-255/camera.json"),
            "--out",
            "o.png",
            "--background",
            "1.5,0,0"
        ],
    ];
    for arguments in refused {
        let answer = desk.run(arguments);
        assert_eq!(answer.code, Some(2), "{answer:?}");
        assert!(answer.err.contains("background") && answer.err.contains("[0, 1]"), "{answer:?}");
        assert!(!desk.path("o.png").exists());
    }
}

#[test]
fn masks_of_0_and_1_are_masks_in_every_type() {
    let desk = Desk::new();
    let (render, truth) = (case("mask-png-0-1/render.png"), case("mask-png-0-1/truth.png"));
    for mask in ["mask01.png", "mask255.png", "mask01.npy"] {
        let found = scores(&desk, args![render, truth, "--mask", case(&format!("mask-png-0-1/{mask}"))]);
        close(&found["psnr_mask"], 26.851576);
    }
}

#[test]
fn pngs_of_one_bit_are_as_large_as_they_say() {
    for (file, side, covered) in
        [("palette_1bit", 1024, true), ("empty_1bit", 512, false), ("person_1bit_2048", 2048, true)]
    {
        let path = case(&format!("one-bit-png/{file}.png"));
        let mask = load_mask(&path).unwrap();
        assert_eq!((mask.width(), mask.height()), (side, side));
        assert_eq!(mask.values().contains(&1.0), covered, "{file}");
        assert!(mask.values().iter().all(|&v| v == 0.0 || v == 1.0));
        assert_eq!(load_image(&path).unwrap().0.width(), side);
    }
}

#[test]
fn one_empty_mask_costs_one_frame_its_masked_scores() {
    let desk = Desk::new();
    let folders = || args![case("one-empty-mask/render"), case("one-empty-mask/truth")];
    let found = scores(&desk, folders());
    assert!(found["frames"]["b"]["psnr"].is_number() && found["frames"]["a"]["psnr_mask"].is_number());
    let reason = found["frames"]["b"]["not_computed"]["psnr_mask"].as_str().unwrap();
    assert!(reason.contains("holds no pixel"), "{reason}");
    assert!(found["mean"]["psnr"].is_number() && found["mean"]["psnr_mask"].is_null());
    assert_eq!(found["mean"]["not_computed"]["psnr_mask"], "1 of 2 frames have it");
    let whole = scores(&desk, [folders(), args!["--protocol", "hugs-full"]].concat());
    assert_eq!(whole["protocol"]["frames"], 2, "{whole}");
    let boxed = scores(&desk, [folders(), args!["--protocol", "hugs-human"]].concat());
    assert_eq!(boxed["protocol"]["frames"], 1, "{boxed}");
    assert!(boxed["frames"]["b"]["protocol_not_computed"].as_str().unwrap().contains("no pixel"), "{boxed}");
}

#[test]
fn jpegs_that_end_early_are_refused_as_pngs_are() {
    let whole = std::fs::read(case("truncated-jpeg/whole.jpg")).unwrap();
    let desk = Desk::new();
    assert!(load_image(&desk.put("whole.jpg", &whole)).is_ok());
    let mut wrong = 0;
    for cut in (whole.len() / 4..whole.len() - 1).step_by(7) {
        wrong += usize::from(load_image(&desk.put("cut.jpg", &whole[..cut])).is_ok());
    }
    // The same with an end put behind the cut, as a rescue tool does.
    for cut in (whole.len() / 2..whole.len() - 8).step_by(7) {
        let patched = [&whole[..cut], b"\xFF\xD9"].concat();
        wrong += usize::from(load_image(&desk.put("cut.jpg", patched)).is_ok());
    }
    assert_eq!(wrong, 0);
    let answer = desk.run(args!["score", case("truncated-jpeg/cut.jpg"), "whole.jpg"]);
    assert_eq!((answer.code, answer.out.as_str()), (Some(2), ""), "{answer:?}");
    // What follows the end of the image is nobody's business.
    assert!(load_image(&desk.put("more.jpg", [&whole[..], b"trailer"].concat())).is_ok());
}

#[test]
fn arrays_of_integers_count_as_pixels_do() {
    let desk = Desk::new();
    let (png, array) =
        (|n: &str| case(&format!("uint8-npy/{n}.png")), |n: &str| case(&format!("uint8-npy/{n}_u8.npy")));
    for (render, truth) in [
        (png("render"), png("truth")),
        (array("render"), array("truth")),
        (png("render"), array("truth")),
        (array("render"), png("truth")),
    ] {
        close(&scores(&desk, args![render, truth])["psnr"], 26.827927);
    }
    let shape = [2_u64, 2, 3];
    let of = |name: &str, bytes: Vec<u8>| desk.put(name, bytes);
    let wide = of("u2.npy", npy(&shape, &[65535_u16, 0, 32768, 0, 0, 0, 0, 0, 0, 0, 0, 257]));
    let pixels = load_image(&wide).unwrap().0;
    assert_eq!(pixels.at(0, 0), [1.0, 0.0, 32768.0 / 65535.0]);
    assert_eq!(pixels.at(1, 1)[2], 1.0 / 255.0);
    let floats =
        of("f4.npy", npy(&shape, &[0.0_f32, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 12.0, 255.0]));
    let error = load_image(&floats).unwrap_err().to_string();
    assert!(error.contains("floats from 0 to 255"), "{error}");
    let centred = of("centred.npy", npy(&shape, &[-1.0_f32; 12]));
    assert!(load_image(&centred).unwrap_err().to_string().contains("floats from -1 to 0"));
    let low = of("low.npy", npy(&shape, &[0_u16, 0, 255, 0, 0, 0, 0, 0, 0, 0, 0, 7]));
    let error = load_image(&low).unwrap_err().to_string();
    assert!(error.contains("values up to 255") && error.contains("65535"), "{error}");
}
