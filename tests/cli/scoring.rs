//! `score`: two images, two folders.

use crate::args;
use crate::program::Desk;
use crate::support::{fixture, json};
use serde_json::Value;

/// The reference values hold to this in f64: sums in another order.
const TOLERANCE: f64 = 1e-9;

fn score(desk: &Desk, arguments: Vec<std::ffi::OsString>) -> Value {
    let mut all = args!["score"];
    all.extend(arguments);
    all.extend(args!["--format", "json"]);
    serde_json::from_str(&desk.ok(all)).unwrap()
}

#[test]
fn every_variant_agrees_with_the_reference() {
    let desk = Desk::new();
    let expected = json("metrics/expected.json");
    let (mut compared, mut refused) = (0, 0);
    for (name, pair) in expected["pairs"].as_object().unwrap() {
        let [a, b] = [0, 1].map(|i| fixture("metrics").join(pair["files"][i].as_str().unwrap()));
        let found = score(&desk, args![a, b]);
        for (variant, reference) in [
            ("mse", &pair["mse"]),
            ("mae", &pair["mae"]),
            ("psnr", &pair["psnr"]),
            ("psnr_mean_of_channels", &pair["psnr_mean_of_channels"]),
            ("ssim_zero_pad", &pair["ssim"]["inria_f64"]),
            ("ssim_valid", &pair["ssim"]["skimage_gaussian"]),
            ("ssim_reflect", &pair["ssim"]["torchmetrics"]),
            ("ssim_uniform7", &pair["ssim"]["skimage_default_7x7_uniform"]),
        ] {
            match reference {
                Value::Number(number) => {
                    let (found, reference) = (found[variant].as_f64().unwrap(), number.as_f64().unwrap());
                    assert!((found - reference).abs() <= TOLERANCE, "{name} {variant}: {found} {reference}");
                    compared += 1;
                }
                // The reference library refuses the size.
                Value::String(_) => {
                    assert!(found["not_computed"][variant].is_string(), "{name} {variant}: {found}");
                    assert!(found.get(variant).is_none(), "{name} {variant}");
                    refused += 1;
                }
                // Identical images.
                _ => {
                    assert_eq!(found.get(variant), Some(&Value::Null), "{name} {variant}");
                    compared += 1;
                }
            }
        }
    }
    assert_eq!((compared, refused), (125, 3));
}

/// Copies `frames` of the fixture images into two folders as frames.
fn folders(desk: &Desk) {
    for (frame, pair) in [("a", "rocket_67x53_noise"), ("b", "tiny_11x11")] {
        for (folder, side) in [("renders", "a"), ("truths", "b")] {
            let file = fixture("metrics/png").join(format!("{pair}_{side}.png"));
            desk.put(&format!("{folder}/{frame}.png"), std::fs::read(file).unwrap());
        }
    }
}

#[test]
fn folders_pair_up_by_name() {
    let desk = Desk::new();
    folders(&desk);
    let found = score(&desk, args!["renders", "truths", "--protocol", "3dgs"]);
    let mean = found["mean"]["psnr"].as_f64().unwrap();
    let frames = ["a", "b"].map(|frame| {
        let [render, truth] = ["renders", "truths"].map(|folder| format!("{folder}/{frame}.png"));
        let single = score(&desk, args![render, truth, "--protocol", "3dgs"]);
        assert_eq!(found["frames"][frame], single, "{frame}");
        single["psnr"].as_f64().unwrap()
    });
    assert!((mean - (frames[0] + frames[1]) / 2.0).abs() < 1e-12, "{mean} {frames:?}");
    assert_eq!(found["frames"].as_object().unwrap().len(), 2);
    assert_eq!(found["protocol"]["frames"], 2, "{}", found["protocol"]);
    let text = desk.ok(args!["score", "renders", "truths", "--protocol", "3dgs"]);
    assert!(text.contains("Protocol 3dgs@1.") && text.contains("mean of 2"), "{text}");
    assert_eq!(
        desk.ok(args!["score", "renders", "truths", "--protocol", "3dgs@1"]),
        text,
        "as it is printed"
    );
    for (protocol, parts) in
        [("3dgs@7", ["version 7", "version 1"]), ("3dgs+ssim=x+ssim=y", ["twice", "once"])]
    {
        desk.run(args!["score", "renders", "truths", "--protocol", protocol]).refuses(&parts, protocol);
    }
    let csv = desk.ok(args!["score", "renders", "truths", "--protocol", "3dgs", "--format", "csv"]);
    let line = csv.lines().find(|line| line.starts_with("mean of 2 frames,psnr,mean,")).unwrap();
    assert_eq!(line.split(',').nth(3).unwrap().parse::<f64>().unwrap(), mean);
    let one = desk.ok(args!["score", "renders", "truths", "--threads", "1"]);
    assert_eq!(one, desk.ok(args!["score", "renders", "truths", "--threads", "2"]));
}

#[test]
fn frames_without_a_partner_are_named() {
    let desk = Desk::new();
    folders(&desk);
    std::fs::copy(desk.path("renders/a.png"), desk.path("renders/c.png")).unwrap();
    desk.run(args!["score", "renders", "truths"]).refuses(&["renders", "frames c", "truths"], "more renders");
    std::fs::copy(desk.path("renders/a.png"), desk.path("truths/c.png")).unwrap();
    std::fs::copy(desk.path("renders/a.png"), desk.path("truths/d.png")).unwrap();
    desk.run(args!["score", "renders", "truths"]).refuses(&["truths", "frames d", "renders"], "more truths");
    std::fs::copy(desk.path("renders/a.png"), desk.path("renders/a.npy")).unwrap();
    desk.run(args!["score", "renders", "truths"])
        .refuses(&["a.png", "a.npy", "one image per frame"], "twice");
}

#[test]
fn masks_add_variants() {
    let desk = Desk::new();
    let [a, b] = ["a", "b"].map(|side| fixture(&format!("metrics/png/checker_64x72_inverted_{side}.png")));
    let plain = score(&desk, args![a, b]);
    let size = skinsplat_data::frames::load_image(&a).unwrap().0;
    let half: Vec<f32> =
        (0..size.pixels().len()).map(|i| f32::from(i % size.width() < size.width() / 2)).collect();
    let mask = skinsplat_core::scene::Mask::new(size.width(), size.height(), half).unwrap();
    skinsplat_data::frames::save_mask_png(&desk.path("mask.png"), &mask).unwrap();
    let masked = score(&desk, args![a, b, "--mask", "mask.png"]);
    for (name, value) in plain.as_object().unwrap() {
        assert_eq!(&masked[name], value, "{name}");
    }
    // Black against white everywhere: half of the image is as wrong as all of it.
    assert_eq!(masked["mse_mask"], 1.0);
    assert_eq!(masked["mse_bbox"], 1.0);
    assert_eq!(masked["mse_image_times_mask"], 0.5);
    let ids: usize = skinsplat_metrics::VARIANT_IDS.iter().map(|(_, ids)| ids.len()).sum();
    assert_eq!(masked.as_object().unwrap().len(), ids);
}
