//! Triangle rasterizer: ground truth of synthetic subjects, silhouettes, visibility, textured meshes.
//!
//! Exact where it can be: vertices are projected in f64 and snapped to 1/4096 pixel, edges are evaluated in integers
//! with the top-left rule, so triangles that share an edge neither overlap nor leave a gap. Coverage is supersampled on
//! a rotated grid of n x n samples per pixel ([`SamplePattern`]). Visibility is resolved first (nearest sample wins, the
//! lowest face index on a tie); then the shading closure is called once per covered sample, with the perspective-correct
//! barycentric coordinates of that very sample, and the samples of a pixel are averaged with equal weights in the colour
//! values that the closure returns. Both sides of a triangle are drawn. Pixels are independent: the result is the same,
//! bit for bit, for any number of threads.

mod adjoint;
mod pattern;
mod raster;
mod setup;
mod texture;

pub use adjoint::{motion_gradient, texture_gradient};
pub use pattern::SamplePattern;
pub use setup::NEAR_PLANE;
pub use texture::Texture;

use glam::Vec3;
use raster::PixelSamples;
use rayon::prelude::*;
use skinsplat_core::scene::{Camera, Image, Mask, Rendered, SceneError, Underlay};

/// Triangles in world space. Both orientations are drawn; vertices that are not finite make their faces vanish.
#[derive(Clone, Copy, Debug)]
pub struct Mesh<'a> {
    vertices: &'a [Vec3],
    faces: &'a [[u32; 3]],
}

impl<'a> Mesh<'a> {
    /// A mesh of world positions in metres and triples of vertex indices.
    ///
    /// # Errors
    /// A vertex index out of range.
    pub fn new(vertices: &'a [Vec3], faces: &'a [[u32; 3]]) -> Result<Self, SceneError> {
        match faces.iter().position(|face| face.iter().any(|&i| i as usize >= vertices.len())) {
            None => Ok(Self { vertices, faces }),
            Some(i) => {
                let problem = format!("vertex indices {:?}", faces[i]);
                let expected = format!("indices below {}", vertices.len());
                Err(SceneError::new(format!("faces[{i}]"), problem, expected))
            }
        }
    }

    /// World positions, metres.
    pub fn vertices(&self) -> &'a [Vec3] {
        self.vertices
    }

    /// Vertex indices of each triangle.
    pub fn faces(&self) -> &'a [[u32; 3]] {
        self.faces
    }
}

/// What a shading closure is told about a covered sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fragment {
    /// Face index.
    pub face: u32,
    /// Perspective-correct barycentric coordinates, in \[0, 1\], summing to one: any vertex attribute at this sample
    /// is `Σ barycentric[k] * attribute[faces[face][k]]`.
    pub barycentric: [f32; 3],
    /// Camera depth (z), metres.
    pub depth: f32,
    /// World position, metres.
    pub position: Vec3,
}

/// A drawn mesh before any background.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// Straight (un-premultiplied) colour: the mean over the covered samples of a pixel, zero where none is covered.
    pub colour: Image,
    /// The covered fraction of each pixel's samples.
    pub coverage: Mask,
    /// Mean camera depth over the covered samples, metres; zero where none is covered.
    pub depth: Mask,
}

impl Drawing {
    /// The drawing over a background colour, in the form in which the splat renderer returns its images (depth weighted
    /// by coverage).
    pub fn over(&self, background: [f32; 3]) -> Rendered {
        let mut image = self.colour.clone();
        let mut depth = self.depth.clone();
        let coverage = self.coverage.values();
        for ((pixel, z), &a) in image.pixels_mut().iter_mut().zip(depth.values_mut()).zip(coverage) {
            *pixel = std::array::from_fn(|c| pixel[c] * a + background[c] * (1.0 - a));
            *z *= a;
        }
        Rendered { image, alpha: self.coverage.clone(), depth }
    }

