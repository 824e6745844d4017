//! Subjects, sequences and the registry.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "support/files.rs"]
mod files;
mod support;

use files::Values;
use skinsplat::datasets::Registry;
use skinsplat_core::scene::{Image, Mask, SceneError};
use skinsplat_data::folder::Options;
use skinsplat_data::{Capture, FrameFiles, FrameSource, Subject, folder, frames, npy};
use std::path::{Path, PathBuf};

fn subject(name: &str) -> PathBuf {
    support::data("blender/datasets").join(name)
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

#[test]
fn the_committed_subjects_load_with_what_they_hold() {
    let expected = [
        (
            "multiview_ben",
            Capture::Multiview,
            24,
            vec![("train", 18, 6, 3), ("test_novel_pose", 4, 2, 2), ("test_novel_view", 4, 2, 2)],
        ),
        (
            "snapshot_ava",
            Capture::Monocular,
            24,
            vec![("train_casual", 8, 1, 8), ("test_squat", 3, 1, 3), ("test_twist", 3, 1, 3)],
        ),
        ("xhands_ava", Capture::Hands, 55, vec![("train_take1", 5, 1, 5), ("test_take2", 3, 1, 3)]),
    ];
    for (name, capture, joints, sequences) in expected {
        let loaded = Subject::load(&subject(name), &Options::default()).unwrap();
        assert_eq!((loaded.id.as_str(), loaded.capture), (name, capture));
        assert_eq!(folder::inspect(&subject(name)).unwrap(), capture);
        let found: Vec<_> = loaded
            .sequences()
            .map(|s| (s.id.as_str(), s.frames.len(), s.cameras.len(), s.poses.len()))
            .collect();
        assert_eq!(found, sequences);
        assert!(loaded.train.iter().all(|s| s.id.starts_with("train")));
        for sequence in loaded.sequences() {
            assert_eq!(sequence.body.skeleton.num_joints(), joints);
            assert!(std::sync::Arc::ptr_eq(&sequence.body, &loaded.train[0].body), "one body per shape");
        }
    }
    let multi = Subject::load(&subject("multiview_ben"), &Options::default()).unwrap();
    let frame = &multi.train[0].frames[5];
    assert_eq!((frame.name.as_str(), frame.camera, frame.pose), ("cam01/image_0027", 1, 2));
}

#[test]
fn every_committed_frame_decodes_and_covers_its_body() {
    for name in ["snapshot_ava", "multiview_ben", "xhands_ava"] {
        let subject = Subject::load(&subject(name), &Options::default()).unwrap();
        for sequence in subject.sequences() {
            for (i, frame) in sequence.frames.iter().enumerate() {
                let truth = sequence.truth(i).unwrap();
                let camera = &sequence.cameras[frame.camera];
                assert_eq!((truth.rgb.width(), truth.rgb.height()), (512, 512));
                let posed =
                    skinsplat_core::scene::PosedBody::new(&sequence.body, &sequence.poses[frame.pose])
                        .unwrap();
                let inside = |v: &glam::Vec3| {
                    let (pixel, _) = camera.project(v.as_dvec3()).unwrap();
                    let (x, y) = (pixel.x.clamp(0.0, 511.0) as usize, pixel.y.clamp(0.0, 511.0) as usize);
                    truth.alpha.at(x, y) > 0.0
                };
                let vertices = &posed.mesh().vertices;
                let covered = vertices.iter().filter(|v| inside(v)).count();
                // Poses, cameras and frames belong together: silhouette vertices alone may miss by a pixel.
                assert!(
                    covered * 100 >= vertices.len() * 99,
                    "{name}/{} {}: {covered}",
                    sequence.id,
                    frame.name
                );
            }
        }
    }
}

#[test]
fn clothing_is_worn_only_on_request() {
    let load = |clothing| {
        let options = Options { clothing, ..Options::default() };
        Subject::load(&subject("multiview_ben"), &options).unwrap().train.remove(0).body
    };
    let (body, clothed) = (load(false), load(true));
    let offsets = npy::read(&subject("multiview_ben").join("gt_normal_offset.npy")).unwrap().values;
    for ((a, b), offset) in body.vertices.iter().zip(&clothed.vertices).zip(&offsets) {
        assert!(((*a - *b).length() - offset.abs()).abs() < 1e-9);
    }
    assert_eq!(body.skeleton, clothed.skeleton);
    assert!(offsets.iter().any(|o| *o > 0.02));
}

#[test]
fn a_validation_sequence_is_neither_trained_on_nor_a_test() {
    let folder = tempfile::tempdir().unwrap();
    let copied = folder.path().join("ava");
    copy(&subject("snapshot_ava"), &copied);
    std::fs::rename(copied.join("test_squat"), copied.join("val")).unwrap();
    let options =
        Options { model: Some(support::data("blender/models/anny_smpl24.npz")), ..Options::default() };
    let loaded = Subject::load(&copied, &options).unwrap();
    let names = |part: &[skinsplat_data::Sequence]| part.iter().map(|s| s.id.clone()).collect::<Vec<_>>();
    assert_eq!([names(&loaded.train), names(&loaded.test)], [["train_casual"], ["test_twist"]]);
    assert_eq!(names(&loaded.val), ["val"]);
    assert_eq!(loaded.sequence("val").unwrap().frames.len(), 3);
}

#[test]
fn truth_is_straight_colour_and_the_mask() {
    let subject = Subject::load(&subject("snapshot_ava"), &Options::default()).unwrap();
    let truth = subject.test[0].truth(0).unwrap();
    let FrameSource::Files(FrameFiles { image, mask: Some(mask), .. }) = &subject.test[0].frames[0].source
    else {
        panic!()
    };
    let mask = &mask.path;
    let (rgb, alpha) = frames::load_image(image).unwrap();
    assert_eq!((truth.rgb, Some(&truth.alpha)), (rgb, alpha.as_ref()), "mask and alpha are the same here");
    assert_eq!(frames::load_mask(mask).unwrap(), truth.alpha);
    let digest = |frames: &[usize]| subject.test[0].selected(frames).unwrap().digest().unwrap();
    assert_eq!(digest(&[0]).len(), 64);
    assert_eq!(digest(&[0]), digest(&[0]));
    assert_ne!(digest(&[0]), digest(&[1]));
    assert_eq!(subject.test[0].selected(&[99]).unwrap_err().field(), "frame");
    assert_eq!(subject.test[0].truth(99).unwrap_err().field(), "frame");
}

#[test]
fn a_sequence_may_keep_everything_in_its_json() {
    let folder = tempfile::tempdir().unwrap();
    let copied = folder.path().join("ava");
    copy(&subject("snapshot_ava"), &copied);
    for entry in ["train_casual", "test_squat", "test_twist"] {
        for file in ["cameras.npz", "poses.npz"] {
            std::fs::remove_file(copied.join(entry).join(file)).unwrap();
        }
    }
    let options =
        Options { model: Some(support::data("blender/models/anny_smpl24.npz")), ..Options::default() };
    let from_json = Subject::load(&copied, &options).unwrap();
    let original = Subject::load(&subject("snapshot_ava"), &Options::default()).unwrap();
    for (a, b) in from_json.sequences().zip(original.sequences()) {
        assert_eq!((&*a.cameras, &a.body, &*a.poses), (&*b.cameras, &b.body, &*b.poses));
    }
}

#[test]
fn what_is_wrong_with_a_sequence_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let copied = folder.path().join("ava");
    let options =
        Options { model: Some(support::data("blender/models/anny_smpl24.npz")), ..Options::default() };
    let sequence = copied.join("test_twist");
    let listing = sequence.join("transforms.json");
    let text = std::fs::read_to_string(subject("snapshot_ava").join("test_twist/transforms.json")).unwrap();
    let edits = [
        ("\"time\": 2}", "\"time\": 3}", "frames[2].time"),
        ("\"camera\": 0, \"time\": 1", "\"camera\": 1, \"time\": 1", "frames[1].camera"),
        ("images/image_0000.png", "images/image_9.png", "frames[0].file_path"),
        ("masks/mask_0019.png", "masks/none.png", "frames[2].mask_path"),
        ("\"frames\"", "\"images\"", "frames"),
    ];
    for (from, to, field) in edits {
        std::fs::remove_dir_all(&copied).ok();
        copy(&subject("snapshot_ava").join("test_twist"), &sequence);
        let edited = text.replacen(from, to, 1);
        assert_ne!(edited, text, "{from}");
        std::fs::write(&listing, edited).unwrap();
        let error = Subject::load(&copied, &options).unwrap_err();
        assert_eq!((error.field(), error.path()), (field, listing.as_path()), "{error}");
    }
    std::fs::write(&listing, &text).unwrap();
    let error = Subject::load(&copied, &Options::default()).unwrap_err();
    assert!(error.to_string().contains("model: anny_smpl24.npz not found"), "{error}");

    let loaded = Subject::load(&copied, &options).unwrap();
    frames::save_mask_png(&sequence.join("masks/mask_0000.png"), &Mask::filled(8, 8, 1.0)).unwrap();
    let error = loaded.test[0].truth(0).unwrap_err().to_string();
    assert!(error.ends_with("mask_0000.png: mask size: 8x8; expected the camera's 512x512"), "{error}");
    frames::save_png(&sequence.join("images/image_0000.png"), &Image::filled(9, 8, [0.0; 3])).unwrap();
    assert_eq!(loaded.test[0].truth(0).unwrap_err().field(), "image size");
    std::fs::remove_file(sequence.join("images/image_0000.png")).unwrap();
    assert_eq!(loaded.test[0].truth(0).unwrap_err().field(), "image");
    assert_eq!(Subject::load(folder.path(), &options).unwrap_err().field(), "sequences");
}

