//! A small engine, written plainly and on its own: it reads the inputs of `vectors.json`, skins them in f64, and has the
//! bugs that it is told to have. Nothing of the crate's computation is used.

mod files;
pub mod maths;

pub use files::{binary, ply};
use maths::*;
use serde_json::{Value, json};
use std::path::Path;

/// The inputs, in the axes and units of the vectors; quaternions with w first, matrices by rows.
pub struct Inputs {
    pub parents: Vec<Option<usize>>,
    pub rest: Vec<V3>,
    pub indices: Vec<Vec<usize>>,
    pub weights: Vec<Vec<f64>>,
    pub means: Vec<V3>,
    pub quats: Vec<Q>,
    pub log_scales: Vec<V3>,
    pub logits: Vec<f64>,
    pub sh: Vec<Vec<V3>>,
    pub eye: V3,
    pub angles: Vec<Vec<V3>>,
    pub translations: Vec<V3>,
    pub joint_quats: Vec<Vec<Q>>,
    pub joint_matrices: Vec<Vec<[f64; 16]>>,
    pub world_matrices: Vec<Vec<[f64; 16]>>,
}

fn read<T: serde::de::DeserializeOwned>(inputs: &Value, name: &str) -> T {
    serde_json::from_value(inputs[name].clone()).unwrap_or_else(|e| panic!("{name}: {e}"))
}

fn matrices(inputs: &Value, name: &str) -> Vec<Vec<[f64; 16]>> {
    let all: Vec<Vec<Vec<f64>>> = read(inputs, name);
    all.iter().map(|pose| pose.iter().map(|m| std::array::from_fn(|k| m[k])).collect()).collect()
}

/// From column by column to row by row.
fn by_rows(mut all: Vec<Vec<[f64; 16]>>, by_columns: bool) -> Vec<Vec<[f64; 16]>> {
    for m in all.iter_mut().flatten().filter(|_| by_columns) {
        *m = std::array::from_fn(|k| m[k % 4 * 4 + k / 4]);
    }
    all
}

/// From (x, y, z, w) to (w, x, y, z).
fn w_first(mut all: Vec<Q>, w_is_last: bool) -> Vec<Q> {
    all.iter_mut().filter(|_| w_is_last).for_each(|q| *q = [q[3], q[0], q[1], q[2]]);
    all
}

impl Inputs {
    pub fn of(folder: &Path) -> Self {
        let text = std::fs::read_to_string(folder.join("vectors.json")).unwrap();
        let all: Value = serde_json::from_str(&text).unwrap();
        let inputs = &all["inputs"];
        let parents: Vec<i64> = read(inputs, "parents");
        let xyzw = all["convention"]["quaternions"] == "xyzw";
        let columns = all["convention"]["matrices"] == "column";
        let joint_quats: Vec<Vec<Q>> = read(inputs, "joint_quaternions");
        Self {
            parents: parents.iter().map(|&p| usize::try_from(p).ok()).collect(),
            rest: read(inputs, "rest_positions"),
            indices: read(inputs, "indices"),
            weights: read(inputs, "weights"),
            means: read(inputs, "canonical_means"),
            quats: w_first(read(inputs, "canonical_quaternions"), xyzw),
            log_scales: read(inputs, "canonical_log_scales"),
            logits: read(inputs, "canonical_opacity_logits"),
            sh: read(inputs, "canonical_sh"),
            eye: read(inputs, "camera_position"),
            angles: read(inputs, "pose_axis_angles"),
            translations: read(inputs, "pose_translations"),
            joint_quats: joint_quats.into_iter().map(|pose| w_first(pose, xyzw)).collect(),
            joint_matrices: by_rows(matrices(inputs, "joint_matrices"), columns),
            world_matrices: by_rows(matrices(inputs, "world_matrices"), columns),
        }
    }
}

/// What the engine made of one Gaussian.
#[derive(Clone, Default)]
pub struct Out {
    pub mean: V3,
    pub quat: Q,
    pub scale: V3,
    pub covariance: [f64; 6],
    pub direction: V3,
    pub opacity: f64,
    pub sh: Vec<V3>,
}

/// Poses × Gaussians.
pub type Outs = Vec<Vec<Out>>;

