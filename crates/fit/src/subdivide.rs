//! Finer bodies: every triangle divided into four at the middles of its sides.

use super::tessellation::Middles;
use skinsplat_core::scene::{RestBody, SceneError, SkinWeights, body::Uv};

/// A body with four faces for every one of another body's, on the same surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Subdivided {
    /// The other body's vertices in their order, then one per edge in the order in which the faces name them. Face
    /// `4 f + k` is the part of face f at its corner k, face `4 f + 3` the middle one. Positions, weights, texture
    /// coordinates and pose directions are linear along the old edges; the skeleton is the same.
    pub body: RestBody,
    /// The ends of the edge in whose middle each new vertex lies.
    pub edges: Vec<[u32; 2]>,
}

impl Subdivided {
    /// Divides every face of a body.
    ///
    /// # Errors
    /// A body that breaks an invariant, or with too many vertices for 32-bit indices.
    pub fn new(body: &RestBody) -> Result<Self, SceneError> {
        body.validate()?;
        let count = body.vertices.len();
        // at most three edges per face
        if count + 3 * body.faces.len() > u32::MAX as usize {
            let problem = format!("{count} vertices and {} faces", body.faces.len());
            return Err(SceneError::new("f", problem, "counts whose subdivision has 32-bit indices"));
        }
        let mut middles = Middles::after(count);
        let faces = quartered(&body.faces, &mut middles);
        let edges = middles.edges;
        let pairs = || edges.iter().map(|&[a, b]| (a as usize, b as usize));
        let old_rows = (0..count).map(|i| {
            let (joints, weights) = body.weights.row(i);
            joints.iter().map(|&j| usize::from(j)).zip(weights.iter().copied()).collect()
        });
        let new_rows = pairs().map(|(a, b)| body.weights.mixed(&[(a, 0.5), (b, 0.5)]));
        let weights = SkinWeights::from_rows(old_rows.chain(new_rows), body.skeleton.num_joints())?;
        let mut vertices = body.vertices.clone();
        vertices.extend(pairs().map(|(a, b)| (body.vertices[a] + body.vertices[b]) / 2.0));
        let mut pose_directions = body.pose_directions.clone();
        for direction in &mut pose_directions {
            let new: Vec<_> = pairs().map(|(a, b)| (direction[a] + direction[b]) / 2.0).collect();
            direction.extend(new);
        }
        let uv = body.uv.as_ref().map(divided_uv);
        let body =
            RestBody { skeleton: body.skeleton.clone(), vertices, faces, weights, uv, pose_directions };
        Ok(Self { body, edges })
    }

    /// Values on the vertices of the finer body from values on those of the coarser one, linear along its edges.
    pub fn interpolated(&self, values: &[f32]) -> Vec<f32> {
        let middle = |&[a, b]: &[u32; 2]| (values[a as usize] + values[b as usize]) / 2.0;
        values.iter().copied().chain(self.edges.iter().map(middle)).collect()
    }
}

