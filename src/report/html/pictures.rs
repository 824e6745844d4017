//! The pictures of a page, within a bound.

use super::encode;
use crate::report::results::{SequenceResults, TableResults};
use image::RgbImage;
use rayon::prelude::*;
use skinsplat_metrics::MetricId;
use skinsplat_page::{Frame, Part, Picture, Scale, View, Viewer};
use std::collections::BTreeMap;

/// Errors from here on have the brightest colour.
const BRIGHTEST: f32 = 0.25;

/// The pictures that a run kept, decoded.
#[derive(Debug, Default)]
pub struct KeptPictures {
    /// Frames.
    pub stills: Vec<Stills>,
    /// Moving pictures.
    pub moving: Vec<MovingPicture>,
    /// Of how many frames the run kept pictures, if those of some were not read.
    pub kept: usize,
    /// What of they were kept and cannot be read any more: names of frames and files.
    pub lost: Vec<String>,
    /// Frames whose pictures were kept and not read: table, sequence, frame, as in [`Stills`].
    pub unread: Vec<[String; 3]>,
}

/// The pictures of a frame.
#[derive(Debug)]
pub struct Stills {
    /// Id of the experiment.
    pub table: String,
    /// `dataset/subject/sequence`.
    pub sequence: String,
    /// Name of the image.
    pub frame: String,
    /// The truth.
    pub truth: RgbImage,
    /// Ids of variants, and what they drew.
    pub variants: Vec<(String, RgbImage)>,
}

/// A moving picture.
#[derive(Debug)]
pub struct MovingPicture {
    /// Id of the experiment.
    pub table: String,
    /// `dataset/subject/sequence`.
    pub sequence: String,
    /// The truth and ids of variants, from the left.
    pub columns: Vec<String>,
    /// How many frames of how many that have scores it shows.
    pub frames: [usize; 2],
    /// The file, a GIF.
    pub gif: Vec<u8>,
    /// Width and height.
    pub size: [usize; 2],
}

impl KeptPictures {
    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.stills.is_empty() && self.moving.is_empty()
    }
}

/// Which frames a page shows pictures of, and of which it left them out.
pub(super) struct Links<'p>(BTreeMap<[&'p str; 3], bool>);

impl Links<'_> {
    /// Whether the pictures of a frame are on the page; none if the run kept none of it.
    pub(super) fn shown(&self, table: &str, sequence: &str, frame: &str) -> Option<bool> {
        self.0.get(&[table, sequence, frame]).copied()
    }
}

/// How large pictures are and how many there are, so that the page stays within its bound.
pub(super) struct Budget {
    step: usize,
    frames: usize,
    of: usize,
    kept: usize,
    moving: usize,
    /// How many times charts have half of their points.
    thinned: u32,
    /// Whether the page is too large without any of them.
    over: bool,
}

/// Longer sides, the largest first.
const SIDES: [u32; 4] = [512, 384, 256, 192];

impl Budget {
    pub(super) fn new(pictures: &KeptPictures) -> Self {
        Self {
            step: 0,
            frames: pictures.stills.len(),
            of: pictures.stills.len(),
            kept: pictures.kept.max(pictures.stills.len()),
            moving: pictures.moving.len(),
            thinned: 0,
            over: false,
        }
    }

    /// For a page whose tables alone are beyond its bound.
    pub(super) fn over(self) -> Self {
        Self { over: true, ..self }
    }

    /// No picture.
    pub(super) fn none() -> Self {
        Self::new(&KeptPictures::default())
    }

    /// With charts that have half of their points so many times.
    pub(super) fn thinned(self, thinned: u32) -> Self {
        Self { thinned, ..self }
    }

    /// How many of so many points charts may have.
    pub(super) fn points(&self, most: usize) -> usize {
        (most >> self.thinned).max(2)
    }

    /// The smallest pictures of so many frames, and all moving ones.
    pub(super) fn smallest(pictures: &KeptPictures, frames: usize) -> Self {
        Self { step: SIDES.len() - 1, frames, ..Self::new(pictures) }
    }

    /// The next smaller one; false if there is none.
    pub(super) fn shrink(&mut self) -> bool {
        if self.step + 1 < SIDES.len() {
            self.step += 1;
        } else if self.frames > 0 {
            self.frames /= 2;
        } else if self.moving > 0 {
            self.moving = 0;
        } else {
            return false;
        }
        true
    }

    /// What was given up.
    pub(super) fn says(&self, bound: usize) -> Vec<String> {
        let thinned = (self.thinned > 0).then(|| {
            let megabytes = bound as f64 / 1e6;
            format!("Charts have fewer points, so that the page stays below {megabytes} MB; they say which.")
        });
        let over = self.over.then(|| {
            let megabytes = bound as f64 / 1e6;
            format!("The page is larger than {megabytes} MB by its tables alone.")
        });
        self.says_of_pictures(bound).into_iter().chain(thinned).chain(over).collect()
    }

