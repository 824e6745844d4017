//! Checks of an experiment that its types cannot make.

use super::{
    AvatarRecipe, Error, Experiment, Paper, Role, Split, Variant, catalog, equivalence, poses, seeds,
};
use skinsplat_fit::Recipe;
use std::collections::BTreeSet;

/// Checks one experiment.
pub(super) fn experiment(e: &Experiment, file: &str) -> Result<(), Error> {
    let fail = |key: &str, problem: String, expected: &str| Err(Error::invalid(file, key, problem, expected));
    if e.schema != 1 {
        return fail(
            "schema",
            format!("{}", e.schema),
            "1, the version of the format that this program reads",
        );
    }
    for (key, id) in [("id", &e.id), ("dataset", &e.dataset)] {
        if !is_id(id) {
            return fail(key, format!("`{id}`"), "lower-case letters, digits, `-` and `_`, not empty");
        }
    }
    let other = e.stand_in.as_ref().and_then(|stand_in| stand_in.protocol.as_deref());
    let specs = [("protocol", Some(e.protocol.as_str())), ("stand_in.protocol", other)];
    for (key, spec) in specs.into_iter().filter_map(|(key, spec)| Some((key, spec?))) {
        catalog::protocol(spec)
            .map_err(|(problem, expected)| Error::invalid(file, key, problem, expected))?;
    }
    if let Some(stem) = stem(file)
        && stem != e.id
    {
        return fail("id", format!("`{}` in {stem}.toml", e.id), "the file's name without .toml");
    }
    if e.columns.is_empty() || e.variants.is_empty() {
        let key = if e.columns.is_empty() { "columns" } else { "variants" };
        return fail(key, "none".into(), "at least one");
    }
    for fitted in [false, true] {
        let shown = e.columns.iter().filter(|column| column.fitted == fitted);
        distinct_in(file, "columns.metric", shown.map(|column| column.metric.id()))?;
    }
    distinct_in(file, "variants.id", e.variants.iter().map(|v| v.id.as_str()))?;
    distinct_in(file, "variants.label", e.variants.iter().map(|v| v.label.as_str()))?;
    let average = e.average.iter().map(|average| average.label.as_str());
    distinct_in(file, "sequences, average.label", e.sequences.iter().map(String::as_str).chain(average))?;
    distinct_in(file, "splits.sequence", e.splits.iter().map(|s| s.sequence.as_str()))?;
    let stranger = |id: &&String| !e.sequences.is_empty() && !e.sequences.contains(id);
    if let Some(id) = e.genders.keys().find(stranger) {
        return fail("genders", format!("`{id}`"), "subjects of `sequences`");
    }
    if e.variant(&e.baseline).is_none() {
        return fail("baseline", format!("`{}`", e.baseline), "the id of one of the variants");
    }
    for (i, variant) in e.variants.iter().enumerate() {
        if let Some(id) = variant.against.iter().find(|id| e.variant(id).is_none()) {
            let key = format!("variants[{i}].against");
            return fail(&key, format!("`{id}`"), "ids of variants of the table");
        }
    }
    if let Some(i) = e.columns.iter().position(|c| c.decimals() > 12) {
        return fail(&format!("columns[{i}].decimals"), format!("{}", e.columns[i].decimals()), "at most 12");
    }
    for (i, variant) in e.variants.iter().enumerate() {
        variant_is_possible(variant, &format!("variants[{i}]"), file)?;
    }
    seeds::check(e, file)?;
    poses::check(e, file)?;
    equivalence::check(e, file)?;
    stand_in_keeps_its_name(e, file)?;
    if let Some(paper) = &e.paper {
        paper_is_complete(e, paper, file)?;
    }
    e.splits.iter().enumerate().try_for_each(|(i, split)| split_adds_up(split, i, file))
}

/// Checks that no two experiments share an id.
pub(super) fn distinct(experiments: &[Experiment], source: &str) -> Result<(), Error> {
    distinct_in(source, "id", experiments.iter().map(|e| e.id.as_str()))
}

/// Ids name files and go into keys.
fn is_id(text: &str) -> bool {
    let allowed = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-' || b == b'_';
    !text.is_empty() && text.bytes().all(allowed)
}

/// The file's name without `.toml`.
fn stem(file: &str) -> Option<&str> {
    std::path::Path::new(file).file_name()?.to_str()?.strip_suffix(".toml")
}

fn distinct_in<'a>(file: &str, key: &str, ids: impl Iterator<Item = &'a str>) -> Result<(), Error> {
    let mut seen = BTreeSet::new();
    for id in ids {
        if !seen.insert(id) {
            return Err(Error::invalid(file, key, format!("`{id}` twice"), "each once"));
        }
    }
    Ok(())
}

