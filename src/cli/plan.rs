//! `reproduce plan`: what a run would do.

use super::Exit;
use super::output::{Format, emit, emit_json};
use super::planning::{Planned, Planning};
use anyhow::Result;
use skinsplat::experiment::{self, Shard, Slices};
use skinsplat::run::store;
use std::path::PathBuf;

/// Show what a run would do, without doing it.
///
/// Prints tables, avatars and frames, and how many of them the results store of --out has already.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Plan {
    #[command(flatten)]
    planning: Planning,
    /// Folder of the run
    #[arg(long, value_name = "DIR", default_value = super::run::DEFAULT_OUT)]
    out: PathBuf,
    /// Only this slice of the work
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// How to print the plan; JSON holds every avatar and every frame with its content key
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

const EXAMPLES: &str = "\
Examples:
  reproduce plan                              the six tables: rows, avatars, frames still to do
  reproduce plan table1 --data DIR            what a folder of subjects would give
  reproduce plan --profile paper --seeds 0,1,2";

impl Plan {
    pub(super) fn run(&self) -> Result<Exit> {
        let planned = self.planning.plan()?;
        let left_over: String = planned.left_over().iter().map(|note| format!("{note}\n")).collect();
        let Planned { plan, library, .. } = planned;
        match self.format {
            Format::Json => emit_json(&plan)?,
            Format::Text => {
                let broken = library.unreadable().map(|(dataset, own)| {
                    format!("cannot be loaded: {dataset}/{}: {}\n", own.subject, own.problem)
                });
                emit(&(self.text(&plan)? + &broken.collect::<String>() + &left_over))?;
            }
        }
        Ok(Exit::Success)
    }

    fn text(&self, plan: &experiment::Plan) -> Result<String> {
        let mut text = format!("plan {}\n", plan.digest);
        for (index, table) in plan.tables.iter().enumerate() {
            let without = table.rows.iter().filter(|row| row.missing.is_some()).count();
            let names: Vec<&str> = table.datasets.iter().map(|(_, title)| title.as_str()).collect();
            let frames = plan.jobs.iter().filter(|job| job.table == index).count();
            text += &format!(
                "{}: {} sequences{}, {} variants, {frames} frames, protocol {}, on {}\n",
                table.experiment,
                table.rows.len(),
                if without > 0 { format!(" ({without} of them not there)") } else { String::new() },
                table.variants.len(),
                table.protocol,
                if names.is_empty() { "no data".to_owned() } else { names.join(", ") },
            );
        }
        text += &self.shard.map_or_else(String::new, |shard| share(plan, shard));
        let records = store::merge(store::stores(&self.out)?.iter().map(PathBuf::as_path))?;
        let jobs = plan.shard(self.shard);
        let left = store::outstanding(&jobs, &records).len();
        text +=
            &format!("{} avatars\n{} frames, {left} of them still to do\n", plan.avatars.len(), jobs.len());
        Ok(text)
    }
}

/// How much of the work a slice is, and how much of it nobody can cut any further.
fn share(plan: &experiment::Plan, shard: Shard) -> String {
    let slices = Slices::of(plan, shard.count());
    let all = slices.loads().iter().sum::<u64>().max(1);
    let percent = |cost: u64| cost * 100 / all;
    let own = slices.loads().get(shard.index() - 1).copied().unwrap_or_default();
    let piece = percent(slices.largest_unit());
    format!("slice {shard}: {} % of the estimated work, {piece} % in one piece\n", percent(own))
}
