//! Body models in the layout of SMPL: any number of vertices V, faces F, joints J and shape directions B.

use super::super::arrays::Arrays;
use super::super::npy::Array;
use super::super::{Error, pickle::Rows};
use super::Loaded;
use glam::{DVec3, Vec3};
use skinsplat_core::scene::{
    Body, HandSpace, HandSpaces, RestBody, SceneError, ShapeSpace, Skeleton, SkinWeights, Uv,
};
use std::path::Path;

/// The joints of SMPL-X, in the order of its files. The first 22 are the body's in SMPL and SMPL-H too; SMPL has two hand
/// joints after them, SMPL-H the fingers.
const SMPLX_JOINTS: [&str; 55] = [
    "pelvis",
    "left_hip",
    "right_hip",
    "spine1",
    "left_knee",
    "right_knee",
    "spine2",
    "left_ankle",
    "right_ankle",
    "spine3",
    "left_foot",
    "right_foot",
    "neck",
    "left_collar",
    "right_collar",
    "head",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "jaw",
    "left_eye_smplhf",
    "right_eye_smplhf",
    "left_index1",
    "left_index2",
    "left_index3",
    "left_middle1",
    "left_middle2",
    "left_middle3",
    "left_pinky1",
    "left_pinky2",
    "left_pinky3",
    "left_ring1",
    "left_ring2",
    "left_ring3",
    "left_thumb1",
    "left_thumb2",
    "left_thumb3",
    "right_index1",
    "right_index2",
    "right_index3",
    "right_middle1",
    "right_middle2",
    "right_middle3",
    "right_pinky1",
    "right_pinky2",
    "right_pinky3",
    "right_ring1",
    "right_ring2",
    "right_ring3",
    "right_thumb1",
    "right_thumb2",
    "right_thumb3",
];

/// Shape directions of an SMPL-X file with all of them; expressions follow.
const SMPLX_SHAPES: usize = 300;
/// Expression directions of such a file.
const SMPLX_EXPRESSIONS: usize = 100;

/// Keys: `v_template` (V, 3), `f` or `faces` (F, 3), `weights` (V, J), `kintree_table` (2, J), `J_regressor` (J, V), dense or
/// sparse, and/or `J` (J, 3); optional `shapedirs` (V, 3, B), `posedirs` (V, 3, 9 (J - 1)), `vt` (T, 2) with `ft` (F, 3),
/// `joint_names` (J), `hands_meanl`, `hands_meanr` (3 n), `hands_componentsl`, `hands_componentsr` (m, 3 n). Other keys are
/// ignored.
///
/// The layout is that of <https://smpl.is.tue.mpg.de> and of the smplx package: a posed joint is regressed from the shaped
/// template; row `9 (j - 1) + 3 r + c` of the pose directions goes with entry (r, c) of `R(theta_j) - I`. A file of SMPL-X
/// (55 joints) with 400 directions holds 300 of shape and 100 of expression, one with 20 holds 10 and 10.
pub(super) fn load(path: &Path) -> Result<Loaded, Error> {
    let mut file = Arrays::open(path, "body")?;
    let vertices = points(&file.require("v_template", "V,3")?);
    let mut notes = Vec::new();
    let weights = weights(&mut file, &mut notes)?;
    let face_key = if file.contains("f") { "f" } else { "faces" };
    let faces = triangles(&mut file, face_key, "F,3")?;
    let parents = parents(&mut file)?;
    let joint_regressor = joint_regressor(&mut file)?;
    let positions = match file.optional("J", "J,3")? {
        // The regressor is the model's definition; J is its answer for the mean shape, rounded.
        _ if !joint_regressor.is_empty() => regressed(&joint_regressor, &vertices),
        Some(joints) => points(&joints),
        None => {
            return Err(file.invalid("J_regressor", "missing, and J too", "J_regressor (J,V) or J (J,3)"));
        }
    };
    let names = joint_names(&mut file, parents.len())?;
    let uv = uv(&mut file)?;
    let pose_directions = pose_directions(&mut file, parents.len())?;
    let shape = shape_space(&mut file, parents.len(), joint_regressor)?;
    let hands = hands(&mut file)?;
    let named = |e: SceneError| Error::scene(path, SceneError { field: in_file_terms(&e.field), ..e });
    let mut skeleton = Skeleton::from_joint_positions(names, parents, &positions).map_err(named)?;
    skeleton.hands = hands.map(std::sync::Arc::new);
    let rest = RestBody { skeleton, vertices, faces, weights, uv, pose_directions };
    rest.validate().map_err(named)?;
    Ok(Loaded { body: Body { rest, shape }, notes })
}

