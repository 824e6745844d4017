//! How far the subject's surface lies outside of its body: offsets along the normals that bring the body's outline onto
//! the outline of the training masks.

use super::Error;
use super::fill::Neighbours;
use super::gather::{Gathering, Parts, gather};
use super::sighting::{Frame, Observation, SurfacePoint};
use super::tessellation::{Tessellation, vertices_with_faces};
use glam::{DVec2, DVec3};
use skinsplat_core::math::sh;
use skinsplat_core::scene::Mask;
use skinsplat_data::sequence::Sequence;
use skinsplat_render::mesh::{Mesh, SamplePattern, silhouette};
use std::sync::Arc;

/// How far along the normal an outline is looked for, pixels.
const REACH: f64 = 12.0;
/// Steps per pixel along the normal.
const STEPS: f64 = 4.0;
/// A point takes part where the cosine between its normal and the view is at most this: on the outline it is zero.
const MOST_FACING: f64 = 0.35;
/// A point lies on the body's outline if that is within so many pixels of it.
const ON_OUTLINE: f64 = 2.0;
/// Something this much nearer hides a point, metres.
const HIDDEN: f64 = 0.03;
/// Pull of each vertex towards its neighbours, in observations per neighbour, and towards no offset.
const SMOOTHNESS: f64 = 1.0;
const SHRINKAGE: f64 = 0.05;
/// Steps of the smoothing.
const SMOOTHING_STEPS: usize = 200;

/// Offsets along the rest normals of a sequence's body, metres, one per vertex, found in `rounds` rounds. All zero for no
/// rounds.
///
/// # Errors
/// A sequence whose body, cameras or poses break an invariant, a frame that cannot be read.
pub fn offsets_from_outlines(sequence: &Sequence, rounds: usize) -> Result<Vec<f32>, Error> {
    let body = &*sequence.body;
    let mut offsets = vec![0.0f32; body.vertices.len()];
    let neighbours = Neighbours::of_vertices(body.vertices.len(), &body.faces);
    let vertices = vertices_with_faces(body);
    let sites = Tessellation::new(body, f64::INFINITY).vertex_sites();
    let parts = Parts::single_points(sites);
    for _ in 0..rounds {
        let current = with_offsets(sequence, &offsets)?;
        let outline = |frame: &Frame<'_>| {
            let mesh = Mesh::new(&frame.body.mesh().vertices, &frame.body.rest.faces);
            mesh.and_then(|mesh| silhouette(&mesh, frame.camera, SamplePattern::new(2)))
                .map_err(Error::scene(sequence))
        };
        let residual = Gathering { origin: 0.0, ..Gathering::MEAN };
        let found = gather(&current, &parts, residual, outline, observe)?;
        let (mut steps, mut confidence) = (vec![0.0; offsets.len()], vec![0.0; offsets.len()]);
        for (part, &vertex) in vertices.iter().enumerate() {
            steps[vertex] = f64::from(found.of(part)[0][0]) * sh::C0;
            confidence[vertex] = f64::from(found.confidence[part]);
        }
        let target: Vec<f64> = offsets.iter().zip(&steps).map(|(&o, s)| f64::from(o) + s).collect();
        offsets = smoothed(&target, &confidence, &neighbours);
    }
    Ok(offsets)
}

/// The sequence with its body moved by [`offsets_from_outlines`].
pub(super) fn dressed(sequence: &Sequence, rounds: usize) -> Result<Sequence, Error> {
    with_offsets(sequence, &offsets_from_outlines(sequence, rounds)?)
}

fn with_offsets(sequence: &Sequence, offsets: &[f32]) -> Result<Sequence, Error> {
    let body = (*sequence.body).clone().with_normal_offset(offsets).map_err(Error::scene(sequence))?;
    Ok(Sequence { body: Arc::new(body), ..sequence.clone() })
}

