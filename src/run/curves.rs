//! How the fits of a run went: loss and PSNR on training frames, PSNR on held-out frames on the way.

use super::Error;
use super::fitting::FitReport;
use crate::experiment::Plan;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// The way of one fit, as one variant of a table draws it.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Id of the experiment.
    pub experiment: String,
    /// Data set.
    pub dataset: String,
    /// Subject.
    pub subject: String,
    /// Id of the variant.
    pub variant: String,
    /// By iteration, ascending.
    pub points: Vec<CurvePoint>,
}

/// A point of a curve. Not everything is known everywhere.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CurvePoint {
    /// Iterations done.
    pub iteration: u32,
    /// Mean loss since the last point, regularisers included.
    pub loss: Option<f64>,
    /// Mean PSNR of training frames since the last point, dB.
    pub training_psnr: Option<f64>,
    /// Number of Gaussians.
    pub splats: Option<usize>,
    /// Mean PSNR over a few frames of each test sequence (mean over sequences, each counting once), dB, by the default
    /// protocol.
    pub test_psnr: Option<f64>,
}

/// The curves of the fits that a plan names, from the sidecars in runs' folders of avatars. Fits that are not there yet are left
/// out.
///
/// # Errors
/// A sidecar that is no sidecar.
pub fn curves(plan: &Plan, folders: &[PathBuf]) -> Result<Vec<Curve>, Error> {
    let mut curves = Vec::new();
    let mut seen = BTreeSet::new();
    for job in &plan.jobs {
        let experiment = &plan.tables[job.table].experiment;
        for variant in &job.variants {
            if !seen.insert((experiment, &job.dataset, &job.subject, &variant.id)) {
                continue;
            }
            let name = format!("{}.json", variant.avatar);
            let found = folders.iter().map(|folder| folder.join(&name)).find(|path| path.is_file());
            let Some(path) = found else { continue };
            let Ok(text) = skinsplat_data::source::read_to_string(&path) else { continue };
            let report: FitReport = serde_json::from_str(&text)
                .map_err(|error| Error::Sidecar { path, problem: error.to_string() })?;
            curves.push(Curve {
                experiment: experiment.clone(),
                dataset: job.dataset.clone(),
                subject: job.subject.clone(),
                variant: variant.id.clone(),
                points: points(&report),
            });
        }
    }
    Ok(curves)
}

fn points(report: &FitReport) -> Vec<CurvePoint> {
    let mut points: BTreeMap<u32, CurvePoint> = BTreeMap::new();
    for step in &report.curve {
        points.entry(step.iteration).or_default().loss = Some(step.loss);
        let point = points.entry(step.iteration).or_default();
        (point.training_psnr, point.splats) = (Some(step.psnr), Some(step.splats));
    }
    let mut tests: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
    for score in &report.held_out {
        tests.entry(score.iteration).or_default().push(score.psnr);
    }
    for (iteration, scores) in tests {
        let mean = scores.iter().sum::<f64>() / scores.len() as f64;
        points.entry(iteration).or_default().test_psnr = Some(mean);
    }
    points.into_iter().map(|(iteration, point)| CurvePoint { iteration, ..point }).collect()
}
