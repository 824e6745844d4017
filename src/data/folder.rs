//! A subject as a folder of sequences.
//!
//! ```text
//! <subject>/<sequence>/transforms.json     model, cameras, frames (file, mask, camera, row of poses)
//!                      cameras.npz         the same cameras (used if there)
//!                      poses.npz           betas and poses (used if there; transforms.json may hold them instead)
//!                      images/*.png, masks/*.png, or camNN/images/*.png, camNN/masks/*.png
//! <subject>/gt_normal_offset.npy           clothing, (V) metres along the rest normals; see [`Options`]
//! models/<model>                           in the subject's folder or one of the two above it
//! ```
//! Sequences named `train*` are for fitting, those named `test*` for evaluation.

use super::{Error, Sequence, body, camera, error, npy, poses};
use super::{FrameRef, FrameSource};
use crate::scene::{Body, RestBody};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How a subject is loaded.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// A body model to use instead of the one that the sequences name.
    pub model: Option<PathBuf>,
    /// Displace the body by `gt_normal_offset.npy`. Off by default: an evaluation does not know the clothing.
    pub clothing: bool,
}

/// How a subject was captured, found by looking at the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Capture {
    /// One camera (PeopleSnapshot, NeuMan).
    Monocular,
    /// Several cameras in some sequence (GalaBasketball).
    MultiCamera,
    /// One camera and a body with hands and face, 55 joints (X-Humans).
    Expressive,
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
}

impl Subject {
    /// Loads every sequence of a subject; no image is decoded.
    ///
    /// # Errors
    /// A folder without sequences, missing files, inconsistent cameras, poses, frames or body.
    pub fn load(folder: &Path, options: &Options) -> Result<Self, Error> {
        let mut loader = Loader { folder, options, models: BTreeMap::new() };
        let mut split = |prefix: &str| -> Result<Vec<Sequence>, Error> {
            let names = sequence_folders(folder, prefix)?;
            names.iter().map(|name| loader.sequence(&folder.join(name), name)).collect()
        };
        let (train, test) = (split("train")?, split("test")?);
        let Some(capture) = capture(train.iter().chain(&test)) else {
            let expected = "folders train* and test* with transforms.json";
            return Err(Error::invalid(folder, "sequences", "none", expected));
        };
        let id = folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        Ok(Self { id, capture, train, test })
    }

    /// All sequences, training first.
    pub fn sequences(&self) -> impl Iterator<Item = &Sequence> {
        self.train.iter().chain(&self.test)
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

fn capture<'a>(sequences: impl Iterator<Item = &'a Sequence> + Clone) -> Option<Capture> {
    let joints = sequences.clone().map(|s| s.body.skeleton.num_joints()).max()?;
    let cameras = sequences.map(|s| s.cameras.len()).max()?;
    Some(match (cameras, joints) {
        (2.., _) => Capture::MultiCamera,
        (_, 55..) => Capture::Expressive,
        _ => Capture::Monocular,
    })
}

fn sequence_folders(folder: &Path, prefix: &str) -> Result<Vec<String>, Error> {
    let entries = std::fs::read_dir(folder)
        .map_err(|cause| Error::read(folder, "dataset", "a folder of sequences", cause))?;
    let mut names: Vec<String> = entries
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| name.starts_with(prefix) && folder.join(name).join("transforms.json").is_file())
        .collect();
    names.sort();
    Ok(names)
}

/// The part of `transforms.json` that only it holds.
#[derive(Deserialize)]
struct Transforms {
    model: Option<String>,
    frames: Vec<ListedFrame>,
}

#[derive(Deserialize)]
struct ListedFrame {
    file_path: String,
    mask_path: Option<String>,
    camera: usize,
    time: usize,
}

struct Loader<'a> {
    folder: &'a Path,
    options: &'a Options,
    models: BTreeMap<PathBuf, Model>,
}

/// A body model and the shapes of it that sequences share.
struct Model {
    body: Body,
    shapes: Vec<(Vec<f64>, Arc<RestBody>)>,
}

impl Loader<'_> {
    fn sequence(&mut self, folder: &Path, id: &str) -> Result<Sequence, Error> {
        let listing = folder.join("transforms.json");
        let transforms: Transforms =
            error::read_json(&listing, "frames", "model, cameras and frames of a sequence")?;
        let cameras = camera::load(&or(folder.join("cameras.npz"), &listing))?;
        let track = poses::load(&or(folder.join("poses.npz"), &listing))?;
        let model = self.model(&listing, transforms.model.as_deref())?;
        let body = self.shaped(&model, &track.betas)?;
        let poses = track.poses(&body.skeleton)?;
        let frames = frames_of(folder, &listing, transforms.frames, poses.len(), cameras.len())?;
        Ok(Sequence { id: id.to_owned(), body, poses, cameras, frames })
    }

    /// The body model that a sequence names, looked for in `models` beside and above the subject.
    fn model(&self, listing: &Path, name: Option<&str>) -> Result<PathBuf, Error> {
        if let Some(model) = &self.options.model {
            return Ok(model.clone());
        }
        let Some(name) = name else {
            return Err(Error::invalid(listing, "model", "missing", "the file name of a body model"));
        };
        let places = ["models", "../models", "../../models"].map(|place| self.folder.join(place).join(name));
        places.iter().find(|path| path.is_file()).cloned().ok_or_else(|| {
            let expected = "a file in models/ of the subject's folder or of one of the two above it";
            Error::invalid(listing, "model", format!("{name} not found"), expected)
        })
    }

    fn shaped(&mut self, model: &Path, betas: &[f64]) -> Result<Arc<RestBody>, Error> {
        if !self.models.contains_key(model) {
            let loaded = Model { body: body::load(model)?, shapes: Vec::new() };
            self.models.insert(model.to_owned(), loaded);
        }
        let Model { body, shapes } = self.models.get_mut(model).expect("inserted above");
        if let Some((_, rest)) = shapes.iter().find(|(known, _)| known == betas) {
            return Ok(rest.clone());
        }
        let offsets = self.folder.join("gt_normal_offset.npy");
        let mut rest = body.shaped(betas).map_err(|e| Error::scene(model, e))?;
        if self.options.clothing && offsets.is_file() {
            let array = npy::read(&offsets)?;
            let values: Vec<f32> = array.values.iter().map(|&v| v as f32).collect();
            rest = rest.with_normal_offset(&values).map_err(|e| Error::scene(&offsets, e))?;
        }
        let rest = Arc::new(rest);
        shapes.push((betas.to_vec(), rest.clone()));
        Ok(rest)
    }
}

fn or(preferred: PathBuf, fallback: &Path) -> PathBuf {
    if preferred.is_file() { preferred } else { fallback.to_owned() }
}

fn frames_of(
    folder: &Path,
    listing: &Path,
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
        if file.is_file() {
            return Ok(file);
        }
        Err(Error::invalid(
            listing,
            format!("frames[{i}].{field}"),
            format!("no file {path}"),
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
            pose: listed.time,
            camera: listed.camera,
            source: FrameSource::Files { image, mask },
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
