//! The results store: an append-only file of JSON lines, keyed by content.
//!
//! ```text
//! {"header":{"schema":1,"plan":"9f2c…"}}
//! {"frame":{"key":"51ab…","label":"…","outcome":{"scored":{…}},"seconds":{…}}}
//! ```
//!
//! A record goes out in one write, so that a process killed at any byte leaves at most one torn line, at the end:
//! reading drops it and [`Store::open`] cuts it off before it appends. Records are found by key, never by position. A
//! failed frame is a record too and is tried again by the next run. A file may be opened for another plan: keys that
//! both plans share are not computed twice, and a further header line says where the other plan began.

use crate::experiment::{FrameRecord, Job, JobVariant, Outcome, Records};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::collections::btree_map::Entry;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Version of the file format.
pub const SCHEMA: u32 = 1;

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
        "{first_label}: two results for one key {key}: {first} and {second}; expected equal ones: delete the stale file, or raise the code version that changed the numbers"
    )]
    Conflict {
        /// The key.
        key: String,
        /// What the frame is.
        first_label: String,
        /// One result.
        first: String,
        /// The other.
        second: String,
    },
}

/// A line of the file.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Line {
    Header(Header),
    Frame(FrameRecord),
}

/// Says what follows. Fields that a newer program adds do not keep this one from reading the schema number.
#[derive(Serialize, Deserialize)]
struct Header {
    schema: u32,
    /// Digest of the plan whose run appends from here on.
    plan: String,
}

/// What a file holds.
struct Contents {
    records: Records,
    /// Digest of the plan of the last header.
    plan: Option<String>,
    /// Bytes up to the end of the last whole line.
    whole: u64,
}

/// An open store.
#[derive(Debug)]
pub struct Store {
    path: PathBuf,
    file: File,
    length: u64,
    records: Records,
}

impl Store {
    /// Opens or creates the store, drops a torn last line, and appends a header if the last one is of another plan.
    ///
    /// # Errors
    /// If the file cannot be read or written, is not a store, or holds two results for one key.
    pub fn open(path: &Path, plan: &str) -> Result<Self, Error> {
        let io = |source| Error::Io { path: path.into(), source };
        let mut options = OpenOptions::new();
        let mut file = options.read(true).write(true).create(true).truncate(false).open(path).map_err(io)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(io)?;
        let contents = parse(&bytes, path)?;
        file.set_len(contents.whole).map_err(io)?;
        file.seek(SeekFrom::Start(contents.whole)).map_err(io)?;
        let mut store = Self { path: path.into(), file, length: contents.whole, records: contents.records };
        if contents.plan.as_deref() != Some(plan) {
            store.write(&[Line::Header(Header { schema: SCHEMA, plan: plan.into() })])?;
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
        let mut touched: Records =
            records.iter().filter_map(|new| self.records.get_key_value(&new.key)).map(own).collect();
        for record in records {
            insert(&mut touched, record.clone())?;
        }
        let lines: Vec<Line> = records.iter().cloned().map(Line::Frame).collect();
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
        let written = self.file.write_all(text.as_bytes()).and_then(|()| self.file.flush());
        if let Err(source) = written {
            // If even that fails, the torn line is dropped by the next reader.
            let _ =
                self.file.set_len(self.length).and_then(|()| self.file.seek(SeekFrom::Start(self.length)));
            return Err(Error::Io { path: self.path.clone(), source });
        }
        self.length += text.len() as u64;
        Ok(())
    }
}

fn own((key, record): (&String, &FrameRecord)) -> (String, FrameRecord) {
    (key.clone(), record.clone())
}

/// Reads a store without touching it.
///
/// # Errors
/// If the file cannot be read, is not a store, or holds two results for one key.
pub fn read(path: &Path) -> Result<Records, Error> {
    let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.into(), source })?;
    Ok(parse(&bytes, path)?.records)
}

/// The records of several stores as one.
///
/// # Errors
/// If a store cannot be read, or two of them contradict each other.
pub fn merge<'a>(paths: impl IntoIterator<Item = &'a Path>) -> Result<Records, Error> {
    let mut all = Records::new();
    for path in paths {
        for (_, record) in read(path)? {
            insert(&mut all, record)?;
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

/// Adds a record: a score replaces a failure and repeats an equal score; a failure never replaces a score.
fn insert(records: &mut Records, record: FrameRecord) -> Result<(), Error> {
    let mut slot = match records.entry(record.key.clone()) {
        Entry::Vacant(slot) => {
            slot.insert(record);
            return Ok(());
        }
        Entry::Occupied(slot) => slot,
    };
    match (&slot.get().outcome, &record.outcome) {
        (Outcome::Scored { .. }, Outcome::Scored { .. }) if *slot.get() != record => {
            let show = |r: &FrameRecord| serde_json::to_string(&r.outcome).expect("every field serialises");
            return Err(Error::Conflict {
                key: record.key.clone(),
                first_label: slot.get().label.clone(),
                first: show(slot.get()),
                second: show(&record),
            });
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
    let mut contents = Contents { records: Records::new(), plan: None, whole: whole as u64 };
    let lines = bytes[..whole].split_inclusive(|&byte| byte == b'\n');
    for (number, line) in (1..).zip(lines) {
        let line: Line = serde_json::from_slice(line)
            .map_err(|error| invalid(number, error.to_string(), "a header or a frame record"))?;
        match line {
            Line::Header(header) if header.schema != SCHEMA => {
                let problem = format!("schema {}", header.schema);
                return Err(invalid(number, problem, &format!("{SCHEMA}, which this program writes")));
            }
            Line::Header(header) => contents.plan = Some(header.plan),
            Line::Frame(record) => insert(&mut contents.records, record)?,
        }
    }
    Ok(contents)
}