/// An avatar, a strategy and an SH degree that go together.
fn variant_is_possible(variant: &Variant, key: &str, file: &str) -> Result<(), Error> {
    let fail = |field: &str, problem: String, expected: &str| {
        Err(Error::invalid(file, format!("{key}.{field}"), problem, expected))
    };
    if !is_id(&variant.id) {
        return fail("id", format!("`{}`", variant.id), "lower-case letters, digits, `-` and `_`, not empty");
    }
    match (&variant.strategy, variant.avatar.is_gaussian()) {
        (None, true) => {
            return fail("strategy", "missing".into(), "a strategy, such as \"quaternion-average\"");
        }
        (Some(_), false) => {
            return fail("strategy", "given".into(), "none: there are no Gaussians to pose");
        }
        (Some(spec), true) => {
            if let Err((problem, expected)) = catalog::strategy(spec) {
                return fail("strategy", problem, &expected);
            }
        }
        (None, false) => {}
    }
    if let Some(recipe) = variant.avatar.fitting_recipe()
        && let Err(error) = Recipe::parse(recipe)
    {
        let named_by_file = matches!(variant.avatar, AvatarRecipe::File { .. });
        let field = if named_by_file { "avatar.otherwise" } else { "avatar.name" };
        return fail(field, error.to_string(), "a fitting recipe");
    }
    sh_degree_is_possible(variant).or_else(|(problem, expected)| fail("sh_degree", problem, expected))?;
    match variant.avatar {
        AvatarRecipe::TexturedMesh { size } if !(16..=8192).contains(&size) => {
            fail("avatar.size", format!("{size}"), "16 to 8192 texels")
        }
        _ => Ok(()),
    }
}

/// Gaussians that are gathered here have a degree, and nothing else has.
fn sh_degree_is_possible(variant: &Variant) -> Result<(), (String, &'static str)> {
    match (&variant.avatar, variant.sh_degree) {
        (AvatarRecipe::SurfaceVertex {} | AvatarRecipe::SurfaceFace {}, None) => {
            Err(("missing".to_owned(), "0 to 3"))
        }
        (AvatarRecipe::SurfaceVertex {} | AvatarRecipe::SurfaceFace {}, Some(degree)) if degree > 3 => {
            Err((format!("{degree}"), "0 to 3"))
        }
        (AvatarRecipe::SurfaceVertex {} | AvatarRecipe::SurfaceFace {}, Some(_)) | (_, None) => Ok(()),
        (AvatarRecipe::Fit { .. }, Some(_)) => {
            Err(("given".to_owned(), "none: the fitting recipe has it (+sh_degree=2 varies it)"))
        }
        (
            AvatarRecipe::TexturedMesh { .. } | AvatarRecipe::File { .. } | AvatarRecipe::Renders { .. },
            Some(_),
        ) => Err(("given".to_owned(), "none: it applies to Gaussians that are made here")),
    }
}

/// A stand-in never carries the name of the data set that it stands in for.
fn stand_in_keeps_its_name(e: &Experiment, file: &str) -> Result<(), Error> {
    let Some(stand_in) = &e.stand_in else { return Ok(()) };
    let notes = e.notes.iter().map(|note| ("notes", note));
    for (key, text) in [("stand_in.caption", &stand_in.caption)].into_iter().chain(notes) {
        for name in [&e.dataset, &e.dataset_title] {
            if text.to_lowercase().contains(&name.to_lowercase()) {
                let problem = format!("names `{name}`");
                return Err(Error::invalid(file, key, problem, "text that also fits a stand-in"));
            }
        }
    }
    Ok(())
}

/// Printed rows refer to printed variants and to sequences of the experiment, and each is there once.
fn paper_is_complete(e: &Experiment, paper: &Paper, file: &str) -> Result<(), Error> {
    let fail =
        |key: String, problem: String, expected: &str| Err(Error::invalid(file, key, problem, expected));
    distinct_in(file, "paper.variants.id", paper.variants.iter().map(|v| v.id.as_str()))?;
    for (i, variant) in e.variants.iter().enumerate() {
        if let Some(id) = &variant.paper
            && paper.label(id).is_none()
        {
            return fail(
                format!("variants[{i}].paper"),
                format!("`{id}`"),
                "the id of one of paper.variants",
            );
        }
    }
    let mut seen = BTreeSet::new();
    for (i, row) in paper.rows.iter().enumerate() {
        let key = |field: &str| format!("paper.rows[{i}].{field}");
        if paper.label(&row.variant).is_none() {
            return fail(key("variant"), format!("`{}`", row.variant), "the id of one of paper.variants");
        }
        let known = e.sequences.is_empty() || row.average || e.sequences.contains(&row.sequence);
        if !known {
            return fail(key("sequence"), format!("`{}`", row.sequence), "one of `sequences`");
        }
        if !seen.insert((&row.sequence, &row.variant)) {
            let problem = format!("`{}` / `{}` twice", row.sequence, row.variant);
            return fail(key("sequence"), problem, "each pair once");
        }
        if let Some(metric) = row.bold.iter().find(|&&metric| row.value(metric).is_none()) {
            return fail(key("bold"), format!("`{}` has no number", metric.id()), "metrics of the row");
        }
    }
    Ok(())
}

/// The counts that a split states are those of its ranges.
fn split_adds_up(split: &Split, index: usize, file: &str) -> Result<(), Error> {
    for (role, field, stated) in
        [(Role::Train, "n_train", split.n_train), (Role::Test, "n_test", split.n_test)]
    {
        if let (Some(stated), Some(counted)) = (stated, split.count(role))
            && stated != counted
        {
            let key = format!("splits[{index}].{field}");
            return Err(Error::invalid(
                file,
                key,
                format!("{stated}"),
                format!("{counted}, which the range gives"),
            ));
        }
    }
    let zero_step = [split.train, split.test].into_iter().flatten().any(|[_, _, step]| step == 0);
    if zero_step {
        let key = format!("splits[{index}]");
        return Err(Error::invalid(file, key, "step 0", "a step of at least 1"));
    }
    Ok(())
}
