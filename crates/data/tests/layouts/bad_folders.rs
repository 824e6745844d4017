//! Damaged folders: one line each that names file and field, no panic, no memory beyond what a file holds.

use super::names::copy;
use super::{SPLIT, load, model, place};
use skinsplat_data::layouts::Split;
use skinsplat_data::{Error, Subject};
use std::path::{Path, PathBuf};

struct Kind {
    layout: &'static str,
    folder: &'static str,
    model: Option<&'static str>,
    split: Option<Split>,
}

const KINDS: [Kind; 6] = [
    Kind { layout: "neuman", folder: "neuman/ava", model: Some("anny_smpl24.npz"), split: Some(SPLIT) },
    Kind { layout: "neuman", folder: "neuman/own", model: Some("anny_smpl24.npz"), split: Some(SPLIT) },
    Kind {
        layout: "peoplesnapshot",
        folder: "peoplesnapshot/ava",
        model: Some("anny_smpl24.npz"),
        split: None,
    },
    Kind {
        layout: "peoplesnapshot-raw",
        folder: "peoplesnapshot-raw/someone",
        model: None,
        split: Some(Split { train: [0, 3, 1], test: [4, 5, 1] }),
    },
    Kind { layout: "xhumans", folder: "xhumans/00099", model: Some("anny_smplx55.npz"), split: None },
    Kind { layout: "galabasketball", folder: "galabasketball/ball", model: None, split: None },
];

impl Kind {
    fn model(&self) -> Option<PathBuf> {
        self.model.map_or_else(|| Some(place("models/SMPL_NEUTRAL.npz")), model)
    }

    fn load(&self, folder: &Path) -> Result<Subject, Error> {
        load(self.layout, folder, self.model(), self.split.as_ref())
    }

    /// Everything that a run asks of a subject.
    fn read(&self, folder: &Path) -> Result<(), Error> {
        let subject = self.load(folder)?;
        for sequence in subject.sequences() {
            sequence.digest()?;
            for frame in 0..sequence.frames.len() {
                sequence.truth(frame)?;
            }
        }
        Ok(())
    }
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { found.extend(files(&path)) } else { found.push(path) }
    }
    found.sort();
    found
}

fn one_line(error: &Error, what: &str) {
    let text = error.to_string();
    assert_eq!(text.lines().count(), 1, "{what}: {text}");
    assert!(text.len() < 1000 && text.contains("; expected "), "{what}: {text}");
    assert!(error.path().as_os_str().len() > 1 && !error.field().is_empty(), "{what}: {text}");
}

/// One file of each kind: the first of a folder by extension.
fn representatives(folder: &Path) -> Vec<PathBuf> {
    let mut seen = std::collections::BTreeSet::new();
    let kind = |path: &PathBuf| (path.parent().unwrap().to_owned(), path.extension().map(ToOwned::to_owned));
    files(folder)
        .into_iter()
        .filter(|path| !path.ends_with("expected.npz") && seen.insert(kind(path)))
        .collect()
}

#[test]
fn half_files_empty_files_and_missing_files_are_named() {
    let mut untold = Vec::new();
    for kind in KINDS {
        let folder = tempfile::tempdir().unwrap();
        let subject = folder.path().join("subject");
        copy(&place(kind.folder), &subject);
        kind.read(&subject).unwrap();
        for path in representatives(&subject) {
            let whole = std::fs::read(&path).unwrap();
            let name = format!("{} {}", kind.layout, path.strip_prefix(&subject).unwrap().display());
            for damage in ["half", "empty", "missing", "noise"] {
                match damage {
                    "half" => std::fs::write(&path, &whole[..whole.len() / 2]).unwrap(),
                    "empty" => std::fs::write(&path, b"").unwrap(),
                    "noise" => {
                        std::fs::write(&path, whole.iter().map(|b| b ^ 0x5a).collect::<Vec<_>>()).unwrap()
                    }
                    _ => std::fs::remove_file(&path).unwrap(),
                }
                let what = format!("{name}, {damage}");
                match kind.read(&subject) {
                    Err(error) => {
                        one_line(&error, &what);
                        let word = subject_of(&path).filter(|_| error.path() == path);
                        untold.extend(
                            word.filter(|word| !error.field().contains(word))
                                .map(|word| format!("{what}, {word}: {error}")),
                        );
                    }
                    Ok(()) => assert!(may_pass(&path, damage), "{what}: taken without a word"),
                }
            }
            std::fs::write(&path, &whole).unwrap();
        }
    }
    assert!(untold.is_empty(), "fields that do not say what they are about: {untold:#?}");
}

