//! What a frame is drawn from: Gaussians bound to a body, a textured mesh, or both.

use super::Error;
use super::foreign;
use super::textured::TexturedFiles;
use skinsplat_core::scene::{Avatar, Camera, Image, Pose, PosedBody, RestBody};
use skinsplat_data::avatar::read_avatar;
use skinsplat_fit::texture::{SAMPLES, TexturedBody};
use skinsplat_posing::{BoundAvatar, PoseOptions, Poser, Strategy};
use skinsplat_render::View;
use skinsplat_render::mesh::{Drawing, SamplePattern};
use skinsplat_render::splat::Renderer;
use std::borrow::Cow;
use std::path::Path;
use std::time::Instant;

/// What a frame is drawn from.
#[derive(Debug)]
pub enum Drawable<'m> {
    /// Gaussians, bound to the subject's body.
    Gaussians(Box<BoundAvatar>),
    /// The body's mesh under a texture.
    Textured(Cow<'m, TexturedBody>),
    /// Both, drawn together.
    Hybrid(Box<BoundAvatar>, Cow<'m, TexturedBody>),
}

/// A body in a pose, seen by a camera.
#[derive(Debug)]
pub struct PosedView<'a> {
    /// The pose.
    pub pose: &'a Pose,
    /// The camera.
    pub camera: &'a Camera,
    /// The body in the pose.
    pub body: PosedBody<'a>,
}

/// How a drawable is drawn, wherever it stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// How its Gaussians are posed; a textured mesh needs none.
    pub strategy: Option<Strategy>,
    /// What is behind it, sRGB values.
    pub background: [f32; 3],
    /// Whether the antialiased rasterizer renders.
    pub antialiased: bool,
}

impl Look {
    /// What the rasterizer is asked for through a camera.
    pub fn at<'c>(&self, camera: &'c Camera) -> View<'c> {
        View::new(camera).over(self.background).antialiased(self.antialiased)
    }
}

/// Memory that drawing keeps from frame to frame.
#[derive(Default)]
pub struct Scratch {
    renderer: Renderer,
    poser: Poser,
}

/// What was drawn.
#[derive(Debug)]
pub struct Drawn {
    /// The picture.
    pub image: Image,
    /// Gaussians of the avatar; none for a textured mesh.
    pub splats: Option<u64>,
    /// Those that reach the image.
    pub visible_splats: Option<u64>,
    /// Seconds spent on posing Gaussians.
    pub pose_seconds: f64,
    /// Seconds spent on rendering.
    pub render_seconds: f64,
}

impl Drawable<'static> {
    /// Reads an avatar, whoever made it, and binds it to a body. The mesh of a hybrid is read beside its Gaussians. Says
    /// what a reader of its numbers has to know.
    ///
    /// # Errors
    /// A file that cannot be read or does not fit the body; the message names file, field and expectation.
    pub fn read(path: &Path, body: &RestBody) -> Result<(Self, Vec<String>), Error> {
        let loaded = read_avatar(path)?;
        let files = TexturedFiles::beside(&loaded.files[0]);
        let mesh = files.exist().then(|| files.read(body)).transpose()?;
        let (avatar, notes) = foreign::on_body(loaded, body)?;
        Ok((Self::new(&avatar, mesh.map(Cow::Owned), body)?, notes))
    }
}

impl<'m> Drawable<'m> {
    /// Gaussians, and the mesh that is drawn with them if there is one, on a body.
    ///
    /// # Errors
    /// An avatar that does not fit the body.
    pub fn new(avatar: &Avatar, mesh: Option<Cow<'m, TexturedBody>>, body: &RestBody) -> Result<Self, Error> {
        let bound = Box::new(BoundAvatar::new(avatar, body)?.without_zero_bands());
        Ok(match mesh {
            Some(mesh) => Self::Hybrid(bound, mesh),
            None => Self::Gaussians(bound),
        })
    }

    /// For each joint whether the strategy reads its rotation; none if nothing is known of what is read.
    pub fn joints_read(&self, strategy: &Strategy) -> Option<Vec<bool>> {
        match self {
            Self::Gaussians(bound) | Self::Hybrid(bound, _) => Some(bound.joints_read(strategy)),
            Self::Textured(_) => None,
        }
    }

    /// Draws it.
    ///
    /// # Errors
    /// A pose of another body, a camera that breaks an invariant, Gaussians without a strategy.
    pub fn draw(&self, view: &PosedView<'_>, look: &Look, scratch: &mut Scratch) -> Result<Drawn, Error> {
        match self {
            Self::Gaussians(bound) => draw_gaussians(bound, None, view, look, scratch),
            Self::Hybrid(bound, mesh) => draw_gaussians(bound, Some(&**mesh), view, look, scratch),
            Self::Textured(mesh) => draw_mesh(mesh, view, look),
        }
    }
}

fn draw_mesh(mesh: &TexturedBody, view: &PosedView<'_>, look: &Look) -> Result<Drawn, Error> {
    let start = Instant::now();
    let image = mesh.draw(view.pose, view.camera, SamplePattern::new(SAMPLES), look.background)?.image;
    Ok(Drawn {
        image,
        splats: None,
        visible_splats: None,
        pose_seconds: 0.0,
        render_seconds: start.elapsed().as_secs_f64(),
    })
}

fn draw_gaussians(
    bound: &BoundAvatar,
    mesh: Option<&TexturedBody>,
    view: &PosedView<'_>,
    look: &Look,
    Scratch { renderer, poser }: &mut Scratch,
) -> Result<Drawn, Error> {
    let strategy = look.strategy.ok_or(Error::NoStrategy)?;
    let start = Instant::now();
    let options = PoseOptions { seen_by: Some(view.camera), ..PoseOptions::default() };
    let posed = poser.pose(bound, &view.body, &strategy, &options)?;
    let pose_seconds = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let drawing = mesh.map(|mesh| mesh.drawing(view.pose, view.camera, SamplePattern::new(SAMPLES)));
    let drawing = drawing.transpose()?;
    let underlay = drawing.as_ref().map(Drawing::underlay);
    let image = renderer.render(&posed, &look.at(view.camera).with_underlay(underlay))?.image.clone();
    Ok(Drawn {
        image,
        splats: Some(posed.len() as u64),
        visible_splats: Some(renderer.visible() as u64),
        pose_seconds,
        render_seconds: start.elapsed().as_secs_f64(),
    })
}