/// Skins everything with these bugs.
pub fn skin(inputs: &Inputs, bugs: &[&str]) -> Outs {
    let has = |bug: &str| bugs.contains(&bug);
    (0..inputs.angles.len())
        .map(|pose| {
            let last = inputs.angles.len() - 1;
            let shown = match pose {
                _ if has("one-frame-late") => pose.max(1) - 1,
                _ if has("one-frame-early") => last.min(pose + 1),
                pose => pose,
            };
            let joints = joints(inputs, shown, &has);
            (0..inputs.means.len()).map(|i| gaussian(inputs, &joints, i, &has)).collect()
        })
        .collect()
}

struct Joints {
    linear: Vec<M3>,
    translation: Vec<V3>,
    quats: Vec<Q>,
}

fn joints(inputs: &Inputs, pose: usize, has: &dyn Fn(&str) -> bool) -> Joints {
    let mut joints = Joints { linear: vec![], translation: vec![], quats: inputs.joint_quats[pose].clone() };
    if OF_THE_CHAIN.iter().any(|bug| has(bug)) {
        return chain(inputs, pose, has);
    }
    let source = if has("bind-pose-missing") { &inputs.world_matrices } else { &inputs.joint_matrices };
    for m in &source[pose] {
        // Row by row, translation in the last column.
        let mut linear = [[m[0], m[1], m[2]], [m[4], m[5], m[6]], [m[8], m[9], m[10]]];
        let mut translation = [m[3], m[7], m[11]];
        if has("row-major-matrices") {
            // Read column by column: the rows are the columns, and the last column is 0 0 0.
            linear = transpose(&linear);
            translation = [m[12], m[13], m[14]];
        }
        if has("transposed-joints") {
            linear = transpose(&linear);
        }
        joints.linear.push(linear);
        joints.translation.push(translation);
    }
    if has("row-major-matrices") || has("transposed-joints") {
        joints.quats.iter_mut().for_each(|q| *q = conj(*q));
    }
    if has("joints-xyzw") {
        joints.quats.iter_mut().for_each(|q| *q = [q[1], q[2], q[3], q[0]]);
    }
    joints
}

/// Bugs for which the engine computes its joints itself.
const OF_THE_CHAIN: [&str; 9] = [
    "degrees-for-radians",
    "degrees-handed-in",
    "local-conjugated",
    "local-xyzw",
    "local-wxyz",
    "chain-reversed",
    "bind-on-other-side",
    "translation-missing",
    "translation-before",
];

/// Forward kinematics of our own: positions and rotations down the chain.
fn chain(inputs: &Inputs, pose: usize, has: &dyn Fn(&str) -> bool) -> Joints {
    let factor = match () {
        () if has("degrees-for-radians") => 1f64.to_radians(),
        () if has("degrees-handed-in") => 1f64.to_degrees(),
        () => 1.0,
    };
    let mut joints = Joints { linear: vec![], translation: vec![], quats: vec![] };
    let mut at: Vec<V3> = vec![];
    for (j, &rest) in inputs.rest.iter().enumerate() {
        let [x, y, z] = inputs.angles[pose][j].map(|c| c * factor);
        let angle = (x * x + y * y + z * z).sqrt();
        let s = if angle > 0.0 { (angle / 2.0).sin() / angle } else { 0.5 };
        let mut local = [(angle / 2.0).cos(), s * x, s * y, s * z];
        if has("local-conjugated") {
            local = conj(local);
        } else if has("local-xyzw") {
            local = [local[1], local[2], local[3], local[0]];
        } else if has("local-wxyz") {
            local = [local[3], local[0], local[1], local[2]];
        }
        let (turned, position) = match inputs.parents[j] {
            None => (local, rest),
            Some(p) if has("chain-reversed") => {
                let offset = sub(rest, inputs.rest[p]);
                (mul(local, joints.quats[p]), add(apply(&mat(local), at[p]), offset))
            }
            Some(p) => {
                let offset = sub(rest, inputs.rest[p]);
                (mul(joints.quats[p], local), add(at[p], apply(&mat(joints.quats[p]), offset)))
            }
        };
        let r = mat(turned);
        let bind = if has("bind-on-other-side") { rest } else { apply(&r, rest) };
        let moved = match inputs.translations[pose] {
            _ if has("translation-missing") => [0.0; 3],
            t if has("translation-before") => apply(&r, t),
            t => t,
        };
        joints.linear.push(r);
        joints.translation.push(add(sub(position, bind), moved));
        joints.quats.push(turned);
        at.push(position);
    }
    joints
}