/// The word by which the field of an error about a file tells what it is about.
fn subject_of(path: &Path) -> Option<&'static str> {
    const WORDS: [(&[&str], &str); 6] = [
        (&["mean_shape"], "betas"),
        (&["/camera/", "cameras.", "camera.pkl"], "camera"),
        (&["/pose/", "/poses", "_poses", "/SMPLX/", "/smpl_", "alignments"], "poses"),
        (&["/masks/", "masks.hdf5", "segmentations", "_mask"], "mask"),
        (&["/model/"], "body model"),
        (&["/images/", "/image/", "/frames/", "images.txt", "/0/"], "image"),
    ];
    let text = path.display().to_string();
    let fits = |(parts, _): &&(&[&str], &str)| parts.iter().any(|part| text.contains(part));
    WORDS.iter().find(fits).map(|(_, word)| *word)
}

/// What need not be there: `own` files of a layout that has others, and files that nobody reads.
fn may_pass(path: &Path, damage: &str) -> bool {
    let text = path.display().to_string();
    let unread = ["/segmentations/", "_mask", "consensus.pkl", "config.json"];
    // NeuMan's masks are not read where HUGS's are; a clothed shape and a configuration are optional; half a line less of a
    // text may be nothing.
    unread.iter().any(|part| text.contains(part)) || (damage == "missing" && text.contains("poses/anim_nerf"))
}

#[test]
fn bytes_that_are_changed_never_panic() {
    let mut random = 7u64;
    let mut next = move || {
        random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (random >> 33) as usize
    };
    for kind in KINDS {
        let folder = tempfile::tempdir().unwrap();
        let subject = folder.path().join("subject");
        copy(&place(kind.folder), &subject);
        for path in representatives(&subject) {
            let image = path.extension().is_some_and(|e| e == "png");
            let whole = std::fs::read(&path).unwrap();
            for _ in 0..if image { 2 } else { 12 } {
                let mut bytes = whole.clone();
                for _ in 0..1 + next() % 4 {
                    let at = next() % bytes.len();
                    bytes[at] = [0, 0xff, 0x7f, next() as u8][next() % 4];
                }
                std::fs::write(&path, &bytes).unwrap();
                if let Err(error) = kind.load(&subject) {
                    one_line(&error, &path.display().to_string());
                }
            }
            std::fs::write(&path, &whole).unwrap();
        }
    }
}

