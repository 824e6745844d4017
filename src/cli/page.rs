//! The page of a run: what `run --html` and `report --format html` write.

use super::Context;
use anyhow::{Context as _, Result, anyhow, bail};
use image::RgbImage;
use skinsplat::experiment::Records;
use skinsplat::report::html::{Extras, KeptPictures, MovingPicture, Stills, frames_that_fit, html};
use skinsplat::report::timing;
use skinsplat::report::{Results, check_curves};
use skinsplat::run::costs::{self, Costs};
use skinsplat::run::pictures::{INDEX, Index, Keep, Kept, Moving, check_gif};
use skinsplat::run::store;
use skinsplat_data::error::{read_bytes, read_text};
use skinsplat_data::{atomic, select::evenly_spaced};
use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Component, Path};

/// Which pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Images {
    /// None
    None,
    /// Of every sequence the frames on which the variants differ most
    Key,
    /// Every frame
    All,
}

impl Images {
    pub(super) fn keep(self) -> Keep {
        match self {
            Self::None => Keep::None,
            Self::Key => Keep::Key,
            Self::All => Keep::All,
        }
    }
}

/// Folder, inside the run's, of the pictures that its page shows.
pub(super) const PICTURES: &str = "pictures";

/// The page of a run as HTML, of at most `bound` bytes: its results with what lies in its folder. Without a folder there is nothing but the results.
///
/// Frames with a picture that is gone or broken are shown without pictures, and a line says so.
///
/// # Errors
/// Records that cannot be read; the message names the file.
pub(super) fn page(
    results: &Results,
    folder: &Path,
    images: Images,
    bound: usize,
    context: Context,
) -> Result<String> {
    let curves = curves(&folder.join("curves.csv"))?;
    let stores = store::stores(folder)?;
    let records = store::merge(stores.iter().map(std::path::PathBuf::as_path))?;
    let measured = folder.join(costs::FILE_NAME);
    let measured: Option<Costs> = match measured.is_file() {
        true => Some(super::selection::read_json(&measured)?),
        false => None,
    };
    let tables = timing::costs(results, &records, measured.as_ref()).into_iter().collect();
    let absent = absent(results, folder, &records, curves.is_empty());
    let bends = records.into_values().filter_map(|record| Some((record.key, record.bend?))).collect();
    let mut extras = Extras { pictures: KeptPictures::default(), bends, curves, tables, absent, bound };
    let pictures = folder.join(PICTURES);
    let Some(mut index) = index(&pictures, images)? else { return Ok(html(results, &extras)) };
    // The run may have tables that the page has not.
    let has = |table: &String| results.tables.iter().any(|own| own.experiment == *table);
    index.frames.retain(|kept| has(&kept.table));
    index.moving.retain(|of| has(&of.table));
    if index.frames.len() > FEW {
        context.note(format!("page: pictures of {} frames", index.frames.len()));
    }
    let mut lost = Lost::default();
    let moving = index.moving.iter().filter_map(|of| lost.or(&of.file, moving(&pictures, of)));
    extras.pictures.moving = moving.collect();
    let mut lost_stills = Lost::default();
    extras.pictures.stills = stills(&pictures, &index.frames, FEW, &mut lost_stills);
    extras.pictures.kept = index.frames.len();
    if index.frames.len() > FEW {
        let fit = frames_that_fit(results, &extras, index.frames.len());
        lost_stills = Lost::default();
        extras.pictures.stills = stills(&pictures, &index.frames, fit, &mut lost_stills);
    }
    [&lost, &lost_stills].into_iter().for_each(|lost| lost.say(context));
    extras.pictures.kept = index.frames.len() - lost_stills.of.len();
    let unread = unread(&index.frames, &extras.pictures.stills).into_iter();
    extras.pictures.unread = unread.filter(|names| !lost_stills.of.contains(&names.join(", "))).collect();
    extras.pictures.lost = lost_stills.of.into_iter().chain(lost.of).collect();
    Ok(html(results, &extras))
}

/// So many frames are read whatever comes of them; of more frames so many tell how many fit.
const FEW: usize = 32;

/// Writes a page and says how large it is.
pub(super) fn write_page(path: &Path, html: &str, bound: usize, context: Context) -> Result<()> {
    atomic::write(path, |w| w.write_all(html.as_bytes()))?;
    let over = if html.len() > bound { ", beyond its bound by its tables alone" } else { "" };
    context.note(format!("{}: {:.1} MB{over}", path.display(), html.len() as f64 / 1e6));
    Ok(())
}

/// Which pictures the run kept of those that are wanted; none if it kept none.
fn index(folder: &Path, images: Images) -> Result<Option<Index>> {
    let path = folder.join(INDEX);
    if images == Images::None || !path.is_file() {
        return Ok(None);
    }
    let mut index: Index = super::selection::read_json(&path)?;
    let stills =
        index.frames.iter().flat_map(|of| of.variants.iter().map(|(_, file)| file).chain([&of.truth]));
    let files = stills.chain(index.moving.iter().map(|of| &of.file));
    let is_own = |file: &str| Path::new(file).components().all(|part| matches!(part, Component::Normal(_)));
    if let Some(file) = files.into_iter().find(|file| !is_own(file)) {
        bail!("{}: the picture {file}; expected the name of a file in the folder", path.display());
    }
    index.frames.retain(|kept| images == Images::All || kept.telling);
    Ok(Some(index))
}

