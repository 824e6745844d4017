//! Forward kinematics and skinning walked backwards: from what posing reads of a posed body to its pose.

use super::{BodyGradient, Pose, PoseGradient, PosedBody, SceneError};
use crate::math::rotation::{adjoint, unique_nearest_rotation};
use glam::{DAffine3, DMat3, DVec3};

impl PosedBody<'_> {
    /// The derivatives with respect to the pose that this body was made from, from those with respect to what posing read of
    /// it. Exact for rigid joints and for those that scale; the rotation of a joint that has none (one scaled to nothing, or
    /// mirrored) asks for nothing.
    ///
    /// # Errors
    /// A pose or a gradient of another body.
    pub fn pose_gradient(&self, pose: &Pose, gradient: &BodyGradient) -> Result<PoseGradient, SceneError> {
        let skeleton = &self.rest.skeleton;
        let count = |field: &str, found: usize, expected: usize| match found == expected {
            true => Ok(()),
            false => Err(SceneError::new(field, format!("{found} values"), format!("{expected}"))),
        };
        count("pose", pose.locals.len(), skeleton.len())?;
        count("gradient of the joints", gradient.linear.len(), self.joints.len())?;
        count("gradient of the joints' translations", gradient.translations.len(), self.joints.len())?;
        count("gradient of the joints' rotations", gradient.torques.len(), self.joints.len())?;
        let mut of_joints: Vec<OfAffine> = (0..self.joints.len())
            .map(|joint| OfAffine {
                linear: gradient.linear[joint] + self.of_rotation(joint, gradient.torques[joint]),
                translation: gradient.translations[joint],
            })
            .collect();
        let mut result =
            PoseGradient { rotations: vec![DVec3::ZERO; skeleton.len()], translation: DVec3::ZERO };
        if !gradient.vertices.is_empty() {
            count("gradient of the vertices", gradient.vertices.len(), self.rest.vertices.len())?;
            count("gradient of the normals", gradient.normals.len(), self.rest.vertices.len())?;
            let of_vertices = self.of_vertices(gradient);
            let of_rest = self.through_skinning(&of_vertices, &mut of_joints);
            self.through_blend_shapes(&of_rest, &mut result.rotations);
        }
        result.translation = of_joints.iter().map(|own| own.translation).sum();
        self.through_chain(pose, &of_joints, &mut result.rotations);
        Ok(result)
    }

    /// From a further rotation of a joint's rotation to the entries of its linear part.
    fn of_rotation(&self, joint: usize, torque: DVec3) -> DMat3 {
        let own = &self.joints[joint];
        if torque == DVec3::ZERO || unique_nearest_rotation(own.linear).is_none() {
            return DMat3::ZERO;
        }
        let rotation = [own.rotation.w, own.rotation.x, own.rotation.y, own.rotation.z];
        let linear = own.linear.transpose().to_cols_array_2d();
        let of_linear = adjoint::nearest_rotation(&linear, rotation, torque.to_array());
        DMat3::from_cols_array_2d(&of_linear).transpose()
    }

    /// Vertices and what their normals ask of them.
    fn of_vertices(&self, gradient: &BodyGradient) -> Vec<DVec3> {
        let mut of_vertices = gradient.vertices.clone();
        if gradient.normals.iter().all(|g| *g == DVec3::ZERO) {
            return of_vertices;
        }
        let vertices = self.vertices();
        let across = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|v| vertices[v as usize]);
            (b - a, c - a)
        };
        let mut sums = vec![DVec3::ZERO; vertices.len()];
        for face in &self.rest.faces {
            let (u, v) = across(face);
            face.iter().for_each(|&corner| sums[corner as usize] += u.cross(v));
        }
        let of_sum = |(sum, g): (&DVec3, &DVec3)| {
            let unit = sum.normalize_or_zero();
            if unit == DVec3::ZERO { DVec3::ZERO } else { (*g - unit * unit.dot(*g)) / sum.length() }
        };
        let of_sums: Vec<DVec3> = sums.iter().zip(&gradient.normals).map(of_sum).collect();
        for face in &self.rest.faces {
            let of_area: DVec3 = face.iter().map(|&corner| of_sums[corner as usize]).sum();
            if of_area == DVec3::ZERO {
                continue;
            }
            let (u, v) = across(face);
            let (of_u, of_v) = (v.cross(of_area), of_area.cross(u));
            for (&corner, own) in face.iter().zip([-of_u - of_v, of_u, of_v]) {
                of_vertices[corner as usize] += own;
            }
        }
        of_vertices
    }

    /// Adds to the joints what skinned vertices ask of them; returns what they ask of the vertices before skinning.
    fn through_skinning(&self, of_vertices: &[DVec3], of_joints: &mut [OfAffine]) -> Vec<DVec3> {
        let rest = self.posed_rest_vertices();
        let mut of_rest = vec![DVec3::ZERO; rest.len()];
        for (vertex, &own) in of_vertices.iter().enumerate().filter(|(_, own)| **own != DVec3::ZERO) {
            let (joints, weights) = self.rest.weights.row(vertex);
            for (&joint, &weight) in joints.iter().zip(weights) {
                let joint = usize::from(joint);
                let share = own * f64::from(weight);
                of_joints[joint].linear += outer(share, rest[vertex]);
                of_joints[joint].translation += share;
                of_rest[vertex] += self.joints[joint].linear.transpose() * share;
            }
        }
        of_rest
    }

    /// Adds to the rotations what the shapes that they drive ask of them.
    fn through_blend_shapes(&self, of_rest: &[DVec3], of_rotations: &mut [DVec3]) {
        let Some(rotations) = &self.blend_shape_rotations else { return };
        let directions = self.rest.pose_directions.chunks_exact(9);
        let nodes = rotations.iter().enumerate().skip(1).zip(directions);
        for ((node, &rotation), directions) in nodes {
            let Some(sum) = of_rotations.get_mut(node) else { continue };
            let mut of_matrix = [[0.0; 3]; 3];
            for (k, direction) in directions.iter().enumerate() {
                let products = direction.iter().zip(of_rest).map(|(offset, own)| offset.as_dvec3().dot(*own));
                of_matrix[k / 3][k % 3] = products.sum();
            }
            let matrix = DMat3::from_quat(rotation).transpose().to_cols_array_2d();
            *sum += DVec3::from_array(adjoint::matrix_to_torque(&matrix, &of_matrix));
        }
    }

    /// From the joints, down the chain to the rotations of the nodes.
    fn through_chain(&self, pose: &Pose, of_joints: &[OfAffine], of_rotations: &mut [DVec3]) {
        let skeleton = &self.rest.skeleton;
        let world = skeleton.world_transforms(&pose.locals);
        let mut of_world = vec![OfAffine::default(); skeleton.len()];
        for ((node, own), bind) in of_world.iter_mut().zip(of_joints).zip(&skeleton.inverse_binds) {
            // skin = world · bind.
            node.linear = own.linear * bind.matrix3.transpose() + outer(own.translation, bind.translation);
            node.translation = own.translation;
        }
        for &node in skeleton.order.iter().rev() {
            let own = of_world[node];
            let local = pose.locals[node].to_affine();
            let parent = skeleton.parents[node];
            let above = parent.map_or(DAffine3::IDENTITY, |parent| world[parent]);
            let of_local = above.matrix3.transpose() * own.linear;
            of_rotations[node] += torque(&local.matrix3, &of_local);
            if let Some(parent) = parent {
                let of_parent = &mut of_world[parent];
                of_parent.linear +=
                    own.linear * local.matrix3.transpose() + outer(own.translation, local.translation);
                of_parent.translation += own.translation;
            }
        }
    }
}

