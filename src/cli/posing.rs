//! An avatar, a body, a frame of a pose track and a strategy: the arguments of `render` and `skin`.

use anyhow::{Context as _, Result, bail};
use skinsplat::run::drawable::{Drawable, Look, PosedView, Scratch};
use skinsplat::run::foreign::{OnBody, on_body};
use skinsplat_core::scene::{
    Avatar, Binding, Body, Camera, Image, OwnedPosed, Pose, Posed, PosedBody, RestBody,
};
use skinsplat_data::avatar::{Canonical, LoadedAvatar, read_avatar};
use skinsplat_data::{body, poses};
use skinsplat_fit::texture::TexturedBody;
use skinsplat_posing::{BoundAvatar, JointLift, PoseOptions, Poser, Strategy};
use skinsplat_render::splat;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Which pose to take, and how to rotate the Gaussians.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Posing")]
pub(super) struct Posing {
    /// Body model: SMPL-style .npz or .pkl, or skinned .glb or .gltf
    #[arg(long, value_name = "BODY")]
    body: Option<PathBuf>,
    /// Poses: .npz or .pkl (smplx, AMASS, AIST++), transforms.json, or a .glb or .gltf with clips
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
    /// Poses per second, if the track says so.
    framerate: Option<f64>,
    /// What has to be said of the files, each with its name.
    notes: Vec<String>,
}

/// A body and consecutive poses of it.
pub(super) struct Track<'a> {
    /// The body in its rest pose.
    pub(super) rest: &'a RestBody,
    /// From the first pose of the track to that of `--frame`.
    pub(super) poses: Vec<&'a Pose>,
    /// Poses per second; 30 if the file does not say.
    pub(super) framerate: f64,
}

impl Posing {
    /// The strategy as it was asked for.
    pub(super) fn strategy(&self) -> Strategy {
        self.strategy
    }

    /// The option that chooses a pose or a strategy, if one does: for commands that take all.
    pub(super) fn chosen(&self) -> Option<&'static str> {
        let strategy = Strategy::preset("quaternion-average").is_some_and(|default| default != self.strategy);
        if self.frame != 0 { Some("--frame") } else { strategy.then_some("--strategy") }
    }

    /// True if a body was named.
    pub(super) fn has_body(&self) -> bool {
        self.body.is_some()
    }

    /// True if a track of poses was named.
    pub(super) fn has_poses(&self) -> bool {
        self.poses.is_some()
    }

    /// The same with the last pose of the track, so that all of it is loaded.
    pub(super) fn at_last_frame(&self) -> Result<Self> {
        let Some(path) = &self.poses else { bail!("--poses is missing: no track") };
        let track = poses::load_clip(path, self.clip.as_deref())?;
        Ok(Self { frame: track.len().saturating_sub(1), ..self.clone() })
    }

    /// Loads the avatar and, if a body was named, the body in its shape and the pose of the frame.
    pub(super) fn load(&self, avatar: &Path) -> Result<Subject> {
        let loaded = read_avatar(avatar)?;
        let Some(body_path) = &self.body else { return as_it_stands(loaded) };
        let model = body::read(body_path)?;
        let mut remarks = said(body_path, model.notes);
        let betas = loaded.betas.clone();
        if betas.is_some() {
            let note = "the body has the shape (betas) that this file holds".to_owned();
            remarks.extend(said(avatar, vec![note]));
        }
        let Motion { rest, pose, before, framerate } = match &self.poses {
            None if self.frame != 0 => {
                bail!("--frame {} without --poses; expected a track of poses", self.frame)
            }
            None => {
                let (rest, notes) = body::shape(&model.body, betas.as_deref().unwrap_or(&[]), &[])?;
                remarks.extend(said(body_path, notes));
                remarks.push("no --poses: the body is at rest".to_owned());
                let pose = Pose::rest(&rest.skeleton);
                Motion { pose, rest, before: Vec::new(), framerate: None }
            }
            Some(path) => {
                let (motion, notes) = self.poses_to_frame(path, &model.body, betas.as_deref())?;
                remarks.extend(said(path, notes));
                motion
            }
        };
        let joints = PosedBody::new(&rest, &pose)?;
        remarks.extend(
            scale_note(&joints, self.strategy).map(|note| format!("{}: {note}", body_path.display())),
        );
        let OnBody { avatar: bound, body, mesh, notes } = on_body(loaded, &rest)?;
        let mut notes = said(avatar, notes);
        for remark in remarks {
            // A file that is body and poses says the same of both.
            if !notes.contains(&remark) {
                notes.push(remark);
            }
        }
        let rest = Some((body.unwrap_or(rest), pose));
        Ok(Subject { avatar: bound, mesh, rest, before, framerate, notes })
    }

    /// The body in its shape (that of the avatar, if it has one), the pose of the frame and those before it; and what has to
    /// be said of them.
    fn poses_to_frame(
        &self,
        path: &Path,
        model: &Body,
        betas: Option<&[f64]>,
    ) -> Result<(Motion, Vec<String>)> {
        let track = poses::load_clip(path, self.clip.as_deref())?;
        let shaped = body::shape(model, betas.unwrap_or(&track.betas), &track.expression);
        let (rest, mut notes) = shaped.with_context(|| format!("{}", path.display()))?;
        notes.extend(track.notes_for(&rest.skeleton));
        let mut poses = track.poses(&rest.skeleton)?.to_vec();
        if self.frame >= poses.len() {
            bail!("{}: --frame {}; expected a frame below {}", path.display(), self.frame, poses.len());
        }
        poses.truncate(self.frame + 1);
        let pose = poses.remove(self.frame);
        Ok((Motion { rest, pose, before: poses, framerate: track.framerate }, notes))
    }
}

