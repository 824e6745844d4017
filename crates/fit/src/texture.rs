//! A textured mesh as an avatar: the texture is gathered from the training frames, the triangle rasterizer draws it.

use super::gather::{Parts, consensus};
use super::options::{Clothing, Cover, POSITIVE, Sighting, within};
use super::sighting::SurfacePoint;
use super::surface;
use super::{Error, clothing, training};
use glam::{DMat4, Vec3};
use rayon::prelude::*;
use skinsplat_core::math::sh;
use skinsplat_core::scene::{
    BodyGradient, Camera, Image, Mask, Pose, PoseGradient, PosedBody, Rendered, RenderedGradient, RestBody,
    SceneError, Uv,
};
use skinsplat_data::sequence::Sequence;
use skinsplat_render::mesh::{
    Drawing, Mesh, SamplePattern, Texture, draw, motion_gradient, texture_gradient, visible_faces,
};
use std::sync::Arc;

/// A body with its clothes on, and a texture for it.
#[derive(Clone, Debug, PartialEq)]
pub struct TexturedBody {
    /// The body, its surface moved onto the outlines of the training frames ([`super::clothing`]).
    pub body: Arc<RestBody>,
    /// Texture coordinates per face corner.
    pub uv: Uv,
    /// The colours.
    pub texture: Texture,
}

impl TexturedBody {
    /// Draws the body in a pose, over a background.
    ///
    /// # Errors
    /// As [`TexturedBody::drawing`].
    pub fn draw(
        &self,
        pose: &Pose,
        camera: &Camera,
        pattern: SamplePattern,
        background: [f32; 3],
    ) -> Result<Rendered, SceneError> {
        Ok(self.drawing(pose, camera, pattern)?.over(background))
    }

    /// Draws the body in a pose.
    ///
    /// # Errors
    /// A camera that breaks an invariant, or a pose for another body.
    pub fn drawing(
        &self,
        pose: &Pose,
        camera: &Camera,
        pattern: SamplePattern,
    ) -> Result<Drawing, SceneError> {
        let posed = PosedBody::new(&self.body, pose)?;
        let mesh = Mesh::new(&posed.mesh().vertices, &self.body.faces)?;
        draw(&mesh, camera, pattern, self.texture.shader(&self.uv))
    }

    /// The derivatives of a loss with respect to the texels ([`texture_gradient`]), from those with respect to the colours
    /// of [`TexturedBody::drawing`].
    ///
    /// # Errors
    /// As [`TexturedBody::drawing`].
    pub fn backward(
        &self,
        pose: &Pose,
        camera: &Camera,
        pattern: SamplePattern,
        upstream: &Image,
        gradient: &mut Image,
    ) -> Result<(), SceneError> {
        let posed = PosedBody::new(&self.body, pose)?;
        let mesh = Mesh::new(&posed.mesh().vertices, &self.body.faces)?;
        texture_gradient(&mesh, camera, pattern, &self.uv, upstream, gradient)
    }

    /// The derivatives of a loss with respect to the pose in which this body was drawn, from those with respect to an image (over
    /// `background`) and its alpha in which the drawing was shown with the weights `shown`.
    ///
    /// To first order a point keeps its colour while it moves, and a pixel changes by the gradient of the drawing along that
    /// motion: exact inside a smooth texture, a good part of it at outlines. Differences reach to the next pixels.
    ///
    /// # Errors
    /// As [`TexturedBody::drawing`].
    pub(crate) fn pose_gradient(
        &self,
        (pose, camera): (&Pose, &Camera),
        drawing: &Drawing,
        background: [f32; 3],
        upstream: &RenderedGradient,
        shown: &Mask,
    ) -> Result<PoseGradient, SceneError> {
        let posed = PosedBody::new(&self.body, pose)?;
        let mesh = Mesh::new(&posed.mesh().vertices, &self.body.faces)?;
        let of_places = of_places(&drawing.over(background), drawing, upstream, shown);
        let mut of_body = BodyGradient::default();
        of_body.reset(posed.joints.len());
        let (of_vertices, _) = of_body.mesh_mut(self.body.vertices.len());
        motion_gradient(&mesh, camera, SamplePattern::new(MOTION_SAMPLES), &of_places, of_vertices)?;
        posed.pose_gradient(pose, &of_body)
    }
}

