//! How far the subject's surface lies outside of its body: offsets along the normals that bring the body's outline onto
//! the outline of the training masks.

use super::Error;
use super::fill::Neighbours;
use super::gather::{Gathering, Parts, gather};
use super::options::{Clothing, Sighting};
use super::sighting::{Frame, Observation, SurfacePoint};
use super::tessellation::{Tessellation, vertices_with_faces};
use glam::{DVec2, DVec3};
use skinsplat_core::math::sh;
use skinsplat_core::scene::Mask;
use skinsplat_data::sequence::Sequence;
use skinsplat_render::mesh::{Mesh, SamplePattern, silhouette};
use std::sync::Arc;

/// Offsets along the rest normals of a sequence's body, metres, one per vertex. All zero for no rounds. Points are
/// taken as hidden by the depth buffers of `sighting`.
///
/// # Errors
/// A sequence whose body, cameras or poses break an invariant, a frame that cannot be read.
pub fn offsets_from_outlines(
    sequence: &Sequence,
    options: &Clothing,
    sighting: &Sighting,
) -> Result<Vec<f32>, Error> {
    options.check("clothing")?;
    let body = &*sequence.body;
    let mut offsets = vec![0.0f32; body.vertices.len()];
    let neighbours = Neighbours::of_vertices(body.vertices.len(), &body.faces);
    let vertices = vertices_with_faces(body);
    let sites = Tessellation::of(body).vertex_sites();
    let parts = Parts::single_points(sites);
    for _ in 0..options.rounds {
        let current = with_offsets(sequence, &offsets)?;
        let outline = |frame: &Frame<'_>| {
            let mesh = Mesh::new(&frame.body.mesh().vertices, &frame.body.rest.faces);
            mesh.and_then(|mesh| silhouette(&mesh, frame.camera, SamplePattern::new(2)))
                .map_err(Error::scene(sequence))
        };
        let residual = Gathering { origin: 0.0, ..Gathering::mean(sighting) };
        let moved =
            |frame: &Frame<'_>, drawn: &Mask, point: &SurfacePoint| observe(options, frame, drawn, point);
        let found = gather(&current, &parts, residual, outline, moved)?;
        let (mut steps, mut confidence) = (vec![0.0; offsets.len()], vec![0.0; offsets.len()]);
        for (part, &vertex) in vertices.iter().enumerate() {
            steps[vertex] = f64::from(found.of(part)[0][0]) * sh::C0;
            confidence[vertex] = f64::from(found.confidence[part]);
        }
        let target: Vec<f64> = offsets.iter().zip(&steps).map(|(&o, s)| f64::from(o) + s).collect();
        offsets = smoothed(options, &target, &confidence, &neighbours);
    }
    Ok(offsets)
}

/// The sequence with its body moved by [`offsets_from_outlines`].
pub(super) fn dressed(
    sequence: &Sequence,
    options: &Clothing,
    sighting: &Sighting,
) -> Result<Sequence, Error> {
    with_offsets(sequence, &offsets_from_outlines(sequence, options, sighting)?)
}

fn with_offsets(sequence: &Sequence, offsets: &[f32]) -> Result<Sequence, Error> {
    let body = (*sequence.body).clone().with_normal_offset(offsets).map_err(Error::scene(sequence))?;
    Ok(Sequence { body: Arc::new(body), ..sequence.clone() })
}

/// How far a point on the outline of the drawn body must move along its normal to reach the true outline, metres, as the
/// first channel of a colour.
fn observe(options: &Clothing, frame: &Frame<'_>, drawn: &Mask, point: &SurfacePoint) -> Observation {
    let (position, normal) = frame.posed(point);
    let unseen = Observation::unseen(position);
    let world = position.as_dvec3();
    let view = (frame.eye - world).normalize_or_zero();
    let facing = normal.dot(view);
    if normal == DVec3::ZERO || facing.abs() > options.most_facing {
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
    if is_hidden(frame, pixel, depth - options.hidden) {
        return unseen;
    }
    let (Some(own), Some(wanted)) =
        (crossing(options, drawn, pixel, direction), crossing(options, &frame.truth.alpha, pixel, direction))
    else {
        return unseen;
    };
    if own.abs() > options.on_outline {
        return unseen;
    }
    let slant = facing / options.most_facing;
    let weight = 1.0 - slant * slant;
    Observation { colour: [((wanted - own) / scale) as f32, 0.0, 0.0], weight: weight as f32, position }
}

/// True if another part of the body around a pixel is nearer than a depth.
fn is_hidden(frame: &Frame<'_>, pixel: DVec2, depth: f64) -> bool {
    let (width, height) = (frame.depth.width(), frame.depth.height());
    let scale = width as f64 / f64::from(frame.camera.width);
    let near = |position: f64, size: usize| {
        let centre = (position * scale).clamp(0.0, (size - 1) as f64) as usize;
        centre.saturating_sub(2)..(centre + 3).min(size)
    };
    near(pixel.y, height).any(|y| near(pixel.x, width).any(|x| f64::from(frame.depth.depth(x, y)) < depth))
}

/// Where a mask falls below one half along a line: outwards (positive) from a covered start, inwards from an uncovered
/// one; pixels. `None` if it does not within the reach or the line leaves the image.
fn crossing(options: &Clothing, mask: &Mask, start: DVec2, direction: DVec2) -> Option<f64> {
    let steps = options.steps_per_pixel;
    let first = mask_at(mask, start)?;
    let sign = if first >= 0.5 { 1.0 } else { -1.0 };
    let mut previous = first;
    for step in 1..=(options.reach * steps) as usize {
        let distance = sign * step as f64 / steps;
        let value = mask_at(mask, start + direction * distance)?;
        if (value >= 0.5) != (previous >= 0.5) {
            let part = (0.5 - previous) / (value - previous);
            return Some(sign * (step as f64 - 1.0 + f64::from(part)) / steps);
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
/// `Σ confidence (x - target)² + smoothness Σ (x_i - x_j)² + shrinkage Σ x²`.
fn smoothed(options: &Clothing, target: &[f64], confidence: &[f64], neighbours: &Neighbours) -> Vec<f32> {
    let Clothing { smoothness, shrinkage, .. } = options;
    let mut x: Vec<f64> =
        target.iter().zip(confidence).map(|(&t, &c)| if c > 0.0 { t } else { 0.0 }).collect();
    for _ in 0..options.smoothing_steps {
        for i in 0..x.len() {
            let around = neighbours.of(i);
            let sum: f64 = around.iter().map(|&j| x[j as usize]).sum();
            let pulled = confidence[i] * target[i] + smoothness * sum;
            x[i] = pulled / (confidence[i] + smoothness * around.len() as f64 + shrinkage);
        }
    }
    x.into_iter().map(|v| v as f32).collect()
}
