//! `reproduce run`: the main job.

use super::output::emit;
use super::page::{Images, PICTURES, page, write_page};
use super::planning::{Planned, Planning};
use super::{Context, Exit, progress::Watch};
use anyhow::{Context as _, Result};
use skinsplat::experiment::{Records, Shard, Unreadable};
use skinsplat::report;
use skinsplat::run::gallery;
use skinsplat::run::motion::{self, Motion};
use skinsplat::run::pictures;
use skinsplat::run::provenance::{Provenance, Stopwatch};
use skinsplat::run::store::{self, FILE_NAME, Store};
use skinsplat::run::{self, Error};
use skinsplat_data::atomic;
use skinsplat_table::Format;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Where a run goes unless told otherwise.
pub(super) const DEFAULT_OUT: &str = "runs/default";

/// Evaluate: make avatars, pose, render, score, and write the tables.
///
/// Writes tables.md, one .csv and .tex per table, results.json (see reports/SCHEMA.md), curves.csv and curves/ (how the fits
/// went) and run.json (who, when, how fast). frames.jsonl remembers every frame by its content: a run that is killed goes on
/// where it stopped, and a run with other settings redoes only what they change. Slices (--shard) write results of their own;
/// when all are done, run again without --shard to collect them.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Run {
    #[command(flatten)]
    planning: Planning,
    /// Folder to write to
    #[arg(long, value_name = "DIR", default_value = DEFAULT_OUT)]
    out: PathBuf,
    /// Only this slice of the frames, counted from 1
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Also write images/: where the variants differ most, truth and variants side by side with their errors; and pictures/: single
    /// pictures of those frames (key), or of every frame (all), for pages and comparisons [default with --html: key]
    #[arg(long, value_name = "WHICH", num_args = 0..=1, default_missing_value = "key", conflicts_with = "shard")]
    images: Option<Images>,
    /// Also write the results as one page for a browser, with pictures to compare: below 15 MB
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
    /// Forget what the folder's results store knows
    #[arg(long, conflicts_with = "shard")]
    fresh: bool,
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
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        let start = Instant::now();
        let mut planned = self.planning.plan()?;
        let motion = self.motion(&mut planned, context)?;
        let mut provenance = Provenance::starting(&planned.plan);
        let stopwatch = Stopwatch::after_planning(start.elapsed().as_secs_f64());
        make_folder(&self.out)?;
        [self.out.clone(), self.out.join(AVATARS)].iter().for_each(|folder| atomic::sweep(folder));
        if self.fresh {
            for path in stores(&self.out)? {
                std::fs::remove_file(&path).with_context(|| format!("{}: cannot remove", path.display()))?;
            }
        }
        provenance.frames_rendered = self.execute(&planned, &stopwatch, context)?;
        provenance.phases = stopwatch.phases();
        provenance.frames_planned = planned.plan.jobs.len();
        provenance.seconds = start.elapsed().as_secs_f64();
        if self.shard.is_some() {
            return self.verdict_of_shard(&planned, context);
        }
        self.write(&planned, motion.as_ref(), &provenance, context)
    }

    /// Renders what is left to do; says how many frames that were.
    fn execute(&self, planned: &Planned, stopwatch: &Stopwatch, context: Context) -> Result<usize> {
        let Planned { plan, library, networks, .. } = planned;
        let known = store::merge(stores(&self.out)?.iter().map(PathBuf::as_path))?;
        let left = store::outstanding(plan.shard(self.shard), &known);
        let mut store = Store::open(&self.out.join(self.store_name()), &plan.digest)?;
        let watch = Watch::new(context.quiet);
        let avatars = self.out.join(AVATARS);
        run::execute(plan, &left, library, networks, &avatars, &mut store, &|event| {
            stopwatch.see(&event);
            watch.see(event);
        })?;
        Ok(left.len())
    }

    /// Whether every frame of the slice has a score.
    fn verdict_of_shard(&self, Planned { plan, .. }: &Planned, context: Context) -> Result<Exit> {
        let known = store::merge(stores(&self.out)?.iter().map(PathBuf::as_path))?;
        let left = store::outstanding(plan.shard(self.shard), &known);
        let missing: usize = left.iter().map(|job| job.variants.len()).sum();
        if missing == 0 {
            return Ok(Exit::Success);
        }
        let store = self.out.join(self.store_name());
        context.note(format!("{missing} scores of this slice are missing; {} says why", store.display()));
        Ok(Exit::Incomplete)
    }

    /// Name of the store that this call appends to.
    fn store_name(&self) -> String {
        self.shard.map_or_else(|| FILE_NAME.to_owned(), Shard::file_name)
    }

    /// The tables, from every record in the folder.
    fn write(
        &self,
        planned: &Planned,
        motion: Option<&Motion>,
        provenance: &Provenance,
        context: Context,
    ) -> Result<Exit> {
        let records: Records = store::merge(stores(&self.out)?.iter().map(PathBuf::as_path))?;
        let results = report::results(&planned.plan, &planned.experiments, &records)?;
        write_results(&self.out, &results)?;
        self.write_curves(planned)?;
        self.write_bend(&results)?;
        write_text(&self.out.join("run.json"), &(serde_json::to_string_pretty(provenance)? + "\n"))?;
        if self.images.is_some_and(|which| which != Images::None) {
            self.write_images(planned, &records, context)?;
        }
        self.write_page(planned, &records, &results, context)?;
        if let Some(motion) = motion {
            self.write_motion(planned, motion, context)?;
        }
        emit(&report::page(&results))?;
        let out = self.out.display();
        context.note(format!("{out}: tables.md, results.json and more, in {:.1} s", provenance.seconds));
        let missing = results.missing();
        if missing > 0 {
            context.note(format!("{missing} scores are missing; {out}/{FILE_NAME} says why"));
            return Ok(Exit::Incomplete);
        }
        // Those that nobody asked for are missed by nobody.
        let asked = &planned.plan.options.subset.subjects;
        let unreadable = planned.library.unreadable();
        let mut unreadable =
            unreadable.filter(|(_, own)| asked.is_empty() || asked.contains(&own.subject)).peekable();
        if unreadable.peek().is_some() {
            for (dataset, Unreadable { subject, problem }) in unreadable {
                context.note(format!("{dataset}/{subject}: left out: {problem}"));
            }
            return Ok(Exit::Incomplete);
        }
        if planned.plan.jobs.is_empty() {
            context.note("no frame was selected: none of the experiments has data here");
            return Ok(Exit::Incomplete);
        }
        Ok(Exit::Success)
    }
}

