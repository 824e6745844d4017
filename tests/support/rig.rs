//! A small deterministic body, poses and avatars for the tests of strategies.
#![allow(dead_code, reason = "each test binary uses a part of this module")]

use glam::{DQuat, DVec3, Vec3};
use skinsplat_core::math::average::Solver;
use skinsplat_core::math::rotation::SignPolicy;
use skinsplat_core::scene::{Avatar, Binding, FaceBinding, Gaussians, Pose, RestBody, Skeleton, SkinWeights};
use skinsplat_posing::{ColourChoice, CovarianceChoice, PRESETS, Preset, RotationChoice, Strategy};

pub(crate) const JOINTS: usize = 5;
const RINGS: usize = 21;
const SEGMENTS: usize = 6;

/// Deterministic numbers in \[-1, 1).
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub(crate) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

/// A tube along x with a joint every 20 cm; its vertices hang on one to four joints.
pub(crate) fn body() -> RestBody {
    let positions: Vec<DVec3> = (0..JOINTS).map(|j| DVec3::X * 0.2 * j as f64).collect();
    let parents = (0..JOINTS).map(|j| j.checked_sub(1)).collect();
    let skeleton = Skeleton::from_joint_positions(vec![String::new(); JOINTS], parents, &positions).unwrap();
    let (mut vertices, mut faces, mut rows) = (Vec::new(), Vec::new(), Vec::new());
    let mut noise = Noise(11);
    for ring in 0..RINGS {
        let x = ring as f64 / (RINGS - 1) as f64;
        for segment in 0..SEGMENTS {
            let angle = segment as f64 / SEGMENTS as f64 * std::f64::consts::TAU;
            let radius = 0.1 + 0.01 * noise.next();
            vertices.push(DVec3::new(x, radius * angle.cos(), radius * angle.sin()));
            let nearest = ((x * 5.0) as usize).min(JOINTS - 1);
            let count = 1 + (ring + segment / 3) % 4;
            let raw: Vec<f64> = (0..count).map(|_| 1.1 + noise.next()).collect();
            let sum: f64 = raw.iter().sum();
            let joint = |k: usize| (nearest + k) % JOINTS;
            rows.push(raw.iter().enumerate().map(|(k, w)| (joint(k), (w / sum) as f32)).collect::<Vec<_>>());
            if ring + 1 < RINGS {
                let at = |r: usize, s: usize| (r * SEGMENTS + s % SEGMENTS) as u32;
                let [a, b, c, d] = [
                    at(ring, segment),
                    at(ring, segment + 1),
                    at(ring + 1, segment),
                    at(ring + 1, segment + 1),
                ];
                faces.extend([[a, c, b], [b, c, d]]);
            }
        }
    }
    let weights = SkinWeights::from_rows(rows, JOINTS).unwrap();
    RestBody { skeleton, vertices, faces, weights, uv: None, pose_directions: Vec::new() }
}

/// The same tube with weights that change smoothly along it, three joints at most: for what reads how they change.
pub(crate) fn smooth_body() -> RestBody {
    let mut body = body();
    let row = |x: f64| {
        let near = |j: usize| (1.0 - (x - 0.2 * j as f64).abs() / 0.35).max(0.0).powi(2);
        let sum: f64 = (0..JOINTS).map(near).sum();
        (0..JOINTS).map(|j| (j, (near(j) / sum) as f32)).filter(|(_, w)| *w > 0.0).collect::<Vec<_>>()
    };
    let rows: Vec<_> = body.vertices.iter().map(|v| row(v.x)).collect();
    body.weights = SkinWeights::from_rows(rows, JOINTS).unwrap();
    body
}

/// True if a strategy reads how weights change along the surface.
pub(crate) fn pushes(strategy: &Strategy) -> bool {
    let by_covariance =
        matches!(strategy.covariance, CovarianceChoice::PushForward | CovarianceChoice::PushForwardNormal);
    by_covariance || matches!(strategy.rotation, RotationChoice::PushForward(_))
}

/// Every joint turned by up to `bend` radians about each axis.
pub(crate) fn bent(body: &RestBody, seed: u64, bend: f64) -> Pose {
    let mut noise = Noise(seed);
    let angles: Vec<DVec3> = (0..JOINTS).map(|_| noise.vector() * bend).collect();
    Pose::from_axis_angles(&body.skeleton, &angles, noise.vector())
}

/// The pose followed by the world motion x' = Q x + t.
pub(crate) fn moved(pose: &Pose, rotation: DQuat, translation: DVec3) -> Pose {
    let mut moved = pose.clone();
    moved.locals[0].rotation = rotation * pose.locals[0].rotation;
    moved.locals[0].translation = rotation * pose.locals[0].translation;
    moved.translation = rotation * pose.translation + translation;
    moved
}

/// The pose with every joint scaled by a factor of its own, 0.5 to 2, on its own part of the body and those beyond.
pub(crate) fn scaled(pose: &Pose, seed: u64) -> Pose {
    let mut noise = Noise(seed);
    let mut scaled = pose.clone();
    for local in &mut scaled.locals {
        local.scale = DVec3::splat(2f64.powf(noise.next() * 0.4));
    }
    scaled
}

