//! Gaussians without networks in torch files: dictionaries of tensors and graphdeco's `capture()`.
//!
//! Tensors are found by the last part of their name, wherever dictionaries nest them: those of 3DGS and its descendants
//! (`_xyz`, `_features_dc`, …, with or without the underscore), of gsplat (`splats.means`, `sh0`, …) and of nerfstudio
//! (`pipeline._model.gauss_params.means`, …). All keep log scales, logits and quaternions w, x, y, z.

use super::super::Error;
use super::super::npy::Array;
use super::super::torch::{Checkpoint, Tensors};
use super::start::Start;
use super::{Format, LoadedAvatar, Reader, haha};
use glam::Vec3;
use skinsplat_core::math::sh;
use skinsplat_core::scene::{Avatar, Binding, Gaussians};

pub(super) const READER: Reader = Reader { recognises: |start| start.has_entry("data.pkl"), read };

/// Names of a kind of tensor.
type Names = &'static [&'static str];

const MEANS: Names = &["_xyz", "xyz", "means", "means3D", "_means"];
const ROTATIONS: Names = &["_rotation", "rotation", "quats", "rotations", "unnorm_rotations"];
const SCALES: Names = &["_scaling", "scaling", "scales", "log_scales"];
const OPACITIES: Names = &["_opacity", "opacity", "opacities", "logit_opacities"];
const COLOURS: Names = &["_features_dc", "features_dc", "sh0", "f_dc"];
const BANDS: Names = &["_features_rest", "features_rest", "shN", "f_rest"];

/// Where graphdeco's `capture()` has what: (degree, xyz, dc, rest, scaling, rotation, opacity, …).
const CAPTURED: [(usize, &str); 6] = [
    (1, "_xyz"),
    (2, "_features_dc"),
    (3, "_features_rest"),
    (4, "_scaling"),
    (5, "_rotation"),
    (6, "_opacity"),
];

/// What a checkpoint of a method with networks has, and which exporter turns it into Gaussians.
const NETWORKS: [(&str, &str); 4] = [
    ("triplane", "hugs.py"),
    ("geometry_dec", "hugs.py"),
    ("deformer", "gs3davatar.py"),
    ("shEncoder", "animatable.py or ihuman.py"),
];

fn read(start: &Start) -> Result<LoadedAvatar, Error> {
    let mut checkpoint = Checkpoint::open(&start.path, "avatar")?;
    let mut tensors = checkpoint.tensors()?;
    if let Some(prefix) = tensors.prefix_of(haha::FACES) {
        return haha::read(&mut checkpoint, &tensors, &prefix);
    }
    captured(&mut tensors);
    let prefix = MEANS.iter().find_map(|name| tensors.prefix_of(name));
    let Some(prefix) = prefix else { return Err(without_gaussians(&checkpoint, &tensors, "_xyz")) };
    let gaussians = gaussians(&mut checkpoint, &tensors, &prefix)?;
    let avatar = Avatar { gaussians, binding: Binding::Static };
    avatar.validate(None).map_err(|e| Error::scene(&start.path, e))?;
    let mut loaded = LoadedAvatar::new(Format::Checkpoint, avatar, &start.path);
    let names = [MEANS, ROTATIONS, SCALES, OPACITIES, COLOURS, BANDS];
    let read =
        |name: &str| names.iter().flat_map(|names| names.iter()).any(|own| name == format!("{prefix}{own}"));
    loaded.ignored = tensors.names().filter(|name| !read(name)).map(str::to_owned).collect();
    loaded.notes.push("tensors of Gaussians in a torch checkpoint: log scales, logits".to_owned());
    if let Some(exporter) = exporter(&tensors) {
        loaded
            .notes
            .push(format!("networks beside them are left out ({exporter} writes an npz with what they add)"));
    }
    Ok(loaded)
}

/// Gives the tensors of a `capture()` their names.
fn captured(tensors: &mut Tensors) {
    for prefix in ["", "[0]"] {
        let is_capture = CAPTURED.iter().all(|(place, _)| tensors.contains(&format!("{prefix}[{place}]")));
        if is_capture {
            for (place, name) in CAPTURED {
                tensors.rename(&format!("{prefix}[{place}]"), name);
            }
            return;
        }
    }
}

/// The exporter for the method whose networks are among the tensors, if they are of one.
fn exporter(tensors: &Tensors) -> Option<String> {
    let has = |part: &str| tensors.names().any(|name| name.split(['.', '[']).any(|own| own == part));
    let (_, exporter) = NETWORKS.iter().find(|(part, _)| has(part))?;
    Some(format!("experiments/exporters/{exporter}"))
}

