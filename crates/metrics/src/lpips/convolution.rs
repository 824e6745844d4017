//! Convolution of feature maps: an implicit matrix product on vector instructions.
//!
//! Patches of the input are copied next to each other (never the whole `im2col` matrix) and multiplied with weights that
//! were laid out for it when the network was loaded. An output value is a sum of blocks of `DEPTH` products; inside a
//! block, products are added one after another with fused multiply-adds, on every instruction set: the bits depend on
//! neither the vector width nor on how the work is cut.

use super::FeatureMap;
use pulp::Simd;
use rayon::prelude::*;

/// Output channels that are computed together: the width of a panel of weights.
const PANEL: usize = 32;
/// Pixels that are computed together.
const TILE: usize = 12;
/// Products per block of a sum: a panel and the patches of this depth stay in a core's cache, and sums of blocks lose
/// fewer digits than one long sum.
const DEPTH: usize = 256;

/// The shape of a convolution with a square kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConvolutionShape {
    /// Channels of the input.
    pub inputs: usize,
    /// Channels of the output.
    pub outputs: usize,
    /// Width and height of the kernel.
    pub kernel: usize,
    /// Step between output pixels.
    pub stride: usize,
    /// Zeros around the input.
    pub padding: usize,
}

impl ConvolutionShape {
    /// Products per output value.
    fn depth(&self) -> usize {
        self.kernel * self.kernel * self.inputs
    }

    /// Width or height of the output; 0 if the kernel does not fit.
    pub fn output_size(&self, input: usize) -> usize {
        let padded = input + 2 * self.padding;
        if padded < self.kernel { 0 } else { (padded - self.kernel) / self.stride + 1 }
    }
}

/// A convolution followed by a rectifier, with its weights.
#[derive(Clone, Debug)]
pub struct Convolution {
    shape: ConvolutionShape,
    /// Panel after panel; in a panel, rows over (kernel row, kernel column, input channel), which is the order of a patch.
    panels: Vec<[f32; PANEL]>,
    bias: Vec<[f32; PANEL]>,
}

impl Convolution {
    /// From weights (outputs, inputs, kernel rows, kernel columns), row-major, and one bias per output.
    ///
    /// # Panics
    /// If the slices have other lengths than the shape says.
    pub fn new(shape: ConvolutionShape, weights: &[f32], bias: &[f32]) -> Self {
        let depth = shape.depth();
        assert_eq!(weights.len(), shape.outputs * depth, "weights of {shape:?}");
        assert_eq!(bias.len(), shape.outputs, "biases of {shape:?}");
        let taps = shape.kernel * shape.kernel;
        let groups = shape.outputs.div_ceil(PANEL);
        let (mut panels, mut padded) = (vec![[0.0; PANEL]; groups * depth], vec![[0.0; PANEL]; groups]);
        for output in 0..shape.outputs {
            let (group, column) = (output / PANEL, output % PANEL);
            padded[group][column] = bias[output];
            for tap in 0..taps {
                for input in 0..shape.inputs {
                    panels[group * depth + tap * shape.inputs + input][column] =
                        weights[(output * shape.inputs + input) * taps + tap];
                }
            }
        }
        Self { shape, panels, bias: padded }
    }

    /// The shape.
    pub fn shape(&self) -> ConvolutionShape {
        self.shape
    }

    /// `max(0, weights * input + bias)`.
    pub fn rectified(&self, input: &FeatureMap) -> FeatureMap {
        self.rectified_on(skinsplat_simd::arch(), input)
    }

    fn rectified_on(&self, arch: pulp::Arch, input: &FeatureMap) -> FeatureMap {
        debug_assert_eq!(input.channels, self.shape.inputs);
        let (width, height) = (self.shape.output_size(input.width), self.shape.output_size(input.height));
        let mut output = FeatureMap::zeros(width, height, self.shape.outputs);
        // Larger chunks read the weights less often; small images need enough chunks for all threads.
        let pixels = if width * height < 2048 { 4 * TILE } else { 8 * TILE };
        let chunks = output.values.par_chunks_mut(pixels * self.shape.outputs).enumerate();
        chunks.for_each_init(Vec::new, |patches, (chunk, values)| {
            let first = chunk * pixels;
            arch.dispatch(Chunk { convolution: self, input, width, first, values, patches });
        });
        output
    }
}

