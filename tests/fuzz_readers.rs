//! Mutated files: every reader returns a value or one error that names the file; it never panics and never allocates
//! what the file cannot hold.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]
#![allow(unsafe_code, reason = "an allocator that counts")]

#[path = "support/files.rs"]
mod files;
mod support;

use files::Values;
use proptest::prelude::*;
use skinsplat::datasets::Registry;
use skinsplat_core::scene::{Avatar, Binding, FaceBinding, Gaussians, Image, Mask, SkinWeights};
use skinsplat_data::avatar::read_avatar;
use skinsplat_data::folder::Options;
use skinsplat_data::pickle::Pickle;
use skinsplat_data::ply::{self, Encoding, Metadata};
use skinsplat_data::{Error, Subject, body, camera, frames, npy, poses};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::{Path, PathBuf};

thread_local! {
    static LARGEST: Cell<usize> = const { Cell::new(0) };
}

/// The system's allocator, which remembers the largest request of each thread.
struct Counting;

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        note(layout.size());
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        note(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        note(size);
        unsafe { System.realloc(pointer, layout, size) }
    }
}

fn note(size: usize) {
    LARGEST.try_with(|largest| largest.set(largest.get().max(size))).ok();
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// No single allocation may be larger: files here have a few kilobytes, and deflate expands them at most a
/// thousandfold.
const ALLOCATION_LIMIT: usize = 16 << 20;

/// A change to a file.
#[derive(Clone, Debug)]
enum Mutation {
    Flip {
        at: prop::sample::Index,
        bit: u8,
    },
    Overwrite {
        at: prop::sample::Index,
        bytes: Vec<u8>,
    },
    Truncate {
        at: prop::sample::Index,
    },
    Insert {
        at: prop::sample::Index,
        bytes: Vec<u8>,
    },
    Remove {
        at: prop::sample::Index,
        count: u8,
    },
    /// Replaces the n-th run of decimal digits.
    Number {
        which: prop::sample::Index,
        text: &'static str,
    },
}

const NUMBERS: [&str; 12] = [
    "0",
    "-1",
    "2",
    "255",
    "65536",
    "1000000000",
    "4294967295",
    "18446744073709551615",
    "99999999999999999999",
    "1e309",
    "0.5",
    "[1]",
];

fn mutation() -> impl Strategy<Value = Mutation> {
    let at = any::<prop::sample::Index>;
    let bytes = || prop::collection::vec(prop_oneof![any::<u8>(), Just(0), Just(0xFF)], 1..9);
    prop_oneof![
        3 => (at(), 0u8..8).prop_map(|(at, bit)| Mutation::Flip { at, bit }),
        2 => (at(), bytes()).prop_map(|(at, bytes)| Mutation::Overwrite { at, bytes }),
        1 => at().prop_map(|at| Mutation::Truncate { at }),
        1 => (at(), bytes()).prop_map(|(at, bytes)| Mutation::Insert { at, bytes }),
        1 => (at(), 1u8..20).prop_map(|(at, count)| Mutation::Remove { at, count }),
        3 => (at(), prop::sample::select(&NUMBERS[..])).prop_map(|(which, text)| Mutation::Number { which, text }),
    ]
}

fn mutated(original: &[u8], mutations: &[Mutation]) -> Vec<u8> {
    let mut bytes = original.to_vec();
    for mutation in mutations {
        if bytes.is_empty() {
            break;
        }
        match mutation {
            Mutation::Flip { at, bit } => {
                let i = at.index(bytes.len());
                bytes[i] ^= 1 << bit;
            }
            Mutation::Overwrite { at, bytes: new } => {
                let i = at.index(bytes.len());
                let end = (i + new.len()).min(bytes.len());
                bytes[i..end].copy_from_slice(&new[..end - i]);
            }
            Mutation::Truncate { at } => bytes.truncate(at.index(bytes.len())),
            Mutation::Insert { at, bytes: new } => {
                let i = at.index(bytes.len());
                bytes.splice(i..i, new.iter().copied());
            }
            Mutation::Remove { at, count } => {
                let i = at.index(bytes.len());
                let end = (i + usize::from(*count)).min(bytes.len());
                bytes.drain(i..end);
            }
            Mutation::Number { which, text } => {
                let starts: Vec<usize> = (0..bytes.len())
                    .filter(|&i| bytes[i].is_ascii_digit() && (i == 0 || !bytes[i - 1].is_ascii_digit()))
                    .collect();
                if !starts.is_empty() {
                    let start = starts[which.index(starts.len())];
                    let end =
                        (start..bytes.len()).find(|&i| !bytes[i].is_ascii_digit()).unwrap_or(bytes.len());
                    bytes.splice(start..end, text.bytes());
                }
            }
        }
    }
    bytes
}

/// `SKINSPLAT_FUZZ=N` runs N times as many cases.
fn effort() -> u32 {
    std::env::var("SKINSPLAT_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(1)
}

/// Runs a reader over mutations of a file.
fn fuzz(cases: u32, original: &Path, read: impl Fn(&Path) -> Result<(), Error>) {
    let bytes = std::fs::read(original).unwrap();
    read(original).expect("the file is valid before it is mutated");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(original.file_name().unwrap());
    let config =
        ProptestConfig { cases: cases * effort(), failure_persistence: None, ..ProptestConfig::default() };
    proptest!(config, |(mutations in prop::collection::vec(mutation(), 1..4))| {
        std::fs::write(&path, mutated(&bytes, &mutations)).unwrap();
        LARGEST.set(0);
        let result = read(&path);
        prop_assert!(LARGEST.get() <= ALLOCATION_LIMIT, "{} bytes at once", LARGEST.get());
        if let Err(error) = result {
            let text = error.to_string();
            prop_assert_eq!(error.path(), path.as_path());
            prop_assert!(text.contains("; expected ") && !error.field().is_empty() && !text.contains('\n'), "{}", text);
        }
    });
    // Truncation at any byte (of small files), at a sample of bytes otherwise.
    let step = bytes.len().div_ceil(500).max(1);
    for length in (0..bytes.len()).step_by(step) {
        std::fs::write(&path, &bytes[..length]).unwrap();
        if let Err(error) = read(&path) {
            assert_eq!(error.path(), path, "{error}");
        }
    }
}

fn nothing<T>(value: Result<T, Error>) -> Result<(), Error> {
    value.map(|_| ())
}

fn avatar(binding: Binding) -> Avatar {
    let n = 3;
    let gaussians = Gaussians {
        means: (0..n).map(|i| glam::Vec3::splat(i as f32)).collect(),
        rotations: vec![[1.0, 0.5, -0.25, 0.0]; n],
        log_scales: vec![glam::Vec3::splat(-4.0); n],
        opacity_logits: vec![0.5; n],
        sh_degree: 1,
        sh: (0..4 * n).map(|i| [i as f32 / 8.0; 3]).collect(),
    };
    Avatar { gaussians, binding }
}

fn temporary(name: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    (folder, path)
}

#[test]
fn ply() {
    let weights = SkinWeights::from_rows([[(3, 0.25), (1, 0.75)]; 3], 4).unwrap();
    let faces =
        FaceBinding { faces: vec![8; 3], barycentric: vec![[0.25, 0.25, 0.5]; 3], offsets: vec![0.5; 3] };
    for binding in [Binding::Vertex(weights), Binding::Face(faces)] {
        for encoding in [Encoding::LittleEndian, Encoding::Ascii] {
            let (_folder, path) = temporary("avatar.ply");
            ply::write_avatar(&path, &avatar(binding.clone()), &Metadata::default(), encoding).unwrap();
            fuzz(1500, &path, |path| nothing(ply::read(path)));
        }
    }
}

#[test]
fn avatars_of_other_programs() {
    for (name, cases) in [
        ("base.compressed.ply", 600),
        ("six_big_endian.ply", 1500),
        ("six_ascii.ply", 600),
        ("gaussians.npz", 1000),
        ("gaussians_logs.npz", 600),
        ("gsplat.pt", 1500),
        ("capture.pth", 600),
        ("haha.ckpt", 1500),
    ] {
        fuzz(cases, &support::data("small/avatars").join(name), |path| nothing(read_avatar(path)));
    }
}

#[test]
fn cameras_of_other_programs() {
    let lens = r#""w": 64, "h": 48, "fl_x": 60.5, "cx": 32, "cy": 24, "k1": 0.5, "camera_angle_x": 0.5"#;
    let frame = r#"{"file_path": "a", "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0.5], [0, 0, 1, 3], [0, 0, 0, 1]]}"#;
    let trained = r#"[{"id": 0, "width": 64, "height": 48, "position": [0, 0.5, 1], "fx": 60, "fy": 61,
        "rotation": [[1, 0, 0], [0, -1, 0], [0, 0, -1]]}]"#;
    for text in [format!("{{{lens}, \"frames\": [{frame}]}}"), trained.to_owned()] {
        let (_folder, path) = temporary("cameras.json");
        std::fs::write(&path, text).unwrap();
        fuzz(1500, &path, |path| nothing(camera::load_views(path)));
    }
}

