//! Gaussians on the surface of a body, coloured by the training frames: an avatar before any optimiser, and what one
//! starts from.

use super::disc::{self, Disc};
use super::fill::{Neighbours, fill_unknown};
use super::gather::{Colours, Gathering, Parts, consensus, gather};
use super::options::{Clothing, Cover, Sighting};
use super::room::room_below;
use super::sighting::{Frame, SurfacePoint};
use super::tessellation::Tessellation;
use super::{Error, clothing, tessellation, training};
pub use crate::recipe::{BindTo, Placement, StartShape};
use glam::{DVec3, Vec3};
use skinsplat_core::math::portable;
use skinsplat_core::math::sh;
use skinsplat_core::scene::body::vertex_normals;
use skinsplat_core::scene::{
    Avatar, Binding, FaceBinding, Gaussians, PosedBody, RestBody, SceneError, SkinWeights,
};
use skinsplat_data::sequence::Sequence;
use skinsplat_posing::{BoundAvatar, Strategy, pose};
use skinsplat_render::View;
use skinsplat_render::splat::render;

/// How a surface-initialised avatar is made. The defaults gave the best PSNR on held-out frames.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SurfaceInit {
    /// Where the Gaussians sit.
    pub placement: Placement,
    /// How they move.
    pub bind_to: BindTo,
    /// Edges of the mesh longer than this, metres, are halved until none is. Infinite: the body's own mesh.
    pub longest_edge: f64,
    /// Standard deviations in the tangent plane, in units of those of the part of the surface that a Gaussian stands for.
    pub scale: f64,
    /// Standard deviation along the normal, in units of the mean one in the tangent plane.
    pub thickness: f64,
    /// Opacity of every Gaussian, in (0, 1).
    pub opacity: f64,
    /// How far below the surface the Gaussians sit, in pixels of the training frames: a splat renderer widens every
    /// outline by its low-pass filter. Thin parts sink less; what no frame shows (inside the mouth) stays.
    pub inset: f64,
    /// Gaussians drawn from the surface, evenly by area and as large as their share of it; 0: all that `placement` has.
    pub samples: u32,
    /// What they look like.
    pub shape: StartShape,
    /// SH degree of the colours, 0 to 3.
    pub sh_degree: usize,
    /// Pull of degrees 1 to 3 towards zero, relative to the observations.
    pub smoothness: f64,
    /// How often the colours are corrected by what is missing in the rendered training frames.
    pub refinements: usize,
    /// How the body's outline is brought closer to that of the masks before anything else: clothing and hair are not part
    /// of a body model.
    pub clothing: Clothing,
    /// Which sights of the surface count.
    pub sighting: Sighting,
    /// How the surface is covered.
    pub cover: Cover,
}

impl Default for SurfaceInit {
    fn default() -> Self {
        Self {
            placement: Placement::Vertices,
            bind_to: BindTo::Joints,
            longest_edge: 0.01,
            scale: 1.0,
            thickness: 0.1,
            opacity: 0.99,
            inset: 1.2,
            samples: 0,
            shape: StartShape::Disc,
            sh_degree: 0,
            smoothness: 0.1,
            refinements: 1,
            clothing: Clothing::default(),
            sighting: Sighting::default(),
            cover: Cover::default(),
        }
    }
}

/// Makes an avatar with one Gaussian per vertex or face of a sequence's body, coloured by the sequence's frames.
///
/// # Errors
/// A setting out of range, a sequence without frames, a body that breaks an invariant, a frame that cannot be read.
pub fn surface_init(sequence: &Sequence, init: &SurfaceInit) -> Result<Avatar, Error> {
    init.validate()?;
    let training = training::prepared(sequence, init.cover.most_frames)?;
    let dressed = clothing::dressed(&training, &init.clothing, &init.sighting)?;
    let (layout, mut colours) = coloured(&dressed, init)?;
    refine(&dressed, &layout, init, &mut colours)?;
    let (layout, colours) = match init.samples as usize {
        0 => (layout, colours),
        n => layout
            .sampled(&colours, n, sequence.body.skeleton.num_joints())
            .map_err(Error::scene(sequence))?,
    };
    Ok(layout.avatar(init, &colours, &sequence.body))
}

