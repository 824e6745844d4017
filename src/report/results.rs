//! The results document, `results.json`: every table, sequence and frame of a run. Nothing in it depends on the time or
//! the machine. `reports/SCHEMA.md` describes it key by key.

use super::comparison::Comparison;
use super::reading::from_json;
use crate::experiment::{AvatarRecipe, CodeVersions, FittedOutcome, Options, PoseNoise, Shown, Source};
use serde::{Deserialize, Serialize};
use skinsplat_fit::options::PoseFit;
use skinsplat_metrics::{FrameScore, ProtocolId, Summary};
use skinsplat_table::{Digits, Table, to_json};
use std::collections::BTreeSet;

/// Version of the document's format.
pub const SCHEMA: u32 = 4;

/// The oldest version that this program reads.
pub const OLDEST_SCHEMA: u32 = 3;

/// Everything that a run found out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Results {
    /// Version of the format: [`SCHEMA`], or an earlier one that was read.
    pub schema: u32,
    /// Digest of the plan.
    pub plan: String,
    /// What was asked for.
    pub options: Options,
    /// Versions of the code behind the numbers.
    pub code: CodeVersions,
    /// One per experiment.
    pub tables: Vec<TableResults>,
}

impl Results {
    /// The document as text: JSON, indented, with a final newline.
    pub fn to_json(&self) -> String {
        to_json(self)
    }

    /// Reads a document.
    ///
    /// # Errors
    /// One line that says what is wrong and where.
    pub fn from_json(text: &str) -> Result<Self, String> {
        /// Whatever else changes, every version has this.
        #[derive(Deserialize)]
        struct Versioned {
            schema: u32,
        }
        let what = "the results.json of a run (reports/SCHEMA.md)";
        let versioned: Versioned = from_json(text, what)?;
        if !(OLDEST_SCHEMA..=SCHEMA).contains(&versioned.schema) {
            let expected = format!("{OLDEST_SCHEMA} to {SCHEMA}, which this program reads");
            return Err(format!("schema: {}; expected {expected}", versioned.schema));
        }
        let results: Self = from_json(text, what)?;
        once("tables: experiment", results.tables.iter().map(|table| table.experiment.as_str()))?;
        results.tables.iter().try_for_each(TableResults::check)?;
        Ok(results)
    }

    /// Frames that were planned and have no score, over all tables.
    pub fn missing(&self) -> usize {
        let variants = self.tables.iter().flat_map(|t| &t.sequences).flat_map(|sequence| &sequence.variants);
        variants.map(VariantResults::missing).sum()
    }
}

/// Refuses an id that comes twice: nobody could say which of the two is meant.
fn once<'a>(place: &str, ids: impl Iterator<Item = &'a str>) -> Result<(), String> {
    let mut seen = BTreeSet::new();
    let again = ids.into_iter().find(|&id| !seen.insert(id));
    again.map_or(Ok(()), |id| Err(format!("{place}: `{id}` twice; expected each once")))
}

/// One table and what it was made from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableResults {
    /// Id of the experiment.
    pub experiment: String,
    /// Version of the experiment.
    pub version: u32,
    /// The scoring protocol.
    pub protocol: ProtocolId,
    /// The data sets that took part: id and title.
    pub datasets: Vec<(String, String)>,
    /// Own data, a stand-in, or nothing.
    pub source: Source,
    /// How test poses were fitted, where they were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub test_pose: Option<PoseFit>,
    /// Longest side of images that the experiment asks for, pixels, where that is less than the profile's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resolution: Option<u32>,
    /// Whether the antialiased rasterizer drew.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub antialiased: bool,
    /// The table as it is printed.
    pub table: Table,
    /// Variants compared frame by frame, per sequence and over all of them.
    pub comparisons: Vec<Comparison>,
    /// The paper's own table.
    pub paper: Option<Table>,
    /// The sequences, each with every variant and frame.
    pub sequences: Vec<SequenceResults>,
}

impl TableResults {
    /// Checks what formats rely on.
    fn check(&self) -> Result<(), String> {
        let digits = self.comparisons.iter().flat_map(|c| &c.differences).map(|d| d.decimals);
        if let Some(n) = digits.into_iter().find(|&n| n > Digits::MOST) {
            let most = Digits::MOST;
            return Err(format!(
                "table `{}`: comparisons: decimals: {n}; expected at most {most}",
                self.experiment
            ));
        }
        let place = format!("table `{}`: sequences", self.experiment);
        once(&format!("{place}: id"), self.sequences.iter().map(|sequence| sequence.id.as_str()))?;
        for SequenceResults { id, variants, .. } in &self.sequences {
            let ids = variants.iter().map(|variant| variant.id.as_str());
            once(&format!("{place}: `{id}`: variants: id"), ids)?;
            for variant in variants {
                let at = format!("{place}: `{id}`: variants: `{}`", variant.id);
                variant.check(&self.protocol).map_err(|problem| format!("{at}: {problem}"))?;
            }
        }
        self.table.check()?;
        self.paper.as_ref().map_or(Ok(()), Table::check)
    }
}

