//! `reproduce export`: avatars as files that other programs open.

use super::output::emit;
use super::posing::{Posing, Track};
use super::{Context, Exit};
use anyhow::{Context as _, Result, bail};
use skinsplat_core::math::sh;
use skinsplat_core::scene::{Avatar, Binding, Gaussians, Pose, PosedBody, RestBody, SkinWeights};
use skinsplat_data::gltf::{Motion, write_skinned_splats, write_splats};
use skinsplat_data::{atomic, ply};
use skinsplat_posing::{BoundAvatar, PoseOptions, Poser, Strategy, bake};
use std::path::{Path, PathBuf};

/// Write an avatar as files that other programs open: posed PLY, posed GLB, skinned GLB.
///
/// Posed files hold static Gaussians, quaternions and SH turned: any viewer draws them. GLB files follow
/// KHR_gaussian_splatting. The skinned one holds the canonical Gaussians with JOINTS and WEIGHTS, skeleton and clip: a
/// proposal, since the extension does not say what a skin does to rotations and SH and no viewer draws it yet. All of them
/// are avatars that this program reads again.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Export {
    /// The canonical avatar, whoever made it
    #[arg(value_name = "AVATAR")]
    avatar: PathBuf,
    /// What to write
    #[arg(long, value_enum, value_name = "KIND")]
    to: Kind,
    /// The file to write; with --all-frames a folder
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,
    /// A file for every pose of the track
    #[arg(long, requires = "poses")]
    all_frames: bool,
    /// SH degree of the file: 0 leaves the others out (small viewers), 3 pads with zeros (viewers that expect 62 properties)
    /// [default: that of the avatar]
    #[arg(long, value_name = "L", value_parser = clap::value_parser!(u8).range(0..=3))]
    degree: Option<u8>,
    #[command(flatten)]
    posing: Posing,
}

/// A kind of file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Kind {
    /// Static 3DGS PLY of a pose
    PosedPly,
    /// Static GLB of a pose, KHR_gaussian_splatting
    Glb,
    /// Canonical Gaussians with skin and clip, KHR_gaussian_splatting: a proposal
    SkinnedGlb,
    /// How to get an SPZ file: prints the commands
    SpzHint,
}

const EXAMPLES: &str = "\
Examples:
  reproduce export A.ply --body B.npz --poses P.npz --frame 9 --to posed-ply --degree 3 --out p.ply
  reproduce export A.ply --body B.npz --poses P.npz --all-frames --to glb --out frames/
  reproduce export A.ply --body B.glb --poses B.glb --to skinned-glb --out skinned.glb";

const SPZ_HINT: &str = "\
SPZ is not written here. Pose first, then convert with PlayCanvas's splat-transform (npm, Node 22 or later):
  reproduce export AVATAR --body BODY --poses POSES --frame N --to posed-ply --out posed.ply
  npx @playcanvas/splat-transform posed.ply posed.spz
SPZ rounds positions, colours and rotations, and holds no skinning weights. The axes stay as they are: y up. (Its conversion of
PLY to GLB turns by 180 degrees about z; --to glb here does not.)
";

