//! Bodies: skeleton, template mesh, shape space, skinning weights; forward kinematics and linear blend skinning.

use super::{LocalTransform, Pose, SceneError, SkinWeights};
use crate::math::rotation::unique_nearest_rotation;
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use std::sync::OnceLock;

/// A hierarchy of nodes. The first [`Skeleton::num_joints`] nodes deform the mesh; further ones only carry them (glTF
/// ancestors of the joints).
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    /// A name per node ("joint 7" where the file has none).
    pub names: Vec<String>,
    /// Parent node; `None` for roots.
    pub parents: Vec<Option<usize>>,
    /// Transform of each node relative to its parent, in the rest pose.
    pub rest_locals: Vec<LocalTransform>,
    /// Joint-from-mesh transform in the bind pose, one per deforming joint.
    pub inverse_binds: Vec<DAffine3>,
    order: Vec<usize>,
}

impl Skeleton {
    /// Builds a skeleton and finds an order in which parents come before children.
    ///
    /// # Errors
    /// A parent index out of range, a cycle, arrays of different lengths, values that are not finite.
    pub fn new(
        names: Vec<String>,
        parents: Vec<Option<usize>>,
        rest_locals: Vec<LocalTransform>,
        inverse_binds: Vec<DAffine3>,
    ) -> Result<Self, SceneError> {
        let n = parents.len();
        if names.len() != n || rest_locals.len() != n || inverse_binds.len() > n || inverse_binds.is_empty() {
            return Err(SceneError::new(
                "joints",
                "arrays of different lengths",
                "one entry per joint, at least one",
            ));
        }
        if let Some((i, &Some(parent))) = parents.iter().enumerate().find(|(_, p)| p.is_some_and(|p| p >= n))
        {
            return Err(SceneError::new(format!("parents[{i}]"), format!("{parent}"), format!("below {n}")));
        }
        for (i, local) in rest_locals.iter().enumerate() {
            if !(local.translation.is_finite() && local.rotation.is_finite() && local.scale.is_finite()) {
                return Err(SceneError::new(
                    format!("rest transform[{i}]"),
                    "NaN or infinite",
                    "finite values",
                ));
            }
        }
        if let Some(i) = inverse_binds.iter().position(|m| !m.is_finite()) {
            return Err(SceneError::new(format!("inverse bind[{i}]"), "NaN or infinite", "finite values"));
        }
        let order = topological_order(&parents)?;
        Ok(Self { names, parents, rest_locals, inverse_binds, order })
    }

    /// A skeleton of pure translations (SMPL): joint positions in the rest pose.
    ///
    /// # Errors
    /// As [`Skeleton::new`].
    pub fn from_joint_positions(
        names: Vec<String>,
        parents: Vec<Option<usize>>,
        positions: &[DVec3],
    ) -> Result<Self, SceneError> {
        if positions.len() != parents.len() {
            return Err(SceneError::new(
                "joints",
                format!("{} positions", positions.len()),
                "one per parent",
            ));
        }
        let local = |(&position, parent): (&DVec3, &Option<usize>)| LocalTransform {
            translation: position
                - parent.map_or(DVec3::ZERO, |p| positions.get(p).copied().unwrap_or(DVec3::ZERO)),
            ..LocalTransform::IDENTITY
        };
        let rest_locals = positions.iter().zip(&parents).map(local).collect();
        let inverse_binds = positions.iter().map(|&p| DAffine3::from_translation(-p)).collect();
        Self::new(names, parents, rest_locals, inverse_binds)
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.parents.len()
    }

    /// True if there are no nodes (never, after [`Skeleton::new`]).
    pub fn is_empty(&self) -> bool {
        self.parents.is_empty()
    }

    /// Number of nodes that deform the mesh.
    pub fn num_joints(&self) -> usize {
        self.inverse_binds.len()
    }

    /// World transform of every node in a pose (without [`Pose::translation`]).
    pub fn world_transforms(&self, pose: &Pose) -> Vec<DAffine3> {
        let mut world = vec![DAffine3::IDENTITY; self.len()];
        for &node in &self.order {
            let local = pose.locals[node].to_affine();
            world[node] = match self.parents[node] {
                Some(parent) => world[parent] * local,
                None => local,
            };
        }
        world
    }

