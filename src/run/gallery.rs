//! Pictures of a run: for every sequence of every table the frame on which the variants differ most.
//!
//! A picture has the truth and every variant side by side, in the table's order, cropped to the subject; below each variant
//! its absolute error, four times enlarged.

use super::drawable::{Behind, Scratch};
use super::execute::{prepare_avatars, test_sequence};
use super::frame::{Frame, behind};
use super::looks::{look, noisy_pose};
use super::{Error, Event, Library};
use crate::experiment::{Job, Outcome, Plan, Records};
use skinsplat_core::scene::{Image, Mask, SceneError};
use skinsplat_data::frames::save_png;
use skinsplat_metrics::MetricId;
use std::fmt::Write;
use std::path::Path;

/// Factor on the errors that are shown.
const ERROR_GAIN: f32 = 4.0;
/// Pixels around the subject that a crop keeps, as a part of its size.
const MARGIN: f32 = 0.06;

/// Writes the pictures into `folder` and returns a page that shows them. What has no score is not drawn.
///
/// # Errors
/// An avatar or a frame that cannot be made, or a folder that cannot be written.
pub fn write(
    plan: &Plan,
    library: &Library,
    records: &Records,
    avatars: &Path,
    folder: &Path,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<String, Error> {
    std::fs::create_dir_all(folder).map_err(|source| Error::Folder { path: folder.to_owned(), source })?;
    let scored = scored(&plan.jobs, records);
    let chosen = most_telling(&scored, records);
    let jobs: Vec<Job> = chosen.iter().map(|&job| job.clone()).collect();
    let avatars = prepare_avatars(plan, &jobs, library, avatars, watch)?;
    watch(Event::Frames(jobs.len()));
    let mut scratch = Scratch::default();
    let mut page = format!(
        "# Pictures\n\nFor each sequence, the frame on which the variants differ most in PSNR: the truth, then the variants in \
         the table's order; below, their absolute errors times {ERROR_GAIN}.\n"
    );
    for job in chosen {
        let mut images = Vec::new();
        let sequence = test_sequence(job, library)?;
        let frame = Frame::load(&sequence, job.frame, None)?;
        for variant in &job.variants {
            let avatar = avatars[&variant.avatar]
                .as_ref()
                .map_err(|problem| Error::Avatar { problem: problem.clone() })?;
            let noisy = noisy_pose(variant, &sequence, job.frame);
            let noisy_view = noisy.as_ref().map(|pose| frame.in_pose(pose)).transpose()?;
            let view = noisy_view.as_ref().unwrap_or(&frame.view);
            images.push(avatar.draw(view, &look(job, variant, &frame.truth)?, &mut scratch)?.image);
        }
        let truth = match behind(&job.protocol, &frame.truth)? {
            Behind::Colour(colour) => frame.truth.rgb.composited(&frame.truth.alpha, colour)?,
            Behind::Picture(_) => frame.truth.rgb.clone(),
        };
        let table = &plan.tables[job.table];
        let name = picture_name(&table.experiment, &table.rows[job.row].label, &job.name);
        save_png(&folder.join(&name), &strip(&truth, &images, &frame.truth.alpha)?)?;
        let variants: Vec<&str> = job.variants.iter().map(|variant| variant.id.as_str()).collect();
        let caption = format!("{} {} {}", table.experiment, table.rows[job.row].label, job.name);
        let _ = write!(page, "\n{caption}: truth, {}\n\n![{caption}]({name})\n", variants.join(", "));
        watch(Event::FrameDone(String::new()));
    }
    Ok(page)
}

/// The jobs with those of their variants that have a score: what could not be drawn then cannot be drawn now.
pub(super) fn scored(jobs: &[Job], records: &Records) -> Vec<Job> {
    let has_score =
        |key: &str| records.get(key).is_some_and(|record| matches!(record.outcome, Outcome::Scored { .. }));
    let reduced = |job: &Job| {
        let variants: Vec<_> =
            job.variants.iter().filter(|variant| has_score(&variant.key)).cloned().collect();
        (!variants.is_empty()).then(|| Job { variants, ..job.clone() })
    };
    jobs.iter().filter_map(reduced).collect()
}

/// Per table and sequence, the first job with the widest spread of PSNR.
fn most_telling<'a>(jobs: &'a [Job], records: &Records) -> Vec<&'a Job> {
    let mut best: Vec<(&Job, f64)> = Vec::new();
    for job in jobs {
        let Some(spread) = spread(job, records) else { continue };
        match best.last_mut() {
            Some((last, widest)) if (last.table, last.row) == (job.table, job.row) => {
                if spread > *widest {
                    (*last, *widest) = (job, spread);
                }
            }
            _ => best.push((job, spread)),
        }
    }
    best.into_iter().map(|(job, _)| job).collect()
}