/// One colour per vertex of a sequence's body, also where no frame shows it; grey for vertices without a face.
pub(super) fn vertex_colours(
    sequence: &Sequence,
    sighting: &Sighting,
    cover: &Cover,
) -> Result<Vec<[f32; 3]>, Error> {
    let (sighting, cover) = (sighting.clone(), cover.clone());
    let init = SurfaceInit {
        placement: Placement::Vertices,
        sh_degree: 0,
        sighting,
        cover,
        ..SurfaceInit::default()
    };
    let (_, colours) = coloured(sequence, &init)?;
    let mut of_body = vec![[0.5; 3]; sequence.body.vertices.len()];
    for (vertex, coefficients) in
        tessellation::vertices_with_faces(&sequence.body).into_iter().zip(&colours.coefficients)
    {
        of_body[vertex] = coefficients.map(|c| 0.5 + c * sh::C0 as f32);
    }
    Ok(of_body)
}

fn coloured(sequence: &Sequence, init: &SurfaceInit) -> Result<(Layout, Colours), Error> {
    let layout = Layout::new(sequence, init).map_err(Error::scene(sequence))?;
    let mut colours = consensus(
        sequence,
        &init.sighting,
        init.cover.robust_scale,
        &layout.parts,
        (init.sh_degree, init.smoothness),
    )?;
    let known: Vec<bool> = colours.confidence.iter().map(|&c| c > 0.0).collect();
    let centres: Vec<DVec3> = layout.discs.iter().map(|d| d.centre).collect();
    let stride = sh::count(init.sh_degree);
    let steps = init.cover.diffusion_steps;
    fill_unknown(&mut colours.coefficients, stride, &known, &layout.neighbours, &centres, steps);
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
        if self.longest_edge.is_nan() || self.longest_edge <= 0.0 {
            return Err(Error::invalid("longest_edge", self.longest_edge.to_string(), "metres above 0"));
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
        self.clothing.check("clothing")?;
        self.sighting.check("sighting")?;
        self.cover.check("cover")
    }
}

/// Draws the avatar into every frame and adds what is missing there to the Gaussians that are seen there, again and
/// again: neighbouring discs blend, so a Gaussian needs more contrast than the surface that it stands for.
fn refine(
    sequence: &Sequence,
    layout: &Layout,
    init: &SurfaceInit,
    colours: &mut Colours,
) -> Result<(), Error> {
    let strategy = Strategy::preset(REFINEMENT_STRATEGY)
        .ok_or_else(|| Error::invalid("strategy", REFINEMENT_STRATEGY, "a preset"))?;
    for _ in 0..init.refinements {
        let avatar = layout.avatar(init, colours, &sequence.body);
        let bound = BoundAvatar::new(&avatar, &sequence.body).map_err(Error::strategy(sequence))?;
        let residual = |frame: &Frame<'_>| {
            let posed = pose(&bound, &frame.body, &strategy).map_err(Error::strategy(sequence))?;
            let view = View::new(frame.camera).over(REFINEMENT_BACKGROUND);
            let mut image = render(&posed.as_posed(), &view).map_err(Error::scene(sequence))?.image;
            let truth = &frame.truth;
            let truth =
                truth.rgb.composited(&truth.alpha, REFINEMENT_BACKGROUND).map_err(Error::scene(sequence))?;
            for (pixel, wanted) in image.pixels_mut().iter_mut().zip(truth.pixels()) {
                *pixel = std::array::from_fn(|c| wanted[c] - pixel[c]);
            }
            Ok(image)
        };
        let none = colours.zeroed();
        let gathering = Gathering {
            degree: init.sh_degree,
            smoothness: init.smoothness,
            origin: 0.0,
            robust: Some((&none, init.cover.robust_scale)),
            sighting: &init.sighting,
        };
        colours
            .add(&gather(sequence, &layout.parts, gathering, residual, |f, image, p| f.observe(p, image))?);
    }
    Ok(())
}

/// How the avatar is posed while its colours are refined: the average rotation is the reference that others are compared
/// with.
const REFINEMENT_STRATEGY: &str = "quaternion-average";
/// Grey: what shows through an avatar favours neither a white nor a black background.
const REFINEMENT_BACKGROUND: [f32; 3] = [0.5; 3];

/// Everything about an avatar but its colours.
struct Layout {
    discs: Vec<Disc>,
    sites: Vec<SurfacePoint>,
    parts: Parts,
    neighbours: Neighbours,
    /// Size of a pixel of the training frames on the surface, metres.
    pixel: f64,
}

