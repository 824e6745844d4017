//! From experiments and data to jobs: pure, no file is opened.

use super::rows::{DataRow, Source, rows_of};
use super::{
    AvatarRecipe, CodeVersions, Dataset, Error, Experiment, Options, SequenceInfo, Shard, SubjectInfo,
    Variant, catalog,
};
use serde::Serialize;
use serde_json::{Value, json};
use skinsplat_data::key::content_key;
use skinsplat_fit::FitOptions;
use skinsplat_fit::Recipe;
use skinsplat_fit::surface::SurfaceInit;
use skinsplat_fit::texture::TextureInit;
use skinsplat_fit::train::Starting;
use skinsplat_metrics::{MetricKind, Protocol, ProtocolId};
use skinsplat_posing::Strategy;
use std::collections::BTreeSet;

/// Everything that a run has to do and a report has to show, as plain data.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// What was asked for.
    pub options: Options,
    /// One per experiment, in the given order.
    pub tables: Vec<PlannedTable>,
    /// The avatars that jobs need, each once whichever tables share it, in order of first use.
    pub avatars: Vec<AvatarBuild>,
    /// One per table and test frame: tables in order, sequences in order, frames ascending.
    pub jobs: Vec<Job>,
    /// SHA-256 over the keys of all jobs and the tables' shapes.
    pub digest: String,
}

impl Plan {
    /// True if a subset was asked for: its tables say so.
    pub fn is_partial(&self) -> bool {
        !self.options.subset.is_everything()
    }

    /// The avatar of this key.
    pub fn avatar(&self, key: &str) -> Option<&AvatarBuild> {
        self.avatars.iter().find(|avatar| avatar.key == key)
    }

    /// The jobs of a shard (all of them without one), in order.
    pub fn shard(&self, shard: Option<Shard>) -> Vec<&Job> {
        match shard {
            Some(shard) => shard.slice(&self.jobs).collect(),
            None => self.jobs.iter().collect(),
        }
    }
}

/// One table and the data it will be made from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlannedTable {
    /// Id of the experiment.
    pub experiment: String,
    /// Own data, a stand-in, or nothing.
    pub source: Source,
    /// Ids and titles of the data sets that take part, in the given order.
    pub datasets: Vec<(String, String)>,
    /// The sequences.
    pub rows: Vec<DataRow>,
    /// Ids of the variants that take part, in the experiment's order.
    pub variants: Vec<String>,
    /// The scoring protocol.
    pub protocol: ProtocolId,
}

/// An avatar to be made or read before its jobs can run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AvatarBuild {
    /// Content key.
    pub key: String,
    /// Data set.
    pub dataset: String,
    /// Subject.
    pub subject: String,
    /// Training sequence; none if the avatar is a file.
    pub sequence: Option<String>,
    /// Indices of the training frames, ascending.
    pub frames: Vec<usize>,
    /// How it is made.
    pub recipe: AvatarRecipe,
    /// SH degree; none if the recipe decides.
    pub sh_degree: Option<u8>,
    /// Longer side to which training frames are reduced, pixels; native if absent.
    pub resolution: Option<u32>,
    /// Edge length that the avatar resolves, millimetres.
    pub edge_mm: u32,
    /// How it is fitted; none if it is not.
    pub fit: Option<PlannedFit>,
}

/// A fit to be made.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlannedFit {
    /// Recipe and budget.
    pub options: FitOptions,
    /// Content key of the avatar with which it starts: recipes that start alike share it.
    pub start: String,
}

/// One test frame of one table: the truth is loaded once and every variant is rendered and scored against it, so that
/// comparisons are paired.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Job {
    /// Index into [`Plan::tables`].
    pub table: usize,
    /// Index into [`PlannedTable::rows`].
    pub row: usize,
    /// Data set.
    pub dataset: String,
    /// Subject.
    pub subject: String,
    /// Test sequence.
    pub sequence: String,
    /// Index of the frame in its sequence.
    pub frame: usize,
    /// Name of the frame.
    pub name: String,
    /// Spec of the scoring protocol.
    pub protocol: String,
    /// Longer side to which the frame is reduced, pixels; native if absent.
    pub resolution: Option<u32>,
    /// Whether the antialiased rasterizer renders.
    pub antialiased: bool,
    /// Whether the table has a column for SSIM.
    pub ssim: bool,
    /// Whether the table has a column for LPIPS.
    pub lpips: bool,
    /// What is rendered.
    pub variants: Vec<JobVariant>,
}

