//! The poses of the training frames while they are fitted with the avatar.

use crate::options::PoseRefinement;
use crate::poses::{FreePose, PoseRates};
use serde::{Deserialize, Serialize};
use skinsplat_core::math::portable;
use skinsplat_core::scene::{Pose, PoseGradient, Skeleton};
use skinsplat_data::sequence::Sequence;
use std::collections::BTreeMap;

/// What every pose that was visited is turned and shifted by, by its place in the sequence. Frames of several cameras share theirs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct TrainingPoses(BTreeMap<usize, FreePose>);

/// The pose of a training frame as a fit leaves it.
#[derive(Clone, Debug, PartialEq)]
pub struct RefinedPose {
    /// Names of the frames that show it.
    pub frames: Vec<String>,
    /// The pose.
    pub pose: Pose,
    /// By how much the joint that turned most has turned from the given pose, degrees.
    pub turned_degrees: f64,
    /// It diverged, and is as it was before.
    pub stopped: bool,
}

impl TrainingPoses {
    /// True if every pose is of a skeleton with so many nodes.
    pub(super) fn are_for(&self, nodes: usize) -> bool {
        self.0.values().all(|free| free.is_for(nodes))
    }

    /// A pose as it stands.
    pub(super) fn applied(&self, index: usize, given: &Pose) -> Pose {
        self.0.get(&index).map_or_else(|| given.clone(), |free| free.applied(given))
    }

    /// One step of a pose; why it is fitted no further, if it is so from now on.
    pub(super) fn step(
        &mut self,
        index: usize,
        skeleton: &Skeleton,
        gradient: &PoseGradient,
        (options, rates): (&PoseRefinement, PoseRates),
    ) -> Option<String> {
        let new = || FreePose::new(skeleton.len(), options.moments);
        let free = self.0.entry(index).or_insert_with(new);
        free.step(skeleton, gradient, rates).err().map(|stopped| stopped.problem)
    }

    /// Every pose that frames of the sequence show, those included that no iteration looked at.
    pub(super) fn refined(&self, sequence: &Sequence) -> Vec<RefinedPose> {
        let mut frames: BTreeMap<usize, Vec<String>> = BTreeMap::new();
        for frame in &sequence.frames {
            frames.entry(frame.pose).or_default().push(frame.name.clone());
        }
        let refined = |(index, frames)| {
            let free = self.0.get(&index);
            RefinedPose {
                frames,
                pose: self.applied(index, &sequence.poses[index]),
                turned_degrees: free.map_or(0.0, FreePose::turned_degrees),
                stopped: free.is_some_and(FreePose::is_stopped),
            }
        };
        frames.into_iter().map(refined).collect()
    }
}