/// Consecutive output pixels.
struct Chunk<'a> {
    convolution: &'a Convolution,
    input: &'a FeatureMap,
    /// Width of the output.
    width: usize,
    /// Index of the first pixel.
    first: usize,
    /// The output values of all pixels of the chunk.
    values: &'a mut [f32],
    /// Scratch: tile after tile, one block deep.
    patches: &'a mut Vec<[f32; TILE]>,
}

impl pulp::WithSimd for Chunk<'_> {
    type Output = ();

    /// Register tiles that keep the multipliers busy without spilling: 24 accumulators where there are 32 registers, 12
    /// where there are 16.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match S::F32_LANES {
            16 => self.run::<S, 2, 12>(simd),
            8 => self.run::<S, 2, 6>(simd),
            4 => self.run::<S, 4, 6>(simd),
            _ => self.run::<S, 8, 1>(simd),
        }
    }
}

impl Chunk<'_> {
    #[inline(always)]
    fn run<S: Simd, const VECTORS: usize, const PIXELS: usize>(self, simd: S) {
        let Self { convolution: Convolution { shape, panels, bias }, input, width, first, values, patches } =
            self;
        let (depth, outputs) = (shape.depth(), shape.outputs);
        let pixels = values.len() / outputs;
        let tiles = pixels.div_ceil(TILE);
        for start in (0..depth).step_by(DEPTH) {
            let rows = DEPTH.min(depth - start);
            patches.clear();
            patches.resize(tiles * rows, [0.0; TILE]);
            for (tile, patches) in patches.chunks_exact_mut(rows).enumerate() {
                for pixel in 0..TILE.min(pixels - tile * TILE) {
                    let at = first + tile * TILE + pixel;
                    copy_patch(shape, input, (at % width, at / width), start, patches, pixel);
                }
            }
            let last = start + rows == depth;
            for (group, bias) in bias.iter().enumerate() {
                let panel = &panels[group * depth + start..][..rows];
                let initial = if start == 0 { Some(bias) } else { None };
                for (tile, patches) in patches.chunks_exact(rows).enumerate() {
                    let store = Store { tile: tile * TILE, pixels, outputs, group, initial, last };
                    product::<S, VECTORS, PIXELS>(simd, panel, patches, values, &store);
                }
            }
        }
    }
}

/// Where the product of a panel and a tile goes.
struct Store<'a> {
    /// First pixel of the tile.
    tile: usize,
    /// Pixels of the chunk.
    pixels: usize,
    outputs: usize,
    /// Number of the panel.
    group: usize,
    /// What the first block is added to; later ones are added to what is there.
    initial: Option<&'a [f32; PANEL]>,
    /// Whether this is the last block, after which the rectifier comes.
    last: bool,
}

/// Adds panel x patches to the output.
#[inline(always)]
fn product<S: Simd, const VECTORS: usize, const PIXELS: usize>(
    simd: S,
    panel: &[[f32; PANEL]],
    patches: &[[f32; TILE]],
    values: &mut [f32],
    store: &Store<'_>,
) {
    let lanes = S::F32_LANES;
    let mut channel = 0;
    while channel < PANEL {
        let mut pixel = 0;
        while pixel < TILE {
            let mut sums = [[simd.splat_f32s(0.0); VECTORS]; PIXELS];
            for (weights, patch) in panel.iter().zip(patches) {
                let weights = S::as_simd_f32s(&weights[channel..channel + VECTORS * lanes]).0;
                for p in 0..PIXELS {
                    let value = simd.splat_f32s(patch[pixel + p]);
                    for v in 0..VECTORS {
                        sums[p][v] = simd.mul_add_f32s(weights[v], value, sums[p][v]);
                    }
                }
            }
            for p in 0..PIXELS {
                let mut block = [0.0f32; PANEL];
                for v in 0..VECTORS {
                    S::as_mut_simd_f32s(&mut block[v * lanes..(v + 1) * lanes]).0[0] = sums[p][v];
                }
                add_block(&block[..VECTORS * lanes], channel, pixel + p, values, store);
            }
            pixel += PIXELS;
        }
        channel += VECTORS * lanes;
    }
}

