//! LPIPS 0.1 (Zhang et al. 2018), with AlexNet or VGG-16, as the `lpips` package computes it.
//!
//! An image in \[-1, 1\] is scaled per channel and fed to the convolutions of a classifier; the rectified outputs of five
//! of its layers are normalised to unit length per pixel; squared differences of two images are weighted per channel,
//! averaged over pixels and added up over the layers. Features are f32, everything after them f64.
//!
//! The networks are behind the feature `lpips`. The names of the variants and the interface are always there: a protocol
//! names its LPIPS whether or not it is computed.

#[cfg(feature = "lpips")]
pub mod convolution;
#[cfg(feature = "lpips")]
mod features;
#[cfg(feature = "lpips")]
mod network;
#[cfg(feature = "lpips")]
mod one_frame;
mod variant;
#[cfg(feature = "lpips")]
pub mod weights;

#[cfg(feature = "lpips")]
pub use features::FeatureMap;
#[cfg(feature = "lpips")]
pub use network::{Features, Network, network_input};
#[cfg(feature = "lpips")]
pub use one_frame::{NetworkSource, OneFrame};
pub use variant::{InputRange, LpipsNet, LpipsVariant, PerceptualDistance};