impl Job {
    /// The label of a record of this job.
    pub fn label(&self, variant: &JobVariant) -> String {
        let Self { dataset, subject, sequence, name, .. } = self;
        format!("{dataset}/{subject}/{sequence}/{name} {}", variant.id)
    }
}

/// One way of rendering a frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JobVariant {
    /// Id of the variant.
    pub id: String,
    /// Content key of the record: equal keys mean equal numbers, in whichever table.
    pub key: String,
    /// Key of the [`AvatarBuild`].
    pub avatar: String,
    /// Strategy spec; none for a textured mesh.
    pub strategy: Option<String>,
}

/// Plans the experiments on the data at hand.
///
/// An experiment whose own data set (by id) is among `datasets` runs on that; otherwise on every subject that may
/// stand in; otherwise its table has no rows. The result depends on the arguments alone.
///
/// # Errors
/// An unknown protocol or strategy, a subset that names no subject or variant, or an avatar file that the subject does
/// not have; the message names the experiment and the key.
pub fn plan(experiments: &[Experiment], datasets: &[Dataset], options: &Options) -> Result<Plan, Error> {
    super::validate::distinct(experiments, "experiments")?;
    subset_names_something(experiments, datasets, options)?;
    let mut builder = Builder { datasets, options, avatars: Vec::new(), jobs: Vec::new() };
    let numbered = experiments.iter().enumerate();
    let tables: Vec<PlannedTable> =
        numbered.map(|(index, experiment)| builder.table(index, experiment)).collect::<Result<_, _>>()?;
    let Builder { avatars, jobs, .. } = builder;
    let digest = content_key(&json!({ "options": options, "tables": tables, "jobs": jobs }));
    Ok(Plan { options: options.clone(), tables, avatars, jobs, digest })
}

/// Collects avatars and jobs while the tables are walked.
struct Builder<'a> {
    datasets: &'a [Dataset],
    options: &'a Options,
    avatars: Vec<AvatarBuild>,
    jobs: Vec<Job>,
}