fn gaussian(inputs: &Inputs, joints: &Joints, i: usize, has: &dyn Fn(&str) -> bool) -> Out {
    let mut row: Vec<(usize, f64)> = inputs.indices[i]
        .iter()
        .copied()
        .zip(inputs.weights[i].iter().copied())
        .filter(|(_, w)| *w > 0.0)
        .collect();
    if has("weights-cut-to-four") || has("weights-cut-not-normalised") {
        row.sort_by(|a, b| b.1.total_cmp(&a.1));
        row.truncate(4);
        let sum: f64 = row.iter().map(|r| r.1).sum();
        if has("weights-cut-to-four") {
            row.iter_mut().for_each(|r| r.1 /= sum);
        }
    }
    if has("weights-quantised") {
        row.iter_mut().for_each(|r| r.1 = (r.1 * 255.0).round() / 255.0);
        let sum: f64 = row.iter().map(|r| r.1).sum();
        row.iter_mut().for_each(|r| r.1 /= sum);
        row.retain(|r| r.1 > 0.0);
    }
    if has("weights-not-normalised") {
        // As painted: sums that differ from Gaussian to Gaussian.
        let sum = 0.9 + 0.2 * ((i * 7 % 11) as f64 / 11.0);
        row.iter_mut().for_each(|r| r.1 *= sum);
    }
    if has("weights-eleven-tenths") {
        row.iter_mut().for_each(|r| r.1 *= 1.1);
    }
    let mut mean = [0.0; 3];
    for &(j, w) in &row {
        let moved = add(apply(&joints.linear[j], inputs.means[i]), joints.translation[j]);
        mean = add(mean, moved.map(|c| c * w));
    }
    let mut own = inputs.quats[i];
    if has("canonical-xyzw") {
        own = [own[3], own[0], own[1], own[2]];
    }
    if has("canonical-conjugated") {
        own = conj(own);
    }
    let mut relative = blend(joints, &row, has);
    if has("dual-quaternions") {
        mean = dual_mean(joints, &row, inputs.means[i]);
    }
    if has("relative-conjugated") {
        relative = conj(relative);
    }
    let mut quat = if has("product-swapped") { mul(own, relative) } else { mul(relative, own) };
    if has("matrix-to-quaternion") {
        quat = from_matrix(&product(&blended(joints, &row), &mat(own)));
        relative = mul(quat, conj(own));
    }
    if has("gaussians-not-turned") {
        (quat, relative) = (own, [1.0, 0.0, 0.0, 0.0]);
    }
    if has("canonical-rotation-missing") {
        quat = relative;
    }
    if has("posed-conjugated") {
        quat = conj(quat);
    }
    let mut scale = inputs.log_scales[i].map(f64::exp);
    if has("scale-ignored") {
        scale = [1.0; 3];
    }
    if has("scale-ball") {
        scale = [inputs.log_scales[i].iter().sum::<f64>() / 3.0; 3].map(f64::exp);
    }
    let spread = match scale {
        _ if has("scale-not-activated") => inputs.log_scales[i],
        scale if has("activated-scale") => scale.map(f64::exp),
        scale => scale,
    };
    let r = if has("blended-matrix-not-projected") {
        product(&blended(joints, &row), &mat(own))
    } else if has("not-normalised-anywhere") {
        raw(quat)
    } else {
        mat(unit(quat))
    };
    let mut m = [[0.0; 3]; 3];
    for a in 0..3 {
        for b in 0..3 {
            m[a][b] = (0..3).map(|k| r[a][k] * spread[k] * spread[k] * r[b][k]).sum();
        }
    }
    let turn = mat(unit(relative));
    let away = sub(mean, inputs.eye);
    let length = (away[0] * away[0] + away[1] * away[1] + away[2] * away[2]).sqrt();
    let length = if has("direction-reversed") { -length } else { length };
    let away = away.map(|c| c / length);
    let direction = if has("not-normalised-anywhere") {
        apply(&transpose(&raw(relative)), away)
    } else if has("sh-not-turned") {
        away
    } else if has("sh-turned-backwards") || has("sh-backwards-and-not") {
        apply(&turn, away)
    } else {
        apply(&transpose(&turn), away)
    };
    let sh = colours(inputs, i, &turn, has);
    let covariance = [m[0][0], m[0][1], m[0][2], m[1][1], m[1][2], m[2][2]];
    let opacity = 1.0 / (1.0 + (-inputs.logits[i]).exp());
    let mut out = Out { mean, quat, scale: spread, covariance, direction, opacity, sh };
    finish(&mut out, has);
    out
}

