//! Which experiments, on how much of the data: the arguments of `run` and `plan`.

use super::data::Data;
use super::lpips::LpipsWeights;
use super::selection::name_and_path;
use anyhow::{Result, bail};
use clap::builder::{OsStringValueParser, TypedValueParser};
use skinsplat::experiment::{
    self, AvatarRecipe, AvatarSource, Experiment, GIVEN_AVATAR, GivenWeights, Options, Plan, PlannedAvatar,
    Profile, Subset, Variant,
};
use skinsplat::run::{Library, RegisteredAvatar};
use skinsplat_core::choice::one_of;
use skinsplat_metrics::lpips::weights::Networks;
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// What to plan.
#[derive(Debug, clap::Args)]
pub(super) struct Planning {
    /// Experiments: ids (see `reproduce list experiments`) or .toml files [default: the six tables]
    #[arg(value_name = "EXPERIMENT")]
    experiments: Vec<OsString>,
    /// How much of the data to look at: quick (256 pixels, few frames, short fits), standard (everything), paper (long fits)
    #[arg(long, value_name = "P", default_value = "quick", value_parser = profile)]
    profile: Profile,
    /// Most iterations of a fit [default: the profile's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    fit_iterations: Option<u32>,
    /// Avatars that are made here start with edges of at most so many millimetres: more Gaussians where it is smaller [default:
    /// the profile's]
    #[arg(long, value_name = "MM", value_parser = clap::value_parser!(u32).range(1..=1000))]
    avatar_edge: Option<u32>,
    /// Repeat every fit with these seeds (such as 0,1,2), and print means and spreads
    #[arg(long, value_name = "S,…", value_delimiter = ',')]
    seeds: Vec<u64>,
    /// Add a row for every strategy
    #[arg(long)]
    all_strategies: bool,
    /// Take a variant's avatar from FILE, in which {subject} stands for the id of each subject (may be repeated)
    #[arg(long = "avatar", value_name = "VARIANT=FILE", value_parser = given_avatar())]
    avatars: Vec<GivenAvatar>,
    /// Take a variant's frames from FOLDER, rendered by any program and named as the test frames; {subject} and {sequence}
    /// stand for their ids (may be repeated)
    #[arg(long, value_name = "VARIANT=FOLDER", value_parser = given_avatar())]
    renders: Vec<GivenAvatar>,
    /// Only test frames START <= index < END of each sequence
    #[arg(long, value_name = "START..END", value_parser = range, help_heading = "Subset")]
    frames: Option<Range>,
    /// At most N test frames per sequence
    #[arg(long, value_name = "N", help_heading = "Subset", value_parser = clap::value_parser!(u32).range(1..))]
    limit: Option<u32>,
    /// Only this subject (may be repeated)
    #[arg(long = "subject", value_name = "ID", help_heading = "Subset")]
    subjects: Vec<String>,
    /// Only this variant (may be repeated)
    #[arg(long = "variant", value_name = "ID", help_heading = "Subset")]
    variants: Vec<String>,
    #[command(flatten)]
    lpips: LpipsWeights,
    #[command(flatten)]
    data: Data,
}

/// A file or folder that replaces the avatar of a variant.
#[derive(Clone, Debug)]
struct GivenAvatar {
    variant: String,
    file: PathBuf,
}

#[derive(Clone, Copy, Debug)]
struct Range([usize; 2]);

/// A plan and all that it was made from.
pub(super) struct Planned {
    pub(super) plan: Plan,
    pub(super) experiments: Vec<Experiment>,
    pub(super) library: Library,
    pub(super) networks: Networks,
}

impl Planned {
    /// What lies in folders of renders and takes no part.
    pub(super) fn left_over(&self) -> BTreeSet<String> {
        let said = |avatar: &PlannedAvatar| match &avatar.source {
            AvatarSource::Renders(renders) => {
                let others = renders.left_over.as_ref()?;
                Some(format!("{}: {others} of {}", renders.folder.display(), renders.sequence))
            }
            _ => None,
        };
        self.plan.avatars.iter().filter_map(said).collect()
    }
}

