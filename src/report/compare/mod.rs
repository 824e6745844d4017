//! Two results documents: what moved, and whether for the worse.
//!
//! ```text
//! baseline, current ─ compare() ─► Changes ─┬─ verdicts(), moved()   tables, for every format of `skinsplat_table`
//! current ────── against_paper() ─►         ├─ text(), markdown()    for people
//!                                           ├─ to_json()             reports/schema/compare.json
//!                                           └─ junit(), github()     for continuous integration
//! ```

mod against_paper;
mod comparable;
mod formats;
mod github;
mod junit;
mod series;
mod tables;
mod tolerances;

pub use against_paper::against_paper;
pub use formats::{markdown, text};
pub use github::github;
pub use junit::junit;
pub use tables::{moved, verdicts};
pub use tolerances::{Allowed, Tolerances};

use super::results::Results;
use comparable::comparable;
use serde::{Deserialize, Serialize};
use skinsplat_metrics::MetricId;
use skinsplat_table::Digits;
use std::collections::BTreeMap;

/// Version of the format of a comparison as JSON.
pub const SCHEMA: u32 = 1;

/// Frames that are named behind a number.
const NAMED_FRAMES: usize = 3;

/// The outcome of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// A number got worse by more than its tolerance.
    Regressed,
    /// None did, but something of the baseline is missing or does not compare, or nothing was compared at all.
    Incomplete,
    /// A number got better by more than its tolerance and none got worse.
    Improved,
    /// No number moved by more than its tolerance.
    Unchanged,
}

impl Verdict {
    /// Its name in files.
    pub fn id(self) -> &'static str {
        match self {
            Self::Regressed => "regressed",
            Self::Incomplete => "incomplete",
            Self::Improved => "improved",
            Self::Unchanged => "unchanged",
        }
    }
}

/// What became of one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fate {
    /// Worse by more than the tolerance.
    Regressed,
    /// Better by more than the tolerance.
    Improved,
    /// Within the tolerance.
    Unchanged,
    /// The baseline has it, the current results have not.
    Missing,
    /// The current results have it, the baseline has not.
    New,
}

impl Fate {
    /// All of them, those that need attention first.
    pub const ALL: [Self; 5] = [Self::Regressed, Self::Missing, Self::Improved, Self::New, Self::Unchanged];

    /// Its name in files and tables.
    pub fn id(self) -> &'static str {
        match self {
            Self::Regressed => "regressed",
            Self::Improved => "improved",
            Self::Unchanged => "unchanged",
            Self::Missing => "missing",
            Self::New => "new",
        }
    }

    /// Of a number that moved from `before` to `after`.
    fn of(metric: MetricId, before: f64, after: f64, tolerance: f64) -> Self {
        // What prints as equal to the tolerance is within it: 30.05 - 30 is a little more than 0.05.
        let rounding = 4.0 * f64::EPSILON * before.abs().max(after.abs());
        let rounding = if tolerance > 0.0 && rounding.is_finite() { rounding } else { 0.0 };
        if before == after || (after - before).abs() <= tolerance + rounding {
            Self::Unchanged
        } else if (after > before) == metric.higher_is_better() {
            Self::Improved
        } else {
            Self::Regressed
        }
    }
}

/// One number of both documents: a metric of a variant on a sequence.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Line {
    /// Id of the experiment.
    pub table: String,
    /// `dataset/subject/sequence`; what a mean is called, if it is one, and what the paper calls one that is missing.
    pub sequence: String,
    /// Id of the variant; what the paper calls one that is missing.
    pub variant: String,
    /// The metric; none where all of them are missing or new.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metric: Option<MetricId>,
    /// With every test pose fitted to its image.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub fitted: bool,
    /// In the baseline; infinite is `null` in JSON.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub baseline: Option<f64>,
    /// Digits after the point of a baseline that is printed in the paper.
    #[serde(skip)]
    pub printed: Option<usize>,
    /// In the current results; infinite is `null` in JSON.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub current: Option<f64>,
    /// How far it may move.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// What became of it.
    pub fate: Fate,
    /// The frames behind a number that moved, the farthest first.
    #[serde(skip)]
    pub moved: Vec<String>,
    /// Frames of which that is said, where it is not said of the whole sequence.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frames: Vec<String>,
}

/// The title of a number, of poses as they are given or fitted.
fn titled(title: &str, fitted: bool) -> String {
    if fitted { format!("{title} (fitted)") } else { title.to_owned() }
}

