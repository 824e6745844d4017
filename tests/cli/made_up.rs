//! A small body, an avatar bound to it, poses and a camera, each of which a test may break.

use crate::files::{self, Values};
use crate::program::Desk;
use std::path::{Path, PathBuf};

/// An array of an archive: name, shape, values (written as f32).
pub(super) type Field = (&'static str, Vec<u64>, Vec<f32>);

/// A chain of three joints and a strip of four faces along it.
pub(super) fn body() -> Vec<Field> {
    let vertices: Vec<f32> = (0..6).flat_map(|i| [0.1 * (i % 2) as f32, 0.2 * (i / 2) as f32, 0.0]).collect();
    let mut weights = vec![0.0; 18];
    for vertex in 0..6 {
        weights[vertex * 3 + vertex / 2] = 0.75;
        weights[vertex * 3 + (vertex / 2 + 1) % 3] = 0.25;
    }
    vec![
        ("v_template", vec![6, 3], vertices),
        ("f", vec![4, 3], vec![0., 1., 2., 1., 3., 2., 2., 3., 4., 3., 5., 4.]),
        ("weights", vec![6, 3], weights),
        ("kintree_table", vec![2, 3], vec![-1., 0., 1., 0., 1., 2.]),
        ("J", vec![3, 3], vec![0.05, 0., 0., 0.05, 0.2, 0., 0.05, 0.4, 0.]),
    ]
}

/// Two frames: rest, and both upper joints turned.
pub(super) fn poses() -> Vec<Field> {
    let mut thetas = vec![0.0; 18];
    (thetas[9 + 3], thetas[9 + 7]) = (0.6, -0.4);
    vec![("thetas", vec![2, 9], thetas), ("transl", vec![2, 3], vec![0.0; 6])]
}

/// The fields with one of them changed.
pub(super) fn with(mut fields: Vec<Field>, name: &str, change: impl FnOnce(&mut Field)) -> Vec<Field> {
    change(fields.iter_mut().find(|field| field.0 == name).unwrap());
    fields
}

/// The fields without one of them.
pub(super) fn without(mut fields: Vec<Field>, name: &str) -> Vec<Field> {
    fields.retain(|field| field.0 != name);
    fields
}

pub(super) fn write_npz(path: &Path, fields: &[Field]) -> PathBuf {
    let arrays: Vec<_> = fields
        .iter()
        .map(|(name, shape, values)| (*name, shape.as_slice(), Values::F32(values.clone())))
        .collect();
    files::npz(path, &arrays);
    path.to_owned()
}

/// A PLY in ascii, as rows of named values.
#[derive(Clone)]
pub(super) struct Ply {
    pub(super) properties: Vec<(String, String)>,
    pub(super) rows: Vec<Vec<String>>,
}

impl Ply {
    /// Six Gaussians of degree 0, one at each vertex of [`body`], bound to the joints.
    pub(super) fn bound() -> Self {
        let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3 weight_0 weight_1";
        let mut properties: Vec<_> = names.split(' ').map(|n| ("float".to_owned(), n.to_owned())).collect();
        properties.extend(["joint_0", "joint_1"].map(|n| ("ushort".to_owned(), n.to_owned())));
        let row = |i: usize| {
            let [x, y] = [0.1 * (i % 2) as f32, 0.2 * (i / 2) as f32];
            let joints = [i / 2, (i / 2 + 1) % 3];
            let text = format!(
                "{x} {y} 0 0.5 0.1 -0.2 1 -3 -3.5 -4 1 0.1 0 0 0.75 0.25 {} {}",
                joints[0], joints[1]
            );
            text.split(' ').map(str::to_owned).collect()
        };
        Self { properties, rows: (0..6).map(row).collect() }
    }

    /// One value replaced.
    pub(super) fn set(mut self, row: usize, name: &str, value: &str) -> Self {
        let column = self.properties.iter().position(|p| p.1 == name).unwrap();
        value.clone_into(&mut self.rows[row][column]);
        self
    }

    /// One property left out.
    pub(super) fn drop(mut self, name: &str) -> Self {
        let column = self.properties.iter().position(|p| p.1 == name).unwrap();
        self.properties.remove(column);
        self.rows.iter_mut().for_each(|row| drop(row.remove(column)));
        self
    }

    pub(super) fn header(&self, format: &str, count: u64) -> String {
        let property = |(kind, name): &(String, String)| format!("property {kind} {name}\n");
        let properties: String = self.properties.iter().map(property).collect();
        format!("ply\nformat {format} 1.0\nelement vertex {count}\n{properties}end_header\n")
    }

    pub(super) fn text(&self) -> String {
        let rows: String = self.rows.iter().map(|row| row.join(" ") + "\n").collect();
        self.header("ascii", self.rows.len() as u64) + &rows
    }
}

/// A camera that sees [`body`], as JSON.
pub(super) fn camera() -> serde_json::Value {
    serde_json::json!({
        "width": 48, "height": 64, "fx": 80.0, "fy": 80.0, "cx": 24.0, "cy": 32.0,
        "world_to_camera": [[1, 0, 0, 0], [0, -1, 0, 0.2], [0, 0, -1, 1], [0, 0, 0, 1]],
    })
}

/// A desk with `avatar.ply`, `body.npz`, `poses.npz` and `camera.json`.
pub(super) fn desk() -> Desk {
    let desk = Desk::new();
    put(&desk);
    desk
}

/// Puts these four files on a desk.
pub(super) fn put(desk: &Desk) {
    desk.put("avatar.ply", Ply::bound().text());
    write_npz(&desk.path("body.npz"), &body());
    write_npz(&desk.path("poses.npz"), &poses());
    desk.put("camera.json", camera().to_string());
}
