//! `recipes.toml`: sections that may build on others, and specifications that vary a recipe.

use super::Recipe;
use crate::Error;
use skinsplat_core::choice::one_of;
use std::sync::LazyLock;
use toml::{Table, Value};

/// The recipes that come with the program, in the order of the file.
pub static RECIPES: LazyLock<Vec<Recipe>> = LazyLock::new(|| {
    let sections = sections(include_str!("recipes.toml")).expect("a test reads the embedded file");
    sections.into_iter().map(|table| table.try_into().expect("a test reads every section")).collect()
});

/// The sections of a recipe file, each laid over its `base`.
fn sections(text: &str) -> Result<Vec<Table>, String> {
    let file: Table = text.parse().map_err(|error: toml::de::Error| error.message().to_owned())?;
    let Some(Value::Array(entries)) = file.get("recipe") else {
        return Err("no [[recipe]] sections".to_owned());
    };
    let mut complete: Vec<Table> = Vec::new();
    for entry in entries {
        let mut own = entry.as_table().cloned().ok_or("[[recipe]] is not a table")?;
        let table = match own.remove("base") {
            None => own,
            Some(base) => {
                let known = |table: &&Table| table.get("id") == Some(&base);
                let mut table = complete.iter().find(known).cloned().ok_or("base names no earlier recipe")?;
                overlay(&mut table, own);
                table
            }
        };
        complete.push(table);
    }
    Ok(complete)
}

/// Lays one table over another, key by key; a table in both is merged.
fn overlay(below: &mut Table, above: Table) {
    for (key, value) in above {
        match (below.get_mut(&key), value) {
            (Some(Value::Table(below)), Value::Table(above)) => overlay(below, above),
            (_, value) => {
                below.insert(key, value);
            }
        }
    }
}

/// See [`Recipe::parse`].
pub(super) fn parse(specification: &str) -> Result<Recipe, Error> {
    let refuse = |problem: String, expected: String| {
        Error::invalid(format!("recipe: {specification}"), problem, expected)
    };
    let parts = parts(specification);
    let mut parts = parts.iter().map(|part| part.trim());
    let id = parts.next().unwrap_or_default();
    let known: Vec<&str> = RECIPES.iter().map(|recipe| recipe.id.as_str()).collect();
    let base = RECIPES.iter().find(|recipe| recipe.id == id);
    let base = base.ok_or_else(|| refuse(format!("no recipe `{id}`"), one_of(id, &known)))?;
    let mut table = Table::try_from(base).map_err(|e| refuse(e.to_string(), "a recipe".into()))?;
    // What recipes leave out where nothing is special about it can be varied all the same.
    let complete =
        |value: Result<Value, toml::ser::Error>| value.map_err(|e| refuse(e.to_string(), "a recipe".into()));
    table.entry("poses").or_insert(complete(Value::try_from(base.poses))?);
    table.entry("pose").or_insert(complete(Value::try_from(&base.pose))?);
    table.entry("coupling").or_insert(complete(Value::try_from(&base.coupling))?);
    for (section, field, value) in
        [("rates", "decay", base.rates.decay), ("free", "scale_most", base.free.scale_most)]
    {
        if let Some(Value::Table(section)) = table.get_mut(section) {
            section.entry(field).or_insert(Value::Float(value.into()));
        }
    }
    let mut varied = false;
    for part in parts {
        let expected = |path: &str, table: &Table| {
            let known = fields(table, "");
            format!("FIELD=VALUE, such as rates.rotation=0.01, with {}", one_of(path, &known))
        };
        let (path, value) =
            part.split_once('=').ok_or_else(|| refuse(format!("`{part}`"), expected(part, &table)))?;
        match slot(&mut table, path) {
            Some(slot) => *slot = value_of(value),
            None => return Err(refuse(format!("no field `{path}`"), expected(path, &table))),
        }
        varied = true;
    }
    if varied {
        table.insert("id".into(), specification.into());
    }
    let recipe: Recipe = table.try_into().map_err(|error: toml::de::Error| {
        refuse(error.message().trim().replace('\n', ", "), "the values of recipes.toml".into())
    })?;
    recipe.check()?;
    Ok(recipe)
}

