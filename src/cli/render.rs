//! `reproduce render`: an avatar, posed or as it stands, through a camera.

use super::posing::Posing;
use super::{Context, Exit, selection::parse_colour};
use anyhow::{Result, bail};
use skinsplat::run::drawable::{Behind, Look};
use skinsplat_data::{camera, frames};
use std::path::PathBuf;

/// Render an avatar, posed or as it stands.
///
/// Semantics are those of the original 3DGS rasterizer. CAMERA.json holds width, height, fx, fy, cx, cy,
/// world_to_camera (4x4, rows, OpenCV axes) and, if you like, background; cameras.npz, cameras.json of 3DGS training and
/// transforms.json of nerfstudio are read as well.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Render {
    /// The avatar or scene, whoever made it
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Camera: .json or .npz
    #[arg(long, value_name = "CAMERA")]
    camera: PathBuf,
    /// Which camera of a file with several, counted from 0
    #[arg(long, value_name = "K", default_value_t = 0)]
    camera_index: usize,
    /// Image to write: .png (8 bit, RGB) or .npy (f32, height x width x 3, not clamped)
    #[arg(long, value_name = "IMAGE")]
    out: PathBuf,
    /// Background colour, sRGB values in [0, 1] [default: the camera file's, else black]
    #[arg(long, value_name = "R,G,B", value_parser = parse_colour)]
    background: Option<[f32; 3]>,
    /// Compensate the opacity of splats that the 0.3-pixel low-pass widens, as the later 3DGS kernels can
    #[arg(long)]
    antialiased: bool,
    #[command(flatten)]
    posing: Posing,
}

const EXAMPLES: &str = "\
Examples:
  reproduce render avatar.ply --camera camera.json --out picture.png
  reproduce render a.ply --camera c.npz --body body.npz --poses poses.npz --frame 12 --out p.png";

impl Render {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        let views = camera::load_views(&self.camera)?;
        let Some(view) = views.get(self.camera_index) else {
            let path = self.camera.display();
            bail!("{path}: --camera-index {}; expected an index below {}", self.camera_index, views.len());
        };
        let extension = self.out.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        if !["png", "npy"].contains(&extension.as_str()) {
            bail!("{}: --out; expected a name that ends in .png or .npy", self.out.display());
        }
        let background = Behind::Colour(self.background.or(view.background).unwrap_or([0.0; 3]));
        let look = Look { strategy: Some(self.posing.strategy()), background, antialiased: self.antialiased };
        let subject = self.posing.load(&self.file)?;
        let image = subject.image(&view.camera, &look)?;
        match extension.as_str() {
            "png" => frames::save_png(&self.out, &image)?,
            _ => frames::save_npy(&self.out, &image)?,
        }
        view.note.iter().for_each(|note| context.note(format!("{}: {note}", self.camera.display())));
        subject.notes().iter().for_each(|note| context.note(note));
        let (n, out) = (subject.avatar().gaussians.len(), self.out.display());
        context.note(format!("{out}: {n} Gaussians, {}x{}", view.camera.width, view.camera.height));
        Ok(Exit::Success)
    }
}
