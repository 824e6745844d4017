//! From parameters to a body: mesh, joints, weights, texture coordinates, and what the material needs at each vertex.

use super::field::{Capsule, Field, Part};
use super::parameters::{ArmShape, FigureShape, Parameters, Rig};
use super::skeleton::{Joints, Placement, Proportions, figure_joints};
use super::{atlas, flesh, surface, weights};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use skinsplat_core::math::portable;
use skinsplat_core::scene::body::vertex_normals;
use skinsplat_core::scene::{RestBody, SceneError, Skeleton};
use skinsplat_data::Capture;
use std::sync::Arc;

/// A body and the surface attributes that belong to its vertices.
#[derive(Clone, Debug)]
pub(super) struct Figure {
    pub(super) body: Arc<RestBody>,
    /// Positions on the reference adult, where the material is defined (metres); for an arm (bones along it, and the
    /// position across in radii).
    pub(super) material_positions: Vec<Vec3>,
    /// 1 in the open, towards 0 in creases of the rest pose.
    pub(super) openness: Vec<f32>,
    /// Unit normals of the rest pose.
    pub(super) rest_normals: Vec<Vec3>,
}

/// Builds the body that valid parameters ask for.
///
/// # Errors
/// Of the scene types, which check themselves.
pub(super) fn build(parameters: &Parameters) -> Result<Figure, SceneError> {
    match parameters.rig {
        Rig::Figure(shape) => build_human(shape, parameters.capture == Capture::Hands),
        Rig::Arm(shape) => build_arm(shape),
    }
}

fn build_human(shape: FigureShape, fingers: bool) -> Result<Figure, SceneError> {
    let FigureShape { height, girth, shoulders, softness, edge } = shape;
    let proportions = Proportions { height, girth, shoulders };
    let place = Placement(proportions);
    let field = flesh::flesh(proportions);
    let mesh = surface::mesh(&field, edge, &flesh::lenses(proportions, edge))?;
    let joints = figure_joints(proportions, fingers);
    let claims = weights::figure_claims(&joints, place, softness);
    let material = |v: &DVec3| place.reference(*v).as_vec3();
    let material_positions = mesh.vertices.iter().map(material).collect();
    assemble(&field, mesh, &joints, &claims, material_positions, 0.03 * place.scale())
}

fn build_arm(shape: ArmShape) -> Result<Figure, SceneError> {
    let ArmShape { bones, length, radius, softness, edge } = shape;
    let bone = length / f64::from(bones);
    let start = -length / 2.0;
    let joints = Joints {
        names: (0..bones).map(|i| format!("bone{i}")).collect(),
        parents: (0..bones as usize).map(|i| i.checked_sub(1)).collect(),
        positions: (0..bones).map(|i| DVec3::X * (start + bone * f64::from(i))).collect(),
    };
    // Round ends, inside the length.
    let end = DVec3::X * (length / 2.0 - radius);
    let field = Field {
        parts: vec![Part::new(vec![Capsule::new(-end, radius, end, radius)], 0.01, 0.01)],
        floor: None,
    };
    let mut mesh = surface::mesh(&field, edge, &[])?;
    // One part per bone, so that charts are short enough to pack.
    mesh.parts = mesh.vertices.iter().map(|v| ((v.x - start) / bone).max(0.0) as usize).collect();
    let claims = weights::chain_claims(&joints, softness * bone);
    let material = |v: &DVec3| DVec3::new((v.x - start) / bone, v.y / radius, v.z / radius).as_vec3();
    let material_positions = mesh.vertices.iter().map(material).collect();
    assemble(&field, mesh, &joints, &claims, material_positions, 0.3 * radius)
}

fn assemble(
    field: &Field,
    mesh: surface::Mesh,
    joints: &Joints,
    claims: &[weights::Claim],
    material_positions: Vec<Vec3>,
    crease: f64,
) -> Result<Figure, SceneError> {
    let surface::Mesh { vertices, faces, parts } = mesh;
    // A face on the border between parts belongs to the one in the middle of the order: the majority, if there is one.
    let middle = |mut labels: [usize; 3]| {
        labels.sort_unstable();
        labels[1]
    };
    let face_parts: Vec<usize> = faces.iter().map(|f| middle(f.map(|i| parts[i as usize]))).collect();
    let normals = vertex_normals(&vertices, &faces);
    let openness = vertices.par_iter().zip(&normals).map(|(&v, &n)| openness(field, v, n, crease)).collect();
    let skeleton =
        Skeleton::from_joint_positions(joints.names.clone(), joints.parents.clone(), &joints.positions)?;
    let body = RestBody {
        skeleton,
        weights: weights::weigh(joints, claims, &vertices, &faces)?,
        uv: Some(atlas::unwrap(&vertices, &faces, &face_parts)),
        vertices,
        faces,
        pose_directions: Vec::new(),
    };
    body.validate()?;
    let rest_normals = normals.iter().map(|n| n.as_vec3()).collect();
    Ok(Figure { body: Arc::new(body), material_positions, openness, rest_normals })
}

/// How much of the surrounding a point of the rest pose sees: how fast free space opens along the normal, at distances
/// up to five times `step` metres.
fn openness(field: &Field, vertex: DVec3, normal: DVec3, step: f64) -> f32 {
    let missing = |k: u32| {
        let distance = step * f64::from(k);
        (1.0 - field.distance(vertex + normal * distance) / distance).clamp(0.0, 1.0)
            * portable::powi(0.6, k as i32)
    };
    let worst: f64 = (1..=5).map(|k| portable::powi(0.6, k)).sum();
    let hidden: f64 = (1..=5).map(missing).sum();
    (1.0 - 1.3 * hidden / worst).clamp(0.15, 1.0) as f32
}
