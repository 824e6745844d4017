//! The derivative of the map that carries means (Eq. 6), by which Gaussians are pushed forward.
//!
//! LBS moves a point by φ(x) = Σ w_j(x) (L_j x + t_j). Its derivative is J = B + Σ (L_j x + t_j) ∇w_jᵀ: the blend B keeps the
//! first sum only. Weights are known on the surface, so ∇w_j lies in its tangent plane:
//! * under a face-bound Gaussian, the gradient of the weights that are linear on its face;
//! * under one with weights of its own, the barycentric mix of the gradients at the corners of its nearest face, each by
//!   least squares over the edges around the vertex, in its tangent plane.
//!
//! Only joints of the Gaussian's own row count: a weight that is 0 at a point is at its least there, so its gradient is 0
//! wherever it has one. Since Σ ∇w_j = 0, the second sum is taken of the motions less φ(x), which rounds less and is 0 for a
//! Gaussian on one joint.
//!
//! Across the surface there are two ways to go on ([`Across`]).

use super::blend::{self, Blend};
use super::joints::Joints;
use super::lanes::{self, LANES, Lanes};
use super::layout::{CHUNK, Chunk};
use super::surface::{Embedding, Surface};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use skinsplat_core::math::{Matrix3, matrix3};
use skinsplat_core::scene::{RestBody, SkinWeights};

/// What becomes of the direction across the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Across {
    /// Weights are constant across the surface: J n = B n.
    Constant,
    /// The rest normal becomes the posed one, of the same length: thickness is kept.
    Normal,
}

/// Edges around a vertex that lie this much (determinant over squared trace) along one line give no gradient.
const DEGENERATE: f64 = 1e-10;

/// A posed normal shorter than this (relative to the product of the tangents' sizes) has no direction.
const FOLDED: f32 = 1e-12;

/// What [`Derivative`] reads besides blocks, for the blocks of one chunk. Empty vectors for Gaussians that do not move.
#[derive(Clone, Debug)]
pub(super) struct Tangents {
    /// ∇w_j, 1/m, a row per joint of [`Chunk::weights`].
    gradients: Vec<[Lanes; 3]>,
    /// Unit normals at rest, one per block.
    normals: Vec<[Lanes; 3]>,
}

/// The tangents of every chunk.
pub(super) fn tangents(
    chunks: &[Chunk],
    surface: &Surface,
    on_faces: bool,
    body: &RestBody,
) -> Vec<Tangents> {
    let vertices = if on_faces { Vec::new() } else { vertex_gradients(surface, body) };
    let of_gaussian = |gaussian: usize| {
        let embedding = &surface.embeddings[gaussian];
        if on_faces { on_face(embedding, body) } else { around(embedding, surface, &vertices) }
    };
    let of_chunk = |(c, chunk): (usize, &Chunk)| {
        let mut gradients = vec![[[0.0; LANES]; 3]; chunk.joints.len()];
        let mut normals = vec![[[0.0; LANES]; 3]; chunk.blocks.len()];
        for (block, normal) in chunk.blocks.iter().zip(&mut normals) {
            let (joints, _) = chunk.influences(block);
            let rows = &mut gradients[block.influences.clone()];
            for lane in 0..LANES {
                let own = of_gaussian(c * CHUNK + usize::from(block.index[lane]));
                set(normal, lane, own.normal);
                for (&joint, row) in joints.iter().zip(rows.iter_mut()) {
                    set(row, lane, own.gradient(joint));
                }
            }
        }
        Tangents { gradients, normals }
    };
    chunks.par_iter().enumerate().map(of_chunk).collect()
}

fn set(lanes: &mut [Lanes; 3], lane: usize, v: DVec3) {
    for (lanes, value) in lanes.iter_mut().zip(v.to_array()) {
        lanes[lane] = value as f32;
    }
}

/// A normal and the weights' gradients there, joints in any order.
#[derive(Clone, Debug, Default)]
struct Field {
    normal: DVec3,
    gradients: Vec<(u16, DVec3)>,
}

impl Field {
    fn gradient(&self, joint: u16) -> DVec3 {
        self.gradients.iter().filter(|(own, _)| *own == joint).map(|(_, gradient)| *gradient).sum()
    }
}

fn add<T: Copy + std::ops::AddAssign>(sums: &mut Vec<(u16, T)>, joint: u16, value: T) {
    match sums.iter_mut().find(|(own, _)| *own == joint) {
        Some((_, sum)) => *sum += value,
        None => sums.push((joint, value)),
    }
}

