//! What a frame is drawn from: Gaussians bound to a body, a textured mesh, or both.

use super::foreign::{self, OnBody};
use super::{Error, renders};
use crate::experiment::RenderedFrames;
use skinsplat_core::scene::{Avatar, Camera, Image, Mask, Pose, PosedBody, Rendered, RestBody, SceneError};
use skinsplat_data::Truth;
use skinsplat_data::avatar::read_avatar;
use skinsplat_fit::options::PoseFit;
use skinsplat_fit::pose_fit::{FittedPose, Posable, Target, fit_pose};
use skinsplat_fit::texture::{SAMPLES, TexturedBody};
use skinsplat_posing::{BoundAvatar, PoseOptions, Poser, Strategy, rotation_jumps};
use skinsplat_render::View;
use skinsplat_render::mesh::{Drawing, SamplePattern};
use skinsplat_render::splat::Renderer;
use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// What a frame is drawn from.
#[derive(Debug)]
pub enum Drawable<'m> {
    /// Gaussians, bound to the subject's body.
    Gaussians(Box<Bound>),
    /// The body's mesh under a texture.
    Textured(Cow<'m, TexturedBody>),
    /// Both, drawn together.
    Hybrid(Box<Bound>, Cow<'m, TexturedBody>),
    /// Nothing: what was drawn by another program.
    Renders(Box<RenderedFrames>),
}

/// Gaussians on a body.
#[derive(Debug)]
pub struct Bound {
    avatar: BoundAvatar,
    /// The body that they hang on, if that is not the one in view but takes its poses.
    body: Option<Arc<RestBody>>,
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
    /// Name of the frame, if it is one of a sequence.
    pub name: &'a str,
    /// Width and height of the frame as it is stored; those of the camera if it is smaller.
    pub stored: [u32; 2],
}

/// How a drawable is drawn, wherever it stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look<'a> {
    /// How its Gaussians are posed; a textured mesh needs none.
    pub strategy: Option<Strategy>,
    /// What is behind it.
    pub background: Behind<'a>,
    /// Whether the antialiased rasterizer renders.
    pub antialiased: bool,
}

/// What is behind a drawable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Behind<'a> {
    /// One colour, sRGB values.
    Colour([f32; 3]),
    /// What the camera saw without the subject.
    Picture(&'a Image),
}

impl Behind<'_> {
    /// The colour to draw over; black under a picture, which is added afterwards.
    fn colour(self) -> [f32; 3] {
        let colour = match self {
            Self::Colour(colour) => colour,
            Self::Picture(_) => [0.0; 3],
        };
        #[cfg(feature = "faults")]
        let colour = super::faults::of_background(colour);
        colour
    }

    /// Straight colours with alpha over what is behind.
    ///
    /// # Errors
    /// Sizes that differ.
    pub(super) fn around(self, rgb: &Image, alpha: &Mask) -> Result<Image, SceneError> {
        let mut image = rgb.composited(alpha, self.colour())?;
        self.add(&mut image, alpha);
        Ok(image)
    }

    /// What was drawn over [`Behind::colour`], over what is behind.
    fn under(self, Rendered { image, alpha, .. }: &Rendered) -> Image {
        let mut image = image.clone();
        self.add(&mut image, alpha);
        image
    }

    /// Adds what shows of a picture.
    fn add(self, image: &mut Image, alpha: &Mask) {
        if let Self::Picture(picture) = self {
            image.add_behind(alpha, picture);
        }
    }
}

impl Look<'_> {
    /// What the rasterizer is asked for through a camera.
    pub fn at<'c>(&self, camera: &'c Camera) -> View<'c> {
        View::new(camera).over(self.background.colour()).antialiased(self.antialiased)
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
        let has_shape = loaded.betas.is_some();
        let OnBody { avatar, body: own, mesh, mut notes } = foreign::on_body(loaded, body)?;
        if has_shape {
            notes.push("the shape (betas) in its file is left: the body is the subject's".to_owned());
        }
        let own = own.map(Arc::new);
        let mut bound = Bound::new(&avatar, own.as_deref().unwrap_or(body))?;
        bound.body = own;
        Ok((Self::of(bound, mesh.map(Cow::Owned)), notes))
    }
}

