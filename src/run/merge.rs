//! Collecting what several machines computed of one plan.

use super::plan_file::{Difference, PlanFile};
use super::store::{self, Contents, Entry};
use super::{Error, Machine};
use crate::experiment::{FrameRecord, Outcome, Records, Shard, Slices};
use serde::Serialize;
use serde_json::Value;
use std::collections::btree_map;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What the stores of a plan hold together.
#[derive(Clone, Debug, PartialEq)]
pub struct Merged {
    /// The plan.
    pub file: PlanFile,
    /// Every record, the first of several that agree.
    pub records: Records,
    /// The machine of each record, by its key.
    pub machines: BTreeMap<String, Arc<Machine>>,
    /// The stores, in the order in which they were read.
    pub sources: Vec<Source>,
    /// Records for which two stores have different results.
    pub disagreements: Vec<Disagreement>,
    /// Records of the plan without a score.
    pub missing: Vec<Missing>,
}

/// A store that was collected.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Source {
    /// The file.
    pub store: String,
    /// The slice, if it is one's.
    pub shard: Option<Shard>,
    /// The machines that wrote it.
    pub machines: Vec<Machine>,
    /// Records.
    pub records: usize,
    /// Seconds that they took.
    pub seconds: f64,
}

/// Two results for one key.
#[derive(Clone, Debug, PartialEq)]
pub struct Disagreement {
    /// The key.
    pub key: String,
    /// What the frame is.
    pub label: String,
    /// File and line of each, and the machine.
    pub places: [(String, Arc<Machine>); 2],
    /// What differs: metric, the one's value, the other's.
    pub values: Vec<(String, String, String)>,
}

/// A record that is not there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Missing {
    /// What the frame is.
    pub label: String,
    /// The slice that it belongs to, if the stores are slices'.
    pub shard: Option<Shard>,
    /// Why, if somebody tried.
    pub problem: Option<String>,
}

/// Reads every store of some run folders, which have to be of one plan.
///
/// # Errors
/// A folder without stores, a store that cannot be read, a plan that is not there, two plans.
pub fn merge(folders: &[PathBuf]) -> Result<Merged, Error> {
    let mut plan: Option<(PathBuf, PlanFile)> = None;
    let mut stores: Vec<(PathBuf, Contents)> = Vec::new();
    for folder in folders {
        let before = stores.len();
        for path in store::stores(folder)? {
            let contents = store::read_all(&path)?;
            // A run that was killed before its first line.
            let Some(digest) = &contents.plan else { continue };
            match &plan {
                None => plan = Some((path.clone(), PlanFile::find(digest, folders, &path)?)),
                Some((_, known)) if known.plan.digest == *digest => {}
                Some((first, known)) => {
                    let other = PlanFile::find(digest, folders, &path)?;
                    return Err(mixed((first, known), (&path, &other)));
                }
            }
            stores.push((path, contents));
        }
        if stores.len() == before {
            return Err(Error::NoStores { folder: folder.clone() });
        }
    }
    let (_, file) =
        plan.ok_or_else(|| Error::NoStores { folder: folders.first().cloned().unwrap_or_default() })?;
    let sources = stores.iter().map(|(path, contents)| Source::of(path, contents)).collect::<Vec<_>>();
    let mut collected = Collected::default();
    for (path, contents) in stores {
        contents.entries.into_iter().for_each(|entry| collected.add(&path, entry));
    }
    let missing = missing(&file, &collected.records, &sources);
    let machines = collected.places.into_iter().map(|(key, (_, machine))| (key, machine)).collect();
    Ok(Merged {
        file,
        records: collected.records,
        machines,
        sources,
        disagreements: collected.clashes,
        missing,
    })
}

/// Two plans, and in what they differ.
fn mixed((first, plan): (&Path, &PlanFile), (second, other): (&Path, &PlanFile)) -> Error {
    let digests = || Difference {
        field: "digest".to_owned(),
        first: plan.plan.digest.clone(),
        second: other.plan.digest.clone(),
    };
    let difference = plan.difference(other).unwrap_or_else(digests);
    Error::MixedPlans {
        first: first.to_owned(),
        second: second.to_owned(),
        field: difference.field,
        first_has: difference.first,
        second_has: difference.second,
    }
}

