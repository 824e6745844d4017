//! A motion from a file, drawn with the avatars of a run.
//!
//! Nobody photographed the subjects in these poses, so nothing is scored: pictures are all that comes of it. The shape stays
//! the subject's. A motion has a world of its own, so it is moved as a whole: in its first pose the first joint is where it is
//! in the first test frame of the row, turned and scaled as there, and the camera of that frame looks on.

use super::drawable::{Drawable, PosedView, Scratch};
use super::execute::{prepare_avatars, test_sequence};
use super::frame::Frame;
use super::looks::look;
use super::{Error, Event, Library};
use crate::experiment::{AvatarSource, Job, JobVariant, Plan, PlannedTable};
use glam::{DAffine3, DQuat, DVec3};
use rayon::prelude::*;
use skinsplat_core::scene::{LocalTransform, Pose, PosedBody, Skeleton};
use skinsplat_data::Sourced;
use skinsplat_data::frames::save_png;
use skinsplat_data::poses::{self, PoseTrack};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A motion from a file, and which of its poses are drawn.
#[derive(Debug)]
pub struct Motion {
    track: PoseTrack,
    path: PathBuf,
    every: usize,
}

impl Motion {
    /// Reads a motion, of which every `every`-th pose is drawn; of a glTF file with several, the clip of this name.
    ///
    /// # Errors
    /// As [`poses::load_clip`]; a motion without poses.
    pub fn load(path: &Path, clip: Option<&str>, every: usize) -> Result<Self, Error> {
        let track = poses::load_clip(path, clip)?;
        if track.is_empty() {
            return Err(skinsplat_data::Error::invalid(path, "poses", "none", "at least one").into());
        }
        Ok(Self { track, path: path.to_owned(), every: every.max(1) })
    }

    /// Makes the captions of a plan say what is drawn; returns what has to be said of the file on the subjects' bodies.
    ///
    /// # Errors
    /// A motion that fits the skeleton of no subject that takes part.
    pub fn announce(&self, plan: &mut Plan, library: &Library) -> Result<Vec<String>, Error> {
        let (mut notes, mut misfit, mut fits) = (BTreeSet::new(), None, false);
        for job in scenes(plan).into_iter().cloned().collect::<Vec<_>>() {
            let skeleton = &library.sequence(&job.dataset, &job.subject, &job.sequence)?.body.skeleton;
            let table = &mut plan.tables[job.table];
            match self.poses(skeleton) {
                Ok(_) => {
                    fits = true;
                    notes.extend(self.notes(skeleton));
                    let sentence = self.sentence();
                    if !table.remarks.contains(&sentence) {
                        table.remarks.push(sentence);
                    }
                }
                Err(problem) => {
                    table.remarks.push(format!("Motion: not drawn with {}: {problem}", job.subject));
                    misfit = misfit.or(Some(problem));
                }
            }
        }
        match misfit {
            Some(problem) if !fits => Err(problem),
            _ => Ok(notes.into_iter().collect()),
        }
    }

    /// The caption's sentence.
    fn sentence(&self) -> String {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        let poses = self.track.len().div_ceil(self.every);
        format!(
            "Motion: {poses} poses of {name} are drawn with the avatars, in motion/, from where the first test frame has the \
             subject; no image shows them, so they are not scored"
        )
    }

    fn notes(&self, skeleton: &Skeleton) -> Vec<String> {
        let mut notes = self.track.notes_for(skeleton);
        if !self.track.betas.is_empty() {
            notes.push("the shape (betas) of the motion is left: the subject's stays".to_owned());
        }
        notes.iter().map(|note| format!("{}: {note}", self.path.display())).collect()
    }

    fn poses(&self, skeleton: &Skeleton) -> Result<Sourced<Vec<Pose>>, Error> {
        Ok(self.track.poses(skeleton)?)
    }
}

