//! What everything is measured on: an avatar, its body, and two motions.

use super::exact::{Rig, Shot};
use super::{Error, motion, sweep};
use skinsplat_core::math::portable;
use skinsplat_core::scene::{Avatar, Binding, Camera, Image, Pose, Posed, RestBody, SceneError, SkinWeights};
use skinsplat_data::select::evenly_spaced;
use skinsplat_data::{Sequence, Subject};
use skinsplat_fit::recipe::{BindTo, Placement};
use skinsplat_fit::surface::{SurfaceInit, surface_init};
use skinsplat_posing::BoundAvatar;
use skinsplat_render::View;
use skinsplat_render::splat::render;
use std::sync::Arc;

/// How much is looked at.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Frames per motion.
    pub frames: usize,
    /// Longer side of the images, pixels.
    pub resolution: u32,
    /// Repeats behind each time.
    pub repeats: usize,
    /// Fewer solvers.
    pub quick: bool,
    /// At most so many Gaussians, evenly spaced and enlarged to cover what the others did.
    pub most_gaussians: Option<usize>,
    /// How the avatar is made, if none is given: one Gaussian per vertex or per face of the refined body.
    pub placement: Placement,
    /// Edges of the body are halved until none is longer, metres.
    pub longest_edge: f64,
    /// Training frames that colour it.
    pub training_frames: usize,
}

impl Options {
    /// About three minutes on two cores.
    pub fn standard() -> Self {
        Self {
            frames: 4,
            resolution: 512,
            repeats: 9,
            quick: false,
            most_gaussians: None,
            placement: Placement::Vertices,
            longest_edge: 0.014,
            training_frames: 24,
        }
    }

    /// A look in seconds: small images, few Gaussians, few repeats.
    pub fn quick() -> Self {
        Self {
            frames: 2,
            resolution: 128,
            repeats: 3,
            quick: true,
            most_gaussians: Some(2000),
            longest_edge: 0.06,
            training_frames: 6,
            ..Self::standard()
        }
    }
}

/// Frames of one kind of motion.
#[derive(Debug)]
pub(super) struct Motion {
    /// `test` or `extreme`.
    pub(super) id: &'static str,
    pub(super) shots: Vec<Shot>,
}

/// An avatar on its body, and the motions that it is put through.
#[derive(Debug)]
pub struct Stage {
    /// Data set and subject.
    pub name: String,
    pub(super) options: Options,
    pub(super) avatar: Avatar,
    pub(super) rig: Rig,
    pub(super) bound: BoundAvatar,
    pub(super) motions: [Motion; 2],
    /// Poses and cameras that the avatar was made from: what is pruned is judged by these.
    pub(super) training: Vec<(Pose, Camera)>,
}

/// Grey: neither a dark nor a bright splat at the outline is favoured.
const BACKGROUND: [f32; 3] = [0.5; 3];

impl Stage {
    /// Makes the avatar, unless one is given, and finds the exact rotations.
    ///
    /// # Errors
    /// A subject without training or test frames, an avatar that does not fit its body or does not move.
    pub fn new(
        name: &str,
        subject: &Subject,
        given: Option<Avatar>,
        options: &Options,
    ) -> Result<Self, Error> {
        let missing = |what: &str| Error::Subject {
            subject: name.to_owned(),
            problem: format!("no {what} frames"),
            expected: format!("a {what} sequence to measure on"),
        };
        let train = subject.train.first().filter(|s| !s.frames.is_empty());
        let tests: Vec<Sequence> = subject.test.iter().map(|s| s.reduced(options.resolution)).collect();
        let test_frames: Vec<(usize, usize)> =
            tests.iter().enumerate().flat_map(|(s, t)| (0..t.frames.len()).map(move |f| (s, f))).collect();
        let chosen = evenly_spaced(&test_frames, Some(options.frames));
        if chosen.is_empty() {
            return Err(missing("test"));
        }
        let body = Arc::clone(&tests[0].body);
        let training = match train {
            Some(train) => thinned(train, options)?,
            None if given.is_some() => tests[0].clone(),
            None => return Err(missing("training")),
        };
        let avatar = match given {
            Some(avatar) => avatar,
            None => made(&training, options)?,
        };
        if matches!(avatar.binding, Binding::Static) {
            return Err(Error::Subject {
                subject: name.to_owned(),
                problem: "the avatar has no binding and does not move".to_owned(),
                expected: "joint and weight properties, or face, barycentric and offset properties"
                    .to_owned(),
            });
        }
        avatar.validate(Some(&body))?;
        let avatar = match options.most_gaussians {
            Some(most) if most < avatar.gaussians.len() => {
                sparser(&avatar, most, body.skeleton.num_joints())?
            }
            _ => avatar,
        };
        let bound = BoundAvatar::new(&avatar, &body)?;
        let weights = weights_of(&avatar, &body)?;
        let rig = Rig::new(body, weights, &avatar.gaussians);
        let view = |&(s, f): &(usize, usize)| {
            let (sequence, frame) = (&tests[s], &tests[s].frames[f]);
            (sequence.poses[frame.pose].clone(), sequence.cameras[frame.camera].clone())
        };
        let views: Vec<(Pose, Camera)> = chosen.iter().map(view).collect();
        let shots = |turned: bool| {
            let shot = |(k, (pose, camera)): (usize, &(Pose, Camera))| {
                let pose = if turned { motion::extreme(&rig.body.skeleton, pose, k) } else { pose.clone() };
                Shot::new(&rig, &bound, pose, camera.clone())
            };
            views.iter().enumerate().map(shot).collect::<Result<Vec<_>, Error>>()
        };
        let motions =
            [Motion { id: "test", shots: shots(false)? }, Motion { id: "extreme", shots: shots(true)? }];
        let seen = |f: &skinsplat_data::FrameRef| {
            (training.poses[f.pose].clone(), training.cameras[f.camera].clone())
        };
        let training = evenly_spaced(
            &training.frames.iter().map(seen).collect::<Vec<_>>().iter().collect::<Vec<_>>(),
            Some(options.frames),
        )
        .into_iter()
        .cloned()
        .collect();
        Ok(Self { name: name.to_owned(), options: options.clone(), avatar, rig, bound, motions, training })
    }

