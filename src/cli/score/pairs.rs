//! Frames to score: which files belong together, and what they hold.

use crate::cli::Context;
use crate::cli::progress::Watch;
use anyhow::{Result, bail};
use rayon::prelude::*;
use skinsplat::run::Event;
use skinsplat_core::scene::{Image, Mask};
use skinsplat_data::frames::{load_image, load_mask};
use skinsplat_data::listing;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The files of one frame.
pub(super) struct Pair {
    pub(super) name: String,
    render: PathBuf,
    truth: PathBuf,
    mask: Option<PathBuf>,
}

/// The images of one frame, and whether they have alpha.
pub(super) struct Loaded {
    render: (Image, Option<Mask>),
    truth: (Image, Option<Mask>),
    mask: Option<Mask>,
}

/// Two images.
pub(super) fn single(render: &Path, truth: &Path, mask: Option<&Path>) -> Result<Vec<Pair>> {
    if render.is_dir() || mask.is_some_and(Path::is_dir) {
        bail!("{}: a file; expected a folder, like the other arguments", truth.display());
    }
    let name = truth.display().to_string();
    let (render, truth, mask) = (render.to_owned(), truth.to_owned(), mask.map(Path::to_owned));
    Ok(vec![Pair { name, render, truth, mask }])
}

/// The frames of two folders by name, sorted.
pub(super) fn folders(render: &Path, truth: &Path, mask: Option<&Path>) -> Result<Vec<Pair>> {
    if let Some(file) = [Some(render), mask].into_iter().flatten().find(|path| path.is_file()) {
        bail!("{}: a file; expected a folder, as {} is", file.display(), truth.display());
    }
    let (renders, truths) = (frames_of(render)?, frames_of(truth)?);
    same_names(render, &renders, truth, &truths)?;
    let masks = mask.map(|folder| masks_of(folder, truth, &truths)).transpose()?;
    let pair = |((name, truth), render): ((String, PathBuf), PathBuf)| {
        let mask = masks.as_ref().and_then(|masks| masks.get(&name)).cloned();
        Pair { name, render, truth, mask }
    };
    Ok(truths.into_iter().zip(renders.into_values()).map(pair).collect())
}

/// Scores frames, a few at a time, so that memory does not grow with their number; in their order.
pub(super) fn each<T: Send>(
    pairs: &[Pair],
    context: Context,
    score: impl Fn(&Pair) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    let watch = Watch::new(context.quiet);
    watch.see(Event::Frames(pairs.len()));
    let mut scored = Vec::with_capacity(pairs.len());
    for some in pairs.chunks(2 * rayon::current_num_threads()) {
        let score = |pair: &Pair| {
            let scored = score(pair);
            watch.see(Event::FrameDone(pair.name.clone()));
            scored
        };
        scored.extend(some.par_iter().map(score).collect::<Result<Vec<T>>>()?);
    }
    Ok(scored)
}

impl Pair {
    pub(super) fn load(&self) -> Result<Loaded> {
        let mask = self.mask.as_deref().map(load_mask).transpose()?;
        Ok(Loaded { render: load_image(&self.render)?, truth: load_image(&self.truth)?, mask })
    }

    /// The mask and the frame, if the mask has another name.
    pub(super) fn guessed(&self) -> Option<String> {
        let stem = self.mask.as_ref()?.file_stem()?.to_string_lossy();
        (stem != self.name).then(|| format!("{stem} for {}", self.name))
    }

    /// The files, for errors.
    pub(super) fn files(&self) -> String {
        let mask = self.mask.as_ref().map_or(String::new(), |mask| format!(", mask {}", mask.display()));
        format!("{} against {}{mask}", self.render.display(), self.truth.display())
    }
}

/// A render pixel differs from a background if a channel is further from it than this: JPEG and 8 bit stay below.
const BACKGROUND_TOLERANCE: f32 = 16.0 / 255.0;

impl Loaded {
    /// Render and truth, each over the background if it has alpha.
    pub(super) fn over(&self, background: [f32; 3]) -> Result<(Image, Image)> {
        let over = |(rgb, alpha): &(Image, Option<Mask>)| match alpha {
            None => Ok(rgb.clone()),
            Some(alpha) => rgb.composited(alpha, background),
        };
        Ok((over(&self.render)?, over(&self.truth)?))
    }

    /// The mask that was given, else the truth's alpha.
    pub(super) fn mask(&self) -> Option<&Mask> {
        self.mask.as_ref().or(self.truth.1.as_ref())
    }