    fn says_of_pictures(&self, bound: usize) -> Option<String> {
        let megabytes = bound as f64 / 1e6;
        if self.kept == 0 {
            None
        } else if self.frames < self.kept {
            let (frames, of) = (self.frames, self.kept);
            Some(format!(
                "Pictures of {frames} of the {of} frames that the run kept, so that the page stays below {megabytes} MB."
            ))
        } else if self.step > 0 {
            let side = SIDES[self.step];
            Some(format!(
                "Pictures are reduced to {side} pixels, so that the page stays below {megabytes} MB."
            ))
        } else {
            None
        }
    }

    fn side(&self) -> u32 {
        SIDES[self.step]
    }

    /// Whether the i-th of all frames is shown: where some are left out, every sequence keeps its share.
    fn shows(&self, i: usize) -> bool {
        self.of > 0 && (i + 1) * self.frames / self.of > i * self.frames / self.of
    }

    /// Where points of charts may lead.
    pub(super) fn links<'p>(&self, pictures: &'p KeptPictures) -> Links<'p> {
        let read = pictures
            .stills
            .iter()
            .enumerate()
            .map(|(i, of)| ([of.table.as_str(), of.sequence.as_str(), of.frame.as_str()], self.shows(i)));
        let unread = pictures.unread.iter().map(|of| (of.each_ref().map(String::as_str), false));
        Links(unread.chain(read).collect())
    }

    /// The pictures of a table.
    pub(super) fn viewer(&self, results: &TableResults, pictures: &KeptPictures) -> Option<Viewer> {
        let of_table = pictures.stills.iter().enumerate().filter(|(_, s)| s.table == results.experiment);
        let shown: Vec<&Stills> =
            of_table.filter(|(i, _)| self.shows(*i)).map(|(_, stills)| stills).collect();
        let frame = |stills: &&Stills| {
            let sequence = results.sequences.iter().find(|sequence| sequence.id == stills.sequence)?;
            Some(self.frame(sequence, stills))
        };
        let frames: Vec<Frame> = shown.par_iter().filter_map(frame).collect();
        let title = format!("{}: pictures", results.table.title);
        (!frames.is_empty()).then(|| Viewer { title, frames, scale: Some(Scale::to(BRIGHTEST)) })
    }

    fn frame(&self, sequence: &SequenceResults, stills: &Stills) -> Frame {
        let truth = View {
            label: "Truth".to_owned(),
            picture: encode::picture(&stills.truth, self.side()),
            error: None,
            note: String::new(),
        };
        let view = |(id, image): &(String, RgbImage)| {
            let error = encode::error(image, &stills.truth, Scale::to(BRIGHTEST));
            View {
                label: label(sequence, id),
                picture: encode::picture(image, self.side()),
                error: Some(encode::picture(&error, self.side())),
                note: score(sequence, id, &stills.frame),
            }
        };
        let images: Vec<&RgbImage> = stills.variants.iter().map(|(_, image)| image).collect();
        let crops = encode::places(&images).into_iter().map(|at| {
            std::iter::once(&stills.truth)
                .chain(images.iter().copied())
                .map(|image| encode::place(image, at))
                .collect()
        });
        Frame {
            sequence: sequence.label.clone(),
            name: stills.frame.clone(),
            views: std::iter::once(truth).chain(stills.variants.iter().map(view)).collect(),
            crops: crops.collect(),
        }
    }

    /// The moving pictures of a table.
    pub(super) fn moving(&self, results: &TableResults, pictures: &KeptPictures) -> Vec<Part> {
        let of_table = pictures.moving.iter().take(self.moving).filter(|m| m.table == results.experiment);
        let part = |moving: &MovingPicture| {
            let sequence = results.sequences.iter().find(|sequence| sequence.id == moving.sequence)?;
            let columns = moving.columns.iter().enumerate();
            let names: Vec<String> = columns
                .map(|(i, id)| if i == 0 { "truth".to_owned() } else { label(sequence, id) })
                .collect();
            let [shown, of] = moving.frames;
            let caption =
                format!("{}, {shown} of {of} frames. From the left: {}.", sequence.label, names.join(", "));
            Some(Part::Figure(Picture::new("image/gif", &moving.gif, moving.size), caption))
        };
        of_table.filter_map(part).collect()
    }
}

fn label(sequence: &SequenceResults, id: &str) -> String {
    let variant = sequence.variants.iter().find(|variant| variant.id == id);
    variant.map_or_else(|| id.to_owned(), |variant| variant.label.clone())
}

/// The scores of a frame in a line.
fn score(sequence: &SequenceResults, id: &str, frame: &str) -> String {
    let variant = sequence.variants.iter().find(|variant| variant.id == id);
    let found = variant.and_then(|variant| variant.frames.iter().find(|own| own.name == frame));
    let Some(found) = found else { return String::new() };
    let value = |metric: MetricId| {
        let value = found.value(metric)?;
        let digits = metric.decimals();
        Some(format!("{} {value:.digits$}", metric.title()))
    };
    MetricId::of_frames().filter_map(value).collect::<Vec<_>>().join(", ")
}
