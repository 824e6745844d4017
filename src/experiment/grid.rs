//! Variants by the product of their choices: a table that crosses three rotations with two colours names five choices, not six
//! variants.

use super::{Error, Experiment, Variant};
use serde::Deserialize;
use std::collections::BTreeSet;
use toml::Value;

/// Most variants of an experiment.
const MOST: usize = 1000;

/// Axes, and a variant in whose texts `{AXIS}` stands for a choice of each: in `id` and `against` for its id, in `label` for its
/// label, everywhere else for its value.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// What is crossed; the last one changes fastest.
    axes: Vec<Axis>,
    /// As in `variants`, with names of axes in braces.
    variant: toml::Table,
}

/// What is chosen in one respect.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Axis {
    /// How the variant refers to it.
    name: String,
    /// The choices, in the order of the table.
    choices: Vec<Choice>,
}

/// A choice.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Choice {
    /// Part of the variant's id.
    id: String,
    /// Part of its label; the id if absent.
    #[serde(default)]
    label: Option<String>,
    /// Part of its other texts; the id if absent.
    #[serde(default)]
    value: Option<String>,
}

/// What `{AXIS}` stands for.
#[derive(Clone, Copy)]
enum Meaning {
    Id,
    Label,
    Value,
}

impl Choice {
    fn text(&self, meaning: Meaning) -> &str {
        match meaning {
            Meaning::Id => &self.id,
            Meaning::Label => self.label.as_deref().unwrap_or(&self.id),
            Meaning::Value => self.value.as_deref().unwrap_or(&self.id),
        }
    }
}

/// Adds the variants of the grids behind those that are listed, and takes the grids away.
///
/// # Errors
/// An axis without choices or with the name of another, too many variants, a variant that cannot be read or that names
/// another axis than there is.
pub(super) fn expand(mut e: Experiment, file: &str) -> Result<Experiment, Error> {
    for (i, grid) in std::mem::take(&mut e.grids).into_iter().enumerate() {
        let key = format!("grids[{i}]");
        let room = MOST.saturating_sub(e.variants.len());
        check(&grid, &key, room, file)?;
        for choices in product(&grid.axes) {
            e.variants.push(grid.at(&choices, &format!("{key}.variant"), file)?);
        }
    }
    Ok(e)
}

fn check(grid: &Grid, key: &str, room: usize, file: &str) -> Result<(), Error> {
    let fail =
        |key: String, problem: String, expected: &str| Err(Error::invalid(file, key, problem, expected));
    let mut names = BTreeSet::new();
    for (i, axis) in grid.axes.iter().enumerate() {
        if axis.choices.is_empty() {
            return fail(format!("{key}.axes[{i}].choices"), "none".into(), "at least one");
        }
        if !names.insert(axis.name.as_str()) {
            return fail(format!("{key}.axes[{i}].name"), format!("`{}` twice", axis.name), "each once");
        }
    }
    let count = grid.axes.iter().try_fold(1_usize, |n, axis| n.checked_mul(axis.choices.len()));
    match count {
        Some(count) if count <= room => Ok(()),
        _ => fail(format!("{key}.axes"), "too many variants".into(), "at most 1000 in an experiment"),
    }
}

/// One choice of each axis, in all ways.
fn product(axes: &[Axis]) -> Vec<Vec<(&str, &Choice)>> {
    axes.iter().fold(vec![Vec::new()], |begun, axis| {
        let with = |chosen: &Vec<_>, choice| [chosen.as_slice(), &[(axis.name.as_str(), choice)]].concat();
        begun.iter().flat_map(|chosen| axis.choices.iter().map(move |choice| with(chosen, choice))).collect()
    })
}

impl Grid {
    /// The variant of these choices.
    fn at(&self, choices: &[(&str, &Choice)], key: &str, file: &str) -> Result<Variant, Error> {
        let mut table = self.variant.clone();
        for (field, value) in &mut table {
            let meaning = match field.as_str() {
                "id" | "against" => Meaning::Id,
                "label" => Meaning::Label,
                _ => Meaning::Value,
            };
            fill(value, choices, meaning);
        }
        let fail = |problem: String, expected: String| Error::invalid(file, key, problem, expected);
        if let Some(name) = unfilled(&Value::Table(table.clone())) {
            let axes: Vec<_> = self.axes.iter().map(|axis| format!("`{{{}}}`", axis.name)).collect();
            return Err(fail(format!("`{{{name}}}`"), format!("an axis: {}", axes.join(", "))));
        }
        let read = Variant::deserialize(table);
        read.map_err(|error| fail(error.message().replace('\n', ", "), "a variant".into()))
    }
}

