//! The frames of a video as numbered files, images and masks paired by number.

use crate::{Error, listing};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Files by their numbers, and which number is the first frame of the video.
#[derive(Debug)]
pub(super) struct Numbered {
    folder: PathBuf,
    field: &'static str,
    files: BTreeMap<usize, PathBuf>,
    start: usize,
}

impl Numbered {
    /// The files of a folder; their numbers start at 0, or at 1 as ffmpeg counts, until [`Numbered::fit_to`] knows better.
    pub(super) fn open(folder: PathBuf, field: &'static str, extensions: &[&str]) -> Result<Self, Error> {
        let files = listing::numbered(&folder, field, extensions)?;
        let start = usize::from(files.keys().next() == Some(&1));
        Ok(Self { folder, field, files, start })
    }

    fn first(&self) -> usize {
        self.files.keys().next().copied().unwrap_or_default()
    }

    fn last(&self) -> usize {
        self.files.keys().next_back().copied().unwrap_or_default()
    }

    /// Frames from the first of the video to the last that is there.
    pub(super) fn count(&self) -> usize {
        self.last() + 1 - self.start
    }

    /// Tells the number of the video's first frame from how many frames it has according to `source`'s field.
    ///
    /// # Errors
    /// If the numbers fit neither a count from 0 nor one from the first file, or either might be meant.
    pub(super) fn fit_to(&mut self, count: usize, source: &Path, field: &str) -> Result<(), Error> {
        let (first, last) = (self.first(), self.last());
        if last + 1 - first == count {
            self.start = first;
        } else if last + 1 == count && first != 1 {
            self.start = 0;
        } else {
            let frames = last + 1 - self.start;
            let expected = format!("{frames}, one per frame ({} {first} to {last})", self.field);
            return Err(Error::invalid(source, field, format!("{count} of them"), expected));
        }
        Ok(())
    }

    /// As [`Numbered::fit_to`] for a folder that may hold the beginning of the video only.
    ///
    /// # Errors
    /// More frames than the video has, numbers of which it cannot be told where they start.
    pub(super) fn fit_within(&mut self, count: usize, source: &Path, field: &str) -> Result<(), Error> {
        let (first, last) = (self.first(), self.last());
        if last + 1 - first >= count || first == 0 {
            if first == 0 && last < count {
                self.start = 0;
                return Ok(());
            }
            return self.fit_to(count, source, field);
        }
        let problem = format!("numbers {first} to {last} of a video of {count} frames");
        let expected = "numbers from 0 (ffmpeg -start_number 0), or all frames";
        Err(Error::invalid(&self.folder, self.field, problem, expected))
    }

    /// The file of a frame of the video, counted from 0.
    ///
    /// # Errors
    /// If it is not there.
    pub(super) fn frame(&self, frame: usize) -> Result<&PathBuf, Error> {
        let number = frame + self.start;
        self.files.get(&number).ok_or_else(|| {
            let expected = format!("a file like {} with the number {number}", self.example());
            Error::invalid(&self.folder, self.field, format!("frame {frame} is missing"), expected)
        })
    }

    /// That the files of another folder are numbered from the same first frame.
    ///
    /// # Errors
    /// If they start elsewhere: each would be paired with a neighbour's.
    pub(super) fn starts_with(&self, other: &Self) -> Result<(), Error> {
        if self.first() == other.first() {
            return Ok(());
        }
        let problem = format!("the first has the number {}", self.first());
        let expected = format!("{}, as {} have", other.first(), other.field);
        Err(Error::invalid(&self.folder, self.field, problem, expected))
    }

    /// Another folder's files are numbered from the same first frame as these.
    pub(super) fn start_as(&mut self, other: &Self) {
        self.start = other.start;
    }

    fn example(&self) -> String {
        self.files.values().next().map_or_else(String::new, |path| listing::file_name(path))
    }
}
