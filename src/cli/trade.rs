//! `reproduce trade`: what every choice costs, and how far it is from the exact answer.

use super::data::Data;
use super::output::{PageFormat, emit};
use super::products::make_folder;
use super::progress::Watch;
use super::{Context, Exit};
use anyhow::{Context as _, Result, bail};
use skinsplat::run::foreign::{OnBody, on_body};
use skinsplat_core::scene::Avatar;
use skinsplat_data::avatar::read_avatar;
use skinsplat_data::{Subject, atomic};
use skinsplat_fit::recipe::Placement;
use skinsplat_plot::{png, svg};
use skinsplat_study::trade::{self, Options, SWEEPS, Stage, Sweep, Trade, savings};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The subject that is measured unless another is named.
const DEFAULT_SUBJECT: &str = "synthetic/ring_stripes";

/// Measure what every choice costs and how far it is from the exact answer.
///
/// Solvers, influences, precision, strategies, colour, storage, splats, cut-offs, resolution, many avatars: everything is
/// measured in one run on one avatar, in the subject's test motion and in one whose joints are turned by nearly 180 degrees.
/// Then what leaving out the unneeded saves, on a built-in subject. Writes trade.md, trade.html, trade.csv, trade.json and a plot of time
/// against error per table and motion, and ends with a recommendation for offline scoring, real-time engines and browsers.
/// Times are of one thread: run it on an idle machine. Everything but times is the same from run to run.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Trading {
    /// How to print what was found
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t)]
    format: PageFormat,
    /// What to measure on: the ids of a data set and of a subject (see `reproduce list datasets`), or a subject's alone
    /// [default: a built-in subject, or the first of --data]
    #[arg(value_name = "DATASET/SUBJECT")]
    subject: Option<String>,
    /// The avatar to measure on the subject's body, whoever made it [default: made from the training frames]
    #[arg(long, value_name = "AVATAR")]
    avatar: Option<PathBuf>,
    /// How the avatar is made if none is given
    #[arg(long, value_enum, default_value_t, conflicts_with = "avatar")]
    recipe: Recipe,
    /// Only these tables (repeatable)
    #[arg(long = "only", value_name = "TABLE", value_parser = table)]
    only: Vec<&'static str>,
    /// A look in seconds: small images, few Gaussians, few repeats
    #[arg(long)]
    quick: bool,
    /// Folder to write to
    #[arg(long, value_name = "DIR", default_value = "runs/trade")]
    out: PathBuf,
    #[command(flatten)]
    data: Data,
}

/// How an avatar is made from training frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
enum Recipe {
    /// A Gaussian per vertex, with skinning weights.
    #[default]
    SurfaceVertex,
    /// A Gaussian per face, bound to it.
    SurfaceFace,
}

const EXAMPLES: &str = "\
Examples:
  reproduce trade                                    all tables on a built-in subject, in minutes
  reproduce trade --quick --only solver              one table, in seconds
  reproduce trade ava --data DIR --avatar ava.ply    a fitted avatar";

/// The id of a table.
fn table(id: &str) -> Result<&'static str, String> {
    let known: Vec<&str> = SWEEPS.into_iter().chain([savings::ID]).collect();
    let found = known.iter().find(|known| **known == id);
    found.copied().ok_or_else(|| format!("expected one of {}", known.join(", ")))
}