fn in_file_terms(field: &str) -> String {
    field.replace("parents[", "kintree_table[0, ")
}

fn points(array: &Array) -> Vec<DVec3> {
    array.values.chunks_exact(3).map(DVec3::from_slice).collect()
}

fn weights(file: &mut Arrays, notes: &mut Vec<String>) -> Result<SkinWeights, Error> {
    let array = file.require("weights", "V,J")?;
    let joints = array.shape[1];
    if joints == 0 {
        return Err(file.invalid("weights", "no joints", "at least one"));
    }
    let mut rows: Vec<Vec<(usize, f32)>> = array
        .values
        .chunks_exact(joints)
        .map(|row| row.iter().map(|&w| w as f32).enumerate().filter(|(_, w)| *w != 0.0).collect())
        .collect();
    notes.extend(SkinWeights::normalise(&mut rows).map(|note| format!("weights: {note}")));
    SkinWeights::from_rows(rows, joints).map_err(|e| Error::scene(file.path(), e))
}

fn triangles(file: &mut Arrays, name: &str, pattern: &str) -> Result<Vec<[u32; 3]>, Error> {
    let array = file.require(name, pattern)?;
    let is_index = |&v: &f64| v >= 0.0 && v <= f64::from(u32::MAX) && v.fract() == 0.0;
    if let Some(i) = array.values.iter().position(|v| !is_index(v)) {
        let problem = format!("{}", array.values[i]);
        return Err(file.invalid(format!("{name}[{}, {}]", i / 3, i % 3), problem, "a vertex index"));
    }
    Ok(array.values.chunks_exact(3).map(|t| [t[0] as u32, t[1] as u32, t[2] as u32]).collect())
}

