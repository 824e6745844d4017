//! The text files that Unity scripts of GalaBasketball write: numbers with commas between them, and what they mean.
//!
//! Unity's world is left-handed. Everything is mirrored on its way in, (x, y, z) to (x, -y, z), so that the world is right-handed
//! and cameras are rotations again: with F = diag(1, -1, 1), a transform A becomes F A F, and a camera that looks along the z of
//! its own frame, y up, becomes an OpenCV camera, y down. Posed vertices project to the same pixels.

use crate::{Error, error};
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use skinsplat_core::math::portable;
use skinsplat_core::scene::Camera;
use std::path::Path;

/// A point, mirrored.
pub(super) fn point(v: &[f64]) -> DVec3 {
    DVec3::new(v[0], -v[1], v[2])
}

/// The rotation Ry Rx Rz of three angles in degrees, mirrored: of the other handedness, about the mirrored axis.
pub(super) fn rotation(degrees: &[f64]) -> DQuat {
    let about =
        |axis: DVec3, angle: f64| portable::from_axis_angle(axis, angle * (std::f64::consts::PI / 180.0));
    let unity = about(DVec3::Y, degrees[1]) * about(DVec3::X, degrees[0]) * about(DVec3::Z, degrees[2]);
    mirrored(unity)
}

fn mirrored(q: DQuat) -> DQuat {
    DQuat::from_xyzw(-q.x, q.y, -q.z, q.w)
}

/// An affine map of 16 numbers, row by row, mirrored.
pub(super) fn affine(rows: &[f64]) -> DAffine3 {
    let sign = [1.0, -1.0, 1.0];
    let entry = |r: usize, c: usize| rows[4 * r + c] * sign[r] * sign.get(c).copied().unwrap_or(1.0);
    let column = |c: usize| DVec3::new(entry(0, c), entry(1, c), entry(2, c));
    DAffine3::from_cols(column(0), column(1), column(2), column(3))
}

/// A camera: field of view in degrees from top to bottom, width, height; position; quaternion x y z w; scale.
///
/// # Errors
/// Other numbers of numbers, a field of view or size that is none, a scale that mirrors or is 0.
pub(super) fn camera(path: &Path) -> Result<Camera, Error> {
    let lines = numbers(path, "camera")?;
    let line = |i: usize, count: usize, what: &str| {
        lines.get(i).filter(|values| values.len() == count).ok_or_else(|| {
            let found = lines.get(i).map_or_else(|| "missing".to_owned(), |v| format!("{} numbers", v.len()));
            Error::invalid(path, format!("line {}", i + 1), found, format!("{count}: {what}"))
        })
    };
    let view = line(0, 3, "field of view, width, height")?;
    let (position, turn, scale) =
        (line(1, 3, "position")?, line(2, 4, "quaternion x y z w")?, line(3, 3, "scale")?);
    let side =
        |value: f64| if value.fract() == 0.0 && (1.0..=1e6).contains(&value) { value as u32 } else { 0 };
    let (width, height) = (side(view[1]), side(view[2]));
    if !(view[0] > 0.0 && view[0] < 180.0) {
        return Err(Error::invalid(
            path,
            "line 1",
            format!("a field of view of {}", view[0]),
            "0 to 180 degrees",
        ));
    }
    let rotation = DQuat::from_xyzw(turn[0], turn[1], turn[2], turn[3]);
    if rotation.length() <= 1e-6 {
        return Err(Error::invalid(path, "line 3", "a quaternion of length 0", "x y z w"));
    }
    if scale.iter().product::<f64>() <= 0.0 {
        let problem = format!("a scale of {}, {}, {}", scale[0], scale[1], scale[2]);
        return Err(Error::invalid(path, "line 4", problem, "1, 1, 1: a camera that does not mirror"));
    }
    let rotation = mirrored(rotation.normalize());
    let world_from_camera =
        DMat4::from_scale_rotation_translation(DVec3::from_slice(scale), rotation, point(position));
    let focal = f64::from(height) / 2.0 / portable::tan(view[0] * (std::f64::consts::PI / 360.0));
    let camera = Camera {
        width,
        height,
        fx: focal,
        fy: focal,
        cx: f64::from(width) / 2.0,
        cy: f64::from(height) / 2.0,
        camera_from_world: with_exact_last_row(world_from_camera.inverse()),
    };
    camera.validate().map_err(|e| Error::scene(path, e))?;
    Ok(camera)
}

/// An inverse whose last row is rounded to what it is.
fn with_exact_last_row(m: DMat4) -> DMat4 {
    DMat4::from_mat3_translation(DMat3::from_mat4(m), m.w_axis.truncate())
}

