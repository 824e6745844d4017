//! Canonical Gaussians as named arrays: the neutral form in which methods with networks hand over what they fitted. The
//! README of this crate is its definition.

use super::super::npy::Array;
use super::super::npz::Archive;
use super::super::{Error, frames, ply};
use super::start::Start;
use super::{Canonical, CanonicalPose, Format, LoadedAvatar, Reader};
use glam::{DVec3, Vec3};
use skinsplat_core::math::{portable, sh};
use skinsplat_core::scene::{Avatar, Binding, FaceBinding, Gaussians, SkinWeights};

pub(super) const READER: Reader = Reader {
    recognises: |start| {
        start.has_entry("means.npy") && KEYS[1..6].iter().any(|key| start.has_entry(&format!("{key}.npy")))
    },
    read,
};

/// Every array that is read; the second to the sixth tell Gaussians from other archives with `means`.
const KEYS: [&str; 21] = [
    "means",
    "quats",
    "scales",
    "log_scales",
    "opacities",
    "logit_opacities",
    "sh",
    "rgb",
    "weights",
    "joint_indices",
    "joint_weights",
    "faces",
    "barycentric",
    "offsets",
    "canonical_pose",
    "canonical_transl",
    "betas",
    "method",
    "strategy",
    "body",
    "comment",
];

fn read(start: &Start) -> Result<LoadedAvatar, Error> {
    let path = &start.path;
    let mut archive = Archive::open(path, "avatar")?;
    let gaussians = gaussians(&mut archive)?;
    let mut notes = Vec::new();
    let binding = binding(&mut archive, gaussians.len(), &mut notes)?;
    let avatar = Avatar { gaussians, binding };
    avatar.validate(None).map_err(|e| Error::scene(path, e))?;
    let mut loaded = LoadedAvatar::new(Format::Npz, avatar, path);
    loaded.canonical = canonical(&mut archive)?;
    loaded.betas = archive.any_of("betas", &["B", "1,B"])?.map(|array| array.values);
    loaded.body = text(&mut archive, "body")?;
    if let Some(method) = text(&mut archive, "method")? {
        notes.push(format!("an avatar of {method}"));
    }
    if let Some(strategy) = text(&mut archive, "strategy")? {
        notes.push(format!("its method poses it by {strategy}"));
    }
    loaded.comments = archive.text("comment").ok().flatten().unwrap_or_default();
    loaded.ignored = archive.names().into_iter().filter(|name| !KEYS.contains(&name.as_str())).collect();
    if !loaded.ignored.is_empty() {
        notes.push(format!("arrays that were not read: {}", loaded.ignored.join(", ").escape_debug()));
    }
    loaded.notes = notes;
    Ok(loaded)
}

/// A string, in one line.
fn text(archive: &mut Archive, name: &str) -> Result<Option<String>, Error> {
    let lines = archive.text(name)?;
    Ok(lines.and_then(|lines| lines.into_iter().next()).map(|line| line.replace(char::is_control, " ")))
}

/// The one of two arrays that is there: the first, or the second.
fn either(
    archive: &mut Archive,
    [first, second]: [&str; 2],
    patterns: &[&str],
) -> Result<Result<Array, Array>, Error> {
    if archive.contains(first) && archive.contains(second) {
        let expected = format!("either {first} or {second}");
        return Err(archive.invalid(second, format!("there, and {first} too"), expected));
    }
    if let Some(array) = archive.any_of(second, patterns)? {
        return Ok(Err(array));
    }
    match archive.any_of(first, patterns)? {
        Some(array) => Ok(Ok(array)),
        None => {
            let expected = format!("an array ({}), or {second}", patterns[0]);
            Err(archive.invalid(first, "missing", expected))
        }
    }
}

