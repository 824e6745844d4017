//! What a folder holds: a run, an export of an avatar, a subject in one of the layouts, renders of another program, or folders of them.

use super::{avatar_text, json_text, line, notes_text, store_text};
use crate::cli::products::AVATARS;
use anyhow::{Result, bail};
use skinsplat::run::renders::{self, RenderFolder};
use skinsplat::run::{store, subject_notes};
use skinsplat_core::scene::Camera;
use skinsplat_data::avatar::read_avatar;
use skinsplat_data::folder::{Options, is_subject};
use skinsplat_data::layouts::{self, Contents, Request};
use skinsplat_data::{FrameSource, Sequence, Subject, listing, splatting_avatar};
use std::path::{Path, PathBuf};

/// Everything of a folder.
pub(super) fn text(path: &Path) -> Result<String> {
    let stores = store::stores(path)?;
    if path.join("results.json").is_file() || !stores.is_empty() {
        return run_text(path, &stores);
    }
    if path.join(splatting_avatar::GAUSSIANS).is_file() || path.join("point_cloud").is_dir() {
        return Ok(avatar_text(&read_avatar(path)?));
    }
    if let Some(contents) = layouts::contents(path) {
        return subject_text(path, &contents);
    }
    let inner = path.join("datasets");
    let parent = if inner.is_dir() { &inner } else { path };
    if let Some(text) = folders_text(parent)? {
        return Ok(text);
    }
    if let Some(folder) = renders::look(path)? {
        return Ok(renders_text(&folder));
    }
    let known: Vec<&str> = layouts::LAYOUTS.iter().map(|layout| layout.id).collect();
    let expected = "an avatar's export, a subject or a folder of subjects (layouts";
    bail!(
        "{}: folder: nothing that is known; expected {expected} {}), or images",
        path.display(),
        known.join(", ")
    )
}

/// A folder of subjects, or of data sets that are such folders: what each folder in it is, and everything of its subjects.
fn folders_text(parent: &Path) -> Result<Option<String>> {
    let folders = listing::folders(parent, "subjects")?;
    let own = layouts::subjects(parent);
    let inner: Vec<Vec<(PathBuf, Contents)>> =
        folders.iter().map(|folder| layouts::subjects(folder)).collect();
    if own.is_empty() && inner.iter().all(Vec::is_empty) {
        return Ok(None);
    }
    let kind = if own.is_empty() { "folder of data sets" } else { "folder of subjects" };
    let mut text = line("kind", kind);
    for (folder, inner) in folders.iter().zip(&inner) {
        let subject = own.iter().find(|(path, _)| path == folder).map(|(_, contents)| contents);
        text += &line(&name_of(folder), folder_kind(subject, inner));
    }
    for (folder, contents) in &own {
        text += &format!("{}\n", folder.display());
        text += &subject_text(folder, contents)?;
    }
    Ok(Some(text))
}

/// What one of several folders is, in a line.
fn folder_kind(subject: Option<&Contents>, inner: &[(PathBuf, Contents)]) -> String {
    if let Some(contents) = subject {
        let lacks = if contents.missing.is_empty() { "" } else { ", not complete" };
        return format!("subject, layout {}{lacks}", contents.layout.id);
    }
    if inner.is_empty() {
        return "no layout that is known".to_owned();
    }
    let of_layout = |id: &&str| {
        let names: Vec<String> = (inner.iter().filter(|(_, contents)| contents.layout.id == *id))
            .map(|(path, _)| name_of(path))
            .collect();
        format!("layout {id}: {}", names.join(" "))
    };
    let ids = layouts::LAYOUTS.iter().map(|layout| layout.id);
    let used: Vec<&str> =
        ids.filter(|id| inner.iter().any(|(_, contents)| contents.layout.id == *id)).collect();
    format!("data set, {}", used.iter().map(of_layout).collect::<Vec<_>>().join("; "))
}

fn name_of(folder: &Path) -> String {
    folder.file_name().unwrap_or_default().to_string_lossy().escape_debug().to_string()
}

/// A run of this program: its tables, if it is done, and its stores.
fn run_text(path: &Path, stores: &[PathBuf]) -> Result<String> {
    let mut text = line("kind", "run of reproduce");
    let results = path.join("results.json");
    text += &match results.is_file() {
        true => json_text(&results)?,
        false => line("results.json", "not there yet: no table is done"),
    };
    for file in stores {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        text += &(line("store", name) + &store_text(file)?);
    }
    let avatars = path.join(AVATARS);
    // One checksum each.
    let whole = |entry: &std::fs::DirEntry| entry.path().extension().is_some_and(|e| e == "sha256");
    let made = std::fs::read_dir(&avatars).map_or(0, |dir| dir.flatten().filter(whole).count());
    Ok(text + &line("avatars made", made))
}

/// A subject: what lies there, what is missing, and what is read of it.
fn subject_text(path: &Path, contents: &Contents) -> Result<String> {
    let mut text =
        line("kind", format!("subject, layout {}: {}", contents.layout.id, contents.layout.summary));
    for found in &contents.found {
        let files = if found.files == 1 { "1 file".to_owned() } else { format!("{} files", found.files) };
        text += &line(found.part.what, format!("{files}: {}", found.part.place));
    }
    text += &contents.missing.iter().map(|missing| line("missing", missing)).collect::<String>();
    let request = Request { folder: path, split: None, options: &Options::default() };
    Ok(match (contents.layout.load)(&request) {
        Ok(subject) => text + &loaded_text(&subject),
        // A folder of this project's own is right or wrong; somebody else's may be half unpacked.
        Err(error) if is_subject(path) => return Err(error.into()),
        Err(error) => text + &line("not read", error),
    })
}

fn loaded_text(subject: &Subject) -> String {
    let mut text =
        line("subject", &subject.id) + &line("capture", format!("{:?}", subject.capture).to_lowercase());
    if let Some(sequence) = subject.sequences().next() {
        let body = &sequence.body;
        let (vertices, joints) = (body.vertices.len(), body.skeleton.num_joints());
        text += &line("body model", format!("{vertices} vertices, {joints} joints"));
    }
    text += &subject.sequences().map(sequence_text).collect::<String>();
    text + &notes_text(&subject_notes(subject))
}

fn sequence_text(sequence: &Sequence) -> String {
    let (frames, poses, cameras) = (sequence.frames.len(), sequence.poses.len(), sequence.cameras.len());
    let masked = |source: &FrameSource| match source {
        FrameSource::Files(files) => files.mask.is_some(),
        FrameSource::Generated { .. } => true,
    };
    let masks = sequence.frames.iter().filter(|frame| masked(&frame.source)).count();
    let size = |camera: &Camera| format!(", images of {}x{}", camera.width, camera.height);
    let size = sequence.cameras.first().map_or(String::new(), size);
    line(&sequence.id, format!("{frames} frames, {poses} poses, {cameras} cameras, {masks} masks{size}"))
}

fn renders_text(RenderFolder { frames, size, said }: &RenderFolder) -> String {
    let mut text = line("kind", "images: renders of another program, for --renders VARIANT=FOLDER");
    let (first, last) = (frames.first(), frames.last());
    let ends = first.zip(last).map_or(String::new(), |(first, last)| format!(", {first} to {last}"));
    text += &line("frames", format!("{}{ends}", frames.len()));
    if let Some([width, height]) = size {
        text += &line("size of the first", format!("{width}x{height}"));
    }
    text += &said.iter().map(|(name, value)| line(name, value)).collect::<String>();
    text
}