#[test]
fn the_embedded_registry_names_what_is_there() {
    let registry = Registry::embedded();
    let available: Vec<&str> =
        registry.datasets.iter().filter(|d| d.is_available()).map(|d| d.id.as_str()).collect();
    let shipped = [
        "synthetic",
        "synthetic_arm",
        "synthetic_small",
        "synthetic_lights",
        "snapshot_ava",
        "multiview_ben",
        "xhands_ava",
    ];
    assert_eq!(available[..shipped.len()], shipped);
    for id in &shipped[4..] {
        let dataset = registry.get(id).unwrap();
        let folder = &dataset.subject_folders().unwrap()[0];
        let subject = dataset.load_subject(folder, &Options::default()).unwrap();
        assert_eq!(subject.capture, dataset.capture, "{id}");
    }
    let people = registry.get("peoplesnapshot").unwrap();
    assert_eq!(
        (people.layout.as_str(), people.subjects.len(), people.splits.len()),
        ("peoplesnapshot", 4, 0)
    );
    let error = registry.get("nothing").unwrap_err().to_string();
    assert!(
        error.contains("datasets.toml: dataset: no id \"nothing\"; expected one of synthetic,"),
        "{error}"
    );
}

#[test]
fn a_folder_of_subjects_becomes_a_registry() {
    for root in [support::data("blender"), support::data("blender/datasets")] {
        let registry = Registry::scan(&root).unwrap();
        let found: Vec<_> = registry.datasets.iter().map(|d| (d.id.as_str(), d.capture)).collect();
        let expected = [
            ("multiview_ben", Capture::Multiview),
            ("snapshot_ava", Capture::Monocular),
            ("xhands_ava", Capture::Hands),
        ];
        assert_eq!(found, expected);
    }
    assert_eq!(Registry::scan(&subject("xhands_ava")).unwrap().datasets[0].id, "xhands_ava");
    let empty = tempfile::tempdir().unwrap();
    assert_eq!(Registry::scan(empty.path()).unwrap_err().field(), "datasets");
}