/// A change of a copied folder, and what its error must name.
type Case = (&'static str, fn(&Path), &'static str, &'static str);

fn refused(kind: &Kind, cases: &[Case]) {
    for (what, damage, field, part) in cases {
        let folder = tempfile::tempdir().unwrap();
        let subject = folder.path().join("subject");
        copy(&place(kind.folder), &subject);
        damage(&subject);
        let error = kind.read(&subject).expect_err(what);
        one_line(&error, what);
        assert_eq!(error.field(), *field, "{what}: {error}");
        assert!(error.to_string().contains(part), "{what}: {error}");
    }
}

fn remove(path: PathBuf) {
    std::fs::remove_file(path).unwrap();
}

fn replace(path: PathBuf, from: &str, to: &str) {
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{}: no {from}", path.display());
    std::fs::write(path, text.replacen(from, to, 1)).unwrap();
}

#[test]
fn neuman_names_what_does_not_match() {
    refused(
        &KINDS[0],
        &[
            ("an image is missing", |f| remove(f.join("images/00004.png")), "images", "no file 00004.png"),
            (
                "a mask is missing",
                |f| remove(f.join("4d_humans/sam_segmentations/mask_0004.png")),
                "masks",
                "7 files; expected 8",
            ),
            (
                "unpadded names",
                |f| replace(f.join("sparse/images.txt"), "00004.png", "4.png"),
                "image names",
                "numbers of one width",
            ),
            (
                "a camera model",
                |f| replace(f.join("sparse/cameras.txt"), "PINHOLE", "FOV"),
                "camera line 4",
                "camera model FOV",
            ),
            (
                "an unknown camera",
                |f| replace(f.join("sparse/images.txt"), " 3 00004.png", " 9 00004.png"),
                "image line 13",
                "camera 9",
            ),
            (
                "an image fewer in the model",
                |f| {
                    let path = f.join("sparse/images.txt");
                    let text = std::fs::read_to_string(&path).unwrap();
                    let lines: Vec<&str> = text.lines().collect();
                    let at = lines.iter().position(|line| line.ends_with("00004.png")).unwrap();
                    let kept = [&lines[..at], &lines[at + 2..]].concat();
                    std::fs::write(path, kept.join("\n")).unwrap();
                },
                "masks",
                "8 files; expected 7",
            ),
            (
                "COLMAP's binary model only",
                |f| std::fs::rename(f.join("sparse/cameras.txt"), f.join("sparse/cameras.bin")).unwrap(),
                "cameras",
                "model_converter",
            ),
        ],
    );
    let folder = place("neuman/ava");
    let error = load("neuman", &folder, model("anny_smpl24.npz"), None).unwrap_err().to_string();
    assert!(error.contains("images: 8 registered; expected at least 10"), "{error}");
    refused(
        &KINDS[1],
        &[
            ("no poses", |f| remove(f.join("smpl_output_optimized.pkl")), "poses", "4d_humans/"),
            (
                "masks turned over",
                |f| {
                    let mask = f.join("segmentations/00003.png");
                    let stored = skinsplat_data::frames::load_mask(&mask).unwrap();
                    let dim = stored.values().iter().map(|v| v * 0.5).collect();
                    let dim = skinsplat_core::scene::Mask::new(64, 64, dim).unwrap();
                    skinsplat_data::frames::save_mask_png(&mask, &dim).unwrap();
                },
                "mask",
                "no pixel has the highest value",
            ),
        ],
    );
}

#[test]
fn the_other_layouts_name_what_does_not_match() {
    refused(
        &KINDS[2],
        &[
            ("no mask of a frame", |f| remove(f.join("masks/mask_0003.npy")), "masks", "frame 3 is missing"),
            (
                "masks one off",
                |f| remove(f.join("masks/mask_0000.npy")),
                "masks",
                "the first has the number 1",
            ),
            (
                "a step of 0",
                |f| {
                    replace(
                        f.join("config.json"),
                        "\"train\": {\"start\": 0, \"end\": 5, \"skip\": 1",
                        "\"train\": {\"start\": 0, \"end\": 5, \"skip\": 0",
                    )
                },
                "split.train",
                "within the 8 images",
            ),
            ("a video that is too short", |f| remove(f.join("images/image_0007.png")), "poses", "expected 7"),
        ],
    );
    refused(
        &KINDS[3],
        &[
            ("a frame is missing", |f| remove(f.join("images/frame_3.png")), "frames", "frame 2 is missing"),
            (
                "the video only",
                |f| {
                    std::fs::remove_dir_all(f.join("images")).unwrap();
                    std::fs::write(f.join("subject.mp4"), b"x").unwrap();
                },
                "frames",
                "ffmpeg -i subject.mp4 -start_number 0 frames/%06d.png",
            ),
            (
                "masks that were cut off",
                |f| {
                    let path = f.join("masks.hdf5");
                    let whole = std::fs::read(&path).unwrap();
                    std::fs::write(path, &whole[..whole.len() - 100]).unwrap();
                },
                "masks",
                "the file ends early, after ",
            ),
            ("which is the first", |f| remove(f.join("images/frame_6.png")), "frames", "-start_number 0"),
        ],
    );
    refused(
        &KINDS[4],
        &[
            ("a gender", |f| std::fs::write(f.join("gender.txt"), "robot\n").unwrap(), "gender", "robot"),
            (
                "a depth map",
                |f| remove(f.join("train/Take4/render/depth/depth_000014.tiff")),
                "depth",
                "depth_000014.tiff",
            ),
            (
                "a pose",
                |f| remove(f.join("train/Take4/SMPLX/mesh-f00014_smplx.pkl")),
                "poses",
                "mesh-f00014_smplx.pkl",
            ),
            (
                "an image",
                |f| remove(f.join("train/Take4/render/image/color_000011.png")),
                "images",
                "frame 11 is missing; expected color_000011.png: depth has it",
            ),
            (
                "no take",
                |f| {
                    std::fs::remove_dir_all(f.join("train")).unwrap();
                    std::fs::remove_dir_all(f.join("test")).unwrap();
                },
                "takes",
                "folders in train/ and test/",
            ),
        ],
    );
    refused(
        &KINDS[5],
        &[
            ("a pose", |f| remove(f.join("pose/0004.txt")), "poses", "0004.txt"),
            ("a background", |f| remove(f.join("bg/6.png")), "background", "missing"),
            ("a camera", |f| remove(f.join("camera/6.txt")), "cameras", "missing"),
            (
                "two players",
                |f| {
                    let path = f.join("pose/0000.txt");
                    let text = std::fs::read_to_string(&path).unwrap();
                    std::fs::write(path, text.repeat(2)).unwrap();
                },
                "poses",
                "2 players",
            ),
            (
                "a parent",
                |f| replace(f.join("model/jointParent.txt"), "-1\n0", "-1\n99"),
                "body model line 2",
                "a joint below 27",
            ),
            (
                "a mirrored joint",
                |f| {
                    let row = "0.871354992,0.0242893001,0.490051536";
                    replace(f.join("model/tpose_mat.txt"), row, "-0.871354992,-0.0242893001,-0.490051536");
                },
                "body model matrices[0]",
                "determinant -1.000",
            ),
            ("a number", |f| replace(f.join("pose/0000.txt"), ",", ",x"), "poses line 1", "a number"),
        ],
    );
}