impl Planning {
    /// Loads experiments and data, and plans.
    pub(super) fn plan(&self) -> Result<Planned> {
        let experiments = self.with_given_avatars(self.experiments()?)?;
        match self.plan_on(experiments.clone(), &self.subjects) {
            // What is wrong with a choice of subjects is told with all that there are.
            Err(_) if !self.subjects.is_empty() => self.plan_on(experiments, &[]),
            planned => planned,
        }
    }

    /// Plans; figures that are not `asked` for are not generated.
    fn plan_on(&self, experiments: Vec<Experiment>, asked: &[String]) -> Result<Planned> {
        let mut library = self.data.library(&experiments, asked)?;
        for GivenAvatar { variant, file } in &self.avatars {
            library.register(&RegisteredAvatar { name: given_name(variant), path: file.clone() });
        }
        let subset = Subset {
            frames: self.frames.map(|Range(range)| range),
            limit: self.limit.map(|limit| limit as usize),
            subjects: self.subjects.clone(),
            variants: self.variants.clone(),
        };
        let networks = self.lpips.networks()?;
        let given = |(net, digest): (_, &str)| GivenWeights { net, digest: digest.to_owned() };
        let lpips_weights = networks.given().map(given);
        let options = Options { profile: self.profile(), subset, lpips_weights, seeds: self.seeds.clone() };
        let described = library.describe()?;
        renders_were_found(&described, &self.subjects)?;
        let plan = experiment::plan(&experiments, &described, &options)?;
        Ok(Planned { plan, experiments, library, networks })
    }

    /// The experiments with the avatars and renders that the arguments name.
    fn with_given_avatars(&self, mut experiments: Vec<Experiment>) -> Result<Vec<Experiment>> {
        for GivenAvatar { variant: id, file } in &self.avatars {
            let argument = format!("--avatar {id}={}", file.display());
            for variant in named(&mut experiments, id, &argument)? {
                if variant.strategy.is_none() {
                    bail!(
                        "{argument}: a textured mesh without a strategy; expected a variant that poses Gaussians"
                    );
                }
                variant.avatar = AvatarRecipe::File { name: given_name(id), otherwise: None };
                variant.sh_degree = None;
            }
        }
        for GivenAvatar { variant: id, file } in &self.renders {
            let argument = format!("--renders {id}={}", file.display());
            for variant in named(&mut experiments, id, &argument)? {
                variant.avatar = AvatarRecipe::Renders { path: file.clone() };
                (variant.sh_degree, variant.strategy) = (None, None);
            }
        }
        if !self.avatars.is_empty() || !self.renders.is_empty() {
            let note = "Files and folders that were given stand in the place of fits: what is said here of fits, budgets and starts \
                        does not hold for them.";
            experiments.iter_mut().for_each(|experiment| experiment.notes.push(note.to_owned()));
        }
        Ok(experiments)
    }

    /// The experiments that are files.
    pub(super) fn files(&self) -> impl Iterator<Item = &Path> + Clone {
        self.experiments.iter().map(Path::new).filter(|path| path.is_file())
    }

    fn profile(&self) -> Profile {
        let fit_iterations = self.fit_iterations.or(self.profile.fit_iterations);
        let avatar_edge_mm = self.avatar_edge.unwrap_or(self.profile.avatar_edge_mm);
        Profile { fit_iterations, avatar_edge_mm, ..self.profile.clone() }
    }

    /// The experiments that the arguments name.
    pub(super) fn experiments(&self) -> Result<Vec<Experiment>> {
        let known = known_experiments()?;
        let built_in = Experiment::embedded_all();
        let mut chosen = Vec::new();
        for name in &self.experiments {
            if Path::new(name).extension().is_some_and(|e| e == "toml") {
                chosen.push(Experiment::load(Path::new(name))?);
                continue;
            }
            let Some(experiment) = known.iter().chain(&built_in).find(|e| *name == *e.id) else {
                let ids: Vec<&str> = known.iter().map(|e| e.id.as_str()).collect();
                let name = name.to_string_lossy();
                bail!("experiment `{name}`; expected a .toml file or {}", one_of(&name, &ids));
            };
            chosen.push(experiment.clone());
        }
        let chosen = if chosen.is_empty() { Experiment::embedded() } else { chosen };
        let extend = self.all_strategies;
        let chosen =
            if extend { chosen.iter().map(Experiment::with_all_strategies).collect() } else { chosen };
        Ok(chosen.into_iter().map(|e| e.with_seeds(&self.seeds)).collect::<Result<_, _>>()?)
    }
}