impl Run {
    /// How the fits went, if there were any.
    fn write_curves(&self, Planned { plan, experiments, .. }: &Planned) -> Result<()> {
        let curves = run::curves::curves(plan, &self.out.join(AVATARS))?;
        if curves.is_empty() {
            return Ok(());
        }
        write_text(&self.out.join("curves.csv"), &report::curves_csv(&curves))?;
        let folder = self.out.join("curves");
        make_folder(&folder)?;
        for (name, svg) in report::curve_plots(&curves, experiments)? {
            write_text(&folder.join(format!("{name}.svg")), &svg)?;
        }
        Ok(())
    }

    /// Differences by how far the body is bent, if a table asks for them.
    fn write_bend(&self, results: &report::Results) -> Result<()> {
        let Some(lines) = report::bend_csv(results) else { return Ok(()) };
        write_text(&self.out.join("bend.csv"), &lines)?;
        for (table, svg) in report::bend_plots(results)? {
            write_text(&self.out.join(format!("{table}-bend.svg")), &svg)?;
        }
        Ok(())
    }

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
        results: &report::Results,
        context: Context,
    ) -> Result<()> {
        let images = self.images.unwrap_or(if self.html.is_some() { Images::Key } else { Images::None });
        if images != Images::None {
            let watch = Watch::new(context.quiet);
            let (avatars, folder) = (self.out.join(AVATARS), self.out.join(PICTURES));
            pictures::write(plan, library, records, images.keep(), &avatars, &folder, &|event| {
                watch.see(event)
            })?;
        }
        match &self.html {
            Some(path) => write_page(path, &page(results, &self.out, images)?, context),
            None => Ok(()),
        }
    }

    fn write_motion(
        &self,
        Planned { plan, library, .. }: &Planned,
        motion: &Motion,
        context: Context,
    ) -> Result<()> {
        let watch = Watch::new(context.quiet);
        let (avatars, folder) = (self.out.join(AVATARS), self.out.join("motion"));
        Ok(motion::write(plan, library, motion, &avatars, &folder, &|event| watch.see(event))?)
    }

    fn write_images(
        &self,
        Planned { plan, library, .. }: &Planned,
        records: &Records,
        context: Context,
    ) -> Result<()> {
        let watch = Watch::new(context.quiet);
        let folder = self.out.join("images");
        let avatars = self.out.join(AVATARS);
        let page = gallery::write(plan, library, records, &avatars, &folder, &|event| watch.see(event))?;
        write_text(&folder.join("README.md"), &page)
    }
}

/// Folder, inside the run's, of the avatars that it made.
const AVATARS: &str = "avatars";

/// The results stores of a run's folder, sorted.
pub(super) fn stores(folder: &Path) -> Result<Vec<PathBuf>> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let context = || format!("{}: cannot list the folder", folder.display());
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(context)? {
        let path = entry.with_context(context)?.path();
        // A pipe of such a name would be waited for.
        if path.extension().is_some_and(|e| e == "jsonl") && path.is_file() {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

/// Formats that each table is written in, in a file of its own.
const TABLE_FILES: [&str; 2] = ["csv", "latex"];

/// Every form of the tables.
pub(super) fn write_results(folder: &Path, results: &report::Results) -> Result<()> {
    write_text(&folder.join("tables.md"), &report::page(results))?;
    write_text(&folder.join("results.json"), &results.to_json())?;
    for table in &results.tables {
        for format in TABLE_FILES.iter().filter_map(|id| Format::named(id)) {
            let file = format!("{}.{}", table.experiment, format.extension);
            write_text(&folder.join(file), &(format.write)(&table.table))?;
        }
    }
    Ok(())
}

fn write_text(path: &Path, text: &str) -> Result<()> {
    Ok(atomic::write(path, |w| w.write_all(text.as_bytes()))?)
}

fn make_folder(folder: &Path) -> Result<()> {
    Ok(std::fs::create_dir_all(folder).map_err(|source| Error::Folder { path: folder.to_owned(), source })?)
}
