//! Poses and motions: SMPL-style `.npz` and `.pkl` as the smplx package, AMASS, AIST++ and HUGS write them,
//! `transforms.json`, clips of a glTF file.
//!
//! Axis-angle values keep their place in the body that they are for: a part of SMPL-X that a file leaves out is zero, and the
//! fingers of an SMPL-H motion become those of an SMPL-X body. What had to be assumed or was not read is said
//! ([`PoseTrack::notes`], [`PoseTrack::notes_for`]).
//!
//! | written by | arrays |
//! |---|---|
//! | smplx, InstantAvatar, X-Humans | `global_orient`, `body_pose`, `jaw_pose`, `leye_pose`, `reye_pose`, `left_hand_pose`, `right_hand_pose` (axis-angle, or principal coefficients), `transl`, `betas`, `expression` |
//! | HUGS | the same with `scale`: `scale * LBS + transl` |
//! | AMASS | `poses` (72, 156 or 165 a frame) or `root_orient`, `pose_body`, `pose_hand`, `pose_jaw`, `pose_eye`; `trans`, `betas`, `gender`, `mocap_framerate` |
//! | AIST++ | `smpl_poses`, `smpl_trans`, `smpl_scaling`: in centimetres, scaled as HUGS's |
//! | this project | `thetas`, `transl`, `betas` |

mod angles;
mod names;
mod part;
mod read;

pub use angles::Hands;
pub use part::Part;

use super::body::Format;
use super::{Error, SourceDigest, Sourced, error, gltf};
use angles::{Angles, Track};
use glam::DVec3;
use serde::Deserialize;
use skinsplat_core::scene::{LocalTransform, Pose, Skeleton};
use std::path::{Path, PathBuf};

/// Poses as a file holds them. They become [`Pose`]s for a skeleton, whose rest offsets may follow from `betas` and
/// `expression`: shape the body first.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseTrack {
    /// Shape coefficients of the subject; empty if the file has none.
    pub betas: Vec<f64>,
    /// Coefficients of the facial expression (SMPL-X), the same in all frames; empty if the file has none.
    pub expression: Vec<f64>,
    /// As the file has it.
    pub gender: Option<String>,
    /// Poses per second, if the file says so.
    pub framerate: Option<f64>,
    notes: Vec<String>,
    path: PathBuf,
    keys: Keys,
}

#[derive(Clone, Debug, PartialEq)]
enum Keys {
    /// Axis-angle vectors, radians.
    Angles(Angles),
    /// Poses of a glTF file's own nodes, by name.
    Nodes { names: Vec<String>, poses: Vec<Pose>, source: SourceDigest },
}

/// Most poses of a file of angles: a small archive may hold many, all alike.
const MAX_POSES: usize = 1 << 18;

/// Farther translations (metres), larger scales and wider angles (radians) are no poses of a body: posed, they overflow 32 bits or mean nothing.
pub const FARTHEST: f64 = 1e6;

/// The first number of a pose that is beyond [`FARTHEST`] or not finite, and what it is.
fn beyond(pose: &Pose) -> Option<(&'static str, f64)> {
    let out = |v: &f64| v.is_nan() || v.abs() > FARTHEST;
    let of = |what, values: &[f64]| Some((what, *values.iter().find(|v| out(v))?));
    let local = |local: &LocalTransform| {
        of("translation", &local.translation.to_array())
            .or_else(|| of("rotation", &local.rotation.to_array()))
            .or_else(|| of("scale", &local.scale.to_array()))
    };
    of("translation", &pose.translation.to_array()).or_else(|| pose.locals.iter().find_map(local))
}

