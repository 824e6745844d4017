//! `conform.json`: which rig a folder holds.

use super::{Cases, Convention, Error, RIG_VERSION};
use serde::Deserialize;
use serde_json::json;
use std::path::Path;

/// The file.
pub(crate) const NAME: &str = "conform.json";

/// What the folder holds.
pub(crate) struct Exported {
    pub(crate) cases: Cases,
    pub(crate) convention: Convention,
}

#[derive(Deserialize)]
struct Manifest {
    rig_version: u32,
    cases: String,
    convention: String,
}

/// The text of the file.
pub(crate) fn text(cases: Cases, convention: &Convention) -> String {
    let value = json!({
        "format": "skinsplat conform",
        "rig_version": RIG_VERSION,
        "cases": cases.name(),
        "convention": convention.to_string(),
    });
    format!("{value:#}\n")
}

/// Reads the file of a folder.
///
/// # Errors
/// No such file, another version of the rig, unknown names.
pub(crate) fn read(folder: &Path) -> Result<Exported, Error> {
    let path = folder.join(NAME);
    let expected = "a folder that `reproduce conform export --out` wrote";
    let manifest: Manifest = skinsplat_data::error::read_json(&path, "rig", expected)?;
    let place = |field: &str| format!("{}: {field}", path.display());
    if manifest.rig_version != RIG_VERSION {
        let expected = format!("{RIG_VERSION}: export the rig again");
        return Err(Error::new(place("rig_version"), manifest.rig_version.to_string(), expected));
    }
    let named = Cases::NAMES.into_iter().find(|(name, _)| *name == manifest.cases);
    let Some((_, cases)) = named else {
        return Err(Error::new(place("cases"), format!("`{}`", manifest.cases), "small or full"));
    };
    let convention =
        manifest.convention.parse().map_err(|e: Error| Error { place: place("convention"), ..e })?;
    Ok(Exported { cases, convention })
}
