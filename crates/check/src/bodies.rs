//! Silhouettes of a sequence's body in poses that are not the frame's own.

use super::shadows::Shadow;
use super::{Seen, Shadows};
use glam::Vec3;
use rayon::prelude::*;
use skinsplat_core::scene::{Camera, PosedBody};
use skinsplat_data::Sequence;
use skinsplat_render::mesh::{Mesh, SamplePattern, silhouette};
use std::collections::BTreeMap;

/// A frame that shows both, body and mask.
pub(super) type Pair<'a> = (&'a Seen, &'a Shadows);

/// A body at the resolution of the comparison, to be put into any pose under any camera.
pub(super) struct Bodies<'a> {
    small: &'a Sequence,
    /// The first of the cameras that see the same as a camera.
    first_alike: Vec<usize>,
}

impl<'a> Bodies<'a> {
    pub(super) fn new(small: &'a Sequence) -> Self {
        let alike = |camera: &Camera| small.cameras.iter().position(|other| other == camera);
        let first_alike = small.cameras.iter().enumerate().map(|(i, c)| alike(c).unwrap_or(i)).collect();
        Self { small, first_alike }
    }

    /// How many poses there are, in the order of time.
    pub(super) fn poses(&self) -> usize {
        self.small.poses.len()
    }

    /// The pose that a frame has.
    pub(super) fn pose_of(&self, seen: &Seen) -> usize {
        self.small.frames[seen.index].pose
    }

    /// A camera that stands for all that see what a frame's camera sees.
    pub(super) fn camera_of(&self, seen: &Seen) -> usize {
        self.first_alike[self.small.frames[seen.index].camera]
    }

    /// A frame in a pose, by name.
    pub(super) fn name_of_pose(&self, pose: usize) -> String {
        let frame = self.small.frames.iter().find(|frame| frame.pose == pose);
        frame.map_or_else(|| format!("pose {pose}"), |frame| frame.name.clone())
    }

    /// Overlap of each frame's mask with the body in other poses: for each frame, of the poses `wanted(frame)`, in their order.
    pub(super) fn overlaps(
        &self,
        pairs: &[Pair<'_>],
        wanted: impl Fn(usize) -> Vec<usize>,
    ) -> Vec<BTreeMap<usize, f64>> {
        // A body is posed once, and drawn once under each camera.
        let mut by_pose: BTreeMap<usize, BTreeMap<usize, Vec<usize>>> = BTreeMap::new();
        for (i, (seen, _)) in pairs.iter().enumerate() {
            for pose in wanted(i) {
                by_pose.entry(pose).or_default().entry(self.camera_of(seen)).or_default().push(i);
            }
        }
        let by_pose: Vec<_> = by_pose.into_iter().collect();
        let measured: Vec<Vec<(usize, usize, f64)>> = by_pose
            .par_iter()
            .map(|(pose, cameras)| {
                let Some(vertices) = self.posed(*pose) else { return Vec::new() };
                let drawn = cameras.iter().filter_map(|(&camera, frames)| {
                    let shadow = self.drawn(&vertices, camera)?;
                    let overlap = |&i: &usize| (i, *pose, shadow.overlap(&pairs[i].1.mask).unwrap_or(0.0));
                    Some(frames.iter().map(overlap).collect::<Vec<_>>())
                });
                drawn.flatten().collect()
            })
            .collect();
        let mut overlaps = vec![BTreeMap::new(); pairs.len()];
        for (frame, pose, overlap) in measured.into_iter().flatten() {
            overlaps[frame].insert(pose, overlap);
        }
        overlaps
    }

    fn posed(&self, pose: usize) -> Option<Vec<Vec3>> {
        let body = PosedBody::new(&self.small.body, &self.small.poses[pose]).ok()?;
        Some(body.mesh().vertices.clone())
    }

    fn drawn(&self, vertices: &[Vec3], camera: usize) -> Option<Shadow> {
        let mesh = Mesh::new(vertices, &self.small.body.faces).ok()?;
        let mask = silhouette(&mesh, &self.small.cameras[camera], SamplePattern::new(2)).ok()?;
        Some(Shadow::of(&mask))
    }
}
