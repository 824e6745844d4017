//! `reproduce run`: the main job.

use super::output::{apart, beside_run, emit, written};
use super::page::{Images, PICTURES, page, write_page};
use super::planning::{Planned, Planning};
use super::products::{
    AVATARS, JSON, MARKDOWN, Printed, kept_in, make_folder, printed, verdict, write_bend, write_curves,
    write_results, write_text,
};
use super::selection::read_json;
use super::{Context, Exit, progress::Watch};
use anyhow::{Context as _, Result};
use skinsplat::experiment::{Job, Records, Shard, Unreadable};
use skinsplat::report::html::BOUND;
use skinsplat::report::{self, Results, TableResults};
use skinsplat::run::motion::{self, Motion};
use skinsplat::run::pictures;
use skinsplat::run::plan_file::{LeftOut, PlanFile};
use skinsplat::run::provenance::{Phases, Provenance, Stopwatch};
use skinsplat::run::store::{self, FILE_NAME, Store};
use skinsplat::run::{self, Machine};
use skinsplat::run::{cache, costs, gallery};
use skinsplat_data::atomic;
use std::path::PathBuf;
use std::time::Instant;

/// Where a run goes unless told otherwise.
pub(super) const DEFAULT_OUT: &str = "runs/default";

/// Evaluate: make avatars, pose, render, score, and write the tables.
///
/// Writes tables.md, one .csv and .tex per table, results.json (see reports/SCHEMA.md), curves.csv and curves/ (how the fits
/// went) and run.json (who, when, how fast). frames.jsonl remembers every frame by its content: a run that is killed goes on
/// where it stopped, and a run with other settings redoes only what they change. Slices (--shard) write results of their own,
/// which `reproduce merge` collects.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Run {
    #[command(flatten)]
    planning: Planning,
    /// Folder to write to
    #[arg(long, value_name = "DIR", default_value = DEFAULT_OUT)]
    out: PathBuf,
    /// Only this slice of the work, counted from 1: slices cost about the same, and what is drawn with one avatar stays together
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Also write images/: where the variants differ most, truth and variants side by side with their errors; and pictures/: single
    /// pictures of those frames (key), or of every frame (all), for pages and comparisons [default with --html: key]
    #[arg(long, value_name = "WHICH", num_args = 0..=1, default_missing_value = "key", conflicts_with = "shard")]
    images: Option<Images>,
    /// Also write the results as one page for a browser, with pictures to compare: below 15 MB. A few frames are drawn again, for
    /// times with repeats (costs.json)
    #[arg(long, value_name = "FILE", conflicts_with = "shard")]
    html: Option<PathBuf>,
    /// Also write motion/: the avatars of every variant under a motion (smplx, AMASS or AIST++ .npz or .pkl, transforms.json,
    /// .glb or .gltf), as motion/TABLE/SUBJECT/VARIANT/frame_0000.png. Each keeps its shape, starts where the first test frame
    /// of its row has it, and is seen by that frame's camera. Nothing is scored: no true images exist
    #[arg(long, value_name = "POSES", conflicts_with = "shard")]
    motion: Option<PathBuf>,
    /// Clip of a glTF file with several
    #[arg(long, value_name = "NAME", requires = "motion")]
    motion_clip: Option<String>,
    /// Draw only every N-th pose of the motion
    #[arg(long, value_name = "N", requires = "motion", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    motion_every: u32,
    /// What stays in the folder's avatars/ once every score is there: all, for pictures, motions and runs with other variants; or
    /// none but the reports of fits, for small folders
    #[arg(long, value_enum, value_name = "WHICH", default_value_t, conflicts_with = "shard")]
    keep: KeepAvatars,
    #[command(flatten)]
    printed: Printed,
    /// Forget what the folder's results store knows
    #[arg(long, conflicts_with = "shard")]
    fresh: bool,
}

/// Which avatars stay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
enum KeepAvatars {
    /// All that were made
    #[default]
    All,
    /// None
    None,
}

const EXAMPLES: &str = "\
Examples:
  reproduce run                                  all six tables on built-in data
  reproduce run table3 --all-strategies          one table, a row per strategy
  reproduce run --data DIR --profile standard    all tables on the subjects of a folder
  reproduce run my.toml --out runs/mine          a table of your own
  reproduce run table3 --motion dance.npz        Table 3, and its avatars dancing
  reproduce run table1 --html table1.html        Table 1 as a page with pictures";

