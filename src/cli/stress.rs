//! `reproduce stress`: numerical stability at the extremes.

use super::output::{PageFormat, emit};
use super::products::make_folder;
use super::progress::Watch;
use super::{Context, Exit};
use anyhow::Result;
use skinsplat_data::error::read_bytes;
use skinsplat_data::{atomic, frames};
use skinsplat_study::stress::{self, Report, Section};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Try every strategy and solver on inputs that are hard on purpose, and say what holds, degrades and breaks.
///
/// Needs no data. Writes stress.md, stress.html, stress.csv (a line per input), stress.json and pictures of what breaks visibly, and
/// prints the Markdown.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Stress {
    /// How to print what was found
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t)]
    format: PageFormat,
    /// Folder to write to; it is made if it is missing
    #[arg(long, value_name = "DIR", default_value = "runs/stress")]
    out: PathBuf,
    /// Only these sections
    #[arg(long, value_name = "SECTION", value_delimiter = ',')]
    only: Vec<SectionName>,
    /// Fewer inputs
    #[arg(long)]
    quick: bool,
}

/// A section by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct SectionName(Section);

impl std::str::FromStr for SectionName {
    type Err = String;

    fn from_str(id: &str) -> Result<Self, String> {
        let known = || Section::ALL.map(Section::id).join(", ");
        let section = Section::ALL.into_iter().find(|section| section.id() == id);
        section.map(Self).ok_or_else(|| format!("expected one of {}", known()))
    }
}

const EXAMPLES: &str = "\
Examples:
  reproduce stress                          everything, into runs/stress
  reproduce stress --only averages --out /tmp/stress";

impl Stress {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        let out = &self.out;
        make_folder(out)?;
        let sections: Vec<Section> = Section::ALL.into_iter().filter(|s| self.wants(*s)).collect();
        let watch = Watch::new(context.quiet);
        watch.start("sections", sections.len());
        let mut findings = Vec::new();
        let mut pictures = Vec::new();
        for section in sections {
            let examined = section.examine(self.quick)?;
            findings.push(examined.findings);
            pictures.extend(examined.pictures);
            watch.see(skinsplat::run::Event::FrameDone(section.id().to_owned()));
        }
        drop(watch);
        let report = Report::new(self.quick, findings, pictures);
        for picture in &report.pictures {
            frames::save_png(&out.join(&picture.file), &picture.image)?;
        }
        let shown = report.pictures.iter().map(|picture| {
            let path = out.join(&picture.file);
            Ok(read_bytes(&path, "picture", "the PNG that was just written")?)
        });
        let html = stress::page(&report, &shown.collect::<Result<Vec<_>>>()?).html();
        write(&out.join("stress.html"), &html)?;
        let (markdown, json) = (report.markdown(), report.json());
        write(&out.join("stress.csv"), &report.csv())?;
        write(&out.join("stress.json"), &json)?;
        write(&out.join("stress.md"), &markdown)?;
        emit(self.format.of(&markdown, &json))?;
        Ok(Exit::Success)
    }

    fn wants(&self, section: Section) -> bool {
        self.only.is_empty() || self.only.contains(&SectionName(section))
    }
}

fn write(path: &Path, text: &str) -> Result<()> {
    Ok(atomic::write(path, |file| file.write_all(text.as_bytes()))?)
}
