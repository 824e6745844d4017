//! `tables.md`: every table of a run on one page.

use super::captions::count;
use super::{Results, TableResults, markdown};
use crate::experiment::{ADDED_VARIANT, AvatarRecipe, Experiment, GIVEN_AVATAR, Options, Profile};
use crate::quoting::quoted;
use skinsplat_table::markdown::code_span;
use std::collections::BTreeSet;
use std::ffi::OsStr;

/// The page: how it was made, what is missing, and the tables.
pub fn page(results: &Results) -> String {
    let mut text = head(results) + &incomplete(results);
    for table in &results.tables {
        text.push('\n');
        text += &markdown(table);
    }
    text
}

/// How the tables were made and are read: the same for any records.
pub fn head(results: &Results) -> String {
    let code = results.code;
    format!(
        "# Results\n\nMade by {}, on the data that the tables name (experiment files and a data folder are further \
         arguments). Nothing on this page depends on the time or the machine. Bold is the best value of a \
         sequence, with everything that the frames do not decide to be worse: where they are too few to decide anything, all of \
         it. Counts are bold only where they are what the table is about. ↑: more is better, ↓: less is better; \
         n/c: not computed.\n\n\
         Plan `{}`; code versions: fit {}, strategy {}, render {}, metrics {}.\n",
        code_span(&command(results)),
        results.plan,
        code.fit,
        code.strategy,
        code.render,
        code.metrics
    )
}

/// How many scores are missing, if any are.
pub fn incomplete(results: &Results) -> String {
    match results.missing() {
        0 => String::new(),
        missing => format!("\n**Incomplete: {} missing; see the footnotes.**\n", count(missing, "score")),
    }
}

/// The argument that gave a variant its avatar; the captions say which file that was.
fn given_avatar(recipe: &AvatarRecipe) -> Option<String> {
    let AvatarRecipe::File { name, .. } = recipe else { return None };
    Some(option("--avatar", &format!("{}=FILE", name.strip_prefix(GIVEN_AVATAR)?)))
}

/// The arguments that gave variants of built-in experiments their frames, where those have none of their own.
fn given_renders(table: &TableResults) -> impl Iterator<Item = String> {
    let known = Experiment::embedded_all().into_iter().find(|known| known.id == table.experiment);
    let fitted: Vec<String> = known.into_iter().flat_map(|known| known.variants).map(|own| own.id).collect();
    let variants = table.sequences.iter().flat_map(|sequence| &sequence.variants);
    let rendered = variants.filter(|variant| matches!(variant.avatar, AvatarRecipe::Renders { .. }));
    let given = rendered.filter(move |variant| fitted.contains(&variant.id));
    given.map(|variant| option("--renders", &format!("{}=FOLDER", variant.id)))
}

/// An option as a shell reads it, whatever its value holds.
fn option(name: &str, value: &str) -> String {
    format!("{name} {}", word(value))
}

fn word(text: &str) -> String {
    quoted(OsStr::new(text))
}

/// The command that makes these tables again, from the same data, as a shell reads it.
pub(super) fn command(results: &Results) -> String {
    let Options { profile, subset, lpips_weights, seeds } = &results.options;
    let mut words = vec!["reproduce run".to_owned()];
    words.extend(results.tables.iter().map(|table| word(&table.experiment)));
    words.push(option("--profile", &profile.id));
    let variants = results.tables.iter().flat_map(|t| &t.sequences).flat_map(|sequence| &sequence.variants);
    if variants.clone().map(|variant| &variant.id).any(|id| id.starts_with(ADDED_VARIANT)) {
        words.push("--all-strategies".to_owned());
    }
    let given: BTreeSet<String> = variants.filter_map(|variant| given_avatar(&variant.avatar)).collect();
    words.extend(given);
    words.extend(results.tables.iter().flat_map(given_renders).collect::<BTreeSet<_>>());
    let preset = Profile::preset(&profile.id);
    let usual = preset.as_ref().and_then(|preset| preset.fit_iterations);
    if let Some(iterations) = profile.fit_iterations.filter(|_| profile.fit_iterations != usual) {
        words.push(format!("--fit-iterations {iterations}"));
    }
    if preset.is_some_and(|preset| preset.avatar_edge_mm != profile.avatar_edge_mm) {
        words.push(format!("--avatar-edge {}", profile.avatar_edge_mm));
    }
    if !seeds.is_empty() {
        words.push(format!("--seeds {}", seeds.iter().map(u64::to_string).collect::<Vec<_>>().join(",")));
    }
    if let Some(given) = lpips_weights {
        words.push(format!("--lpips-weights lpips_{}.safetensors", given.net.id()));
    }
    if let Some([start, end]) = subset.frames {
        words.push(format!("--frames {start}..{end}"));
    }
    if let Some(limit) = subset.limit {
        words.push(format!("--limit {limit}"));
    }
    words.extend(subset.subjects.iter().map(|id| option("--subject", id)));
    words.extend(subset.variants.iter().map(|id| option("--variant", id)));
    words.join(" ")
}
