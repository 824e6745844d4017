//! A subject as a folder of sequences.
//!
//! ```text
//! <subject>/<sequence>/transforms.json     model, cameras, frames (file, mask, camera, row of poses)
//!                      cameras.npz         the same cameras (used if there)
//!                      poses.npz           betas and poses (used if there; transforms.json may hold them instead)
//!                      images/*.png, masks/*.png, or camNN/images/*.png, camNN/masks/*.png
//! <subject>/gt_normal_offset.npy           clothing, (V) metres along the rest normals; see [`Options`]
//! models/<model>                           in the subject's folder or one of the two above it (of a link: above either end)
//! ```
//! Sequences named `train*` are for fitting, those named `test*` for evaluation, those named `val*` for choosing how to fit.

use super::models::{Doubt, Gender, Models, ShapeFit};
use super::poses::{self, PoseTrack};
use super::{Capture, Error, Sequence, camera, error, listing};
use super::{FrameFiles, FrameRef, FrameSource, MaskFile};
use serde::Deserialize;
use serde::de::IgnoredAny;
use skinsplat_core::scene::Camera;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// How a subject is loaded.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// A body model to use instead of the one that the sequences name, or a folder of models by gender.
    pub model: Option<PathBuf>,
    /// The gender of the body model where a data set tells it by gender, instead of the subject's own: some methods fit one
    /// template to everybody.
    pub gender: Option<Gender>,
    /// Displace the body by `gt_normal_offset.npy`. Off by default: an evaluation does not know the clothing.
    pub clothing: bool,
}

/// A person with training and test sequences.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The folder's name.
    pub id: String,
    /// How it was captured.
    pub capture: Capture,
    /// Sequences to fit on, by name.
    pub train: Vec<Sequence>,
    /// Sequences to evaluate on, by name.
    pub test: Vec<Sequence>,
    /// Sequences to choose settings on, by name: no table scores them unless it names them.
    pub val: Vec<Sequence>,
    /// What was guessed, left out or not read, a sentence each.
    pub notes: Vec<String>,
    /// What its own files say that may spoil its numbers.
    pub doubts: Vec<Doubt>,
    /// Shapes that were asked of its body models.
    pub shapes: Vec<ShapeFit>,
}

impl Subject {
    /// Loads every sequence of a subject; no image is decoded.
    ///
    /// # Errors
    /// A folder without sequences, missing files, inconsistent cameras, poses, frames or body.
    pub fn load(folder: &Path, options: &Options) -> Result<Self, Error> {
        let mut models = Models::new(folder, options);
        let mut split = |prefix: &str| -> Result<Vec<Sequence>, Error> {
            let names = sequence_folders(folder, prefix)?;
            names.iter().map(|name| load_sequence(&folder.join(name), name, &mut models)).collect()
        };
        let (train, test, val) = (split("train")?, split("test")?, split("val")?);
        let sequences = || train.iter().chain(&test);
        let cameras = sequences().map(|s| s.cameras.len()).max();
        let joints = sequences().map(|s| s.body.skeleton.num_joints()).max();
        let capture = capture_of(folder, cameras.zip(joints))?;
        let id = listing::file_name(folder);
        let subject = Self {
            id,
            capture,
            train,
            test,
            val,
            notes: models.notes().to_vec(),
            doubts: Vec::new(),
            shapes: Vec::new(),
        };
        Ok(models.told(subject))
    }

    /// All sequences, training first.
    pub fn sequences(&self) -> impl Iterator<Item = &Sequence> {
        self.train.iter().chain(&self.test).chain(&self.val)
    }

    /// A sequence by name.
    pub fn sequence(&self, id: &str) -> Option<&Sequence> {
        self.sequences().find(|s| s.id == id)
    }
}

/// True if a folder looks like a subject: it holds a sequence folder with `transforms.json`.
pub fn is_subject(folder: &Path) -> bool {
    ["train", "test"]
        .iter()
        .any(|prefix| sequence_folders(folder, prefix).is_ok_and(|names| !names.is_empty()))
}

/// How a subject was captured, found without loading its body.
///
/// # Errors
/// A folder without sequences, unreadable cameras or poses.
pub fn inspect(folder: &Path) -> Result<Capture, Error> {
    let mut most = None;
    for name in
        ["train", "test"].iter().map(|p| sequence_folders(folder, p)).collect::<Result<Vec<_>, _>>()?.concat()
    {
        let files = Files::of(&folder.join(name));
        let (cameras, joints) = most.unwrap_or((0, 0));
        let (more_cameras, more_joints) = (files.cameras()?.len(), files.poses()?.num_joints());
        most = Some((cameras.max(more_cameras), joints.max(more_joints)));
    }
    capture_of(folder, most)
}

/// From the largest numbers of cameras and joints of a subject's sequences.
fn capture_of(folder: &Path, cameras_and_joints: Option<(usize, usize)>) -> Result<Capture, Error> {
    match cameras_and_joints {
        None => {
            let expected = "folders train* and test* with transforms.json";
            Err(Error::invalid(folder, "sequences", "none", expected))
        }
        Some((2.., _)) => Ok(Capture::Multiview),
        Some((_, 55..)) => Ok(Capture::Hands),
        Some(_) => Ok(Capture::Monocular),
    }
}