#[test]
fn what_is_wrong_with_a_registry_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("datasets.toml");
    let good = "[[dataset]]\nid = \"a\"\ntitle = \"A\"\nlayout = \"folder\"\ncapture = \"monocular\"\nlicence = \"CC0-1.0\"\n\
                provenance = \"here\"\npath = \"x\"\n";
    std::fs::write(&path, good).unwrap();
    let registry = Registry::load(&path).unwrap();
    assert_eq!(registry.datasets[0].path, Some(folder.path().join("x")));
    assert!(!registry.datasets[0].is_available());
    let split = |key: &str| format!("[dataset.splits]\n{key} = {{ train = [0, 1, 1], test = [2, 3, 1] }}\n");
    let people = "subjects = [\"anna\", \"bob\"]\n[dataset.folders]\nbob = \"b\"\n";
    for key in ["anna", "bob", "b"] {
        std::fs::write(&path, format!("{good}{people}{}", split(key))).unwrap();
        let dataset = &Registry::load(&path).unwrap().datasets[0];
        assert!(dataset.split_of(if key == "b" { "bob" } else { key }).is_some(), "{key}");
    }
    let cases = [
        (good.replace("title", "titel"), "line 3", "titel"),
        (good.replace("\"folder\"", "\"floppy\""), "line 4", "floppy"),
        (good.replace("licence = \"CC0-1.0\"\n", ""), "line 1", "licence"),
        (format!("{good}{good}"), "dataset[1].id", "again"),
        (format!("{good}subjects = [\"../b\"]\n"), "dataset[0].subjects", "path"),
        (format!("{good}subjects = [\"..\"]\n"), "dataset[0].subjects", "path"),
        (format!("{good}subjects = [\".\"]\n"), "dataset[0].subjects", "path"),
        (format!("{good}subjects = [\"/\"]\n"), "dataset[0].subjects", "path"),
        (format!("{good}subjects = [\"\"]\n"), "dataset[0].subjects", "path"),
        (format!("{good}subjects = [\"b/\"]\n"), "dataset[0].subjects", "path"),
        (format!("{good}[dataset.folders]\nb = \"..\"\n"), "dataset[0].subjects", "path"),
        (
            format!("{good}[[dataset.avatars]]\nname = \"h\"\npath = \"h.ply\"\nfile = \"x\"\n"),
            "line 12",
            "file",
        ),
        (
            format!("{good}{}", "[[dataset.avatars]]\nname = \"h\"\npath = \"h.ply\"\n".repeat(2)),
            "dataset[0].avatars",
            "repeat",
        ),
        (
            format!("{good}{}", split("y")),
            "dataset[0].splits.\"y\"",
            "no subject of this name; expected one of x",
        ),
        (format!("{good}{people}{}", split("ana")), "dataset[0].splits.\"ana\"", "is `anna` meant?"),
        (
            format!("{good}{people}{}b = {{ train = [0, 1, 1], test = [2, 3, 1] }}\n", split("bob")),
            "dataset[0].splits.\"bob\"",
            "the subject of splits.\"b\" again",
        ),
        (
            format!("{good}subjects = [\"anna\"]\n[dataset.folders]\nana = \"a\"\n"),
            "dataset[0].folders.\"ana\"",
            "`anna`",
        ),
        ("[[dataset]".into(), "line 1", ""),
    ];
    for (text, field, word) in cases {
        std::fs::write(&path, text).unwrap();
        let error = Registry::load(&path).unwrap_err();
        assert_eq!((error.field(), error.path()), (field, path.as_path()), "{error}");
        assert!(error.to_string().contains(word) && error.to_string().lines().count() == 1, "{error}");
    }
}

