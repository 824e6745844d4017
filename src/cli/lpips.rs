//! The weights of LPIPS on the command line.

use anyhow::{Context as _, Result};
use skinsplat_data::{error::read_bytes, key::sha256_hex};
use skinsplat_metrics::lpips::{
    Network,
    weights::{GivenNetwork, Networks},
};
use std::path::PathBuf;

/// Networks for LPIPS.
#[derive(Debug, clap::Args)]
pub(super) struct LpipsWeights {
    /// Weights of LPIPS (safetensors), for protocols that ask for VGG-16; AlexNet is built in. See crates/lpips-alex/README.md
    #[arg(long = "lpips-weights", value_name = "FILE", env = "REPRODUCE_LPIPS_WEIGHTS")]
    file: Option<PathBuf>,
}

impl LpipsWeights {
    /// The networks at hand. A file is read now; what is built in, when it is needed.
    pub(super) fn networks(&self) -> Result<Networks> {
        let read = |path: &PathBuf| -> Result<GivenNetwork> {
            let bytes = read_bytes(path, "LPIPS weights", "a safetensors file with the weights of LPIPS")?;
            let network = Network::from_safetensors(&bytes).with_context(|| path.display().to_string())?;
            Ok(GivenNetwork { network, digest: sha256_hex(&bytes) })
        };
        Ok(Networks::new(self.file.as_ref().map(read).transpose()?))
    }
}
