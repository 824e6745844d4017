//! What an optimiser of the shape needs of each frame: the mask, and where every vertex goes in the image as its offset
//! changes.

use super::ShapeOptions;
use super::surface::Surface;
use crate::Error;
use crate::silhouette::{self, Blur, Match, Window};
use glam::{DMat3, DVec2, DVec3, Vec3};
use skinsplat_core::scene::{Camera, Mask, PosedBody};
use skinsplat_data::sequence::Sequence;
use skinsplat_render::mesh::NEAR_PLANE;
use std::sync::Arc;

/// One frame: a filtered mask, and vertices in camera space as linear functions of their offsets. Posing is linear in the
/// rest position, so that Eq. 6 is evaluated once per frame and not once per step.
#[derive(Debug)]
pub(super) struct View {
    window: Window,
    mask: Vec<f32>,
    focal: DVec2,
    centre: DVec2,
    /// Vertices without an offset, metres.
    start: Vec<Vec3>,
    /// How they move per metre of offset.
    along: Vec<Vec3>,
}

/// Why a frame says nothing about the shape.
pub(super) type Unusable = &'static str;

impl View {
    /// Loads a frame, for offsets near `offsets`.
    pub(super) fn load(
        sequence: &Sequence,
        index: usize,
        surface: &Surface,
        offsets: &[f64],
        blur: &Blur,
        options: &ShapeOptions,
    ) -> Result<Result<Self, Unusable>, Error> {
        let truth = sequence.truth(index)?.alpha;
        if let Some(problem) = unusable_mask(&truth, options) {
            return Ok(Err(problem));
        }
        let frame = &sequence.frames[index];
        let camera = &sequence.cameras[frame.camera];
        camera.validate().map_err(Error::scene(sequence))?;
        let posed =
            PosedBody::new(&surface.body, &sequence.poses[frame.pose]).map_err(Error::scene(sequence))?;
        let mut view = Self::posed(&posed, surface, camera);
        let points = view.projected(offsets);
        let Some(body) = bounds(&points, &truth) else {
            return Ok(Err("the body's projection lies outside of the image"));
        };
        view.window = around(body, &truth, options.margin + 2 * blur.reach());
        let raw = cropped(&truth, view.window);
        if silhouette::common_area(&surface.topology, &points, view.window, &raw) <= 0.0 {
            return Ok(Err("the mask misses the body"));
        }
        let mut filtered: Vec<f64> = raw.iter().map(|&v| f64::from(v)).collect();
        blur.apply(&mut filtered, view.window.width);
        view.mask = filtered.into_iter().map(|v| v as f32).collect();
        Ok(Ok(view))
    }

    fn posed(posed: &PosedBody<'_>, surface: &Surface, camera: &Camera) -> Self {
        let to_camera = camera.camera_from_world;
        let linear = DMat3::from_mat4(to_camera);
        let start = posed.mesh().vertices.iter().map(|v| to_camera.transform_point3(v.as_dvec3()).as_vec3());
        let moved = |(vertex, normal): (usize, &DVec3)| {
            let (joints, weights) = surface.body.weights.row(vertex);
            let blended =
                |(&j, &w): (&u16, &f32)| posed.joints[usize::from(j)].linear * *normal * f64::from(w);
            (linear * joints.iter().zip(weights).map(blended).sum::<DVec3>()).as_vec3()
        };
        Self {
            window: Window { left: 0, top: 0, width: 0, height: 0 },
            mask: Vec::new(),
            focal: DVec2::new(camera.fx, camera.fy),
            centre: DVec2::new(camera.cx, camera.cy),
            start: start.collect(),
            along: surface.normals.iter().enumerate().map(moved).collect(),
        }
    }

    /// Bytes held.
    pub(super) fn size(&self) -> usize {
        size_of_val(&self.mask[..]) + size_of_val(&self.start[..]) + size_of_val(&self.along[..])
    }

    /// Pixel coordinates of every vertex; NaN at or behind the near plane.
    fn projected(&self, offsets: &[f64]) -> Vec<DVec2> {
        let project = |((start, along), &offset): ((&Vec3, &Vec3), &f64)| {
            let p = start.as_dvec3() + along.as_dvec3() * offset;
            if p.z > NEAR_PLANE { self.focal * p.truncate() / p.z + self.centre } else { DVec2::NAN }
        };
        self.start.iter().zip(&self.along).zip(offsets).map(project).collect()
    }

