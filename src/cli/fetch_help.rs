//! `reproduce fetch-help`: how to get a data set that cannot be shipped.

use super::Exit;
use super::data::Data;
use super::output::emit;
use anyhow::Result;
use skinsplat::datasets::Dataset;
use skinsplat_data::layouts::LAYOUTS;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Say who has a data set, what to unpack where, and what a registry says of it.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct FetchHelp {
    /// Id of the data set (see `reproduce list datasets`)
    dataset: String,
    #[command(flatten)]
    data: Data,
}

/// Where the body models are to be had, by what a layout's files are made for.
const MODELS: [(&str, &str); 2] =
    [("SMPL", "https://smpl.is.tue.mpg.de"), ("SMPL-X", "https://smpl-x.is.tue.mpg.de")];

const EXAMPLES: &str = "\
Examples:
  reproduce fetch-help neuman";

impl FetchHelp {
    pub(super) fn run(&self) -> Result<Exit> {
        let registry = self.data.registry()?;
        // A layout beside that of a data set, such as peoplesnapshot-raw, is the same data in other files.
        let of_layout = || {
            let layout = LAYOUTS.iter().find(|layout| layout.id == self.dataset)?;
            let dataset = registry.datasets.iter().find(|dataset| layout.id.starts_with(&dataset.id))?;
            Some(Dataset { id: layout.id.to_owned(), layout: layout.id.to_owned(), ..dataset.clone() })
        };
        match (registry.get(&self.dataset), of_layout()) {
            (Err(_), Some(dataset)) => emit(&text(&dataset)?)?,
            (dataset, _) => emit(&text(dataset?)?)?,
        }
        Ok(Exit::Success)
    }
}

fn text(dataset: &Dataset) -> Result<String> {
    let Dataset { title, provenance, licence, .. } = dataset;
    let mut text = format!("{title}\n  {provenance}\n  Licence: {licence}\n");
    if dataset.is_generated() {
        return Ok(text + "  Nothing to fetch: it is generated.\n");
    }
    if let Some(url) = &dataset.url {
        text += &format!("  To be had from {url}\n");
    }
    if let Some(layout) = dataset.reader() {
        text += &format!("\nLayout {}: {}\n", layout.id, layout.summary);
        for part in layout.parts {
            text += &format!("  {:<24} {}\n", part.what, part.place);
        }
    }
    text += "\nA folder per subject:\n";
    for folder in dataset.subject_folders().unwrap_or_default() {
        text += &format!("  {}: {}\n", state(&folder), absolute(&folder).display());
    }
    if let Some(model) = &dataset.model {
        let hands = dataset.layout == "xhumans";
        let (name, url) = MODELS[usize::from(hands)];
        let stem = if hands { "SMPLX" } else { "SMPL" };
        text += &format!(
            "\nThe body model {name}, under its own licence from {url}, as {stem}_NEUTRAL, {stem}_FEMALE and {stem}_MALE \
             (.npz or .pkl):\n  {}: {}\n",
            state(model),
            absolute(model).display()
        );
    }
    text += "\nThe entry of datasets.toml (paths are relative to that file):\n\n";
    let mut entry = toml::Table::try_from(dataset)?;
    entry.retain(|_, value| !says_nothing(value));
    text += &toml::to_string(&BTreeMap::from([("dataset", [entry])]))?;
    text += &format!("\nThen: reproduce inspect FOLDER, and reproduce check {}\n", dataset.id);
    Ok(text)
}

/// True for lists and tables that are empty, as they are where a file leaves them out.
fn says_nothing(value: &toml::Value) -> bool {
    value.as_table().is_some_and(toml::Table::is_empty) || value.as_array().is_some_and(Vec::is_empty)
}

fn state(path: &Path) -> &'static str {
    if path.exists() { "here" } else { "missing" }
}

fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}
