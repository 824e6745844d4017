//! The results store: an append-only file of JSON lines, keyed by content.
//!
//! ```text
//! {"header":{"schema":2,"plan":"9f2c…","machine":{"host":"n1","processor":"…"}}}
//! {"frame":{"key":"51ab…","label":"…","outcome":{"scored":{…}},"seconds":{…}}}
//! ```
//!
//! A record goes out in one write, so that a process killed at any byte leaves at most one torn line, at the end:
//! reading drops it and [`Store::open`] cuts it off before it appends. Records are found by key, never by position. A
//! failed frame is a record too and is tried again by the next run. A file may be opened for another plan or on another
//! machine: keys that both plans share are not computed twice, and a further header line says where the other began.

use super::Machine;
use crate::experiment::{FrameRecord, Job, JobVariant, Outcome, Records};
use serde::{Deserialize, Serialize};
use skinsplat_data::source;
use std::collections::btree_map;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, Metadata, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Version of the file format. Stores of other versions are refused: a run into a new folder makes their records anew.
pub const SCHEMA: u32 = 2;

/// File name of a run that is not sharded.
pub const FILE_NAME: &str = "frames.jsonl";

/// How every store begins.
const OPENING: &str = "{\"header\":{";

/// A store that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The store.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file is something else, is damaged, or was written by a newer program.
    #[error("{}:{line}: {problem}; expected {expected}", path.display())]
    Invalid {
        /// The store.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What was found.
        problem: String,
        /// What a store has there.
        expected: String,
    },
    /// One key with two results: the program is not deterministic, or a code version was not raised.
    #[error(
        "{label}: two results for one key: {} at {first_at}, {} at {second_at}; expected equal ones: delete the stale \
         file, or raise the code version that moved the numbers",
        show(.first), show(.second)
    )]
    Conflict {
        /// What the frame is.
        label: String,
        /// Where the one result is: file and line, or "this run".
        first_at: String,
        /// The one result.
        first: Box<Outcome>,
        /// Where the other is.
        second_at: String,
        /// The other.
        second: Box<Outcome>,
    },
}

/// A result as the store writes it.
fn show(outcome: &Outcome) -> String {
    serde_json::to_string(outcome).expect("every field serialises")
}

/// A line of the file.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Line {
    Header(Header),
    Frame(Box<FrameRecord>),
}

/// Says what follows. Fields that a newer program adds do not keep this one from reading the schema number.
#[derive(Serialize, Deserialize)]
struct Header {
    schema: u32,
    /// Digest of the plan whose run appends from here on.
    plan: String,
    /// The machine that appends from here on; stores of 0.1 do not say.
    #[serde(default)]
    machine: Machine,
}

/// A record of a store, and where it comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The record.
    pub record: FrameRecord,
    /// Its line, from 1.
    pub line: usize,
    /// The machine that made it.
    pub machine: Arc<Machine>,
}

/// What a file holds, in the order of its lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Contents {
    /// Every record.
    pub entries: Vec<Entry>,
    /// Digest of the plan of the last header.
    pub plan: Option<String>,
    /// The machine of the last header.
    machine: Arc<Machine>,
    /// Bytes up to the end of the last whole line.
    whole: u64,
}

/// An open store.
#[derive(Debug)]
pub struct Store {
    path: PathBuf,
    file: File,
    records: Records,
}

impl Store {
    /// Opens or creates the store, drops a torn last line, and appends a header if the last one is of another plan or of another
    /// machine.
    ///
    /// # Errors
    /// If the file cannot be read or written, is not a store, or holds two results for one key.
    pub fn open(path: &Path, plan: &str, machine: &Machine) -> Result<Self, Error> {
        let io = |source| Error::Io { path: path.into(), source };
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(path).map_err(io)?;
        let locked = Locked::of(&file);
        let bytes = whole(&mut file).map_err(io)?;
        let contents = parse(&bytes, path)?;
        let records = contents.records(path)?;
        if contents.whole < bytes.len() as u64 {
            cut(path, contents.whole).map_err(io)?;
        }
        drop(locked);
        let mut store = Self { path: path.into(), file, records };
        if contents.plan.as_deref() != Some(plan) || *contents.machine != *machine {
            let (plan, machine) = (plan.into(), machine.clone());
            store.write(&[Line::Header(Header { schema: SCHEMA, plan, machine })])?;
        }
        Ok(store)
    }

    /// Every record so far.
    pub fn records(&self) -> &Records {
        &self.records
    }

    /// Every record, when the run is done.
    pub fn into_records(self) -> Records {
        self.records
    }

