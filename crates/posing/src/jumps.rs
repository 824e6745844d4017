//! Rotations that jump from one pose to the next.

use super::frame::{Frame, Visitor};
use super::lanes::{Lanes, take};
use super::layout::Chunk;
use super::options::PoseOptions;
use super::rotate::{BlockInput, Rotated};
use super::{BoundAvatar, ColourChoice, CovarianceChoice, PosingError, Strategy};
use rayon::prelude::*;
use skinsplat_core::math::rotation::angle_between;
use skinsplat_core::math::{Quaternion, portable};
use skinsplat_core::scene::PosedBody;

/// How many Gaussians turn, from one pose of a body to another, by over `margin` degrees more than any joint that they hang on
/// (with a weight above zero); those that hang on none may turn by `margin`. What turns a Gaussian is what its covariance is
/// drawn with and, where its SH are more than a constant, what they are turned by: either may jump. The signs of quaternions
/// do not matter.
///
/// A rotation that follows its joints continuously turns about as far as they do, but for joints nearly half a turn apart,
/// where averages turn fast. `None` for a strategy that turns nothing: covariances that are deformed, SH left alone.
///
/// # Errors
/// As [`Poser::pose`](super::Poser::pose), for either pose.
pub fn rotation_jumps(
    bound: &BoundAvatar,
    before: &PosedBody<'_>,
    after: &PosedBody<'_>,
    strategy: &Strategy,
    margin: f64,
) -> Result<Option<u64>, PosingError> {
    let reads = Reads::of(strategy, bound);
    if !bound.is_turned_by(strategy) {
        return Ok(None);
    }
    let [before_turned, after_turned] = [turned(bound, before, strategy)?, turned(bound, after, strategy)?];
    let pairs = before.joints.iter().zip(&after.joints);
    let joints: Vec<f64> =
        pairs.map(|(a, b)| portable::angle_between(a.rotation, b.rotation).to_degrees()).collect();
    let chunks = bound.chunks(strategy.covariance).par_iter().zip(before_turned).zip(after_turned);
    Ok(Some(chunks.map(|((chunk, a), b)| reads.jumps(chunk, &a, &b, &joints, margin)).sum()))
}

impl BoundAvatar {
    /// Whether a strategy turns anything of the avatar, covariances or SH: one that deforms covariances and leaves SH alone does
    /// not, and [`rotation_jumps`] has nothing to count.
    pub fn is_turned_by(&self, strategy: &Strategy) -> bool {
        let reads = Reads::of(strategy, self);
        reads.drawn || reads.colour
    }
}

/// Which rotations of a Gaussian can be seen.
#[derive(Clone, Copy)]
struct Reads {
    drawn: bool,
    colour: bool,
}

impl Reads {
    fn of(strategy: &Strategy, bound: &BoundAvatar) -> Self {
        let drawn = match strategy.covariance {
            CovarianceChoice::Rotate | CovarianceChoice::Surfel | CovarianceChoice::RotateByAverage => true,
            CovarianceChoice::Affine
            | CovarianceChoice::AffineConjugate
            | CovarianceChoice::PushForward
            | CovarianceChoice::PushForwardNormal => false,
        };
        let colour = match strategy.colour {
            ColourChoice::RotateSh | ColourChoice::ViewRotation => bound.sh_degree > 0,
            ColourChoice::None | ColourChoice::ViewBlend | ColourChoice::ViewBlendInverse => false,
        };
        Self { drawn, colour }
    }

    /// The jumps of a chunk, given its rotations before and after and the turns of the joints, degrees.
    fn jumps(self, chunk: &Chunk, before: &Turned, after: &Turned, joints: &[f64], margin: f64) -> u64 {
        let turn = |a: &Quaternion<f32>, b: &Quaternion<f32>| {
            angle_between(a.map(f64::from), b.map(f64::from)).to_degrees()
        };
        let mut count = 0;
        for block in &chunk.blocks {
            let (indices, weights) = chunk.influences(block);
            for lane in 0..block.count {
                let i = usize::from(block.index[lane]);
                let moving = indices.iter().zip(weights).filter(|(_, weight)| weight[lane] > 0.0);
                let widest = moving.map(|(&joint, _)| joints[usize::from(joint)]).fold(0.0, f64::max);
                let jumps = |seen: bool, a: &[Quaternion<f32>], b: &[Quaternion<f32>]| {
                    seen && turn(&a[i], &b[i]) > widest + margin
                };
                let jumped = jumps(self.drawn, &before.drawn, &after.drawn)
                    || jumps(self.colour, &before.relative, &after.relative);
                count += u64::from(jumped);
            }
        }
        count
    }
}

