//! The avatars of a plan: where each comes from, with exactly what that needs.

use super::{
    AvatarFile, AvatarRecipe, AvatarState, CodeVersions, DataRow, PoseNoise, Profile, RenderedFrames, Role,
    SubjectInfo, Variant,
};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use skinsplat_data::key::content_key;
use skinsplat_data::select::evenly_spaced;
use skinsplat_fit::recipe::{BindTo, Placement};
use skinsplat_fit::surface::SurfaceInit;
use skinsplat_fit::texture::TextureInit;
use skinsplat_fit::train::Starting;
use skinsplat_fit::{FitOptions, Recipe};
use std::path::{Path, PathBuf};

/// An avatar to be made or read before its jobs can run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedAvatar {
    /// Content key.
    pub key: String,
    /// Data set.
    pub dataset: String,
    /// Subject.
    pub subject: String,
    /// Where it comes from.
    #[serde(flatten)]
    pub source: AvatarSource,
}

/// Where an avatar comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "from", rename_all = "kebab-case")]
#[expect(clippy::large_enum_variant, reason = "a plan holds few, and a fit is the usual one")]
pub enum AvatarSource {
    /// A file that somebody else made.
    File {
        /// Name under which it is registered.
        name: String,
        /// The file, or the folder of an export. No key depends on it.
        #[serde(serialize_with = "super::lossy::path")]
        path: PathBuf,
        /// Digest of what it holds.
        digest: String,
        /// What a reader of the table has to know of it.
        notes: Vec<String>,
        /// The sequence whose body it is bound to.
        sequence: String,
    },
    /// None: the subject does not have what it would be made from. Frames that need it fail with the reason, and no others.
    Missing {
        /// Why, one line.
        problem: String,
    },
    /// Images that another program rendered.
    Renders(RenderedFrames),
    /// Gaussians on the body's surface, coloured from the training frames.
    Surface {
        /// The training frames.
        training: TrainingFrames,
        /// Where they sit.
        placement: Placement,
        /// How they move.
        bind_to: BindTo,
        /// SH degree of their colours.
        sh_degree: u8,
        /// Edge length that they resolve, millimetres.
        edge_mm: u32,
    },
    /// The body's mesh under a texture that is gathered from the training frames.
    Textured {
        /// The training frames.
        training: TrainingFrames,
        /// Side of the texture, texels.
        size: u32,
    },
    /// Gaussians that are fitted to the training frames.
    Fit {
        /// The training frames.
        training: TrainingFrames,
        /// How.
        fit: PlannedFit,
    },
}

/// The frames that an avatar is made from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainingFrames {
    /// Training sequence.
    pub sequence: String,
    /// Indices of its frames, ascending.
    pub frames: Vec<usize>,
    /// Longer side to which they are reduced, pixels; native if absent.
    pub resolution: Option<u32>,
    /// Further takes, and the indices of their frames.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub further: Vec<(String, Vec<usize>)>,
    /// Noise on their poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<PoseNoise>,
}

/// A fit to be made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedFit {
    /// Recipe and budget.
    pub options: FitOptions,
    /// Content key of the avatar with which it starts: recipes that start alike share it.
    pub start: String,
}

impl PlannedAvatar {
    /// The frames that it is made from; none if it is a file.
    pub fn training(&self) -> Option<&TrainingFrames> {
        match &self.source {
            AvatarSource::File { .. } | AvatarSource::Renders(_) | AvatarSource::Missing { .. } => None,
            AvatarSource::Surface { training, .. }
            | AvatarSource::Textured { training, .. }
            | AvatarSource::Fit { training, .. } => Some(training),
        }
    }

    /// The key of the avatar with which its fit starts; none if it is not fitted.
    pub fn start(&self) -> Option<&str> {
        match &self.source {
            AvatarSource::Fit { fit, .. } => Some(&fit.start),
            _ => None,
        }
    }

    /// What it is, for people: data set, subject and recipe.
    pub fn label(&self) -> String {
        let how = match &self.source {
            AvatarSource::File { name, .. } => format!("file {name}"),
            AvatarSource::Missing { problem } => format!("none: {problem}"),
            AvatarSource::Renders(renders) => format!("renders in {}", renders.folder.display()),
            AvatarSource::Surface { placement: Placement::Vertices, .. } => "surface-vertex".to_owned(),
            AvatarSource::Surface { placement: Placement::Faces, .. } => "surface-face".to_owned(),
            AvatarSource::Textured { size, .. } => format!("textured-mesh {size}"),
            AvatarSource::Fit { fit, .. } => format!("fit {} {}", fit.options.recipe.id, fit.options.seed),
        };
        format!("{}/{} {how}", self.dataset, self.subject)
    }
}