fn sequence_folders(folder: &Path, prefix: &str) -> Result<Vec<String>, Error> {
    let folders = listing::folders(folder, "dataset")?;
    let names = folders.iter().filter(|path| path.join("transforms.json").is_file());
    let mut names: Vec<String> =
        names.map(|path| listing::file_name(path)).filter(|name| name.starts_with(prefix)).collect();
    names.sort();
    Ok(names)
}

/// The part of `transforms.json` that only it holds.
#[derive(Deserialize)]
struct Transforms {
    model: Option<String>,
    frames: Vec<ListedFrame>,
    #[serde(flatten)]
    others: BTreeMap<String, IgnoredAny>,
}

/// Keys of `transforms.json` that others read, or that describe it.
const OTHER_KEYS: [&str; 4] = ["betas", "cameras", "convention", "poses"];

#[derive(Deserialize)]
struct ListedFrame {
    file_path: String,
    mask_path: Option<String>,
    camera: usize,
    time: usize,
    #[serde(flatten)]
    others: BTreeMap<String, IgnoredAny>,
}

impl Transforms {
    /// What has to be said of it: keys that nothing reads, images that count more than once.
    fn notes(&self) -> Vec<String> {
        let top = self.others.keys().filter(|key| !OTHER_KEYS.contains(&key.as_str())).cloned();
        let in_frames = self.frames.iter().flat_map(|frame| frame.others.keys());
        let unread: BTreeSet<String> = top.chain(in_frames.map(|key| format!("frames.{key}"))).collect();
        let unread: Vec<String> = unread.iter().map(|key| key.escape_debug().to_string()).collect();
        let mut seen = BTreeSet::new();
        let again = self.frames.iter().find(|frame| !seen.insert((&frame.file_path, frame.camera)));
        let again =
            again.map(|frame| format!("{} is listed more than once, and counts as often", frame.file_path));
        (!unread.is_empty())
            .then(|| format!("not read: {}", unread.join(", ")))
            .into_iter()
            .chain(again)
            .collect()
    }
}

/// Where a sequence keeps its parts.
struct Files {
    folder: PathBuf,
    listing: PathBuf,
}

impl Files {
    fn of(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), listing: folder.join("transforms.json") }
    }

    fn cameras(&self) -> Result<Vec<Camera>, Error> {
        camera::load(&self.or_listing("cameras.npz")).map_err(|e| e.about("camera"))
    }

    fn poses(&self) -> Result<PoseTrack, Error> {
        poses::load(&self.or_listing("poses.npz")).map_err(|e| e.about("poses"))
    }

    fn or_listing(&self, name: &str) -> PathBuf {
        let own = self.folder.join(name);
        if own.is_file() { own } else { self.listing.clone() }
    }
}

fn load_sequence(folder: &Path, id: &str, models: &mut Models) -> Result<Sequence, Error> {
    let files = Files::of(folder);
    let transforms: Transforms =
        error::read_json(&files.listing, "frames", "model, cameras and frames of a sequence")?;
    transforms.notes().iter().for_each(|note| models.note(&files.listing, note));
    let cameras = files.cameras()?;
    let track = files.poses()?;
    let body = models.of_track(&files.or_listing("poses.npz"), transforms.model.as_deref(), &track)?;
    let poses = track.poses(&body.skeleton).map_err(|e| e.about("poses"))?;
    let frames = frames_of(&files, transforms.frames, poses.len(), cameras.len())?;
    Ok(Sequence { id: id.to_owned(), body, poses, cameras: cameras.into(), frames, stored_sizes: None })
}

fn frames_of(
    Files { folder, listing }: &Files,
    listed: Vec<ListedFrame>,
    poses: usize,
    cameras: usize,
) -> Result<Vec<FrameRef>, Error> {
    let below = |i: usize, field: &str, value: usize, limit: usize, what: &str| {
        if value < limit {
            return Ok(());
        }
        let expected = format!("an index below {limit} ({what})");
        Err(Error::invalid(listing, format!("frames[{i}].{field}"), value.to_string(), expected))
    };
    let present = |i: usize, field: &str, path: &str| {
        let file = folder.join(path);
        // Sequences of a subject may share images.
        let inside = listing::stays_inside(path, 1);
        if inside && file.is_file() {
            return Ok(file);
        }
        Err(Error::invalid(
            listing,
            format!("frames[{i}].{field}"),
            if inside {
                format!("no file {path}")
            } else {
                format!("{path} leads out of the subject's folder")
            },
            "a file of the sequence",
        ))
    };
    let frame = |(i, listed): (usize, ListedFrame)| {
        below(i, "time", listed.time, poses, "poses")?;
        below(i, "camera", listed.camera, cameras, "cameras")?;
        let image = present(i, "file_path", &listed.file_path)?;
        let mask = listed.mask_path.map(|path| present(i, "mask_path", &path)).transpose()?;
        let name = frame_name(&listed.file_path);
        Ok(FrameRef {
            name,
            time: listed.time,
            pose: listed.time,
            camera: listed.camera,
            source: FrameSource::Files(FrameFiles {
                image,
                mask: mask.map(MaskFile::from),
                background: None,
            }),
        })
    };
    listed.into_iter().enumerate().map(frame).collect()
}

/// `cam00/images/image_0004.png` -> `cam00/image_0004`.
fn frame_name(path: &str) -> String {
    let parts: Vec<&str> = path.split('/').filter(|part| *part != "images").collect();
    let name = parts.join("/");
    name.rsplit_once('.').map_or(name.clone(), |(stem, _)| stem.to_owned())
}
