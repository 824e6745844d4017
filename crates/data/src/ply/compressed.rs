//! SuperSplat's compressed PLY, as SuperSplat, splat-transform and the PlayCanvas engine write it.
//!
//! An element `chunk` holds the range of 256 consecutive vertices: `min_x … max_z`, `min_scale_x … max_scale_z`
//! (logarithms) and, in newer files, `min_r … max_b` (colours; 0 to 1 without). Each vertex is four words, the first number in
//! the highest bits:
//!
//! | word | bits | what |
//! |---|---|---|
//! | `packed_position` | 11, 10, 11 | x, y, z as fractions of the chunk's range |
//! | `packed_rotation` | 2, 10, 10, 10 | which of `rot_0 … rot_3` is the largest; the others in order, -1/√2 to 1/√2 |
//! | `packed_scale` | 11, 10, 11 | log scales as fractions of the range |
//! | `packed_color` | 8, 8, 8, 8 | R, G, B (0.5 plus SH band 0 times its constant) as fractions of the range; opacity, 0 to 1 |
//!
//! An element `sh` of bytes `f_rest_k` holds the higher bands: 0 is -4, 255 is 4, any other byte the middle of its bin.

use super::REST_COUNTS;
use super::header::Header;
use super::rows::{Column, Rows};
use glam::Vec3;
use skinsplat_core::math::{portable, sh};
use skinsplat_core::scene::{Gaussians, SceneError};

/// Vertices per chunk.
const CHUNK: usize = 256;

/// True if the vertices are packed.
pub(super) fn is_packed(vertices: &Rows<'_>) -> bool {
    vertices.has("packed_position")
}

/// Unpacks the vertices; `body` is what follows the header.
///
/// # Errors
/// Missing elements or properties, fewer chunks than the vertices need.
pub(super) fn gaussians(
    header: &Header,
    vertices: &mut Rows<'_>,
    body: &[u8],
) -> Result<Gaussians, SceneError> {
    let n = vertices.len();
    let chunks = Chunks::read(header, body, n)?;
    let [position, rotation, scale, colour] = vertices
        .columns(&["packed_position", "packed_rotation", "packed_scale", "packed_color"])
        .map_err(named)?;
    let mut g = Gaussians::default();
    let bands = Bands::read(header, body, n)?;
    g.sh_degree = bands.as_ref().map_or(0, |bands| bands.degree);
    for i in 0..n {
        let range = &chunks.0[i / CHUNK];
        let [position, rotation, scale, colour] =
            [position, rotation, scale, colour].map(|column| vertices.bits(i, column));
        let colour = colour?;
        g.means.push(vector(range.position.at(fractions(position?))));
        g.rotations.push(quaternion(rotation?));
        g.log_scales.push(vector(range.log_scale.at(fractions(scale?))));
        let rgb = range.colour.at([24, 16, 8].map(|shift| unit(colour >> shift, 8)));
        g.sh.push(rgb.map(|c| ((c - 0.5) / sh::C0) as f32));
        let opacity = unit(colour, 8);
        g.opacity_logits.push((-portable::ln(1.0 / opacity - 1.0)) as f32);
        if let Some(bands) = &bands {
            bands.push(i, &mut g.sh);
        }
    }
    Ok(g)
}

fn vector(values: [f64; 3]) -> Vec3 {
    Vec3::from_array(values.map(|v| v as f32))
}

/// The error with what the file is.
fn named(error: SceneError) -> SceneError {
    let expected = format!("{} (splat-transform converts a whole file to a plain PLY)", error.expected);
    SceneError::new(error.field, format!("{} in a SuperSplat compressed PLY", error.problem), expected)
}

/// The lowest bits as a fraction of the largest number that they hold.
fn unit(value: u32, bits: u32) -> f64 {
    let largest = (1u32 << bits) - 1;
    f64::from(value & largest) / f64::from(largest)
}

/// Three fractions of 11, 10 and 11 bits.
fn fractions(word: u32) -> [f64; 3] {
    [unit(word >> 21, 11), unit(word >> 11, 10), unit(word, 11)]
}