impl Line {
    /// A line on all of a sequence and variant, without a number.
    fn new(table: &str, [sequence, variant]: [String; 2], fate: Fate) -> Self {
        Self {
            table: table.to_owned(),
            sequence,
            variant,
            metric: None,
            fitted: false,
            baseline: None,
            printed: None,
            current: None,
            tolerance: None,
            fate,
            moved: Vec::new(),
            frames: Vec::new(),
        }
    }

    /// With how many digits its baseline is shown: a printed one as it was printed.
    fn digits_before(&self, metric: MetricId) -> Digits {
        self.printed.map_or_else(|| tables::finer(metric), Digits::Decimals)
    }

    /// The frame that it is about, or those behind its movement.
    pub(super) fn behind(&self) -> String {
        match (self.frames.as_slice(), self.moved.as_slice()) {
            ([], []) => String::new(),
            ([], moved) => format!("; most in {}", moved.join(", ")),
            (frames, _) => format!("; in {}", frames.join(", ")),
        }
    }

    /// What its number is called.
    pub(super) fn title(&self) -> String {
        titled(self.metric.map_or("all", MetricId::title), self.fitted)
    }
}

/// A number of a frame that moved.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Move {
    /// Id of the experiment.
    pub table: String,
    /// `dataset/subject/sequence`.
    pub sequence: String,
    /// What the table calls the sequence.
    #[serde(skip)]
    pub label: String,
    /// Id of the variant.
    pub variant: String,
    /// Name of the image.
    pub frame: String,
    /// The metric.
    pub metric: MetricId,
    /// With the pose fitted to its image.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub fitted: bool,
    /// In the baseline; infinite is `null` in JSON.
    pub baseline: f64,
    /// In the current results; infinite is `null` in JSON.
    pub current: f64,
    /// The change in tolerances of the sequence's number, without its sign; infinite (`null` in JSON) where the tolerance is 0 or
    /// one of the numbers is infinite.
    pub tolerances: f64,
    /// Whether it got worse.
    pub worse: bool,
    /// Pictures of the frame that both runs kept: before and after.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pictures: Option<[String; 2]>,
}

/// How many numbers had which fate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// See [`Fate::Regressed`].
    pub regressed: usize,
    /// See [`Fate::Missing`].
    pub missing: usize,
    /// See [`Fate::Improved`].
    pub improved: usize,
    /// See [`Fate::New`].
    pub new: usize,
    /// See [`Fate::Unchanged`].
    pub unchanged: usize,
}

/// Why something was not compared, or what a reader has to know of what was.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Note {
    /// Whether something was left out because of it.
    pub left_out: bool,
    /// One line.
    pub text: String,
}

/// Everything that a comparison found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Changes {
    /// Version of the format: [`SCHEMA`].
    pub schema: u32,
    /// The outcome.
    pub verdict: Verdict,
    /// Whether what got better counts as a regression.
    pub strict: bool,
    /// Whether the baseline is what the paper prints.
    #[serde(skip)]
    pub paper: bool,
    /// Sequences and variants that were compared.
    pub compared: usize,
    /// Numbers by their fate.
    pub counts: Counts,
    /// What did not compare, and what else has to be known.
    pub notes: Vec<Note>,
    /// Every number, in the order of the baseline; those that are new last.
    pub lines: Vec<Line>,
    /// Frames that moved at all, per metric.
    pub frames_moved: usize,
    /// The frames that moved most, those that got worse first, the farthest first.
    pub frames: Vec<Move>,
}

/// Compares results with a baseline: the aggregates of every sequence and variant against the tolerances, and frame by frame to
/// show where a movement comes from. Frames are matched by sequence and name, so that runs whose keys differ (other code versions)
/// compare; where only some frames are in both, those are what is compared.
///
/// Left out with a note: tables of another protocol or version, sequences of other data.
pub fn compare(baseline: &Results, current: &Results, tolerances: &Tolerances) -> Changes {
    let mut changes = Changes::default();
    tolerances.note_unknown(&[baseline, current], &mut changes.notes);
    let pairs = comparable(baseline, current, &mut changes.notes);
    for pair in &pairs.both {
        pair.compare(tolerances, &mut changes);
    }
    changes.lines.extend(pairs.missing.iter().map(|series| series.line(Fate::Missing)));
    changes.lines.extend(pairs.new.iter().map(|series| series.line(Fate::New)));
    if changes.compared == 0 {
        changes.notes.push(pairs.nothing_shared(baseline, current));
    }
    changes.finish()
}

