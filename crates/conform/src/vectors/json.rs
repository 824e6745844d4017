//! Vectors as JSON: an object of nested arrays, which is also the form of an answer.

use super::super::pipeline::Pipeline;
use super::{Array, NO_PARENT, expected, inputs};
use crate::answer::RIG_VERSION;
use serde_json::{Value, json};
use std::fmt::Write;

/// `vectors.json`.
pub(crate) fn json(pipeline: &Pipeline<'_>) -> String {
    let convention = &pipeline.convention;
    let head = [
        ("format", json!("skinsplat conform")),
        ("rig_version", json!(RIG_VERSION)),
        ("cases", json!(pipeline.rig.cases.name())),
        (
            "convention",
            json!({
                "name": convention.name,
                "axes": convention.axes,
                "units_per_metre": convention.units,
                "quaternions": convention.quaternions.name(),
                "matrices": convention.matrices.name(),
            }),
        ),
        ("gaussians", json!(pipeline.rig.len())),
        ("poses", json!(pipeline.rig.poses.len())),
    ];
    let mut text = "{\n".to_owned();
    // Writing into a String cannot fail.
    for (name, value) in head {
        let _ = writeln!(text, "  \"{name}\": {value},");
    }
    let names = &pipeline.rig.body.skeleton.names;
    let _ = writeln!(text, "  \"inputs\": {{\n    \"joint_names\": {},", json!(names));
    write_arrays(&mut text, "    ", &inputs(pipeline));
    text += "  },\n";
    write_arrays(&mut text, "  ", &expected(pipeline));
    text += "}\n";
    text
}

/// A line per entry of the first axis.
fn write_arrays(text: &mut String, indent: &str, arrays: &[Array]) {
    for (i, array) in arrays.iter().enumerate() {
        let comma = if i + 1 == arrays.len() { "" } else { "," };
        let rows: Vec<String> = match nested(array, 0, 0) {
            Value::Array(rows) => rows.iter().map(Value::to_string).collect(),
            other => vec![other.to_string()],
        };
        let flat = array.shape.len() == 1;
        let separator = if flat { ", ".to_owned() } else { format!(",\n{indent}  ") };
        let (open, close) = if flat {
            (String::new(), String::new())
        } else {
            (format!("\n{indent}  "), format!("\n{indent}"))
        };
        let _ = writeln!(text, "{indent}\"{}\": [{open}{}{close}]{comma}", array.name, rows.join(&separator));
    }
}

fn nested(array: &Array, axis: usize, start: usize) -> Value {
    if axis == array.shape.len() {
        let value = array.values[start];
        return match array.integer {
            true if value == f64::from(NO_PARENT) => json!(-1),
            true => json!(value as u64),
            false => json!(value),
        };
    }
    let stride: usize = array.shape[axis + 1..].iter().product();
    Value::Array((0..array.shape[axis]).map(|k| nested(array, axis + 1, start + k * stride)).collect())
}
