//! Pose sequences: SMPL-style `.npz`, `transforms.json`, clips of a glTF file.

use super::body::Format;
use super::npz::Archive;
use super::{Error, SourceDigest, Sourced, digest::Fingerprint, error, gltf};
use glam::DVec3;
use serde::Deserialize;
use skinsplat_core::scene::{Pose, Skeleton};
use std::path::{Path, PathBuf};

/// The parts of an SMPL or SMPL-X pose, in joint order.
const PARTS: [&str; 7] =
    ["global_orient", "body_pose", "jaw_pose", "leye_pose", "reye_pose", "left_hand_pose", "right_hand_pose"];

/// Poses as a file holds them. They become [`Pose`]s for a skeleton, whose rest offsets may follow from `betas`:
/// shape the body first.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseTrack {
    /// Shape coefficients of the subject; empty if the file has none.
    pub betas: Vec<f64>,
    path: PathBuf,
    keys: Keys,
}

#[derive(Clone, Debug, PartialEq)]
enum Keys {
    /// Axis-angle vectors (radians) per frame and joint, and a translation (metres) per frame.
    AxisAngles { rotations: Vec<Vec<DVec3>>, translations: Vec<DVec3> },
    /// Poses of a glTF file's own nodes, by name.
    Nodes { names: Vec<String>, poses: Vec<Pose>, source: SourceDigest },
}

impl PoseTrack {
    /// Number of poses.
    pub fn len(&self) -> usize {
        match &self.keys {
            Keys::AxisAngles { rotations, .. } => rotations.len(),
            Keys::Nodes { poses, .. } => poses.len(),
        }
    }

    /// True if there are no poses.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of joints or nodes that are posed.
    pub fn num_joints(&self) -> usize {
        match &self.keys {
            Keys::AxisAngles { rotations, .. } => rotations.first().map_or(0, Vec::len),
            Keys::Nodes { names, .. } => names.len(),
        }
    }

    /// The poses for a skeleton, with the digest of what the file stores of them. Joints that the file does not mention
    /// (an SMPL body pose without hands) keep their rest transform.
    ///
    /// # Errors
    /// More joints in the file than in the skeleton, or nodes of a glTF clip that the skeleton does not have.
    pub fn poses(&self, skeleton: &Skeleton) -> Result<Sourced<Vec<Pose>>, Error> {
        match &self.keys {
            Keys::AxisAngles { rotations, translations } => {
                let joints = self.num_joints();
                if joints > skeleton.num_joints() {
                    let expected = format!("at most the body's {} joints", skeleton.num_joints());
                    return Err(Error::invalid(&self.path, "thetas", format!("{joints} joints"), expected));
                }
                let pose = |(r, &t): (&Vec<DVec3>, &DVec3)| Pose::from_axis_angles(skeleton, r, t);
                let poses = rotations.iter().zip(translations).map(pose).collect();
                Ok(Sourced::computed(poses, of_angles(rotations, translations)))
            }
            Keys::Nodes { names, poses, source } if *names == skeleton.names => {
                Ok(Sourced::computed(poses.clone(), *source))
            }
            Keys::Nodes { names, poses, source } => self.retargeted(names, poses, *source, skeleton),
        }
    }

    fn retargeted(
        &self,
        names: &[String],
        poses: &[Pose],
        source: SourceDigest,
        skeleton: &Skeleton,
    ) -> Result<Sourced<Vec<Pose>>, Error> {
        let place = |name: &String| {
            names.iter().position(|n| n == name).ok_or_else(|| {
                let problem = format!("no node named {name:?}");
                Error::invalid(&self.path, "nodes", problem, "the names of the body's joints")
            })
        };
        let sources = skeleton.names.iter().map(place).collect::<Result<Vec<_>, _>>()?;
        let moved =
            |pose: &Pose| Pose { locals: sources.iter().map(|&s| pose.locals[s]).collect(), ..pose.clone() };
        let source = sources.iter().fold(source, |digest, &node| digest.and(node as u64));
        Ok(Sourced::computed(poses.iter().map(moved).collect(), source))
    }
}

/// The digest of angles and translations as a file stores them.
fn of_angles(rotations: &[Vec<DVec3>], translations: &[DVec3]) -> SourceDigest {
    let mut hash = Fingerprint::new();
    hash.count(rotations.len());
    rotations.iter().for_each(|frame| hash.vectors(frame));
    hash.vectors(translations);
    hash.finish()
}

/// Loads the poses of a file: `.npz`, `transforms.json`, or a glTF file with a single clip.
///
/// # Errors
/// Unknown formats, missing or inconsistent arrays, NaN or infinite values.
pub fn load(path: &Path) -> Result<PoseTrack, Error> {
    load_clip(path, None)
}