/// Derivatives with respect to an affine map.
#[derive(Clone, Copy, Default)]
struct OfAffine {
    linear: DMat3,
    translation: DVec3,
}

/// a bᵀ.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// How ⟨g, exp(ω) m⟩ changes with ω.
fn torque(m: &DMat3, g: &DMat3) -> DVec3 {
    m.x_axis.cross(g.x_axis) + m.y_axis.cross(g.y_axis) + m.z_axis.cross(g.z_axis)
}

#[cfg(test)]
mod tests {
    use super::super::{RestBody, Skeleton, SkinWeights};
    use super::*;
    use crate::math::random::SplitMix64;
    use glam::Vec3;

    /// A chain with a branch, a fan of triangles on it, and shapes that poses drive.
    fn body(numbers: &mut impl FnMut() -> f64) -> RestBody {
        let positions =
            [[0.0, 0.0, 0.0], [0.5, 0.1, 0.0], [0.9, 0.0, 0.2], [0.4, 0.5, 0.0]].map(DVec3::from_array);
        let parents = vec![None, Some(0), Some(1), Some(1)];
        let skeleton = Skeleton::from_joint_positions(vec![String::new(); 4], parents, &positions).unwrap();
        let vertices: Vec<DVec3> = (0..12).map(|_| DVec3::new(numbers(), numbers(), numbers())).collect();
        let rows = (0..12).map(|i| vec![(i % 4, 0.625f32), ((i + 1) % 4, 0.375)]);
        let weights = SkinWeights::from_rows(rows, 4).unwrap();
        let faces = (1..11).map(|i| [0, i, i + 1]).collect();
        let mut shift = || Vec3::new(numbers() as f32, numbers() as f32, numbers() as f32) * 0.1;
        let pose_directions = (0..27).map(|_| (0..12).map(|_| shift()).collect()).collect();
        RestBody { skeleton, vertices, faces, weights, uv: None, pose_directions }
    }