/// How far the PSNR of the variants lie apart on a frame; none if one was not scored or is infinite.
pub(super) fn spread(job: &Job, records: &Records) -> Option<f64> {
    let psnr = |key: &str| match &records.get(key)?.outcome {
        Outcome::Scored { score, .. } => score.value(MetricId::PSNR),
        Outcome::Error(_) => None,
    };
    let scores: Option<Vec<f64>> = job.variants.iter().map(|variant| psnr(&variant.key)).collect();
    let scores = scores?;
    let high = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let low = scores.iter().copied().fold(f64::INFINITY, f64::min);
    (high - low).is_finite().then_some(high - low)
}

/// The file, in the folder of pictures, of a frame: experiment, label of the sequence, name of the frame.
pub fn picture_name(experiment: &str, sequence: &str, frame: &str) -> String {
    file_name(&format!("{experiment}-{sequence}-{frame}"))
}

/// Letters, digits and dashes.
fn file_name(text: &str) -> String {
    let dashed =
        text.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' }).collect::<String>();
    let parts: Vec<&str> = dashed.split('-').filter(|part| !part.is_empty()).collect();
    parts.join("-") + ".png"
}

/// Truth and variants in a row, errors below.
fn strip(truth: &Image, variants: &[Image], alpha: &Mask) -> Result<Image, SceneError> {
    let [x0, x1, y0, y1] = crop(alpha);
    let (width, height) = (x1 - x0, y1 - y0);
    let mut pixels = Vec::with_capacity(2 * width * height * (variants.len() + 1));
    for y in y0..y1 {
        for image in std::iter::once(truth).chain(variants) {
            pixels.extend((x0..x1).map(|x| image.at(x, y)));
        }
    }
    for y in y0..y1 {
        pixels.extend(std::iter::repeat_n([0.0; 3], width));
        for image in variants {
            let error = |x| {
                let (a, b) = (image.at(x, y), truth.at(x, y));
                std::array::from_fn(|c| ((a[c] - b[c]).abs() * ERROR_GAIN).min(1.0))
            };
            pixels.extend((x0..x1).map(error));
        }
    }
    Image::new(width * (variants.len() + 1), 2 * height, pixels)
}

/// The subject's bounding box with a margin (x from, x to, y from, y to; half open); the whole image if it is empty.
pub(super) fn crop(alpha: &Mask) -> [usize; 4] {
    let (width, height) = (alpha.width(), alpha.height());
    let inside = |x: usize, y: usize| alpha.at(x, y) > 0.5;
    let columns: Vec<usize> = (0..width).filter(|&x| (0..height).any(|y| inside(x, y))).collect();
    let rows: Vec<usize> = (0..height).filter(|&y| (0..width).any(|x| inside(x, y))).collect();
    let span = |hit: &[usize], size: usize| match (hit.first(), hit.last()) {
        (Some(&first), Some(&last)) => {
            let margin = ((last - first + 1) as f32 * MARGIN) as usize + 2;
            [first.saturating_sub(margin), (last + 1 + margin).min(size)]
        }
        _ => [0, size],
    };
    let ([x0, x1], [y0, y1]) = (span(&columns, width), span(&rows, height));
    [x0, x1, y0, y1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_show_truth_variants_and_errors() {
        let truth = Image::filled(20, 30, [0.5; 3]);
        let render = Image::filled(20, 30, [0.6, 0.5, 0.0]);
        let mut alpha = Mask::filled(20, 30, 0.0);
        alpha.values_mut()[10 * 20 + 8] = 1.0;
        let picture = strip(&truth, &[render], &alpha).unwrap();
        let [x0, x1, y0, y1] = crop(&alpha);
        assert_eq!([x0, x1, y0, y1], [6, 11, 8, 13]);
        assert_eq!((picture.width(), picture.height()), (10, 10));
        assert_eq!((picture.at(0, 0), picture.at(5, 0)), ([0.5; 3], [0.6, 0.5, 0.0]));
        assert_eq!(picture.at(0, 9), [0.0; 3]);
        let error = picture.at(9, 9);
        assert!((error[0] - 0.4).abs() < 1e-6 && error[1] == 0.0 && error[2] == 1.0);
    }

    #[test]
    fn file_names_are_plain() {
        assert_eq!(
            file_name("table1-synthetic: dots / test_twist-cam00/image_0004"),
            "table1-synthetic-dots-test_twist-cam00-image_0004.png"
        );
    }
}
