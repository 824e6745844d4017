//! `reproduce skin`: a posed avatar as a plain 3DGS PLY.

use super::posing::{Posing, picked};
use super::{Context, Exit};
use anyhow::{Result, bail};
use skinsplat_core::scene::{Avatar, Binding};
use skinsplat_data::ply;
use skinsplat_posing::{Choice, Resolved, RotationChoice, Strategy, bake};
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
    /// Blend the quaternions of the average with signs that do not let it jump where bones pass 180 degrees
    #[arg(long, value_enum, value_name = "REFERENCE")]
    continuity: Option<Continuity>,
    #[command(flatten)]
    posing: Posing,
}

/// What the signs of joint quaternions stay close to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Continuity {
    /// The frame before: the track is followed from its first pose to --frame
    Previous,
    /// The rest pose of the parent joint, without a memory: the strategy axis rotation=lifted-sum
    Rest,
}

impl Skin {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        if !self.posing.has_body() {
            bail!("--body is missing: an avatar is posed by a body");
        }
        let subject = self.posing.load(&self.avatar)?;
        let choice = self.choice()?;
        let canonical = &subject.avatar().gaussians;
        let (baked, resolved) = match (self.continuity, choice) {
            (Some(Continuity::Previous), Choice::Fixed(strategy)) => {
                let baked = subject.posed_following(&strategy, |posed| Ok(bake(posed, canonical)))?;
                (baked, Some(Resolved { strategy, bound: None }))
            }
            _ => subject
                .posed(choice, None, |posed, resolved| Ok((bake(posed, canonical), resolved.copied())))?,
        };
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

    /// The strategy, its average made a sum of quaternions with signs if continuity was asked for.
    fn choice(&self) -> Result<Choice> {
        let choice = self.posing.strategy();
        if self.continuity.is_none() {
            return Ok(choice);
        }
        match choice {
            Choice::Fixed(strategy) => Ok(Choice::Fixed(continued(strategy)?)),
            Choice::Auto(_) => {
                bail!("--continuity with --strategy {choice}; expected a strategy that is given")
            }
        }
    }
}

fn continued(strategy: Strategy) -> Result<Strategy> {
    match strategy.rotation {
        RotationChoice::QuaternionAverage(_) | RotationChoice::LiftedSum => {
            Ok(Strategy { rotation: RotationChoice::LiftedSum, ..strategy })
        }
        other => {
            bail!("--continuity with rotation={other}; expected a quaternion average, which it continues")
        }
    }
}
