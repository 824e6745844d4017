//! From experiments and data to jobs: pure, no file is opened.

use super::avatar::{PlannedAvatar, Planner};
use super::rows::{DataRow, Source, rows_of};
use super::subset::{subjects_are_of_a_table, subjects_can_be_loaded, subset_names_something};
use super::{
    CodeVersions, Dataset, Error, Experiment, Options, PoseNoise, SequenceInfo, Shard, Slices, SubjectInfo,
    Unreadable, Variant, catalog,
};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::json;
use skinsplat_data::key::content_key;
use skinsplat_fit::options::PoseFit;
use skinsplat_metrics::{MetricId, Protocol, ProtocolId};
use skinsplat_posing::Strategy;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Everything that a run has to do and a report has to show, as plain data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// What was asked for.
    pub options: Options,
    /// One per experiment, in the given order.
    pub tables: Vec<PlannedTable>,
    /// The avatars that jobs need, each once whichever tables share it, in order of first use.
    pub avatars: Vec<PlannedAvatar>,
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
    pub fn avatar(&self, key: &str) -> Option<&PlannedAvatar> {
        self.avatars.iter().find(|avatar| avatar.key == key)
    }

    /// The jobs of a shard (all of them without one), in order, each with its variants that belong to the shard.
    pub fn shard(&self, shard: Option<Shard>) -> Vec<Job> {
        match shard {
            Some(shard) => Slices::of(self, shard.count()).jobs(&self.jobs, shard),
            None => self.jobs.clone(),
        }
    }

    /// The digest that a plan has with these options, tables and jobs.
    pub fn digest_of(options: &Options, tables: &[PlannedTable], jobs: &[Job]) -> String {
        content_key(&json!({ "options": options, "tables": tables, "jobs": jobs }))
    }
}

/// One table and the data it will be made from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
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
    /// What a reader has to know of the data, a clause per subject.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub data_notes: Vec<String>,
    /// Sentences of the caption on what else the run makes of the table's avatars: no number depends on it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
}

/// One test frame of one table: the truth is loaded once and every variant is rendered and scored against it, so that
/// comparisons are paired.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
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
    /// The scoring protocol; serialised as its id.
    #[serde(serialize_with = "id", deserialize_with = "protocol")]
    pub protocol: Arc<Protocol>,
    /// Longer side to which the frame is reduced, pixels; native if absent.
    pub resolution: Option<u32>,
    /// Whether the antialiased rasterizer renders.
    pub antialiased: bool,
    /// What is computed: the metrics that the table shows, and those that cost nothing. Ascending.
    pub metrics: Vec<MetricId>,
    /// What is rendered.
    pub variants: Vec<JobVariant>,
}

impl Job {
    /// The label of a record of this job.
    pub fn label(&self, variant: &JobVariant) -> String {
        let Self { dataset, subject, sequence, name, .. } = self;
        format!("{dataset}/{subject}/{sequence}/{name} {}", variant.id)
    }

    /// The frame with its sequence and subject, and the variants that are drawn of it.
    pub fn frame_name(&self) -> String {
        let variants: Vec<&str> = self.variants.iter().map(|variant| variant.id.as_str()).collect();
        let Self { subject, sequence, name, .. } = self;
        format!("{subject}/{sequence}/{name} of {}", variants.join(", "))
    }

    /// The sequence with its subject and data set.
    pub fn sequence_name(&self) -> String {
        format!("{}/{}/{}", self.dataset, self.subject, self.sequence)
    }
}

/// One way of rendering a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JobVariant {
    /// Id of the variant.
    pub id: String,
    /// Content key of the record: equal keys mean equal numbers, in whichever table.
    pub key: String,
    /// Key of the [`PlannedAvatar`].
    pub avatar: String,
    /// How its Gaussians are posed; none for a textured mesh. Serialised as its spec.
    #[serde(serialize_with = "spec", deserialize_with = "strategy")]
    pub strategy: Option<Strategy>,
    /// Noise on the pose of the frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<PoseNoise>,
    /// How the pose is fitted to the image for a further score; none if it is not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fitted: Option<PoseFit>,
}

