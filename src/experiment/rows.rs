//! Which sequences a table is made from, and which of their frames.

use super::{Dataset, Experiment, FrameInfo, Options, Role, SequenceInfo, Split, StandIn, SubjectInfo};
use serde::{Deserialize, Serialize};
use skinsplat_data::select::evenly_spaced;

/// Where the numbers of a table come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// The table's own data set.
    Own,
    /// Other data of the same kind of capture: the numbers do not compare with the paper's.
    StandIn,
    /// No data: the table has no rows.
    Absent,
}

/// A sequence of the table: one subject's test sequence, and the training frames that go with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DataRow {
    /// `dataset/subject/sequence`, unique in the table.
    pub id: String,
    /// What the table calls it.
    pub label: String,
    /// Data set.
    pub dataset: String,
    /// Subject.
    pub subject: String,
    /// Test sequence; empty if the row has no data.
    pub sequence: String,
    /// Indices of the test frames that are scored, ascending.
    pub frames: Vec<usize>,
    /// Training sequence and the indices of its frames; none if the subject has none.
    pub train: Option<(String, Vec<usize>)>,
    /// Why the row has no frames, if it has none.
    pub missing: Option<String>,
    /// Digests of the test and the training sequence, if there is data. The keys of the jobs hold them already.
    #[serde(skip)]
    pub data: Option<RowDigests>,
    /// Width and height of the test images as stored, pixels, if somebody knows. No number depends on it.
    #[serde(skip)]
    pub image: Option<[u32; 2]>,
}

/// Digests of the data of a row.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RowDigests {
    /// Of the test sequence.
    pub test: String,
    /// Of the training sequence, if the subject has one.
    pub train: Option<String>,
}

/// The rows of an experiment: of its own data set if that is there, else of every subject that may stand in.
pub(super) fn rows_of(
    experiment: &Experiment,
    datasets: &[Dataset],
    options: &Options,
) -> (Source, Vec<DataRow>) {
    // Who loads data without asking for the table's bodies has the subjects' own.
    let named = |id: &str| datasets.iter().find(|dataset| dataset.id == id);
    let own = named(&experiment.data_id()).or_else(|| named(&experiment.dataset));
    let stand_in = match (own, &experiment.stand_in) {
        // Where nothing of it can be used, a stand-in is of more use than rows of reasons.
        (Some(own), stand_in) if stand_in.is_none() || !own.subjects.is_empty() => {
            return (Source::Own, own_rows(experiment, own, options));
        }
        (_, Some(stand_in)) => stand_in,
        (_, None) => return (Source::Absent, Vec::new()),
    };
    let fits = |s: &&SubjectInfo| stand_in.capture.is_none_or(|capture| s.capture == capture);
    let of_kind = |d: &&Dataset| !d.is_for_one_table() && d.subjects.iter().any(|s| fits(&s));
    let several = datasets.iter().filter(of_kind).count() > 1;
    let mut rows = Vec::new();
    for dataset in datasets.iter().filter(of_kind) {
        for subject in dataset.subjects.iter().filter(|s| fits(s) && chosen(options, &s.id)) {
            for mut row in stand_in_rows(stand_in, dataset, subject, options) {
                if several && dataset.id != subject.id {
                    row.label = format!("{}: {}", dataset.id, row.label);
                }
                rows.push(row);
            }
        }
    }
    (if rows.is_empty() { Source::Absent } else { Source::StandIn }, rows)
}

/// True if the subset leaves the subject in.
fn chosen(options: &Options, subject: &str) -> bool {
    let subjects = &options.subset.subjects;
    subjects.is_empty() || subjects.iter().any(|id| id == subject)
}

/// The experiment's sequences (subjects) in printed order; those that are not there are rows without data.
fn own_rows(experiment: &Experiment, dataset: &Dataset, options: &Options) -> Vec<DataRow> {
    let unreadable = dataset.unreadable.iter().map(|known| known.subject.as_str());
    let ids: Vec<&str> = if experiment.sequences.is_empty() {
        dataset.subjects.iter().map(|s| s.id.as_str()).chain(unreadable).collect()
    } else {
        experiment.sequences.iter().map(String::as_str).collect()
    };
    let mut rows = Vec::new();
    for id in ids.into_iter().filter(|id| chosen(options, id)) {
        let subject = dataset.subjects.iter().find(|subject| subject.id == id);
        let split = experiment.splits.iter().find(|split| split.sequence == id);
        let found =
            subject.map_or_else(Vec::new, |subject| own_subject_rows(dataset, subject, split, options));
        if found.is_empty() {
            let missing = match subject {
                None => unusable(dataset, id),
                Some(_) => format!("no test sequence of `{id}` matches the experiment's split"),
            };
            rows.push(without_data(dataset, id, missing));
        }
        rows.extend(found);
    }
    rows
}