/// Derivatives with respect to where the surface that a pixel shows is seen, pixels: against the gradient of the image, which moves
/// with it.
fn of_places(over: &Rendered, drawing: &Drawing, upstream: &RenderedGradient, shown: &Mask) -> Vec<[f32; 2]> {
    let (width, height) = (shown.width(), shown.height());
    let of_pixel = |x: usize, y: usize| {
        let coverage = drawing.coverage.at(x, y);
        if coverage <= 0.0 {
            return [0.0; 2];
        }
        let in_view = shown.at(x, y) / coverage;
        let of_colour = upstream.image.at(x, y);
        let of_alpha = upstream.alpha.as_ref().map_or(0.0, |alpha| alpha.at(x, y));
        let along = |[before, after]: [[usize; 2]; 2]| {
            let pixels = (after[0] - before[0] + after[1] - before[1]).max(1) as f32;
            let colours = [before, after].map(|[x, y]| over.image.at(x, y));
            let alphas = [before, after].map(|[x, y]| drawing.coverage.at(x, y));
            let colour: f32 = (0..3).map(|c| of_colour[c] * (colours[1][c] - colours[0][c])).sum();
            -in_view * (colour + of_alpha * (alphas[1] - alphas[0])) / pixels
        };
        [
            along([[x.saturating_sub(1), y], [(x + 1).min(width - 1), y]]),
            along([[x, y.saturating_sub(1)], [x, (y + 1).min(height - 1)]]),
        ]
    };
    (0..width * height).into_par_iter().map(|i| of_pixel(i % width, i / width)).collect()
}

/// Samples per pixel side that say which part of the surface a pixel shows, where its motion is asked for.
const MOTION_SAMPLES: usize = 2;

/// Samples per pixel side with which textured bodies are drawn: 16 samples on a rotated grid.
pub const SAMPLES: usize = 4;

/// The largest side of a texture, texels.
pub const MAX_SIZE: u32 = 8192;

/// How a texture is gathered.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TextureInit {
    /// Texels along a side.
    pub size: u32,
    /// Observations of a texel count against the colour spread from its surroundings, which counts as much as such a part
    /// of one frontal observation.
    pub prior_weight: f32,
    /// Texels around each chart that repeat its border, so that interpolation never reads an empty texel.
    pub gutter: usize,
    /// How the body's outline is brought closer to that of the masks before anything else.
    pub clothing: Clothing,
    /// Which sights of the surface count.
    pub sighting: Sighting,
    /// How the surface is covered.
    pub cover: Cover,
}

impl Default for TextureInit {
    fn default() -> Self {
        Self {
            size: 1024,
            prior_weight: 0.02,
            gutter: 8,
            clothing: Clothing::default(),
            sighting: Sighting::default(),
            cover: Cover::default(),
        }
    }
}

/// Gathers a square texture from the frames of a sequence, in the body's own atlas. Each texel is the robust mean of what
/// the frames show of it; where they show little or nothing, the colour comes from the surface around it.
///
/// # Errors
/// A size of zero or above [`MAX_SIZE`], a body without texture coordinates, a sequence without frames, a frame that
/// cannot be read.
pub fn gather_texture(sequence: &Sequence, init: &TextureInit) -> Result<TexturedBody, Error> {
    let size = init.size;
    if size == 0 || size > MAX_SIZE {
        return Err(Error::invalid("texture size", size.to_string(), format!("1 to {MAX_SIZE} texels")));
    }
    let TextureInit { prior_weight, gutter, clothing, sighting, cover, .. } = init;
    within(
        "texture",
        &[("prior_weight", f64::from(*prior_weight), POSITIVE), ("gutter", *gutter as f64, 0.0..=1024.0)],
    )?;
    sighting.check("sighting")?;
    cover.check("cover")?;
    let training = training::prepared(sequence, cover.most_frames)?;
    let Some(uv) = sequence.body.uv.clone() else {
        let field = format!("sequence {}: body", sequence.id);
        return Err(Error::invalid(field, "no texture coordinates", "uv per face corner (vt and ft)"));
    };
    let sequence = &clothing::dressed(&training, clothing, sighting)?;
    let body = &*sequence.body;
    let coarse = surface::vertex_colours(sequence, sighting, cover)?;
    let atlas = Atlas::new(&uv, size).map_err(Error::scene(sequence))?;
    let parts = Parts::single_points(atlas.points);
    let colours = consensus(sequence, sighting, cover.robust_scale, &parts, (0, 0.0))?;
    let texel = |(part, point): (usize, &SurfacePoint)| -> [f32; 3] {
        let own = colours.of(part)[0].map(|c| 0.5 + c * sh::C0 as f32);
        let around = interpolated(body, &coarse, point);
        let weight = colours.confidence[part];
        std::array::from_fn(|c| (own[c] * weight + around[c] * prior_weight) / (weight + prior_weight))
    };
    let texels: Vec<[f32; 3]> = parts.points.par_iter().enumerate().map(texel).collect();
    let image =
        with_gutter(&atlas.pixels, &texels, size as usize, *gutter).map_err(Error::scene(sequence))?;
    Ok(TexturedBody { body: sequence.body.clone(), uv, texture: Texture::new(image) })
}