/// Puts the choices in the place of `{AXIS}` in every text.
fn fill(value: &mut Value, choices: &[(&str, &Choice)], meaning: Meaning) {
    match value {
        Value::String(text) => {
            for (name, choice) in choices {
                *text = text.replace(&format!("{{{name}}}"), choice.text(meaning));
            }
        }
        Value::Array(values) => values.iter_mut().for_each(|value| fill(value, choices, meaning)),
        Value::Table(table) => table.iter_mut().for_each(|(_, value)| fill(value, choices, meaning)),
        _ => {}
    }
}

/// A name in braces that no axis has. `{subject}` and `{sequence}` are those of folders of renders.
fn unfilled(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => text.split('{').skip(1).find_map(|rest| {
            let (name, _) = rest.split_once('}')?;
            (!["subject", "sequence"].contains(&name)).then(|| name.to_owned())
        }),
        Value::Array(values) => values.iter().find_map(unfilled),
        Value::Table(table) => table.values().find_map(unfilled),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "schema = 1\nid = \"x\"\nversion = 1\ntitle = \"X\"\ncaption = \"c\"\ndataset = \"d\"\n\
        dataset_title = \"D\"\nmethod = \"m\"\nprotocol = \"avatar-v1\"\nlayout = \"rows\"\nbaseline = \"a-0\"\n\
        columns = [{ metric = \"psnr\" }]\n";
    const AXES: &str = "[[grids]]\naxes = [\n\
        { name = \"how\", choices = [{ id = \"a\", label = \"A\", value = \"quaternion-average\" }, { id = \"lbs\" }] },\n\
        { name = \"degree\", choices = [{ id = \"0\" }, { id = \"2\", label = \"two\" }] },\n]\n";
    const VARIANT: &str = "[grids.variant]\nid = \"{how}-{degree}\"\nlabel = \"{how}, {degree}\"\n\
        avatar = { recipe = \"fit\", name = \"animatable-skinned+sh_degree={degree}\" }\nstrategy = \"{how}\"\n";

    #[test]
    fn every_choice_meets_every_other() {
        let text = [HEAD, AXES, VARIANT].concat();
        let experiment = Experiment::parse(&text, "x.toml").unwrap();
        let ids: Vec<_> = experiment.variants.iter().map(|v| (v.id.as_str(), v.label.as_str())).collect();
        assert_eq!(ids, [("a-0", "A, 0"), ("a-2", "A, two"), ("lbs-0", "lbs, 0"), ("lbs-2", "lbs, two")]);
        assert_eq!(experiment.variants[1].strategy.as_deref(), Some("quaternion-average"));
        assert_eq!(
            experiment.variants[1].avatar.fitting_recipe(),
            Some("animatable-skinned+sh_degree=2"),
            "an id is the value where none is given"
        );
        assert!(experiment.grids.is_empty());
    }

    #[test]
    fn what_is_wrong_is_named() {
        let axis =
            |choices: &str| format!("[[grids]]\naxes = [{{ name = \"how\", choices = [{choices}] }}]\n");
        let many: String = (0..MOST + 1).map(|i| format!("{{ id = \"{i}\" }},")).collect();
        let cases = [
            (axis(""), "grids[0].axes[0].choices: none; expected at least one"),
            (axis(&many), "grids[0].axes: too many variants; expected at most 1000 in an experiment"),
            (axis("{ id = \"a\" }"), "grids[0].variant: `{degree}`; expected an axis: `{how}`"),
            (AXES.replace("degree", "how"), "grids[0].axes[1].name: `how` twice; expected each once"),
        ];
        for (axes, expected) in cases {
            let error =
                Experiment::parse(&[HEAD, &axes, VARIANT].concat(), "x.toml").unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
        let wrong = [HEAD, AXES, &VARIANT.replace("strategy", "stratagem")].concat();
        let error = Experiment::parse(&wrong, "x.toml").unwrap_err().to_string();
        assert!(error.contains("grids[0].variant") && error.contains("stratagem"), "{error}");
    }
}
