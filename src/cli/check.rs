//! `reproduce check`: look before you run.

use super::data::Data;
use super::output::{Format, emit, emit_json};
use super::{Context, Exit};
use anyhow::Result;
use serde::Serialize;
use skinsplat_check::{self as check, Finding, Kind, SequenceFit};
use skinsplat_data::Subject;
use skinsplat_data::select::evenly_spaced;
use std::path::PathBuf;

/// See whether bodies, poses, cameras and masks of a data set fit together.
///
/// Projects the posed body into every frame and compares it with the frame's mask: intersection over union, and findings
/// where it says that masks are inverted, poses are shifted, or a body or camera is another one. Exit code 1 if something was
/// found that would spoil the numbers of a table.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Check {
    /// Data set, or DATASET/SUBJECT [default: every subject of --data]
    name: Option<String>,
    /// At most N frames of each sequence, evenly spaced
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    limit: Option<u32>,
    /// Also write the body's outline (red) and the mask's (green) over each frame, and a contact sheet per sequence
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// How to print what was found
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    #[command(flatten)]
    data: Data,
}

const EXAMPLES: &str = "\
Examples:
  reproduce check neuman/seattle --out look     one subject, with pictures
  reproduce check --data DIR --format json      every subject of a folder, for programs";

/// What was seen.
#[derive(Serialize)]
struct Seen {
    sequences: Vec<SequenceFit>,
    findings: Vec<Finding>,
}

impl Check {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        let mut seen = Seen { sequences: Vec::new(), findings: Vec::new() };
        let subjects = self.data.subjects(self.name.as_deref())?;
        if self.name.is_none() {
            context.note(format!("no data set was named: all subjects that are there, {}", subjects.len()));
        }
        for (name, subject) in subjects {
            match subject {
                Ok(subject) => self.look_at(&name, &subject, &mut seen, context)?,
                Err(error) => {
                    seen.findings.push(Finding { sequence: name, ..Finding::of_error(&error) });
                }
            }
        }
        match self.format {
            Format::Json => emit_json(&seen)?,
            Format::Text => emit(&text(&seen))?,
        }
        let spoilt = seen.findings.iter().any(|finding| finding.spoils);
        Ok(if spoilt { Exit::Failed } else { Exit::Success })
    }

    fn look_at(&self, name: &str, subject: &Subject, seen: &mut Seen, context: Context) -> Result<()> {
        subject.notes.iter().for_each(|note| context.note(format!("{name}: {note}")));
        let own = check::subject(subject).into_iter();
        seen.findings.extend(own.map(|finding| Finding { sequence: name.to_owned(), ..finding }));
        let others = self.data.in_genders(name);
        for sequence in subject.sequences() {
            let all: Vec<usize> = (0..sequence.frames.len()).collect();
            let frames = evenly_spaced(&all, self.limit.map(|limit| limit as usize));
            let id = format!("{name}/{}", sequence.id);
            context.note(format!("{id}: {} frames", frames.len()));
            let (fit, findings) = check::sequence(sequence, &frames);
            let same = others.iter().filter_map(|(gender, other)| {
                Some((gender.name(), other.sequences().find(|other| other.id == sequence.id)?))
            });
            let gender = check::of_another_gender(sequence, &same.collect::<Vec<_>>(), &frames);
            seen.sequences.push(SequenceFit { id: id.clone(), ..fit });
            let found = explained_by(gender, findings).into_iter();
            seen.findings.extend(found.map(|finding| Finding { sequence: id.clone(), ..finding }));
            if let Some(folder) = &self.out {
                check::write_overlays(sequence, &frames, &folder.join(name))?;
            }
        }
        Ok(())
    }
}

/// What was found, in which the body of another gender explains a size that is off.
fn explained_by(gender: Option<Finding>, mut findings: Vec<Finding>) -> Vec<Finding> {
    if gender.is_some() {
        findings.retain(|finding| !matches!(finding.kind, Kind::Camera | Kind::WrongGenderOrModel));
    }
    findings.extend(gender);
    findings
}

fn text(Seen { sequences, findings }: &Seen) -> String {
    let mut text = String::new();
    for SequenceFit { id, frames, mean_iou } in sequences {
        let overlaps = frames.iter().filter_map(|f| Some((f.silhouette_iou?, f.name.as_str())));
        let worst = overlaps.min_by(|a, b| a.0.total_cmp(&b.0));
        let mean = mean_iou.map_or("none".to_owned(), |mean| format!("{mean:.3}"));
        let worst = worst.map_or(String::new(), |(overlap, name)| format!(", worst {overlap:.3} ({name})"));
        text += &format!("{id}: {} frames, mean overlap of body and mask {mean}{worst}\n", frames.len());
    }
    for Finding { kind, sequence, detail, spoils } in findings {
        let weight = if *spoils { "error" } else { "note" };
        text += &format!("{weight}: {sequence}: {kind}: {detail}\n");
    }
    if findings.is_empty() {
        text += "nothing found\n";
    }
    text
}