fn interpolated(body: &RestBody, vertex_colours: &[[f32; 3]], point: &SurfacePoint) -> [f32; 3] {
    let corners = body.faces[point.face as usize].map(|i| vertex_colours[i as usize]);
    std::array::from_fn(|c| (0..3).map(|k| corners[k][c] * point.barycentric[k]).sum())
}

/// The texels of an atlas whose centre lies on a face.
struct Atlas {
    points: Vec<SurfacePoint>,
    /// Where each point's texel lies, in row-major order.
    pixels: Vec<usize>,
}

impl Atlas {
    fn new(uv: &Uv, size: u32) -> Result<Self, SceneError> {
        let side = size as f32;
        let flat: Vec<Vec3> =
            uv.coordinates.iter().map(|&[u, v]| Vec3::new(u * side, (1.0 - v) * side, 1.0)).collect();
        let mesh = Mesh::new(&flat, &uv.faces)?;
        // pixel coordinates are the x and y of points at z = 1
        let camera = Camera {
            width: size,
            height: size,
            fx: 1.0,
            fy: 1.0,
            cx: 0.0,
            cy: 0.0,
            camera_from_world: DMat4::IDENTITY,
        };
        let faces = visible_faces(&mesh, &camera)?;
        let barycentric = draw(&mesh, &camera, SamplePattern::new(1), |f| f.barycentric)?.colour;
        let side = size as usize;
        let point = |pixel: &usize| {
            let (x, y) = (pixel % side, pixel / side);
            faces.face(x, y).map(|face| SurfacePoint { face, barycentric: barycentric.at(x, y) })
        };
        let pixels: Vec<usize> = (0..side * side).filter(|pixel| point(pixel).is_some()).collect();
        let points = pixels.iter().filter_map(point).collect();
        Ok(Self { points, pixels })
    }
}

/// The texels on an image of `size`, grown outwards by `gutter` texels; the rest has the mean colour.
fn with_gutter(
    pixels: &[usize],
    texels: &[[f32; 3]],
    size: usize,
    gutter: usize,
) -> Result<Image, SceneError> {
    let mut values: Vec<Option<[f32; 3]>> = vec![None; size * size];
    for (&pixel, &texel) in pixels.iter().zip(texels) {
        values[pixel] = Some(texel);
    }
    for _ in 0..gutter {
        let grown = |(pixel, own): (usize, &Option<[f32; 3]>)| {
            own.or_else(|| mean(neighbours(pixel, size).filter_map(|n| values[n])))
        };
        values = values.par_iter().enumerate().map(grown).collect();
    }
    let rest = mean(texels.iter().copied()).unwrap_or([0.5; 3]);
    Image::new(size, size, values.into_iter().map(|v| v.unwrap_or(rest)).collect())
}

fn neighbours(pixel: usize, size: usize) -> impl Iterator<Item = usize> {
    let (x, y) = ((pixel % size) as isize, (pixel / size) as isize);
    let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
    around.filter_map(move |(dx, dy)| {
        let (x, y, side) = (x + dx, y + dy, size as isize);
        (x >= 0 && y >= 0 && x < side && y < side).then_some((y * side + x) as usize)
    })
}

fn mean(colours: impl Iterator<Item = [f32; 3]>) -> Option<[f32; 3]> {
    let (mut sum, mut count) = ([0.0f64; 3], 0u32);
    for colour in colours {
        sum = std::array::from_fn(|c| sum[c] + f64::from(colour[c]));
        count += 1;
    }
    (count > 0).then(|| sum.map(|s| (s / f64::from(count)) as f32))
}
