//! Where points of a body's surface are seen in a frame, and how far each sight can be trusted.

use super::Error;
use super::options::Sighting;
use glam::{DVec2, DVec3, Vec3};
use skinsplat_core::math::portable;
use skinsplat_core::scene::{Camera, Image, Mask, PosedBody};
use skinsplat_data::sequence::{Sequence, Truth};
use skinsplat_render::mesh::{Mesh, VisibleFaces, visible_faces};

/// A point on a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SurfacePoint {
    pub(super) face: u32,
    pub(super) barycentric: [f32; 3],
}

/// What a frame says about a surface point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Observation {
    pub(super) colour: [f32; 3],
    /// Zero if the point is not seen.
    pub(super) weight: f32,
    /// World position of the point in the frame's pose, metres.
    pub(super) position: Vec3,
}

impl Observation {
    /// The point is not seen.
    pub(super) fn unseen(position: Vec3) -> Self {
        Self { colour: [0.0; 3], weight: 0.0, position }
    }
}

/// A frame with its truth and the posed surface in front of its camera.
pub(super) struct Frame<'a> {
    pub(super) camera: &'a Camera,
    pub(super) body: PosedBody<'a>,
    pub(super) truth: Truth,
    pub(super) depth: VisibleFaces,
    pub(super) eye: DVec3,
    sighting: &'a Sighting,
}

impl<'a> Frame<'a> {
    /// Loads and poses frame `index` of a sequence.
    pub(super) fn load(sequence: &'a Sequence, index: usize, sighting: &'a Sighting) -> Result<Self, Error> {
        let truth = sequence.truth(index)?;
        let frame = &sequence.frames[index];
        let (pose, camera) = (&sequence.poses[frame.pose], &sequence.cameras[frame.camera]);
        let in_scene = Error::scene(sequence);
        let body = PosedBody::new(&sequence.body, pose).map_err(&in_scene)?;
        let finer = sighting.oversampling;
        let fine = camera.resized(camera.width * finer, camera.height * finer);
        let mesh = Mesh::new(&body.mesh().vertices, &sequence.body.faces).map_err(&in_scene)?;
        let depth = visible_faces(&mesh, &fine).map_err(&in_scene)?;
        Ok(Self { camera, truth, depth, eye: camera.position(), body, sighting })
    }

    /// What `image`, of the frame's size, shows at a surface point.
    pub(super) fn observe(&self, point: &SurfacePoint, image: &Image) -> Observation {
        let options = self.sighting;
        let (position, normal) = self.posed(point);
        let unseen = Observation::unseen(position);
        let facing = normal.dot((self.eye - position.as_dvec3()).normalize_or_zero());
        if facing < options.least_facing {
            return unseen;
        }
        let Some((pixel, depth)) = self.camera.project(position.as_dvec3()) else { return unseen };
        let Some(trust) = self.trust(pixel, depth, facing) else { return unseen };
        let (colour, coverage) = bilinear(image, &self.truth.alpha, pixel);
        if coverage < options.least_coverage {
            return unseen;
        }
        let covered = if coverage < options.full_coverage { options.beside_outline } else { 1.0 };
        let weight = portable::powi(facing, options.facing_power) * trust * covered;
        Observation { colour, weight: weight as f32, position }
    }

    /// World position and unit normal of a surface point; a zero normal where all faces around it are degenerate.
    pub(super) fn posed(&self, point: &SurfacePoint) -> (Vec3, DVec3) {
        let mesh = self.body.mesh();
        let corners = self.body.rest.faces[point.face as usize].map(|i| i as usize);
        let mix = |values: &[Vec3]| -> Vec3 {
            corners.iter().zip(point.barycentric).map(|(&i, b)| values[i] * b).sum()
        };
        (mix(&mesh.vertices), mix(&mesh.normals).normalize_or_zero().as_dvec3())
    }

    /// Looks at the depth buffer around a point: `None` if it is hidden, less than one beside an edge.
    fn trust(&self, pixel: DVec2, depth: f64, facing: f64) -> Option<f64> {
        let options = self.sighting;
        let finer = f64::from(options.oversampling);
        let sample = pixel * finer;
        let (width, height) = (self.depth.width() as isize, self.depth.height() as isize);
        if !(sample.x >= 0.0 && sample.y >= 0.0 && sample.x < width as f64 && sample.y < height as f64) {
            return None;
        }
        // depth changes by this much per sample along the steepest direction of the surface
        let tangent = (1.0 - facing * facing).max(0.0).sqrt() / facing;
        let slope = depth / (self.camera.fx.min(self.camera.fy) * finer) * tangent;
        let (x, y) = (sample.x as isize, sample.y as isize);
        if depth > f64::from(self.depth.depth(x as usize, y as usize)) + options.depth_tolerance + slope {
            return None;
        }
        let radius = options.edge_radius as isize;
        let reach = radius as f64 + 1.0;
        let tolerance = 3.0 * options.depth_tolerance + reach * std::f64::consts::SQRT_2 * slope;
        let (mut nearest, mut farthest) = (f64::INFINITY, 0.0f64);
        for row in (y - radius).max(0)..=(y + radius).min(height - 1) {
            for column in (x - radius).max(0)..=(x + radius).min(width - 1) {
                let z = f64::from(self.depth.depth(column as usize, row as usize));
                nearest = nearest.min(z);
                farthest = farthest.max(z);
            }
        }
        let occluder = if nearest < depth - tolerance { options.beside_occluder } else { 1.0 };
        let outline = if farthest > depth + tolerance { options.beside_outline } else { 1.0 };
        Some(occluder * outline)
    }
}

/// Bilinear interpolation of straight colours, weighted by coverage, and the interpolated coverage.
fn bilinear(image: &Image, alpha: &Mask, pixel: DVec2) -> ([f32; 3], f32) {
    let axis = |position: f64, size: usize| {
        let clamped = (position - 0.5).clamp(0.0, (size - 1) as f64);
        let first = clamped as usize;
        (first, (first + 1).min(size - 1), (clamped - first as f64) as f32)
    };
    let (x0, x1, fx) = axis(pixel.x, image.width());
    let (y0, y1, fy) = axis(pixel.y, image.height());
    let corners = [
        (x0, y0, (1.0 - fx) * (1.0 - fy)),
        (x1, y0, fx * (1.0 - fy)),
        (x0, y1, (1.0 - fx) * fy),
        (x1, y1, fx * fy),
    ];
    let (mut sum, mut coverage) = ([0.0f32; 3], 0.0);
    for (x, y, weight) in corners {
        let weight = weight * alpha.at(x, y);
        let colour = image.at(x, y);
        sum = std::array::from_fn(|c| sum[c] + weight * colour[c]);
        coverage += weight;
    }
    (if coverage > 0.0 { sum.map(|s| s / coverage) } else { sum }, coverage)
}
