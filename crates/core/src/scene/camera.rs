//! Pinhole cameras with OpenCV axes: x right, y down, z forward; `u = fx x/z + cx`; pixel centres at +0.5.

use super::SceneError;
use glam::{DMat4, DVec2, DVec3};

/// A pinhole camera without distortion.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Horizontal focal length, pixels.
    pub fx: f64,
    /// Vertical focal length, pixels.
    pub fy: f64,
    /// Principal point, pixels from the left edge (`width / 2` when centred).
    pub cx: f64,
    /// Principal point, pixels from the top edge.
    pub cy: f64,
    /// Affine world-to-camera transform. Its linear part may be a reflection (left-handed worlds): it is never turned
    /// into a quaternion.
    pub camera_from_world: DMat4,
}

/// No image side above this is accepted: twice the 8,192 of the largest cameras, since some are drawn at twice their size.
pub const MAX_IMAGE_SIDE: u32 = 1 << 14;
/// No image of more pixels than this is accepted: a header or a typo must not cause an allocation of many gigabytes. A
/// frame of so many pixels takes 1.3 GB to draw.
pub const MAX_IMAGE_PIXELS: u64 = 1 << 26;

/// Checks the size of an image before memory is asked for.
///
/// # Errors
/// No pixels, more than [`MAX_IMAGE_SIDE`] on a side (`width` or `height`), more than [`MAX_IMAGE_PIXELS`] in all (`size`).
pub fn check_image_size(width: u32, height: u32) -> Result<(), SceneError> {
    for (field, side) in [("width", width), ("height", height)] {
        if side == 0 || side > MAX_IMAGE_SIDE {
            return Err(SceneError::new(field, format!("{side} pixels"), format!("1 to {MAX_IMAGE_SIDE}")));
        }
    }
    if u64::from(width) * u64::from(height) > MAX_IMAGE_PIXELS {
        let expected = format!("at most {MAX_IMAGE_PIXELS} pixels in all");
        return Err(SceneError::new("size", format!("{width}x{height} pixels"), expected));
    }
    Ok(())
}

impl Camera {
    /// Checks every invariant: a size that [`check_image_size`] accepts, finite and positive focal lengths, finite principal
    /// point, finite and invertible affine transform.
    ///
    /// # Errors
    /// Names the first field that is wrong.
    pub fn validate(&self) -> Result<(), SceneError> {
        check_image_size(self.width, self.height)?;
        for (field, focal) in [("fx", self.fx), ("fy", self.fy)] {
            if !(focal.is_finite() && focal > 0.0) {
                return Err(SceneError::new(
                    field,
                    format!("focal length {focal}"),
                    "a finite number above 0",
                ));
            }
        }
        for (field, centre) in [("cx", self.cx), ("cy", self.cy)] {
            if !centre.is_finite() {
                return Err(SceneError::new(field, format!("{centre}"), "a finite number of pixels"));
            }
        }
        let m = self.camera_from_world;
        if !m.is_finite() {
            return Err(SceneError::new("world_to_camera", "not finite", "16 finite numbers"));
        }
        if (m.row(3) - glam::DVec4::W).abs().max_element() > 1e-9 {
            return Err(SceneError::new("world_to_camera", "last row is not 0 0 0 1", "an affine transform"));
        }
        if glam::DMat3::from_mat4(m).determinant().abs() < 1e-12 {
            return Err(SceneError::new("world_to_camera", "singular", "an invertible transform"));
        }
        Ok(())
    }

    /// The camera centre in world coordinates.
    #[inline]
    pub fn position(&self) -> DVec3 {
        self.camera_from_world.inverse().w_axis.truncate()
    }

    /// Pixel coordinates and depth (camera z) of a world point; `None` at or behind the camera plane.
    pub fn project(&self, world: DVec3) -> Option<(DVec2, f64)> {
        let p = self.camera_from_world.transform_point3(world);
        (p.z > 0.0).then(|| (DVec2::new(self.fx * p.x / p.z + self.cx, self.fy * p.y / p.z + self.cy), p.z))
    }

    /// The same view at another resolution (the field of view is kept, also when the aspect changes).
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let (sx, sy) = (f64::from(width) / f64::from(self.width), f64::from(height) / f64::from(self.height));
        Self {
            width,
            height,
            fx: self.fx * sx,
            fy: self.fy * sy,
            cx: self.cx * sx,
            cy: self.cy * sy,
            ..self.clone()
        }
    }

    /// A camera at `eye` that looks at `target`, with `up` towards the top of the image and the principal point in the
    /// image centre.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, focal: f64, width: u32, height: u32) -> Self {
        let z = (target - eye).normalize();
        let x = z.cross(up).normalize();
        let y = z.cross(x);
        let rotation = glam::DMat3::from_cols(x, y, z).transpose();
        let camera_from_world = DMat4::from_mat3(rotation) * DMat4::from_translation(-eye);
        let (cx, cy) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
        Self { width, height, fx: focal, fy: focal, cx, cy, camera_from_world }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn look_at_puts_the_target_in_the_centre_and_up_at_the_top() {
        let eye = DVec3::new(0.35, 1.15, 2.9);
        let camera = Camera::look_at(eye, DVec3::Y, DVec3::Y, 700.0, 640, 480);
        camera.validate().unwrap();
        assert!((camera.position() - eye).length() < 1e-12);
        let (centre, depth) = camera.project(DVec3::Y).unwrap();
        assert!(
            (centre - DVec2::new(320.0, 240.0)).length() < 1e-9
                && (depth - (eye - DVec3::Y).length()).abs() < 1e-12
        );
        assert!(camera.project(DVec3::Y * 1.1).unwrap().0.y < 240.0, "up is towards row 0");
        assert!(camera.project(eye * 2.0).is_none(), "behind");
    }

    #[test]
    fn sizes_that_no_memory_should_be_asked_for_are_refused_by_name() {
        for (width, height, field) in [
            (0, 8, "width"),
            (8, MAX_IMAGE_SIDE + 1, "height"),
            (32_768, 32_768, "width"),
            (8193, 8192, "size"),
            (MAX_IMAGE_SIDE, 4097, "size"),
        ] {
            let camera = Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, 100.0, width, height);
            assert_eq!(camera.validate().unwrap_err().field, field, "{width}x{height}");
        }
        for (width, height) in [(8192, 8192), (MAX_IMAGE_SIDE, 4096), (1, 1)] {
            Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, 100.0, width, height).validate().unwrap();
        }
    }

    #[test]
    fn zero_focal_length_is_refused_by_name() {
        let mut camera = Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, 100.0, 8, 8);
        camera.fy = 0.0;
        assert_eq!(camera.validate().unwrap_err().field, "fy");
    }
}
