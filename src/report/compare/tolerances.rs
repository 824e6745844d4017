//! How far numbers may move: by metric, and by table where a file says so.

use super::Note;
use crate::report::results::Results;
use crate::toml_problem::TomlProblem;
use serde::Deserialize;
use skinsplat_metrics::MetricId;
use std::collections::BTreeMap;

/// A tolerance per metric, in its unit: finite or infinite (the metric does not matter), not negative.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(transparent)]
pub struct Allowed(pub BTreeMap<MetricId, f64>);

/// How far a number of each metric may move without counting.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tolerances {
    /// What was asked for by hand: goes before everything else.
    pub asked: Allowed,
    /// Of a table, by the id of its experiment.
    pub tables: BTreeMap<String, Allowed>,
    /// Of all tables; the metric's own tolerance for what is not here: half of the last digit that tables print, and nothing
    /// for counts.
    pub all: Allowed,
    /// Of single frames; what is not here does not count.
    pub frames: Allowed,
}

/// The file.
#[derive(Deserialize)]
struct File {
    #[serde(default)]
    tables: BTreeMap<String, Allowed>,
    #[serde(default)]
    frames: Allowed,
    #[serde(flatten)]
    all: BTreeMap<String, toml::Value>,
}

impl Tolerances {
    /// A tolerance for every metric.
    pub fn each(tolerance: impl Fn(MetricId) -> f64) -> Self {
        let asked = Allowed(MetricId::all().map(|metric| (metric, tolerance(metric))).collect());
        Self { asked, ..Self::default() }
    }

    /// No movement at all: for two runs of one program on one machine.
    pub fn none() -> Self {
        Self::each(|_| 0.0)
    }

    /// Reads a file: `psnr = 0.05` at the top, `[tables.ID]` for one table, `[frames]` for single frames.
    ///
    /// # Errors
    /// One line: what is wrong, where, and what was expected.
    pub fn parse(text: &str) -> Result<Self, String> {
        let file: File = toml::from_str(text).map_err(|error| one_line(text, &error))?;
        let mut all = Allowed::default();
        for (key, value) in file.all {
            let metric = MetricId::from_id(&key).ok_or_else(|| {
                let known: Vec<&str> = MetricId::all().map(MetricId::id).collect();
                format!("{key}; expected one of {}, [tables.ID] or [frames]", known.join(", "))
            })?;
            let number = value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64));
            let number = number.ok_or_else(|| format!("{key}: {value}; expected a number"))?;
            all.0.insert(metric, number);
        }
        all.check("")?;
        file.frames.check("frames.")?;
        for (table, allowed) in &file.tables {
            allowed.check(&format!("tables.{table}."))?;
        }
        Ok(Self { asked: Allowed::default(), tables: file.tables, all, frames: file.frames })
    }

    /// How far an aggregate may move.
    pub(super) fn of(&self, table: &str, metric: MetricId) -> f64 {
        self.given(table, metric).unwrap_or_else(|| metric.metric().tolerance)
    }

    /// How far an aggregate may move, if somebody said so.
    pub(super) fn given(&self, table: &str, metric: MetricId) -> Option<f64> {
        let own = self.tables.get(table);
        let sets = [Some(&self.asked), own, Some(&self.all)];
        sets.into_iter().flatten().find_map(|set| set.0.get(&metric)).copied()
    }

    /// Notes the tables that no run has.
    pub(super) fn note_unknown(&self, runs: &[&Results], notes: &mut Vec<Note>) {
        let known = |id: &String| runs.iter().flat_map(|run| &run.tables).any(|t| t.experiment == *id);
        let who = if runs.len() == 1 { "the run does not have" } else { "neither run has" };
        let unknown = self.tables.keys().filter(|id| !known(id));
        notes.extend(unknown.map(|id| {
            let text = format!("tolerances: [tables.{id}]: {who} this table");
            Note { left_out: false, text }
        }));
    }

    /// How far a single frame may move, if that is bounded.
    pub(super) fn of_frame(&self, metric: MetricId) -> Option<f64> {
        self.frames.0.get(&metric).copied()
    }
}

impl Allowed {
    fn check(&self, at: &str) -> Result<(), String> {
        match self.0.iter().find(|(_, value)| value.is_nan() || **value < 0.0) {
            Some((metric, value)) => {
                Err(format!("{at}{}: {value}; expected a number that is not negative", metric.id()))
            }
            None => Ok(()),
        }
    }
}

fn one_line(text: &str, error: &toml::de::Error) -> String {
    let problem = TomlProblem::of(text, error);
    format!("line {}: {} (at `{}`)", problem.line, problem.message(), problem.excerpt)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_nearer_goes_first() {
        let file = "psnr = 0.05\nsplats = inf\n[tables.ci]\npsnr = 1\n[frames]\npsnr = 2.5\n";
        let mut tolerances = Tolerances::parse(file).unwrap();
        let psnr = MetricId::PSNR;
        assert_eq!((tolerances.of("a", psnr), tolerances.of("ci", psnr)), (0.05, 1.0));
        assert_eq!(tolerances.of("ci", MetricId::SPLATS), f64::INFINITY);
        assert_eq!(tolerances.of("ci", MetricId::SSIM), MetricId::SSIM.metric().tolerance);
        assert_eq!((tolerances.of_frame(psnr), tolerances.of_frame(MetricId::SSIM)), (Some(2.5), None));
        tolerances.asked.0.insert(psnr, 0.0);
        assert_eq!(tolerances.of("ci", psnr), 0.0);
    }

    #[test]
    fn files_that_say_something_else_are_refused_in_a_line() {
        for (text, parts) in [
            ("psnrr = 1", ["psnrr", "psnr, ssim"]),
            ("psnr = -1", ["psnr: -1", "not negative"]),
            ("psnr = nan", ["psnr: NaN", "not negative"]),
            ("psnr = \"much\"", ["psnr", "a number"]),
            ("[frames]\nssim = -0.5", ["frames.ssim", "not negative"]),
            ("[tables.ci]\nssim = -0.5", ["tables.ci.ssim", "not negative"]),
            ("[tables.ci]\nloss = 1", ["line 2", "loss"]),
            ("psnr = ", ["line 1", "psnr"]),
        ] {
            let problem = Tolerances::parse(text).unwrap_err();
            assert!(parts.iter().all(|part| problem.contains(part)), "{text}: {problem}");
            assert_eq!(problem.lines().count(), 1, "{problem}");
        }
    }
}