impl Run {
    /// The options that only a run without slices can have, and whether they were given.
    pub(super) fn whole_run_options(&self) -> [(&'static str, bool); 6] {
        [
            ("--out", self.out.as_os_str() != DEFAULT_OUT),
            ("--shard", self.shard.is_some()),
            ("--images", self.images.is_some()),
            ("--html", self.html.is_some()),
            ("--motion", self.motion.is_some()),
            ("--fresh", self.fresh),
        ]
    }

    /// What is planned.
    pub(super) fn planning(&self) -> &Planning {
        &self.planning
    }

    /// How to go on after the run was stopped.
    pub(super) fn advice(&self) -> String {
        kept_in(&self.out)
    }

    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        let start = Instant::now();
        if let Some(path) = &self.html {
            beside_run(path, &self.out)?;
            apart(path, self.planning.files())?;
        }
        let mut planned = self.planning.plan()?;
        planned.left_over().into_iter().for_each(|note| context.note(note));
        let motion = self.motion(&mut planned, context)?;
        let mut provenance = Provenance::starting(&planned.plan);
        let stopwatch = Stopwatch::after_planning(start.elapsed().as_secs_f64());
        make_folder(&self.out)?;
        [self.out.clone(), self.out.join(AVATARS)].iter().for_each(|folder| atomic::sweep(folder));
        if self.fresh {
            for path in store::stores(&self.out)? {
                std::fs::remove_file(&path).with_context(|| format!("{}: cannot remove", path.display()))?;
            }
        }
        let (rendered, results) = self.execute(&planned, &stopwatch, context)?;
        provenance.frames_rendered = rendered;
        provenance.phases = stopwatch.phases();
        if let Some(earlier) = self.earlier_phases(&provenance.plan) {
            provenance.phases.or_those_of(&earlier);
        }
        provenance.frames_planned = planned.plan.jobs.len();
        provenance.seconds = start.elapsed().as_secs_f64();
        let said = serde_json::to_string_pretty(&provenance)? + "\n";
        write_text(&self.out.join(self.provenance_name()), &said)?;
        match results {
            Some(results) => self.write(&planned, &results, motion.as_ref(), context, provenance.seconds),
            None => self.verdict_of_shard(&planned, context),
        }
    }

    /// Renders what is left to do, table by table, and prints each as soon as it is done; a slice prints none. Says how many
    /// frames were rendered.
    fn execute(
        &self,
        planned: &Planned,
        stopwatch: &Stopwatch,
        context: Context,
    ) -> Result<(usize, Option<Results>)> {
        let Planned { plan, library, networks, experiments, .. } = planned;
        let left = store::outstanding(&plan.shard(self.shard), &self.records()?);
        run::check(&left, library)?;
        let path = self.out.join(self.store_name());
        let mut store = Store::open(&path, &plan.digest, &Machine::here())?;
        if self.shard.is_some() {
            PlanFile::new(plan, experiments, left_out(planned)).write(&self.out)?;
        } else if self.printed.format == MARKDOWN {
            emit(&report::head(&report::results(plan, experiments, &Records::default())?))?;
        }
        let avatars = self.out.join(AVATARS);
        let mut tables = Vec::new();
        for (index, table) in plan.tables.iter().enumerate() {
            let jobs: Vec<Job> = left.iter().filter(|job| job.table == index).cloned().collect();
            let watch = Watch::of(&table.experiment, context.quiet);
            run::execute(plan, &jobs, library, networks, &avatars, &mut store, &|event| {
                stopwatch.see(&event);
                watch.see(event);
            })?;
            drop(watch);
            if self.shard.is_none() {
                let records = self.records()?;
                tables.push(report::table_results(plan, index, experiments, &records)?);
                self.print(&tables[index])?;
                // A run that ends here can be reported on: the tables to come with what is known of them.
                if index + 1 < plan.tables.len() {
                    let to_come = (index + 1..plan.tables.len())
                        .map(|index| report::table_results(plan, index, experiments, &records));
                    let all: Vec<_> =
                        tables.iter().cloned().map(Ok).chain(to_come).collect::<Result<_, _>>()?;
                    write_results(&self.out, &report::results_of(plan, all))?;
                }
            }
        }
        Ok((left.len(), self.shard.is_none().then(|| report::results_of(plan, tables))))
    }

    /// Prints a table that is done, but as a part of the one document that JSON is.
    fn print(&self, results: &TableResults) -> Result<()> {
        match self.printed.format.as_str() {
            MARKDOWN => emit(&format!("\n{}", report::markdown(results))),
            JSON => Ok(()),
            format => emit(&written(&results.table, format)),
        }
    }

    /// What is known of the folder's frames.
    fn records(&self) -> Result<Records> {
        Ok(store::merge(store::stores(&self.out)?.iter().map(PathBuf::as_path))?)
    }

    /// Whether every frame of the slice has a score.
    fn verdict_of_shard(&self, Planned { plan, .. }: &Planned, context: Context) -> Result<Exit> {
        let left = store::outstanding(&plan.shard(self.shard), &self.records()?);
        let missing: usize = left.iter().map(|job| job.variants.len()).sum();
        if missing == 0 {
            return Ok(Exit::Success);
        }
        let store = self.out.join(self.store_name());
        context.note(format!("{missing} scores of this slice are missing; {} says why", store.display()));
        Ok(Exit::Incomplete)
    }

