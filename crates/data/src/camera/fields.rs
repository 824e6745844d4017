//! The fields of an object in a camera file, each named where it is missing or something else than it should be.

use super::super::Error;
use crate::words::Language;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use std::path::Path;

/// An object of a camera file.
pub(super) struct Fields<'a> {
    path: &'a Path,
    /// Where it stands, with a dot behind it; nothing for the whole file.
    place: String,
    object: &'a Map<String, Value>,
    /// What it should be, with the names of its fields.
    format: &'static str,
}

impl<'a> Fields<'a> {
    /// The fields of a value that should be an object; `place` is empty for the whole file.
    pub(super) fn of(
        path: &'a Path,
        place: &str,
        value: &'a Value,
        format: &'static str,
    ) -> Result<Self, Error> {
        let place = if place.is_empty() { String::new() } else { format!("{place}.") };
        match value {
            Value::Object(object) => Ok(Self { path, place, object, format }),
            other => {
                let field = if place.is_empty() { "camera" } else { place.trim_end_matches('.') };
                Err(Error::invalid(path, field, kind(other), format))
            }
        }
    }

    /// A field that must be there.
    pub(super) fn required<T: DeserializeOwned>(&self, name: &str, expected: &str) -> Result<T, Error> {
        match self.object.get(name) {
            Some(value) => {
                T::deserialize(value).map_err(|cause| self.invalid(name, problem(&cause), expected))
            }
            None => Err(self.invalid(name, "missing", self.format)),
        }
    }

    /// A field that may be left out, or null.
    pub(super) fn optional<T: DeserializeOwned>(
        &self,
        name: &str,
        expected: &str,
    ) -> Result<Option<T>, Error> {
        match self.object.get(name) {
            None | Some(Value::Null) => Ok(None),
            Some(_) => self.required(name, expected).map(Some),
        }
    }

    /// An error about a field.
    pub(super) fn invalid(&self, name: &str, problem: impl Into<String>, expected: &str) -> Error {
        Error::invalid(self.path, format!("{}{name}", self.place), problem, expected)
    }
}

/// What a reader of types found, in the words of JSON.
pub(super) fn problem(cause: &serde_json::Error) -> String {
    let message = cause.to_string();
    match message.strip_prefix("invalid length ").and_then(|rest| rest.split_once(',')) {
        Some((length, _)) => format!("a list of length {length}"),
        None => Language::Json.told(&message).0,
    }
}

/// What a value is, in words.
pub(super) fn kind(value: &Value) -> String {
    const MOST: usize = 6;
    match value {
        Value::Null => "null".to_owned(),
        Value::Bool(_) => "a truth value".to_owned(),
        Value::Number(_) => "a number".to_owned(),
        Value::String(_) => "text".to_owned(),
        Value::Object(_) => "an object".to_owned(),
        Value::Array(list) => match list.first() {
            None => "an empty list".to_owned(),
            Some(Value::Object(first)) => {
                let short = |name: &String| -> String { name.chars().take(40).collect() };
                let names: Vec<String> =
                    first.keys().take(MOST).map(|name| short(name).escape_debug().to_string()).collect();
                format!("a list of {} objects with {}", list.len(), names.join(", "))
            }
            Some(_) => format!("a list of length {}", list.len()),
        },
    }
}