/// The row of a subject that has nothing to score.
fn without_data(dataset: &Dataset, subject: &str, missing: String) -> DataRow {
    DataRow {
        id: format!("{}/{subject}", dataset.registered_id()),
        label: subject.into(),
        dataset: dataset.id.clone(),
        subject: subject.into(),
        sequence: String::new(),
        frames: Vec::new(),
        train: None,
        missing: Some(missing),
        data: None,
        image: None,
    }
}

/// Why a data set has no usable subject of this id.
fn unusable(dataset: &Dataset, id: &str) -> String {
    match dataset.unreadable.iter().find(|known| known.subject == id) {
        Some(known) => known.problem.clone(),
        None => format!("the data set has no subject `{id}`"),
    }
}

/// The rows of a subject of the table's own data set. A subject with one test sequence is called by its own name, as in
/// the paper.
fn own_subject_rows(
    dataset: &Dataset,
    subject: &SubjectInfo,
    split: Option<&Split>,
    options: &Options,
) -> Vec<DataRow> {
    let plays = |sequence: &&SequenceInfo, role: Role| match split.and_then(|split| split.take(role)) {
        Some(take) => sequence.id == take,
        None => sequence.role == role || (sequence.role == Role::Whole && split.is_some()),
    };
    let frames = |sequence: &SequenceInfo, role: Role| -> Vec<usize> {
        let by_range = split.filter(|_| !subject.split_given);
        indices(sequence, |frame| by_range.is_none_or(|split| split.selects(role, frame)))
    };
    let train = subject.sequences.iter().find(|s| plays(s, Role::Train)).map(|s| (s, frames(s, Role::Train)));
    let tests: Vec<&SequenceInfo> = subject.sequences.iter().filter(|s| plays(s, Role::Test)).collect();
    let label = |test: &SequenceInfo| match tests.len() {
        1 => subject.id.clone(),
        _ => format!("{} / {}", subject.id, test.id),
    };
    let row = |test: &&SequenceInfo| {
        let scored = frames(test, Role::Test);
        data_row(dataset, subject, test, label(test), scored, train.clone(), options)
    };
    tests.iter().map(row).collect()
}

/// The rows of a subject that stands in: each of its test sequences, or why it has none of those that the table names.
fn stand_in_rows(
    stand_in: &StandIn,
    dataset: &Dataset,
    subject: &SubjectInfo,
    options: &Options,
) -> Vec<DataRow> {
    let plays = |sequence: &&SequenceInfo, role: Role, named: &[String]| match named {
        [] => sequence.role == role,
        named => named.contains(&sequence.id),
    };
    let train = subject.sequences.iter().find(|s| plays(s, Role::Train, &stand_in.train));
    let train = train.map(|sequence| (sequence, indices(sequence, |_| true)));
    let tests = subject.sequences.iter().filter(|s| plays(s, Role::Test, &stand_in.test));
    let row = |test: &SequenceInfo| {
        let label = format!("{} / {}", subject.id, test.id);
        data_row(dataset, subject, test, label, indices(test, |_| true), train.clone(), options)
    };
    let rows: Vec<DataRow> = tests.map(row).collect();
    if rows.is_empty() && !stand_in.test.is_empty() {
        let missing = format!("`{}` has no sequence {}", subject.id, stand_in.test.join(", "));
        return vec![without_data(dataset, &subject.id, missing)];
    }
    rows
}

/// Indices of the frames for which the condition holds.
fn indices(sequence: &SequenceInfo, keep: impl Fn(&FrameInfo) -> bool) -> Vec<usize> {
    let kept = sequence.frames.iter().enumerate().filter(|(_, frame)| keep(frame));
    kept.map(|(index, _)| index).collect()
}

fn data_row(
    dataset: &Dataset,
    subject: &SubjectInfo,
    test: &SequenceInfo,
    label: String,
    scored: Vec<usize>,
    train: Option<(&SequenceInfo, Vec<usize>)>,
    options: &Options,
) -> DataRow {
    let frames = options.subset.select(scored, &options.profile);
    let none_of = |which: &str| Some(format!("no {which} frame is left by the split and the subset"));
    let missing = match &train {
        _ if frames.is_empty() => none_of("test"),
        Some((_, frames)) if frames.is_empty() => none_of("training"),
        _ => None,
    };
    let train_digest = train.as_ref().map(|(sequence, _)| sequence.digest.clone());
    let thin = |frames: Vec<usize>| evenly_spaced(&frames, options.profile.max_train_frames);
    DataRow {
        id: format!("{}/{}/{}", dataset.registered_id(), subject.id, test.id),
        label,
        dataset: dataset.id.clone(),
        subject: subject.id.clone(),
        sequence: test.id.clone(),
        frames,
        train: train.map(|(sequence, frames)| (sequence.id.clone(), thin(frames))),
        missing,
        data: Some(RowDigests { test: test.digest.clone(), train: train_digest }),
        image: test.image,
    }
}
