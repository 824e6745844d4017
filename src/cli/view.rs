//! `reproduce view`: an avatar in motion as one HTML page.

use super::export::by_weights;
use super::posing::Posing;
use super::{Context, Exit};
use anyhow::{Context as _, Result, bail};
use skinsplat_core::scene::Pose;
use skinsplat_data::atomic;
use skinsplat_view::{Motion, Page, Up};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Write an avatar in motion as one HTML page: rotations switched live, side by side, marked by their distance from the average.
///
/// The page needs no other file and no network, and any browser with WebGL 2 shows it. It skins with the shader of
/// `crates/shader`. SH are stored in 16 bits.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct View {
    /// The canonical avatar, whoever made it
    #[arg(value_name = "AVATAR")]
    avatar: PathBuf,
    /// The page to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// What the page is called [default: the name of the avatar's file]
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,
    /// The axis of the world that points up
    #[arg(long, value_enum, value_name = "AXIS", default_value = "y")]
    up: Axis,
    /// Every Nth pose of the track alone
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
    #[command(flatten)]
    posing: Posing,
}

/// An axis that points up.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Axis {
    /// SMPL, glTF
    Y,
    /// Images, OpenCV
    MinusY,
    /// Blender
    Z,
}

const EXAMPLES: &str = "\
Examples:
  reproduce view A.ply --body B.npz --poses P.npz --out view.html
  reproduce view A.ply --body B.glb --poses B.glb --every 2 --up z --out view.html";

impl View {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        if !self.posing.has_body() {
            bail!("--body is missing: an avatar is posed by a body");
        }
        if let Some(option) = self.posing.chosen() {
            bail!("{option}: not read; the page holds every pose and switches rotations itself");
        }
        let posing = if self.posing.has_poses() { self.posing.at_last_frame()? } else { self.posing.clone() };
        let subject = posing.load(&self.avatar)?;
        subject.notes().iter().for_each(|note| context.note(note));
        let Some(track) = subject.track() else { bail!("--body is missing: an avatar is posed by a body") };
        if subject.has_mesh() {
            context.note("the mesh of this avatar is left out: the page shows Gaussians alone");
        }
        let (avatar, note) = by_weights(subject.avatar(), track.rest)?;
        note.iter().for_each(|note| context.note(note));
        let poses: Vec<&Pose> = track.poses.iter().copied().step_by(self.every as usize).collect();
        let framerate = track.framerate / f64::from(self.every);
        let motion = Motion { rest: track.rest, poses: &poses, framerate };
        let mut page = Page::new(self.title(), &avatar, motion)
            .with_context(|| self.avatar.display().to_string())?
            .up(match self.up {
                Axis::Y => Up::Y,
                Axis::MinusY => Up::MinusY,
                Axis::Z => Up::Z,
            });
        if let Some(note) = note {
            page = page.note(note);
        }
        let html = page.html();
        atomic::write(&self.out, |file| file.write_all(html.as_bytes()))?;
        context.note(format!("{}: {:.1} MB", self.out.display(), html.len() as f64 / 1e6));
        Ok(Exit::Success)
    }

    fn title(&self) -> String {
        let name = || {
            let stem = Path::new(&self.avatar).file_stem().unwrap_or_default();
            stem.to_string_lossy().into_owned()
        };
        self.title.clone().unwrap_or_else(name)
    }
}
