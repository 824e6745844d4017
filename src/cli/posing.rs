//! An avatar, a body, a frame of a pose track and a strategy: the arguments of `render` and `skin`.

use crate::run::drawable::{Drawable, Look, PosedView, Scratch};
use crate::run::foreign::on_body;
use crate::run::textured::TexturedFiles;
use anyhow::{Context as _, Result, bail};
use skinsplat_core::scene::{
    Avatar, Binding, Body, Camera, Image, OwnedPosed, Pose, Posed, PosedBody, RestBody,
};
use skinsplat_data::avatar::read_avatar;
use skinsplat_data::{body, poses};
use skinsplat_fit::texture::TexturedBody;
use skinsplat_posing::{BoundAvatar, JointLift, PoseOptions, Poser, Strategy};
use skinsplat_render::splat;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Which pose to take, and how to rotate the Gaussians.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Posing")]
pub(super) struct Posing {
    /// Body model: SMPL-style .npz, or skinned .glb or .gltf
    #[arg(long, value_name = "BODY")]
    body: Option<PathBuf>,
    /// Poses: .npz, transforms.json, or a .glb or .gltf with clips
    #[arg(long, value_name = "POSES", requires = "body")]
    poses: Option<PathBuf>,
    /// Clip of a glTF file with several
    #[arg(long, value_name = "NAME", requires = "poses")]
    clip: Option<String>,
    /// Pose of the track, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    frame: usize,
    /// Rotation strategy: a preset, or a preset with changed axes (see `reproduce list strategies`)
    #[arg(long, value_name = "S", default_value = "quaternion-average")]
    strategy: Strategy,
}

/// An avatar that is ready to be posed.
pub(super) struct Subject {
    avatar: Avatar,
    /// The mesh that is drawn with the Gaussians, of a hybrid.
    mesh: Option<TexturedBody>,
    rest: Option<(RestBody, Pose)>,
    /// The poses of the track before this one.
    before: Vec<Pose>,
    /// What has to be said of the avatar.
    notes: Vec<String>,
}

impl Posing {
    /// The strategy as it was asked for.
    pub(super) fn strategy(&self) -> Strategy {
        self.strategy
    }

    /// True if a body was named.
    pub(super) fn has_body(&self) -> bool {
        self.body.is_some()
    }

    /// Loads the avatar and, if a body was named, the body in its shape and the pose of the frame.
    pub(super) fn load(&self, avatar: &Path) -> Result<Subject> {
        let mut loaded = read_avatar(avatar)?;
        let Some(body_path) = &self.body else {
            loaded.avatar.binding = Binding::Static;
            let (avatar, notes) = (loaded.avatar, Vec::new());
            return Ok(Subject { avatar, mesh: None, rest: None, before: Vec::new(), notes });
        };
        if !loaded.is_bound() {
            let expected = "joint and weight properties, or face, barycentric and offset properties";
            bail!("{}: no binding; expected {expected}, to pose it with --body", avatar.display());
        }
        let model = body::load(body_path)?;
        let (rest, pose, before) = match &self.poses {
            None => {
                let rest = model.shaped(&[])?;
                let pose = Pose::rest(&rest.skeleton);
                (rest, pose, Vec::new())
            }
            Some(path) => self.poses_to_frame(path, &model)?,
        };
        let mesh = TexturedFiles::beside(&loaded.files[0]);
        let mesh = mesh.exist().then(|| mesh.read(&rest)).transpose()?;
        let (avatar, notes) = on_body(loaded, &rest)?;
        Ok(Subject { avatar, mesh, rest: Some((rest, pose)), before, notes })
    }

    /// The body in its shape, the pose of the frame and those before it.
    fn poses_to_frame(&self, path: &Path, model: &Body) -> Result<(RestBody, Pose, Vec<Pose>)> {
        let track = poses::load_clip(path, self.clip.as_deref())?;
        let rest = model.shaped(&track.betas).with_context(|| format!("{}", path.display()))?;
        let mut poses = track.poses(&rest.skeleton)?.to_vec();
        if self.frame >= poses.len() {
            bail!("{}: --frame {}; expected a frame below {}", path.display(), self.frame, poses.len());
        }
        poses.truncate(self.frame + 1);
        let pose = poses.remove(self.frame);
        Ok((rest, pose, poses))
    }
}

impl Subject {
    /// The canonical avatar.
    pub(super) fn avatar(&self) -> &Avatar {
        &self.avatar
    }

    /// What has to be said of the avatar, a clause each.
    pub(super) fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Draws the avatar in its pose, with its mesh if it has one; without a body as it stands.
    pub(super) fn image(&self, camera: &Camera, look: &Look) -> Result<Image> {
        let Some((rest, pose)) = &self.rest else {
            let posed = OwnedPosed::from_static(&self.avatar.gaussians);
            return Ok(splat::render(&posed.as_posed(), &look.at(camera))?.image);
        };
        let drawable = Drawable::new(&self.avatar, self.mesh.as_ref().map(Cow::Borrowed), rest)?;
        let view = PosedView { pose, camera, body: PosedBody::new(rest, pose)? };
        Ok(drawable.draw(&view, look, &mut Scratch::default())?.image)
    }

    /// Poses the avatar and hands the Gaussians to `use_posed`; without a body they stay as they are.
    pub(super) fn posed<T>(
        &self,
        strategy: &Strategy,
        use_posed: impl FnOnce(&Posed<'_>) -> Result<T>,
    ) -> Result<T> {
        let Some((rest, pose)) = &self.rest else {
            return use_posed(&OwnedPosed::from_static(&self.avatar.gaussians).as_posed());
        };
        let bound = BoundAvatar::new(&self.avatar, rest)?;
        let body = PosedBody::new(rest, pose)?;
        use_posed(&Poser::new().pose(&bound, &body, strategy, &PoseOptions::default())?)
    }

    /// [`Subject::posed`] with the signs of joint quaternions followed through the track, from its first pose to this one.
    pub(super) fn posed_following<T>(
        &self,
        strategy: &Strategy,
        use_posed: impl FnOnce(&Posed<'_>) -> Result<T>,
    ) -> Result<T> {
        let Some((rest, pose)) = &self.rest else {
            return use_posed(&OwnedPosed::from_static(&self.avatar.gaussians).as_posed());
        };
        let mut lift: Option<JointLift> = None;
        for earlier in &self.before {
            lift = Some(JointLift::next(lift.as_ref(), &PosedBody::new(rest, earlier)?));
        }
        let body = PosedBody::new(rest, pose)?;
        let lift = JointLift::next(lift.as_ref(), &body);
        let bound = BoundAvatar::new(&self.avatar, rest)?;
        let options = PoseOptions { lift: Some(&lift), ..PoseOptions::default() };
        use_posed(&Poser::new().pose(&bound, &body, strategy, &options)?)
    }
}
