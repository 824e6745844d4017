//! Which way the faces of a body look: a mirrored body, or one whose faces are wound the other way, looks into itself.

use skinsplat_core::scene::{Pose, PosedBody, RestBody, SceneError};

/// A volume below this, of that of a cube with the area of the surface on one side, encloses nothing: a sphere has 0.094, a
/// standing person 0.03.
const OPEN: f64 = 0.004;
/// The sum of the areas as vectors, of the sum of their lengths: 0 of a closed surface, which alone has a volume.
const CLOSED: f64 = 0.05;

/// What has to be said of a body whose faces look inwards at rest.
pub(super) fn note(rest: &RestBody) -> Result<Option<String>, SceneError> {
    let body = PosedBody::with_rotations(rest, &Pose::rest(&rest.skeleton), |_| false)?;
    let vertices = &body.mesh().vertices;
    let count = vertices.len().max(1) as f64;
    let middle = vertices.iter().map(|v| v.as_dvec3()).sum::<glam::DVec3>() / count;
    let (mut volume, mut area, mut vectors) = (0.0, 0.0, glam::DVec3::ZERO);
    for face in &rest.faces {
        let [a, b, c] = face.map(|i| vertices[i as usize].as_dvec3() - middle);
        volume += a.dot(b.cross(c)) / 6.0;
        let vector = (b - a).cross(c - a) / 2.0;
        area += vector.length();
        vectors += vector;
    }
    let inwards = vectors.length() < CLOSED * area && volume < -OPEN * area * area.sqrt();
    Ok(inwards.then(|| {
        "faces look inwards (they enclose a volume below 0): the body is mirrored, or its faces are wound the other way".to_owned()
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use skinsplat_core::scene::{Skeleton, SkinWeights};

    /// A tetrahedron on one joint, every vertex scaled so.
    fn tetrahedron(scale: DVec3) -> RestBody {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let weights = SkinWeights::from_rows(vec![vec![(0, 1.0)]; 4], 1).unwrap();
        RestBody {
            skeleton: Skeleton::from_joint_positions(vec!["root".into()], vec![None], &[DVec3::ZERO])
                .unwrap(),
            vertices: corners.map(|corner| corner * scale).into(),
            faces: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
            weights,
            uv: None,
            pose_directions: Vec::new(),
        }
    }

    #[test]
    fn a_mirrored_body_looks_inwards_and_a_sheet_nowhere() {
        let said = |scale| note(&tetrahedron(scale)).unwrap();
        assert_eq!(said(DVec3::ONE), None);
        assert_eq!(said(DVec3::new(-1.0, -1.0, 2.0)), None);
        assert!(said(DVec3::new(-1.0, 1.0, 1.0)).unwrap().contains("mirrored"));
        assert!(said(DVec3::splat(-0.01)).is_some(), "whatever its size");
        let mut sheet = tetrahedron(DVec3::new(-1.0, 1.0, 1.0));
        sheet.faces.truncate(1);
        assert_eq!(note(&sheet).unwrap(), None);
    }
}