/// Weights that are linear on the face. Zero on a face without area.
fn on_face(embedding: &Embedding, body: &RestBody) -> Field {
    let [a, b, c] = embedding.corners.map(|v| body.vertices[v as usize]);
    let twice_area = (b - a).cross(c - a);
    let (normal, area) = (twice_area.normalize_or_zero(), twice_area.length());
    let mut field = Field { normal, gradients: Vec::new() };
    for (&corner, edge) in embedding.corners.iter().zip([c - b, a - c, b - a]) {
        let slope = if area > 0.0 { normal.cross(edge) / area } else { DVec3::ZERO };
        for (joint, weight) in row(&body.weights, corner) {
            add(&mut field.gradients, joint, slope * weight);
        }
    }
    field
}

/// The mix of the corners' gradients, in the plane across the mix of their normals.
fn around(embedding: &Embedding, surface: &Surface, vertices: &[Field]) -> Field {
    let mut field = Field::default();
    for (&corner, share) in embedding.corners.iter().zip(embedding.weights()) {
        let own = &vertices[corner as usize];
        field.normal += surface.faces.mesh.normals[corner as usize].as_dvec3() * f64::from(share);
        for &(joint, gradient) in &own.gradients {
            add(&mut field.gradients, joint, gradient * f64::from(share));
        }
    }
    field.normal = field.normal.normalize_or_zero();
    for (_, gradient) in &mut field.gradients {
        *gradient -= field.normal * field.normal.dot(*gradient);
    }
    field
}

fn row(weights: &SkinWeights, vertex: u32) -> impl Iterator<Item = (u16, f64)> {
    let (joints, weights) = weights.row(vertex as usize);
    joints.iter().copied().zip(weights.iter().map(|&w| f64::from(w)))
}

/// The gradients at every vertex that a Gaussian is near.
fn vertex_gradients(surface: &Surface, body: &RestBody) -> Vec<Field> {
    let mut around = vec![Vec::new(); body.vertices.len()];
    for &corners in &body.faces {
        for k in 0..3 {
            let [v, next, last] = [corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]];
            if surface.vertex_used[v as usize] {
                around[v as usize].extend([next, last]);
            }
        }
    }
    let at = |(v, around): (usize, &Vec<u32>)| {
        let normal = surface.faces.mesh.normals[v].as_dvec3().normalize_or_zero();
        least_squares(v as u32, normal, around, body)
    };
    around.par_iter().enumerate().map(at).collect()
}

/// min over g ⟂ n of Σ (w_u − w_v − g·(x_u − x_v))² over the edges to the vertices u around v, for each joint's weight.
fn least_squares(v: u32, normal: DVec3, around: &[u32], body: &RestBody) -> Field {
    let mut field = Field { normal, gradients: Vec::new() };
    if around.is_empty() || normal == DVec3::ZERO {
        return field;
    }
    let (first, second) = normal.any_orthonormal_pair();
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    let mut sides: Vec<(u16, DVec2)> = Vec::new();
    for &u in around {
        let edge = body.vertices[u as usize] - body.vertices[v as usize];
        let edge = DVec2::new(first.dot(edge), second.dot(edge));
        (xx, xy, yy) = (xx + edge.x * edge.x, xy + edge.x * edge.y, yy + edge.y * edge.y);
        row(&body.weights, u).for_each(|(joint, weight)| add(&mut sides, joint, edge * weight));
        row(&body.weights, v).for_each(|(joint, weight)| add(&mut sides, joint, -edge * weight));
    }
    let determinant = xx * yy - xy * xy;
    if determinant > DEGENERATE * (xx + yy) * (xx + yy) {
        field.gradients = sides
            .into_iter()
            .map(|(joint, side)| {
                let x = (yy * side.x - xy * side.y) / determinant;
                let y = (xx * side.y - xy * side.x) / determinant;
                (joint, first * x + second * y)
            })
            .collect();
    }
    field
}

/// The derivative of the map of each lane, row-major, by what becomes of the direction across.
pub(super) struct Jacobian {
    /// J with weights that are constant across.
    constant: [Lanes; 9],
    /// J (I − n nᵀ) + n' nᵀ, if asked for.
    normal: Option<[Lanes; 9]>,
}

impl Jacobian {
    #[inline(always)]
    pub(super) fn of(&self, across: Across) -> &[Lanes; 9] {
        match (across, &self.normal) {
            (Across::Normal, Some(normal)) => normal,
            _ => &self.constant,
        }
    }
}

