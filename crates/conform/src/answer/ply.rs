//! Posed PLY files of 3DGS: one, or a folder with one per pose.

use super::super::Error;
use super::super::sample::{Field, Fields, Storage};
use super::layout::take_sh;
use super::{Answer, Expected, blank, put};
use skinsplat_core::scene::Gaussians;
use skinsplat_data::ply::{self, Dialect};
use std::path::{Path, PathBuf};

/// One file; the caller says which pose it is, else a number at the end of its name.
pub(super) fn single(path: &Path, expected: &Expected) -> Result<Answer, Error> {
    let mut answer = read(path, expected)?;
    let numbered = number(path).filter(|&n| n < expected.poses);
    if let (None, Some(n)) = (expected.frame, numbered) {
        answer.notes.push(format!("taken for pose {n}, from its name"));
    }
    answer.frames = expected.frame.or(numbered).map(|frame| vec![frame]);
    Ok(answer)
}

/// A folder of files, one per pose.
pub(super) fn folder(path: &Path, expected: &Expected) -> Result<Answer, Error> {
    let place = || format!("{}: answer", path.display());
    let entries = std::fs::read_dir(path)
        .map_err(|cause| Error::new(place(), format!("cannot read: {cause}"), "a folder of PLY files"))?;
    let is_ply = |path: &PathBuf| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply"));
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).filter(is_ply).collect();
    files.sort();
    if files.is_empty() {
        return Err(Error::new(place(), "no PLY file", "a PLY file per pose"));
    }
    let mut frames: Vec<usize> = files.iter().filter_map(|file| number(file)).collect();
    let mut sorted = frames.clone();
    sorted.sort_unstable();
    sorted.dedup();
    let named = sorted.len() == files.len() && sorted.last().is_some_and(|&n| n < expected.poses);
    let mut notes = Vec::new();
    if !named {
        frames = (0..files.len()).collect();
        notes.push("files are taken for poses 0, 1, … in the order of their names".to_owned());
    }
    if let (true, Some(frame)) = (files.len() > 1, expected.frame) {
        let expected =
            format!("none with a folder of {} PLY files, whose names say their poses", files.len());
        return Err(Error::new("--frame", frame.to_string(), expected).within(path));
    }
    frames = expected.frame.map_or(frames, |frame| vec![frame]);
    if files.len() > expected.poses {
        let problem = format!("{} PLY files", files.len());
        return Err(Error::new(place(), problem, format!("at most {} poses", expected.poses)));
    }
    let mut all = Answer {
        storage: Storage::Logarithms,
        frames: Some(frames),
        present: Fields::default(),
        samples: Vec::new(),
        halves: Fields::default(),
        declared: None,
        notes,
    };
    for (i, file) in files.iter().enumerate() {
        let one = read(file, expected)?;
        all.present = if i == 0 { one.present } else { all.present.and(one.present) };
        all.samples.extend(one.samples);
        let news: Vec<String> = one.notes.into_iter().filter(|note| !all.notes.contains(note)).collect();
        all.notes.extend(news);
    }
    Ok(all)
}

/// The last number in the name of a file.
fn number(path: &Path) -> Option<usize> {
    let stem = path.file_stem()?.to_str()?;
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem[..end].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |at| at + 1);
    stem[start..end].parse().ok()
}

fn read(path: &Path, expected: &Expected) -> Result<Answer, Error> {
    let stored = ply::read(path)?;
    let gaussians = &stored.avatar.gaussians;
    if gaussians.len() != expected.gaussians {
        let place = format!("{}: vertex", path.display());
        let problem = format!("{} Gaussians", gaussians.len());
        return Err(Error::new(place, problem, format!("{}, in the order of the rig", expected.gaussians)));
    }
    finite(path, gaussians)?;
    let mut notes = stored.notes;
    if stored.dialect == Dialect::Compressed {
        notes.push("compressed: its numbers are rounded".to_owned());
    }
    Ok(answer(gaussians, notes))
}

/// Refuses infinite logarithms and logits, which readers of PLY take for what vanishes or is opaque: nothing in the rig is.
fn finite(path: &Path, gaussians: &Gaussians) -> Result<(), Error> {
    let scales = gaussians.log_scales.iter().enumerate().flat_map(|(i, v)| {
        v.to_array().into_iter().enumerate().map(move |(k, v)| (i, format!("scale_{k}"), v))
    });
    let logits = gaussians.opacity_logits.iter().enumerate().map(|(i, &v)| (i, "opacity".to_owned(), v));
    match scales.chain(logits).find(|(_, _, v)| !v.is_finite()) {
        None => Ok(()),
        Some((i, name, v)) => Err(Error::new(
            format!("{}: vertex {i}: {name}", path.display()),
            v.to_string(),
            "a finite number",
        )),
    }
}

fn answer(gaussians: &Gaussians, notes: Vec<String>) -> Answer {
    let mut answer = Answer {
        storage: Storage::Logarithms,
        frames: None,
        present: [Field::Means, Field::Quaternions, Field::Scales, Field::Opacities].into_iter().collect(),
        samples: blank(1, gaussians.len()),
        halves: Fields::default(),
        declared: None,
        notes,
    };
    let wide = |v: &[f32]| v.iter().map(|&c| f64::from(c)).collect::<Vec<_>>();
    let flat = |v: &[glam::Vec3]| v.iter().flat_map(|v| v.to_array()).map(f64::from).collect::<Vec<_>>();
    put(&mut answer.samples, Field::Means, &flat(&gaussians.means));
    put(&mut answer.samples, Field::Quaternions, &wide(gaussians.rotations.as_flattened()));
    put(&mut answer.samples, Field::Scales, &flat(&gaussians.log_scales));
    put(&mut answer.samples, Field::Opacities, &wide(&gaussians.opacity_logits));
    take_sh(&mut answer, &wide(gaussians.sh.as_flattened()), 3 * gaussians.sh_count());
    answer
}
