//! A glTF document under construction, with its binary chunk.

use crate::{Error, atomic};
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;

/// `componentType` of glTF.
pub(super) mod component {
    pub(in super::super) const U16: u32 = 5123;
    pub(in super::super) const U32: u32 = 5125;
    pub(in super::super) const F32: u32 = 5126;
}

/// What a buffer view is bound to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Target {
    /// Vertex attributes.
    Vertices,
    /// Indices of a primitive.
    Indices,
    /// Neither: matrices, keys of animations.
    Other,
}

/// The document.
pub(super) struct Builder {
    /// Everything but buffer views, accessors and buffers.
    pub(super) json: Value,
    views: Vec<Value>,
    accessors: Vec<Value>,
    binary: Vec<u8>,
}

impl Builder {
    pub(super) fn new() -> Self {
        let generator = concat!("skinsplat ", env!("CARGO_PKG_VERSION"));
        let json = json!({ "asset": { "version": "2.0", "generator": generator }, "scene": 0 });
        Self { json, views: Vec::new(), accessors: Vec::new(), binary: Vec::new() }
    }

    /// Floats, `width` per element, with the bounds that glTF asks of positions and keys; returns the accessor.
    pub(super) fn floats(
        &mut self,
        kind: &str,
        width: usize,
        values: &[f32],
        target: Target,
        bounds: bool,
    ) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let accessor = self.accessor(component::F32, kind, values.len() / width, &bytes, target);
        if bounds && !values.is_empty() {
            let of = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
                let column = |k: usize| values.iter().skip(k).step_by(width).copied();
                (0..width).filter_map(|k| column(k).reduce(pick)).collect()
            };
            self.accessors[accessor]["min"] = json!(of(f32::min));
            self.accessors[accessor]["max"] = json!(of(f32::max));
        }
        accessor
    }

    /// Joint indices, four per element.
    pub(super) fn joints(&mut self, values: &[[u16; 4]]) -> usize {
        let bytes: Vec<u8> = values.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(component::U16, "VEC4", values.len(), &bytes, Target::Vertices)
    }

    /// Indices of a primitive.
    pub(super) fn indices(&mut self, values: &[u32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(component::U32, "SCALAR", values.len(), &bytes, Target::Indices)
    }

    fn accessor(&mut self, component: u32, kind: &str, count: usize, bytes: &[u8], target: Target) -> usize {
        let mut view = json!({ "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len() });
        match target {
            Target::Vertices => view["target"] = json!(34962),
            Target::Indices => view["target"] = json!(34963),
            Target::Other => {}
        }
        self.binary.extend(bytes);
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.accessors.push(json!({
            "bufferView": self.views.len() - 1, "componentType": component, "type": kind, "count": count,
        }));
        self.accessors.len() - 1
    }

    /// Writes the `.glb`.
    ///
    /// # Errors
    /// A file that cannot be written, or that would be longer than the 4 GiB of the format.
    pub(super) fn write(mut self, path: &Path) -> Result<(), Error> {
        if !self.binary.is_empty() {
            self.json["buffers"] = json!([{ "byteLength": self.binary.len() }]);
            self.json["bufferViews"] = Value::Array(self.views);
            self.json["accessors"] = Value::Array(self.accessors);
        }
        let mut text = self.json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = 12 + 8 + text.len() + 8 + self.binary.len();
        let Ok(total) = u32::try_from(total) else {
            return Err(Error::invalid(
                path,
                "file",
                format!("{total} bytes"),
                "at most 4 GiB, as .glb allows",
            ));
        };
        atomic::write(path, |w| {
            w.write_all(b"glTF")?;
            w.write_all(&2u32.to_le_bytes())?;
            w.write_all(&total.to_le_bytes())?;
            for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &self.binary)] {
                w.write_all(&(chunk.len() as u32).to_le_bytes())?;
                w.write_all(kind)?;
                w.write_all(chunk)?;
            }
            Ok(())
        })
    }
}
