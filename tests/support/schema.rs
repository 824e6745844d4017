//! A validator of the part of JSON Schema that `reports/schema` uses. A keyword that it does not know is a failure, not a pass.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part of this module")]

use serde_json::Value;

/// Words that say something to people only.
const PROSE: [&str; 5] = ["$schema", "$id", "title", "description", "$defs"];

/// What in a document is not as its schema says; the first thing, with its place.
pub fn violation(schema: &Value, document: &Value) -> Option<String> {
    check(schema, schema, document, "$").err()
}

fn check(root: &Value, schema: &Value, value: &Value, at: &str) -> Result<(), String> {
    let fail = |what: String| Err(format!("{at}: {what}: {value}"));
    for (keyword, rule) in schema.as_object().expect("a schema is an object") {
        match keyword.as_str() {
            word if PROSE.contains(&word) => {}
            "$ref" => {
                let place = rule.as_str().unwrap().strip_prefix('#').expect("a reference within the file");
                let target = root.pointer(place).unwrap_or_else(|| panic!("no {place}"));
                check(root, target, value, at)?;
            }
            "const" if rule != value => return fail(format!("expected {rule}")),
            "enum" if !rule.as_array().unwrap().contains(value) => {
                return fail(format!("expected one of {rule}"));
            }
            "const" | "enum" => {}
            "type" => {
                let types = rule.as_array().cloned().unwrap_or_else(|| vec![rule.clone()]);
                if !types.iter().any(|one| is(one.as_str().unwrap(), value)) {
                    return fail(format!("expected {rule}"));
                }
            }
            "minimum" if value.as_f64().is_some_and(|v| v < rule.as_f64().unwrap()) => {
                return fail(format!("expected at least {rule}"));
            }
            "minItems" if value.as_array().is_some_and(|v| (v.len() as u64) < rule.as_u64().unwrap()) => {
                return fail(format!("expected at least {rule} items"));
            }
            "maxItems" if value.as_array().is_some_and(|v| (v.len() as u64) > rule.as_u64().unwrap()) => {
                return fail(format!("expected at most {rule} items"));
            }
            "minimum" | "minItems" | "maxItems" => {}
            "anyOf" => {
                let tried: Vec<String> = rule
                    .as_array()
                    .unwrap()
                    .iter()
                    .filter_map(|one| check(root, one, value, at).err())
                    .collect();
                if tried.len() == rule.as_array().unwrap().len() {
                    return Err(tried.join("; "));
                }
            }
            "required" => {
                for name in rule.as_array().unwrap() {
                    if value.is_object() && value.get(name.as_str().unwrap()).is_none() {
                        return fail(format!("no {name}"));
                    }
                }
            }
            "properties" | "additionalProperties" | "items" => {}
            unknown => panic!("{unknown}: a keyword that this validator does not know"),
        }
    }
    children(root, schema, value, at)
}

fn children(root: &Value, schema: &Value, value: &Value, at: &str) -> Result<(), String> {
    if let (Some(items), Some(rule)) = (value.as_array(), schema.get("items")) {
        for (i, item) in items.iter().enumerate() {
            check(root, rule, item, &format!("{at}[{i}]"))?;
        }
    }
    let Some(object) = value.as_object() else { return Ok(()) };
    for (name, inner) in object {
        let at = format!("{at}.{name}");
        match (schema.pointer(&format!("/properties/{name}")), schema.get("additionalProperties")) {
            (Some(rule), _) => check(root, rule, inner, &at)?,
            (None, Some(Value::Bool(false))) => return Err(format!("{at}: unknown")),
            (None, Some(rule)) if rule.is_object() => check(root, rule, inner, &at)?,
            _ => {}
        }
    }
    Ok(())
}

fn is(name: &str, value: &Value) -> bool {
    match name {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        "number" => value.is_number(),
        "integer" => value.is_u64() || value.is_i64(),
        other => panic!("{other}: no type"),
    }
}
