//! An avatar, a body, a frame of a pose track and a strategy: the arguments of `render` and `skin`.

use anyhow::{Context as _, Result, bail};
use skinsplat_core::scene::{Avatar, Binding, Body, Camera, OwnedPosed, Pose, Posed, PosedBody, RestBody};
use skinsplat_data::{body, ply, poses};
use skinsplat_posing::{BoundAvatar, JointLift, PoseOptions, Poser, Strategy};
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
    rest: Option<(RestBody, Pose)>,
    /// The poses of the track before this one.
    before: Vec<Pose>,
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
        let mut loaded = ply::read_avatar(avatar)?;
        let Some(body_path) = &self.body else {
            if !matches!(loaded.binding, Binding::Static) {
                loaded.binding = Binding::Static;
            }
            return Ok(Subject { avatar: loaded, rest: None, before: Vec::new() });
        };
        if matches!(loaded.binding, Binding::Static) {
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
        loaded.validate(Some(&rest)).with_context(|| {
            format!("{}: does not fit the body {}", avatar.display(), body_path.display())
        })?;
        Ok(Subject { avatar: loaded, rest: Some((rest, pose)), before })
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

    /// Poses the avatar and hands the Gaussians to `use_posed`; without a body they stay as they are. Where one camera looks
    /// at them, what it does not need is left out.
    pub(super) fn posed<T>(
        &self,
        strategy: &Strategy,
        camera: Option<&Camera>,
        use_posed: impl FnOnce(&Posed<'_>) -> Result<T>,
    ) -> Result<T> {
        let Some((rest, pose)) = &self.rest else {
            return use_posed(&OwnedPosed::from_static(&self.avatar.gaussians).as_posed());
        };
        let mut bound = BoundAvatar::new(&self.avatar, rest)?;
        if camera.is_some() {
            bound = bound.without_zero_bands();
        }
        let body = PosedBody::new(rest, pose)?;
        let options = PoseOptions { seen_by: camera, ..PoseOptions::default() };
        use_posed(&Poser::new().pose(&bound, &body, strategy, &options)?)
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
