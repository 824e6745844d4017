#![doc = include_str!("../README.md")]

/// The weights as a safetensors file.
pub const SAFETENSORS: &[u8] = include_bytes!("../lpips_alex.safetensors");
