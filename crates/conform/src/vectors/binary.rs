//! Vectors as flat binary: `answer::binary` documents the layout.

use super::super::pipeline::Pipeline;
use super::{Array, expected, inputs};
use crate::answer::{BLOCK, Block, HEADER, MAGIC, VERSION, dtype};
use crate::convention::{MatrixOrder, QuaternionOrder};

/// `vectors.bin`: inputs as `input.*`, then what is expected.
pub(crate) fn binary(pipeline: &Pipeline<'_>) -> Vec<u8> {
    let inputs = inputs(pipeline).into_iter().map(|array| (format!("input.{}", short(array.name)), array));
    let outputs = expected(pipeline).into_iter().map(|array| (array.name.to_owned(), array));
    let arrays: Vec<(String, Array)> = inputs.chain(outputs).collect();
    let mut offset = (HEADER + BLOCK * arrays.len()) as u64;
    let mut blocks = Vec::new();
    for (name, array) in &arrays {
        let length = 4 * array.values.len() as u64;
        let dtype = if array.integer { dtype::U32 } else { dtype::F32 };
        blocks.push(Block { name: name.clone(), dtype, shape: array.shape.clone(), offset, length });
        offset += length;
    }
    let mut bytes = header(pipeline, blocks.len());
    blocks.iter().for_each(|block| bytes.extend(entry(block)));
    for (_, array) in &arrays {
        for &value in &array.values {
            bytes.extend(if array.integer {
                (value as u32).to_le_bytes()
            } else {
                (value as f32).to_le_bytes()
            });
        }
    }
    bytes
}

/// Names have to fit 24 bytes with `input.` before them.
fn short(name: &str) -> &str {
    match name {
        "canonical_quaternions" => "canonical_quats",
        "canonical_opacity_logits" => "canonical_logits",
        "canonical_log_scales" => "canonical_logs",
        "canonical_opacities" => "canonical_opacity",
        other => other,
    }
}

fn padded<const N: usize>(text: &str) -> [u8; N] {
    let bytes = text.as_bytes();
    std::array::from_fn(|k| bytes.get(k).copied().unwrap_or(0))
}

fn header(pipeline: &Pipeline<'_>, blocks: usize) -> Vec<u8> {
    let convention = &pipeline.convention;
    let mut bytes = MAGIC.to_vec();
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend((blocks as u32).to_le_bytes());
    bytes.extend(padded::<16>(convention.name));
    bytes.extend(u32::from(convention.quaternions == QuaternionOrder::Xyzw).to_le_bytes());
    bytes.extend(u32::from(convention.matrices == MatrixOrder::Column).to_le_bytes());
    bytes
}

fn entry(block: &Block) -> Vec<u8> {
    let mut bytes = padded::<24>(&block.name).to_vec();
    bytes.extend(block.dtype.to_le_bytes());
    bytes.extend((block.shape.len() as u32).to_le_bytes());
    for k in 0..4 {
        bytes.extend((block.shape.get(k).copied().unwrap_or(0) as u32).to_le_bytes());
    }
    bytes.extend(block.offset.to_le_bytes());
    bytes.extend(block.length.to_le_bytes());
    bytes
}
