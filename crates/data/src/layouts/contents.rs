//! What lies in a folder, before anything of it is read: which layout it is, how many files each part has, what is missing.

use super::{LAYOUTS, Layout};
use crate::{folder, listing};
use std::path::{Path, PathBuf};

/// A part of a layout: files at a place in a subject's folder.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// What they are for: "masks". Parts of one name are alternatives.
    pub what: &'static str,
    /// Where they lie, `*` standing for any text in a name: `masks/*.{npy,png}`.
    pub place: &'static str,
    /// The arrays that are read of a file of arrays; empty if it is none, or all of it is read.
    pub arrays: &'static [&'static str],
    /// Whether no subject can be read without it or an alternative.
    needed: bool,
    /// Whether no other layout has it, so that it tells the layout.
    tells: bool,
}

impl Part {
    /// A part without which (or an alternative) nothing is read.
    pub(super) const fn needed(what: &'static str, place: &'static str) -> Self {
        Self { what, place, arrays: &[], needed: true, tells: false }
    }

    /// A part that is used where it is.
    pub(super) const fn optional(what: &'static str, place: &'static str) -> Self {
        Self { what, place, arrays: &[], needed: false, tells: false }
    }

    /// The same part, which no other layout has.
    pub(super) const fn telling(self) -> Self {
        Self { tells: true, ..self }
    }

    /// The same part, of whose files only these arrays are read.
    pub(super) const fn of_arrays(self, arrays: &'static [&'static str]) -> Self {
        Self { arrays, ..self }
    }

    /// Its files in a folder.
    fn files(&self, folder: &Path) -> usize {
        matching(folder, self.place)
    }
}

/// A part that was found, and how many files it has.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// The part.
    pub part: &'static Part,
    /// Files.
    pub files: usize,
}

/// What was found in a folder.
#[derive(Clone, Debug)]
pub struct Contents {
    /// The layout that the folder has.
    pub layout: &'static Layout,
    /// Its parts that are there.
    pub found: Vec<Found>,
    /// Those that are not, each with the places of all its alternatives.
    pub missing: Vec<String>,
}

/// What a folder holds, if it has one of the layouts: the one of which most telling parts are there.
pub fn contents(folder: &Path) -> Option<Contents> {
    if folder::is_subject(folder) {
        let layout = Layout::named("folder")?;
        return Some(Contents { layout, found: Vec::new(), missing: Vec::new() });
    }
    let score = |layout: &Layout| {
        let telling = layout.parts.iter().filter(|part| part.tells);
        telling.filter(|part| part.files(folder) > 0).count()
    };
    let (score, layout) =
        LAYOUTS.iter().map(|layout| (score(layout), layout)).rev().max_by_key(|(s, _)| *s)?;
    (score > 0).then(|| of_layout(folder, layout))
}

fn of_layout(folder: &Path, layout: &'static Layout) -> Contents {
    let count = |part: &'static Part| Found { part, files: part.files(folder) };
    let found: Vec<Found> = layout.parts.iter().map(count).filter(|found| found.files > 0).collect();
    let mut missing: Vec<String> = Vec::new();
    let mut seen: Vec<&str> = Vec::new();
    for part in layout.parts.iter().filter(|part| part.needed) {
        if seen.contains(&part.what) || found.iter().any(|found| found.part.what == part.what) {
            continue;
        }
        seen.push(part.what);
        let places = layout.parts.iter().filter(|other| other.what == part.what).map(|other| other.place);
        missing.push(format!("{} ({})", part.what, places.collect::<Vec<_>>().join(" or ")));
    }
    Contents { layout, found, missing }
}

/// Subjects of a folder whose layout is known, by name, and what they hold.
pub fn subjects(folder: &Path) -> Vec<(PathBuf, Contents)> {
    let folders = listing::folders(folder, "subjects").unwrap_or_default();
    folders.into_iter().filter_map(|path| Some((path.clone(), contents(&path)?))).collect()
}

/// Files at a place in a folder.
fn matching(folder: &Path, place: &str) -> usize {
    let Some((first, rest)) = place.split_once('/') else {
        return match place.contains('*') {
            true => names(folder).iter().filter(|name| fits(name, place)).count(),
            false => usize::from(folder.join(place).is_file()),
        };
    };
    match first.contains('*') {
        true => {
            let folders = names(folder).into_iter().filter(|name| fits(name, first));
            folders.map(|name| matching(&folder.join(name), rest)).sum()
        }
        false => matching(&folder.join(first), rest),
    }
}

/// Names in a folder, but hidden ones; none if it is no folder.
fn names(folder: &Path) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    names.filter(|name| !name.starts_with('.')).collect()
}

/// True if a name is a pattern with one `*` in it, and perhaps `{a,b}` at its end.
pub(super) fn fits(name: &str, pattern: &str) -> bool {
    if let Some((start, ends)) = pattern.split_once('{') {
        return ends.trim_end_matches('}').split(',').any(|end| fits(name, &format!("{start}{end}")));
    }
    let (start, end) = pattern.split_once('*').unwrap_or((pattern, ""));
    name.len() >= start.len() + end.len() && name.starts_with(start) && name.ends_with(end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_count_files() {
        let folder = tempfile::tempdir().unwrap();
        for name in
            ["train/Take1/a_1.png", "train/Take1/a_2.png", "train/Take2/a_1.png", "train/Take2/._a.png"]
        {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let count = |place| matching(folder.path(), place);
        assert_eq!([count("train/*/a_*.png"), count("train/*/a_1.png"), count("*/b.png")], [3, 2, 0]);
        assert_eq!([count("train/Take1/*.{png,npy}"), count("train/Take1/*.{jpg,npy}")], [2, 0]);
        assert!(fits("mesh-f1_smplx.pkl", "mesh-f*_smplx.pkl") && !fits("ab", "ab*b"));
    }
}