    /// Whether the render evidently lies over something else than this background, over which the truth is composited:
    /// where the truth is empty, most pixels of the render have another colour.
    pub(super) fn lies_over_another(&self, background: [f32; 3]) -> bool {
        let ((render, None), (_, Some(alpha))) = (&self.render, &self.truth) else { return false };
        let differs = |rgb: &[f32; 3]| {
            rgb.iter().zip(background).any(|(value, other)| (value - other).abs() > BACKGROUND_TOLERANCE)
        };
        let empty = render.pixels().iter().zip(alpha.values()).filter(|(_, alpha)| **alpha == 0.0);
        let (mut count, mut other) = (0_usize, 0_usize);
        for (rgb, _) in empty {
            count += 1;
            other += usize::from(differs(rgb));
        }
        2 * other > count
    }
}

/// Image files by stem, sorted.
type Frames = BTreeMap<String, PathBuf>;

/// Those of a folder.
fn frames_of(folder: &Path) -> Result<Frames> {
    let mut frames = BTreeMap::new();
    for path in listing::files(folder, "frames", &["png", "jpg", "jpeg", "npy"])? {
        let Some(stem) = path.file_stem().and_then(|s| s.to_str()) else {
            bail!("{}: a name that is no Unicode; expected names of frames", path.display());
        };
        if let Some(other) = frames.insert(stem.to_owned(), path.clone()) {
            bail!("{} and {}: one name; expected one image per frame", other.display(), path.display());
        }
    }
    if frames.is_empty() {
        let found = passed_over(folder)?.unwrap_or_else(|| format!("{}: no frames", folder.display()));
        bail!("{found}; expected .png, .jpg or .npy images");
    }
    Ok(frames)
}

/// What a folder holds besides its frames: pictures of kinds that are not read.
pub(super) fn passed_over(folder: &Path) -> Result<Option<String>> {
    let names = listing::unread_pictures(folder)?;
    let Some(first) = names.first() else { return Ok(None) };
    let which = match names.len() {
        1 => format!("{first} is of a kind that is not read"),
        n => format!("{n} pictures are of kinds that are not read ({first}, …)"),
    };
    Ok(Some(format!("{}: {which}", folder.display())))
}

/// The masks of a folder by the names of the truths: their own, or, where no name is one of a truth, the truth with the same last
/// number (`mask_0010` for `image_10`). Masks of other frames are left alone.
fn masks_of(folder: &Path, truth: &Path, truths: &Frames) -> Result<Frames> {
    let masks = frames_of(folder)?;
    let by_name = masks.keys().any(|name| truths.contains_key(name));
    let mut numbered: BTreeMap<u64, Vec<&PathBuf>> = BTreeMap::new();
    for (name, path) in masks.iter().filter(|_| !by_name) {
        number(name).into_iter().for_each(|number| numbered.entry(number).or_default().push(path));
    }
    let mut found = Frames::new();
    for name in truths.keys() {
        let of_number = || match numbered.get(&number(name)?)?.as_slice() {
            [one] => Some(PathBuf::clone(one)),
            _ => None,
        };
        let mask = if by_name { masks.get(name).cloned() } else { of_number() };
        let Some(mask) = mask else {
            let rule = "a mask of the frame's name, or, where no mask has one, one mask with its last number";
            bail!("{}: no mask for frame {name} of {}; expected {rule}", folder.display(), truth.display());
        };
        found.insert(name.clone(), mask);
    }
    Ok(found)
}

/// The last number in a name.
fn number(name: &str) -> Option<u64> {
    let end = name.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = name[..end].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |at| at + 1);
    name.get(start..end)?.parse().ok()
}

fn same_names(left: &Path, a: &Frames, right: &Path, b: &Frames) -> Result<()> {
    let strangers = |a: &Frames, b: &Frames| {
        let names: Vec<&str> = a.keys().filter(|k| !b.contains_key(*k)).map(String::as_str).collect();
        let more = if names.len() > 5 { format!(" and {} more", names.len() - 5) } else { String::new() };
        (!names.is_empty()).then(|| names.iter().take(5).copied().collect::<Vec<_>>().join(", ") + &more)
    };
    for (here, there, names) in [(left, right, strangers(a, b)), (right, left, strangers(b, a))] {
        if let Some(names) = names {
            let (here, there) = (here.display(), there.display());
            bail!("{here}: frames {names} have no partner in {there}; expected the same names in both");
        }
    }
    Ok(())
}
