//! The two networks of LPIPS 0.1: their layers, and the features of an image.

use super::convolution::{Convolution, ConvolutionShape, max_pooled};
use super::{FeatureMap, InputRange, LpipsNet};
use crate::Planes;

/// A layer of a backbone. Convolutions are followed by a rectifier.
#[derive(Clone, Copy, Debug)]
enum Layer {
    /// Convolution of this place in torchvision's `.features`.
    Convolution { index: usize, outputs: usize, kernel: usize, stride: usize, padding: usize },
    /// Maximum over windows.
    Pool { size: usize, stride: usize },
    /// What came out of the layer before is compared.
    Tap,
}

const fn conv(index: usize, outputs: usize, kernel: usize, stride: usize, padding: usize) -> Layer {
    Layer::Convolution { index, outputs, kernel, stride, padding }
}

const fn conv3(index: usize, outputs: usize) -> Layer {
    conv(index, outputs, 3, 1, 1)
}

const ALEX: &[Layer] = {
    const POOL: Layer = Layer::Pool { size: 3, stride: 2 };
    use Layer::Tap;
    &[
        conv(0, 64, 11, 4, 2),
        Tap,
        POOL,
        conv(3, 192, 5, 1, 2),
        Tap,
        POOL,
        conv3(6, 384),
        Tap,
        conv3(8, 256),
        Tap,
        conv3(10, 256),
        Tap,
    ]
};

const VGG: &[Layer] = {
    const POOL: Layer = Layer::Pool { size: 2, stride: 2 };
    use Layer::Tap;
    &[
        conv3(0, 64),
        conv3(2, 64),
        Tap,
        POOL,
        conv3(5, 128),
        conv3(7, 128),
        Tap,
        POOL,
        conv3(10, 256),
        conv3(12, 256),
        conv3(14, 256),
        Tap,
        POOL,
        conv3(17, 512),
        conv3(19, 512),
        conv3(21, 512),
        Tap,
        POOL,
        conv3(24, 512),
        conv3(26, 512),
        conv3(28, 512),
        Tap,
    ]
};

/// LPIPS scales its input as ImageNet classifiers do, for values from -1 to 1.
const SHIFT: [f64; 3] = [-0.030, -0.088, -0.188];
const SCALE: [f64; 3] = [0.458, 0.448, 0.450];

impl LpipsNet {
    fn layers(self) -> &'static [Layer] {
        match self {
            Self::Alex => ALEX,
            Self::Vgg => VGG,
        }
    }

    /// Names and shapes of the tensors of its weights, in the order that [`Network::new`] takes them: per convolution
    /// `features.N.weight` (outputs, inputs, rows, columns) and `features.N.bias`, with torchvision's numbers, then
    /// `lin.K.weight` (1, channels, 1, 1) per tap.
    pub fn tensors(self) -> Vec<(String, Vec<usize>)> {
        let (mut tensors, mut lins, mut channels) = (Vec::new(), Vec::new(), 3);
        for layer in self.layers() {
            match *layer {
                Layer::Convolution { index, outputs, kernel, .. } => {
                    let shape = vec![outputs, channels, kernel, kernel];
                    tensors.push((format!("features.{index}.weight"), shape));
                    tensors.push((format!("features.{index}.bias"), vec![outputs]));
                    channels = outputs;
                }
                Layer::Tap => lins.push((format!("lin.{}.weight", lins.len()), vec![1, channels, 1, 1])),
                Layer::Pool { .. } => (),
            }
        }
        tensors.extend(lins);
        tensors
    }

    /// Smallest width and height of an image, below which a layer has no output.
    pub fn minimum_size(self) -> usize {
        match self {
            Self::Alex => 31,
            Self::Vgg => 16,
        }
    }
}

/// A backbone and the weights of its taps' channels.
#[derive(Clone, Debug)]
pub struct Network {
    net: LpipsNet,
    convolutions: Vec<Convolution>,
    /// Per tap, a weight per channel.
    lins: Vec<Vec<f64>>,
}

/// The rectified outputs of a network's taps for one image.
#[derive(Clone, Debug)]
pub struct Features {
    /// Tap after tap.
    pub taps: Vec<FeatureMap>,
}

impl Network {
    /// From the values of [`LpipsNet::tensors`], in that order, row-major.
    ///
    /// # Panics
    /// If their number or lengths differ.
    pub fn new(net: LpipsNet, tensors: &[Vec<f32>]) -> Self {
        let mut tensors = tensors.iter();
        let mut next = || tensors.next().expect("a tensor for every name");
        let (mut convolutions, mut inputs) = (Vec::new(), 3);
        for layer in net.layers() {
            if let Layer::Convolution { outputs, kernel, stride, padding, .. } = *layer {
                let shape = ConvolutionShape { inputs, outputs, kernel, stride, padding };
                convolutions.push(Convolution::new(shape, next(), next()));
                inputs = outputs;
            }
        }
        let taps = net.layers().iter().filter(|layer| matches!(layer, Layer::Tap));
        let lins = taps.map(|_| next().iter().copied().map(f64::from).collect()).collect();
        Self { net, convolutions, lins }
    }

    /// Which network it is.
    pub fn net(&self) -> LpipsNet {
        self.net
    }

    /// The features of an input that [`network_input`] made and that is not below the minimum size.
    pub fn features(&self, input: &FeatureMap) -> Features {
        let mut convolutions = self.convolutions.iter();
        let mut taps: Vec<FeatureMap> = Vec::new();
        // What the next layer reads, where that is not the last tap.
        let mut current = None;
        for layer in self.net.layers() {
            let source = current.as_ref().or(taps.last()).unwrap_or(input);
            match *layer {
                Layer::Convolution { .. } => {
                    let convolution = convolutions.next().expect("made for these layers");
                    current = Some(convolution.rectified(source));
                }
                Layer::Pool { size, stride } => current = Some(max_pooled(source, size, stride)),
                Layer::Tap => taps.extend(current.take()),
            }
        }
        Features { taps }
    }

    /// What each tap contributes to the distance of two images of equal size: the mean over its pixels of the weighted
    /// squared differences of their features, normalised per pixel. LPIPS is the sum.
    pub fn layer_distances(&self, a: &Features, b: &Features) -> Vec<f64> {
        let taps = a.taps.iter().zip(&b.taps).zip(&self.lins);
        taps.map(|((a, b), weights)| a.weighted_distance(b, weights)).collect()
    }
}

/// The scaled input of the networks for an image.
pub fn network_input(image: &Planes, range: InputRange) -> FeatureMap {
    let mut input = FeatureMap::zeros(image.width(), image.height(), 3);
    for (c, plane) in image.channels().iter().enumerate() {
        for (pixel, &value) in input.values.chunks_exact_mut(3).zip(plane) {
            let value = match range {
                InputRange::Pm1 => 2.0 * value - 1.0,
                InputRange::Raw01 => value,
            };
            pixel[c] = ((value - SHIFT[c]) / SCALE[c]) as f32;
        }
    }
    input
}
