//! `inspect`, `list` and `plan`.

use crate::args;
use crate::made_up;
use crate::program::Desk;
use crate::reports::finished;
use crate::support::{data, fixture};
use serde_json::Value;

#[test]
fn inspect_tells_what_each_kind_of_file_holds() {
    let desk = finished();
    made_up::put(&desk);
    let subject = data("blender/datasets/snapshot_ava");
    let sequence = subject.join("test_twist");
    for (path, parts) in [
        (fixture("raster/scene_S.ply"), vec!["3DGS PLY", "10000", "SH degree            3", "static scene"]),
        (desk.path("avatar.ply"), vec!["3DGS PLY", "joint weights, up to 2 per Gaussian"]),
        (
            desk.path("body.npz"),
            vec!["npz archive", "body model", "v_template           [6, 3] <f4", "zero-area faces      0"],
        ),
        (data("blender/models/anny_smpl24.npz"), vec!["13492", "26972", "shape directions     10", "pelvis"]),
        (desk.path("poses.npz"), vec!["npz archive", "thetas", "poses                2"]),
        (sequence.join("cameras.npz"), vec!["npz archive", "camera 0             512x512, focal 799.0"]),
        (sequence.join("transforms.json"), vec!["cameras", "512x512", "poses                3"]),
        (fixture("raster/front_512.json"), vec!["cameras", "512x512, focal 703.4 703.4"]),
        (
            data("blender/models/ava_smplx55_8inf.glb"),
            vec!["body model", "joints               55", "clip hands           40 keys"],
        ),
        (sequence.join("images/image_0000.png"), vec!["image", "512x512", "alpha"]),
        (fixture("raster/S_front_512_image.npy"), vec!["image", "512x512"]),
        (subject, vec!["subject", "monocular", "test_twist           3 frames, 3 poses, 1 cameras"]),
        (data("blender"), vec!["folder of subjects", "multiview_ben", "xhands_ava", "snapshot_ava"]),
        (
            desk.path("run/results.json"),
            vec!["results of a run", "tiny", "2 sequences, protocol avatar-v1@1", "missing scores       0"],
        ),
        (
            desk.path("run/frames.jsonl"),
            vec!["results store", "records              4", "failed               0"],
        ),
    ] {
        let text = desk.ok(args!["inspect", path]);
        assert!(text.starts_with(&format!("{}\n", path.display())), "{text}");
        for part in parts {
            assert!(text.contains(part), "no `{part}` in {text}");
        }
    }
}

#[test]
fn inspect_refuses_what_it_does_not_know() {
    let desk = Desk::new();
    desk.put("notes.doc", "x");
    desk.put("other.json", "{}");
    desk.put("broken.json", "{");
    desk.put("frames.jsonl", "{\"frame\":1}\n");
    desk.put("empty/readme.txt", "x");
    for (path, parts) in [
        ("notes.doc", vec!["notes.doc", "expected .ply"]),
        ("other.json", vec!["other.json"]),
        ("broken.json", vec!["broken.json", "line 1"]),
        ("frames.jsonl", vec!["frames.jsonl:1", "not a results store"]),
        ("empty", vec!["empty: folder: nothing that is known", "a folder of subjects", "neuman"]),
        ("nothing.ply", vec!["nothing.ply", "No such file"]),
        ("nothing", vec!["nothing"]),
    ] {
        desk.run(args!["inspect", path]).refuses(&parts, path);
    }
}