    /// Where the time of the call before went, if it was of the same plan.
    fn earlier_phases(&self, plan: &str) -> Option<Phases> {
        #[derive(serde::Deserialize)]
        struct Earlier {
            plan: String,
            phases: Phases,
        }
        // What cannot be read, of an older program or cut short, is about to be replaced.
        let earlier: Earlier = read_json(&self.out.join(self.provenance_name())).ok()?;
        (earlier.plan == plan).then_some(earlier.phases)
    }

    /// Name of the store that this call appends to.
    fn store_name(&self) -> String {
        self.shard.map_or_else(|| FILE_NAME.to_owned(), Shard::file_name)
    }

    /// Name of the file that says who computed.
    fn provenance_name(&self) -> String {
        self.shard.map_or_else(|| "run.json".to_owned(), Shard::provenance_name)
    }

    /// The files of the tables, and what goes with them.
    fn write(
        &self,
        planned: &Planned,
        results: &Results,
        motion: Option<&Motion>,
        context: Context,
        seconds: f64,
    ) -> Result<Exit> {
        let records = self.records()?;
        write_results(&self.out, results)?;
        write_curves(&self.out, &planned.plan, &planned.experiments, std::slice::from_ref(&self.out))?;
        write_bend(&self.out, results)?;
        if self.images.is_some_and(|which| which != Images::None) {
            self.write_images(planned, &records, context)?;
        }
        self.write_page(planned, &records, results, context)?;
        if let Some(motion) = motion {
            self.write_motion(planned, motion, context)?;
        }
        match self.printed.format.as_str() {
            MARKDOWN => emit(&report::incomplete(results))?,
            JSON => emit(&printed(results, JSON))?,
            _ => {}
        }
        let out = self.out.display();
        context.note(format!("{out}: tables.md, results.json and more, in {seconds:.1} s"));
        let missing = results.missing();
        if missing > 0 {
            context.note(format!("{missing} scores are missing; {out}/{FILE_NAME} says why"));
        }
        let exit = verdict(&planned.plan, missing, &left_out(planned), context);
        if self.keep == KeepAvatars::None && exit == Exit::Success {
            let made = planned.plan.avatars.iter().map(|avatar| avatar.key.as_str());
            let starts = planned.plan.avatars.iter().filter_map(|avatar| avatar.start());
            cache::remove_entries(&self.out.join(AVATARS), made.chain(starts))?;
        }
        Ok(exit)
    }
}

impl Run {
    /// The motion that the arguments name, with a word in the captions.
    fn motion(&self, planned: &mut Planned, context: Context) -> Result<Option<Motion>> {
        let Some(path) = &self.motion else { return Ok(None) };
        let motion = Motion::load(path, self.motion_clip.as_deref(), self.motion_every as usize)?;
        for note in motion.announce(&mut planned.plan, &planned.library)? {
            context.note(note);
        }
        Ok(Some(motion))
    }

    /// The pictures that the page shows, and the page.
    fn write_page(
        &self,
        Planned { plan, library, .. }: &Planned,
        records: &Records,
        results: &Results,
        context: Context,
    ) -> Result<()> {
        let images = self.images.unwrap_or(if self.html.is_some() { Images::Key } else { Images::None });
        if images != Images::None {
            let watch = Watch::of("pictures", context.quiet);
            let (avatars, folder) = (self.out.join(AVATARS), self.out.join(PICTURES));
            pictures::write(plan, library, records, images.keep(), &avatars, &folder, &|event| {
                watch.see(event)
            })?;
        }
        let Some(path) = &self.html else { return Ok(()) };
        let watch = Watch::new(context.quiet);
        let costs = costs::measure(plan, library, &self.out.join(AVATARS), &|event| watch.see(event))?;
        drop(watch);
        write_text(&self.out.join(costs::FILE_NAME), &(serde_json::to_string_pretty(&costs)? + "\n"))?;
        write_page(path, &page(results, &self.out, images, BOUND, context)?, BOUND, context)
    }

    fn write_motion(
        &self,
        Planned { plan, library, .. }: &Planned,
        motion: &Motion,
        context: Context,
    ) -> Result<()> {
        let watch = Watch::of("motion", context.quiet);
        let (avatars, folder) = (self.out.join(AVATARS), self.out.join("motion"));
        Ok(motion::write(plan, library, motion, &avatars, &folder, &|event| watch.see(event))?)
    }

    fn write_images(
        &self,
        Planned { plan, library, .. }: &Planned,
        records: &Records,
        context: Context,
    ) -> Result<()> {
        let watch = Watch::of("images", context.quiet);
        let folder = self.out.join("images");
        let avatars = self.out.join(AVATARS);
        let page = gallery::write(plan, library, records, &avatars, &folder, &|event| watch.see(event))?;
        write_text(&folder.join("README.md"), &page)
    }
}

/// Subjects that could not be used.
fn left_out(planned: &Planned) -> Vec<LeftOut> {
    let of = |(dataset, subject): (&str, &Unreadable)| LeftOut {
        dataset: dataset.to_owned(),
        subject: subject.clone(),
    };
    planned.library.unreadable().map(of).collect()
}
