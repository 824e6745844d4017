//! Frames that another program has rendered: a folder of images, paired with the frames of a sequence by name.

use super::Error;
use super::drawable::Behind;
use crate::experiment::{LeftOver, RenderedFrames};
use serde::Deserialize;
use skinsplat_core::scene::{Camera, Image, Mask};
use skinsplat_data::avatar::file_digest;
use skinsplat_data::{Error as DataError, Sequence, Truth, error, frames, listing};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// What a folder may say about its frames, in `renders.json`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Said {
    /// Gaussians of the avatar.
    splats: Option<u64>,
    /// Size of the avatar, bytes.
    bytes: Option<u64>,
    /// Time of a frame, milliseconds.
    milliseconds: Option<f64>,
}

/// The name of the file that says more than images do.
const SAID: &str = "renders.json";
/// Folders that are no part of a frame's name; nerfbaselines keeps its predictions in `color`.
const UNNAMED: [&str; 2] = ["images", "color"];
/// How deep images lie at most.
const DEPTH: usize = 4;

/// The place of the renders of a sequence: `{subject}` and `{sequence}` in a path stand for their ids.
pub(super) fn place(path: &Path, subject: &str, sequence: &str) -> PathBuf {
    match path.to_str() {
        Some(text) => text.replace("{subject}", subject).replace("{sequence}", sequence).into(),
        None => path.to_owned(),
    }
}

/// What lies in a folder of renders, whatever they are of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderFolder {
    /// Names of the images, as frames would be named, sorted.
    pub frames: Vec<String>,
    /// Width and height of the first.
    pub size: Option<[usize; 2]>,
    /// What `renders.json` says: names and numbers.
    pub said: Vec<(&'static str, String)>,
}

/// What lies in a folder of images; none if it holds no image.
///
/// # Errors
/// Files that cannot be read, two images of one name, a `renders.json` with other fields.
pub fn look(folder: &Path) -> Result<Option<RenderFolder>, DataError> {
    let images = images_of(folder)?;
    let Some(first) = images.values().next() else { return Ok(None) };
    let (image, _) = frames::load_image(first)?;
    let Said { splats, bytes, milliseconds } = said(folder)?;
    let said = [
        ("splats", splats.map(|n| n.to_string())),
        ("bytes", bytes.map(|n| n.to_string())),
        ("milliseconds", milliseconds.map(|n| n.to_string())),
    ];
    let said = said.into_iter().filter_map(|(name, value)| Some((name, value?))).collect();
    let size = Some([image.width(), image.height()]);
    Ok(Some(RenderFolder { frames: images.into_keys().collect(), size, said }))
}

/// What a folder says about its frames.
fn said(folder: &Path) -> Result<Said, DataError> {
    let path = folder.join(SAID);
    match path.is_file() {
        true => error::read_json(&path, "renders", "splats, bytes and milliseconds, each a number"),
        false => Ok(Said::default()),
    }
}

/// What lies in a folder, paired with the frames of a sequence. A folder that is not there has no frames.
///
/// # Errors
/// Files that cannot be read, two images of one frame, a `renders.json` with other fields.
pub(super) fn describe(path: &Path, subject: &str, sequence: &Sequence) -> Result<RenderedFrames, DataError> {
    let folder = place(path, subject, &sequence.id);
    let images = match folder.is_dir() {
        true => images_of(&folder)?,
        false => BTreeMap::new(),
    };
    let found = |name: &str| images.get(name).or_else(|| images.get(name.rsplit('/').next()?));
    let paired = sequence.frames.iter().filter_map(|f| Some((f.name.clone(), found(&f.name)?.clone())));
    let frames: BTreeMap<String, PathBuf> = paired.collect();
    let left_over = left_over(&images, &frames);
    let digests: BTreeMap<&str, String> = frames
        .iter()
        .map(|(name, file)| Ok((name.as_str(), file_digest(file)?)))
        .collect::<Result<_, DataError>>()?;
    let digest = skinsplat_data::key::content_key(&serde_json::json!(digests));
    let Said { splats, bytes, milliseconds } = said(&folder)?;
    let (path, sequence) = (path.to_owned(), sequence.id.clone());
    Ok(RenderedFrames { path, folder, sequence, frames, left_over, digest, splats, bytes, milliseconds })
}

/// The images that no frame was paired with.
fn left_over(images: &BTreeMap<String, PathBuf>, paired: &BTreeMap<String, PathBuf>) -> Option<LeftOver> {
    let used: BTreeSet<&PathBuf> = paired.values().collect();
    let mut others = images.iter().filter(|(_, file)| !used.contains(file)).map(|(name, _)| name);
    let first = others.next()?.clone();
    Some(LeftOver { count: 1 + others.count(), first })
}

/// Every image below a folder, by its name: the path without extension and without folders that only sort files.
fn images_of(folder: &Path) -> Result<BTreeMap<String, PathBuf>, DataError> {
    let own = folder.join("color");
    let root = if own.is_dir() { own } else { folder.to_owned() };
    let mut found = BTreeMap::new();
    collect(&root, "", DEPTH, &mut found)?;
    Ok(found)
}

fn collect(
    folder: &Path,
    prefix: &str,
    depth: usize,
    found: &mut BTreeMap<String, PathBuf>,
) -> Result<(), DataError> {
    for image in listing::files(folder, "renders", &["png", "jpg", "jpeg", "npy"])? {
        let stem = image.file_stem().unwrap_or_default().to_string_lossy();
        if let Some(other) = found.insert(format!("{prefix}{stem}"), image.clone()) {
            let problem = format!("the name of {} too", other.display());
            return Err(DataError::invalid(&image, "frame", problem, "one image per frame"));
        }
    }
    if depth == 0 {
        return Ok(());
    }
    for inner in listing::folders(folder, "renders")? {
        let name = inner.file_name().unwrap_or_default().to_string_lossy();
        let named = !UNNAMED.contains(&name.as_ref());
        let prefix = if named { format!("{prefix}{name}/") } else { prefix.to_owned() };
        collect(&inner, &prefix, depth - 1, found)?;
    }
    Ok(())
}

/// The image of a frame, of the size of its camera, over what is behind it if it has alpha.
///
/// # Errors
/// A frame without an image, an image of another size than the frame's truth.
pub(super) fn draw(
    renders: &RenderedFrames,
    name: &str,
    camera: &Camera,
    stored: [u32; 2],
    behind: Behind<'_>,
) -> Result<Image, Error> {
    let gap = || {
        let expected = "an image of the frame's name";
        DataError::invalid(&renders.folder, format!("frame {name}"), "no image", expected)
    };
    let path = renders.frames.get(name).ok_or_else(gap)?;
    let (rgb, alpha) = frames::load_image(path)?;
    let size = [rgb.width() as u32, rgb.height() as u32];
    let wanted = [camera.width, camera.height];
    if size != wanted && size != stored {
        let problem = format!("{}x{}", size[0], size[1]);
        let expected = format!("{}x{}, the size of the frame", stored[0], stored[1]);
        return Err(DataError::invalid(path, "image size", problem, expected).into());
    }
    let alpha = alpha.unwrap_or_else(|| Mask::filled(rgb.width(), rgb.height(), 1.0));
    let truth = Truth::new(rgb, alpha).reduced(wanted);
    Ok(behind.around(&truth.rgb, &truth.alpha)?)
}