fn gaussians(archive: &mut Archive) -> Result<Gaussians, Error> {
    let means = archive.require("means", "N,3")?;
    let n = means.shape[0];
    if n == 0 {
        return Err(archive.invalid("means", "no rows", "at least one Gaussian"));
    }
    let quats = archive.require("quats", "N,4")?;
    let (sh_degree, sh) = colours(archive, n)?;
    Ok(Gaussians {
        means: vectors(&means.values),
        rotations: quats.values.chunks_exact(4).map(|q| [0, 1, 2, 3].map(|k: usize| q[k] as f32)).collect(),
        log_scales: log_scales(archive, n)?,
        opacity_logits: logits(archive)?,
        sh_degree,
        sh,
    })
}

fn vectors(values: &[f64]) -> Vec<Vec3> {
    values.chunks_exact(3).map(|v| DVec3::from_slice(v).as_vec3()).collect()
}

/// `scales` (standard deviations) or `log_scales`, per axis or one for all.
fn log_scales(archive: &mut Archive, n: usize) -> Result<Vec<Vec3>, Error> {
    let logarithms = match either(archive, ["scales", "log_scales"], &["N,3", "N,1", "N"])? {
        Err(logarithms) => logarithms.values,
        Ok(linear) => {
            if let Some(i) = linear.values.iter().position(|s| s.is_nan() || *s < 0.0) {
                let row = i * n / linear.values.len();
                let problem = format!("{}", linear.values[i]);
                return Err(archive.invalid(format!("scales[{row}]"), problem, "metres, at least 0"));
            }
            linear.values.into_iter().map(portable::ln).collect()
        }
    };
    Ok(match logarithms.len() == n {
        true => logarithms.into_iter().map(|s| Vec3::splat(s as f32)).collect(),
        false => vectors(&logarithms),
    })
}

/// `opacities` within \[0, 1\] or `logit_opacities`.
fn logits(archive: &mut Archive) -> Result<Vec<f32>, Error> {
    match either(archive, ["opacities", "logit_opacities"], &["N", "N,1"])? {
        Err(logits) => Ok(logits.values.into_iter().map(|v| v as f32).collect()),
        Ok(linear) => {
            if let Some(i) = linear.values.iter().position(|o| !(0.0..=1.0).contains(o)) {
                let problem = format!("{}", linear.values[i]);
                return Err(archive.invalid(format!("opacities[{i}]"), problem, "0 to 1"));
            }
            Ok(linear.values.into_iter().map(ply::logit).collect())
        }
    }
}

/// What the brightest colour is stored as: 255 in bytes, else 1.
fn full_colour(archive: &mut Archive, rgb: &Array) -> Result<f64, Error> {
    if archive.header("rgb")?.descr.ends_with("u1") {
        return Ok(255.0);
    }
    match rgb.values.iter().find(|c| !frames::PLAUSIBLE.contains(c)) {
        None => Ok(1.0),
        Some(c) => Err(archive.invalid("rgb", format!("a colour of {c}"), "0 to 1, or bytes (uint8)")),
    }
}

/// `sh` (N, K, 3), or `rgb` (N, 3): the same from everywhere.
fn colours(archive: &mut Archive, n: usize) -> Result<(usize, Vec<[f32; 3]>), Error> {
    let triple = |c: &[f64]| [0, 1, 2].map(|k: usize| c[k] as f32);
    match either(archive, ["sh", "rgb"], &["N,K,3", "N,3"])? {
        Err(rgb) if rgb.shape.len() == 2 => {
            let full = full_colour(archive, &rgb)?;
            let band = |c: f64| (c / full - 0.5) / sh::C0;
            let coefficients: Vec<f64> = rgb.values.into_iter().map(band).collect();
            Ok((0, coefficients.chunks_exact(3).map(triple).collect()))
        }
        Err(rgb) => Err(archive.invalid("rgb", format!("shape {:?}", rgb.shape), "(N,3)")),
        Ok(sh) => {
            let count = if sh.shape.len() == 3 { sh.shape[1] } else { 1 };
            let Some(degree) = (0..=sh::MAX_DEGREE).find(|&degree| sh::count(degree) == count) else {
                let problem = format!("{count} coefficients of {n} Gaussians");
                return Err(archive.invalid("sh", problem, "1, 4, 9 or 16 (SH degree 0 to 3)"));
            };
            Ok((degree, sh.values.chunks_exact(3).map(triple).collect()))
        }
    }
}