/// Adds what a block contributes to one pixel's channels from `channel` of the panel on.
#[inline(always)]
fn add_block(block: &[f32], channel: usize, pixel: usize, values: &mut [f32], store: &Store<'_>) {
    let first = store.group * PANEL + channel;
    if store.tile + pixel >= store.pixels || first >= store.outputs {
        return;
    }
    let count = block.len().min(store.outputs - first);
    let values = &mut values[(store.tile + pixel) * store.outputs + first..][..count];
    if let Some(initial) = store.initial {
        values.copy_from_slice(&initial[channel..channel + count]);
    }
    for (value, sum) in values.iter_mut().zip(block) {
        *value += sum;
    }
    if store.last {
        values.iter_mut().for_each(|value| *value = value.max(0.0));
    }
}

/// Copies the values from `start` on of the patch of output pixel `at` into column `column`: row after row of the kernel,
/// each of which lies in one piece in the input, but for what is beyond its borders.
#[inline(always)]
fn copy_patch(
    shape: &ConvolutionShape,
    input: &FeatureMap,
    at: (usize, usize),
    start: usize,
    patches: &mut [[f32; TILE]],
    column: usize,
) {
    let ConvolutionShape { inputs, kernel, stride, padding, .. } = *shape;
    let (line, pad) = (input.width * inputs, padding * inputs);
    let mut done = 0;
    while done < patches.len() {
        let (row, from) = ((start + done) / (kernel * inputs), (start + done) % (kernel * inputs));
        let count = (kernel * inputs - from).min(patches.len() - done);
        let patches = &mut patches[done..done + count];
        done += count;
        let y = (at.1 * stride + row).checked_sub(padding).filter(|&y| y < input.height);
        // Where the row of the kernel begins in the line of the input, counted from the padding.
        let begin = at.0 * stride * inputs + from;
        let left = pad.saturating_sub(begin).min(count);
        let right = (pad + line).saturating_sub(begin).clamp(left, count);
        let inside = match y {
            Some(y) if left < right => &input.values[y * line + begin + left - pad..][..right - left],
            _ => &[],
        };
        let left = if inside.is_empty() { count } else { left };
        patches[..left].iter_mut().for_each(|patch| patch[column] = 0.0);
        patches[left..].iter_mut().zip(inside).for_each(|(patch, value)| patch[column] = *value);
        if left < count {
            patches[right..].iter_mut().for_each(|patch| patch[column] = 0.0);
        }
    }
}

/// The largest value of each `size` x `size` window, every `stride` pixels; what is left at the right and bottom is
/// dropped.
pub(super) fn max_pooled(input: &FeatureMap, size: usize, stride: usize) -> FeatureMap {
    let output = |side: usize| if side < size { 0 } else { (side - size) / stride + 1 };
    let (width, height, channels) = (output(input.width), output(input.height), input.channels);
    let mut pooled = FeatureMap::zeros(width, height, channels);
    let arch = skinsplat_simd::arch();
    let rows = pooled.values.par_chunks_mut((width * channels).max(1)).enumerate();
    rows.for_each(|(y, row)| arch.dispatch(PooledRow { input, size, stride, y, row }));
    pooled
}

/// One row of [`max_pooled`].
struct PooledRow<'a> {
    input: &'a FeatureMap,
    size: usize,
    stride: usize,
    y: usize,
    row: &'a mut [f32],
}

impl pulp::NullaryFnOnce for PooledRow<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { input, size, stride, y, row } = self;
        for (x, values) in row.chunks_exact_mut(input.channels).enumerate() {
            values.copy_from_slice(input.at(x * stride, y * stride));
            for tap in 1..size * size {
                let window = input.at(x * stride + tap % size, y * stride + tap / size);
                for (value, &other) in values.iter_mut().zip(window) {
                    *value = if other > *value { other } else { *value };
                }
            }
        }
    }
}
