//! Pictures of a run that are kept for its page and for comparisons: of chosen frames the truth and what every variant drew, cropped to
//! the subject, and of every sequence a moving picture, variants side by side.

use super::drawable::{Behind, Scratch};
use super::execute::{Avatars, prepare_avatars, test_sequence};
use super::frame::{Frame, behind};
use super::gallery::{crop, picture_name, scored, spread};
use super::looks::look;
use super::{Error, Event, Library};
use crate::experiment::{Job, Plan, Records};
use image::RgbImage;
use image::imageops::{FilterType, resize};
use serde::{Deserialize, Serialize};
use skinsplat_core::scene::Image;
use skinsplat_data::frames::save_png;
use skinsplat_data::{atomic, select::evenly_spaced};
use std::collections::BTreeSet;
use std::path::Path;

/// Which frames' pictures are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Keep {
    /// None.
    None,
    /// Of every sequence those on which the variants differ most, and a moving picture.
    Key,
    /// Every frame, and a moving picture.
    All,
}

/// Frames per sequence that count as telling.
const TELLING: usize = 3;
/// Frames of a moving picture.
const MOVING: usize = 16;
/// Most rows of pixels of a moving picture.
const MOVING_HEIGHT: u32 = 180;
/// Hundredths of a second per frame of a moving picture.
const DELAY: u16 = 14;

/// What the folder holds: `index.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Index {
    /// Frames, in the order of the tables.
    pub frames: Vec<Kept>,
    /// Moving pictures.
    pub moving: Vec<Moving>,
}

/// The pictures of a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kept {
    /// Id of the experiment.
    pub table: String,
    /// `dataset/subject/sequence`.
    pub sequence: String,
    /// Name of the image.
    pub frame: String,
    /// Whether the variants differ there as on few others.
    pub telling: bool,
    /// File of the truth.
    pub truth: String,
    /// Ids of the variants with their files.
    pub variants: Vec<(String, String)>,
}

/// A moving picture of a sequence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Moving {
    /// Id of the experiment.
    pub table: String,
    /// `dataset/subject/sequence`.
    pub sequence: String,
    /// The file.
    pub file: String,
    /// What stands side by side, from the left: the truth, then ids of variants.
    pub columns: Vec<String>,
    /// How many frames of how many that have scores it shows.
    pub frames: [usize; 2],
}

/// Name of the index in the folder of pictures.
pub const INDEX: &str = "index.json";

/// Draws and writes the pictures of what has a score: what could not be drawn for one has no picture either.
///
/// # Errors
/// An avatar or a frame that cannot be made, or a folder that cannot be written.
pub fn write(
    plan: &Plan,
    library: &Library,
    records: &Records,
    keep: Keep,
    avatars: &Path,
    folder: &Path,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<Index, Error> {
    make(folder)?;
    let scored = scored(&plan.jobs, records);
    let groups = by_sequence(&scored);
    let chosen: Vec<(Vec<&Job>, Chosen)> =
        groups.into_iter().map(|jobs| (jobs.clone(), Chosen::of(&jobs, records, keep))).collect();
    let jobs: Vec<Job> =
        chosen.iter().flat_map(|(jobs, wanted)| wanted.drawn().map(|i| jobs[i].clone())).collect();
    let avatars = prepare_avatars(plan, &jobs, library, avatars, watch)?;
    watch(Event::Frames(jobs.len()));
    let mut index = Index::default();
    for (jobs, wanted) in &chosen {
        Sequence { plan, library, avatars: &avatars, folder, jobs }.write(wanted, &mut index, watch)?;
    }
    let text = serde_json::to_string_pretty(&index).unwrap_or_default() + "\n";
    atomic::write(&folder.join(INDEX), |w| std::io::Write::write_all(w, text.as_bytes()))?;
    Ok(index)
}

/// The file, in the folder of pictures, of what a variant drew of a frame.
pub fn single_picture(experiment: &str, sequence: &str, frame: &str, variant: &str) -> String {
    let stem = picture_name(experiment, sequence, frame).replace(".png", "");
    format!("{stem}/{}", picture_name("v", variant, ""))
}

fn make(folder: &Path) -> Result<(), Error> {
    std::fs::create_dir_all(folder).map_err(|source| Error::Folder { path: folder.to_owned(), source })
}

/// The jobs of every table and row, in order.
fn by_sequence(jobs: &[Job]) -> Vec<Vec<&Job>> {
    let mut groups: Vec<Vec<&Job>> = Vec::new();
    for job in jobs {
        match groups.last_mut() {
            Some(group) if (group[0].table, group[0].row) == (job.table, job.row) => group.push(job),
            _ => groups.push(vec![job]),
        }
    }
    groups
}

/// Positions among the frames of a sequence.
struct Chosen {
    telling: BTreeSet<usize>,
    stills: BTreeSet<usize>,
    moving: BTreeSet<usize>,
}

impl Chosen {
    fn of(jobs: &[&Job], records: &Records, keep: Keep) -> Self {
        let all = || (0..jobs.len()).collect::<Vec<usize>>();
        let moving = match keep {
            Keep::None => BTreeSet::new(),
            Keep::Key | Keep::All => evenly_spaced(&alike(jobs), Some(MOVING)).into_iter().collect(),
        };
        let mut by_spread: Vec<(usize, f64)> =
            all().into_iter().filter_map(|i| Some((i, spread(jobs[i], records)?))).collect();
        by_spread.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let telling: BTreeSet<usize> = by_spread.into_iter().take(TELLING).map(|(i, _)| i).collect();
        let stills = match keep {
            Keep::None => BTreeSet::new(),
            Keep::All => all().into_iter().collect(),
            Keep::Key => telling.clone(),
        };
        Self { telling, stills, moving }
    }

    fn drawn(&self) -> impl Iterator<Item = usize> {
        self.stills.union(&self.moving).copied()
    }
}

/// The frames that have pictures of the same variants, as many as any frame has: a moving picture keeps its columns.
fn alike(jobs: &[&Job]) -> Vec<usize> {
    let most = jobs.iter().map(|job| job.variants.len()).max().unwrap_or(0);
    let ids = |job: &Job| job.variants.iter().map(|variant| variant.id.clone()).collect::<Vec<_>>();
    let columns = jobs.iter().find(|job| job.variants.len() == most).map(|job| ids(job));
    (0..jobs.len()).filter(|&i| columns.as_ref() == Some(&ids(jobs[i]))).collect()
}

/// One row of a table.
struct Sequence<'a> {
    plan: &'a Plan,
    library: &'a Library,
    avatars: &'a Avatars,
    folder: &'a Path,
    jobs: &'a [&'a Job],
}

