//! Reads the rasterizer's benchmark scenes: binary little-endian 3DGS PLY of degree 3 and camera JSON.
#![expect(unreachable_pub, clippy::unwrap_used, reason = "shared by tests and benchmarks")]

use glam::{DMat4, Vec3};
use skinsplat_core::scene::{Camera, Gaussians};
use std::path::Path;

/// Floats per Gaussian: position, normal, 3 + 45 SH, opacity, scale, rotation.
const PROPERTIES: usize = 62;

/// The Gaussians of a scene file.
pub fn gaussians(path: &Path) -> Gaussians {
    let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let marker = b"end_header\n";
    let start = bytes.windows(marker.len()).position(|w| w == marker).unwrap() + marker.len();
    let values: Vec<f32> =
        bytes[start..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    let mut out = Gaussians { sh_degree: 3, ..Gaussians::default() };
    for row in values.chunks_exact(PROPERTIES) {
        out.means.push(Vec3::from_slice(row));
        out.sh.push([row[6], row[7], row[8]]);
        out.sh.extend((0..15).map(|k| [0, 1, 2].map(|c| row[9 + 15 * c + k])));
        out.opacity_logits.push(row[54]);
        out.log_scales.push(Vec3::from_slice(&row[55..]));
        out.rotations.push([row[58], row[59], row[60], row[61]]);
    }
    out
}

/// A camera and its background.
pub fn camera(json: &serde_json::Value) -> (Camera, [f32; 3]) {
    let number = |v: &serde_json::Value| v.as_f64().unwrap();
    let rows: Vec<f64> = json["world_to_camera"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|row| row.as_array().unwrap().iter().map(number))
        .collect();
    let size = |key: &str| u32::try_from(json[key].as_u64().unwrap()).unwrap();
    let camera = Camera {
        width: size("width"),
        height: size("height"),
        fx: number(&json["fx"]),
        fy: number(&json["fy"]),
        cx: number(&json["cx"]),
        cy: number(&json["cy"]),
        camera_from_world: DMat4::from_cols_slice(&rows).transpose(),
    };
    let background = [0, 1, 2].map(|c| number(&json["background"][c]) as f32);
    (camera, background)
}