    /// Rotation of every node relative to the rest pose, scales left out.
    fn rotations_from_rest(&self, pose: &Pose) -> Vec<DQuat> {
        let chained = |locals: &[LocalTransform]| {
            let mut world = vec![DQuat::IDENTITY; self.len()];
            for &node in &self.order {
                let local = locals[node].rotation;
                world[node] = self.parents[node].map_or(local, |parent| world[parent] * local);
            }
            world
        };
        let (posed, rest) = (chained(&pose.locals), chained(&self.rest_locals));
        posed.iter().zip(rest).map(|(posed, rest)| (*posed * rest.inverse()).normalize()).collect()
    }
}

fn topological_order(parents: &[Option<usize>]) -> Result<Vec<usize>, SceneError> {
    let mut children = vec![Vec::new(); parents.len()];
    let mut stack: Vec<usize> = Vec::new();
    for (i, parent) in parents.iter().enumerate() {
        match parent {
            Some(p) => children[*p].push(i),
            None => stack.push(i),
        }
    }
    stack.reverse();
    let mut order = Vec::with_capacity(parents.len());
    while let Some(node) = stack.pop() {
        order.push(node);
        stack.extend(children[node].iter().rev());
    }
    if order.len() < parents.len() {
        let stuck = (0..parents.len()).find(|i| !order.contains(i)).unwrap_or_default();
        return Err(SceneError::new(format!("parents[{stuck}]"), "a cycle", "a tree of joints"));
    }
    Ok(order)
}

/// Texture coordinates with an index of their own per face corner (OBJ convention, v up).
#[derive(Clone, Debug, PartialEq)]
pub struct Uv {
    /// Texture coordinates.
    pub coordinates: Vec<[f32; 2]>,
    /// Indices into `coordinates`, one triple per face.
    pub faces: Vec<[u32; 3]>,
}

/// A body of one shape, in its rest pose: what avatars are bound to.
#[derive(Clone, Debug, PartialEq)]
pub struct RestBody {
    /// The joints.
    pub skeleton: Skeleton,
    /// Rest positions, metres.
    pub vertices: Vec<DVec3>,
    /// Triangles, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// Skinning weights, one row per vertex.
    pub weights: SkinWeights,
    /// Texture coordinates, if any.
    pub uv: Option<Uv>,
    /// Pose blend shapes: per direction, one offset per vertex; direction `9 (j - 1) + 3 r + c` is driven by entry
    /// (r, c) of `R(theta_j) - I`, j from 1. Empty if the rig has none.
    pub pose_directions: Vec<Vec<Vec3>>,
}

/// The largest coordinate of a vertex, metres: far beyond, squares of distances overflow.
const MAX_COORDINATE: f64 = 1e12;

impl RestBody {
    /// Checks counts and indices.
    ///
    /// # Errors
    /// Names the first field that is wrong.
    pub fn validate(&self) -> Result<(), SceneError> {
        let v = self.vertices.len();
        if self.weights.len() != v {
            return Err(SceneError::new(
                "weights",
                format!("{} rows", self.weights.len()),
                format!("{v} (vertices)"),
            ));
        }
        let too_far = |p: &DVec3| p.to_array().into_iter().any(|c| c.is_nan() || c.abs() > MAX_COORDINATE);
        if let Some(i) = self.vertices.iter().position(too_far) {
            let [x, y, z] = self.vertices[i].to_array();
            let problem = format!("({x:e}, {y:e}, {z:e})");
            let expected = format!("metres, at most {MAX_COORDINATE:e} from the origin");
            return Err(SceneError::new(format!("v_template[{i}]"), problem, expected));
        }
        if let Some(i) = self.faces.iter().position(|f| f.iter().any(|&k| k as usize >= v)) {
            let problem = format!("vertex indices {:?}", self.faces[i]);
            return Err(SceneError::new(format!("f[{i}]"), problem, format!("indices below {v}")));
        }
        if let Some(uv) = &self.uv {
            let count = uv.coordinates.len();
            if uv.faces.len() != self.faces.len() {
                return Err(SceneError::new(
                    "ft",
                    format!("{} faces", uv.faces.len()),
                    format!("{}", self.faces.len()),
                ));
            }
            if let Some(i) = uv.faces.iter().position(|f| f.iter().any(|&k| k as usize >= count)) {
                return Err(SceneError::new(
                    format!("ft[{i}]"),
                    "index out of range",
                    format!("below {count}"),
                ));
            }
        }
        if let Some(k) = self.pose_directions.iter().position(|d| d.len() != v) {
            return Err(SceneError::new(format!("posedirs[{k}]"), "wrong length", format!("{v} offsets")));
        }
        Ok(())
    }

