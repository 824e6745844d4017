//! NeuMan's own poses: SMPL of each frame as `smpl_output_optimized.pkl` has it (written by joblib), and a matrix per image in
//! `alignments.npy` (a pickled dictionary, name to 4 x 3) that leads it into the scene: `X = [LBS, 1] A`.
//!
//! Rows of the first are indexed by the number that an image is called by, matrices by its name
//! (`data_io/neuman_helper.py` and `preprocess/export_alignment.py` of ml-neuman 0149d25).

use super::colmap::Registered;
use super::neuman::Bodies;
use crate::digest::Fingerprint;
use crate::npy::Array;
use crate::pickle::Pickle;
use crate::poses::{Part, PoseTrack};
use crate::{Error, Sourced, listing};
use glam::{DMat3, DQuat, DVec3};
use skinsplat_core::scene::{Pose, Skeleton};
use std::path::{Path, PathBuf};

/// What leads the poses of SMPL into the scene.
#[derive(Debug)]
pub(super) struct Places {
    /// The file of matrices.
    path: PathBuf,
    /// Per frame `X = linear LBS + translation`.
    maps: Vec<(DMat3, DVec3)>,
}

/// Reads both files.
///
/// # Errors
/// Missing or malformed files, several people, an image without a matrix or whose number has no pose.
pub(super) fn load(folder: &Path, captures: &[Registered]) -> Result<Bodies, Error> {
    let path = folder.join("smpl_output_optimized.pkl");
    if !path.is_file() {
        let expected =
            "4d_humans/smpl_optimized_aligned_scale.npz, or smpl_output_optimized.pkl and alignments.npy";
        return Err(Error::invalid(folder, "poses", "missing", expected));
    }
    let pickle = Pickle::read(&path, "poses")?;
    let people = pickle.root().keys()?;
    let [person] = &people[..] else {
        return Err(pickle.root().invalid(format!("{} people", people.len()), "one person"));
    };
    let person = pickle.get(person)?;
    let (all_poses, all_betas) = (person.get("pose")?.numbers("N,72")?, person.get("betas")?.numbers("N,*")?);
    let matrices = Pickle::read(&folder.join("alignments.npy"), "alignments")?;
    let (mut thetas, mut maps, mut betas) = (Vec::new(), Vec::new(), Vec::new());
    for capture in captures {
        let row = listing::number_of(Path::new(&capture.name)).filter(|row| *row < all_poses.shape[0]);
        let row = row.ok_or_else(|| {
            let problem = format!("{} poses, none of {}", all_poses.shape[0], capture.name);
            Error::invalid(&path, "pose", problem, "a row for the number of every image")
        })?;
        let values = matrices.get(&capture.name)?.numbers("4,3")?.values;
        let [x, y, z, translation] = [0, 3, 6, 9].map(|at| DVec3::from_slice(&values[at..]));
        thetas.extend_from_slice(&all_poses.values[72 * row..72 * (row + 1)]);
        maps.push((DMat3::from_cols(x, y, z), translation));
        betas.push(row_of(&all_betas, row));
    }
    let here = vec![DVec3::ZERO; captures.len()];
    let track = PoseTrack::from_parts(&path, Vec::new(), vec![(Part::Whole, thetas)], here)?;
    let places = Some(Places { path: matrices.path().to_owned(), maps });
    Ok(Bodies { path, betas, track, places })
}

/// A row of a matrix; its only one if there is one.
fn row_of(array: &Array, row: usize) -> Vec<f64> {
    let width = array.shape[1];
    let row = row.min(array.shape[0].saturating_sub(1));
    array.values[width * row..width * (row + 1)].to_vec()
}

/// A rotation with one scale, within this share of the scale: anything else bends a body.
const TOLERANCE: f64 = 1e-3;

impl Places {
    /// The poses of a body in the scene: the matrix moves into the root.
    ///
    /// # Errors
    /// A matrix that is no rotation with a scale.
    pub(super) fn applied(
        &self,
        inner: &Sourced<Vec<Pose>>,
        skeleton: &Skeleton,
    ) -> Result<Sourced<Vec<Pose>>, Error> {
        let mut poses = Vec::with_capacity(inner.len());
        for (i, (pose, &(linear, translation))) in inner.iter().zip(&self.maps).enumerate() {
            let Some((scale, rotation)) = similarity(linear) else {
                let problem = "a matrix that shears or mirrors";
                return Err(Error::invalid(
                    &self.path,
                    format!("poses alignments[{i}]"),
                    problem,
                    "a rotation with one scale",
                ));
            };
            poses.push(placed(pose.clone(), skeleton, scale, rotation, translation));
        }
        let mut hash = Fingerprint::new();
        hash.bytes(&inner.digest().0);
        for (linear, translation) in &self.maps {
            hash.numbers(linear.to_cols_array().into_iter().chain(translation.to_array()));
        }
        Ok(Sourced::computed(poses, hash.finish()))
    }
}

/// Scale and rotation of a matrix that is nothing else.
fn similarity(linear: DMat3) -> Option<(f64, DQuat)> {
    let scale = skinsplat_core::math::portable::cbrt(linear.determinant());
    if !(scale.is_finite() && scale > 0.0) {
        return None;
    }
    let rotation = linear * (1.0 / scale);
    let off = rotation.transpose() * rotation - DMat3::IDENTITY;
    let largest = off.to_cols_array().into_iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    (largest <= TOLERANCE).then(|| (scale, DQuat::from_mat3(&rotation).normalize()))
}

/// `scale rotation (body) + translation` of a body without translation.
fn placed(mut pose: Pose, skeleton: &Skeleton, scale: f64, rotation: DQuat, translation: DVec3) -> Pose {
    for (local, parent) in pose.locals.iter_mut().zip(&skeleton.parents) {
        if parent.is_none() {
            local.translation = rotation * (local.translation * scale);
            local.rotation = rotation * local.rotation;
            local.scale *= scale;
        }
    }
    pose.translation = rotation * (pose.translation * scale) + translation;
    pose
}