impl Layout {
    fn new(sequence: &Sequence, init: &SurfaceInit) -> Result<Self, SceneError> {
        let body = &*sequence.body;
        let mesh = Tessellation::new(body, init.longest_edge, init.cover.most_divisions)?;
        let (vertices, faces) = (&mesh.vertices, &mesh.faces);
        let points: Vec<SurfacePoint> =
            mesh.corners.iter().flat_map(|corners| POINTS.map(|weights| corners.at(weights))).collect();
        let (discs, sites, neighbours, (offsets, members)) = match init.placement {
            Placement::Vertices => (
                disc::of_vertices(vertices, faces),
                mesh.vertex_sites(),
                Neighbours::of_vertices(vertices.len(), faces),
                points_around_vertices(&mesh),
            ),
            Placement::Faces => (
                disc::of_faces(vertices, faces),
                mesh.face_sites(),
                Neighbours::of_faces(faces),
                points_on_faces(faces.len()),
            ),
        };
        let weights = sites.iter().map(|site| body.weights_at(site.face, site.barycentric.map(f64::from)));
        let skin = SkinWeights::from_rows(weights, body.skeleton.num_joints())?;
        let parts = Parts { points, offsets, members, skin: Some(skin) };
        Ok(Self { discs, sites, parts, neighbours, pixel: pixel_on_surface(sequence)? })
    }

    /// Some of the Gaussians, standing for all, with their colours. Of no more than there are.
    fn sampled(self, colours: &Colours, n: usize, joints: usize) -> Result<(Self, Colours), SceneError> {
        let (kept, discs): (Vec<usize>, Vec<Disc>) =
            disc::sampled(&self.discs, n.min(self.discs.len())).into_iter().unzip();
        let stride = sh::count(colours.degree);
        let own = |&i: &usize| colours.coefficients[i * stride..][..stride].iter().copied();
        let colours = Colours {
            degree: colours.degree,
            coefficients: kept.iter().flat_map(own).collect(),
            confidence: kept.iter().map(|&i| colours.confidence[i]).collect(),
        };
        let sites = kept.iter().map(|&i| self.sites[i]).collect();
        let skin = match &self.parts.skin {
            Some(skin) => {
                let row = |&i: &usize| {
                    let (joints, weights) = skin.row(i);
                    joints.iter().map(|&j| usize::from(j)).zip(weights.iter().copied()).collect::<Vec<_>>()
                };
                Some(SkinWeights::from_rows(kept.iter().map(row), joints)?)
            }
            None => None,
        };
        Ok((Self { discs, sites, parts: Parts { skin, ..self.parts }, ..self }, colours))
    }

    /// How far each Gaussian sits below its disc, metres.
    fn insets(&self, init: &SurfaceInit, colours: &Colours) -> Vec<f64> {
        let (wanted, share) = (init.inset * self.pixel, init.cover.share_of_room);
        let room = room_below(&self.discs, wanted.abs() / share, init.cover.room_cone);
        let inset = |(room, &seen): (f64, &f32)| {
            if seen > 0.0 { wanted.signum() * wanted.abs().min(share * room) } else { 0.0 }
        };
        room.into_iter().zip(&colours.confidence).map(inset).collect()
    }

    /// The avatar, bound to a body whose surface may lie below the one on which the Gaussians sit.
    fn avatar(&self, init: &SurfaceInit, colours: &Colours, body: &RestBody) -> Avatar {
        let shapes: Vec<_> = self
            .discs
            .iter()
            .map(|d| shaped(d.gaussian(init.scale, init.thickness, &init.cover), init.shape))
            .collect();
        let means: Vec<DVec3> = self
            .discs
            .iter()
            .zip(self.insets(init, colours))
            .map(|(d, inset)| d.centre - d.normal * inset)
            .collect();
        let logit = portable::ln(init.opacity / (1.0 - init.opacity)) as f32;
        let binding = match (init.bind_to, self.parts.skin.clone()) {
            (BindTo::Joints, Some(skin)) => Binding::Vertex(skin),
            _ => Binding::Face(FaceBinding {
                faces: self.sites.iter().map(|site| site.face).collect(),
                barycentric: self.sites.iter().map(|site| site.barycentric).collect(),
                offsets: heights(body, &self.sites, &means),
            }),
        };
        let gaussians = Gaussians {
            means: means.iter().map(|m| m.as_vec3()).collect(),
            rotations: shapes.iter().map(|s| s.0).collect(),
            log_scales: shapes.iter().map(|s| s.1).collect(),
            opacity_logits: vec![logit; self.discs.len()],
            sh_degree: init.sh_degree,
            sh: colours.coefficients.clone(),
        };
        Avatar { gaussians, binding }
    }
}

