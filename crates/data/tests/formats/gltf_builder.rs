//! Skinned glTF files by hand: an arm of two joints, with what a test adds.

use crate::files;
use glam::Vec3;
use serde_json::{Value, json};
use skinsplat_core::scene::{Pose, PosedBody};
use skinsplat_data::gltf::Rig;
use std::path::Path;

pub(super) const F32: u32 = 5126;
pub(super) const U8: u32 = 5121;
pub(super) const U16: u32 = 5123;
pub(super) const U32: u32 = 5125;

/// A document under construction; every accessor has a buffer view of its own.
pub(super) struct Builder {
    pub(super) json: Value,
    pub(super) binary: Vec<u8>,
}

impl Builder {
    pub(super) fn accessor(&mut self, component: u32, kind: &str, count: usize, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let view = json!({ "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len() });
        self.binary.extend(bytes);
        let views = self.json["bufferViews"].as_array_mut().unwrap();
        views.push(view);
        let view = views.len() - 1;
        let normalized = component != F32 && kind == "VEC4";
        let mut accessor =
            json!({ "bufferView": view, "componentType": component, "type": kind, "count": count });
        if normalized {
            accessor["normalized"] = json!(true);
        }
        if kind == "VEC3" {
            (accessor["min"], accessor["max"]) = (json!([-9, -9, -9]), json!([9, 9, 9]));
        }
        let accessors = self.json["accessors"].as_array_mut().unwrap();
        accessors.push(accessor);
        accessors.len() - 1
    }

    pub(super) fn floats(&mut self, kind: &str, count: usize, values: &[f32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(F32, kind, count, &bytes)
    }

    pub(super) fn channel(
        &mut self,
        clip: &str,
        node: usize,
        path: &str,
        interpolation: &str,
        times: &[f32],
        values: &[f32],
    ) {
        let input = self.floats("SCALAR", times.len(), times);
        let width = if path == "rotation" { 4 } else { 3 };
        let kind = if width == 4 { "VEC4" } else { "VEC3" };
        let output = self.floats(kind, values.len() / width, values);
        let animations = self.json["animations"].as_array_mut().unwrap();
        if !animations.iter().any(|a| a["name"] == clip) {
            animations.push(json!({ "name": clip, "samplers": [], "channels": [] }));
        }
        let animation = animations.iter_mut().find(|a| a["name"] == clip).unwrap();
        let samplers = animation["samplers"].as_array_mut().unwrap();
        samplers.push(json!({ "input": input, "output": output, "interpolation": interpolation }));
        let sampler = samplers.len() - 1;
        let target = json!({ "node": node, "path": path });
        animation["channels"].as_array_mut().unwrap().push(json!({ "sampler": sampler, "target": target }));
    }

    pub(super) fn document(&self) -> Value {
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.binary.len().next_multiple_of(4) }]);
        json
    }

    pub(super) fn glb(&self, folder: &Path) -> std::path::PathBuf {
        let path = folder.join("rig.glb");
        files::glb(&path, &self.document(), &self.binary);
        path
    }
}

/// An arm along x: shoulder at x = 0 (node 1), elbow at x = 1 (node 0), both under node 2, which moves everything by
/// (0, 0, 5) and doubles it. The skin lists the elbow first. Vertex 0 is the hand at x = 2, vertex 1 the upper arm at
/// x = 0.5, vertex 2 is shared half and half at x = 1.
pub(super) fn arm() -> Builder {
    let mut b = Builder {
        json: json!({
            "asset": { "version": "2.0" },
            "nodes": [
                { "name": "elbow", "translation": [1, 0, 0] },
                { "name": "shoulder", "children": [0] },
                { "name": "root", "children": [1], "translation": [0, 0, 5], "scale": [2, 2, 2] },
                { "name": "mesh", "mesh": 0, "skin": 0, "translation": [100, 100, 100] },
            ],
            "bufferViews": [], "accessors": [], "animations": [],
        }),
        binary: Vec::new(),
    };
    let position = b.floats("VEC3", 3, &[2., 0., 0., 0.5, 0., 0., 1., 0.25, 0.]);
    let uv = b.floats("VEC2", 3, &[0., 0., 0.25, 0.75, 1., 1.]);
    let joints = b.accessor(U8, "VEC4", 3, &[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0]);
    b.json["accessors"][joints].as_object_mut().unwrap().remove("normalized");
    let weights = b.floats("VEC4", 3, &[1., 0., 0., 0., 1., 0., 0., 0., 0.5, 0.5, 0., 0.]);
    let indices = b.accessor(U16, "SCALAR", 3, &[0, 0, 1, 0, 2, 0]);
    let mut binds = vec![0.0f32; 32];
    for (matrix, x) in [(0, -1.0), (1, 0.0)] {
        [0, 5, 10, 15].iter().for_each(|&k| binds[16 * matrix + k] = 1.0);
        binds[16 * matrix + 12] = x;
    }
    let binds = b.floats("MAT4", 2, &binds);
    b.json["meshes"] = json!([{ "primitives": [{
        "attributes": { "POSITION": position, "TEXCOORD_0": uv, "JOINTS_0": joints, "WEIGHTS_0": weights },
        "indices": indices,
    }] }]);
    b.json["skins"] = json!([{ "joints": [0, 1], "inverseBindMatrices": binds }]);
    b
}

pub(super) fn posed(rig: &Rig, pose: &Pose) -> Vec<Vec3> {
    PosedBody::new(&rig.body.rest, pose).unwrap().mesh().vertices.clone()
}

pub(super) fn close(found: &[Vec3], expected: &[[f32; 3]]) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!((*a - Vec3::from_array(*b)).length() < 1e-6, "{a} and {b:?}");
    }
}