    /// Appends records, all of them in one write.
    ///
    /// # Errors
    /// If the disk refuses (the file is then as before), or a record contradicts an earlier one.
    pub fn append(&mut self, records: &[FrameRecord]) -> Result<(), Error> {
        let mut touched = Records::new();
        for record in records {
            if let (false, Some(earlier)) = (touched.contains_key(&record.key), self.records.get(&record.key))
            {
                touched.insert(record.key.clone(), earlier.clone());
            }
            let at = || [self.path.display().to_string(), "this run".to_owned()];
            insert(&mut touched, record.clone()).map_err(|clash| clash.at(at()))?;
        }
        let lines: Vec<Line> = records.iter().cloned().map(|record| Line::Frame(Box::new(record))).collect();
        self.write(&lines)?;
        self.records.append(&mut touched);
        Ok(())
    }

    /// Writes whole lines. What a refused write leaves behind is cut off again.
    fn write(&mut self, lines: &[Line]) -> Result<(), Error> {
        let mut text = String::new();
        for line in lines {
            text += &serde_json::to_string(line).expect("every field serialises");
            text.push('\n');
        }
        let io = |source| Error::Io { path: self.path.clone(), source };
        let _locked = Locked::of(&self.file);
        let before = self.file.metadata().map_err(io)?.len();
        self.file.write_all(text.as_bytes()).and_then(|()| self.file.flush()).map_err(|source| {
            // Should even this fail, the next reader drops the torn line.
            let _ = cut(&self.path, before);
            io(source)
        })
    }
}

/// A store that no other process changes meanwhile, where the file system has locks: the last line of another is then never
/// taken for a torn one. Without them, appending in one write has to do.
struct Locked(Option<File>);

impl Locked {
    fn of(file: &File) -> Self {
        Self(file.try_clone().ok().filter(|file| file.lock().is_ok()))
    }
}

impl Drop for Locked {
    fn drop(&mut self) {
        if let Some(file) = &self.0 {
            // It ends with the file at the latest.
            let _ = file.unlock();
        }
    }
}

/// Most bytes of a store: some million records.
const MOST: u64 = 1 << 32;

/// The bytes of a regular file. A device can neither be cut off nor read to its end.
fn whole(file: &mut File) -> io::Result<Vec<u8>> {
    let metadata = file.metadata()?;
    refuse_devices(&metadata)?;
    if metadata.len() > MOST {
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, "more than 4 GiB"));
    }
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn refuse_devices(metadata: &Metadata) -> io::Result<()> {
    match metadata.is_file() {
        true => Ok(()),
        false => Err(io::Error::other("not a regular file; expected one to which records can be appended")),
    }
}

/// Cuts a file off after a number of bytes.
fn cut(path: &Path, length: u64) -> io::Result<()> {
    OpenOptions::new().write(true).open(path)?.set_len(length)
}

/// Reads a store without touching it.
///
/// # Errors
/// If the file cannot be read, is not a store, or holds two results for one key.
pub fn read(path: &Path) -> Result<Records, Error> {
    read_all(path)?.records(path)
}

/// Everything that a store holds, contradictions included, without touching it.
///
/// # Errors
/// If the file cannot be read or is not a store.
pub fn read_all(path: &Path) -> Result<Contents, Error> {
    let bytes = source::open(path).and_then(|mut file| whole(&mut file));
    let bytes = bytes.map_err(|source| Error::Io { path: path.into(), source })?;
    parse(&bytes, path)
}

/// The results stores of a run's folder, sorted by name; none if there is no such folder.
///
/// # Errors
/// A folder that cannot be listed.
pub fn stores(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let io = |source| Error::Io { path: folder.into(), source };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        // A pipe of such a name would be waited for.
        if path.extension().is_some_and(|e| e == "jsonl") && path.is_file() {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

/// Writes records into a new store, those of one machine under a header of their own. An older store is replaced at once.
///
/// # Errors
/// A folder that cannot be written.
pub fn write_new<'a>(
    path: &Path,
    plan: &str,
    records: impl IntoIterator<Item = (&'a Machine, &'a FrameRecord)>,
) -> Result<(), skinsplat_data::Error> {
    let mut by_machine: BTreeMap<&Machine, Vec<&FrameRecord>> = BTreeMap::new();
    records.into_iter().for_each(|(machine, record)| by_machine.entry(machine).or_default().push(record));
    skinsplat_data::atomic::write(path, |w| {
        let mut line = |line: &Line| {
            w.write_all((serde_json::to_string(line).expect("every field serialises") + "\n").as_bytes())
        };
        for (machine, records) in by_machine {
            line(&Line::Header(Header { schema: SCHEMA, plan: plan.into(), machine: machine.clone() }))?;
            records.into_iter().try_for_each(|record| line(&Line::Frame(Box::new(record.clone()))))?;
        }
        Ok(())
    })
}

/// The records of several stores as one.
///
/// # Errors
/// If a store cannot be read, or two of them contradict each other.
pub fn merge<'a>(paths: impl IntoIterator<Item = &'a Path>) -> Result<Records, Error> {
    let mut all = Records::new();
    let mut origins: BTreeMap<String, &Path> = BTreeMap::new();
    for path in paths {
        for (key, record) in read(path)? {
            insert(&mut all, record).map_err(|clash| {
                let first = origins.get(&key).map_or_else(String::new, |path| path.display().to_string());
                clash.at([first, path.display().to_string()])
            })?;
            origins.entry(key).or_insert(path);
        }
    }
    Ok(all)
}

