//! JSON answers: the arrays of `vectors.json`, nested or flat.

use super::super::Error;
use super::super::convention::QuaternionOrder;
use super::layout::{self, Array};
use super::{Answer, Declared, Expected};
use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, Visitor};
use serde_json::{Map, Value};

const EXPECTED: &str = "a JSON object with arrays such as means and quaternions (README.md of the rig)";

/// The entries of an object, those of the same name too.
struct Document(Vec<(String, Value)>);

impl<'de> Deserialize<'de> for Document {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries;
        impl<'de> Visitor<'de> for Entries {
            type Value = Document;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Document, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(Document(entries))
            }
        }
        deserializer.deserialize_map(Entries)
    }
}

impl Document {
    /// Refuses names that are given twice: which of them holds is anybody's guess.
    fn once(self) -> Result<Map<String, Value>, Error> {
        let mut map = Map::new();
        for (name, value) in self.0 {
            let place: String = name.chars().take(40).collect();
            if map.insert(name, value).is_some() {
                return Err(Error::new(place, "given twice", "every name once"));
            }
        }
        Ok(map)
    }
}

/// Reads an answer.
pub(super) fn read(bytes: &[u8], expected: &Expected) -> Result<Answer, Error> {
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let document: Document = serde_json::from_slice(text).map_err(|cause| {
        let odd = ["NaN", "Infinity", "nan", "inf"].into_iter().find(|word| holds(text, word));
        let hint = odd.map_or(String::new(), |word| format!(" ({word} is no JSON number)"));
        Error::new("JSON", format!("{cause}{hint}"), EXPECTED)
    })?;
    let document = document.once()?;
    let mut arrays = Vec::new();
    let mut unread = Vec::new();
    for (name, value) in &document {
        if layout::is_field(name) {
            let mut array = Array { name: name.clone(), values: Vec::new(), shape: shape(value) };
            flatten(name, value, &array.shape, &mut array.values)?;
            arrays.push(array);
        } else if !KNOWN.contains(&name.as_str()) {
            unread.push(name.chars().take(40).collect::<String>());
        }
    }
    let mut answer = layout::answer(arrays, frames(&document)?, expected)?;
    answer.declared = declared(&document)?;
    if !unread.is_empty() {
        answer.notes.push(format!("not read: {}", unread.join(", ")));
    }
    Ok(answer)
}

/// What a document may hold besides the fields of an answer.
const KNOWN: [&str; 9] =
    ["format", "rig_version", "cases", "convention", "frame", "frames", "gaussians", "poses", "inputs"];

fn holds(text: &[u8], word: &str) -> bool {
    text.windows(word.len()).any(|part| part == word.as_bytes())
}

/// Extents along the first entries; empty for a number.
fn shape(value: &Value) -> Vec<usize> {
    let mut shape = Vec::new();
    let mut inner = value;
    while let Value::Array(entries) = inner {
        shape.push(entries.len());
        match entries.first() {
            Some(first) => inner = first,
            None => break,
        }
    }
    shape
}

/// Numbers of nested arrays of these extents in their order; the error's place is the index of what is no number, or of a list
/// that has another length than the first.
fn flatten(place: &str, value: &Value, shape: &[usize], numbers: &mut Vec<f64>) -> Result<(), Error> {
    match (value, shape) {
        (Value::Number(number), []) => numbers.push(number.as_f64().unwrap_or(f64::NAN)),
        (Value::Array(entries), [length, rest @ ..]) if entries.len() == *length => {
            for (i, entry) in entries.iter().enumerate() {
                match entry.as_f64().filter(|_| rest.is_empty()) {
                    Some(number) => numbers.push(number),
                    None => flatten(&format!("{place}[{i}]"), entry, rest, numbers)?,
                }
            }
        }
        (Value::Array(entries), _) => {
            return Err(ragged(place, format!("a list of {}", entries.len()), shape));
        }
        (Value::Number(_), _) => return Err(ragged(place, "a number".to_owned(), shape)),
        (other, _) => {
            let shown: String = other.to_string().chars().take(40).collect();
            return Err(Error::new(place, shown, "finite numbers"));
        }
    }
    Ok(())
}

/// What stands where its neighbours have something else.
fn ragged(place: &str, problem: String, shape: &[usize]) -> Error {
    let expected = match shape {
        [length, ..] => format!("a list of {length}, as the first of its neighbours"),
        [] => "a number, as the first of its neighbours".to_owned(),
    };
    Error::new(place, problem, expected)
}

/// `frame: 3` or `frames: [0, 1, 2]`.
fn frames(document: &Map<String, Value>) -> Result<Option<Vec<usize>>, Error> {
    let index = |value: &Value| value.as_u64().and_then(|n| usize::try_from(n).ok());
    let wrong = |field: &str, value: &Value| {
        let shown: String = value.to_string().chars().take(40).collect();
        Error::new(field, shown, "indices of poses, from 0")
    };
    if let (Some(frame), Some(_)) = (document.get("frame"), document.get("frames")) {
        let shown: String = frame.to_string().chars().take(40).collect();
        return Err(Error::new("frame", format!("{shown}, beside `frames`"), "one of frame and frames"));
    }
    if let Some(value) = document.get("frame") {
        return index(value).map(|frame| Some(vec![frame])).ok_or_else(|| wrong("frame", value));
    }
    let Some(value) = document.get("frames") else { return Ok(None) };
    let all = value.as_array().and_then(|all| all.iter().map(index).collect::<Option<Vec<_>>>());
    all.map(Some).ok_or_else(|| wrong("frames", value))
}

/// `convention: "unity"` or `convention: { name, quaternions }`.
fn declared(document: &Map<String, Value>) -> Result<Option<Declared>, Error> {
    let Some(value) = document.get("convention") else { return Ok(None) };
    let wrong =
        || Error::new("convention", value.to_string(), "a name, or an object with name and quaternions");
    if let Some(text) = value.as_str() {
        let convention: super::Convention =
            text.parse().map_err(|e| Error { place: "convention".to_owned(), ..e })?;
        let mut words = text.split(',').map(str::trim);
        let says_order = words.any(|word| word == "wxyz" || word == "xyzw");
        let quaternions = says_order.then_some(convention.quaternions);
        return Ok(Some(Declared { name: convention.name.to_owned(), quaternions }));
    }
    let object = value.as_object().ok_or_else(wrong)?;
    let name = object.get("name").and_then(Value::as_str).ok_or_else(wrong)?.to_owned();
    let quaternions = match object.get("quaternions").and_then(Value::as_str) {
        None => None,
        Some("wxyz") => Some(QuaternionOrder::Wxyz),
        Some("xyzw") => Some(QuaternionOrder::Xyzw),
        Some(other) => return Err(Error::new("convention.quaternions", other, "wxyz or xyzw")),
    };
    Ok(Some(Declared { name, quaternions }))
}