impl Builder<'_> {
    /// One table; its jobs and avatars are added to the builder's.
    fn table(&mut self, index: usize, experiment: &Experiment) -> Result<PlannedTable, Error> {
        let (source, rows) = rows_of(experiment, self.datasets, self.options);
        let invalid = |(problem, expected)| Error::invalid(&experiment.id, "protocol", problem, expected);
        let protocol = catalog::protocol(experiment.protocol_on(source)).map_err(invalid)?;
        let wanted = &self.options.subset.variants;
        let variants: Vec<(usize, &Variant)> = (experiment.variants.iter().enumerate())
            .filter(|(_, variant)| wanted.is_empty() || wanted.contains(&variant.id))
            .collect();
        let with_data = |(_, row): &(usize, &DataRow)| row.missing.is_none() && !variants.is_empty();
        for (row_index, row) in rows.iter().enumerate().filter(with_data) {
            let prepared = variants
                .iter()
                .map(|&(v, variant)| self.prepare(experiment, v, variant, row))
                .collect::<Result<Vec<_>, _>>()?;
            self.add_jobs((index, row_index), row, experiment, &protocol, &prepared);
        }
        let used = |dataset: &&Dataset| rows.iter().any(|row| row.dataset == dataset.id);
        let datasets = self.datasets.iter().filter(used).map(|d| (d.id.clone(), d.title.clone())).collect();
        Ok(PlannedTable {
            experiment: experiment.id.clone(),
            source,
            datasets,
            rows,
            variants: variants.iter().map(|(_, variant)| variant.id.clone()).collect(),
            protocol: protocol.key(),
        })
    }

    /// What a variant needs on a row, before any frame: its avatar and its strategy.
    fn prepare(
        &mut self,
        experiment: &Experiment,
        index: usize,
        variant: &Variant,
        row: &DataRow,
    ) -> Result<Prepared, Error> {
        let invalid = |field: &str, (problem, expected): (String, String)| {
            Error::invalid(&experiment.id, format!("variants[{index}].{field}"), problem, expected)
        };
        let strategy = match &variant.strategy {
            None => None,
            Some(spec) => Some(catalog::strategy(spec).map_err(|why| invalid("strategy", why))?),
        };
        let avatar = self.avatar(variant, row).map_err(|why| invalid("avatar", why))?;
        Ok(Prepared { variant: variant.clone(), avatar, strategy })
    }

    /// The key of the variant's avatar for a row's subject; the build is noted if it is new. An avatar that cannot be
    /// made is a problem and an expectation.
    fn avatar(&mut self, variant: &Variant, row: &DataRow) -> Result<String, (String, String)> {
        let subject = self.subject(row);
        let resolution = self.options.profile.resolution;
        let mut build = AvatarBuild {
            key: String::new(),
            dataset: row.dataset.clone(),
            subject: row.subject.clone(),
            sequence: None,
            frames: Vec::new(),
            recipe: variant.avatar.clone(),
            sh_degree: variant.sh_degree,
            resolution: None,
            edge_mm: self.options.profile.avatar_edge_mm,
            fit: None,
        };
        let content = if let AvatarRecipe::File { name } = &variant.avatar {
            let file = subject.avatars.iter().find(|avatar| &avatar.name == name);
            let file = file.ok_or_else(|| {
                let known: Vec<&str> = subject.avatars.iter().map(|avatar| avatar.name.as_str()).collect();
                let problem = format!("{}/{} has no avatar `{name}`", row.dataset, row.subject);
                (problem, format!("one of those it has: {}", known.join(", ")))
            })?;
            json!({ "file": file.digest })
        } else {
            let (sequence, frames) = row.train.clone().ok_or_else(|| {
                let problem = format!("{}/{} has no training sequence", row.dataset, row.subject);
                (problem, "a subject with one, or a recipe that reads a file".to_owned())
            })?;
            let digest = &find_sequence(subject, &sequence).digest;
            let of_frames = json!({
                "code": CodeVersions::CURRENT.fit, "train": digest, "frames": frames, "resolution": resolution,
                "edge_mm": build.edge_mm,
            });
            let fit = self.fit(&variant.avatar, &of_frames)?;
            let content = match &fit {
                Some(PlannedFit { options, .. }) => json!({
                    "made": of_frames, "code": CodeVersions::CURRENT, "recipe": options.recipe.choices(),
                    "iterations": options.iterations, "seed": options.seed,
                }),
                None => {
                    let defaults = (SurfaceInit::default(), TextureInit::default());
                    json!({
                        "made": of_frames, "recipe": variant.avatar, "sh_degree": variant.sh_degree,
                        "defaults": defaults,
                    })
                }
            };
            build = AvatarBuild { sequence: Some(sequence), frames, resolution, fit, ..build };
            content
        };
        build.key = content_key(&json!({ "avatar": content }));
        let key = build.key.clone();
        if self.avatars.iter().all(|known| known.key != key) {
            self.avatars.push(build);
        }
        Ok(key)
    }

    /// The fit of a recipe, if it is one, on training frames that `of_frames` describes in full.
    fn fit(&self, avatar: &AvatarRecipe, of_frames: &Value) -> Result<Option<PlannedFit>, (String, String)> {
        let AvatarRecipe::Fit { name, seed } = avatar else { return Ok(None) };
        let recipe =
            Recipe::parse(name).map_err(|error| (error.to_string(), "a fitting recipe".to_owned()))?;
        let profile = &self.options.profile;
        let iterations = profile.fit_iterations.map_or(recipe.iterations, |most| recipe.iterations.min(most));
        let options = FitOptions { recipe, iterations, seed: *seed, edge_mm: profile.avatar_edge_mm };
        let start = content_key(&json!({ "start": of_frames, "how": Starting::of(&options) }));
        Ok(Some(PlannedFit { options, start }))
    }

    /// The jobs of a row, one per frame. `place` is the index of the table and of the row.
    fn add_jobs(
        &mut self,
        place: (usize, usize),
        row: &DataRow,
        experiment: &Experiment,
        protocol: &Protocol,
        variants: &[Prepared],
    ) {
        let test = find_sequence(self.subject(row), &row.sequence).clone();
        let resolution = self.options.profile.resolution;
        let shows = |metric| experiment.columns.iter().any(|column| column.metric == metric);
        let (ssim, lpips) = (shows(MetricKind::Ssim), shows(MetricKind::Lpips));
        let weights = self.options.lpips_weights.as_ref().filter(|given| given.net == protocol.lpips.net);
        let choices = Protocol { title: String::new(), source: String::new(), ..protocol.clone() };
        for &frame in &row.frames {
            let variants = variants.iter().map(|prepared| {
                let content = json!({
                    "code": CodeVersions::CURRENT, "test": test.digest, "frame": frame,
                    "avatar": prepared.avatar, "strategy": prepared.strategy, "protocol": choices,
                    "antialiased": experiment.antialiased, "resolution": resolution,
                    "ssim": ssim, "lpips": lpips, "lpips_weights": weights.filter(|_| lpips),
                });
                JobVariant {
                    id: prepared.variant.id.clone(),
                    key: content_key(&json!({ "frame": content })),
                    avatar: prepared.avatar.clone(),
                    strategy: prepared.variant.strategy.clone(),
                }
            });
            self.jobs.push(Job {
                table: place.0,
                row: place.1,
                dataset: row.dataset.clone(),
                subject: row.subject.clone(),
                sequence: row.sequence.clone(),
                frame,
                name: test.frames[frame].name.clone(),
                protocol: protocol.id.clone(),
                resolution,
                antialiased: experiment.antialiased,
                ssim,
                lpips,
                variants: variants.collect(),
            });
        }
    }

    fn subject(&self, row: &DataRow) -> &SubjectInfo {
        let dataset =
            self.datasets.iter().find(|d| d.id == row.dataset).expect("rows come from the data sets");
        dataset.subjects.iter().find(|s| s.id == row.subject).expect("rows with data come from a subject")
    }
}