/// The numbers of every line that is not empty.
///
/// # Errors
/// A file that cannot be read, a word that is no finite number.
pub(super) fn numbers(path: &Path, field: &str) -> Result<Vec<Vec<f64>>, Error> {
    let text = error::read_text(path, field, "lines of numbers with commas between them")?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let number = |line: usize, word: &str| {
        let value: Option<f64> = word.parse().ok().filter(|v: &f64| v.is_finite());
        value.ok_or_else(|| {
            let problem = format!("{:?}", word.chars().take(40).collect::<String>());
            Error::invalid(path, format!("line {}", line + 1), problem, "a number")
        })
    };
    let words = |line: &'_ str| -> Vec<String> {
        line.split(',').map(|word| word.trim().to_owned()).filter(|word| !word.is_empty()).collect()
    };
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    lines.map(|(i, line)| words(line).iter().map(|word| number(i, word)).collect()).collect()
}

/// The lines of a file as groups of vectors: `group` lines each, with so many numbers.
///
/// # Errors
/// A number of lines that is no multiple, a line of another length.
pub(super) fn groups(path: &Path, field: &str, group: &[usize]) -> Result<Vec<Vec<Vec<f64>>>, Error> {
    let lines = numbers(path, field)?;
    if !lines.len().is_multiple_of(group.len()) || lines.is_empty() {
        let problem = format!("{} lines", lines.len());
        return Err(Error::invalid(path, field, problem, format!("a multiple of {}", group.len())));
    }
    for (i, line) in lines.iter().enumerate() {
        let count = group[i % group.len()];
        if count != 0 && line.len() != count {
            let problem = format!("{} numbers", line.len());
            return Err(Error::invalid(path, format!("line {}", i + 1), problem, count.to_string()));
        }
    }
    Ok(lines.chunks(group.len()).map(<[Vec<f64>]>::to_vec).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The authors' matrices, entry by entry, mirrored by hand.
    #[test]
    fn rotations_are_those_of_unity_mirrored() {
        let degrees = [20.0, -35.0, 70.0];
        let [x, y, z] = degrees.map(|d: f64| d.to_radians());
        let (c1, c2, c3) = (y.cos(), x.cos(), z.cos());
        let (s1, s2, s3) = (y.sin(), x.sin(), z.sin());
        let unity = [
            [c1 * c3 + s1 * s2 * s3, c3 * s1 * s2 - c1 * s3, c2 * s1],
            [c2 * s3, c2 * c3, -s2],
            [c1 * s2 * s3 - c3 * s1, c1 * c3 * s2 + s1 * s3, c1 * c2],
        ];
        let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
        let expected = flip * DMat3::from_cols_array_2d(&unity).transpose() * flip;
        let off = DMat3::from_quat(rotation(&degrees)) - expected;
        assert!(off.to_cols_array().iter().all(|v| v.abs() < 1e-12), "{off}");
    }

    #[test]
    fn a_point_lands_on_the_pixel_of_the_left_handed_camera() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("0.txt");
        std::fs::write(&path, "60, 320, 240\r\n1,2,-5\r\n0,0.38268343236,0,0.92387953251\r\n1,1,1\r\n")
            .unwrap();
        let camera = camera(&path).unwrap();
        assert!(DMat3::from_mat4(camera.camera_from_world).determinant() > 0.0);
        // In Unity: local = R^T (p - position), right x, up y, ahead z.
        let p = DVec3::new(1.5, 2.25, 0.5);
        let turn = DQuat::from_xyzw(0.0, 0.38268343236, 0.0, 0.92387953251).normalize();
        let local = turn.inverse() * (p - DVec3::new(1.0, 2.0, -5.0));
        let focal = 120.0 / (30.0f64).to_radians().tan();
        let expected = [160.0 + focal * local.x / local.z, 120.0 - focal * local.y / local.z];
        let (pixel, depth) = camera.project(point(&p.to_array())).unwrap();
        assert!(
            (pixel.x - expected[0]).abs() < 1e-9 && (pixel.y - expected[1]).abs() < 1e-9,
            "{pixel} {expected:?}"
        );
        assert!((depth - local.z).abs() < 1e-9);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("0.txt");
        for (text, field) in [
            ("60,320\n0,0,0\n0,0,0,1\n1,1,1\n", "line 1"),
            ("60,320,240\n0,0,x\n0,0,0,1\n1,1,1\n", "line 2"),
            ("60,320,240\n0,0,0\n0,0,0,0\n1,1,1\n", "line 3"),
            ("60,320,240\n0,0,0\n0,0,0,1\n", "line 4"),
            ("200,320,240\n0,0,0\n0,0,0,1\n1,1,1\n", "line 1"),
            ("60,320,240\n0,0,0\n0,0,0,1\n1,-1,1\n", "line 4"),
            ("60,320,240\n0,0,0\n0,0,0,1\n1,0,1\n", "line 4"),
            ("60,0,240\n0,0,0\n0,0,0,1\n1,1,1\n", "width"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = camera(&path).unwrap_err();
            assert_eq!(error.field(), field, "{error}");
        }
    }
}