    /// The skinning weights of a point of a face, from those of its corners, as sorted (joint, weight) pairs. `barycentric`
    /// are at least 0 and sum to one.
    pub fn weights_at(&self, face: u32, barycentric: [f64; 3]) -> Vec<(usize, f32)> {
        let corners = self.faces[face as usize];
        self.weights.mixed(&[0, 1, 2].map(|k: usize| (corners[k] as usize, barycentric[k])))
    }

    /// The same body with every vertex moved along its rest normal (clothing), metres. Joints stay where they are.
    ///
    /// # Errors
    /// If the count is not the number of vertices or a value is not finite.
    pub fn with_normal_offset(mut self, offsets: &[f32]) -> Result<Self, SceneError> {
        let v = self.vertices.len();
        if offsets.len() != v || offsets.iter().any(|o| !o.is_finite()) {
            let problem = format!("{} values", offsets.len());
            return Err(SceneError::new("normal offset", problem, format!("{v} finite metres")));
        }
        let normals = vertex_normals(&self.vertices, &self.faces);
        for ((vertex, normal), &offset) in self.vertices.iter_mut().zip(&normals).zip(offsets) {
            *vertex += *normal * f64::from(offset);
        }
        Ok(self)
    }
}

/// Linear shape directions and how joints follow them.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeSpace {
    /// Per direction, one offset per vertex, metres per unit.
    pub directions: Vec<Vec<Vec3>>,
    /// Sparse rows (vertex, weight) per joint; empty if joints do not follow the shape.
    pub joint_regressor: Vec<Vec<(u32, f32)>>,
}

/// A body model: the mean body and its shape space.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// The body of zero shape.
    pub rest: RestBody,
    /// How it varies, if it does.
    pub shape: Option<ShapeSpace>,
}

impl Body {
    /// The body of the given shape (SMPL: `v_template + shapedirs betas`, `J = J_regressor v`). Missing betas are zero.
    ///
    /// # Errors
    /// More non-zero betas than directions, or a beta that is not finite.
    pub fn shaped(&self, betas: &[f64]) -> Result<RestBody, SceneError> {
        let known = self.shape.as_ref().map_or(0, |s| s.directions.len());
        if let Some(i) = betas.iter().position(|b| !b.is_finite()) {
            return Err(SceneError::new(format!("betas[{i}]"), "NaN or infinite", "finite values"));
        }
        if let Some(i) = betas.iter().skip(known).position(|&b| b != 0.0) {
            let problem = format!("{} of a body with {known} shape directions", betas[known + i]);
            return Err(SceneError::new(format!("betas[{}]", known + i), problem, "0"));
        }
        let mut rest = self.rest.clone();
        let Some(shape) = &self.shape else { return Ok(rest) };
        for (direction, &beta) in shape.directions.iter().zip(betas) {
            for (vertex, offset) in rest.vertices.iter_mut().zip(direction) {
                *vertex += offset.as_dvec3() * beta;
            }
        }
        if !shape.joint_regressor.is_empty() {
            let joint = |row: &Vec<(u32, f32)>| -> DVec3 {
                row.iter().map(|&(v, w)| rest.vertices[v as usize] * f64::from(w)).sum()
            };
            let positions: Vec<DVec3> = shape.joint_regressor.iter().map(joint).collect();
            let Skeleton { names, parents, .. } = rest.skeleton;
            rest.skeleton = Skeleton::from_joint_positions(names, parents, &positions)?;
        }
        Ok(rest)
    }
}

/// The motion of one joint relative to the rest pose: `x' = linear x + translation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointTransform {
    /// Linear part (a rotation for SMPL; may carry scale in glTF).
    pub linear: DMat3,
    /// The rotation of `linear`: the b_j of Eq. 7. Its polar factor; where that is not unique (a joint scaled to nothing,
    /// or mirrored), the chain of rotations without scales.
    pub rotation: DQuat,
    /// Metres.
    pub translation: DVec3,
}

/// A body in a pose. The mesh is skinned when first asked for.
#[derive(Debug)]
pub struct PosedBody<'a> {
    /// The body in its rest pose.
    pub rest: &'a RestBody,
    /// One per deforming joint, [`Pose::translation`] included.
    pub joints: Vec<JointTransform>,
    blend_shape_rotations: Option<Vec<DQuat>>,
    mesh: OnceLock<PosedMesh>,
}