/// What the derivative of a block is computed from: the `position`-th of its chunk.
#[derive(Clone, Copy)]
pub(super) struct Derivative<'a> {
    pub(super) joints: &'a Joints,
    pub(super) chunk: &'a Chunk,
    pub(super) position: usize,
    pub(super) tangents: &'a Tangents,
    pub(super) blend: &'a Blend,
}

impl<'a> Derivative<'a> {
    /// J. A function of its own with the instructions of `arch`: inlined, it would weigh on every strategy.
    #[inline(never)]
    pub(super) fn jacobian(self, arch: pulp::Arch, with_normal: bool) -> Jacobian {
        let constant = arch.dispatch(self);
        let moves = !self.chunk.blocks[self.position].influences.is_empty();
        let normal = (with_normal && moves).then(|| self.with_normals(&constant));
        Jacobian { constant, normal }
    }

    /// J with the direction across replaced.
    fn with_normals(self, constant: &[Lanes; 9]) -> [Lanes; 9] {
        let (normals, growth) = (&self.tangents.normals[self.position], self.growth());
        let mut result = *constant;
        for lane in 0..LANES {
            let normal = [0, 1, 2].map(|k: usize| normals[k][lane]);
            let own = with_normal(&lanes::matrix(constant, lane), normal, growth[lane]);
            lanes::put_matrix(&mut result, lane, &own);
        }
        result
    }

    /// By how much thickness grows where joints scale.
    fn growth(self) -> Lanes {
        let (indices, weights) = self.chunk.influences(&self.chunk.blocks[self.position]);
        let scales = self.joints.scale.as_deref();
        scales.map_or([1.0; LANES], |scales| blend::growth(scales, indices, weights))
    }

    fn influences(self) -> impl Iterator<Item = (usize, &'a [Lanes; 3])> {
        let block = &self.chunk.blocks[self.position];
        let (indices, _) = self.chunk.influences(block);
        let gradients = &self.tangents.gradients[block.influences.clone()];
        indices.iter().map(|&joint| usize::from(joint)).zip(gradients)
    }

    /// The derivative with respect to the canonical mean, from that with respect to J (or to it with its normal carried) of a
    /// lane: through the motions of the joints; gradients of weights stay.
    pub(super) fn adjoint(
        self,
        jacobian: &Jacobian,
        across: Across,
        lane: usize,
        upstream: &Matrix3<f32>,
    ) -> [f32; 3] {
        let upstream = self.constant_adjoint(jacobian, across, lane, upstream);
        let b = self.blend.matrix(lane);
        let mut of_mean = [0.0; 3];
        for (joint, gradient) in self.influences() {
            let linear = self.joints.linear[joint];
            let along = matrix3::apply(upstream, [0, 1, 2].map(|k: usize| gradient[k][lane]));
            for column in 0..3 {
                for row in 0..3 {
                    of_mean[column] += (linear[row][column] - b[row][column]) * along[row];
                }
            }
        }
        of_mean
    }

    /// From the derivative with respect to J with its normal carried to that with respect to J itself, which is also the one
    /// with respect to the blend B in it.
    fn constant_adjoint(
        self,
        jacobian: &Jacobian,
        across: Across,
        lane: usize,
        upstream: &Matrix3<f32>,
    ) -> Matrix3<f32> {
        match across {
            Across::Normal if jacobian.normal.is_some() => {
                let normal = [0, 1, 2].map(|k: usize| self.tangents.normals[self.position][k][lane]);
                let constant = lanes::matrix(&jacobian.constant, lane);
                with_normal_adjoint(&constant, normal, self.growth()[lane], upstream)
            }
            _ => *upstream,
        }
    }

    /// The derivatives with respect to the motions of the joints, from that with respect to J (or to it with its normal
    /// carried) of a lane: with respect to B is returned, `add` gets each influence and what its motion L_j x + t_j of the
    /// Gaussian is asked for.
    pub(super) fn joint_adjoint(
        self,
        jacobian: &Jacobian,
        across: Across,
        lane: usize,
        upstream: &Matrix3<f32>,
        mut add: impl FnMut(usize, [f32; 3]),
    ) -> Matrix3<f32> {
        let of_blend = self.constant_adjoint(jacobian, across, lane, upstream);
        let (_, weights) = self.chunk.influences(&self.chunk.blocks[self.position]);
        let along =
            |gradient: &[Lanes; 3]| matrix3::apply(of_blend, [0, 1, 2].map(|k: usize| gradient[k][lane]));
        // Motions count less φ(x) = Σ w_j m_j.
        let mut total = [0.0; 3];
        for (_, gradient) in self.influences() {
            total = matrix3::add_scaled(total, 1.0, along(gradient));
        }
        for (influence, ((_, gradient), weight)) in self.influences().zip(weights).enumerate() {
            add(influence, matrix3::add_scaled(along(gradient), -weight[lane], total));
        }
        of_blend
    }
}

