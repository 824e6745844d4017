//! Gaussians on the surface of a body, coloured by the training frames: an avatar before any optimiser, and what one
//! starts from.

use super::Error;
use super::disc::{self, Disc};
use super::fill::{Neighbours, fill_unknown};
use super::gather::{Colours, Gathering, Parts, ROBUST_SCALE, gather};
use super::sighting::SurfacePoint;
use crate::data::sequence::Sequence;
use crate::math::sh;
use crate::scene::body::vertex_normals;
use crate::scene::{Avatar, Binding, FaceBinding, Gaussians, RestBody, SkinWeights};
use glam::DVec3;

/// Where the Gaussians sit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Placement {
    /// One per vertex, bound by the vertex's skinning weights.
    Vertices,
    /// One per face, at its centroid, bound by the mean of its vertices' skinning weights.
    FaceWeights,
    /// One per face, at its centroid, bound to the face itself.
    Faces,
}

/// How a surface-initialised avatar is made. The defaults gave the best PSNR on held-out frames.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SurfaceInit {
    /// Where the Gaussians sit.
    pub placement: Placement,
    /// Standard deviations in the tangent plane, in units of those of the part of the surface that a Gaussian stands for.
    pub scale: f64,
    /// Standard deviation along the normal, in units of the mean one in the tangent plane.
    pub thickness: f64,
    /// Opacity of every Gaussian, in (0, 1).
    pub opacity: f64,
    /// How far below the surface the Gaussians sit, metres: a splat renderer widens every outline by its low-pass filter.
    pub inset: f64,
    /// SH degree of the colours, 0 to 3.
    pub sh_degree: usize,
    /// Pull of degrees 1 to 3 towards zero, relative to the observations.
    pub smoothness: f64,
}

impl Default for SurfaceInit {
    fn default() -> Self {
        Self {
            placement: Placement::Vertices,
            scale: 1.0,
            thickness: 0.1,
            opacity: 0.9,
            inset: 0.0,
            sh_degree: 0,
            smoothness: 0.1,
        }
    }
}

/// Makes an avatar with one Gaussian per vertex or face of a sequence's body, coloured by the sequence's frames.
///
/// # Errors
/// A setting out of range, a sequence without frames, a body that breaks an invariant, a frame that cannot be read.
pub fn surface_init(sequence: &Sequence, init: &SurfaceInit) -> Result<Avatar, Error> {
    init.validate()?;
    let (layout, colours) = coloured(sequence, init)?;
    Ok(layout.avatar(init, colours))
}

/// One colour per vertex of a sequence's body, also where no frame shows it.
pub(super) fn vertex_colours(sequence: &Sequence) -> Result<Vec<[f32; 3]>, Error> {
    let (_, colours) = coloured(
        sequence,
        &SurfaceInit { placement: Placement::Vertices, sh_degree: 0, ..Default::default() },
    )?;
    Ok(colours.coefficients.iter().map(|c| c.map(|c| 0.5 + c * sh::C0 as f32)).collect())
}

fn coloured(sequence: &Sequence, init: &SurfaceInit) -> Result<(Layout, Colours), Error> {
    if sequence.frames.is_empty() {
        return Err(Error::invalid(format!("sequence {}: frames", sequence.id), "none", "at least one"));
    }
    let body = &*sequence.body;
    body.validate().map_err(Error::scene(sequence))?;
    let layout = Layout::new(body, init.placement).map_err(Error::scene(sequence))?;
    let mut colours = consensus(sequence, &layout.parts, init)?;
    let known: Vec<bool> = colours.confidence.iter().map(|&c| c > 0.0).collect();
    let centres: Vec<DVec3> = layout.discs.iter().map(|d| d.centre).collect();
    let stride = sh::count(init.sh_degree);
    fill_unknown(&mut colours.coefficients, stride, &known, &layout.neighbours, &centres);
    Ok((layout, colours))
}

impl SurfaceInit {
    fn validate(&self) -> Result<(), Error> {
        let positive = [("scale", self.scale), ("thickness", self.thickness), ("opacity", self.opacity)];
        for (field, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::invalid(field, value.to_string(), "a finite number above 0"));
            }
        }
        if self.opacity >= 1.0 {
            return Err(Error::invalid("opacity", self.opacity.to_string(), "a number below 1"));
        }
        if !self.inset.is_finite() {
            return Err(Error::invalid("inset", self.inset.to_string(), "finite metres"));
        }
        if !(self.smoothness.is_finite() && self.smoothness >= 0.0) {
            return Err(Error::invalid(
                "smoothness",
                self.smoothness.to_string(),
                "a finite number, at least 0",
            ));
        }
        if self.sh_degree > sh::MAX_DEGREE {
            return Err(Error::invalid("sh_degree", self.sh_degree.to_string(), "0 to 3"));
        }
        Ok(())
    }
}