    /// How frames are drawn.
    pub(super) fn view<'v>(&self, camera: &'v Camera) -> View<'v> {
        View::new(camera).over(BACKGROUND)
    }

    /// A frame, drawn.
    pub(super) fn image(&self, posed: &Posed, camera: &Camera) -> Result<Image, SceneError> {
        Ok(render(posed, &self.view(camera))?.image)
    }

    /// What the numbers come from.
    pub(super) fn ran_on(&self) -> Vec<String> {
        let gaussians = &self.avatar.gaussians;
        let camera = &self.motions[0].shots[0].camera;
        let [known, left_out] = self.motions.each_ref().map(|motion| {
            let ties = motion.shots.iter().map(|shot| shot.exact.iter().filter(|e| !e.unique).count());
            ties.sum::<usize>()
        });
        vec![
            format!("{}: {} Gaussians of SH degree {}", self.name, gaussians.len(), gaussians.sh_degree),
            format!(
                "{} frames of the test motion, and as many with every joint turned by 120 to 179.99 degrees (`extreme`), at {} x {}",
                self.motions[0].shots.len(),
                camera.width,
                camera.height
            ),
            format!(
                "the exact rotation is the average of Eq. 7 in f64 by Jacobi; Gaussians for which it is not unique are left out of angles: {known} of the test motion, {left_out} of the extreme one"
            ),
            "times are of one thread: median and quartiles".to_owned(),
        ]
    }
}

/// The training frames that are looked at.
fn thinned(train: &Sequence, options: &Options) -> Result<Sequence, Error> {
    let indices: Vec<usize> = (0..train.frames.len()).collect();
    Ok(train.selected(&evenly_spaced(&indices, Some(options.training_frames)))?.reduced(options.resolution))
}

fn made(training: &Sequence, options: &Options) -> Result<Avatar, Error> {
    let bind_to = match options.placement {
        Placement::Vertices => BindTo::Joints,
        Placement::Faces => BindTo::Faces,
    };
    let init = SurfaceInit {
        placement: options.placement,
        bind_to,
        sh_degree: 3,
        longest_edge: options.longest_edge,
        ..SurfaceInit::default()
    };
    Ok(surface_init(training, &init)?)
}

/// Some of the Gaussians, evenly spaced in their order, each as much larger in area as there are fewer.
fn sparser(avatar: &Avatar, most: usize, joints: usize) -> Result<Avatar, Error> {
    let all: Vec<usize> = (0..avatar.gaussians.len()).collect();
    let kept = evenly_spaced(&all, Some(most));
    let mut sparse = sweep::subset(avatar, &kept, joints)?;
    let wider = (0.5 * portable::ln(all.len() as f64 / kept.len() as f64)) as f32;
    sparse.gaussians.log_scales.iter_mut().for_each(|scale| *scale += wider);
    Ok(sparse)
}

/// The skinning weights of each Gaussian: its own, or those of its face.
fn weights_of(avatar: &Avatar, body: &RestBody) -> Result<SkinWeights, Error> {
    match &avatar.binding {
        Binding::Vertex(weights) => Ok(weights.clone()),
        Binding::Static => Ok(SkinWeights::from_rows(Vec::<Vec<(usize, f32)>>::new(), 1)?),
        Binding::Face(binding) => {
            let row = |(&face, barycentric): (&u32, &[f32; 3])| {
                let corners = body.faces[face as usize];
                let shares = barycentric.map(|b| f64::from(b).max(0.0));
                let sum: f64 = shares.iter().sum();
                body.weights.mixed(&[0, 1, 2].map(|k| (corners[k] as usize, shares[k] / sum)))
            };
            let rows = binding.faces.iter().zip(&binding.barycentric).map(row);
            Ok(SkinWeights::from_rows(rows, body.skeleton.num_joints())?)
        }
    }
}
