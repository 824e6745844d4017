//! Records to results: what each planned frame became, and the protocol's aggregate of each sequence.

use super::captions::avatar_file;
use super::results::{
    DataDigests, FrameResult, Results, SCHEMA, SequenceResults, TableResults, VariantResults,
};
use super::{Error, build, paper};
use crate::experiment::{
    CodeVersions, DataRow, Experiment, Job, Outcome, Plan, PlannedTable, Records, Variant,
};
use skinsplat_metrics::{FrameScore, Protocol};

/// The results of a plan: pure, and the same for the same records in whatever order they were made.
///
/// # Errors
/// If the plan is not of these experiments, or a record's score is of another protocol than its key says.
pub fn results(plan: &Plan, experiments: &[Experiment], records: &Records) -> Result<Results, Error> {
    let tables = (0..plan.tables.len()).map(|index| table_results(plan, index, experiments, records));
    Ok(results_of(plan, tables.collect::<Result<_, _>>()?))
}

/// The results of a plan whose tables are these.
pub fn results_of(plan: &Plan, tables: Vec<TableResults>) -> Results {
    Results {
        schema: SCHEMA,
        plan: plan.digest.clone(),
        options: plan.options.clone(),
        code: CodeVersions::CURRENT,
        tables,
    }
}

/// One table of a plan, of which only its own records have to be there.
///
/// # Errors
/// As [`results`].
pub fn table_results(
    plan: &Plan,
    index: usize,
    experiments: &[Experiment],
    records: &Records,
) -> Result<TableResults, Error> {
    let planned = &plan.tables[index];
    let experiment = experiments
        .iter()
        .find(|experiment| experiment.id == planned.experiment)
        .ok_or_else(|| Error::Unplanned { experiment: planned.experiment.clone() })?;
    let jobs: Vec<&Job> = plan.jobs.iter().filter(|job| job.table == index).collect();
    table(plan, planned, experiment, &jobs, records)
}

fn table(
    plan: &Plan,
    planned: &PlannedTable,
    experiment: &Experiment,
    jobs: &[&Job],
    records: &Records,
) -> Result<TableResults, Error> {
    let spec = experiment.protocol_on(planned.source);
    let protocol =
        Protocol::parse(spec).map_err(|source| Error::Scores { at: experiment.id.clone(), source })?;
    let variants: Vec<&Variant> = planned.variants.iter().filter_map(|id| experiment.variant(id)).collect();
    let sequences = planned.rows.iter().enumerate().map(|(r, row)| {
        let jobs: Vec<&Job> = jobs.iter().copied().filter(|job| job.row == r).collect();
        sequence(row, experiment, &variants, &jobs, records, &protocol)
    });
    let sequences: Vec<SequenceResults> = sequences.collect::<Result<_, _>>()?;
    let mut made = build::table(experiment, planned, &plan.options, &sequences);
    let profile = &plan.options.profile;
    // What the profile says already is not the table's.
    let side = experiment.resolution_on(planned.source, profile);
    let resolution = side.filter(|_| side != profile.resolution);
    made.sentences.extend(variants.iter().filter_map(|variant| avatar_file(plan, variant, jobs)));
    Ok(TableResults {
        experiment: experiment.id.clone(),
        version: experiment.version,
        protocol: planned.protocol.clone(),
        datasets: planned.datasets.clone(),
        source: planned.source,
        test_pose: experiment.fitted_test_poses().cloned(),
        resolution,
        antialiased: experiment.antialiased,
        table: made,
        comparisons: build::comparisons(experiment, &sequences),
        paper: experiment.paper.as_ref().map(|paper| paper::printed_table(experiment, paper)),
        sequences,
    })
}

fn sequence(
    row: &DataRow,
    experiment: &Experiment,
    variants: &[&Variant],
    jobs: &[&Job],
    records: &Records,
    protocol: &Protocol,
) -> Result<SequenceResults, Error> {
    let of_variant = |variant: &&Variant| -> Result<VariantResults, Error> {
        let planned = jobs.iter().filter_map(|job| {
            let key = &job.variants.iter().find(|v| v.id == variant.id)?.key;
            Some((*job, key.as_str()))
        });
        let frames: Vec<FrameResult> = planned.map(|(job, key)| frame(job, key, records)).collect();
        let scores: Vec<FrameScore> = frames.iter().filter_map(|frame| frame.score.clone()).collect();
        let summary = (!scores.is_empty()).then(|| protocol.aggregate(&scores)).transpose();
        let fitted: Vec<FrameScore> =
            frames.iter().filter_map(|frame| frame.fitted_score().cloned()).collect();
        let all_fitted = !fitted.is_empty() && fitted.len() == scores.len();
        let fitted = all_fitted.then(|| protocol.aggregate(&fitted)).transpose();
        Ok(VariantResults {
            id: variant.id.clone(),
            label: variant.label.clone(),
            avatar: variant.avatar.clone(),
            sh_degree: variant.sh_degree,
            strategy: variant.strategy.clone(),
            pose_noise: experiment.noise_of(variant),
            takes: variant.takes,
            summary: summary
                .map_err(|source| Error::Scores { at: format!("{}, {}", row.id, variant.id), source })?,
            fitted: fitted
                .map_err(|source| Error::Scores { at: format!("{}, {}", row.id, variant.id), source })?,
            frames,
        })
    };
    Ok(SequenceResults {
        id: row.id.clone(),
        label: row.label.clone(),
        missing: row.missing.clone(),
        data: row.data.as_ref().map(|of| DataDigests { test: of.test.clone(), train: of.train.clone() }),
        variants: variants.iter().map(of_variant).collect::<Result<_, _>>()?,
    })
}

/// What a planned frame became.
fn frame(job: &Job, key: &str, records: &Records) -> FrameResult {
    let mut result = FrameResult {
        frame: job.frame,
        name: job.name.clone(),
        key: key.to_owned(),
        score: None,
        visible_splats: None,
        error: None,
        fitted: None,
    };
    match records.get(key).map(|record| &record.outcome) {
        Some(Outcome::Scored { score, visible_splats, fitted }) => {
            result.fitted.clone_from(fitted);
            result.score = Some(score.clone());
            result.visible_splats = *visible_splats;
        }
        Some(Outcome::Error(error)) => result.error = Some(error.clone()),
        None => {}
    }
    result
}