/// The quaternion (w, x, y, z) whose largest component is left out.
fn quaternion(word: u32) -> [f32; 4] {
    let stored = [20, 10, 0].map(|shift| (unit(word >> shift, 10) - 0.5) * std::f64::consts::SQRT_2);
    let largest = (word >> 30) as usize;
    let squares: f64 = stored.iter().map(|c| c * c).sum();
    let mut others = stored.into_iter();
    std::array::from_fn(|k| match k == largest {
        true => (1.0 - squares).max(0.0).sqrt() as f32,
        false => others.next().unwrap_or_default() as f32,
    })
}

/// From where to where three numbers of a chunk go.
struct Range {
    low: [f64; 3],
    high: [f64; 3],
}

impl Range {
    fn at(&self, fraction: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k: usize| self.low[k] * (1.0 - fraction[k]) + self.high[k] * fraction[k])
    }
}

struct Chunk {
    position: Range,
    log_scale: Range,
    colour: Range,
}

struct Chunks(Vec<Chunk>);

impl Chunks {
    fn read(header: &Header, body: &[u8], vertices: usize) -> Result<Self, SceneError> {
        let Some(mut rows) = Rows::of(header, "chunk", body)? else {
            return Err(named(SceneError::new(
                "element chunk",
                "missing",
                "the ranges of 256 vertices each",
            )));
        };
        let needed = vertices.div_ceil(CHUNK);
        if rows.len() < needed {
            let expected = format!("{needed}, one for {CHUNK} of {vertices} vertices");
            return Err(named(SceneError::new("element chunk", format!("{} chunks", rows.len()), expected)));
        }
        let position =
            rows.columns(&["min_x", "min_y", "min_z", "max_x", "max_y", "max_z"]).map_err(named)?;
        let scales =
            ["min_scale_x", "min_scale_y", "min_scale_z", "max_scale_x", "max_scale_y", "max_scale_z"];
        let log_scale = rows.columns(&scales).map_err(named)?;
        let colours = ["min_r", "min_g", "min_b", "max_r", "max_g", "max_b"];
        let colour = rows.has(colours[0]).then(|| rows.columns(&colours).map_err(named)).transpose()?;
        let range = |row: usize, columns: [Column; 6]| {
            let [a, b, c, d, e, f] = columns.map(|column| rows.number(row, column));
            Range { low: [a, b, c], high: [d, e, f] }
        };
        let chunk = |row| Chunk {
            position: range(row, position),
            log_scale: range(row, log_scale),
            colour: colour.map_or(Range { low: [0.0; 3], high: [1.0; 3] }, |columns| range(row, columns)),
        };
        Ok(Self((0..needed).map(chunk).collect()))
    }
}

/// The higher SH bands.
struct Bands<'a> {
    rows: Rows<'a>,
    columns: Vec<Column>,
    degree: usize,
}

impl<'a> Bands<'a> {
    fn read(header: &'a Header, body: &'a [u8], vertices: usize) -> Result<Option<Self>, SceneError> {
        let Some(mut rows) = Rows::of(header, "sh", body)? else { return Ok(None) };
        if rows.len() != vertices {
            let problem = format!("{} rows", rows.len());
            return Err(named(SceneError::new("element sh", problem, format!("{vertices}, as vertices"))));
        }
        let columns = rows.numbered("f_rest_").map_err(named)?;
        let Some(degree) = REST_COUNTS.iter().position(|&n| n == columns.len()) else {
            let problem = format!("{} properties", columns.len());
            return Err(named(SceneError::new("f_rest", problem, "0, 9, 24 or 45 (SH degree 0 to 3)")));
        };
        Ok(Some(Self { rows, columns, degree }))
    }

    /// Appends the coefficients of a vertex, those of all channels together.
    fn push(&self, row: usize, sh: &mut Vec<[f32; 3]>) {
        let per_channel = self.columns.len() / 3;
        let value = |k: usize| {
            let byte = self.rows.number(row, self.columns[k]);
            let fraction = match byte {
                0.0 => 0.0,
                255.0 => 1.0,
                _ => (byte + 0.5) / 256.0,
            };
            ((fraction - 0.5) * 8.0) as f32
        };
        sh.extend((0..per_channel).map(|k| [0, 1, 2].map(|channel| value(channel * per_channel + k))));
    }
}