fn id<S: Serializer>(protocol: &Protocol, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&protocol.id)
}

fn spec<S: Serializer>(strategy: &Option<Strategy>, serializer: S) -> Result<S::Ok, S::Error> {
    strategy.map(|strategy| strategy.to_string()).serialize(serializer)
}

fn protocol<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Arc<Protocol>, D::Error> {
    let id = String::deserialize(deserializer)?;
    Protocol::parse(&id).map(Arc::new).map_err(serde::de::Error::custom)
}

fn strategy<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Strategy>, D::Error> {
    let spec = Option::<String>::deserialize(deserializer)?;
    spec.map(|spec| spec.parse().map_err(serde::de::Error::custom)).transpose()
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
    if jobs.is_empty() {
        subjects_can_be_loaded(datasets, options)?;
        subjects_are_of_a_table(experiments, datasets, options)?;
    }
    let digest = Plan::digest_of(options, &tables, &jobs);
    Ok(Plan { options: options.clone(), tables, avatars, jobs, digest })
}

/// Collects avatars and jobs while the tables are walked.
struct Builder<'a> {
    datasets: &'a [Dataset],
    options: &'a Options,
    avatars: Vec<PlannedAvatar>,
    jobs: Vec<Job>,
}

impl Builder<'_> {
    /// One table; its jobs and avatars are added to the builder's.
    fn table(&mut self, index: usize, experiment: &Experiment) -> Result<PlannedTable, Error> {
        let (source, rows) = rows_of(experiment, self.datasets, self.options);
        let invalid = |(problem, expected)| Error::invalid(&experiment.id, "protocol", problem, expected);
        let protocol = Arc::new(catalog::protocol(experiment.protocol_on(source)).map_err(invalid)?);
        let wanted = &self.options.subset.variants;
        let variants: Vec<(usize, &Variant)> = (experiment.variants.iter().enumerate())
            .filter(|(_, variant)| wanted.is_empty() || wanted.iter().any(|id| variant.is_called(id)))
            .collect();
        let with_data = |(_, row): &(usize, &DataRow)| row.missing.is_none() && !variants.is_empty();
        for (row_index, row) in rows.iter().enumerate().filter(with_data) {
            let resolution = experiment.resolution_on(source, &self.options.profile);
            let prepared = variants
                .iter()
                .map(|&(v, variant)| self.prepare(experiment, v, variant, row, resolution))
                .collect::<Result<Vec<_>, _>>()?;
            self.add_jobs((index, row_index), row, experiment, (&protocol, resolution), &prepared);
        }
        let used = |dataset: &&Dataset| rows.iter().any(|row| row.dataset == dataset.id);
        let datasets = self
            .datasets
            .iter()
            .filter(used)
            .map(|d| (d.registered_id().to_owned(), d.title.clone()))
            .collect();
        let mut data_notes = self.data_notes(&rows);
        if experiment.columns.iter().any(|column| column.metric.needs_before()) {
            data_notes.extend(self.frames_apart(&rows));
        }
        if source != Source::Own {
            data_notes.extend(self.why_not_own(experiment));
        }
        if source == Source::Own
            && experiment.has_own_bodies()
            && rows.iter().all(|row| row.dataset == experiment.dataset)
        {
            let note = "on the subjects' own body templates, where the table asks for others";
            data_notes.push(format!("{}: {note}", experiment.dataset));
        }
        Ok(PlannedTable {
            data_notes,
            remarks: self.reduced_below_avatars(&variants, &rows).into_iter().collect(),
            experiment: experiment.id.clone(),
            source,
            datasets,
            rows,
            variants: variants.iter().map(|(_, variant)| variant.id.clone()).collect(),
            protocol: protocol.key(),
        })
    }

    /// Avatars from files that meet smaller images than the data has: they were fitted to other ones, and splats that are
    /// right for those are too small or too wide here.
    fn reduced_below_avatars(&self, variants: &[(usize, &Variant)], rows: &[DataRow]) -> Option<String> {
        let resolution = self.options.profile.resolution?;
        let from_file =
            |(_, variant): &(usize, &Variant)| matches!(variant.avatar, super::AvatarRecipe::File { .. });
        let larger = |row: &DataRow| {
            let images = self.subject(row).sequences.iter().filter_map(|sequence| sequence.image);
            images.flatten().any(|side| side > resolution)
        };
        let reduced = rows.iter().filter(|row| row.missing.is_none()).any(larger);
        (reduced && variants.iter().any(from_file)).then(|| {
            format!(
                "Avatars from files are drawn at no more than {resolution} pixels a side, below the size of the data: what was \
                 fitted at another size scores lower (--profile standard keeps the data's size)"
            )
        })
    }

    /// What keeps the subjects of an experiment's own data from being used, where some are there.
    fn why_not_own(&self, experiment: &Experiment) -> Vec<String> {
        let own = self.datasets.iter().find(|dataset| dataset.id == experiment.dataset);
        let problem = |broken: &Unreadable| format!("not on {}: {}", experiment.dataset, broken.problem);
        own.map_or_else(Vec::new, |own| own.unreadable.iter().map(problem).collect())
    }

    /// The notes of the subjects of some rows.
    fn data_notes(&self, rows: &[DataRow]) -> Vec<String> {
        let mut notes = Vec::new();
        for row in rows.iter().filter(|row| row.missing.is_none()) {
            let subject = self.subject(row);
            let note = format!("{}: {}", subject.id, subject.notes.join("; "));
            if !subject.notes.is_empty() && !notes.contains(&note) {
                notes.push(note);
            }
        }
        notes
    }

    /// Test sequences whose frames are not successive points in time, for columns that compare a frame with the one before.
    fn frames_apart(&self, rows: &[DataRow]) -> Vec<String> {
        let note = |row: &DataRow| {
            let steps = time_steps(find_sequence(self.subject(row), &row.sequence));
            let (least, most) = (steps.iter().min()?, steps.iter().max()?);
            let far = match least == most {
                true => format!("{most}"),
                false => format!("{least} to {most}"),
            };
            (*most > 1)
                .then(|| format!("{}: frames of {} are {far} time steps apart", row.subject, row.sequence))
        };
        rows.iter().filter(|row| row.missing.is_none()).filter_map(note).collect()
    }

    /// What a variant needs on a row, before any frame: its avatar and its strategy.
    fn prepare(
        &mut self,
        experiment: &Experiment,
        index: usize,
        variant: &Variant,
        row: &DataRow,
        resolution: Option<u32>,
    ) -> Result<Prepared, Error> {
        let invalid = |field: &str, (problem, expected): (String, String)| {
            Error::invalid(&experiment.id, format!("variants[{index}].{field}"), problem, expected)
        };
        let strategy = match &variant.strategy {
            None => None,
            Some(spec) => Some(catalog::strategy(spec).map_err(|why| invalid("strategy", why))?),
        };
        let noise = experiment.noise_of(variant);
        let avatar = self.avatar(variant, row, resolution, noise).map_err(|why| invalid("avatar", why))?;
        // Nothing moves the frames of another program, nor a mesh that asks for nothing.
        let fitted = experiment.fitted_test_poses().cloned();
        Ok(Prepared { variant: variant.id.clone(), avatar, strategy, noise, fitted })
    }

    /// The key of the variant's avatar for a row's subject; the avatar is noted if it is new.
    fn avatar(
        &mut self,
        variant: &Variant,
        row: &DataRow,
        resolution: Option<u32>,
        noise: Option<PoseNoise>,
    ) -> Result<String, (String, String)> {
        let (profile, subject) = (&self.options.profile, self.subject(row));
        let (takes, most_frames) = (variant.takes.unwrap_or(1), profile.max_train_frames);
        let planner = Planner { profile, resolution, subject, row, noise, takes, most_frames };
        let avatar = planner.avatar(variant)?;
        let key = avatar.key.clone();
        if self.avatars.iter().all(|known| known.key != key) {
            self.avatars.push(avatar);
        }
        Ok(key)
    }

    /// The jobs of a row, one per frame. `place` is the index of the table and of the row.
    fn add_jobs(
        &mut self,
        place: (usize, usize),
        row: &DataRow,
        experiment: &Experiment,
        (protocol, resolution): (&Arc<Protocol>, Option<u32>),
        variants: &[Prepared],
    ) {
        let test = find_sequence(self.subject(row), &row.sequence).clone();
        let metrics = metrics_of(experiment);
        let lpips = metrics.contains(&MetricId::LPIPS);
        let weights = self.options.lpips_weights.as_ref().filter(|given| given.net == protocol.lpips.net);
        // Which frame comes before which: nothing else depends on the points in time.
        let times: Option<Vec<usize>> = metrics
            .iter()
            .any(|metric| metric.needs_before())
            .then(|| test.frames.iter().map(|frame| frame.time).collect());
        let times = times.map(|times| content_key(&json!({ "times": times })));
        let choices = Protocol { title: String::new(), source: String::new(), ..Protocol::clone(protocol) };
        for &frame in &row.frames {
            let variants = variants.iter().map(|prepared| {
                let mut content = json!({
                    "code": CodeVersions::CURRENT, "test": test.digest, "frame": frame,
                    "avatar": prepared.avatar, "strategy": prepared.strategy, "protocol": choices,
                    "antialiased": experiment.antialiased, "resolution": resolution,
                    "metrics": metrics, "lpips_weights": weights.filter(|_| lpips),
                });
                if let Some(noise) = &prepared.noise {
                    content["pose_noise"] = json!(noise);
                }
                if let Some(times) = &times {
                    content["times"] = json!(times);
                }
                if let Some(fitted) = &prepared.fitted {
                    content["fitted"] = json!(fitted);
                }
                JobVariant {
                    noise: prepared.noise,
                    fitted: prepared.fitted.clone(),
                    id: prepared.variant.clone(),
                    key: content_key(&json!({ "frame": content })),
                    avatar: prepared.avatar.clone(),
                    strategy: prepared.strategy,
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
                protocol: protocol.clone(),
                resolution,
                antialiased: experiment.antialiased,
                metrics: metrics.clone(),
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
    /// Id.
    variant: String,
    /// Key of the avatar.
    avatar: String,
    /// The strategy in full, so that two specs of one strategy share their keys.
    strategy: Option<Strategy>,
    /// Noise on its poses.
    noise: Option<PoseNoise>,
    /// How poses of test images are fitted.
    fitted: Option<PoseFit>,
}

/// What is computed of every frame: PSNR and the number of Gaussians, which cost nothing, and what the columns show.
fn metrics_of(experiment: &Experiment) -> Vec<MetricId> {
    let shown = experiment.columns.iter().map(|column| column.metric);
    let all: BTreeSet<MetricId> = shown.chain([MetricId::PSNR, MetricId::SPLATS]).collect();
    all.into_iter().collect()
}

/// From each point in time of a sequence to the next.
fn time_steps(sequence: &SequenceInfo) -> Vec<usize> {
    let times: BTreeSet<usize> = sequence.frames.iter().map(|frame| frame.time).collect();
    times.iter().zip(times.iter().skip(1)).map(|(time, next)| next - time).collect()
}

/// The sequence of this id, which rows take from their subject.
pub(super) fn find_sequence<'a>(subject: &'a SubjectInfo, id: &str) -> &'a SequenceInfo {
    subject.sequences.iter().find(|sequence| sequence.id == id).expect("rows name sequences of their subject")
}
