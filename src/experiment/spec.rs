//! The experiment file: one table, described as data.

use super::{
    EMBEDDED, Error, FURTHER, Grid, Paper, Profile, Replicate, Source, Split, TestPoses, catalog, grid,
    poses, seeds, validate,
};
use crate::toml_problem::TomlProblem;
use serde::{Deserialize, Serialize};
use skinsplat_data::{Capture, Gender, source};
use skinsplat_fit::options::PoseFit;
use skinsplat_metrics::MetricId;
use skinsplat_posing::PRESETS;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// How the ids of variants begin that [`Experiment::with_all_strategies`] adds.
pub const ADDED_VARIANT: &str = "strategy-";

/// Between the id of a data set and that of the experiment for which it was loaded on other bodies.
pub(super) const OWN_BODIES: char = '@';

/// How the names of avatars begin that the command line gives to a variant, whose id follows.
pub const GIVEN_AVATAR: &str = "--avatar ";

/// One table: what to ask of which data. See `experiments/README.md` for the file format.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Version of the file format: 1.
    pub schema: u32,
    /// Id, equal to the file's name without `.toml`; names the outputs.
    pub id: String,
    /// Version of the experiment: raised by hand when a change makes old and new numbers incomparable.
    pub version: u32,
    /// Title, such as `Table 1`.
    pub title: String,
    /// Caption when the table's own data set runs.
    pub caption: String,
    /// Id of the table's own data set.
    pub dataset: String,
    /// Its name in prose: a stand-in's caption must not contain it.
    pub dataset_title: String,
    /// The stock method that the table is about.
    pub method: String,
    /// The scoring protocol: a preset's id, or a preset with other choices, such as `haha+ssim=torchmetrics-1.4`.
    pub protocol: String,
    /// Longer side to which images of the table's own data are reduced, pixels: the resolution of the compared method.
    #[serde(default)]
    pub resolution: Option<u32>,
    /// Whether the antialiased rasterizer renders.
    #[serde(default)]
    pub antialiased: bool,
    /// Subjects of the data set, in printed order; all of them if empty.
    #[serde(default)]
    pub sequences: Vec<String>,
    /// Gender of the body model by subject, where the compared method takes another than the subject's own. A model file that
    /// the registry gives goes before it.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub genders: BTreeMap<String, Gender>,
    /// Shape of the table.
    pub layout: Layout,
    /// Id of the variant with which the others are compared frame by frame.
    pub baseline: String,
    /// The mean over sequences; none if absent.
    pub average: Option<Average>,
    /// Remarks printed under the table.
    #[serde(default)]
    pub notes: Vec<String>,
    /// What may run where the data set is absent; nothing if absent.
    pub stand_in: Option<StandIn>,
    /// The metric columns.
    pub columns: Vec<Column>,
    /// Seeds with which every fitted variant is repeated; each variant's own seed if empty. Tables print means over seeds
    /// and their spread.
    #[serde(default)]
    pub seeds: Vec<u64>,
    /// Per metric, up to which difference two variants are as good as each other; see [`Experiment::margin`].
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub equivalence: BTreeMap<MetricId, f64>,
    /// Noise on the poses of every variant that has none of its own, for training and for test: degrees per joint
    /// ([`skinsplat_data::pose_noise`]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_noise: Option<f64>,
    /// Seed of the noise.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub pose_noise_seed: u64,
    /// Whether the poses of test images are fitted before a further score; tables never show that score alone.
    #[serde(default, skip_serializing_if = "TestPoses::are_given")]
    pub test_poses: TestPoses,
    /// How, where they are.
    #[serde(default, skip_serializing_if = "is_default")]
    pub test_pose: PoseFit,
    /// What is compared, once per seed where there are several.
    #[serde(default)]
    pub variants: Vec<Variant>,
    /// Further variants, by the product of their choices; empty once they are among `variants`.
    #[serde(default, skip_serializing)]
    pub grids: Vec<Grid>,
    /// The printed table, if there is one.
    pub paper: Option<Paper>,
    /// How the compared method's repository splits the data.
    #[serde(default)]
    pub splits: Vec<Split>,
}

fn is_zero(number: &u64) -> bool {
    *number == 0
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Shape of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// A row per sequence and variant, a column per metric (Tables 1 to 5).
    Rows,
    /// A row per variant, a group of metric columns per sequence (Table 6).
    Wide,
}

/// The mean over sequences, each counting once however many frames it has.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Average {
    /// Title of the row or of the column group.
    pub label: String,
}

/// Which data may run in place of the table's own.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StandIn {
    /// The kind of capture that a subject must be; any if absent.
    #[serde(default)]
    pub capture: Option<Capture>,
    /// Caption of a table made from stand-in data; it must not name the table's own data set.
    pub caption: String,
    /// Scoring protocol of the stand-in where the table's own does not fit it; the table's own if absent.
    #[serde(default)]
    pub protocol: Option<String>,
    /// Ids of the sequences from which avatars are made (the first that a subject has is taken); its first training
    /// sequence if empty.
    #[serde(default)]
    pub train: Vec<String>,
    /// Ids of the sequences that are scored; every test sequence if empty.
    #[serde(default)]
    pub test: Vec<String>,
}

