//! The way of every fit of a run, as one CSV: a line per variant, subject and point of the curve.

use super::Error;
use super::fitting::FitReport;
use crate::experiment::Plan;
use std::collections::BTreeSet;
use std::path::Path;

/// The curves of the fits that a plan names, from the sidecars in the run's folder of avatars. Fits that are not there yet
/// are left out; `None` if none is there.
///
/// # Errors
/// A sidecar that is no sidecar.
pub fn csv(plan: &Plan, folder: &Path) -> Result<Option<String>, Error> {
    let mut lines = csv::Writer::from_writer(Vec::new());
    let mut any = false;
    let mut seen = BTreeSet::new();
    for job in &plan.jobs {
        let table = &plan.tables[job.table].experiment;
        for variant in &job.variants {
            if !seen.insert((table, &job.dataset, &job.subject, &variant.id)) {
                continue;
            }
            let path = folder.join(format!("{}.json", variant.avatar));
            let Ok(text) = std::fs::read_to_string(&path) else { continue };
            let report: FitReport = serde_json::from_str(&text)
                .map_err(|error| Error::Checkpoint { path, problem: error.to_string() })?;
            if !any {
                write(&mut lines, HEADINGS.map(str::to_owned));
                any = true;
            }
            for step in &report.curve {
                let names = [table, &job.dataset, &job.subject, &variant.id].map(Clone::clone);
                let numbers = [
                    step.iteration.to_string(),
                    format!("{:.6}", step.loss),
                    format!("{:.3}", step.psnr),
                    step.splats.to_string(),
                ];
                let [a, b, c, d] = names;
                let [e, f, g, h] = numbers;
                write(&mut lines, [a, b, c, d, e, f, g, h]);
            }
        }
    }
    let bytes = lines.into_inner().expect("writing to memory cannot fail");
    Ok(any.then(|| String::from_utf8(bytes).expect("text in, text out")))
}

const HEADINGS: [&str; 8] =
    ["experiment", "dataset", "subject", "variant", "iteration", "loss", "training_psnr", "splats"];

fn write(lines: &mut csv::Writer<Vec<u8>>, record: [String; 8]) {
    lines.write_record(record).expect("writing to memory cannot fail");
}
