//! Bodies at rest: skeleton, template mesh, shape space, skinning weights.

use super::{Pose, PosedBody, SceneError, Skeleton, SkinWeights};
use glam::{DAffine3, DVec3, Vec3};

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
    /// Checks counts, indices and coordinates.
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
        self.weights.check_joints("weights", self.skeleton.num_joints())?;
        if let Some((i, problem)) = self.first_far_vertex() {
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

    /// The same body, with a pose in the place of its rest pose: for what is measured on the body in that pose (the canonical
    /// pose of HUGS). A pose of `self` is one of the new body and puts each joint where it was; vertices with several joints
    /// blend motions from the new rest pose, which is why the two are not the same surface. Blend shapes of poses are left out.
    ///
    /// # Errors
    /// As [`PosedBody::new`]; a joint that the pose scales to nothing.
    pub fn in_pose(&self, pose: &Pose) -> Result<Self, SceneError> {
        let pose = Pose { blend_shape_rotations: None, ..pose.clone() };
        let posed = PosedBody::new(self, &pose)?;
        let bind = |(joint, bind): (&super::JointTransform, &DAffine3)| {
            *bind * DAffine3::from_mat3_translation(joint.linear, joint.translation).inverse()
        };
        let inverse_binds = posed.joints.iter().zip(&self.skeleton.inverse_binds).map(bind).collect();
        let vertices = posed.vertices();
        // The translation is part of every joint, so the new rest pose has it in the roots.
        let moved = |(local, parent): (&super::LocalTransform, &Option<usize>)| match parent {
            Some(_) => *local,
            None => super::LocalTransform { translation: local.translation + pose.translation, ..*local },
        };
        let Skeleton { names, parents, .. } = self.skeleton.clone();
        let rest_locals = pose.locals.iter().zip(&parents).map(moved).collect();
        let skeleton = Skeleton::new(names, parents, rest_locals, inverse_binds)?;
        let weights = self.weights.clone();
        let (faces, uv) = (self.faces.clone(), self.uv.clone());
        Ok(Self { skeleton, vertices, faces, weights, uv, pose_directions: Vec::new() })
    }

    /// The first vertex beyond [`MAX_COORDINATE`], and where it is.
    fn first_far_vertex(&self) -> Option<(usize, String)> {
        let too_far = |p: &DVec3| p.to_array().into_iter().any(|c| c.is_nan() || c.abs() > MAX_COORDINATE);
        let i = self.vertices.iter().position(too_far)?;
        let [x, y, z] = self.vertices[i].to_array();
        Some((i, format!("({x:e}, {y:e}, {z:e})")))
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
    /// The same for facial expressions (SMPL-X); empty if there are none.
    pub expressions: Vec<Vec<Vec3>>,
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
        self.shaped_with(betas, &[])
    }

    /// As [`Body::shaped`], with a facial expression (SMPL-X), which joints follow too. Missing coefficients are zero.
    ///
    /// # Errors
    /// As [`Body::shaped`], of both kinds of coefficients.
    pub fn shaped_with(&self, betas: &[f64], expression: &[f64]) -> Result<RestBody, SceneError> {
        let known = self.shape.as_ref().map_or([0; 2], |s| [s.directions.len(), s.expressions.len()]);
        check_coefficients("betas", betas, known[0], "shape")?;
        check_coefficients("expression", expression, known[1], "expression")?;
        let mut rest = self.rest.clone();
        let Some(shape) = &self.shape else { return Ok(rest) };
        let shapes = shape.directions.iter().zip(betas);
        for (direction, &beta) in shapes.chain(shape.expressions.iter().zip(expression)) {
            for (vertex, offset) in rest.vertices.iter_mut().zip(direction) {
                *vertex += offset.as_dvec3() * beta;
            }
        }
        if let Some((i, place)) = rest.first_far_vertex() {
            let expected = format!("a body within {MAX_COORDINATE:e} m of the origin");
            return Err(SceneError::new("betas", format!("they move vertex {i} to {place}"), expected));
        }
        if !shape.joint_regressor.is_empty() {
            let joint = |row: &Vec<(u32, f32)>| -> DVec3 {
                row.iter().map(|&(v, w)| rest.vertices[v as usize] * f64::from(w)).sum()
            };
            let positions: Vec<DVec3> = shape.joint_regressor.iter().map(joint).collect();
            let Skeleton { names, parents, hands, .. } = rest.skeleton;
            rest.skeleton = Skeleton::from_joint_positions(names, parents, &positions)?;
            rest.skeleton.hands = hands;
        }
        Ok(rest)
    }
}

/// That all coefficients are finite, and those beyond the `known` directions zero.
fn check_coefficients(name: &str, values: &[f64], known: usize, what: &str) -> Result<(), SceneError> {
    if let Some(i) = values.iter().position(|v| !v.is_finite()) {
        return Err(SceneError::new(format!("{name}[{i}]"), "NaN or infinite", "finite values"));
    }
    if let Some(i) = values.iter().skip(known).position(|&v| v != 0.0) {
        let problem = format!("{} of a body with {known} {what} directions", values[known + i]);
        return Err(SceneError::new(format!("{name}[{}]", known + i), problem, "0"));
    }
    Ok(())
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
    fn joints_that_only_carry_deform_nothing() {
        let mut body = arm();
        body.skeleton.inverse_binds.pop();
        assert_eq!((body.skeleton.len(), body.skeleton.num_joints()), (2, 1));
        assert_eq!(body.validate().unwrap_err().field, "weights[0]");
    }

    #[test]
    fn a_body_in_a_pose_rests_there_and_moves_its_joints_as_before() {
        let body = arm();
        let angles = [DVec3::new(0.3, -0.2, 0.1), DVec3::Z];
        let canonical = Pose::from_axis_angles(&body.skeleton, &angles, DVec3::new(0.0, 2.0, 0.0));
        let turned = body.in_pose(&canonical).unwrap();
        let at_rest = PosedBody::new(&turned, &Pose::rest(&turned.skeleton)).unwrap();
        let there = PosedBody::new(&body, &canonical).unwrap();
        for (i, vertex) in turned.vertices.iter().enumerate() {
            assert!((at_rest.vertices()[i] - *vertex).length() < 1e-12);
            assert!((there.vertices()[i] - *vertex).length() < 1e-12);
        }
        // A vertex of one joint goes wherever it goes from the old rest pose.
        let pose = Pose::from_axis_angles(&body.skeleton, &[DVec3::Y, DVec3::X], DVec3::X);
        let [old, new] = [&body, &turned].map(|body| PosedBody::new(body, &pose).unwrap().vertices());
        assert!((old[0] - new[0]).length() < 1e-12 && (old[1] - new[1]).length() < 1e-12);
    }

    /// What can be read as an `f64` and not be squared.
    #[test]
    fn coordinates_beyond_what_can_be_squared_are_refused_by_name() {
        let mut body = arm();
        body.vertices[2].y = 1e160;
        assert_eq!(body.validate().unwrap_err().field, "v_template[2]");
        let direction = vec![Vec3::ZERO, Vec3::X, Vec3::ZERO];
        let shape =
            ShapeSpace { directions: vec![direction], expressions: Vec::new(), joint_regressor: Vec::new() };
        let model = Body { rest: arm(), shape: Some(shape) };
        model.shaped(&[1e9]).unwrap().validate().unwrap();
        for beta in [1e13, 1e160, -1e300] {
            let error = model.shaped(&[beta]).unwrap_err();
            assert_eq!(error.field, "betas");
            assert!(error.problem.starts_with("they move vertex 1 to"), "{error}");
        }
    }
}