impl PoseTrack {
    /// A track of axis-angle values (radians) by part, frame after frame, with a translation (metres) per frame; either
    /// [`Part::Whole`] alone or other parts, each at most once. Principal coefficients of hands are told by their number
    /// per frame, which is not 45. `path` is the file that errors name.
    ///
    /// # Errors
    /// No part, a part that comes twice, values that do not fit the frames, or that are not finite.
    pub fn from_parts(
        path: &Path,
        betas: Vec<f64>,
        parts: Vec<(Part, Vec<f64>)>,
        translations: Vec<DVec3>,
    ) -> Result<Self, Error> {
        let frames = translations.len();
        if frames > MAX_POSES {
            let expected = format!("at most {MAX_POSES}, 36 minutes of 120 a second");
            return Err(Error::invalid(path, "poses", format!("{frames} of them"), expected));
        }
        let mut tracks: Vec<Track> = Vec::new();
        for (part, values) in parts {
            let width = values.len().checked_div(frames).unwrap_or(0);
            let principal = part.is_hand() && width != 45;
            let fits = width > 0 && width * frames == values.len() && (principal || width.is_multiple_of(3));
            if !fits || values.iter().any(|v| !v.is_finite()) {
                let problem = format!("{} values for {frames} frames", values.len());
                return Err(Error::invalid(
                    path,
                    part.name(),
                    problem,
                    "finite axis-angle triples, as many for each",
                ));
            }
            if tracks.iter().any(|own| own.part == part || own.part == Part::Whole) {
                return Err(Error::invalid(path, part.name(), "given twice", "each part once"));
            }
            tracks.push(Track { part, width, principal, values });
        }
        if tracks.is_empty() {
            return Err(Error::invalid(path, "thetas", "no part of a pose", "at least one"));
        }
        if let Some(i) = translations.iter().position(|t| !t.is_finite()) {
            return Err(Error::invalid(path, format!("transl[{i}]"), "NaN or infinite", "finite metres"));
        }
        let angles = Angles { tracks, translations, scales: Vec::new(), hands: None };
        Ok(Self::of(path, betas, Keys::Angles(angles)))
    }

    fn of(path: &Path, betas: Vec<f64>, keys: Keys) -> Self {
        Self {
            betas,
            expression: Vec::new(),
            gender: None,
            framerate: None,
            notes: Vec::new(),
            path: path.to_owned(),
            keys,
        }
    }

    /// With a scale per frame, or one of all: `x = scale * LBS + transl`. Clips of glTF files have scales of their own and
    /// stay as they are.
    ///
    /// # Errors
    /// Another number of scales, or one that is not finite and above 0.
    pub fn with_scales(mut self, scales: &[f64]) -> Result<Self, Error> {
        let frames = self.len();
        if scales.iter().any(|s| !(s.is_finite() && *s > 0.0)) || ![1, frames].contains(&scales.len()) {
            let problem = format!("{} values", scales.len());
            return Err(Error::invalid(
                &self.path,
                "scale",
                problem,
                format!("{frames} finite factors above 0, or one"),
            ));
        }
        if let Keys::Angles(angles) = &mut self.keys {
            let ones = scales.iter().all(|s| *s == 1.0);
            angles.scales =
                if ones { Vec::new() } else { scales.iter().copied().cycle().take(frames).collect() };
        }
        Ok(self)
    }

    /// With hands relative to the flat or to the mean hand, where the data set says which. By default parts follow the smplx
    /// package ([`Hands::Mean`]) and whole vectors AMASS ([`Hands::Flat`]).
    #[must_use]
    pub fn with_hands(mut self, hands: Hands) -> Self {
        if let Keys::Angles(angles) = &mut self.keys {
            angles.hands = Some(hands);
        }
        self
    }

    /// Several tracks one after the other, such as files of one pose each; shape and names are those of the first.
    ///
    /// # Errors
    /// No track, or one with other parts than the first.
    pub fn joined(path: &Path, tracks: Vec<Self>) -> Result<Self, Error> {
        let mut rest = tracks.into_iter();
        let Some(mut all) = rest.next() else {
            return Err(Error::invalid(path, "poses", "no file of poses", "at least one"));
        };
        all.path = path.to_owned();
        for track in rest {
            let source = track.path.clone();
            if track.betas != all.betas || track.expression != all.expression {
                let what = if track.betas == all.betas { "expression" } else { "betas" };
                let note = format!("{what}: not the same in all files; those of the first are used");
                if !all.notes.contains(&note) {
                    all.notes.push(note);
                }
            }
            let fits = match (&mut all.keys, track.keys) {
                (Keys::Angles(own), Keys::Angles(next)) => own.append(next),
                _ => false,
            };
            if !fits {
                return Err(Error::invalid(
                    source,
                    "poses",
                    "other parts than the first file",
                    "the same in all",
                ));
            }
            let news: Vec<String> =
                track.notes.into_iter().filter(|note| !all.notes.contains(note)).collect();
            all.notes.extend(news);
        }
        Ok(all)
    }