/// A subject of the InstantAvatar layout with six frames of 4x4 pixels.
fn peoplesnapshot(folder: &Path) {
    for sub in ["images", "masks", "poses", "../models"] {
        std::fs::create_dir_all(folder.join(sub)).unwrap();
    }
    for i in 0..6 {
        let image = Image::filled(4, 4, [i as f32 / 255.0, 0.0, 0.0]);
        frames::save_png(&folder.join(format!("images/image_{i:04}.png")), &image).unwrap();
        npy::write_f32(&folder.join(format!("masks/mask_{i:04}.npy")), &[4, 4], [1.0; 16]).unwrap();
    }
    let mut identity = vec![0.0; 16];
    [0, 5, 10, 15].iter().for_each(|&i| identity[i] = 1.0);
    let side = || Values::I64(vec![4]);
    let k = Values::F64(vec![8., 0., 2., 0., 8., 2., 0., 0., 1.]);
    let cameras: [(&str, &[u64], Values); 4] = [
        ("intrinsic", &[3, 3], k),
        ("extrinsic", &[4, 4], Values::F64(identity)),
        ("width", &[], side()),
        ("height", &[], side()),
    ];
    files::npz(&folder.join("cameras.npz"), &cameras);
    let ramp = |n: usize| Values::F32((0..n).map(|i| i as f32 / 10.0).collect());
    let betas = |v: f32| ("betas", &[1u64, 1][..], Values::F32(vec![v]));
    files::npz(
        &folder.join("poses.npz"),
        &[("thetas", &[6, 6], ramp(36)), ("transl", &[6, 3], ramp(18)), betas(0.0)],
    );
    let refined: [(&str, &[u64], Values); 4] = [
        ("global_orient", &[2, 3], ramp(6)),
        ("body_pose", &[2, 3], ramp(6)),
        ("transl", &[2, 3], ramp(6)),
        betas(0.5),
    ];
    files::npz(&folder.join("poses/anim_nerf_train.npz"), &refined);
    files::npz(&folder.join("../models/body.npz"), &files::small_body());
}

