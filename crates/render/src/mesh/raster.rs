//! Visibility: which triangle is nearest at each sample. Square tiles, each with its own small depth buffer.

use super::setup::{self, Triangle, UNITS};
use super::{Fragment, Mesh, SamplePattern};
use glam::Vec3;
use rayon::prelude::*;
use skinsplat_core::scene::{Camera, SceneError};

/// Pixels along a side of a tile: with 16 samples per pixel, a tile's buffers take 32 KiB.
const TILE: usize = 16;

/// No triangle covers the sample.
const NONE: u32 = u32::MAX;

/// A mesh in front of a camera, binned into tiles.
pub(super) struct Scene<'a> {
    mesh: Mesh<'a>,
    width: usize,
    height: usize,
    /// Sample positions in units from the pixel corner.
    samples: Vec<[i64; 2]>,
    triangles: Vec<Triangle>,
    bins: Bins,
}

impl<'a> Scene<'a> {
    pub(super) fn new(mesh: &Mesh<'a>, camera: &Camera, pattern: SamplePattern) -> Result<Self, SceneError> {
        camera.validate()?;
        let (width, height) = (camera.width as usize, camera.height as usize);
        let triangles = setup::triangles(mesh, camera);
        let bins = Bins::new(&triangles, width.div_ceil(TILE), height.div_ceil(TILE));
        Ok(Self { mesh: *mesh, width, height, samples: pattern.positions(UNITS), triangles, bins })
    }

    /// Calls `pixel` for every pixel with a covered sample; the others get the default value. Row-major.
    pub(super) fn resolve<P: Clone + Default + Send>(
        &self,
        pixel: impl Fn(PixelSamples<'_>) -> P + Sync,
    ) -> Vec<P> {
        let mut pixels = vec![P::default(); self.width * self.height];
        let rows = pixels.par_chunks_mut(self.width * TILE).enumerate();
        rows.for_each_init(
            || TileBuffer::new(self.samples.len()),
            |buffer, (tile_y, rows)| {
                for tile_x in 0..self.bins.tiles_x {
                    let bin = self.bins.triangles(tile_x, tile_y);
                    if !bin.is_empty() {
                        self.fill(buffer, bin, tile_x * TILE, tile_y * TILE);
                        self.resolve_tile(buffer, tile_x * TILE, tile_y * TILE, rows, &pixel);
                    }
                }
            },
        );
        pixels
    }

    /// Depth-tests the triangles of a bin against the samples of the tile whose corner is (left, top).
    fn fill(&self, buffer: &mut TileBuffer, bin: &[u32], left: usize, top: usize) {
        buffer.clear();
        for &index in bin {
            let triangle = &self.triangles[index as usize];
            buffer.steps.set(triangle, &self.samples);
            let clamp = |range: [u32; 2], start: usize| {
                (range[0] as usize).max(start)..(range[1] as usize + 1).min(start + TILE)
            };
            for y in clamp(triangle.rows, top) {
                for x in clamp(triangle.columns, left) {
                    buffer.test(triangle, index, (x, y), (y - top) * TILE + x - left);
                }
            }
        }
    }

    fn resolve_tile<P>(
        &self,
        buffer: &TileBuffer,
        left: usize,
        top: usize,
        rows: &mut [P],
        pixel: &impl Fn(PixelSamples<'_>) -> P,
    ) {
        let count = self.samples.len();
        for (local_y, row) in rows.chunks_mut(self.width).enumerate() {
            let right = (left + TILE).min(self.width);
            for (local_x, out) in row[left..right].iter_mut().enumerate() {
                let slot = (local_y * TILE + local_x) * count;
                let nearest = &buffer.nearest[slot..slot + count];
                if nearest.iter().any(|&t| t != NONE) {
                    *out = pixel(PixelSamples { scene: self, x: left + local_x, y: top + local_y, nearest });
                }
            }
        }
    }
}

/// The nearest triangle at each sample of one pixel.
#[derive(Clone, Copy)]
pub(super) struct PixelSamples<'a> {
    scene: &'a Scene<'a>,
    x: usize,
    y: usize,
    nearest: &'a [u32],
}

impl<'a> PixelSamples<'a> {
    /// Number of covered samples.
    pub(super) fn covered(self) -> usize {
        self.nearest.iter().filter(|&&t| t != NONE).count()
    }

    /// The fragment at each covered sample.
    #[inline]
    pub(super) fn fragments(self) -> impl Iterator<Item = Fragment> + 'a {
        let covered = self.nearest.iter().zip(&self.scene.samples).filter(|(t, _)| **t != NONE);
        covered.map(move |(&t, &sample)| self.fragment(&self.scene.triangles[t as usize], sample))
    }

