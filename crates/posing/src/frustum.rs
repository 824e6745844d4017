//! What a camera surely does not see, so that it need not be rotated or coloured.

use super::blend::Blend;
use super::lanes::{LANES, Lanes};
use super::layout::Block;
use skinsplat_core::scene::Camera;
use skinsplat_core::scene::rasterizer::{
    DEVIATIONS, JACOBIAN_LIMIT, LEAST_DISCRIMINANT, LOW_PASS, NEAR, TILE,
};

/// At least what the low-pass and the floor under a square root can add to the larger eigenvalue of a screen covariance,
/// pixels².
const ADDED: f32 = 1.0;
const _: () = assert!(ADDED as f64 > LOW_PASS + LEAST_DISCRIMINANT && LEAST_DISCRIMINANT < 0.4);

/// What rounding may add to the radius, pixels, and how much of it.
const MARGIN: f32 = 3.0;
const SLACK: f32 = 1.01;

/// A camera, as a test for blocks. The test is the rasterizer's own (near plane; square of three standard deviations around
/// the centre, against tiles), with a bound in place of the covariance and a margin for rounding: what it culls is not
/// drawn.
pub(super) struct Frustum {
    rows: [[f32; 4]; 3],
    focal: [f32; 2],
    centre: [f32; 2],
    /// The last pixel that a tile covers, per axis.
    end: [f32; 2],
    /// Upper bound of the squared norm of both rows of the Jacobian at depth 1 together, pixels².
    stretch: f32,
}

impl Frustum {
    pub(super) fn new(camera: &Camera) -> Self {
        let m = camera.camera_from_world;
        let norm = |k: usize| m.row(k).truncate().length();
        let row = |k: usize, focal: f64, centre: f64, size: u32| {
            let size = f64::from(size);
            // The slope is clamped to this or, around a principal point outside the image, to more.
            let limit = JACOBIAN_LIMIT * (size + centre.abs()) / focal;
            let most = focal * (norm(k) + limit * norm(2));
            most * most
        };
        let stretch =
            row(0, camera.fx, camera.cx, camera.width) + row(1, camera.fy, camera.cy, camera.height);
        let end = [camera.width, camera.height].map(|size| (size as f32 / TILE as f32).ceil() * TILE as f32);
        Self {
            rows: [0, 1, 2].map(|k| m.row(k).as_vec4().to_array()),
            focal: [camera.fx as f32, camera.fy as f32],
            centre: [camera.cx as f32 - 0.5, camera.cy as f32 - 0.5],
            end,
            stretch: stretch as f32,
        }
    }

    /// The posed means of a block if none of its Gaussians can be seen.
    #[inline(always)]
    pub(super) fn culls(&self, block: &Block, blend: &Blend) -> Option<[Lanes; 3]> {
        let means = blend.transform(&block.means);
        let mut hidden = 0;
        for lane in 0..LANES {
            let [x, y, z] = [0, 1, 2].map(|k| {
                let row = &self.rows[k];
                row[0] * means[0][lane] + row[1] * means[1][lane] + row[2] * means[2][lane] + row[3]
            });
            let scale = block.scales[0][lane].max(block.scales[1][lane]).max(block.scales[2][lane]);
            let inverse = 1.0 / z;
            let radius =
                DEVIATIONS as f32 * (self.stretch * scale * scale * inverse * inverse + ADDED).sqrt() * SLACK
                    + MARGIN;
            let (u, v) =
                (x * inverse * self.focal[0] + self.centre[0], y * inverse * self.focal[1] + self.centre[1]);
            let (reach_u, reach_v) = (radius + u.abs() * 1e-4, radius + v.abs() * 1e-4);
            let magnitude = x.abs() + y.abs() + z.abs() + self.rows[2][3].abs();
            let behind = z < NEAR as f32 - 1e-4 * magnitude;
            let before = z > NEAR as f32;
            let off = (u + reach_u < 0.0)
                | (v + reach_v < 0.0)
                | (u - reach_u > self.end[0])
                | (v - reach_v > self.end[1]);
            hidden += u32::from(behind | (before & off));
        }
        (hidden as usize == LANES).then_some(means)
    }
}
