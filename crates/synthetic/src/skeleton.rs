//! The joints of the figure: an adult in T-pose, Y up, facing +Z, its left at +X, soles at y = 0.

use glam::DVec3;

/// How a figure differs from the reference adult.
#[derive(Clone, Copy, Debug)]
pub(super) struct Proportions {
    /// Standing height, metres.
    pub(super) height: f64,
    /// Factor on the thickness of torso and limbs.
    pub(super) girth: f64,
    /// Factor on the distance between the shoulders.
    pub(super) shoulders: f64,
}

/// Height of the reference adult, metres.
pub(super) const REFERENCE_HEIGHT: f64 = 1.74;
/// Shoulder joints of the reference adult are at ± this x.
const SHOULDER_X: f64 = 0.172;
/// Inside of this |x| a widening fades out.
const NECK_HALF_WIDTH: f64 = 0.06;
/// All arm joints lie on this line in T-pose.
pub(super) const ARM_Y: f64 = 1.415;
pub(super) const ARM_Z: f64 = -0.03;

/// SMPL's 24 joints: name, parent, position on the reference adult.
const BODY_JOINTS: [(&str, Option<usize>, [f64; 3]); 24] = [
    ("pelvis", None, [0.0, 0.945, -0.01]),
    ("left_hip", Some(0), [0.088, 0.90, -0.005]),
    ("right_hip", Some(0), [-0.088, 0.90, -0.005]),
    ("spine1", Some(0), [0.0, 1.05, -0.015]),
    ("left_knee", Some(1), [0.098, 0.50, -0.002]),
    ("right_knee", Some(2), [-0.098, 0.50, -0.002]),
    ("spine2", Some(3), [0.0, 1.17, -0.015]),
    ("left_ankle", Some(4), [0.104, 0.085, -0.03]),
    ("right_ankle", Some(5), [-0.104, 0.085, -0.03]),
    ("spine3", Some(6), [0.0, 1.26, -0.015]),
    ("left_foot", Some(7), [0.118, 0.03, 0.085]),
    ("right_foot", Some(8), [-0.118, 0.03, 0.085]),
    ("neck", Some(9), [0.0, 1.465, -0.03]),
    ("left_collar", Some(9), [0.075, 1.40, -0.025]),
    ("right_collar", Some(9), [-0.075, 1.40, -0.025]),
    ("head", Some(12), [0.0, 1.545, 0.0]),
    ("left_shoulder", Some(13), [SHOULDER_X, ARM_Y, ARM_Z]),
    ("right_shoulder", Some(14), [-SHOULDER_X, ARM_Y, ARM_Z]),
    ("left_elbow", Some(16), [0.435, ARM_Y, ARM_Z]),
    ("right_elbow", Some(17), [-0.435, ARM_Y, ARM_Z]),
    ("left_wrist", Some(18), [0.685, ARM_Y, ARM_Z]),
    ("right_wrist", Some(19), [-0.685, ARM_Y, ARM_Z]),
    ("left_hand", Some(20), [0.77, ARM_Y, ARM_Z]),
    ("right_hand", Some(21), [-0.77, ARM_Y, ARM_Z]),
];

/// A finger of the reference adult's left hand, metres.
pub(super) struct Finger {
    pub(super) name: &'static str,
    knuckle: [f64; 3],
    direction: [f64; 3],
    phalanges: [f64; 3],
    /// At the knuckle and at the tip, metres.
    pub(super) radii: [f64; 2],
}