/// A folder in which no frame of any sequence (of the subjects asked for; all if none is) was found is a mistake; gaps are
/// named by the tables.
fn renders_were_found(datasets: &[experiment::Dataset], asked: &[String]) -> Result<()> {
    // One subject may be there on several bodies: the same frames.
    let frames = |renders: &experiment::RenderedFrames| (renders.folder.clone(), renders.sequence.clone());
    let mut seen = BTreeSet::new();
    let all: Vec<_> = (datasets.iter().flat_map(|d| d.subjects.iter().map(move |s| (d.registered_id(), s))))
        .flat_map(|(id, subject)| subject.renders.iter().map(move |renders| (id, subject, renders)))
        .filter(|(_, subject, _)| asked.is_empty() || asked.contains(&subject.id))
        .filter(|(id, subject, renders)| seen.insert((*id, &subject.id, frames(renders))))
        .map(|(.., renders)| renders)
        .collect();
    let all = || all.iter().copied();
    for renders in all() {
        if all().filter(|own| own.path == renders.path).all(|own| own.frames.is_empty()) {
            let expected = "images named as the test frames, such as image_0001.png";
            bail!("{}: no render of {}; expected {expected}", renders.folder.display(), renders.sequence);
        }
        let shared =
            |own: &&experiment::RenderedFrames| own.folder == renders.folder && !own.frames.is_empty();
        if !renders.frames.is_empty() && all().filter(shared).count() > 1 {
            let expected = "{subject} or {sequence} in the path, so that each has its own";
            bail!("{}: the renders of several sequences; expected {expected}", renders.folder.display());
        }
    }
    Ok(())
}

/// The variants of an id, which an argument names.
fn named<'e>(experiments: &'e mut [Experiment], id: &str, argument: &str) -> Result<Vec<&'e mut Variant>> {
    let all = experiments.iter_mut().flat_map(|experiment| &mut experiment.variants);
    let (named, others): (Vec<&mut Variant>, Vec<_>) = all.partition(|variant| variant.id == id);
    if named.is_empty() {
        let known: BTreeSet<&str> = others.iter().map(|variant| variant.id.as_str()).collect();
        let known: Vec<&str> = known.into_iter().collect();
        bail!("{argument}: no variant `{id}`; expected {}", one_of(id, &known));
    }
    Ok(named)
}

/// The experiments of `experiments/` in this folder, if there is one; else those that are built in, which can be named in any
/// case.
pub(super) fn known_experiments() -> Result<Vec<Experiment>> {
    let folder = PathBuf::from("experiments");
    Ok(if folder.is_dir() { Experiment::load_folder(&folder)? } else { Experiment::embedded_all() })
}

pub(super) fn profile(id: &str) -> Result<Profile, String> {
    Profile::preset(id).ok_or_else(|| format!("expected {}", one_of(id, &Profile::IDS)))
}

fn given_avatar() -> impl TypedValueParser<Value = GivenAvatar> {
    let expected = "expected VARIANT=FILE, such as original=avatars/{subject}.ply";
    OsStringValueParser::new().try_map(move |text| {
        let (variant, file) = name_and_path(&text).ok_or(expected)?;
        Ok::<_, &str>(GivenAvatar { variant, file })
    })
}

/// The name under which the avatar is registered that an argument gives to a variant: no data set has it.
fn given_name(variant: &str) -> String {
    format!("{GIVEN_AVATAR}{variant}")
}

fn range(text: &str) -> Result<Range, String> {
    let ends = text.split_once("..").and_then(|(a, b)| Some([a.parse().ok()?, b.parse().ok()?]));
    match ends {
        Some([start, end]) if start < end => Ok(Range([start, end])),
        _ => Err("expected START..END with START < END, such as 0..10".to_owned()),
    }
}