fn binding(archive: &mut Archive, n: usize, notes: &mut Vec<String>) -> Result<Binding, Error> {
    if archive.contains("faces") {
        return face_binding(archive, n);
    }
    let (indices, weights) = match archive.optional("weights", "N,J")? {
        Some(weights) => (None, weights),
        None if archive.contains("joint_indices") || archive.contains("joint_weights") => {
            let indices = archive.require("joint_indices", "N,I")?;
            (Some(indices), archive.require("joint_weights", "N,I")?)
        }
        None => return Ok(Binding::Static),
    };
    let influences = weights.shape[1];
    let index = |at: usize| match &indices {
        None => Ok(at % influences),
        Some(indices) => integer(indices.values[at]).ok_or_else(|| {
            archive.invalid(
                format!("joint_indices[{}]", at / influences),
                format!("{}", indices.values[at]),
                "a joint's index",
            )
        }),
    };
    let joints = (0..weights.values.len()).map(index).collect::<Result<Vec<_>, _>>()?;
    let row = |i: usize| {
        let range = i * influences..(i + 1) * influences;
        let weights = weights.values[range.clone()].iter().map(|&w| w as f32);
        joints[range].iter().copied().zip(weights).filter(|(_, w)| *w != 0.0).collect()
    };
    let mut table: Vec<Vec<(usize, f32)>> = (0..n).map(row).collect();
    notes.extend(SkinWeights::normalise(&mut table).map(|note| format!("weights: {note}")));
    let table = SkinWeights::from_rows(table, usize::from(u16::MAX) + 1)
        .map_err(|e| Error::scene(archive.path(), e))?;
    Ok(Binding::Vertex(table))
}

fn face_binding(archive: &mut Archive, n: usize) -> Result<Binding, Error> {
    let faces = archive.require("faces", "N")?;
    let barycentric = archive.require("barycentric", "N,3")?;
    let offsets = archive.any_of("offsets", &["N,1", "N"])?;
    let face = |(i, &face): (usize, &f64)| {
        let expected = "the index of a face";
        integer(face)
            .and_then(|face| u32::try_from(face).ok())
            .ok_or_else(|| archive.invalid(format!("faces[{i}]"), format!("{face}"), expected))
    };
    Ok(Binding::Face(FaceBinding {
        faces: faces.values.iter().enumerate().map(face).collect::<Result<_, _>>()?,
        barycentric: vectors(&barycentric.values).iter().map(Vec3::to_array).collect(),
        offsets: offsets.map_or(vec![0.0; n], |array| array.values.iter().map(|&v| v as f32).collect()),
    }))
}

fn integer(value: f64) -> Option<usize> {
    ((0.0..=f64::from(u32::MAX)).contains(&value) && value.fract() == 0.0).then_some(value as usize)
}

fn canonical(archive: &mut Archive) -> Result<Canonical, Error> {
    let angles = archive.any_of("canonical_pose", &["P,3", "P"])?;
    let translation = archive.optional("canonical_transl", "3")?;
    let translation = translation.map_or(DVec3::ZERO, |t| DVec3::from_slice(&t.values));
    let angles = angles.map(|array| array.values).unwrap_or_default();
    if angles.len() % 3 != 0 {
        let problem = format!("{} values", angles.len());
        return Err(archive.invalid("canonical_pose", problem, "three per joint"));
    }
    if angles.iter().any(|v| !v.is_finite()) {
        return Err(archive.invalid("canonical_pose", "NaN or infinite", "radians"));
    }
    let axis_angles: Vec<DVec3> = angles.chunks_exact(3).map(DVec3::from_slice).collect();
    let rests = translation == DVec3::ZERO && axis_angles.iter().all(|angle| *angle == DVec3::ZERO);
    Ok(if rests { Canonical::Rest } else { Canonical::Pose(CanonicalPose { axis_angles, translation }) })
}