/// A disc, or the ball as wide as it is.
fn shaped(disc: ([f32; 4], Vec3), shape: StartShape) -> ([f32; 4], Vec3) {
    match shape {
        StartShape::Disc => disc,
        StartShape::Ball => ([1.0, 0.0, 0.0, 0.0], Vec3::splat(0.5 * (disc.1.x + disc.1.y))),
    }
}

/// How far points lie above their sites on a body, along the interpolated unit vertex normal, metres.
fn heights(body: &RestBody, sites: &[SurfacePoint], points: &[DVec3]) -> Vec<f32> {
    let normals = vertex_normals(&body.vertices, &body.faces);
    let height = |(site, point): (&SurfacePoint, &DVec3)| {
        let corners = body.faces[site.face as usize];
        let mix = |values: &[DVec3]| -> DVec3 {
            corners.iter().zip(site.barycentric).map(|(&i, b)| values[i as usize] * f64::from(b)).sum()
        };
        (*point - mix(&body.vertices)).dot(mix(&normals).normalize_or_zero()) as f32
    };
    sites.iter().zip(points).map(height).collect()
}

/// The median over the frames of the size of a pixel at the depth of the body's middle, metres.
fn pixel_on_surface(sequence: &Sequence) -> Result<f64, SceneError> {
    let mut sizes = Vec::with_capacity(sequence.frames.len());
    for frame in &sequence.frames {
        let camera = &sequence.cameras[frame.camera];
        let posed = PosedBody::new(&sequence.body, &sequence.poses[frame.pose])?;
        let joints = posed.joints.iter().zip(&sequence.body.skeleton.inverse_binds);
        let count = posed.joints.len() as f64;
        let middle: DVec3 =
            joints.map(|(j, bind)| j.linear * bind.inverse().translation + j.translation).sum::<DVec3>()
                / count;
        if let Some((_, depth)) = camera.project(middle) {
            sizes.push(depth / (camera.fx * camera.fy).sqrt());
        }
    }
    sizes.sort_unstable_by(f64::total_cmp);
    Ok(sizes.get(sizes.len() / 2).copied().unwrap_or(0.0))
}

/// The centroids of the four equal triangles into which the mid-points of its sides divide a face.
const POINTS: [[f32; 3]; 4] = [
    [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0],
    [2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0],
    [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
    [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0],
];

/// Parts of one face each: the compressed rows of [`Parts`].
fn points_on_faces(faces: usize) -> (Vec<u32>, Vec<(u32, f32)>) {
    let count = POINTS.len();
    let offsets = (0..=faces).map(|face| (face * count) as u32).collect();
    (offsets, (0..(faces * count) as u32).map(|point| (point, 1.0)).collect())
}

/// Parts of one vertex each: the points on the faces around it, weighted by its hat function and the faces' areas.
fn points_around_vertices(mesh: &Tessellation) -> (Vec<u32>, Vec<(u32, f32)>) {
    let mut rows: Vec<Vec<(u32, f32)>> = vec![Vec::new(); mesh.vertices.len()];
    for (index, face) in mesh.faces.iter().enumerate() {
        let [a, b, c] = face.map(|i| mesh.vertices[i as usize]);
        // only ratios of areas matter; a floor keeps the points of faces without area
        let area = (b - a).cross(c - a).length().max(1e-12) as f32;
        for (k, weights) in POINTS.iter().enumerate() {
            let point = (index * POINTS.len() + k) as u32;
            for (&vertex, share) in face.iter().zip(weights) {
                rows[vertex as usize].push((point, share * area));
            }
        }
    }
    let mut offsets = vec![0];
    let mut members = Vec::with_capacity(mesh.faces.len() * 3 * POINTS.len());
    for row in rows {
        members.extend(row);
        offsets.push(members.len() as u32);
    }
    (offsets, members)
}