impl Trading {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        let (name, subject) = self.subject()?;
        let (subject, given) = match &self.avatar {
            Some(path) => {
                let (subject, avatar) = self.given(path, subject, context)?;
                (subject, Some(avatar))
            }
            None => (subject, None),
        };
        make_folder(&self.out)?;
        let watch = Watch::new(context.quiet);
        watch.start("avatar", 1);
        let stage = Stage::new(&name, &subject, given, &self.options());
        let stage = match &self.avatar {
            Some(path) => stage.with_context(|| format!("{}: cannot be measured", path.display()))?,
            None => stage?,
        };
        let is_wanted = |id: &str| self.only.is_empty() || self.only.contains(&id);
        let ids: Vec<&str> = SWEEPS.into_iter().filter(|id| is_wanted(id)).collect();
        watch.start("tables", ids.len() + usize::from(is_wanted(savings::ID)));
        let mut begun = 0;
        let sweeps = trade::measure(&stage, &ids, &mut |id| {
            watch.at(begun, id);
            begun += 1;
        })?;
        let mut result = Trade::new(&stage, &sweeps);
        if is_wanted(savings::ID) {
            watch.at(begun, savings::ID);
            result.sections.push(savings::section(&savings::measure(&self.savings())?));
        }
        drop(watch);
        let page = self.write(&result, &sweeps)?;
        emit(self.format.of(&page, &trade::json(&result)))?;
        Ok(Exit::Success)
    }

    /// The avatar of a file on the subject's body, and the subject with the body that it hangs on.
    fn given(&self, path: &Path, mut subject: Subject, context: Context) -> Result<(Subject, Avatar)> {
        let Some(body) = subject.sequences().next().map(|sequence| Arc::clone(&sequence.body)) else {
            bail!("{}: no sequence; expected one with a body for {}", subject.id, path.display());
        };
        let OnBody { avatar, body, mesh, mut notes } = on_body(read_avatar(path)?, &body)?;
        if let Some(body) = body.map(Arc::new) {
            let sequences = subject.train.iter_mut().chain(&mut subject.test).chain(&mut subject.val);
            sequences.for_each(|sequence| sequence.body = Arc::clone(&body));
        }
        if mesh.is_some() {
            notes.push("its mesh is left out: only Gaussians are measured".to_owned());
        }
        notes.iter().for_each(|note| context.note(format!("{}: {note}", path.display())));
        Ok((subject, avatar))
    }

    fn options(&self) -> Options {
        let options = if self.quick { Options::quick() } else { Options::standard() };
        let placement = match self.recipe {
            Recipe::SurfaceVertex => Placement::Vertices,
            Recipe::SurfaceFace => Placement::Faces,
        };
        Options { placement, ..options }
    }

    fn savings(&self) -> savings::Options {
        let options = savings::Options::default();
        if self.quick {
            savings::Options { resolution: 128, edge: 0.03, poses: 2, runs: 2, ..options }
        } else {
            options
        }
    }

    /// The subject and its full name.
    fn subject(&self) -> Result<(String, Subject)> {
        let named = match (&self.subject, self.data.is_given()) {
            (Some(subject), _) => subject.clone(),
            (None, false) => DEFAULT_SUBJECT.to_owned(),
            (None, true) => {
                let Some(first) = self.data.first_subject()? else {
                    bail!("--data: no subject; expected at least one")
                };
                first
            }
        };
        let (dataset, subject) = self.data.subject(&named)?;
        Ok((format!("{dataset}/{}", subject.id), subject))
    }

    /// Writes the pictures and the result in three formats; returns the page.
    fn write(&self, result: &Trade, sweeps: &[Sweep]) -> Result<String> {
        let save = |name: &str, bytes: &[u8]| atomic::write(&self.out.join(name), |w| w.write_all(bytes));
        let mut pictures = Vec::new();
        for sweep in sweeps {
            for motion in ["test", "extreme"] {
                let Some(plot) = trade::scatter(sweep, motion) else { continue };
                let name = format!("{}-{motion}", sweep.id);
                save(&format!("{name}.svg"), svg(&plot)?.as_bytes())?;
                save(&format!("{name}.png"), &png(&plot)?)?;
                pictures.push((sweep.id.to_owned(), format!("{name}.svg"), plot.title));
            }
        }
        let page = trade::markdown(result, &pictures);
        save("trade.csv", trade::csv(result).as_bytes())?;
        save("trade.json", trade::json(result).as_bytes())?;
        save("trade.html", trade::html(result, sweeps).as_bytes())?;
        save("trade.md", page.as_bytes())?;
        Ok(page)
    }
}
