//! A rotation strategy of one's own: the exponential of the weighted sum of the joints' rotation vectors, against the
//! paper's average. Whoever computes one quaternion per Gaussian gets means, covariances and SH from the poser.
//!
//! `cargo run -p skinsplat-posing --example own_strategy`
#![expect(clippy::print_stdout, clippy::disallowed_methods, reason = "an example")]

use glam::{DQuat, DVec3, Vec3};
use skinsplat_core::math::rotation::angle_between;
use skinsplat_core::scene::{
    Avatar, Binding, Gaussians, Pose, PosedBody, RestBody, SceneError, Skeleton, SkinWeights,
};
use skinsplat_posing::{BoundAvatar, PoseOptions, Poser, PosingError, Strategy};

/// exp(Σ w log q): the strategy.
fn log_blend(body: &PosedBody<'_>, weights: &SkinWeights) -> Vec<[f32; 4]> {
    let rotation = |i: usize| {
        let (joints, weights) = weights.row(i);
        let turn = |(&joint, &weight): (&u16, &f32)| {
            body.joints[usize::from(joint)].rotation.to_scaled_axis() * f64::from(weight)
        };
        let blended = DQuat::from_scaled_axis(joints.iter().zip(weights).map(turn).sum::<DVec3>());
        [blended.w, blended.x, blended.y, blended.z].map(|c| c as f32)
    };
    (0..weights.len()).map(rotation).collect()
}

/// Two bones along x that meet at the origin, and eleven Gaussians across the joint.
fn elbow() -> Result<(RestBody, Avatar), SceneError> {
    let names = ["upper", "lower"].map(str::to_owned).to_vec();
    let skeleton = Skeleton::from_joint_positions(names, vec![None, Some(0)], &[-DVec3::X, DVec3::ZERO])?;
    let places: Vec<f32> = (0..11).map(|i| 0.1 * i as f32 - 0.5).collect();
    let weights = SkinWeights::from_rows(places.iter().map(|x| [(0, 0.5 - x), (1, 0.5 + x)]), 2)?;
    let n = places.len();
    let gaussians = Gaussians {
        means: places.iter().map(|&x| Vec3::X * x).collect(),
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; n],
        log_scales: vec![Vec3::splat(0.05f32.ln()); n],
        opacity_logits: vec![2.0; n],
        sh_degree: 1,
        sh: vec![[0.3; 3]; 4 * n],
    };
    let body = RestBody {
        skeleton,
        vertices: places.iter().map(|&x| DVec3::X * f64::from(x)).collect(),
        faces: Vec::new(),
        weights: weights.clone(),
        uv: None,
        pose_directions: Vec::new(),
    };
    Ok((body, Avatar { gaussians, binding: Binding::Vertex(weights) }))
}

fn main() -> Result<(), PosingError> {
    let (body, avatar) = elbow()?;
    let Binding::Vertex(weights) = &avatar.binding else { return Ok(()) };
    let bound = BoundAvatar::new(&avatar, &body)?;
    let turns = [DVec3::new(0.5, 0.0, 0.0), DVec3::new(0.0, 0.0, 2.4)];
    let posed_body = PosedBody::new(&body, &Pose::from_axis_angles(&body.skeleton, &turns, DVec3::ZERO))?;

    let strategy: Strategy = "quaternion-average".parse()?;
    let (mut poser, mut reference) = (Poser::new(), Poser::new());
    let own = log_blend(&posed_body, weights);
    let options = PoseOptions { rotations: Some(&own), ..PoseOptions::default() };
    let posed = poser.pose(&bound, &posed_body, &strategy, &options)?;
    let average = reference.pose(&bound, &posed_body, &strategy, &PoseOptions::default())?;
    for (i, mean) in posed.means.iter().enumerate() {
        let [a, b] = [posed, average].map(|p| p.rotations.map_or([0.0; 4], |q| q[i]).map(f64::from));
        let off = angle_between(a, b).to_degrees();
        println!("weight {:.1} at {mean:.2}: {off:5.2} degrees from the average", 0.1 * i as f32);
    }
    Ok(())
}