pub(super) const FINGERS: [Finger; 5] = [
    Finger {
        name: "index",
        knuckle: [0.773, ARM_Y, 0.004],
        direction: [1.0, -0.03, 0.19],
        phalanges: [0.036, 0.024, 0.018],
        radii: [0.0096, 0.0074],
    },
    Finger {
        name: "middle",
        knuckle: [0.778, ARM_Y + 0.002, -0.020],
        direction: [1.0, -0.03, 0.02],
        phalanges: [0.040, 0.027, 0.019],
        radii: [0.0098, 0.0075],
    },
    Finger {
        name: "pinky",
        knuckle: [0.762, ARM_Y - 0.004, -0.064],
        direction: [1.0, -0.03, -0.37],
        phalanges: [0.028, 0.019, 0.015],
        radii: [0.0086, 0.0066],
    },
    Finger {
        name: "ring",
        knuckle: [0.773, ARM_Y, -0.043],
        direction: [1.0, -0.03, -0.15],
        phalanges: [0.037, 0.025, 0.018],
        radii: [0.0094, 0.0072],
    },
    Finger {
        name: "thumb",
        knuckle: [0.712, ARM_Y - 0.008, 0.006],
        direction: [0.72, -0.16, 0.68],
        phalanges: [0.034, 0.028, 0.022],
        radii: [0.0125, 0.0092],
    },
];

/// Joints of a figure: names, parents, rest positions.
#[derive(Clone, Debug)]
pub(super) struct Joints {
    pub(super) names: Vec<String>,
    pub(super) parents: Vec<Option<usize>>,
    pub(super) positions: Vec<DVec3>,
}

/// Where a point of the reference adult is on a figure of other proportions, and back.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement(pub(super) Proportions);

impl Placement {
    /// Metres per metre of the reference adult.
    pub(super) fn scale(self) -> f64 {
        self.0.height / REFERENCE_HEIGHT
    }

    /// Everything outside the neck moves with the shoulders; legs do not.
    fn widening(self, y: f64) -> f64 {
        (self.0.shoulders - 1.0) * SHOULDER_X * smoothstep(1.0, ARM_Y, y)
    }

    /// From the reference adult to this figure.
    pub(super) fn point(self, [x, y, z]: [f64; 3]) -> DVec3 {
        let widened = x + self.widening(y) * (x / NECK_HALF_WIDTH).clamp(-1.0, 1.0);
        DVec3::new(widened, y, z) * self.scale()
    }

    /// From this figure to the reference adult.
    pub(super) fn reference(self, point: DVec3) -> DVec3 {
        let point = point / self.scale();
        let widening = self.widening(point.y);
        let beyond = (point.x.abs() - NECK_HALF_WIDTH - widening).max(0.0);
        let x = if beyond > 0.0 {
            NECK_HALF_WIDTH + beyond
        } else {
            point.x.abs() / (1.0 + widening / NECK_HALF_WIDTH)
        };
        DVec3::new(x.copysign(point.x), point.y, point.z)
    }
}

/// 0 below `low`, 1 above `high`, C¹ between.
pub(super) fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// SMPL's 24 joints, or with `fingers` the 22 of its body and fifteen per hand (SMPL-X order: left then right; index,
/// middle, pinky, ring, thumb).
pub(super) fn figure_joints(proportions: Proportions, fingers: bool) -> Joints {
    let place = Placement(proportions);
    let body = &BODY_JOINTS[..if fingers { 22 } else { 24 }];
    let mut joints = Joints {
        names: body.iter().map(|j| j.0.to_owned()).collect(),
        parents: body.iter().map(|j| j.1).collect(),
        positions: body.iter().map(|j| place.point(j.2)).collect(),
    };
    if !fingers {
        return joints;
    }
    for (side, wrist, mirror) in [("left", 20, 1.0), ("right", 21, -1.0)] {
        for finger in &FINGERS {
            for (k, point) in finger.points()[..3].iter().enumerate() {
                let parent = if k == 0 { wrist } else { joints.names.len() - 1 };
                joints.names.push(format!("{side}_{}{}", finger.name, k + 1));
                joints.parents.push(Some(parent));
                joints.positions.push(place.point((*point * DVec3::new(mirror, 1.0, 1.0)).to_array()));
            }
        }
    }
    joints
}

impl Finger {
    /// Knuckle, the two joints and the tip.
    pub(super) fn points(&self) -> [DVec3; 4] {
        let direction = DVec3::from_array(self.direction).normalize();
        let mut point = DVec3::from_array(self.knuckle);
        let mut points = [point; 4];
        for (k, length) in self.phalanges.iter().enumerate() {
            point += direction * *length;
            points[k + 1] = point;
        }
        points
    }
}
