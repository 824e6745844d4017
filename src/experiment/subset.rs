//! Whether the part of the work that was asked for is one of what there is.

use super::rows::rows_of;
use super::{Dataset, Error, Experiment, Options, Subset, Variant};
use skinsplat_core::choice::one_of;
use std::collections::BTreeSet;

/// Refuses subjects of whom none belongs to any of the tables, where others do.
pub(super) fn subjects_are_of_a_table(
    experiments: &[Experiment],
    datasets: &[Dataset],
    options: &Options,
) -> Result<(), Error> {
    let asked = &options.subset.subjects;
    let everybody =
        Options { subset: Subset { subjects: Vec::new(), ..options.subset.clone() }, ..options.clone() };
    let rows = experiments.iter().flat_map(|experiment| rows_of(experiment, datasets, &everybody).1);
    let known: BTreeSet<String> = rows.filter(|row| row.missing.is_none()).map(|row| row.subject).collect();
    if asked.is_empty() || known.is_empty() || asked.iter().any(|id| known.contains(id)) {
        return Ok(());
    }
    let ids: Vec<&str> = experiments.iter().map(|experiment| experiment.id.as_str()).collect();
    let problem = format!("`{}`: not among the data of {}", asked.join("`, `"), ids.join(", "));
    let known: Vec<String> = known.into_iter().collect();
    Err(Error::invalid("subset", "subjects", problem, one_of(&asked[0], &known)))
}

/// Refuses subjects of whom one cannot be loaded, where that leaves nothing to do: the first such reason.
pub(super) fn subjects_can_be_loaded(datasets: &[Dataset], options: &Options) -> Result<(), Error> {
    let asked = &options.subset.subjects;
    let mut unreadable = datasets.iter().flat_map(|dataset| &dataset.unreadable);
    match unreadable.find(|own| asked.contains(&own.subject)) {
        None => Ok(()),
        Some(broken) => {
            // The reason says itself what was expected.
            let (why, expected) = (broken.problem.rsplit_once("; expected "))
                .unwrap_or((&broken.problem, "a subject that can be loaded"));
            let problem = format!("`{}` cannot be loaded: {why}", broken.subject);
            Err(Error::invalid("subset", "subjects", problem, expected))
        }
    }
}

/// Refuses a subset that would leave nothing because of a name that does not exist. Subjects that cannot be loaded exist: tables
/// say what is wrong with them.
pub(super) fn subset_names_something(
    experiments: &[Experiment],
    datasets: &[Dataset],
    options: &Options,
) -> Result<(), Error> {
    let readable = datasets.iter().flat_map(|d| &d.subjects).map(|subject| subject.id.as_str());
    let unreadable = datasets.iter().flat_map(|d| &d.unreadable).map(|own| own.subject.as_str());
    let subjects: BTreeSet<&str> = readable.chain(unreadable).collect();
    let variants: BTreeSet<&str> =
        experiments.iter().flat_map(|e| &e.variants).flat_map(Variant::names).collect();
    let subset = &options.subset;
    for (key, asked, known) in
        [("subjects", &subset.subjects, subjects), ("variants", &subset.variants, variants)]
    {
        if let Some(stranger) = asked.iter().find(|id| !known.contains(id.as_str())) {
            let known: Vec<&str> = known.into_iter().collect();
            let expected = one_of(stranger, &known);
            return Err(Error::invalid("subset", key, format!("`{stranger}`"), expected));
        }
    }
    Ok(())
}