impl Export {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        self.check_choices()?;
        if self.to == Kind::SpzHint {
            emit(SPZ_HINT)?;
            return Ok(Exit::Success);
        }
        let Some(out) = &self.out else { bail!("--out: missing; expected a file to write") };
        self.check_out(out)?;
        if !self.posing.has_body() {
            bail!("--body is missing: an avatar is posed by a body");
        }
        let whole = self.all_frames || (self.to == Kind::SkinnedGlb && self.posing.has_poses());
        let posing = if whole { self.posing.at_last_frame()? } else { self.posing.clone() };
        let subject = posing.load(&self.avatar)?;
        subject.notes().iter().for_each(|note| context.note(note));
        let Some(track) = subject.track() else { bail!("--body is missing: an avatar is posed by a body") };
        match self.to {
            Kind::SkinnedGlb => self.write_skinned(out, subject.avatar(), &track, context)?,
            _ if self.all_frames => self.write_frames(out, subject.avatar(), &track, context)?,
            _ => {
                let last = [*track.poses.last().context("--poses: no pose")?];
                let mut written = |gaussians: &Gaussians, _| self.write_posed(out, gaussians);
                posed(subject.avatar(), track.rest, &last, &posing.strategy(), context, &mut written)?;
            }
        }
        Ok(Exit::Success)
    }

    /// Refuses options that the kind of file would leave without effect.
    fn check_choices(&self) -> Result<()> {
        let chosen = match (self.to, self.posing.chosen()) {
            (Kind::SpzHint, _) if self.out.is_some() => Some("--out"),
            (Kind::SpzHint, _) if self.degree.is_some() => Some("--degree"),
            (Kind::SpzHint | Kind::SkinnedGlb, Some(option)) => Some(option),
            (_, Some("--frame")) if self.all_frames => {
                bail!("--frame with --all-frames; expected one of the two")
            }
            _ => None,
        };
        let what = match self.to {
            Kind::SpzHint => "--to spz-hint, which writes nothing",
            _ => "--to skinned-glb, which holds every pose and no strategy",
        };
        chosen.map_or(Ok(()), |option| bail!("{option} with {what}; expected it without"))
    }

    /// Refuses what the kind of file does not allow: frame by frame, or under another ending.
    fn check_out(&self, out: &Path) -> Result<()> {
        if self.all_frames && self.to == Kind::SkinnedGlb {
            bail!(
                "--all-frames with --to skinned-glb; expected one of the two: its clip holds every pose of the track"
            );
        }
        let expected = self.extension();
        match out.extension() {
            Some(found) if !self.all_frames && !found.eq_ignore_ascii_case(expected) => {
                bail!("--out {}; expected a file whose name ends in .{expected}", out.display())
            }
            _ if self.all_frames => Ok(()),
            _ => Ok(atomic::check(out)?),
        }
    }

    fn extension(&self) -> &'static str {
        if self.to == Kind::PosedPly { "ply" } else { "glb" }
    }

    fn write_frames(&self, out: &Path, avatar: &Avatar, track: &Track<'_>, context: Context) -> Result<()> {
        super::products::make_folder(out)?;
        let extension = self.extension();
        let mut written = |gaussians: &Gaussians, frame: usize| {
            self.write_posed(&out.join(format!("frame_{frame:04}.{extension}")), gaussians)
        };
        posed(avatar, track.rest, &track.poses, &self.posing.strategy(), context, &mut written)
    }

    fn write_posed(&self, path: &Path, gaussians: &Gaussians) -> Result<()> {
        let gaussians = of_degree(gaussians, self.degree);
        if self.to == Kind::Glb {
            return Ok(write_splats(path, &gaussians)?);
        }
        let comments = vec![format!("posed by {}", self.posing.strategy())];
        let metadata = ply::Metadata { body: None, comments };
        let avatar = Avatar { gaussians, binding: Binding::Static };
        Ok(ply::write_avatar(path, &avatar, &metadata, ply::Encoding::LittleEndian)?)
    }

    fn write_skinned(&self, out: &Path, avatar: &Avatar, track: &Track<'_>, context: Context) -> Result<()> {
        let (avatar, note) = by_weights(avatar, track.rest)?;
        note.iter().for_each(|note| context.note(note));
        let gaussians = of_degree(&avatar.gaussians, self.degree);
        let avatar = Avatar { gaussians, ..avatar };
        let poses: Vec<Pose> = track.poses.iter().map(|&pose| pose.clone()).collect();
        let motion = Motion { name: "motion", poses: &poses, framerate: track.framerate };
        let motion = self.posing.has_poses().then_some(motion);
        Ok(write_skinned_splats(out, &avatar, track.rest, motion)?)
    }
}

/// Poses an avatar, bakes it and hands on the Gaussians with the number of the pose.
fn posed(
    avatar: &Avatar,
    rest: &RestBody,
    poses: &[&Pose],
    strategy: &Strategy,
    context: Context,
    written: &mut dyn FnMut(&Gaussians, usize) -> Result<()>,
) -> Result<()> {
    let bound = BoundAvatar::new(avatar, rest)?;
    let mut poser = Poser::new();
    let mut loss = None;
    for (frame, pose) in poses.iter().enumerate() {
        let body = PosedBody::new(rest, pose)?;
        let baked = bake(&poser.pose(&bound, &body, strategy, &PoseOptions::default())?, &avatar.gaussians);
        written(&baked.gaussians, frame)?;
        loss = loss.or(baked.loss);
    }
    loss.iter().for_each(|loss| context.note(loss));
    Ok(())
}

/// The Gaussians with SH of another degree: cut, or padded with zeros.
fn of_degree(gaussians: &Gaussians, degree: Option<u8>) -> Gaussians {
    let degree = degree.map_or(gaussians.sh_degree, usize::from);
    let (count, own) = (sh::count(degree), gaussians.sh_count());
    let padded = |coefficients: &[[f32; 3]]| {
        let mut row = coefficients.to_vec();
        row.resize(count, [0.0; 3]);
        row
    };
    let sh = gaussians.sh.chunks_exact(own).flat_map(padded).collect();
    Gaussians { sh_degree: degree, sh, ..gaussians.clone() }
}

/// The avatar with skinning weights of each Gaussian's own, and what is lost by that. Gaussians on faces take the mix of the
/// weights of the corners and the place where the rest body has them.
pub(super) fn by_weights(avatar: &Avatar, rest: &RestBody) -> Result<(Avatar, Option<&'static str>)> {
    let Binding::Face(binding) = &avatar.binding else { return Ok((avatar.clone(), None)) };
    let row = |i: usize| {
        let clamped = binding.barycentric[i].map(|b| f64::from(b.max(0.0)));
        let sum: f64 = clamped.iter().sum();
        rest.weights_at(binding.faces[i], clamped.map(|b| b / sum))
    };
    let weights = SkinWeights::from_rows((0..binding.faces.len()).map(row), rest.skeleton.num_joints())?;
    let mut gaussians = avatar.gaussians.clone();
    let bound = BoundAvatar::new(avatar, rest)?;
    let body = PosedBody::new(rest, &Pose::rest(&rest.skeleton))?;
    let strategy = Strategy::preset("quaternion-average").context("no such preset")?;
    gaussians.means = Poser::new().pose(&bound, &body, &strategy, &PoseOptions::default())?.means.to_vec();
    let note = match rest.pose_directions.is_empty() {
        true => "Gaussians on faces: a skin moves them by weights, not with their face",
        false => {
            "Gaussians on faces: a skin moves them by weights, not with their face, and without the blend shapes that poses drive"
        }
    };
    Ok((Avatar { gaussians, binding: Binding::Vertex(weights) }, Some(note)))
}
