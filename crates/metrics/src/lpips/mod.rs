//! LPIPS 0.1 (Zhang et al. 2018), with AlexNet or VGG-16, as the `lpips` package computes it.
//!
//! An image in \[-1, 1\] is scaled per channel and fed to the convolutions of a classifier; the rectified outputs of five
//! of its layers are normalised to unit length per pixel; squared differences of two images are weighted per channel,
//! averaged over pixels and added up over the layers. Features are f32, everything after them f64.

pub mod convolution;
mod features;
mod network;
mod one_frame;
mod variant;
pub mod weights;

pub use features::FeatureMap;
pub use network::{Features, Network, network_input};
pub use one_frame::{NetworkSource, OneFrame};
pub use variant::{InputRange, LpipsNet, LpipsVariant, PerceptualDistance};