#[test]
fn npy_and_images_in_it() {
    let (_folder, path) = temporary("image.npy");
    frames::save_npy(&path, &Image::filled(5, 4, [0.5, 0.25, 1.0])).unwrap();
    fuzz(2000, &path, |path| nothing(npy::read(path)).and(nothing(frames::load_image(path))));
}

#[test]
fn npz_bodies_and_poses() {
    let (_folder, path) = temporary("body.npz");
    files::npz(&path, &files::small_body());
    fuzz(3000, &path, |path| nothing(body::load(path)));
    let (_folder, path) = temporary("poses.npz");
    let poses_of = |n: usize| Values::F32(vec![0.125; n]);
    files::npz(
        &path,
        &[("thetas", &[2, 6], poses_of(12)), ("transl", &[2, 3], poses_of(6)), ("betas", &[1], poses_of(1))],
    );
    fuzz(2000, &path, |path| nothing(poses::load(path)));
}

#[test]
fn pickled_bodies_and_poses() {
    for body_file in ["smpl.pkl", "smpl_select.pkl"] {
        fuzz(1000, &support::data("small/bodies").join(body_file), |path| nothing(body::load(path)));
    }
    fuzz(2000, &support::data("small/bodies/aist_poses.pkl"), |path| nothing(poses::load(path)));
    for values in ["python2_0.pkl", "python3_0.pkl", "python3_2.pkl", "python3_4.pkl", "joblib.pkl"] {
        fuzz(1000, &support::data("small/pickles").join(values), |path| {
            let file = Pickle::read(path, "values")?;
            for key in file.root().keys()? {
                if let Ok(field) = file.get(&key) {
                    let _ = (field.array().is_ok(), field.rows().is_ok(), field.texts().is_ok());
                }
            }
            Ok(())
        });
    }
}