impl Source {
    fn of(path: &Path, contents: &Contents) -> Self {
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let machines: BTreeSet<&Machine> = contents.entries.iter().map(|entry| &*entry.machine).collect();
        let seconds = |entry: &Entry| {
            let seconds = entry.record.seconds;
            seconds.pose + seconds.render + seconds.score
        };
        Self {
            store: path.to_string_lossy().into_owned(),
            shard: Shard::of_file_name(&name),
            machines: machines.into_iter().cloned().collect(),
            records: contents.entries.len(),
            seconds: contents.entries.iter().map(seconds).sum(),
        }
    }
}

/// Records with their places, and where they contradict each other.
#[derive(Default)]
struct Collected {
    records: Records,
    places: BTreeMap<String, (String, Arc<Machine>)>,
    clashes: Vec<Disagreement>,
}

impl Collected {
    /// A score replaces a failure; a failure never replaces a score; the first of two scores stays.
    fn add(&mut self, path: &Path, Entry { record, line, machine }: Entry) {
        let place = (format!("{}:{line}", path.display()), machine);
        let known = match self.records.entry(record.key.clone()) {
            btree_map::Entry::Vacant(slot) => {
                self.places.insert(record.key.clone(), place);
                slot.insert(record);
                return;
            }
            btree_map::Entry::Occupied(slot) => slot.into_mut(),
        };
        match (&known.outcome, &record.outcome) {
            (Outcome::Error(_), Outcome::Scored { .. }) => {
                self.places.insert(record.key.clone(), place);
                *known = record;
            }
            (Outcome::Scored { .. }, Outcome::Scored { .. }) if *known != record => {
                let first = self.places.get(&record.key).cloned().unwrap_or_default();
                self.clashes.push(Disagreement {
                    values: differing_values(known, &record),
                    places: [first, place],
                    key: record.key,
                    label: record.label,
                });
            }
            _ => {}
        }
    }
}

/// Every number in which two results differ, by its place in the record.
fn differing_values(a: &FrameRecord, b: &FrameRecord) -> Vec<(String, String, String)> {
    let [a, b] = [a, b].map(|record| serde_json::to_value(&record.outcome).unwrap_or_default());
    let mut found = Vec::new();
    walk("", &a["scored"], &b["scored"], &mut found);
    found
}

fn walk(at: &str, a: &Value, b: &Value, found: &mut Vec<(String, String, String)>) {
    let join = |name: &str| if at.is_empty() { name.to_owned() } else { format!("{at}.{name}") };
    match (a, b) {
        _ if a == b => {}
        (Value::Object(one), Value::Object(other)) => {
            let names: BTreeSet<&String> = one.keys().chain(other.keys()).collect();
            // The metrics themselves carry no prefix.
            let plain = |name: &String| match ["score", "values"].contains(&name.as_str()) {
                true => at.to_owned(),
                false => join(name),
            };
            names
                .into_iter()
                .for_each(|name| walk(&plain(name), &a[name.as_str()], &b[name.as_str()], found));
        }
        _ => found.push((at.to_owned(), a.to_string(), b.to_string())),
    }
}

/// What has no score, and whose it is: of the finest splitting that the stores name.
fn missing(file: &PlanFile, records: &Records, sources: &[Source]) -> Vec<Missing> {
    let count = sources.iter().filter_map(|source| source.shard).map(Shard::count).max();
    let slices = count.map(|count| Slices::of(&file.plan, count));
    let mut seen = BTreeSet::new();
    let mut missing = Vec::new();
    for (job, variant) in file.plan.jobs.iter().flat_map(|job| job.variants.iter().map(move |v| (job, v))) {
        let problem = match records.get(&variant.key).map(|record| &record.outcome) {
            Some(Outcome::Scored { .. }) => continue,
            Some(Outcome::Error(problem)) => Some(problem.clone()),
            None => None,
        };
        if seen.insert(&variant.key) {
            let shard = slices.as_ref().and_then(|slices| slices.owner(&variant.key));
            let table = &file.plan.tables[job.table].experiment;
            let label = format!("{table}: {}", job.label(variant));
            missing.push(Missing { label, shard, problem });
        }
    }
    missing
}