/// A variant that is ready for the frames of one row.
struct Prepared {
    variant: Variant,
    /// Key of the avatar.
    avatar: String,
    /// The strategy in full, so that two specs of one strategy share their keys.
    strategy: Option<Strategy>,
}

fn find_sequence<'a>(subject: &'a SubjectInfo, id: &str) -> &'a SequenceInfo {
    subject.sequences.iter().find(|sequence| sequence.id == id).expect("rows name sequences of their subject")
}

/// Refuses a subset that would leave nothing because of a name that does not exist.
fn subset_names_something(
    experiments: &[Experiment],
    datasets: &[Dataset],
    options: &Options,
) -> Result<(), Error> {
    let subjects: BTreeSet<&str> =
        datasets.iter().flat_map(|d| &d.subjects).map(|subject| subject.id.as_str()).collect();
    let variants: BTreeSet<&str> =
        experiments.iter().flat_map(|e| &e.variants).map(|variant| variant.id.as_str()).collect();
    let subset = &options.subset;
    for (key, asked, known) in
        [("subjects", &subset.subjects, subjects), ("variants", &subset.variants, variants)]
    {
        if let Some(stranger) = asked.iter().find(|id| !known.contains(id.as_str())) {
            let known: Vec<&str> = known.into_iter().collect();
            let expected = format!("one of {}", known.join(", "));
            return Err(Error::invalid("subset", key, format!("`{stranger}`"), expected));
        }
    }
    Ok(())
}