/// The parts between the plus signs that are not in quotes.
fn parts(specification: &str) -> Vec<&str> {
    let mut quoted = false;
    let split = |c: char| {
        quoted ^= c == '"';
        c == '+' && !quoted
    };
    specification.split(split).collect()
}

/// The value at a dotted path.
fn slot<'t>(table: &'t mut Table, path: &str) -> Option<&'t mut Value> {
    let (first, rest) = path.split_once('.').map_or((path, None), |(first, rest)| (first, Some(rest)));
    if ["id", "title", "source"].contains(&first) {
        return None;
    }
    match (table.get_mut(first)?, rest) {
        (Value::Table(inner), Some(rest)) => slot(inner, rest),
        (Value::Table(_), None) | (_, Some(_)) => None,
        (value, None) => Some(value),
    }
}

/// Every field that [`slot`] finds, as it is written.
fn fields(table: &Table, before: &str) -> Vec<String> {
    let choices = table.iter().filter(|(name, _)| !["id", "title", "source"].contains(&name.as_str()));
    choices
        .flat_map(|(name, value)| match value {
            Value::Table(inner) => fields(inner, &format!("{before}{name}.")),
            _ => vec![format!("{before}{name}")],
        })
        .collect()
}

/// A TOML value, or text that needs no quotes.
fn value_of(text: &str) -> Value {
    let text = text.trim();
    let parsed = format!("value = {text}").parse::<Table>().ok().and_then(|mut table| table.remove("value"));
    parsed.unwrap_or_else(|| Value::String(text.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_recipe_of_the_file_is_complete_and_sound() {
        assert!(RECIPES.len() > 5);
        for recipe in RECIPES.iter() {
            recipe.check().expect("sound");
            assert_eq!(&parse(&recipe.id).expect("known"), recipe);
        }
    }

    #[test]
    fn choices_vary_a_recipe() {
        let recipe =
            parse("pure-skinned+rates.rotation=0.5+free.rotation=fixed+sh_degree=1").expect("varied");
        assert_eq!(recipe.rates.rotation, 0.5);
        assert_eq!(recipe.free.rotation, super::super::FreeRotation::Fixed);
        assert_eq!(recipe.sh_degree, 1);
        let refined = parse("pure-skinned+poses=refine+pose.rate=0.25").expect("varied");
        assert_eq!((refined.poses, refined.pose.rate), (super::super::Poses::Refine, 0.25));
        // Recipes that do not ask for it keep their content keys.
        assert!(!Table::try_from(&recipe).expect("a recipe").contains_key("pose"));
        let quoted = parse("pure-skinned+strategy=\"quaternion-average+colour=none\"").expect("varied");
        assert_eq!(quoted.strategy, "quaternion-average+colour=none");
        assert_eq!(recipe.id, "pure-skinned+rates.rotation=0.5+free.rotation=fixed+sh_degree=1");
    }

    #[test]
    fn wrong_specifications_are_refused() {
        for wrong in [
            "nothing",
            "pure-skinned+",
            "pure-skinned+rates=1",
            "pure-skinned+rates.none=1",
            "pure-skinned+id=other",
            "pure-skinned+rates.rotation=-1",
            "pure-skinned+rates.rotation=nan",
            "pure-skinned+free.rotation=sideways",
            "pure-skinned+sh_degree=4",
            "pure-skinned+loss.ssim=1.5",
            "pure-skinned+start.opacity=1.0",
            "pure-skinned+strategy=none",
            "pure-skinned+iterations=0",
            "hugs-skinned+free.position=along-normal",
            "hugs-skinned+free.rotation=about-normal",
            "haha+mesh.texture=0",
            "haha+mesh.rate=-1.0",
            "haha+mesh.gaussians_first=0.8+mesh.texture_next=0.3",
            "haha+mesh.gaussians_first=nan",
            "haha+start.surface=silhouettes",
            "pure-skinned+rates.decay=0.0",
            "pure-skinned+rates.decay=1.5",
            "pure-skinned+free.scale_most=-1.0",
            "pure-skinned+coupling.neighbours=0",
            "pure-skinned+coupling.colour=nan",
            "haha+poses=guess",
            "haha+poses=refine+pose.decay=0.0",
            "haha+poses=refine+pose.most_degrees=200.0",
            "pure-skinned+strategy=\"lbs",
        ] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