/// A metric column.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Column {
    /// The metric.
    pub metric: MetricId,
    /// Title; the metric's usual one if absent.
    #[serde(default)]
    pub title: Option<String>,
    /// Digits after the point; the metric's usual number if absent.
    #[serde(default)]
    pub decimals: Option<usize>,
    /// Whether the experiment is about it, so that the best is bold: if absent, metrics of frames are, counts are not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outcome: Option<bool>,
    /// It shows the score after the pose was fitted to the image; the column before it is the one as given. Not for files:
    /// `test_poses = "fitted"` makes two columns of each.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub fitted: bool,
}

/// What a column shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shown {
    /// The metric.
    pub metric: MetricId,
    /// With poses fitted to the test images.
    pub fitted: bool,
}

impl From<MetricId> for Shown {
    /// With poses as they are given.
    fn from(metric: MetricId) -> Self {
        Self { metric, fitted: false }
    }
}

impl Column {
    /// What it shows.
    pub fn shown(&self) -> Shown {
        Shown { metric: self.metric, fitted: self.fitted }
    }

    /// Title of the column.
    pub fn title(&self) -> &str {
        self.title.as_deref().unwrap_or(self.metric.title())
    }

    /// Digits after the point.
    pub fn decimals(&self) -> usize {
        self.decimals.unwrap_or(self.metric.decimals())
    }

    /// Whether the best of the column is bold.
    pub fn is_outcome(&self) -> bool {
        self.outcome.unwrap_or(self.metric.is_of_frames())
    }
}

/// One of the things that a table compares: an avatar and how it is posed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// Id, unique in the table.
    pub id: String,
    /// Label in the table.
    pub label: String,
    /// Id of the printed variant whose numbers belong beside this one's; none if nothing printed compares.
    #[serde(default)]
    pub paper: Option<String>,
    /// Where the avatar comes from.
    pub avatar: AvatarRecipe,
    /// How its Gaussians are posed: a strategy's id or spec, such as `quaternion-average+rotation=power-15`. Absent
    /// for a textured mesh, which has none.
    #[serde(default)]
    pub strategy: Option<String>,
    /// SH degree of the colour, 0 to 3, for avatars that are made here.
    #[serde(default)]
    pub sh_degree: Option<u8>,
    /// Noise on its poses, degrees per joint; the experiment's if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_noise: Option<f64>,
    /// From how many training sequences (takes) of a subject its avatar is made; from the first one if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub takes: Option<u32>,
    /// Ids of variants, besides the baseline, that it is compared with over all sequences.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub against: Vec<String>,
    /// The variant of the file that this one repeats.
    #[serde(skip)]
    pub replicate: Option<Replicate>,
}

impl Variant {
    /// Its id, and that of the variant of the file which it repeats.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        [Some(self.id.as_str()), self.replicate.as_ref().map(|of| of.id.as_str())].into_iter().flatten()
    }

    /// Whether an id names it, or the variant of the file which it repeats.
    pub fn is_called(&self, id: &str) -> bool {
        self.names().any(|name| name == id)
    }
}

/// Where an avatar comes from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "recipe", rename_all = "kebab-case", deny_unknown_fields)]
pub enum AvatarRecipe {
    /// One Gaussian per vertex of the body, bound to the vertex's joints, coloured from the training frames.
    SurfaceVertex {},
    /// One Gaussian per face of the body, bound to it by barycentric coordinates, coloured from the training frames.
    SurfaceFace {},
    /// The body's mesh with a texture gathered from the training frames, drawn by the triangle rasterizer.
    TexturedMesh {
        /// Side of the texture, texels.
        size: u32,
    },
    /// Gaussians that are fitted to the training frames.
    Fit {
        /// The fitting recipe: an id of `recipes.toml`, or one with other choices.
        name: String,
        /// Seed of all that is random in it.
        #[serde(default)]
        seed: u64,
    },
    /// A file that the data set registers for the subject.
    File {
        /// Name under which it is registered.
        name: String,
        /// The recipe by which an avatar is fitted where a subject has no such file; without it that is an error.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        otherwise: Option<String>,
    },
    /// Images that another program rendered, paired with the test frames by name; `renders.json` beside them may say
    /// `splats`, `bytes` and `milliseconds`.
    Renders {
        /// The folder; `{subject}` and `{sequence}` stand for their ids. Relative to the experiment's file.
        #[serde(serialize_with = "super::lossy::path")]
        path: PathBuf,
    },
}

impl AvatarRecipe {
    /// True if a strategy poses it.
    pub fn is_gaussian(&self) -> bool {
        !matches!(self, Self::TexturedMesh { .. } | Self::Renders { .. })
    }

    /// The recipe by which it is fitted, or may be.
    pub fn fitting_recipe(&self) -> Option<&str> {
        match self {
            Self::Fit { name, .. } => Some(name),
            Self::File { otherwise, .. } => otherwise.as_deref(),
            Self::SurfaceVertex {}
            | Self::SurfaceFace {}
            | Self::TexturedMesh { .. }
            | Self::Renders { .. } => None,
        }
    }
}