/// What is expected of a checkpoint whose tensors are not those of Gaussians.
fn expected(tensors: &Tensors, otherwise: &str) -> String {
    let npz = |exporter: String| format!("the npz that {exporter} writes: its Gaussians come from networks");
    exporter(tensors).map_or_else(|| otherwise.to_owned(), npz)
}

/// A tensor that every avatar has is missing.
fn without_gaussians(checkpoint: &Checkpoint, tensors: &Tensors, missing: &str) -> Error {
    let names = "tensors of Gaussians: _xyz, _features_dc, _opacity, _scaling, _rotation, or gsplat's or nerfstudio's names";
    let problem = format!("no such tensor among {}", tensors.shown());
    checkpoint.invalid(missing, problem, expected(tensors, names))
}

/// The one tensor of a kind beside the means.
fn named(
    checkpoint: &mut Checkpoint,
    tensors: &Tensors,
    prefix: &str,
    names: Names,
) -> Result<Option<Array>, Error> {
    let found = names.iter().map(|name| format!("{prefix}{name}")).find(|name| tensors.contains(name));
    found.map(|name| checkpoint.array(tensors, &name)).transpose()
}

fn gaussians(checkpoint: &mut Checkpoint, tensors: &Tensors, prefix: &str) -> Result<Gaussians, Error> {
    let mut rows = 0;
    let mut required = |checkpoint: &mut Checkpoint, names: Names, width: usize| {
        let Some(array) = named(checkpoint, tensors, prefix, names)? else {
            return Err(without_gaussians(checkpoint, tensors, &format!("{prefix}{}", names[0])));
        };
        let count = array.shape.first().copied().unwrap_or(0);
        rows = if rows == 0 { count } else { rows };
        if count != rows || count == 0 || array.values.len() != rows * width {
            let (name, problem) = (format!("{prefix}{}", names[0]), format!("shape {:?}", array.shape));
            let shape = format!("{} rows of {width}", rows.max(1));
            return Err(checkpoint.invalid(name, problem, expected(tensors, &shape)));
        }
        Ok(array.values)
    };
    let means = required(checkpoint, MEANS, 3)?;
    let rotations = required(checkpoint, ROTATIONS, 4)?;
    let scales = required(checkpoint, SCALES, 3)?;
    let opacities = required(checkpoint, OPACITIES, 1)?;
    let colours = required(checkpoint, COLOURS, 3)?;
    let bands = named(checkpoint, tensors, prefix, BANDS)?;
    let (sh_degree, sh) = with_bands(checkpoint, &colours, bands.as_ref(), &format!("{prefix}{}", BANDS[0]))?;
    let vectors = |values: &[f64]| -> Vec<Vec3> {
        values.chunks_exact(3).map(|v| Vec3::new(v[0] as f32, v[1] as f32, v[2] as f32)).collect()
    };
    Ok(Gaussians {
        means: vectors(&means),
        rotations: rotations.chunks_exact(4).map(|q| [0, 1, 2, 3].map(|k: usize| q[k] as f32)).collect(),
        log_scales: vectors(&scales),
        opacity_logits: opacities.iter().map(|&v| v as f32).collect(),
        sh_degree,
        sh,
    })
}

/// SH of all bands: `bands` (N, K - 1, 3) behind band 0.
fn with_bands(
    checkpoint: &Checkpoint,
    colours: &[f64],
    bands: Option<&Array>,
    name: &str,
) -> Result<(usize, Vec<[f32; 3]>), Error> {
    let n = colours.len() / 3;
    let rest = bands.map_or(&[][..], |bands| &bands.values);
    let per_gaussian = rest.len() / n;
    let degree = (0..=sh::MAX_DEGREE).find(|&degree| 3 * (sh::count(degree) - 1) == per_gaussian);
    let last_is_rgb = bands.is_none_or(|bands| bands.values.is_empty() || bands.shape.last() == Some(&3));
    let (Some(degree), true) = (degree.filter(|_| per_gaussian * n == rest.len()), last_is_rgb) else {
        let problem = format!("shape {:?}", bands.map(|bands| &bands.shape[..]).unwrap_or_default());
        return Err(checkpoint.invalid(name, problem, format!("({n}, 0, 3, 8 or 15, 3)")));
    };
    let triple = |c: &[f64]| [0, 1, 2].map(|k: usize| c[k] as f32);
    let count = sh::count(degree);
    let mut all = Vec::with_capacity(n * count);
    for i in 0..n {
        all.push(triple(&colours[3 * i..]));
        all.extend(rest[i * per_gaussian..(i + 1) * per_gaussian].chunks_exact(3).map(triple));
    }
    Ok((degree, all))
}