/// What is left to do: the jobs with those of their variants that have no score yet. A key that several jobs share is
/// left to the first of them. Pure.
pub fn outstanding<'a>(jobs: impl IntoIterator<Item = &'a Job>, records: &Records) -> Vec<Job> {
    let scored =
        |key: &str| matches!(records.get(key), Some(FrameRecord { outcome: Outcome::Scored { .. }, .. }));
    let mut claimed: BTreeSet<&str> = BTreeSet::new();
    let mut left = Vec::new();
    for job in jobs {
        let mut open = |variant: &&'a JobVariant| !scored(&variant.key) && claimed.insert(&variant.key);
        let variants: Vec<JobVariant> = job.variants.iter().filter(|v| open(v)).cloned().collect();
        if !variants.is_empty() {
            left.push(Job { variants, ..job.clone() });
        }
    }
    left
}

/// Two scores for one key.
struct Clash {
    label: String,
    first: Outcome,
    second: Outcome,
}

impl Clash {
    /// The error, with the places of the two.
    fn at(self, [first_at, second_at]: [String; 2]) -> Error {
        let Self { label, first, second } = self;
        Error::Conflict { label, first_at, first: Box::new(first), second_at, second: Box::new(second) }
    }
}

/// Adds a record: a score replaces a failure and repeats an equal score; a failure never replaces a score.
fn insert(records: &mut Records, record: FrameRecord) -> Result<(), Box<Clash>> {
    let mut slot = match records.entry(record.key.clone()) {
        btree_map::Entry::Vacant(slot) => {
            slot.insert(record);
            return Ok(());
        }
        btree_map::Entry::Occupied(slot) => slot,
    };
    let known = slot.get();
    match (&known.outcome, &record.outcome) {
        (Outcome::Scored { .. }, Outcome::Scored { .. }) if *known != record => {
            let (label, first) = (known.label.clone(), known.outcome.clone());
            return Err(Box::new(Clash { label, first, second: record.outcome }));
        }
        (Outcome::Scored { .. }, _) => {}
        (Outcome::Error(_), _) => {
            slot.insert(record);
        }
    }
    Ok(())
}

/// The whole lines of a store.
fn parse(bytes: &[u8], path: &Path) -> Result<Contents, Error> {
    let invalid = |line: usize, problem: String, expected: &str| Error::Invalid {
        path: path.into(),
        line,
        problem,
        expected: expected.into(),
    };
    let whole = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |last| last + 1);
    let start = &bytes[..bytes.len().min(OPENING.len())];
    if !OPENING.as_bytes().starts_with(start) {
        return Err(invalid(1, "not a results store".into(), &format!("a line that begins with {OPENING}")));
    }
    let mut contents =
        Contents { entries: Vec::new(), plan: None, machine: Arc::default(), whole: whole as u64 };
    let lines = bytes[..whole].split_inclusive(|&byte| byte == b'\n');
    for (number, line) in (1..).zip(lines) {
        let line: Line = serde_json::from_slice(line)
            .map_err(|error| invalid(number, error.to_string(), "a header or a frame record"))?;
        match line {
            Line::Header(header) if header.schema != SCHEMA => {
                let problem = format!("schema {}", header.schema);
                return Err(invalid(number, problem, &format!("{SCHEMA}, which this program writes")));
            }
            Line::Header(header) => {
                contents.plan = Some(header.plan);
                contents.machine = Arc::new(header.machine);
            }
            Line::Frame(record) => {
                let machine = contents.machine.clone();
                contents.entries.push(Entry { record: *record, line: number, machine });
            }
        }
    }
    Ok(contents)
}

impl Contents {
    /// The records by key.
    fn records(&self, path: &Path) -> Result<Records, Error> {
        let mut records = Records::new();
        let mut scored_in: BTreeMap<&str, usize> = BTreeMap::new();
        for Entry { record, line, .. } in &self.entries {
            let at = |line: usize| format!("{}:{line}", path.display());
            let first = scored_in.get(record.key.as_str()).copied().unwrap_or_default();
            insert(&mut records, record.clone()).map_err(|clash| clash.at([at(first), at(*line)]))?;
            if matches!(record.outcome, Outcome::Scored { .. }) {
                scored_in.entry(&record.key).or_insert(*line);
            }
        }
        Ok(records)
    }
}
