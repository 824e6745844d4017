//! `reproduce skin`: a posed avatar as a plain 3DGS PLY.

use super::{Context, Exit, posing::Posing};
use crate::data::ply;
use anyhow::{Result, bail};
use std::path::PathBuf;

/// Pose an avatar and write a plain static 3DGS PLY.
///
/// Quaternions and SH are rotated, so any rasterizer draws the posed avatar: none needs to change.
#[derive(Debug, clap::Args)]
pub(super) struct Skin {
    /// The canonical avatar
    #[arg(value_name = "AVATAR.ply")]
    avatar: PathBuf,
    /// The posed Gaussians to write
    #[arg(long, value_name = "POSED.ply")]
    out: PathBuf,
    #[command(flatten)]
    posing: Posing,
}

impl Skin {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        if !self.posing.has_body() {
            bail!("--body is missing: an avatar is posed by a body");
        }
        let subject = self.posing.load(&self.avatar)?;
        let strategy = self.posing.strategy();
        let baked = subject.posed(strategy, |posed| Ok(crate::strategy::bake(posed)))?;
        ply::write_static(&self.out, &baked.gaussians, &[&format!("posed by {strategy}")])?;
        if let Some(loss) = baked.loss {
            context.note(format!("{}: {loss}", self.out.display()));
        }
        Ok(Exit::Success)
    }
}