#[test]
fn npz_cameras() {
    let path = support::data("blender/datasets/multiview_ben/test_novel_view/cameras.npz");
    fuzz(1500, &path, |path| nothing(camera::load(path)));
}

#[test]
fn glb() {
    // A rig small enough for every part of it to be hit.
    let path = support::data("blender/models/ava_smpl24_4inf.glb");
    fuzz(400, &path, |path| nothing(body::load(path)).and(nothing(poses::load_clip(path, Some("twist")))));
}

#[test]
fn gltf_text() {
    // The document alone: its JSON is what mutations should hit, its buffer lies beside it.
    let bytes = std::fs::read(support::data("blender/models/ava_smpl24_4inf.glb")).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let mut json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    let (folder, path) = temporary("rig.gltf");
    let buffer = folder.path().join("rig.bin");
    std::fs::write(&buffer, &bytes[28 + length..]).unwrap();
    json["buffers"][0]["uri"] = "rig.bin".into();
    std::fs::write(&path, json.to_string()).unwrap();
    fuzz(1500, &path, |path| {
        let beside = path.with_file_name("rig.bin");
        if !beside.exists() {
            std::fs::copy(&buffer, beside).unwrap();
        }
        nothing(body::load(path)).and(nothing(poses::load_clip(path, Some("twist"))))
    });
}

#[test]
fn camera_json() {
    let (_folder, path) = temporary("camera.json");
    let text = r#"{"width": 64, "height": 48, "fx": 70.5, "fy": 71.5, "cx": 32, "cy": 24, "background": [0, 0.5, 1],
        "world_to_camera": [[1, 0, 0, 0.5], [0, -1, 0, 1.5], [0, 0, -1, 3], [0, 0, 0, 1]]}"#;
    std::fs::write(&path, text).unwrap();
    fuzz(2000, &path, |path| nothing(camera::load_views(path)));
}

#[test]
fn transforms_json() {
    let subject = support::data("blender/datasets/snapshot_ava/test_twist");
    let path = subject.join("transforms.json");
    fuzz(500, &path, |path| nothing(camera::load(path)).and(nothing(poses::load(path))));
    // Through the folder layout, errors may name any file of the subject.
    let folder = tempfile::tempdir().unwrap();
    let sequence = folder.path().join("test_twist");
    std::fs::create_dir(&sequence).unwrap();
    files::npz(&folder.path().join("small.npz"), &files::small_body());
    let options =
        Options { model: Some(folder.path().join("small.npz")), clothing: true, ..Options::default() };
    let bytes = std::fs::read(path).unwrap();
    let config =
        ProptestConfig { cases: 300 * effort(), failure_persistence: None, ..ProptestConfig::default() };
    proptest!(config, |(mutations in prop::collection::vec(mutation(), 1..4))| {
        std::fs::write(sequence.join("transforms.json"), mutated(&bytes, &mutations)).unwrap();
        let error = Subject::load(folder.path(), &options).unwrap_err();
        prop_assert!(error.path().starts_with(folder.path()), "{error}");
    });
}

#[test]
fn registry_toml() {
    let (_folder, path) = temporary("datasets.toml");
    std::fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets.toml"), &path).unwrap();
    fuzz(1500, &path, |path| nothing(Registry::load(path)));
}

#[test]
fn png() {
    let (_folder, path) = temporary("image.png");
    let mut image = Image::filled(9, 7, [0.5, 0.25, 1.0]);
    image.pixels_mut().iter_mut().enumerate().for_each(|(i, p)| p[0] = i as f32 / 64.0);
    frames::save_png(&path, &image).unwrap();
    fuzz(3000, &path, |path| nothing(frames::load_image(path)));
    frames::save_mask_png(&path, &Mask::filled(9, 7, 0.5)).unwrap();
    fuzz(1000, &path, |path| nothing(frames::load_mask(path)));
}
