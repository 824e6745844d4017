//! Smooth skinning weights: every joint claims a share of what its parent holds, by position in the rest pose.
//!
//! The root holds everything; a joint takes from its parent the product of its gates (smooth steps across planes, or
//! around an axis). Shares are C¹ in position, at most a few joints hold anything at a point, and the sum is one by
//! construction.

use super::skeleton::{FINGERS, Joints, Placement, smoothstep};
use glam::DVec3;
use skinsplat_core::scene::{SceneError, SkinWeights};

/// Influences kept per vertex.
pub(super) const MAX_INFLUENCES: usize = 4;

/// A smooth indicator of a region of space.
#[derive(Clone, Copy, Debug)]
enum Gate {
    /// 0 below a plane, 1 above it, changing over ± `width` metres.
    Above { point: DVec3, normal: DVec3, width: f64 },
    /// 1 within `inner` metres of a line, 0 beyond `outer`.
    Around { point: DVec3, direction: DVec3, inner: f64, outer: f64 },
}

impl Gate {
    fn share(self, at: DVec3) -> f64 {
        match self {
            Self::Above { point, normal, width } => smoothstep(-width, width, (at - point).dot(normal)),
            Self::Around { point, direction, inner, outer } => {
                1.0 - smoothstep(inner, outer, (at - point).reject_from(direction).length())
            }
        }
    }
}

/// What a joint takes from its parent.
#[derive(Clone, Debug)]
pub(super) struct Claim {
    joint: usize,
    gates: Vec<Gate>,
}

/// Claims of the joints of a chain along +X, `width` metres of transition on either side of each joint.
pub(super) fn chain_claims(joints: &Joints, width: f64) -> Vec<Claim> {
    let claim = |joint: usize| Claim {
        joint,
        gates: vec![Gate::Above { point: joints.positions[joint], normal: DVec3::X, width }],
    };
    (1..joints.positions.len()).map(claim).collect()
}

/// Half widths of the transitions on the reference adult (metres) and the direction from parent to child flesh, for
/// left and middle joints.
const TRANSITIONS: [(&str, [f64; 3], f64); 14] = [
    ("hip", [0.32, -0.94, 0.0], 0.075),
    ("spine1", [0.0, 1.0, 0.0], 0.055),
    ("knee", [0.0, -1.0, 0.0], 0.065),
    ("spine2", [0.0, 1.0, 0.0], 0.05),
    ("ankle", [0.0, -1.0, 0.15], 0.032),
    ("spine3", [0.0, 1.0, 0.0], 0.045),
    ("foot", [0.0, -0.1, 1.0], 0.025),
    ("neck", [0.0, 1.0, 0.15], 0.035),
    ("collar", [1.0, 0.0, 0.0], 0.05),
    ("head", [0.0, 0.8, 0.6], 0.032),
    ("shoulder", [1.0, 0.1, 0.0], 0.052),
    ("elbow", [1.0, 0.0, 0.0], 0.048),
    ("wrist", [1.0, 0.0, 0.0], 0.034),
    ("hand", [1.0, 0.0, 0.0], 0.02),
];

/// Claims of the figure's joints; `softness` multiplies every transition.
pub(super) fn figure_claims(joints: &Joints, place: Placement, softness: f64) -> Vec<Claim> {
    let mut claims = Vec::new();
    for (joint, name) in joints.names.iter().enumerate().skip(1) {
        let mirror = if name.starts_with("right_") { -1.0 } else { 1.0 };
        let bare = name.trim_start_matches("left_").trim_start_matches("right_");
        if let Some(&(_, normal, width)) = TRANSITIONS.iter().find(|t| t.0 == bare) {
            let normal = DVec3::from_array(normal).normalize() * DVec3::new(mirror, 1.0, 1.0);
            let width = width * softness * place.scale();
            let mut gates = vec![Gate::Above { point: joints.positions[joint], normal, width }];
            gates.extend(side_gates(bare, mirror, place));
            claims.push(Claim { joint, gates });
        } else if let Some(gates) = finger_gates(joints, joint, bare, place, softness) {
            claims.push(Claim { joint, gates });
        }
    }
    claims
}