/// The rotations of a chunk's Gaussians, of any length.
struct Turned {
    /// What is drawn.
    drawn: Vec<Quaternion<f32>>,
    /// R.
    relative: Vec<Quaternion<f32>>,
}

/// The rotations of every chunk in a pose.
fn turned(
    bound: &BoundAvatar,
    body: &PosedBody<'_>,
    strategy: &Strategy,
) -> Result<Vec<Turned>, PosingError> {
    let options = PoseOptions::default();
    let frame = Frame::new(skinsplat_simd::arch(), bound, body, strategy, &options)?;
    let chunks = bound.chunks(strategy.covariance).par_iter().enumerate();
    let of_chunk = |(number, chunk): (usize, &Chunk)| {
        let count: usize = chunk.blocks.iter().map(|block| block.count).sum();
        let mut turned = Turned { drawn: vec![[0.0; 4]; count], relative: vec![[0.0; 4]; count] };
        frame.walk(chunk, number * super::layout::CHUNK, &mut turned);
        turned
    };
    Ok(chunks.map(of_chunk).collect())
}

impl Visitor for Turned {
    #[inline(always)]
    fn block(&mut self, _: usize, input: &BlockInput<'_>, rotated: &Rotated, _: &[Lanes; 3]) {
        for lane in 0..input.block.count {
            let i = usize::from(input.block.index[lane]);
            self.drawn[i] = take(&rotated.posed, lane);
            self.relative[i] = take(&rotated.relative, lane);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3};
    use skinsplat_core::scene::{Avatar, Binding, Gaussians, Pose, RestBody, Skeleton, SkinWeights};

    const MARGIN: f64 = 5.0;

    /// A bone with an elbow in it. Gaussians on the upper joint, on both (0.7 and 0.3), on the lower one.
    fn arm() -> (RestBody, Avatar) {
        let names = vec!["shoulder".to_owned(), "elbow".to_owned()];
        let skeleton =
            Skeleton::from_joint_positions(names, vec![None, Some(0)], &[DVec3::ZERO, DVec3::X]).unwrap();
        let rows = [vec![(0, 1.0)], vec![(0, 0.7), (1, 0.3)], vec![(1, 1.0)]];
        let weights = SkinWeights::from_rows(rows, 2).unwrap();
        let body = RestBody {
            skeleton,
            vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            faces: vec![[0, 1, 2]],
            weights: weights.clone(),
            uv: None,
            pose_directions: Vec::new(),
        };
        let gaussians = Gaussians {
            means: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; 3],
            log_scales: vec![Vec3::splat(-3.0); 3],
            opacity_logits: vec![0.0; 3],
            sh_degree: 0,
            sh: vec![[0.5; 3]; 3],
        };
        (body, Avatar { gaussians, binding: Binding::Vertex(weights) })
    }

    /// Jumps between two bends of the elbow, degrees.
    fn jumps(strategy: &str, bends: [f64; 2]) -> Option<u64> {
        let (body, avatar) = arm();
        let bound = BoundAvatar::new(&avatar, &body).unwrap();
        let pose = |bend: f64| {
            Pose::from_axis_angles(&body.skeleton, &[DVec3::ZERO, DVec3::Z * bend.to_radians()], DVec3::ZERO)
        };
        let poses = bends.map(pose);
        let [before, after] = poses.each_ref().map(|pose| PosedBody::new(&body, pose).unwrap());
        rotation_jumps(&bound, &before, &after, &strategy.parse().unwrap(), MARGIN).unwrap()
    }

    #[test]
    fn a_flip_of_the_branch_is_counted_and_an_average_is_not() {
        // Across half a turn the sum of the joints' quaternions as they come changes sides: 90 degrees, where joints turn 20.
        assert_eq!(jumps("engine-gaussian-vrm-ue5", [170.0, 190.0]), Some(1));
        assert_eq!(jumps("engine-gaussian-vrm-ue5", [100.0, 120.0]), Some(0));
        for strategy in ["quaternion-average", "lbs", "engine-babylon", "engine-spark+rotation=lifted-sum"] {
            assert_eq!(jumps(strategy, [100.0, 120.0]), Some(0), "{strategy}");
        }
        assert_eq!(jumps("quaternion-average", [170.0, 190.0]), Some(0));
    }

    #[test]
    fn what_is_not_turned_has_no_jumps() {
        assert_eq!(jumps("view-canonical", [0.0, 10.0]), None);
        assert_eq!(jumps("quaternion-average+covariance=affine", [0.0, 10.0]), None);
    }
}