/// What cannot be planned, and what could be.
pub(super) type Problem = (String, String);

/// Plans the avatars of one row of a table.
pub(super) struct Planner<'a> {
    pub(super) profile: &'a Profile,
    /// Longer side of the images, pixels; native if absent.
    pub(super) resolution: Option<u32>,
    pub(super) subject: &'a SubjectInfo,
    pub(super) row: &'a DataRow,
    /// Of the variant's poses.
    pub(super) noise: Option<PoseNoise>,
    /// From how many training sequences its avatar is made.
    pub(super) takes: u32,
    /// Whether test frames are used to limit further takes: most frames of a sequence.
    pub(super) most_frames: Option<usize>,
}

impl Planner<'_> {
    /// The avatar of a variant.
    ///
    /// # Errors
    /// A file that is not there or does not fit, a subject without training frames for what is made from them.
    pub(super) fn avatar(&self, variant: &Variant) -> Result<PlannedAvatar, Problem> {
        let (source, content) = match self.too_few_takes() {
            Some(problem) => {
                let content = json!({ "missing": problem });
                (AvatarSource::Missing { problem }, content)
            }
            None => self.source(variant)?,
        };
        let key = content_key(&json!({ "avatar": content }));
        Ok(PlannedAvatar {
            key,
            dataset: self.row.dataset.clone(),
            subject: self.row.subject.clone(),
            source,
        })
    }

    /// Why there is no avatar from as many takes as the variant asks for, if there is none.
    fn too_few_takes(&self) -> Option<String> {
        let (first, _) = self.row.train.as_ref().filter(|_| self.takes > 1)?;
        self.further_takes(first).err().map(|(problem, expected)| format!("{problem}; expected {expected}"))
    }

    /// The source and what its key is made from.
    fn source(&self, variant: &Variant) -> Result<(AvatarSource, Value), Problem> {
        let surface = |placement, bind_to| self.surface(variant, placement, bind_to);
        match &variant.avatar {
            AvatarRecipe::File { name, otherwise } => self.file(variant, name, otherwise.as_deref()),
            AvatarRecipe::SurfaceVertex {} => surface(Placement::Vertices, BindTo::Joints),
            AvatarRecipe::SurfaceFace {} => surface(Placement::Faces, BindTo::Faces),
            AvatarRecipe::TexturedMesh { size } => {
                let training = self.training()?;
                let content = self.gathered(variant, &training);
                Ok((AvatarSource::Textured { training, size: *size }, content))
            }
            AvatarRecipe::Fit { name, seed } => self.fit(name, *seed),
            AvatarRecipe::Renders { path } => self.renders(path),
        }
    }

    fn renders(&self, path: &Path) -> Result<(AvatarSource, Value), Problem> {
        let of_row = |own: &&RenderedFrames| own.path == path && own.sequence == self.row.sequence;
        let renders = self.subject.renders.iter().find(of_row).ok_or_else(|| {
            let of = format!("{}/{}", self.row.subject, self.row.sequence);
            (format!("renders of {of} in {}", path.display()), "renders that were looked for".to_owned())
        })?;
        let content = json!({ "renders": renders.digest, "splats": renders.splats });
        Ok((AvatarSource::Renders(renders.clone()), content))
    }

    fn surface(
        &self,
        variant: &Variant,
        placement: Placement,
        bind_to: BindTo,
    ) -> Result<(AvatarSource, Value), Problem> {
        let training = self.training()?;
        let content = self.gathered(variant, &training);
        let sh_degree = variant.sh_degree.unwrap_or_default();
        let edge_mm = self.profile.avatar_edge_mm;
        Ok((AvatarSource::Surface { training, placement, bind_to, sh_degree, edge_mm }, content))
    }

    /// What the key of an avatar that is gathered from the training frames is made from.
    fn gathered(&self, variant: &Variant, training: &TrainingFrames) -> Value {
        let made = self.of_frames(training);
        let defaults = (SurfaceInit::default(), TextureInit::default());
        json!({
            "made": made, "recipe": variant.avatar, "sh_degree": variant.sh_degree, "defaults": defaults,
        })
    }

    fn fit(&self, recipe: &str, seed: u64) -> Result<(AvatarSource, Value), Problem> {
        let training = self.training()?;
        let made = self.of_frames(&training);
        let recipe =
            Recipe::parse(recipe).map_err(|error| (error.to_string(), "a fitting recipe".to_owned()))?;
        let iterations = recipe.length(training.frames.len(), self.profile.fit_iterations);
        let options = FitOptions { recipe, iterations, seed, edge_mm: self.profile.avatar_edge_mm };
        let start = content_key(&json!({ "start": made, "how": Starting::of(&options) }));
        let content = json!({
            "made": made, "code": CodeVersions::CURRENT, "recipe": options.recipe.choices(),
            "iterations": options.iterations, "seed": options.seed,
        });
        Ok((AvatarSource::Fit { training, fit: PlannedFit { options, start } }, content))
    }

    /// A registered file; what is fitted otherwise where there is none.
    fn file(
        &self,
        variant: &Variant,
        name: &str,
        otherwise: Option<&str>,
    ) -> Result<(AvatarSource, Value), Problem> {
        let of = format!("variant {}: {}/{}", variant.id, self.row.dataset, self.row.subject);
        let registered = self.subject.avatars.iter().find(|avatar| avatar.name == name);
        match (registered, otherwise) {
            (Some(AvatarFile { path, state: AvatarState::Present { digest, notes }, .. }), _) => {
                let sequence = self.row.train.as_ref().map_or(&self.row.sequence, |(id, _)| id);
                let content = json!({ "file": digest, "body": self.digest(sequence) });
                let source = AvatarSource::File {
                    name: name.to_owned(),
                    path: path.clone(),
                    digest: digest.clone(),
                    notes: notes.clone(),
                    sequence: sequence.clone(),
                };
                Ok((source, content))
            }
            (Some(AvatarFile { state: AvatarState::Broken { problem }, .. }), _) => {
                Err((format!("{of}: {problem}"), "an avatar of this subject's body".to_owned()))
            }
            (_, Some(recipe)) => self.fit(recipe, 0),
            (Some(AvatarFile { path, .. }), None) => {
                let expected = "the avatar there, or `otherwise = \"RECIPE\"` beside its name to fit one";
                Err((format!("{of}: no file {}", path.display()), expected.to_owned()))
            }
            (None, None) => {
                let known: Vec<&str> = self.subject.avatars.iter().map(|avatar| &*avatar.name).collect();
                let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                let expected = format!("[[dataset.avatars]] of that name (registered: {known})");
                Err((format!("{of} has no avatar `{name}`"), expected))
            }
        }
    }

    fn training(&self) -> Result<TrainingFrames, Problem> {
        let (sequence, frames) = self.row.train.clone().ok_or_else(|| {
            let problem = format!("{}/{} has no training sequence", self.row.dataset, self.row.subject);
            (problem, "a subject with one, or a recipe that reads a file".to_owned())
        })?;
        let (resolution, noise) = (self.resolution, self.noise);
        Ok(TrainingFrames { further: self.further_takes(&sequence)?, sequence, frames, resolution, noise })
    }

    /// The takes after the first one, in the order of the subject's training sequences.
    fn further_takes(&self, first: &str) -> Result<Vec<(String, Vec<usize>)>, Problem> {
        let wanted = self.takes.saturating_sub(1) as usize;
        let others = self.subject.sequences.iter().filter(|s| s.role == Role::Train && s.id != first);
        let thinned = |sequence: &super::SequenceInfo| {
            let all: Vec<usize> = (0..sequence.frames.len()).collect();
            (sequence.id.clone(), evenly_spaced(&all, self.most_frames))
        };
        let takes: Vec<_> = others.take(wanted).map(thinned).collect();
        match takes.len() == wanted {
            true => Ok(takes),
            false => {
                let of = format!("{}/{}", self.row.dataset, self.row.subject);
                let found = format!("{of} has {} of the {} training sequences", takes.len() + 1, self.takes);
                Err((found, "as many takes as the variant asks for".to_owned()))
            }
        }
    }

    /// Everything that an avatar can depend on through its training frames.
    fn of_frames(&self, training: &TrainingFrames) -> Value {
        let TrainingFrames { sequence, frames, resolution, further, noise } = training;
        let mut made = json!({
            "code": CodeVersions::CURRENT.fit, "train": self.digest(sequence), "frames": frames,
            "resolution": resolution, "edge_mm": self.profile.avatar_edge_mm,
        });
        if !further.is_empty() {
            let takes: Vec<_> = further.iter().map(|(id, frames)| (self.digest(id), frames)).collect();
            made["further"] = json!(takes);
        }
        if let Some(noise) = noise {
            made["pose_noise"] = json!(noise);
        }
        made
    }

    fn digest(&self, sequence: &str) -> &str {
        &super::plan::find_sequence(self.subject, sequence).digest
    }
}