/// A sequence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SequenceResults {
    /// `dataset/subject/sequence`.
    pub id: String,
    /// What the table calls it.
    pub label: String,
    /// Why there are no frames, if there are none.
    pub missing: Option<String>,
    /// What it was made from; none without data, or before schema 4.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub data: Option<DataDigests>,
    /// In the order of the experiment.
    pub variants: Vec<VariantResults>,
}

/// Digests of the data behind a sequence: equal digests, equal images, cameras, poses and bodies.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DataDigests {
    /// Of the test sequence.
    pub test: String,
    /// Of the training sequence; none if the subject has none.
    pub train: Option<String>,
}

/// A variant on a sequence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VariantResults {
    /// Id of the variant.
    pub id: String,
    /// What the table calls it.
    pub label: String,
    /// Where the avatar came from.
    pub avatar: AvatarRecipe,
    /// SH degree of an avatar that was made here.
    pub sh_degree: Option<u8>,
    /// Strategy spec; none for a textured mesh.
    pub strategy: Option<String>,
    /// Noise on its poses, for training and test.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_noise: Option<PoseNoise>,
    /// Training sequences that it is fitted to, where the experiment says how many.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub takes: Option<u32>,
    /// The metrics over the scored frames, aggregated as the protocol says; none without a scored frame.
    pub summary: Option<Summary>,
    /// The same with every pose fitted to its image; none unless that was asked for and every scored frame has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fitted: Option<Summary>,
    /// Every planned frame, in order.
    pub frames: Vec<FrameResult>,
}

impl VariantResults {
    /// Checks that its parts agree with each other, and with the protocol of the table.
    fn check(&self, protocol: &ProtocolId) -> Result<(), String> {
        let places: Vec<String> = self.frames.iter().map(|frame| frame.frame.to_string()).collect();
        once("frames: frame", places.iter().map(String::as_str))?;
        let other = |what: &str, of: &ProtocolId| {
            (of != protocol).then(|| format!("{what}: protocol: {of}; expected the table's, {protocol}"))
        };
        for frame in &self.frames {
            let at = format!("frames: `{}`", frame.name);
            if frame.score.is_some() && frame.error.is_some() {
                return Err(format!("{at}: a score and an error; expected one of them"));
            }
            let scores = frame.score.iter().chain(frame.fitted_score());
            if let Some(problem) = scores.into_iter().find_map(|score| other(&at, &score.protocol)) {
                return Err(problem);
            }
        }
        for (what, summary) in [("summary", &self.summary), ("fitted", &self.fitted)] {
            let Some(summary) = summary else { continue };
            if let Some(problem) = other(what, &summary.protocol) {
                return Err(problem);
            }
            let (frames, scored) = (summary.frames, self.scored() as u64);
            if frames != scored {
                return Err(format!("{what}: frames: {frames}; expected {scored}, which have scores"));
            }
        }
        Ok(())
    }

    /// Frames that were scored.
    pub fn scored(&self) -> usize {
        self.frames.iter().filter(|frame| frame.score.is_some()).count()
    }

    /// Frames that were planned and have no score.
    pub fn missing(&self) -> usize {
        self.frames.len() - self.scored()
    }

    /// What a column shows of the scored frames.
    pub fn value(&self, shown: impl Into<Shown>) -> Option<f64> {
        let Shown { metric, fitted } = shown.into();
        if fitted { self.fitted.as_ref() } else { self.summary.as_ref() }?.value(metric)
    }
}

/// A frame: scored, failed (with an error) or not run (with neither).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameResult {
    /// Index in its sequence.
    pub frame: usize,
    /// Name of the image.
    pub name: String,
    /// Content key.
    pub key: String,
    /// The metrics.
    pub score: Option<FrameScore>,
    /// Gaussians that reach the image; none for a textured mesh.
    pub visible_splats: Option<u64>,
    /// Why it failed.
    pub error: Option<String>,
    /// What came of it with its pose fitted to the image, where that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fitted: Option<FittedOutcome>,
}

impl FrameResult {
    /// The frame's own value of what a column shows; none for what only an avatar has.
    pub fn value(&self, shown: impl Into<Shown>) -> Option<f64> {
        let Shown { metric, fitted } = shown.into();
        let score = if fitted { self.fitted_score() } else { self.score.as_ref() };
        score?.value(metric).filter(|_| metric.is_of_frames())
    }

    /// Its score with the pose fitted.
    pub fn fitted_score(&self) -> Option<&FrameScore> {
        match self.fitted.as_ref()? {
            FittedOutcome::Scored { score, .. } => Some(score),
            FittedOutcome::Failed(_) => None,
        }
    }
}