/// A frame as it was drawn.
struct DrawnFrame {
    truth: Image,
    variants: Vec<Image>,
    /// Where the subject is: x from, x to, y from, y to.
    subject: [usize; 4],
}

impl Sequence<'_> {
    fn write(&self, wanted: &Chosen, index: &mut Index, watch: &(dyn Fn(Event) + Sync)) -> Result<(), Error> {
        let first = self.jobs[0];
        let (table, row) = (&self.plan.tables[first.table], first.row);
        let sequence = test_sequence(first, self.library)?;
        let mut scratch = Scratch::default();
        let mut moving = Vec::new();
        let mut columns = vec!["truth".to_owned()];
        for i in wanted.drawn() {
            let job = self.jobs[i];
            let drawn = self.draw(job, &Frame::load(&sequence, job.frame, None)?, &mut scratch)?;
            if wanted.stills.contains(&i) {
                let telling = wanted.telling.contains(&i);
                index.frames.push(Kept { telling, ..self.still(job, &drawn)? });
            }
            if wanted.moving.contains(&i) {
                if moving.is_empty() {
                    columns.extend(job.variants.iter().map(|variant| variant.id.clone()));
                }
                moving.push(drawn);
            }
            watch(Event::FrameDone(String::new()));
        }
        if moving.len() < 2 {
            return Ok(());
        }
        let file = picture_name(&table.experiment, &table.rows[row].label, "motion").replace(".png", ".gif");
        write_gif(&self.folder.join(&file), &moving)?;
        index.moving.push(Moving {
            table: table.experiment.clone(),
            sequence: table.rows[row].id.clone(),
            file,
            columns,
            frames: [moving.len(), self.jobs.len()],
        });
        Ok(())
    }

    fn draw(&self, job: &Job, frame: &Frame<'_>, scratch: &mut Scratch) -> Result<DrawnFrame, Error> {
        let mut variants = Vec::new();
        for variant in &job.variants {
            let avatar = self.avatars[&variant.avatar].as_ref();
            let avatar = avatar.map_err(|problem| Error::Avatar { problem: problem.clone() })?;
            variants.push(avatar.draw(&frame.view, &look(job, variant, &frame.truth)?, scratch)?.image);
        }
        let truth = match behind(&job.protocol, &frame.truth)? {
            Behind::Colour(colour) => frame.truth.rgb.composited(&frame.truth.alpha, colour)?,
            Behind::Picture(_) => frame.truth.rgb.clone(),
        };
        Ok(DrawnFrame { truth, variants, subject: crop(&frame.truth.alpha) })
    }

    fn still(&self, job: &Job, drawn: &DrawnFrame) -> Result<Kept, Error> {
        let (table, row) = (&self.plan.tables[job.table], &self.plan.tables[job.table].rows[job.row]);
        let of = |variant: &str| single_picture(&table.experiment, &row.label, &job.name, variant);
        let truth = of("").replace("/v.png", "/truth.png");
        make(&self.folder.join(&truth).with_file_name(""))?;
        let save = |file: String, image: &Image| -> Result<String, Error> {
            save_png(&self.folder.join(&file), &cut(image, drawn.subject)?)?;
            Ok(file)
        };
        let mut variants = Vec::new();
        for (variant, image) in job.variants.iter().zip(&drawn.variants) {
            variants.push((variant.id.clone(), save(of(&variant.id), image)?));
        }
        Ok(Kept {
            table: table.experiment.clone(),
            sequence: row.id.clone(),
            frame: job.name.clone(),
            telling: false,
            truth: save(truth, &drawn.truth)?,
            variants,
        })
    }
}