/// How far poses move at an iteration out of a number; not at all before their time.
pub(super) fn rates(options: &PoseRefinement, iteration: u32, iterations: u32) -> Option<PoseRates> {
    let last = f64::from(iterations.max(2) - 1);
    let first = f64::from(options.from) * f64::from(iterations);
    if f64::from(iteration) < first {
        return None;
    }
    let done = if last > first { (f64::from(iteration) - first) / (last - first) } else { 0.0 };
    let factor = portable::pow(f64::from(options.decay), done) as f32;
    Some(PoseRates {
        rotation: options.rate * factor,
        translation: options.translation_rate * factor,
        most_degrees: options.most_degrees,
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Trainer, start};
    use super::*;
    use crate::loss::{Losses, Weights};
    use crate::{FitOptions, Recipe};
    use glam::DVec3;
    use skinsplat_core::scene::{
        BodyGradient, Image, PosedBody, PosedGradient, Rendered, RenderedGradient, RestBody,
    };
    use skinsplat_posing::{BoundAvatar, Gradients, PoseOptions, Poser, Strategy};
    use skinsplat_render::View;
    use skinsplat_render::splat::{Derivatives, Renderer};
    use skinsplat_synthetic::{ArmShape, Parameters, Rig, Subject};

    /// Nothing of the avatar moves.
    const FROZEN: &str = "free.position=fixed+free.rotation=fixed+free.scale=fixed+free.opacity=false+rates.colour=0.0+rates.colour_rest=0.0";

    fn arm() -> Sequence {
        let rig = Rig::Arm(ArmShape::default());
        let parameters = Parameters { rig, resolution: 64, train_frames: 4, ..Parameters::default() };
        Subject::new(&parameters).expect("an arm").train().remove(0)
    }

    /// The loss of a frame, and its gradient with respect to the pose.
    fn loss(
        (bound, rest, strategy): (&BoundAvatar, &RestBody, &Strategy),
        gaussians: &skinsplat_core::scene::Gaussians,
        (sequence, frame): (&Sequence, usize),
        pose: &Pose,
    ) -> (f64, PoseGradient) {
        let (mut poser, mut renderer) = (Poser::new(), Renderer::new());
        let body = PosedBody::new(rest, pose).expect("a pose");
        let options = PoseOptions::default();
        let posed = poser.pose(bound, &body, strategy, &options).expect("posed").into_owned();
        let camera = &sequence.cameras[sequence.frames[frame].camera];
        let view = View::new(camera).over([1.0; 3]);
        let Rendered { image, alpha, .. } =
            renderer.render(&posed.as_posed(), &view).expect("rendered").clone();
        let truth = sequence.truth(frame).expect("a truth");
        let mut over = Image::filled(1, 1, [0.0; 3]);
        super::super::composite(&truth.rgb, &truth.alpha, [1.0; 3], &mut over);
        let mut upstream = RenderedGradient { image: Image::filled(1, 1, [0.0; 3]), alpha: None };
        let weights = Weights { ssim: 0.2, silhouette: 0.1 };
        let total =
            Losses::default().frame((&image, &alpha), (&over, &truth.alpha), &weights, &mut upstream).total;
        let (mut of_posed, mut of_body) = (PosedGradient::default(), BodyGradient::default());
        renderer
            .backward(&posed.as_posed(), &view, &upstream, &mut of_posed, Derivatives::Exact)
            .expect("back");
        of_body.reset(body.joints.len());
        let into = Gradients { body: Some(&mut of_body), ..Gradients::default() };
        poser.backward(bound, &body, strategy, &options, gaussians, &of_posed, into).expect("back");
        (total, body.pose_gradient(pose, &of_body).expect("the pose's body"))
    }

    /// From pixels to joints. Where a splat ends its alpha falls from 1/255 to nothing, and no derivative of a rasterizer follows
    /// that: the difference of the loss, which does, is off by about as many 255ths as splats overlap. That every station on the
    /// way has its exact derivative is tested where it is; what is tested here is that they are in each other's terms.
    #[test]
    fn a_step_follows_the_rendered_loss() {
        let sequence = arm();
        let options = |recipe: &str| FitOptions {
            recipe: Recipe::parse(recipe).expect("a recipe"),
            iterations: 10,
            seed: 0,
            edge_mm: 40,
        };
        let mut off = Vec::new();
        for recipe in [
            "animatable-skinned",
            "ihuman-original",
            "splattingavatar-original",
            "animatable-original",
            "haha",
        ] {
            let options = options(recipe);
            let avatar = start(&sequence, &options).expect("a start").avatar;
            let bound = BoundAvatar::new(&avatar, &sequence.body).expect("bound");
            let strategy: Strategy = options.recipe.strategy.parse().expect("a strategy");
            let skeleton = &sequence.body.skeleton;
            let turn = |node: usize| DVec3::new(0.03, -0.05, 0.04) * (1.0 + node as f64 * 0.3);
            let turns: Vec<DVec3> = (0..skeleton.len()).map(turn).collect();
            let at = sequence.poses[sequence.frames[1].pose].turned(&turns, DVec3::new(0.01, 0.0, -0.01));
            let of = |pose: &Pose| {
                loss((&bound, &sequence.body, &strategy), &avatar.gaussians, (&sequence, 1), pose)
            };
            let (_, gradient) = of(&at);
            let found: Vec<f64> =
                gradient.rotations.iter().chain([&gradient.translation]).flat_map(|v| v.to_array()).collect();
            let difference = |place: usize| {
                let slope = |h: f64| {
                    let ends = [h, -h].map(|h| {
                        let mut vectors = vec![DVec3::ZERO; skeleton.len() + 1];
                        vectors[place / 3][place % 3] = h;
                        of(&at.turned(&vectors[..skeleton.len()], vectors[skeleton.len()])).0
                    });
                    (ends[0] - ends[1]) / (2.0 * h)
                };
                (4.0 * slope(4e-3) - slope(8e-3)) / 3.0
            };
            let expected: Vec<f64> = (0..found.len()).map(difference).collect();
            let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|c| c * c).sum::<f64>().sqrt();
            let size = norm(&mut expected.iter().copied());
            let error = norm(&mut found.iter().zip(&expected).map(|(a, b)| a - b));
            off.push((recipe, error / size));
            assert!(size > 1e-3, "{recipe}");
        }
        assert!(off.iter().all(|(_, error)| *error < 0.25), "{off:?}");
    }

    /// Poses that were turned by hand come back, and are the same bits after an interruption.
    #[test]
    fn wrong_poses_are_found_and_survive_a_checkpoint() {
        let sequence = arm();
        let wrong = |(index, pose): (usize, &Pose)| {
            let sign = if index % 2 == 0 { 1.0 } else { -1.0 };
            pose.turned(&vec![DVec3::new(0.02, 0.06, -0.05) * sign; pose.locals.len()], DVec3::ZERO)
        };
        let poses: Vec<Pose> = sequence.poses.iter().enumerate().map(wrong).collect();
        let noisy = Sequence { poses: poses.into(), ..sequence.clone() };
        let recipe = Recipe::parse(&format!("animatable-skinned+poses=refine+pose.from=0.0+{FROZEN}"))
            .expect("a recipe");
        let options = FitOptions { recipe, iterations: 160, seed: 0, edge_mm: 40 };
        // The avatar is known: with a free one of four frames, either may give way.
        let avatar = start(&sequence, &options).expect("a start").avatar;
        let mut trainer = Trainer::new(&noisy, &options, avatar.clone()).expect("a trainer");
        let mut resumed = None;
        while !trainer.is_done() {
            trainer.step().expect("a step");
            if trainer.iteration == 100 {
                let bytes = postcard::to_stdvec(&trainer.checkpoint().expect("a checkpoint")).expect("bytes");
                let checkpoint = postcard::from_bytes(&bytes).expect("a checkpoint");
                resumed = Some(Trainer::resume(&noisy, &options, checkpoint).expect("resumed"));
            }
        }
        let mut resumed = resumed.expect("a checkpoint on the way");
        while !resumed.is_done() {
            resumed.step().expect("a step");
        }
        assert_eq!(resumed.poses(), trainer.poses());
        assert!(resumed.avatar() == trainer.avatar());
        let error = |poses: &[Pose]| {
            let of = |(own, true_pose): (&Pose, &Pose)| {
                let pairs = own.locals.iter().zip(&true_pose.locals);
                pairs.map(|(a, b)| portable::angle_between(a.rotation, b.rotation)).sum::<f64>()
            };
            poses.iter().zip(sequence.poses.iter()).map(of).sum::<f64>()
        };
        let refined: Vec<Pose> =
            trainer.poses().expect("they were fitted").into_iter().map(|own| own.pose).collect();
        let (before, after) = (error(&noisy.poses), error(&refined));
        // Turns about lines of sight are seen, those out of the image hardly: one camera looks.
        assert!(after < 0.85 * before, "{after} of {before}");
    }
}
