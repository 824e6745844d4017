//! What a run leaves in its folder, whoever collected the records: tables, curves, verdict.

use super::output::{table_format, written};
use super::{Context, Exit};
use anyhow::Result;
use skinsplat::experiment::{Experiment, Plan};
use skinsplat::quoting::quoted;
use skinsplat::report;
use skinsplat::run::plan_file::LeftOut;
use skinsplat::run::{self, Error};
use skinsplat_data::atomic;
use skinsplat_table::{Format, to_json};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Folder, inside a run's, of the avatars that it made.
pub(super) const AVATARS: &str = "avatars";

/// Formats that each table is written in, in a file of its own.
const TABLE_FILES: [&str; 2] = ["csv", "latex"];

/// Every form of the tables.
pub(super) fn write_results(folder: &Path, results: &report::Results) -> Result<()> {
    write_text(&folder.join("tables.md"), &report::page(results))?;
    write_text(&folder.join("results.json"), &results.to_json())?;
    for table in &results.tables {
        for format in TABLE_FILES.iter().filter_map(|id| Format::named(id)) {
            let file = format!("{}.{}", table.experiment, format.extension);
            write_text(&folder.join(file), &(format.write)(&table.table))?;
        }
    }
    Ok(())
}

/// How to go on after a run into a folder was stopped.
pub(super) fn kept_in(folder: &Path) -> String {
    let folder = quoted(folder.as_os_str());
    format!("what is done is kept in {folder}; the same command goes on from there")
}

/// The format in which tables are printed, as an argument of whoever prints all of them.
#[derive(Debug, clap::Args)]
pub(super) struct Printed {
    /// How to print the tables
    #[arg(long, value_name = "FORMAT", value_parser = table_format(), default_value = MARKDOWN)]
    pub(super) format: String,
}

/// Tables with what is said around them, as in tables.md.
pub(super) const MARKDOWN: &str = "markdown";
/// All tables as one document.
pub(super) const JSON: &str = "json";

/// All tables in a format.
pub(super) fn printed(results: &report::Results, format: &str) -> String {
    let tables = results.tables.iter().map(|table| &table.table);
    match format {
        MARKDOWN => report::page(results),
        JSON => to_json(&tables.collect::<Vec<_>>()),
        format => tables.map(|table| written(table, format)).collect::<Vec<_>>().join("\n"),
    }
}

/// How the fits went, if there were any, from the reports beside the avatars in some runs' folders.
pub(super) fn write_curves(
    out: &Path,
    plan: &Plan,
    experiments: &[Experiment],
    runs: &[PathBuf],
) -> Result<()> {
    let avatars: Vec<PathBuf> = runs.iter().map(|run| run.join(AVATARS)).collect();
    let curves = run::curves::curves(plan, &avatars)?;
    if curves.is_empty() {
        return Ok(());
    }
    write_text(&out.join("curves.csv"), &report::curves_csv(&curves))?;
    let folder = out.join("curves");
    make_folder(&folder)?;
    for (name, svg) in report::curve_plots(&curves, experiments)? {
        write_text(&folder.join(format!("{name}.svg")), &svg)?;
    }
    Ok(())
}

/// Differences by how far the body is bent, if a table asks for them.
pub(super) fn write_bend(out: &Path, results: &report::Results) -> Result<()> {
    let Some(lines) = report::bend_csv(results) else { return Ok(()) };
    write_text(&out.join("bend.csv"), &lines)?;
    for (table, svg) in report::bend_plots(results)? {
        write_text(&out.join(format!("{table}-bend.svg")), &svg)?;
    }
    Ok(())
}

/// Whether everything that was asked for is in the tables; says what is not.
pub(super) fn verdict(plan: &Plan, missing: usize, left_out: &[LeftOut], context: Context) -> Exit {
    if missing > 0 {
        return Exit::Incomplete;
    }
    // Those that nobody asked for are missed by nobody.
    let asked = &plan.options.subset.subjects;
    let mut left_out =
        left_out.iter().filter(|own| asked.is_empty() || asked.contains(&own.subject.subject)).peekable();
    if left_out.peek().is_some() {
        for LeftOut { dataset, subject } in left_out {
            context.note(format!("{dataset}/{}: left out: {}", subject.subject, subject.problem));
        }
        return Exit::Incomplete;
    }
    if plan.jobs.is_empty() {
        context.note("no frame was selected: none of the experiments has data here");
        return Exit::Incomplete;
    }
    Exit::Success
}

pub(super) fn write_text(path: &Path, text: &str) -> Result<()> {
    Ok(atomic::write(path, |w| w.write_all(text.as_bytes()))?)
}

pub(super) fn make_folder(folder: &Path) -> Result<()> {
    Ok(std::fs::create_dir_all(folder).map_err(|source| Error::Folder { path: folder.to_owned(), source })?)
}
