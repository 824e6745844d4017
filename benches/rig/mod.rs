//! A deterministic body of the size and with the weights of an SMPL-style one: 24 joints, tubes around 23 bones, 13,800
//! vertices, 26,450 faces; 63 % of the vertices hang on one joint, 22 % on two, 5 % on three, 10 % on four.

use glam::{DVec3, Vec3};
use skinsplat_core::scene::{Avatar, Binding, FaceBinding, Gaussians, Pose, RestBody, Skeleton, SkinWeights};

/// SMPL's tree.
const PARENTS: [usize; 24] =
    [0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21];
const RINGS: usize = 25;
const SEGMENTS: usize = 24;

/// Deterministic numbers in \[0, 1).
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn signed(&mut self) -> f64 {
        2.0 * self.next() - 1.0
    }
}

pub(crate) fn body() -> RestBody {
    let mut noise = Noise(1);
    let mut positions = vec![DVec3::ZERO];
    for joint in 1..24 {
        let step = DVec3::new(noise.signed(), noise.signed(), noise.signed()).normalize() * 0.2;
        positions.push(positions[PARENTS[joint]] + step);
    }
    let parents = (0..24).map(|j| (j > 0).then(|| PARENTS[j])).collect();
    let names = (0..24).map(|j| format!("joint {j}")).collect();
    let skeleton = Skeleton::from_joint_positions(names, parents, &positions).unwrap();
    let (mut vertices, mut faces, mut rows) = (Vec::new(), Vec::new(), Vec::new());
    for joint in 1..24 {
        let parent = PARENTS[joint];
        let (from, to) = (positions[parent], positions[joint]);
        let (u, v) = (to - from).normalize().any_orthonormal_pair();
        for ring in 0..RINGS {
            let t = (ring as f64 + 0.5) / RINGS as f64;
            for segment in 0..SEGMENTS {
                let angle = segment as f64 / SEGMENTS as f64 * std::f64::consts::TAU;
                vertices.push(from.lerp(to, t) + (u * angle.cos() + v * angle.sin()) * 0.05);
                rows.push(row(parent, joint, t, &mut noise));
                if ring + 1 < RINGS {
                    let base = vertices.len() - 1 - segment;
                    let next = (segment + 1) % SEGMENTS;
                    let [a, b, c, d] =
                        [base + segment, base + next, base + SEGMENTS + segment, base + SEGMENTS + next]
                            .map(|i| i as u32);
                    faces.extend([[a, b, c], [b, d, c]]);
                }
            }
        }
    }
    let weights = SkinWeights::from_rows(rows, 24).unwrap();
    RestBody { skeleton, vertices, faces, weights, uv: None, pose_directions: Vec::new() }
}

/// Weights at the fraction `t` of the bone from `parent` to `joint`.
fn row(parent: usize, joint: usize, t: f64, noise: &mut Noise) -> Vec<(usize, f32)> {
    let joints = match t {
        t if t < 0.10 => vec![parent, joint, PARENTS[parent], (joint + 5) % 24],
        t if t < 0.15 => vec![parent, joint, PARENTS[parent]],
        t if t < 0.37 => vec![parent, joint],
        _ => vec![joint],
    };
    let raw: Vec<f64> = joints.iter().map(|_| 0.1 + noise.next()).collect();
    let sum: f64 = raw.iter().sum();
    joints.into_iter().zip(raw).map(|(j, w)| (j, (w / sum) as f32)).collect()
}

/// Joints bent by up to about a right angle.
pub(crate) fn pose(body: &RestBody) -> Pose {
    let mut noise = Noise(2);
    let angles: Vec<DVec3> =
        (0..24).map(|_| DVec3::new(noise.signed(), noise.signed(), noise.signed())).collect();
    Pose::from_axis_angles(&body.skeleton, &angles, DVec3::new(0.0, 0.5, 2.0))
}

fn gaussians(means: Vec<Vec3>, degree: usize) -> Gaussians {
    let mut noise = Noise(3);
    let n = means.len();
    let quat = |noise: &mut Noise| [0; 4].map(|_| noise.signed() as f32);
    let log_scale = |noise: &mut Noise| Vec3::new(noise.next() as f32, noise.next() as f32, -1.0) - 5.0;
    Gaussians {
        rotations: (0..n).map(|_| quat(&mut noise)).collect(),
        log_scales: (0..n).map(|_| log_scale(&mut noise)).collect(),
        opacity_logits: vec![2.0; n],
        sh_degree: degree,
        sh: (0..n * (degree + 1).pow(2)).map(|_| [0; 3].map(|_| noise.signed() as f32 * 0.2)).collect(),
        means,
    }
}

/// A Gaussian per vertex, in the order of the mesh.
pub(crate) fn on_vertices(body: &RestBody, degree: usize) -> Avatar {
    let means = body.vertices.iter().map(|v| v.as_vec3()).collect();
    Avatar { gaussians: gaussians(means, degree), binding: Binding::Vertex(body.weights.clone()) }
}

/// 100,000 face-bound Gaussians in no order, as densification leaves them.
pub(crate) fn on_faces(body: &RestBody, degree: usize) -> Avatar {
    let mut noise = Noise(4);
    let mut binding = FaceBinding::default();
    for _ in 0..100_000 {
        binding.faces.push((noise.next() * body.faces.len() as f64) as u32);
        let (a, b) = (noise.next() as f32, noise.next() as f32);
        let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
        binding.barycentric.push([1.0 - a - b, a, b]);
        binding.offsets.push(noise.signed() as f32 * 0.01);
    }
    let means = vec![Vec3::ZERO; binding.faces.len()];
    Avatar { gaussians: gaussians(means, degree), binding: Binding::Face(binding) }
}

/// 100,000 Gaussians with weights of their own near the surface, in no order.
pub(crate) fn scattered(body: &RestBody, degree: usize) -> Avatar {
    let mut noise = Noise(5);
    let (mut means, mut rows) = (Vec::new(), Vec::new());
    for _ in 0..100_000 {
        let vertex = (noise.next() * body.vertices.len() as f64) as usize;
        let jitter = DVec3::new(noise.signed(), noise.signed(), noise.signed()) * 0.01;
        means.push((body.vertices[vertex] + jitter).as_vec3());
        rows.push(body.weights.mixed(&[(vertex, 1.0)]));
    }
    let weights = SkinWeights::from_rows(rows, 24).unwrap();
    Avatar { gaussians: gaussians(means, degree), binding: Binding::Vertex(weights) }
}
