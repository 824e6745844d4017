//! The plan beside the stores of its shards, `plan-DIGEST.json`: with it a merge needs neither the data nor the arguments of the
//! runs. Its name holds the digest, so that shards of one plan write one file, whoever comes first.

use super::Error;
use crate::experiment::{CodeVersions, Experiment, Plan, RowDigests, Unreadable};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use skinsplat_data::atomic;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Version of the file's schema.
pub const SCHEMA: u32 = 1;

/// A plan and what its report needs besides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanFile {
    /// Version of this schema.
    pub schema: u32,
    /// Versions of the code that planned.
    pub code: CodeVersions,
    /// The plan.
    pub plan: Plan,
    /// What it was made from.
    pub experiments: Vec<Experiment>,
    /// What the plan's own form leaves out, by table and row.
    rows: Vec<Vec<Row>>,
    /// Subjects that nobody could use.
    pub left_out: Vec<LeftOut>,
}

/// What the form of a row leaves out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    data: Option<RowDigests>,
    image: Option<[u32; 2]>,
}

/// A subject that could not be used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeftOut {
    /// Data set.
    pub dataset: String,
    /// Subject and reason.
    #[serde(flatten)]
    pub subject: Unreadable,
}

impl PlanFile {
    /// Of a plan and the experiments that it was made from.
    pub fn new(plan: &Plan, experiments: &[Experiment], left_out: Vec<LeftOut>) -> Self {
        let rows = plan.tables.iter().map(|table| {
            table.rows.iter().map(|row| Row { data: row.data.clone(), image: row.image }).collect()
        });
        Self {
            schema: SCHEMA,
            code: CodeVersions::CURRENT,
            rows: rows.collect(),
            plan: plan.clone(),
            experiments: experiments.to_vec(),
            left_out,
        }
    }

    /// Name of the file of a plan.
    pub fn name(digest: &str) -> String {
        format!("plan-{}.json", digest.get(..16).unwrap_or(digest))
    }

    /// Writes the file into a run's folder, unless it is there.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), Error> {
        let path = folder.join(Self::name(&self.plan.digest));
        if path.is_file() && Self::read(&path).is_ok() {
            return Ok(());
        }
        let text = serde_json::to_string(self).expect("every field serialises") + "\n";
        Ok(atomic::write(&path, |w| w.write_all(text.as_bytes()))?)
    }

    /// Reads the file; the plan is the one that its digest names.
    ///
    /// # Errors
    /// A file that cannot be read, that is something else, or that was changed.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let invalid = |problem: String| Error::PlanFile { path: path.to_owned(), problem };
        let bytes = skinsplat_data::source::read(path).map_err(|source| Error::File {
            path: path.to_owned(),
            action: "read",
            source,
        })?;
        let mut file: Self = serde_json::from_slice(&bytes).map_err(|error| invalid(error.to_string()))?;
        if file.schema != SCHEMA {
            return Err(invalid(format!("schema {}", file.schema)));
        }
        let Plan { options, tables, jobs, digest, .. } = &file.plan;
        if Plan::digest_of(options, tables, jobs) != *digest {
            return Err(invalid("the plan is not the one that its digest names".to_owned()));
        }
        for (table, rows) in file.plan.tables.iter_mut().zip(&file.rows) {
            for (row, Row { data, image }) in table.rows.iter_mut().zip(rows) {
                (row.data, row.image) = (data.clone(), *image);
            }
        }
        Ok(file)
    }

    /// The file of a plan in one of some folders.
    ///
    /// # Errors
    /// As [`PlanFile::read`]; [`Error::NoPlanFile`] if none has it.
    pub fn find(digest: &str, folders: &[PathBuf], store: &Path) -> Result<Self, Error> {
        let name = Self::name(digest);
        let path = folders.iter().map(|folder| folder.join(&name)).find(|path| path.is_file());
        let path = path.ok_or_else(|| Error::NoPlanFile { store: store.to_owned(), name })?;
        let file = Self::read(&path)?;
        match file.plan.digest == digest {
            true => Ok(file),
            false => Err(Error::PlanFile { path, problem: "the plan of another digest".to_owned() }),
        }
    }

    /// The first part in which another plan differs: where, what this one has there, what the other.
    pub fn difference(&self, other: &Self) -> Option<Difference> {
        let [a, b] = [self, other].map(Self::parts);
        a.into_iter().zip(b).find_map(|((part, a), (_, b))| first_difference(part, &a, &b))
    }

    /// The parts by which plans are told apart, the telling ones first.
    fn parts(&self) -> [(&'static str, Value); 6] {
        let Self { code, plan, experiments, rows, .. } = self;
        let data: Vec<Vec<_>> = rows.iter().map(|rows| rows.iter().map(|row| &row.data).collect()).collect();
        [
            ("code", json!(code)),
            ("options", json!(plan.options)),
            ("experiments", json!(experiments)),
            ("tables", json!(plan.tables)),
            ("data", json!(data)),
            ("jobs", json!(plan.jobs)),
        ]
    }
}

/// Where two documents differ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The field, such as `options.profile.fit_iterations`.
    pub field: String,
    /// What the one has.
    pub first: String,
    /// What the other has.
    pub second: String,
}

/// The first difference of two JSON values, by depth.
fn first_difference(field: &str, a: &Value, b: &Value) -> Option<Difference> {
    if a == b {
        return None;
    }
    let within = match (a, b) {
        (Value::Object(a), Value::Object(b)) => a.keys().chain(b.keys()).find_map(|key| {
            let [a, b] = [a, b].map(|map| map.get(key).unwrap_or(&Value::Null));
            first_difference(&format!("{field}.{key}"), a, b)
        }),
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => (0..a.len())
            .find_map(|i| first_difference(&format!("{field}[{}]", element_name(&a[i], i)), &a[i], &b[i])),
        _ => None,
    };
    let here = || Difference { field: field.to_owned(), first: shown(a), second: shown(b) };
    Some(within.unwrap_or_else(here))
}

/// What an element is called: its own name where it has one.
fn element_name(element: &Value, index: usize) -> String {
    let named = ["id", "experiment"].into_iter().find_map(|name| element.get(name)?.as_str());
    named.map_or_else(|| index.to_string(), str::to_owned)
}

/// Longest text of a value in a message.
const SHOWN: usize = 80;

fn shown(value: &Value) -> String {
    let text = match value {
        Value::Null => "nothing".to_owned(),
        Value::Array(items) if items.iter().any(|item| item.is_array() || item.is_object()) => {
            format!("{} entries", items.len())
        }
        value => value.to_string(),
    };
    match text.chars().count() > SHOWN {
        true => text.chars().take(SHOWN).chain(['…']).collect(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_field_that_differs_is_named() {
        let one = json!({ "a": [{ "id": "x", "n": 1 }, { "id": "y", "n": 2 }], "b": null });
        let other = json!({ "a": [{ "id": "x", "n": 1 }, { "id": "y", "n": 3 }] });
        let found = first_difference("p", &one, &other).expect("they differ");
        assert_eq!(
            (found.field.as_str(), found.first.as_str(), found.second.as_str()),
            ("p.a[y].n", "2", "3")
        );
        assert_eq!(first_difference("p", &one, &one), None);
        let longer = first_difference("p", &json!([[1], [2]]), &json!([[1]])).expect("they differ");
        assert_eq!((longer.first.as_str(), longer.second.as_str()), ("2 entries", "1 entries"));
    }
}
