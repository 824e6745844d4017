//! A motion that no body makes: every joint turned by nearly half a turn, where averages are nearly ties.

use glam::DVec3;
use skinsplat_core::math::portable;
use skinsplat_core::math::random::SplitMix64;
use skinsplat_core::scene::{Pose, Skeleton};

/// Seed of the axes and angles.
const SEED: u64 = 0x7ADE_0FF5_9EED_0180;
/// Joints stay between these from 180 degrees, evenly on a logarithmic scale.
const FROM_HALF_TURN: [f64; 2] = [0.01, 60.0];

/// A pose with every joint but the roots turned about a random axis by 120 to 179.99 degrees; roots and the translation
/// are those of `from`. The same for the same number.
pub(super) fn extreme(skeleton: &Skeleton, from: &Pose, number: usize) -> Pose {
    let mut random = SplitMix64::new(SEED ^ (number as u64).wrapping_mul(0x9E37_79B9));
    let mut pose = from.clone();
    for (node, local) in pose.locals.iter_mut().enumerate() {
        let axis = axis(&mut random);
        let [least, most] = FROM_HALF_TURN;
        let short_by = least * portable::pow(most / least, f64::from(random.unit_f32()));
        if skeleton.parents[node].is_some() && node < skeleton.num_joints() {
            let turn = portable::from_axis_angle(axis, (180.0 - short_by).to_radians());
            local.rotation = skeleton.rest_locals[node].rotation * turn;
        }
    }
    // Blend shapes that answer to such angles say nothing about rotations.
    pose.blend_shape_rotations = None;
    pose
}

/// A direction, evenly over the sphere.
fn axis(random: &mut SplitMix64) -> DVec3 {
    let z = 2.0 * f64::from(random.unit_f32()) - 1.0;
    let (sin, cos) = portable::sin_cos(std::f64::consts::TAU * f64::from(random.unit_f32()));
    let ring = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(ring * cos, ring * sin, z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    #[test]
    fn joints_turn_by_nearly_half_a_turn_and_roots_do_not() {
        let joints: Vec<DVec3> = (0..5).map(|i| DVec3::X * f64::from(i)).collect();
        let parents = (0..5_usize).map(|i| i.checked_sub(1)).collect();
        let skeleton =
            Skeleton::from_joint_positions(vec![String::new(); 5], parents, &joints).expect("a chain");
        let rest = Pose::rest(&skeleton);
        let pose = extreme(&skeleton, &rest, 3);
        assert_eq!(pose.locals[0], rest.locals[0]);
        for local in &pose.locals[1..] {
            let angle = local.rotation.angle_between(DQuat::IDENTITY).to_degrees();
            assert!((119.99..179.995).contains(&angle), "{angle}");
        }
        assert_eq!(pose, extreme(&skeleton, &rest, 3));
        assert_ne!(pose, extreme(&skeleton, &rest, 4));
    }
}