/// One rotation from several.
fn blend(joints: &Joints, row: &[(usize, f64)], has: &dyn Fn(&str) -> bool) -> Q {
    let quats: Vec<Q> = row.iter().map(|&(j, _)| joints.quats[j]).collect();
    let sum = |aligned: bool| {
        let mut sum = [0.0; 4];
        for (q, &(_, w)) in quats.iter().zip(row) {
            let q = &if has("signs-from-matrices") { from_matrix(&mat(*q)) } else { *q };
            let sign = if aligned && dot(*q, quats[0]) < 0.0 { -1.0 } else { 1.0 };
            (0..4).for_each(|k| sum[k] += sign * w * q[k]);
        }
        sum
    };
    if has("signs-not-aligned") || has("signs-from-matrices") {
        return unit(sum(false));
    }
    if has("not-normalised") || has("not-normalised-anywhere") {
        return sum(true);
    }
    if has("normalised-sum") || has("dual-quaternions") {
        return unit(sum(true));
    }
    for (bug, rows, [first, second]) in GRAM_SCHMIDTS {
        if has(bug) {
            return orthonormal(blended(joints, row), rows, first, second);
        }
    }
    let mut a = [[0.0; 4]; 4];
    for (q, &(_, w)) in quats.iter().zip(row) {
        for r in 0..4 {
            for c in 0..4 {
                a[r][c] += w * q[r] * q[c];
            }
        }
    }
    for steps in [3, 6, 15] {
        if has(&format!("power-{steps}")) {
            let mut v = quats[0];
            for _ in 0..steps {
                v = unit(std::array::from_fn(|r| (0..4).map(|c| a[r][c] * v[c]).sum()));
            }
            return v;
        }
    }
    leading(a)
}

/// Which way a matrix is made orthonormal: over rows, and which two axes first.
const GRAM_SCHMIDTS: [(&str, bool, [usize; 2]); 5] = [
    ("gram-schmidt", false, [0, 1]),
    ("gram-schmidt-z-first", false, [2, 1]),
    ("gram-schmidt-y-z", false, [1, 2]),
    ("gram-schmidt-rows", true, [0, 1]),
    ("gram-schmidt-rows-z-first", true, [2, 0]),
];

