//! `reproduce skin`: a posed avatar as a plain 3DGS PLY.

use super::posing::{Posing, picked};
use super::{Context, Exit};
use crate::data::ply;
use crate::scene::{Avatar, Binding};
use crate::strategy::{Views, bake};
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
        let choice = self.posing.strategy();
        let canonical = &subject.avatar().gaussians;
        let (baked, resolved) = subject
            .posed(choice, Views::Any, |posed, resolved| Ok((bake(posed, canonical), resolved.copied())))?;
        let strategy = resolved.map(|resolved| resolved.strategy.to_string()).unwrap_or_default();
        let avatar = Avatar { gaussians: baked.gaussians, binding: Binding::Static };
        let metadata = ply::Metadata { body: None, comments: vec![format!("posed by {strategy}")] };
        ply::write_avatar(&self.out, &avatar, &metadata, ply::Encoding::LittleEndian)?;
        if let Some(note) = picked(choice, resolved.as_ref()) {
            context.note(note);
        }
        if let Some(loss) = baked.loss {
            context.note(format!("{}: {loss}", self.out.display()));
        }
        Ok(Exit::Success)
    }
}