#[test]
fn peoplesnapshot_splits_its_video() {
    let folder = tempfile::tempdir().unwrap();
    let subject = folder.path().join("someone");
    std::fs::create_dir(&subject).unwrap();
    peoplesnapshot(&subject);
    let text = "[[dataset]]\nid = \"people\"\ntitle = \"People\"\nlayout = \"peoplesnapshot\"\ncapture = \"monocular\"\n\
                licence = \"none\"\nprovenance = \"here\"\npath = \".\"\nmodel = \"models/body.npz\"\nsubjects = [\"someone\"]\n\
                [dataset.splits]\nsomeone = { train = [0, 3, 2], test = [3, 5, 2] }\n";
    let path = folder.path().join("datasets.toml");
    std::fs::write(&path, text).unwrap();
    let registry = Registry::load(&path).unwrap();
    let dataset = &registry.datasets[0];
    assert!(dataset.is_available());
    let load = || dataset.load_subject(&dataset.subject_folders().unwrap()[0], &Options::default());
    let loaded = load().unwrap();
    let frames = |s: &skinsplat_data::Sequence| -> Vec<(String, usize)> {
        s.frames.iter().map(|f| (f.name.clone(), f.pose)).collect()
    };
    // Refined training poses have a row per frame of the split; test poses come from those of the whole video.
    assert_eq!(frames(&loaded.train[0]), [("image_0000".into(), 0), ("image_0002".into(), 1)]);
    assert_eq!(frames(&loaded.test[0]), [("image_0003".into(), 3), ("image_0005".into(), 5)]);
    assert_eq!(loaded.train[0].body.vertices[2].x, 2.5, "each split has its own shape");
    assert_eq!(loaded.test[0].body.vertices[2].x, 2.0);
    let truth = loaded.test[0].truth(1).unwrap();
    assert_eq!((truth.rgb.at(0, 0)[0], truth.alpha.at(3, 3)), (5.0 / 255.0, 1.0));
    std::fs::remove_file(subject.join("masks/mask_0005.npy")).unwrap();
    let error = load().unwrap_err();
    assert_eq!(error.field(), "masks");
    assert!(
        error.to_string().contains("masks: frame 5 is missing; expected a file like mask_0000.npy"),
        "{error}"
    );
    std::fs::remove_file(subject.join("images/image_0005.png")).unwrap();
    assert_eq!(load().unwrap_err().field(), "split.test");
}

#[test]
fn errors_of_scene_types_keep_their_field() {
    let error =
        skinsplat_data::Error::scene("body.npz", SceneError::new("weights[3]", "sum 0", "a sum of 1"));
    assert_eq!(error.to_string(), "body.npz: weights[3]: sum 0; expected a sum of 1");
}