/// Draws a motion with the avatars of a plan: `folder/<table>/<subject>/<variant>/frame_0000.png`, numbered as the file's
/// poses. Subjects whose skeleton it does not fit, and renders of other programs, are left out.
///
/// # Errors
/// An avatar or a frame that cannot be made, or a folder that cannot be written.
pub fn write(
    plan: &Plan,
    library: &Library,
    motion: &Motion,
    avatars: &Path,
    folder: &Path,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<(), Error> {
    let mut jobs: Vec<Job> = scenes(plan).into_iter().cloned().collect();
    for job in &mut jobs {
        job.variants.retain(|variant| moves(plan, variant));
    }
    let avatars = prepare_avatars(plan, &jobs, library, avatars, watch)?;
    for job in &jobs {
        let sequence = test_sequence(job, library)?;
        let skeleton = &sequence.body.skeleton;
        let Ok(track) = motion.poses(skeleton) else { continue };
        let scene = Frame::load(&sequence, job.frame, None)?;
        let poses: Vec<(usize, Pose)> =
            placed(&track, scene.view.pose, skeleton).into_iter().enumerate().step_by(motion.every).collect();
        let place = folder.join(place_of(&plan.tables[job.table], job));
        watch(Event::Frames(poses.len() * job.variants.len()));
        for variant in &job.variants {
            let avatar = avatars[&variant.avatar]
                .as_ref()
                .map_err(|problem| Error::Avatar { problem: problem.clone() })?;
            draw(avatar, (job, variant), &scene, &poses, &place.join(&variant.id), watch)?;
        }
    }
    Ok(())
}

/// The first job of each subject in each table.
fn scenes(plan: &Plan) -> Vec<&Job> {
    let mut seen = BTreeSet::new();
    plan.jobs.iter().filter(|job| seen.insert((job.table, &job.dataset, &job.subject))).collect()
}

/// True unless a variant's avatar is a folder of renders, which show the test frames and nothing else, or there is none.
fn moves(plan: &Plan, variant: &JobVariant) -> bool {
    let still =
        |source: &AvatarSource| matches!(source, AvatarSource::Renders(_) | AvatarSource::Missing { .. });
    plan.avatar(&variant.avatar).is_none_or(|avatar| !still(&avatar.source))
}

/// Where the pictures of a job's subject lie: subjects of several data sets may share a name.
fn place_of(table: &PlannedTable, job: &Job) -> PathBuf {
    let subject = match table.datasets.len() {
        1 => job.subject.clone(),
        _ => format!("{}-{}", job.dataset, job.subject),
    };
    Path::new(&table.experiment).join(subject)
}

/// The poses of a motion, moved so that the first puts the first joint where `start` has it.
fn placed(track: &[Pose], start: &Pose, skeleton: &Skeleton) -> Vec<Pose> {
    let Some(first) = track.first() else { return Vec::new() };
    let there = Similarity::of(first_joint(start, skeleton));
    let here = Similarity::of(first_joint(first, skeleton));
    let moved = there.after_undoing(&here);
    track.iter().map(|pose| moved.of_pose(pose, skeleton)).collect()
}

/// The first joint's transform in the world.
fn first_joint(pose: &Pose, skeleton: &Skeleton) -> DAffine3 {
    let world = skeleton.world_transforms(&pose.locals);
    DAffine3::from_translation(pose.translation) * world[0]
}

/// `x -> scale * (rotation x) + translation`.
struct Similarity {
    scale: f64,
    rotation: DQuat,
    translation: DVec3,
}

impl Similarity {
    /// The nearest to a joint's transform.
    fn of(transform: DAffine3) -> Self {
        let (scale, rotation, translation) = transform.to_scale_rotation_translation();
        Self { scale: scale.x.abs(), rotation: rotation.normalize(), translation }
    }

    /// `self * other^-1`.
    fn after_undoing(&self, other: &Self) -> Self {
        let scale = self.scale / other.scale;
        let rotation = (self.rotation * other.rotation.inverse()).normalize();
        let translation = self.translation - scale * (rotation * other.translation);
        Self { scale, rotation, translation }
    }

    fn of_point(&self, point: DVec3) -> DVec3 {
        self.scale * (self.rotation * point) + self.translation
    }

    /// A pose moved as a whole, its translation taken into its roots.
    fn of_pose(&self, pose: &Pose, skeleton: &Skeleton) -> Pose {
        let mut locals = pose.locals.clone();
        for (local, _) in locals.iter_mut().zip(&skeleton.parents).filter(|(_, parent)| parent.is_none()) {
            *local = LocalTransform {
                translation: self.of_point(local.translation + pose.translation),
                rotation: self.rotation * local.rotation,
                scale: self.scale * local.scale,
            };
        }
        Pose { locals, translation: DVec3::ZERO, ..pose.clone() }
    }
}

/// Draws one variant in every pose.
fn draw(
    avatar: &Drawable<'_>,
    (job, variant): (&Job, &JobVariant),
    scene: &Frame<'_>,
    poses: &[(usize, Pose)],
    folder: &Path,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<(), Error> {
    std::fs::create_dir_all(folder).map_err(|source| Error::Folder { path: folder.to_owned(), source })?;
    let look = look(job, variant, &scene.truth)?;
    poses.par_iter().try_for_each_init(Scratch::default, |scratch, (index, pose)| {
        let body = PosedBody::new(scene.view.body.rest, pose)?;
        let view = PosedView { pose, camera: scene.view.camera, body, name: "", stored: scene.view.stored };
        let drawn = avatar.draw(&view, &look, scratch)?;
        save_png(&folder.join(format!("frame_{index:04}.png")), &drawn.image)?;
        watch(Event::FrameDone(String::new()));
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_starts_where_the_subject_stands_and_keeps_its_course() {
        let joints = [DVec3::new(0.0, 1.0, 0.0), DVec3::new(0.0, 1.5, 0.0)];
        let skeleton = {
            let names = vec!["a".to_owned(), "b".to_owned()];
            Skeleton::from_joint_positions(names, vec![None, Some(0)], &joints).unwrap()
        };
        let pose = |turn: f64, translation| {
            Pose::from_axis_angles(&skeleton, &[DVec3::Y * turn, DVec3::X * turn], translation)
        };
        let start = pose(0.4, DVec3::new(0.2, 0.1, 3.0));
        let track = [pose(1.1, DVec3::new(5.0, 0.0, -2.0)), pose(1.3, DVec3::new(5.0, 0.3, -1.0))];
        let moved = placed(&track, &start, &skeleton);
        let off = first_joint(&moved[0], &skeleton) * first_joint(&start, &skeleton).inverse();
        assert!(off.abs_diff_eq(DAffine3::IDENTITY, 1e-12), "{off}");
        // From pose to pose the joints move as in the file, seen from the first joint.
        let step = |poses: &[Pose]| {
            let world = |pose: &Pose| {
                let world = skeleton.world_transforms(&pose.locals);
                DAffine3::from_translation(pose.translation) * world[1]
            };
            first_joint(&poses[0], &skeleton).inverse() * world(&poses[1])
        };
        assert!(step(&moved).abs_diff_eq(step(&track), 1e-12));
    }
}