/// Skinned vertices and their normals.
#[derive(Clone, Debug, PartialEq)]
pub struct PosedMesh {
    /// World positions, metres.
    pub vertices: Vec<Vec3>,
    /// Area-weighted unit normals; zero where all incident faces are degenerate.
    pub normals: Vec<Vec3>,
}

impl<'a> PosedBody<'a> {
    /// Forward kinematics.
    ///
    /// # Errors
    /// A pose of another number of nodes, or with values that are not finite.
    pub fn new(rest: &'a RestBody, pose: &Pose) -> Result<Self, SceneError> {
        Self::with_rotations(rest, pose, |_| true)
    }

    /// [`PosedBody::new`] for a reader of some joints' rotations only: those of the others are left the identity, which
    /// saves a polar decomposition each. Means and meshes do not read rotations.
    ///
    /// # Errors
    /// As [`PosedBody::new`].
    pub fn with_rotations(
        rest: &'a RestBody,
        pose: &Pose,
        reads: impl Fn(usize) -> bool,
    ) -> Result<Self, SceneError> {
        let skeleton = &rest.skeleton;
        if pose.locals.len() != skeleton.len() {
            let problem = format!("{} joints", pose.locals.len());
            return Err(SceneError::new("pose", problem, format!("the body's {}", skeleton.len())));
        }
        let finite =
            |l: &LocalTransform| l.translation.is_finite() && l.rotation.is_finite() && l.scale.is_finite();
        if let Some(i) = pose.locals.iter().position(|l| !finite(l)) {
            return Err(SceneError::new(format!("pose[{i}]"), "NaN or infinite", "finite values"));
        }
        if !pose.translation.is_finite() {
            return Err(SceneError::new("transl", "NaN or infinite", "finite metres"));
        }
        let world = skeleton.world_transforms(pose);
        let rotations = std::cell::OnceCell::new();
        let joint = |(index, (world, bind)): (usize, (&DAffine3, &DAffine3))| {
            let skin = *world * *bind;
            let chained = || rotations.get_or_init(|| skeleton.rotations_from_rest(pose))[index];
            let rotation = || unique_nearest_rotation(skin.matrix3).unwrap_or_else(chained);
            JointTransform {
                linear: skin.matrix3,
                rotation: if reads(index) { rotation() } else { DQuat::IDENTITY },
                translation: skin.translation + pose.translation,
            }
        };
        let joints = world.iter().zip(&skeleton.inverse_binds).enumerate().map(joint).collect();
        Ok(Self {
            rest,
            joints,
            blend_shape_rotations: pose.blend_shape_rotations.clone(),
            mesh: OnceLock::new(),
        })
    }

    /// The skinned mesh (Eq. 6), computed in f64 on first use.
    pub fn mesh(&self) -> &PosedMesh {
        self.mesh.get_or_init(|| {
            let rest = self.posed_rest_vertices();
            let vertices: Vec<DVec3> = (0..rest.len()).map(|i| self.skinned(i, rest[i])).collect();
            let normals = vertex_normals(&vertices, &self.rest.faces);
            PosedMesh {
                vertices: vertices.iter().map(|v| v.as_vec3()).collect(),
                normals: normals.iter().map(|n| n.as_vec3()).collect(),
            }
        })
    }

    fn skinned(&self, vertex: usize, position: DVec3) -> DVec3 {
        let (joints, weights) = self.rest.weights.row(vertex);
        let moved = |(&j, &w): (&u16, &f32)| {
            let joint = &self.joints[usize::from(j)];
            (joint.linear * position + joint.translation) * f64::from(w)
        };
        joints.iter().zip(weights).map(moved).sum()
    }

    fn posed_rest_vertices(&self) -> std::borrow::Cow<'_, [DVec3]> {
        let Some(rotations) =
            self.blend_shape_rotations.as_ref().filter(|_| !self.rest.pose_directions.is_empty())
        else {
            return std::borrow::Cow::Borrowed(&self.rest.vertices);
        };
        let mut vertices = self.rest.vertices.clone();
        let features = rotations.iter().skip(1).flat_map(|&q| {
            let m = DMat3::from_quat(q) - DMat3::IDENTITY;
            (0..9).map(move |k| m.row(k / 3)[k % 3])
        });
        for (feature, direction) in features.zip(&self.rest.pose_directions) {
            if feature != 0.0 {
                for (vertex, offset) in vertices.iter_mut().zip(direction) {
                    *vertex += offset.as_dvec3() * feature;
                }
            }
        }
        std::borrow::Cow::Owned(vertices)
    }
}