/// As [`load`], naming the clip of a glTF file with several. Clips are sampled at their own keys.
///
/// # Errors
/// As [`load`]; a clip that does not exist, or a name for a file that has no clips.
pub fn load_clip(path: &Path, clip: Option<&str>) -> Result<PoseTrack, Error> {
    let is_json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    if !is_json && Format::of(path)? == Format::Gltf {
        let rig = gltf::Rig::load(path)?;
        let clip = rig.clip(clip).map_err(|e| Error::scene(path, e))?;
        let poses = clip.key_poses(&rig).map_err(|e| Error::scene(path, e))?;
        let source = clip.digest(&rig);
        let keys = Keys::Nodes { names: rig.body.rest.skeleton.names, poses, source };
        return Ok(PoseTrack { betas: Vec::new(), path: path.to_owned(), keys });
    }
    match clip {
        Some(name) => {
            Err(Error::invalid(path, "clip", format!("{name:?}, of a file without clips"), "no clip name"))
        }
        None if is_json => load_json(path),
        None => load_npz(path),
    }
}

/// `thetas` (T, 3J), or the parts of SMPL (`global_orient`, `body_pose` 69) or SMPL-X (`body_pose` 63, `jaw_pose`,
/// `leye_pose`, `reye_pose`, `left_hand_pose` 45, `right_hand_pose` 45) concatenated; `transl` (T, 3); `betas` (B) or
/// the same row T times.
fn load_npz(path: &Path) -> Result<PoseTrack, Error> {
    let mut archive = Archive::open(path, "poses")?;
    let betas = betas(&mut archive)?;
    let parts: Vec<&str> = match archive.contains("thetas") {
        true => vec!["thetas"],
        false => PARTS
            .into_iter()
            .filter(|p| archive.contains(p) || ["global_orient", "body_pose"].contains(p))
            .collect(),
    };
    let mut rotations = axis_angles(&mut archive, parts[0])?;
    for part in &parts[1..] {
        let part = axis_angles(&mut archive, part)?;
        rotations.iter_mut().zip(part).for_each(|(frame, part)| frame.extend(part));
    }
    let translations = match archive.optional("transl", "T,3")? {
        Some(array) => array.values.chunks_exact(3).map(DVec3::from_slice).collect(),
        None => vec![DVec3::ZERO; rotations.len()],
    };
    let keys = Keys::AxisAngles { rotations, translations };
    Ok(PoseTrack { betas, path: path.to_owned(), keys })
}

/// A (T, 3k) array as k vectors per frame. Hands must be full axis-angle (45 values), not principal components.
fn axis_angles(archive: &mut Archive, name: &str) -> Result<Vec<Vec<DVec3>>, Error> {
    let array = archive.require(name, if name.ends_with("hand_pose") { "T,45" } else { "T,*" })?;
    let width = array.shape[1];
    if width == 0 || !width.is_multiple_of(3) {
        return Err(archive.invalid(name, format!("{width} values per frame"), "axis-angle triples"));
    }
    let frame = |row: &[f64]| row.chunks_exact(3).map(DVec3::from_slice).collect();
    Ok(array.values.chunks_exact(width).map(frame).collect())
}

fn betas(archive: &mut Archive) -> Result<Vec<f64>, Error> {
    if !archive.contains("betas") {
        return Ok(Vec::new());
    }
    let per_frame = archive.header("betas")?.shape.len() == 2;
    let array = archive.require("betas", if per_frame { "N,B" } else { "B" })?;
    let count = array.shape.last().copied().unwrap_or_default().max(1);
    let mut rows = array.values.chunks_exact(count);
    let first = rows.next().unwrap_or_default();
    if let Some(i) = rows.position(|row| row != first) {
        let field = format!("betas[{}]", i + 1);
        return Err(archive.invalid(field, "differs from betas[0]", "one shape for the whole sequence"));
    }
    Ok(first.to_vec())
}

/// The part of `transforms.json` that holds poses.
#[derive(Deserialize)]
struct JsonTrack {
    #[serde(default)]
    betas: Vec<f64>,
    poses: Vec<JsonPose>,
}

#[derive(Deserialize)]
struct JsonPose {
    time: usize,
    transl: [f64; 3],
    thetas: Vec<[f64; 3]>,
}

fn load_json(path: &Path) -> Result<PoseTrack, Error> {
    let track: JsonTrack = error::read_json(path, "poses", "betas and poses of {time, transl, thetas}")?;
    let joints = track.poses.first().map_or(0, |p| p.thetas.len());
    for (i, pose) in track.poses.iter().enumerate() {
        if pose.time != i {
            let field = format!("poses[{i}].time");
            return Err(Error::invalid(
                path,
                field,
                format!("{}", pose.time),
                format!("{i} (poses in order)"),
            ));
        }
        if pose.thetas.len() != joints {
            let field = format!("poses[{i}].thetas");
            return Err(Error::invalid(
                path,
                field,
                format!("{} joints", pose.thetas.len()),
                format!("{joints}"),
            ));
        }
    }
    let rotations = track.poses.iter().map(|p| p.thetas.iter().map(|&t| t.into()).collect()).collect();
    let translations = track.poses.iter().map(|p| p.transl.into()).collect();
    let keys = Keys::AxisAngles { rotations, translations };
    Ok(PoseTrack { betas: track.betas, path: path.to_owned(), keys })
}