fn orthonormal(b: M3, rows: bool, first: usize, second: usize) -> Q {
    let b = if rows { b } else { transpose(&b) };
    let x = unit3(b[first]);
    let y = b[second];
    let d = x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
    let y = unit3(sub(y, x.map(|c| c * d)));
    let cross =
        |x: V3, y: V3| [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
    let mut m = [[0.0; 3]; 3];
    (m[first], m[second]) = (x, y);
    let z = if (first + 1) % 3 == second { cross(x, y) } else { cross(y, x) };
    m[3 - first - second] = z;
    from_matrix(&if rows { m } else { transpose(&m) })
}

fn blended(joints: &Joints, row: &[(usize, f64)]) -> M3 {
    let mut b = [[0.0; 3]; 3];
    for &(j, w) in row {
        let r = mat(joints.quats[j]);
        (0..9).for_each(|k| b[k / 3][k % 3] += w * r[k / 3][k % 3]);
    }
    b
}

fn dual_mean(joints: &Joints, row: &[(usize, f64)], point: V3) -> V3 {
    let (mut real, mut dual) = ([0.0; 4], [0.0; 4]);
    let first = joints.quats[row[0].0];
    for &(j, w) in row {
        let q = joints.quats[j];
        let [x, y, z] = joints.translation[j];
        let d = mul([0.0, x / 2.0, y / 2.0, z / 2.0], q);
        let sign = if dot(q, first) < 0.0 { -w } else { w };
        (0..4).for_each(|k| (real[k] += sign * q[k], dual[k] += sign * d[k]).0);
    }
    let n = dot(real, real).sqrt();
    let (real, dual) = (real.map(|c| c / n), dual.map(|c| c / n));
    let [_, x, y, z] = mul(dual, conj(real));
    add(apply(&mat(real), point), [2.0 * x, 2.0 * y, 2.0 * z])
}

fn colours(inputs: &Inputs, i: usize, turn: &M3, has: &dyn Fn(&str) -> bool) -> Vec<V3> {
    let own = &inputs.sh[i];
    let right = turned(own, turn);
    if has("sh-not-turned") {
        return own.clone();
    }
    if has("sh-turned-backwards") {
        return turned(own, &transpose(turn));
    }
    if has("sh-backwards-and-not") {
        let back = turned(own, &transpose(turn));
        return (0..16).map(|k| if k < 4 { back[k] } else { own[k] }).collect();
    }
    if has("bgr-for-rgb") {
        return right.into_iter().map(|[r, g, b]| [b, g, r]).collect();
    }
    if has("sh-only-first-band-turned") {
        return (0..16).map(|k| if k < 4 { right[k] } else { own[k] }).collect();
    }
    let signed = |sh: &[V3], flipped: &dyn Fn(usize) -> bool| -> Vec<V3> {
        sh.iter().enumerate().map(|(k, c)| if flipped(k) { c.map(|v| -v) } else { *c }).collect()
    };
    let odd = |k: usize| [1, 3, 5, 7, 9, 11, 13, 15].contains(&k);
    if has("sh-basis-sign-out") {
        return signed(&right, &odd);
    }
    if has("sh-basis-sign-while") {
        return signed(&turned(&signed(own, &odd), turn), &odd);
    }
    right
}

/// Axes and orders of what is handed over.
fn finish(out: &mut Out, has: &dyn Fn(&str) -> bool) {
    if has("mirrored-handedness") {
        // x is mirrored: of vectors, of the axis of rotations (an axial vector), of products with one x, of SH that are odd in x.
        out.mean[0] *= -1.0;
        out.direction[0] *= -1.0;
        out.quat = [out.quat[0], out.quat[1], -out.quat[2], -out.quat[3]];
        out.covariance[1] *= -1.0;
        out.covariance[2] *= -1.0;
        [3, 4, 7, 10, 13, 15].iter().for_each(|&k: &usize| out.sh[k] = out.sh[k].map(|c| -c));
    }
    if has("mirrored-shape") {
        // As before, but for what the colour is made of.
        out.mean[0] *= -1.0;
        out.quat = [out.quat[0], out.quat[1], -out.quat[2], -out.quat[3]];
        out.covariance[1] *= -1.0;
        out.covariance[2] *= -1.0;
    }
    if has("y-up-for-z-up") {
        // (x, -z, y): everything in the world turns by 90 degrees about x.
        let [x, y, z] = out.mean;
        out.mean = [x, -z, y];
        let half = 0.5f64.sqrt();
        out.quat = mul([half, half, 0.0, 0.0], out.quat);
        let [xx, xy, xz, yy, yz, zz] = out.covariance;
        out.covariance = [xx, -xz, xy, zz, -yz, yy];
        out.sh = turned(&out.sh, &[[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]);
    }
    if has("xyzw-for-wxyz") {
        out.quat = [out.quat[1], out.quat[2], out.quat[3], out.quat[0]];
    }
}

/// JSON of an answer; only these fields.
pub fn json_of(outs: &Outs, fields: &[&str]) -> String {
    let all = |of: &dyn Fn(&Out) -> Value| -> Value {
        outs.iter().map(|pose| pose.iter().map(of).collect::<Vec<_>>()).collect()
    };
    let mut answer = json!({});
    for &field in fields {
        answer[field] = all(&|o| match field {
            "means" => json!(o.mean),
            "quaternions" => json!(o.quat),
            "scales" => json!(o.scale),
            "covariances" => json!(o.covariance),
            "directions" => json!(o.direction),
            "opacities" => json!(o.opacity),
            _ => json!(o.sh),
        });
    }
    answer.to_string()
}

/// Every number rounded to a half float, and widened again.
pub fn halved(outs: &Outs) -> Outs {
    let half = |v: &mut f64| {
        let step = 2f64.powi(v.abs().log2().floor().max(-14.0) as i32 - 10);
        *v = (*v / step).round_ties_even() * step;
    };
    let mut outs = outs.clone();
    for o in outs.iter_mut().flatten() {
        let fields = [&mut o.mean[..], &mut o.quat, &mut o.scale, &mut o.covariance, &mut o.direction];
        fields.into_iter().flatten().for_each(half);
        o.sh.iter_mut().flatten().for_each(half);
        half(&mut o.opacity);
    }
    outs
}

/// Every field.
pub const FIELDS: [&str; 7] =
    ["means", "quaternions", "scales", "covariances", "directions", "opacities", "sh"];