/// How far a point on the outline of the drawn body must move along its normal to reach the true outline, metres, as the
/// first channel of a colour.
fn observe(frame: &Frame<'_>, drawn: &Mask, point: &SurfacePoint) -> Observation {
    let (position, normal) = frame.posed(point);
    let unseen = Observation::unseen(position);
    let world = position.as_dvec3();
    let view = (frame.eye - world).normalize_or_zero();
    let facing = normal.dot(view);
    if normal == DVec3::ZERO || facing.abs() > MOST_FACING {
        return unseen;
    }
    // a small step across the view shows where the normal points in the image, and how long a metre is there
    let across = normal - view * facing;
    let step = 1e-3;
    let (Some((pixel, depth)), Some((beyond, _))) =
        (frame.camera.project(world), frame.camera.project(world + across * step))
    else {
        return unseen;
    };
    let pixels_per_metre = (beyond - pixel) / step;
    let scale = pixels_per_metre.length();
    let Some(direction) = pixels_per_metre.try_normalize() else { return unseen };
    if is_hidden(frame, pixel, depth) {
        return unseen;
    }
    let (Some(own), Some(wanted)) =
        (crossing(drawn, pixel, direction), crossing(&frame.truth.alpha, pixel, direction))
    else {
        return unseen;
    };
    if own.abs() > ON_OUTLINE {
        return unseen;
    }
    let weight = 1.0 - (facing / MOST_FACING).powi(2);
    Observation { colour: [((wanted - own) / scale) as f32, 0.0, 0.0], weight: weight as f32, position }
}

/// True if another part of the body is in front of a point.
fn is_hidden(frame: &Frame<'_>, pixel: DVec2, depth: f64) -> bool {
    let (width, height) = (frame.depth.width(), frame.depth.height());
    let scale = width as f64 / f64::from(frame.camera.width);
    let near = |position: f64, size: usize| {
        let centre = (position * scale).clamp(0.0, (size - 1) as f64) as usize;
        centre.saturating_sub(2)..(centre + 3).min(size)
    };
    near(pixel.y, height)
        .any(|y| near(pixel.x, width).any(|x| f64::from(frame.depth.depth(x, y)) < depth - HIDDEN))
}

/// Where a mask falls below one half along a line: outwards (positive) from a covered start, inwards from an uncovered
/// one; pixels. `None` if it does not within [`REACH`] or the line leaves the image.
fn crossing(mask: &Mask, start: DVec2, direction: DVec2) -> Option<f64> {
    let first = mask_at(mask, start)?;
    let sign = if first >= 0.5 { 1.0 } else { -1.0 };
    let mut previous = first;
    for step in 1..=(REACH * STEPS) as usize {
        let distance = sign * step as f64 / STEPS;
        let value = mask_at(mask, start + direction * distance)?;
        if (value >= 0.5) != (previous >= 0.5) {
            let part = (0.5 - previous) / (value - previous);
            return Some(sign * (step as f64 - 1.0 + f64::from(part)) / STEPS);
        }
        previous = value;
    }
    None
}

/// Bilinear interpolation of a mask; `None` outside of the image.
fn mask_at(mask: &Mask, pixel: DVec2) -> Option<f32> {
    let (width, height) = (mask.width() as f64, mask.height() as f64);
    if !(pixel.x >= 0.5 && pixel.y >= 0.5 && pixel.x < width - 0.5 && pixel.y < height - 0.5) {
        return None;
    }
    let corner = (pixel - 0.5).floor();
    let fraction = (pixel - 0.5 - corner).as_vec2();
    let (x, y) = (corner.x as usize, corner.y as usize);
    let (right, below) = ((x + 1).min(mask.width() - 1), (y + 1).min(mask.height() - 1));
    let upper = mask.at(x, y) * (1.0 - fraction.x) + mask.at(right, y) * fraction.x;
    let lower = mask.at(x, below) * (1.0 - fraction.x) + mask.at(right, below) * fraction.x;
    Some(upper * (1.0 - fraction.y) + lower * fraction.y)
}

/// The offsets that are near the targets where these are known, and smooth: Gauss-Seidel steps on
/// `Σ confidence (x - target)² + SMOOTHNESS Σ (x_i - x_j)² + SHRINKAGE Σ x²`.
fn smoothed(target: &[f64], confidence: &[f64], neighbours: &Neighbours) -> Vec<f32> {
    let mut x: Vec<f64> =
        target.iter().zip(confidence).map(|(&t, &c)| if c > 0.0 { t } else { 0.0 }).collect();
    for _ in 0..SMOOTHING_STEPS {
        for i in 0..x.len() {
            let around = neighbours.of(i);
            let sum: f64 = around.iter().map(|&j| x[j as usize]).sum();
            let pulled = confidence[i] * target[i] + SMOOTHNESS * sum;
            x[i] = pulled / (confidence[i] + SMOOTHNESS * around.len() as f64 + SHRINKAGE);
        }
    }
    x.into_iter().map(|v| v as f32).collect()
}
