//! Content keys hold every number that an avatar depends on.
#![expect(clippy::unwrap_used, reason = "tests")]

use serde_json::Value;
use skinsplat_data::key::content_key;
use skinsplat_fit::train::Starting;
use skinsplat_fit::{FitOptions, RECIPES, Recipe};

/// Paths of all numbers and switches below a value.
fn leaves(value: &Value, path: &str, found: &mut Vec<String>) {
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                leaves(value, &path, found);
            }
        }
        Value::Number(_) | Value::Bool(_) => found.push(path.to_owned()),
        _ => {}
    }
}

fn at<'v>(value: &'v Value, path: &str) -> &'v Value {
    path.split('.').fold(value, |value, field| &value[field])
}

/// Another value that the field may have.
fn other(path: &str, value: &Value) -> String {
    match value {
        Value::Bool(on) => (!on).to_string(),
        Value::Number(number) if path == "sh_degree" => (3 - number.as_u64().unwrap()).to_string(),
        Value::Number(number) if number.is_f64() && path == "densify.from" => "0.01".to_owned(),
        Value::Number(number) if path == "densify.most" => (number.as_f64().unwrap() + 1.0).to_string(),
        Value::Number(number) if number.is_f64() => (0.7 * number.as_f64().unwrap() + 1.7e-3).to_string(),
        Value::Number(number) => (number.as_u64().unwrap() + 1).to_string(),
        _ => unreachable!("only numbers and switches are varied"),
    }
}

fn options(recipe: Recipe) -> FitOptions {
    FitOptions { recipe, iterations: 100, seed: 0, edge_mm: 20 }
}

#[test]
fn every_number_of_a_recipe_can_be_varied_and_changes_the_key() {
    let mut sections = std::collections::BTreeSet::new();
    for recipe in RECIPES.iter() {
        let value = serde_json::to_value(recipe).unwrap();
        let mut paths = Vec::new();
        leaves(&value, "", &mut paths);
        assert!(paths.len() > 60, "{paths:?}");
        let key = content_key(&options(recipe.choices()));
        let start = content_key(&Starting::of(&options(recipe.clone())));
        for path in paths {
            let text = format!("{}+{path}={}", recipe.id, other(&path, at(&value, &path)));
            let varied = Recipe::parse(&text).unwrap_or_else(|error| panic!("{text}: {error}"));
            assert_ne!(content_key(&options(varied.choices())), key, "{text}");
            let section = path.split('.').next().unwrap().to_owned();
            let starts = ["start", "clothing", "sighting", "cover"].contains(&&*section)
                || (section == "shape" && value["start"]["surface"] == "silhouettes");
            let changes = content_key(&Starting::of(&options(varied))) != start;
            assert!(changes || !starts, "{text}: the start depends on it");
            sections.insert(section);
        }
    }
    for section in ["clothing", "sighting", "cover", "shape", "schedule", "densify", "mesh"] {
        assert!(sections.contains(section), "{section}");
    }
}

#[test]
fn values_out_of_range_are_refused_by_name() {
    for (text, field) in [
        ("clothing.steps_per_pixel=0.0", "clothing.steps_per_pixel"),
        ("sighting.oversampling=0", "sighting.oversampling"),
        ("cover.most_frames=0", "cover.most_frames"),
        ("cover.least_sigma=nan", "cover.least_sigma"),
        ("shape.batch=0", "shape.batch"),
        ("schedule.between_bindings=0", "schedule.between_bindings"),
        ("schedule.moments.beta2=1.0", "schedule.moments.beta2"),
        ("schedule.shape_share=1.5", "schedule.shape_share"),
    ] {
        let error = Recipe::parse(&format!("pure-skinned+{text}")).unwrap_err().to_string();
        assert!(error.contains(field) && error.contains("expected"), "{error}");
    }
    for (text, field) in [("texture=9000", "mesh.texture"), ("gutter=5000", "mesh.gutter")] {
        let error = Recipe::parse(&format!("haha+mesh.{text}")).unwrap_err().to_string();
        assert!(error.contains(field) && error.contains("expected"), "{error}");
    }
}