impl Default for Changes {
    fn default() -> Self {
        Self {
            schema: SCHEMA,
            verdict: Verdict::Incomplete,
            strict: false,
            paper: false,
            compared: 0,
            counts: Counts::default(),
            notes: Vec::new(),
            lines: Vec::new(),
            frames_moved: 0,
            frames: Vec::new(),
        }
    }
}

impl Changes {
    /// Counts, sorts and judges.
    fn finish(mut self) -> Self {
        for line in &self.lines {
            *match line.fate {
                Fate::Regressed => &mut self.counts.regressed,
                Fate::Missing => &mut self.counts.missing,
                Fate::Improved => &mut self.counts.improved,
                Fate::New => &mut self.counts.new,
                Fate::Unchanged => &mut self.counts.unchanged,
            } += 1;
        }
        self.frames_moved = self.frames.len();
        self.frames.sort_by(|a, b| {
            let size = |m: &Move| (m.current - m.baseline).abs();
            let by_tolerances = b.tolerances.total_cmp(&a.tolerances);
            b.worse.cmp(&a.worse).then(by_tolerances).then_with(|| size(b).total_cmp(&size(a)))
        });
        self.name_frames();
        let left_out = self.notes.iter().any(|note| note.left_out);
        self.verdict = match self.counts {
            Counts { regressed: 1.., .. } => Verdict::Regressed,
            Counts { missing: 1.., .. } => Verdict::Incomplete,
            _ if left_out || self.compared == 0 => Verdict::Incomplete,
            Counts { improved: 1.., .. } => Verdict::Improved,
            _ => Verdict::Unchanged,
        };
        self
    }

    /// Names the frames behind every number, of all that moved: who shows fewer still has them.
    fn name_frames(&mut self) {
        let mut by_number: BTreeMap<_, Vec<&String>> = BTreeMap::new();
        for m in &self.frames {
            let number = ([&m.table, &m.sequence, &m.variant], m.metric, m.fitted, m.worse);
            let names = by_number.entry(number).or_default();
            if names.len() < NAMED_FRAMES {
                names.push(&m.frame);
            }
        }
        for line in &mut self.lines {
            let (Some(metric), at) = (line.metric, [&line.table, &line.sequence, &line.variant]) else {
                continue;
            };
            let names = by_number.get(&(at, metric, line.fitted, line.fate == Fate::Regressed));
            line.moved = names.into_iter().flatten().map(|name| (*name).clone()).collect();
        }
    }

    /// The comparison judged so that a number that got better by more than its tolerance counts too: for a program whose numbers
    /// should not move. A fault may well raise a score.
    pub fn strictly(self) -> Self {
        Self { strict: true, ..self }
    }

    /// Whether a program that checks for regressions should be content.
    pub fn is_good(&self) -> bool {
        match self.verdict {
            Verdict::Unchanged => true,
            Verdict::Improved => !self.strict,
            Verdict::Regressed | Verdict::Incomplete => false,
        }
    }

    /// Whether a line counts against the current results.
    fn is_bad(&self, line: &Line) -> bool {
        match line.fate {
            Fate::Regressed | Fate::Missing => true,
            Fate::Improved => self.strict,
            Fate::Unchanged | Fate::New => false,
        }
    }

    /// What the current results are held against.
    fn against(&self) -> &'static str {
        if self.paper { "paper" } else { "baseline" }
    }

    /// The comparison with so many frames at most.
    pub fn with_frames(mut self, most: usize) -> Self {
        self.frames.truncate(most);
        self
    }

    /// The outcome in a line: `regressed: 2 regressed, 1 improved, 30 unchanged`.
    pub fn summary(&self) -> String {
        let Counts { regressed, missing, improved, new, unchanged } = self.counts;
        let counts = [
            (regressed, Fate::Regressed),
            (missing, Fate::Missing),
            (improved, Fate::Improved),
            (new, Fate::New),
            (unchanged, Fate::Unchanged),
        ];
        let counts: Vec<String> = (counts.iter().filter(|(count, _)| *count > 0))
            .map(|(count, fate)| format!("{count} {}", fate.id()))
            .collect();
        let counts = if counts.is_empty() { "nothing compared".to_owned() } else { counts.join(", ") };
        let strict =
            if self.strict && self.counts.improved > 0 { "; strict: what improved counts too" } else { "" };
        format!("verdict: {}: {counts}{strict}", self.verdict.id())
    }
}