    /// Number of poses.
    pub fn len(&self) -> usize {
        match &self.keys {
            Keys::Angles(angles) => angles.len(),
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
            Keys::Angles(angles) => angles.num_joints(),
            Keys::Nodes { names, .. } => names.len(),
        }
    }

    /// What has to be said of the file, a clause each: arrays that were not read, what was assumed.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// [`PoseTrack::notes`], and what a body of this skeleton makes of the poses: parts that it has no joints for, hands.
    pub fn notes_for(&self, skeleton: &Skeleton) -> Vec<String> {
        let mut notes = self.notes.clone();
        if let Keys::Angles(angles) = &self.keys {
            notes.extend(angles.notes_for(&self.path, skeleton));
        }
        notes
    }

    /// The poses for a skeleton, with the digest of what the file stores of them. Parts keep their joints: on bodies of 24, 52
    /// and 55 joints (SMPL, SMPL-H, SMPL-X) every part of a pose has its place, whatever else the file holds; joints that
    /// the file does not mention keep their rest transform, and parts that the body has no joints for are left out (see
    /// [`PoseTrack::notes_for`]). For other bodies the joints of the file are the first ones.
    ///
    /// # Errors
    /// More joints in the file than in a skeleton of another family, hands by principal coefficients for a model without
    /// components, nodes of a glTF clip that the skeleton does not have, or numbers that no body survives ([`FARTHEST`]).
    pub fn poses(&self, skeleton: &Skeleton) -> Result<Sourced<Vec<Pose>>, Error> {
        let poses = self.poses_of(skeleton)?;
        match poses.iter().enumerate().find_map(|(frame, pose)| Some((frame, beyond(pose)?))) {
            None => Ok(poses),
            Some((frame, (what, number))) => {
                let expected = format!("finite angles, and {what}s of at most {FARTHEST:e}");
                let problem = format!("a {what} of {number:e}");
                Err(Error::invalid(&self.path, format!("poses[{frame}]"), problem, expected))
            }
        }
    }

    fn poses_of(&self, skeleton: &Skeleton) -> Result<Sourced<Vec<Pose>>, Error> {
        match &self.keys {
            Keys::Angles(angles) => angles.poses(&self.path, skeleton),
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

/// True if a file of arrays holds poses.
pub fn is_motion(file: &super::arrays::Arrays) -> bool {
    read::is_motion(file)
}

/// Loads the poses of a file: `.npz` or `.pkl` (see the table above), `transforms.json`, or a glTF file with a single clip.
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
        let notes = [rig.notes.clone(), clip.notes(&rig)].concat();
        let keys = Keys::Nodes { names: rig.body.rest.skeleton.names, poses, source };
        let mut track = PoseTrack::of(path, Vec::new(), keys);
        track.notes = notes;
        return Ok(track);
    }
    match clip {
        Some(name) => {
            Err(Error::invalid(path, "clip", format!("{name:?}, of a file without clips"), "no clip name"))
        }
        None if is_json => load_json(path),
        None => read::load(path),
    }
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
    if joints == 0 {
        return Err(Error::invalid(
            path,
            "poses",
            "no pose, or poses without joints",
            "at least one joint in one pose",
        ));
    }
    let thetas = track.poses.iter().flat_map(|p| p.thetas.iter().flatten().copied()).collect();
    let translations = track.poses.iter().map(|p| p.transl.into()).collect();
    PoseTrack::from_parts(path, track.betas, vec![(Part::Whole, thetas)], translations)
}
