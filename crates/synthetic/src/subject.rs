//! A synthetic subject and its sequences.

use super::material::Material;
use super::motion::{self, Track};
use super::parameters::{Parameters, Rig};
use super::stage::{self, Role};
use super::truth::Model;
use super::{figure, parameters::GENERATOR_VERSION};
use skinsplat_core::scene::{Camera, Pose, RestBody, SceneError};
use skinsplat_data::Capture;
use skinsplat_data::{Error, FrameGenerator, FrameRef, FrameSource, Sequence, SourceDigest, Sourced, Truth};
use std::sync::Arc;

/// A subject: a body, and sequences whose images are rendered when asked for.
#[derive(Clone, Debug)]
pub struct Subject {
    parameters: Parameters,
    model: Arc<Model>,
}

impl Subject {
    /// Builds the body; no image is rendered.
    ///
    /// # Errors
    /// Parameters out of range, by name.
    pub fn new(parameters: &Parameters) -> Result<Self, SceneError> {
        parameters.validate()?;
        let model = Model {
            figure: figure::build(parameters)?,
            material: Material::new(parameters.look, parameters.seed),
            lights: parameters.lights,
            rig: parameters.rig,
            samples: parameters.samples,
        };
        Ok(Self { parameters: parameters.clone(), model: Arc::new(model) })
    }

    /// What it was made from.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The body in its rest pose (T-pose; an arm lies along +X).
    pub fn body(&self) -> &Arc<RestBody> {
        &self.model.figure.body
    }

    /// Sequences to fit on.
    pub fn train(&self) -> Vec<Sequence> {
        vec![self.sequence("train", self.training_poses(), Role::Train)]
    }

    /// Sequences to evaluate on.
    pub fn test(&self) -> Vec<Sequence> {
        let mut sequences = Vec::new();
        if self.parameters.capture == Capture::Multiview {
            sequences.push(self.sequence("test_novel_view", self.sampled_training_poses(), Role::Test));
        }
        let tracks: &[(&str, Track)] = match (self.parameters.rig, self.parameters.capture) {
            (Rig::Arm(_), _) => &[("test_twist", Track::ArmTwist), ("test_bend", Track::ArmBend)],
            (Rig::Figure(_), Capture::Hands) => &[("test_fingers", Track::Fingers)],
            (Rig::Figure(_), _) => &[("test_twist", Track::Twist), ("test_bend", Track::Bend)],
        };
        for &(id, track) in tracks {
            sequences.push(self.sequence(id, self.poses(track, self.parameters.test_frames), Role::Test));
        }
        sequences
    }

    /// All sequences, training first.
    pub fn sequences(&self) -> Vec<Sequence> {
        self.train().into_iter().chain(self.test()).collect()
    }

    fn poses(&self, track: Track, frames: u32) -> Vec<Pose> {
        motion::poses(track, &self.parameters.motion, self.parameters.seed, &self.body().skeleton, frames)
    }

    fn training_poses(&self) -> Vec<Pose> {
        let track = match (self.parameters.rig, self.parameters.capture) {
            (Rig::Arm(_), _) => Track::ArmTurn,
            (Rig::Figure(_), Capture::Monocular) => Track::Turn,
            (Rig::Figure(_), Capture::Multiview) => Track::Drill,
            (Rig::Figure(_), Capture::Hands) => Track::Gesture,
        };
        self.poses(track, self.parameters.train_frames)
    }

    /// As many training poses as tests have frames, evenly spread.
    fn sampled_training_poses(&self) -> Vec<Pose> {
        let poses = self.training_poses();
        let count = (self.parameters.test_frames as usize).min(poses.len());
        (0..count).map(|i| poses[i * poses.len() / count].clone()).collect()
    }

    /// Every pose seen by every camera of a role, camera by camera.
    fn sequence(&self, id: &str, poses: Vec<Pose>, role: Role) -> Sequence {
        let cameras = stage::cameras(&self.parameters, role);
        let key = format!("{} {id}", self.parameters.key());
        let source = SourceDigest::of_bytes(key.as_bytes());
        let take =
            Take { model: Arc::clone(&self.model), key, poses: poses.clone(), cameras: cameras.clone() };
        let generator: Arc<dyn FrameGenerator> = Arc::new(take);
        let frame = |frame: usize| {
            let (camera, pose) = (frame / poses.len(), frame % poses.len());
            let folder = if cameras.len() > 1 { format!("cam{camera:02}/") } else { String::new() };
            FrameRef {
                name: format!("{folder}image_{pose:04}"),
                time: pose,
                pose,
                camera,
                source: FrameSource::Generated { generator: Arc::clone(&generator), frame },
            }
        };
        let frames = (0..poses.len() * cameras.len()).map(frame).collect();
        Sequence {
            id: id.to_owned(),
            body: Arc::clone(self.body()),
            poses: Sourced::computed(poses, source),
            cameras: Sourced::computed(cameras, source),
            frames,
            stored_sizes: None,
        }
    }
}

/// The frames of one sequence: frame `camera * poses + pose`.
#[derive(Debug)]
struct Take {
    model: Arc<Model>,
    key: String,
    poses: Vec<Pose>,
    cameras: Vec<Camera>,
}

impl FrameGenerator for Take {
    /// # Panics
    /// If there is no such frame.
    fn truth(&self, frame: usize) -> Result<Truth, Error> {
        let (camera, pose) = (&self.cameras[frame / self.poses.len()], &self.poses[frame % self.poses.len()]);
        let drawing = self.model.draw(pose, camera);
        let drawing = drawing.expect("poses and cameras were made for this body from valid parameters");
        Ok(Truth::new(drawing.colour, drawing.coverage))
    }

    fn key(&self) -> Result<String, Error> {
        debug_assert!(self.key.starts_with(&format!("synthetic-v{GENERATOR_VERSION}-")));
        Ok(self.key.clone())
    }
}