fn quartered(faces: &[[u32; 3]], middles: &mut Middles) -> Vec<[u32; 3]> {
    let mut parts = Vec::with_capacity(4 * faces.len());
    for &[a, b, c] in faces {
        let (ab, bc, ca) = (middles.of(a, b), middles.of(b, c), middles.of(c, a));
        parts.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    parts
}

fn divided_uv(uv: &Uv) -> Uv {
    let mut middles = Middles::after(uv.coordinates.len());
    let faces = quartered(&uv.faces, &mut middles);
    let mut coordinates = uv.coordinates.clone();
    for [a, b] in middles.edges {
        let (p, q) = (coordinates[a as usize], coordinates[b as usize]);
        coordinates.push([(p[0] + q[0]) / 2.0, (p[1] + q[1]) / 2.0]);
    }
    Uv { coordinates, faces }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3};
    use skinsplat_core::scene::{Pose, PosedBody, Skeleton};

    /// Two triangles that share a side on the surface but not in the atlas, two joints, one pose direction, and a vertex
    /// without a face.
    fn kite() -> RestBody {
        let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.5), DVec3::Z];
        let names = vec!["root".into(), "tip".into()];
        let rows =
            [vec![(0, 1.0)], vec![(1, 1.0)], vec![(0, 0.25), (1, 0.75)], vec![(1, 1.0)], vec![(0, 1.0)]];
        RestBody {
            skeleton: Skeleton::from_joint_positions(names, vec![None, Some(0)], &[DVec3::ZERO, DVec3::X])
                .unwrap(),
            weights: SkinWeights::from_rows(rows, 2).unwrap(),
            pose_directions: vec![(0..5).map(|i| Vec3::splat(i as f32)).collect()],
            vertices,
            faces: vec![[0, 1, 2], [2, 1, 3]],
            uv: Some(Uv {
                coordinates: (0..6).map(|i| [i as f32, 0.5 * i as f32]).collect(),
                faces: vec![[0, 1, 2], [3, 4, 5]],
            }),
        }
    }

    #[test]
    fn everything_is_linear_along_the_old_edges() {
        let body = kite();
        let fine = Subdivided::new(&body).unwrap();
        fine.body.validate().unwrap();
        assert_eq!(fine.edges, [[0, 1], [1, 2], [0, 2], [1, 3], [2, 3]], "a shared side has one middle");
        assert_eq!(fine.body.faces.len(), 8);
        assert_eq!(fine.body.faces[..4], [[0, 5, 7], [5, 1, 6], [7, 6, 2], [5, 6, 7]]);
        assert_eq!(fine.body.vertices[6], DVec3::new(0.5, 0.5, 0.0));
        assert_eq!(fine.body.weights.row(6), (&[0u16, 1][..], &[0.125f32, 0.875][..]));
        assert_eq!(fine.body.pose_directions[0][9], Vec3::splat(2.5));
        let uv = fine.body.uv.as_ref().unwrap();
        assert_eq!(uv.coordinates.len(), 12, "the seam stays open");
        assert_eq!(uv.coordinates[uv.faces[7][0] as usize], [3.5, 1.75]);
        assert_eq!(fine.interpolated(&[0.0, 2.0, 4.0, 8.0, 1.0])[5..], [1.0, 3.0, 2.0, 5.0, 6.0]);
    }

    #[test]
    fn areas_and_orientations_are_kept() {
        let body = kite();
        let fine = Subdivided::new(&body).unwrap().body;
        let area = |body: &RestBody, f: usize| {
            let [a, b, c] = body.faces[f].map(|i| body.vertices[i as usize]);
            (b - a).cross(c - a)
        };
        for f in 0..fine.faces.len() {
            assert!((area(&fine, f) * 4.0 - area(&body, f / 4)).length() < 1e-15);
        }
    }

    #[test]
    fn posing_a_rigid_part_and_dividing_it_commute() {
        let body = RestBody { pose_directions: Vec::new(), ..kite() };
        let rigid = SkinWeights::from_rows((0..5).map(|_| [(1, 1.0)]), 2).unwrap();
        let body = RestBody { weights: rigid, ..body };
        let fine = Subdivided::new(&body).unwrap();
        let pose = Pose::from_axis_angles(&body.skeleton, &[DVec3::X, DVec3::new(0.3, 1.0, 0.0)], DVec3::Y);
        let posed = |b: &RestBody| PosedBody::new(b, &pose).unwrap().mesh().vertices.clone();
        let (coarse, moved) = (posed(&body), posed(&fine.body));
        for (new, &[a, b]) in moved[5..].iter().zip(&fine.edges) {
            assert!(((coarse[a as usize] + coarse[b as usize]) / 2.0 - *new).length() < 1e-6);
        }
    }

    #[test]
    fn a_body_with_foreign_indices_is_refused() {
        let body = RestBody { faces: vec![[0, 1, 9]], uv: None, ..kite() };
        assert_eq!(Subdivided::new(&body).unwrap_err().field, "f[0]");
    }
}
