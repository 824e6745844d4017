//! `reproduce skin`: a posed avatar as a plain 3DGS PLY.

use super::posing::Posing;
use super::{Context, Exit};
use anyhow::{Result, bail};
use skinsplat_core::scene::{Avatar, Binding};
use skinsplat_data::ply;
use skinsplat_posing::{RotationChoice, Strategy, bake};
use std::path::PathBuf;

/// Pose an avatar and write a plain static 3DGS PLY.
///
/// Quaternions and SH are rotated, so any rasterizer draws the posed avatar: none needs to change.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Skin {
    /// The canonical avatar, whoever made it
    #[arg(value_name = "AVATAR")]
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

const EXAMPLES: &str = "\
Examples:
  reproduce skin avatar.ply --body body.npz --poses poses.npz --frame 12 --out posed.ply
  reproduce skin a.ply --body rig.glb --poses rig.glb --clip Walk --strategy lbs --out posed.ply";

impl Skin {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        if !self.posing.has_body() {
            bail!("--body is missing: an avatar is posed by a body");
        }
        let subject = self.posing.load(&self.avatar)?;
        let strategy = self.strategy()?;
        let canonical = &subject.avatar().gaussians;
        let baked = match self.continuity {
            Some(Continuity::Previous) => {
                subject.posed_following(&strategy, |posed| Ok(bake(posed, canonical)))?
            }
            Some(Continuity::Rest) | None => subject.posed(&strategy, |posed| Ok(bake(posed, canonical)))?,
        };
        let avatar = Avatar { gaussians: baked.gaussians, binding: Binding::Static };
        let metadata = ply::Metadata { body: None, comments: vec![format!("posed by {strategy}")] };
        ply::write_avatar(&self.out, &avatar, &metadata, ply::Encoding::LittleEndian)?;
        subject.notes().iter().for_each(|note| context.note(note));
        if let Some(loss) = baked.loss {
            context.note(format!("{}: {loss}", self.out.display()));
        }
        Ok(Exit::Success)
    }

    /// The strategy, its average made a sum of quaternions with signs if continuity was asked for.
    fn strategy(&self) -> Result<Strategy> {
        let strategy = self.posing.strategy();
        if self.continuity.is_some() { continued(strategy) } else { Ok(strategy) }
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