/// Area-weighted unit vertex normals; zero where every incident face is degenerate.
pub fn vertex_normals(vertices: &[DVec3], faces: &[[u32; 3]]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; vertices.len()];
    for face in faces {
        let [a, b, c] = face.map(|i| vertices[i as usize]);
        let area_normal = (b - a).cross(c - a);
        for &i in face {
            normals[i as usize] += area_normal;
        }
    }
    normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
    normals
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arm() -> RestBody {
        let names = vec!["shoulder".into(), "elbow".into()];
        let skeleton =
            Skeleton::from_joint_positions(names, vec![None, Some(0)], &[DVec3::ZERO, DVec3::X]).unwrap();
        RestBody {
            skeleton,
            vertices: vec![DVec3::X * 2.0, DVec3::X * 0.5, DVec3::Y],
            faces: vec![[0, 1, 2]],
            weights: SkinWeights::from_rows([vec![(1, 1.0)], vec![(0, 1.0)], vec![(0, 0.5), (1, 0.5)]], 2)
                .unwrap(),
            uv: None,
            pose_directions: Vec::new(),
        }
    }

    #[test]
    fn vertices_out_of_reach_of_arithmetic_are_refused() {
        for far in [1e160, f64::INFINITY, f64::NAN] {
            let mut body = arm();
            body.vertices[1].y = far;
            let error = body.validate().unwrap_err();
            assert_eq!(
                (error.field.as_str(), error.expected.as_str()),
                ("v_template[1]", "metres, at most 1e12 from the origin")
            );
        }
    }

    #[test]
    fn a_bent_elbow_moves_the_hand_only() {
        let body = arm();
        body.validate().unwrap();
        let quarter = DVec3::Z * std::f64::consts::FRAC_PI_2;
        let pose = Pose::from_axis_angles(&body.skeleton, &[DVec3::ZERO, quarter], DVec3::new(0.0, 0.0, 3.0));
        let posed = PosedBody::new(&body, &pose).unwrap();
        let mesh = posed.mesh();
        assert!((mesh.vertices[0] - Vec3::new(1.0, 1.0, 3.0)).length() < 1e-6);
        assert!((mesh.vertices[1] - Vec3::new(0.5, 0.0, 3.0)).length() < 1e-6);
        assert!(posed.joints[1].rotation.angle_between(DQuat::from_rotation_z(quarter.z)) < 1e-7);
    }

    #[test]
    fn joints_that_vanish_or_mirror_keep_the_rotation_of_their_chain() {
        let body = arm();
        let world = DQuat::from_scaled_axis(DVec3::new(0.3, -1.2, 0.5));
        let elbow = DQuat::from_scaled_axis(DVec3::new(-0.7, 0.2, 1.9));
        for scale in [DVec3::ZERO, DVec3::new(1.0, 1.0, -1.0), -DVec3::ONE, DVec3::ONE] {
            let mut pose = Pose::rest(&body.skeleton);
            pose.locals[0].rotation = world;
            (pose.locals[1].rotation, pose.locals[1].scale) = (elbow, scale);
            let posed = PosedBody::new(&body, &pose).unwrap();
            let off = posed.joints[1].rotation.angle_between(world * elbow);
            assert!(off < 1e-7, "{scale}: {off}");
        }
    }

    #[test]
    fn cycles_and_foreign_parents_are_refused() {
        let names = || vec![String::new(), String::new()];
        let cycle = Skeleton::from_joint_positions(names(), vec![Some(1), Some(0)], &[DVec3::ZERO; 2]);
        assert_eq!(cycle.unwrap_err().problem, "a cycle");
        let foreign = Skeleton::from_joint_positions(names(), vec![None, Some(7)], &[DVec3::ZERO; 2]);
        assert_eq!(foreign.unwrap_err().field, "parents[1]");
    }

    #[test]
    fn the_rest_pose_moves_nothing() {
        let body = arm();
        let posed = PosedBody::new(&body, &Pose::rest(&body.skeleton)).unwrap();
        for (posed, rest) in posed.mesh().vertices.iter().zip(&body.vertices) {
            assert!((*posed - rest.as_vec3()).length() < 1e-7);
        }
    }
}