pub(crate) fn gaussians(means: Vec<Vec3>, seed: u64, sh_degree: usize) -> Gaussians {
    let mut noise = Noise(seed);
    let n = means.len();
    Gaussians {
        rotations: (0..n).map(|_| [0; 4].map(|_| noise.next() as f32)).collect(),
        log_scales: (0..n).map(|_| (noise.vector() - 5.0).as_vec3()).collect(),
        opacity_logits: (0..n).map(|_| noise.next() as f32).collect(),
        sh_degree,
        sh: (0..n * (sh_degree + 1).pow(2)).map(|_| [0; 3].map(|_| noise.next() as f32)).collect(),
        means,
    }
}

/// `n` Gaussians near the body with the weights of some vertex.
pub(crate) fn on_vertices(body: &RestBody, n: usize, seed: u64) -> Avatar {
    let mut noise = Noise(seed);
    let (mut means, mut rows) = (Vec::new(), Vec::new());
    for _ in 0..n {
        let vertex = ((noise.next() + 1.0) * 0.5 * body.vertices.len() as f64) as usize;
        means.push((body.vertices[vertex] + noise.vector() * 0.01).as_vec3());
        let (joints, weights) = body.weights.row(vertex);
        rows.push(joints.iter().map(|&j| usize::from(j)).zip(weights.iter().copied()).collect::<Vec<_>>());
    }
    let weights = SkinWeights::from_rows(rows, JOINTS).unwrap();
    Avatar { gaussians: gaussians(means, seed, 3), binding: Binding::Vertex(weights) }
}

/// `n` Gaussians on faces of the body.
pub(crate) fn on_faces(body: &RestBody, n: usize, seed: u64) -> Avatar {
    let mut noise = Noise(seed);
    let mut binding = FaceBinding::default();
    let mut means = Vec::new();
    let normals = skinsplat_core::scene::body::vertex_normals(&body.vertices, &body.faces);
    for _ in 0..n {
        let face = ((noise.next() + 1.0) * 0.5 * body.faces.len() as f64) as usize;
        let (a, b) = (0.25 + 0.25 * noise.next(), 0.25 + 0.25 * noise.next());
        let barycentric = [1.0 - a - b, a, b].map(|c| c as f32);
        let offset = (noise.next() * 0.02) as f32;
        let mix = |values: &[DVec3]| -> DVec3 {
            body.faces[face].iter().zip(barycentric).map(|(&v, b)| values[v as usize] * f64::from(b)).sum()
        };
        means.push((mix(&body.vertices) + mix(&normals).normalize() * f64::from(offset)).as_vec3());
        binding.faces.push(face as u32);
        binding.barycentric.push(barycentric);
        binding.offsets.push(offset);
    }
    Avatar { gaussians: gaussians(means, seed, 3), binding: Binding::Face(binding) }
}

/// Every rotation choice with the presets' other choices, and every other choice with the presets' rotations.
pub(crate) fn strategies() -> Vec<Strategy> {
    // Seeds of tests follow the order: new choices come last.
    let is_new = |strategy: &Strategy| {
        pushes(strategy)
            || [RotationChoice::LiftedSum, RotationChoice::JointSum].contains(&strategy.rotation)
            || strategy.covariance == CovarianceChoice::RotateByAverage
    };
    let (engines, presets): (Vec<&Preset>, Vec<&Preset>) =
        PRESETS.iter().partition(|preset| preset.is_engine());
    let mut all: Vec<Strategy> = presets.iter().map(|preset| preset.strategy).collect();
    all.extend(RotationChoice::named().flat_map(variants));
    for id in ["closed-form", "eigen", "polar", "power-15", "nlerp", "squaring-6", "vertex-average-eigen"] {
        all.extend(variants(id.parse().unwrap()));
    }
    for preset in presets {
        all.extend(ColourChoice::ALL.map(|colour| Strategy { colour, ..preset.strategy }));
        all.extend(CovarianceChoice::ALL.map(|covariance| Strategy { covariance, ..preset.strategy }));
    }
    let (new, mut all): (Vec<_>, Vec<_>) = all.into_iter().partition(is_new);
    all.extend(new);
    all.extend(engines.iter().map(|preset| preset.strategy));
    all
}

fn variants(rotation: RotationChoice) -> [Strategy; 3] {
    let base = Strategy::preset("quaternion-average").unwrap();
    [
        Strategy { rotation, ..base },
        Strategy { rotation, colour: ColourChoice::ViewRotation, ..base },
        Strategy { rotation, covariance: CovarianceChoice::Surfel, ..base },
    ]
}

/// True if R commutes with rotations of the world. HUGS's conversion does not (its start vector is an axis), nor does
/// Gram-Schmidt over rows, nor the sum of quaternions whose signs are fixed one by one, nor squaring that has not
/// converged (it reads a column).
pub(crate) fn equivariant(rotation: RotationChoice) -> bool {
    use skinsplat_posing::LbsProjection;
    match rotation {
        RotationChoice::Lbs(projection) => match projection {
            LbsProjection::GramSchmidtColumns | LbsProjection::Polar => true,
            LbsProjection::GramSchmidtRows
            | LbsProjection::MatrixToQuaternion
            | LbsProjection::MatrixToQuaternionRaw => false,
        },
        RotationChoice::JointSum => false,
        RotationChoice::VertexQuaternions(policy) => policy == SignPolicy::AlignToFirst,
        RotationChoice::QuaternionAverage(solver) | RotationChoice::VertexAverage(solver) => {
            !matches!(solver, Solver::Squaring { .. })
        }
        RotationChoice::FaceFrame(_)
        | RotationChoice::LiftedSum
        | RotationChoice::PushForward(_)
        | RotationChoice::DualQuaternion => true,
    }
}