    /// The intersection over union with the mask, and its derivative by every offset, per metre.
    pub(super) fn compare(&self, surface: &Surface, offsets: &[f64], blur: &Blur) -> (f64, Vec<f64>) {
        let points = self.projected(offsets);
        let Match { iou, gradient } =
            silhouette::compare(&surface.topology, &points, self.window, &self.mask, blur);
        let by_offset = |(i, by_point): (usize, DVec2)| {
            if by_point == DVec2::ZERO {
                return 0.0;
            }
            let (start, along) = (self.start[i].as_dvec3(), self.along[i].as_dvec3());
            let p = start + along * offsets[i];
            let velocity = self.focal * (along.truncate() - p.truncate() * (along.z / p.z)) / p.z;
            by_point.dot(velocity)
        };
        (iou, gradient.into_iter().enumerate().map(by_offset).collect())
    }
}

fn unusable_mask(mask: &Mask, options: &ShapeOptions) -> Option<Unusable> {
    if mask.values().iter().any(|v| !v.is_finite()) {
        return Some("the mask has a value that is not finite");
    }
    let area: f64 = mask.values().iter().map(|&v| f64::from(v)).sum();
    if area < options.least_area {
        return Some("the mask is empty");
    }
    let covered = area / mask.values().len() as f64;
    (covered > options.most_covered).then_some("the mask covers the whole image")
}

/// First and last column and row of the pixels of an image that points lie in; `None` if there are none.
fn bounds(points: &[DVec2], image: &Mask) -> Option<[DVec2; 2]> {
    let size = DVec2::new(image.width() as f64, image.height() as f64);
    let inside = |p: &&DVec2| p.cmpge(DVec2::ZERO).all() && p.cmplt(size).all();
    let grown = |bounds: Option<[DVec2; 2]>, p: &DVec2| {
        Some(bounds.map_or([*p; 2], |[low, high]| [low.min(*p), high.max(*p)]))
    };
    points.iter().filter(inside).fold(None, grown)
}

/// The part of the image around a body and a mask.
fn around([low, high]: [DVec2; 2], mask: &Mask, margin: usize) -> Window {
    let (mut left, mut right) = (low.x as usize, high.x as usize);
    let (mut top, mut bottom) = (low.y as usize, high.y as usize);
    for (y, row) in mask.values().chunks_exact(mask.width()).enumerate() {
        for x in [row.iter().position(|&v| v > 0.0), row.iter().rposition(|&v| v > 0.0)].into_iter().flatten()
        {
            (left, right) = (left.min(x), right.max(x));
            (top, bottom) = (top.min(y), bottom.max(y));
        }
    }
    let (left, top) = (left.saturating_sub(margin), top.saturating_sub(margin));
    let right = (right + margin + 1).min(mask.width());
    let bottom = (bottom + margin + 1).min(mask.height());
    Window { left, top, width: right - left, height: bottom - top }
}

fn cropped(mask: &Mask, window: Window) -> Vec<f32> {
    let rows = mask.values().chunks_exact(mask.width()).skip(window.top).take(window.height);
    rows.flat_map(|row| &row[window.left..window.left + window.width]).copied().collect()
}

/// Memory that loaded frames may take together, bytes.
const BUDGET: usize = 512 << 20;

/// Views kept for the next time; those for which there is no room are loaded again. What is kept does not change any
/// result.
#[derive(Debug, Default)]
pub(super) struct Cache {
    views: Vec<Option<Arc<View>>>,
    size: usize,
}

impl Cache {
    pub(super) fn new(frames: usize) -> Self {
        Self { views: vec![None; frames], size: 0 }
    }

    pub(super) fn get(&self, frame: usize) -> Option<Arc<View>> {
        self.views[frame].clone()
    }

    pub(super) fn keep(&mut self, frame: usize, view: &Arc<View>) {
        if self.views[frame].is_none() && self.size + view.size() <= BUDGET {
            self.size += view.size();
            self.views[frame] = Some(view.clone());
        }
    }
}