    fn fragment(self, triangle: &Triangle, sample: [i64; 2]) -> Fragment {
        let pixels = |corner: usize, units: i64| corner as f64 + units as f64 / UNITS as f64;
        let weights = triangle.barycentric_at(pixels(self.x, sample[0]), pixels(self.y, sample[1]));
        let barycentric = weights.map(|b| b as f32);
        let mesh = &self.scene.mesh;
        let corners = mesh.faces[triangle.face as usize].map(|i| mesh.vertices[i as usize]);
        let position: Vec3 = corners.iter().zip(barycentric).map(|(&v, b)| v * b).sum();
        let depth = triangle.depths.iter().zip(weights).map(|(z, b)| z * b).sum::<f64>() as f32;
        Fragment { face: triangle.face, barycentric, depth, position }
    }
}

/// The triangles that may touch each tile, in the order of the faces.
struct Bins {
    tiles_x: usize,
    offsets: Vec<usize>,
    triangles: Vec<u32>,
}

impl Bins {
    fn new(triangles: &[Triangle], tiles_x: usize, tiles_y: usize) -> Self {
        let tiles = |triangle: &Triangle| {
            let range = |pixels: [u32; 2]| pixels[0] as usize / TILE..pixels[1] as usize / TILE + 1;
            let columns = range(triangle.columns);
            range(triangle.rows).flat_map(move |y| columns.clone().map(move |x| y * tiles_x + x))
        };
        let mut offsets = vec![0; tiles_x * tiles_y + 1];
        for tile in triangles.iter().flat_map(tiles) {
            offsets[tile + 1] += 1;
        }
        for tile in 1..offsets.len() {
            offsets[tile] += offsets[tile - 1];
        }
        let mut next = offsets.clone();
        let mut entries = vec![0; offsets[tiles_x * tiles_y]];
        for (index, triangle) in triangles.iter().enumerate() {
            for tile in tiles(triangle) {
                entries[next[tile]] = index as u32;
                next[tile] += 1;
            }
        }
        Self { tiles_x, offsets, triangles: entries }
    }

    fn triangles(&self, x: usize, y: usize) -> &[u32] {
        let tile = y * self.tiles_x + x;
        &self.triangles[self.offsets[tile]..self.offsets[tile + 1]]
    }
}

/// Inverse depth and nearest triangle of every sample of a tile.
struct TileBuffer {
    inverse_depth: Vec<f32>,
    nearest: Vec<u32>,
    steps: SampleSteps,
}

impl TileBuffer {
    fn new(samples: usize) -> Self {
        let count = TILE * TILE * samples;
        Self { inverse_depth: vec![0.0; count], nearest: vec![NONE; count], steps: SampleSteps::new(samples) }
    }

    fn clear(&mut self) {
        self.inverse_depth.fill(0.0);
        self.nearest.fill(NONE);
    }

    /// Tests one triangle at the samples of pixel (x, y), the `slot`-th of the tile. Faces come in order and only a
    /// nearer one replaces another: the lowest index wins a tie.
    #[inline]
    fn test(&mut self, triangle: &Triangle, index: u32, (x, y): (usize, usize), slot: usize) {
        let corner = [x as i64 * UNITS, y as i64 * UNITS];
        let edges = triangle.edges.map(|edge| edge.at(corner[0], corner[1]));
        if (0..3).any(|k| edges[k] + self.steps.largest[k] < 0) {
            return;
        }
        let inverse_depth = triangle.inverse_depth.at(x as f64, y as f64) as f32;
        let [farthest, nearest] = triangle.inverse_depth_range;
        let count = self.steps.edges[0].len();
        let depths = &mut self.inverse_depth[slot * count..(slot + 1) * count];
        let ids = &mut self.nearest[slot * count..(slot + 1) * count];
        let [e0, e1, e2] = &self.steps.edges;
        for s in 0..count {
            // a negative value in any of the three sets the sign bit
            if (edges[0] + e0[s]) | (edges[1] + e1[s]) | (edges[2] + e2[s]) >= 0 {
                // min and max, unlike clamp, take a bound where a face seen edge-on gives NaN
                let value = (inverse_depth + self.steps.inverse_depth[s]).max(farthest).min(nearest);
                if value > depths[s] {
                    depths[s] = value;
                    ids[s] = index;
                }
            }
        }
    }
}

/// How the edge functions and the inverse depth of one triangle change from a pixel's corner to its samples.
struct SampleSteps {
    edges: [Vec<i64>; 3],
    largest: [i64; 3],
    inverse_depth: Vec<f32>,
}

impl SampleSteps {
    fn new(samples: usize) -> Self {
        Self {
            edges: std::array::from_fn(|_| vec![0; samples]),
            largest: [0; 3],
            inverse_depth: vec![0.0; samples],
        }
    }

    fn set(&mut self, triangle: &Triangle, samples: &[[i64; 2]]) {
        for (k, edge) in triangle.edges.iter().enumerate() {
            let mut largest = i64::MIN;
            for (step, sample) in self.edges[k].iter_mut().zip(samples) {
                *step = edge.x * sample[0] + edge.y * sample[1];
                largest = largest.max(*step);
            }
            self.largest[k] = largest;
        }
        let pixels = |units: i64| units as f64 / UNITS as f64;
        for (step, sample) in self.inverse_depth.iter_mut().zip(samples) {
            *step = triangle.inverse_depth.change(pixels(sample[0]), pixels(sample[1])) as f32;
        }
    }
}
