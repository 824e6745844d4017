//! Avatars that jobs need: read from files, or made from training frames once, kept in the run's folder and read back bit for
//! bit.

use super::cache::{self, Entry};
use super::curve_frames::CurveFrames;
use super::drawable::Drawable;
use super::fitting::{self, FitEvent, FitFiles, Tests};
use super::textured::TexturedFiles;
use super::{Error, Event, Library};
use crate::experiment::{AvatarSource, Plan, PlannedAvatar, PlannedFit, TrainingFrames};
use skinsplat_data::{FrameRef, Sequence, ply};
use skinsplat_fit::recipe::Poses;
use skinsplat_fit::surface::{SurfaceInit, surface_init};
use skinsplat_fit::texture::{TextureInit, gather_texture};
use std::borrow::Cow;
use std::path::Path;

/// Makes the avatars of a plan.
pub(super) struct Workshop<'a> {
    library: &'a Library,
    curves: CurveFrames<'a>,
    training: TrainingHeld,
    /// The run's folder of avatars.
    folder: &'a Path,
    watch: &'a (dyn Fn(Event) + Sync),
}

/// The training frames of the avatar made last, decoded or drawn once for all avatars that are made from them: starts look at each
/// again and again.
#[derive(Default)]
struct TrainingHeld(Option<(PlannedFrames, Sequence)>);

/// Data set, subject and frames.
type PlannedFrames = (String, String, TrainingFrames);

impl TrainingHeld {
    /// Frames are held if they take no more than this, bytes; larger sequences belong to fits that take long beside that.
    const MOST_BYTES: usize = 128 << 20;

    /// The sequence with its images in memory, if they are few and small enough.
    fn of(&mut self, avatar: &PlannedAvatar, training: &Sequence) -> Result<Sequence, Error> {
        let pixels = |frame: &FrameRef| {
            let camera = &training.cameras[frame.camera];
            camera.width as usize * camera.height as usize
        };
        let bytes = training.frames.iter().map(pixels).sum::<usize>() * size_of::<[f32; 4]>();
        let Some(frames) = avatar.training().filter(|_| bytes <= Self::MOST_BYTES) else {
            return Ok(training.clone());
        };
        let key = (avatar.dataset.clone(), avatar.subject.clone(), frames.clone());
        match &self.0 {
            Some((known, held)) if *known == key => Ok(held.clone()),
            _ => Ok(self.0.insert((key, training.held()?)).1.clone()),
        }
    }
}

/// Points of the curve of test scores, after the start.
const CURVE_POINTS: u32 = 5;

impl<'a> Workshop<'a> {
    /// Nothing made yet.
    pub(super) fn new(
        plan: &'a Plan,
        library: &'a Library,
        folder: &'a Path,
        watch: &'a (dyn Fn(Event) + Sync),
    ) -> Self {
        Self { library, curves: CurveFrames::new(plan), training: TrainingHeld::default(), folder, watch }
    }