    /// The drawing as a layer among Gaussians.
    pub fn underlay(&self) -> Underlay<'_> {
        Underlay { colour: &self.colour, coverage: &self.coverage, depth: &self.depth }
    }
}

/// Draws a mesh with `pattern` samples per pixel, calling `shade` once per covered sample.
///
/// # Errors
/// A camera that breaks an invariant ([`Camera::validate`]).
pub fn draw(
    mesh: &Mesh<'_>,
    camera: &Camera,
    pattern: SamplePattern,
    shade: impl Fn(&Fragment) -> [f32; 3] + Sync,
) -> Result<Drawing, SceneError> {
    let scene = raster::Scene::new(mesh, camera, pattern)?;
    let pixels = scene.resolve(|pixel: PixelSamples<'_>| {
        let mut sum = Shaded::default();
        for fragment in pixel.fragments() {
            let colour = shade(&fragment);
            sum.colour = std::array::from_fn(|c| sum.colour[c] + colour[c]);
            sum.depth += fragment.depth;
            sum.coverage += 1.0;
        }
        sum.mean(pattern.len())
    });
    let (width, height) = (camera.width as usize, camera.height as usize);
    let channel = |f: fn(&Shaded) -> f32| Mask::new(width, height, pixels.par_iter().map(f).collect());
    Ok(Drawing {
        colour: Image::new(width, height, pixels.par_iter().map(|p| p.colour).collect())?,
        coverage: channel(|p| p.coverage)?,
        depth: channel(|p| p.depth)?,
    })
}

/// Sums over the covered samples of a pixel, then their means.
#[derive(Clone, Copy, Default)]
struct Shaded {
    colour: [f32; 3],
    coverage: f32,
    depth: f32,
}

impl Shaded {
    fn mean(self, samples: usize) -> Self {
        Self {
            colour: self.colour.map(|c| c / self.coverage),
            coverage: self.coverage / samples as f32,
            depth: self.depth / self.coverage,
        }
    }
}

/// The covered fraction of each pixel.
///
/// # Errors
/// As [`draw`].
pub fn silhouette(mesh: &Mesh<'_>, camera: &Camera, pattern: SamplePattern) -> Result<Mask, SceneError> {
    let scene = raster::Scene::new(mesh, camera, pattern)?;
    let coverage = scene.resolve(|pixel| pixel.covered() as f32 / pattern.len() as f32);
    Mask::new(camera.width as usize, camera.height as usize, coverage)
}

/// Which face is seen through the centre of each pixel, and how far away it is.
#[derive(Clone, Debug, PartialEq)]
pub struct VisibleFaces {
    width: usize,
    height: usize,
    pixels: Vec<Option<(u32, f32)>>,
}

impl VisibleFaces {
    /// Width in pixels.
    #[inline]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    #[inline]
    pub fn height(&self) -> usize {
        self.height
    }

    /// The nearest face at the centre of pixel (x, y).
    #[inline]
    pub fn face(&self, x: usize, y: usize) -> Option<u32> {
        self.pixels[y * self.width + x].map(|(face, _)| face)
    }

    /// Camera depth of that face at the centre of pixel (x, y), metres; infinite where nothing is seen.
    #[inline]
    pub fn depth(&self, x: usize, y: usize) -> f32 {
        self.pixels[y * self.width + x].map_or(f32::INFINITY, |(_, depth)| depth)
    }
}

/// The face buffer and depth buffer of a mesh, one sample at each pixel centre.
///
/// # Errors
/// As [`draw`].
pub fn visible_faces(mesh: &Mesh<'_>, camera: &Camera) -> Result<VisibleFaces, SceneError> {
    let scene = raster::Scene::new(mesh, camera, SamplePattern::new(1))?;
    let pixels = scene.resolve(|pixel| pixel.fragments().next().map(|f| (f.face, f.depth)));
    Ok(VisibleFaces { width: camera.width as usize, height: camera.height as usize, pixels })
}