    /// Against central differences in f64, for rigid joints and for joints that scale by unequal factors.
    #[test]
    fn poses_are_followed_through_joints_and_mesh() {
        let mut random = SplitMix64::new(6);
        let mut number = || f64::from(2.0 * random.unit_f32() - 1.0);
        for case in 0..20 {
            let body = body(&mut number);
            let mut vector = || DVec3::new(number(), number(), number());
            let angles: Vec<DVec3> = (0..4).map(|_| vector()).collect();
            let mut pose = Pose::from_axis_angles(&body.skeleton, &angles, vector());
            if case % 2 == 1 {
                pose.locals.iter_mut().for_each(|local| local.scale = DVec3::ONE + vector() * 0.3);
            }
            let mut matrix = || DMat3::from_cols(vector(), vector(), vector());
            let (of_linear, of_rotation): (Vec<_>, Vec<_>) = (0..4).map(|_| (matrix(), matrix())).unzip();
            let [of_translation, of_vertices, of_normals] =
                [4, 12, 12].map(|n| (0..n).map(|_| vector()).collect::<Vec<_>>());
            let dot = |a: &DMat3, b: &DMat3| {
                a.x_axis.dot(b.x_axis) + a.y_axis.dot(b.y_axis) + a.z_axis.dot(b.z_axis)
            };
            let loss = |pose: &Pose| {
                let posed = PosedBody::new(&body, pose).unwrap();
                let joints = posed.joints.iter().enumerate().map(|(j, joint)| {
                    dot(&joint.linear, &of_linear[j])
                        + dot(&DMat3::from_quat(joint.rotation), &of_rotation[j])
                        + joint.translation.dot(of_translation[j])
                });
                let vertices = posed.vertices();
                let normals = super::super::body::vertex_normals(&vertices, &body.faces);
                let mesh = vertices.iter().zip(&of_vertices).chain(normals.iter().zip(&of_normals));
                joints.sum::<f64>() + mesh.map(|(a, b)| a.dot(*b)).sum::<f64>()
            };
            let posed = PosedBody::new(&body, &pose).unwrap();
            let turn = |(joint, own): (&super::super::JointTransform, &DMat3)| {
                torque(&DMat3::from_quat(joint.rotation), own)
            };
            let gradient = BodyGradient {
                torques: posed.joints.iter().zip(&of_rotation).map(turn).collect(),
                linear: of_linear.clone(),
                translations: of_translation.clone(),
                vertices: of_vertices.clone(),
                normals: of_normals.clone(),
            };
            let found = posed.pose_gradient(&pose, &gradient).unwrap();
            for node in 0..5 {
                for axis in 0..3 {
                    let slope = |h: f64| {
                        let ends = [h, -h].map(|h| {
                            let (mut turns, mut shift) = (vec![DVec3::ZERO; 4], DVec3::ZERO);
                            turns.get_mut(node).unwrap_or(&mut shift)[axis] = h;
                            loss(&pose.turned(&turns, shift))
                        });
                        (ends[0] - ends[1]) / (2.0 * h)
                    };
                    let expected = (4.0 * slope(5e-4) - slope(1e-3)) / 3.0;
                    let own = found.rotations.get(node).unwrap_or(&found.translation)[axis];
                    assert!(
                        (own - expected).abs() < 1e-7 * (1.0 + expected.abs()),
                        "{case}, {node}: {own} is not {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn gradients_of_another_body_are_refused() {
        let body = body(&mut || 0.5);
        let pose = Pose::rest(&body.skeleton);
        let posed = PosedBody::new(&body, &pose).unwrap();
        let mut gradient = BodyGradient::default();
        assert_eq!(posed.pose_gradient(&pose, &gradient).unwrap_err().field, "gradient of the joints");
        gradient.reset(4);
        assert_eq!(posed.pose_gradient(&pose, &gradient).unwrap().rotations, [DVec3::ZERO; 4]);
        gradient.mesh_mut(3);
        assert_eq!(posed.pose_gradient(&pose, &gradient).unwrap_err().field, "gradient of the vertices");
    }
}