    /// Reads an avatar, from its own file or from the run's folder, where it is made if it is not there. Whether it was
    /// there makes no difference to a single bit: a fresh avatar is read back too.
    ///
    /// # Errors
    /// A file that cannot be read or does not fit the body, training frames that cannot be used, a folder that cannot be
    /// written.
    pub(super) fn prepare(&mut self, avatar: &PlannedAvatar) -> Result<Drawable<'static>, Error> {
        match &avatar.source {
            AvatarSource::File { path, sequence, .. } => {
                let body = &self.library.sequence(&avatar.dataset, &avatar.subject, sequence)?.body;
                Ok(Drawable::read(path, body)?.0)
            }
            AvatarSource::Missing { problem } => Err(Error::Avatar { problem: problem.clone() }),
            AvatarSource::Renders(renders) => Ok(Drawable::Renders(Box::new(renders.clone()))),
            AvatarSource::Surface { training, placement, bind_to, sh_degree, edge_mm } => {
                let init = SurfaceInit {
                    placement: *placement,
                    bind_to: *bind_to,
                    sh_degree: usize::from(*sh_degree),
                    longest_edge: f64::from(*edge_mm) / 1000.0,
                    ..SurfaceInit::default()
                };
                self.surface(avatar, &self.training(avatar, training)?, &init)
            }
            AvatarSource::Textured { training, size } => {
                self.textured(avatar, &self.training(avatar, training)?, *size)
            }
            AvatarSource::Fit { training, fit } => {
                let training = self.training(avatar, training)?;
                self.fit(avatar, fit, &training)
            }
        }
    }

    fn surface(
        &mut self,
        avatar: &PlannedAvatar,
        training: &Sequence,
        init: &SurfaceInit,
    ) -> Result<Drawable<'static>, Error> {
        let entry = Entry::new(self.folder, &avatar.key, &["ply"]);
        let file = entry.path("ply");
        entry.ensure(
            |damage| warn(self.watch, damage),
            || {
                let made = surface_init(&self.training.of(avatar, training)?, init)?;
                let metadata = ply::Metadata::default();
                Ok(ply::write_avatar(&file, &made, &metadata, ply::Encoding::LittleEndian)?)
            },
        )?;
        Ok(Drawable::read(&file, &training.body)?.0)
    }

    /// A textured body: its texture, its dressed vertices beside it.
    fn textured(
        &mut self,
        avatar: &PlannedAvatar,
        training: &Sequence,
        size: u32,
    ) -> Result<Drawable<'static>, Error> {
        let entry = Entry::new(self.folder, &avatar.key, &["npy", "vertices.npy"]);
        let files = TexturedFiles { texture: entry.path("npy"), vertices: entry.path("vertices.npy") };
        let init = TextureInit { size, ..TextureInit::default() };
        let make = || files.write(&gather_texture(&self.training.of(avatar, training)?, &init)?);
        entry.ensure(|damage| warn(self.watch, damage), make)?;
        Ok(Drawable::Textured(Cow::Owned(files.read(&training.body)?)))
    }

    fn fit(
        &mut self,
        avatar: &PlannedAvatar,
        planned: &PlannedFit,
        training: &Sequence,
    ) -> Result<Drawable<'static>, Error> {
        let mut parts = vec!["ply", "json"];
        if planned.options.recipe.mesh.is_some() {
            parts.extend(["texture.png", "vertices.npy"]);
        }
        if planned.options.recipe.poses == Poses::Refine {
            parts.push("poses.json");
        }
        let entry = Entry::new(self.folder, &avatar.key, &parts);
        let start = Entry::new(self.folder, &planned.start, &["ply"]);
        let files = FitFiles { avatar: entry.path("ply"), start: Some(start) };
        let watch = self.watch;
        entry.ensure(
            |damage| warn(watch, damage),
            || {
                let tests = self.curves.of(avatar, self.library)?;
                let noise = avatar.training().and_then(|training| training.noise);
                let noisy = |test: &Sequence| {
                    noise
                        .map_or_else(|| test.clone(), |noise| test.with_pose_noise(noise.degrees, noise.seed))
                };
                let tests: Vec<Sequence> = tests.iter().map(noisy).collect();
                let name = format!("{}/{}/{}", avatar.dataset, avatar.subject, training.id);
                let training = &self.training.of(avatar, training)?;
                let fit = || fit_into(&files, planned, training, &name, &tests, watch);
                // The name of a checkpoint here is that of its fit: one that does not belong to it is damaged or of another
                // version of the program.
                match fit() {
                    Err(Error::Checkpoint { path, problem }) => {
                        warn(watch, format!("{}: {problem}; fitted from the start", path.display()))?;
                        cache::remove(&path)?;
                        fit()
                    }
                    fitted => fitted,
                }
            },
        )?;
        Ok(Drawable::read(&files.avatar, &training.body)?.0)
    }

    /// The frames that an avatar is made from.
    fn training(&self, avatar: &PlannedAvatar, training: &TrainingFrames) -> Result<Sequence, Error> {
        let TrainingFrames { sequence, frames, resolution, further, noise } = training;
        let take = |id: &str, frames: &[usize]| -> Result<Sequence, Error> {
            let whole = self.library.sequence(&avatar.dataset, &avatar.subject, id)?;
            let selected = whole.selected(frames)?;
            Ok(noise.map_or_else(
                || selected.clone(),
                |noise| selected.with_pose_noise(noise.degrees, noise.seed),
            ))
        };
        let first = std::iter::once(take(sequence, frames));
        let takes = first
            .chain(further.iter().map(|(id, frames)| take(id, frames)))
            .collect::<Result<Vec<_>, _>>()?;
        let selected = Sequence::joined(&takes)?;
        Ok(match resolution {
            Some(side) => selected.reduced(*side),
            None => selected,
        })
    }
}

/// Fits an avatar into its files, with a curve of scores on some test frames.
fn fit_into(
    files: &FitFiles,
    planned: &PlannedFit,
    training: &Sequence,
    name: &str,
    tests: &[Sequence],
    watch: &(dyn Fn(Event) + Sync),
) -> Result<(), Error> {
    let every = Some(planned.options.iterations.div_ceil(CURVE_POINTS));
    let tests = Tests { sequences: tests, every, ssim: false };
    fitting::fit(training, &planned.options, name, files, tests, &mut |event| match event {
        FitEvent::Starting => Ok(()),
        FitEvent::Took(part, seconds) => {
            watch(Event::Took(part, seconds));
            Ok(())
        }
        FitEvent::Step(step) => {
            watch(Event::Fitting(step));
            Ok(())
        }
        FitEvent::Warning(text) | FitEvent::Damage(text) => warn(watch, text.to_owned()),
    })?;
    Ok(())
}

fn warn(watch: &(dyn Fn(Event) + Sync), text: String) -> Result<(), Error> {
    watch(Event::Warning(text));
    Ok(())
}