impl Experiment {
    /// True if it asks for other bodies than its data set's subjects have.
    pub fn has_own_bodies(&self) -> bool {
        !self.genders.is_empty()
    }

    /// Id under which its own data is loaded: the data set's, or one of its own where it asks for other bodies.
    pub fn data_id(&self) -> String {
        match self.has_own_bodies() {
            true => format!("{}{OWN_BODIES}{}", self.dataset, self.id),
            false => self.dataset.clone(),
        }
    }

    /// Reads one experiment file.
    ///
    /// # Errors
    /// Names the file and the line or key.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let text = source::read_to_string(path).map_err(|source| Error::Io { path: path.into(), source })?;
        let mut experiment = Self::parse(&text, &path.display().to_string())?;
        let folder = path.parent().unwrap_or(Path::new(""));
        for variant in &mut experiment.variants {
            if let AvatarRecipe::Renders { path } = &mut variant.avatar {
                *path = folder.join(&path);
            }
        }
        Ok(experiment)
    }

    /// Reads every `*.toml` of a folder, in the order of their names.
    ///
    /// # Errors
    /// Names the file and the line or key; also if two files have one id.
    pub fn load_folder(folder: &Path) -> Result<Vec<Self>, Error> {
        let io = |source| Error::Io { path: folder.into(), source };
        let mut paths = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(io)? {
            let path = entry.map_err(io)?.path();
            if path.extension().is_some_and(|extension| extension == "toml") {
                paths.push(path);
            }
        }
        paths.sort();
        let experiments: Vec<Self> = paths.iter().map(|path| Self::load(path)).collect::<Result<_, _>>()?;
        validate::distinct(&experiments, &folder.display().to_string())?;
        Ok(experiments)
    }

    /// The six tables of the paper, compiled in.
    pub fn embedded() -> Vec<Self> {
        let parse = |(file, text): &(&str, &str)| Self::parse(text, file).expect("tests load every one");
        EMBEDDED.iter().map(parse).collect()
    }

    /// The six tables and the experiments of our own, compiled in, in the order of their ids.
    pub fn embedded_all() -> Vec<Self> {
        let parse = |(file, text): &(&str, &str)| Self::parse(text, file).expect("tests load every one");
        FURTHER.iter().chain(EMBEDDED).map(parse).collect()
    }

    /// Parses and checks the text of an experiment file; `file` is its name in error messages.
    ///
    /// # Errors
    /// Names the file and the line or key.
    pub fn parse(text: &str, file: &str) -> Result<Self, Error> {
        let experiment: Self = toml::from_str(text).map_err(|error| toml_error(text, file, &error))?;
        let experiment = grid::expand(experiment, file)?;
        validate::experiment(&experiment, file)?;
        Ok(poses::expand(seeds::expand(experiment)))
    }

    /// The variant of this id.
    pub fn variant(&self, id: &str) -> Option<&Variant> {
        self.variants.iter().find(|variant| variant.id == id)
    }

    /// The scoring protocol on data of this source.
    pub fn protocol_on(&self, source: Source) -> &str {
        let other = self.stand_in.as_ref().and_then(|stand_in| stand_in.protocol.as_deref());
        if source == Source::StandIn { other.unwrap_or(&self.protocol) } else { &self.protocol }
    }

    /// Longer side of images on data of this source under a profile, pixels; native if none.
    pub fn resolution_on(&self, source: Source, profile: &Profile) -> Option<u32> {
        let own = self.resolution.filter(|_| source == Source::Own);
        profile.resolution.into_iter().chain(own).min()
    }

    /// The experiment with a further row for each preset strategy that no variant has yet. The rows copy the avatar of
    /// the last variant that a strategy poses; without such a variant nothing is added.
    pub fn with_all_strategies(&self) -> Self {
        let mut extended = self.clone();
        let Some(model) = self.variants.iter().rev().find(|variant| variant.strategy.is_some()) else {
            return extended;
        };
        for preset in PRESETS {
            let known = |v: &Variant| {
                let strategy = v.strategy.as_deref().and_then(|spec| catalog::strategy(spec).ok());
                strategy == Some(preset.strategy)
                    && v.avatar == model.avatar
                    && v.sh_degree == model.sh_degree
            };
            if !extended.variants.iter().any(known) {
                let taken = extended.variants.iter().any(|variant| variant.label == preset.title);
                extended.variants.push(Variant {
                    id: format!("{ADDED_VARIANT}{}", preset.id),
                    label: if taken {
                        format!("{} ({})", preset.title, preset.id)
                    } else {
                        preset.title.to_owned()
                    },
                    paper: None,
                    against: Vec::new(),
                    strategy: Some(preset.id.to_owned()),
                    replicate: None,
                    ..model.clone()
                });
            }
        }
        extended
    }
}

/// The parser's complaint in one line, with the line that it is about.
fn toml_error(text: &str, file: &str, error: &toml::de::Error) -> Error {
    let problem = TomlProblem::of(text, error);
    let message = problem.message();
    Error::Toml { file: file.into(), line: problem.line, message, excerpt: problem.excerpt }
}
