//! Writers of test files, independent of the readers under test: arrays through `npyz`, glTF as JSON by hand.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part of this module")]

use npyz::WriterBuilder;
use std::io::Write;
use std::path::Path;

/// A named array for [`npz`].
pub enum Values {
    F32(Vec<f32>),
    F64(Vec<f64>),
    U32(Vec<u32>),
    I64(Vec<i64>),
}

/// Writes an `.npz` archive of C-order arrays.
pub fn npz(path: &Path, arrays: &[(&str, &[u64], Values)]) {
    let mut archive = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    for (name, shape, values) in arrays {
        archive.start_file(format!("{name}.npy"), zip::write::SimpleFileOptions::default()).unwrap();
        let bytes = match values {
            Values::F32(v) => npy(shape, v),
            Values::F64(v) => npy(shape, v),
            Values::U32(v) => npy(shape, v),
            Values::I64(v) => npy(shape, v),
        };
        archive.write_all(&bytes).unwrap();
    }
    archive.finish().unwrap();
}

/// The bytes of an `.npy` file.
pub fn npy<T: npyz::AutoSerialize + Clone>(shape: &[u64], values: &[T]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer =
        npyz::WriteOptions::new().default_dtype().shape(shape).writer(&mut bytes).begin_nd().unwrap();
    writer.extend(values.iter().cloned()).unwrap();
    writer.finish().unwrap();
    bytes
}

/// An SMPL-style body of two joints (at the origin and at x = 1), four vertices, two faces and one shape direction.
pub fn small_body() -> Vec<(&'static str, &'static [u64], Values)> {
    vec![
        ("v_template", &[4, 3], Values::F64(vec![0., 0., 0., 1., 0., 0., 2., 0., 0., 1., 1., 0.])),
        ("f", &[2, 3], Values::U32(vec![0, 1, 3, 1, 2, 3])),
        ("weights", &[4, 2], Values::F32(vec![1., 0., 0.5, 0.5, 0., 1., 0.25, 0.75])),
        ("kintree_table", &[2, 2], Values::I64(vec![-1, 0, 0, 1])),
        ("J_regressor", &[2, 4], Values::F32(vec![1., 0., 0., 0., 0., 1., 0., 0.])),
        ("shapedirs", &[4, 3, 1], Values::F32(vec![0., 0., 0., 0.5, 0., 0., 1., 0., 0., 0.5, 0., 0.])),
    ]
}

/// A `.glb` file of a JSON document and a binary chunk.
pub fn glb(path: &Path, json: &serde_json::Value, binary: &[u8]) {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut binary = binary.to_vec();
    binary.resize(binary.len().next_multiple_of(4), 0);
    let mut file = std::fs::File::create(path).unwrap();
    let total = 12 + 8 + text.len() + 8 + binary.len();
    let words = |values: &[u32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    file.write_all(b"glTF").unwrap();
    file.write_all(&words(&[2, total as u32, text.len() as u32])).unwrap();
    file.write_all(b"JSON").unwrap();
    file.write_all(&text).unwrap();
    file.write_all(&words(&[binary.len() as u32])).unwrap();
    file.write_all(b"BIN\0").unwrap();
    file.write_all(&binary).unwrap();
}