#[test]
fn list_names_everything_that_can_be_chosen() {
    let desk = Desk::new();
    for (what, ids) in [
        ("experiments", vec!["table1", "table6"]),
        ("datasets", vec!["synthetic", "snapshot_ava", "neuman"]),
        ("strategies", skinsplat_posing::PRESETS.iter().map(|p| p.id).collect()),
        ("protocols", skinsplat_metrics::PROTOCOLS.iter().map(|p| p.id.as_str()).collect()),
        ("metrics", skinsplat_metrics::METRICS.iter().map(|metric| metric.id).collect()),
        ("metrics", vec!["psnr", "ssim_zero_pad", "psnr_mean_of_channels_mask"]),
    ] {
        let text = desk.ok(args!["list", what]);
        for id in ids {
            assert!(
                text.lines().any(|line| line.starts_with(&format!("{id} "))),
                "{what}: no {id} in {text}"
            );
        }
    }
    let here = desk.ok(args!["list", "datasets", "--data", data("blender")]);
    assert_eq!(here.lines().count(), 3, "{here}");
    assert!(here.lines().all(|line| line.ends_with("available")), "{here}");
    let strategies = desk.ok(args!["list", "strategies"]);
    for variation in ["+rotation=lifted-sum ", "+rotation=power-N[-START] ", "+colour=view-rotation "] {
        assert!(strategies.lines().any(|line| line.starts_with(variation)), "{variation}: {strategies}");
    }
    // The same table in every format.
    for (format, line) in [
        ("markdown", "| psnr | table column PSNR: peak signal-to-noise ratio |"),
        ("csv", "psnr,table column PSNR: peak signal-to-noise ratio"),
        ("latex", "psnr & table column PSNR: peak signal-to-noise ratio \\\\"),
    ] {
        let listed = desk.ok(args!["list", "metrics", "--format", format]);
        assert!(listed.lines().any(|l| l == line), "{listed}");
    }
    let listed: Value = serde_json::from_str(&desk.ok(args!["list", "metrics", "--format", "json"])).unwrap();
    assert_eq!((&listed["rows"][0]["id"], &listed["columns"][0]["key"]), (&"psnr".into(), &"what".into()));
    // What is listed as a strategy can be asked for by that spec.
    for preset in skinsplat_posing::PRESETS {
        assert!(preset.strategy.to_string().parse::<skinsplat_posing::Strategy>().is_ok(), "{}", preset.id);
    }
}

#[test]
fn a_plan_counts_what_is_left_and_touches_nothing() {
    let desk = Desk::new();
    desk.put("tiny.toml", include_str!("tiny.toml"));
    let plan = args!["plan", "tiny.toml", "--out", "run", "--limit", "1"];
    let before = desk.contents();
    let text = desk.ok(plan.clone());
    assert!(
        text.contains("tiny: 2 sequences, 2 variants, 2 frames, protocol avatar-v1@1, on Blender"),
        "{text}"
    );
    assert!(text.ends_with("1 avatars\n2 frames, 2 of them still to do\n"), "{text}");
    assert!(desk.contents() == before);

    let desk = finished();
    assert!(desk.ok(plan.clone()).ends_with("2 frames, 0 of them still to do\n"));
    let mut shard = plan.clone();
    shard.extend(args!["--shard", "1/2"]);
    let text = desk.ok(shard);
    assert!(text.contains("\nslice 1/2: ") && text.contains(" % of the estimated work, "), "{text}");
    assert!(text.ends_with(" frames, 0 of them still to do\n"), "{text}");

    let mut as_json = plan;
    as_json.extend(args!["--format", "json"]);
    let json: Value = serde_json::from_str(&desk.ok(as_json)).unwrap();
    assert_eq!((json["jobs"].as_array().unwrap().len(), json["avatars"].as_array().unwrap().len()), (2, 1));
    assert!(text.starts_with(&format!("plan {}\n", json["digest"].as_str().unwrap())), "{text}");
}

/// Other kernels of the C library's `exp`, `sin` and the like, which round differently.
pub(crate) const OTHER_KERNELS: (&str, &str) =
    ("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2,-AVX,-AVX2_Usable,-FMA_Usable");

#[test]
fn a_plan_and_its_keys_do_not_depend_on_the_c_library() {
    let desk = Desk::new();
    let plan = |environment: Option<(&str, &str)>| {
        let mut command = desk.command(args!["plan", "--profile", "quick", "--format", "json"]);
        command.envs(environment);
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    };
    assert!(plan(None) == plan(Some(OTHER_KERNELS)), "the keys differ");
}

#[test]
fn help_with_fetching_lists_the_files_and_an_entry_without_empty_tables() {
    let text = Desk::new().ok(args!["fetch-help", "neuman"]);
    for part in ["sparse/images.txt", "4d_humans/sam_segmentations", "reproduce inspect", "id = \"neuman\""] {
        assert!(text.contains(part), "no `{part}` in {text}");
    }
    assert!(!text.contains("[dataset.splits]") && !text.contains("avatars = []"), "{text}");
}