impl Bound {
    fn new(avatar: &Avatar, body: &RestBody) -> Result<Self, Error> {
        #[cfg(feature = "faults")]
        let avatar = &*super::faults::of_avatar(avatar);
        Ok(Self { avatar: BoundAvatar::new(avatar, body)?.without_zero_bands(), body: None })
    }
}

impl<'m> Drawable<'m> {
    /// Gaussians, and the mesh that is drawn with them if there is one, on a body.
    ///
    /// # Errors
    /// An avatar that does not fit the body.
    pub fn new(avatar: &Avatar, mesh: Option<Cow<'m, TexturedBody>>, body: &RestBody) -> Result<Self, Error> {
        Ok(Self::of(Bound::new(avatar, body)?, mesh))
    }

    fn of(bound: Bound, mesh: Option<Cow<'m, TexturedBody>>) -> Self {
        match mesh {
            Some(mesh) => Self::Hybrid(Box::new(bound), mesh),
            None => Self::Gaussians(Box::new(bound)),
        }
    }

    /// For each joint whether the strategy reads its rotation; none if nothing is known of what is read.
    pub fn joints_read(&self, strategy: &Strategy) -> Option<Vec<bool>> {
        match self {
            Self::Gaussians(bound) | Self::Hybrid(bound, _) => Some(bound.avatar.joints_read(strategy)),
            Self::Textured(_) | Self::Renders(_) => None,
        }
    }

    /// Draws it.
    ///
    /// # Errors
    /// A pose of another body, a camera that breaks an invariant, Gaussians without a strategy.
    pub fn draw(&self, view: &PosedView<'_>, look: &Look<'_>, scratch: &mut Scratch) -> Result<Drawn, Error> {
        match self {
            Self::Gaussians(bound) => draw_gaussians(bound, None, view, look, scratch),
            Self::Hybrid(bound, mesh) => draw_gaussians(bound, Some(&**mesh), view, look, scratch),
            Self::Textured(mesh) => draw_mesh(mesh, view, look),
            Self::Renders(renders) => load_render(renders, view, look),
        }
    }
}

impl Drawable<'_> {
    /// Fits the pose of a view to its truth, everything else frozen. The background is the protocol's colour; a picture behind
    /// counts as black, on both sides.
    ///
    /// # Errors
    /// Frames of another program, which no pose moves. As [`fit_pose`].
    pub(super) fn fit_pose(
        &self,
        view: &PosedView<'_>,
        truth: &Truth,
        look: &Look<'_>,
        options: &PoseFit,
    ) -> Result<FittedPose, Error> {
        let (bound, mesh) = match self {
            Self::Gaussians(bound) => (Some(&**bound), None),
            Self::Hybrid(bound, mesh) => (Some(&**bound), Some(&**mesh)),
            Self::Textured(mesh) => (None, Some(&**mesh)),
            Self::Renders(_) => return Err(Error::NoPoseToFit),
        };
        let strategy = bound.map(|_| look.strategy.ok_or(Error::NoStrategy)).transpose()?;
        let body = bound.and_then(|bound| bound.body.as_deref()).unwrap_or(view.body.rest);
        let gaussians = bound.map(|bound| &bound.avatar).zip(strategy.as_ref());
        let posable = Posable { body, gaussians, mesh };
        let (background, antialiased) = (look.background.colour(), look.antialiased);
        let target = Target { truth, camera: view.camera, background, antialiased };
        Ok(fit_pose(&posable, &target, view.pose, options)?)
    }
}