/// What keeps a claim to its own limb, where the plane through the joint also cuts other flesh.
fn side_gates(bare: &str, mirror: f64, place: Placement) -> Vec<Gate> {
    let above = |point: [f64; 3], normal: [f64; 3], width: f64| {
        let flip = DVec3::new(mirror, 1.0, 1.0);
        Gate::Above {
            point: place.point(point) * flip,
            normal: DVec3::from_array(normal).normalize() * flip,
            width: width * place.scale(),
        }
    };
    match bare {
        "hip" => vec![above([0.0; 3], [1.0, 0.0, 0.0], 0.03)],
        "neck" => vec![
            above([0.10, 1.46, 0.0], [-1.0, 0.5, 0.0], 0.03),
            above([-0.10, 1.46, 0.0], [1.0, 0.5, 0.0], 0.03),
        ],
        "collar" => vec![above([0.15, 1.315, 0.0], [0.6, 0.8, 0.0], 0.05)],
        _ => Vec::new(),
    }
}

fn finger_gates(
    joints: &Joints,
    joint: usize,
    bare: &str,
    place: Placement,
    softness: f64,
) -> Option<Vec<Gate>> {
    let (finger, phalanx) = bare.split_at_checked(bare.len().checked_sub(1)?)?;
    let finger = FINGERS.iter().find(|f| f.name == finger)?;
    let point = joints.positions[joint];
    let axis = finger.points();
    let mut direction = (axis[3] - axis[0]).normalize();
    direction.x = direction.x.copysign(point.x);
    let scale = place.scale();
    let mut gates = vec![Gate::Above { point, normal: direction, width: 0.011 * softness * scale }];
    if phalanx == "1" {
        let radius = finger.radii[0] * scale;
        gates.push(Gate::Around {
            point,
            direction,
            inner: 1.15 * radius,
            outer: 1.15 * radius + 0.008 * scale,
        });
    }
    Some(gates)
}

/// Rounds of averaging over the mesh: transitions between fingers are narrower than their web, and this widens them to
/// several edges along the surface.
const SMOOTHINGS: usize = 3;

/// Weights of every vertex: at most [`MAX_INFLUENCES`] joints, summing to one.
///
/// # Errors
/// Never for claims of the joints they were made from; the table checks itself.
pub(super) fn weigh(
    joints: &Joints,
    claims: &[Claim],
    vertices: &[DVec3],
    faces: &[[u32; 3]],
) -> Result<SkinWeights, SceneError> {
    let mut rows: Vec<Vec<f64>> = vertices.iter().map(|&vertex| claimed(joints, claims, vertex)).collect();
    let mut neighbours = vec![Vec::new(); vertices.len()];
    for face in faces {
        // Each edge of a closed mesh is seen once in this direction.
        (0..3).for_each(|k| neighbours[face[k] as usize].push(face[(k + 1) % 3] as usize));
    }
    for _ in 0..SMOOTHINGS {
        rows = rows.iter().zip(&neighbours).map(|(row, around)| smoothed(&rows, row, around)).collect();
    }
    SkinWeights::from_rows(rows.iter().map(|row| strongest(row)), joints.positions.len())
}

/// Half of a row and half of the mean of its neighbours.
fn smoothed(rows: &[Vec<f64>], row: &[f64], around: &[usize]) -> Vec<f64> {
    let share = 0.5 / around.len() as f64;
    let mut sum: Vec<f64> = row.iter().map(|w| 0.5 * w).collect();
    for &neighbour in around {
        sum.iter_mut().zip(&rows[neighbour]).for_each(|(s, w)| *s += share * w);
    }
    sum
}

/// The largest weights of a row, scaled to a sum of one.
fn strongest(row: &[f64]) -> Vec<(usize, f32)> {
    let mut row: Vec<(usize, f64)> = row.iter().copied().enumerate().filter(|h| h.1 > 1e-4).collect();
    row.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    row.truncate(MAX_INFLUENCES);
    let sum: f64 = row.iter().map(|r| r.1).sum();
    row.into_iter().map(|(joint, weight)| (joint, (weight / sum) as f32)).collect()
}

/// The share of every joint at a point of the rest pose.
fn claimed(joints: &Joints, claims: &[Claim], vertex: DVec3) -> Vec<f64> {
    let mut held = vec![0.0f64; joints.positions.len()];
    held[0] = 1.0;
    // Parents come before children; siblings claim at once, so that left and right are treated alike.
    for parent in 0..held.len() {
        if held[parent] == 0.0 {
            continue;
        }
        let of_parent = claims.iter().filter(|c| joints.parents[c.joint] == Some(parent));
        let shares: Vec<(usize, f64)> = of_parent
            .map(|claim| (claim.joint, claim.gates.iter().map(|g| g.share(vertex)).product()))
            .collect();
        let claimed: f64 = shares.iter().map(|s| s.1).sum();
        let available = held[parent];
        for (joint, share) in shares {
            held[joint] = available * share / claimed.max(1.0);
        }
        held[parent] = available * (1.0 - claimed).max(0.0);
    }
    held
}