impl pulp::NullaryFnOnce for Derivative<'_> {
    type Output = [Lanes; 9];

    #[inline(always)]
    fn call(self) -> [Lanes; 9] {
        let mut sum = self.blend.linear;
        let means = &self.chunk.blocks[self.position].means;
        let centre = self.blend.transform(means);
        for (joint, gradient) in self.influences() {
            add_outer(&mut sum, self.joints, joint, means, &centre, gradient);
        }
        sum
    }
}

/// Adds (L_j x + t_j − φ(x)) ∇w_jᵀ.
#[inline(always)]
fn add_outer(
    sum: &mut [Lanes; 9],
    joints: &Joints,
    joint: usize,
    x: &[Lanes; 3],
    centre: &[Lanes; 3],
    gradient: &[Lanes; 3],
) {
    let (linear, translation) = (&joints.linear[joint], &joints.translation[joint]);
    for row in 0..3 {
        let [a, b, c] = linear[row];
        let mut motion = [0.0; LANES];
        for lane in 0..LANES {
            let moved = (a * x[0][lane] + b * x[1][lane]) + (c * x[2][lane] + translation[row]);
            motion[lane] = moved - centre[row][lane];
        }
        for column in 0..3 {
            for lane in 0..LANES {
                sum[3 * row + column][lane] += motion[lane] * gradient[column][lane];
            }
        }
    }
}

/// J (I − n nᵀ) + s n' nᵀ with n' = cof(J) n, normalised: the normal of the posed surface, and s the growth of joints that
/// scale. Where the surface is folded to a line J stays.
fn with_normal(j: &Matrix3<f32>, normal: [f32; 3], growth: f32) -> Matrix3<f32> {
    let Some((posed, _)) = posed_normal(j, normal) else { return *j };
    let across = matrix3::apply(*j, normal);
    let mut result = *j;
    for row in 0..3 {
        for column in 0..3 {
            result[row][column] += (growth * posed[row] - across[row]) * normal[column];
        }
    }
    result
}

/// cof(J) n: its direction and its length.
fn posed_normal(j: &Matrix3<f32>, normal: [f32; 3]) -> Option<([f32; 3], f32)> {
    let [c0, c1, c2] = matrix3::transpose(*j);
    let parts = [matrix3::cross(c1, c2), matrix3::cross(c2, c0), matrix3::cross(c0, c1)];
    let sum =
        [0, 1, 2].map(|k: usize| normal[0] * parts[0][k] + normal[1] * parts[1][k] + normal[2] * parts[2][k]);
    let length = matrix3::dot(sum, sum).sqrt();
    let size = matrix3::max_abs(*j);
    (length > FOLDED * size * size).then(|| (sum.map(|c| c / length), length))
}

/// [`with_normal`] walked backwards.
fn with_normal_adjoint(
    j: &Matrix3<f32>,
    normal: [f32; 3],
    growth: f32,
    upstream: &Matrix3<f32>,
) -> Matrix3<f32> {
    let Some((posed, length)) = posed_normal(j, normal) else { return *upstream };
    let of_posed = matrix3::apply(*upstream, normal);
    let along = matrix3::dot(of_posed, posed);
    let g = [0, 1, 2].map(|k: usize| growth * (of_posed[k] - along * posed[k]) / length);
    let [c0, c1, c2] = matrix3::transpose(*j);
    // Of a · (b × c) by a turn: each column occurs in two of the three products.
    let of_column = |[left, right]: [[f32; 3]; 2], [m, n]: [f32; 2]| {
        let (a, b) = (matrix3::cross(g, right), matrix3::cross(left, g));
        [0, 1, 2].map(|k: usize| m * a[k] + n * b[k])
    };
    let columns = [
        of_column([c1, c2], [normal[1], normal[2]]),
        of_column([c2, c0], [normal[2], normal[0]]),
        of_column([c0, c1], [normal[0], normal[1]]),
    ];
    let mut result = *upstream;
    for row in 0..3 {
        for column in 0..3 {
            result[row][column] += columns[column][row] - of_posed[row] * normal[column];
        }
    }
    result
}