impl Drawable<'_> {
    /// How many Gaussians' rotations jump from one view to another, beyond `margin` degrees ([`rotation_jumps`]).
    ///
    /// # Errors
    /// What has no rotations: frames of another program, a mesh, Gaussians that a strategy deforms. Poses of another body.
    pub(super) fn rotation_jumps(
        &self,
        before: &PosedView<'_>,
        after: &PosedView<'_>,
        strategy: Option<Strategy>,
        margin: f64,
    ) -> Result<u64, Error> {
        let (Bound { avatar, body: own }, strategy) = self.turned_by(strategy)?;
        let jumps = match own.as_deref() {
            None => rotation_jumps(avatar, &before.body, &after.body, &strategy, margin)?,
            Some(rest) => {
                let [before, after] = [PosedBody::new(rest, before.pose)?, PosedBody::new(rest, after.pose)?];
                rotation_jumps(avatar, &before, &after, &strategy, margin)?
            }
        };
        jumps.ok_or(Error::NoRotations { of: UNTURNED })
    }

    /// The Gaussians that a strategy turns.
    ///
    /// # Errors
    /// What has no rotations, as [`Drawable::rotation_jumps`] has it.
    pub(super) fn turned_by(&self, strategy: Option<Strategy>) -> Result<(&Bound, Strategy), Error> {
        let bound = match self {
            Self::Gaussians(bound) | Self::Hybrid(bound, _) => &**bound,
            Self::Textured(_) => return Err(Error::NoRotations { of: "a mesh has none" }),
            Self::Renders(_) => {
                return Err(Error::NoRotations {
                    of: "those of frames that another program rendered are not known",
                });
            }
        };
        let strategy = strategy.ok_or(Error::NoStrategy)?;
        match bound.avatar.is_turned_by(&strategy) {
            true => Ok((bound, strategy)),
            false => Err(Error::NoRotations { of: UNTURNED }),
        }
    }
}

/// Why Gaussians may have no rotations.
const UNTURNED: &str = "the strategy deforms Gaussians and turns none";

fn load_render(renders: &RenderedFrames, view: &PosedView<'_>, look: &Look<'_>) -> Result<Drawn, Error> {
    let image = renders::draw(renders, view.name, view.camera, view.stored, look.background)?;
    let (splats, visible_splats) = (renders.splats, None);
    Ok(Drawn { image, splats, visible_splats, pose_seconds: 0.0, render_seconds: 0.0 })
}

fn draw_mesh(mesh: &TexturedBody, view: &PosedView<'_>, look: &Look<'_>) -> Result<Drawn, Error> {
    let start = Instant::now();
    let behind = look.background;
    let drawn = mesh.draw(view.pose, view.camera, SamplePattern::new(SAMPLES), behind.colour())?;
    Ok(Drawn {
        image: behind.under(&drawn),
        splats: None,
        visible_splats: None,
        pose_seconds: 0.0,
        render_seconds: start.elapsed().as_secs_f64(),
    })
}

fn draw_gaussians(
    Bound { avatar, body: own }: &Bound,
    mesh: Option<&TexturedBody>,
    view: &PosedView<'_>,
    look: &Look<'_>,
    Scratch { renderer, poser }: &mut Scratch,
) -> Result<Drawn, Error> {
    let strategy = look.strategy.ok_or(Error::NoStrategy)?;
    let own = own.as_deref().map(|rest| {
        let read = avatar.joints_read(&strategy);
        PosedBody::with_rotations(rest, view.pose, |joint| read[joint])
    });
    let own = own.transpose()?;
    let start = Instant::now();
    let options = PoseOptions { seen_by: Some(view.camera), ..PoseOptions::default() };
    let posed = poser.pose(avatar, own.as_ref().unwrap_or(&view.body), &strategy, &options)?;
    let pose_seconds = start.elapsed().as_secs_f64();
    let camera = view.camera;
    #[cfg(feature = "faults")]
    let faulty = super::faults::of_drawing(posed, camera);
    #[cfg(feature = "faults")]
    let (posed, camera) =
        faulty.as_ref().map_or((posed, camera), |(posed, camera)| (posed.as_posed(), camera));
    let start = Instant::now();
    let drawing = mesh.map(|mesh| mesh.drawing(view.pose, view.camera, SamplePattern::new(SAMPLES)));
    let drawing = drawing.transpose()?;
    let underlay = drawing.as_ref().map(Drawing::underlay);
    let image = look.background.under(renderer.render(&posed, &look.at(camera).with_underlay(underlay))?);
    Ok(Drawn {
        image,
        splats: Some(posed.len() as u64),
        visible_splats: Some(renderer.visible() as u64),
        pose_seconds,
        render_seconds: start.elapsed().as_secs_f64(),
    })
}