/// An avatar without a body: its Gaussians where the file has them.
fn as_it_stands(loaded: LoadedAvatar) -> Result<Subject> {
    let LoadedAvatar { mut avatar, canonical, files, mut notes, texture, .. } = loaded;
    if canonical == Canonical::Faces {
        let expected = "--body: Gaussians are measured on the faces of a body";
        bail!("{}: no place without a body; expected {expected}", files[0].display());
    }
    if texture.is_some() {
        notes.push("its textured mesh is not drawn: that needs --body".to_owned());
    }
    avatar.binding = Binding::Static;
    let notes = said(&files[0], notes);
    Ok(Subject { avatar, mesh: None, rest: None, before: Vec::new(), framerate: None, notes })
}

/// Notes with the file that they are about.
fn said(path: &Path, notes: Vec<String>) -> Vec<String> {
    notes.into_iter().map(|note| format!("{}: {note}", path.display())).collect()
}

/// A body in its shape, a pose of it and those before.
struct Motion {
    rest: RestBody,
    pose: Pose,
    before: Vec<Pose>,
    framerate: Option<f64>,
}

/// What a strategy leaves out of joints that scale, if it does.
fn scale_note(body: &PosedBody<'_>, strategy: Strategy) -> Option<String> {
    let joint = strategy.ignored_scale(body)?;
    let name = &body.rest.skeleton.names[joint];
    Some(format!(
        "joint {name} scales by unequal factors, which the shape of Gaussians does not follow \
         (covariance=affine does)"
    ))
}

impl Subject {
    /// The canonical avatar.
    pub(super) fn avatar(&self) -> &Avatar {
        &self.avatar
    }

    /// The body and the poses up to that of the frame; `None` without a body.
    pub(super) fn track(&self) -> Option<Track<'_>> {
        let (rest, pose) = self.rest.as_ref()?;
        let poses = self.before.iter().chain([pose]).collect();
        Some(Track { rest, poses, framerate: self.framerate.unwrap_or(30.0) })
    }

    /// A mesh is drawn with the Gaussians.
    pub(super) fn has_mesh(&self) -> bool {
        self.mesh.is_some()
    }

    /// What has to be said of avatar, body and poses, a line each.
    pub(super) fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Draws the avatar in its pose, with its mesh if it has one; without a body as it stands.
    pub(super) fn image(&self, camera: &Camera, look: &Look<'_>) -> Result<Image> {
        let Some((rest, pose)) = &self.rest else {
            let posed = OwnedPosed::from_static(&self.avatar.gaussians);
            return Ok(splat::render(&posed.as_posed(), &look.at(camera))?.image);
        };
        let drawable = Drawable::new(&self.avatar, self.mesh.as_ref().map(Cow::Borrowed), rest)?;
        let view = PosedView {
            pose,
            camera,
            body: PosedBody::new(rest, pose)?,
            name: "",
            stored: [camera.width, camera.height],
        };
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
