//! SMPL-style `.npz` body models: any number of vertices V, faces F, joints J and shape directions B.

use super::super::Error;
use super::super::npy::Array;
use super::super::npz::Archive;
use glam::{DVec3, Vec3};
use skinsplat_core::scene::{Body, RestBody, SceneError, ShapeSpace, Skeleton, SkinWeights, Uv};
use std::path::Path;

/// Keys: `v_template` (V, 3), `f` or `faces` (F, 3), `weights` (V, J), `kintree_table` (2, J), `J_regressor` (J, V)
/// and/or `J` (J, 3); optional `shapedirs` (V, 3, B), `posedirs` (V, 3, 9 (J - 1)), `vt` (T, 2) with `ft` (F, 3),
/// `joint_names` (J). Other keys are ignored.
pub(super) fn load(path: &Path) -> Result<Body, Error> {
    let mut archive = Archive::open(path, "body")?;
    let vertices = points(&archive.require("v_template", "V,3")?);
    let weights = weights(&mut archive)?;
    let face_key = if archive.contains("f") { "f" } else { "faces" };
    let faces = triangles(&mut archive, face_key, "F,3")?;
    let parents = parents(&mut archive)?;
    let joint_regressor = joint_regressor(&mut archive)?;
    let positions = match archive.optional("J", "J,3")? {
        // The regressor is the model's definition; J is its answer for the mean shape, rounded.
        _ if !joint_regressor.is_empty() => regressed(&joint_regressor, &vertices),
        Some(joints) => points(&joints),
        None => {
            return Err(archive.invalid("J_regressor", "missing, and J too", "J_regressor (J,V) or J (J,3)"));
        }
    };
    let names = joint_names(&mut archive, parents.len())?;
    let uv = uv(&mut archive)?;
    let pose_directions = pose_directions(&mut archive, parents.len())?;
    let shape = archive.optional("shapedirs", "V,3,B")?;
    let shape = shape.map(|array| ShapeSpace { directions: directions(&array), joint_regressor });
    let named = |e: SceneError| Error::scene(path, SceneError { field: in_file_terms(&e.field), ..e });
    let skeleton = Skeleton::from_joint_positions(names, parents, &positions).map_err(named)?;
    let rest = RestBody { skeleton, vertices, faces, weights, uv, pose_directions };
    rest.validate().map_err(named)?;
    Ok(Body { rest, shape })
}

fn in_file_terms(field: &str) -> String {
    field.replace("parents[", "kintree_table[0, ")
}

fn points(array: &Array) -> Vec<DVec3> {
    array.values.chunks_exact(3).map(DVec3::from_slice).collect()
}

fn weights(archive: &mut Archive) -> Result<SkinWeights, Error> {
    let array = archive.require("weights", "V,J")?;
    let joints = array.shape[1];
    if joints == 0 {
        return Err(archive.invalid("weights", "no joints", "at least one"));
    }
    let rows = array.values.chunks_exact(joints).map(|row| row.iter().map(|&w| w as f32).enumerate());
    SkinWeights::from_rows(rows, joints).map_err(|e| Error::scene(archive.path(), e))
}

fn triangles(archive: &mut Archive, name: &str, pattern: &str) -> Result<Vec<[u32; 3]>, Error> {
    let array = archive.require(name, pattern)?;
    let is_index = |&v: &f64| v >= 0.0 && v <= f64::from(u32::MAX) && v.fract() == 0.0;
    if let Some(i) = array.values.iter().position(|v| !is_index(v)) {
        let problem = format!("{}", array.values[i]);
        return Err(archive.invalid(format!("{name}[{}, {}]", i / 3, i % 3), problem, "a vertex index"));
    }
    Ok(array.values.chunks_exact(3).map(|t| [t[0] as u32, t[1] as u32, t[2] as u32]).collect())
}

/// Row 0 of `kintree_table`. A root's parent is stored as -1, or as 2^32 - 1 where that was cast to unsigned.
fn parents(archive: &mut Archive) -> Result<Vec<Option<usize>>, Error> {
    let table = archive.require("kintree_table", "2,J")?;
    let (parents, ids) = table.values.split_at(table.shape[1]);
    if let Some(i) = (0..ids.len()).find(|&i| ids[i] != i as f64) {
        let problem = format!("joint id {}", ids[i]);
        return Err(archive.invalid(
            format!("kintree_table[1, {i}]"),
            problem,
            format!("{i} (joints in order)"),
        ));
    }
    let parent = |(i, &value): (usize, &f64)| {
        if value < 0.0 || value >= f64::from(u32::MAX) {
            Ok(None)
        } else if value.fract() == 0.0 {
            Ok(Some(value as usize))
        } else {
            Err(archive.invalid(format!("kintree_table[0, {i}]"), format!("{value}"), "a joint index"))
        }
    };
    parents.iter().enumerate().map(parent).collect()
}

/// The dense (J, V) regressor as sparse rows; empty if the file has none.
fn joint_regressor(archive: &mut Archive) -> Result<Vec<Vec<(u32, f32)>>, Error> {
    let Some(array) = archive.optional("J_regressor", "J,V")? else { return Ok(Vec::new()) };
    let sparse = |row: &[f64]| {
        row.iter().enumerate().filter(|(_, w)| **w != 0.0).map(|(v, &w)| (v as u32, w as f32)).collect()
    };
    Ok(array.values.chunks_exact(array.shape[1].max(1)).map(sparse).collect())
}

fn regressed(regressor: &[Vec<(u32, f32)>], vertices: &[DVec3]) -> Vec<DVec3> {
    let joint = |row: &Vec<(u32, f32)>| row.iter().map(|&(v, w)| vertices[v as usize] * f64::from(w)).sum();
    regressor.iter().map(joint).collect()
}

fn joint_names(archive: &mut Archive, joints: usize) -> Result<Vec<String>, Error> {
    match archive.text("joint_names")? {
        Some(names) if names.len() == joints => Ok(names),
        Some(names) => Err(archive.invalid(
            "joint_names",
            format!("{} names", names.len()),
            format!("{joints} (joints)"),
        )),
        None => Ok((0..joints).map(|i| format!("joint {i}")).collect()),
    }
}

fn uv(archive: &mut Archive) -> Result<Option<Uv>, Error> {
    let Some(vt) = archive.optional("vt", "T,2")? else { return Ok(None) };
    let coordinates = vt.values.chunks_exact(2).map(|t| [t[0] as f32, t[1] as f32]).collect();
    Ok(Some(Uv { coordinates, faces: triangles(archive, "ft", "F,3")? }))
}

/// `posedirs` by direction. A model whose directions are all zero has none: nothing is to be computed for them.
fn pose_directions(archive: &mut Archive, joints: usize) -> Result<Vec<Vec<Vec3>>, Error> {
    let count = 9 * (joints - 1);
    match archive.optional("posedirs", &format!("V,3,{count}"))? {
        Some(array) if array.values.iter().any(|&v| v != 0.0) => Ok(directions(&array)),
        _ => Ok(Vec::new()),
    }
}

/// A (V, 3, B) array as B directions of V offsets.
fn directions(array: &Array) -> Vec<Vec<Vec3>> {
    let [vertices, _, count] = [array.shape[0], array.shape[1], array.shape[2]];
    let value = |v: usize, c: usize, k: usize| array.values[(v * 3 + c) * count + k] as f32;
    let offset = |k: usize, v: usize| Vec3::new(value(v, 0, k), value(v, 1, k), value(v, 2, k));
    (0..count).map(|k| (0..vertices).map(|v| offset(k, v)).collect()).collect()
}
