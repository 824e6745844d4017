//! The training poses that a fit refined, as JSON beside its avatar.

use super::Error;
use serde::{Deserialize, Serialize};
use skinsplat_core::math::portable;
use skinsplat_data::{Sequence, atomic};
use skinsplat_fit::train::RefinedPose;
use std::io::Write;
use std::path::Path;

/// Version of the file's format.
const SCHEMA: u32 = 1;

/// The file.
#[derive(Debug, Serialize, Deserialize)]
struct File {
    schema: u32,
    /// The training sequence.
    sequence: String,
    /// Names of the skeleton's nodes, in the order of `rotations`.
    joints: Vec<String>,
    poses: Vec<Stored>,
}

/// One pose.
#[derive(Debug, Serialize, Deserialize)]
struct Stored {
    /// Names of the frames that show it.
    frames: Vec<String>,
    /// Per node, its rotation relative to its parent as axis times angle, radians: SMPL's `thetas`, where the rest pose turns
    /// no joint.
    rotations: Vec<[f64; 3]>,
    /// Metres: SMPL's `transl`.
    translation: [f64; 3],
    /// By how much the joint that turned most has turned from the given pose.
    turned_degrees: f64,
    /// Its fit diverged; this is the last good one.
    stopped: bool,
}

/// Writes the poses.
///
/// # Errors
/// A file that cannot be written.
pub(super) fn write(path: &Path, sequence: &Sequence, refined: &[RefinedPose]) -> Result<(), Error> {
    let stored = |own: &RefinedPose| Stored {
        frames: own.frames.clone(),
        rotations: own.pose.locals.iter().map(|l| portable::to_scaled_axis(l.rotation).to_array()).collect(),
        translation: own.pose.translation.to_array(),
        turned_degrees: own.turned_degrees,
        stopped: own.stopped,
    };
    let file = File {
        schema: SCHEMA,
        sequence: sequence.id.clone(),
        joints: sequence.body.skeleton.names.clone(),
        poses: refined.iter().map(stored).collect(),
    };
    let text = serde_json::to_string(&file).expect("every field serialises") + "\n";
    Ok(atomic::write(path, |w| w.write_all(text.as_bytes()))?)
}
