//! The weights of LPIPS on the command line.

use crate::data::lpips_weights::Networks;
use anyhow::Result;
use std::path::PathBuf;

/// Networks for LPIPS.
#[derive(Debug, clap::Args)]
pub(super) struct LpipsWeights {
    /// Weights of LPIPS (safetensors), for protocols that ask for VGG-16; AlexNet is built in. See assets/README.md
    #[arg(long = "lpips-weights", value_name = "FILE", env = "REPRODUCE_LPIPS_WEIGHTS")]
    file: Option<PathBuf>,
}

impl LpipsWeights {
    /// The networks at hand. A file is read now; what is built in, when it is needed.
    pub(super) fn networks(&self) -> Result<Networks> {
        Ok(Networks::new(self.file.as_deref())?)
    }
}
