//! Ranges of frames: which of a video are trained on, which are held out.

use super::{Request, Split};
use crate::{Error, error, listing};
use serde::Deserialize;
use std::path::Path;

/// First, last (inclusive), step.
pub(super) type Range = [usize; 3];

/// The splits that a subject is known by, the one that counts first.
#[derive(Debug)]
pub(super) struct Splits(Vec<Split>);

/// The splits of Anim-NeRF, which InstantAvatar and those after it use, by what the subject's folder is called.
const STOCK: [(&str, Split); 4] = [
    ("female-3-casual", Split { train: [0, 445, 4], test: [446, 647, 4] }),
    ("female-4-casual", Split { train: [0, 335, 4], test: [335, 523, 4] }),
    ("male-3-casual", Split { train: [0, 455, 4], test: [456, 675, 4] }),
    ("male-4-casual", Split { train: [0, 659, 6], test: [660, 872, 6] }),
];

/// The part of SplattingAvatar's `config.json` that is read.
#[derive(Deserialize)]
pub(super) struct Config {
    pub(super) gender: Option<String>,
    train: ConfigRange,
    test: ConfigRange,
}

#[derive(Clone, Copy, Deserialize)]
struct ConfigRange {
    start: usize,
    end: usize,
    skip: usize,
}

impl Config {
    /// The `config.json` of a folder that has one.
    pub(super) fn of(folder: &Path) -> Result<Option<Self>, Error> {
        let path = folder.join("config.json");
        let expected = "gender, and start, end, skip of train and test";
        if path.is_file() { error::read_json(&path, "config", expected).map(Some) } else { Ok(None) }
    }

    fn split(&self) -> Split {
        let range = |ConfigRange { start, end, skip }| [start, end, skip];
        Split { train: range(self.train), test: range(self.test) }
    }
}

impl Splits {
    /// What the registry says; else what `config.json` says; else the stock split of a subject of this name.
    ///
    /// # Errors
    /// If none of them knows the subject.
    pub(super) fn of(request: &Request<'_>, config: Option<&Config>) -> Result<Self, Error> {
        let name = listing::file_name(request.folder);
        let stock =
            STOCK.iter().find(|(known, _)| *known == name || known.trim_end_matches("-casual") == name);
        let known: Vec<Split> = request
            .split
            .copied()
            .into_iter()
            .chain(config.map(Config::split))
            .chain(stock.map(|(_, split)| *split))
            .collect();
        if known.is_empty() {
            let expected = "splits.<subject> = { train = [first, last, step], test = ... }";
            return Err(Error::invalid(request.folder, format!("splits.{name}"), "missing", expected));
        }
        Ok(Self(known))
    }

    /// The ranges of a part ("train", "test") by decreasing precedence.
    pub(super) fn ranges(&self, part: &str) -> Vec<Range> {
        self.0.iter().map(|split| if part == "train" { split.train } else { split.test }).collect()
    }
}

/// The frames of a range, all of which must be below `count`.
///
/// # Errors
/// An empty range, a step of 0, one that leaves the video.
pub(super) fn chosen(folder: &Path, part: &str, range: Range, count: usize) -> Result<Vec<usize>, Error> {
    let [first, last, step] = range;
    if step == 0 || first > last || last >= count {
        let expected = format!("[first, last, step] within the {count} images");
        return Err(Error::invalid(folder, format!("split.{part}"), format!("{range:?}"), expected));
    }
    Ok((first..=last).step_by(step).collect())
}

/// How many frames a range holds; 0 if it is none.
pub(super) fn count([first, last, step]: Range) -> usize {
    if step == 0 || first > last { 0 } else { (last - first) / step + 1 }
}