/// Row 0 of `kintree_table`. A root's parent is stored as -1, or as 2^32 - 1 where that was cast to unsigned.
fn parents(file: &mut Arrays) -> Result<Vec<Option<usize>>, Error> {
    let table = file.require("kintree_table", "2,J")?;
    let (parents, ids) = table.values.split_at(table.shape[1]);
    if let Some(i) = (0..ids.len()).find(|&i| ids[i] != i as f64) {
        let problem = format!("joint id {}", ids[i]);
        return Err(file.invalid(
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
            Err(file.invalid(format!("kintree_table[0, {i}]"), format!("{value}"), "a joint index"))
        }
    };
    parents.iter().enumerate().map(parent).collect()
}

/// The (J, V) regressor, dense or sparse in the file; empty if it has none.
fn joint_regressor(file: &mut Arrays) -> Result<Vec<Vec<(u32, f32)>>, Error> {
    let Some(Rows { rows, .. }) = file.rows("J_regressor", "J,V")? else { return Ok(Vec::new()) };
    Ok(rows.into_iter().map(|row| row.into_iter().map(|(v, w)| (v, w as f32)).collect()).collect())
}

fn regressed(regressor: &[Vec<(u32, f32)>], vertices: &[DVec3]) -> Vec<DVec3> {
    let joint = |row: &Vec<(u32, f32)>| row.iter().map(|&(v, w)| vertices[v as usize] * f64::from(w)).sum();
    regressor.iter().map(joint).collect()
}

/// The names of the file; of a body with the joints of SMPL, SMPL-H or SMPL-X theirs.
fn joint_names(file: &mut Arrays, joints: usize) -> Result<Vec<String>, Error> {
    match file.text("joint_names")? {
        Some(names) if names.len() == joints => Ok(names),
        Some(names) => {
            Err(file.invalid("joint_names", format!("{} names", names.len()), format!("{joints} (joints)")))
        }
        None => Ok(stock_names(joints)),
    }
}

fn stock_names(joints: usize) -> Vec<String> {
    let (body, fingers) = (&SMPLX_JOINTS[..22], &SMPLX_JOINTS[25..]);
    let names: Vec<&str> = match joints {
        24 => [body, &["left_hand", "right_hand"]].concat(),
        52 => [body, fingers].concat(),
        55 => SMPLX_JOINTS.to_vec(),
        _ => return (0..joints).map(|i| format!("joint {i}")).collect(),
    };
    names.into_iter().map(str::to_owned).collect()
}

fn uv(file: &mut Arrays) -> Result<Option<Uv>, Error> {
    let Some(vt) = file.optional("vt", "T,2")? else { return Ok(None) };
    let coordinates = vt.values.chunks_exact(2).map(|t| [t[0] as f32, t[1] as f32]).collect();
    Ok(Some(Uv { coordinates, faces: triangles(file, "ft", "F,3")? }))
}

/// `posedirs` by direction. A model whose directions are all zero has none: nothing is to be computed for them.
fn pose_directions(file: &mut Arrays, joints: usize) -> Result<Vec<Vec<Vec3>>, Error> {
    let count = 9 * (joints - 1);
    match file.optional("posedirs", &format!("V,3,{count}"))? {
        Some(array) if array.values.iter().any(|&v| v != 0.0) => Ok(directions(&array)),
        _ => Ok(Vec::new()),
    }
}

/// `shapedirs`, split into shape and expression where the model has both.
fn shape_space(
    file: &mut Arrays,
    joints: usize,
    joint_regressor: Vec<Vec<(u32, f32)>>,
) -> Result<Option<ShapeSpace>, Error> {
    let Some(array) = file.optional("shapedirs", "V,3,B")? else { return Ok(None) };
    let mut directions = directions(&array);
    let shapes = match (joints, directions.len()) {
        (55, n) if n >= SMPLX_SHAPES + SMPLX_EXPRESSIONS => SMPLX_SHAPES,
        (55, 20) => 10,
        (_, n) => n,
    };
    let expressions = directions.split_off(shapes);
    Ok(Some(ShapeSpace { directions, expressions, joint_regressor }))
}

/// The pose spaces of both hands, if the file has both.
fn hands(file: &mut Arrays) -> Result<Option<HandSpaces>, Error> {
    let mut hand = |side: char| -> Result<Option<HandSpace>, Error> {
        let Some(mean) = file.optional(&format!("hands_mean{side}"), "H")? else { return Ok(None) };
        let width = mean.values.len();
        let components = file.optional(&format!("hands_components{side}"), "C,H")?;
        let rows = |array: Array| array.values.chunks_exact(width.max(1)).map(<[f64]>::to_vec).collect();
        Ok(Some(HandSpace { mean: mean.values, components: components.map(rows).unwrap_or_default() }))
    };
    Ok(hand('l')?.zip(hand('r')?).map(|(left, right)| HandSpaces { left, right }))
}

/// A (V, 3, B) array as B directions of V offsets.
fn directions(array: &Array) -> Vec<Vec<Vec3>> {
    let [vertices, _, count] = [array.shape[0], array.shape[1], array.shape[2]];
    let value = |v: usize, c: usize, k: usize| array.values[(v * 3 + c) * count + k] as f32;
    let offset = |k: usize, v: usize| Vec3::new(value(v, 0, k), value(v, 1, k), value(v, 2, k));
    (0..count).map(|k| (0..vertices).map(|v| offset(k, v)).collect()).collect()
}