fn cut(image: &Image, [x0, x1, y0, y1]: [usize; 4]) -> Result<Image, Error> {
    let pixels = (y0..y1).flat_map(|y| (x0..x1).map(move |x| image.at(x, y))).collect();
    Ok(Image::new(x1 - x0, y1 - y0, pixels)?)
}

/// Reads a GIF of so many frames to its end; says how wide and high it is.
///
/// # Errors
/// What is wrong with it.
pub fn check_gif(bytes: &[u8], frames: usize) -> Result<[usize; 2], String> {
    let mut decoder = gif::DecodeOptions::new().read_info(bytes).map_err(|error| error.to_string())?;
    let mut found = 0;
    while decoder.read_next_frame().map_err(|error| error.to_string())?.is_some() {
        found += 1;
    }
    if found != frames {
        return Err(format!("{found} frames; expected {frames}"));
    }
    Ok([decoder.width().into(), decoder.height().into()])
}

/// Truth and variants side by side, in a box that holds the subject in every frame.
fn write_gif(path: &Path, frames: &[DrawnFrame]) -> Result<(), Error> {
    let hull = frames
        .iter()
        .map(|frame| frame.subject)
        .reduce(|[a0, a1, b0, b1], [x0, x1, y0, y1]| [a0.min(x0), a1.max(x1), b0.min(y0), b1.max(y1)]);
    let Some(hull) = hull else { return Ok(()) };
    let mut pictures = Vec::new();
    for frame in frames {
        let parts = std::iter::once(&frame.truth).chain(&frame.variants);
        let parts: Vec<RgbImage> = parts.map(|image| small(image, hull)).collect::<Result<_, _>>()?;
        pictures.push(side_by_side(&parts));
    }
    let bytes = encoded(pictures)
        .map_err(|error| Error::Sidecar { path: path.to_owned(), problem: error.to_string() })?;
    Ok(atomic::write(path, |w| std::io::Write::write_all(w, &bytes))?)
}

fn encoded(pictures: Vec<RgbImage>) -> Result<Vec<u8>, gif::EncodingError> {
    let [width, height] =
        pictures.first().map_or([1, 1], |first| [first.width() as u16, first.height() as u16]);
    let mut bytes = Vec::new();
    let mut encoder = gif::Encoder::new(&mut bytes, width, height, &[])?;
    encoder.set_repeat(gif::Repeat::Infinite)?;
    for picture in pictures {
        let mut frame = gif::Frame::from_rgb_speed(width, height, picture.as_raw(), 10);
        frame.delay = DELAY;
        encoder.write_frame(&frame)?;
    }
    drop(encoder);
    Ok(bytes)
}

fn small(image: &Image, hull: [usize; 4]) -> Result<RgbImage, Error> {
    let image = cut(image, hull)?;
    let level = |v: f32| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    let bytes = image.pixels().as_flattened().iter().map(|&v| level(v)).collect();
    let (width, height) = (image.width() as u32, image.height() as u32);
    let whole = RgbImage::from_raw(width, height, bytes).unwrap_or_default();
    if height <= MOVING_HEIGHT {
        return Ok(whole);
    }
    let narrow = (width * MOVING_HEIGHT / height).max(1);
    Ok(resize(&whole, narrow, MOVING_HEIGHT, FilterType::Triangle))
}

fn side_by_side(parts: &[RgbImage]) -> RgbImage {
    let [width, height] = parts.first().map_or([1, 1], |first| [first.width(), first.height()]);
    RgbImage::from_fn(width * parts.len() as u32, height, |x, y| {
        *parts[(x / width) as usize].get_pixel(x % width, y)
    })
}
