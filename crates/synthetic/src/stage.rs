//! Where the cameras stand.

use super::parameters::{Parameters, Rig};
use glam::DVec3;
use skinsplat_core::math::portable::{cos, sin};
use skinsplat_core::scene::Camera;
use skinsplat_data::Capture;
use std::f64::consts::TAU;

/// Which cameras: those of the training sequence, or those of the tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// Training cameras.
    Train,
    /// Test cameras: between the training cameras where there are several.
    Test,
}

/// What a camera looks at, and half of what its image spans there, metres.
struct Framing {
    target: DVec3,
    half_extent: f64,
    distance: f64,
}

/// The cameras of a role. One camera stands in front; several stand in a ring, at alternating heights.
pub(super) fn cameras(parameters: &Parameters, role: Role) -> Vec<Camera> {
    let framing = framing(parameters);
    let side = parameters.resolution;
    let focal = f64::from(side) / 2.0 * framing.distance / framing.half_extent;
    let camera = |azimuth: f64, elevation: f64| {
        let direction =
            DVec3::new(sin(azimuth) * cos(elevation), sin(elevation), cos(azimuth) * cos(elevation));
        let eye = framing.target + direction * framing.distance;
        Camera::look_at(eye, framing.target, DVec3::Y, focal, side, side)
    };
    if parameters.capture != Capture::Multiview {
        return vec![camera(0.0, 0.06)];
    }
    let trained = f64::from(parameters.train_cameras);
    match role {
        Role::Train => (0..parameters.train_cameras)
            .map(|i| camera(TAU * f64::from(i) / trained, if i % 2 == 0 { 0.05 } else { 0.32 }))
            .collect(),
        Role::Test => (0..parameters.test_cameras)
            .map(|i| {
                // Spread over the ring, in the middle between two training cameras.
                let gap = (f64::from(i) * trained / f64::from(parameters.test_cameras)).floor() + 0.5;
                camera(TAU * gap / trained, 0.18)
            })
            .collect(),
    }
}

fn framing(parameters: &Parameters) -> Framing {
    match parameters.rig {
        Rig::Arm(arm) => {
            Framing { target: DVec3::ZERO, half_extent: 0.6 * arm.length, distance: 3.0 * arm.length }
        }
        Rig::Figure(figure) => match parameters.capture {
            Capture::Hands => {
                let target = DVec3::Y * 0.76 * figure.height;
                Framing { target, half_extent: 0.27 * figure.height, distance: 1.0 * figure.height }
            }
            Capture::Monocular | Capture::Multiview => {
                let target = DVec3::Y * 0.49 * figure.height;
                Framing { target, half_extent: 0.55 * figure.height, distance: 1.9 * figure.height }
            }
        },
    }
}