/// The mean colour of each part over the frames that show it, then again with the outliers weighed down, in the wanted
/// SH degree.
fn consensus(sequence: &Sequence, parts: &Parts, init: &SurfaceInit) -> Result<Colours, Error> {
    let truth = |frame: &super::sighting::Frame<'_>| Ok(frame.truth.rgb.clone());
    let mean = Gathering { degree: 0, smoothness: 0.0, robust: None };
    let first = gather(sequence, parts, mean, 0.5, truth)?;
    let robust = Gathering {
        degree: init.sh_degree,
        smoothness: init.smoothness,
        robust: Some((&first, ROBUST_SCALE)),
    };
    gather(sequence, parts, robust, 0.5, truth)
}

/// Everything about an avatar but its colours.
struct Layout {
    discs: Vec<Disc>,
    binding: Binding,
    parts: Parts,
    neighbours: Neighbours,
}

impl Layout {
    fn new(body: &RestBody, placement: Placement) -> Result<Self, crate::scene::SceneError> {
        let points = points_on_faces(body.faces.len());
        if placement == Placement::Vertices {
            let discs = disc::of_vertices(body, &vertex_normals(&body.vertices, &body.faces));
            let neighbours = Neighbours::of_vertices(body.vertices.len(), &body.faces);
            let (offsets, members) = vertex_members(body, &points);
            let parts = Parts { points, offsets, members, skin: Some(body.weights.clone()) };
            return Ok(Self { discs, binding: Binding::Vertex(body.weights.clone()), parts, neighbours });
        }
        let joints = body.skeleton.num_joints();
        let third = |i: u32| (i as usize, 1.0 / 3.0);
        let mixed = body.faces.iter().map(|face| body.weights.mixed(&face.map(third)));
        let skin = SkinWeights::from_rows(mixed, joints)?;
        let count = body.faces.len();
        let binding = match placement {
            Placement::Faces => Binding::Face(FaceBinding {
                faces: (0..count as u32).collect(),
                barycentric: vec![[1.0 / 3.0; 3]; count],
                offsets: vec![0.0; count],
            }),
            _ => Binding::Vertex(skin.clone()),
        };
        let per_face = POINTS.len() as u32;
        let offsets = (0..=count as u32).map(|face| face * per_face).collect();
        let members = (0..points.len() as u32).map(|point| (point, 1.0)).collect();
        let parts = Parts { points, offsets, members, skin: Some(skin) };
        Ok(Self {
            discs: disc::of_faces(body),
            binding,
            parts,
            neighbours: Neighbours::of_faces(&body.faces),
        })
    }

    fn avatar(self, init: &SurfaceInit, colours: Colours) -> Avatar {
        let shapes: Vec<_> = self.discs.iter().map(|d| d.gaussian(init.scale, init.thickness)).collect();
        let below = |d: &Disc| (d.centre - d.normal * init.inset).as_vec3();
        let logit = (init.opacity / (1.0 - init.opacity)).ln() as f32;
        let mut binding = self.binding;
        if let Binding::Face(faces) = &mut binding {
            faces.offsets.fill(-init.inset as f32);
        }
        let gaussians = Gaussians {
            means: self.discs.iter().map(below).collect(),
            rotations: shapes.iter().map(|s| s.0).collect(),
            log_scales: shapes.iter().map(|s| s.1).collect(),
            opacity_logits: vec![logit; self.discs.len()],
            sh_degree: init.sh_degree,
            sh: colours.coefficients,
        };
        Avatar { gaussians, binding }
    }
}

/// The centroids of the four equal triangles into which the mid-points of its sides divide a face.
const POINTS: [[f32; 3]; 4] = [
    [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0],
    [2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0],
    [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
    [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0],
];

fn points_on_faces(faces: usize) -> Vec<SurfacePoint> {
    let on_face = |face| POINTS.map(|barycentric| SurfacePoint { face, barycentric });
    (0..faces as u32).flat_map(on_face).collect()
}

/// The points on the faces around each vertex, weighted by the vertex's hat function and the faces' areas.
fn vertex_members(body: &RestBody, points: &[SurfacePoint]) -> (Vec<u32>, Vec<(u32, f32)>) {
    let mut rows: Vec<Vec<(u32, f32)>> = vec![Vec::new(); body.vertices.len()];
    for (index, point) in points.iter().enumerate() {
        let face = body.faces[point.face as usize];
        let [a, b, c] = face.map(|i| body.vertices[i as usize]);
        // square metres are small numbers, but only their ratios matter; a floor keeps points of degenerate faces
        let area = (b - a).cross(c - a).length().max(1e-12) as f32;
        for (vertex, share) in face.into_iter().zip(point.barycentric) {
            rows[vertex as usize].push((index as u32, share * area));
        }
    }
    let mut offsets = vec![0];
    let mut members = Vec::with_capacity(points.len() * 3);
    for row in rows {
        members.extend(row);
        offsets.push(members.len() as u32);
    }
    (offsets, members)
}