/// Pictures that the run kept and that cannot be read any more.
#[derive(Default)]
struct Lost {
    /// Of what they are.
    of: Vec<String>,
    /// Why the first cannot be read.
    first: Option<anyhow::Error>,
}

impl Lost {
    /// What was read; noted if it was not.
    fn or<T>(&mut self, of: &str, read: Result<T>) -> Option<T> {
        read.map_err(|error| {
            self.of.push(of.to_owned());
            self.first.get_or_insert(error);
        })
        .ok()
    }

    fn say(&self, context: Context) {
        if let Some(first) = &self.first {
            context.note(format!("{} of the pictures are not shown: {first:#}", self.of.len()));
        }
    }
}

/// The pictures of at most so many frames, evenly spaced, without those that cannot be read.
fn stills(folder: &Path, frames: &[Kept], most: usize, lost: &mut Lost) -> Vec<Stills> {
    let frames: Vec<&Kept> = frames.iter().collect();
    let read = |kept: &Kept| lost.or(&names(kept).map(String::as_str).join(", "), still(folder, kept));
    evenly_spaced(&frames, Some(most)).into_iter().filter_map(read).collect()
}

/// Frames whose pictures were not read.
fn unread(frames: &[Kept], read: &[Stills]) -> Vec<[String; 3]> {
    let read: BTreeSet<[&String; 3]> = read.iter().map(|of| [&of.table, &of.sequence, &of.frame]).collect();
    frames
        .iter()
        .map(names)
        .filter(|names| !read.contains(names))
        .map(|names| names.map(String::clone))
        .collect()
}

/// Table, sequence and frame.
fn names(of: &Kept) -> [&String; 3] {
    [&of.table, &of.sequence, &of.frame]
}

/// Files of the run's folder that are not there or hold less than the results, and what the page has not because of them.
fn absent(results: &Results, folder: &Path, records: &Records, no_curves: bool) -> Vec<String> {
    let variants = || results.tables.iter().flat_map(|table| &table.sequences).flat_map(|of| &of.variants);
    let scored = || variants().flat_map(|variant| &variant.frames).filter(|frame| frame.score.is_some());
    let (all, known) = (scored().count(), scored().filter(|frame| records.contains_key(&frame.key)).count());
    let frames = match known {
        0 => "`frames.jsonl` (bytes and times, charts over the bend)".to_owned(),
        known => format!("`frames.jsonl` for {} of {all} scores (their bytes, times and bends)", all - known),
    };
    let fits = variants().any(|variant| variant.avatar.fitting_recipe().is_some());
    let absent = [
        (known < all, frames),
        (!folder.join("run.json").is_file(), "`run.json` (who made them, when and how)".to_owned()),
        (fits && no_curves, "`curves.csv` (how the fits went)".to_owned()),
    ];
    absent.into_iter().filter(|(gone, _)| *gone).map(|(_, file)| file).collect()
}

/// How fits went; nothing if there were none.
fn curves(path: &Path) -> Result<String> {
    if !path.is_file() {
        return Ok(String::new());
    }
    let text = read_text(path, "curves", "the curves.csv of a run")?;
    check_curves(&text).map_err(|problem| anyhow!("{}: {problem}", path.display()))?;
    Ok(text)
}

fn still(folder: &Path, kept: &Kept) -> Result<Stills> {
    let read = |file: &String| -> Result<RgbImage> {
        let path = folder.join(file);
        let bytes = read_bytes(&path, "picture", "a PNG that the run kept")?;
        Ok(image::load_from_memory(&bytes)
            .with_context(|| format!("{}: cannot read the picture", path.display()))?
            .to_rgb8())
    };
    let truth = read(&kept.truth)?;
    let like_truth = |file: &String| -> Result<RgbImage> {
        let image = read(file)?;
        let ((w, h), (width, height)) = (image.dimensions(), truth.dimensions());
        if (w, h) != (width, height) {
            bail!(
                "{}: {w}x{h} pixels; expected {width}x{height}, as of the truth",
                folder.join(file).display()
            );
        }
        Ok(image)
    };
    let variants =
        kept.variants.iter().map(|(id, file)| Ok((id.clone(), like_truth(file)?))).collect::<Result<_>>()?;
    Ok(Stills {
        table: kept.table.clone(),
        sequence: kept.sequence.clone(),
        frame: kept.frame.clone(),
        truth,
        variants,
    })
}

fn moving(folder: &Path, of: &Moving) -> Result<MovingPicture> {
    let path = folder.join(&of.file);
    let gif = read_bytes(&path, "picture", "a GIF that the run kept")?;
    let size = check_gif(&gif, of.frames[0])
        .map_err(|problem| anyhow!("{}: cannot read the picture: {problem}", path.display()))?;
    Ok(MovingPicture {
        table: of.table.clone(),
        sequence: of.sequence.clone(),
        columns: of.columns.clone(),
        frames: of.frames,
        gif,
        size,
    })
}
