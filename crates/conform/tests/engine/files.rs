//! Answers as flat binary and as posed PLY, written by hand.

use super::Outs;
use std::path::Path;

/// A block of f32.
fn block(name: &str, shape: &[u32], offset: usize, length: usize) -> Vec<u8> {
    let mut entry = name.as_bytes().to_vec();
    entry.resize(24, 0);
    entry.extend(1u32.to_le_bytes());
    entry.extend((shape.len() as u32).to_le_bytes());
    (0..4).for_each(|k| entry.extend(shape.get(k).copied().unwrap_or(0).to_le_bytes()));
    entry.extend((offset as u64).to_le_bytes());
    entry.extend((length as u64).to_le_bytes());
    entry
}

/// Means, quaternions and SH as flat binary, in the convention `name` (empty: not said).
pub fn binary(outs: &Outs, name: &str) -> Vec<u8> {
    let (poses, gaussians) = (outs.len() as u32, outs[0].len() as u32);
    let all = || outs.iter().flatten();
    let arrays: [(&str, Vec<u32>, Vec<f64>); 3] = [
        ("means", vec![poses, gaussians, 3], all().flat_map(|o| o.mean).collect()),
        ("quaternions", vec![poses, gaussians, 4], all().flat_map(|o| o.quat).collect()),
        ("sh", vec![poses, gaussians, 16, 3], all().flat_map(|o| o.sh.concat()).collect()),
    ];
    let mut bytes = b"SKINCONF".to_vec();
    bytes.extend(1u32.to_le_bytes());
    bytes.extend(3u32.to_le_bytes());
    let mut padded = name.as_bytes().to_vec();
    padded.resize(16, 0);
    bytes.extend(padded);
    bytes.extend([0; 8]);
    let mut offset = 40 + 64 * 3;
    for (name, shape, values) in &arrays {
        bytes.extend(block(name, shape, offset, 4 * values.len()));
        offset += 4 * values.len();
    }
    for (_, _, values) in &arrays {
        values.iter().for_each(|&v| bytes.extend((v as f32).to_le_bytes()));
    }
    bytes
}

/// A posed PLY per pose; `activated` writes scales and opacities as they are drawn.
pub fn ply(outs: &Outs, folder: &Path, activated: &[&str]) {
    std::fs::create_dir_all(folder).unwrap();
    for (k, pose) in outs.iter().enumerate() {
        let mut text = format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", pose.len());
        let mut names: Vec<String> = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"].map(String::from).to_vec();
        names.extend((0..45).map(|k| format!("f_rest_{k}")));
        names.push("opacity".into());
        names.extend((0..3).map(|k| format!("scale_{k}")));
        names.extend((0..4).map(|k| format!("rot_{k}")));
        names.iter().for_each(|name| text += &format!("property float {name}\n"));
        text += "end_header\n";
        let mut bytes = text.into_bytes();
        for o in pose {
            let mut row: Vec<f64> = o.mean.to_vec();
            row.extend(o.sh[0]);
            (0..3).for_each(|channel| row.extend((1..16).map(|k| o.sh[k][channel])));
            let logit = (o.opacity / (1.0 - o.opacity)).ln();
            row.push(if activated.contains(&"opacity") { o.opacity } else { logit });
            row.extend(o.scale.map(|s| if activated.contains(&"scale") { s } else { s.ln() }));
            row.extend(o.quat);
            row.iter().for_each(|&v| bytes.extend((v as f32).to_le_bytes()));
        }
        std::fs::write(folder.join(format!("{k:03}.ply")), bytes).unwrap();
    }
}
